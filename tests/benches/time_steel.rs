//! Time, unknowns and estimated error of the steel's solutions against the requested tolerance.
//!
//! ```text
//! cargo bench --locked --bench time_steel -- [DESIGN]
//! ```
//!
//! Default: `designs/seed.toml`; one thread. Every line is the least of the repeats.

// A measurement: it prints.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::Path;

use fluxform::coil::inductance::self_inductance_h;
use fluxform::commands::bench::clock::Watch;
use fluxform::design::{Design, Need};
use fluxform::field::steel::array::CoupledArray;
use fluxform::field::steel::cored_coil::CoredCoil;
use fluxform::scene::Scene;

type Failure = Box<dyn Error + Send + Sync>;

/// Least processor time of `runs` repeats of `work`, s, and its last result.
fn least<T>(runs: usize, mut work: impl FnMut() -> T) -> (f64, T) {
    let watch = Watch::start();
    let mut result = work();
    let mut seconds = watch.processor_s();
    for _ in 1..runs {
        let watch = Watch::start();
        result = work();
        seconds = seconds.min(watch.processor_s());
    }
    (seconds, result)
}

fn measure(design: &Design) -> Result<(), Failure> {
    let scene = Scene::new(design)?;
    let core = scene.core.as_ref().ok_or("the design has no [core]")?;
    let (winding, shape) = (&scene.winding, core.shape);
    let mu_r = core.relative_permeability();
    let lowest_m = design.target_height_m;
    let (air, _) = least(20, || self_inductance_h(winding));
    println!("air inductance: {:.3} ms\n", 1e3 * air);
    println!("| one cored coil, tolerance | ms | unknowns | estimated error |\n|---|---|---|---|");
    for digits in 1..=8 {
        let tolerance = 10.0_f64.powi(-digits);
        let (seconds, coil) = least(9, || {
            CoredCoil::new(winding, shape, mu_r, tolerance, lowest_m)
        });
        let coil = coil?;
        println!(
            "| {tolerance:e} | {:.3} | {} | {:.1e} |",
            1e3 * seconds,
            coil.core.density_a().len(),
            coil.relative_error
        );
    }
    let positions_m = &design.array.positions_m;
    println!(
        "\n| {} coupled coils, tolerance | ms | estimated error |\n|---|---|---|",
        positions_m.len()
    );
    for digits in 1..=5 {
        let tolerance = 10.0_f64.powi(-digits);
        let (seconds, array) = least(3, || {
            CoupledArray::new(winding, shape, mu_r, positions_m, tolerance, lowest_m)
        });
        println!(
            "| {tolerance:e} | {:.1} | {:.1e} |",
            1e3 * seconds,
            array?.relative_error
        );
    }
    Ok(())
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let path = arguments
        .first()
        .map_or("designs/seed.toml", String::as_str);
    let (design, _) = Design::read(Path::new(path), Need::CALIBRATE)?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()?
        .install(|| measure(&design))
}
