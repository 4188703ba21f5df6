//! The same inputs give the same artefacts whatever made them: bytes with any number of threads, and
//! with another build, C library or set of vector instructions numbers within the error they state.
//!
//! `cargo test --locked --test builds -- --nocapture` prints what differs and by how much. Another
//! build is held against this one by naming it:
//!
//! ```text
//! cargo build --release --locked
//! FLUXFORM_OTHER=target/release/fluxform cargo test --locked --test builds another -- --nocapture
//! ```
#![cfg(unix)]
#![allow(clippy::disallowed_methods, clippy::print_stderr)] // a test's own files

mod difference;

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

use difference::{Difference, between};
use fluxform_testing::inputs::{OUT, scenes};
use fluxform_testing::place::Place;
use fluxform_testing::run::program;
use fluxform_testing::tree::{Tree, same, tree};
use fluxform_testing::{needs, trials};

fn main() -> ExitCode {
    needs::run(trials! {
        None => [threads_change_no_byte, the_c_library_may_do_without_avx2_and_fma],
        no_emulator() => [
            a_processor_without_avx2_and_fma_agrees,
            values_cached_by_another_processor_are_not_used,
        ],
        no_other_build() => [another_build_agrees],
    })
}

/// How the program is started.
#[derive(Clone, Default)]
struct Way {
    /// Before its arguments.
    start: Vec<String>,
    /// After them.
    flags: Vec<&'static str>,
    environment: Vec<(&'static str, &'static str)>,
}

impl Way {
    fn plain() -> Self {
        Self {
            start: vec![program().display().to_string()],
            ..Self::default()
        }
    }

    fn run(&self, place: &Place, args: &[&str]) -> Vec<u8> {
        let mut command = Command::new(&self.start[0]);
        command.args(&self.start[1..]).args(args).args(&self.flags);
        place.at_home(&mut command);
        let output = command
            .envs(self.environment.iter().copied())
            .stdout(std::process::Stdio::piped())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{args:?}: {said}");
        output.stdout
    }

    /// Outputs of every command that computes, from the same inputs.
    fn artefacts(&self) -> Tree {
        let place = scenes();
        for args in [
            &[
                "calibrate",
                "two.toml",
                "bump.toml",
                "ramp.toml",
                "--out",
                "out",
                "--no-report",
            ][..],
            &[
                "map",
                "air.toml",
                "--components",
                "all",
                "--csv",
                "--out",
                "out/map",
            ],
            &["map", "two.toml", "--out", "out/cored"],
            &[
                "sweep",
                "plan",
                "air.toml",
                "--set",
                "wire.diameter_mm=0.5,0.7",
                "--out",
                "plan.json",
            ],
            &["sweep", "run", "plan.json", "--out", "points"],
            &[
                "sweep",
                "merge",
                "plan.json",
                "points",
                "--out",
                "out/sweep.csv",
            ],
        ] {
            self.run(&place, args);
        }
        let mut tree = tree(&place.path(OUT));
        for (name, args) in [
            (
                "evaluate.json",
                &["evaluate", "two.toml", "--format", "json"][..],
            ),
            (
                "lambda.json",
                &["lambda", "air.toml", "ramp.toml", "--format", "json"],
            ),
            (
                "optimize.json",
                &["optimize", "air.toml", "--format", "json"],
            ),
        ] {
            tree.insert(name.to_owned(), self.run(&place, args));
        }
        // Cached values are no artefacts, and seconds are no numbers of the model.
        tree.retain(|path, _| !path.contains(".fluxform-cache") && !path.contains("timing"));
        tree
    }
}

/// Holds what `way` makes against what this build makes and prints what differs.
fn compared(name: &str, way: &Way) -> Vec<Difference> {
    let (here, there) = (Way::plain().artefacts(), way.artefacts());
    let names: Vec<&String> = here.keys().collect();
    assert_eq!(names, there.keys().collect::<Vec<_>>());
    let differences: Vec<Difference> = here
        .iter()
        .filter(|(path, bytes)| there[*path] != **bytes)
        .map(|(path, _)| between(path, &here, &there))
        .collect();
    eprintln!(
        "{name}: {} of {} files differ",
        differences.len(),
        here.len()
    );
    for difference in &differences {
        eprintln!("{difference}");
    }
    differences
}

#[track_caller]
fn agree(name: &str, way: &Way) {
    for difference in compared(name, way) {
        assert!(difference.within(), "{difference}");
    }
}

fn threads_change_no_byte() {
    for threads in ["1", "5"] {
        let mut way = Way::plain();
        way.flags = vec!["--threads", threads];
        assert!(compared(&format!("{threads} threads"), &way).is_empty());
    }
}

fn the_c_library_may_do_without_avx2_and_fma() {
    let mut way = Way::plain();
    let without = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F";
    way.environment = vec![("GLIBC_TUNABLES", without)];
    agree("the C library's plain functions", &way);
}

const EMULATOR: &str = "qemu-x86_64";

/// Reason to skip where no program emulates a processor without AVX.
fn no_emulator() -> Option<String> {
    let found = Command::new(EMULATOR).arg("--version").output();
    let there = cfg!(target_arch = "x86_64") && found.is_ok_and(|output| output.status.success());
    (!there).then(|| format!("{EMULATOR} (Debian: qemu-user)"))
}

/// A processor without AVX, emulated.
fn old_processor() -> Way {
    let mut way = Way::plain();
    let program = program().display().to_string();
    let start = [EMULATOR, "-cpu", "Westmere", &program];
    way.start = start.map(str::to_owned).to_vec();
    way
}

fn a_processor_without_avx2_and_fma_agrees() {
    agree("a processor without AVX2 and FMA", &old_processor());
}

fn values_cached_by_another_processor_are_not_used() {
    let way = old_processor();
    let args = [
        "calibrate",
        "two.toml",
        "bump.toml",
        "--out",
        "out",
        "--no-report",
    ];
    let (shared, own) = (scenes(), scenes());
    Way::plain().run(&shared, &args);
    way.run(&shared, &args);
    way.run(&own, &args);
    same(&tree(&shared.path(OUT)), &tree(&own.path(OUT))).unwrap();
}

fn other_build() -> Option<OsString> {
    std::env::var_os("FLUXFORM_OTHER")
}

fn no_other_build() -> Option<String> {
    let missing = "FLUXFORM_OTHER to name another build";
    other_build().is_none().then(|| missing.to_owned())
}

fn another_build_agrees() {
    let other = other_build().unwrap_or_default();
    let other = PathBuf::from(&other)
        .canonicalize()
        .unwrap_or_else(|error| {
            panic!("FLUXFORM_OTHER={}: {error}", other.display());
        });
    let mut way = Way::plain();
    way.start = vec![other.display().to_string()];
    agree(&format!("{}", other.display()), &way);
}
