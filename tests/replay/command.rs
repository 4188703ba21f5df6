//! `fluxform replay` as its users meet it.

use std::path::Path;

use fluxform_testing::place::Place;
use fluxform_testing::run::Ran;
use fluxform_testing::{committed, tree};
use serde_json::Value;

use crate::support::in_air;

/// A place with a copy of a bundle in `flat`.
fn with_a_bundle() -> Place {
    let place = Place::empty();
    tree::copy(&in_air().folder("flat"), &place.path("flat"));
    place
}

fn replay(place: &Place, args: &str) -> Ran {
    replay_with(place, args, "")
}

fn replay_with(place: &Place, args: &str, input: &str) -> Ran {
    let args: Vec<&str> = ["replay"]
        .into_iter()
        .chain(args.split_whitespace())
        .collect();
    place.run_with_input(&args, input)
}

const FINGER: &str = "t_s,x_m,y_m,z_m\n0,0.003,0.007,0.05\n0.02,0.004,0.007,0.051\n\
                      0.04,0.3,0,0.05\n";

#[test]
fn a_table_with_facts_seconds_and_a_picture() {
    let place = with_a_bundle();
    place.write("finger.csv", FINGER);
    replay(&place, "flat finger.csv --plot replay.svg").ends(0);
    let table = place.text("replay.csv");
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(
        lines[0],
        "t_s,x_m,y_m,z_m,wanted_force_n,force_n,error_n,current_0_a,current_1_a,current_2_a,\
         current_3_a,current_4_a,current_5_a,current_6_a,current_7_a,current_8_a,\
         static_force_n,static_error_n,status"
    );
    assert_eq!(lines.len(), 4);
    let lambda = serde_json::from_str::<Value>(&place.text("flat/manifest.json")).unwrap()["lambda"]
        ["lambda_n_per_m"]
        .as_f64()
        .unwrap();
    let target: f64 = lines[1].split(',').nth(4).unwrap().parse().unwrap();
    assert!((target / (0.05 * lambda) - 1.0).abs() < 1e-12);
    assert!(lines[3].starts_with("0.04,0.3,0,0.05,0,0,0,0,") && lines[3].ends_with(",outside"));
    let facts: Value = serde_json::from_str(&place.text("replay.json")).unwrap();
    assert_eq!(facts["schema_version"], "1.4.0");
    assert_eq!(facts["inputs"][0]["path"], "flat/manifest.json");
    assert_eq!(facts["inputs"][1]["path"], "finger.csv");
    assert_eq!(facts["trajectory"]["positions"], 3);
    assert!(facts["force"]["feedback"]["worst_at"]["t_s"].is_number());
    assert!(facts["force"]["static"]["rms_error_n"].as_f64().unwrap() > 0.0);
    assert_eq!(facts["currents"]["max_a"].as_array().unwrap().len(), 9);
    assert!(facts["accuracy"]["force"]["estimate"].as_f64().unwrap() < 1e-3);
    assert!((facts["outside_time_fraction"].as_f64().unwrap() - 1.0 / 3.0).abs() < 1e-12);
    assert!(!place.text("replay.json").contains("seconds"));
    let timing: Value = serde_json::from_str(&place.text("timing_replay.json")).unwrap();
    assert!(timing["seconds_per_step"].as_f64().unwrap() > 0.0);
    assert!(place.text("replay.svg").ends_with("</svg>"));
    // The same inputs replace, others do not.
    replay(&place, "flat finger.csv --threads 1").ends(0);
    assert_eq!(place.text("replay.csv"), table);
    place.write("other.csv", &FINGER.replace("0.003", "0.0031"));
    replay(&place, "flat other.csv")
        .ends(4)
        .says(&["was made from other inputs", "--force"]);
    replay(&place, "flat other.csv --force").ends(0);
    place.write("mine.svg", "mine");
    replay(&place, "flat finger.csv --out new.csv --plot mine.svg")
        .ends(4)
        .says(&["mine.svg exists"]);
    assert!(!place.path("new.csv").exists() && place.text("mine.svg") == "mine");
}

#[test]
fn streams_and_json_hold_one_thing_each() {
    let place = with_a_bundle();
    let ran = replay_with(&place, "flat - --out - --dynamics", FINGER);
    let ran = ran.ends(0).says(&["time constants", "feedback"]);
    let header = ran.out.lines().next().unwrap();
    assert!(header.contains(",commanded_0_a,") && header.ends_with(",status"));
    assert_eq!(ran.out.lines().count(), 4);
    assert!(!place.path("replay.csv").exists());
    let reported = replay(
        &place,
        "flat --synthesize circle --format json --duration 2",
    )
    .ends(0);
    let reported = reported.json();
    assert_eq!(reported["trajectory"]["positions"], 101);
    assert_eq!(reported["trajectory"]["source"], "a circle");
    assert_eq!(reported["warnings"], serde_json::json!([]));
}

#[test]
fn a_made_up_trajectory_replays_to_the_same_table() {
    let place = with_a_bundle();
    let made = "flat --synthesize explore --seed 7 --duration 3 --trajectory-out finger.csv";
    replay(&place, &format!("{made} --out made.csv")).ends(0);
    replay(&place, "flat finger.csv --out read.csv").ends(0);
    assert_eq!(place.text("made.csv"), place.text("read.csv"));
    assert_eq!(place.text("finger.csv").lines().count(), 152);
}

#[test]
fn bad_trajectories_are_reported_with_their_line() {
    let place = with_a_bundle();
    for (text, words) in [
        (
            "",
            &["bad.csv: the table is empty; expected a header line"][..],
        ),
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
        replay(&place, "flat bad.csv").ends(3).says(words);
        assert!(!place.path("replay.csv").exists());
    }
    replay(&place, "flat none.csv")
        .ends(3)
        .says(&["none.csv: cannot be read"]);
    // Gaps and positions outside are worth a warning.
    let mut text = FINGER.to_owned();
    for k in 0..20 {
        text += &format!("{},0.004,0.007,0.051\n", 1.0 + 0.02 * f64::from(k));
    }
    place.write("gap.csv", &text);
    replay(&place, "flat gap.csv --out gap_out.csv")
        .ends(0)
        .says(&["no position from 0.04 s to 1 s, more than 10 times"]);
    place.write("far.csv", "t_s,x_m,y_m,z_m\n0,0.3,0,0.05\n");
    replay(&place, "flat far.csv --out far_out.csv")
        .ends(0)
        .says(&["no position lies inside the map"]);
    for usage in [
        "flat",
        "flat far.csv --synthesize scan",
        "flat far.csv --seed 3",
        "flat --synthesize scan --duration 0",
        "flat --synthesize scan --duration 1e9",
        "flat --synthesize wander",
    ] {
        replay(&place, usage).ends(2);
    }
    replay(&place, "flat far.csv --out far.json")
        .ends(2)
        .says(&["take the ending .json"]);
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
    let place = with_a_bundle();
    let points = place.text("flat/points.csv");
    place.write("flat/points.csv", &points.replacen("0.05", "0.06", 1));
    replay(&place, asked)
        .ends(5)
        .says(&["points.csv was changed or damaged", "its SHA-256 is"]);
    place.write("flat/points.csv", &points[..points.len() / 2]);
    replay(&place, asked)
        .ends(5)
        .says(&["bytes, the manifest says"]);
    std::fs::remove_file(place.path("flat/points.csv")).unwrap();
    replay(&place, asked).ends(5).says(&["it is missing"]);
    place.write("flat/points.csv", &points);
    // Regression: an accuracy that somebody edited was printed.
    let manifest = place.text("flat/manifest.json");
    let edited = manifest.replacen("\"largest_error\": ", "\"largest_error\": 1", 1);
    assert_ne!(edited, manifest);
    place.write("flat/manifest.json", &edited);
    replay(&place, asked)
        .ends(5)
        .says(&["manifest.json was changed or damaged", "record_sha256"]);
    place.write("flat/manifest.json", &manifest);
    edit(&place.path("flat/manifest.json"), |m| {
        m["schema_version"] = "2.0.0".into();
    });
    replay(&place, asked)
        .ends(3)
        .says(&["2.0.0 is newer than this program"]);
    replay(&place, "nowhere --synthesize scan")
        .ends(3)
        .says(&["nowhere: no such folder"]);

    // A flat surface that attraction cannot push up.
    let place = with_a_bundle();
    let design = committed("designs/seed_air.toml")
        .replace("polarity = \"repel\"", "polarity = \"attract\"")
        .replace(", 61]", ", 11]");
    place.write("attract.toml", &design);
    place.write("flat.toml", "name = \"flat\"\nprimitive = \"flat\"\n");
    place
        .run(&["calibrate", "attract.toml", "flat.toml", "-q"])
        .ends(4);
    replay(&place, "results/seed_air/flat --synthesize scan")
        .ends(4)
        .says(&["has no force constant (lambda is null)"]);
}

/// Regression: the picture and the page were put in place before the table, so that a disk that was full then left
/// them alone, and the same run was refused because of them.
#[test]
fn picture_and_page_are_there_with_the_table_or_not_at_all() {
    let place = with_a_bundle();
    place.write("finger.csv", FINGER);
    replay(&place, "flat finger.csv --plot r.svg --report /dev/full").ends(4);
    for name in ["r.svg", "replay.csv", "replay.json"] {
        assert!(!place.path(name).exists(), "{name}");
    }
    let both = "flat finger.csv --plot r.svg --report pages/r.html";
    let ran = replay(&place, both).ends(0);
    let ran = ran.says(&["written: r.svg", "written: pages/r.html"]);
    assert!(ran.out.contains("replay.csv"), "{}", ran.out);
    assert!(place.path("r.svg").is_file() && place.path("pages/r.html").is_file());
}

/// The largest error of the whole map, at the lowest layer, was taken for that of every position and coil: 30 to 400 times
/// too much, and forces known to less than their size had no warning.
#[test]
fn regression_the_map_s_largest_error_was_everywhere() {
    let place = Place::new();
    place.write(
        "flat.toml",
        "name = \"flat\"\nprimitive = \"flat\"\nheight_mm = 30\nside_mm = 60\n",
    );
    for (nodes, known) in [("21, 16", true), ("5, 5", false)] {
        let [level, up] = [0, 1].map(|k| nodes.split(", ").nth(k).unwrap());
        let design = format!(
            "name = \"four\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\nlength_mm = 60\n\
             [wire]\ndiameter_mm = 0.7\n[array]\nrows = 2\ncolumns = 2\n[magnet]\n[workspace]\n\
             x_mm = [-60, 60, {level}]\ny_mm = [-60, 60, {level}]\nz_mm = [10, 80, {up}]\n"
        );
        place.write("four.toml", &design);
        let args = [
            "calibrate",
            "four.toml",
            "flat.toml",
            "--out",
            "b",
            "--no-report",
            "--force",
        ];
        place.run(&args).ends(0);
        let args = "replay b/four/flat --synthesize scan --duration 2 --out r.csv --report r.html --force --format json";
        let args: Vec<&str> = args.split(' ').collect();
        let report = place.run(&args).ends(0).json();
        let stated = report["accuracy"]["force"]["estimate"].as_f64().unwrap();
        let warned = report["warnings"]
            .to_string()
            .contains("the forces are known to");
        assert_eq!(warned, !known, "{report:#}");
        assert!(place.text("r.html").contains("The forces are known to"));
        let table = place.text("r.csv");
        let mut lines = table
            .lines()
            .map(|line| line.split(',').collect::<Vec<_>>());
        let names = lines.next().unwrap();
        let number = |row: &[&str], name: &str| -> f64 {
            let at = names.iter().position(|other| *other == name).unwrap();
            row[at].parse().unwrap()
        };
        let rows: Vec<Vec<&str>> = lines.collect();
        let positions = rows.iter().map(|row| row[1..4].join(",") + "\n");
        place.write(
            "at.csv",
            &format!("x_m,y_m,z_m\n{}", positions.collect::<String>()),
        );
        let args = [
            "probe",
            "four.toml",
            "at.csv",
            "--magnet-force",
            "--format",
            "json",
        ];
        let probed = place.run(&args).ends(0).json();
        let per_a = probed["columns"]["force_z_n_per_a"].as_array().unwrap();
        let off = rows.iter().zip(per_a.chunks(4)).map(|(row, per_a)| {
            let terms = per_a.iter().enumerate();
            let terms = terms.map(|(coil, per_a)| {
                per_a.as_f64().unwrap() * number(row, &format!("current_{coil}_a"))
            });
            (terms.sum::<f64>() - number(row, "force_n")).abs()
        });
        let worst = off.fold(0.0, f64::max);
        assert!(worst > 1e-5 && stated > worst, "{stated} {worst}");
        assert!(!known || stated < 10.0 * worst, "{stated} {worst}");
    }
}

/// The page and the fixed currents' line spoke of the first finger alone.
#[test]
fn regression_the_second_fingers_errors_were_left_out() {
    let place = with_a_bundle();
    place.write(
        "pair.csv",
        "t_s,x_m,y_m,z_m,x2_m,y2_m,z2_m\n0,0.003,0.007,0.05,0.03,0.02,0.052\n",
    );
    let ran = replay(&place, "flat pair.csv --report pair.html").ends(0);
    let page = place.text("pair.html");
    for finger in ["first finger", "second finger"] {
        assert!(
            ran.out.contains(&format!("{finger}: error rms")),
            "{}",
            ran.out
        );
        assert!(
            page.contains(&format!("{finger}, with fixed currents")),
            "{finger}"
        );
        assert!(
            page.contains(&format!("With feedback the force on the {finger}")),
            "{finger}"
        );
    }
}
