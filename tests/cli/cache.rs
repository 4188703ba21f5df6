//! `calibrate`: the cache of a design's field, and the plan printed first.

use std::path::Path;

use serde_json::Value;

use fluxform_testing::place::Place;

const KEPT: &str = "results/seed/.fluxform-cache";
const FILES: [&str; 5] = [
    "manifest.json",
    "map.npz",
    "lambda.json",
    "points.csv",
    "currents.csv",
];

/// Two cored coils, coupled, and a small object.
fn small() -> Place {
    let place = Place::new();
    let seed = String::from_utf8(place.read("designs/seed.toml")).unwrap();
    let two = seed
        .replace("rows = 3\ncolumns = 3", "rows = 1\ncolumns = 2")
        .replace("[10.0, 80.0, 29]", "[30.0, 80.0, 21]")
        .replace(", 61]", ", 21]");
    place.write("two.toml", &two);
    place.write(
        "bump.toml",
        "name = \"bump\"\nprimitive = \"half-sphere\"\nradius_mm = 13\nbase_mm = 37\n\
         [points]\nx_mm = [-13.0, 13.0, 9]\ny_mm = [-13.0, 13.0, 9]\n",
    );
    place
}

fn edit(place: &Place, from: &str, to: &str) {
    let text = String::from_utf8(place.read("two.toml")).unwrap();
    assert!(text.contains(from), "{from}");
    place.write("two.toml", &text.replace(from, to));
}

fn calibrate(place: &Place, flags: &[&str]) -> Vec<Vec<u8>> {
    let args = [&["calibrate", "two.toml", "bump.toml", "--force"], flags].concat();
    place.run(&args).ends(0);
    let read = |name| place.read(&format!("results/seed/bump/{name}"));
    FILES.into_iter().map(read).collect()
}

/// Whether the last run computed forces.
fn computed(place: &Place) -> bool {
    let stages: Value =
        serde_json::from_slice(&place.read("results/seed/bump/timing.json")).unwrap();
    let stages = stages.as_array().unwrap();
    stages.iter().any(|stage| stage["stage"] == "forces")
}

#[test]
fn cached_values_are_those_computed() {
    let place = small();
    let first = calibrate(&place, &[]);
    assert!(computed(&place) && place.path(KEPT).join("steel").is_file());
    assert!(calibrate(&place, &[]) == first && !computed(&place));

    // Limits and criteria leave the field as it is.
    edit(&place, "current_max_a = 2.0", "current_max_a = 1.3");
    let limited = calibrate(&place, &[]);
    assert!(!computed(&place) && limited != first);
    assert!(calibrate(&place, &["--no-cache"]) == limited && computed(&place));
    assert!(
        !place.path(KEPT).exists(),
        "--no-cache removes what was kept"
    );
}

#[test]
fn another_field_is_computed_again() {
    for (from, to) in [
        ("turns = 1429", "turns = 1300"),
        (
            "relative_permeability = 1000.0",
            "relative_permeability = 700.0",
        ),
        ("pitch_mm = 50.0", "pitch_mm = 43.0"),
        ("tilt_deg = [0.0, 0.0]", "tilt_deg = [7.0, 0.0]"),
    ] {
        let place = small();
        edit(
            &place,
            "model = \"dipole\"",
            "model = \"dipole\"\ntilt_deg = [0.0, 0.0]",
        );
        calibrate(&place, &[]);
        edit(&place, from, to);
        let here = calibrate(&place, &[]);
        assert!(computed(&place), "{to}");
        assert!(calibrate(&place, &["--no-cache"]) == here, "{to}");
    }
    let place = small();
    calibrate(&place, &[]);
    calibrate(&place, &["--tolerance", "1e-3"]);
    assert!(computed(&place), "another tolerance");
}

type Damage<'a> = &'a dyn Fn(&mut Vec<u8>);

/// Overwrites the file with what `damage` makes of its bytes.
#[allow(clippy::disallowed_methods)] // a test's own damage
fn spoil(path: &Path, damage: impl Fn(&mut Vec<u8>)) {
    let mut bytes = std::fs::read(path).unwrap();
    damage(&mut bytes);
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn damaged_entries_are_not_used_and_foreign_files_stay() {
    let place = small();
    let first = calibrate(&place, &[]);
    let map = (std::fs::read_dir(place.path(KEPT)).unwrap())
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .find(|name| name.starts_with("map-"))
        .unwrap();
    let entries = ["steel", "bump.forces", "bump.lifted", &map, "bump.points"];
    let damages: [Damage; 3] = [
        &|bytes| bytes.truncate(bytes.len() / 2),
        &|bytes| {
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
        },
        &|bytes| bytes.truncate(20),
    ];
    for damage in damages {
        for entry in entries {
            spoil(&place.path(KEPT).join(entry), damage);
        }
        assert!(calibrate(&place, &[]) == first && computed(&place));
        assert!(
            calibrate(&place, &[]) == first && !computed(&place),
            "mended"
        );
    }
    let notes = format!("{KEPT}/{map}");
    spoil(&place.path(&notes), |bytes| *bytes = b"my notes".to_vec());
    assert!(calibrate(&place, &[]) == first);
    assert_eq!(place.read(&notes), b"my notes");
    calibrate(&place, &["--no-cache"]);
    assert_eq!(place.read(&notes), b"my notes");
}

#[test]
fn the_plan_lists_the_parts_left_out_and_its_cost() {
    let place = small();
    let args = ["calibrate", "two.toml", "bump.toml", "--explain"];
    let reported = place.run(&args).ends(0).out;
    assert!(reported.starts_with("plan\n"), "{reported}");
    let json = place
        .run(&[&args[..], &["--format", "json"]].concat())
        .ends(0)
        .json();
    let terms = json["plan"]["terms"].as_array().unwrap();
    let term = |what: &str| terms.iter().find(|term| term["what"] == what).unwrap();
    assert_eq!(term("steel")["done"], "kept");
    assert_eq!(term("coupling between the cores")["done"], "computed");
    assert_eq!(term("finite magnet")["done"], "left_out");
    // A 10 mm cylinder 37 mm up differs from its dipole by (3/8) (a/r)^2-like parts of the force.
    let cost = |what: &str| term(what)["cost"]["of_the_force"].as_f64().unwrap();
    assert!((1e-4..2e-2).contains(&cost("finite magnet")), "{reported}");
    assert!(
        (1e-2..1.0).contains(&cost("coupling between the cores")),
        "{reported}"
    );
    let pull = term("pull of the unpowered steel")["cost"]["force_n"]
        .as_f64()
        .unwrap();
    assert!((1e-3..3e-2).contains(&pull), "{reported}");
    // The map holds what the object needs, no more.
    let shape = &json["plan"]["shapes"][0];
    let nodes = |key: &str| -> u64 {
        let counts = shape[key].as_array().unwrap();
        counts.iter().map(|n| n.as_u64().unwrap()).product()
    };
    assert!(nodes("nodes") < nodes("workspace_nodes"));
    let map = &json["bundles"][0]["manifest"]["map"];
    for (axis, planned) in ["x_m", "y_m", "z_m"]
        .into_iter()
        .zip(shape["nodes"].as_array().unwrap())
    {
        assert_eq!(map[axis]["samples"], *planned, "{axis}");
    }
}

/// Of three points the plan had the pull "up to 3.2 mN"; the bundle of the same run had 3.85 mN.
#[test]
fn the_plans_costs_are_those_all_over_the_points() {
    let place = small();
    edit(&place, "rows = 1\ncolumns = 2", "rows = 2\ncolumns = 2");
    place.write(
        "ball.toml",
        "name = \"ball\"\nprimitive = \"half-sphere\"\n[points]\nx_mm = [-50, 50, 13]\n\
         y_mm = [-50, 50, 13]\n",
    );
    let args = ["calibrate", "two.toml", "ball.toml", "--explain"];
    let args = [&args[..], &["--no-report", "--force", "--format", "json"]].concat();
    let json = place.run(&args).ends(0).json();
    let pull = |parts: &Value| {
        let all = parts.as_array().unwrap();
        let what = "pull of the unpowered steel";
        all.iter()
            .find(|part| part["what"] == what)
            .unwrap()
            .clone()
    };
    let planned_n = pull(&json["plan"]["terms"])["cost"]["force_n"]
        .as_f64()
        .unwrap();
    let bundle = &json["bundles"][0];
    let why = pull(&bundle["manifest"]["left_out"])["why"].to_string();
    let (_, stated) = why.split_once("up to ").unwrap();
    let stated_mn: f64 = stated.split_once(" mN").unwrap().0.parse().unwrap();
    assert!(
        (1e3 * planned_n / stated_mn - 1.0).abs() < 0.02,
        "{planned_n} {why}"
    );
    assert_eq!(json["plan"]["cost_points"], bundle["points"]);
}
