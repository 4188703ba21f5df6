//! Designs at the limits of what may be asked.

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::steel::generatrix::Resolution;
use fluxform_field::winding::Winding;

use super::support::{Design, SEED_COIL, SEED_CORE, designs};

fn winding(inner_radius_m: f64, outer_radius_m: f64, length_m: f64) -> Winding {
    Winding {
        inner_radius_m,
        outer_radius_m,
        length_m,
        turns: 1000.0,
    }
}

fn core(radius_m: f64, bottom_m: f64, top_m: f64) -> CoreShape {
    CoreShape {
        radius_m,
        bottom_m,
        top_m,
    }
}

fn extreme_shapes() -> Vec<(&'static str, Winding, CoreShape)> {
    let seed = SEED_COIL;
    vec![
        ("coin at the top", seed, core(0.012, -0.0001, 0.0)),
        ("coin in the middle", seed, core(0.0119, -0.051, -0.05)),
        ("wire", winding(1e-4, 0.019, 0.1), core(5e-5, -0.1, 0.0)),
        (
            "wire through a short coil",
            winding(1e-4, 0.019, 0.001),
            core(1e-4, -0.05, 0.05),
        ),
        ("far below", seed, core(0.01, -0.3, -0.2)),
        (
            "far above",
            winding(0.012, 0.019, 0.01),
            core(0.01, 0.2, 0.25),
        ),
        (
            "in a long coil",
            winding(0.012, 0.019, 1.0),
            core(0.01, -0.505, -0.495),
        ),
        ("a micrometre of air", seed, core(0.011_999, -0.11, 0.0)),
        ("wide of the winding", seed, core(0.0013, -0.07, -0.03)),
        ("ten nanometres out", seed, core(0.012, -0.100_000_01, 1e-8)),
        ("a hair out", seed, core(0.0117, -0.1001, 2.7e-5)),
        ("a hair in", seed, core(0.0117, -0.0999, -2.7e-5)),
        (
            "one layer",
            winding(0.012, 0.0121, 0.1),
            core(0.012, -0.1, 0.0),
        ),
        ("standing out", seed, core(0.012, -0.1, 0.02)),
        ("set back", seed, core(0.012, -0.117, -0.031)),
    ]
}

/// The estimate covers the error; the tolerance is reached; the steel takes up energy.
#[test]
fn extreme_shapes_keep_their_estimate() {
    let finest = Resolution {
        order: 15,
        ratio: 0.2,
        tip: 1e-6,
        quadrature: 1e-13,
    };
    for (name, winding, core) in extreme_shapes() {
        for mu_r in [0.5, 100.0, 1e9] {
            let design = Design {
                winding,
                core,
                mu_r,
            };
            let solved = design.solve(1e-6);
            let fine = CoredCoil::at_resolution(&winding, core, mu_r, &finest)
                .expect("off the winding's edges");
            let error = design.difference(&fine, &solved);
            let estimate = solved.relative_error;
            println!("{name}, mu_r {mu_r:e}: error {error:.1e}, estimate {estimate:.1e}");
            assert!(
                error <= estimate,
                "{name}, mu_r {mu_r:e}: error {error:e}, estimate {estimate:e}"
            );
            assert!(estimate <= 1e-6, "{name}, mu_r {mu_r:e}: {estimate:e}");
            assert!(
                (mu_r - 1.0) * solved.added_inductance_h > 0.0,
                "{name}, mu_r {mu_r:e}: {:e} H",
                solved.added_inductance_h
            );
        }
    }
}

#[test]
fn steel_of_permeability_one_is_air() {
    for design in designs(5) {
        let air = Design {
            mu_r: 1.0,
            ..design
        }
        .solve(1e-6);
        assert_eq!(air.added_inductance_h, 0.0);
        let (r_m, z_m) = (0.7 * design.core.radius_m, design.lowest_m());
        let (with, without) = (
            air.field(r_m, z_m).expect("above"),
            design.winding.field(r_m, z_m).expect("above"),
        );
        assert_eq!(with, without);
    }
}

/// To first order the steel's field is chi times a field of the geometry alone.
#[test]
fn weak_steel_acts_in_proportion_to_its_susceptibility() {
    for design in designs(5) {
        let per_chi = |chi: f64| {
            let mu_r = 1.0 + chi;
            let coil = Design { mu_r, ..design }.solve(1e-8);
            let at = coil
                .core
                .field(0.7 * design.core.radius_m, design.lowest_m());
            let chi = mu_r - 1.0;
            [at.b_z / chi, at.dbz_dz / chi, coil.added_inductance_h / chi]
        };
        let (least, small) = (per_chi(1e-9), per_chi(1e-6));
        for (a, b) in least.iter().zip(&small) {
            assert!((a / b - 1.0).abs() < 2e-6, "{design:?}: {a:e} {b:e}");
        }
    }
}

#[test]
fn very_strong_steel_has_a_limit() {
    for design in designs(5) {
        let at = |mu_r: f64| Design { mu_r, ..design }.solve(1e-7);
        let (strong, stronger) = (at(1e9), at(1e14));
        assert!(design.difference(&strong, &stronger) < 1e-6, "{design:?}");
    }
}

/// A wire of aspect 1000 lets the field through nearly as if it were endless.
#[test]
fn a_long_wire_is_hardly_demagnetised() {
    let wire = Design {
        winding: winding(6e-5, 0.019, 0.1),
        core: core(5e-5, -0.1, 0.0),
        mu_r: 50.0,
    };
    let coil = wire.solve(1e-6);
    let inside = coil.field(1.7e-5, -0.049).expect("in the core").b_z;
    let applied = wire.winding.field(1.7e-5, -0.049).expect("in the bore").b_z;
    assert!((inside / applied / 50.0 - 1.0).abs() < 2e-3, "{inside:e}");
}

/// In the middle of a very long coil the field is uniform: what the core adds is its moment.
#[test]
fn a_short_core_in_a_long_coil_sees_a_uniform_field() {
    let added = |length_m: f64, turns: f64| {
        let middle = -0.5 * length_m;
        let design = Design {
            winding: Winding {
                turns,
                ..winding(0.012, 0.019, length_m)
            },
            core: core(0.01, middle - 0.007, middle + 0.006),
            mu_r: 730.0,
        };
        let applied = design.winding.field(0.0, middle).expect("in the bore").b_z;
        let coil = design.solve(1e-8);
        // L_added = moment times applied B; moment per field and volume is the geometry's alone.
        let volume = design.core.volume_m3();
        coil.added_inductance_h * MU_0_T_M_PER_A / (applied * applied * volume)
    };
    let (long, longer) = (added(1.3, 1000.0), added(4.1, 710.0));
    assert!((long / longer - 1.0).abs() < 1e-6, "{long} {longer}");
    assert!(long > 2.0 && long < 10.0, "{long}");
}

/// Moving the steel to where the field is weaker takes inductance away.
#[test]
fn a_core_drawn_out_of_its_coil_adds_less_and_less() {
    let mut before = f64::INFINITY;
    for lift in [0.0, 0.013, 0.047, 0.11, 0.37, 1.3] {
        let design = Design {
            winding: SEED_COIL,
            core: core(0.012, -0.105 + lift, 0.005 + lift),
            mu_r: 1000.0,
        };
        assert!(design.core.length_m() > 0.0 && SEED_CORE.radius_m == design.core.radius_m);
        let added = design.solve(1e-6).added_inductance_h;
        assert!(added > 0.0 && added < before, "lift {lift}: {added:e}");
        before = added;
    }
}
