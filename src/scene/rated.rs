//! One coil alone at its rated current: what `evaluate` reports, `optimize` writes of its best coil
//! and a sweep tabulates.

use std::collections::BTreeMap;

use serde::Serialize;

use super::Scene;
use super::core_material::SceneCore;
use super::single::{CoreSummary, Single, TargetSummary};
use crate::RunError;
use crate::accuracy::{StageAccuracy, missed, missed_in_core, missed_of_force};
use crate::coil::circuit::{Circuit, CoilSize};
use crate::coil::limits::{self, Evaluated, LimitCheck, UsedPower};
use crate::coil::mutual::{largest_self_inductance_h, slowest_inductance_h};
use crate::design::Supply;

/// One coil alone at its rated current, SI.
pub(crate) struct Rated {
    /// Dimensions, turns and circuit.
    pub coil: CoilSummary,
    /// Field and force at the target.
    pub target: TargetSummary,
    /// The steel; `None` for air coils.
    pub core: Option<CoreSummary>,
    /// The permeability that the transient estimate uses.
    pub relative_permeability: f64,
    /// The design's limits by name.
    pub limits: BTreeMap<&'static str, LimitCheck>,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// The stages that miss the tolerance.
    pub accuracy_missed: Vec<String>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// A coil and its circuit, SI.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CoilSummary {
    /// Its dimensions.
    #[serde(flatten)]
    pub size: CoilSize,
    /// Number of turns.
    pub turns: f64,
    /// Circuit and mass.
    #[serde(flatten)]
    pub circuit: CircuitSummary,
}

/// Circuit, mass and heat of a coil, SI.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CircuitSummary {
    /// Resistance at the wire's temperature, ohm.
    pub resistance_ohm: f64,
    /// Self inductance, H; with a B-H curve the flux linkage over the rated current.
    pub inductance_h: f64,
    /// Flux linkage at the rated current, Wb; with a B-H curve.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flux_linkage_wb: Option<f64>,
    /// L/R, s.
    pub time_constant_s: f64,
    /// Five time constants, s.
    pub settling_s: f64,
    /// Length of wire, m.
    pub wire_length_m: f64,
    /// Mass of wire and core, kg.
    pub mass_kg: f64,
    /// Heat at the rated current, W.
    pub power_w: f64,
}

impl CircuitSummary {
    /// Time until a step to `current_a` has settled, s: [`Circuit::settling_under_s`].
    pub(crate) fn settling_under_s(&self, supply: &Supply, current_a: f64) -> f64 {
        let circuit = Circuit {
            resistance_ohm: self.resistance_ohm,
            inductance_h: self.inductance_h,
            ..Circuit::default()
        };
        circuit.settling_under_s(supply, current_a)
    }
}

impl Rated {
    /// Computes the coil of `scene` alone.
    ///
    /// # Errors
    /// A target on the winding's edge or in the steel; steel that cannot be solved.
    pub(crate) fn new(scene: &Scene) -> Result<Self, RunError> {
        let current_a = scene.rated_current_a();
        let mut single = Single::new(scene)?;
        let circuit = Circuit {
            inductance_h: single.inductance_h,
            ..scene.circuit
        };
        let power_w = circuit.power_w(current_a);
        let steel_kg = scene.core.as_ref().map_or(0.0, SceneCore::mass_kg);
        let mass_kg = circuit.wire_mass_kg + steel_kg;
        let target = single.target(scene, current_a)?;
        let mut accuracy_missed = missed(&single.accuracy, single.tolerance);
        accuracy_missed.extend(missed_in_core(
            &single.accuracy,
            scene.tolerances.core_field,
        ));
        accuracy_missed.extend(missed_of_force(
            &single.accuracy,
            scene.tolerances.coil_force,
        ));
        let mut rated = Self {
            coil: CoilSummary {
                size: CoilSize::from(&scene.coil),
                turns: circuit.turns,
                circuit: CircuitSummary {
                    resistance_ohm: circuit.resistance_ohm,
                    inductance_h: circuit.inductance_h,
                    flux_linkage_wb: single.flux_linkage_wb,
                    time_constant_s: circuit.time_constant_s(),
                    settling_s: circuit.settling_s(),
                    wire_length_m: circuit.wire_length_m,
                    mass_kg,
                    power_w,
                },
            },
            target,
            relative_permeability: single.relative_permeability,
            core: single.core,
            limits: BTreeMap::new(),
            accuracy_missed,
            accuracy: single.accuracy,
            warnings: single.warnings,
        };
        // A coil alone is its own array.
        let alone = [vec![circuit.inductance_h]];
        rated.check_limits(scene, (scene.coils.len() == 1).then_some(&alone));
        Ok(rated)
    }

    /// Checks the design's limits; `inductances_h` is the array's matrix, where that is known. With a plate or
    /// other bodies of steel a coil's inductance is that among them.
    pub(crate) fn check_limits(&mut self, scene: &Scene, inductances_h: Option<&[Vec<f64>]>) {
        let summary = &self.coil.circuit;
        let among_steel = inductances_h.filter(|_| scene.design.has_iron());
        let array_inductance_h = inductances_h.map(slowest_inductance_h);
        self.limits = limits::check(&Evaluated {
            design: scene.design,
            circuit: &Circuit {
                inductance_h: among_steel.map_or(summary.inductance_h, largest_self_inductance_h),
                ..scene.circuit
            },
            power_w: summary.power_w,
            mass_kg: summary.mass_kg,
            core_field_t: self.core.as_ref().map(|core| core.peak_field_t),
            array_inductance_h,
            used: UsedPower::default(),
        });
    }
}
