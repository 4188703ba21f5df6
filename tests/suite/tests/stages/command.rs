//! The suite as a command.

use std::path::Path;
use std::process::{Command, Output};

fn bench(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fluxform-bench"))
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
fn a_stage_is_measured_and_reported_as_json() {
    let folder = tempfile::tempdir().unwrap();
    let stage = ["--quick", "--stage", "inductance"];
    let reported = json(&bench(
        folder.path(),
        &[&stage[..], &["--format", "json"]].concat(),
    ));
    assert_eq!(reported["stages"][0]["stage"], "inductance");
    let rows = &reported["stages"][0]["curves"][0]["rows"];
    assert_eq!(rows.as_array().unwrap().len(), 3);
    // A part of the curves leaves the tables of a whole run alone; the same is written, warnings aside.
    assert!(!folder.path().join("results/bench").exists());
    let written = std::fs::read(folder.path().join("results/bench-part/bench.json")).unwrap();
    let written: serde_json::Value = serde_json::from_slice(&written).unwrap();
    assert_eq!(written["stages"], reported["stages"]);
    let human = bench(folder.path(), &[&stage[..], &["--out", "b"]].concat());
    let said = String::from_utf8(human.stdout).unwrap();
    assert!(
        said.contains("mutual inductance") && said.contains("report.html"),
        "{said}"
    );
    assert_eq!(
        bench(folder.path(), &["--stage", "moons"]).status.code(),
        Some(2)
    );
}

#[test]
fn only_a_whole_run_replaces_the_recorded_tables() {
    let folder = tempfile::tempdir().unwrap();
    // An existing file that is no output of ours stops a run before it measures anything.
    let kept = ["results/bench", "results/bench-part"].map(|at| folder.path().join(at));
    for at in &kept {
        std::fs::create_dir_all(at).unwrap();
        std::fs::write(at.join("bench.json"), "mine").unwrap();
    }
    let refused = |arguments: &[&str]| {
        let output = bench(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(4), "{arguments:?} {output:?}");
        let said = String::from_utf8_lossy(&output.stderr).replace(['\n', ' '], "");
        (
            said.contains("results/bench/bench.json"),
            said.contains("results/bench-part/bench.json"),
        )
    };
    assert_eq!(refused(&[]), (true, false));
    for part in [
        &["--quick"][..],
        &["--peers"],
        &["--scaling"],
        &["--stage", "replay"],
    ] {
        assert_eq!(refused(part), (false, true), "{part:?}");
    }
    assert_eq!(
        refused(&["--quick", "--out", "results/bench"]),
        (true, false)
    );
    for at in &kept {
        assert_eq!(std::fs::read(at.join("bench.json")).unwrap(), b"mine");
    }
}

#[test]
fn the_catalogue_is_written_to_the_given_folder_only() {
    let folder = tempfile::tempdir().unwrap();
    let asked = ["--extreme", "--case", "wires: wound of 0.7 mm"];
    let without = bench(folder.path(), &asked);
    assert!(without.status.success(), "{without:?}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    let with = [&asked[..], &["--out", "c"]].concat();
    for _ in 0..2 {
        let run = bench(folder.path(), &with);
        assert!(run.status.success(), "{run:?}");
    }
    let read = |name: &str| std::fs::read_to_string(folder.path().join("c").join(name)).unwrap();
    let reported: serde_json::Value = serde_json::from_str(&read("extreme.json")).unwrap();
    assert_eq!(reported["cases"].as_array().unwrap().len(), 1);
    assert_eq!(read("extreme.csv").lines().count(), 2);
    assert!(read("report.html").contains("1 of 1 case at the limits"));
    // Another's page is not replaced.
    std::fs::create_dir(folder.path().join("d")).unwrap();
    std::fs::write(folder.path().join("d/report.html"), "mine").unwrap();
    let other = bench(folder.path(), &[&asked[..], &["--out", "d"]].concat());
    assert_eq!(other.status.code(), Some(4), "{other:?}");
}

#[test]
fn a_missing_peer_is_reported_and_no_error() {
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
    let reported = json(&bench(folder.path(), &asked));
    let missing = reported["peers_missing"][0].as_str().unwrap();
    assert!(missing.starts_with("inductance_cfsem.py: "), "{missing}");
    assert_eq!(reported["stages"][0]["curves"].as_array().unwrap().len(), 3);
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

#[test]
fn laws_that_are_not_measured_again_stay() {
    let folder = tempfile::tempdir().unwrap();
    let measured = |stage: &[&str], law: &str| {
        let part = ["--quick", "--scaling", "--law", law, "--format", "json"];
        json(&bench(folder.path(), &[stage, &part].concat()))
    };
    let first = measured(&["--stage", "inductance"], "lambda-path:points");
    let points = &first["scaling"];
    // Without a stage no curve is measured again, and those of the folder stay.
    let second = measured(&[], "inductance:coils");
    assert_eq!(second["stages"].as_array().unwrap().len(), 1);
    for kept in ["stages", "accuracy", "inputs", "made_with"] {
        assert_eq!(second[kept], first[kept], "{kept}");
    }
    let table =
        std::fs::read_to_string(folder.path().join("results/bench-part/bench.csv")).unwrap();
    assert!(
        table
            .lines()
            .skip(1)
            .all(|row| row.starts_with("inductance,"))
            && table.lines().count() > 3
    );
    let both = &second["scaling"];
    let laws = both.as_array().unwrap();
    // In the order of a whole run, whichever was measured last.
    assert_eq!(
        [&laws[0]["stage"], &laws[1]["stage"]],
        ["inductance", "lambda-path"]
    );
    assert_eq!((laws.len(), &laws[1]), (2, &points[0]));
    let refused = bench(folder.path(), &["--scaling", "--law", "moons:points"]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    let without = bench(folder.path(), &["--law", "inductance:coils"]);
    assert_eq!(without.status.code(), Some(2), "{without:?}");
}

#[test]
fn help_names_every_mode_and_its_examples_work() {
    let folder = tempfile::tempdir().unwrap();
    let help = bench(folder.path(), &["--help"]);
    assert!(help.status.success());
    let page = String::from_utf8(help.stdout).unwrap();
    for part in [
        "--quick",
        "--extreme",
        "--peers",
        "--scaling",
        "Exit codes:",
        "130  interrupted",
    ] {
        assert!(page.contains(part), "{part}: {page}");
    }
    let examples = page.split("Examples:").nth(1).unwrap().lines();
    let typed = examples.filter_map(|line| line.trim().strip_prefix("fluxform-bench "));
    let mut count = 0;
    for line in typed {
        let arguments: Vec<&str> = line.split(' ').collect();
        let ran = bench(folder.path(), &arguments);
        assert!(ran.status.success(), "{line}: {ran:?}");
        count += 1;
    }
    assert!(count >= 3, "{page}");
}

#[test]
#[cfg(unix)]
fn a_signal_ends_a_run_without_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Command::new(env!("CARGO_BIN_EXE_fluxform-bench"))
        .args(["--out", "b"])
        .current_dir(folder.path())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(900));
    let asked = Command::new("kill")
        .args(["-INT", &run.id().to_string()])
        .status();
    assert!(asked.unwrap().success());
    assert_eq!(run.wait().unwrap().code(), Some(130));
    assert!(!folder.path().join("b").exists());
}
