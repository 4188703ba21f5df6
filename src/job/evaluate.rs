//! `evaluate`: one coil as given, and the array's inductances.

use std::collections::BTreeMap;

use serde::Serialize;

use super::scene::Scene;
use super::{JobError, KERNEL_ERROR};
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::coil::limits::{self, LimitCheck};
use crate::coil::{inductance, mutual};
use crate::design::Design;

/// What `evaluate` tells; all SI.
#[derive(Debug, Clone, Serialize)]
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
    /// Limits by name.
    pub limits: BTreeMap<&'static str, LimitCheck>,
    /// The array; absent for a single coil.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub array: Option<ArrayFacts>,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Whether the tolerance asked for was reached.
    pub accuracy_reached: bool,
}

/// The coil and its circuit.
#[derive(Debug, Clone, Serialize)]
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
    /// Self inductance, H.
    pub inductance_h: f64,
    /// L/R, s.
    pub time_constant_s: f64,
    /// Five time constants, s.
    pub settling_s: f64,
    /// Length of wire, m.
    pub wire_length_m: f64,
    /// Mass of the copper, kg.
    pub mass_kg: f64,
    /// Heat at the rated current, W.
    pub power_w: f64,
}

/// Field and force at the target.
#[derive(Debug, Clone, Serialize)]
pub struct TargetFacts {
    /// Height of the magnet's centre, m.
    pub height_m: f64,
    /// The rated current: the largest of the drivers' limits, or the supply's V/R, A.
    pub current_a: f64,
    /// dB_z/dz on the axis, T/m/A.
    pub gradient_t_per_m_per_a: f64,
    /// B_z on the axis, T/A.
    pub field_t_per_a: f64,
    /// Upward force at the rated current, N.
    pub force_n: f64,
}

/// The array's inductances.
#[derive(Debug, Clone, Serialize)]
pub struct ArrayFacts {
    /// One entry a coil.
    pub coils: Vec<ArrayCoil>,
    /// Inductance matrix, H: `[i][j]` is the flux through coil i for one ampere in coil j.
    pub mutual_inductance_h: Vec<Vec<f64>>,
}

/// One coil among its neighbours.
#[derive(Debug, Clone, Serialize)]
pub struct ArrayCoil {
    /// Index.
    pub coil: usize,
    /// Axis, m.
    pub x_m: f64,
    /// Axis, m.
    pub y_m: f64,
    /// Self inductance among its neighbours, H; without steel the same as alone.
    pub inductance_h: f64,
    /// Upper current limit, A.
    pub current_max_a: f64,
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
/// A design that cannot be computed; a target on the winding's edge.
pub fn evaluate(
    design: &Design,
    inputs: Vec<Input>,
    tolerance: Option<f64>,
) -> Result<Evaluation, JobError> {
    let scene = Scene::new(design)?;
    let height_m = design.target_height_m;
    let field = scene.winding.field(0.0, height_m)?;
    let current_a = scene.rated_current_a();
    let circuit = &scene.circuit;
    let power_w = circuit.power_w(current_a);
    let inductance_h = circuit.inductance_h;
    let array = (scene.coils.len() > 1).then(|| {
        let axes = &design.array.positions_m;
        let matrix = mutual::inductance_matrix_h(&scene.winding, inductance_h, axes);
        let coils = axes
            .iter()
            .enumerate()
            .map(|(coil, [x_m, y_m])| ArrayCoil {
                coil,
                x_m: *x_m,
                y_m: *y_m,
                inductance_h,
                current_max_a: scene.upper_a[coil],
            })
            .collect();
        ArrayFacts {
            coils,
            mutual_inductance_h: matrix,
        }
    });
    let accuracy = accuracy(&scene);
    let worst = accuracy["field"]
        .estimate
        .max(accuracy["inductance"].estimate);
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
            inductance_h,
            time_constant_s: circuit.time_constant_s(),
            settling_s: circuit.settling_s(),
            wire_length_m: circuit.wire_length_m,
            mass_kg: circuit.wire_mass_kg,
            power_w,
        },
        target: TargetFacts {
            height_m,
            current_a,
            gradient_t_per_m_per_a: field.dbz_dz,
            field_t_per_a: field.b_z,
            // On the axis the transverse components of the gradient's last column vanish.
            force_n: scene.moment_a_m2[2] * field.dbz_dz * current_a,
        },
        limits: limits::check(design, circuit, power_w, circuit.wire_mass_kg, None),
        array,
        accuracy,
        accuracy_reached: worst <= tolerance.unwrap_or(KERNEL_ERROR),
    })
}

fn accuracy(scene: &Scene) -> BTreeMap<&'static str, StageAccuracy> {
    let stage = |estimate, relative_to: &str, method: &str| StageAccuracy {
        estimate,
        relative_to: relative_to.to_owned(),
        method: method.to_owned(),
    };
    let mut accuracy = BTreeMap::from([
        (
            "field",
            stage(
                KERNEL_ERROR,
                "|grad B| (|B| for the field) at the target",
                "a-priori quadrature bound 1e-15; rounding sampled against 40-digit values",
            ),
        ),
        (
            "inductance",
            stage(
                inductance::RELATIVE_ERROR,
                "the inductance",
                "a-priori quadrature bound; sampled against 20-digit values",
            ),
        ),
    ]);
    if scene.coils.len() > 1 {
        let gap_m = nearest_gap_m(scene);
        let apart = gap_m >= 0.1 * scene.winding.outer_radius_m;
        let estimate = if apart {
            mutual::RELATIVE_ERROR
        } else {
            mutual::RELATIVE_ERROR_TOUCHING
        };
        accuracy.insert(
            "mutual_inductance",
            stage(
                estimate,
                "each mutual inductance",
                "a-priori quadrature bound for the narrowest gap between windings",
            ),
        );
    }
    accuracy
}

/// The narrowest gap between two windings, m.
fn nearest_gap_m(scene: &Scene) -> f64 {
    let axes = &scene.design.array.positions_m;
    let mut nearest = f64::INFINITY;
    for (i, [xi, yi]) in axes.iter().enumerate() {
        for [xj, yj] in &axes[i + 1..] {
            nearest = nearest.min((xi - xj).hypot(yi - yj));
        }
    }
    nearest - 2.0 * scene.winding.outer_radius_m
}
