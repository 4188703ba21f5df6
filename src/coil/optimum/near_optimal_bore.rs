//! The flat valley: bores that cost next to no force, all else re-optimised.

use super::domain::Domain;
use super::local_searches::{Solved, keep_better};
use super::model::Window;
use super::outcome::Valley;
use super::problem::{Fixed, LimitName, Problem, Task};
use super::scalar;
use super::sqp::{self, FEASIBLE, Local};
use fluxform_base::progress::{Interrupted, Progress};

/// Share of the best force that a coil in the valley may lack.
pub const SHARE: f64 = 1e-3;
/// Relative accuracy of the valley's ends.
const TOLERANCE: f64 = 1e-6;
/// Steps that look for a bore outside the valley.
const STEPS: i32 = 12;

/// Inner diameters of coils within [`SHARE`] of the best force; `None` where the bore is given.
pub(super) fn valley(
    solved: &Solved<'_>,
    progress: &dyn Progress,
) -> Result<Option<Valley>, Interrupted> {
    let problem = &solved.problem;
    let Some(best) = &solved.best else {
        return Ok(None);
    };
    if problem.task.fixed.inner_diameter_m.is_some() {
        return Ok(None);
    }
    let window = Problem::window(best.x);
    let enough = -best.point.objective + (-SHARE).ln_1p();
    let margin = |inner_m: f64| best_ln_at(problem, &window, inner_m) - enough;
    let domain = Domain::of(problem);
    let at = window.inner_radius_m;
    let size = window.outer_radius_m();
    let lowest = problem
        .limit_of(LimitName::InnerDiameter)
        .map_or(0.0, |v| 0.5 * v);
    let highest = (domain.outer_m[1] - domain.depth_min_m).min(at + 64.0 * size);
    let mut ends = [at, at];
    for (end, limit) in ends.iter_mut().zip([lowest, highest]) {
        let mut inside = at;
        let mut outside = None;
        for step in 1..=STEPS {
            progress.check()?;
            // Towards the limit in growing steps.
            let share = (f64::from(step) / f64::from(STEPS)).powi(3);
            let bore = at + share * (limit - at);
            if margin(bore) < 0.0 {
                outside = Some(bore);
                break;
            }
            inside = bore;
        }
        *end = match outside {
            Some(outside) => scalar::root(
                margin,
                inside.min(outside),
                inside.max(outside),
                TOLERANCE * size,
            )
            .unwrap_or(inside),
            None => limit,
        };
    }
    Ok(Some(Valley {
        force_share: SHARE,
        inner_diameter_m: ends.map(|radius| 2.0 * radius),
    }))
}

/// ln of the best force of a coil whose bore has the radius `inner_m`.
fn best_ln_at(problem: &Problem<'_>, near: &Window, inner_m: f64) -> f64 {
    let task = Task {
        fixed: Fixed {
            inner_diameter_m: Some(2.0 * inner_m),
            ..problem.task.fixed
        },
        ..problem.task.clone()
    };
    let fixed = problem.with_task(&task);
    let outer = near.outer_radius_m();
    let starts = [outer - inner_m, near.depth_m].map(|depth_m| {
        Problem::coordinates(&Window {
            inner_radius_m: inner_m,
            depth_m: depth_m.max(problem.strand.diameter_m),
            length_m: near.length_m,
        })
    });
    best_near(&fixed, &starts).map_or(f64::NEG_INFINITY, |local| -local.point.objective)
}

/// The best coil of `problem` that local searches from `starts` find.
pub(super) fn best_near(problem: &Problem<'_>, starts: &[[f64; 3]]) -> Option<Local> {
    // The settling time is costly to know and often holds nothing back.
    if let Some(relaxed) = problem.without(&[LimitName::Settling])
        && let Some(local) = best_from(&relaxed, starts)
        && let Some(adopted) = problem.adopted(&relaxed, &local)
        && adopted.violation(problem) <= FEASIBLE
    {
        return Some(adopted);
    }
    best_from(problem, starts)
}

fn best_from(problem: &Problem<'_>, starts: &[[f64; 3]]) -> Option<Local> {
    let mut best = None;
    for &start in starts {
        if let Some(local) = sqp::solve(problem, start) {
            keep_better(problem, &mut best, local);
        }
    }
    best
}
