//! Against finite elements and against a boundary-integral solution by surface charge.

use fluxform_coil::inductance::self_inductance_h;
use fluxform_field::steel::CoreShape;
use fluxform_field::winding::Winding;
use serde_json::Value;

use super::support::{Design, SEED_COIL, SEED_CORE, number, oracle};

/// dB_z/dz to 1e-5 of the peak at its height, B_z to 5e-6, L to 1e-7, at tolerance 1e-6.
#[test]
fn finite_elements_agree_on_the_seeds_coil() {
    let oracle = oracle("fem_single_core");
    for mu_r in [1.0, 100.0, 1000.0, 4000.0] {
        let case = &oracle["linear"][format!("mu_r={mu_r}")];
        let design = Design {
            winding: SEED_COIL,
            core: SEED_CORE,
            mu_r,
        };
        let coil = design.solve(1e-6);
        let inductance = self_inductance_h(&SEED_COIL) + coil.added_inductance_h;
        let error = inductance / number(&case["L_H"]) - 1.0;
        assert!(error.abs() < 1e-7, "mu_r {mu_r}: L is off by {error:e}");
        let points = case["points_mm_r_z"].as_array().expect("points");
        let column = |name: &str| -> Vec<f64> {
            let values: &Vec<Value> = case[name].as_array().expect("values");
            values.iter().map(number).collect()
        };
        let (b_z, gradient) = (column("Bz_T_per_A"), column("dBzdz_T_per_m_per_A"));
        assert_eq!(points.len(), 10);
        for (i, point) in points.iter().enumerate() {
            let (r_m, z_mm) = (1e-3 * number(&point[0]), number(&point[1]));
            let field = coil.field(r_m, 1e-3 * z_mm).expect("above");
            let peak = points
                .iter()
                .zip(&gradient)
                .filter(|(p, _)| number(&p[1]) == z_mm)
                .fold(0.0_f64, |peak, (_, g)| peak.max(g.abs()));
            let off = (field.dbz_dz - gradient[i]).abs() / peak;
            assert!(
                off < 1e-5,
                "mu_r {mu_r} at {point}: dBz/dz is off by {off:e}"
            );
            let off = (field.b_z / b_z[i] - 1.0).abs();
            assert!(off < 5e-6, "mu_r {mu_r} at {point}: Bz is off by {off:e}");
        }
    }
}

#[test]
fn the_surface_charge_agrees_on_generic_designs() {
    let oracle = oracle("cores");
    let cases = oracle["cases"].as_array().expect("cases");
    assert_eq!(cases.len(), 7);
    for case in cases {
        let value = |key: &str| number(&case[key]);
        let design = Design {
            winding: Winding {
                inner_radius_m: value("inner_radius_m"),
                outer_radius_m: value("outer_radius_m"),
                length_m: value("length_m"),
                turns: value("turns"),
            },
            core: CoreShape {
                radius_m: value("core_radius_m"),
                bottom_m: value("core_bottom_m"),
                top_m: value("core_top_m"),
            },
            mu_r: value("mu_r"),
        };
        // The oracle's coarser solution is within 6e-8; its finer one is far better than that.
        assert!(
            value("error") < 6e-8,
            "the oracle itself is uncertain: {case}"
        );
        let allowed = 1e-9;
        let coil = design.solve(1e-9);
        let error = coil.added_inductance_h / value("added_inductance_h") - 1.0;
        println!(
            "{design:?}: L off by {error:.1e}, oracle within {:.1e}",
            value("error")
        );
        assert!(error.abs() < allowed, "{design:?}: L is off by {error:e}");
        let points = case["points"].as_array().expect("points");
        let peak = |key: &str| {
            points
                .iter()
                .fold(0.0_f64, |p, point| p.max(number(&point[key]).abs()))
        };
        for point in points {
            let field = coil
                .core
                .field(number(&point["r_m"]), number(&point["z_m"]));
            for (key, value) in [
                ("b_r", field.b_r),
                ("b_z", field.b_z),
                ("dbz_dz", field.dbz_dz),
            ] {
                let error = (value - number(&point[key])).abs() / peak(key);
                assert!(
                    error < allowed,
                    "{design:?}: {key} at {point} is off by {error:e}"
                );
            }
        }
    }
}
