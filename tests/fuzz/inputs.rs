//! Damaged and hostile inputs of every kind but surfaces (see `surfaces.rs`), as long as requested.
//!
//! ```text
//! cargo bench --locked --bench fuzz_inputs -- [--seconds 60] [--kind bundle] [--seed 1]
//! ```
//!
//! Seconds are for each kind. An input that makes a reader panic, exceed the limits that
//! `kinds/mod.rs` states, refuse without naming the file, or accept what is not finite is kept in
//! the folder for temporary files and named; the run goes on and fails in the end. `tests/hostile`
//! runs the same for a moment.

// A measurement: it reads the clock, prints and ends a run that hangs.
#![allow(clippy::print_stdout, clippy::disallowed_methods, clippy::exit)]

mod harness;
mod kinds;
#[allow(dead_code)]
mod mutation;
mod structure;

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use fluxform_testing::Random;
use harness::{BEGAN, Harness, millis};
use peak_alloc::PeakAlloc;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

/// A reader that takes so long is not waited for.
const HANGS: Duration = Duration::from_secs(60);

fn main() {
    let words: Vec<String> = std::env::args().collect();
    let option = |name: &str| {
        let at = words.iter().position(|word| word == name)?;
        words.get(at + 1).cloned()
    };
    let seconds: f64 = option("--seconds")
        .and_then(|s| s.parse().ok())
        .unwrap_or(5.0);
    let seed = option("--seed").and_then(|s| s.parse().ok()).unwrap_or(1);
    let expected = option("--kind");
    std::panic::set_hook(Box::new(|_| {}));
    let folder = std::env::temp_dir().join("fluxform-fuzz");
    let harness = Harness {
        heap: &HEAP,
        folder: folder.join("now"),
        kept: Some(folder.join("kept")),
    };
    let now = harness.folder.clone();
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_secs(1));
            let began = BEGAN.load(Ordering::Relaxed);
            if began > 0 && u128::from(millis() - began) > HANGS.as_millis() {
                println!("hangs: see {}", now.display());
                std::process::exit(2);
            }
        }
    });
    println!(
        "| kind | inputs | s | read | refused | worst time / limit | worst memory / limit | faults |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut well = true;
    for kind in kinds::all() {
        if expected
            .as_deref()
            .is_some_and(|expected| expected != kind.name)
        {
            continue;
        }
        let start = Instant::now();
        let tally = harness.run(&kind, &mut Random::new(seed), |_| {
            start.elapsed().as_secs_f64() < seconds
        });
        let faults: u64 = tally.faults.values().sum();
        println!(
            "| {} | {} | {:.0} | {} | {} | {:.2} | {:.2} | {faults} |",
            kind.name,
            tally.inputs,
            start.elapsed().as_secs_f64(),
            tally.read,
            tally.inputs - tally.read,
            tally.slowest,
            tally.largest,
        );
        for (fault, count) in &tally.faults {
            println!("{}: {count} x {fault}", kind.name);
        }
        well &= tally.faults.is_empty();
    }
    if !well {
        std::process::exit(1);
    }
}
