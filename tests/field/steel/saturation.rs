//! The stated errors of coils along a magnetisation curve against far finer solutions.

use super::claims::{covered, random_cores};
use super::support::{Design, SEED_COIL, SEED_CORE};
use fluxform_coil::inductance::self_inductance_h;
use fluxform_field::steel::bh_curve::BhCurve;
use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::steel::generatrix::Resolution;
use fluxform_field::steel::saturated_coil::CoilWithCurve;
use fluxform_testing::Random;
use fluxform_testing::random_of_study;
use rayon::prelude::*;

const SEED: u64 = 20_261_123;

/// The committed table, one of cobalt-iron that ends high, and a coarse one whose kinks are sharp.
pub fn curves() -> Vec<BhCurve> {
    let text = include_str!("../../../designs/steel_1010.csv");
    let (b_t, h): (Vec<f64>, Vec<f64>) = text
        .lines()
        .skip(1)
        .map(|line| {
            let (b, h) = line.split_once(',').expect("two columns");
            let number = |text: &str| text.trim().parse::<f64>().expect("a number");
            (number(b), number(h))
        })
        .unzip();
    let table = |b: &[f64], h: &[f64]| BhCurve::new(b, h).expect("a good curve");
    vec![
        table(&b_t, &h),
        table(
            &[0.0, 0.5, 1.0, 1.5, 1.8, 2.0, 2.2, 2.3, 2.35],
            &[0.0, 60.0, 110.0, 230.0, 700.0, 2.2e3, 1.1e4, 3.2e4, 7e4],
        ),
        table(
            &[0.0, 0.4, 0.7, 1.3, 1.6, 1.9],
            &[0.0, 70.0, 130.0, 700.0, 5100.0, 31e3],
        ),
    ]
}

struct Case {
    design: Design,
    curve: BhCurve,
    current_a: f64,
}

/// The seed's coil and random ones, the steel from far below its knee to far above it.
fn cases(mut random: Random, count: usize) -> Vec<Case> {
    let curves = curves();
    let seed = Design {
        winding: SEED_COIL,
        core: SEED_CORE,
        mu_r: 1.0,
    };
    let mut cases: Vec<Case> = [2.0, 4.0, 4.9, 5.6, 6.0, 8.0]
        .map(|current_a| Case {
            design: seed,
            curve: curves[0].clone(),
            current_a,
        })
        .into();
    let of_cores = Random::new(random.bits());
    for design in random_cores(of_cores, count) {
        // Ampere turns over the length drive 10 to 1000 kA/m.
        let field = random.decades(1e4, 1e6);
        cases.push(Case {
            design,
            curve: curves[random.between(0.0, 3.0) as usize].clone(),
            current_a: field * design.winding.length_m / design.winding.turns,
        });
    }
    cases
}

/// Claimed and true relative errors at every tolerance: of gradient and flux, of the peak.
fn errors<const N: usize>(case: &Case, tolerances: [f64; N]) -> [[(f64, f64); 3]; N] {
    let winding = &case.design.winding;
    let coil = CoilWithCurve {
        winding,
        air_inductance_h: self_inductance_h(winding),
        shape: case.design.core,
        law: &case.curve,
    };
    let lowest_m = case.design.lowest_m();
    // Shorter panels of a higher degree: nothing of the solver's own sequence.
    let finest = Resolution {
        order: 7,
        ratio: 0.5,
        tip: 1e-3,
        quadrature: 1e-9,
    };
    let truth = coil
        .at_resolution(case.current_a, &finest)
        .expect("a state of the steel");
    tolerances.map(|tolerance| {
        let found = coil
            .solve(case.current_a, tolerance, lowest_m)
            .expect("a state of the steel");
        let off = coil.difference(&truth, &found, lowest_m).expect("above");
        let (a, b) = (&found.inside, &truth.inside);
        [
            (found.relative_error, off),
            (found.peak_error, (a.peak_b_t / b.peak_b_t - 1.0).abs()),
            (found.mean_error, (a.mean_b_t / b.mean_b_t - 1.0).abs()),
        ]
    })
}

fn study<const N: usize>(cases: &[Case], tolerances: [f64; N]) {
    let errors: Vec<_> = cases
        .par_iter()
        .map(|case| errors(case, tolerances))
        .collect();
    let mut missed = 0;
    for (case, errors) in cases.iter().zip(&errors) {
        if errors.iter().flatten().any(|(claim, off)| claim < off) {
            let Case {
                design, current_a, ..
            } = case;
            println!("{errors:?}: {current_a} A, {design:?}");
        }
    }
    for (k, tolerance) in tolerances.iter().enumerate() {
        for (quantity, what) in ["gradient and flux", "peak |B|", "mean |B|"]
            .iter()
            .enumerate()
        {
            let of: Vec<_> = errors.iter().map(|errors| errors[k][quantity]).collect();
            missed += covered(&format!("{tolerance:e}, {what}"), &of);
        }
    }
    assert_eq!(missed, 0);
}

/// The small version of the study below.
#[test]
fn claims_hold_along_curves() {
    study(&cases(Random::new(SEED), 0)[2..5], [1e-4]);
}

/// `cargo test --test field steel -- --ignored --nocapture along_curves_in_full` prints the table;
/// with `FLUXFORM_SEED=<number>` of other states.
#[test]
#[ignore = "minutes of CPU: 42 states of the steel"]
fn claims_hold_along_curves_in_full() {
    study(&cases(random_of_study(SEED), 36), [1e-4]);
}

/// The linear core in the place of one along a curve: another solver has its gradient, and what is left of the curve's
/// is stated.
#[test]
fn the_linear_core_of_a_curve_has_its_gradient_at_one_height() {
    const TARGET_M: f64 = 0.03;
    let curve = &curves()[0];
    let coil = CoilWithCurve {
        winding: &SEED_COIL,
        air_inductance_h: self_inductance_h(&SEED_COIL),
        shape: SEED_CORE,
        law: curve,
    };
    for current_a in [1.0, 6.0, 20.0] {
        let state = coil.solve(current_a, 1e-4, 0.0).expect("a state");
        let first = curve.relative_permeability(state.inside.mean_b_t);
        let linear = |first: f64| {
            coil.linear_equivalent(&state, first, TARGET_M)
                .expect("above the winding")
        };
        let found = linear(first);
        let mu_r = found.relative_permeability;
        let again = linear(20.0 * first).relative_permeability;
        assert!((again / mu_r - 1.0).abs() < 1e-3, "{mu_r} {again}");
        let core = CoredCoil::new(&SEED_COIL, SEED_CORE, mu_r, 1e-6, 0.001).expect("above");
        // The largest difference at a height, relative to the largest gradient there.
        let off = |across_m: &[f64], z_m: f64| {
            let (mut size, mut most) = (0.0_f64, 0.0_f64);
            for r_m in across_m {
                let air = SEED_COIL.field(*r_m, z_m).expect("above");
                let along = air + state.layer.field(*r_m, z_m);
                let linear = core.field(*r_m, z_m).expect("above");
                size = size.max(along.gradient_norm());
                most = most.max((along.dbz_dz - linear.dbz_dz).abs());
                most = most.max((along.dbr_dz - linear.dbr_dz).abs());
            }
            most / size
        };
        let at_target = off(&[0.0], TARGET_M);
        assert!(at_target < 1e-5, "{current_a} A: {at_target:e}");
        for z_m in [0.002, 0.004, 0.013, 0.03, 0.06, 0.2] {
            let worst = off(&[0.0, 0.004, 0.009, 0.012, 0.018], z_m);
            let stated = found.gradient.largest_from(z_m);
            assert!(
                worst <= stated,
                "{current_a} A, {z_m} m: {worst:e} {stated:e}"
            );
        }
        assert!(found.gradient.largest_from(0.01) < found.gradient.largest_from(0.0));
        let flux = (core.added_inductance_h - state.added_inductance_h).abs();
        let flux = flux / (coil.air_inductance_h + state.added_inductance_h);
        assert!(flux <= found.flux_error, "{flux:e} {}", found.flux_error);
    }
}
