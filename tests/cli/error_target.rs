//! `--error`: one budget, held, obeyed, recorded.

use fluxform_testing::place::Place;
use serde_json::Value;

use crate::SEED;

/// An object that leaves its points to the program.
fn shape(place: &Place, name: &str, text: &str) -> String {
    let file = format!("{name}.toml");
    place.write(&file, &format!("name = \"{name}\"\n{text}"));
    file
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// True, stated and requested error: the first within the second within the third.
#[test]
fn a_requested_error_is_held_against_a_finer_run() {
    let place = Place::new();
    let objects = [
        ("wedge", "primitive = \"wedge\"\nlow_mm = 34.0\n"),
        (
            "dome",
            "primitive = \"half-sphere\"\nradius_mm = 91.0\nbase_mm = 11.0\n",
        ),
        ("cap", "primitive = \"half-sphere\"\nradius_mm = 38.3\n"),
    ];
    for (name, text) in objects {
        let free = shape(&place, name, text);
        let grid = "[points]\nx_mm = [-50.0, 50.0, 321]\ny_mm = [-50.0, 50.0, 321]\n";
        let fine = shape(&place, "fine", &format!("{text}{grid}"));
        let solved = |shape: &str, flags: &[&str]| {
            let args = ["lambda", SEED, shape, "--format", "json"];
            place.run(&[&args[..], flags].concat()).ends(0).json()
        };
        let limit = number(&solved(&fine, &["--weights", "area"])["lambda_n_per_m"]);
        let mut points = Vec::new();
        for error in ["5%", "0.015"] {
            let run = solved(&free, &["--error", error]);
            let headline = &run["headline"];
            let off = (number(&run["lambda_n_per_m"]) / limit - 1.0).abs();
            let stated = number(&headline["force_error"]);
            let requested = number(&headline["requested"]["error"]);
            assert!(off <= stated, "{name} {error}: {off} of {stated}");
            assert!(stated <= requested, "{name} {error}: {stated}");
            assert_eq!(headline["requested"]["met"], true);
            assert_eq!(run["weights"], "area");
            points.push(run["points"].as_u64().unwrap());
        }
        assert!(points[0] < points[1] && points[1] < 321 * 321, "{points:?}");
    }
}

#[test]
fn grids_that_are_given_are_obeyed_and_what_they_cause_is_said() {
    let place = Place::new();
    let grid =
        "primitive = \"wedge\"\n[points]\nx_mm = [-50.0, 50.0, 7]\ny_mm = [-50.0, 50.0, 7]\n";
    let given = shape(&place, "wedge", grid);
    let ran = place
        .run(&["lambda", SEED, &given, "--error", "0.1%"])
        .ends(0);
    let first = ran.out.lines().nth(1).unwrap();
    assert!(first.contains("exceeds the requested 0.1 %"), "{first}");
    ran.says(&["exceeded", "number of points", "--refine"]);
    let chosen = [
        "lambda", SEED, &given, "--error", "0.1%", "--refine", "--format", "json",
    ];
    let chosen = place.run(&chosen).ends(0).json();
    assert_eq!(chosen["headline"]["requested"]["met"], true);
    assert!(chosen["points"].as_u64() > Some(49));
    for refused in [["--error", "0"], ["--error", "60%"], ["--error", "much"]] {
        place
            .run(&[&["lambda", SEED, &given], &refused[..]].concat())
            .ends(2);
    }
    place.run(&["lambda", SEED, &given, "--refine"]).ends(2);
}

/// The map's nodes follow the budget too; the bundle records the request and is made again from it.
#[test]
fn a_bundle_of_a_requested_error_is_recorded_and_verifies() {
    let place = Place::new();
    let free = shape(&place, "wedge", "primitive = \"wedge\"\nlow_mm = 34.0\n");
    let args = [
        "calibrate",
        SEED,
        &free,
        "--refine",
        "--format",
        "json",
        "--error",
    ];
    let run = |error: &str| place.run(&[&args[..], &[error]].concat());
    let coarse = run("5%").ends(0).json();
    let headline = &coarse["bundles"][0]["headline"];
    assert_eq!(headline["requested"]["met"], true);
    let nodes = |of: &Value| number(&of["requested"]["nodes"][0]);
    assert!(nodes(headline) < 61.0);
    place.run(&["verify", "results/seed_air/wedge"]).ends(0);
    run("1%").ends(4).says(&["error"]);
    let fine = place
        .run(&[&args[..], &["1%", "--force"]].concat())
        .ends(0)
        .json();
    let headline_of = &fine["bundles"][0]["headline"];
    assert!(nodes(headline_of) > nodes(headline));
    assert!(number(&headline_of["force_error"]) <= 0.01);
}
