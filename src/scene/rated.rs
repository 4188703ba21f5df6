//! One coil alone at its rated current: what `evaluate` tells of it and a sweep tabulates.

use std::collections::BTreeMap;

use super::Scene;
use super::single::{Single, TargetForce};
use crate::RunError;
use crate::accuracy::missed;
use crate::coil::circuit::Circuit;
use crate::coil::limits::{self, Evaluated, LimitCheck};
use crate::units::STEEL_DENSITY_KG_PER_M3;

/// One coil alone at its rated current, SI.
pub(crate) struct Rated {
    /// The coil with its core.
    pub single: Single,
    /// Its circuit, the core's part of the inductance included.
    pub circuit: Circuit,
    /// The rated current, A.
    pub current_a: f64,
    /// Heat, W.
    pub power_w: f64,
    /// Mass of wire and core, kg.
    pub mass_kg: f64,
    /// What the magnet feels at the target.
    pub force: TargetForce,
    /// The design's limits by name.
    pub limits: BTreeMap<&'static str, LimitCheck>,
    /// What misses the tolerance.
    pub accuracy_missed: Vec<String>,
}

impl Rated {
    /// Computes the coil of `scene` alone.
    ///
    /// # Errors
    /// A target on the winding's edge or in the steel; steel that cannot be solved.
    pub(crate) fn new(scene: &Scene, tolerance: Option<f64>) -> Result<Self, RunError> {
        let current_a = scene.rated_current_a();
        let mut single = Single::new(scene, tolerance)?;
        let mut circuit = scene.circuit;
        circuit.inductance_h = single.inductance_h;
        let power_w = circuit.power_w(current_a);
        let steel_kg = scene
            .core
            .as_ref()
            .map_or(0.0, |core| core.shape.volume_m3() * STEEL_DENSITY_KG_PER_M3);
        let mass_kg = circuit.wire_mass_kg + steel_kg;
        let force = single.force(scene, current_a)?;
        let limits = limits::check(&Evaluated {
            design: scene.design,
            circuit: &circuit,
            power_w,
            mass_kg,
            core_field_t: single.core.as_ref().map(|core| core.peak_field_t),
        });
        Ok(Self {
            accuracy_missed: missed(&single.accuracy, single.tolerance),
            single,
            circuit,
            current_a,
            power_w,
            mass_kg,
            force,
            limits,
        })
    }
}
