//! What is uncertain of the display in use: flags, the design's section, and the felt error.

use fluxform_testing::place::Place;
use serde_json::Value;

use crate::SEED;

const GIVEN: [&str; 8] = [
    "--sensor-error",
    "4mm",
    "--tilt",
    "10deg",
    "--heat",
    "20C",
    "--driver-error",
    "2%",
];

fn flat(place: &Place) -> &'static str {
    place.write(
        "flat.toml",
        "name = \"flat\"\nsurface = \"shapes/flat.stl\"\nunit = \"mm\"\n\
         translate_mm = [0.0, 0.0, 50.0]\nforce = \"vertical-only\"\n[points]\n\
         x_mm = [-40.0, 40.0, 9]\ny_mm = [-40.0, 40.0, 9]\n",
    );
    "flat.toml"
}

fn solved(place: &Place, design: &str, flags: &[&str]) -> Value {
    let args = ["lambda", design, flat(place), "--format", "json"];
    place.run(&[&args[..], flags].concat()).ends(0).json()
}

/// Points were taken in equal steps: of 1000 rows of ten points all of one column, and the force vector was called 160 %
/// off and within reach everywhere.
#[test]
fn longer_columns_of_points_do_not_change_what_a_finger_feels() {
    let place = Place::new();
    let surface = ["--unit", "mm", "--translate", "0,0,30"];
    let [few, many] = ["10x100", "10x1000"].map(|grid| {
        let args = ["lambda", SEED, "shapes/wedge.stl", "--grid", grid];
        let flags = ["--sensor-error", "4mm", "--format", "json"];
        let args = [&args[..], &surface, &flags].concat();
        place.run(&args).ends(0).json()
    });
    for path in [
        "/sideways/static_share",
        "/sideways/feedback_share",
        "/headline/feedback/least",
        "/uncertainty/exact/static",
        "/uncertainty/exact/feedback",
    ] {
        let [few, many] = [number(&few, path), number(&many, path)];
        assert!((many / few - 1.0).abs() < 0.05, "{path}: {few} and {many}");
    }
}

fn number(of: &Value, path: &str) -> f64 {
    of.pointer(path)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("{path} in {of}"))
}

/// Nothing said what a sensor or a finger costs, and least-power currents were all there was.
#[test]
fn a_sensor_that_is_four_millimetres_off_costs_less_with_currents_chosen_for_it() {
    let place = Place::new();
    let found = solved(&place, SEED, &GIVEN[..2]);
    let study = &found["uncertainty"];
    for kind in ["promised", "realised"] {
        let of = |what: &str| number(study, &format!("/robust/error/{kind}/{what}"));
        assert!(of("vertical") < 0.10 && of("sideways") < 0.06, "{study}");
        let plain = number(study, &format!("/feedback/{kind}/expected"));
        assert!(of("expected") < 0.9 * plain, "{study}");
    }
    let felt = &found["headline"]["felt"];
    let error = number(&found, "/headline/force_error");
    let total = number(felt, "/total/robust");
    let promised = number(study, "/robust/error/promised/expected");
    assert!((total - promised - error).abs() < 1e-12, "{felt}");
    let missing = felt["not_modelled"].as_array().expect("a list");
    assert!(
        missing
            .iter()
            .any(|one| one.as_str().is_some_and(|one| one.contains("tilt")))
    );
    let plain = solved(&place, SEED, &[]);
    assert_eq!(plain["uncertainty"], Value::Null);
    assert!(
        number(&plain, "/headline/felt/total/feedback") < 0.1,
        "{}",
        plain["headline"]["felt"]
    );
    assert!(number(&plain, "/headline/felt/total/static") > 0.2);
}

#[test]
fn a_design_states_its_uncertainties_and_flags_take_their_place() {
    let place = Place::new();
    let seed = place.text(SEED);
    let section =
        "\n[uncertainty]\nsensor_mm = 4.0\ntilt_deg = 10.0\nheat_c = 20.0\ndriver_percent = 2.0\n";
    place.write("uncertain.toml", &format!("{seed}{section}"));
    let stated = solved(&place, "uncertain.toml", &[]);
    let flagged = solved(&place, SEED, &GIVEN);
    assert_eq!(stated["uncertainty"], flagged["uncertainty"]);
    assert_eq!(
        stated["uncertainty"]["causes"].as_array().map(Vec::len),
        Some(4)
    );
    let exact = solved(
        &place,
        "uncertain.toml",
        &["--tilt", "0", "--sensor-error", "0", "--heat", "0"],
    );
    let causes = exact["uncertainty"]["causes"].as_array().expect("a list");
    assert_eq!(causes.len(), 1);
    assert_eq!(causes[0]["cause"], "driver");
    let text = place
        .run(&["lambda", "uncertain.toml", "flat.toml"])
        .ends(0)
        .out;
    for words in [
        "finger",
        "tilt of the finger 10 degrees: half",
        "left out",
        "chosen for the uncertainties",
    ] {
        assert!(text.contains(words), "{words} in {text}");
    }
}

/// A bundle held no setting, so a runtime knew the currents of least power alone.
#[test]
fn a_replay_commands_the_currents_that_its_bundle_was_made_for() {
    let place = Place::new();
    let shape = flat(&place);
    let calibrated = |flags: &[&str]| {
        let args = ["calibrate", SEED, shape, "--force"];
        place.run(&[&args[..], flags].concat()).ends(0);
    };
    let replay = [
        "replay",
        "results/seed_air/flat",
        "--synthesize",
        "explore",
        "--duration",
        "30",
        "--force",
        "--robust",
    ];
    calibrated(&[]);
    place
        .run(&replay)
        .ends(3)
        .says(&["holds no setting for uncertainties"]);
    calibrated(&["--sensor-error", "4mm"]);
    let found = place
        .run(&[&replay[..], &["--format", "json"]].concat())
        .ends(0)
        .json();
    let felt = &found["force"]["felt"];
    let of = |kind: &str| number(felt, &format!("/{kind}"));
    assert!(of("draws") >= 1000.0);
    assert!(
        of("robust/promised") < 0.9 * of("feedback/promised"),
        "{felt}"
    );
    for currents in ["robust", "feedback"] {
        let [promised, realised] =
            ["promised", "realised"].map(|kind| of(&format!("{currents}/{kind}")));
        assert!((realised / promised - 1.0).abs() < 0.1, "{felt}");
    }
    assert_eq!(found["made_with"]["robust"], true);
    // Positions outside the map took their share of the displays with them.
    place.write(
        "out.csv",
        "t_s,x_m,y_m,z_m\n0,0,0,0.05\n1,0.3,0,0.05\n2,0.3,0,0.05\n",
    );
    let mut args = [&replay[..], &["--format", "json"]].concat();
    args.splice(2..6, ["out.csv"]);
    let outside = place.run(&args).ends(0).json();
    assert_eq!(outside["force"]["felt"]["draws"], 1000);
    let plain = place.run(&[&replay[..7], &["--format", "json"]].concat());
    let plain = plain.ends(0).json();
    assert_eq!(plain["force"]["felt"], Value::Null);
    assert_eq!(plain["made_with"]["robust"], Value::Null);
}

/// The vector's error was drawn, beside which currents chosen for the upward force looked worst.
#[test]
fn regression_the_plot_shows_another_error_than_currents_are_chosen_for() {
    let place = Place::new();
    let shape = flat(&place);
    let upward = |force: &str| {
        let args = ["calibrate", SEED, shape, "--sensor-error", "4mm"];
        place
            .run(&[&args[..], &["--force-direction", force, "--force"]].concat())
            .ends(0);
        let plot = place.text("results/seed_air/flat/plots/uncertainty.svg");
        let page = place.text("results/seed_air/flat/report.html");
        ["upward error", "least error of the upward force"]
            .iter()
            .zip([plot, page])
            .all(|(words, of)| of.contains(words))
    };
    assert!(upward("vertical"));
    assert!(!upward("vertical-only"));
}

#[test]
fn bounds_beyond_the_map_or_all_sense_are_refused() {
    let place = Place::new();
    let shape = flat(&place);
    let refused = |code: i32, args: &[&str], words: &str| {
        place.run(args).ends(code).says(&[words]);
    };
    refused(
        3,
        &["lambda", SEED, shape, "--sensor-error", "60mm"],
        "between the magnet at the lowest point",
    );
    refused(
        2,
        &["lambda", SEED, shape, "--tilt", "100deg"],
        "expected 0 to 90deg",
    );
    refused(
        2,
        &["lambda", SEED, shape, "--driver-error", "-2%"],
        "expected 0 to 100",
    );
    refused(
        2,
        &["lambda", SEED, shape, "--heat", "warm"],
        "expected 0 to 300C",
    );
    refused(
        2,
        &["lambda", SEED, shape, "--power-cap", "0W"],
        "expected watts above 0",
    );
    refused(
        3,
        &["calibrate", SEED, shape, "--sensor-error", "25mm"],
        "larger than the map's reach of 20 mm",
    );
}

#[test]
fn a_cap_of_power_without_uncertainties_is_refused() {
    let place = Place::new();
    for command in ["lambda", "calibrate"] {
        let arguments = [
            command,
            "designs/seed_air.toml",
            "shapes/flat.toml",
            "--power-cap",
            "5",
        ];
        place
            .run(&arguments)
            .ends(3)
            .says(&["--power-cap", "there are none", "--sensor-error"]);
    }
}

/// Regression: a wedge that goes down to 5 mm was stated to be off by 135, 111, 212 and 151 % with feedback, to the last
/// digit, for 138 %: some points are in the narrow strip that decides, or none. Then, with a tilt that adds a hundredth
/// of a percent, by 50 +- 80 %.
#[test]
fn the_felt_error_of_some_points_states_what_others_may_change() {
    let place = Place::new();
    place.write(
        "steep.toml",
        "name = \"steep\"\nprimitive = \"wedge\"\nlow_mm = 5\nhigh_mm = 90\nside_mm = 80\n",
    );
    let felt = |flags: &[&str]| {
        let args = [&["lambda", SEED, "steep.toml", "--format", "json"], flags].concat();
        let found = place.run(&args).json();
        let text = place.run(&[&args[..3], flags].concat()).out;
        let shown = text.lines().find(|line| line.contains("finger"));
        assert!(shown.is_some_and(|line| line.contains("+-")), "{text}");
        found
    };
    // By a sum over 150 x 120 midpoints, and of static currents over all points of finer requests.
    let truth = [("static", 1.125), ("feedback", 1.38)];
    for error in ["3%", "1%", "0.3%"] {
        let exact = felt(&["--error", error]);
        let tilted = felt(&["--error", error, "--tilt", "5deg"]);
        for (currents, truth) in truth {
            let of = |found: &Value, what: &str| {
                number(found, &format!("/headline/felt/{what}/{currents}"))
            };
            for found in [&exact, &tilted] {
                let (share, off) = (of(found, "expected"), of(found, "sampling"));
                assert!(
                    (share - truth).abs() < off && off < 1.0,
                    "{currents}, {error}: {share} +- {off}"
                );
            }
            let [with, without] = [&tilted, &exact].map(|found| of(found, "expected"));
            assert!((with - without).abs() < 0.01, "{with} and {without}");
            // The headline and the study state one error.
            let study = number(
                &tilted,
                &format!("/uncertainty/{currents}/promised/expected"),
            );
            assert_eq!(study, with);
            let study = number(&tilted, &format!("/uncertainty/exact/{currents}"));
            assert!((study - without).abs() < 1e-12, "{study} and {without}");
        }
    }
}

/// The second coil of a pair in series was counted with its own resistance once more: 243 W of 219.
#[test]
fn a_pair_in_series_takes_the_power_of_its_two_coils() {
    let place = Place::new();
    let flags = ["--series", "0+8", "--sensor-error", "1mm", "--feedback"];
    let found = solved(&place, SEED, &flags);
    let currents = found["currents_a"].as_array().expect("currents");
    let squares = currents
        .iter()
        .map(|of| of.as_f64().expect("a number").powi(2));
    let heat = &found["hottest_coil"];
    // Coils that are alike, the hottest of which has the largest current.
    let ohm = number(heat, "/power_w") / number(heat, "/current_a").powi(2);
    let power_w = ohm * squares.sum::<f64>();
    for of in [
        "/uncertainty/static/promised/mean_power_w",
        "/feedback/vector/static/mean_power_w",
        "/feedback/without/power_w",
    ] {
        let stated = number(&found, of);
        assert!(
            (stated - power_w).abs() < 1e-9 * power_w,
            "{of}: {stated}, not {power_w}"
        );
    }
}
