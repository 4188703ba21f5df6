//! Time and memory of the force constant's two forms over 1e2 to 1e7 points, and over 16 to 900 coils.
//!
//! ```text
//! cargo bench --locked --bench time_lambda -- [MOST_POINTS] [THREADS]
//! cargo bench --locked --bench time_lambda -- coils [MOST_COILS] [THREADS]
//! ```
//!
//! Default: 1e6 points, one thread. Each row is its own process, so that its peak memory
//! (`VmHWM`, reset once the forces are there) is its own; 1e7 points of nine coils need 0.8 GB
//! for the forces alone. The least processor time of a few runs is printed.

// A measurement: it reads the clock and prints.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use std::error::Error;
use std::path::Path;
use std::process::Command;

use fluxform::commands::bench::clock::Watch;
use fluxform::design::{Design, Need};
use fluxform::lambda::worst::worst_point;
use fluxform::lambda::{self, ForceProblem, Settings};
use fluxform::numerics::axis::Axis;
use fluxform::progress::Silent;
use fluxform::scene::Scene;
use fluxform::scene::steel;
use fluxform_bench::memory::peak_bytes;

type Failure = Box<dyn Error + Send + Sync>;

/// Surfaces of the table: name, rows and columns of the array, its pitch, half the side of the
/// surface, mm.
const CASES: [(&str, usize, u32, u32); 6] = [
    ("flat", 3, 50, 50),
    ("dome", 3, 50, 50),
    ("flat", 5, 50, 100),
    ("dome", 5, 50, 100),
    ("flat", 5, 25, 50),
    ("dome", 5, 25, 50),
];

/// Sides of the square arrays over which coils are counted: at a pitch of 50 mm under a plate over
/// all of them, of that many points along a side.
const SIDES: [usize; 8] = [4, 6, 8, 10, 12, 15, 20, 30];
const PITCH_MM: u32 = 50;
const NODES: usize = 61;

/// Height of the surface, m; the dome is a smooth one without any symmetry.
fn height_m(surface: &str, x: f64, y: f64) -> f64 {
    match surface {
        "flat" => 0.05,
        _ => 0.03 + 0.03 * (-((x - 0.007) / 0.04).powi(2) - ((y + 0.003) / 0.05).powi(2)).exp(),
    }
}

/// A field of `/proc/self/status` in kB; 0 where there is none.
fn status_kb(field: &str) -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with(field));
    let number = line.and_then(|line| line.split_whitespace().nth(1));
    number.and_then(|n| n.parse().ok()).unwrap_or(0)
}

/// Runs `work` a few times: least seconds, peak memory above what was there before, MB.
fn time<T>(
    repeats: usize,
    mut work: impl FnMut() -> Result<T, Failure>,
) -> Result<(T, f64, f64), Failure> {
    // Resets VmHWM; without that right the peak is that of the whole process.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let before = status_kb("VmRSS");
    let mut least = f64::INFINITY;
    let mut result = None;
    for _ in 0..repeats {
        let watch = Watch::start();
        result = Some(work()?);
        least = least.min(watch.processor_s());
    }
    let peak = (peak_bytes() / 1024).saturating_sub(before) as f64 / 1e3;
    Ok((result.ok_or("no run")?, least, peak))
}

/// One row of the table.
fn row(
    surface: &str,
    side: usize,
    [pitch_m, half_m]: [f64; 2],
    nodes: usize,
) -> Result<(), Failure> {
    let (mut design, _) = Design::read(Path::new("designs/seed_air.toml"), Need::CALIBRATE)?;
    let middle = 0.5 * (side - 1) as f64;
    design.array.positions_m = (0..side * side)
        .map(|k| [(k % side) as f64, (k / side) as f64].map(|i| (i - middle) * pitch_m))
        .collect();
    design.array.grid = None;
    design.array.gain = vec![1.0; side * side];
    design.supply.current_max_a = vec![2.0; side * side];
    design.supply.current_min_a = vec![0.0; side * side];
    design.supply.total_current_max_a = Some(2.0 * (side * side) as f64);
    let scene = Scene::new(&design)?;
    let solved = steel::solve(&scene, scene.tolerances.forces, 0.03)?;
    let side_m = Axis {
        from: -half_m,
        to: half_m,
        samples: nodes,
    }
    .nodes();
    let points: Vec<[f64; 3]> = side_m
        .iter()
        .flat_map(|&y| side_m.iter().map(move |&x| [x, y, height_m(surface, x, y)]))
        .collect();
    let forces = scene.forces_n_per_a(&solved, &points, &Silent)?;
    let heights: Vec<f64> = points.iter().map(|p| p[2]).collect();
    drop(points);
    let resistance_ohm = scene.resistances_ohm();
    let problem = ForceProblem {
        forces_n_per_a: &forces,
        height_m: &heights,
        offset_n: None,
        weights: None,
        lower_a: &scene.lower_a,
        upper_a: &scene.upper_a,
        total_max_a: design.supply.total_current_max_a,
        resistance_ohm: &resistance_ohm,
    };
    let repeats = if heights.len() > 100_000 { 2 } else { 5 };
    let settings = Settings::default();
    let (solution, path_s, path_mb) = time(repeats, || Ok(lambda::solve(&problem, &settings)?))?;
    let (worst, worst_s, worst_mb) = time(repeats, || Ok(worst_point(&problem, &settings)?))?;
    let jnd = worst.lambda_jnd_n_per_m.unwrap_or(f64::NAN);
    let point = worst.at(&problem, jnd);
    let gap = point.gap_n / point.worst_error_n;
    println!(
        "| {surface} | {} | {:.0} | {} | {path_s:.6} | {path_mb:.1} | {} | {worst_s:.6} | {worst_mb:.1} | {} | {} | {gap:.1e} |",
        side * side,
        pitch_m * 1e3,
        heights.len(),
        solution.path.breakpoints().len(),
        worst.path.as_ref().map_or(0, |path| path.turns().len()),
        worst.complete,
    );
    Ok(())
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|argument| argument != "--bench")
        .collect();
    if let [surface, side, pitch, half, nodes, threads] = arguments.as_slice() {
        let (side, nodes) = (side.parse()?, nodes.parse()?);
        let sizes_m = [pitch.parse::<f64>()? * 1e-3, half.parse::<f64>()? * 1e-3];
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.parse()?);
        return pool.build()?.install(|| row(surface, side, sizes_m, nodes));
    }
    let over_coils = arguments.first().is_some_and(|first| first == "coils");
    let arguments = &arguments[usize::from(over_coils)..];
    let most: f64 = arguments.first().map_or(Ok(1e6), |text| text.parse())?;
    let threads = arguments.get(1).map_or("1", String::as_str);
    println!("{threads} thread(s)\n");
    println!(
        "| surface | coils | pitch mm | points | path s | MB | turns | worst-point s | MB | turns | whole | gap |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    let measured = |surface: &str, side: usize, sizes_mm: [u32; 2], nodes: usize| {
        let status = Command::new(std::env::current_exe()?)
            .arg(surface)
            .args([side.to_string(), sizes_mm[0].to_string()])
            .args([sizes_mm[1].to_string(), nodes.to_string()])
            .arg(threads)
            .status()?;
        if status.success() {
            return Ok(());
        }
        Err(Failure::from(format!("{surface} {side} {nodes}: {status}")))
    };
    if over_coils {
        for side in SIDES
            .into_iter()
            .filter(|side| (side * side) as f64 <= most)
        {
            let half_mm = PITCH_MM * (side as u32 - 1) / 2;
            measured("flat", side, [PITCH_MM, half_mm], NODES)?;
        }
        return Ok(());
    }
    for (surface, side, pitch, half) in CASES {
        for nodes in [10, 32, 100, 316, 1000, 3162] {
            let (size, coils): (f64, _) = ((nodes * nodes) as f64, side * side);
            // 25 coils at 1e7 points would need 2 GB.
            if size > most * 1.01 || size * coils as f64 > 1e8 {
                continue;
            }
            measured(surface, side, [pitch, half], nodes)?;
        }
    }
    Ok(())
}
