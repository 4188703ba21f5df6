//! `probe --compare` of one coil: what is fitted and what explains a scan, held against the truth.

use serde_json::Value;

use crate::SEED;
use crate::scan::{FIELD, compare_with, grid};
use fluxform_testing::Random;
use fluxform_testing::place::Place;

/// A scan of what `truth` says, at 1.3 A in its only coil, with noise.
fn scan_of(place: &Place, truth: &str, points_m: &[[f64; 3]], noise_t: f64, seed: u64) -> String {
    let mut table = "x_m,y_m,z_m\n".to_owned();
    for [x, y, z] in points_m {
        table.push_str(&format!("{x},{y},{z}\n"));
    }
    let report_text = place.run_with_input(&["probe", truth, "-", "-q"], &table);
    let report_text = report_text.ends(0).out;
    let mut lines = report_text
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let columns = FIELD.map(|column| {
        let name = format!("{column}_per_a");
        header.iter().position(|cell| *cell == name).unwrap()
    });
    let mut noise = Random::new(seed);
    let mut scan = format!("x_m,y_m,z_m,coil,current_a,{}\n", FIELD.join(","));
    for ([x, y, z], row) in points_m.iter().zip(lines) {
        scan.push_str(&format!("{x},{y},{z},0,1.3"));
        for column in columns {
            let value = 1.3 * row[column].parse::<f64>().unwrap() + noise_t * noise.normal();
            scan.push_str(&format!(",{value}"));
        }
        scan.push('\n');
    }
    scan
}

/// `design` with one coil.
fn alone(design: &str) -> String {
    design
        .replace("rows = 3", "rows = 1")
        .replace("columns = 3", "columns = 1")
}

/// The explanation by `key`, and whether it is the best or alike to it.
fn explained_by(report_text: &Value, key: &str) -> (Value, bool) {
    let list = report_text["explanations"].as_array().unwrap();
    let found = list.iter().find(|e| e["parameter"] == key).unwrap();
    let best = report_text["best_explanation"].as_str().unwrap_or("none");
    let alike = found["alike"].as_array();
    let named = best == key || alike.is_some_and(|all| all.iter().any(|other| other == best));
    (found.clone(), named)
}

/// Changes so large that one linear step from the design misses them by many of its stated errors: a
/// permeability of 300 for 1000 was once reported as a change of -2223 +- 0.7.
#[test]
fn large_changes_are_fitted_to_their_end() {
    let place = Place::new();
    let seed = alone(&String::from_utf8(place.read("designs/seed.toml")).unwrap());
    place.write("design.toml", &seed);
    for (key, from, to, change) in [
        (
            "core.relative_permeability",
            "relative_permeability = 1000.0",
            "relative_permeability = 300.0",
            -700.0,
        ),
        (
            "coil.length_mm",
            "length_mm = 100.0",
            "length_mm = 96.0",
            -4.0,
        ),
        ("core.above_mm", "above_mm = 0.0", "above_mm = 2.0", 2.0),
        ("core.below_mm", "below_mm = 10.0", "below_mm = 4.0", -6.0),
        (
            "core.clearance_mm",
            "clearance_mm = 0.0",
            "clearance_mm = 1.0",
            1.0,
        ),
    ] {
        let truth = seed.replacen(from, to, 1);
        assert_ne!(truth, seed, "{key}");
        place.write("truth.toml", &truth);
        place.write("scan.csv", &scan_of(&place, "truth.toml", &grid(), 2e-7, 7));
        let more = ["--noise-t", "2e-7"];
        let report_text = compare_with(&place, "design.toml", "scan.csv", &more);
        let (found, named) = explained_by(&report_text, key);
        assert!(named, "{key}: {report_text:#}");
        let error = found["standard_error"].as_f64().unwrap();
        let off = found["change"].as_f64().unwrap() - change;
        assert!(off.abs() <= 2.5 * error, "{key}: {found:#}");
        assert!(found["share"].as_f64().unwrap() > 0.99, "{key}: {found:#}");
    }
}

/// Of 95 % intervals at least 90 % hold the truth.
#[test]
fn stated_intervals_hold_random_truths() {
    let place = Place::new();
    let seed = alone(&place.text(SEED));
    place.write("design.toml", &seed);
    let mut numbers = Random::new(5);
    let (mut held, mut tried) = (0, 0);
    for run in 0..24 {
        let (key, value) = [
            ("coil.length_mm", 100.0),
            ("coil.outer_diameter_mm", 38.0),
            ("coil.inner_diameter_mm", 24.0),
        ][run % 3];
        let change = value * 0.03 * numbers.normal();
        let line = key.trim_start_matches("coil.");
        let from = format!("{line} = {value:.1}");
        let truth = seed.replacen(&from, &format!("{line} = {}", value + change), 1);
        assert_ne!(truth, seed, "{from}");
        place.write("truth.toml", &truth);
        let scan = scan_of(&place, "truth.toml", &grid(), 3e-6, run as u64 + 100);
        place.write("scan.csv", &scan);
        let report_text = compare_with(&place, "design.toml", "scan.csv", &[]);
        let (found, _) = explained_by(&report_text, key);
        let error = found["standard_error"].as_f64().unwrap();
        let off = found["change"].as_f64().unwrap() - change;
        held += usize::from(off.abs() <= 1.96 * error);
        tried += 1;
    }
    assert!(held * 10 >= tried * 9, "{held} of {tried}");
}

#[test]
fn a_scan_is_drawn_beside_its_fit() {
    let place = Place::new();
    let scan = [
        "probe",
        "designs/seed_air.toml",
        "--compare",
        "designs/scan_example.csv",
    ];
    let run = |more: &[&str]| place.run(&[&scan[..], more].concat());
    run(&["--noise-t", "2e-6", "--plot", "fit.svg"])
        .ends(0)
        .says(&["written: fit.svg"]);
    let svg = String::from_utf8(place.read("fit.svg")).unwrap();
    for text in [
        "designs/scan_example.csv against seed_air",
        "measured / mT",
        "field: measured minus fitted",
        "bz_t, fitted",
        "1 and 2 times the stated noise",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    run(&["--plot", "fit.pdf"]).ends(0);
    assert!(place.read("fit.pdf").starts_with(b"%PDF"));
    run(&["--plot", "-", "--out", "-"]).ends(2);
    run(&["--noise-t-per-m", "1e-3"])
        .ends(3)
        .says(&["no gradient values"]);
    let alone = [
        "probe",
        "designs/seed_air.toml",
        "points.csv",
        "--plot",
        "fit.svg",
    ];
    place.run(&alone).ends(2).says(&["[POINTS]"]);
}

/// Differences made the turn about its axis seem to change what one coil gives: of 32 scans 13 fits
/// did not settle, and none named what a single coil leaves open.
#[test]
fn regression_a_coil_s_symmetry_was_hidden_by_differences() {
    let place = Place::new();
    place.write("one.toml", &alone(&place.text(SEED)));
    let mut random = Random::new(3);
    let mut near = |reach_m: f64| reach_m * (2.0 * random.unit() - 1.0);
    let points: Vec<[f64; 3]> = (0..40)
        .map(|_| [near(0.03), near(0.03), 0.006 + near(0.004)])
        .collect();
    for seed in 0..4 {
        let scan = scan_of(&place, "one.toml", &points, 2e-6, seed);
        let mut lines = scan.lines();
        let mut moved = format!("{}\n", lines.next().unwrap());
        for (line, [x, y, z]) in lines.zip(&points) {
            let rest = line.splitn(4, ',').nth(3).unwrap();
            moved += &format!("{},{},{},{rest}\n", x - 0.0009, y + 0.0004, z + 0.0003);
        }
        place.write("one.csv", &moved);
        let args = [
            "probe",
            "one.toml",
            "--compare",
            "one.csv",
            "--fit",
            "position,rotation",
        ];
        let ran = place.run(&[&args[..], &["--format", "json"]].concat());
        let fit = ran.ends(0).json()["fit"].clone();
        let open = serde_json::json!([["position x", "position y", "rotation about z"]]);
        assert_eq!(fit["converged"], true, "{fit}");
        assert_eq!(fit["undetermined"], open, "{fit}");
        let off_m = fit["position_m"][2].as_f64().unwrap() + 0.0003;
        let error_m = fit["position_error_m"][2].as_f64().unwrap();
        assert!(off_m.abs() < 4.0 * error_m && error_m < 1e-5, "{fit}");
    }
}
