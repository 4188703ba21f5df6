//! The start of a path over fewer points than coils.
//!
//! Up to lambda_linear many currents give the force that is requested exactly, and any of them are a path.
//! One that keeps as few of them moving as it can stops at limits after small steps, hundreds of times for 81
//! coils over 9 points. So the path goes straight to currents just below lambda_linear, which the linear
//! program of the worst point names: the least largest error is zero up to the same lambda.

use std::cell::OnceCell;

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::basis::{Basis, Target};
use super::homotopy::{Bounds, ExactStart};
use super::model::Model;
use super::pivoted::Pivoted;
use super::problem::ForceProblem;
use super::qr_reduction::{Reduced, times_power};
use super::worst;

/// Errors relative to the requested force up to which there is none.
const EXACT: f64 = 1e-26;
/// Share by which the sum stays below its limit, and lambda below lambda_linear.
const ROOM: f64 = 1e-9;
/// Currents that differ from a limit by a smaller share of their range are at it.
const AT_LIMIT: f64 = 1e-12;

/// A force constant just below lambda_linear, N/m, and currents, A, that give its force exactly, once they are
/// solved for.
pub(super) type NearLinear = OnceCell<Option<(f64, Vec<f64>)>>;

/// A start near lambda_linear; `None` where the forces requested are not within the limits' signs, or rounding
/// keeps the currents from being exact. `residual_rate` is that without the drivers' size.
pub(super) fn exact_start(
    problem: &ForceProblem,
    reduced: &Reduced,
    (model, bounds): (&Model, &Bounds),
    residual_rate: &[Num],
    near_linear: &NearLinear,
) -> Option<ExactStart> {
    let heights = reduced.heights();
    let few = problem.points() < problem.coils() && problem.offset_n.is_none();
    if !few || Num::dot(heights, heights) <= Num::ZERO || !is_nothing(residual_rate, heights) {
        return None;
    }
    // Room for the slack.
    let narrowed = ForceProblem {
        total_max_a: problem.total_max_a.map(|total| total * (1.0 - ROOM)),
        ..*problem
    };
    let near_linear = near_linear.get_or_init(|| worst::without_error(&narrowed, 1.0 - ROOM));
    let (lambda_n_per_m, currents_a) = near_linear.as_ref()?;
    let lambda = Num::of(times_power(*lambda_n_per_m, -reduced.lambda_scale));
    if lambda <= Num::ZERO {
        return None;
    }
    let mut open = Vec::new();
    let mut x = Vec::with_capacity(model.count());
    for (i, &ampere) in currents_a.iter().enumerate() {
        let value = Num::of(times_power(ampere, reduced.current_scale(i)));
        let (lower, upper) = (bounds.lower[i]?, bounds.upper[i]?);
        let near = Num::of(AT_LIMIT) * (upper - lower);
        x.push(if value - lower <= near {
            lower
        } else if upper - value <= near {
            upper
        } else {
            open.push(i);
            value
        });
    }
    // Of a limit on the sum the slack takes what the coils leave.
    let columns = open.iter().map(|&i| model.column(i).to_vec()).collect();
    let independent = Pivoted::new(columns, open.len(), 0.0).members;
    let mut moving: Vec<usize> = independent.into_iter().map(|k| open[k]).collect();
    if model.weight.is_some() {
        moving.push(x.len());
        x.push(Num::ZERO);
    }
    let mut basis = Basis::new(model, Target::along(heights));
    basis.set(&moving);
    let moves: Vec<usize> = basis.moving().collect();
    let still = (0..x.len()).filter(|i| !moves.contains(i));
    let fixed: Vec<(usize, Num)> = still.map(|i| (i, x[i])).collect();
    let exact = basis.values(lambda, bounds.total, &fixed);
    let (x, residual) = (exact.x, exact.residual);
    let within = |i: usize| {
        bounds.lower[i].is_none_or(|lower| x[i] >= lower)
            && bounds.upper[i].is_none_or(|upper| x[i] <= upper)
    };
    let target: Vec<Num> = heights.iter().map(|&h| lambda * h).collect();
    (is_nothing(&residual, &target) && (0..x.len()).all(within)).then_some(ExactStart { lambda, x })
}

fn is_nothing(residual: &[Num], requested: &[Num]) -> bool {
    let square = |v: &[Num]| Num::dot(v, v);
    square(residual) <= Num::of(EXACT * EXACT) * square(requested)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::followed::{Extent, solve_paths};
    use crate::qr_reduction::largest_entries;

    /// Dipoles 10 mm apart under 3 x 3 points: from limit to limit the path up to lambda_linear has hundreds of pieces.
    #[test]
    fn a_path_over_few_points_is_straight_up_to_lambda_linear() {
        let side = 9;
        let place = |k: usize| 0.01 * (k as f64 - 0.5 * (side as f64 - 1.0));
        let force = |i: usize, j: usize| {
            let along = |a: usize, b: usize| place(a) - 0.05 * (b as f64 - 1.0);
            let flat = along(i % side, j % 3).powi(2) + along(i / side, j / 3).powi(2);
            let z = 0.06_f64;
            1.0e-6 * z * (2.0 * z * z - 3.0 * flat) / (flat + z * z).powf(3.5)
        };
        let coils = side * side;
        let forces: Vec<f64> = (0..9)
            .flat_map(|j| (0..coils).map(move |i| force(i, j)))
            .collect();
        let all = |value: f64| vec![value; coils];
        for total_max_a in [None, Some(40.0)] {
            let problem = ForceProblem {
                forces_n_per_a: &forces,
                height_m: &[0.03; 9],
                offset_n: None,
                weights: None,
                lower_a: &all(0.0),
                upper_a: &all(2.0),
                total_max_a,
                resistance_ohm: &all(6.1),
            };
            let (solved, rank, _) =
                solve_paths(&problem, &largest_entries(&problem), Extent::Whole);
            assert_eq!(rank, 9);
            assert!(solved.reliable());
            let exact = (solved.limited.pieces.iter())
                .take_while(|piece| is_nothing(&piece.residual_rate, solved.reduced.heights()));
            let exact: Vec<Num> = exact.map(|piece| piece.start).collect();
            assert!((2..5).contains(&exact.len()), "{} pieces", exact.len());
            let linear = solved.limited.pieces[exact.len()].start;
            let short = ((linear - exact[1]) / linear).to_f64();
            assert!((0.0..1e-7).contains(&short), "{short:e}");
        }
    }
}
