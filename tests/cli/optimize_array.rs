//! `optimize --for`: the whole array, for shapes.

use std::collections::BTreeMap;

use fluxform::bundle::sweep::{ArrayRow, PlanFile, PointFile, Row, Status};
use serde_json::Value;

use crate::SEED;
use fluxform_testing::place::Place;

const FLAT: &str = "shapes/flat.toml";

fn number(value: &Value, path: &str) -> f64 {
    let found = path.split('/').fold(value, |value, key| &value[key]);
    found.as_f64().unwrap_or_else(|| panic!("{path}: {found}"))
}

/// The options of a quick search of coil and pitch in air.
const QUICK: [&str; 10] = [
    "--vary",
    "coil.inner_diameter_mm=6:30",
    "--vary",
    "array.pitch_mm=38:60",
    "--evaluations",
    "40",
    "--starts",
    "1",
    "--format",
    "json",
];

fn search<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec!["optimize", SEED, "--for", FLAT];
    arguments.extend(QUICK);
    arguments.extend(more);
    arguments
}

#[test]
fn the_best_array_meets_its_limits_and_is_a_design() {
    let place = Place::new();
    let result = place.run(&search(&["--out", "best.toml"])).ends(0).json();
    assert_eq!(result["status"], "done");
    assert_eq!(result["certificate"]["kind"], "local");
    assert!(number(&result, "gain") > 1.0, "{}", result["gain"]);
    for limit in result["limits"].as_object().unwrap().values() {
        assert_eq!(limit["met"], true, "{limit}");
    }
    let history = result["history"].as_array().unwrap();
    let grows = |pair: &[Value]| {
        number(&pair[0], "gain") < number(&pair[1], "gain")
            && number(&pair[0], "evaluations") < number(&pair[1], "evaluations")
    };
    assert!(!history.is_empty() && history.windows(2).all(grows));
    let last = number(history.last().unwrap(), "gain");
    assert!(
        (last / number(&result, "gain") - 1.0).abs() < 1e-2,
        "{last}"
    );
    let best = place
        .run(&["evaluate", "best.toml", "--strict", "--format", "json"])
        .ends(0)
        .json();
    let turns = number(&best, "coil/turns");
    assert_eq!(turns, turns.round());
    let lambda = place
        .run(&["lambda", "best.toml", FLAT, "--format", "json"])
        .ends(0)
        .json();
    let stated = result["shapes"][0]["lambda_n_per_m"].as_f64().unwrap();
    assert!((number(&lambda, "lambda_n_per_m") / stated - 1.0).abs() < 1e-9);
    place
        .run(&["calibrate", "best.toml", FLAT, "--no-report"])
        .ends(0);
    // The independent route: no tables, no telescoping, the duality gap from the points.
    let bundle = "results/seed_air_array/flat";
    place.run(&["verify", bundle]).ends(0);
}

/// The name of the best array's design was too long for one.
#[test]
fn regression_a_long_name_left_no_array() {
    let place = Place::new();
    let name = "a".repeat(100);
    let text = place
        .text(SEED)
        .replace("\"seed_air\"", &format!("{name:?}"));
    place.write("long.toml", &text);
    let vary = ["--vary", "array.pitch_mm=38:60", "--evaluations", "2"];
    let args = ["optimize", "long.toml", "--for", FLAT, "--out", "best.toml"];
    place.run(&[&args[..], &vary].concat()).ends(0);
    let best = format!("name = \"{}_array\"", &name[..94]);
    assert!(place.text("best.toml").contains(&best));
}

/// Two cored coils: the pattern of opposite currents settles more slowly than a coil alone.
#[test]
fn regression_the_settling_limit_held_for_a_coil_alone() {
    let place = Place::new();
    let text = place.text("designs/seed.toml");
    let text = text
        .replace("rows = 3", "rows = 1")
        .replace("columns = 3", "columns = 2")
        .replace("pitch_mm = 50.0", "pitch_mm = 39.0");
    place.write("two.toml", &text);
    let mut arguments = vec!["optimize", "two.toml", "--for", FLAT];
    arguments.extend(["--vary", "coil.length_mm=30:100", "--vary"]);
    arguments.extend(["coil.inner_diameter_mm=10:30", "--evaluations", "40"]);
    arguments.extend(["--starts", "1", "--out", "best.toml", "--format", "json"]);
    let result = place.run(&arguments).ends(0).json();
    let best = place
        .run(&["evaluate", "best.toml", "--strict", "--format", "json"])
        .ends(0)
        .json();
    let henry = |j: usize| best["array"]["mutual_inductance_h"][0][j].as_f64().unwrap();
    let settled = 5.0 * (henry(0) + henry(1).abs()) / number(&best, "coil/resistance_ohm");
    assert!((number(&best, "array/settling_s") / settled - 1.0).abs() < 1e-9);
    assert!(settled < 0.1 && settled > 0.09, "{settled}");
    assert!((number(&best, "limits/array_settling_s/value") / settled - 1.0).abs() < 1e-9);
    assert!(number(&best, "coil/settling_s") < settled, "{best}");
    assert_eq!(result["limits"]["array_settling_s"]["limit"], 0.1);
}

/// Heat by use is that of `lambda --feedback`, the cost that of the masses; `evaluate` and `lambda` say that they do not check it.
#[test]
fn heat_by_use_and_cost_are_limits() {
    let place = Place::new();
    let limited = |limits: &str| {
        let text = place.text(SEED);
        let text = text.replace("resistance_max_ohm = 6.0", "resistance_max_ohm = 7.0");
        let text = text.replace("[limits]", &format!("[limits]\n{limits}\n#"));
        let cost = "[cost]\nper_coil = 20.0\nwire_per_kg = 15.0\nsteel_per_kg = 4.0\n";
        place.write("limited.toml", &format!("{text}\n{cost}"));
    };
    let optimize = |more: &[&str]| {
        let mut arguments = vec!["optimize", "limited.toml", "--for", FLAT];
        arguments.extend(QUICK);
        arguments.extend(more);
        place.run(&arguments)
    };
    limited("static_power_max_w = 70\nfeedback_power_max_w = 30\narray_cost_max = 300");
    let result = optimize(&["--out", "best.toml"]).ends(0).json();
    let lambda = ["lambda", "best.toml", FLAT, "--feedback"];
    let lambda = place.run(&[&lambda[..], &["--format", "json"]].concat());
    let lambda = lambda.ends(0).json();
    // It left them out without a word.
    let warned = lambda["warnings"].to_string();
    for key in ["static", "feedback"] {
        let unchecked = format!("limits.{key}_power_max_w: not checked");
        assert!(warned.contains(&unchecked), "{warned}");
    }
    let checked = |key: &str| number(&result, &format!("limits/{key}/value"));
    for (key, stated) in [
        ("static_power_w", "feedback/without/power_w"),
        ("feedback_power_w", "feedback/at_chosen/mean_power_w"),
    ] {
        let (ours, stated) = (checked(key), number(&lambda, stated));
        assert!((ours / stated - 1.0).abs() < 1e-9, "{key}: {ours} {stated}");
        assert_eq!(result["limits"][key]["met"], true);
        assert_eq!(result["limits_given"][key]["met"], false, "{key}");
    }
    let run = place.run(&["evaluate", "best.toml", "--format", "json"]);
    let alone = run.ends(0).json();
    let warnings = alone["warnings"].to_string();
    assert!(
        warnings.contains("limits.static_power_max_w: not checked"),
        "{warnings}"
    );
    let mass_kg = number(&alone, "coil/mass_kg");
    let cost = number(&alone, "limits/array_cost/value");
    assert!(
        (cost - 9.0 * (20.0 + 15.0 * mass_kg)).abs() < 1e-9 * cost,
        "{cost}"
    );
    assert_eq!(checked("array_cost"), cost);
    place.run(&["calibrate", "best.toml", FLAT]).ends(0);
    let page = place.read("results/seed_air_array/flat/report.html");
    let page = String::from_utf8(page).expect("text");
    assert!(page.contains("heat at static currents"));
    assert!(page.contains("Not looked at here: heat with feedback"));
    // What no array meets is named before or after it is computed.
    limited("array_cost_max = 150");
    let run = optimize(&[]).ends(3);
    assert!(
        run.err.contains("meets cost of all coils <= 150"),
        "{}",
        run.err
    );
    place.write(
        "limited.toml",
        &(place.text(SEED) + "[cost]\nper_coil = 0\n")
            .replace("[limits]", "[limits]\narray_cost_max = 9\n#"),
    );
    let run = optimize(&[]).ends(3);
    assert!(run.err.contains("no prices to add up"), "{}", run.err);
}

/// Nothing that is searched lets a coil settle in time: its limit is not asked of the array either.
#[test]
fn a_settling_limit_that_the_given_coil_misses_does_not_fail_a_search_of_the_pitch() {
    let place = Place::new();
    let text = place.text("designs/seed.toml");
    let text = text
        .replace("rows = 3", "rows = 1")
        .replace("columns = 3", "columns = 2");
    place.write("two.toml", &text);
    let mut arguments = vec!["optimize", "two.toml", "--for", FLAT];
    arguments.extend(["--vary", "array.pitch_mm=39:60", "--starts", "1"]);
    arguments.extend(["--evaluations", "12", "--format", "json"]);
    let result = place.run(&arguments).ends(0).json();
    assert!(result["limits"]["array_settling_s"].is_null());
}

/// A known answer: the pitch alone against a fine scan, which the proven bound encloses.
#[test]
fn the_pitch_alone_is_that_of_a_fine_scan() {
    let place = Place::new();
    let text = place
        .text(SEED)
        .replace("resistance_max_ohm = 6.0", "resistance_max_ohm = 7.0");
    place.write("air.toml", &text);
    let result = place
        .run(&[
            "optimize",
            "air.toml",
            "--for",
            FLAT,
            "--vary",
            "array.pitch_mm=38:70",
            "--format",
            "json",
        ])
        .ends(0)
        .json();
    let found = result["shapes"][0]["lambda_n_per_m"].as_f64().unwrap();
    let at = |pitch: f64| {
        let moved = text.replace("pitch_mm = 50.0", &format!("pitch_mm = {pitch}"));
        place.write("scan.toml", &moved);
        let lambda = place
            .run(&["lambda", "scan.toml", FLAT, "--format", "json"])
            .ends(0)
            .json();
        number(&lambda, "lambda_n_per_m")
    };
    let scanned = (0..=16)
        .map(|k| at(38.0 + 2.0 * f64::from(k)))
        .fold(0.0, f64::max);
    assert!(found > scanned * (1.0 - 1e-4), "{found} {scanned}");
    let exact = at(number(&result, "values/array.pitch_mm"));
    assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
    assert_eq!(result["certificate"]["kind"], "global");
    let before = result["shapes"][0]["lambda_before_n_per_m"]
        .as_f64()
        .unwrap();
    let bound = number(&result, "certificate/upper_bound");
    assert!(bound >= scanned.max(found) / before, "{bound} {scanned}");
    let gap = number(&result, "certificate/gap");
    assert!(
        (bound / number(&result, "gain") - 1.0 - gap).abs() < 1e-12 && gap < 3e-3,
        "{gap}"
    );
}

/// Few whole values: all of them are computed, and the best is the best of all.
#[test]
fn numbers_of_rows_alone_are_all_computed() {
    let place = Place::new();
    let text = place
        .text(SEED)
        .replace("resistance_max_ohm = 6.0", "resistance_max_ohm = 7.0");
    place.write("air.toml", &text);
    let mut arguments = vec![
        "optimize",
        "air.toml",
        "--for",
        FLAT,
        "--vary",
        "array.rows=1,2,3",
    ];
    arguments.extend(["--format", "json"]);
    let result = place.run(&arguments).ends(0).json();
    assert_eq!(result["certificate"]["kind"], "exhaustive");
    let choices = result["choices"].as_array().unwrap();
    let gains: Vec<f64> = choices.iter().map(|c| number(c, "objective")).collect();
    assert_eq!(gains.len(), 3);
    assert!(gains[1..].iter().all(|gain| gains[0] >= *gain), "{gains:?}");
}

/// The error at a given force constant, as `lambda --at` states it.
#[test]
fn the_least_error_at_a_force_constant() {
    let place = Place::new();
    let more = [
        "--constant",
        "error",
        "--lambda",
        "1.3",
        "--out",
        "best.toml",
    ];
    let result = place.run(&search(&more)).ends(0).json();
    assert!(number(&result, "gain") > 1.0, "{}", result["gain"]);
    for (design, key) in [
        (SEED, "relative_error_before"),
        ("best.toml", "relative_error"),
    ] {
        let lambda = place
            .run(&["lambda", design, FLAT, "--at", "1.3", "--format", "json"])
            .ends(0)
            .json();
        let stated = result["shapes"][0][key].as_f64().unwrap();
        // The plate is 50 mm high everywhere.
        let exact = number(&lambda, "at/rms_error_n") / (1.3 * 0.05);
        assert!(
            (stated / exact - 1.0).abs() < 1e-9,
            "{key}: {stated} {exact}"
        );
    }
    for wrong in [&["--constant", "error"][..], &["--lambda", "1.3"]] {
        let run = place.run(&search(wrong)).ends(2);
        assert!(run.err.contains("go together"), "{}", run.err);
    }
}

/// Lowered into the coils, a shape of height next to nothing had a force constant of millions.
#[test]
fn regression_shapes_were_lowered_into_the_coils() {
    let place = Place::new();
    let mut arguments = vec![
        "optimize",
        SEED,
        "--for",
        FLAT,
        "--vary",
        "shapes.height_mm=-60:0",
    ];
    arguments.extend(["--evaluations", "12", "--format", "json"]);
    let result = place.run(&arguments).ends(0).json();
    // The plate lies at 50 mm, the workspace begins at 10 mm.
    let height = number(&result, "values/shapes.height_mm");
    assert!((-40.0..-39.0).contains(&height), "{height}");
    // A design holds no shapes.
    assert!(
        result["warnings"]
            .to_string()
            .contains("mm lower than given: move them"),
        "{result}"
    );
}

/// A known answer: mirrored shapes ask for mirrored arrays.
#[test]
fn mirrored_shapes_give_mirrored_arrays() {
    let place = Place::new();
    let text = place
        .text(SEED)
        .replace("rows = 3", "rows = 1")
        .replace("columns = 3", "columns = 2");
    let text = text.replace("resistance_max_ohm = 6.0", "resistance_max_ohm = 7.0");
    place.write(
        "two.toml",
        &format!("{text}\n[search]\narray.move_mm = [-12.0, 12.0]\narray.symmetry = \"free\"\n"),
    );
    let wedge = place.text("shapes/wedge.toml");
    place.write(
        "mirrored.toml",
        &wedge
            .replace("surface = \"", "surface = \"shapes/")
            .replace(
                "unit = \"mm\"",
                "unit = \"mm\"\nrotate_deg = [0.0, 0.0, 180.0]",
            ),
    );
    let gain = |shape: &str| {
        let run = place.run(&[
            "optimize",
            "two.toml",
            "--for",
            shape,
            "--evaluations",
            "120",
            "--format",
            "json",
        ]);
        let result = run.ends(0).json();
        let x = |group: usize| number(&result, &format!("values/array.move_{group}_mm"));
        (number(&result, "gain"), [x(1), x(3)])
    };
    let ((one, moves), (other, mirrored)) = (gain("shapes/wedge.toml"), gain("mirrored.toml"));
    assert!((one / other - 1.0).abs() < 2e-3, "{one} {other}");
    assert!(moves.iter().chain(&mirrored).all(|x| x.abs() <= 12.0));
}

/// The picture states what limits are worth, and is what its ending says.
#[test]
fn regression_a_png_of_the_trade_offs_held_svg() {
    let place = Place::new();
    let drawn = |file: &str| {
        place.run(&search(&["--plot", file])).ends(0);
        place.read(file)
    };
    assert!(drawn("front.png").starts_with(b"\x89PNG"));
    let svg = String::from_utf8(drawn("front.svg")).expect("text");
    assert!(
        svg.contains(" more of ") && svg.contains(" would give "),
        "{svg}"
    );
    place.run(&search(&["--plot", "front.jpeg"])).ends(2);
}

/// A page whose drawings are in its text: two arrays in two views, three trade-offs.
#[test]
fn the_page_shows_both_arrays_without_scripts() {
    let place = Place::new();
    let result = place
        .run(&search(&["--report", "page.html"]))
        .ends(0)
        .json();
    let page = String::from_utf8(place.read("page.html")).expect("text");
    let gain = format!("{:.3}", number(&result, "gain"));
    assert!(page.contains(&format!("Felt {gain} times")), "{gain}");
    assert_eq!(page.matches("<svg class=\"array\"").count(), 2 * 2 + 3);
    assert!(!page.contains("class=\"draw\"") && !page.contains("<noscript>"));
    for said in ["As given", " more of ", "nothing is proven", "within 1 %"] {
        assert!(page.contains(said), "{said}");
    }
    place.run(&search(&["--report", "-", "--out", "-"])).ends(2);
}

/// Every choice of layout is reported with its best array, and is a row of the trade-off over coils.
#[test]
fn choices_are_reported_with_the_gain_of_each() {
    let place = Place::new();
    let result = place
        .run(&search(&[
            "--vary",
            "array.columns=2,3",
            "--front",
            "trade.csv",
        ]))
        .ends(0)
        .json();
    let choices = result["choices"].as_array().unwrap();
    let coils: Vec<f64> = choices.iter().map(|one| number(one, "coils")).collect();
    assert_eq!(coils.iter().sum::<f64>(), 6.0 + 9.0);
    assert!(number(&choices[0], "objective") >= number(&choices[1], "objective"));
    let table = String::from_utf8(place.read("trade.csv")).expect("text");
    assert_eq!(
        table
            .lines()
            .filter(|row| row.starts_with("coils,"))
            .count(),
        2
    );
}

#[test]
fn an_earlier_run_is_taken_up_and_threads_do_not_matter() {
    let place = Place::new();
    let first = place
        .run(&search(&["--journal", "kept.json", "--threads", "1"]))
        .ends(0)
        .out;
    let again = place
        .run(&search(&["--journal", "kept.json", "--threads", "2"]))
        .ends(0)
        .out;
    assert_eq!(first, again);
    // A run that computes more takes the journal's place, as after an interruption; it was refused at its end.
    let kept = place.text("kept.json");
    let other = search(&["--journal", "kept.json", "--seed", "3"]);
    place.run(&other).ends(0);
    let grown = place.text("kept.json");
    assert!(grown.len() > kept.len(), "{} {}", grown.len(), kept.len());
    place.write("kept.json", &grown.replacen('#', "# mine", 1));
    place.run(&other).ends(4).says(&["kept.json"]);
}

/// The optimum's length was rounded beyond the limit that it lies on, and the given design taken in its place.
#[test]
fn an_optimum_on_a_limit_stays_within_it() {
    let place = Place::new();
    let design = "name = \"near\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\nlength_mm = 60\n\
                  [wire]\ndiameter_mm = 0.7\n[magnet]\ndiameter_mm = 10\nlength_mm = 8\n\
                  magnetization_a_per_m = 1.1e6\npolarity = \"repel\"\n[supply]\ncurrent_max_a = 2\n\
                  total_current_max_a = 6\n[target]\nheight_mm = 28\n[workspace]\nx_mm = [-50, 50, 11]\n\
                  y_mm = [-50, 50, 11]\nz_mm = [20, 80, 7]\n[array]\nrows = 2\npitch_mm = 45\n";
    let flat = "name = \"f\"\nprimitive = \"flat\"\nheight_mm = 40\n[points]\nx_mm = [-40, 40, 11]\n\
                y_mm = [-40, 40, 11]\n";
    place.write("f.toml", flat);
    for (name, more) in [
        (
            "touching",
            "columns = 2\n[search]\narray.move_mm = [-3, 10]\n",
        ),
        (
            "wide",
            "columns = 4\n[search]\narray.pitch_mm = [40, 60]\n[limits]\nfootprint_max_mm = 184\n",
        ),
    ] {
        place.write("near.toml", &format!("{design}{more}"));
        let run = place.run(&[
            "optimize",
            "near.toml",
            "--for",
            "f.toml",
            "--evaluations",
            "60",
            "--format",
            "json",
        ]);
        let result = run.ends(0).json();
        assert!(number(&result, "gain") > 1.15, "{name}: {}", result["gain"]);
        for limit in result["limits"].as_object().unwrap().values() {
            assert_eq!(limit["met"], true, "{name}: {limit}");
        }
    }
}

#[test]
fn what_cannot_be_searched_is_said_before_anything_is_computed() {
    let place = Place::new();
    for (vary, said) in [
        ("array.pitch_mm=60:40", "holds no values"),
        ("coil.inner_diameter_mm=37.5:37.9", "no winding fits"),
        ("core.below_mm=0:20", "no core"),
        ("array.pich_mm=40:60", "did you mean pitch_mm"),
        ("array.pitch_mm=20:30", "meets the array's pitch <= 30 mm;"),
    ] {
        let run = place
            .run(&["optimize", SEED, "--for", FLAT, "--vary", vary])
            .ends(3);
        assert!(run.err.contains(said), "{vary}: {}", run.err);
    }
    let text = place.text(SEED) + "[search]\nmagnet.size_mm = [[10.0, 10.0], [10.0, 10.0]]\n";
    place.write("magnets.toml", &text);
    let run = place
        .run(&["optimize", "magnets.toml", "--for", FLAT])
        .ends(3);
    assert!(run.err.contains("there twice"), "{}", run.err);
    let twice = ["--vary", "array.columns=2,3", "--vary", "array.columns=3,4"];
    let run = place
        .run(&[&["optimize", SEED, "--for", FLAT][..], &twice].concat())
        .ends(2);
    assert!(run.err.contains("given twice"), "{}", run.err);
    // Limits that contradict each other: named, with the nearest design.
    let text = place
        .text(SEED)
        .replace("resistance_max_ohm = 6.0", "resistance_max_ohm = 5e-4");
    place.write("tight.toml", &text);
    let run = place
        .run(&[
            "optimize",
            "tight.toml",
            "--for",
            FLAT,
            "--vary",
            "coil.length_mm=60:90",
        ])
        .ends(3);
    assert!(
        run.err.contains("meets resistance <= 0.0005 ohm;")
            && run.err.contains("nearest, layers ="),
        "{}",
        run.err
    );
    // Out of the workspace's reach, above it.
    let high = place
        .text(FLAT)
        .replace("surface = \"", "surface = \"shapes/");
    let high = high.replace("0.0, 0.0, 50.0", "0.0, 0.0, 400.0");
    place.write("high.toml", &high);
    let run = place
        .run(&[
            "optimize",
            SEED,
            "--for",
            "high.toml",
            "--vary",
            "array.pitch_mm=40:60",
        ])
        .ends(4);
    assert!(
        run.err.contains("wholly outside the design's workspace"),
        "{}",
        run.err
    );
}

/// A sweep whose points are searches: the same bytes in shards, and a column for every variable.
#[test]
fn a_sweep_searches_an_array_for_every_limit() {
    let place = Place::new();
    let text = place.text(SEED);
    let search = "[search]\ncoil.inner_diameter_mm = [6.0, 30.0]\narray.pitch_mm = [38.0, 60.0]\n";
    place.write("air.toml", &format!("{text}\n{search}"));
    let shape = place
        .text(FLAT)
        .replace("surface = \"", "surface = \"shapes/");
    place.write("plane.toml", &shape);
    let plan = [
        "sweep",
        "plan",
        "air.toml",
        "--for",
        "plane.toml",
        "--evaluations",
        "24",
    ];
    let set = [
        "--set",
        "limits.resistance_max_ohm=5,7",
        "--out",
        "plan.json",
    ];
    place.run(&[&plan[..], &set[..]].concat()).ends(0);
    place
        .run(&["sweep", "run", "plan.json", "--out", "whole"])
        .ends(0);
    for shard in ["2/2", "1/2"] {
        let run = [
            "sweep",
            "run",
            "plan.json",
            "--out",
            "parts",
            "--shard",
            shard,
        ];
        place.run(&[&run[..], &["--threads", "1"]].concat()).ends(0);
    }
    let merged = |folder: &str| {
        let table = format!("{folder}.d/sweep.csv");
        let merge = ["sweep", "merge", "plan.json", folder, "--out", &table];
        let run = place.run(&merge).ends(0);
        assert!(run.out.contains("times its own given array"), "{}", run.out);
        String::from_utf8(place.read(&table)).expect("text")
    };
    let table = merged("whole");
    assert_eq!(table, merged("parts"));
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().expect("a head");
    let column = |name: &str| head.iter().position(|one| *one == name).expect(name);
    let rows: Vec<_> = lines.collect();
    let value = |row: usize, name: &str| rows[row][column(name)].parse::<f64>().expect(name);
    assert!(value(0, "gain") < value(1, "gain"));
    for row in 0..2 {
        let limit = value(row, "limits.resistance_max_ohm");
        assert!(value(row, "resistance_ohm") <= limit && value(row, "coils") == 9.0);
        assert!((38.0..=60.0).contains(&value(row, "best:array.pitch_mm")));
        assert_eq!(value(row, "best:layers"), value(row, "best:layers").round());
    }
    place.write("plane.toml", &format!("{shape}\n# edited\n"));
    let run = ["sweep", "run", "plan.json", "--out", "again"];
    let refused = place.run(&run).ends(3);
    assert!(
        refused.err.contains("has changed since the plan"),
        "{}",
        refused.err
    );
}

/// A sweep ranked arrays by their gains, each over the given array of its own point: a swept current that made the given
/// array weak made its best one the best of all.
#[test]
fn regression_a_sweep_ranked_arrays_by_gains_over_different_arrays() {
    let place = Place::new();
    let text = place.text(SEED);
    let search = "[search]\narray.pitch_mm = [38.0, 60.0]\n";
    place.write("air.toml", &format!("{text}\n{search}"));
    let plan = ["sweep", "plan", "air.toml", "--for", FLAT];
    let set = [
        "--set",
        "supply.current_max_a=0.7,1.3,2",
        "--out",
        "plan.json",
    ];
    place.run(&[&plan[..], &set].concat()).ends(0);
    let plan = PlanFile::parse("plan.json", &place.read("plan.json")).expect("a plan");
    // The smallest constant would choose the last, the gain the first, the geometric mean the second.
    let found = [(1.7, [0.3, 0.5]), (0.9, [0.6, 1.9]), (1.3, [0.7, 0.8])];
    for (index, (gain, lambda_n_per_m)) in (0..).zip(found) {
        let row = Row {
            resistance_ohm: 3.0 - 0.7 * index as f64,
            mass_kg: 0.3,
            settling_s: 0.01,
            force_n: 0.1,
            limits_met: true,
            array: Some(ArrayRow {
                gain,
                lambda_n_per_m: lambda_n_per_m.to_vec(),
                coils: 9,
                evaluations: 7,
                values: BTreeMap::new(),
            }),
            ..Row::default()
        };
        let point = PointFile::new(&plan.plan_sha256, index, Ok((row, Status::Done)));
        let bytes = point.to_bytes().expect("a point");
        let path = format!("points/points/000/{index:06}.json");
        place.write(&path, std::str::from_utf8(&bytes).expect("text"));
    }
    let merge = [
        "sweep",
        "merge",
        "plan.json",
        "points",
        "--report",
        "page.html",
    ];
    let merged = place
        .run(&[&merge[..], &["--plot", "plot.svg"]].concat())
        .ends(0);
    for text in [
        "design 1: supply.current_max_a = 1.3",
        "1.0677 N/m, 0.9 times its own",
    ] {
        assert!(merged.out.contains(text), "{text}: {}", merged.out);
    }
    // The heaviest in nothing, the second is on every front; the first is on none.
    let fronts = place.text("sweep_pareto.csv");
    let designs: Vec<&str> = fronts.lines().skip(1).map(|row| &row[..1]).collect();
    assert_eq!(designs, ["1", "2"], "{fronts}");
    let page = place.text("page.html");
    for text in [
        "best in mean force constant and",
        "<td class=\"n\">1.068 N/m</td>",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(place.text("plot.svg").contains("mean force constant"));
}

/// Six coils in air under a wedge, which tie in pairs by symmetry.
fn six_coils(place: &Place) {
    place.write(
        "six.toml",
        "name = 'six'\n[coil]\ninner_diameter_mm = 10.0\nouter_diameter_mm = 25.6\nlength_mm = 30.0\n\
         [wire]\ndiameter_mm = 0.6\n[array]\nrows = 2\ncolumns = 3\npitch_mm = 30.0\n[magnet]\n[supply]\n\
         current_max_a = [1.0, 2.0, 1.5, 2.0, 2.0, 2.0]\ntotal_current_max_a = 6.0\nvoltage_v = 24.0\n[limits]\n\
         outer_diameter_max_mm = 29.0\nresistance_max_ohm = 4.0\n[search]\n\
         coil.outer_diameter_mm = [16.0, 29.0]\ncoil.length_mm = [15.0, 45.0]\narray.pitch_mm = [27.0, 45.0]\n",
    );
    place.write(
        "wedge.toml",
        "name = 'wedge'\nprimitive = 'wedge'\nside_mm = 60\nlow_mm = 25\nhigh_mm = 40\n[points]\n\
         x_mm = [-30.0, 30.0, 31]\ny_mm = [-30.0, 30.0, 31]\n",
    );
}

/// Coarse forces have coils that tie by symmetry a little apart, and the last breakpoint at 1e5 times its place.
#[test]
fn regression_a_search_of_lambda_saturation_followed_rounding() {
    let place = Place::new();
    six_coils(&place);
    let mut arguments = vec!["optimize", "six.toml", "--for", "wedge.toml"];
    arguments.extend(["--constant", "saturation", "--evaluations", "30"]);
    arguments.extend(["--starts", "1", "--format", "json"]);
    let result = place.run(&arguments).ends(0).json();
    assert!(number(&result, "gain") > 1.0, "{}", result["gain"]);
    let search = &result["levels"][0];
    assert_eq!(search["level"], "search");
    assert!(number(search, "lambda_error") < 1e-3, "{search}");
    let warnings = result["warnings"].to_string();
    assert!(
        warnings.contains("lambda_saturation of wedge is "),
        "{warnings}"
    );
}

/// Coils that only push give no upright force without a sideways part: raising limits does not help, reversing does.
#[test]
fn regression_a_force_vector_out_of_reach_was_called_no_force() {
    let place = Place::new();
    six_coils(&place);
    let mut arguments = vec!["optimize", "six.toml", "--for", "wedge.toml"];
    arguments.extend(["--constant", "vector", "--evaluations", "4"]);
    let run = place.run(&arguments).ends(3);
    for said in [
        "cannot render the force vector of wedge",
        "at point 0",
        "current_min_a",
    ] {
        assert!(run.err.contains(said), "{said}: {}", run.err);
    }
}
