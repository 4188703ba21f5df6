//! `lambda`: variants, wiring, and inputs with nothing to solve.

use crate::support::Place;

const AIR: &str = "designs/seed_air.toml";
const WEDGE: &str = "shapes/wedge.toml";

#[test]
fn variants_are_told_beside_the_design_as_given() {
    let place = Place::new();
    let told = place
        .run(&["lambda", AIR, WEDGE, "--variants", "--format", "json"])
        .ends(0)
        .json();
    let variants = told["variants"].as_array().unwrap();
    let named = |name: &str| variants.iter().find(|v| v["name"] == name).unwrap();
    let given = named("as given");
    for key in [
        "lambda_n_per_m",
        "lambda_linear_n_per_m",
        "lambda_jnd_n_per_m",
        "lambda_saturation_n_per_m",
        "lambda_maxmin_n_per_m",
        "rms_error_n",
        "worst_error_n",
    ] {
        assert_eq!(given[key], told[key], "{key}");
    }
    assert_eq!(given["relative_change"], 0.0);
    let worst = &told["worst_point"]["lambda_jnd_n_per_m"];
    assert_eq!(given["worst_point_lambda_jnd_n_per_m"], *worst);
    for coil in 0..9 {
        let broken = named(&format!("{coil} broken"));
        assert_eq!(broken["currents_a"][coil], 0.0);
        let change = broken["lambda_n_per_m"].as_f64().unwrap()
            / given["lambda_n_per_m"].as_f64().unwrap()
            - 1.0;
        assert!((broken["relative_change"].as_f64().unwrap() - change).abs() < 1e-10);
    }
    let series = &named("all pairs in series")["currents_a"];
    for (a, b) in [(0, 8), (1, 7), (2, 6), (3, 5)] {
        assert_eq!(series[a], series[b]);
    }
    assert_eq!(named("push and pull")["pulls"], true);
    // The table says the same.
    let shown = place.run(&["lambda", AIR, WEDGE, "--variants"]).ends(0);
    assert!(shown.out.contains("all pairs in series") && shown.out.contains("4 broken"));

    // A run with a coil broken is its variant.
    let one = place
        .run(&["lambda", AIR, WEDGE, "--broken", "4", "--format", "json"])
        .ends(0)
        .json();
    assert_eq!(one["lambda_n_per_m"], named("4 broken")["lambda_n_per_m"]);
    assert_eq!(one["wiring"]["broken"][0], 4);
    let pair = ["lambda", AIR, WEDGE, "--series", "0+8", "--format", "json"];
    let pair = place.run(&pair).ends(0).json();
    assert_eq!(
        pair["lambda_n_per_m"],
        named("0+8 in series")["lambda_n_per_m"]
    );
    assert_eq!(pair["currents_a"][0], pair["currents_a"][8]);
    assert_eq!(pair["wiring"]["series"][0][1], 8);
}

#[test]
fn wiring_that_cannot_be_is_refused() {
    let place = Place::new();
    for (flags, words) in [
        (["--broken", "9"], "its coils are numbered 0 to 8"),
        (["--broken", "3,3"], "coil 3 is named twice"),
        (["--series", "3+3"], "coil 3 is named twice"),
    ] {
        let ran = place.run(&["lambda", AIR, WEDGE, flags[0], flags[1]]);
        ran.ends(3).says(&[words]);
    }
    let ran = place.run(&["lambda", AIR, WEDGE, "--series", "3-9"]);
    ran.ends(2).says(&["\"3-9\" is no pair of coils"]);
}

#[test]
fn nothing_to_render_is_told_not_computed() {
    let place = Place::new();
    let air = String::from_utf8(place.read(AIR)).unwrap();
    // Coils that pull only.
    place.write("pull.toml", &air.replace("\"repel\"", "\"attract\""));
    let ran = place.run(&[
        "lambda",
        "pull.toml",
        WEDGE,
        "--variants",
        "--format",
        "json",
    ]);
    let ran = ran.ends(4).says(&["pushes the magnet up"]);
    let told = ran.json();
    assert!(
        told["lambda_n_per_m"].is_null() && told["worst_point"]["lambda_jnd_n_per_m"].is_null()
    );
    // Everything below what is felt is within the tolerances all the same.
    assert!(told["tolerance"]["lambda_n_per_m"].as_f64().unwrap() > 0.0);
    let variants = told["variants"].as_array().unwrap();
    assert!(variants[0]["relative_change"].is_null());
    let both = variants
        .iter()
        .find(|v| v["name"] == "push and pull")
        .unwrap();
    assert!(both["lambda_saturation_n_per_m"].as_f64().unwrap() > 0.0);
    // No current at all.
    let line = air
        .lines()
        .find(|l| l.starts_with("current_max_a"))
        .unwrap();
    place.write("none.toml", &air.replace(line, "current_max_a = 0.0"));
    let ran = place.run(&["lambda", "none.toml", WEDGE]);
    assert!(ran.code.is_some_and(|code| code != 101), "{ran:?}");
}
