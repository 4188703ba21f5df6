//! The felt error under what is uncertain of the display in use, and currents chosen for it.

use crate::RunError;
use crate::design::Design;
use crate::force_direction::RequestedForce;
use crate::lambda::all_points::AllPoints;
use crate::lambda::sampling::quarters;
use crate::lambda::uncertainty::{
    Draw, Drawn, Study, Surroundings, Turned, displacements_m, draws, most_points, study,
};
use crate::lambda::{ForceProblem, Wiring};
use crate::numerics::spread::spread;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::passive;
use crate::scene::steel::Solved;
use crate::uncertainty::Uncertainty;

use super::LambdaOptions;
use super::feedback::render_error;
use super::points::ForcePoints;

/// Random displays.
const DRAWS: usize = 1000;

/// # Errors
/// A cap of power for currents that nothing requests.
pub(crate) fn check(options: &LambdaOptions, design: &Design) -> Result<(), RunError> {
    let given = options.uncertainty.over(design.uncertainty);
    if given.is_none() && options.uncertainty.power_cap_w.is_some() {
        return Err(RunError::Input(
            "--power-cap bounds the currents that are chosen for uncertainties, and there are none: add \
             --sensor-error, --tilt, --heat or --driver-error, or [uncertainty] to the design"
                .to_owned(),
        ));
    }
    Ok(())
}

/// The study of some of the points with what is known of `all`; `None` where nothing is uncertain or requested.
///
/// # Errors
/// Bounds beyond the array; places that cannot be computed; interruption.
pub(super) fn study_of(
    all: &AllPoints,
    (scene, solved): (&Scene, &Solved),
    points: &ForcePoints,
    (options, force): (&LambdaOptions, RequestedForce),
    progress: &dyn Progress,
) -> Result<Option<Study>, RunError> {
    let given = options.uncertainty.over(scene.design.uncertainty);
    if given.is_none() || all.lambda_n_per_m <= 0.0 {
        return Ok(None);
    }
    let coils = scene.coils.len();
    let chosen = Chosen::new(points, most_points(coils));
    check_clearance(scene, &given, &chosen.positions_m)?;
    let draws = draws(&given, chosen.positions_m.len(), coils, DRAWS);
    let displacements = displacements_m(&given);
    let positions = chosen.positions_m.iter();
    let around: Vec<[f64; 3]> = positions
        .flat_map(|place| displacements.iter().map(|by| moved(*place, *by)))
        .collect();
    let drawn = |draw: &Draw| moved(chosen.positions_m[draw.point], draw.displacement_m);
    let drawn: Vec<[f64; 3]> = draws.iter().map(drawn).collect();
    let forces = |places: &[[f64; 3]]| -> Result<Vec<Turned>, RunError> {
        let fields = scene.turned_forces_n_per_a(solved, places, progress)?;
        Ok(wired(&options.wiring, scene, fields))
    };
    let (fields, pull_n) = (forces(&around)?, pulls_n(scene, &around)?);
    let (drawn_fields, drawn_pull_n) = (forces(&drawn)?, pulls_n(scene, &drawn)?);
    let resistance_ohm = scene.resistances_ohm();
    let no_forces = vec![0.0; chosen.height_m.len() * coils];
    let plain = ForceProblem {
        forces_n_per_a: &no_forces,
        height_m: &chosen.height_m,
        offset_n: None,
        weights: chosen.weights.as_deref(),
        lower_a: &scene.lower_a,
        upper_a: &scene.upper_a,
        total_max_a: scene.design.supply.total_current_max_a,
        resistance_ohm: &resistance_ohm,
    };
    let limits = (options.wiring).apply(&plain, scene.design.supply.voltage_v);
    let surroundings = Surroundings {
        problem: limits.problem(&plain),
        direction: &chosen.directions(points, force),
        vector: force.direction.is_vector(),
        fields: &fields,
        pull_n: pull_n.as_deref(),
        quarters: &chosen.quarters(points),
    };
    let drawn = Drawn {
        draws: &draws,
        fields: &drawn_fields,
        pull_n: drawn_pull_n.as_deref(),
    };
    progress.begin("uncertainty", 1);
    let cap_w = options.uncertainty.power_cap_w;
    let found = study(&surroundings, all, (&given, cap_w), &drawn);
    let mut found = found.map_err(render_error)?;
    let currents = found
        .as_mut()
        .and_then(|found| found.robust_static.currents_a.as_mut());
    if let Some(currents) = currents {
        options.wiring.spread(currents);
    }
    progress.end();
    Ok(found)
}

/// The points that are looked at.
pub(super) struct Chosen {
    rows: Vec<usize>,
    pub(super) positions_m: Vec<[f64; 3]>,
    pub(super) height_m: Vec<f64>,
    pub(super) weights: Option<Vec<f64>>,
}

impl Chosen {
    /// At most so many, evenly among all.
    pub(super) fn new(points: &ForcePoints, most: usize) -> Self {
        let rows = spread(points.height_m.len(), most);
        let of = |all: &[f64]| -> Vec<f64> { rows.iter().map(|row| all[*row]).collect() };
        Self {
            positions_m: rows.iter().map(|row| points.positions_m[*row]).collect(),
            height_m: of(&points.height_m),
            weights: points.weights().map(of),
            rows,
        }
    }

    /// The quarter of each.
    pub(super) fn quarters(&self, points: &ForcePoints) -> Vec<usize> {
        quarters(&self.rows, points.grid_places())
    }

    pub(super) fn directions(&self, points: &ForcePoints, force: RequestedForce) -> Vec<[f64; 3]> {
        let all = points.directions(force);
        self.rows.iter().map(|row| all[*row]).collect()
    }
}

/// The upward force without currents at places, N; `None` where the design leaves it out.
fn pulls_n(scene: &Scene, places_m: &[[f64; 3]]) -> Result<Option<Vec<f64>>, RunError> {
    let pull = passive::counted(scene, places_m)?;
    Ok(pull.map(|pull| pull.forces_z_n(places_m)))
}

fn moved(place: [f64; 3], by: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| place[axis] + by[axis])
}

/// Refuses a position so uncertain that the magnet may touch the array.
fn check_clearance(
    scene: &Scene,
    given: &Uncertainty,
    places_m: &[[f64; 3]],
) -> Result<(), RunError> {
    let lowest_m = places_m
        .iter()
        .fold(f64::INFINITY, |z, place| z.min(place[2]));
    let room_m = lowest_m - scene.sources_top_m() - scene.magnet_depth_m();
    if given.sensor_m < room_m {
        return Ok(());
    }
    Err(RunError::Input(format!(
        "a sensor error of {} mm is more than the {} mm between the magnet at the lowest point and the \
         array: no force is known there; lower --sensor-error (sensor_mm in [uncertainty]) or raise the shape",
        1e3 * given.sensor_m,
        1e3 * room_m.max(0.0),
    )))
}

/// Force per ampere of the coils as wired.
fn wired(wiring: &Wiring, scene: &Scene, mut fields: Vec<Turned>) -> Vec<Turned> {
    if wiring.is_plain() {
        return fields;
    }
    for component in 0..9 {
        let along: Vec<f64> = fields.iter().map(|turned| turned[component]).collect();
        let plain = ForceProblem {
            forces_n_per_a: &along,
            height_m: &[],
            offset_n: None,
            weights: None,
            lower_a: &scene.lower_a,
            upper_a: &scene.upper_a,
            total_max_a: None,
            resistance_ohm: &scene.resistances_ohm(),
        };
        let changed = wiring.apply(&plain, scene.design.supply.voltage_v);
        let values = changed.problem(&plain).forces_n_per_a;
        for (turned, value) in fields.iter_mut().zip(values) {
            turned[component] = *value;
        }
    }
    fields
}
