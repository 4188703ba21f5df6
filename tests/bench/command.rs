//! `bench` as a command.

use std::path::Path;
use std::process::{Command, Output};

fn bench(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fluxform"))
        .arg("bench")
        .args(arguments)
        .current_dir(folder)
        .env("FLUXFORM_PYTHON", folder.join("no-python"))
        .output()
        .unwrap()
}

fn json(output: &Output) -> serde_json::Value {
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_stage_is_measured_and_told_as_json() {
    let folder = tempfile::tempdir().unwrap();
    let stage = ["--quick", "--stage", "inductance"];
    let told = json(&bench(
        folder.path(),
        &[&stage[..], &["--format", "json"]].concat(),
    ));
    assert_eq!(told["stages"][0]["stage"], "inductance");
    let rows = &told["stages"][0]["curves"][0]["rows"];
    assert_eq!(rows.as_array().unwrap().len(), 3);
    // The default folder holds the same, warnings aside.
    let written = std::fs::read(folder.path().join("results/bench/bench.json")).unwrap();
    let written: serde_json::Value = serde_json::from_slice(&written).unwrap();
    assert_eq!(written["stages"], told["stages"]);
    let human = bench(folder.path(), &[&stage[..], &["--out", "b"]].concat());
    let said = String::from_utf8(human.stdout).unwrap();
    assert!(
        said.contains("mutual inductance") && said.contains("summary.md"),
        "{said}"
    );
    assert_eq!(
        bench(folder.path(), &["--stage", "moons"]).status.code(),
        Some(2)
    );
}

#[test]
fn a_missing_peer_is_told_and_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let scripts = folder.path().join("scripts/peers");
    std::fs::create_dir_all(&scripts).unwrap();
    let asked = [
        "--quick",
        "--stage",
        "inductance",
        "--peers",
        "--format",
        "json",
    ];
    let without = json(&bench(folder.path(), &asked));
    assert!(
        without["peers_missing"][0]
            .as_str()
            .unwrap()
            .contains("there is no")
    );
    std::fs::write(scripts.join("inductance_cfsem.py"), "").unwrap();
    let told = json(&bench(folder.path(), &asked));
    let missing = told["peers_missing"][0].as_str().unwrap();
    assert!(missing.starts_with("inductance_cfsem.py: "), "{missing}");
    assert_eq!(told["stages"][0]["curves"].as_array().unwrap().len(), 3);
}

#[test]
fn one_row_of_the_scaling_is_a_process_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let row = json(&bench(
        folder.path(),
        &["--size-row", "lambda-path:points:11:1"],
    ));
    assert_eq!(row["size"], 121.0);
    assert!(row["seconds"].as_f64().unwrap() > 0.0);
    if cfg!(target_os = "linux") {
        assert!(row["peak_bytes"].as_u64().unwrap() > 1 << 20);
    }
    for wrong in ["lambda-path:points:11", "lambda-path:points:x:1"] {
        assert_eq!(
            bench(folder.path(), &["--size-row", wrong]).status.code(),
            Some(2)
        );
    }
    assert_eq!(
        bench(folder.path(), &["--size-row", "a:b:1:1"])
            .status
            .code(),
        Some(3)
    );
}
