//! Cost of a run in memory and time, before anything is computed.
//!
//! The factors are measured: peak memory of `map`, `discretize` and `lambda` at sizes where it is
//! proportional to the work.

use super::Scene;
use super::coupled;
use super::tolerances::Tolerances;
use crate::design::Design;
use crate::field::steel::array::closest_m;
use crate::field::steel::array_cost::ArrayCost;
use crate::field::steel::passive::coupling_tolerance;
pub use crate::map::Components;
use crate::shape::document::{AxisRequest, ShapeDocument};

/// Bytes of a map's value: it is held twice, as it is computed and as it is written.
const MAP_VALUE_BYTES: f64 = 16.0;
/// Bytes of a component of mag_manip's field, with its text.
const VECTOR_VALUE_BYTES: f64 = 36.0;
/// Bytes of a constraint point, and of its force from one coil.
const POINT_BYTES: f64 = 320.0;
const FORCE_BYTES: f64 = 32.0;
/// Bytes of a component of the field of one coil at one point, with its row of a table.
const PROBE_VALUE_BYTES: f64 = 16.0;
/// Operations a second of one thread on the products of a coupled array.
const OPERATIONS_PER_S: f64 = 2e9;

/// Memory and time of a part of a job.
#[derive(Debug, Clone, PartialEq)]
pub struct Cost {
    /// The part, as messages name it.
    pub what: String,
    /// Peak memory, bytes.
    pub bytes: f64,
    /// Processor time, s; 0 where it is not worth a word.
    pub cpu_seconds: f64,
    /// How to make it smaller.
    pub reduce: &'static str,
    /// The error that is left whatever the effort, and the tolerance that it exceeds.
    pub misses: Option<(f64, f64)>,
}

/// A table of `components` over the workspace of `design`.
#[must_use]
pub fn of_map(design: &Design, components: Components) -> Cost {
    let parts = match components {
        Components::Gz => 1.0,
        // The tensor is computed first.
        Components::Force => 12.0,
        Components::Gradient => 10.0,
        Components::All => 13.0,
    };
    let workspace = &design.workspace;
    let samples = [workspace.x_m, workspace.y_m, workspace.z_m].map(|axis| axis.samples);
    let [x, y, z] = samples;
    let coils = design.array.positions_m.len();
    Cost {
        what: format!("the map of {x} x {y} x {z} nodes and {coils} coils"),
        bytes: MAP_VALUE_BYTES * parts * coils as f64 * product(&samples),
        cpu_seconds: 0.0,
        reduce: "ask for fewer samples under [workspace], or for fewer components",
        misses: None,
    }
}

/// The field on `nodes` along each axis for mag_manip.
#[must_use]
pub fn of_vector_field(design: &Design, nodes: usize) -> Cost {
    let coils = design.array.positions_m.len();
    Cost {
        what: format!("the field on {nodes} x {nodes} x {nodes} nodes and of {coils} coils"),
        bytes: VECTOR_VALUE_BYTES * 3.0 * coils as f64 * product(&[nodes; 3]),
        cpu_seconds: 0.0,
        reduce: "ask for fewer --vfield-nodes",
        misses: None,
    }
}

/// The points of a shape, and their forces from `coils` coils.
#[must_use]
pub fn of_points(shape: &ShapeDocument, coils: usize) -> Cost {
    let samples = [shape.grid.x, shape.grid.y].map(|axis| match axis {
        AxisRequest::Given(axis) => axis.samples,
        AxisRequest::Extent(samples) => samples,
    });
    let [x, y] = samples;
    Cost {
        what: format!("the {x} x {y} points of {:?}", shape.name),
        bytes: (POINT_BYTES + FORCE_BYTES * coils as f64) * product(&samples),
        cpu_seconds: 0.0,
        reduce: "ask for fewer points (x_mm and y_mm under [points], or --grid)",
        misses: None,
    }
}

/// The field of every coil of `design` at `points` points, `components` numbers each.
#[must_use]
pub fn of_probe(design: &Design, points: usize, components: usize) -> Cost {
    let coils = design.array.positions_m.len();
    Cost {
        what: format!("the field of {coils} coils at {points} points"),
        bytes: PROBE_VALUE_BYTES * product(&[coils, points, components]),
        cpu_seconds: 0.0,
        reduce: "ask for fewer points, or for --components gz",
        misses: None,
    }
}

/// The steel of a coupled array; `None` where the design has none, or does not say enough.
#[must_use]
pub fn of_steel(design: &Design, tolerance: Option<f64>) -> Option<Cost> {
    if !coupled(design) {
        return None;
    }
    let scene = Scene::new(design).ok()?;
    let positions_m = &design.array.positions_m;
    let tolerance = Tolerances::of_inductances(tolerance);
    let cost = ArrayCost::new(
        scene.core.as_ref()?.shape,
        scene.winding.length_m,
        positions_m,
        closest_m(positions_m),
        tolerance,
    );
    Some(Cost {
        what: format!("the steel of {} coupled cores", positions_m.len()),
        bytes: cost.bytes,
        cpu_seconds: cost.operations / OPERATIONS_PER_S,
        reduce: "use fewer coils, shorter cores, a larger --tolerance, or coupling = \"none\"",
        misses: (cost.least_error > tolerance).then_some((cost.least_error, tolerance)),
    })
}

/// The pull of a coupled array's unpowered steel, to `tolerance` of it; `None` where the design leaves it
/// out (then few cores are coupled), or does not say enough.
#[must_use]
pub fn of_pull(design: &Design, tolerance: f64) -> Option<Cost> {
    if !design.magnet.passive_force || !coupled(design) {
        return None;
    }
    let scene = Scene::new(design).ok()?;
    let positions_m = &design.array.positions_m;
    let cost = ArrayCost::of_pull(
        scene.core.as_ref()?.shape,
        positions_m,
        closest_m(positions_m),
        coupling_tolerance(tolerance),
    );
    Some(Cost {
        what: format!("the pull of {} coupled cores", positions_m.len()),
        bytes: cost.bytes,
        cpu_seconds: cost.operations / OPERATIONS_PER_S,
        reduce: "use fewer coils, coupling = \"none\", or leave the pull out (passive_force = false)",
        misses: None,
    })
}

fn product(factors: &[usize]) -> f64 {
    factors.iter().map(|f| *f as f64).product()
}
