//! Coils that are a little weaker than the best one, and shorter, lighter or cooler.

use super::model::{CoilModel, Window};
use super::near_optimal_bore::best_near;
use super::outcome::{Advantage, Alternative, BestCoil};
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
/// Relative difference of two coils that are one.
const SAME: f64 = 1e-3;

/// For each of length, mass and heat the coil of `best`'s wire that has least of it and lacks at
/// most [`SHARE`] of the force, to about 1e-4 and as far as a local search can say; none where the
/// force falls at once or where nothing is to be gained. Coils that hardly differ are one. All of them
/// have a bore that a bobbin allows; where the best has not, the strongest of those is the first.
///
/// # Errors
/// Interruption.
pub fn alternatives(
    model: &dyn CoilModel,
    task: &Task,
    best: &BestCoil,
    progress: &dyn Progress,
) -> Result<Vec<Alternative>, Interrupted> {
    let mut list: Vec<Alternative> = Vec::new();
    let task = &Task {
        bobbin: task.fixed.inner_diameter_m.is_none(),
        ..task.clone()
    };
    let bore_min_m = task.bore_min_m(&best.strand).unwrap_or(0.0);
    let windable = bore_min_m > 2.0 * best.window.inner_radius_m * (1.0 + SAME);
    if windable {
        let strongest = wound_on_a_bobbin(model, task, best);
        list.extend(strongest.map(|coil| Alternative::new(&coil, best, None)));
    }
    for (sought, coil) in reduced_coils(model, task, best, progress)? {
        let coil = Alternative::new(&coil, best, Some(sought));
        if !list.iter().any(|known| known.is_near(&coil, SAME)) {
            list.push(coil);
        }
    }
    if windable {
        list.iter_mut()
            .for_each(|coil| coil.better.insert(0, Advantage::Windable));
    }
    Ok(list)
}

/// The strongest coil within `task`, where it lacks at most [`SHARE`] of the force of `best`.
fn wound_on_a_bobbin(model: &dyn CoilModel, task: &Task, best: &BestCoil) -> Option<BestCoil> {
    let problem = of_regime(model, task, best)?;
    let local = best_near(&problem, &[Problem::coordinates(&best.window)])?;
    let coil = coil_of(&problem, &local, best)?;
    (coil.force_n >= best.force_n * (1.0 - SHARE)).then_some(coil)
}

/// The problem of `best`'s wire and regime.
fn of_regime<'a>(model: &'a dyn CoilModel, task: &'a Task, best: &BestCoil) -> Option<Problem<'a>> {
    Problem::of_wire(model, task, best.strand)
        .into_iter()
        .find(|problem| problem.regime == best.regime)
}

/// A local optimum of `problem` as a coil like `best`.
fn coil_of(problem: &Problem<'_>, local: &Local, best: &BestCoil) -> Option<BestCoil> {
    let window = Problem::window(local.x);
    let rated = problem.rate(window)?;
    Some(BestCoil {
        window,
        strand: best.strand,
        turns: best.strand.turns(&window),
        whole: None,
        regime: best.regime,
        force_n: (-local.point.objective).exp(),
        current_a: rated.current_a,
        mass_kg: rated.mass_kg,
        limits: Vec::new(),
    })
}

/// The coil that has least of each, where there is one.
fn reduced_coils(
    model: &dyn CoilModel,
    task: &Task,
    best: &BestCoil,
    progress: &dyn Progress,
) -> Result<Vec<(Advantage, BestCoil)>, Interrupted> {
    let mut list = Vec::new();
    for sought in Advantage::LESS {
        progress.check()?;
        if sought == Advantage::Shorter && task.fixed.length_m.is_some() {
            continue;
        }
        list.extend(least(model, task, best, sought).map(|coil| (sought, coil)));
    }
    Ok(list)
}

fn least(
    model: &dyn CoilModel,
    task: &Task,
    best: &BestCoil,
    sought: Advantage,
) -> Option<BestCoil> {
    let value = match sought {
        Advantage::Shorter => best.window.length_m,
        Advantage::Lighter => best.mass_kg,
        Advantage::Cooler => best.power_w(),
        Advantage::Windable => return None,
    };
    let enough = best.force_n.ln() + (-SHARE).ln_1p();
    let margin = |share: f64| {
        let found = under(model, task, best, sought, share * value);
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
    let (_, local) = under(model, task, best, sought, share * value)?;
    coil_of(&of_regime(model, task, best)?, &local, best)
}

/// The best coil that has `most` or less of what is `sought`.
fn under(
    model: &dyn CoilModel,
    task: &Task,
    best: &BestCoil,
    sought: Advantage,
    most: f64,
) -> Option<(Window, Local)> {
    let limits = &task.limits;
    let tighter = |limit: Option<f64>| Some(limit.map_or(most, |limit| limit.min(most)));
    let limits = match sought {
        Advantage::Shorter => Limits {
            length_max_m: tighter(limits.length_max_m),
            ..*limits
        },
        Advantage::Lighter => Limits {
            mass_max_kg: tighter(limits.mass_max_kg),
            ..*limits
        },
        Advantage::Cooler => Limits {
            power_max_w: tighter(limits.power_max_w),
            ..*limits
        },
        Advantage::Windable => *limits,
    };
    let task = Task {
        limits,
        ..task.clone()
    };
    let problem = of_regime(model, &task, best)?;
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
        let list = reduced_coils(&model, &task, &top, &Silent).expect("runs");
        let sought: Vec<Advantage> = list.iter().map(|(sought, _)| *sought).collect();
        assert_eq!(sought, Advantage::LESS);
        let volume = |window: &Window| window.volume_over_pi_m3().value;
        for (sought, found) in &list {
            let ratio = found.force_n / top.force_n;
            assert!((0.99..0.9903).contains(&ratio), "{found:?} {ratio}");
            let amount = match sought {
                Advantage::Shorter => found.window.length_m / top.window.length_m,
                Advantage::Lighter | Advantage::Cooler => {
                    volume(&found.window) / volume(&top.window)
                }
                Advantage::Windable => unreachable!("not of ALL"),
            };
            assert!(amount < 0.99, "{found:?} {amount}");
            // No coil with so little of it is stronger.
            let window = found.window;
            let tighter = match sought {
                Advantage::Shorter => Limits {
                    length_max_m: Some(window.length_m),
                    ..limits
                },
                Advantage::Lighter => Limits {
                    mass_max_kg: Some(volume(&window) * top.strand.mass_per_volume()),
                    ..limits
                },
                Advantage::Cooler => Limits {
                    power_max_w: Some(4.0 * volume(&window) * top.strand.resistance_per_volume()),
                    ..limits
                },
                Advantage::Windable => limits,
            };
            let ratio = best(tighter).force_n / found.force_n;
            assert!((ratio - 1.0).abs() < 1e-8, "{found:?} {ratio}");
        }
    }
}
