//! The Python package as people get it: the wheel is built, installed into an empty virtual
//! environment where no compiler is to be found, and used there.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use fluxform_testing::needs::Trial;
use fluxform_testing::{needs, root, trials};
use tempfile::TempDir;

pub fn trials() -> Vec<Trial> {
    let missing = || needs::numpy().or_else(|| needs::tool("maturin"));
    trials! {
        missing() => [
            the_program_is_in_the_wheel,
            the_source_distribution_holds_what_a_build_needs,
            the_module_gives_the_numbers_of_the_command,
            a_bundle_gives_the_currents_of_the_loader_that_works_alone,
            documents_in_memory_are_files_to_every_command,
            a_failure_carries_code_place_and_advice,
            ctrl_c_stops_a_computation_and_the_next_one_runs,
            progress_is_reported,
            the_examples_of_the_documentation_run,
            the_notebook_runs_from_a_design_to_felt_forces,
        ],
    }
}

/// The wheel in a virtual environment that sees numpy and nothing else of this machine's tools.
static INSTALLED: LazyLock<(TempDir, PathBuf)> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let (wheels, environment) = (
        folder.path().join("wheels"),
        folder.path().join("environment"),
    );
    run(Command::new("maturin")
        .args([
            "build",
            "--quiet",
            "--profile",
            "dev",
            "--features",
            "tests",
            "--manifest-path",
        ])
        .arg(root().join("src/python/Cargo.toml"))
        .arg("--out")
        .arg(&wheels));
    let wheel = std::fs::read_dir(&wheels).unwrap().next().unwrap().unwrap();
    run(Command::new("python3")
        .args(["-m", "venv", "--system-site-packages"])
        .arg(&environment));
    let python = environment.join("bin/python");
    run(Command::new(&python)
        .args(["-m", "pip", "install", "--quiet", "--no-index", "--no-deps"])
        .arg(wheel.path())
        .env("PATH", environment.join("bin")));
    (folder, environment.join("bin"))
});

/// Runs a program that must end well and returns its output.
fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(
        output.status.success(),
        "{command:?}\n{}\n{}",
        text(&output.stdout),
        text(&output.stderr)
    );
    text(&output.stdout)
}

/// A program of the environment, in a folder with the repository's designs and shapes.
fn installed(program: &str, folder: &Path) -> Command {
    for inputs in ["designs", "shapes"] {
        std::os::unix::fs::symlink(root().join(inputs), folder.join(inputs)).unwrap();
    }
    let mut command = Command::new(INSTALLED.1.join(program));
    command
        .current_dir(folder)
        .env("PATH", &INSTALLED.1)
        .env("PYTHONDONTWRITEBYTECODE", "1");
    command
}

/// Runs a function of `checks.py`.
fn check(name: &str) {
    let folder = tempfile::tempdir().unwrap();
    let script = root().join("tests/programs/wheel/checks.py");
    run(installed("python", folder.path()).arg(script).arg(name));
}

fn the_program_is_in_the_wheel() {
    let folder = tempfile::tempdir().unwrap();
    let version = run(installed("fluxform", folder.path()).arg("--version"));
    let stated = format!("fluxform {}", env!("CARGO_PKG_VERSION"));
    assert!(version.starts_with(&stated), "{version}");
    let ran = installed("fluxform", tempfile::tempdir().unwrap().path())
        .args(["evaluate", "none.toml"])
        .output();
    assert_eq!(ran.unwrap().status.code(), Some(3));
}

/// Where there is no wheel pip builds from sources: their manifests and every file that is compiled in.
fn the_source_distribution_holds_what_a_build_needs() {
    let folder = tempfile::tempdir().unwrap();
    let in_folder = |program: &str| {
        let mut command = Command::new(program);
        command.current_dir(folder.path());
        command
    };
    run(in_folder("maturin")
        .args(["sdist", "--out", "made", "--manifest-path"])
        .arg(root().join("src/python/Cargo.toml")));
    let version = env!("CARGO_PKG_VERSION");
    let archive = format!("made/fluxform-{version}.tar.gz");
    run(in_folder("python3").args(["-m", "tarfile", "-e", &archive, "unpacked"]));
    let tree = format!("unpacked/fluxform-{version}");
    run(in_folder("cargo")
        .args(["metadata", "--locked", "--format-version", "1"])
        .args(["--manifest-path", &format!("{tree}/src/python/Cargo.toml")]));
    let is_compiled_in = |line: &str| {
        let (_, rest) = line.split_once("include_str!(\"")?;
        Some(rest.split_once('"')?.0.to_owned())
    };
    let compiling_in = [
        "src/render/report/frame.rs",
        "src/bundle/schema.rs",
        "src/cli/code.rs",
        "src/shape/step/kernel.rs",
    ];
    for source in compiling_in {
        let text = std::fs::read_to_string(root().join(source)).unwrap();
        assert!(text.lines().any(|line| is_compiled_in(line).is_some()));
        let beside = Path::new(source).parent().unwrap();
        for named in text.lines().filter_map(is_compiled_in) {
            let file = folder.path().join(&tree).join(beside).join(&named);
            assert!(file.is_file(), "{source}: {named} is not in the archive");
        }
    }
}

fn the_module_gives_the_numbers_of_the_command() {
    check("numbers_of_the_command");
}

fn a_bundle_gives_the_currents_of_the_loader_that_works_alone() {
    check("currents_of_the_loader");
}

fn documents_in_memory_are_files_to_every_command() {
    check("documents_in_memory");
}

fn a_failure_carries_code_place_and_advice() {
    check("failures");
}

fn ctrl_c_stops_a_computation_and_the_next_one_runs() {
    check("interruption");
}

fn progress_is_reported() {
    check("progress");
}

fn the_examples_of_the_documentation_run() {
    let folder = tempfile::tempdir().unwrap();
    let readme = root().join("src/python/README.md");
    run(installed("python", folder.path())
        .args(["-m", "doctest"])
        .arg(readme));
    check("docstrings");
}

fn the_notebook_runs_from_a_design_to_felt_forces() {
    let folder = tempfile::tempdir().unwrap();
    let script = root().join("tests/programs/wheel/checks.py");
    let printed = run(installed("python", folder.path())
        .arg(script)
        .arg("notebook")
        .arg(root().join("src/python/felt_force.ipynb")));
    let lines: usize = printed.lines().last().unwrap().parse().unwrap();
    assert!(lines <= 25, "{lines} lines of code");
}
