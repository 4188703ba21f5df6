//! Flux densities in the cores of an array, and the pull of cores in a map.

use fluxform_testing::place::Place;
use serde_json::Value;

/// Two coils close to each other, their cores of the steel of `core`.
fn pair(core: &str, currents_a: &str, more: &str) -> String {
    format!(
        "name = \"pair\"\n[coil]\ninner_diameter_mm = 16\nouter_diameter_mm = 20\nlength_mm = 40\nturns = 400\n\
         [wire]\ndiameter_mm = 0.4\n[core]\nclearance_mm = 0\nabove_mm = 2\nbelow_mm = 2\n{core}\n\
         [array]\npositions_mm = [[-10.5, 0], [10.5, 0]]\n[magnet]\n[supply]\ncurrent_max_a = {currents_a}\n\
         [target]\nheight_mm = 12\n{more}"
    )
}

fn evaluated(place: &Place, design: &str) -> Value {
    place.write("pair.toml", design);
    place
        .run(&["evaluate", "pair.toml", "--format", "json"])
        .ends(0)
        .json()
}

fn of_coils(report: &Value, key: &str) -> Vec<f64> {
    let coils = report["array"]["coils"].as_array().unwrap();
    coils
        .iter()
        .map(|coil| coil[key].as_f64().unwrap())
        .collect()
}

const CURVE: &str = "bh_curve = \"designs/steel_1010.csv\"";

/// Of a core without current beside one with, the mean |B| along a B-H curve lacked what its neighbour sends across its
/// axis: a third of it, beside a stated error of 8e-5.
#[test]
fn regression_the_mean_along_a_curve_lacked_what_neighbours_send_across() {
    let place = Place::new();
    let along = evaluated(&place, &pair(CURVE, "[0.01, 0.004]", ""));
    let permeability = &along["array"]["relative_permeability"];
    let linear = format!("relative_permeability = {permeability}");
    let linear = evaluated(&place, &pair(&linear, "[0.01, 0.004]", ""));
    for (key, stage) in [
        ("peak_field_t", "array_core_field"),
        ("mean_field_t", "array_core_field_mean"),
    ] {
        let stated = |report: &Value| report["accuracy"][stage]["estimate"].as_f64().unwrap();
        let allowed = stated(&along) + stated(&linear);
        assert!(allowed < 1e-3, "{allowed}");
        let [along, linear] = [&along, &linear].map(|report| of_coils(report, key));
        let largest = linear.iter().copied().fold(0.0, f64::max);
        for (along, linear) in along.iter().zip(&linear) {
            assert!(
                (along - linear).abs() < allowed * largest,
                "{key}: {along} {linear}"
            );
        }
    }
}

/// Cores that pass the knee, or a limit, only among their neighbours had no warning.
#[test]
fn regression_a_core_above_its_knee_among_neighbours_had_no_warning() {
    let place = Place::new();
    let limit = "[limits]\ncore_field_max_t = 1.4\n";
    let report = evaluated(&place, &pair(CURVE, "[10, 0]", limit));
    let alone = report["core"]["peak_field_t"].as_f64().unwrap();
    let knee = report["core"]["knee_t"].as_f64().unwrap();
    assert!(alone < 1.4 && knee > 1.4, "{alone} {knee}");
    assert!(of_coils(&report, "peak_field_t")[0] > knee);
    let warnings = report["warnings"].to_string();
    for words in [
        "above its steel's knee at",
        "limits.core_field_max_t = 1.4 is of one coil alone",
    ] {
        assert!(warnings.contains(words), "{warnings}");
    }
}

/// `map` left the pull of the unpowered steel out that the design counts.
#[test]
fn regression_a_map_left_the_pull_of_the_steel_out() {
    let place = Place::new();
    let core = "relative_permeability = 1000";
    let design = pair(
        core,
        "2",
        "[workspace]\nx_mm = [-20, 20, 5]\ny_mm = [-10, 10, 5]\nz_mm = [14, 34, 9]\n",
    );
    let design = design.replace("[magnet]", "[magnet]\npassive_force = true");
    place.write("pair.toml", &design);
    let report = place
        .run(&["map", "pair.toml", "--out", "m", "--format", "json"])
        .ends(0)
        .json();
    let largest_n = report["map"]["passive_force"]["largest_n"]
        .as_f64()
        .unwrap();
    let error = report["accuracy"]["passive_force_map"]["estimate"]
        .as_f64()
        .unwrap();
    // The pull alone asks for more than the limits give, so close to the cores.
    place.write(
        "at.toml",
        "name = \"at\"\nprimitive = \"flat\"\nheight_mm = 14\nside_mm = 60\n\
        [points]\nx_mm = [-20, 20, 5]\ny_mm = [-10, 10, 5]\n",
    );
    place
        .run(&[
            "calibrate",
            "pair.toml",
            "at.toml",
            "--out",
            "b",
            "--no-report",
        ])
        .ends(4);
    let bundle: Value = serde_json::from_str(&place.text("b/pair/at/manifest.json")).unwrap();
    let same_n = bundle["map"]["passive_force"]["largest_n"]
        .as_f64()
        .unwrap();
    assert!(
        largest_n > 1e-3 && (largest_n - same_n).abs() <= 2.0 * error * largest_n,
        "{largest_n} {same_n}"
    );
    let bytes = place.read("m/map.npz");
    let name = b"passive_force_n.npy";
    assert!(bytes.windows(name.len()).any(|part| part == name));
}

/// Fluxes of parallel coils beside each other take from each other: with currents of both signs cores that are below
/// their knee at the rated currents passed it, and nothing said so.
#[test]
fn regression_currents_of_both_signs_took_cores_above_their_knee_unsaid() {
    let place = Place::new();
    for core in ["relative_permeability = 1000\nknee_t = 1.25", CURVE] {
        let report = evaluated(&place, &pair(core, "9\ncurrent_min_a = -9", ""));
        let knee = report["core"]["knee_t"].as_f64().unwrap();
        let largest = &report["array"]["largest_core_field"];
        let peak = |value: &Value| value["peak_field_t"].as_f64().unwrap();
        assert!(of_coils(&report, "peak_field_t")[0] < knee && peak(largest) > knee);
        let warnings = report["warnings"].to_string();
        assert!(
            warnings.contains("with currents within their limits whose fluxes add up reaches"),
            "{warnings}"
        );
        // A limit that is passed at the rated currents already took the word away.
        let limited = "[limits]\ncore_field_max_t = 0.3\n";
        let limited = pair(core, "9\ncurrent_min_a = -9", limited);
        let warnings = evaluated(&place, &limited)["warnings"].to_string();
        for words in [
            "whose fluxes add up reaches",
            "limits.core_field_max_t = 0.3 is of one coil",
            "knee at",
        ] {
            assert!(warnings.contains(words), "{warnings}");
        }
        // As in a design whose rated currents are those.
        assert_eq!(largest["currents_a"], serde_json::json!([9.0, -9.0]));
        let both = pair(core, "[9, 0]\ncurrent_min_a = [0, -9]", "");
        let both = evaluated(&place, &both);
        let same = of_coils(&both, "peak_field_t");
        let coil = largest["coil"].as_u64().unwrap() as usize;
        assert!(
            (same[coil] / peak(largest) - 1.0).abs() < 1e-9,
            "{same:?} {largest}"
        );
        assert_eq!(
            both["array"]["largest_core_field"]["currents_a"],
            largest["currents_a"]
        );
    }
}
