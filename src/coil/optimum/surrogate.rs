//! From a coarse model's optimum to that of the sharp one: solve, sharpen there, solve again.

use super::local_searches::{Solved, best_of, keep_better};
use super::model::CoilModel;
use super::problem::{Problem, Task};
use super::sqp;
use fluxform_base::progress::{Interrupted, Progress};

/// Most sharpenings.
const ROUNDS: usize = 8;
/// Movement, in scaled coordinates, below which the optimum is taken as found: its force is second order in
/// it.
pub(super) const STANDS: f64 = 1e-5;
/// Problems whose coarse optimum lacks more than this share of the best are not solved again.
const CLOSE: f64 = 0.01;
/// How much smaller, relatively, a second start is.
const SMALLER: f64 = 0.03;

/// Sharpens `model` about the best of `problems` until the optimum no longer moves; `None` where the
/// model cannot be sharpened.
///
/// # Errors
/// Interruption.
pub(super) fn sharpened(
    model: &dyn CoilModel,
    task: &Task,
    problems: &[Solved<'_>],
    progress: &dyn Progress,
) -> Result<Option<Box<dyn CoilModel>>, Interrupted> {
    let Some(mut at) = best_x(problems) else {
        return Ok(None);
    };
    let mut sharp: Option<Box<dyn CoilModel>> = None;
    for _ in 0..ROUNDS {
        progress.check()?;
        let now = sharp.as_deref().unwrap_or(model);
        let Some(next) = now.sharpened(&Problem::window(at)) else {
            break;
        };
        let moved = best_x(&restated(&*next, task, problems));
        sharp = Some(next);
        let Some(moved) = moved else { break };
        let step = (0..3).fold(0.0_f64, |s, i| s.max((moved[i] - at[i]).abs()));
        at = moved;
        if step < STANDS {
            break;
        }
    }
    Ok(sharp)
}

/// `problems` under another model, solved from their optima. Optima that lack too much to
/// matter are kept as the coarse model gave them.
pub(super) fn restated<'a>(
    model: &'a dyn CoilModel,
    task: &'a Task,
    problems: &[Solved<'_>],
) -> Vec<Solved<'a>> {
    let best_n = best_of(problems).and_then(Solved::force_n).unwrap_or(0.0);
    let all = task
        .strands
        .iter()
        .flat_map(|&strand| Problem::of_wire(model, task, strand));
    all.zip(problems)
        .map(|(problem, coarse)| {
            let mut solved = Solved {
                problem,
                best: None,
                contradiction: coarse.contradiction.clone(),
                missing: coarse.missing.clone(),
                evaluations: coarse.evaluations,
                starts: coarse.starts,
            };
            let close = coarse
                .force_n()
                .is_some_and(|n| n >= best_n * (1.0 - CLOSE));
            if !close {
                solved.best = coarse.best.clone();
            } else if let Some(local) = &coarse.best {
                // Also a coil a little smaller: the sharp model's limits may be tighter.
                for less in [0.0, SMALLER] {
                    let start = local.x.map(|x| x - less);
                    if let Some(local) = sqp::solve(&solved.problem, start) {
                        solved.evaluations += local.evaluations;
                        keep_better(&solved.problem, &mut solved.best, local);
                    }
                }
            }
            solved
        })
        .collect()
}

pub(super) fn best_x(problems: &[Solved<'_>]) -> Option<[f64; 3]> {
    Some(best_of(problems)?.best.as_ref()?.x)
}
