//! Maps over the workspace: the error of their nodes, and the error between them.

use super::{Measured, curve, stage};
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::inputs::{SEED, SEED_AIR};
use crate::reference::{AXIAL_ERROR, axial_gradient};
use fluxform::RunError;
use fluxform::design::{Design, Need};
use fluxform::field::steel::clearance::Clearance;
use fluxform::field::steel::equivalent_dipoles::ArraySources;
use fluxform::map::coupled_map::SampledField;
use fluxform::map::tabulate::{Grid, tabulate};
use fluxform::map::{Components, FieldMap};
use fluxform::numerics::axis::Axis;
use fluxform::numerics::lagrange::locate;
use fluxform::numerics::random::Random;
use fluxform::progress::{Progress, Silent};
use fluxform::scene::Scene;
use fluxform::scene::maps::{MagnetMean, SceneMap};
use fluxform::scene::steel;
use fluxform::scene::tolerances::COUPLED_TOLERANCE;
use fluxform::scene::tolerances::MAP_TOLERANCE;

const AIR: [f64; 12] = [
    1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13,
];
const COUPLED: [f64; 6] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// Share of the tolerance that a coupled map's rules have beside the steel's solution.
const MAP_SHARE: f64 = 0.3;
/// Nodes along x and y; along z half as many.
const NODES: [usize; 5] = [16, 31, 61, 121, 181];
/// The seed's own.
const DEFAULT_NODES: usize = 61;
/// Nodes and places that are compared.
const COMPARED: usize = 300;

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    let air = SEED_AIR.design(Need::CALIBRATE)?;
    let cored = SEED.design(Need::CALIBRATE)?;
    Ok(Measured {
        curves: StageCurves {
            stage: "map-table".to_owned(),
            timed: "dB_z/dz of nine coils over the workspace, nothing written".to_owned(),
            error_of: "largest |grad B| at the height (between nodes: largest |dB_z/dz|)"
                .to_owned(),
            default: "tolerance 1e-9 in air, 1e-4 with coupled cores; the design's own grid, \
                      61 x 61 x 29"
                .to_owned(),
            curves: vec![
                windings(&air, pace, progress)?,
                coupled(&cored, pace, progress)?,
                between(&air, pace, progress)?,
            ],
        },
        accuracy: stage(
            MAP_TOLERANCE,
            "the largest |grad B| at each height",
            "a-priori bounds of quadrature and table",
        ),
    })
}

fn grid(design: &Design, nodes: Option<usize>) -> Grid {
    let workspace = &design.workspace;
    let along = |axis: &Axis, samples: Option<usize>| {
        let samples = samples.unwrap_or(axis.samples);
        Axis { samples, ..*axis }.nodes()
    };
    Grid {
        x_m: along(&workspace.x_m, nodes),
        y_m: along(&workspace.y_m, nodes),
        z_m: along(&workspace.z_m, nodes.map(|n| n.div_ceil(2))),
    }
}

/// Nodes to look at: coil, and indices along z, y, x; the lowest plane twice as often.
fn looked_at(grid: &Grid, coils: usize) -> Vec<[usize; 4]> {
    let mut numbers = Random::new(11);
    let mut below = |n: usize| ((numbers.unit() * n as f64) as usize).min(n - 1);
    (0..COMPARED)
        .map(|k| {
            let z = below(grid.z_m.len());
            let place = [
                below(coils),
                z,
                below(grid.y_m.len()),
                below(grid.x_m.len()),
            ];
            if k % 3 == 0 {
                [place[0], 0, place[2], place[3]]
            } else {
                place
            }
        })
        .collect()
}

fn node(map: &FieldMap, [coil, z, y, x]: [usize; 4]) -> f64 {
    let (rows, row) = (map.y_m.len(), map.x_m.len());
    map.gz_t_per_m_per_a[((coil * map.z_m.len() + z) * rows + y) * row + x]
}

/// The array in air for other programs: axes, coils, and values at the nodes looked at.
pub(super) fn problem() -> Result<serde_json::Value, RunError> {
    let design = SEED_AIR.design(Need::CALIBRATE)?;
    let scene = Scene::new(&design)?;
    let grid = grid(&design, None);
    let looked = looked_at(&grid, scene.coils.len());
    let exact = in_air(&scene, &grid, &looked)?;
    Ok(serde_json::json!({
        "winding": super::section(&scene.winding),
        "positions_m": design.array.positions_m,
        "x_m": grid.x_m,
        "y_m": grid.y_m,
        "z_m": grid.z_m,
        "coil_z_y_x": looked,
        "gz_t_per_m_per_a": exact.iter().map(|(gz, _)| *gz).collect::<Vec<f64>>(),
        "size_t_per_m_per_a": exact.iter().map(|(_, size)| *size).collect::<Vec<f64>>(),
    }))
}

/// dB_z/dz at the nodes, and the largest |grad B| at their heights.
fn in_air(scene: &Scene, grid: &Grid, looked: &[[usize; 4]]) -> Result<Vec<(f64, f64)>, RunError> {
    let mut exact = Vec::with_capacity(looked.len());
    for &[coil, z, y, x] in looked {
        let [ax, ay] = scene.coils[coil].axis_m;
        let (r_m, z_m) = ((grid.x_m[x] - ax).hypot(grid.y_m[y] - ay), grid.z_m[z]);
        let [gz, _] = axial_gradient(&scene.winding, r_m, z_m);
        let mut size = 0.0_f64;
        for part in [0.0, 0.5, 0.9, 1.2] {
            let field = scene
                .winding
                .field(part * scene.winding.outer_radius_m, z_m)?;
            size = size.max(field.gradient_norm());
        }
        exact.push((gz, size));
    }
    Ok(exact)
}

fn windings(design: &Design, pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let scene = Scene::new(design)?;
    let grid = grid(design, None);
    let looked = looked_at(&grid, scene.coils.len());
    let exact = in_air(&scene, &grid, &looked)?;
    let nodes = scene.coils.len() * grid.x_m.len() * grid.y_m.len() * grid.z_m.len();
    let mut rows = Vec::new();
    for &tolerance in pace.settings(&AIR, AIR.len()) {
        let (map, timing) = pace.time(progress, || {
            Ok(tabulate(
                &scene.winding,
                &scene.coils,
                &grid,
                Components::Gz,
                tolerance,
                &Silent,
            )?)
        })?;
        let error = looked
            .iter()
            .zip(&exact)
            .fold(0.0_f64, |most, (at, (gz, size))| {
                most.max((node(&map, *at) - gz).abs() / size)
            });
        let found = Found {
            knob: tolerance,
            default: tolerance == MAP_TOLERANCE,
            items: nodes,
            error,
            stated: Some(map.relative_error),
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        "the seed's array in air, 61 x 61 x 29 nodes",
        "tolerance",
        "Biot-Savart around every loop at 300 nodes, double-double",
        AXIAL_ERROR,
        rows,
    ))
}

fn coupled(design: &Design, pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let scene = Scene::new(design)?;
    let grid = grid(design, None);
    let lowest_m = grid.z_m[0];
    let solved = steel::solve(&scene, scene.tolerances.map, lowest_m)?;
    let Some(array) = solved.steel().coupled() else {
        return Err(super::no_core());
    };
    let looked = looked_at(&grid, scene.coils.len());
    // The dipoles themselves, finer than any row's.
    let finest = ArraySources::of_array(array, Clearance::above(lowest_m, lowest_m), 1e-10);
    let points: Vec<[f64; 3]> = looked
        .iter()
        .map(|[_, z, y, x]| [grid.x_m[*x], grid.y_m[*y], grid.z_m[*z]])
        .collect();
    let mut exact = vec![0.0; scene.coils.len() * points.len()];
    finest.sample(&points, Components::Gz, &mut exact);
    let mut sizes = Vec::with_capacity(points.len());
    for (k, point) in points.iter().enumerate() {
        let column = exact.iter().skip(k).step_by(points.len());
        let steel = column.fold(0.0_f64, |m, v| m.max(v.abs()));
        // Over the driven coil all of it is larger than at any generic node.
        let air = scene.winding.field(0.0, point[2])?.gradient_norm();
        sizes.push(steel.max(air));
    }
    let nodes = scene.coils.len() * grid.x_m.len() * grid.y_m.len() * grid.z_m.len();
    let mut rows = Vec::new();
    for &tolerance in pace.settings(&COUPLED, 4) {
        let (map, timing) = pace.time(progress, || {
            let own = MAP_SHARE * tolerance;
            let sources = ArraySources::of_array(
                array,
                Clearance::above(lowest_m, lowest_m),
                0.1 * tolerance,
            );
            let field = SampledField::new(&sources, &grid, Components::Gz, own, 1, &Silent)?;
            Ok(field.map(&scene.coils, &grid, &Silent)?)
        })?;
        let error = (looked.iter().enumerate()).fold(0.0_f64, |most, (k, at)| {
            let direct = exact[at[0] * points.len() + k];
            most.max((node(&map, *at) - direct).abs() / sizes[k])
        });
        let found = Found {
            knob: tolerance,
            default: tolerance == COUPLED_TOLERANCE,
            items: nodes,
            error,
            stated: Some((MAP_SHARE + 0.1) * tolerance),
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        "the steel's part of the seed's array with coupled cores, from its solution",
        "tolerance",
        "the solution's rings evaluated to 1e-10 at 300 nodes",
        1e-10,
        rows,
    ))
}

/// Interpolation between the nodes, against their number.
fn between(design: &Design, pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let scene = Scene::new(design)?;
    let solved = steel::solve(&scene, scene.tolerances.map, 0.0)?;
    let mut numbers = Random::new(13);
    let whole = grid(design, None);
    let ends = |nodes: &[f64]| [nodes[0], nodes[nodes.len() - 1]];
    let [x, y, z] = [&whole.x_m, &whole.y_m, &whole.z_m].map(|nodes| ends(nodes));
    // The error falls with height: half the places lie in the lowest fourteenth.
    let places: Vec<[f64; 3]> = (0..4 * COMPARED)
        .map(|k| {
            let top = if k % 2 == 0 { z[1] } else { z[0] + 0.005 };
            [
                numbers.between(x[0], x[1]),
                numbers.between(y[0], y[1]),
                numbers.between(z[0], top),
            ]
        })
        .collect();
    let mut exact = Vec::with_capacity(places.len());
    for &[x, y, z] in &places {
        let field = scene.winding.field(x.hypot(y), z)?;
        let mut size = 0.0_f64;
        for part in [0.0, 0.3, 0.6] {
            let above = scene
                .winding
                .field(part * scene.winding.outer_radius_m, z)?;
            size = size.max(above.dbz_dz.abs());
        }
        exact.push((field.dbz_dz, size));
    }
    let mut rows = Vec::new();
    // The coil at the centre: its axis is the origin.
    let centre = scene.coils.len() / 2;
    for &nodes in pace.settings(&NODES, 4) {
        let grid = grid(design, Some(nodes));
        let (made, timing) = pace.time(progress, || {
            SceneMap::new(
                &scene,
                &solved,
                &scene.coils,
                &grid,
                Components::Gz,
                &MagnetMean::field(),
                &Silent,
            )
        })?;
        let map = &made.map;
        let count = grid.x_m.len() * grid.y_m.len() * grid.z_m.len();
        let values = &map.gz_t_per_m_per_a[centre * count..(centre + 1) * count];
        let error = places
            .iter()
            .zip(&exact)
            .fold(0.0_f64, |most, (place, (gz, size))| {
                let [x, y, z] = *place;
                let cell = locate([&grid.x_m, &grid.y_m, &grid.z_m], [x, y, z]);
                cell.map_or(f64::INFINITY, |cell| {
                    most.max((cell.value(values) - gz).abs() / size)
                })
            });
        let found = Found {
            knob: nodes as f64,
            default: nodes == DEFAULT_NODES,
            items: scene.coils.len() * count,
            error,
            stated: Some(made.between.largest),
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        "between the nodes: tricubic interpolation, air",
        "nodes along x and y (z: half as many)",
        "the winding's kernel at 1200 places, half of them in the lowest 5 mm",
        1e-12,
        rows,
    ))
}
