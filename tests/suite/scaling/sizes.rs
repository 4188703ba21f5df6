//! The sizes that grow, their ranges, and the work that is measured at each size.

use super::THREADS;
use crate::force::{Forces, forces, forces_over_all, forces_overlapping, with_coils};
use crate::inputs::{OPTIMUM_AIR, SEED, SEED_AIR};
use crate::stages::posed;
use crate::test_surface::{dome_m, grid, known, mesh};
use fluxform::RunError;
use fluxform::coil::inductance::self_inductance_h;
use fluxform::coil::mutual::inductance_matrix_h;
use fluxform::coil::optimum::{Settings as Search, optimise};
use fluxform::commands::bench::clock::{Effort, Timing, measure};
use fluxform::design::Need;
use fluxform::field::steel::array::CoupledArray;
use fluxform::lambda::worst::worst_point;
use fluxform::lambda::{self, Allocator, Settings};
use fluxform::map::Components;
use fluxform::map::tabulate::{Grid, tabulate};
use fluxform::numerics::axis::Axis;
use fluxform::numerics::random::Random;
use fluxform::progress::Silent;
use fluxform::scene::Scene;
use fluxform::scene::steel;
use fluxform::scene::tolerances::COUPLED_TOLERANCE;
use fluxform::shape::deviation::{Faces, Lattice, Looks, vertical};
use fluxform::shape::height::heights;

/// Size and seconds.
type Sized = Result<(f64, Timing), RunError>;

/// One law: what is computed, against what, at which settings.
#[derive(Debug, Clone, Copy)]
pub struct Spec {
    /// The quantity computed.
    pub stage: &'static str,
    /// The size that grows.
    pub axis: &'static str,
    /// Its value on the seed.
    pub seed_size: f64,
    /// From small to large; what a setting is the row's work says.
    settings: &'static [usize],
    /// How many of them are quick.
    quick: usize,
    /// Measures a setting.
    pub(super) run: fn(usize, &Effort) -> Sized,
}

impl Spec {
    /// As the command line names it.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}:{}", self.stage, self.axis)
    }

    /// Settings and threads; along the threads the one setting at 1, 2, 4 ... of `most`.
    #[must_use]
    pub fn settings(&self, quick: bool, most: usize) -> Vec<(usize, usize)> {
        if self.axis == THREADS {
            let mut counts: Vec<usize> = (0..10).map(|k| 1 << k).filter(|n| *n < most).collect();
            counts.push(most);
            return counts.into_iter().map(|n| (self.settings[0], n)).collect();
        }
        let count = if quick {
            self.quick
        } else {
            self.settings.len()
        };
        self.settings[..count].iter().map(|s| (*s, 1)).collect()
    }
}

const COILS: f64 = 9.0;
const POINTS: f64 = 3721.0;
const NODES: f64 = 107_909.0;
/// Of the seed's half-sphere.
const TRIANGLES: f64 = 13_478.0;
/// Points along either axis of a plan, the seed's.
const SAMPLES: usize = 61;

const fn spec(
    stage: &'static str,
    axis: &'static str,
    seed_size: f64,
    settings: &'static [usize],
    run: fn(usize, &Effort) -> Sized,
) -> Spec {
    Spec {
        stage,
        axis,
        seed_size,
        quick: if settings.len() < 3 {
            settings.len()
        } else {
            3
        },
        settings,
        run,
    }
}

/// Every law.
pub const LAWS: [Spec; 22] = [
    spec(
        "map-table",
        "coils",
        COILS,
        &[1, 2, 3, 4, 6, 8, 12, 20, 30],
        map_coils,
    ),
    spec(
        "map-table",
        "nodes",
        NODES,
        &[16, 31, 61, 91, 121, 181],
        map_nodes,
    ),
    spec(
        "inductance",
        "coils",
        COILS,
        &[2, 3, 5, 8, 12, 20, 30],
        matrix,
    ),
    spec(
        "coupled-array",
        "coils",
        COILS,
        &[1, 2, 3, 4, 5, 6, 8, 10, 15, 30],
        coupled,
    ),
    spec(
        "forces",
        "points",
        POINTS,
        &[31, 61, 121, 241, 481],
        force_points,
    ),
    spec("forces", "coils", COILS, &[3, 6, 10, 15], force_coils),
    spec(
        "forces, coupled",
        "points",
        POINTS,
        &[31, 61, 121, 241],
        coupled_points,
    ),
    spec(
        "lambda-path",
        "points",
        POINTS,
        &[31, 61, 121, 241, 481, 961],
        path_points,
    ),
    spec(
        "lambda-path",
        "coils",
        COILS,
        &[3, 4, 6, 8, 10, 15, 20, 30],
        path_coils,
    ),
    spec(
        "worst-point",
        "points",
        POINTS,
        &[11, 21, 31, 61, 121, 401, 1000],
        worst_points,
    ),
    spec(
        "worst-point, 25 overlapping coils",
        "points",
        POINTS,
        &[31, 61, 121, 241, 481, 1000],
        worst_overlapping,
    ),
    spec(
        "worst-point",
        "coils",
        COILS,
        &[3, 4, 6, 8, 10, 15, 20, 30],
        worst_coils,
    ),
    spec(
        "height-map",
        "triangles",
        TRIANGLES,
        &[64, 128, 256, 512, 1024, 1448],
        map_triangles,
    ),
    spec(
        "height-map",
        "points",
        POINTS,
        &[61, 121, 241, 481, 961, 1921],
        map_points,
    ),
    spec(
        "points-against-surface",
        "points",
        POINTS,
        &[31, 61, 121, 241, 481],
        deviation_points,
    ),
    spec(
        "points-against-surface",
        "triangles",
        TRIANGLES,
        &[32, 64, 128, 256, 512],
        deviation_triangles,
    ),
    spec("coil-optimum", "wires", 1.0, &[1, 2, 4, 8, 16], wires),
    spec(
        "replay, currents",
        "coils",
        COILS,
        &[3, 4, 6, 8, 12, 16, 30],
        allocate,
    ),
    spec("map-table", THREADS, 1.0, &[121], map_nodes),
    spec("coupled-array", THREADS, 1.0, &[3], coupled),
    spec("forces, coupled", THREADS, 1.0, &[121], coupled_points),
    spec("height-map", THREADS, 1.0, &[512], map_triangles),
];

fn workspace(samples: usize, along_z: usize) -> Result<Grid, RunError> {
    let design = SEED_AIR.design(Need::CALIBRATE)?;
    let nodes = |axis: &Axis, samples: usize| Axis { samples, ..*axis }.nodes();
    Ok(Grid {
        x_m: nodes(&design.workspace.x_m, samples),
        y_m: nodes(&design.workspace.y_m, samples),
        z_m: nodes(&design.workspace.z_m, along_z),
    })
}

fn map(side: usize, grid: &Grid, effort: &Effort) -> Result<Timing, RunError> {
    let design = with_coils(&SEED_AIR, side)?;
    let scene = Scene::new(&design)?;
    let work = || {
        let (winding, coils) = (&scene.winding, &scene.coils);
        Ok::<_, RunError>(tabulate(
            winding,
            coils,
            grid,
            Components::Gz,
            1e-9,
            &Silent,
        )?)
    };
    Ok(measure(effort, work)?.1)
}

fn map_coils(side: usize, effort: &Effort) -> Sized {
    let grid = workspace(SAMPLES, 29)?;
    Ok(((side * side) as f64, map(side, &grid, effort)?))
}

fn map_nodes(samples: usize, effort: &Effort) -> Sized {
    let grid = workspace(samples, samples.div_ceil(2))?;
    let nodes = grid.x_m.len() * grid.y_m.len() * grid.z_m.len();
    Ok((nodes as f64, map(3, &grid, effort)?))
}

fn matrix(side: usize, effort: &Effort) -> Sized {
    let design = with_coils(&SEED_AIR, side)?;
    let scene = Scene::new(&design)?;
    let work = || {
        let own_h = self_inductance_h(&scene.winding);
        let axes_m = &design.array.positions_m;
        Ok::<_, RunError>(inductance_matrix_h(&scene.winding, own_h, axes_m))
    };
    Ok(((side * side) as f64, measure(effort, work)?.1))
}

fn coupled(side: usize, effort: &Effort) -> Sized {
    let design = with_coils(&SEED, side)?;
    let scene = Scene::new(&design)?;
    let core = scene
        .core
        .as_ref()
        .ok_or_else(|| RunError::Input("the built-in design has no [core]".to_owned()))?;
    let work = || {
        let array = CoupledArray::new(
            &scene.winding,
            core.shape,
            core.relative_permeability(),
            &design.array.positions_m,
            COUPLED_TOLERANCE,
            0.01,
        );
        Ok::<_, RunError>(array?)
    };
    Ok(((side * side) as f64, measure(effort, work)?.1))
}

/// Heights of the dome over the plan.
fn places(samples: usize) -> Vec<[f64; 3]> {
    let line = grid(samples).x_m.nodes();
    line.iter()
        .flat_map(|&y| line.iter().map(move |&x| [x, y, dome_m(x, y)]))
        .collect()
}

fn force_points(samples: usize, effort: &Effort) -> Sized {
    let design = SEED_AIR.design(Need::CALIBRATE)?;
    let scene = Scene::new(&design)?;
    let solved = steel::solve(&scene, scene.tolerances.field, 0.03)?;
    let points = places(samples);
    let work = || scene.forces_n_per_a(&solved, &points, &Silent);
    Ok((points.len() as f64, measure(effort, work)?.1))
}

/// At points over the whole array, far from most coils.
fn force_coils(side: usize, effort: &Effort) -> Sized {
    let work = || forces_over_all(&SEED_AIR, side, SAMPLES, dome_m);
    Ok(((side * side) as f64, measure(effort, work)?.1))
}

fn coupled_points(samples: usize, effort: &Effort) -> Sized {
    let design = SEED.design(Need::CALIBRATE)?;
    let scene = Scene::new(&design)?;
    let solved = steel::solve(&scene, scene.tolerances.field, 0.03)?;
    let points = places(samples);
    let work = || scene.forces_n_per_a(&solved, &points, &Silent);
    Ok((points.len() as f64, measure(effort, work)?.1))
}

fn path(given: &Forces, effort: &Effort) -> Result<Timing, RunError> {
    let problem = given.problem();
    let work = || Ok::<_, RunError>(lambda::solve(&problem, &Settings::default())?);
    Ok(measure(effort, work)?.1)
}

fn path_points(samples: usize, effort: &Effort) -> Sized {
    let given = forces(&SEED_AIR, 3, samples, dome_m)?;
    Ok(((samples * samples) as f64, path(&given, effort)?))
}

fn path_coils(side: usize, effort: &Effort) -> Sized {
    let given = forces_over_all(&SEED_AIR, side, SAMPLES, dome_m)?;
    Ok(((side * side) as f64, path(&given, effort)?))
}

fn worst(given: &Forces, effort: &Effort) -> Result<Timing, RunError> {
    let problem = given.problem();
    let work = || Ok::<_, RunError>(worst_point(&problem, &Settings::default())?);
    Ok(measure(effort, work)?.1)
}

fn worst_points(samples: usize, effort: &Effort) -> Sized {
    let given = forces(&SEED_AIR, 3, samples, dome_m)?;
    Ok(((samples * samples) as f64, worst(&given, effort)?))
}

fn worst_overlapping(samples: usize, effort: &Effort) -> Sized {
    let given = forces_overlapping(&SEED_AIR, 5, samples, dome_m)?;
    Ok(((samples * samples) as f64, worst(&given, effort)?))
}

fn worst_coils(side: usize, effort: &Effort) -> Sized {
    let given = forces_over_all(&SEED_AIR, side, SAMPLES, dome_m)?;
    Ok(((side * side) as f64, worst(&given, effort)?))
}

fn height_map(side: usize, samples: usize, effort: &Effort) -> Result<(usize, Timing), RunError> {
    let mesh = mesh(side)?;
    let plan = grid(samples);
    let work = || Ok::<_, RunError>(heights(&mesh, &plan, &Silent)?);
    Ok((mesh.triangles().len(), measure(effort, work)?.1))
}

fn map_triangles(side: usize, effort: &Effort) -> Sized {
    let (triangles, timing) = height_map(side, SAMPLES, effort)?;
    Ok((triangles as f64, timing))
}

fn map_points(samples: usize, effort: &Effort) -> Sized {
    let (_, timing) = height_map(40, samples, effort)?;
    Ok(((samples * samples) as f64, timing))
}

fn deviation(side: usize, samples: usize, effort: &Effort) -> Result<(usize, Timing), RunError> {
    let mesh = mesh(side)?;
    let plan = grid(samples);
    let work = || {
        let known = known(&heights(&mesh, &plan, &Silent)?);
        let faces = Faces::new(&mesh, &plan, Looks::endless());
        let lattice = Lattice::new(&faces, &plan, &known);
        Ok::<_, RunError>(vertical(&mesh, &plan, &lattice, &Silent)?)
    };
    Ok((mesh.triangles().len(), measure(effort, work)?.1))
}

fn deviation_points(samples: usize, effort: &Effort) -> Sized {
    let (_, timing) = deviation(40, samples, effort)?;
    Ok(((samples * samples) as f64, timing))
}

fn deviation_triangles(side: usize, effort: &Effort) -> Sized {
    let (triangles, timing) = deviation(side, SAMPLES, effort)?;
    Ok((triangles as f64, timing))
}

/// Wires to choose from, each a little thinner than the one before.
fn wires(count: usize, effort: &Effort) -> Sized {
    let (mut task, model) = posed(&OPTIMUM_AIR)?;
    let first = task.strands[0];
    task.strands = (0..count)
        .map(|k| {
            let share = 1.0 - 0.02 * k as f64;
            let mut strand = first;
            strand.diameter_m *= share;
            strand.conductor_diameter_m *= share;
            strand
        })
        .collect();
    let settings = Search {
        cells: 0,
        valley: false,
        ..Search::default()
    };
    let work = || Ok::<_, RunError>(optimise(&*model, &task, &settings, &Silent)?);
    Ok((count as f64, measure(effort, work)?.1))
}

/// Currents of least power for a thousand rows of forces.
fn allocate(side: usize, effort: &Effort) -> Sized {
    const ROWS: usize = 1000;
    let coils = side * side;
    let refused = |error: &dyn std::fmt::Display| RunError::Input(error.to_string());
    let (lower, upper) = (vec![0.0; coils], vec![2.0; coils]);
    let mut allocator = Allocator::new(&vec![6.0; coils], &lower, &upper, Some(coils as f64))
        .map_err(|error| refused(&error))?;
    let mut numbers = Random::new(3);
    let rows: Vec<f64> = (0..ROWS * coils).map(|_| numbers.unit()).collect();
    let mut currents = vec![0.0; coils];
    let work = || {
        for row in rows.chunks_exact(coils) {
            std::hint::black_box(allocator.allocate(row, 0.3 * coils as f64, &mut currents));
        }
        Ok::<_, RunError>(())
    };
    let timing = measure(effort, work)?.1;
    let each = |seconds: f64| seconds / ROWS as f64;
    Ok((
        coils as f64,
        Timing {
            seconds: each(timing.seconds),
            low_s: each(timing.low_s),
            high_s: each(timing.high_s),
            elapsed_s: each(timing.elapsed_s),
            ..timing
        },
    ))
}
