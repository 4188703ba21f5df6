//! All of `tests/planted`: every case, with a row each.
//!
//! ```text
//! cargo bench --locked --bench planted -- [--rows] [--command map]
//! FLUXFORM_OTHER=target/release/fluxform cargo bench --locked --bench planted
//! ```
//!
//! Plants links, foreign files, foreign manifests and the user's own files at every name that a
//! command may touch, runs it with and without `--force`, with good and with spoilt inputs, and
//! compares every byte, mode, type and link target of what is the user's. Ends with an error where
//! one changed. `--rows` prints a line for every case instead of those that changed alone.

// A measurement: it prints and ends with a code.
#![allow(clippy::print_stdout, clippy::disallowed_methods, clippy::exit)]

#[cfg(target_os = "linux")]
mod cases;
#[cfg(target_os = "linux")]
mod commands;
#[cfg(target_os = "linux")]
mod inputs_as_outputs;
#[cfg(target_os = "linux")]
mod judge;
#[cfg(target_os = "linux")]
mod run;
#[cfg(target_os = "linux")]
mod snapshot;

#[cfg(not(target_os = "linux"))]
fn main() {
    println!("skipped: links and pipes are those of Linux");
}

/// Measures take seconds: every so many cases of theirs one.
#[cfg(target_os = "linux")]
const MEASURES_EVERY: usize = 7;

#[cfg(target_os = "linux")]
fn main() {
    let words: Vec<String> = std::env::args().collect();
    let only = words
        .iter()
        .position(|word| word == "--command")
        .and_then(|at| words.get(at + 1));
    let chosen = |commands: &[commands::Writes]| -> Vec<_> {
        let expected = commands
            .iter()
            .filter(|writes| only.is_none_or(|only| writes.name == only));
        expected.copied().collect()
    };
    let mut rows = run::rows(&chosen(commands::COMMANDS), 1);
    rows.extend(run::rows(&chosen(commands::MEASURES), MEASURES_EVERY));
    let changed: Vec<_> = rows
        .iter()
        .filter(|row| !row.changed.is_empty())
        .cloned()
        .collect();
    if words.iter().any(|word| word == "--rows") {
        println!("{}", run::lines(&rows, false));
    } else if !changed.is_empty() {
        println!("{}", run::lines(&changed, false));
    }
    println!("{}", run::summary(&rows, "planted", |row| row.planted));
    println!("{}", run::summary(&rows, "command", |row| row.command));
    if !changed.is_empty() {
        std::process::exit(1);
    }
}
