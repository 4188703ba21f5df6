//! `evaluate`: one coil as given, and the array's inductances.

pub(crate) mod command;

use std::collections::BTreeMap;

use serde::Serialize;

use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::coil::limits::LimitCheck;
use crate::coil::transient::{VoltageStep, core_energy_share};
use crate::design::Design;
use crate::scene::Scene;
use crate::scene::neighbours::{self, ArrayFacts};
use crate::scene::rated::Rated;
use crate::scene::single::{CoreFacts, Single};

/// What `evaluate` tells; all SI.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Evaluation {
    /// Layout of the artefact.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Name of the design.
    pub design: String,
    /// What went in.
    pub inputs: Vec<Input>,
    /// The coil and its circuit.
    pub coil: CoilFacts,
    /// What it does at the target.
    pub target: TargetFacts,
    /// The steel; absent for air coils.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub core: Option<CoreFacts>,
    /// Current and force after a voltage step; absent for air coils.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transient: Option<TransientFacts>,
    /// Limits by name.
    pub limits: BTreeMap<&'static str, LimitCheck>,
    /// The array; absent for a single coil.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub array: Option<ArrayFacts>,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Whether the tolerance asked for was reached.
    pub accuracy_reached: bool,
    /// What misses it.
    #[serde(skip)]
    pub accuracy_missed: Vec<String>,
    /// Warnings for the user.
    #[serde(skip)]
    pub notes: Vec<String>,
}

/// The coil and its circuit.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct CoilFacts {
    /// Inner diameter, m.
    pub inner_diameter_m: f64,
    /// Outer diameter, m.
    pub outer_diameter_m: f64,
    /// Length, m.
    pub length_m: f64,
    /// Number of turns.
    pub turns: f64,
    /// Resistance at the wire's temperature, ohm.
    pub resistance_ohm: f64,
    /// Self inductance, H; with a B-H curve the flux linkage over the rated current.
    pub inductance_h: f64,
    /// Flux linkage at the rated current, Wb; told with a B-H curve.
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

/// Field and force at the target.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct TargetFacts {
    /// Height of the magnet's centre, m.
    pub height_m: f64,
    /// The rated current: the largest of the drivers' limits, or the supply's V/R, A.
    pub current_a: f64,
    /// dB_z/dz on the axis, T/m/A.
    pub gradient_t_per_m_per_a: f64,
    /// B_z on the axis, T/A.
    pub field_t_per_a: f64,
    /// Upward force at the rated current, N; the unpowered steel's pull included where the
    /// design asks for it.
    pub force_n: f64,
    /// Force vector at the rated current, N, as `force_n`.
    pub force_vector_n: [f64; 3],
    /// Torque on the magnet about its centre at the rated current, N m, the steel's pull left out.
    pub torque_n_m: [f64; 3],
    /// Upward force of the unpowered steel, N; told where the design asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passive_force_n: Option<f64>,
}

/// After a voltage step, with eddy currents in the solid core.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct TransientFacts {
    /// Time until the current reaches 95 % of its final value, s.
    pub current_95_s: f64,
    /// Time until the force does, s.
    pub force_95_s: f64,
}

impl Evaluation {
    /// Whether every limit is met.
    #[must_use]
    pub fn limits_met(&self) -> bool {
        self.limits.values().all(|check| check.met)
    }
}

/// Evaluates the coil of `design` alone, and the array's inductance matrix.
///
/// # Errors
/// A design that cannot be computed; a target on the winding's edge or in the steel.
pub fn evaluate(
    design: &Design,
    inputs: Vec<Input>,
    tolerance: Option<f64>,
) -> Result<Evaluation, RunError> {
    let scene = Scene::new(design)?;
    let height_m = design.target_height_m;
    let Rated {
        single,
        circuit,
        current_a,
        power_w,
        mass_kg,
        force,
        limits,
        mut accuracy_missed,
    } = Rated::new(&scene, tolerance)?;
    let mut accuracy = single.accuracy.clone();
    let mut notes = single.notes.clone();
    let array = neighbours::array(&scene, tolerance, &mut accuracy, &mut notes)?;
    if let Some(array) = &array {
        accuracy_missed.extend_from_slice(&array.accuracy_missed);
    }
    let transient = transient(&scene, &single, &mut accuracy);
    Ok(Evaluation {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        design: design.name.clone(),
        inputs,
        coil: CoilFacts {
            inner_diameter_m: scene.coil.inner_diameter_m,
            outer_diameter_m: scene.coil.outer_diameter_m,
            length_m: scene.coil.length_m,
            turns: circuit.turns,
            resistance_ohm: circuit.resistance_ohm,
            inductance_h: circuit.inductance_h,
            flux_linkage_wb: single.flux_linkage_wb,
            time_constant_s: circuit.time_constant_s(),
            settling_s: circuit.settling_s(),
            wire_length_m: circuit.wire_length_m,
            mass_kg,
            power_w,
        },
        target: TargetFacts {
            height_m,
            current_a,
            gradient_t_per_m_per_a: single.field.dbz_dz,
            field_t_per_a: single.field.b_z,
            force_n: force.force_n[2],
            force_vector_n: force.force_n,
            torque_n_m: force.torque_n_m,
            passive_force_n: force.passive_n,
        },
        core: single.core,
        transient,
        limits,
        array,
        accuracy,
        accuracy_reached: accuracy_missed.is_empty(),
        accuracy_missed,
        notes,
    })
}

fn transient(
    scene: &Scene,
    single: &Single,
    accuracy: &mut BTreeMap<&'static str, StageAccuracy>,
) -> Option<TransientFacts> {
    let core = scene.core.as_ref()?;
    let air_inductance_h = scene.circuit.inductance_h;
    let air = scene
        .winding
        .field(0.0, scene.design.target_height_m)
        .ok()?;
    let shape = core.shape;
    let step = VoltageStep {
        resistance_ohm: scene.circuit.resistance_ohm,
        air_inductance_h,
        inductance_h: single.inductance_h,
        relative_permeability: single.relative_permeability,
        conductivity_s_per_m: core.conductivity_s_per_m,
        core_radius_m: shape.radius_m,
        core_energy_share: core_energy_share(
            &scene.winding,
            shape.radius_m,
            shape.bottom_m,
            shape.top_m,
            air_inductance_h,
        ),
        air_share: (air.dbz_dz / single.field.dbz_dz).clamp(0.0, 1.0),
    };
    let settling = step.settling().ok()?;
    accuracy.insert("transient", settling.accuracy.clone());
    Some(TransientFacts {
        current_95_s: settling.current_95_s,
        force_95_s: settling.force_95_s,
    })
}
