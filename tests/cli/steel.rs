//! Designs with steel: what is refused, what is warned of, the summaries.

use fluxform_testing::place::Place;
use fluxform_testing::run::Ran;

const CORED: &str = "designs/seed.toml";

/// The shipped design with `from` replaced by `to`, as `design.toml`.
fn changed(place: &Place, from: &str, to: &str) {
    let text = String::from_utf8(place.read(CORED)).unwrap();
    let new = text.replace(from, to);
    assert_ne!(new, text, "{from} is not in {CORED}");
    place.write("design.toml", &new);
}

fn evaluate(place: &Place, from: &str, to: &str) -> Ran {
    changed(place, from, to);
    place.run(&["evaluate", "design.toml"])
}

/// `evaluate` with the steel of a table.
fn with_table(place: &Place, rows: &str) -> Ran {
    place.write("steel.csv", &format!("b_t,h_a_per_m\n{rows}"));
    evaluate(
        place,
        "relative_permeability = 1000.0",
        "bh_curve = \"steel.csv\"",
    )
}

#[test]
fn cores_that_cannot_be_are_refused_with_their_line() {
    let place = Place::new();
    let refused = |from: &str, to: &str, words: &[&str]| {
        evaluate(&place, from, to)
            .ends(3)
            .says(&["design.toml"])
            .says(words);
    };
    refused(
        "clearance_mm = 0.0",
        "clearance_mm = -1.0",
        &[
            "core.clearance_mm",
            "26 mm in diameter",
            "thicker than the bore",
        ],
    );
    refused(
        "pitch_mm = 50.0",
        "pitch_mm = 20.0",
        &["array.pitch_mm", "coils 0 and 1 overlap"],
    );
    refused(
        "relative_permeability = 1000.0",
        "relative_permeability = 0.001",
        &["core.relative_permeability", "between 1 and 1e9"],
    );
    refused(
        "below_mm = 10.0",
        "below_mm = -100.0",
        &["core.below_mm", "no length"],
    );
    refused(
        "relative_permeability = 1000.0",
        "relative_permeability = 1000.0\nbh_curve = \"steel.csv\"",
        &["exclude each other"],
    );
}

#[test]
fn a_magnet_or_a_workspace_inside_the_steel_is_refused() {
    let place = Place::new();
    evaluate(&place, "height_mm = 30.0", "height_mm = 3.0")
        .ends(3)
        .says(&[
            "target.height_mm",
            "overlaps the core",
            "5 mm or higher",
            "^|^",
        ]);
    changed(&place, "above_mm = 0.0", "above_mm = 17.0");
    let map = place.run(&["map", "design.toml", "--out", "maps"]);
    map.ends(3).says(&[
        "workspace.z_mm",
        "reaches into a core",
        "begin at 17 or higher",
    ]);
    assert!(!place.path("maps").exists());
    // A point hardly off the steel, where the field is not resolved.
    let points = "x_m,y_m,z_m\n0,0,0.03\n0.05,0,0.0001\n";
    place
        .run_with_input(&["probe", CORED, "-"], points)
        .ends(3)
        .says(&["point 2 ", "core of coil 5", "keep 0.240 mm away"]);
}

#[test]
fn tables_that_are_no_magnetisation_curve_are_refused() {
    let place = Place::new();
    with_table(&place, "0,0\n0.5,100\n1.0,180\n0.9,300\n1.6,2000\n")
        .ends(3)
        .says(&["steel.csv:5", "b_t", "0.9", "sort the rows"]);
    with_table(&place, "0.1,20\n0.5,100\n1.0,180\n1.5,1000\n")
        .ends(3)
        .says(&["steel.csv", "0.1 T", "expected 0,0", "add the row"]);
    with_table(&place, "0,0\n0.5,1e6\n1.0,2e6\n1.5,3e6\n")
        .ends(3)
        .says(&["steel.csv", "row 2", "less permeable than vacuum"]);
    with_table(&place, "0,0\n0.5,fast\n")
        .ends(3)
        .says(&["steel.csv:3", "fast"]);
    place.write("steel.csv", "h,b\n0,0\n");
    place
        .run(&["evaluate", "design.toml"])
        .ends(3)
        .says(&["steel.csv:1", "b_t,h_a_per_m"]);
    changed(
        &place,
        "relative_permeability = 1000.0",
        "bh_curve = \"none.csv\"",
    );
    for command in ["evaluate", "map"] {
        place
            .run(&[command, "design.toml"])
            .ends(3)
            .says(&["none.csv", "check the path"]);
    }
}

#[test]
fn a_table_in_another_unit_is_warned_of() {
    let place = Place::new();
    let kilo = "0,0\n0.5,0.1\n1.0,0.18\n1.5,1.0\n1.9,15\n2.1,60\n2.3,200\n";
    with_table(&place, kilo)
        .ends(0)
        .says(&["warning: ", "kA/m", "multiply h_a_per_m by 1000"]);
    let json = place.run(&["evaluate", "design.toml", "--format", "json"]);
    let reported = json.ends(0).json()["warnings"][0].clone();
    assert!(reported.as_str().unwrap().contains("kA/m"), "{reported}");
}

#[test]
fn a_curve_that_starts_level_gives_numbers() {
    // Broke: its infinite permeability at the origin made the linear steel it is compared with NaN.
    let place = Place::new();
    let rows = "0,0\n0.2,10\n0.3,200\n1.0,1500\n1.5,5000\n1.8,20000\n";
    let ran = with_table(&place, rows).ends(0).says(&["starts level"]);
    let material = "infinite permeability, computed with 1e9";
    assert!(ran.out.contains(material), "{}", ran.out);
    let ran = place.run(&["evaluate", "design.toml", "--format", "json"]);
    ran.ends(0);
}

#[test]
fn a_core_above_its_knee_is_warned_of() {
    let place = Place::new();
    let ran = evaluate(&place, "current_max_a = 2.0", "current_max_a = 5.0").ends(0);
    let ran = ran.says(&[
        "warning: ",
        "1.78 T",
        "knee at 1.5 T",
        "taken as linear",
        "core.bh_curve",
    ]);
    assert!(ran.out.contains("|B| up to 1.782 T"), "{}", ran.out);
    let quiet = place.run(&["evaluate", "design.toml", "-q"]).ends(0);
    assert!(quiet.err.is_empty(), "{}", quiet.err);
    let low = place.run(&["evaluate", CORED]).ends(0);
    assert!(!low.err.contains("warning"), "{}", low.err);
}

/// `lambda` compared coupled cores alone with their knee.
#[test]
fn regression_lambda_was_silent_about_cores_that_are_not_coupled() {
    let place = Place::new();
    let shipped = String::from_utf8(place.read(CORED)).unwrap();
    let knee = |text: &str| text.replace("[core]", "[core]\nknee_t = 0.1");
    let alone = shipped.replace("[array]", "[array]\ncoupling = \"none\"");
    let one = shipped.replace("rows = 3", "rows = 1");
    let one = one.replace("columns = 3", "columns = 1");
    for text in [knee(&alone), knee(&one)] {
        place.write("design.toml", &text);
        let ran = place.run(&["lambda", "design.toml", "shapes/flat.toml"]);
        ran.says(&["the array at the chosen currents", "knee at 0.1 T"]);
    }
    place.write("design.toml", &alone);
    let below = place.run(&["lambda", "design.toml", "shapes/flat.toml"]);
    assert!(!below.err.contains("chosen currents"), "{}", below.err);
}

#[test]
fn the_steel_s_part_is_in_the_summary() {
    let place = Place::new();
    let linear = place.run(&["evaluate", CORED]).ends(0).out;
    for reported in [
        "778.87 mN up",
        "476.14 g and 391.63 g of steel",
        "relative permeability 1000",
        "|B| up to 0.7128 T",
        "95 % of the current after 93 +- ",
        "core peak",
        "core mean",
    ] {
        assert!(linear.contains(reported), "{reported}: {linear}");
    }
    let curve = place.run(&["evaluate", "designs/seed_1010.toml"]).ends(0);
    for reported in [
        "flux linkage 371.",
        "a B-H curve",
        "less than with",
        "off that along the B-H curve",
    ] {
        assert!(curve.out.contains(reported), "{reported}: {}", curve.out);
    }
    let lambda = ["lambda", "designs/seed_1010.toml", "shapes/flat.toml"];
    let lambda = place.run(&lambda).ends(0).out;
    assert!(lambda.contains("% off those added up"), "{lambda}");
    let felt = "tilt_deg = [10.0, 5.0]\npassive_force = true\nmodel = \"cylinder\"";
    let tilted = evaluate(&place, "model = \"dipole\"", felt).ends(0).out;
    for reported in [
        "down by the unpowered steel",
        "force along x, y, z ",
        "torque about x, y, z ",
        "passive force",
    ] {
        assert!(tilted.contains(reported), "{reported}: {tilted}");
    }
}

#[test]
fn the_compact_form_of_a_map_is_reported() {
    let place = Place::new();
    let args = ["map", CORED, "--out", "maps"];
    let reported = place.run(&args).ends(0).out;
    assert!(reported.contains("by a harmonic function"), "{reported}");
    let json = place.run(&[&args[..], &["--format", "json"]].concat());
    let table = json.ends(0).json()["table"].clone();
    let number = |key: &str| table[key].as_f64().unwrap();
    assert_eq!(number("from_m"), 0.01);
    assert_eq!(number("bytes"), 8.0 * number("coefficients"));
    assert!(number("bytes") < 7.77e6 && number("samples") < 107_909.0);
    assert!(number("certificate") < 3e-5 && number("checks") > 100.0);
    // Nothing of it where nothing is sampled.
    let air = [
        "map",
        "designs/seed_air.toml",
        "--out",
        "air",
        "--format",
        "json",
    ];
    assert!(place.run(&air).ends(0).json().get("table").is_none());
}

#[test]
fn a_probe_reports_the_force_on_the_magnet() {
    let place = Place::new();
    let points = "x_m,y_m,z_m\n0.007,0.013,0.031\n0.03,-0.02,0.047\n";
    let probe = |design: &str, more: &[&str]| {
        let args = [&["probe", design, "-", "--format", "json"], more].concat();
        place.run_with_input(&args, points).ends(0).json()
    };
    let column = |probe: &serde_json::Value, name: &str| -> Vec<f64> {
        let values = probe["columns"][name].as_array().unwrap();
        values.iter().map(|value| value.as_f64().unwrap()).collect()
    };
    let without = probe(CORED, &[]);
    assert!(without["columns"].get("force_z_n_per_a").is_none());
    assert!(without["accuracy"].get("force").is_none());
    let to = without["accuracy"]["field"]["relative_to"]
        .as_str()
        .unwrap();
    assert!(to.contains("at the point's height"), "{to}");
    let with = probe(CORED, &["--magnet-force"]);
    assert_eq!(
        column(&with, "dbz_dz_t_per_m_per_a"),
        column(&without, "dbz_dz_t_per_m_per_a")
    );
    // An upright dipole: F = m_z grad B_z, torque = m x B, m pointing down.
    let moment = -1.1579e6 * std::f64::consts::PI * 0.005_f64.powi(2) * 0.01;
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    for (force, field, sign) in [
        ("force_x_n_per_a", "dbz_dx_t_per_m_per_a", 1.0),
        ("force_y_n_per_a", "dbz_dy_t_per_m_per_a", 1.0),
        ("force_z_n_per_a", "dbz_dz_t_per_m_per_a", 1.0),
        ("torque_x_n_m_per_a", "by_t_per_a", -1.0),
        ("torque_y_n_m_per_a", "bx_t_per_a", 1.0),
    ] {
        let (felt, field) = (column(&with, force), column(&with, field));
        for (felt, field) in felt.iter().zip(&field) {
            let expected = sign * moment * field;
            let allowed = 1e-12 * largest(&[moment * field, moment]);
            assert!(
                (felt - expected).abs() < allowed,
                "{force} {felt} {expected}"
            );
        }
    }
    assert!(
        column(&with, "torque_z_n_m_per_a")
            .iter()
            .all(|t| *t == 0.0)
    );
    // The magnet's size changes the force a little, and its error is printed.
    changed(&place, "model = \"dipole\"", "model = \"cylinder\"");
    let cylinder = probe("design.toml", &["--magnet-force"]);
    let (small, large) = (
        column(&with, "force_z_n_per_a"),
        column(&cylinder, "force_z_n_per_a"),
    );
    let change = small
        .iter()
        .zip(&large)
        .map(|(a, b)| (a - b).abs() / largest(&small))
        .fold(0.0, f64::max);
    assert!((1e-3..2e-2).contains(&change), "{change}");
    let error = cylinder["accuracy"]["force"]["estimate"].as_f64().unwrap();
    assert!((1e-7..1e-3).contains(&error), "{error}");
    // As a table: six columns more.
    let table = place.run_with_input(
        &["probe", CORED, "-", "--components", "gz", "--magnet-force"],
        points,
    );
    let header = table.ends(0).out.lines().next().unwrap().to_owned();
    assert!(header.ends_with(
        ",dbz_dz_t_per_m_per_a,force_x_n_per_a,force_y_n_per_a,force_z_n_per_a,\
         torque_x_n_m_per_a,torque_y_n_m_per_a,torque_z_n_m_per_a"
    ));
    // Where the magnet has no room there is no force.
    place
        .run_with_input(
            &["probe", "design.toml", "-", "--magnet-force"],
            "x_m,y_m,z_m\n0,0,0.004\n",
        )
        .ends(3)
        .says(&["magnet"]);
}

/// Regression: `evaluate` stated no error of the force on a cylinder, which was off by 9e-6 at a tolerance of 0.1;
/// `probe` passed over a tolerance that its force misses, and refused a place for the height of another.
#[test]
fn the_force_on_a_cylinder_has_an_error_that_its_tolerance_governs() {
    let place = Place::new();
    const WIDE: &str = "name = \"wide\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\nlength_mm = 100\n\
        [wire]\ndiameter_mm = 0.7\n[array]\nrows = 1\ncolumns = 1\n[magnet]\ndiameter_mm = 40\nlength_mm = 10\n\
        model = \"cylinder\"\ntilt_deg = [0, 90]\n[supply]\ncurrent_max_a = 1\n[target]\nheight_mm = 25\n";
    place.write("wide.toml", WIDE);
    let evaluated = |tolerance: &str| {
        let args = ["evaluate", "wide.toml", "--tolerance", tolerance];
        let found = place.run(&[&args[..], &["--format", "json"]].concat());
        let found = found.ends(0).json();
        let force = found["target"]["force_vector_n"][0].as_f64().unwrap();
        (force, found["accuracy"]["force"]["estimate"].as_f64())
    };
    let (sure, _) = evaluated("1e-5");
    for tolerance in ["0.1", "0.001"] {
        let (force, stated) = evaluated(tolerance);
        // The largest gradient over the magnet gives at least this force.
        let off = (force / sure - 1.0).abs();
        let stated = stated.expect("an error of the force");
        assert!(off <= stated && stated < 1000.0 * off, "{off:e} {stated:e}");
    }
    // Far off the dipoles lie on the magnet's axis, with large shares of both signs: rounding alone might exceed the
    // default.
    place.write(
        "far.toml",
        &WIDE.replace("height_mm = 25", "height_mm = 85"),
    );
    place.run(&["evaluate", "far.toml"]).ends(0);
    let probe = |points: &str, tolerance: &str| {
        let args = ["probe", "wide.toml", "-", "--magnet-force"];
        let points = format!("x_m,y_m,z_m\n{points}\n");
        place.run_with_input(&[&args[..], &["--tolerance", tolerance]].concat(), &points)
    };
    probe("0,0,0.04", "1e-8").ends(0);
    probe("0,0,0.04", "1e-12").ends(4).says(&["E403", "force"]);
    // A power of two of the gap below, the magnet's dipoles would be too many.
    probe("0,0,0.05\n0,0,0.0233", "1e-3").ends(0);
    probe("0,0,0.05\n0,0,0.01", "1e-3").ends(3).says(&[
        "point 2",
        "centre 10.000 mm",
        "-10 mm from",
    ]);
}

/// Below the highest core or winding it was refused however far aside: heights alone counted.
#[test]
fn regression_a_cylinder_beside_windings_and_raised_cores_was_refused() {
    let place = Place::new();
    let design = |core: &str, magnet: &str| {
        format!(
            "name = \"beside\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\nlength_mm = 20\n\
             [wire]\ndiameter_mm = 0.7\n{core}[magnet]\ndiameter_mm = 10\nlength_mm = 10\n{magnet}\
             [supply]\ncurrent_max_a = 1\n"
        )
    };
    let core = "[core]\nabove_mm = 15\n";
    let probe = |text: &str, points: &str, more: &[&str]| {
        place.write("beside.toml", text);
        let points = format!("x_m,y_m,z_m\n{points}");
        let args = [&["probe", "beside.toml", "-", "--format", "json"], more].concat();
        place.run_with_input(&args, &points).ends(0).json()
    };
    let column = |probe: &serde_json::Value, name: &str| -> Vec<f64> {
        let values = probe["columns"][name].as_array().unwrap();
        values.iter().map(|value| value.as_f64().unwrap()).collect()
    };
    // Middles of equal parts of the magnet, whose moment is upright: dB_z/dx over it.
    let (x_m, z_m) = (0.034, -0.004);
    let mut inside = String::new();
    for layer in 0..10 {
        for ring in 0..5 {
            for sector in 0..16 {
                let r = 0.005 * ((f64::from(ring) + 0.5) / 5.0).sqrt();
                let (s, c) = (f64::from(sector) / 16.0 * std::f64::consts::TAU).sin_cos();
                let z = z_m + 0.001 * (f64::from(layer) - 4.5);
                inside += &format!("{},{},{z}\n", x_m + r * c, r * s);
            }
        }
    }
    let moment = -1.1579e6 * std::f64::consts::PI * 0.005_f64.powi(2) * 0.01;
    for core in ["", core] {
        let cylinder = design(core, "model = \"cylinder\"\n");
        let force = ["--magnet-force", "--tolerance", "1e-3"];
        let found = probe(&cylinder, &format!("{x_m},0,{z_m}\n0.5,0,-0.01\n"), &force);
        let mean = |name: &str| {
            let values = column(
                &probe(&design(core, ""), &inside, &["--tolerance", "1e-3"]),
                name,
            );
            values.iter().sum::<f64>() / values.len() as f64
        };
        for (felt, derivative) in [
            ("force_x_n_per_a", "dbz_dx_t_per_m_per_a"),
            ("force_z_n_per_a", "dbz_dz_t_per_m_per_a"),
        ] {
            let (felt, expected) = (column(&found, felt)[0], moment * mean(derivative));
            assert!(
                (felt / expected - 1.0).abs() < 4e-3,
                "{core}{derivative}: {felt} {expected}"
            );
        }
    }
    // Where it has no room, its distance is said.
    let points = "x_m,y_m,z_m\n0.022,0,-0.004\n";
    let args = ["probe", "beside.toml", "-", "--magnet-force"];
    place.write("beside.toml", &design("", "model = \"cylinder\"\n"));
    let ran = place.run_with_input(&args, points).ends(3);
    ran.says(&["3.000 mm from the nearest winding or steel", "move it away"]);
}

/// Two coils of the shipped design, as `design.toml`.
fn two_coils(place: &Place) {
    let text = String::from_utf8(place.read(CORED)).unwrap();
    let two = text
        .replace("rows = 3", "rows = 1")
        .replace("columns = 3", "columns = 2");
    assert_ne!(two, text);
    place.write("design.toml", &two);
}

/// Broke: 1.1e-6 and 2e-6 were stated for a tolerance of 1e-6, and the exit code was 0.
#[test]
fn a_probe_reaches_its_tolerance_or_says_that_it_does_not() {
    let place = Place::new();
    two_coils(&place);
    place.write("points.csv", "x_m,y_m,z_m\n0,0,0.01\n0.01,0,0.03\n");
    let reported = |tolerance: &str| {
        let arguments = [
            "probe",
            "design.toml",
            "points.csv",
            "--tolerance",
            tolerance,
            "--format",
            "json",
        ];
        place.run(&arguments)
    };
    for tolerance in [1e-5, 1e-6] {
        let ran = reported(&format!("{tolerance:e}"));
        let json = ran.ends(0).json();
        let stated = json["accuracy"]["field"]["estimate"].as_f64().unwrap();
        assert!(stated <= tolerance, "{stated:e} for {tolerance:e}");
    }
}

/// Broke: the array's inductances were left at 4.3e-6, and the flux density in the core at 2.9e-6, and
/// the tolerance called reached.
#[test]
fn every_stage_that_a_tolerance_governs_reaches_it_or_says_that_it_does_not() {
    let place = Place::new();
    two_coils(&place);
    for tolerance in [1e-5, 1e-6, 1e-7, 1e-9] {
        let given = format!("{tolerance:e}");
        let arguments = [
            "evaluate",
            "design.toml",
            "--tolerance",
            &given,
            "--format",
            "json",
        ];
        let json = place.run(&arguments).json();
        let of_stage = |name: &str| json["accuracy"][name]["estimate"].as_f64().unwrap();
        let core = ["core_field", "core_field_mean"];
        let stages = ["field", "inductance", "mutual_inductance"];
        let largest = (core.iter().chain(&stages)).fold(0.0_f64, |m, name| m.max(of_stage(name)));
        let reached = json["accuracy_reached"].as_bool().unwrap();
        assert_eq!(reached, largest <= tolerance, "{largest:e} for {given}");
        // The mean's rule is as fine as the request, whatever the other stages need.
        assert!(
            tolerance < 1e-6 || of_stage("core_field_mean") <= tolerance,
            "{given}"
        );
    }
    // Without a request the core's field is held to its own default.
    let plain = place
        .run(&["evaluate", "design.toml", "--format", "json"])
        .json();
    assert_eq!(plain["accuracy_reached"], true);
}

/// Where no cell between the points needed samples, their pull was that at no place: "inf mm high".
#[test]
fn regression_a_plate_within_its_grid_had_no_pull_of_the_steel() {
    let place = Place::new();
    place.write(
        "pull.toml",
        "name = \"pull\"\n[coil]\ninner_diameter_mm = 10.0\nouter_diameter_mm = 22.0\nlength_mm = 30.0\n[wire]\n\
         diameter_mm = 0.5\n[core]\nbelow_mm = 2\n[array]\nrows = 2\ncolumns = 2\npitch_mm = 24\n[magnet]\n\
         passive_force = true\n",
    );
    place.write(
        "plate.toml",
        "name = \"plate\"\nprimitive = \"flat\"\nside_mm = 40\nheight_mm = 20\n[points]\n\
         x_mm = [-50, 50, 31]\ny_mm = [-50, 50, 31]\n",
    );
    let args = ["lambda", "pull.toml", "plate.toml", "--format", "json"];
    let found = place.run(&args).ends(0).json();
    assert!(found["lambda_n_per_m"].as_f64().unwrap() > 0.0);
}

/// One coil with steel of a table, whose supply is `supply`.
fn saturated(place: &Place, array: &str, supply: &str) {
    place.write(
        "saturated.toml",
        &format!(
            "name = \"t\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\nlength_mm = 100\nturns = 1429\n\
             [wire]\ndiameter_mm = 0.7\n[core]\nbh_curve = \"designs/steel_1010.csv\"\n{array}\
             [magnet]\ndiameter_mm = 10\nlength_mm = 10\nmagnetization_a_per_m = 1.1579e6\n[supply]\n{supply}\n"
        ),
    );
}

/// Regression: above the knee forces per ampere are those at the limit alone, half of those at small currents; nothing
/// said so, and with a limit of the sum they were of a current that no coil can have.
#[test]
fn forces_of_a_saturated_core_hold_at_its_limit_alone() {
    let place = Place::new();
    place.write(
        "flat.toml",
        "name = \"flat\"\nprimitive = \"flat\"\nheight_mm = 30\nside_mm = 40\n[points]\n\
         x_mm = [-20.0, 20.0, 9]\ny_mm = [-20.0, 20.0, 9]\n",
    );
    let lambda = |flags: &[&str]| {
        let args = [&["lambda", "saturated.toml", "flat.toml"], flags].concat();
        place.run(&args).ends(0)
    };
    let number = |of: &serde_json::Value, path: &str| {
        of.pointer(path)
            .and_then(serde_json::Value::as_f64)
            .unwrap_or_else(|| panic!("{path}"))
    };
    let json = ["--format", "json"];
    saturated(&place, "", "current_max_a = 20");
    lambda(&["--at", "1"]).says(&[
        "above the steel's knee at 1.44 T",
        "--at: superposition ends",
    ]);
    place.write("at.csv", "x_m,y_m,z_m\n0,0,0.03\n");
    let probed = place.run(&["probe", "saturated.toml", "at.csv", "--out", "gz.csv"]);
    probed.ends(0).says(&["above the steel's knee"]);
    saturated(&place, "", "current_max_a = 20\ntotal_current_max_a = 2");
    let capped = lambda(&json).json();
    saturated(&place, "", "current_max_a = 2");
    let limited = lambda(&json).json();
    let [capped, limited] = [capped, limited].map(|of| number(&of, "/lambda_n_per_m"));
    assert!((capped / limited - 1.0).abs() < 1e-9, "{capped} {limited}");
    // Two coils share 8 A: neither has them, and the rest is an error of lambda.
    let two = "[array]\npositions_mm = [[-30.0, 0.0], [30.0, 0.0]]\ncoupling = \"none\"\n";
    saturated(&place, two, "current_max_a = 20\ntotal_current_max_a = 8");
    let shared = lambda(&json).json();
    let off = number(&shared, "/working_point/deviation_from_linear");
    let stated = number(&shared, "/headline/lambda_error_n_per_m");
    assert!(off > 0.03, "{off}");
    assert!(
        stated >= off * number(&shared, "/lambda_n_per_m"),
        "{stated} {off}"
    );
    // With feedback the currents are smaller than those that the forces per ampere are of: the headline left that out.
    saturated(&place, "", "current_max_a = 20");
    let felt = &lambda(&json).json()["headline"]["felt"];
    let parts = felt["parts"].as_array().expect("parts");
    let of_steel = parts
        .iter()
        .find(|part| part["cause"] == "smaller_currents");
    let of_steel = &of_steel.expect("the part of smaller currents")["error"];
    let [fixed, feedback] = ["static", "feedback"].map(|of| number(of_steel, &format!("/{of}")));
    assert!(fixed == 0.0 && feedback > 0.1, "{of_steel}");
    assert!(number(felt, "/total/feedback") > feedback, "{felt}");
}

/// Regression: the current that cores are solved at was the upper limit, whatever ran below zero, and the limit of the sum,
/// whatever the other coils leave of it: gradients were 36 % too large, and nothing said so.
#[test]
fn cores_saturate_at_the_largest_current_of_either_direction() {
    let place = Place::new();
    place.write("at.csv", "x_m,y_m,z_m\n0,0,0.03\n");
    let gradient = |array: &str, supply: &str| {
        saturated(&place, array, supply);
        let args = [
            "probe",
            "saturated.toml",
            "at.csv",
            "--components",
            "gz",
            "--format",
            "json",
        ];
        let json = place.run(&args).ends(0).json();
        json["columns"]["dbz_dz_t_per_m_per_a"][0].as_f64().unwrap()
    };
    let two = "[array]\npositions_mm = [[0.0, 0.0], [300.0, 0.0]]\ncoupling = \"none\"\n";
    let expected = gradient("", "current_max_a = 10");
    let small = gradient("", "current_max_a = 0.5");
    assert!((small / expected - 1.0).abs() > 0.1, "{small} {expected}");
    let reverse = gradient("", "current_max_a = 0.5\ncurrent_min_a = -10");
    assert!(
        (reverse / expected - 1.0).abs() < 1e-9,
        "{reverse} {expected}"
    );
    // One has 10 A where the other has -9.5 A.
    let supply = "current_max_a = 10\ncurrent_min_a = -10\ntotal_current_max_a = 0.5";
    let opposed = gradient(two, supply);
    let alone = gradient(two, "current_max_a = 10");
    assert!((opposed / alone - 1.0).abs() < 1e-9, "{opposed} {alone}");
}

/// Regression: coupled cores of a B-H curve were linear with the permeability at the mean |B| of one alone, which above
/// the knee left the gradient 5.9 % (6 A) and 33 % (20 A) off where no neighbour is near, beside a stated error of 1e-5.
#[test]
fn coupled_cores_above_the_knee_have_the_gradient_of_the_curve() {
    const HEIGHTS_M: [f64; 4] = [0.01, 0.03, 0.05, 0.08];
    let place = Place::new();
    let points = |heights: &[f64]| {
        let row = |z: &f64| format!("0,0,{z}\n0.009,0,{z}\n0.03,0,{z}\n");
        let rows: String = heights.iter().map(row).collect();
        place.write("at.csv", &format!("x_m,y_m,z_m\n{rows}"));
    };
    let probe = |array: &str, current_a: f64| {
        saturated(&place, array, &format!("current_max_a = {current_a}"));
        let args = ["probe", "saturated.toml", "at.csv", "--components", "gz"];
        let json = place.run(&[&args[..], &["--format", "json"]].concat());
        json.ends(0).json()
    };
    let gradients = |of: &serde_json::Value| -> Vec<f64> {
        let column = |name: &str| of["columns"][name].as_array().unwrap().clone();
        let rows = column("coil")
            .into_iter()
            .zip(column("dbz_dz_t_per_m_per_a"));
        rows.filter(|(coil, _)| coil.as_f64() == Some(0.0))
            .map(|(_, g)| g.as_f64().unwrap())
            .collect()
    };
    let apart = "[array]\npositions_mm = [[0.0, 0.0], [1000.0, 0.0]]\n";
    for (current_a, most) in [(6.0, 0.02), (20.0, 0.15)] {
        points(&HEIGHTS_M);
        let (alone, pair) = (probe("", current_a), probe(apart, current_a));
        let (alone, found) = (gradients(&alone), gradients(&pair));
        let off = |row: usize| (found[row] / alone[row] - 1.0).abs();
        assert!(off(3) < 1e-4, "{current_a} A at the target: {:e}", off(3));
        let stated = &pair["accuracy"]["linear_cores"]["estimate"];
        let stated = stated.as_f64().expect("what the linear cores leave");
        let worst =
            (0..alone.len()).map(|row| (found[row] - alone[row]).abs() / alone[row / 3 * 3].abs());
        let worst = worst.fold(0.0, f64::max);
        assert!(
            worst <= stated && stated < most,
            "{current_a} A: {worst:e} {stated:e}"
        );
    }
    // Below the knee nothing is left; one core alone, or none that is coupled, has nothing of it.
    let below = probe(apart, 1.0);
    let stated = &below["accuracy"]["linear_cores"]["estimate"];
    assert!(stated.as_f64().unwrap() < 1e-4, "{stated}");
    let none = format!("{apart}coupling = \"none\"\n");
    assert!(probe(&none, 6.0)["accuracy"].get("linear_cores").is_none());
    saturated(&place, apart, "current_max_a = 6");
    let args = ["probe", "saturated.toml", "at.csv", "--out", "gz.csv"];
    place.run(&args).ends(0).says(&[
        "above the steel's knee",
        "coupled cores are taken as linear",
    ]);
}

/// Its largest |B| was 0 T at the origin.
#[test]
fn a_body_of_the_permeability_of_air_has_no_largest_field() {
    let place = Place::new();
    let text = String::from_utf8(place.read("designs/seed_air.toml")).unwrap();
    let plate =
        "[plate]\nthickness_mm = 4.0\nx_mm = 70.0\ny_mm = 40.0\nrelative_permeability = 1.0\n";
    place.write("design.toml", &format!("{text}\n{plate}"));
    let result = place.run(&["evaluate", "design.toml", "--format", "json"]);
    let result = result.ends(0).json();
    assert!(
        result["array"]["iron"]["peak_field_t"].is_null(),
        "{result}"
    );
    let shown = place.run(&["evaluate", "design.toml"]).ends(0).out;
    assert!(
        shown.contains("not magnetised: relative_permeability = 1"),
        "{shown}"
    );
}

/// Forces that `replay` gave by cores saturated at the largest current were 30 % too small at smaller ones, beside a stated
/// error of 1e-4.
#[test]
fn regression_replay_took_smaller_currents_for_the_largest() {
    let place = Place::new();
    place.write(
        "flat.toml",
        "name = \"flat\"\nprimitive = \"flat\"\nheight_mm = 30\nside_mm = 20\n[points]\n\
         x_mm = [-10.0, 10.0, 9]\ny_mm = [-10.0, 10.0, 9]\n",
    );
    let workspace = "[workspace]\nx_mm = [-10, 10, 9]\ny_mm = [-10, 10, 9]\nz_mm = [20, 40, 9]\n";
    saturated(&place, workspace, "current_max_a = 20");
    let args = ["calibrate", "saturated.toml", "flat.toml", "--out", "b"];
    place
        .run(&[&args[..], &["--no-report"]].concat())
        .ends(0)
        .says(&["those of smaller currents are up to"]);
    place.write("t.csv", "t_s,x_m,y_m,z_m\n0,0,0,0.025\n0.1,0.002,0,0.028\n");
    let args = ["replay", "b/t/flat", "t.csv", "--out", "r.csv"];
    let args = [&args[..], &["--format", "json"]].concat();
    let replayed = place.run(&args).ends(0);
    let stated = replayed.json()["accuracy"]["force"]["estimate"].as_f64();
    let stated = stated.expect("an error of the force");
    let table = place.text("r.csv");
    let mut rows = csv::Reader::from_reader(table.as_bytes());
    let rows: Vec<std::collections::HashMap<String, String>> =
        rows.deserialize().map(|row| row.expect("a row")).collect();
    let mut worst = 0.0_f64;
    for row in rows {
        let number = |name: &str| row[name].parse::<f64>().expect("a number");
        let current_a = number("current_0_a");
        assert!(current_a < 19.0, "{current_a}");
        saturated(&place, "", &format!("current_max_a = {current_a}"));
        let [x, y, z] = ["x_m", "y_m", "z_m"].map(number);
        place.write("at.csv", &format!("x_m,y_m,z_m\n{x},{y},{z}\n"));
        let args = ["probe", "saturated.toml", "at.csv", "--magnet-force"];
        let probed = place.run(&[&args[..], &["--format", "json"]].concat());
        let per_a = probed.ends(0).json()["columns"]["force_z_n_per_a"][0].clone();
        let force_n = per_a.as_f64().expect("a force") * current_a;
        worst = worst.max((force_n - number("force_n")).abs());
    }
    assert!(worst > 0.1, "saturated: {worst} N");
    assert!(stated > worst && stated < 10.0 * worst, "{stated} {worst}");
    let warnings = replayed.json()["warnings"].to_string();
    assert!(
        warnings.contains("of smaller ones they are up to"),
        "{warnings}"
    );
}
