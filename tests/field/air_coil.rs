//! The air coil against high-precision values and against physics.

use fluxform_coil::inductance::self_inductance_h;
use fluxform_field::components::Components;
use fluxform_field::winding::{AxialField, Winding};
use serde_json::Value;

fn oracle() -> Value {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/oracles/air_coil.json"
    );
    let text = std::fs::read_to_string(path).expect("committed oracle tests/oracles/air_coil.json");
    serde_json::from_str(&text).expect("JSON")
}

fn number(value: &Value) -> f64 {
    value
        .as_str()
        .expect("decimal text")
        .parse()
        .expect("number")
}

fn winding(oracle: &Value, name: &Value) -> Winding {
    let w = &oracle["windings"][name.as_str().expect("name")];
    Winding {
        inner_radius_m: number(&w["inner_radius_m"]),
        outer_radius_m: number(&w["outer_radius_m"]),
        length_m: number(&w["length_m"]),
        turns: number(&w["turns"]),
    }
}

#[test]
fn every_component_is_exact_to_1e_12() {
    let oracle = oracle();
    let mut worst = 0.0_f64;
    for point in oracle["points"].as_array().expect("points") {
        let winding = winding(&oracle, &point["winding"]);
        let (r, z) = (number(&point["r_m"]), number(&point["z_m"]));
        let field = winding.field(r, z).expect("off the edges");
        let exact = |key: &str| number(&point[key]);
        let gradient = AxialField {
            dbr_dr: exact("dbr_dr"),
            dbr_dz: exact("dbr_dz"),
            dbz_dr: exact("dbz_dr"),
            dbz_dz: exact("dbz_dz"),
            br_over_r: exact("br_over_r"),
            ..AxialField::default()
        };
        let norm = gradient.gradient_norm();
        let size = exact("b_r").hypot(exact("b_z"));
        for (key, value, scale) in [
            ("dbr_dr", field.dbr_dr, norm),
            ("dbr_dz", field.dbr_dz, norm),
            ("dbz_dr", field.dbz_dr, norm),
            ("dbz_dz", field.dbz_dz, norm),
            ("br_over_r", field.br_over_r, norm),
            ("b_r", field.b_r, size),
            ("b_z", field.b_z, size),
        ] {
            let error = (value - exact(key)).abs() / scale;
            worst = worst.max(error);
            assert!(
                error < 1e-12,
                "{} r={r} z={z} {key}: {error:e}",
                point["winding"]
            );
        }
    }
    // The bound is honest: the worst sample is not orders of magnitude better.
    assert!(worst > 1e-15, "{worst:e}");
}

#[test]
fn the_batch_keeps_its_tolerance() {
    let seed = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    };
    let disc = Winding {
        inner_radius_m: 0.013,
        outer_radius_m: 0.047,
        length_m: 0.011,
        turns: 37.0,
    };
    let tube = Winding {
        inner_radius_m: 0.0007,
        outer_radius_m: 0.0011,
        length_m: 1.1,
        turns: 2600.0,
    };
    let sheet = Winding {
        inner_radius_m: 0.05,
        outer_radius_m: 0.0500003,
        length_m: 0.03,
        turns: 91.0,
    };
    for winding in [seed, disc, tube, sheet] {
        for z in [0.0004, 0.0023, 0.01, 0.031, 0.08, 0.7] {
            let mut r: Vec<f64> = (0..300).map(|i| 0.00047 * f64::from(i)).collect();
            // Rules with an odd number of nodes have one here, where a sheet's B_z jumps.
            let middle = 0.5 * (winding.inner_radius_m + winding.outer_radius_m);
            r.extend([0.0, 1.1e-16, -1.1e-16, 1e-12, -1e-12].map(|by| middle * (1.0 + by)));
            r.extend([middle.next_up(), middle.next_down()]);
            let exact: Vec<AxialField> = r
                .iter()
                .map(|r| winding.field(*r, z).expect("off the edges"))
                .collect();
            let largest = exact
                .iter()
                .map(AxialField::gradient_norm)
                .fold(0.0, f64::max);
            let field = exact.iter().map(|f| f.b_z.hypot(f.b_r)).fold(0.0, f64::max);
            for tolerance in [1e-3, 1e-6, 1e-9, 1e-12] {
                let z = vec![z; r.len()];
                let batch = winding
                    .gradients(&r, &z, tolerance, Components::Gradient)
                    .expect("edges");
                let gz = winding
                    .gradients(&r, &z, tolerance, Components::Gz)
                    .expect("edges");
                let b_z = winding.axial_fields(&r, &z, tolerance).expect("edges");
                for (i, f) in exact.iter().enumerate() {
                    let error = [
                        batch.dbz_dz[i] - f.dbz_dz,
                        batch.dbr_dz_over_r[i] * r[i] - f.dbr_dz,
                        batch.br_over_r[i] - f.br_over_r,
                        gz.dbz_dz[i] - f.dbz_dz,
                    ]
                    .iter()
                    .fold(0.0_f64, |worst, e| worst.max(e.abs()));
                    assert!(
                        error <= tolerance * largest,
                        "{winding:?} z={} r={} {tolerance:e}: {:e}",
                        z[0],
                        r[i],
                        error / largest
                    );
                    assert!(
                        (b_z[i] - f.b_z).abs() <= tolerance * field,
                        "{winding:?} B_z z={} r={} {tolerance:e}: {:e}",
                        z[0],
                        r[i],
                        (b_z[i] - f.b_z) / field
                    );
                }
            }
        }
    }
}

#[test]
fn self_inductance_is_exact_to_1e_12() {
    let oracle = oracle();
    for case in oracle["inductances"].as_array().expect("inductances") {
        let winding = winding(&oracle, &case["winding"]);
        let exact = number(&case["inductance_h"]);
        let error = self_inductance_h(&winding) / exact - 1.0;
        assert!(error.abs() < 1e-12, "{}: {error:e}", case["winding"]);
    }
}

#[test]
fn flux_is_conserved_through_a_closed_cylinder() {
    // Divergence theorem on a cylinder that cuts through the conductor: no net flux of B.
    let winding = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    };
    let (radius, low, high) = (0.0157, -0.061, -0.013);
    let n = 400;
    let mut flux = 0.0;
    let mut size = 0.0;
    for k in 0..n {
        let t = (f64::from(k) + 0.5) / f64::from(n);
        // Midpoints in r: the flux through the lids; in z: through the wall.
        let r = radius * t;
        let lid = |z| winding.field(r, z).expect("inside").b_z;
        flux += std::f64::consts::TAU * r * radius / f64::from(n) * (lid(high) - lid(low));
        let z = low + (high - low) * t;
        let wall = winding.field(radius, z).expect("inside").b_r;
        flux += std::f64::consts::TAU * radius * (high - low) / f64::from(n) * wall;
        size += std::f64::consts::TAU * r * radius / f64::from(n) * lid(high).abs();
    }
    assert!(flux.abs() < 1e-5 * size, "{:e}", flux / size);
}

#[test]
fn ampere_law_inside_the_conductor() {
    let winding = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    };
    let current = 4e-7 * std::f64::consts::PI * winding.current_density_per_m2();
    let inside = winding.field(0.0143, -0.037).expect("inside");
    assert!((inside.dbr_dz - inside.dbz_dr - current).abs() < 1e-12 * inside.gradient_norm());
    let outside = winding.field(0.0143, 0.001).expect("outside");
    assert_eq!(outside.dbr_dz, outside.dbz_dr);
    // The jump across the top face is the same: dB_r/dz changes by mu_0 J, the rest does not.
    let (below, above) = (winding.field(0.0143, -1e-12), winding.field(0.0143, 1e-12));
    let (below, above) = (below.expect("inside"), above.expect("outside"));
    assert!((below.dbr_dz - above.dbr_dz - current).abs() < 1e-8 * current);
    assert!((below.dbz_dz - above.dbz_dz).abs() < 1e-8 * current);
}

#[test]
fn taylor_test_of_every_component() {
    let winding = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    };
    for (r, z) in [
        (0.0071, 0.013),
        (0.0143, -0.021),
        (0.031, -0.047),
        (0.3, 0.2),
    ] {
        let at = |dr: f64, dz: f64| winding.field(r + dr, z + dz).expect("off the edges");
        let base = at(0.0, 0.0);
        let remainder = |h: f64| {
            let (right, up) = (at(h, 0.0), at(0.0, h));
            [
                right.b_r - base.b_r - h * base.dbr_dr,
                right.b_z - base.b_z - h * base.dbz_dr,
                up.b_r - base.b_r - h * base.dbr_dz,
                up.b_z - base.b_z - h * base.dbz_dz,
            ]
        };
        let (coarse, fine) = (remainder(4e-5), remainder(4e-6));
        for (c, f) in coarse.iter().zip(fine) {
            let rate = (c / f).abs().log10();
            assert!(rate > 1.8, "r={r} z={z}: observed order {rate}");
        }
    }
}

#[test]
fn mirrored_points_have_mirrored_fields() {
    let winding = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    };
    for (r, height) in [(0.007, 0.013), (0.0143, -0.021), (0.5, 3.0)] {
        let up = winding.field(r, height).expect("off the edges");
        let down = winding.field(r, -0.1 - height).expect("off the edges");
        let norm = up.gradient_norm();
        assert!((up.b_z - down.b_z).abs() < 1e-12 * up.b_z.abs());
        assert!((up.b_r + down.b_r).abs() < 1e-11 * up.b_r.abs());
        assert!((up.dbz_dz + down.dbz_dz).abs() < 1e-12 * norm);
        assert!((up.dbr_dr + down.dbr_dr).abs() < 1e-12 * norm);
        assert!((up.dbr_dz - down.dbr_dz).abs() < 1e-12 * norm);
    }
}

#[test]
fn the_edges_are_refused_and_the_faces_are_not() {
    let winding = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    };
    for (r, z) in [(0.012, 0.0), (0.019, 0.0), (0.012, -0.1), (0.019, -0.1)] {
        let message = winding.field(r, z).expect_err("an edge").to_string();
        assert!(message.contains("unbounded"), "{message}");
    }
    for (r, z) in [
        (0.0143, 0.0),
        (0.012, -0.05),
        (0.019, -0.03),
        (0.0157, -0.1),
    ] {
        let on = winding.field(r, z).expect("a face");
        let (dr, dz) = match (r, z) {
            (_, 0.0) => (0.0, 1e-13),
            (_, -0.1) => (0.0, -1e-13),
            (0.012, _) => (-1e-13, 0.0),
            _ => (1e-13, 0.0),
        };
        let beside = winding.field(r + dr, z + dz).expect("outside");
        assert!((on.dbz_dr - beside.dbz_dr).abs() < 1e-6 * on.gradient_norm());
        assert!((on.dbr_dz - beside.dbr_dz).abs() < 1e-6 * on.gradient_norm());
    }
}

/// Regression: from 1e15 m on the winding's length was lost against the distance, and the field
/// was not a number.
#[test]
fn a_point_beyond_all_measure_has_a_field() {
    let seed = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    };
    // Both sides of where the dipole takes over: B falls with the cube, its slope with the fourth.
    let at = |d: f64| seed.field(0.6 * d, 0.8 * d - 0.05).expect("off the edges");
    let near = at(1e6);
    for d in [1e7, 1.1e8, 1.3e8, 1e12, 1e15, 1e20, 1e60] {
        let (far, k) = (at(d), 1e6 / d);
        let size = near.b_z.hypot(near.b_r) * k * k * k;
        for (found, expected) in [(far.b_z, near.b_z), (far.b_r, near.b_r)] {
            assert!(
                (found - expected * k * k * k).abs() < 1e-12 * size,
                "{d:e}: {found:e}"
            );
        }
        let size = near.gradient_norm() * k.powi(4);
        for (found, expected) in [
            (far.dbz_dz, near.dbz_dz),
            (far.dbr_dz, near.dbr_dz),
            (far.dbr_dr, near.dbr_dr),
            (far.br_over_r, near.br_over_r),
        ] {
            assert!(
                (found - expected * k.powi(4)).abs() < 1e-12 * size,
                "{d:e}: {found:e}"
            );
        }
    }
    for d in [1e77, 1e120, 1e308, f64::MAX, f64::INFINITY] {
        let far = seed.field(0.01, d).expect("off the edges");
        assert!(
            far.b_z.abs() < 1e-200 && far.gradient_norm() < 1e-200,
            "{d:e}: {far:?}"
        );
    }
}

/// Second differences of dB_z/dz along slanted lines.
#[test]
fn no_third_derivative_exceeds_its_bound_and_the_bound_is_not_idle() {
    let winding = Winding {
        inner_radius_m: 0.0123,
        outer_radius_m: 0.0191,
        length_m: 0.0977,
        turns: 1313.0,
    };
    let step_m = 2e-4;
    let dbz_dz = |x: f64, y: f64, z: f64| winding.field(x.hypot(y), z).expect("in air").dbz_dz;
    let mut tightest = f64::INFINITY;
    for z_m in [0.013, 0.03, 0.071] {
        for x_m in [0.0, 0.007, 0.016, 0.024, 0.045] {
            let bound = winding.third_derivative_bound([x_m - step_m, x_m + step_m], z_m - step_m);
            for [a, b, c] in [
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.6, 0.0, 0.8],
                [0.36, 0.48, 0.8],
            ] {
                let at = |t: f64| dbz_dz(x_m + a * t, b * t, z_m + c * t);
                let second = (at(step_m) - 2.0 * at(0.0) + at(-step_m)) / (step_m * step_m);
                assert!(second.abs() <= bound, "{x_m} {z_m}: {second} {bound}");
                tightest = tightest.min(bound / second.abs());
            }
        }
    }
    assert!(tightest < 5.0, "{tightest}");
}
