//! The limits of `optimize` where roundings, reversing drivers and whole turns decide.

use serde_json::Value;

use fluxform_testing::place::Place;

fn number(value: &Value, path: &str) -> f64 {
    let found = path.split('/').fold(value, |value, key| &value[key]);
    found.as_f64().unwrap_or_else(|| panic!("{path}: {found}"))
}

/// The sum of currents that reverse was taken of their magnitudes: 24.3 W of 218.6 W was stated, and met.
#[test]
fn reversing_drivers_heat_all_coils_whatever_the_sum_allows() {
    let place = Place::new();
    let text = "name = \"two_ways\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\nlength_mm = 100\n\
                [wire]\ndiameter_mm = 0.7\n[array]\nrows = 3\ncolumns = 3\npitch_mm = 50\n\
                [supply]\ncurrent_max_a = 2\ncurrent_min_a = -2\ntotal_current_max_a = 2\n\
                [limits]\narray_power_max_w = 30\n";
    place.write("design.toml", text);
    let args = ["design.toml", "--format", "json", "-q"];
    let stated = place
        .run(&[&["evaluate"], &args[..]].concat())
        .ends(0)
        .json();
    let heat_w = 9.0 * 4.0 * number(&stated, "coil/resistance_ohm");
    let limit = &stated["limits"]["array_power_w"];
    assert!(
        (number(limit, "value") / heat_w - 1.0).abs() < 1e-12,
        "{limit}"
    );
    assert_eq!(limit["met"], false);
    // A coil that keeps the limit has the resistance that 36 A^2 leave it.
    let best = place
        .run(&[&["optimize"], &args[..]].concat())
        .ends(0)
        .json();
    assert_eq!(best["limits"]["array_power_w"]["met"], true);
    let most_ohm = 30.0 / 36.0;
    let ohm = number(&best, "coil/resistance_ohm");
    assert!((ohm / most_ohm - 1.0).abs() < 1e-6, "{ohm}");
}
