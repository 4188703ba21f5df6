//! A plate below the cores and other bodies of steel.

use std::sync::LazyLock;

use serde_json::Value;

use fluxform_testing::boxes::block;
use fluxform_testing::place::Place;
use fluxform_testing::run::Ran;
use fluxform_testing::surfaces::binary;

/// Two short coils, and what else there is.
fn design(place: &Place, more: &str) {
    design_of(place, 2, more);
}

fn design_of(place: &Place, coils: usize, more: &str) {
    let text = format!(
        "name = \"pair\"\n[coil]\ninner_diameter_mm = 14.0\nouter_diameter_mm = 22.0\n\
                length_mm = 30.0\n[wire]\ndiameter_mm = 0.7\n[array]\nrows = 1\ncolumns = {coils}\n\
                pitch_mm = 33.0\n[workspace]\nx_mm = [-20, 20, 5]\ny_mm = [-10, 10, 3]\n\
                z_mm = [12, 30, 4]\n"
    );
    place.write("design.toml", &format!("{text}{more}"));
}

const CORE: &str = "[core]\nbelow_mm = 4.0\n";
const PLATE: &str =
    "[core]\nbelow_mm = 4.0\n[plate]\nthickness_mm = 4.0\nx_mm = 70.0\ny_mm = 40.0\n";

const FLAT: &str = "name = \"flat\"\nprimitive = \"flat\"\nside_mm = 30\nheight_mm = 20\n[points]\n\
                    x_mm = [-15, 15, 5]\ny_mm = [-15, 15, 5]\n";

fn evaluated(place: &Place, more: &str) -> Value {
    evaluated_to(place, more, "0.1")
}

fn evaluated_to(place: &Place, more: &str, tolerance: &str) -> Value {
    design(place, more);
    let args = ["evaluate", "design.toml", "--tolerance", tolerance];
    let options = ["--format", "json"];
    place.run(&[&args[..], &options].concat()).ends(0).json()
}

/// The pair without a plate and on one, as tests ask for them, each evaluated once.
static ALONE: LazyLock<Value> = LazyLock::new(|| settling(CORE));
static ON_PLATE: LazyLock<Value> = LazyLock::new(|| settling(PLATE));

/// With a limit of the settling time, which changes nothing else.
fn settling(more: &str) -> Value {
    evaluated(
        &Place::new(),
        &format!("{more}[limits]\nsettling_max_ms = 1e6\n"),
    )
}

fn inductance_h(result: &Value) -> f64 {
    result["array"]["coils"][0]["inductance_h"]
        .as_f64()
        .unwrap()
}

fn fields_t(place: &Place, more: &str, points: &str) -> Vec<[f64; 3]> {
    design(place, more);
    place.write("points.csv", &format!("x_m,y_m,z_m\n{points}\n"));
    let ran = place.run(&["probe", "design.toml", "points.csv", "--tolerance", "0.03"]);
    let ran = ran.ends(0);
    let rows = ran.out.lines().skip(1);
    rows.map(|row| {
        let values: Vec<f64> = row.split(',').map(|value| value.parse().unwrap()).collect();
        [values[4], values[5], values[6]]
    })
    .collect()
}

fn norm(field: [f64; 3]) -> f64 {
    field.iter().map(|b| b * b).sum::<f64>().sqrt()
}

/// The limit stood at the coil's own time, without the plate that it stands on.
#[test]
fn a_plate_counts_in_the_settling_limit_of_a_coil() {
    let limits = |evaluation: &Value| {
        let limit = evaluation["limits"]["settling_s"]["value"]
            .as_f64()
            .unwrap();
        let coils = evaluation["array"]["mutual_inductance_h"]
            .as_array()
            .unwrap();
        let own = (0..coils.len()).map(|i| coils[i][i].as_f64().unwrap());
        let resistance_ohm = evaluation["coil"]["resistance_ohm"].as_f64().unwrap();
        let own_s = 5.0 * own.fold(0.0, f64::max) / resistance_ohm;
        (
            limit,
            own_s,
            evaluation["coil"]["settling_s"].as_f64().unwrap(),
        )
    };
    let (limit, _, alone) = limits(&ALONE);
    assert_eq!(limit, alone);
    let (limit, own, alone) = limits(&ON_PLATE);
    assert!(
        (limit / own - 1.0).abs() < 1e-12 && limit > 1.1 * alone,
        "{limit} {own} {alone}"
    );
}

#[test]
fn a_plate_joins_the_cores_and_one_far_below_does_nothing() {
    let place = Place::new();
    let (alone, joined) = (&*ALONE, &*ON_PLATE);
    let far = evaluated(&place, &format!("{PLATE}gap_mm = 200.0\n"));
    assert!(inductance_h(joined) > 1.15 * inductance_h(alone));
    assert!((inductance_h(&far) / inductance_h(alone) - 1.0).abs() < 0.01);
    let iron = &joined["array"]["iron"];
    assert!(iron["peak_field_t"].as_f64().unwrap() > 0.1);
    let own = joined["coil"]["settling_s"].as_f64().unwrap();
    assert!(iron["settling_s"].as_f64().unwrap() > 1.1 * own);
    assert!(
        joined["array"]["coils"][1]["peak_field_t"]
            .as_f64()
            .unwrap()
            > 0.1
    );
    assert!(alone["array"].get("iron").is_none());
}

#[test]
fn a_thin_plate_warns_that_its_linear_steel_ends() {
    let place = Place::new();
    design(&place, &PLATE.replace("4.0\nx", "0.3\nx"));
    let to = |tolerance| {
        place
            .run(&["evaluate", "design.toml", "--tolerance", tolerance])
            .ends(0)
    };
    // On the coarsest panels the error is most of the peak: the advice brings finer ones.
    to("0.1").says(&["not known at this tolerance", "lower --tolerance to "]);
    let ran = to("0.03");
    // What is said to be off is shown.
    let shown = ran.out.contains("bodies") && ran.out.contains("the knee is at 1.5 T");
    assert!(shown, "{}", ran.out);
    ran.says(&["[[iron]]", "reaches", "taken as linear"]);
}

#[test]
fn a_sheet_of_steel_shields_what_is_behind_it() {
    let place = Place::new();
    let wall = "[[iron]]\nshape = \"box\"\nsize_mm = [2, 90, 90]\ncenter_mm = [60, 0, -15]\n";
    let behind = "0.07,0.004,-0.012";
    let open = fields_t(&place, CORE, behind);
    let shut = fields_t(&place, &format!("{CORE}{wall}"), behind);
    assert!(norm(shut[1]) < 0.4 * norm(open[1]), "{shut:?} {open:?}");
    let json = [
        "probe",
        "design.toml",
        "points.csv",
        "--tolerance",
        "0.03",
        "--format",
        "json",
    ];
    let result = place.run(&json).ends(0).json();
    let error = result["accuracy"]["iron_at_points"]["estimate"].as_f64();
    assert!((1e-6..0.1).contains(&error.unwrap()), "{error:?}");
}

#[test]
fn a_bundle_of_a_plate_verifies() {
    let place = Place::new();
    design(&place, PLATE);
    place.write("flat.toml", FLAT);
    let args = [
        "calibrate",
        "design.toml",
        "flat.toml",
        "--out",
        "out",
        "--tolerance",
        "0.1",
    ];
    place.run(&args).ends(0);
    place.run(&["verify", "out/pair/flat"]).ends(0);
}

/// A plate's pull on the magnet was refused.
#[test]
fn the_pull_of_cores_on_a_plate_is_counted_and_verified() {
    let place = Place::new();
    place.write("flat.toml", FLAT);
    let calibrated = |more: &str, out: &str| {
        design_of(&place, 1, more);
        let args = ["calibrate", "design.toml", "flat.toml", "--out", out];
        let options = ["--tolerance", "0.1", "--format", "json"];
        place.run(&[&args[..], &options].concat()).ends(0).json();
        let read = |file: &str| -> Value {
            serde_json::from_str(&place.text(&format!("{out}/pair/flat/{file}"))).unwrap()
        };
        (read("manifest.json"), read("lambda.json"))
    };
    let counting = format!("{PLATE}[magnet]\npassive_force = true\n");
    let (without, freely) = calibrated(PLATE, "without");
    let (with, pulled) = calibrated(&counting, "with");
    let lambda = |file: &Value| file["lambda_n_per_m"].as_f64().unwrap();
    assert!(
        lambda(&pulled) < 0.95 * lambda(&freely),
        "{pulled} {freely}"
    );
    // What is left out is as large as what the other counts.
    let left = without["left_out"].as_array().unwrap();
    let left = left
        .iter()
        .find(|part| part["what"] == "pull of the unpowered steel");
    let cost = left.unwrap()["error_cost"].as_f64().unwrap();
    let map = &with["map"]["passive_force"];
    let largest = map["largest_n"].as_f64().unwrap();
    let stated = cost * lambda(&freely) * 0.02;
    assert!(stated > 0.0 && stated < 3.0 * largest, "{stated} {largest}");
    // What is verified is the plate's alone, which takes an eighth of the time.
    calibrated(&counting.replace(CORE, ""), "plate");
    place.run(&["verify", "plate/pair/flat"]).ends(0);
    // Over a core it is stronger with a plate than without.
    let force = |more: &str, of: &dyn Fn(&Value) -> f64| of(&evaluated(&place, more));
    let target = "[target]\nheight_mm = 20\n";
    let on_plate = force(&format!("{counting}{target}"), &|result| {
        result["array"]["iron"]["passive_force_n"].as_f64().unwrap()
    });
    let alone = force(
        &format!("{CORE}[magnet]\npassive_force = true\n{target}"),
        &|result| result["target"]["passive_force_n"].as_f64().unwrap(),
    );
    assert!(on_plate < alone && alone < 0.0, "{on_plate} {alone}");
}

/// It cost nothing, without a word; and there was no variant of all.
#[test]
fn steel_above_the_object_leaves_its_pull_unknown() {
    let place = Place::new();
    place.write("flat.toml", FLAT);
    let wall = "[[iron]]\nshape = \"box\"\nsize_mm = [5, 5, 20]\ncenter_mm = [400, 0, 20]\n";
    design_of(&place, 1, wall);
    let args = [
        "calibrate",
        "design.toml",
        "flat.toml",
        "--tolerance",
        "0.1",
    ];
    let ran = place.run(&args).ends(0);
    assert!(ran.err.contains("its size is not known"), "{}", ran.err);
    assert!(ran.out.contains("its cost is not known"), "{}", ran.out);
    let manifest: Value =
        serde_json::from_str(&place.text("results/pair/flat/manifest.json")).unwrap();
    let left = manifest["left_out"].as_array().unwrap();
    let pull = left
        .iter()
        .find(|part| part["what"] == "pull of the unpowered steel");
    assert!(pull.unwrap()["error_cost"].is_null(), "{left:?}");
    let args = [
        "lambda",
        "design.toml",
        "flat.toml",
        "--variants",
        "--format",
        "json",
    ];
    let result = place
        .run(&[&args[..], &["--tolerance", "0.1"]].concat())
        .ends(0);
    assert!(result.json()["variants"].as_array().unwrap().len() > 1);
    assert!(
        result.out.contains("no variant with the steel's pull"),
        "{}",
        result.out
    );
}

#[test]
fn one_coil_is_optimised_without_its_plate_and_says_so() {
    let place = Place::new();
    let limits =
        "[limits]\nresistance_max_ohm = 3\nouter_diameter_max_mm = 24\nlength_max_mm = 30\n";
    let best = |more: &str| {
        design(&place, &format!("{more}{limits}"));
        let args = [
            "optimize",
            "design.toml",
            "--format",
            "json",
            "--starts",
            "2",
        ];
        place.run(&args).ends(0).json()
    };
    let (alone, on_plate) = (best(CORE), best(PLATE));
    assert_eq!(on_plate["objective"], alone["objective"]);
    let warnings = on_plate["warnings"].to_string();
    assert!(warnings.contains("[plate] and [[iron]]") && warnings.contains("optimize --for SHAPE"));
}

/// Sweeps of plates were refused.
#[test]
fn a_sweep_over_plates_has_what_evaluate_has() {
    let place = Place::new();
    design(&place, PLATE);
    let plan = [
        "sweep",
        "plan",
        "design.toml",
        "--set",
        "plate.thickness_mm=2:4:2",
    ];
    let options = ["--tolerance", "0.1", "--out", "plan.json"];
    place.run(&[&plan[..], &options].concat()).ends(0);
    place
        .run(&["sweep", "run", "plan.json", "--out", "points"])
        .ends(0);
    place
        .run(&[
            "sweep",
            "merge",
            "plan.json",
            "points",
            "--out",
            "sweep.csv",
        ])
        .ends(0);
    let table = place.text("sweep.csv");
    let rows: Vec<Vec<&str>> = table.lines().map(|row| row.split(',').collect()).collect();
    let cell = |row: usize, name: &str| -> f64 {
        let column = rows[0].iter().position(|head| *head == name).unwrap();
        rows[row][column].parse().unwrap()
    };
    let known = &*ON_PLATE;
    let iron = &known["array"]["iron"];
    assert_eq!(
        cell(2, "iron_peak_field_t"),
        iron["peak_field_t"].as_f64().unwrap()
    );
    assert_eq!(
        cell(2, "array_settling_s"),
        iron["settling_s"].as_f64().unwrap()
    );
    assert_eq!(cell(2, "array_inductance_h"), inductance_h(known));
    assert!(cell(1, "iron_peak_field_t") > cell(2, "iron_peak_field_t"));
    assert!(cell(1, "array_inductance_h") < cell(2, "array_inductance_h"));
}

/// The plate is a variable like any other: a limit of mass decides how thick it is.
#[test]
fn a_search_chooses_the_plate_within_its_limits() {
    let place = Place::new();
    place.write("flat.toml", FLAT);
    let text = "name = \"one\"\n[coil]\ninner_diameter_mm = 14.0\nouter_diameter_mm = 22.0\nlength_mm = 30.0\n\
                [wire]\ndiameter_mm = 0.7\n[core]\nbelow_mm = 4.0\n[array]\npositions_mm = [[0, 0]]\n\
                [workspace]\nx_mm = [-20, 20, 5]\ny_mm = [-20, 20, 5]\nz_mm = [12, 30, 4]\n\
                [plate]\nthickness_mm = 4.0\ndiameter_mm = 40.0\n[limits]\narray_mass_max_kg = 0.13\n\
                [search.plate]\nthickness_mm = [1.0, 6.0]\nnone = true\n";
    place.write("design.toml", text);
    let args = [
        "optimize",
        "design.toml",
        "--for",
        "flat.toml",
        "--out",
        "best.toml",
    ];
    let options = [
        "--evaluations",
        "10",
        "--tolerance",
        "0.1",
        "--format",
        "json",
    ];
    let found = place.run(&[&args[..], &options].concat()).ends(0).json();
    let thickness = found["values"]["plate.thickness_mm"].as_f64().unwrap();
    let mass = found["limits"]["array_mass_kg"]["value"].as_f64().unwrap();
    assert!(mass <= 0.13 && mass > 0.1299, "{mass}");
    assert!(thickness > 1.0 && thickness < 6.0, "{thickness}");
    assert!(
        place
            .text("best.toml")
            .contains(&format!("thickness_mm = {thickness}"))
    );
    let choices = found["choices"].as_array().unwrap();
    let gain = |plate: bool| {
        let choice = choices
            .iter()
            .find(|choice| choice["plate"] == plate)
            .unwrap();
        choice["objective"].as_f64().unwrap()
    };
    assert!(gain(true) > gain(false), "{choices:?}");
}

const MESH: &str = "[[iron]]\nshape = \"mesh\"\nsurface = \"bar.stl\"\nunit = \"mm\"\ntranslate_mm = [0, 0, -40]\n";

/// A bar about the origin as a binary STL file, mm.
fn bar(sides_mm: [f64; 3]) -> Vec<u8> {
    let triangles = block(
        sides_mm.map(|side| -0.5 * side),
        sides_mm.map(|side| 0.5 * side),
    );
    binary(
        &triangles
            .iter()
            .map(|t| t.map(|corner| corner.map(|c| c as f32)))
            .collect::<Vec<_>>(),
    )
}

/// The same body, named by a file or by its sides.
#[test]
fn a_mesh_counts_as_the_body_that_it_bounds() {
    let place = Place::new();
    place.write("bar.stl", &bar([50.0, 24.0, 6.0]));
    let by_sides = "[[iron]]\nshape = \"box\"\nsize_mm = [50, 24, 6]\ncenter_mm = [0, 0, -40]\n";
    let results = [MESH, by_sides].map(|body| evaluated(&place, &format!("{CORE}{body}")));
    let [mesh, sides] = results.each_ref().map(inductance_h);
    let alone = inductance_h(&ALONE);
    let stated = |result: &Value| {
        let accuracy = &result["accuracy"]["mutual_inductance"];
        accuracy["estimate"].as_f64().unwrap()
    };
    let [off, stated] = [
        (mesh / sides - 1.0).abs(),
        stated(&results[0]) + stated(&results[1]),
    ];
    assert!(
        off <= stated && stated < 1e-2 && mesh > 1.02 * alone,
        "{mesh} {sides} {alone} {stated}"
    );
    let peaks = results.map(|r| r["array"]["iron"]["peak_field_t"].as_f64().unwrap());
    assert!((peaks[0] / peaks[1] - 1.0).abs() < 0.05, "{peaks:?}");
}

/// A bar below the cores is a plate; caps on the cores and posts on the bar are joined to them, and take flux with them.
#[test]
fn what_touches_cores_is_joined_to_them() {
    let place = Place::new();
    let bar = format!(
        "{CORE}[[iron]]\nshape = \"box\"\nsize_mm = [70, 40, 4]\ncenter_mm = [0, 0, -36]\n"
    );
    let (plate, bar_alone) = (
        inductance_h(&ON_PLATE),
        inductance_h(&evaluated(&place, &bar)),
    );
    assert!(
        (plate / bar_alone - 1.0).abs() < 1e-2,
        "{plate} {bar_alone}"
    );
    let cylinder = |diameter: f64, length: f64, at: &str| {
        format!(
            "[[iron]]\nshape = \"cylinder\"\ndiameter_mm = {diameter}\nlength_mm = {length}\n\
             center_mm = {at}\n"
        )
    };
    let caps = cylinder(20.0, 2.0, "[-16.5, 0, 1]") + &cylinder(20.0, 2.0, "[16.5, 0, 1]");
    let posts = cylinder(8.0, 34.0, "[0, 14, -17]") + &cylinder(8.0, 34.0, "[0, -14, -17]");
    let capped = inductance_h(&evaluated(&place, &format!("{bar}{caps}{posts}")));
    assert!(capped > 1.05 * bar_alone, "{capped} {bar_alone}");
    let pot = "[[iron]]\nshape = \"tube\"\ndiameter_mm = 30\ninner_diameter_mm = 24\nlength_mm = 35\n\
               center_mm = [16.5, 0, -16.5]\n";
    let lid = cylinder(30.0, 2.0, "[16.5, 0, 2]");
    let rod = "[core]\nbelow_mm = 4.0\nabove_mm = 1.0\n";
    refused(
        &place,
        &format!("{}{pot}{lid}", bar.replace(CORE, rod)),
        &[
            "the core of coil 1 closes a loop through its winding",
            "leave a gap",
        ],
    );
}

/// Two bars end to end on a third, touching and overlapping, are as one body that is nowhere cut.
#[test]
fn boxes_that_touch_are_joined() {
    let place = Place::new();
    let body = |size: &str, at: &str| {
        format!("[[iron]]\nshape = \"box\"\nsize_mm = {size}\ncenter_mm = {at}\n")
    };
    let whole = body("[50, 24, 6]", "[0, 0, -40]");
    let parts = [
        body("[20, 24, 6]", "[-15, 0, -40]"),
        body("[35, 24, 6]", "[7.5, 0, -40]"),
    ];
    let [one, joined] = [whole, parts.concat()].map(|iron| {
        let result = evaluated_to(&place, &format!("{CORE}{iron}"), "0.03");
        (
            inductance_h(&result),
            result["array"]["iron"]["peak_field_t"].as_f64().unwrap(),
        )
    });
    assert!((one.0 / joined.0 - 1.0).abs() < 1e-4, "{one:?} {joined:?}");
    assert!((one.1 / joined.1 - 1.0).abs() < 0.05, "{one:?} {joined:?}");
    let other = "relative_permeability = 50\n";
    refused(
        &place,
        &format!("{CORE}{}{}{other}", parts[0], parts[1]),
        &["[[iron]] 0 and [[iron]] 1 overlap and are of different steels"],
    );
}

#[test]
fn a_bundle_keeps_the_mesh_and_verifies_from_its_copy() {
    let place = Place::new();
    let mesh = bar([50.0, 24.0, 6.0]);
    place.write("bar.stl", &mesh);
    design(&place, MESH);
    place.write("flat.toml", FLAT);
    let args = |out: &'static str| {
        [
            "calibrate",
            "design.toml",
            "flat.toml",
            "--out",
            out,
            "--tolerance",
            "0.1",
            "--vtk",
        ]
    };
    place.run(&args("out")).ends(0);
    assert_eq!(place.read("out/pair/flat/iron_0.stl"), mesh);
    let manifest: Value = serde_json::from_str(&place.text("out/pair/flat/manifest.json")).unwrap();
    assert_eq!(manifest["inputs"][1]["path"], "bar.stl");
    let coils = place.read("out/pair/flat/vtk/coils.vtp");
    let head = String::from_utf8_lossy(&coils);
    // Windings as rings of 48 sides, and the twelve facets.
    assert!(head.contains("NumberOfPolys=\"396\""), "{}", &head[..400]);
    // What was cached belongs to the bytes, not to the name: computed again, the bundle would differ.
    place.write("bar.stl", &bar([50.0, 24.0, 3.0]));
    place
        .run(&["verify", "out/pair/flat"])
        .says(&["bar.stl has changed since the bundle was made"]);
    place.run(&args("out")).says(&["--force"]);
    let forced = [&args("out")[..], &["--force"]].concat();
    place.run(&forced).ends(0);
    assert_ne!(place.read("out/pair/flat/iron_0.stl"), mesh);
    place.shell("rm bar.stl").ends(0);
    place
        .run(&["verify", "out/pair/flat"])
        .ends(0)
        .says(&["iron_0.stl of the bundle stands for it"]);
}

/// No key of `[[iron]]` could be set: "iron is not a section of the design".
#[test]
fn regression_a_sweep_set_no_key_of_iron() {
    let place = Place::new();
    let bodies = [(20, 60), (8, -60)].map(|(side, x)| {
        format!(
            "[[iron]]\nshape = \"box\"\nsize_mm = [4, {side}, {side}]\ncenter_mm = [{x}, 0, 0]\n"
        )
    });
    let body = bodies.concat();
    design(&place, &format!("{CORE}{body}"));
    let plan = ["sweep", "plan", "design.toml", "--tolerance", "0.1"];
    let set = ["--set", "iron.1.size_mm=[4,8,8],[4,20,20]"];
    place.run(&[&plan[..], &set].concat()).ends(0);
    place
        .run(&["sweep", "run", "plan.json", "--out", "points"])
        .ends(0);
    place
        .run(&["sweep", "merge", "plan.json", "points"])
        .ends(0);
    let table = place.text("sweep.csv");
    let mut lines = table.lines();
    assert!(
        lines.next().unwrap().contains(",iron.1.size_mm,"),
        "{table}"
    );
    for (line, size) in lines.zip([8, 20]) {
        let alone = body.replace("[4, 8, 8]", &format!("[4, {size}, {size}]"));
        let known = evaluated(&place, &format!("{CORE}{alone}"));
        let peak = &known["array"]["iron"]["peak_field_t"];
        assert!(line.contains(&format!("\"[4,{size},{size}]\"")), "{line}");
        assert!(line.contains(&peak.to_string()), "{peak}: {line}");
    }
    let several = ["--set", "iron.size_mm=[4,8,8],[4,20,20]"];
    place
        .run(&[&plan[..], &several].concat())
        .ends(3)
        .says(&["2 [[iron]]: name one by its index, as in iron.0.size_mm"]);
}

#[test]
fn the_plan_of_a_sweep_records_the_mesh() {
    let place = Place::new();
    place.write("bar.stl", &bar([50.0, 24.0, 6.0]));
    design(&place, &format!("{CORE}{MESH}"));
    let plan = [
        "sweep",
        "plan",
        "design.toml",
        "--set",
        "core.above_mm=1,2",
        "--out",
        "plan.json",
    ];
    place.run(&plan).ends(0);
    let plan: Value = serde_json::from_str(&place.text("plan.json")).unwrap();
    assert_eq!(plan["inputs"][1]["path"], "bar.stl", "{plan}");
    place.write("bar.stl", &bar([50.0, 24.0, 3.0]));
    place
        .run(&["sweep", "run", "plan.json", "--out", "points"])
        .says(&["bar.stl: the file has changed since the plan was made"]);
}

#[test]
fn a_mesh_that_cannot_be_is_refused_with_its_place() {
    let place = Place::new();
    let mesh = |more: &str| format!("{CORE}{MESH}{more}");
    refused(
        &place,
        &mesh(""),
        &["iron[0].surface", "bar.stl", "no such file"],
    );
    place.write("bar.stl", "");
    refused(&place, &mesh(""), &["bar.stl", "empty"]);
    place.write("bar.stl", &bar([50.0, 24.0, 6.0]));
    refused(
        &place,
        &mesh("").replace("unit = \"mm\"\n", ""),
        &["[[iron]] 0", "STL files carry no unit"],
    );
    refused(
        &place,
        &mesh("").replace("\"mm\"", "\"mn\""),
        &["iron[0].unit", "expected mm, cm"],
    );
    refused(
        &place,
        &mesh("").replace("translate_mm", "center_mm"),
        &["iron[0].center_mm", "no such key", "translate_mm"],
    );
    refused(
        &place,
        &mesh("").replace("-40]", "-35]"),
        &[
            "[[iron]] 0",
            "and the core of coil",
            "mm: closer steel is not resolved",
        ],
    );
    refused(
        &place,
        &mesh("").replace("[0, 0, -40]", "[0, 0, -25]"),
        &["[[iron]] 0 cuts the winding of coil 0", "mm; move it"],
    );
    let other = MESH.replace("-40]", "-46.01]");
    refused(
        &place,
        &mesh(&other),
        &["[[iron]] 0 and [[iron]] 1 are less than", "one united mesh"],
    );
    // Above the coils, where the finger's magnet is.
    let roof = mesh("").replace("-40]", "20]");
    design(&place, &roof);
    place
        .run(&["map", "design.toml", "--tolerance", "0.1"])
        .ends(3)
        .says(&["mm inside [plate] or [[iron]]"]);
    refused(
        &place,
        &format!("{roof}[target]\nheight_mm = 20\n"),
        &["the magnet at the target", "above coil 0"],
    );
    let open = bar([50.0, 24.0, 6.0]);
    let mut open = open[..open.len() - 50].to_vec();
    open[80] -= 1;
    place.write("bar.stl", &open);
    refused(
        &place,
        &mesh(""),
        &["bar.stl: the mesh is open: 3 edges", "mm; close it"],
    );
}

#[test]
fn a_mesh_is_drawn_with_its_array() {
    let place = Place::new();
    place.write("bar.stl", &bar([50.0, 24.0, 6.0]));
    let drawn = |more: &str| {
        design(&place, more);
        let args = [
            "evaluate",
            "design.toml",
            "--tolerance",
            "0.05",
            "--plot",
            "array.svg",
            "--force",
        ];
        place.run(&args).ends(0);
        place.text("array.svg").matches("<path ").count()
    };
    assert_eq!(drawn(&format!("{CORE}{MESH}")), 2 + drawn(CORE));
}

fn refused(place: &Place, more: &str, words: &[&str]) -> Ran {
    design(place, more);
    place.run(&["evaluate", "design.toml"]).ends(3).says(words)
}

#[test]
fn steel_that_cannot_be_is_refused_with_its_reason() {
    let place = Place::new();
    let plate = |with: &str| format!("{PLATE}{with}");
    let body = |of: &str| format!("{CORE}[[iron]]\n{of}");
    refused(
        &place,
        &PLATE.replace("70.0", "40.0"),
        &[
            "the core of coil 0: the circle of 14.000 mm",
            "crosses an edge",
        ],
    );
    refused(
        &place,
        &PLATE.replace("y_mm = 40.0\n", ""),
        &["two sides or its diameter"],
    );
    refused(
        &place,
        &plate("bh_curve = \"x.csv\"\n"),
        &["plate.bh_curve", "linear"],
    );
    refused(
        &place,
        &plate("gap_mm = 0.02\n"),
        &["closer steel is not resolved"],
    );
    let hole = |hole: &str| plate(&format!("holes_mm = [[0, 0, 3], {hole}]\n"));
    refused(
        &place,
        &hole("[16.5, 9, 5]"),
        &["hole 1", "the foot of coil 1"],
    );
    refused(&place, &hole("[33, 0, 5]"), &["hole 1", "the plate's edge"]);
    refused(&place, &hole("[2, 2, 3]"), &["holes 0 and 1"]);
    refused(&place, &hole("[2, 2]"), &["a hole [x, y, diameter]"]);
    refused(&place, &hole("[2, 2, 0]"), &["no diameter"]);
    let box_at = |size: &str, at: &str| {
        body(&format!(
            "shape = \"box\"\nsize_mm = {size}\ncenter_mm = {at}\n"
        ))
    };
    refused(
        &place,
        &box_at("[5, 5, 5]", "[25, 0, -10]"),
        &["cuts the winding of coil 1"],
    );
    refused(
        &place,
        &box_at("[5, 5, 5]", "[25, 0, 2.53]"),
        &["[[iron]] 0", "core of coil 1"],
    );
    refused(
        &place,
        &body("size_mm = [5, 5, 5]\n"),
        &["iron[0].shape", "box, cylinder, tube, ball, mesh"],
    );
    refused(
        &place,
        &body("shape = \"ball\"\nlength_mm = 3\n"),
        &["no such key", "which is missing"],
    );
    design(&place, PLATE);
    place.write("points.csv", "x_m,y_m,z_m\n0.001,0.002,-0.036\n");
    let inside = place.run(&["probe", "design.toml", "points.csv", "--tolerance", "0.1"]);
    inside
        .ends(3)
        .says(&["lies 2.000 mm inside [plate] or [[iron]], where"]);
    let roof = "shape = \"box\"\nsize_mm = [60, 60, 4]\ncenter_mm = [0, 0, 20]\n";
    design(&place, &body(roof));
    let map = ["map", "design.toml", "--out", "out", "--tolerance", "0.1"];
    place
        .run(&map)
        .ends(3)
        .says(&["from the surface of [plate] or [[iron]]"]);
}
