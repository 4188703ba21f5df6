//! Objects that the array cannot render where they are: exit 4, the cure, and no bundle.

use crate::SEED;
use fluxform_testing::place::Place;

const GRID: &str = "[points]\nx_mm = [-50.0, 50.0, 9]\ny_mm = [-50.0, 50.0, 9]\n";

/// `calibrate` is refused with these words and leaves no bundle; with `--force` it writes one.
fn refused(place: &Place, args: &[&str], shape: &str, words: &[&str]) {
    let all = [&["calibrate", SEED], args, &["--no-report"]].concat();
    let human = place.run(&all).ends(4);
    human.says(
        &[
            &["error[E409]", shape, "no bundle was written", "--force"],
            words,
        ]
        .concat(),
    );
    let bundle = format!("results/seed_air/{shape}/manifest.json");
    assert!(!place.path(&bundle).exists());
    let error = place
        .run(&[&all[..], &["--format", "json"]].concat())
        .ends(4)
        .error();
    assert_eq!(error["error"]["code"], "E409");
    let forced = place.run(&[&all[..], &["--force"]].concat()).ends(4);
    forced.says(&["error[E409]"]);
    assert!(place.path(&bundle).exists(), "{bundle}");
}

#[test]
fn a_surface_in_metres_is_refused_with_the_unit_that_it_is_in() {
    for (unit, long) in [("m", "100 m long in the unit m"), ("um", "in the unit um")] {
        let place = Place::new();
        let args = ["shapes/wedge.stl", "--unit", unit, "--grid", "9x9"];
        refused(&place, &args, "wedge", &[long, "--unit mm (unit = \"mm\""]);
        if unit == "m" {
            place.run(&["verify", "results/seed_air/wedge"]).ends(0);
        }
    }
}

#[test]
fn an_object_above_the_workspace_is_refused_with_the_translation_that_brings_it_in() {
    let place = Place::new();
    let high = format!("name = \"high\"\nprimitive = \"flat\"\nheight_mm = 250.0\n{GRID}");
    place.write("high.toml", &high);
    refused(
        &place,
        &["high.toml"],
        "high",
        &["wholly outside", "translate_mm = [0, 0, -170]"],
    );
    // The cure works.
    let cured = high.replace("height_mm", "translate_mm = [0, 0, -170]\nheight_mm");
    place.write("high.toml", &cured);
    place
        .run(&[
            "calibrate",
            SEED,
            "high.toml",
            "--no-report",
            "--out",
            "cured",
        ])
        .ends(0);
}

#[test]
fn an_object_within_the_workspace_whose_forces_are_too_weak_is_not_moved() {
    let place = Place::new();
    let weak = format!("name = \"weak\"\nprimitive = \"flat\"\nheight_mm = 25.0\n{GRID}");
    place.write("weak.toml", &weak);
    let seed = std::fs::read_to_string(fluxform_testing::root().join(SEED)).unwrap();
    let weakened = seed.replace("\ncurrent_max_a = 2.0", "\ncurrent_max_a = 1e-6");
    assert_ne!(weakened, seed);
    place.write("weak_seed.toml", &weakened);
    let refused = place
        .run(&["lambda", "weak_seed.toml", "weak.toml"])
        .ends(4)
        .says(&[
            "error[E409]",
            "lies within the workspace",
            "allow more current",
        ]);
    assert!(!refused.err.contains("--translate"), "{}", refused.err);
}

/// Broke: what touches an end of the workspace lay outside where a sum of lengths was rounded upward.
#[test]
fn regression_an_object_that_touches_the_workspace_s_top_lay_outside() {
    let place = Place::new();
    // 16 mm + 20 mm is 36.000000000000004 mm.
    place
        .run(&["init", "desk", "--object", "half-sphere", "--name", "d"])
        .ends(0);
    let args = ["calibrate", "d.toml", "d_half-sphere.toml", "--no-report"];
    let ran = place.run(&args).ends(0);
    assert!(!ran.err.contains("outside"), "{}", ran.err);
    place.write("top.csv", "t_s,x_m,y_m,z_m\n0,0,0,0.036000000000000004\n");
    let bundle = place.path("results/d/half-sphere");
    let bundle = bundle.to_str().unwrap();
    let ran = place
        .run(&["replay", bundle, "top.csv", "--out", "-"])
        .ends(0);
    assert!(!ran.out.contains("outside"), "{}", ran.out);
}

#[test]
fn a_few_points_outside_are_a_warning() {
    let place = Place::new();
    let grid = "[points]\nx_mm = [-55.0, 55.0, 23]\ny_mm = [-50.0, 50.0, 9]\n";
    let wide = format!("name = \"wide\"\nprimitive = \"flat\"\nside_mm = 110.0\n{grid}");
    place.write("wide.toml", &wide);
    let ran = place
        .run(&["calibrate", SEED, "wide.toml", "--no-report"])
        .ends(0);
    ran.says(&["warning: ", "18 of 207 points lie outside"]);
}

#[test]
fn an_object_that_no_finger_feels_ends_with_4() {
    let place = Place::new();
    let far = format!("name = \"far\"\nprimitive = \"flat\"\nheight_mm = 900.0\n{GRID}");
    place.write("far.toml", &far);
    let ran = place
        .run(&["lambda", SEED, "far.toml", "--format", "json"])
        .ends(4);
    assert!(ran.json()["lambda_n_per_m"].as_f64().unwrap() > 0.0);
    let message = ran.error()["error"]["message"].as_str().unwrap().to_owned();
    assert!(
        message.contains("nothing of the object is felt"),
        "{message}"
    );
    assert!(message.contains("translate_mm = [0, 0, -820]"), "{message}");
}
