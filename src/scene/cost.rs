//! Cost of a run in memory and time, before anything is computed.
//!
//! The factors are measured: peak memory of `map`, `discretize` and `lambda` at sizes where it is
//! proportional to the work, and the laws of processor time below.

use super::Scene;
use super::coupled;
use super::iron::SceneIron;
use super::passive::iron_tolerance;
use super::passive_iron::RegionPull;
use super::sources::ShapeSource;
use super::tolerances::Tolerances;
use crate::RunError;
use crate::bundle::load::Bundle;
use crate::design::Design;
use crate::field::steel::array::closest_m;
use crate::field::steel::array_cost::ArrayCost;
use crate::field::steel::passive::coupling_tolerance;
pub use crate::map::Components;
use crate::shape::document::ShapeDocument;
use crate::shape::memory::{self, POINT_BYTES};
use fluxform_base::uncertainty::Uncertainty;
use std::path::Path;

/// Bytes of a map's value: it is held twice, as it is computed and as it is written.
const MAP_VALUE_BYTES: f64 = 16.0;
/// Copies of a stored map, file and arrays, while it is replayed, and while it is computed again.
pub const COPIES_REPLAYED: f64 = 3.6;
/// See [`COPIES_REPLAYED`].
pub const COPIES_VERIFIED: f64 = 5.25;
/// Copies of a bundle's points, file and numbers.
const COPIES_OF_POINTS: f64 = 2.3;
/// Bytes of a component of mag_manip's field, with its text.
const VECTOR_VALUE_BYTES: f64 = 36.0;
/// Bytes of a force from one coil at one point, half of them its only component: computed and gathered.
const FORCE_BYTES: f64 = 32.0;
/// Bytes of the field of one coil at one point, and of a value of its row in columns and as text.
const PROBE_BYTES: f64 = 145.0;
const PROBE_JSON_BYTES: f64 = 35.0;
/// Bytes of a point that is read.
const PROBE_POINT_BYTES: f64 = 100.0;
/// Bytes of a replayed position, and of the current of one coil there.
const POSITION_BYTES: f64 = 700.0;
const CURRENT_BYTES: f64 = 24.0;
/// Operations a second of one thread on the products of a coupled array.
const OPERATIONS_PER_S: f64 = 2e9;
/// The same on dense matrices.
const DENSE_OPERATIONS_PER_S: f64 = 1e10;

/// Processor time of a stage on one thread, right within a factor of about three.
struct Law {
    /// The stage, as messages name it.
    stage: &'static str,
    /// Seconds for a number of points and coils.
    seconds: fn(f64, f64) -> f64,
    /// What makes it shorter.
    reduce: &'static str,
}

const FEWER_POINTS: &str = "ask for fewer points (x_mm and y_mm under [points], or --grid)";
const FEWER: &str = "fewer points or coils take less";
/// By batches, in air (`fluxform-bench --scaling --law forces:points`).
const FORCES: Law = Law {
    stage: "the forces",
    seconds: |points, coils| 6e-8 * points * coils,
    reduce: FEWER,
};
/// Of coils so far that batches would lose digits (`--law forces:coils`).
const FORCES_FROM_FAR: Law = Law {
    seconds: |points, coils| 2.5e-6 * points * coils,
    reduce: "fewer points or coils, or a --tolerance of 1e-9, take less",
    ..FORCES
};
/// `--law "forces, coupled:points"`.
const FORCES_OF_STEEL: Law = Law {
    seconds: |points, coils| STEEL_POINT_COIL_S * points * coils,
    ..FORCES
};
/// `--law lambda-path:points --law lambda-path:coils`.
const PATH: Law = Law {
    stage: "lambda's path",
    seconds: |points, coils| 7e-10 * points * coils.powi(2) + 2e-8 * coils.powi(3),
    reduce: FEWER,
};
/// `--law "worst-point, 25 overlapping coils:points" --law worst-point:coils`.
const WORST_POINT: Law = Law {
    stage: "the worst point's force constants",
    seconds: |points, coils| 8e-8 * points * coils + 4e-8 * coils.powi(3),
    reduce: FEWER,
};
/// Of coils so near to each other, as seen from the object, that their forces nearly depend on each other, and
/// of the paths that tell the error of the number of points (`time fluxform lambda`, 225 and 900 coils).
const PATHS_OF_CLOSE_COILS: Law = Law {
    seconds: |points, coils| 7e-10 * points * coils.powi(2) + 3e-7 * coils.powi(3),
    reduce: "fewer points or coils, or coils further apart, take less",
    ..PATH
};
/// Heights of the target above the coils, in distances between them, from which they are so near: condition
/// numbers grow by the exponential of four times that.
const CLOSE: f64 = 2.5;
/// A path for every coil and for every pair (`time fluxform lambda --variants`).
const VARIANTS: Law = Law {
    stage: "the variants of wiring",
    seconds: |points, coils| 1.5 * coils * (PATH.seconds)(points, coils),
    reduce: "fewer points or coils, or no --variants, take less",
};
/// `time fluxform lambda --sensor-error 1mm --tilt 5deg`, 49 and 225 coils.
const UNCERTAINTIES: Law = Law {
    stage: "the uncertainties",
    seconds: |points, coils| 3.3e-7 * points * coils.powi(2),
    reduce: "fewer points or coils, or no [uncertainty], take less",
};
/// Of one component in air, by `--law map-table:nodes --law map-table:coils`.
const MAP: Law = Law {
    stage: "the map",
    seconds: |nodes, coils| 1.2e-8 * nodes * coils,
    reduce: FEWER_NODES,
};
/// Of several, which come from tensors.
const MAP_OF_TENSORS: Law = Law {
    seconds: |nodes, coils| 4e-7 * nodes * coils,
    ..MAP
};
/// The same of coupled steel, which is tabulated first.
const MAP_OF_STEEL: Law = Law {
    seconds: |nodes, coils| 5e-8 * nodes * coils,
    ..MAP
};
const MAP_OF_STEEL_TENSORS: Law = Law {
    seconds: |nodes, coils| 5.5e-7 * nodes * coils,
    ..MAP
};
const FEWER_NODES: &str = "ask for fewer samples under [workspace], or for fewer components";
/// Of designs, evaluated (`time fluxform sweep run`), one coil searched in each.
const EVALUATED: Law = Law {
    stage: "the coils",
    seconds: |designs, _| 8e-4 * designs,
    reduce: FEWER_DESIGNS,
};
const EVALUATED_CORES: Law = Law {
    seconds: |designs, _| 0.04 * designs,
    ..EVALUATED
};
const SEARCHED: Law = Law {
    seconds: |designs, _| 0.02 * designs,
    ..EVALUATED
};
const SEARCHED_CORES: Law = Law {
    seconds: |designs, _| 0.8 * designs,
    ..EVALUATED
};
const FEWER_DESIGNS: &str = "plan fewer designs, or share them among machines with --shard";
/// Of the force of a coil at a point through coupled steel, s.
pub const STEEL_POINT_COIL_S: f64 = 1.5e-6;

impl Law {
    fn cost(&self, points: f64, coils: f64) -> Cost {
        Cost {
            what: format!("{} of {coils} coils at {points} points", self.stage),
            bytes: 0.0,
            cpu_seconds: (self.seconds)(points, coils),
            reduce: self.reduce,
            misses: None,
        }
    }
}

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
    let workspace = &design.workspace;
    let samples = [workspace.x_m, workspace.y_m, workspace.z_m].map(|axis| axis.samples);
    let coils = design.array.positions_m.len();
    of_nodes(design, samples, coils, components)
}

/// The same on a grid of so many `samples`, of so many `coils`.
fn of_nodes(design: &Design, samples: [usize; 3], coils: usize, components: Components) -> Cost {
    let parts = match components {
        Components::Gz => 1.1,
        Components::Force if design.magnet.tilt_deg == [0.0; 2] => 6.5,
        // The tensor is computed first.
        Components::Force => 12.5,
        Components::Gradient => 10.2,
        Components::All => 13.2,
    };
    let [x, y, z] = samples;
    let steel = coupled(design) || design.has_iron();
    let law = match (steel, components) {
        (false, Components::Gz) => MAP,
        (false, _) => MAP_OF_TENSORS,
        (true, Components::Gz) => MAP_OF_STEEL,
        (true, _) => MAP_OF_STEEL_TENSORS,
    };
    Cost {
        what: format!("the map of {x} x {y} x {z} nodes and {coils} coils"),
        bytes: MAP_VALUE_BYTES * parts * coils as f64 * product(&samples),
        cpu_seconds: (law.seconds)(product(&samples), coils as f64),
        reduce: law.reduce,
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
    let samples = [shape.grid.x, shape.grid.y].map(|axis| axis.samples());
    let [x, y] = samples;
    Cost {
        what: format!("the {x} x {y} points of {:?}", shape.name),
        bytes: (POINT_BYTES + FORCE_BYTES * coils as f64) * product(&samples),
        cpu_seconds: 0.0,
        reduce: FEWER_POINTS,
        misses: None,
    }
}

/// The forces of `shapes`' objects, each at the points of all, of so many bytes a point and object.
#[must_use]
pub fn of_comparison(shapes: &[&ShapeDocument], coils: usize, bytes: usize) -> Cost {
    let points =
        |shape: &&ShapeDocument| product(&[shape.grid.x.samples(), shape.grid.y.samples()]);
    let each = 0.5 * POINT_BYTES + (3 * size_of::<f64>() * coils + bytes * shapes.len()) as f64;
    Cost {
        what: format!(
            "the forces of {} objects at the points of all",
            shapes.len()
        ),
        bytes: each * shapes.iter().map(points).sum::<f64>(),
        cpu_seconds: 0.0,
        reduce: FEWER_POINTS,
        misses: None,
    }
}

/// Checks the part of the map that an object needs.
///
/// # Errors
/// As [`check_forces`].
pub fn check_map(
    design: &Design,
    samples: [usize; 3],
    coils: usize,
    components: Components,
) -> Result<(), RunError> {
    let cost = of_nodes(design, samples, coils, components);
    memory::within(cost.bytes, cost.what, cost.reduce).map_err(RunError::Input)
}

/// Checks the forces of `coils` coils, of so many components, at so many points: of a surface their number may not be
/// known before.
///
/// # Errors
/// More memory than granted, and what to do.
pub fn check_forces(points: usize, coils: usize, components: usize) -> Result<(), RunError> {
    let each = POINT_BYTES + 0.5 * FORCE_BYTES * ((1 + components) * coils) as f64;
    let what = format_args!("the forces of {coils} coils at {points} points");
    let advice = "ask for fewer points, or for a larger error";
    memory::within(each * points as f64, what, advice).map_err(RunError::Input)
}

/// A replay of so many positions.
#[must_use]
pub fn of_replay(positions: usize, coils: usize) -> Cost {
    Cost {
        what: format!("the replay of {positions} positions and {coils} coils"),
        bytes: (POSITION_BYTES + CURRENT_BYTES * coils as f64) * positions as f64,
        cpu_seconds: 0.0,
        reduce: "cut the trajectory into parts, or take a lower --rate",
        misses: None,
    }
}

/// The bundle at `path`, of whose map's bytes so many `copies` are held; `None` where there is none.
#[must_use]
pub fn of_bundle(path: &Path, copies: f64) -> Option<Cost> {
    let [_, points] = Bundle::stored_bytes(path)?;
    let map = of_stored_map(path, copies)?;
    Some(Cost {
        what: "the bundle's map and points".to_owned(),
        bytes: map.bytes + COPIES_OF_POINTS * points as f64,
        reduce: "calibrate with fewer nodes of [workspace] or fewer points",
        ..map
    })
}

/// The same of its map alone.
#[must_use]
pub fn of_stored_map(path: &Path, copies: f64) -> Option<Cost> {
    let [map, _] = Bundle::stored_bytes(path)?;
    Some(Cost {
        what: "the bundle's map".to_owned(),
        bytes: copies * map as f64,
        cpu_seconds: 0.0,
        reduce: "calibrate with fewer nodes of [workspace]",
        misses: None,
    })
}

/// The time that forces and force constants of `design` at the points of `shape` take.
#[must_use]
pub fn of_force_constants(
    design: &Design,
    shape: &ShapeDocument,
    tolerance: Option<f64>,
) -> Vec<Cost> {
    let positions_m = &design.array.positions_m;
    let forces = if coupled(design) || design.has_iron() {
        FORCES_OF_STEEL
    } else if is_wide(design, tolerance) {
        FORCES_FROM_FAR
    } else {
        FORCES
    };
    let path = if design.target_height_m > CLOSE * closest_m(positions_m) {
        PATHS_OF_CLOSE_COILS
    } else {
        PATH
    };
    [forces, path, WORST_POINT]
        .map(|law| at_points(&law, design, shape))
        .into()
}

/// The time that force constants of every change of the wiring take, if they are `requested`.
#[must_use]
pub fn of_variants(design: &Design, shape: &ShapeDocument, requested: bool) -> Option<Cost> {
    requested.then(|| at_points(&VARIANTS, design, shape))
}

/// The time that currents for what is `uncertain` take.
#[must_use]
pub fn of_uncertainties(
    design: &Design,
    shape: &ShapeDocument,
    uncertain: &Uncertainty,
) -> Option<Cost> {
    (!uncertain.is_none()).then(|| at_points(&UNCERTAINTIES, design, shape))
}

fn at_points(law: &Law, design: &Design, shape: &ShapeDocument) -> Cost {
    let points = product(&[shape.grid.x.samples(), shape.grid.y.samples()]);
    law.cost(points, design.array.positions_m.len() as f64)
}

/// What is computed of every design of a sweep.
#[derive(Debug, Clone, Copy)]
pub enum OfDesigns<'a> {
    /// The coil as given.
    Evaluated,
    /// The best coil.
    Searched,
    /// The best array for these shapes, after at most so many.
    ArraysFor(&'a [ShapeSource], usize),
}

/// The time that `designs` designs like `design` take.
#[must_use]
pub fn of_designs(design: &Design, what: OfDesigns, designs: u64, tolerance: Option<f64>) -> Cost {
    let count = designs as f64;
    let law = match (what, design.has_steel()) {
        (OfDesigns::Evaluated, false) => EVALUATED,
        (OfDesigns::Evaluated, true) => EVALUATED_CORES,
        (OfDesigns::Searched, false) => SEARCHED,
        (OfDesigns::Searched | OfDesigns::ArraysFor(..), _) => SEARCHED_CORES,
    };
    let cpu_seconds = match what {
        OfDesigns::Evaluated | OfDesigns::Searched => (law.seconds)(count, 1.0),
        OfDesigns::ArraysFor(shapes, evaluations) => {
            let constants = shapes
                .iter()
                .flat_map(|shape| of_force_constants(design, &shape.document, tolerance));
            let each = constants.chain(of_steel(design, tolerance));
            count * evaluations as f64 * each.map(|cost| cost.cpu_seconds).sum::<f64>()
        }
    };
    Cost {
        what: format!("{designs} designs of the sweep"),
        bytes: 0.0,
        cpu_seconds,
        reduce: law.reduce,
        misses: None,
    }
}

/// Whether the coils of `design` are so far from each other's points that forces are computed the sure way.
fn is_wide(design: &Design, tolerance: Option<f64>) -> bool {
    let Ok(scene) = Scene::with_tolerance(design, tolerance) else {
        return false;
    };
    let [x_m, y_m] = [0, 1].map(|axis| {
        let along = design.array.positions_m.iter().map(|place| place[axis]);
        along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
    });
    let tolerance = scene.tolerances.forces;
    !scene.winding.is_quick_at(x_m.hypot(y_m), tolerance)
}

/// The field of every coil of `design` at `points` points, and its `json_columns` where they are printed.
#[must_use]
pub fn of_probe(design: &Design, points: usize, json_columns: Option<usize>) -> Cost {
    let coils = design.array.positions_m.len();
    let row = PROBE_BYTES + PROBE_JSON_BYTES * json_columns.unwrap_or(0) as f64;
    Cost {
        what: format!("the field of {coils} coils at {points} points"),
        bytes: (PROBE_POINT_BYTES + row * coils as f64) * points as f64,
        cpu_seconds: 0.0,
        reduce: "ask for fewer points",
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
        reduce: "use fewer coils, cores farther apart, a larger --tolerance, or coupling = \"none\"",
        misses: (cost.least_error > tolerance).then_some((cost.least_error, tolerance)),
    })
}

/// The pull of the unpowered steel of a coupled array, or of a plate and other bodies, to `tolerance` of it; `None` where
/// the design leaves it out (then it is solved roughly), or does not say enough.
#[must_use]
pub fn of_pull(design: &Design, tolerance: f64) -> Option<Cost> {
    if !design.magnet.passive_force {
        return None;
    }
    let scene = Scene::new(design).ok()?;
    if let Some(iron) = &scene.iron {
        return of_iron_pull(&scene, iron, tolerance);
    }
    if !coupled(design) {
        return None;
    }
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

fn of_iron_pull(scene: &Scene, iron: &SceneIron, tolerance: f64) -> Option<Cost> {
    let tolerance = iron_tolerance(scene, tolerance);
    let [unknowns, parts, places] = RegionPull::least_work(scene, iron, tolerance)?;
    // Factors of every part's matrix, then two solutions of triangles a place.
    let factors = 2.0 / 3.0 * (unknowns as f64).powi(3) * parts as f64;
    let solutions = 2.0 * product(&[unknowns, unknowns, parts, places]);
    Some(Cost {
        what: "the pull of the plate and other bodies".to_owned(),
        bytes: 2.0 * size_of::<f64>() as f64 * product(&[unknowns, unknowns, parts]),
        cpu_seconds: (factors + solutions) / DENSE_OPERATIONS_PER_S,
        reduce: "give a larger --tolerance, or leave the pull out (passive_force = false)",
        misses: None,
    })
}

fn product(factors: &[usize]) -> f64 {
    factors.iter().map(|f| *f as f64).product()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::Need;

    /// The largest size of a row of the scaling that is recorded, and its seconds.
    fn largest(stage: &str, axis: &str) -> (f64, f64) {
        let text = include_str!("../../results/bench/scaling/scaling.csv");
        let mut rows = csv::Reader::from_reader(text.as_bytes());
        let rows = rows.records().map(Result::unwrap);
        let of = rows.filter(|row| &row[0] == stage && &row[1] == axis);
        of.map(|row| (row[2].parse().unwrap(), row[4].parse().unwrap()))
            .max_by(|a: &(f64, f64), b| a.0.total_cmp(&b.0))
            .unwrap()
    }

    #[test]
    fn laws_are_those_of_the_recorded_measurements() {
        const POINTS: f64 = 3721.0;
        const NODES: f64 = 61.0 * 61.0 * 29.0;
        for (law, stage, coils) in [
            (FORCES, "forces", 9.0),
            (MAP, "map-table", 9.0),
            (FORCES_OF_STEEL, "forces, coupled", 9.0),
            (PATH, "lambda-path", 9.0),
            (WORST_POINT, "worst-point, 25 overlapping coils", 25.0),
        ] {
            let axis = if stage == "map-table" {
                "nodes"
            } else {
                "points"
            };
            let (points, seconds) = largest(stage, axis);
            let share = (law.seconds)(points, coils) / seconds;
            assert!((0.33..3.0).contains(&share), "{stage}: {share}");
        }
        for (law, stage) in [
            (FORCES_FROM_FAR, "forces"),
            (PATH, "lambda-path"),
            (WORST_POINT, "worst-point"),
            (MAP, "map-table"),
        ] {
            let (coils, seconds) = largest(stage, "coils");
            let count = if stage == "map-table" { NODES } else { POINTS };
            let share = (law.seconds)(count, coils) / seconds;
            assert!((0.33..3.0).contains(&share), "{stage}: {share}");
        }
    }

    #[test]
    fn the_cost_of_coupled_cores_is_that_of_the_recorded_measurements() {
        let text = include_str!("../../results/bench/scaling/scaling.csv");
        let seed = include_str!("../../designs/seed.toml");
        for side in [3, 4, 6, 15] {
            let row = format!("coupled-array,coils,{},1,", side * side);
            let row = text.lines().find_map(|line| line.strip_prefix(&row));
            let seconds = row.unwrap().split(',').next().unwrap();
            let of_side = ["rows", "columns"]
                .into_iter()
                .fold(seed.to_owned(), |text, key| {
                    text.replace(&format!("\n{key} = 3"), &format!("\n{key} = {side}"))
                });
            let read = Design::from_toml(&of_side, "d.toml".as_ref(), Need::CALIBRATE);
            let cost = of_steel(&read.unwrap().0, None).unwrap();
            let share = cost.cpu_seconds / seconds.parse::<f64>().unwrap();
            assert!((0.33..3.0).contains(&share), "{side} x {side}: {share}");
        }
    }

    /// `time fluxform lambda` of this design: two minutes of processor time.
    #[test]
    fn the_pull_of_a_plate_is_long() {
        let text = "name = \"plate\"\n[coil]\ninner_diameter_mm = 20\nouter_diameter_mm = 38\nlength_mm = 60\n\
                    [wire]\ndiameter_mm = 0.7\n[core]\nabove_mm = 3\nbelow_mm = 5\nrelative_permeability = 500\n\
                    [array]\nrows = 2\ncolumns = 2\npitch_mm = 45\n[magnet]\ndiameter_mm = 10\nlength_mm = 10\n\
                    magnetization_a_per_m = 1.1579e6\nmodel = \"cylinder\"\npassive_force = true\n\
                    [supply]\ncurrent_max_a = 2\n[workspace]\nx_mm = [-40, 40, 33]\ny_mm = [-40, 40, 33]\nz_mm = [16, 64, 17]\n\
                    [[iron]]\nshape = \"box\"\nsize_mm = [120, 120, 5]\ncenter_mm = [0, 0, -70]\n\
                    [[iron]]\nshape = \"cylinder\"\ndiameter_mm = 12\nlength_mm = 40\ncenter_mm = [55, 0, -20]\n";
        let cost = |text: &str| {
            let (design, _) = Design::from_toml(text, "d.toml".as_ref(), Need::CALIBRATE).unwrap();
            of_pull(&design, 1e-3).map(|cost| cost.cpu_seconds)
        };
        let cpu_s = cost(text).unwrap();
        assert!((40.0..360.0).contains(&cpu_s), "{cpu_s}");
        assert_eq!(cost(&text.replace("passive_force = true", "")), None);
    }
}
