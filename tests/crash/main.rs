//! Nothing is lost when the machine or the user misbehaves: a run that is killed, interrupted, finds
//! the disk full or the folder closed, or meets another one in the same folder, leaves files that are
//! whole or absent, bundles that verify, and a place where the same command ends well and leaves
//! what an undisturbed run leaves, to the byte.
//!
//! Here some of each; `cargo bench --locked --bench crash_safety -- 500` does all of it at length.
#![cfg(unix)] // signals, permissions
#![allow(clippy::disallowed_methods, clippy::print_stderr)] // a test's own files and clock

mod changes;
mod disk;
mod kill;
mod regression;
mod scenario;
#[allow(dead_code)] // the table is for the long version
mod table;
mod together;

use std::process::ExitCode;

use disk::{Somebody, file_limit, mounter, small_disk};
use fluxform_testing::needs::{self, Trial};
use fluxform_testing::{Random, trials};
use kill::{How, Strike};
use scenario::{MAIN, MORE, Prepared};
use table::Row;
use together::{RIVALS, asked_to_stop, other_inputs, same_inputs};

fn main() -> ExitCode {
    needs::run(trials().into_iter().chain(regression::trials()))
}

fn trials() -> Vec<Trial> {
    trials! {
        None => [
            every_scenario_is_tried,
            a_kill_at_a_random_moment_leaves_whole_files,
            a_file_limit_is_reported_and_leaves_whole_files,
            two_runs_at_once_do_not_mix,
            a_run_that_is_asked_to_stop_leaves_nothing_half_done,
        ],
        Strike::new().err() => [
            a_kill_before_any_call_leaves_whole_files,
            a_kill_while_bundles_are_exchanged_leaves_one_of_them,
            a_failing_disk_or_folder_is_reported_and_leaves_whole_files,
        ],
        mounter().err() => [a_small_disk_is_reported_and_leaves_whole_files],
        Somebody::new().err() => [a_closed_folder_is_reported_and_leaves_whole_files],
    }
}

/// Runs `act` on some of the scenarios; a failure names the scenario.
#[track_caller]
fn with(
    names: &[&str],
    seed: u64,
    mut act: impl FnMut(&Prepared, &mut Random) -> Result<Row, String>,
) {
    let mut random = Random::new(seed);
    for scenario in MAIN.iter().chain(MORE).filter(|s| names.contains(&s.name)) {
        let outcome = Prepared::new(scenario).and_then(|prepared| act(&prepared, &mut random));
        let row = outcome.unwrap_or_else(|reported| panic!("{}: {reported}", scenario.name));
        eprintln!("{}", table::line(&row));
    }
}

const EVERY: [&str; 9] = [
    "calibrate",
    "calibrate over older bundles",
    "sweep run",
    "map",
    "map over an older one",
    "optimize --out",
    "discretize --out",
    "replay --out",
    "sweep merge",
];

fn every_scenario_is_tried() {
    let all: Vec<&str> = MAIN.iter().chain(MORE).map(|s| s.name).collect();
    assert_eq!(all, EVERY);
}

fn a_kill_at_a_random_moment_leaves_whole_files() {
    with(&EVERY[..5], 1, |prepared, random| {
        kill::at_random(prepared, 4, random)
    });
}

fn a_kill_before_any_call_leaves_whole_files() {
    let strike = Strike::new().unwrap();
    with(&EVERY, 2, |prepared, random| {
        let every = strike.calls(prepared, How::Kill)?.div_ceil(4);
        strike.at_every(prepared, How::Kill, every, random)
    });
}

fn a_kill_while_bundles_are_exchanged_leaves_one_of_them() {
    let strike = Strike::new().unwrap();
    for how in [How::Renames, How::Plain] {
        with(&EVERY[1..2], 10, |prepared, random| {
            strike.at_every(prepared, how, 1, random)
        });
    }
}

fn a_failing_disk_or_folder_is_reported_and_leaves_whole_files() {
    let strike = Strike::new().unwrap();
    for how in [How::Full, How::Denied, How::Broken] {
        with(&EVERY, 3, |prepared, random| {
            let every = strike.calls(prepared, How::Kill)?.div_ceil(2);
            strike.at_every(prepared, how, every, random)
        });
    }
}

fn a_small_disk_is_reported_and_leaves_whole_files() {
    with(&["calibrate", "map"], 4, |prepared, random| {
        small_disk(prepared, 3, random)
    });
}

fn a_file_limit_is_reported_and_leaves_whole_files() {
    with(&["calibrate", "map"], 5, |prepared, random| {
        file_limit(prepared, 3, random)
    });
}

fn a_closed_folder_is_reported_and_leaves_whole_files() {
    let somebody = Somebody::new().unwrap();
    with(&["calibrate", "map", "sweep run"], 6, |prepared, random| {
        somebody.closed(prepared, 2, random)
    });
}

fn two_runs_at_once_do_not_mix() {
    with(&EVERY[..5], 7, |prepared, random| {
        same_inputs(prepared, 1, random)
    });
    let mut random = Random::new(8);
    for rivals in RIVALS {
        if let Err(reported) = other_inputs(rivals, 2, &mut random) {
            panic!("{}: {reported}", rivals.name);
        }
    }
}

fn a_run_that_is_asked_to_stop_leaves_nothing_half_done() {
    with(&EVERY, 9, |prepared, random| {
        asked_to_stop(prepared, 2, random)
    });
}
