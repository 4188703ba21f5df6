//! How warm coils become: the design's `[cooling]`, `evaluate` and `lambda`.

use std::f64::consts::PI;

use fluxform_testing::place::Place;
use serde_json::Value;

use crate::SEED;

const COOLING: &str = "\n[cooling]\nsurface_w_per_m2_k = 17.0\nambient_c = 31.0\n\
                       winding_max_c = 130.0\nheating_s = 45.0\n";

fn number(of: &Value, path: &str) -> f64 {
    of.pointer(path)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("{path} in {of}"))
}

/// The heat that the resistance at the steady temperature makes is what the surface loses there.
#[test]
fn the_steady_temperature_balances_heat_and_loss() {
    let place = Place::new();
    place.write("air.toml", &format!("{}{COOLING}", place.text(SEED)));
    let args = ["evaluate", "air.toml", "--format", "json"];
    let result = place.run(&args).ends(0).json();
    let of = |path: &str| number(&result, path);
    let steady_c = of("/heat/steady_c");
    let warmth = |c: f64| 1.0 + 3.93e-3 * (c - 20.0);
    let resistance_ohm = of("/coil/resistance_ohm") * warmth(steady_c) / warmth(20.0);
    let current_a = of("/heat/current_a");
    let [inner, outer, length] =
        ["inner_diameter_m", "outer_diameter_m", "length_m"].map(|key| of(&format!("/coil/{key}")));
    let surface_m2 = PI * (outer * length + 0.5 * (outer * outer - inner * inner));
    let lost_w = 17.0 * surface_m2 * (steady_c - 31.0);
    let made_w = current_a.powi(2) * resistance_ohm;
    assert!((made_w / lost_w - 1.0).abs() < 1e-12, "{made_w} {lost_w}");
    assert!(of("/heat/after_c") < steady_c && of("/heat/winding_max_s") > 45.0);
    let text = place.run(&["evaluate", "air.toml"]).ends(0).out;
    assert!(text.contains("not for continuous operation"), "{text}");
}

/// Static rendering was never said to burn the coils.
#[test]
fn the_hottest_coil_of_an_object_is_that_of_the_largest_current() {
    let place = Place::new();
    let args = ["lambda", SEED, "shapes/flat.toml", "--format", "json"];
    let result = place.run(&args).ends(0).json();
    let currents = result["currents_a"].as_array().unwrap();
    let largest = currents.iter().map(|a| a.as_f64().unwrap().abs());
    let current_a = number(&result, "/hottest_coil/current_a");
    assert_eq!(current_a, largest.fold(0.0, f64::max));
    let cold = format!(
        "{}\n[cooling]\nsurface_w_per_m2_k = 0.0\n",
        place.text(SEED)
    );
    place.write("cold.toml", &cold);
    place
        .run(&["evaluate", "cold.toml"])
        .ends(3)
        .says(&["cooling.surface_w_per_m2_k", "greater than 0"]);
    // So cold copper had a negative resistance, and cooled as it was driven.
    place.write(
        "cold.toml",
        &cold.replace("surface_w_per_m2_k = 0.0", "ambient_c = -240.0"),
    );
    place
        .run(&["evaluate", "cold.toml"])
        .ends(3)
        .says(&["cooling.ambient_c", "at least -234"]);
}

/// Regression: heat, limits, steel and settling were those of the largest positive current, however far a driver reverses: 2.7
/// of 173 W, 0.5 of 4.1 T, "met" and no warning.
#[test]
fn a_driver_that_reverses_further_is_rated_there() {
    let place = Place::new();
    let design = |supply: &str, polarity: &str, core: &str| {
        let text = format!(
            "name = \"pair\"\n[coil]\ninner_diameter_mm = 8\nouter_diameter_mm = 20\nlength_mm = 30\n\
             [wire]\ndiameter_mm = 0.5\n[core]\nbelow_mm = 5\n{core}[array]\nrows = 1\ncolumns = 2\npitch_mm = 30\n\
             [magnet]\npolarity = \"{polarity}\"\n[supply]\n{supply}\nvoltage_v = 24.0\ndriver = \"current\"\n\
             [workspace]\nx_mm = [-10, 10, 3]\ny_mm = [-10, 10, 3]\nz_mm = [20, 30, 3]\n\
             [limits]\npower_max_w = 10\ncore_field_max_t = 1.0\nsettling_max_ms = 1e4\n"
        );
        place.write("pair.toml", &text);
    };
    let curve = "bh_curve = \"designs/steel_1010.csv\"\n";
    for core in ["", curve] {
        let evaluated = |supply: &str, polarity: &str| {
            design(supply, polarity, core);
            let args = [
                "evaluate",
                "pair.toml",
                "--tolerance",
                "1e-2",
                "--format",
                "json",
            ];
            place.run(&args).json()
        };
        let expected = evaluated("current_max_a = 8\ncurrent_min_a = -1", "repel");
        let found = evaluated("current_max_a = 1\ncurrent_min_a = -8", "attract");
        assert_eq!(number(&found, "/target/current_a"), -8.0);
        let same = [
            "/target/force_n",
            "/coil/power_w",
            "/core/peak_field_t",
            "/heat/after_c",
            "/limits/power_w/value",
            "/limits/core_field_t/value",
            "/limits/settling_s/value",
            "/array/coils/0/peak_field_t",
        ];
        for path in same {
            let [found, expected] = [&found, &expected].map(|result| number(result, path));
            assert!(
                (found / expected - 1.0).abs() < 1e-9,
                "{path}: {found} {expected}"
            );
        }
        assert_eq!(found["limits"]["power_w"]["met"], false, "{found}");
        assert_eq!(found["warnings"], expected["warnings"]);
    }
    // Without an upper limit a core's curve had the tolerance of linear steel, which it does not reach.
    design("current_max_a = 0\ncurrent_min_a = -8", "attract", curve);
    let args = ["map", "pair.toml", "--out", "map"];
    place.run(&args).ends(0);
}
