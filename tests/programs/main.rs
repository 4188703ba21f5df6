//! What needs another program beside Rust: Python with its packages, Octave, a browser, a terminal, a cluster.
#![allow(clippy::disallowed_methods, clippy::print_stderr, clippy::print_stdout)]

mod cluster;
mod compare;
mod magmanip;
mod nlopt;
mod octave;
mod report;
mod step;
mod terminal;
mod wheel;

use std::path::PathBuf;
use std::process::ExitCode;

/// `python3`, or the one that `FLUXFORM_PYTHON` names.
fn python() -> PathBuf {
    std::env::var_os("FLUXFORM_PYTHON").map_or_else(|| "python3".into(), PathBuf::from)
}

fn main() -> ExitCode {
    let rooms = [
        wheel::trials(),
        nlopt::trials(),
        report::trials(),
        step::trials(),
        octave::trials(),
        magmanip::trials(),
        compare::trials(),
        terminal::trials(),
        cluster::trials(),
    ];
    // In turn, the longest first: the tests of the wheel wait for it to be built, and others for a process each.
    let most = rooms.iter().map(Vec::len).max().unwrap_or(0);
    let mut rooms = rooms.map(Vec::into_iter);
    let in_turn = (0..most).flat_map(|_| {
        let next: Vec<_> = rooms.iter_mut().filter_map(Iterator::next).collect();
        next
    });
    fluxform_testing::needs::run(in_turn)
}
