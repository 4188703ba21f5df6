//! The numbers of a coil by which the best one is compared with the design's own, on screen and page.

use super::result::{Objective, Optimization};
use crate::coil::circuit::CoilSize;
use crate::report::limits::label;
use crate::report::number::force;
use crate::scene::rated::CircuitSummary;

/// A coil alone, the best one or the given one.
pub(super) struct ComparedCoil {
    force_n: f64,
    size: CoilSize,
    turns: f64,
    wire_diameter_m: f64,
    circuit: CircuitSummary,
}

/// A number of a coil: its name in artefacts, from which its label and unit follow, and its value, SI.
pub(super) type Property = (&'static str, fn(&ComparedCoil) -> f64);

pub(super) const PROPERTIES: [Property; 12] = [
    ("force_n", |of| of.force_n),
    ("inner_diameter_m", |of| of.size.inner_diameter_m),
    ("outer_diameter_m", |of| of.size.outer_diameter_m),
    ("length_m", |of| of.size.length_m),
    ("turns", |of| of.turns),
    ("wire_diameter_m", |of| of.wire_diameter_m),
    ("resistance_ohm", |of| of.circuit.resistance_ohm),
    ("inductance_h", |of| of.circuit.inductance_h),
    ("settling_s", |of| of.circuit.settling_s),
    ("wire_length_m", |of| of.circuit.wire_length_m),
    ("mass_kg", |of| of.circuit.mass_kg),
    ("power_w", |of| of.circuit.power_w),
];

/// The label of a number: limits may bound another settling, that among neighbours or of a driver's loop.
pub(super) fn name((key, _): Property) -> String {
    match key {
        "settling_s" => format!("{}, 5 L/R", label(key)),
        key => label(key),
    }
}

/// What the force of the best coil leaves out, in words: its neighbours in what is compared, the pull of its core in all.
pub(super) fn beside_the_force(objective: &Objective) -> Vec<String> {
    let alone = objective.alone_force_n.map(|alone| {
        format!(
            "among its neighbours' cores; {} alone, as in the table below",
            force(alone.abs())
        )
    });
    let pull = objective
        .passive_force_n
        .map(|pull| format!("also, the unpowered steel pulls with {}", force(pull)));
    alone.into_iter().chain(pull).collect()
}

impl Optimization {
    /// The best coil and the design's own, where there are such.
    pub(super) fn compared(&self) -> Option<(ComparedCoil, Option<ComparedCoil>)> {
        let (coil, objective) = (self.coil.as_ref()?, self.objective.as_ref()?);
        let best = ComparedCoil {
            force_n: objective.alone_force_n.unwrap_or(objective.force_n),
            size: coil.size,
            turns: coil.turns,
            wire_diameter_m: coil.wire_diameter_m,
            circuit: coil.circuit,
        };
        let given = self.given.as_ref().map(|given| ComparedCoil {
            force_n: given.force_n,
            size: given.coil.size,
            turns: given.coil.turns,
            wire_diameter_m: given.wire_diameter_m,
            circuit: given.coil.circuit,
        });
        Some((best, given))
    }
}
