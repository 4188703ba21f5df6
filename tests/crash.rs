//! Nothing is lost when the machine or the user misbehaves: a run that is killed, interrupted, finds
//! the disk full or the folder closed, or meets another one in the same folder, leaves files that are
//! whole or absent, bundles that verify, and a place where the same command ends well and leaves
//! what an undisturbed run leaves, to the byte.
//!
//! Here some of each; `cargo bench --locked --bench crash_safety -- 500` does all of it at length.
#![cfg(unix)] // signals, permissions
#![allow(clippy::disallowed_methods, clippy::print_stderr)] // a test's own files and clock

#[path = "crash/disk.rs"]
mod disk;
#[path = "crash/kill.rs"]
mod kill;
#[path = "crash/place.rs"]
mod place;
#[path = "crash/regression.rs"]
mod regression;
#[path = "crash/scenario.rs"]
mod scenario;
#[allow(dead_code)] // the table is for the long version
#[path = "crash/table.rs"]
mod table;
#[path = "crash/together.rs"]
mod together;

use disk::{Somebody, file_limit, small_disk};
use kill::{How, Strike};
use place::Dice;
use scenario::{MAIN, MORE, Prepared};
use table::Row;
use together::{RIVALS, asked_to_stop, other_inputs, same_inputs};

/// Does it with some of the scenarios and tells what failed and where.
#[track_caller]
fn with(
    names: &[&str],
    seed: u64,
    mut act: impl FnMut(&Prepared, &mut Dice) -> Result<Row, String>,
) {
    let mut dice = Dice::new(seed);
    for scenario in MAIN.iter().chain(MORE).filter(|s| names.contains(&s.name)) {
        let outcome = Prepared::new(scenario).and_then(|prepared| act(&prepared, &mut dice));
        let row = outcome.unwrap_or_else(|told| panic!("{}: {told}", scenario.name));
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

#[test]
fn every_scenario_is_tried() {
    let all: Vec<&str> = MAIN.iter().chain(MORE).map(|s| s.name).collect();
    assert_eq!(all, EVERY);
}

#[test]
fn a_kill_at_a_random_moment_leaves_whole_files() {
    with(&EVERY[..5], 1, |prepared, dice| {
        kill::at_random(prepared, 4, dice)
    });
}

#[test]
fn a_kill_before_any_call_leaves_whole_files() {
    match Strike::new() {
        Ok(strike) => {
            with(&EVERY, 2, |prepared, dice| {
                let every = strike.calls(prepared, How::Kill)?.div_ceil(4);
                strike.at_every(prepared, How::Kill, every, dice)
            });
        }
        Err(reason) => eprintln!("skipped: {reason}"),
    }
}

#[test]
fn a_kill_while_bundles_are_exchanged_leaves_one_of_them() {
    match Strike::new() {
        Ok(strike) => {
            for how in [How::Renames, How::Plain] {
                with(&EVERY[1..2], 10, |prepared, dice| {
                    strike.at_every(prepared, how, 1, dice)
                });
            }
        }
        Err(reason) => eprintln!("skipped: {reason}"),
    }
}

#[test]
fn a_disk_or_folder_that_gives_out_is_told_and_leaves_whole_files() {
    match Strike::new() {
        Ok(strike) => {
            for how in [How::Full, How::Denied, How::Broken] {
                with(&EVERY, 3, |prepared, dice| {
                    let every = strike.calls(prepared, How::Kill)?.div_ceil(2);
                    strike.at_every(prepared, how, every, dice)
                });
            }
        }
        Err(reason) => eprintln!("skipped: {reason}"),
    }
}

#[test]
fn a_small_disk_is_told_and_leaves_whole_files() {
    with(
        &["calibrate", "map"],
        4,
        |prepared, dice| match small_disk(prepared, 3, dice) {
            Err(reason) if reason.starts_with("no disk") => {
                eprintln!("skipped: {reason}");
                Ok(Row::new(prepared.scenario.name, "skipped"))
            }
            outcome => outcome,
        },
    );
    with(&["calibrate", "map"], 5, |prepared, dice| {
        file_limit(prepared, 3, dice)
    });
}

#[test]
fn a_closed_folder_is_told_and_leaves_whole_files() {
    match Somebody::new() {
        Ok(somebody) => with(&["calibrate", "map", "sweep run"], 6, |prepared, dice| {
            somebody.closed(prepared, 2, dice)
        }),
        Err(reason) => eprintln!("skipped: {reason}"),
    }
}

#[test]
fn two_runs_at_once_do_not_mix() {
    with(&EVERY[..5], 7, |prepared, dice| {
        same_inputs(prepared, 1, dice)
    });
    let mut dice = Dice::new(8);
    for rivals in RIVALS {
        if let Err(told) = other_inputs(rivals, 2, &mut dice) {
            panic!("{}: {told}", rivals.name);
        }
    }
}

#[test]
fn a_run_that_is_asked_to_stop_leaves_nothing_half_done() {
    with(&EVERY, 9, |prepared, dice| asked_to_stop(prepared, 2, dice));
}
