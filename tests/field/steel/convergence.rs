//! How the error falls with the unknowns, and what the stated estimate is worth.

use std::time::Instant;

use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::steel::generatrix::Resolution;

use super::support::{Design, SEED_COIL, SEED_CORE, designs, inductance_difference};

fn at(design: &Design, resolution: &Resolution) -> CoredCoil {
    CoredCoil::at_resolution(&design.winding, design.core, design.mu_r, resolution)
        .expect("off the winding's edges")
}

fn truth(design: &Design) -> CoredCoil {
    at(design, &Resolution::for_tolerance(1e-10))
}

/// Prints nodes, milliseconds, error and estimate: `cargo test --test field steel converges -- --nocapture`.
#[test]
fn converges_geometrically() {
    let seed = Design {
        winding: SEED_COIL,
        core: SEED_CORE,
        mu_r: 1000.0,
    };
    let mut generic = designs(1).remove(0);
    generic.mu_r = 370.0;
    for design in [seed, generic] {
        let truth = truth(&design);
        println!("{design:?}");
        println!("tolerance nodes      ms  error of g  error of L  estimate");
        let mut rows = Vec::new();
        for digits in 2..=8 {
            let tolerance = 10.0_f64.powi(-digits);
            let started = Instant::now();
            let solved = design.solve(tolerance);
            let ms = 1e3 * started.elapsed().as_secs_f64();
            let at_once = at(&design, &Resolution::for_tolerance(tolerance));
            let error = design.difference(&truth, &at_once);
            println!(
                "{tolerance:8.0e} {:6} {ms:7.1}  {:10.1e}  {:10.1e}  {:8.1e}",
                solved.core.outline().nodes.len(),
                design.difference(&truth, &solved),
                inductance_difference(&truth, &solved),
                solved.relative_error,
            );
            rows.push((at_once.core.outline().nodes.len() as f64, error));
        }
        // Two digits asked for are at least one gained ...
        for pair in rows.windows(3) {
            assert!(pair[2].1 < 0.15 * pair[0].1, "{rows:?}");
        }
        // ... so the order seen is above that of any fixed rule that nodes of this number allow.
        let (first, last) = (rows[0], rows[rows.len() - 1]);
        let order = (first.1 / last.1).ln() / (last.0 / first.0).ln();
        println!("observed order {order:.1}");
        assert!(order > 6.0, "observed order {order}");
    }
}

#[test]
fn the_estimate_covers_the_error_and_is_not_idle() {
    let mut ratios = Vec::new();
    for design in designs(24) {
        let truth = truth(&design);
        for tolerance in [1e-3, 1e-5, 1e-7] {
            let solved = design.solve(tolerance);
            let error = design.difference(&truth, &solved);
            let ratio = solved.relative_error / error;
            assert!(
                solved.relative_error <= tolerance,
                "{design:?}: {:e} instead of {tolerance:e}",
                solved.relative_error
            );
            assert!(
                ratio > 1.0,
                "{design:?} at {tolerance:e}: error {error:e}, estimate {:e}",
                solved.relative_error
            );
            ratios.push(ratio);
        }
    }
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    println!(
        "estimate over error: least {:.1}, median {median:.1}, most {:.0}",
        ratios[0],
        ratios[ratios.len() - 1]
    );
    assert!(median < 100.0, "{median}");
}
