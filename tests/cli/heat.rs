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
