//! `evaluate`: one coil as given, and the array's inductances.

pub(crate) mod command;

use std::collections::BTreeMap;

use serde::Serialize;

use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::coil::circuit::Circuit;
use crate::coil::limits::LimitCheck;
use crate::coil::transient::{LEFT, VoltageStep, core_energy_share};
use crate::design::Design;
use crate::heating::Heating;
use crate::plot::array::ArrayPlot;
use crate::scene::Scene;
use crate::scene::neighbours::{self, ArraySummary};
use crate::scene::rated::{CoilSummary, Rated};
use crate::scene::single::{CoreSummary, TargetSummary};

/// The result of `evaluate`; all SI.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Evaluation {
    /// Layout of the artefact.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Name of the design.
    pub design: String,
    /// The files it was made from.
    pub inputs: Vec<Input>,
    /// The coil and its circuit.
    pub coil: CoilSummary,
    /// Field and force at the target.
    pub target: TargetSummary,
    /// The steel; absent for air coils.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub core: Option<CoreSummary>,
    /// Current and force after a voltage step; absent for air coils.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transient: Option<Transient>,
    /// How warm the coil becomes at the rated current.
    pub heat: Heating,
    /// Limits by name.
    pub limits: BTreeMap<&'static str, LimitCheck>,
    /// The array; absent for a single coil.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub array: Option<ArraySummary>,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Whether the requested tolerance was reached.
    pub accuracy_reached: bool,
    /// The stages that miss it.
    #[serde(skip)]
    pub accuracy_missed: Vec<String>,
    /// Warnings for the user.
    #[serde(skip)]
    pub warnings: Vec<String>,
    /// The array to scale.
    #[serde(skip)]
    pub drawing: Option<ArrayPlot>,
}

/// After a voltage step, with eddy currents in the solid core.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Transient {
    /// Time until the current reaches 95 % of its final value, s.
    pub current_95_s: f64,
    /// Time until the force does, s; under a current loop the sum of the loop's and the eddies'.
    pub force_95_s: f64,
    /// Under a current loop: time until the force follows a current that is there at once, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub eddies_95_s: Option<f64>,
    /// The largest contribution.
    pub limited_by: LimitedBy,
}

/// The cause that limits the speed of a force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitedBy {
    /// Resistance and inductance under a voltage that is set.
    TimeConstant,
    /// The supply's voltage against the inductance.
    Voltage,
    /// The current loop.
    Bandwidth,
    /// Eddy currents in the core.
    Eddies,
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
    let scene = Scene::with_tolerance(design, tolerance)?;
    if let Some(iron) = &scene.iron {
        iron.check_target(design)?;
    }
    let mut rated = Rated::new(&scene)?;
    let array = neighbours::of_rated(&scene, &mut rated)?;
    let transient = transient(&scene, &mut rated);
    Ok(Evaluation {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        design: design.name.clone(),
        inputs,
        coil: rated.coil,
        target: rated.target,
        core: rated.core,
        transient,
        heat: scene.heated(scene.rated_current_a()),
        limits: rated.limits,
        array,
        accuracy: rated.accuracy,
        accuracy_reached: rated.accuracy_missed.is_empty(),
        accuracy_missed: rated.accuracy_missed,
        warnings: rated.warnings,
        drawing: scene.drawing(),
    })
}

fn transient(scene: &Scene, rated: &mut Rated) -> Option<Transient> {
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
        inductance_h: rated.coil.circuit.inductance_h,
        relative_permeability: rated.relative_permeability,
        conductivity_s_per_m: core.conductivity_s_per_m(),
        core_radius_m: shape.radius_m,
        core_energy_share: core_energy_share(
            &scene.winding,
            shape.radius_m,
            shape.bottom_m,
            shape.top_m,
            air_inductance_h,
        ),
        air_share: (air.dbz_dz / rated.target.gradient_t_per_m_per_a).clamp(0.0, 1.0),
    };
    let settling = step.settling().ok()?;
    let stage = settling.accuracy.clone();
    rated.accuracy.insert("transient", stage);
    let (supply, current_a) = (&scene.design.supply, rated.target.current_a);
    let circuit = Circuit {
        inductance_h: rated.coil.circuit.inductance_h,
        ..scene.circuit
    };
    let Some(current_95_s) = circuit.step_s(supply, current_a, LEFT) else {
        let eddies = settling.force_95_s > 2.0 * settling.current_95_s;
        return Some(Transient {
            current_95_s: settling.current_95_s,
            force_95_s: settling.force_95_s,
            eddies_95_s: None,
            limited_by: if eddies {
                LimitedBy::Eddies
            } else {
                LimitedBy::TimeConstant
            },
        });
    };
    let eddies_95_s = step.eddies_95_s().ok()?;
    let loop_alone_s = -LEFT.ln() / (std::f64::consts::TAU * supply.bandwidth_hz);
    let limited_by = if eddies_95_s > current_95_s {
        LimitedBy::Eddies
    } else if current_95_s > 2.0 * loop_alone_s {
        LimitedBy::Voltage
    } else {
        LimitedBy::Bandwidth
    };
    Some(Transient {
        current_95_s,
        force_95_s: current_95_s + eddies_95_s,
        eddies_95_s: Some(eddies_95_s),
        limited_by,
    })
}
