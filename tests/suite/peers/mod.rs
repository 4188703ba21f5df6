//! Other programs on the same problems, in the same process tree.
//!
//! Every peer has a script under `scripts/peers` that reads a problem as JSON, solves it at several
//! settings of its own knob and prints rows of error and seconds. A script whose packages are not
//! installed says so; that is reported, and no error.

mod problems;

use std::path::{Path, PathBuf};
use std::process::Command;

use serde::Deserialize;

use super::stages::Measured;
use crate::file::{Curve, Row};
use fluxform::RunError;
use fluxform::bundle::atomic::{Overwrite, Scratch};
use fluxform::bundle::write::write_json;
use fluxform::progress::Progress;

/// Names Python interpreters, separated as in PATH; the first that has a peer's packages runs it.
pub const PYTHON: &str = "FLUXFORM_PYTHON";
/// Where the scripts lie, seen from the repository's root.
const SCRIPTS: &str = "scripts/peers";

/// Output of a script.
#[derive(Deserialize)]
struct Answer {
    #[serde(default)]
    curves: Vec<PeerCurve>,
    /// Packages that it needs and does not find, or versions that are not the pinned ones.
    #[serde(default)]
    missing: Vec<String>,
}

#[derive(Deserialize)]
struct PeerCurve {
    /// Name of this program's curve of the same problem.
    curve: String,
    peer: String,
    version: String,
    knob: String,
    rows: Vec<PeerRow>,
}

#[derive(Deserialize)]
struct PeerRow {
    knob: f64,
    items: u64,
    error: Option<f64>,
    seconds: f64,
    seconds_low: f64,
    seconds_high: f64,
    repeats: u64,
}

/// Adds the peers' curves to the stages measured, and says which peers there are none of.
///
/// # Errors
/// A scratch folder that cannot be made; interruption.
pub fn add(
    measured: &mut [Measured],
    quick: bool,
    progress: &dyn Progress,
) -> Result<Vec<String>, RunError> {
    let mut missing = Vec::new();
    let pythons = interpreters();
    let scratch = Scratch::new()?;
    let posed = problems::problems(measured, quick)?;
    progress.begin("peers", posed.len() as u64);
    for (number, problem) in posed.into_iter().enumerate() {
        progress.check()?;
        let script = Path::new(SCRIPTS).join(problem.script);
        if !script.is_file() {
            missing.push(format!(
                "{}: there is no {}; run from the repository's root",
                problem.script,
                script.display()
            ));
            continue;
        }
        let path = scratch.path().join(format!("{number}.json"));
        write_json(&path, &Overwrite::force(), &problem.content)?;
        let answer = ask(&pythons, &script, &path, &mut missing);
        let stage = measured
            .iter_mut()
            .find(|m| m.curves.stage == problem.stage);
        if let (Some(answer), Some(stage)) = (answer, stage) {
            let curves = answer.curves.into_iter();
            stage
                .curves
                .curves
                .extend(curves.map(|curve| reported(curve, &problem)));
        }
        progress.advance(1);
    }
    progress.end();
    missing.sort();
    missing.dedup();
    Ok(missing)
}

fn reported(found: PeerCurve, problem: &problems::Posed) -> Curve {
    let rows = found.rows.into_iter().map(|row| Row {
        knob: row.knob,
        default: false,
        items: row.items,
        error: row.error.unwrap_or(f64::NAN),
        stated_error: None,
        seconds: row.seconds,
        seconds_low: row.seconds_low,
        seconds_high: row.seconds_high,
        repeats: row.repeats,
    });
    Curve {
        name: found.curve,
        program: format!("{} {}", found.peer, found.version),
        knob: found.knob,
        reference: problem.reference.clone(),
        reference_error: problem.reference_error,
        // A peer that failed at a setting has no error there, and JSON no number for it.
        rows: rows.filter(|row| row.error.is_finite()).collect(),
    }
}

fn interpreters() -> Vec<PathBuf> {
    match std::env::var_os(PYTHON) {
        Some(given) if !given.is_empty() => std::env::split_paths(&given).collect(),
        _ => vec![PathBuf::from("python3")],
    }
}

/// The answer of the first interpreter that has what the script needs; with several, the curves of
/// all that give any.
fn ask(
    pythons: &[PathBuf],
    script: &Path,
    problem: &Path,
    missing: &mut Vec<String>,
) -> Option<Answer> {
    let name = script
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut all = Answer {
        curves: Vec::new(),
        missing: Vec::new(),
    };
    for python in pythons {
        let output = Command::new(python)
            .arg(script)
            .arg("--rows")
            .arg(problem)
            .envs(["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"].map(|n| (n, "1")))
            .output();
        let output = match output {
            Ok(output) => output,
            Err(error) => {
                all.missing.push(format!("{}: {error}", python.display()));
                continue;
            }
        };
        match serde_json::from_slice::<Answer>(&output.stdout) {
            Ok(answer) if output.status.success() => {
                let known =
                    |c: &PeerCurve, all: &Answer| all.curves.iter().any(|k| k.peer == c.peer);
                for curve in answer.curves {
                    if !known(&curve, &all) {
                        all.curves.push(curve);
                    }
                }
                let whole = answer.missing.is_empty();
                all.missing.extend(answer.missing);
                if whole {
                    break;
                }
            }
            _ => {
                let said = String::from_utf8_lossy(&output.stderr);
                let last = said.lines().next_back().unwrap_or("nothing");
                all.missing.push(format!("stopped and said: {last}"));
            }
        }
    }
    // A module that one interpreter lacks another may have.
    let found: Vec<&str> = all.curves.iter().map(|curve| curve.peer.as_str()).collect();
    let still = all.missing.iter().filter(|lacking| {
        !found
            .iter()
            .any(|peer| lacking.to_lowercase().starts_with(&peer.to_lowercase()))
    });
    missing.extend(still.map(|lacking| format!("{name}: {lacking}")));
    (!all.curves.is_empty()).then_some(all)
}
