//! `verify` of fresh bundles: what calibrate wrote follows from its inputs, whatever was requested.

use crate::SEED;
use fluxform::bundle::artefact::sha256_hex;
use fluxform_testing::bundle::edit_manifest;
use fluxform_testing::place::Place;

/// The parts of a design that the cases change.
const AIR: &str = "";
const CORE: &str = "[core]\nclearance_mm = 0.7\nbelow_mm = 7.0\nrelative_permeability = 300.0\n";
const CURVE: &str = "[core]\nclearance_mm = 0.7\nbelow_mm = 7.0\nbh_curve = \"steel_1010.csv\"\n";
const PAIR: &str = "rows = 1\ncolumns = 2\npitch_mm = 47.0\n";
const ONE: &str = "rows = 1\ncolumns = 1\npitch_mm = 47.0\n";
const APART: &str = "rows = 1\ncolumns = 2\npitch_mm = 47.0\ncoupling = \"none\"\n";
const UPRIGHT: &str = "";
const SUPPLY: &str = "current_max_a = 2.0\nvoltage_v = 36.0\n";

fn design(core: &str, array: &str, magnet: &str, supply: &str) -> String {
    format!(
        "name = \"small\"\n[coil]\ninner_diameter_mm = 23.0\nouter_diameter_mm = 37.0\n\
         length_mm = 71.0\n[wire]\ndiameter_mm = 0.7\n{core}[array]\n{array}[magnet]\n\
         diameter_mm = 9.0\nlength_mm = 11.0\nmagnetization_a_per_m = 1.1579e6\n{magnet}[supply]\n\
         {supply}[workspace]\nx_mm = [-37.0, 41.0, 7]\ny_mm = [-31.0, 29.0, 6]\n\
         z_mm = [19.0, 83.0, 9]\n"
    )
}

const SLOPE: &str = "name = \"slope\"\nprimitive = \"wedge\"\nlow_mm = 31\nhigh_mm = 43\n[points]\n\
                     x_mm = [-33, 37, 6]\ny_mm = [-23, 27, 5]\n";

/// The scene to calibrate: core, array, magnet, supply, and the arguments behind the design.
type Case = (
    &'static str,
    [&'static str; 4],
    &'static [&'static str],
    i32,
);

const GIVEN: &[&str] = &[
    "shapes/wedge.stl",
    "--unit",
    "mm",
    "--translate",
    "1,-2,30",
    "--rotate",
    "0,0,17",
    "--grid",
    "6x5",
    "--x",
    "-31,33",
    "--y",
    "-23,27",
    "--scale",
    "0.7",
];

const CASES: &[Case] = &[
    ("air", [AIR, PAIR, UPRIGHT, SUPPLY], &["slope.toml"], 0),
    (
        "the four shapes",
        [AIR, PAIR, UPRIGHT, SUPPLY],
        &[
            "shapes/flat.toml",
            "shapes/half_sphere.toml",
            "shapes/half_cylinder.toml",
            "shapes/wedge.toml",
        ],
        0,
    ),
    ("coupled", [CORE, PAIR, UPRIGHT, SUPPLY], &["slope.toml"], 0),
    (
        "uncoupled",
        [CORE, APART, UPRIGHT, SUPPLY],
        &["slope.toml"],
        0,
    ),
    (
        "drivers that reverse",
        [
            AIR,
            PAIR,
            "polarity = \"attract\"\n",
            "current_max_a = 2.0\ncurrent_min_a = -1.7\n",
        ],
        &["slope.toml"],
        0,
    ),
    (
        "no force constant",
        [AIR, PAIR, "polarity = \"attract\"\n", SUPPLY],
        &["slope.toml"],
        4,
    ),
    (
        "the steel's pull counted",
        [CORE, PAIR, "passive_force = true\n", SUPPLY],
        &["slope.toml"],
        0,
    ),
    (
        "a tilted cylinder magnet",
        [
            AIR,
            PAIR,
            "model = \"cylinder\"\ntilt_deg = [7.0, -3.0]\n",
            SUPPLY,
        ],
        &["slope.toml"],
        0,
    ),
    (
        "a tilted cylinder magnet above cores",
        [
            CORE,
            PAIR,
            "model = \"cylinder\"\ntilt_deg = [7.0, -3.0]\n",
            SUPPLY,
        ],
        &["slope.toml"],
        0,
    ),
    (
        "maxmin",
        [AIR, PAIR, UPRIGHT, SUPPLY],
        &["slope.toml", "--criterion", "maxmin"],
        0,
    ),
    (
        "saturation",
        [AIR, PAIR, UPRIGHT, SUPPLY],
        &["slope.toml", "--criterion", "saturation"],
        0,
    ),
    (
        "linear, with currents at another constant",
        [CORE, PAIR, UPRIGHT, SUPPLY],
        &["slope.toml", "--criterion", "linear", "--at", "0.7"],
        0,
    ),
    (
        "a total current that binds",
        [
            AIR,
            PAIR,
            UPRIGHT,
            "current_max_a = [2.0, 1.3]\ntotal_current_max_a = 1.7\n",
        ],
        &["slope.toml", "--jnd", "0.13"],
        0,
    ),
    (
        "a coil without current, measured gains",
        [
            AIR,
            "rows = 1\ncolumns = 3\npitch_mm = 41.0\ngain = [1.03, 0.97, 1.01]\n",
            UPRIGHT,
            "current_max_a = [2.0, 0.0, 1.7]\n",
        ],
        &["slope.toml"],
        4,
    ),
    (
        "a surface given directly",
        [AIR, PAIR, UPRIGHT, SUPPLY],
        GIVEN,
        0,
    ),
    (
        "one coil along a B-H curve",
        [CURVE, ONE, UPRIGHT, SUPPLY],
        &["slope.toml"],
        0,
    ),
    (
        "a force along the normal, coupled cores and their pull",
        [CORE, PAIR, "passive_force = true\n", SUPPLY],
        &["slope.toml", "--force-direction", "normal"],
        0,
    ),
    (
        "an upright vector, its upward part given",
        [AIR, PAIR, UPRIGHT, SUPPLY],
        &[
            "slope.toml",
            "shapes/half_sphere.toml",
            "--force-direction",
            "normal",
            "--normal-force",
            "upward",
        ],
        0,
    ),
    (
        "a vector on a tilted cylinder magnet above cores",
        [
            CORE,
            PAIR,
            "model = \"cylinder\"\ntilt_deg = [7.0, -3.0]\n",
            SUPPLY,
        ],
        &["slope.toml", "--force-direction", "vertical-only"],
        0,
    ),
    (
        "no pages",
        [CORE, PAIR, UPRIGHT, SUPPLY],
        &["slope.toml", "--no-report"],
        0,
    ),
    (
        "another tolerance and reach",
        [AIR, PAIR, UPRIGHT, SUPPLY],
        &["slope.toml", "--tolerance", "1e-6", "--reach", "3"],
        0,
    ),
    (
        "a coarse tolerance in air",
        [AIR, PAIR, UPRIGHT, SUPPLY],
        &["shapes/wedge.toml", "--tolerance", "1e-3"],
        0,
    ),
    (
        "a pull that takes all current there is",
        [
            CORE,
            PAIR,
            "passive_force = true\n",
            "current_max_a = 0.01\n",
        ],
        &["slope.toml"],
        4,
    ),
];

/// Regression: the stated error of the map's nodes missed those near the axes, where it is largest.
#[test]
fn a_low_map_of_slender_coils_verifies() {
    let place = Place::new();
    place.write(
        "slender.toml",
        "name = \"slender\"\n[coil]\ninner_diameter_mm = 1.45\nouter_diameter_mm = 6.32\nlength_mm = 37.3\n\
         [wire]\ndiameter_mm = 0.49\n[array]\npositions_mm = [[-39.5, -36.1], [-28.5, 4.6], [-21.9, -15.2], \
         [35.9, -24.6], [14.9, 18.3]]\n[workspace]\nx_mm = [-35, 35, 10]\ny_mm = [-28, 33, 6]\n\
         z_mm = [7.43, 35.95, 7]\n",
    );
    place.write(
        "low.toml",
        "name = \"low\"\nprimitive = \"flat\"\nside_mm = 60\nheight_mm = 8.43\n[points]\n\
         x_mm = [-30, 30, 9]\ny_mm = [-30, 30, 9]\n",
    );
    place
        .run(&["calibrate", "slender.toml", "low.toml"])
        .ends(0);
    place.run(&["verify", "results/slender/low"]).ends(0);
}

/// Regression: errors between nodes were held against the largest value on nodes, which lie beside these coils' axes;
/// and none was stated of a sideways component that is zero in the middle of the only cell.
#[test]
fn maps_whose_nodes_lie_beside_the_coils_verify() {
    for (nodes, force) in [(6, "vertical"), (2, "vertical"), (2, "normal")] {
        let place = Place::new();
        place.write(
            "two.toml",
            &format!(
                "name = \"two\"\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\nlength_mm = 100.0\n\
                 turns = 1429\n[wire]\ndiameter_mm = 0.7\n[array]\nrows = 1\ncolumns = 2\npitch_mm = 50\n[supply]\n\
                 current_max_a = [5, 4]\n[workspace]\nx_mm = [-50, 50, 31]\ny_mm = [-50, 50, {nodes}]\n\
                 z_mm = [20, 45, 6]\n"
            ),
        );
        place.write(
            "low.toml",
            &format!(
                "name = \"low\"\nprimitive = \"half-sphere\"\nradius_mm = 18\nbase_mm = 20\nforce = \"{force}\"\n\
                 [points]\nx_mm = [-25, 25, 9]\ny_mm = [-25, 25, 7]\n"
            ),
        );
        place.run(&["calibrate", "two.toml", "low.toml"]).ends(0);
        place.run(&["verify", "results/two/low"]).ends(0);
    }
}

/// Regression: the largest pull on nodes beside the core was a hundredth of that over it, to which the stated error was
/// relative.
#[test]
fn a_pull_that_nodes_miss_verifies() {
    for (half_mm, nodes) in [(30, 2), (12, 2), (30, 3)] {
        let place = Place::new();
        place.write(
            "one.toml",
            &format!(
                "name = \"one\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\nlength_mm = 60\n[wire]\n\
                 diameter_mm = 0.7\n[core]\n[array]\nrows = 1\ncolumns = 1\n[magnet]\npassive_force = true\n\
                 [workspace]\nx_mm = [-{half_mm}, {half_mm}, {nodes}]\ny_mm = [-{half_mm}, {half_mm}, {nodes}]\n\
                 z_mm = [20, 60, 9]\n"
            ),
        );
        place.write(
            "ramp.toml",
            "name = \"ramp\"\nprimitive = \"wedge\"\nside_mm = 20\nlow_mm = 25\nhigh_mm = 45\n[points]\n\
             x_mm = [-10, 10, 5]\ny_mm = [-10, 10, 5]\n",
        );
        place.run(&["calibrate", "one.toml", "ramp.toml"]).ends(0);
        place.run(&["verify", "results/one/ramp"]).ends(0);
    }
}

/// Regression: the one node of a map was held against what interpolation adds, which is nothing.
#[test]
fn a_map_of_one_node_verifies() {
    let place = Place::new();
    place.write(
        "four.toml",
        "name = \"four\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\nlength_mm = 60\n[wire]\n\
         diameter_mm = 0.7\n[array]\nrows = 2\ncolumns = 2\npitch_mm = 50\n[workspace]\nx_mm = [0, 0, 1]\n\
         y_mm = [5, 5, 1]\nz_mm = [20, 20, 1]\n",
    );
    place.write(
        "dot.toml",
        "name = \"dot\"\nprimitive = \"flat\"\nheight_mm = 20\n[points]\nx_mm = [0, 0, 1]\ny_mm = [5, 5, 1]\n",
    );
    // So low between the coils they pull: lambda is null, which a bundle may hold.
    place
        .run(&["calibrate", "four.toml", "dot.toml"])
        .ends(4)
        .says(&["E402"]);
    place.run(&["verify", "results/four/dot"]).ends(0);
}

#[test]
fn fresh_bundles_verify_whatever_was_requested() {
    for (name, [core, array, magnet, supply], args, code) in CASES {
        let place = Place::new();
        place.write("small.toml", &design(core, array, magnet, supply));
        place.copy("designs", "elsewhere");
        let curve = String::from_utf8(place.read("elsewhere/steel_1010.csv")).unwrap();
        place.write("steel_1010.csv", &curve);
        place.write("slope.toml", SLOPE);
        let calibrate = [&["calibrate", "small.toml", "--format", "json"], *args].concat();
        let ran = place.run(&calibrate).ends(*code);
        for bundle in ran.json()["bundles"].as_array().unwrap() {
            let folder = bundle["folder"].as_str().unwrap();
            let verified = place.run(&["verify", folder, "--format", "json"]);
            assert_eq!(verified.code, Some(0), "{name}: {verified:#?}");
            let report = verified.json();
            assert_eq!(report["unchecked"].as_array().unwrap().len(), 0, "{name}");
        }
    }
}

/// A fault in the design that a bundle keeps was reported in the user's file of that name, which has none, as a bad input.
#[test]
#[allow(clippy::disallowed_methods)] // a test's own file
fn regression_a_fault_in_the_kept_design_was_in_the_users_file() {
    let place = Place::new();
    place
        .run(&["calibrate", SEED, "shapes/flat.toml", "--no-report"])
        .ends(0);
    let bundle = place.path("results/seed_air/flat");
    let text = place.text("results/seed_air/flat/design.toml");
    let changed = text.replace("length_mm = 100.0", "length_mm = -100.0");
    assert_ne!(text, changed);
    std::fs::write(bundle.join("design.toml"), &changed).unwrap();
    edit_manifest(&bundle, |manifest| {
        let files = manifest["files"].as_array_mut().unwrap();
        let entry = files.iter_mut().find(|file| file["path"] == "design.toml");
        let entry = entry.unwrap();
        entry["bytes"] = changed.len().into();
        entry["sha256"] = sha256_hex(changed.as_bytes()).into();
    });
    let ran = place.run(&["verify", "results/seed_air/flat"]).ends(5);
    assert!(
        ran.err.contains("results/seed_air/flat/design.toml: as"),
        "{}",
        ran.err
    );
}
