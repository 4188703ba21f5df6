//! Why no coil can be wound though coils of any turns exist: what the whole ones next to them break.

use super::best_bore::{Bores, summit};
use super::best_first::{least, whole};
use super::candidates::around_optimum;
use super::diagnosis;
use super::local_searches::Solved;
use super::model::Window;
use super::outcome::OptimumStatus;
use super::problem::Problem;

/// No coil can be wound: what breaks the limits least of the whole coils next to the best one of any turns, at any
/// bore, over all wires.
pub(super) fn status(open: &[&Solved<'_>]) -> OptimumStatus {
    let least = open.iter().filter_map(|solved| {
        let (miss, window) = least_next_to(solved)?;
        Some((miss, window, &solved.problem))
    });
    let least = least.min_by(|a, b| a.0.total_cmp(&b.0));
    least.map_or(
        OptimumStatus::Infeasible {
            violations: Vec::new(),
            least: Window {
                inner_radius_m: 0.0,
                depth_m: 0.0,
                length_m: 0.0,
            },
        },
        |(_, window, problem)| OptimumStatus::Infeasible {
            violations: diagnosis::violations(problem, window),
            least: window,
        },
    )
}

/// Of one problem's whole coils next to its continuous optimum that which breaks its limits least, and how much.
fn least_next_to(solved: &Solved<'_>) -> Option<(f64, Window)> {
    let problem = &solved.problem;
    let continuous = Problem::window(solved.best.as_ref()?.x);
    let wire_m = problem.strand.diameter_m;
    let domain = around_optimum(solved)?;
    let bores = Bores::of(problem);
    let around = |size_m: f64| whole(size_m / wire_m)..=least(size_m / wire_m);
    let mut best: Option<(f64, Window)> = None;
    for layers in around(continuous.depth_m) {
        for turns in around(continuous.length_m) {
            let window = |inner_m: f64| bores.window(layers, turns, inner_m);
            let depth_m = layers as f64 * wire_m;
            let low_m = domain.inner_m[0].max(domain.outer_m[0] - depth_m);
            let high_m = domain.inner_m[1].min(domain.outer_m[1] - depth_m);
            // Layers that do not fit are wound on the least bore.
            let high_m = high_m.max(low_m);
            let (inner_m, hit) = summit(|a| -diagnosis::miss(problem, window(a)), low_m, high_m);
            if hit.is_finite() && best.is_none_or(|(miss, _)| -hit < miss) {
                best = Some((-hit, window(inner_m)));
            }
        }
    }
    best
}
