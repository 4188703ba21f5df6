//! Magnetisation curves: against scipy's PCHIP, and as physics has them.

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::steel::bh_check::{BhCurveError, BhWarning};
use fluxform_field::steel::bh_curve::BhCurve;
use serde_json::Value;

fn oracle() -> Value {
    serde_json::from_str(include_str!("../oracles/bh_curve.json")).unwrap()
}

fn column(table: &Value, name: &str) -> Vec<f64> {
    let values = table[name].as_array().unwrap();
    values.iter().map(|v| v.as_f64().unwrap()).collect()
}

fn tables() -> Vec<(String, Vec<f64>, Vec<f64>)> {
    let oracle = oracle();
    let tables = oracle.as_object().unwrap();
    tables
        .iter()
        .map(|(name, t)| (name.clone(), column(t, "b_t"), column(t, "h_a_per_m")))
        .collect()
}

fn curve(name: &str) -> BhCurve {
    let table = &oracle()[name];
    BhCurve::new(&column(table, "b_t"), &column(table, "h_a_per_m")).unwrap()
}

fn steel() -> (Vec<f64>, Vec<f64>) {
    let table = &oracle()["steel_1010"];
    (column(table, "b_t"), column(table, "h_a_per_m"))
}

fn scaled(values: &[f64], by: f64) -> Vec<f64> {
    values.iter().map(|v| v * by).collect()
}

#[track_caller]
fn assert_close(found: f64, expected: f64, relative: f64) {
    assert!(
        (found - expected).abs() <= relative * expected.abs(),
        "{found:e} instead of {expected:e}: {:e}",
        (found - expected).abs() / expected.abs()
    );
}

#[test]
fn agrees_with_scipy() {
    for (name, table) in oracle().as_object().unwrap() {
        let curve = curve(name);
        for point in table["points"].as_array().unwrap() {
            let value = |key: &str| point[key].as_f64().unwrap();
            let b = value("b_t");
            assert_close(curve.h_a_per_m(b), value("h_a_per_m"), 3e-14);
            assert_close(curve.dh_db(b), value("dh_db_m_per_h"), 1e-12);
            assert_close(curve.energy_j_per_m3(b), value("energy_j_per_m3"), 1e-13);
            if let Some(found_b_t) = point["found_b_t"].as_f64() {
                assert_close(curve.b_t(value("wanted_h_a_per_m")), found_b_t, 1e-13);
            }
        }
    }
}

#[test]
fn the_committed_table_is_the_oracle_s() {
    let text = include_str!("../../designs/steel_1010.csv");
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    let (b, h) = steel();
    assert_eq!(rows.len(), 38);
    assert!(
        rows.iter()
            .zip(b.iter().zip(&h))
            .all(|(r, (b, h))| [*b, *h] == r[..])
    );
    let curve = BhCurve::new(&b, &h).unwrap();
    assert_eq!(curve.warnings(), []);
    assert_eq!(curve.largest_b_t(), 2.47124);
    // Low-carbon steel: some thousands at first, a knee near 1.5 T.
    assert!((1500.0..3000.0).contains(&curve.initial_relative_permeability()));
    assert!((1.3..1.6).contains(&curve.knee_t()), "{}", curve.knee_t());
}

#[test]
fn the_inverse_is_exact_to_rounding() {
    for (name, b, h) in tables() {
        let curve = BhCurve::new(&b, &h).unwrap();
        for i in 1..4000 {
            let b_t = curve.largest_b_t() * f64::from(i) * 2.9e-4;
            let back = curve.b_t(curve.h_a_per_m(b_t));
            // Half a digit of H, seen through the slope, and two of B.
            let through = f64::EPSILON * curve.h_a_per_m(b_t) / curve.dh_db(b_t);
            assert!(
                (back - b_t).abs() <= 4.0 * (through + f64::EPSILON * b_t),
                "{name} {b_t}"
            );
        }
        // The points themselves are kept to the last bit.
        for (&b, &h) in b.iter().zip(&h) {
            assert_eq!((curve.h_a_per_m(b), curve.b_t(h)), (h, b), "{name}");
        }
    }
}

#[test]
fn is_odd_and_its_energy_even() {
    for (_, b, h) in tables() {
        let curve = BhCurve::new(&b, &h).unwrap();
        for b in [1e-12, 0.37, 1.13, 5.7] {
            assert_eq!(curve.h_a_per_m(-b), -curve.h_a_per_m(b));
            assert_eq!(curve.b_t(-700.0 * b), -curve.b_t(700.0 * b));
            assert_eq!(curve.dh_db(-b), curve.dh_db(b));
            assert_eq!(curve.energy_j_per_m3(-b), curve.energy_j_per_m3(b));
            assert_eq!(
                curve.relative_permeability(-b),
                curve.relative_permeability(b)
            );
        }
        assert_eq!(
            (
                curve.h_a_per_m(0.0),
                curve.b_t(0.0),
                curve.energy_j_per_m3(0.0)
            ),
            (0.0, 0.0, 0.0)
        );
        assert_eq!(
            curve.relative_permeability(0.0),
            curve.initial_relative_permeability()
        );
        assert!(curve.h_a_per_m(f64::NAN).is_nan() && curve.b_t(f64::NAN).is_nan());
    }
}

#[test]
fn is_monotone_and_its_derivatives_belong_to_it() {
    for (name, b, h) in tables() {
        let curve = BhCurve::new(&b, &h).unwrap();
        let mut before = 0.0;
        for i in 1..3000 {
            let b_t = curve.largest_b_t() * f64::from(i) * 4.1e-4;
            let h = curve.h_a_per_m(b_t);
            assert!(h > before, "{name} {b_t}");
            before = h;
        }
        // Taylor: the remainder falls as the square of the step.
        for at in [
            0.41 * b[1],
            0.3 * b[1] + 0.7 * b[2],
            1.3 * curve.largest_b_t(),
        ] {
            let rest = |step: f64| {
                let h = curve.h_a_per_m(at + step) - curve.h_a_per_m(at) - step * curve.dh_db(at);
                let w = curve.energy_j_per_m3(at + step)
                    - curve.energy_j_per_m3(at)
                    - step * curve.h_a_per_m(at);
                [h.abs(), (w - 0.5 * step * step * curve.dh_db(at)).abs()]
            };
            let (wide, narrow) = (rest(1e-3 * b[1]), rest(1e-4 * b[1]));
            assert!(
                narrow[0] <= 0.02 * wide[0] + 1e-13 * curve.h_a_per_m(at),
                "{name} {at}: {wide:?} {narrow:?}"
            );
            assert!(
                narrow[1] <= 0.002 * wide[1] + 1e-13 * curve.energy_j_per_m3(at),
                "{name} {at}: {wide:?} {narrow:?}"
            );
        }
    }
}

#[test]
fn beyond_the_table_it_is_vacuum() {
    let (b, h) = steel();
    let curve = BhCurve::new(&b, &h).unwrap();
    let (last_b, last_h) = (b[37], h[37]);
    assert_eq!(curve.dh_db(last_b), 1.0 / MU_0_T_M_PER_A);
    assert_close(
        curve.h_a_per_m(last_b + 1.3) - last_h,
        1.3 / MU_0_T_M_PER_A,
        1e-14,
    );
    assert_close(
        curve.b_t(last_h + 7e5) - last_b,
        7e5 * MU_0_T_M_PER_A,
        1e-14,
    );
    let rise = curve.energy_j_per_m3(last_b + 1.3) - curve.energy_j_per_m3(last_b);
    assert_close(rise, 1.3 * last_h + 0.845 / MU_0_T_M_PER_A, 1e-14);
}

#[test]
fn the_knee_is_where_a_tenth_of_the_permeability_is_left() {
    let curve = curve("steel_1010");
    let knee = curve.knee_t();
    let steepest = (0..14).fold(f64::INFINITY, |least, k| {
        let (b, h) = steel();
        least.min((h[k + 1] - h[k]) / (b[k + 1] - b[k]))
    });
    assert_close(curve.dh_db(knee), 10.0 * steepest, 1e-12);
    assert!(curve.dh_db(knee - 1e-6) < 10.0 * steepest);
    // A table that is never that steep ends before its knee.
    let gentle = BhCurve::new(&[0.0, 0.7, 1.3], &[0.0, 300.0, 900.0]).unwrap();
    assert_eq!(gentle.knee_t(), 1.3);
}

#[test]
fn points_that_are_no_curve_are_refused_with_their_row() {
    let refuse = |b: &[f64], h: &[f64]| BhCurve::new(b, h).unwrap_err();
    let says = |error: BhCurveError, words: &str| {
        assert!(error.to_string().contains(words), "{error}");
    };
    says(refuse(&[], &[]), "0 points are too few");
    says(
        refuse(&[0.0, 1.3], &[0.0, 700.0]),
        "2 points are too few: expected the origin and at least two points more",
    );
    says(
        refuse(&[0.0, 0.7, 1.3], &[0.0, 700.0]),
        "3 values of B and 2 of H",
    );
    says(
        refuse(&[0.7, 1.0, 1.3], &[70.0, 130.0, 700.0]),
        "the first row is B = 0.7 T, H = 70.0 A/m: expected 0,0 (add the row 0,0 before it",
    );
    says(
        refuse(&[0.0, 0.7, 0.7], &[0.0, 130.0, 700.0]),
        "row 3: b_t is 0.7 after 0.7: expected it to grow",
    );
    says(
        refuse(&[0.0, 0.7, 1.3], &[0.0, 700.0, 130.0]),
        "row 3: h_a_per_m is 130.0 after 700.0",
    );
    says(
        refuse(&[0.0, 0.7, f64::NAN], &[0.0, 130.0, 700.0]),
        "row 3: expected finite numbers",
    );
    says(
        refuse(&[0.0, 0.7, 1.3], &[0.0, f64::INFINITY, 700.0]),
        "row 2: expected finite numbers",
    );
    says(
        refuse(&[0.0, 0.7, 1e300], &[0.0, 130.0, 700.0]),
        "row 3: expected finite numbers with B up to 1e6 T",
    );
    says(
        refuse(&[0.0, 1e-300, 1e-299], &[0.0, 130.0, 700.0]),
        "row 2: up to B = 1e-300 T the steel would be less permeable than vacuum",
    );
    says(
        refuse(&[0.0, 0.7, 1.3], &[0.0, 5e-324, 700.0]),
        "row 2: up to B = 0.7 T the relative permeability would be",
    );
    // mA/m: the steel would be weaker than vacuum.
    let (b, h) = steel();
    let error = refuse(&b, &scaled(&h, 1000.0));
    assert!(
        matches!(error, BhCurveError::BelowVacuum { row: 11, .. }),
        "{error}"
    );
}

#[test]
fn another_unit_is_warned_of_with_its_factor() {
    let (b, h) = steel();
    let said = |b_times: f64, h_times: f64| {
        BhCurve::new(&scaled(&b, b_times), &scaled(&h, h_times))
            .unwrap()
            .warnings()
    };
    let unit_of_h = |w: &BhWarning| match w {
        BhWarning::UnitOfH { unit, times, .. } => Some((*unit, *times)),
        _ => None,
    };
    let unit_of_b = |w: &BhWarning| match w {
        BhWarning::UnitOfB { unit, times, .. } => Some((*unit, *times)),
        _ => None,
    };
    // Linear steel would be vacuum in kA/m, which was advised.
    let (linear_b, linear_h) = ([0.0, 0.5, 1.0, 2.0], [0.0, 400.0, 800.0, 1600.0]);
    let linear = BhCurve::new(&linear_b, &linear_h).unwrap().warnings();
    assert!(
        matches!(linear[..], [BhWarning::EndsEarly { .. }]),
        "{linear:?}"
    );
    let oersted = 1000.0 / (4.0 * std::f64::consts::PI);
    let one = said(1.0, 1e-3);
    assert_eq!(
        one.iter().filter_map(unit_of_h).collect::<Vec<_>>(),
        [("kA/m", 1000.0)],
        "{one:?}"
    );
    let one = said(1.0, 1.0 / oersted);
    assert_eq!(unit_of_h(&one[0]).unwrap().0, "oersted");
    assert_close(unit_of_h(&one[0]).unwrap().1, oersted, 1e-15);
    assert_eq!(one.len(), 1, "{one:?}");
    let one = said(1e3, 1.0);
    assert_eq!(
        one.iter().filter_map(unit_of_b).collect::<Vec<_>>(),
        [("mT", 1e-3)],
        "{one:?}"
    );
    assert_eq!(one.len(), 1, "{one:?}");
    let both = said(1e4, 1.0 / oersted);
    assert_eq!(
        (
            unit_of_b(&both[0]).unwrap().0,
            unit_of_h(&both[1]).unwrap().0
        ),
        ("gauss", "oersted")
    );
    assert!(
        both[0]
            .to_string()
            .ends_with("looks like gauss (multiply b_t by 0.0001 if that is meant)"),
        "{}",
        both[0]
    );
    let exchanged = BhCurve::new(&scaled(&h, 1.0), &b).unwrap().warnings();
    assert!(
        matches!(exchanged[..], [BhWarning::Exchanged { .. }]),
        "{exchanged:?}"
    );
}

#[test]
fn where_a_table_ends_and_begins_is_warned_of() {
    let (b, h) = steel();
    let cut = |rows: usize| BhCurve::new(&b[..rows], &h[..rows]).unwrap().warnings();
    assert!(
        matches!(
            cut(14)[..],
            [BhWarning::EndsEarly {
                largest_b_t: 1.48063,
                ..
            }]
        ),
        "{:?}",
        cut(14)
    );
    assert!(
        matches!(cut(18)[..], [BhWarning::EndsEarly { .. }]),
        "{:?}",
        cut(18)
    );
    assert_eq!(cut(30), []);
    let level = curve("level_origin");
    assert_eq!(level.initial_relative_permeability(), f64::INFINITY);
    assert!(
        level
            .warnings()
            .contains(&BhWarning::LevelOrigin { first_b_t: 0.9 })
    );
    // Rounded rows at saturation rise a little less than vacuum.
    let flat = BhCurve::new(
        &[0.0, 0.7, 1.9, 2.1, 2.3],
        &[
            0.0,
            170.0,
            13000.0,
            150_000.0,
            150_000.0 + 0.205 / MU_0_T_M_PER_A,
        ],
    )
    .unwrap();
    assert!(
        flat.warnings()
            .iter()
            .any(|w| matches!(w, BhWarning::BelowVacuum { .. })),
        "{:?}",
        flat.warnings()
    );
}

#[test]
fn the_weakest_fields_meet_the_initial_permeability() {
    let curve = curve("steel_1010");
    let permeability = curve.initial_relative_permeability() * MU_0_T_M_PER_A;
    for h_a_per_m in [1e-6, 1e-30, 1.3e-90, 0.7e-250] {
        assert_close(curve.b_t(h_a_per_m), permeability * h_a_per_m, 1e-6);
    }
}
