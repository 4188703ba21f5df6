//! `probe --compare`: scans made by the program itself, with what was changed in them found again.

use serde_json::Value;

use crate::SEED;
use fluxform_testing::Random;
use fluxform_testing::place::Place;

/// How a scan differs from what the design gives.
#[derive(Clone)]
struct Made {
    design: &'static str,
    columns: Vec<&'static str>,
    coils: Vec<(usize, f64)>,
    shift_m: [f64; 3],
    /// The sensor's frame about x, then y, then z through the points' middle, degrees.
    turn_deg: [f64; 3],
    background_t: [f64; 3],
    noise_t: f64,
    gradient_noise_t_per_m: f64,
    seed: u64,
    /// Of the program that makes the scan.
    options: &'static [&'static str],
}

/// Turns about x, then y, then z; the other way round and back for a negative `sense`.
fn turned(v: [f64; 3], angles_deg: [f64; 3], sense: f64) -> [f64; 3] {
    let mut v = v;
    let order = if sense > 0.0 { [0, 1, 2] } else { [2, 1, 0] };
    for axis in order {
        let (sin, cos) = (sense * angles_deg[axis].to_radians()).sin_cos();
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        (v[i], v[j]) = (cos * v[i] - sin * v[j], sin * v[i] + cos * v[j]);
    }
    v
}

impl Made {
    fn new(columns: &[&'static str], coils: &[(usize, f64)]) -> Self {
        Self {
            design: SEED,
            columns: columns.to_vec(),
            coils: coils.to_vec(),
            shift_m: [0.0; 3],
            turn_deg: [0.0; 3],
            background_t: [0.0; 3],
            noise_t: 0.0,
            gradient_noise_t_per_m: 0.0,
            seed: 7,
            options: &[],
        }
    }

    /// A row a point and coil, at 1.3 A.
    fn write(&self, place: &Place, name: &str, points_m: &[[f64; 3]]) {
        let mut table = "x_m,y_m,z_m\n".to_owned();
        let count = points_m.len() as f64;
        let middle: [f64; 3] =
            std::array::from_fn(|i| points_m.iter().map(|p| p[i]).sum::<f64>() / count);
        for p in points_m {
            let from = std::array::from_fn(|i| p[i] - middle[i]);
            let from = turned(from, self.turn_deg, 1.0);
            let [x, y, z]: [f64; 3] =
                std::array::from_fn(|i| middle[i] + from[i] + self.shift_m[i]);
            table.push_str(&format!("{x},{y},{z}\n"));
        }
        let args = [&["probe", self.design, "-", "-q"], self.options].concat();
        let report_text = place.run_with_input(&args, &table);
        let report_text = report_text.ends(0).out;
        let mut lines = report_text
            .lines()
            .map(|line| line.split(',').collect::<Vec<_>>());
        let header = lines.next().unwrap();
        let rows: Vec<Vec<&str>> = lines.collect();
        let mut noise = Random::new(self.seed);
        let mut scan = format!("x_m,y_m,z_m,coil,current_a,{}\n", self.columns.join(","));
        for (k, [x, y, z]) in points_m.iter().enumerate() {
            for (coil, gain) in &self.coils {
                let row = &rows[k * 9 + coil];
                scan.push_str(&format!("{x},{y},{z},{coil},1.3"));
                let per_a = |column: &str| -> f64 {
                    let name = format!("{column}_per_a");
                    let at = header.iter().position(|cell| *cell == name).unwrap();
                    row[at].parse().unwrap()
                };
                let seen = turned(FIELD.map(per_a), self.turn_deg, -1.0);
                for column in &self.columns {
                    let axis = FIELD.iter().position(|c| c == column);
                    assert!(axis.is_some() || self.turn_deg == [0.0; 3]);
                    let value = axis.map_or_else(|| per_a(column), |axis| seen[axis]);
                    let background = axis.map_or(0.0, |axis| self.background_t[axis]);
                    let size = axis.map_or(self.gradient_noise_t_per_m, |_| self.noise_t);
                    let value = 1.3 * gain * value + background + size * noise.normal();
                    scan.push_str(&format!(",{value}"));
                }
                scan.push('\n');
            }
        }
        place.write(name, &scan);
    }
}

pub const FIELD: [&str; 3] = ["bx_t", "by_t", "bz_t"];

pub fn grid() -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    for z in [0.011, 0.019, 0.034] {
        for y in [-0.017, 0.004, 0.023] {
            for x in [-0.021, -0.003, 0.013, 0.031] {
                points.push([x, y, z]);
            }
        }
    }
    points
}

fn compare(place: &Place, scan: &str, more: &[&str]) -> Value {
    compare_with(place, SEED, scan, more)
}

pub fn compare_with(place: &Place, design: &str, scan: &str, more: &[&str]) -> Value {
    let args = ["probe", design, "--compare", scan, "--format", "json"];
    let ran = place.run(&[&args[..], more].concat()).ends(0);
    assert!(ran.err.is_empty(), "{}", ran.err);
    ran.json()
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap_or_else(|| panic!("{value}"));
    list.iter()
        .map(|v| v.as_f64().unwrap_or(f64::NAN))
        .collect()
}

#[test]
fn what_was_changed_is_found_within_the_stated_errors() {
    let place = Place::new();
    let gains = [(1, 0.97), (4, 1.034), (5, 1.0)];
    let mut made = Made::new(&FIELD, &gains);
    made.shift_m = [0.0007, -0.0004, 0.0011];
    made.background_t = [13e-6, -7e-6, -41e-6];
    // Without noise: exactly, to the fit's own end.
    made.write(&place, "exact.csv", &grid());
    let exact = compare(&place, "exact.csv", &[]);
    for (found, (_, gain)) in exact["fit"]["scales"].as_array().unwrap().iter().zip(gains) {
        assert!(
            (found["scale"].as_f64().unwrap() - gain).abs() < 1e-7,
            "{found}"
        );
    }
    for (found, shift) in numbers(&exact["fit"]["position_m"])
        .iter()
        .zip(made.shift_m)
    {
        assert!((found - shift).abs() < 1e-9, "{found} {shift}");
    }
    assert!(
        exact["residuals"]["fitted"]["field"]["rms_t"]
            .as_f64()
            .unwrap()
            < 1e-11
    );

    made.noise_t = 3e-6;
    // How far off in stated errors, over several scans.
    let mut squares = Vec::new();
    for seed in [7, 13, 29] {
        made.seed = seed;
        made.write(&place, "scan.csv", &grid());
        let report_text = compare(&place, "scan.csv", &["--noise-t", "3e-6"]);
        let fit = &report_text["fit"];
        let mut hold = |found: f64, error: f64, truth: f64| {
            let off = (found - truth) / error;
            assert!(off.abs() < 4.5, "{found} +- {error} against {truth}");
            squares.push(off * off);
        };
        for (scale, (coil, gain)) in fit["scales"].as_array().unwrap().iter().zip(gains) {
            assert_eq!(scale["coil"], coil);
            let error = scale["standard_error"].as_f64().unwrap();
            assert!(error < 0.002, "{error}");
            hold(scale["scale"].as_f64().unwrap(), error, gain);
        }
        let of = |key: &str| numbers(&fit[key]);
        for i in 0..3 {
            let (shift, error) = (of("position_m")[i], of("position_error_m")[i]);
            assert!(error < 1e-4);
            hold(shift, error, made.shift_m[i]);
            let (level, error) = (of("background_t")[i], of("background_error_t")[i]);
            hold(level, error, made.background_t[i]);
        }
        let chi_square = fit["reduced_chi_square"].as_f64().unwrap();
        assert!((0.7..1.4).contains(&chi_square), "{chi_square}");
        assert_eq!(fit["undetermined"].as_array().unwrap().len(), 0);
        let line = fit["gain_toml"].as_str().unwrap();
        assert!(line.starts_with("gain = [1.000000, 0.9"), "{line}");
    }
    // As large as stated, neither larger nor smaller: the mean square of 27 numbers is near 1.
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((0.4..2.0).contains(&mean), "{mean}");

    // The gains put into the design leave the rest to the frame.
    let report_text = compare(&place, "scan.csv", &[]);
    let line = report_text["fit"]["gain_toml"].as_str().unwrap();
    let design = place
        .text(SEED)
        .replace("[array]\n", &format!("[array]\n{line}\n"));
    place.write("gained.toml", &design);
    let args = [
        "probe",
        "gained.toml",
        "--compare",
        "scan.csv",
        "--format",
        "json",
    ];
    let again = place.run(&args).ends(0).json();
    for scale in again["fit"]["scales"].as_array().unwrap() {
        assert!(
            (scale["scale"].as_f64().unwrap() - 1.0).abs() < 1e-5,
            "{scale}"
        );
    }
}

#[test]
fn a_turned_sensor_is_found_over_coils_with_steel() {
    let place = Place::new();
    let mut made = Made::new(&FIELD, &[(4, 1.02), (1, 0.96)]);
    made.design = "designs/seed.toml";
    made.shift_m = [0.0004, -0.0002, 0.0003];
    made.turn_deg = [1.7, -0.8, 2.9];
    made.background_t = [9e-6, -21e-6, 33e-6];
    // The same steel on both sides, however coarse.
    made.options = &["--tolerance", "1e-2"];
    made.write(&place, "scan.csv", &grid());
    let fit = ["--fit", "scale,background,position,rotation"];
    let options = [&fit[..], made.options].concat();
    let report_text = compare_with(&place, made.design, "scan.csv", &options);
    let fit = &report_text["fit"];
    // The fit solves the steel as `probe` does.
    for (found, turn) in numbers(&fit["rotation_deg"]).iter().zip(made.turn_deg) {
        assert!((found - turn).abs() < 1e-5, "{fit:#}");
    }
    for (found, shift) in numbers(&fit["position_m"]).iter().zip(made.shift_m) {
        assert!((found - shift).abs() < 1e-8, "{fit:#}");
    }
    for (found, level) in numbers(&fit["background_t"]).iter().zip(made.background_t) {
        assert!((found - level).abs() < 1e-10, "{fit:#}");
    }
    for (found, gain) in fit["scales"].as_array().unwrap().iter().zip([0.96, 1.02]) {
        assert!(
            (found["scale"].as_f64().unwrap() - gain).abs() < 1e-6,
            "{fit:#}"
        );
    }
}

#[test]
fn gradients_count_and_an_upright_sensor_is_not_turned() {
    let place = Place::new();
    let columns = ["bz_t", "dbz_dz_t_per_m", "dbx_dz_t_per_m"];
    let mut made = Made::new(&columns, &[(4, 1.0), (3, 0.95)]);
    made.shift_m = [-0.0003, 0.0008, -0.0006];
    made.write(&place, "scan.csv", &grid());
    let what = "scale,background,position,rotation";
    let report_text = compare(&place, "scan.csv", &["--fit", what]);
    for angle in numbers(&report_text["fit"]["rotation_deg"]) {
        assert!(angle.abs() < 1e-4, "{angle}");
    }
    let shifts = numbers(&report_text["fit"]["position_m"]);
    for (found, shift) in shifts.iter().zip(made.shift_m) {
        assert!((found - shift).abs() < 1e-8, "{found} {shift}");
    }
    assert!(report_text["residuals"]["fitted"]["gradient"]["rms_t_per_m"].is_number());
    // Only the background that was measured.
    assert!(report_text["fit"]["background_t"][0].is_null());
    assert!(report_text["fit"]["background_t"][2].is_number());
}

/// One chi-square for both kinds once made errors of the background three times too small where the field
/// was noisy, and those of the position where the gradient was.
#[test]
fn field_and_gradient_have_a_noise_of_their_own() {
    let place = Place::new();
    let columns = ["bz_t", "dbz_dz_t_per_m", "dbx_dz_t_per_m", "dby_dz_t_per_m"];
    let mut made = Made::new(&columns, &[(4, 1.0), (3, 0.95)]);
    made.shift_m = [-0.0003, 0.0008, -0.0006];
    made.background_t[2] = 4.1e-5;
    let all = ["--noise-t", "3e-5", "--noise-t-per-m", "1e-5"];
    // A noisy field beside good gradients, and the other way round.
    for (noises, all) in [
        ([3e-5, 1e-5], all),
        ([1e-7, 1e-3], [all[0], "1e-7", all[2], "1e-3"]),
    ] {
        [made.noise_t, made.gradient_noise_t_per_m] = noises;
        let options = [&[], &all[..2], &all[2..], &all[..]];
        let mut squares = [[0.0; 2]; 4];
        for seed in 0..12 {
            made.seed = seed;
            made.write(&place, "scan.csv", &grid());
            for (options, [level, shift]) in options.into_iter().zip(&mut squares) {
                let compared = compare(&place, "scan.csv", options);
                let fit = &compared["fit"];
                let off = |key: &str, axis: usize, truth: f64| {
                    let error = &fit[key.replace('_', "_error_")][axis];
                    let off = fit[key][axis].as_f64().unwrap() - truth;
                    (off / error.as_f64().unwrap()).powi(2)
                };
                *level += off("background_t", 2, made.background_t[2]) / 12.0;
                for (axis, truth) in made.shift_m.into_iter().enumerate() {
                    *shift += off("position_m", axis, truth) / 36.0;
                }
                for (k, (of, unit)) in [("field", "t"), ("gradient", "t_per_m")].iter().enumerate()
                {
                    let left = &compared["residuals"]["fitted"][of];
                    let stated = left[format!("noise_{unit}")].as_f64();
                    let estimated = left[format!("estimated_noise_{unit}")].as_f64();
                    assert_eq!(stated.is_some(), options.contains(&all[2 * k]), "{left}");
                    assert_ne!(stated.is_some(), estimated.is_some(), "{left}");
                    let ratio = stated.or(estimated).unwrap() / noises[k];
                    assert!((0.7..1.4).contains(&ratio), "{options:?}: {left}");
                }
            }
        }
        for (options, squares) in options.into_iter().zip(squares) {
            let rms = squares.map(f64::sqrt);
            let near_one = rms.iter().all(|rms| (0.6..1.5).contains(rms));
            assert!(near_one, "{noises:?} {options:?}: {rms:?}");
        }
    }
    let human = place.run(&["probe", SEED, "--compare", "scan.csv", all[0], "1e-7"]);
    let human = human.ends(0).out;
    for text in [
        "stated noise 100 nT",
        "estimated noise",
        "field: the stated",
    ] {
        assert!(human.contains(text), "{text}: {human}");
    }
}

/// Three field values do not say how noisy they are.
#[test]
fn a_kind_with_too_few_values_shares_the_other_ones_noise() {
    let place = Place::new();
    let columns = ["bz_t", "dbz_dz_t_per_m", "dbx_dz_t_per_m"];
    let mut made = Made::new(&columns, &[(4, 1.0)]);
    made.gradient_noise_t_per_m = 1e-4;
    made.write(&place, "scan.csv", &grid()[..3]);
    for (option, given) in [(&[][..], false), (&["--noise-t-per-m", "1e-4"], true)] {
        let compared = compare(&place, "scan.csv", option);
        let warning = compared["warnings"][0].as_str().unwrap();
        assert!(warning.contains("too few field values"), "{warning}");
        let fit = &compared["fit"];
        assert_eq!(fit["reduced_chi_square"].is_number(), given);
        assert!(
            fit["background_error_t"][2].as_f64().unwrap() > 0.0,
            "{fit:#}"
        );
    }
}

#[test]
fn noise_alone_is_explained_by_nothing() {
    let place = Place::new();
    let mut made = Made::new(&FIELD, &[(4, 1.0), (0, 1.0)]);
    made.noise_t = 2e-6;
    made.write(&place, "scan.csv", &grid());
    let report_text = compare(&place, "scan.csv", &["--noise-t", "2e-6"]);
    assert!(report_text["best_explanation"].is_null(), "{report_text:#}");
    for scale in report_text["fit"]["scales"].as_array().unwrap() {
        let off = scale["scale"].as_f64().unwrap() - 1.0;
        assert!(off.abs() < 4.0 * scale["standard_error"].as_f64().unwrap());
    }
    let left = &report_text["residuals"]["as_designed"]["field"];
    let rms = left["rms_t"].as_f64().unwrap();
    assert!((1.6e-6..2.4e-6).contains(&rms), "{rms}");
    assert!(left["model_error_t"].as_f64().unwrap() < 1e-12);
    let human = place.run(&["probe", SEED, "--compare", "scan.csv"]).ends(0);
    assert!(human.out.contains("no single parameter"), "{}", human.out);
}

#[test]
fn the_parameter_at_fault_is_named() {
    let place = Place::new();
    let best = |report_text: &Value| {
        report_text["best_explanation"]
            .as_str()
            .unwrap_or("none")
            .to_owned()
    };
    let share = |report_text: &Value, name: &str| {
        let list = report_text["explanations"].as_array().unwrap();
        let found = list.iter().find(|e| e["parameter"] == name).unwrap();
        (found["share"].as_f64().unwrap(), found.clone())
    };
    let coils = [(4, 1.0), (5, 1.0)];
    let mut high = Made::new(&FIELD, &coils);
    high.shift_m[2] = 0.0009;
    high.noise_t = 1e-6;
    high.write(&place, "high.csv", &grid());
    let report_text = compare(&place, "high.csv", &[]);
    assert_eq!(best(&report_text), "height");
    let (part, found) = share(&report_text, "height");
    assert!(part > 0.99);
    let change = found["change"].as_f64().unwrap();
    assert!((change - 0.0009).abs() < 5e-5, "{change}");

    // More turns are a larger scale: both are reported.
    let mut strong = Made::new(&FIELD, &coils.map(|(coil, _)| (coil, 1.021)));
    strong.noise_t = 1e-6;
    strong.write(&place, "strong.csv", &grid());
    let report_text = compare(&place, "strong.csv", &[]);
    assert_eq!(best(&report_text), "scale");
    let (_, found) = share(&report_text, "scale");
    assert_eq!(found["alike"][0], "coil.turns");
    let (_, turns) = share(&report_text, "coil.turns");
    let (change, error) = (&turns["change"], &turns["standard_error"]);
    let off = change.as_f64().unwrap() - 0.021 * 1429.0;
    assert!(off.abs() < 4.0 * error.as_f64().unwrap(), "{turns}");

    // A longer coil, measured with the design of the shorter one.
    let made = Made::new(&FIELD, &coils);
    made.write(&place, "long.csv", &grid());
    let short = place
        .text(SEED)
        .replace("length_mm = 100.0", "length_mm = 99.0");
    place.write(
        "short.toml",
        &short.replace("turns = 1429", "turns = 1414.71"),
    );
    let args = [
        "probe",
        "short.toml",
        "--compare",
        "long.csv",
        "--format",
        "json",
    ];
    let report_text = place.run(&args).ends(0).json();
    let (part, found) = share(&report_text, "coil.length_mm");
    assert!(found["change"].is_number() && part > 0.0, "{report_text:#}");
}

#[test]
fn indistinguishable_parameters_of_a_scan_are_reported() {
    let place = Place::new();
    // On one coil's axis, vertical component: x and y change nothing.
    let axis: Vec<[f64; 3]> = (0..14)
        .map(|k| [0.0, 0.0, 0.01 + 0.0037 * f64::from(k)])
        .collect();
    let mut made = Made::new(&["bz_t"], &[(4, 1.02)]);
    made.noise_t = 1e-7;
    made.write(&place, "axis.csv", &axis);
    let report_text = compare(&place, "axis.csv", &[]);
    let named: Vec<String> = report_text["fit"]["undetermined"]
        .as_array()
        .unwrap()
        .iter()
        .map(ToString::to_string)
        .collect();
    assert!(named.contains(&"[\"position x\"]".to_owned()), "{named:?}");
    assert!(named.contains(&"[\"position y\"]".to_owned()), "{named:?}");
    assert!(
        report_text["fit"]["position_m"][0].is_null()
            && report_text["fit"]["position_m"][2].is_number()
    );
    let scale = &report_text["fit"]["scales"][0];
    let off = scale["scale"].as_f64().unwrap() - 1.02;
    assert!(
        off.abs() < 4.0 * scale["standard_error"].as_f64().unwrap(),
        "{scale}"
    );
    let human = place.run(&["probe", SEED, "--compare", "axis.csv"]).ends(0);
    assert!(
        human.out.contains("changes nothing at these points"),
        "{}",
        human.out
    );

    // One place again and again: scale, background and height are one number.
    made.write(&place, "one.csv", &[[0.003, 0.004, 0.02]; 12]);
    let report_text = compare(&place, "one.csv", &["--fit", "scale,background"]);
    assert_eq!(
        report_text["fit"]["undetermined"][0]
            .as_array()
            .unwrap()
            .len(),
        2
    );
    assert!(
        report_text["fit"]["scales"][0]["scale"].is_null()
            && report_text["fit"]["gain_toml"].is_null()
    );
}

#[test]
fn scans_that_cannot_be_fitted_are_refused_with_what_to_do() {
    let place = Place::new();
    let made = Made::new(&["bz_t"], &[(4, 1.0)]);
    made.write(&place, "scan.csv", &grid());
    let text = String::from_utf8(place.read("scan.csv")).unwrap();
    let refused = |name: &str, text: &str, words: &[&str]| {
        place.write(name, text);
        let args = ["probe", SEED, "--compare", name];
        let ran = place.run(&args).ends(3).says(words);
        assert!(
            ran.err.contains("\nerror[E307]:") && ran.err.contains(name),
            "{}",
            ran.err
        );
        assert!(ran.out.is_empty());
    };
    let rows: Vec<&str> = text.lines().collect();
    refused(
        "few.csv",
        &rows[..6].join("\n"),
        &["5 measured values", "5 numbers", "at least 8", "--fit"],
    );
    refused(
        "off.csv",
        &text.replace(",4,1.3,", ",4,0,"),
        &["current is 0 in every row"],
    );
    let cells = |line: &str, factors: [f64; 6]| -> String {
        let values = line.split(',').zip(factors);
        let scaled = values.map(|(cell, f)| (cell.parse::<f64>().unwrap() * f).to_string());
        scaled.collect::<Vec<_>>().join(",")
    };
    let scaled = |factors: [f64; 6]| {
        let body: Vec<String> = rows[1..].iter().map(|row| cells(row, factors)).collect();
        format!("{}\n{}\n", rows[0], body.join("\n"))
    };
    let mm = scaled([1e3, 1e3, 1e3, 1.0, 1.0, 1.0]);
    refused(
        "mm.csv",
        &mm,
        &["not in metres", "divide millimetres by 1000"],
    );
    for (name, factor, unit) in [
        ("mt.csv", 1e3, "millitesla"),
        ("gauss.csv", 1e4, "gauss"),
        ("ut.csv", 1e6, "microtesla"),
    ] {
        let text = scaled([1.0, 1.0, 1.0, 1.0, 1.0, factor]);
        refused(name, &text, &[unit, "divide it by"]);
    }
    let ma = scaled([1.0, 1.0, 1.0, 1.0, 1e3, 1.0]);
    refused("ma.csv", &ma, &["milliampere", "divide it by 1000"]);

    // Swapped leads are a warning, and another coil's number is a fault of the table.
    place.write("swapped.csv", &scaled([1.0, 1.0, 1.0, 1.0, -1.0, 1.0]));
    let swapped = place
        .run(&["probe", SEED, "--compare", "swapped.csv"])
        .ends(0);
    swapped.says(&["warning: coil 4", "leads may be swapped"]);
    place.write("ninth.csv", &text.replace(",4,1.3,", ",9,1.3,"));
    place
        .run(&["probe", SEED, "--compare", "ninth.csv"])
        .ends(3)
        .says(&["E302", "ninth.csv:2", "column coil", "from 0 to 8"]);
}

#[test]
fn currents_may_flow_in_all_coils_and_residuals_are_written() {
    let place = Place::new();
    let made = Made::new(&["bz_t"], &[(0, 1.0), (4, 1.0)]);
    made.write(&place, "scan.csv", &grid());
    let text = String::from_utf8(place.read("scan.csv")).unwrap();
    // Both coils at once: the two rows of a point added.
    let rows: Vec<Vec<&str>> = text
        .lines()
        .skip(1)
        .map(|l| l.split(',').collect())
        .collect();
    let mut both = "x_m,y_m,z_m,current_0_a,current_4_a,bz_t\n".to_owned();
    for pair in rows.chunks(2) {
        let bz: f64 = pair.iter().map(|row| row[5].parse::<f64>().unwrap()).sum();
        both.push_str(&format!(
            "{},{},{},1.3,1.3,{bz}\n",
            pair[0][0], pair[0][1], pair[0][2]
        ));
    }
    place.write("both.csv", &both);
    let args = ["--out", "left.csv"];
    let report_text = compare(&place, "both.csv", &args);
    assert_eq!(report_text["rows"], 36);
    let left = String::from_utf8(place.read("left.csv")).unwrap();
    assert!(left.starts_with("x_m,y_m,z_m,bz_t,bz_design_t,bz_residual_t,bz_fitted_residual_t\n"));
    for row in left.lines().skip(1) {
        let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert!(
            cells[5].abs() < 1e-14 && (cells[3] - cells[4] - cells[5]).abs() < 1e-18,
            "{row}"
        );
    }
    // A table does not state its inputs. The same bytes with one thread.
    let again = compare(
        &place,
        "both.csv",
        &[&args[..], &["--force", "--threads", "1"]].concat(),
    );
    assert_eq!(report_text, again);
    let piped = place
        .run(&["probe", SEED, "--compare", "both.csv", "--out", "-"])
        .ends(0);
    assert_eq!(piped.out, left);
    assert!(piped.err.contains("against seed_air"), "{}", piped.err);
    place.write("mine.csv", "precious");
    place
        .run(&["probe", SEED, "--compare", "both.csv", "--out", "mine.csv"])
        .ends(4)
        .says(&["E405", "--force"]);
    // Points and a scan exclude each other, and one of them is needed.
    place
        .run(&["probe", SEED, "both.csv", "--compare", "both.csv"])
        .ends(2);
    place.run(&["probe", SEED]).ends(2).says(&["POINTS"]);
}

#[test]
fn the_object_is_as_its_schema_says() {
    let place = Place::new();
    let mut made = Made::new(&["bz_t"], &[(4, 1.0)]);
    made.noise_t = 1e-6;
    made.write(&place, "scan.csv", &grid());
    let report_text = compare(&place, "scan.csv", &["--noise-t", "1e-6"]);
    let (_, schema) = fluxform::bundle::schema::SCHEMAS
        .iter()
        .find(|(name, _)| *name == "scan.schema.json")
        .unwrap();
    let schema: Value = serde_json::from_str(schema).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let faults: Vec<String> = validator
        .iter_errors(&report_text)
        .map(|e| e.to_string())
        .collect();
    assert!(faults.is_empty(), "{faults:?}");
}
