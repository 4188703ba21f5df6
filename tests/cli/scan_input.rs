//! `probe`: scans and points that are not what they look like, and the advice they get.

use serde_json::Value;

use crate::SEED;
use fluxform_testing::place::Place;

/// Coil and current of a scan of one coil.
const DRIVE: (usize, f64) = (4, 1.3);

/// Places over the middle coil, not in line with its axis.
fn places() -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    for z in [0.0113, 0.0191, 0.0347] {
        for y in [-0.0171, 0.0043, 0.0237] {
            for x in [-0.0219, -0.0031, 0.0133, 0.0311] {
                points.push([x, y, z]);
            }
        }
    }
    points
}

/// Position and field of the driven coil at places, by the program.
fn rows(place: &Place) -> Vec<[f64; 6]> {
    let points = places();
    let mut table = "x_m,y_m,z_m\n".to_owned();
    for [x, y, z] in &points {
        table.push_str(&format!("{x},{y},{z}\n"));
    }
    let ran = place.run_with_input(&["probe", SEED, "-", "-q"], &table);
    let printed = ran.ends(0).out;
    let of_coil = printed.lines().skip(1).skip(DRIVE.0).step_by(9);
    let rows: Vec<[f64; 6]> = points
        .into_iter()
        .zip(of_coil)
        .map(|([x, y, z], line)| {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            let [bx, by, bz] = std::array::from_fn(|axis| DRIVE.1 * cells[4 + axis]);
            [x, y, z, bx, by, bz]
        })
        .collect();
    assert_eq!(rows.len(), 36);
    rows
}

/// A scan of `rows` with the columns `drive,field` of these names.
fn scan(rows: &[[f64; 6]], drive: &str, field: &str) -> String {
    let cells = |[x, y, z, bx, by, bz]: &[f64; 6]| {
        let (coil, current_a) = DRIVE;
        format!("{x},{y},{z},{coil},{current_a},{bx},{by},{bz}\n")
    };
    let body: String = rows.iter().map(cells).collect();
    format!("x_m,y_m,z_m,{drive},{field}\n{body}")
}

const BY_ROW: &str = "coil,current_a";
const FIELD: &str = "bx_t,by_t,bz_t";

fn compared(place: &Place, more: &[&str]) -> Value {
    let args = ["probe", SEED, "--compare", "scan.csv", "--format", "json"];
    place.run(&[&args[..], more].concat()).ends(0).json()
}

fn warned(compared: &Value) -> String {
    compared["warnings"].to_string()
}

/// Above a fit that moved the scan to where there is no field nothing was left to change: it was called
/// converged, and the coil's opposite sign went unnamed.
#[test]
fn a_scan_that_fits_best_far_away_did_not_settle() {
    let place = Place::new();
    // The sensor's z axis points down: height and vertical field with the other sign.
    let mirrored = rows(&place).into_iter();
    let mirrored: Vec<[f64; 6]> = mirrored
        .map(|[x, y, z, bx, by, bz]| [x, y, -z, bx, by, -bz])
        .collect();
    place.write("scan.csv", &scan(&mirrored, BY_ROW, FIELD));
    for more in [&[][..], &["--fit", "position"]] {
        let report = compared(&place, more);
        let fit = &report["fit"];
        assert_eq!(fit["converged"], false, "{fit:#}");
        assert!(fit["gain_toml"].is_null(), "{fit:#}");
        for shift in fit["position_m"].as_array().unwrap() {
            assert!(shift.as_f64().unwrap().abs() < 0.3, "{fit:#}");
        }
        let warnings = warned(&report);
        for part in ["did not settle", "coil 4", "opposite sign", "point down"] {
            assert!(warnings.contains(part), "{part}: {warnings}");
        }
    }
    let scale = compared(&place, &["--fit", "scale"]);
    assert_eq!(scale["fit"]["converged"], true);
    assert!(warned(&scale).contains("opposite sign"), "{scale:#}");
}

/// A height of 129180 m +- 3.5e22 was said to explain three quarters of swapped leads.
#[test]
fn nothing_far_from_the_array_explains_a_scan() {
    let place = Place::new();
    let swapped: Vec<[f64; 6]> = rows(&place)
        .into_iter()
        .map(|[x, y, z, bx, by, bz]| [x, y, z, -bx, -by, -bz])
        .collect();
    place.write("scan.csv", &scan(&swapped, BY_ROW, FIELD));
    let report = compared(&place, &[]);
    assert_eq!(report["fit"]["converged"], true);
    assert_eq!(report["best_explanation"], "scale");
    let named = report["explanations"].as_array().unwrap().iter();
    let named: Vec<&str> = named.filter_map(|e| e["parameter"].as_str()).collect();
    assert!(named.contains(&"rotation"), "{named:?}");
    for far in ["height", "position"] {
        assert!(!named.contains(&far), "{named:?}");
    }
}

/// The bound is one of where the scan ends up, not of how wrong its coordinates may be.
#[test]
fn a_scan_with_another_origin_is_moved_to_the_array() {
    let place = Place::new();
    let moved: Vec<[f64; 6]> = rows(&place)
        .into_iter()
        .map(|[x, y, z, bx, by, bz]| [x + 0.021, y, z - 0.043, bx, by, bz])
        .collect();
    place.write("scan.csv", &scan(&moved, BY_ROW, FIELD));
    let report = compared(&place, &[]);
    let fit = &report["fit"];
    assert_eq!(fit["converged"], true, "{fit:#}");
    for (axis, shift) in [-0.021, 0.0, 0.043].into_iter().enumerate() {
        let found = fit["position_m"][axis].as_f64().unwrap();
        assert!((found - shift).abs() < 1e-7, "{fit:#}");
    }
}

/// `current5_a` was passed over like a comment, and its field went into the scale of another coil.
#[test]
fn columns_named_almost_as_one_that_is_read_are_refused() {
    let place = Place::new();
    let rows = rows(&place);
    for (drive, field, found, expected) in [
        ("current_4_a,current5_a", FIELD, "current5_a", "current_5_a"),
        (
            "current_4_a,current_05_a",
            FIELD,
            "current_05_a",
            "current_5_a",
        ),
        ("coil,Current_A", FIELD, "Current_A", "current_a"),
        (BY_ROW, "bx_t,by_t,Bz_T", "Bz_T", "bz_t"),
        (BY_ROW, "bx_mt,by_t,bz_t", "bx_mt", "bx_t"),
        (BY_ROW, "bx_t,B_y (T),bz_t", "B_y (T)", "by_t"),
        (BY_ROW, "bx_t,dby/dz,bz_t", "dby/dz", "dby_dz_t_per_m"),
        (
            BY_ROW,
            "bx_t,by_t,dbz_dx_mt_per_mm",
            "dbz_dx_mt_per_mm",
            "dbz_dx_t_per_m",
        ),
    ] {
        place.write("scan.csv", &scan(&rows, drive, field));
        let ran = place.run(&["probe", SEED, "--compare", "scan.csv"]).ends(3);
        let found = format!("scan.csv:1: column {found}: this name is not read");
        ran.says(&["E302", &found, &format!("expected {expected}")]);
    }
    // One more column than the current by row.
    let with_more = |name: &str| {
        let text = scan(&rows, BY_ROW, FIELD);
        let lines = text.lines().enumerate();
        let lines = lines.map(|(at, line)| match at {
            0 => format!("{line},{name}\n"),
            _ => format!("{line},0.7\n"),
        });
        place.write("scan.csv", &lines.collect::<String>());
        place.run(&["probe", SEED, "--compare", "scan.csv"])
    };
    with_more("current_2")
        .ends(3)
        .says(&["expected current_2_a"]);
    // Anything else is somebody's own, also what `probe` itself writes.
    for own in [
        "time_s",
        "byte",
        "coil_temperature_c",
        "bz_t_per_a",
        "bz_residual_t",
    ] {
        with_more(own).ends(0);
    }
}

/// Centimetres were called millimetres, and so was a point 100 m away.
#[test]
fn no_unit_of_length_is_guessed() {
    let place = Place::new();
    let rows = rows(&place);
    let all = [
        "millimetres by 1000",
        "centimetres by 100",
        "inches by 0.0254",
    ];
    for (per_m, fitting) in [(1e3, &all[..2]), (1e2, &all), (1.0 / 0.0254, &all)] {
        let scaled = rows.iter();
        let scaled: Vec<[f64; 6]> = scaled
            .map(|[x, y, z, b @ ..]| [x * per_m, y * per_m, z * per_m, b[0], b[1], b[2]])
            .collect();
        place.write("scan.csv", &scan(&scaled, BY_ROW, FIELD));
        let ran = place.run(&["probe", SEED, "--compare", "scan.csv"]).ends(3);
        assert!(!ran.err.contains("look like"), "{}", ran.err);
        ran.says(&["E307", "if they are not in metres"])
            .says(fitting);
    }
    place.write("points.csv", "x_m,y_m,z_m\n0,0,100\n");
    let far = place.run(&["probe", SEED, "points.csv"]).ends(0);
    assert!(!far.err.contains("look like"), "{}", far.err);
    far.says(&[
        "warning",
        "if they are not in metres",
        "millimetres by 1000",
    ]);
    // Beyond what any of them would bring near.
    place.write("points.csv", "x_m,y_m,z_m\n0,0,7e6\n");
    let far = place.run(&["probe", SEED, "points.csv"]).ends(0);
    far.says(&["if they are not in metres: convert them"]);
}

/// Of no rows at all every one has no current.
#[test]
fn a_scan_without_rows_is_called_that() {
    let place = Place::new();
    let header = scan(&[], BY_ROW, FIELD);
    let args = ["probe", SEED, "--compare", "-"];
    let ran = place.run_with_input(&args, &header).ends(3);
    assert!(!ran.err.contains("current is 0"), "{}", ran.err);
    ran.says(&["-: the table has a header and no rows"]);
}

/// Broke: a field of 1e160 T was fitted, with NaN of what is left on screen and no JSON.
#[test]
fn what_no_sensor_measures_is_refused_with_its_place() {
    let place = Place::new();
    let mut rows = rows(&place);
    rows[7][5] = 1e160;
    place.write("scan.csv", &scan(&rows, BY_ROW, FIELD));
    place
        .run(&["probe", SEED, "--compare", "scan.csv"])
        .ends(3)
        .says(&["scan.csv:9: column bz_t: ", "no sensor measures"]);
}

/// Broke: of a coil whose field is 0 everywhere the leads were said to be swapped.
#[test]
fn a_coil_without_any_field_is_said_to_show_none() {
    let place = Place::new();
    let none = rows(&place)
        .into_iter()
        .map(|[x, y, z, ..]| [x, y, z, 0.0, 0.0, 0.0]);
    place.write("scan.csv", &scan(&none.collect::<Vec<_>>(), BY_ROW, FIELD));
    let ran = place.run(&["probe", SEED, "--compare", "scan.csv"]).ends(0);
    let ran = ran.says(&["coil 4: the scan shows no field of it"]);
    assert!(!ran.err.contains("swapped"), "{}", ran.err);
    assert!(!ran.out.contains("of the measured"), "{}", ran.out);
}
