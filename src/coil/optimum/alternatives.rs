//! Coils that are a little weaker than the best one, and shorter, lighter or cooler.

use super::model::{CoilModel, Strand, Window};
use super::near_optimal_bore::best_near;
use super::outcome::BestCoil;
use super::problem::{Problem, Task};
use super::scalar;
use super::sqp::Local;
use fluxform_base::progress::{Interrupted, Progress};
use fluxform_design::Limits;

/// Share of the best force that is given up.
pub const SHARE: f64 = 0.01;
/// Factor between two steps that look for a coil too weak, their number, and the accuracy of
/// what is found between them.
const STEP: f64 = 0.97;
const STEPS: i32 = 40;
const TOLERANCE: f64 = 1e-4;

/// What is reduced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reduced {
    /// Length.
    Length,
    /// Mass of wire and core.
    Mass,
    /// Heat at the rated current.
    Power,
}

/// A coil that gives up [`SHARE`] of the force.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// For what.
    pub reduced: Reduced,
    /// Its section.
    pub window: Window,
    /// Its wire.
    pub strand: Strand,
    /// Turns, not rounded.
    pub turns: f64,
    /// |force|, N.
    pub force_n: f64,
    /// Rated current, A.
    pub current_a: f64,
}

/// For each of length, mass and heat the coil of `best`'s wire that has least of it and lacks at
/// most [`SHARE`] of the force, to about 1e-4 and as far as a local search goes; none where the
/// force falls at once or where nothing is to be gained.
///
/// # Errors
/// Interruption.
pub fn alternatives(
    model: &dyn CoilModel,
    task: &Task,
    best: &BestCoil,
    progress: &dyn Progress,
) -> Result<Vec<Alternative>, Interrupted> {
    let mut list = Vec::new();
    for reduced in [Reduced::Length, Reduced::Mass, Reduced::Power] {
        progress.check()?;
        if reduced == Reduced::Length && task.fixed.length_m.is_some() {
            continue;
        }
        list.extend(least(model, task, best, reduced));
    }
    Ok(list)
}

fn least(
    model: &dyn CoilModel,
    task: &Task,
    best: &BestCoil,
    reduced: Reduced,
) -> Option<Alternative> {
    let volume = best.window.volume_over_pi_m3().value;
    let resistance_ohm = volume * best.strand.resistance_per_volume();
    let core_kg = model
        .response(
            &best.window,
            best.strand.turns_per_m2(),
            best.current_a,
            false,
        )
        .ok()?
        .core_mass_kg
        .value;
    let value = match reduced {
        Reduced::Length => best.window.length_m,
        Reduced::Mass => volume * best.strand.mass_per_volume() + core_kg,
        Reduced::Power => best.current_a * best.current_a * resistance_ohm,
    };
    let enough = best.force_n.ln() + (-SHARE).ln_1p();
    let margin = |share: f64| {
        let found = under(model, task, best, reduced, share * value);
        found.map_or(-1.0, |(_, local)| -local.point.objective - enough)
    };
    let (mut inside, mut outside) = (1.0, None);
    for step in 1..=STEPS {
        let share = STEP.powi(step);
        if margin(share) < 0.0 {
            outside = Some(share);
            break;
        }
        inside = share;
    }
    let share = match outside {
        Some(outside) => scalar::root(margin, outside, inside, TOLERANCE)
            .map_or(inside, |share| (share + TOLERANCE).min(inside)),
        None => inside,
    };
    if share > 1.0 - 2.0 * TOLERANCE {
        return None;
    }
    let (window, local) = under(model, task, best, reduced, share * value)?;
    let regime = Problem::of_wire(model, task, best.strand)
        .into_iter()
        .find(|problem| problem.regime == best.regime)?;
    Some(Alternative {
        reduced,
        window,
        strand: best.strand,
        turns: best.strand.turns(&window),
        force_n: (-local.point.objective).exp(),
        current_a: regime.rate(window)?.current_a,
    })
}

/// The best coil of which `reduced` is at most `most`.
fn under(
    model: &dyn CoilModel,
    task: &Task,
    best: &BestCoil,
    reduced: Reduced,
    most: f64,
) -> Option<(Window, Local)> {
    let limits = &task.limits;
    let tighter = |limit: Option<f64>| Some(limit.map_or(most, |limit| limit.min(most)));
    let limits = match reduced {
        Reduced::Length => Limits {
            length_max_m: tighter(limits.length_max_m),
            ..*limits
        },
        Reduced::Mass => Limits {
            mass_max_kg: tighter(limits.mass_max_kg),
            ..*limits
        },
        Reduced::Power => Limits {
            power_max_w: tighter(limits.power_max_w),
            ..*limits
        },
    };
    let task = Task {
        limits,
        ..task.clone()
    };
    let problem = Problem::of_wire(model, &task, best.strand)
        .into_iter()
        .find(|problem| problem.regime == best.regime)?;
    let local = best_near(&problem, &[Problem::coordinates(&best.window)])?;
    Some((Problem::window(local.x), local))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::tests::{HEIGHT_M, air, quick, seed_limits, task};
    use crate::optimum::{Settings, optimise};
    use fluxform_base::progress::Silent;

    #[test]
    fn a_hundredth_of_the_force_buys_something_of_each() {
        let limits = Limits {
            settling_max_s: None,
            ..seed_limits()
        };
        let task = task(limits, None);
        let settings = Settings {
            starts: 4,
            cells: 0,
            ..quick()
        };
        let model = air(HEIGHT_M);
        let best = |limits| {
            let task = Task {
                limits,
                ..task.clone()
            };
            let outcome = optimise(&model, &task, &settings, &Silent).expect("runs");
            outcome.best.expect("optimal")
        };
        let top = best(limits);
        let list = alternatives(&model, &task, &top, &Silent).expect("runs");
        let reduced: Vec<Reduced> = list.iter().map(|found| found.reduced).collect();
        assert_eq!(reduced, [Reduced::Length, Reduced::Mass, Reduced::Power]);
        let volume = |window: &Window| window.volume_over_pi_m3().value;
        for found in &list {
            let ratio = found.force_n / top.force_n;
            assert!((0.99..0.9903).contains(&ratio), "{found:?} {ratio}");
            let amount = match found.reduced {
                Reduced::Length => found.window.length_m / top.window.length_m,
                Reduced::Mass | Reduced::Power => volume(&found.window) / volume(&top.window),
            };
            assert!(amount < 0.99, "{found:?} {amount}");
            // No coil with so little of it is stronger.
            let window = found.window;
            let tighter = match found.reduced {
                Reduced::Length => Limits {
                    length_max_m: Some(window.length_m),
                    ..limits
                },
                Reduced::Mass => Limits {
                    mass_max_kg: Some(volume(&window) * top.strand.mass_per_volume()),
                    ..limits
                },
                Reduced::Power => Limits {
                    power_max_w: Some(4.0 * volume(&window) * top.strand.resistance_per_volume()),
                    ..limits
                },
            };
            let ratio = best(tighter).force_n / found.force_n;
            assert!((ratio - 1.0).abs() < 1e-8, "{found:?} {ratio}");
        }
    }
}
