//! The whole of eq. 9 and 10 for one object: precision, path, criteria, certificate.

use std::cell::Cell;

use fluxform_base::accuracy::StageAccuracy;
use fluxform_base::force_constant::{Criterion, ForceConstants};
use fluxform_base::units::DETECTION_THRESHOLD_N;
use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::certificate;
use super::criteria::{Comparison, VISIBLE};
use super::exact_start::exact_start;
use super::homotopy::{Bounds, Follower, Piece, Trace};
use super::model::Model;
use super::path::Path;
use super::problem::{ForceProblem, ProblemError, Settings};
use super::qr_reduction::{Reduced, counted_coils, largest_entries, times_power};
use super::rest;
use super::worst;

/// Above this condition number of the coils' columns doubles do not decide.
const PLAIN_CONDITION: f64 = 1e3;
/// Up to this condition number, found in doubles, no column depends on others within rounding.
const INDEPENDENT: f64 = 1e10;
/// Error of e*, relative to lambda^2 mean(h^2), up to which doubles are enough.
const PLAIN_ERROR: f64 = 2e-14;
/// Share of a column outside the span of others that is weak: currents within the limits do little with it. Where the
/// best error is of the order of the least share, multipliers are of its square and rounding over it: this is above the
/// third root of rounding.
const WEAK: f64 = 1e-8;
/// The same for lambda_jnd alone.
const WEAK_FOR_JND: f64 = 1e-6;
/// Change of e* at lambda_jnd, relative to the excess there, that leaves lambda_jnd alone.
const SMALL: f64 = 1e-6;
/// Change of e*, relative to lambda^2 mean(h^2), up to which dependences are taken as exact.
const SHOWN: f64 = 1e-11;
/// Share of lambda^2 mean(h^2) by which the currents' error may be above e*, or the path is wrong.
const AGREES: f64 = 1e-8;
/// A bound on rounding, relative to `lambda^2 mean(h^2)`, above which what is proven at the chosen force constant says
/// more: it counts the first breakpoints, where currents of nearly dependent columns are huge for next to no force.
const ROUGH: f64 = 1e-9;
/// Parts of the chosen force constant at which e* shows how small e_0 is.
const NEAR_ZERO: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];
/// Largest relative violation of optimality that is taken for rounding: its square counts.
const FLAW: f64 = 1e-8;

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

/// The arithmetic in which the points were reduced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 53 bits.
    Double,
    /// About 105 bits.
    DoubleDouble,
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

/// How much of the path is needed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Extent {
    /// All of it.
    Whole,
    /// Up to lambda_jnd of this weight above zero, if there is no offset: beyond, the path comes to rest.
    ToJnd(f64),
}

impl Extent {
    /// What the chosen constant needs.
    pub fn of(settings: &Settings) -> Self {
        match settings.criterion {
            Criterion::Jnd if settings.jnd_weight > 0.0 => Self::ToJnd(settings.jnd_weight),
            _ => Self::Whole,
        }
    }

    /// The share of `lambda^2` beyond which e* is not needed.
    fn most_error(self, unlimited: &Piece, heights: &[Num]) -> Option<Num> {
        let square = |v: &[Num]| Num::dot(v, v);
        match self {
            Self::Whole => None,
            Self::ToJnd(weight) => {
                let share = Num::of(weight) * Num::of(weight);
                Some(square(&unlimited.residual_rate) + share * square(heights))
            }
        }
    }
}

/// Both paths of one reduced problem.
pub(super) struct Solved {
    pub reduced: Reduced,
    model: Model,
    bounds: Bounds,
    /// The bounds of `unlimited`.
    free_bounds: Bounds,
    pub limited: Trace,
    pub unlimited: Trace,
    /// Rounding in e*, relative to `lambda^2 mean(h^2)`.
    error: f64,
    flaw: f64,
    /// Share of `lambda^2 mean(h^2)` up to which e* may be off since weak parts are left out.
    doubt: f64,
}

/// The path without the drivers' size.
struct Unlimited {
    bounds: Bounds,
    trace: Trace,
    /// Rounding in e* on it, relative to `lambda^2 mean(h^2)`.
    error: f64,
}

impl Unlimited {
    fn new(problem: &ForceProblem, reduced: &Reduced) -> Self {
        let (model, bounds) = reduced.unlimited(problem);
        let follower = Follower {
            model: &model,
            bounds: &bounds,
            start: None,
            most_error: None,
        };
        let trace = follower.path(reduced.offset().as_deref(), reduced.heights());
        let error = rounding(&model, &trace, reduced.heights());
        Self {
            bounds,
            trace,
            error,
        }
    }
}

impl Solved {
    fn new(problem: &ForceProblem, extent: Extent, reduced: Reduced) -> Self {
        let unlimited = Unlimited::new(problem, &reduced);
        Self::with(problem, extent, reduced, unlimited)
    }

    fn with(problem: &ForceProblem, extent: Extent, reduced: Reduced, free: Unlimited) -> Self {
        let offset = reduced.offset();
        let heights = reduced.heights();
        let (model, bounds) = reduced.limited(problem);
        let unlimited = &free.trace.pieces[0];
        let most_error = extent.most_error(unlimited, heights);
        let rate = &unlimited.residual_rate;
        let follower = Follower {
            model: &model,
            bounds: &bounds,
            start: exact_start(problem, &reduced, (&model, &bounds), rate),
            most_error: most_error.filter(|_| offset.is_none()),
        };
        let mut limited = follower.path(offset.as_deref(), heights);
        let mut error = rounding(&model, &limited, heights).max(free.error);
        if limited.complete && rest::bring_to_rest(&mut limited, offset.as_deref(), heights) {
            error += rest::COST;
        }
        Self {
            model,
            bounds,
            free_bounds: free.bounds,
            error,
            flaw: limited.flaw.max(free.trace.flaw),
            doubt: 0.0,
            limited,
            unlimited: free.trace,
            reduced,
        }
    }

    /// e* and e_0 side by side.
    pub fn comparison(&self) -> Comparison<'_> {
        let heights = self.reduced.heights();
        Comparison {
            limited: &self.limited,
            unlimited: &self.unlimited,
            mean_square: Num::dot(heights, heights),
            visible: VISIBLE.max(self.doubt),
        }
    }

    /// The limited path in SI units.
    pub fn path(&self, problem: &ForceProblem) -> Path {
        let Self {
            reduced,
            bounds,
            limited,
            ..
        } = self;
        Path::new(problem, reduced, bounds, limited, self.doubt)
    }

    pub fn reliable(&self) -> bool {
        self.limited.complete && self.unlimited.complete && self.flaw <= FLAW
    }

    /// Bound on the change of e*, relative to `lambda^2 mean(h^2)`, where the fit of any currents within the limits
    /// moves by no more than `moved`, in its unit.
    fn change(&self, moved: Num) -> f64 {
        let heights = self.reduced.heights();
        let height = Num::dot(heights, heights).sqrt();
        let change = |piece: &Piece| {
            let error = Num::dot(&piece.residual, &piece.residual).sqrt();
            let requested = piece.start * height;
            ((error + error + moved) * moved / (requested * requested)).to_f64()
        };
        let pieces = self.limited.pieces.iter();
        let changes = pieces.filter(|piece| piece.start > Num::ZERO).map(change);
        changes.fold(0.0, f64::max)
    }
}

/// First-order effect of the columns' rounding on e*, at the breakpoints: the residual times
/// the sum of all columns' contributions, and a margin for the sums over points.
fn rounding(model: &Model, trace: &Trace, heights: &[Num]) -> f64 {
    let size = Num::dot(heights, heights).sqrt();
    let mut worst = 1.0_f64;
    for piece in &trace.pieces {
        // On the first piece everything grows with lambda: its rates will do.
        let (x, residual, requested) = if piece.start > Num::ZERO {
            (&piece.x, &piece.residual, piece.start * size)
        } else {
            (&piece.x_rate, &piece.residual_rate, size)
        };
        if requested > Num::ZERO {
            let moved = x
                .iter()
                .zip(&model.norm)
                .fold(Num::ZERO, |s, (&x, &n)| s + x.abs() * n);
            let share =
                Num::dot(residual, residual).sqrt() / requested * (moved / requested + Num::ONE);
            worst = worst.max(share.to_f64());
        }
    }
    20.0 * model.epsilon * worst
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

/// Both paths, the number of independent columns, and the arithmetic of their reduction.
pub(super) fn solve_paths(
    problem: &ForceProblem,
    largest: &[f64],
    extent: Extent,
) -> (Solved, usize, Precision) {
    let counted = counted_coils(problem, largest);
    let mut condition = None;
    if problem.points() >= counted.len() && counted.iter().all(|&coil| largest[coil] > 0.0) {
        let reduced = Reduced::new::<f64>(problem, largest);
        let plain = reduced.condition();
        condition = Some(plain).filter(|&condition| condition <= INDEPENDENT);
        if plain <= PLAIN_CONDITION
            && let Some(solved) = solve_plainly(problem, extent, reduced)
        {
            return (solved, counted.len(), Precision::Double);
        }
    }
    let reduced = condition
        .and_then(|condition| Reduced::by_products(problem, largest, condition))
        .unwrap_or_else(|| Reduced::new::<Num>(problem, largest));
    let (solved, rank) = match condition {
        Some(_) => (Solved::new(problem, extent, reduced), counted.len()),
        None => solve_dependent(problem, extent, reduced),
    };
    (solved, rank, Precision::DoubleDouble)
}

/// From the reduction in doubles; `None` where that is not enough.
fn solve_plainly(problem: &ForceProblem, extent: Extent, reduced: Reduced) -> Option<Solved> {
    let free = Unlimited::new(problem, &reduced);
    if free.error > PLAIN_ERROR {
        return None;
    }
    let solved = Solved::with(problem, extent, reduced, free);
    (solved.reliable() && solved.error <= PLAIN_ERROR).then_some(solved)
}

/// Where columns may depend on each other: dependences that lie within the rounding of the forces are
/// taken as exact, provided that this does not show in e*. With the number of independent columns.
fn solve_dependent(problem: &ForceProblem, extent: Extent, reduced: Reduced) -> (Solved, usize) {
    let clean = reduced.with_clean_dependences();
    let exact = match &clean {
        Some(clean) => (&clean.reduced, clean.rank),
        None => (&reduced, reduced.counted()),
    };
    if let Some(solved) = solve_strong(problem, extent, &reduced, exact) {
        return (solved, exact.1);
    }
    let clean = clean.map(|clean| {
        let moved = clean.most_moved(problem);
        let mut solved = Solved::new(problem, extent, clean.reduced);
        let change = solved.change(moved);
        solved.error += change;
        (solved, clean.rank, change)
    });
    let clean = clean.filter(|(clean, _, _)| clean.reliable());
    match clean {
        Some((clean, rank, change)) if change <= SHOWN => (clean, rank),
        clean => {
            let literal = Solved::new(problem, extent, reduced);
            match clean.filter(|_| !literal.reliable()) {
                Some((clean, rank, _)) => (clean, rank),
                None => {
                    let rank = literal.reduced.rank();
                    (literal, rank)
                }
            }
        }
    }
}

/// Without the weak parts of columns, which add hundreds of breakpoints, decided by rounding where the force can be
/// rendered all but exactly: they count for e_0 only, whose currents have no limit. `exact` has the given number of
/// independent columns. `None` where a bound does not say that this is enough.
fn solve_strong(
    problem: &ForceProblem,
    extent: Extent,
    reduced: &Reduced,
    (exact, rank): (&Reduced, usize),
) -> Option<Solved> {
    let share = match extent {
        Extent::Whole => WEAK,
        Extent::ToJnd(_) => WEAK_FOR_JND,
    };
    // The path over few points is straight as long as the force is exact.
    if problem.points() < reduced.counted() || problem.offset_n.is_some() {
        return None;
    }
    let strong = reduced.without_weak_parts(share)?;
    if strong.rank == rank {
        return None;
    }
    let moved = strong.most_moved(problem);
    let length = |v: &[Num]| Num::dot(v, v).sqrt();
    let heights = strong.reduced.heights();
    let (height, weak) = (length(heights), length(&heights[strong.rank..]));
    // No path changes that.
    if matches!(extent, Extent::Whole) && weak * weak > Num::of(SHOWN) * height * height {
        return None;
    }
    let free = Unlimited::new(problem, exact);
    let mut solved = Solved::with(problem, extent, strong.reduced, free);
    // The change is largest at the first breakpoint; lambda_jnd lies on the last piece but that of rest.
    let pieces = &solved.limited.pieces;
    let start = |place: usize| pieces.get(place).map(|piece| piece.start);
    let (change, most) = match extent {
        Extent::Whole => {
            let requested = start(1)? * height;
            let share = weak / height + moved / requested;
            (share * share, SHOWN)
        }
        Extent::ToJnd(weight) => {
            let requested = start(pieces.len().saturating_sub(2).max(1))? * height;
            let share = moved / requested;
            let change = (Num::of(2.0) * weak / height + share) * share;
            (change, SMALL * weight * weight)
        }
    };
    let change = change.to_f64();
    solved.error += change;
    solved.doubt = change;
    (solved.reliable() && change <= most).then_some(solved)
}

/// lambda_linear and lambda_jnd, N/m, off the two paths; null where no height is above zero.
fn first_and_jnd(
    settings: &Settings,
    solved: &Solved,
    comparison: &Comparison<'_>,
    rank: usize,
) -> (Option<f64>, Option<f64>) {
    let linear = if comparison.mean_square <= Num::ZERO {
        None
    } else if rank == solved.reduced.counted() {
        comparison.linear(&solved.model, &solved.bounds, &solved.free_bounds)
    } else {
        comparison.linear_by_error()
    };
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
    let is_harmless = || harmless(settings, solved, &accuracy, [jnd, saturation], gap);
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

/// Whether a flaw of the path does not matter: `gap` proves the currents at lambda_jnd and saturation to be optimal.
fn harmless(
    settings: &Settings,
    solved: &Solved,
    accuracy: &StageAccuracy,
    [jnd, saturation]: [Option<f64>; 2],
    gap: impl Fn(f64) -> f64,
) -> bool {
    let optimal = |lambda: Option<f64>| lambda.is_none_or(|at| gap(at) <= ROUGH);
    let followed = solved.limited.complete && solved.unlimited.complete;
    let by_proof = settings.criterion == Criterion::Jnd && accuracy.estimate <= ROUGH;
    followed && by_proof && jnd.is_some() && optimal(jnd) && optimal(saturation)
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
        let check = certificate::check::<T>(problem, lambda, &path.currents_a(lambda));
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

    /// Dipoles 10 mm apart under points 200 mm above: what is left out of nearly dependent columns changes e* by no more
    /// than is said, and lambda_jnd not at all.
    #[test]
    fn weak_parts_of_columns_leave_the_force_alone() {
        let (side, samples, height) = (7, 9, 0.2_f64);
        let force = |i: usize, j: usize| {
            let middle = |k: usize, of: usize| k as f64 - 0.5 * (of as f64 - 1.0);
            let apart = |a: usize, b: usize| 0.01 * (middle(a, side) - middle(b, samples));
            let flat = apart(i % side, j % samples).powi(2) + apart(i / side, j / samples).powi(2);
            1e-5 * height * (2.0 * height.powi(2) - 3.0 * flat) / (flat + height.powi(2)).powf(3.5)
        };
        let (coils, points) = (side * side, samples * samples);
        let forces: Vec<f64> = (0..points)
            .flat_map(|j| (0..coils).map(move |i| force(i, j)))
            .collect();
        let all = |value: f64| vec![value; coils];
        // What uneven currents give, so that limits alone leave an error.
        let heights: Vec<f64> = (forces.chunks_exact(coils))
            .map(|row| {
                let currents = (0..coils).map(|i| 1.0 + 0.5 * (i as f64).sin());
                row.iter().zip(currents).map(|(f, i)| f * i).sum::<f64>()
            })
            .collect();
        let problem = ForceProblem {
            forces_n_per_a: &forces,
            height_m: &heights,
            offset_n: None,
            weights: None,
            lower_a: &all(0.0),
            upper_a: &all(2.0),
            total_max_a: None,
            resistance_ohm: &all(6.1),
        };
        let weight = Settings::default().jnd_weight;
        let reduced = Reduced::new::<Num>(&problem, &largest_entries(&problem));
        let (exact, rank) = match reduced.with_clean_dependences() {
            Some(clean) => (clean.reduced, clean.rank),
            None => (reduced.clone(), coils),
        };
        let literal = Solved::new(&problem, Extent::Whole, exact.clone());
        let jnd = |solved: &Solved| solved.comparison().jnd(weight).unwrap().to_f64();
        let e = |solved: &Solved, lambda: Num| {
            let pieces = &solved.limited.pieces;
            let later = pieces.partition_point(|piece| piece.start <= lambda);
            let residual = pieces[later - 1].residual_at(lambda);
            Num::dot(&residual, &residual)
        };
        for extent in [Extent::Whole, Extent::ToJnd(weight)] {
            let strong = solve_strong(&problem, extent, &reduced, (&exact, rank)).unwrap();
            assert!(strong.reduced.heights().len() < rank && strong.doubt > 0.0);
            assert!((jnd(&strong) / jnd(&literal) - 1.0).abs() < 1e-9);
            let until = match extent {
                Extent::Whole => 3.0,
                Extent::ToJnd(_) => 1.0,
            };
            for k in 1..40 {
                let lambda = Num::of(until * jnd(&literal) * f64::from(k) / 40.0);
                let requested = lambda * lambda * literal.comparison().mean_square;
                let off = ((e(&strong, lambda) - e(&literal, lambda)) / requested).to_f64();
                let known = match extent {
                    Extent::Whole => strong.doubt,
                    Extent::ToJnd(weight) => SMALL * weight * weight,
                };
                assert!(off.abs() <= known, "{k}: {off:e} {known:e}");
            }
        }
    }
}
