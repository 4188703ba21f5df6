//! Hostile inputs, for a moment: every kind within the limits that `tests/fuzz/kinds` states, and
//! the three loaders of bundles. The long run is `cargo bench --bench fuzz_inputs`.
#![allow(clippy::disallowed_methods, clippy::print_stderr)]

mod harness;
mod kinds;
mod loaders;
#[allow(dead_code)]
mod mutation;
mod structure;

use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::sync::{PoisonError, RwLock};
use std::time::{Duration, Instant};

use fluxform_testing::needs::{self, Trial};
use fluxform_testing::{Random, trials};
use harness::{BEGAN, Harness, millis};
use peak_alloc::PeakAlloc;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

fn main() -> ExitCode {
    needs::run(trials().into_iter().chain(loaders::trials()))
}

fn trials() -> Vec<Trial> {
    trials! { None => [every_kind_of_input_is_read_or_refused_within_its_limits] }
}

/// Memory is measured for the whole process: while the readers' is, nothing else runs. The loaders read in
/// processes of their own, one beside the other.
pub(crate) static MEASURED: RwLock<()> = RwLock::new(());

/// Mutants a kind of input or a loader is given: always the same ones.
const MUTANTS: u64 = 60;

/// Whether another mutant is to come after `mutants` since `start`: [`MUTANTS`], or as many as fit
/// into the seconds that `FLUXFORM_HOSTILE_SECONDS` gives each kind and loader.
pub(crate) fn another(mutants: u64, start: Instant) -> bool {
    match std::env::var("FLUXFORM_HOSTILE_SECONDS") {
        Ok(reported) => {
            let seconds: f64 = reported.parse().expect("a number of seconds");
            start.elapsed().as_secs_f64() < seconds
        }
        Err(_) => mutants < MUTANTS,
    }
}

/// Ends the process when a reader hangs: nothing else would report it.
fn watch() {
    std::thread::spawn(|| {
        loop {
            std::thread::sleep(Duration::from_secs(1));
            let began = BEGAN.load(Ordering::Relaxed);
            if began > 0 && millis() - began > 120_000 {
                eprintln!("a reader hangs");
                std::process::abort();
            }
        }
    });
}

fn every_kind_of_input_is_read_or_refused_within_its_limits() {
    let _alone = MEASURED.write().unwrap_or_else(PoisonError::into_inner);
    watch();
    std::panic::set_hook(Box::new(|_| {}));
    let folder = tempfile::tempdir().unwrap();
    let harness = Harness {
        heap: &HEAP,
        folder: folder.path().join("now"),
        kept: None,
    };
    let kinds = kinds::all();
    let mut faults = Vec::new();
    for kind in &kinds {
        let start = Instant::now();
        let mut begun: Option<Instant> = None;
        let tally = harness.run(kind, &mut Random::new(1), |mutants| {
            another(mutants, *begun.get_or_insert_with(Instant::now))
        });
        eprintln!(
            "{}: {} inputs in {:.1} s, {} read; worst time {:.2}, worst memory {:.2} of the limit",
            kind.name,
            tally.inputs,
            start.elapsed().as_secs_f64(),
            tally.read,
            tally.slowest,
            tally.largest
        );
        assert!(tally.read > 0, "{}: nothing is read", kind.name);
        let reported = |(fault, count)| format!("{}: {count} x {fault}", kind.name);
        faults.extend(tally.faults.into_iter().map(reported));
    }
    drop(std::panic::take_hook());
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
