//! The force as a vector on the command line: static currents, two fingers, comparisons.

use fluxform_testing::place::Place;
use fluxform_testing::root;
use serde_json::Value;

use crate::SEED;

fn wedge(place: &Place, more: &str) -> &'static str {
    let text = format!(
        "name = \"wedge\"\nprimitive = \"wedge\"\nforce = \"vertical-only\"\n{more}[points]\n\
         x_mm = [-50.0, 50.0, 9]\ny_mm = [-50.0, 50.0, 9]\n"
    );
    place.write("small_wedge.toml", &text);
    "small_wedge.toml"
}

fn number(of: &Value, path: &str) -> f64 {
    of.pointer(path)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("{path} in {of}"))
}

/// Static currents were chosen for the upward component, whatever was requested.
#[test]
fn static_currents_for_a_vector_trade_what_is_noticed() {
    let place = Place::new();
    let solved = |more: &str, flags: &[&str]| {
        let command = [
            "lambda",
            SEED,
            wedge(&place, more),
            "--feedback",
            "--format",
            "json",
        ];
        let report = place.run(&[&command[..], flags].concat()).ends(0).json();
        report["feedback"]["vector"].clone()
    };
    let usual = solved("", &[]);
    let weight = number(&usual, "/static_vector/sideways_weight");
    assert!((weight - 0.07 / 25.0_f64.to_radians().tan()).abs() < 1e-12);
    let of_upward = number(&usual, "/static/sideways_share");
    let sideways = |of: &Value| number(of, "/static_vector/at_chosen/rendering/sideways_share");
    let keener = solved("direction_jnd_deg = 5.0\n", &[]);
    assert!(
        sideways(&keener) < sideways(&usual) && sideways(&usual) < of_upward,
        "{keener}"
    );
    assert_eq!(
        keener["static_vector"],
        solved("", &["--direction-jnd", "5deg"])["static_vector"]
    );
    let worst = "/static_vector/at_chosen/worst";
    let low = number(&usual, &format!("{worst}/at_least_n"));
    let high = number(&usual, &format!("{worst}/worst_error_n"));
    assert!(low > 0.0 && low <= high && high < 1.1 * low, "{low} {high}");
}

/// The row and the page had the sideways force that feedback of the upward component leaves.
#[test]
fn regression_feedback_of_a_vector_had_the_sideways_force_of_another() {
    let place = Place::new();
    let upward = wedge(&place, "").replace("small", "upward");
    let text = String::from_utf8(place.read("small_wedge.toml")).unwrap();
    place.write(
        &upward,
        &text
            .replace("vertical-only", "vertical")
            .replace("name = \"wedge\"", "name = \"upward\""),
    );
    let command = [
        "calibrate",
        SEED,
        "small_wedge.toml",
        &upward,
        "--out",
        "out",
    ];
    let report = place.run(&command).ends(0);
    let rows = report
        .out
        .lines()
        .filter(|line| line.contains("  with feedback"));
    // Off by, upward and its range; sideways in between.
    let shares: Vec<usize> = rows.map(|row| row.matches('%').count()).collect();
    assert_eq!(shares, [3, 4], "{}", report.out);
    for (shape, says) in [("wedge", false), ("upward", true)] {
        let page = place.read(&format!("out/seed_air/{shape}/report.html"));
        let page = String::from_utf8(page).unwrap();
        assert_eq!(page.contains("degrees off; with feedback"), says, "{shape}");
    }
}

#[test]
fn two_fingers_are_somewhere_else_and_get_their_share() {
    let place = Place::new();
    place.write(
        "two_way.toml",
        &place.text(SEED).replace(
            "current_max_a = 2.0",
            "current_max_a = 2.0\ncurrent_min_a = -2.0",
        ),
    );
    let run = |design: &str, apart: &str| {
        place.run(&[
            "lambda",
            design,
            wedge(&place, ""),
            "--feedback",
            "--two-fingers",
            apart,
            "--format",
            "json",
        ])
    };
    let report = run("two_way.toml", "50mm,80mm").ends(0).json();
    let of = &report["feedback"]["two_fingers"];
    let share = |what: &str| number(of, what);
    assert_eq!(share("/pairs"), 1000.0);
    assert!(
        share("/upward_share") >= share("/vector_share") && share("/upward_share") > 0.5,
        "{of}"
    );
    // 3 mu_0 m^2 / (4 pi r^4) and twice that, for 0.91 A m^2 at 50 mm and more.
    assert!((0.001..0.08).contains(&share("/magnets_force_n")), "{of}");
    run("two_way.toml", "0,50mm")
        .ends(2)
        .says(&["cannot be in the same place"]);
    // Broke: magnets that lie in each other pushed each other by 389 N.
    run("two_way.toml", "5mm,8mm")
        .ends(3)
        .says(&["10 mm wide and 10 mm long overlap"]);
    let none = run("two_way.toml", "30cm,40cm").ends(0).json();
    assert_eq!(none["feedback"]["two_fingers"]["pairs"], 0);
}

/// Broke: the size was passed over in silence.
#[test]
fn a_size_along_the_normal_needs_a_force_along_it() {
    let place = Place::new();
    let given = |command: &str, more: &[&str]| {
        let args = [
            command,
            SEED,
            "shapes/flat.toml",
            "--normal-force",
            "upward",
        ];
        place.run(&[&args[..], more].concat())
    };
    for command in ["lambda", "calibrate"] {
        given(command, &[])
            .ends(3)
            .says(&["add --force-direction normal"]);
    }
    given("lambda", &["--force-direction", "normal"]).ends(0);
}

#[test]
fn compared_forces_are_vectors() {
    let place = Place::new();
    let shape = wedge(&place, "");
    let report = place
        .run(&[
            "compare",
            SEED,
            shape,
            "shapes/flat.toml",
            "--format",
            "json",
        ])
        .ends(0)
        .json();
    let pair = &report["pairs"][0];
    for kind in ["static", "feedback"] {
        assert!(number(pair, &format!("/{kind}_vector_jnd")) > 0.0);
        assert!(number(pair, &format!("/{kind}_vector_rms_jnd")) > 0.0);
        let upward = number(pair, &format!("/{kind}_at/a_force_n"));
        assert_eq!(number(pair, &format!("/{kind}_at/a_vector_n/2")), upward);
    }
    assert!(number(pair, "/static_at/a_vector_n/0").abs() > 0.0);
}

/// Where the sum of the currents binds, the nearest forces of symmetric coils are not proven, and a cut by one of them was
/// taken for the proof that no force is within reach. The largest lambdas are those of a linear program at every point.
#[test]
fn regression_a_force_vector_within_a_binding_sum_was_out_of_reach() {
    let place = Place::new();
    place.write(
        "dome.toml",
        "name = \"dome\"\nprimitive = \"half-sphere\"\nradius_mm = 50\nbase_mm = 30\nforce = \"vertical-only\"\n\
         [points]\nx_mm = [-50.0, 50.0, 9]\ny_mm = [-50.0, 50.0, 9]\n",
    );
    let seed = std::fs::read_to_string(root().join(SEED)).expect("the design");
    for (sum_a, largest) in [("18.0", 0.230_256), ("9.0", 0.180_332), ("4.0", 0.111_04)] {
        let text = seed.replace(
            "total_current_max_a = 18.0",
            &format!("total_current_max_a = {sum_a}"),
        );
        place.write("sum.toml", &text);
        let args = [
            "lambda",
            "sum.toml",
            "dome.toml",
            "--feedback",
            "--format",
            "json",
        ];
        let report = place.run(&args).json();
        let found = number(&report, "/feedback/vector/lambda_n_per_m");
        assert!(
            (found / largest - 1.0).abs() < 1e-4,
            "{sum_a} A: {found}, not {largest}"
        );
    }
}

/// Of graded points small ones counted in the angles as much as large ones: 42 degrees of 16.
#[test]
fn angles_of_graded_points_are_those_of_the_object() {
    let place = Place::new();
    let angles = |points: &str, flags: &[&str]| {
        place.write(
            "dome.toml",
            &format!("name = \"dome\"\nprimitive = \"half-sphere\"\nradius_mm = 50\nbase_mm = 30\n{points}"),
        );
        let args = [&["lambda", SEED, "dome.toml", "--format", "json"], flags].concat();
        let report = place.run(&args).json();
        ["static", "feedback"].map(|of| number(&report, &format!("/sideways/{of}_median_deg")))
    };
    let even = angles(
        "[points]\nx_mm = [-50.0, 50.0, 61]\ny_mm = [-50.0, 50.0, 61]\n",
        &["--weights", "area"],
    );
    let graded = angles("", &["--max-deviation", "1mm", "--max-width", "4mm"]);
    for (even, graded) in even.into_iter().zip(graded) {
        assert!(
            (even - graded).abs() < 0.05 * even,
            "{even} and {graded} degrees"
        );
    }
}

/// A search over arrays took every request of a vector for an upright one.
#[test]
fn a_search_renders_the_vector_that_a_shape_requests() {
    let place = Place::new();
    place.write(
        "four.toml",
        "name = 'four'\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\nlength_mm = 30.0\n\
         [wire]\ndiameter_mm = 0.7\n[array]\nrows = 2\ncolumns = 2\npitch_mm = 45.0\n[magnet]\n[supply]\n\
         current_max_a = 2.0\ncurrent_min_a = -2.0\n",
    );
    for force in ["vertical-only", "normal"] {
        place.write(
            "dome.toml",
            &format!(
                "name = 'dome'\nprimitive = 'half-sphere'\nradius_mm = 40\nbase_mm = 25\nforce = '{force}'\n\
                 [points]\nx_mm = [-15.0, 15.0, 7]\ny_mm = [-15.0, 15.0, 7]\n"
            ),
        );
        let args = [
            "lambda",
            "four.toml",
            "dome.toml",
            "--feedback",
            "--format",
            "json",
        ];
        let report = place.run(&args).json();
        let mut args = vec![
            "optimize",
            "four.toml",
            "--for",
            "dome.toml",
            "--constant",
            "vector",
        ];
        args.extend([
            "--vary",
            "array.pitch_mm=40:50",
            "--evaluations",
            "4",
            "--starts",
            "1",
        ]);
        args.extend(["--format", "json"]);
        let found = place.run(&args).json();
        let [alone, before] = [
            number(&report, "/feedback/vector/lambda_n_per_m"),
            number(&found, "/shapes/0/lambda_before_n_per_m"),
        ];
        assert!(
            (alone / before - 1.0).abs() < 1e-6,
            "{force}: {alone} and {before}"
        );
    }
}
