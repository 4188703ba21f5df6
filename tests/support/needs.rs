//! Tests that need another program, reported as ignored where it is missing. The test harness that
//! Rust brings cannot decide that when tests run, so their targets have `harness = false`.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};
use std::sync::OnceLock;

use libtest_mimic::Arguments;
pub use libtest_mimic::Trial;

/// A test with the path of its function; `missing` names what it needs and this machine lacks.
#[must_use]
pub fn trial(path: &str, missing: Option<&str>, test: fn()) -> Trial {
    let name = path.split_once("::").map_or(path, |(_, name)| name);
    let trial = Trial::test(name, move || {
        test();
        Ok(())
    });
    match missing {
        None => trial,
        Some(missing) => trial
            .with_kind(format!("needs {missing}"))
            .with_ignored_flag(true),
    }
}

/// Runs them as the arguments of `cargo test` say.
#[must_use]
pub fn run(trials: impl IntoIterator<Item = Trial>) -> ExitCode {
    libtest_mimic::run(&Arguments::from_args(), trials.into_iter().collect()).exit_code()
}

/// `None => [tests that run anywhere], missing() => [tests that need something]`.
#[macro_export]
macro_rules! trials {
    ($($missing:expr => [$($test:ident),+ $(,)?]),+ $(,)?) => {{
        let mut trials = Vec::new();
        $(
            let missing: Option<String> = $missing;
            $(trials.push($crate::needs::trial(
                concat!(module_path!(), "::", stringify!($test)),
                missing.as_deref(),
                $test,
            ));)+
        )+
        trials
    }};
}

/// Whether a program answers with success.
pub fn answers(program: impl AsRef<OsStr>, arguments: &[&str]) -> bool {
    Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// A tool that a test needs, where `there` reports that it is missing; evaluated once.
fn missing(what: &str, asked: &OnceLock<bool>, there: impl FnOnce() -> bool) -> Option<String> {
    (!asked.get_or_init(there)).then(|| what.to_owned())
}

/// Python with numpy, where it is missing.
#[must_use]
pub fn numpy() -> Option<String> {
    static ASKED: OnceLock<bool> = OnceLock::new();
    missing("python3 with numpy", &ASKED, || {
        answers("python3", &["-c", "import numpy"])
    })
}

/// Python with VTK, the library that ParaView is made of, where it is missing.
#[must_use]
pub fn vtk() -> Option<String> {
    static ASKED: OnceLock<bool> = OnceLock::new();
    missing("python3 with vtk", &ASKED, || {
        answers("python3", &["-c", "import vtk"])
    })
}

/// Python without packages, where it is missing.
#[must_use]
pub fn python() -> Option<String> {
    static ASKED: OnceLock<bool> = OnceLock::new();
    missing("python3", &ASKED, || answers("python3", &["-c", "pass"]))
}

/// A C compiler, where it is missing.
#[must_use]
pub fn c_compiler() -> Option<String> {
    static ASKED: OnceLock<bool> = OnceLock::new();
    missing("a C compiler", &ASKED, || answers("cc", &["--version"]))
}

/// Compilers of C and C++, where one is missing.
#[must_use]
pub fn cpp_compiler() -> Option<String> {
    static ASKED: OnceLock<bool> = OnceLock::new();
    let cpp = || missing("a C++ compiler", &ASKED, || answers("c++", &["--version"]));
    c_compiler().or_else(cpp)
}

/// A C compiler with the address and undefined behaviour sanitizers, where it is missing.
#[must_use]
pub fn sanitizers() -> Option<String> {
    static ASKED: OnceLock<bool> = OnceLock::new();
    missing("a C compiler with sanitizers", &ASKED, || {
        let folder = tempfile::tempdir().unwrap();
        let [source, program] = ["a.c", "a"].map(|name| folder.path().join(name));
        std::fs::write(&source, "int main(void) { return 0; }\n").unwrap();
        let mut compiler = Command::new("cc");
        let built = compiler
            .args(SANITIZERS)
            .arg(source)
            .arg("-o")
            .arg(&program)
            .stderr(Stdio::null())
            .status();
        built.is_ok_and(|status| status.success()) && answers(program, &[])
    })
}

/// The flags that [`sanitizers`] asks for.
pub const SANITIZERS: [&str; 2] = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

/// Octave of version 7 or newer, where it is missing.
#[must_use]
pub fn octave() -> Option<String> {
    static ASKED: OnceLock<bool> = OnceLock::new();
    missing("octave-cli 7 or newer (Debian: octave)", &ASKED, || {
        let newer = "exit(compare_versions(version, '7.0.0', '<'))";
        answers("octave-cli", &["--norc", "--quiet", "--eval", newer])
    })
}

/// A program that a shell finds, where it is missing.
#[must_use]
pub fn tool(name: &str) -> Option<String> {
    let look = format!("command -v {name}");
    (!answers("sh", &["-c", &look])).then(|| name.to_owned())
}

/// The folder of real surface files with their index, `FLUXFORM_CORPUS`, where it is not named.
#[must_use]
pub fn corpus() -> Option<String> {
    let named = std::env::var_os("FLUXFORM_CORPUS").is_some();
    (!named).then(|| "a folder of surface files, named by FLUXFORM_CORPUS".to_owned())
}

/// The folder that [`corpus`] looks for.
///
/// # Panics
/// If none is named.
#[must_use]
pub fn corpus_folder() -> PathBuf {
    std::env::var_os("FLUXFORM_CORPUS")
        .expect("FLUXFORM_CORPUS names a folder")
        .into()
}
