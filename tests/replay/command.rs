//! `fluxform replay` as its users meet it.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

use crate::support::in_air;

/// How a run ended.
struct Ran {
    code: Option<i32>,
    out: String,
    err: String,
}

impl Ran {
    #[track_caller]
    fn ends(self, code: i32, words: &[&str]) -> Self {
        assert_eq!(self.code, Some(code), "{}\n{}", self.out, self.err);
        for word in words {
            assert!(self.err.contains(word), "{word:?} is missing: {}", self.err);
        }
        self
    }

    #[track_caller]
    fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|e| panic!("{e}: {}", self.out))
    }
}

/// A folder with a copy of a bundle in `flat`.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(TempDir::new().unwrap());
        let copy = place.path("flat");
        std::fs::create_dir(&copy).unwrap();
        for entry in std::fs::read_dir(in_air().folder("flat")).unwrap() {
            let entry = entry.unwrap();
            std::fs::copy(entry.path(), copy.join(entry.file_name())).unwrap();
        }
        place
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn run(&self, args: &str) -> Ran {
        self.run_with(args, "")
    }

    fn run_with(&self, args: &str, input: &str) -> Ran {
        let mut child = Command::new(env!("CARGO_BIN_EXE_fluxform"))
            .arg("replay")
            .args(args.split_whitespace())
            .current_dir(self.0.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        let output = child.wait_with_output().unwrap();
        Ran {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

const FINGER: &str = "t_s,x_m,y_m,z_m\n0,0.003,0.007,0.05\n0.02,0.004,0.007,0.051\n\
                      0.04,0.3,0,0.05\n";

#[test]
fn a_table_with_facts_seconds_and_a_picture() {
    let place = Place::new();
    place.write("finger.csv", FINGER);
    place.run("flat finger.csv --plot replay.svg").ends(0, &[]);
    let table = place.read("replay.csv");
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(
        lines[0],
        "t_s,x_m,y_m,z_m,wanted_force_n,force_n,error_n,current_0_a,current_1_a,current_2_a,\
         current_3_a,current_4_a,current_5_a,current_6_a,current_7_a,current_8_a,\
         static_force_n,static_error_n,status"
    );
    assert_eq!(lines.len(), 4);
    let lambda = serde_json::from_str::<Value>(&place.read("flat/manifest.json")).unwrap()["lambda"]
        ["lambda_n_per_m"]
        .as_f64()
        .unwrap();
    let wanted: f64 = lines[1].split(',').nth(4).unwrap().parse().unwrap();
    assert!((wanted / (0.05 * lambda) - 1.0).abs() < 1e-12);
    assert!(lines[3].starts_with("0.04,0.3,0,0.05,0,0,0,0,") && lines[3].ends_with(",outside"));
    let facts: Value = serde_json::from_str(&place.read("replay.json")).unwrap();
    assert_eq!(facts["schema_version"], "1.4.0");
    assert_eq!(facts["inputs"][0]["path"], "flat/manifest.json");
    assert_eq!(facts["inputs"][1]["path"], "finger.csv");
    assert_eq!(facts["trajectory"]["positions"], 3);
    assert!(facts["force"]["feedback"]["worst_at"]["t_s"].is_number());
    assert!(facts["force"]["static"]["rms_error_n"].as_f64().unwrap() > 0.0);
    assert_eq!(facts["currents"]["max_a"].as_array().unwrap().len(), 9);
    assert!(facts["accuracy"]["force"]["estimate"].as_f64().unwrap() < 1e-3);
    assert!((facts["outside_time_fraction"].as_f64().unwrap() - 1.0 / 3.0).abs() < 1e-12);
    assert!(!place.read("replay.json").contains("seconds"));
    let timing: Value = serde_json::from_str(&place.read("timing_replay.json")).unwrap();
    assert!(timing["seconds_per_step"].as_f64().unwrap() > 0.0);
    assert!(place.read("replay.svg").ends_with("</svg>"));
    // The same inputs replace, others do not.
    place.run("flat finger.csv --threads 1").ends(0, &[]);
    assert_eq!(place.read("replay.csv"), table);
    place.write("other.csv", &FINGER.replace("0.003", "0.0031"));
    place
        .run("flat other.csv")
        .ends(4, &["was made from other inputs", "--force"]);
    place.run("flat other.csv --force").ends(0, &[]);
    place.write("mine.svg", "mine");
    place
        .run("flat finger.csv --out new.csv --plot mine.svg")
        .ends(4, &["mine.svg exists"]);
    assert!(!place.path("new.csv").exists() && place.read("mine.svg") == "mine");
}

#[test]
fn streams_and_json_hold_one_thing_each() {
    let place = Place::new();
    let ran = place.run_with("flat - --out - --dynamics", FINGER);
    let ran = ran.ends(0, &["time constants", "feedback"]);
    let header = ran.out.lines().next().unwrap();
    assert!(header.contains(",commanded_0_a,") && header.ends_with(",status"));
    assert_eq!(ran.out.lines().count(), 4);
    assert!(!place.path("replay.csv").exists());
    let told = place
        .run("flat --synthesize circle --format json --duration 2")
        .ends(0, &[]);
    let told = told.json();
    assert_eq!(told["trajectory"]["positions"], 101);
    assert_eq!(told["trajectory"]["source"], "a circle");
    assert_eq!(told["warnings"], serde_json::json!([]));
}

#[test]
fn a_made_up_trajectory_replays_to_the_same_table() {
    let place = Place::new();
    let made = "flat --synthesize explore --seed 7 --duration 3 --trajectory-out finger.csv";
    place.run(&format!("{made} --out made.csv")).ends(0, &[]);
    place.run("flat finger.csv --out read.csv").ends(0, &[]);
    assert_eq!(place.read("made.csv"), place.read("read.csv"));
    assert_eq!(place.read("finger.csv").lines().count(), 152);
}

#[test]
fn bad_trajectories_are_told_with_their_line() {
    let place = Place::new();
    for (text, words) in [
        ("", &["bad.csv:1: column t_s is missing"][..]),
        ("t_s,x_m,y_m\n", &["bad.csv:1: column z_m is missing"]),
        ("t_s,x_m,y_m,z_m\n", &["bad.csv: holds no position"]),
        (
            "t_s,x_m,y_m,z_m\n0,0,0,0.05\n0.02,0,NaN,0.05\n0.04,0,0\n",
            &[
                "bad.csv:3: column y_m: expected a finite number",
                "bad.csv:4: 3 cells",
            ],
        ),
        (
            "t_s,x_m,y_m,z_m\n0.7,0,0,0.05\n0.6,0,0,0.05\n",
            &["bad.csv:3: column t_s: time runs backwards, from 0.7 to 0.6"],
        ),
        (
            "t_s,x_m,y_m,z_m\n0,3,7,50\n0.02,4,7,51\n",
            &[
                "bad.csv: no position lies inside the map",
                "they are in millimetres",
            ],
        ),
    ] {
        place.write("bad.csv", text);
        place.run("flat bad.csv").ends(3, words);
        assert!(!place.path("replay.csv").exists());
    }
    place
        .run("flat none.csv")
        .ends(3, &["none.csv: cannot be read"]);
    // Gaps and positions outside are worth a warning.
    let mut text = FINGER.to_owned();
    for k in 0..20 {
        text += &format!("{},0.004,0.007,0.051\n", 1.0 + 0.02 * f64::from(k));
    }
    place.write("gap.csv", &text);
    place
        .run("flat gap.csv --out gap_out.csv")
        .ends(0, &["no position from 0.04 s to 1 s, more than 10 times"]);
    place.write("far.csv", "t_s,x_m,y_m,z_m\n0,0.3,0,0.05\n");
    place
        .run("flat far.csv --out far_out.csv")
        .ends(0, &["no position lies inside the map"]);
    for usage in [
        "flat",
        "flat far.csv --synthesize scan",
        "flat far.csv --seed 3",
        "flat --synthesize scan --duration 0",
        "flat --synthesize scan --duration 1e9",
        "flat --synthesize wander",
    ] {
        place.run(usage).ends(2, &[]);
    }
    place
        .run("flat far.csv --out far.json")
        .ends(3, &["take the ending .json"]);
}

fn edit(path: &Path, edit: impl FnOnce(&mut Value)) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut value: Value = serde_json::from_str(&text).unwrap();
    edit(&mut value);
    std::fs::write(path, value.to_string()).unwrap();
}

#[test]
fn a_bundle_that_is_not_whole_or_has_no_force_constant_is_refused() {
    let asked = "flat --synthesize scan --duration 1";
    let place = Place::new();
    let points = place.read("flat/points.csv");
    place.write("flat/points.csv", &points.replacen("0.05", "0.06", 1));
    place
        .run(asked)
        .ends(3, &["points.csv was changed or damaged", "its SHA-256 is"]);
    place.write("flat/points.csv", &points[..points.len() / 2]);
    place.run(asked).ends(3, &["bytes, the manifest says"]);
    std::fs::remove_file(place.path("flat/points.csv")).unwrap();
    place.run(asked).ends(3, &["it is missing"]);
    place.write("flat/points.csv", &points);
    edit(&place.path("flat/manifest.json"), |m| {
        m["schema_version"] = "2.0.0".into();
    });
    place
        .run(asked)
        .ends(3, &["2.0.0 is newer than this program"]);
    place
        .run("nowhere --synthesize scan")
        .ends(3, &["is not a bundle"]);

    // A flat surface that attraction cannot push up.
    let place = Place::new();
    let design = std::fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("designs/seed_air.toml"),
    )
    .unwrap()
    .replace("polarity = \"repel\"", "polarity = \"attract\"")
    .replace(", 61]", ", 11]");
    place.write("attract.toml", &design);
    place.write("flat.toml", "name = \"flat\"\nprimitive = \"flat\"\n");
    let made = Command::new(env!("CARGO_BIN_EXE_fluxform"))
        .args(["calibrate", "attract.toml", "flat.toml", "-q"])
        .current_dir(place.0.path())
        .output()
        .unwrap();
    assert_eq!(made.status.code(), Some(4));
    place
        .run("results/seed_air/flat --synthesize scan")
        .ends(4, &["has no force constant (lambda is null)"]);
}
