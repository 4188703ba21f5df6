//! Defaults that decide numbers and were not written are reported, and refused where requested.

use serde_json::Value;

use crate::SEED;
use fluxform_testing::place::Place;

/// Coil and wire alone; everything else has its default.
const BARE: &str = "name = \"bare\"\n[coil]\ninner_diameter_mm = 13.0\nouter_diameter_mm = 31.0\n\
                    length_mm = 40.0\n[wire]\ndiameter_mm = 0.7\n[limits]\nlength_max_mm = 60.0\n\
                    outer_diameter_max_mm = 38.0\n";

/// Every key that decides a number.
const WHOLE: &str = "name = \"whole\"\n[coil]\ninner_diameter_mm = 13.0\nouter_diameter_mm = 31.0\n\
                     length_mm = 40.0\n[wire]\ndiameter_mm = 0.7\nconductor_diameter_mm = 0.65\n\
                     resistivity_ohm_m = 1.7e-8\ntemperature_c = 21.0\n[array]\n\
                     positions_mm = [[-20.0, 0.0], [20.0, 0.0]]\n[magnet]\ndiameter_mm = 9.0\n\
                     length_mm = 9.0\nmagnetization_a_per_m = 1e6\npolarity = \"repel\"\n\
                     model = \"dipole\"\n[supply]\ncurrent_max_a = 1.3\ncurrent_min_a = 0.0\n\
                     [target]\nheight_mm = 20.0\n";

fn assumed(result: &Value) -> Vec<(String, Value)> {
    let list = result["assumed"]
        .as_array()
        .unwrap_or_else(|| panic!("{result}"));
    list.iter()
        .map(|one| {
            (
                one["key"].as_str().unwrap().to_owned(),
                one["value"].clone(),
            )
        })
        .collect()
}

#[test]
fn a_magnet_and_a_supply_that_were_not_written_are_reported_by_every_command() {
    let place = Place::new();
    place.write("bare.toml", BARE);
    place.write("points.csv", "x_m,y_m,z_m\n0.001,0.002,0.03\n");
    let flat = "name = \"small\"\nprimitive = \"flat\"\n[points]\nx_mm = [-7.0, 7.0, 5]\n\
                y_mm = [-7.0, 7.0, 5]\n";
    place.write("small.toml", flat);
    let commands: &[&[&str]] = &[
        &["evaluate", "bare.toml"],
        &["probe", "bare.toml", "points.csv", "--out", "probe.csv"],
        &["map", "bare.toml", "--out", "maps"],
        &["lambda", "bare.toml", "small.toml"],
        &["calibrate", "bare.toml", "small.toml", "--no-report"],
        &["compare", "bare.toml", "small.toml", "shapes/wedge.toml"],
        &["optimize", "bare.toml", "--starts", "1"],
        &[
            "sweep",
            "plan",
            "bare.toml",
            "--set",
            "wire.diameter_mm=0.6,0.7",
            "--out",
            "p.json",
        ],
    ];
    for command in commands {
        let ran = place.run(&[command, &["--format", "json"][..]].concat());
        let all = assumed(&ran.json());
        let value = |key: &str| {
            let found = all.iter().find(|(one, _)| one == key);
            found
                .unwrap_or_else(|| panic!("{command:?}: {key}: {all:?}"))
                .1
                .clone()
        };
        assert_eq!(value("magnet.magnetization_a_per_m"), 1_157_900);
        assert_eq!(value("supply.current_max_a"), 2);
        assert_eq!(value("array"), "one coil at the origin");
        let maps = matches!(command[0], "map" | "calibrate");
        assert_eq!(
            all.iter().any(|(key, _)| key == "workspace.z_mm"),
            maps,
            "{command:?}"
        );
        let refused = place
            .run(&[command, &["--strict-inputs"][..]].concat())
            .ends(3);
        refused.says(&[
            "error[E301]",
            "magnet.diameter_mm",
            "supply.current_max_a",
            "array",
        ]);
    }
    let screen = place.run(&["evaluate", "bare.toml"]).ends(0).err;
    let lines: Vec<&str> = screen
        .lines()
        .filter(|line| line.starts_with("assumed: "))
        .collect();
    assert_eq!(lines.len(), 1, "{screen}");
    assert!(lines[0].contains("magnet.diameter_mm = 10, "), "{screen}");
    let refused = place.run(&[
        "evaluate",
        "bare.toml",
        "--strict-inputs",
        "--format",
        "json",
    ]);
    // All of them in one message.
    let faults = refused.ends(3).error()["error"]["faults"].clone();
    assert_eq!(faults.as_array().unwrap().len(), 1, "{faults}");
}

#[test]
fn what_was_written_is_not_assumed() {
    let place = Place::new();
    place.write("whole.toml", WHOLE);
    let result = place.run(&[
        "evaluate",
        "whole.toml",
        "--strict-inputs",
        "--format",
        "json",
    ]);
    assert_eq!(assumed(&result.ends(0).json()), []);
    let quiet = place.run(&["evaluate", "whole.toml"]).ends(0);
    assert!(!quiet.err.contains("assumed"), "{}", quiet.err);
    // Steel: its knee and conductivity; along a curve neither knee nor permeability.
    place.write(
        "steel.toml",
        &format!("{WHOLE}[core]\nclearance_mm = 0.5\nbelow_mm = 7.0\nabove_mm = 0.0\n"),
    );
    let keys = |design: &str| {
        let ran = place.run(&["evaluate", design, "--format", "json"]).ends(0);
        assumed(&ran.json())
            .into_iter()
            .map(|(key, _)| key)
            .collect::<Vec<_>>()
    };
    let steel = [
        "core.relative_permeability",
        "core.knee_t",
        "core.conductivity_s_per_m",
    ];
    assert_eq!(keys("steel.toml"), steel);
    let seed = keys(SEED);
    assert!(
        !seed.iter().any(|key| key == "magnet.diameter_mm"),
        "{seed:?}"
    );
}
