//! The whole of eq. 9 and 10 for one object: precision, path, criteria, certificate.

use std::cell::Cell;

use fluxform_base::accuracy::StageAccuracy;
use fluxform_base::force_constant::{Criterion, ForceConstants};
use fluxform_base::units::DETECTION_THRESHOLD_N;
use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::certificate;
use super::criteria::Comparison;
use super::followed::{Extent, Precision, Solved, solve_paths};
use super::homotopy::{Piece, Trace};
use super::path::Path;
use super::problem::{ForceProblem, ProblemError, Settings};
use super::qr_reduction::{largest_entries, times_power};
use super::worst;

/// Share of lambda^2 mean(h^2) by which the currents' error may be above e*, or the path is wrong.
const AGREES: f64 = 1e-8;
/// A bound on rounding, relative to `lambda^2 mean(h^2)`, above which what is proven at the chosen force constant says
/// more: it counts the first breakpoints, where currents of nearly dependent columns are huge for next to no force.
const ROUGH: f64 = 1e-9;
/// Parts of the chosen force constant at which e* shows how small e_0 is.
const NEAR_ZERO: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];
/// How far a solution may be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The path is exact.
    Solved,
    /// All heights are zero: no force is requested, no limit binds.
    NothingWanted,
    /// No current within the limits' signs brings the force nearer to the requested one.
    NothingRendered,
    /// The path could not be followed to its end, so that numbers beyond its last breakpoint are not the
    /// minimum, or the error of its currents is not the path's.
    Stalled,
}

/// Currents at one force constant and what they are worth.
#[derive(Debug, Clone, PartialEq)]
pub struct OperatingPoint {
    /// Force constant, N/m.
    pub lambda_n_per_m: f64,
    /// Currents, A.
    pub currents_a: Vec<f64>,
    /// Root of the mean square error e*, N.
    pub rms_error_n: f64,
    /// The same relative to lambda rms(h); `None` where that is zero.
    pub relative_rms_error: Option<f64>,
    /// Largest error at a point, N.
    pub worst_error_n: f64,
    /// Proof of optimality: the mean square error at these currents is at most this far above its minimum, N^2.
    pub duality_gap_n2: f64,
}

/// The path, the force constants and the currents of one object.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Force constants that eq. 10 reads off the path.
    pub constants: ForceConstants,
    /// The points that decide maxmin: no currents within the limits give all of them more.
    pub maxmin_points: Vec<usize>,
    /// The force constant that the criterion chooses, with its currents.
    pub chosen: Option<OperatingPoint>,
    /// The same at the additional force constant.
    pub at: Option<OperatingPoint>,
    /// Number of independent columns of forces.
    pub rank: usize,
    /// e* and the currents anywhere.
    pub path: Path,
    /// How far to trust it.
    pub status: Status,
    /// The arithmetic used.
    pub precision: Precision,
    /// Estimated error of e*.
    pub accuracy: StageAccuracy,
}

/// Solves eq. 9 and 10: the exact path of e*(lambda), the force constants on it, and the
/// currents at the chosen one.
///
/// The points are reduced in doubles where their columns are well conditioned, in
/// double-double where they are not; what was used is reported. The small problem that
/// remains is always followed in double-double. The result does not depend on the number
/// of threads.
///
/// # Errors
/// Where the problem is malformed: lists of the wrong length, numbers that are not finite,
/// limits of the wrong sign, a coil that is 1e-20 of the strongest one.
pub fn solve(problem: &ForceProblem, settings: &Settings) -> Result<Solution, ProblemError> {
    problem.validate(settings)?;
    let largest = largest_entries(problem);
    problem.comparable(&largest)?;
    let (solved, rank, precision) = solve_paths(problem, &largest, Extent::Whole);
    let mut path = solved.path(problem);
    if rank < solved.reduced.counted() && solved.doubt == 0.0 {
        path = path.with_least_power(problem, &solved.reduced, &solved.limited);
    }
    let finish = match precision {
        Precision::Double => finish::<f64>,
        Precision::DoubleDouble => finish::<Num>,
    };
    Ok(finish(
        problem, &largest, settings, &solved, path, rank, precision,
    ))
}

/// The chosen force constant alone, N/m, as [`solve`] has it.
///
/// # Errors
/// As [`solve`].
pub fn constant(problem: &ForceProblem, settings: &Settings) -> Result<Option<f64>, ProblemError> {
    problem.validate(settings)?;
    let largest = largest_entries(problem);
    problem.comparable(&largest)?;
    let (solved, rank, _) = solve_paths(problem, &largest, Extent::of(settings));
    let comparison = solved.comparison();
    let status = status(&solved, &comparison);
    if status == Status::NothingRendered {
        return Ok(None);
    }
    let (linear, jnd) = first_and_jnd(settings, &solved, &comparison, rank);
    let lambda = match settings.criterion {
        Criterion::Linear => linear,
        Criterion::Jnd => jnd,
        Criterion::Saturation => {
            let path = solved.path(problem);
            path.last_turn().or(linear.filter(|&lambda| lambda == 0.0))
        }
        Criterion::Maxmin => worst::largest(problem, &largest).map(|most| most.lambda_n_per_m),
    };
    if lambda.is_none() && status == Status::Stalled {
        return Err(ProblemError::Unfollowed);
    }
    Ok(lambda)
}

/// The root of the mean square error at a force constant above zero, relative to that of the requested force, as
/// [`solve`] has it; `None` where no force is requested or rendered.
///
/// # Errors
/// As [`solve`].
pub fn relative_error(
    problem: &ForceProblem,
    lambda_n_per_m: f64,
) -> Result<Option<f64>, ProblemError> {
    problem.validate(&Settings::default())?;
    let largest = largest_entries(problem);
    problem.comparable(&largest)?;
    let (solved, _, _) = solve_paths(problem, &largest, Extent::Whole);
    if status(&solved, &solved.comparison()) != Status::Solved {
        return Ok(None);
    }
    let path = solved.path(problem);
    let requested_n = lambda_n_per_m * problem.rms_height_m();
    Ok(Some(path.error_n2(lambda_n_per_m).sqrt() / requested_n))
}

/// lambda_linear and lambda_jnd, N/m, off the two paths; null where no height is above zero.
fn first_and_jnd(
    settings: &Settings,
    solved: &Solved,
    comparison: &Comparison<'_>,
    rank: usize,
) -> (Option<f64>, Option<f64>) {
    let linear = solved.linear(comparison, rank);
    let jnd = match linear {
        None => None,
        Some(lambda) if settings.jnd_weight == 0.0 => Some(lambda),
        Some(_) => comparison.jnd(settings.jnd_weight),
    };
    let si = |lambda: Num| times_power(lambda.to_f64(), solved.reduced.lambda_scale);
    (linear.map(si), jnd.map(si))
}

/// How far the result can be relied on.
fn status(solved: &Solved, comparison: &Comparison<'_>) -> Status {
    let unmoved = |trace: &Trace| {
        let all = |piece: &Piece| piece.x.iter().chain(&piece.x_rate).all(|&x| x == Num::ZERO);
        trace.pieces.iter().all(all)
    };
    if !solved.reliable() {
        Status::Stalled
    } else if comparison.mean_square <= Num::ZERO {
        Status::NothingWanted
    } else if unmoved(&solved.unlimited) {
        Status::NothingRendered
    } else {
        Status::Solved
    }
}

/// Reads the force constants off the path and evaluates currents in the precision `T`.
fn finish<T: Real>(
    problem: &ForceProblem,
    largest: &[f64],
    settings: &Settings,
    solved: &Solved,
    path: Path,
    rank: usize,
    precision: Precision,
) -> Solution {
    let comparison = solved.comparison();
    let (linear, jnd) = first_and_jnd(settings, solved, &comparison, rank);
    let saturation = path.last_turn().or(linear.filter(|&lambda| lambda == 0.0));
    let status = status(solved, &comparison);
    let heights = problem.height_m.iter();
    let lowest = heights.fold(f64::INFINITY, |least, h| least.min(*h));
    let rms_height_m = comparison.mean_square.sqrt().to_f64() * solved.reduced.height_unit_m();
    let agrees = Cell::new(true);
    let given = |lambda: f64, currents_a: Vec<f64>, error_n2: Option<f64>| {
        let check = certificate::check::<T>(problem, lambda, &currents_a);
        let scale = lambda * rms_height_m;
        let error_n2 = error_n2.unwrap_or(check.mean_square_n2);
        let rms_error_n = error_n2.sqrt();
        if check.mean_square_n2 - error_n2 > AGREES * (scale * scale + error_n2) {
            agrees.set(false);
        }
        OperatingPoint {
            lambda_n_per_m: lambda,
            currents_a,
            rms_error_n,
            relative_rms_error: (scale > 0.0).then(|| rms_error_n / scale),
            worst_error_n: check.worst_n,
            duality_gap_n2: check.gap_n2,
        }
    };
    let evaluate =
        |lambda: f64| given(lambda, path.currents_a(lambda), Some(path.error_n2(lambda)));
    let maxmin = worst::largest(problem, largest).filter(|_| status != Status::NothingRendered);
    let constants = ForceConstants {
        lambda_linear_n_per_m: linear,
        lambda_jnd_n_per_m: jnd,
        lambda_saturation_n_per_m: saturation,
        lambda_maxmin_n_per_m: maxmin.as_ref().map(|maxmin| maxmin.lambda_n_per_m),
        lambda_floor_n_per_m: (lowest > 0.0).then(|| DETECTION_THRESHOLD_N / lowest),
    };
    let chosen = match (&maxmin, settings.criterion) {
        // These currents are not those of the path.
        (Some(maxmin), Criterion::Maxmin) => {
            let currents_a = maxmin.currents_a.clone();
            Some(given(maxmin.lambda_n_per_m, currents_a, None))
        }
        (_, criterion) => constants.of(criterion).map(evaluate),
    };
    let at = settings.at_n_per_m.map(evaluate);
    let accuracy = accuracy_of::<T>(problem, settings, solved, &path, chosen.as_ref());
    let gap = |at: f64| evaluate(at).duality_gap_n2 / (at * rms_height_m).powi(2);
    let optimal = |lambda: Option<f64>| lambda.is_none_or(|at| gap(at) <= ROUGH);
    let is_harmless = || harmless(settings, solved, &accuracy) && optimal(saturation);
    let status = match status {
        Status::Stalled if is_harmless() => Status::Solved,
        status => status,
    };
    Solution {
        constants,
        maxmin_points: maxmin.map_or_else(Vec::new, |maxmin| {
            maxmin.active.iter().map(|active| active.point).collect()
        }),
        chosen,
        at,
        rank,
        status: if agrees.get() {
            status
        } else {
            Status::Stalled
        },
        precision,
        accuracy,
        path,
    }
}

/// Whether a flaw of the path does not matter where its end is right: `accuracy` is what is proven at lambda_jnd.
fn harmless(settings: &Settings, solved: &Solved, accuracy: &StageAccuracy) -> bool {
    let followed = solved.limited.complete && solved.unlimited.complete;
    followed && settings.criterion == Criterion::Jnd && accuracy.estimate <= ROUGH
}

/// The error of e*: the bound on the path's, or where that is rough what is proven of e* - e_0 at lambda_jnd, the
/// duality gap and all of e_0, which without an offset is no larger a part than e* of any currents at any lambda.
fn accuracy_of<T: Real>(
    problem: &ForceProblem,
    settings: &Settings,
    solved: &Solved,
    path: &Path,
    chosen: Option<&OperatingPoint>,
) -> StageAccuracy {
    let relative_to = "lambda^2 mean(h^2)".to_owned();
    let bound = StageAccuracy {
        estimate: solved.error + 4.0 * f64::EPSILON + solved.flaw * solved.flaw,
        relative_to: relative_to.clone(),
        method: "first-order rounding bound of the QR, optimality conditions at every breakpoint"
            .to_owned(),
    };
    let rough = bound.estimate > ROUGH || !solved.reliable();
    let proportional = settings.criterion == Criterion::Jnd && problem.offset_n.is_none();
    let Some(jnd) = chosen.filter(|at| rough && proportional && at.lambda_n_per_m > 0.0) else {
        return bound;
    };
    let square = |lambda: f64| (lambda * problem.rms_height_m()).powi(2);
    let least = NEAR_ZERO.map(|part| {
        let lambda = part * jnd.lambda_n_per_m;
        let check = certificate::check::<T>(problem, lambda, &path.fitting_a(lambda));
        check.mean_square_n2 / square(lambda)
    });
    let gap = jnd.duality_gap_n2 / square(jnd.lambda_n_per_m);
    let estimate = gap + least.into_iter().fold(1.0, f64::min);
    if estimate > bound.estimate && solved.reliable() {
        return bound;
    }
    StageAccuracy {
        estimate,
        relative_to,
        method: "duality gap at lambda_jnd, and how small e* is at a part of it".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_whose_currents_have_another_error_is_not_solved() {
        let problem = ForceProblem {
            forces_n_per_a: &[0.13, 0.0, 0.05, 0.07, 0.0, 0.11],
            height_m: &[0.05, 0.05, 0.05],
            offset_n: None,
            weights: None,
            lower_a: &[0.0, 0.0],
            upper_a: &[2.0, 1.3],
            total_max_a: None,
            resistance_ohm: &[6.0, 6.0],
        };
        let largest = largest_entries(&problem);
        let (mut solved, rank, precision) = solve_paths(&problem, &largest, Extent::Whole);
        for (share, status) in [(1.0, Status::Solved), (0.9, Status::Stalled)] {
            for piece in &mut solved.limited.pieces {
                let residuals = piece.residual.iter_mut().chain(&mut piece.residual_rate);
                residuals.for_each(|residual| *residual = *residual * Num::of(share));
            }
            let path = solved.path(&problem);
            let settings = Settings {
                at_n_per_m: Some(1.0),
                ..Settings::default()
            };
            let finished = finish::<Num>(
                &problem, &largest, &settings, &solved, path, rank, precision,
            );
            assert_eq!(finished.status, status, "{share}");
        }
    }
}
