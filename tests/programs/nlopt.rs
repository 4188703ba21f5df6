//! `optimize` against NLopt and an independent model of the coil (`scripts/nlopt_reference.py`).
//!
//! Needs a Python with numpy, scipy and nlopt (`scripts/nlopt_requirements.txt`): `python3`, or what
//! `FLUXFORM_PYTHON` names. Without one the tests are reported as ignored. `FLUXFORM_NLOPT=all` judges all problems
//! instead of those marked `ci`, and solves all of them again instead of those marked `again`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use fluxform::commands::evaluate::evaluate;
use fluxform::design::{Design, Need};
use fluxform_testing::needs::Trial;
use fluxform_testing::run::program;
use fluxform_testing::{Random, needs, root, trials};
use serde_json::{Value, json};

use super::python;

const DESIGNS: usize = 100;

pub fn trials() -> Vec<Trial> {
    trials! {
        missing() => [
            both_models_agree_on_random_designs,
            no_problem_has_a_better_coil_and_no_limit_is_missed,
            wrong_models_fail_the_judge,
            the_reference_is_what_its_script_finds,
        ],
    }
}

fn missing() -> Option<String> {
    let there = needs::answers(python(), &["-c", "import numpy, scipy, nlopt"]);
    (!there).then(|| "Python with numpy, scipy and nlopt".to_owned())
}

fn script(python: &Path, arguments: &[&str]) -> Output {
    Command::new(python)
        .arg("scripts/nlopt_reference.py")
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap()
}

/// The script's word; what it finds at fault fails the test.
#[track_caller]
fn passes(python: &Path, arguments: &[&str]) -> String {
    let run = script(python, arguments);
    let out = String::from_utf8(run.stdout).unwrap();
    let errors = String::from_utf8(run.stderr).unwrap();
    assert!(run.status.success(), "{arguments:?}\n{out}\n{errors}");
    println!("{out}");
    out
}

fn all() -> bool {
    std::env::var("FLUXFORM_NLOPT").is_ok_and(|what| what == "all")
}

/// Name and design of the problems: those marked `ci`, or all.
fn problems() -> BTreeMap<String, PathBuf> {
    let folder = root().join("tests/oracles/nlopt");
    let text = std::fs::read_to_string(folder.join("problems.json")).unwrap();
    let list: Value = serde_json::from_str(&text).unwrap();
    list["problems"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|problem| all() || problem["ci"] == true)
        .map(|problem| {
            let word = |key: &str| problem[key].as_str().unwrap().to_owned();
            (word("name"), folder.join(word("design")))
        })
        .collect()
}

#[allow(clippy::disallowed_methods)] // a test's own file
fn file_of(folder: &Path, name: &str, content: &Value) -> String {
    let path = folder.join(name);
    std::fs::write(&path, content.to_string()).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Output of `optimize` on a design, as the script's `--judge` takes it.
fn claim(design: &Path) -> Value {
    let run = Command::new(program())
        .args(["optimize", "--format", "json"])
        .arg(design)
        .current_dir(root())
        .output()
        .unwrap();
    let code = run.status.code();
    assert!(
        code == Some(0) || code == Some(4),
        "{}: {run:?}",
        design.display()
    );
    let result: Value = serde_json::from_slice(&run.stdout).unwrap();
    let coil = &result["coil"];
    if coil.is_null() {
        return json!({"status": result["status"]});
    }
    let sensitivities: BTreeMap<&String, &Value> = result["limits"]
        .as_object()
        .unwrap()
        .iter()
        .map(|(name, limit)| (name, &limit["sensitivity_n_per_unit"]))
        .collect();
    let mut claim = json!({
        "status": result["status"],
        "inner_diameter_m": coil["inner_diameter_m"],
        "outer_diameter_m": coil["outer_diameter_m"],
        "length_m": coil["length_m"],
        "wire_diameter_m": coil["wire_diameter_m"],
        "force_n": result["objective"]["force_n"],
        "sensitivity_n_per_unit": sensitivities,
    });
    if let Some(bound) = result["certificate"]["upper_bound_n"].as_f64() {
        claim["upper_bound_n"] = json!(bound);
    }
    claim
}

/// A random design and what `evaluate` says of it; with a core, within the box of the script's
/// table.
fn random_design(numbers: &mut Random, core: bool) -> Value {
    let mut mm = |low: f64, high: f64| (numbers.between(low, high) * 1e3).round() / 1e3;
    let inner = mm(4.5, 39.0);
    let outer = inner + 2.0 * mm(1.5, 13.5);
    let length = mm(21.0, 159.0);
    let wire = mm(0.05, 1.4);
    let current = mm(0.1, 7.0);
    let steel = if core {
        "[core]\nabove_mm = 0.0\nbelow_mm = 10.0\nrelative_permeability = 1000.0\n"
    } else {
        ""
    };
    let text = format!(
        "name = \"random\"\n[coil]\ninner_diameter_mm = {inner}\nouter_diameter_mm = {outer}\n\
         length_mm = {length}\n[wire]\ndiameter_mm = {wire}\n{steel}[supply]\n\
         current_max_a = {current}\n[target]\nheight_mm = 30.0\n"
    );
    let path = Path::new("random.toml");
    let (design, _) = Design::from_toml(&text, path, Need::EVALUATE).unwrap();
    let report_text = evaluate(&design, Vec::new(), None).unwrap();
    json!({
        "name": text.replace('\n', " "),
        "inner_diameter_m": report_text.coil.size.inner_diameter_m,
        "outer_diameter_m": report_text.coil.size.outer_diameter_m,
        "length_m": report_text.coil.size.length_m,
        "wire_diameter_m": design.wire.diameter_m,
        "current_a": report_text.target.current_a,
        "core": core,
        "force_n": report_text.target.force_n,
        "resistance_ohm": report_text.coil.circuit.resistance_ohm,
        "inductance_h": report_text.coil.circuit.inductance_h,
    })
}

fn both_models_agree_on_random_designs() {
    let python = python();
    let mut numbers = Random::new(7);
    let designs: Vec<Value> = (0..2 * DESIGNS)
        .map(|k| random_design(&mut numbers, k >= DESIGNS))
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let models = file_of(folder.path(), "models.json", &json!({"designs": designs}));
    let said = passes(&python, &["--models", &models]);
    assert!(
        said.contains("air force_n") && said.contains("cored inductance_h"),
        "{said}"
    );
    // A model that is a little wrong is not taken.
    let mut wrong = designs;
    wrong[0]["force_n"] = json!(wrong[0]["force_n"].as_f64().unwrap() * (1.0 + 1e-9));
    let models = file_of(folder.path(), "wrong.json", &json!({"designs": wrong}));
    assert!(!script(&python, &["--models", &models]).status.success());
}

fn no_problem_has_a_better_coil_and_no_limit_is_missed() {
    let python = python();
    let claims: BTreeMap<String, Value> = problems()
        .into_iter()
        .map(|(name, design)| (name, claim(&design)))
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let file = file_of(folder.path(), "claims.json", &json!({"problems": claims}));
    let mut arguments = vec!["--judge", &file];
    if !all() {
        arguments.extend(["--subset", "ci"]);
    }
    passes(&python, &arguments);
}

fn wrong_models_fail_the_judge() {
    let python = python();
    passes(&python, &["--mutants"]);
}

fn the_reference_is_what_its_script_finds() {
    let python = python();
    let which: &[&str] = if all() {
        &["--all"]
    } else {
        &["--subset", "again"]
    };
    passes(&python, which);
}
