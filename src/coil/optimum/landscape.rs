//! Coils around the best one: the force and the limits over outer diameter and length, its bore kept.

use super::model::{CoilModel, Window};
use super::outcome::BestCoil;
use super::problem::{Problem, Rated, Regime, Task};
use crate::limits::LimitName;
use fluxform_base::progress::{Interrupted, Progress};

/// Values of either dimension.
const VALUES: usize = 33;
/// The dimensions go from these parts of the best coil's to these.
const SPAN: [f64; 2] = [0.4, 1.3];

/// Force and limits of coils with one bore and one wire.
#[derive(Debug, Clone, PartialEq)]
pub struct CoilLandscape {
    /// The bore, m.
    pub inner_diameter_m: f64,
    /// Outer diameters, m, ascending.
    pub outer_diameters_m: Vec<f64>,
    /// Lengths, m, ascending.
    pub lengths_m: Vec<f64>,
    /// |force| at the target, N, [length, outer diameter]; `None` where the model does not hold.
    pub forces_n: Vec<Option<f64>>,
    /// Limits, each with the part of it that every coil takes; NaN where there is no coil.
    pub limits: Vec<(LimitName, Vec<f64>)>,
}

/// Coils around `best`, of its wire and bore, at the current that driver and supply allow each.
///
/// # Errors
/// Interruption.
pub fn landscape(
    model: &dyn CoilModel,
    task: &Task,
    best: &BestCoil,
    progress: &dyn Progress,
) -> Result<CoilLandscape, Interrupted> {
    let problems = Problem::of_wire(model, task, best.strand);
    let [low, high] = SPAN;
    let spread = |least: f64, from: f64, to: f64| -> Vec<f64> {
        let from = from.max(least);
        let at = |k: usize| from + (to - from) * k as f64 / (VALUES - 1) as f64;
        (0..VALUES).map(at).collect()
    };
    let wire_m = best.strand.diameter_m;
    let inner_m = best.window.inner_radius_m;
    let depth_m = best.window.depth_m;
    let outer_radii_m = spread(
        inner_m + wire_m,
        inner_m + low * depth_m,
        inner_m + high * depth_m,
    );
    let length_m = best.window.length_m;
    let lengths_m = spread(wire_m, low * length_m, high * length_m);
    let named: Vec<LimitName> = problems[0].bounds.iter().map(|bound| bound.name).collect();
    let shown = named.into_iter().filter(|name| is_drawn(*name));
    let mut limits: Vec<(LimitName, Vec<f64>)> = shown.map(|name| (name, Vec::new())).collect();
    let mut forces_n = Vec::new();
    progress.begin("landscape", (VALUES * VALUES) as u64);
    for length_m in &lengths_m {
        progress.check()?;
        for outer_m in &outer_radii_m {
            let window = Window {
                inner_radius_m: inner_m,
                depth_m: outer_m - inner_m,
                length_m: *length_m,
            };
            let coil = rated(&problems, window);
            forces_n.push(coil.as_ref().map(|(_, coil)| coil.force_n.value));
            for (name, used) in &mut limits {
                let part = coil
                    .as_ref()
                    .and_then(|(problem, coil)| part(problem, coil, *name));
                used.push(part.unwrap_or(f64::NAN));
            }
        }
        progress.advance(VALUES as u64);
    }
    progress.end();
    Ok(CoilLandscape {
        inner_diameter_m: 2.0 * inner_m,
        outer_diameters_m: outer_radii_m.iter().map(|r| 2.0 * r).collect(),
        lengths_m,
        forces_n,
        limits,
    })
}

/// The coil at the driver's current, or, where the voltage does not suffice for it, at the supply's.
fn rated<'p, 'a>(problems: &'p [Problem<'a>], window: Window) -> Option<(&'p Problem<'a>, Rated)> {
    let at = |regime| {
        let problem = problems.iter().find(|problem| problem.regime == regime)?;
        Some((problem, problem.rate(window)?))
    };
    let driven = at(Regime::Driver);
    let enough = driven.as_ref().is_none_or(|(problem, coil)| {
        part(problem, coil, LimitName::Voltage).is_none_or(|part| part <= 1.0)
    });
    if enough {
        driven
    } else {
        at(Regime::Supply).or(driven)
    }
}

/// The part of a limit that a coil takes, 1 where it is just reached; `None` where it does not apply.
fn part(problem: &Problem<'_>, coil: &Rated, name: LimitName) -> Option<f64> {
    let at = problem.bounds.iter().position(|bound| bound.name == name)?;
    let (value, limit) = (coil.values[at].value, problem.bounds[at].limit);
    Some(if name.is_lower() {
        limit / value
    } else {
        value / limit
    })
}

/// Limits of the design; what follows from wire and supply, and the bore, which is kept, are not drawn.
fn is_drawn(name: LimitName) -> bool {
    let kept = matches!(
        name,
        LimitName::InnerDiameter
            | LimitName::Voltage
            | LimitName::Current
            | LimitName::OneLayer
            | LimitName::OneTurn
            | LimitName::Axis
            | LimitName::WindingFill
    );
    !kept && !name.is_equality()
}

#[cfg(test)]
mod tests {
    use fluxform_base::progress::Silent;

    use super::super::tests::{HEIGHT_M, air, seed_limits, solved, task};
    use super::*;

    /// No coil that meets the limits is stronger than the best, and the limits that hold it back run
    /// through it.
    #[test]
    fn the_best_coil_is_the_highest_place_within_the_limits() {
        for voltage_v in [None, Some(36.0), Some(9.0)] {
            let task = task(seed_limits(), voltage_v);
            let best = solved(&task).best.expect("a coil");
            let around = landscape(&air(HEIGHT_M), &task, &best, &Silent).expect("not stopped");
            let cells = around.forces_n.len();
            assert_eq!(cells, VALUES * VALUES);
            let met = |cell: usize| around.limits.iter().all(|(_, used)| used[cell] <= 1.0);
            let within = (0..cells).filter(|cell| met(*cell));
            let forces: Vec<f64> = within.filter_map(|cell| around.forces_n[cell]).collect();
            let highest = forces.iter().copied().fold(0.0, f64::max);
            assert!(
                forces.len() > 50 && forces.len() < cells,
                "{}",
                forces.len()
            );
            assert!(
                highest <= best.force_n * (1.0 + 1e-9),
                "{highest} {}",
                best.force_n
            );
            assert!(highest > 0.9 * best.force_n, "{highest} {}", best.force_n);
            for used in best
                .limits
                .iter()
                .filter(|used| used.active && is_drawn(used.name))
            {
                let (_, parts) = (around.limits.iter())
                    .find(|(name, _)| *name == used.name)
                    .expect("drawn");
                let [under, over] = [|part: &&f64| **part < 1.0, |part: &&f64| **part > 1.0]
                    .map(|side| parts.iter().filter(side).count());
                assert!(under > 0 && over > 0, "{:?}", used.name);
            }
        }
    }
}
