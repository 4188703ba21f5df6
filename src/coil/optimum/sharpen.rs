//! From a coarse model's optimum to that of the sharp one: solve, sharpen there, solve again.

use super::model::CoilModel;
use super::problem::{Problem, Task};
use super::search::{Solved, best_of, keep_better};
use super::sequential;
use fluxform_base::progress::{Interrupted, Progress};

/// Most sharpenings.
const ROUNDS: usize = 8;
/// Movement, in scaled coordinates, below which the optimum stands: its force is second order in
/// it.
const STANDS: f64 = 1e-5;
/// Problems whose coarse optimum lacks more than this share of the best are not solved again.
const CLOSE: f64 = 0.01;
/// How much smaller, relatively, a second start is.
const SMALLER: f64 = 0.03;

/// Sharpens `model` about the best of `problems` until the optimum stands; `None` where the
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
                // A coil a little smaller besides: the sharp model's limits may be tighter.
                for less in [0.0, SMALLER] {
                    let start = local.x.map(|x| x - less);
                    if let Some(local) = sequential::solve(&solved.problem, start) {
                        solved.evaluations += local.evaluations;
                        keep_better(&solved.problem, &mut solved.best, local);
                    }
                }
            }
            solved
        })
        .collect()
}

fn best_x(problems: &[Solved<'_>]) -> Option<[f64; 3]> {
    Some(best_of(problems)?.best.as_ref()?.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::Settings;
    use crate::optimum::air::AirCoil;
    use crate::optimum::model::{NoResponse, Response, Window};
    use crate::optimum::search::solve_all;
    use crate::optimum::tests::{HEIGHT_M, air, quick, seed_limits, task};
    use fluxform_base::progress::Silent;
    use fluxform_design::Limits;

    /// What an air coil's ln F lacks, as a function of the length, is not known to the coarse
    /// model; to the sharp one as a straight line about one length; to the exact one throughout.
    enum Known {
        Nothing,
        About(f64),
        All,
    }

    struct Bent(AirCoil, Known);

    const BEND: f64 = 0.02;
    const MIDDLE_M: f64 = 0.02;

    impl CoilModel for Bent {
        fn response(
            &self,
            window: &Window,
            turns_per_m2: f64,
            current_a: f64,
            with_inductance: bool,
        ) -> Result<Response, NoResponse> {
            let mut response = self
                .0
                .response(window, turns_per_m2, current_a, with_inductance)?;
            let t = (window.length_m / MIDDLE_M).ln();
            let (ln, slope) = match self.1 {
                Known::Nothing => (0.0, 0.0),
                Known::About(p) => (-BEND * (2.0 * p * t - p * p), -2.0 * BEND * p),
                Known::All => (-BEND * t * t, -2.0 * BEND * t),
            };
            let mut force = response.force_n.times(ln.exp());
            force.slope[2] += force.value * slope / window.length_m;
            response.force_n = force;
            Ok(response)
        }

        fn relative_error(&self) -> f64 {
            self.0.relative_error()
        }

        fn length_scale_m(&self) -> f64 {
            self.0.length_scale_m()
        }

        fn sharpened(&self, window: &Window) -> Option<Box<dyn CoilModel>> {
            let about = Known::About((window.length_m / MIDDLE_M).ln());
            Some(Box::new(Self(self.0.clone(), about)))
        }
    }

    #[test]
    fn sharpening_goes_on_until_the_optimum_stands() {
        let limits = Limits {
            settling_max_s: None,
            length_max_m: None,
            ..seed_limits()
        };
        let task = task(limits, None);
        let settings = Settings {
            starts: 4,
            ..quick()
        };
        let [coarse, exact] = [Known::Nothing, Known::All].map(|known| Bent(air(HEIGHT_M), known));
        let Ok(wanted) = solve_all(&exact, &task, &settings, &Silent).expect("runs") else {
            panic!("bounded");
        };
        let Ok(found) = solve_all(&coarse, &task, &settings, &Silent).expect("runs") else {
            panic!("bounded");
        };
        let wanted = best_x(&wanted).expect("an optimum");
        let away = |x: [f64; 3]| (0..3).fold(0.0_f64, |s, i| s.max((x[i] - wanted[i]).abs()));
        let before = away(best_x(&found).expect("an optimum"));
        assert!(before > 0.01, "{before:e}");
        let sharp = sharpened(&coarse, &task, &found, &Silent).expect("runs");
        let sharp = sharp.expect("can be sharpened");
        let at = best_x(&restated(&*sharp, &task, &found)).expect("an optimum");
        // A single sharpening ends 3e-5 away.
        assert!(away(at) < STANDS, "{:e}", away(at));
    }
}
