//! Time of one step of a runtime: map lookup, height and allocation, in Rust and in C.
//!
//! ```text
//! cargo bench --locked --bench replay_step -- [POSITIONS]
//! ```
//!
//! The upward force alone, and the force vector. Arrays of nine and of 64 air coils under a flat surface, positions of an exploring finger and
//! positions at random. C is measured where there is a compiler called `cc`. The least of the
//! repeats is printed: on a machine with other work it is the better measure.

// A measurement: it prints.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use fluxform::bundle::artefact::Input;
use fluxform::bundle::replay::Answer;
use fluxform::commands::bench::clock::Watch;
use fluxform::commands::calibrate::{self, CalibrateOptions};
use fluxform::commands::lambda::LambdaOptions;
use fluxform::commands::replay::Opened;
use fluxform::commands::replay::synthesize::{Kind, Synthesis};
use fluxform::design::{Design, Need};
use fluxform::force_direction::{ForceDirection, ForceOverride};
use fluxform::lambda::{Allocator, SIDEWAYS_WEIGHT, VectorAllocator};
use fluxform::progress::Silent;
use fluxform::scene::sources::{DesignSource, ShapeSource};
use fluxform::shape::document::ShapeDocument;

type Failure = Box<dyn Error + Send + Sync>;

const REPEATS: usize = 20;

/// A bundle of the flat surface over `side` x `side` coils, with the sum of the currents limited
/// to `total_a`.
fn bundle(
    folder: &Path,
    side: usize,
    pitch_mm: f64,
    total_a: f64,
    direction: ForceDirection,
) -> Result<Opened, Failure> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("designs/seed_air.toml"))?
        .replace(
            "rows = 3\ncolumns = 3",
            &format!("rows = {side}\ncolumns = {side}"),
        )
        .replace("pitch_mm = 50.0", &format!("pitch_mm = {pitch_mm:?}"))
        .replace(
            "total_current_max_a = 18.0",
            &format!("total_current_max_a = {total_a:?}"),
        )
        .replace(
            "name = \"seed_air\"",
            &format!("name = \"air_{side}_{total_a}_{}\"", direction.name()),
        );
    let path = root.join("designs/seed_air.toml");
    let (design, _) =
        Design::from_toml(&text, &path, Need::CALIBRATE).map_err(|e| e.to_string())?;
    let (document, _) =
        ShapeDocument::read(&root.join("shapes/flat.toml")).map_err(|e| e.to_string())?;
    let options = CalibrateOptions {
        lambda: LambdaOptions {
            force: ForceOverride {
                direction: Some(direction),
                normal_force: None,
            },
            ..LambdaOptions::default()
        },
        keep: false,
        page: false,
        ..CalibrateOptions::new(folder)
    };
    let source = DesignSource {
        design: &design,
        text: &text,
        input: &Input::of_bytes("design", text.as_bytes()),
    };
    let shape = ShapeSource {
        document,
        input: None,
    };
    let report = calibrate::run(source, &[shape], &options, &Silent)?;
    Ok(Opened::new(&report.bundles[0].folder)?)
}

/// The C step as a program; `None` without a compiler.
fn c_program(folder: &Path) -> Option<std::path::PathBuf> {
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts");
    let program = folder.join("replay");
    let built = Command::new("cc")
        .args(["-std=c99", "-O2", "-o"])
        .arg(&program)
        .args(
            ["replay", "bundle", "currents"].map(|part| scripts.join(format!("fluxform_{part}.c"))),
        )
        .arg("-lm")
        .status();
    built
        .is_ok_and(|status| status.success())
        .then_some(program)
}

/// Nanoseconds of a step in C.
fn in_c(program: &Path, bundle: &Path, positions: &[[f64; 3]]) -> Result<f64, Failure> {
    let mut child = Command::new(program)
        .arg(bundle.join("map.npz"))
        .arg(REPEATS.to_string())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let text: String = positions
        .iter()
        .map(|p| format!("{} {} {}\n", p[0], p[1], p[2]))
        .collect();
    child
        .stdin
        .take()
        .ok_or("no input")?
        .write_all(text.as_bytes())?;
    let output = child.wait_with_output()?;
    let reported = String::from_utf8(output.stdout)?;
    Ok(reported
        .split_whitespace()
        .next()
        .ok_or("no time")?
        .parse()?)
}

/// Nanoseconds an item, the least of the repeats.
fn least(items: usize, mut work: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..REPEATS {
        let watch = Watch::start();
        work();
        best = best.min(watch.processor_s() / items as f64 * 1e9);
    }
    best
}

fn main() -> Result<(), Failure> {
    let mut numbers = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'));
    let count: usize = numbers
        .next_back()
        .map_or(Ok(20_000), |word| word.parse())?;
    let folder = tempfile::tempdir()?;
    let program = c_program(folder.path());
    println!("| coils | positions | saturated | allocation ns | step ns | step in C ns |");
    println!("|---|---|---|---|---|---|");
    let arrays = [(3, 50.0, 18.0), (3, 50.0, 6.0), (8, 40.0, 128.0)];
    let upward = ForceDirection::Vertical;
    let vector = ForceDirection::VerticalOnly;
    let all = arrays.map(|array| (array, upward)).into_iter();
    for ((side, pitch_mm, total_a), direction) in all.chain(arrays.map(|array| (array, vector))) {
        let opened = bundle(folder.path(), side, pitch_mm, total_a, direction)?;
        let finger = opened.synthesize(&Synthesis {
            kind: Kind::Explore,
            seed: 1,
            duration_s: count as f64 / 50.0,
            rate_hz: 50.0,
        });
        let ends = opened.renderer.map().ends_m();
        let part = |k: usize, prime: usize| (k * prime % 10_007) as f64 / 10_007.0;
        let anywhere: Vec<[f64; 3]> = (0..count)
            .map(|k| {
                let share = [part(k, 1_009), part(k, 2_003), part(k, 4_001)];
                std::array::from_fn(|axis| {
                    let [from, to] = ends[axis];
                    from + (to - from) * share[axis]
                })
            })
            .collect();
        for (name, positions) in [("finger", &finger.position_m), ("random", &anywhere)] {
            let mut renderer = opened.renderer.clone();
            let mut currents = vec![0.0; renderer.coils()];
            let mut saturated = 0;
            let mut rows = Vec::new();
            let mut vectors = Vec::new();
            for position in positions {
                let step = renderer.step(*position, &mut currents);
                saturated += usize::from(step.answer == Answer::Saturated);
                if step.answer != Answer::Outside {
                    rows.push((renderer.force_n_per_a().to_vec(), step.wanted_n));
                    vectors.push(renderer.force_vectors_n_per_a().to_vec());
                }
            }
            let step_ns = least(positions.len(), || {
                for position in positions {
                    std::hint::black_box(renderer.step(*position, &mut currents));
                }
            });
            let runtime = &opened.bundle.map.runtime;
            let mut allocator = Allocator::new(
                &runtime.resistance_ohm,
                &runtime.current_min_a,
                &runtime.current_max_a,
                runtime.total_current_max_a,
            )?;
            let mut of_vectors = VectorAllocator::new(
                &runtime.resistance_ohm,
                &runtime.current_min_a,
                &runtime.current_max_a,
                runtime.total_current_max_a,
                SIDEWAYS_WEIGHT,
            )?;
            let allocation_ns = least(rows.len().max(1), || {
                for ((per_ampere, wanted_n), vectors) in rows.iter().zip(&vectors) {
                    if !vectors.is_empty() {
                        let wanted_n = [0.0, 0.0, *wanted_n];
                        let found = of_vectors.allocate(vectors, wanted_n, &mut currents);
                        std::hint::black_box(found);
                        continue;
                    }
                    let found = allocator.allocate(per_ampere, *wanted_n, &mut currents);
                    std::hint::black_box(found);
                }
            });
            let c = match &program {
                Some(program) => {
                    let ns = in_c(program, &opened.bundle.folder, positions)?;
                    format!("{ns:.0}")
                }
                None => "no cc".to_owned(),
            };
            println!(
                "| {}, sum at most {total_a} A, {} | {name} | {:.0} % | {allocation_ns:.0} | {step_ns:.0} | {c} |",
                side * side,
                direction.name(),
                100.0 * saturated as f64 / positions.len() as f64
            );
        }
    }
    Ok(())
}
