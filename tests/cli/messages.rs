//! Bad input: the exit code, and a message that says where, what and what to do.

use crate::SEED;
use fluxform_testing::place::Place;

#[test]
fn every_fault_is_shown_with_its_line_and_a_caret() {
    let place = Place::new();
    let text = place
        .text(SEED)
        .replace("pitch_mm", "pich_mm")
        .replace("resistance_max_ohm = 6.0", "resistance_max_ohm = -6.0");
    place.write("bad.toml", &text);
    let ran = place.run(&["evaluate", "bad.toml"]).ends(3).says(&[
        "bad.toml: 2 errors",
        "pich_mm = 50.0",
        "^^^",
        "did you mean pitch_mm?",
        "limits.resistance_max_ohm",
    ]);
    assert!(ran.out.is_empty() && !ran.err.contains('\u{1b}'), "{ran:?}");

    let reported = place
        .run(&["evaluate", "bad.toml", "--format", "json"])
        .ends(3);
    assert!(reported.out.is_empty());
    let error = &reported.error()["error"];
    assert_eq!(error["exit_code"], 3);
    let faults = error["faults"].as_array().unwrap();
    assert_eq!(faults.len(), 2);
    let line = text.lines().position(|l| l.starts_with("pich_mm")).unwrap() + 1;
    assert!(faults.iter().any(|fault| fault["key"] == "array.pich_mm"
        && fault["line"] == line
        && fault["file"] == "bad.toml"
        && fault["advice"] == "did you mean pitch_mm?"));
}

#[test]
fn faults_of_all_documents_are_reported_in_one_run() {
    let place = Place::new();
    place.write("design.toml", &place.text(SEED).replace("turns", "tunrs"));
    place.write("shape.toml", "name = \"a\"\nprimitive = \"flatt\"\n");
    place
        .run(&["calibrate", "design.toml", "shape.toml", "shapes/flat.toml"])
        .ends(3)
        .says(&["did you mean turns?", "shape.toml", "flatt"]);
    assert!(!place.path("results").exists());
}

#[test]
fn colours_are_for_those_who_ask() {
    let place = Place::new();
    place.write("bad.toml", "name = 7\n");
    let coloured = place.run(&["evaluate", "bad.toml", "--color", "always"]);
    assert!(coloured.ends(3).err.contains("\u{1b}["));
    let missing = ["lambda", SEED, "none.stl", "--unit", "mm"];
    let plain = place.run(&[&missing[..], &["--color", "never"]].concat());
    assert!(!plain.ends(3).err.contains('\u{1b}'));
}

#[test]
fn a_warning_stops_nothing_and_quiet_hides_it() {
    let place = Place::new();
    place.write(
        "metres.toml",
        &place
            .text(SEED)
            .replace("length_max_mm = 100.0", "length_max_mm = 0.1"),
    );
    let ran = place.run(&["evaluate", "metres.toml"]).ends(0);
    let ran = ran.says(&["warning", "limits.length_max_mm"]);
    assert!(ran.out.contains("<= 0.1 mm"), "{}", ran.out);
    let quiet = place.run(&["evaluate", "metres.toml", "-q"]).ends(0);
    assert!(quiet.out.is_empty() && quiet.err.is_empty(), "{quiet:?}");
    let json = place.run(&["evaluate", "metres.toml", "--format", "json"]);
    let json = json.ends(0);
    assert!(json.err.is_empty(), "{}", json.err);
    let warnings = json.json()["warnings"].clone();
    assert!(
        warnings[0]
            .as_str()
            .unwrap()
            .contains("limits.length_max_mm")
    );
}

#[test]
fn a_raw_surface_needs_its_unit() {
    let place = Place::new();
    for command in ["lambda", "calibrate"] {
        place
            .run(&[command, SEED, "shapes/wedge.stl"])
            .ends(2)
            .says(&["shapes/wedge.stl", "--unit", "mm"]);
    }
    let reported = place.run(&["discretize", "shapes/wedge.stl", "--format", "json"]);
    assert_eq!(reported.ends(2).error()["error"]["exit_code"], 2);
    assert!(!place.path("points.csv").exists());
}

#[test]
fn surface_flags_do_not_go_with_a_shape_file() {
    let place = Place::new();
    let args = [
        "discretize",
        "shapes/wedge.toml",
        "--unit",
        "mm",
        "--grid",
        "3x3",
    ];
    place
        .run(&args)
        .ends(2)
        .says(&["--unit --grid", "shapes/wedge.toml", "translate_mm"]);
    // A surface given directly takes them, whatever stands beside it.
    let args = [
        "calibrate",
        SEED,
        "shapes/flat.toml",
        "shapes/wedge.stl",
        "--unit",
        "mm",
        "--translate",
        "0,0,30",
        "--grid",
        "9x9",
    ];
    place.run(&args).ends(0);
    assert!(place.path("results/seed_air/wedge/manifest.json").exists());
}

#[test]
fn arguments_are_validated_with_their_meaning() {
    let place = Place::new();
    let lambda = |more: &[&str]| {
        let base = ["lambda", SEED, "shapes/flat.toml"];
        place.run(&[&base[..], more].concat()).ends(2)
    };
    lambda(&["--tolerance", "3"]).says(&["relative to the field gradient", "1e-15 to 1e-1"]);
    lambda(&["--tolerance", "-1e-9"]).says(&["invalid tolerance -1e-9"]);
    lambda(&["--jnd", "0"]).says(&["above 0, at most 1"]);
    lambda(&["--jnd", "7"]).says(&["at most 1, like 7% or 0.07"]);
    lambda(&["--at", "-2"]).says(&["invalid force constant -2"]);
    // Its squares are no doubles: the result could not be written.
    lambda(&["--at", "1e308"]).says(&[
        "invalid force constant 1e308",
        "above 0, at most 1000000 N/m",
    ]);
    lambda(&["--threads", "0"]).says(&["from 1 to 1024"]);
    lambda(&["--criterion", "best"]).says(&["linear, jnd, saturation, maxmin"]);
    let raw = |more: &[&str]| {
        let base = ["discretize", "shapes/wedge.stl", "--unit", "mm"];
        place.run(&[&base[..], more].concat()).ends(2)
    };
    raw(&["--translate", "0,0"]).says(&["X,Y,Z in millimetres"]);
    raw(&["--grid", "61"]).says(&["NxM"]);
    raw(&["--x", "20,-20"]).says(&["smaller end first"]);
    let folder = ["map", SEED, "--out", "-"];
    place.run(&folder).ends(2).says(&["names a folder"]);
    let twice = ["lambda", "-", "-"];
    place.run(&twice).ends(2).says(&["named 2 times"]);
}

#[test]
fn what_cannot_be_read_is_named() {
    let place = Place::new();
    place
        .run(&["evaluate", "designs"])
        .ends(3)
        .says(&["designs", "found a directory"]);
    place
        .run(&["evaluate", "none.toml"])
        .ends(3)
        .says(&["none.toml", "check the path"]);
    place
        .run(&["discretize", "shapes", "--unit", "mm"])
        .ends(3)
        .says(&["shapes", "found a directory"]);
    place
        .run(&["discretize", "none.stl", "--unit", "mm"])
        .ends(3)
        .says(&["none.stl"]);
    place
        .run(&["probe", SEED, "none.csv"])
        .ends(3)
        .says(&["none.csv"]);
    place.write("notes.txt", "no surface");
    place
        .run(&["discretize", "notes.txt", "--unit", "mm"])
        .ends(3)
        .says(&["notes.txt", ".stl"]);
    place.write("cut.stl", "solid a\nfacet normal 0 0 1\nouter loop\n");
    place
        .run(&["lambda", SEED, "cut.stl", "--unit", "mm"])
        .ends(3)
        .says(&["cut.stl"]);
    place
        .run(&["verify", "shapes"])
        .ends(3)
        .says(&["manifest.json"]);
    place.write("points.csv", "x_m,y_m,z_m\n0.1,0.2,far\n0.1,0.2\n");
    let reported = place.run(&["probe", SEED, "points.csv", "--format", "json"]);
    let reported = reported.ends(3).error();
    assert_eq!(reported["error"]["faults"].as_array().unwrap().len(), 2);
}

#[test]
fn points_without_a_map_are_warned_of() {
    let place = Place::new();
    let small = "name = \"far\"\nprimitive = \"flat\"\ntranslate_mm = [30, 0, 0]\n";
    place.write("far.toml", &format!("{small}[points]\nx_mm = [0, 80, 9]\n"));
    place
        .run(&["calibrate", SEED, "far.toml"])
        .ends(0)
        .says(&["warning: far: ", "outside the design's workspace"]);
}

#[test]
fn two_shapes_of_one_name_are_an_error() {
    let place = Place::new();
    place
        .run(&["calibrate", SEED, "shapes/flat.toml", "shapes/flat.toml"])
        .ends(3)
        .says(&["two shapes are called \"flat\""]);
    assert!(!place.path("results").exists());
}

#[test]
fn a_result_that_misses_the_request_is_reported_and_ends_with_4() {
    let place = Place::new();
    let strict = place.run(&["evaluate", SEED, "--strict"]).ends(4);
    assert!(strict.out.contains("NOT met"), "{}", strict.out);
    strict.says(&["limits that are not met", "resistance"]);
    place.run(&["evaluate", SEED]).ends(0);

    let accuracy = ["evaluate", SEED, "--tolerance", "1e-15", "--format", "json"];
    let ran = place.run(&accuracy).ends(4);
    assert_eq!(ran.json()["accuracy_reached"], false);
    assert_eq!(ran.error()["error"]["exit_code"], 4);

    // A magnet that is only pulled down feels no object.
    let text = place.text(SEED).replace("\"repel\"", "\"attract\"");
    place.write("attract.toml", &text);
    let args = [
        "lambda",
        "attract.toml",
        "shapes/flat.toml",
        "--format",
        "json",
    ];
    let ran = place.run(&args).ends(4);
    assert!(ran.json()["lambda_n_per_m"].is_null());
    assert!(
        ran.json()["warnings"][0]
            .as_str()
            .unwrap()
            .contains("polarity")
    );
    assert_eq!(ran.error()["error"]["exit_code"], 4);
    let args = ["calibrate", "attract.toml", "shapes/flat.toml"];
    place.run(&args).ends(4).says(&["null for flat"]);
    assert!(place.path("results/seed_air/flat/manifest.json").exists());
}
