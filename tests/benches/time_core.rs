//! Time of the computations alone on a design, then of the stages of `map` with its writing.
//!
//! ```text
//! cargo bench --locked --bench time_core -- [DESIGN] [THREADS]
//! ```
//!
//! Default: `designs/seed.toml`, one thread. The least and the median of the repeats stand
//! beside each other: on a machine with other work the least is the better measure.

// A measurement: it prints.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::Path;
use std::sync::Mutex;

use fluxform::bundle::write::MapFormats;
use fluxform::commands::bench::clock::{Watch, quartiles};
use fluxform::commands::map::{self, MapRequest};
use fluxform::design::{Design, Need};
use fluxform::lambda::{self, ForceProblem, Settings};
use fluxform::map::tabulate::{Components, Grid, tabulate};
use fluxform::numerics::axis::Axis;
use fluxform::progress::{Progress, Silent};
use fluxform::scene::Scene;
use fluxform::scene::steel::{self, Solved};

const MAP_TOLERANCE: f64 = 1e-9;
type Failure = Box<dyn Error + Send + Sync>;

/// The flat surface's height.
const HEIGHT_M: f64 = 0.05;

/// Measures the stages of a job.
#[derive(Default)]
struct Stages(Mutex<Vec<(String, Watch, f64)>>);

impl Progress for Stages {
    fn begin(&self, stage: &str, _total: u64) {
        let mut stages = self.0.lock().expect("no holder panics");
        stages.push((stage.to_owned(), Watch::start(), 0.0));
    }
    fn end(&self) {
        if let Some((_, start, seconds)) = self.0.lock().expect("no holder panics").last_mut() {
            *seconds = start.elapsed_s();
        }
    }
}

/// The stages of `map`, each the least of a few runs.
fn stages(design: &Design) -> Result<(), Failure> {
    const RUNS: usize = 9;
    let mut least: Vec<(String, f64)> = Vec::new();
    for _ in 0..RUNS {
        let folder = tempfile::tempdir()?;
        let request = MapRequest {
            components: Components::Gz,
            error: None,
            tolerance: None,
            currents_a: None,
            out: folder.path().join("map"),
            formats: MapFormats::default(),
            mag_manip: Default::default(),
            force: false,
            picture: false,
        };
        let measured = Stages::default();
        map::run(design, Vec::new(), &request, &measured)?;
        let found = measured.0.into_inner().expect("no holder panics");
        least.resize(found.len(), (String::new(), f64::INFINITY));
        for (best, (stage, _, seconds)) in least.iter_mut().zip(found) {
            *best = (stage, best.1.min(seconds));
        }
    }
    println!("\n| stage of `map` | least s |\n|---|---|");
    for (stage, seconds) in least {
        println!("| {stage} | {seconds:.6} |");
    }
    Ok(())
}

/// Runs `work` a few times; prints seconds and, per item, nanoseconds.
fn time<T>(
    what: &str,
    items: usize,
    repeats: usize,
    mut work: impl FnMut() -> Result<T, Failure>,
) -> Result<T, Failure> {
    let mut seconds = Vec::new();
    let mut result = work()?; // warms caches and threads up
    for _ in 0..repeats {
        let watch = Watch::start();
        result = work()?;
        seconds.push(watch.elapsed_s());
    }
    let [_, median, _] = quartiles(&mut seconds);
    let least = seconds[0];
    let each = least / items as f64 * 1e9;
    println!("| {what} | {items} | {least:.6} | {median:.6} | {each:.1} |");
    Ok(result)
}

/// Forces and heights of a flat surface over the workspace, `nodes` along each side.
fn flat(
    scene: &Scene,
    solved: &Solved,
    design: &Design,
    nodes: usize,
) -> Result<(Vec<f64>, Vec<f64>), Failure> {
    let side = |axis: &Axis| Axis {
        samples: nodes,
        ..*axis
    };
    let x_m = side(&design.workspace.x_m).nodes();
    let y_m = side(&design.workspace.y_m).nodes();
    let points: Vec<[f64; 3]> = y_m
        .iter()
        .flat_map(|y| x_m.iter().map(move |x| [*x, *y, HEIGHT_M]))
        .collect();
    let what = format!(
        "forces at {} points, directly, {:.0e}",
        points.len(),
        solved.tolerance
    );
    let repeats = if nodes > 100 { 3 } else { 21 };
    let forces = time(&what, points.len() * scene.coils.len(), repeats, || {
        Ok(scene.forces_n_per_a(solved, &points, &Silent)?)
    })?;
    Ok((forces, vec![HEIGHT_M; points.len()]))
}

fn measure(design: &Design) -> Result<(), Failure> {
    println!("| computation | items | least s | median s | ns an item |");
    println!("|---|---|---|---|---|");
    let scene = time("scene: coil, inductance", 1, 21, || Ok(Scene::new(design)?))?;
    let solved = time("steel, default tolerance; nothing without", 1, 5, || {
        Ok(steel::solve(&scene, scene.tolerances.forces, HEIGHT_M)?)
    })?;
    let workspace = &design.workspace;
    let grid = Grid {
        x_m: workspace.x_m.nodes(),
        y_m: workspace.y_m.nodes(),
        z_m: workspace.z_m.nodes(),
    };
    let nodes = grid.x_m.len() * grid.y_m.len() * grid.z_m.len() * scene.coils.len();
    for (name, components) in [
        ("gz", Components::Gz),
        ("gradient", Components::Gradient),
        ("all", Components::All),
    ] {
        time(
            &format!("map of {name}, windings alone, 1e-9"),
            nodes,
            21,
            || {
                Ok(tabulate(
                    &scene.winding,
                    &scene.coils,
                    &grid,
                    components,
                    MAP_TOLERANCE,
                    &Silent,
                )?)
            },
        )?;
    }
    for nodes in [61, 1000] {
        let (forces, heights) = flat(&scene, &solved, design, nodes)?;
        let problem = ForceProblem {
            forces_n_per_a: &forces,
            height_m: &heights,
            offset_n: None,
            weights: None,
            lower_a: &scene.lower_a,
            upper_a: &scene.upper_a,
            total_max_a: design.supply.total_current_max_a,
            resistance_ohm: &scene.resistances_ohm(),
        };
        let what = format!("lambda and its path, {} points", heights.len());
        let repeats = if nodes > 100 { 5 } else { 101 };
        time(&what, heights.len(), repeats, || {
            Ok(lambda::solve(&problem, &Settings::default())?)
        })?;
    }
    stages(design)
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args()
        .skip(1)
        .filter(|argument| argument != "--bench");
    let path = arguments
        .next()
        .unwrap_or_else(|| "designs/seed.toml".to_owned());
    let threads = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let (design, _) = Design::read(Path::new(&path), Need::CALIBRATE)?;
    println!("`{path}`, {threads} thread(s)\n");
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()?
        .install(|| measure(&design))
}
