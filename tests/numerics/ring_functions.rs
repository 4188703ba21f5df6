//! Integrals over the azimuth between rings, against sums over it and their limits close and far.

use fluxform_numerics::ring_functions::azimuthal_integrals;
use std::f64::consts::{PI, SQRT_2};

fn by_azimuth(chi: f64, m: usize) -> (f64, f64) {
    let n = 20_000;
    let mut sums = (0.0, 0.0);
    for k in 0..n {
        let psi = 2.0 * PI * (k as f64 + 0.5) / n as f64;
        let distance = chi - psi.cos();
        let mode = (m as f64 * psi).cos() * 2.0 * PI / n as f64;
        sums.0 += mode / distance.sqrt();
        sums.1 += mode / (distance * distance.sqrt());
    }
    sums
}

#[test]
fn agree_with_the_integrals_over_the_azimuth() {
    for chi in [1.0003, 1.02, 1.3, 2.7, 40.0, 5000.0] {
        let (mut inverse, mut cubed) = ([0.0; 10], [0.0; 10]);
        azimuthal_integrals(chi - 1.0, &mut inverse, &mut cubed);
        for m in 0..10 {
            let (a, b) = by_azimuth(chi, m);
            assert!(
                (inverse[m] - a).abs() < 1e-12 * inverse[0],
                "{chi} {m}: {} {a}",
                inverse[m]
            );
            assert!(
                (cubed[m] - b).abs() < 1e-11 * cubed[0],
                "{chi} {m}: {} {b}",
                cubed[m]
            );
        }
    }
}

#[test]
fn close_rings_have_the_singularity_of_a_line() {
    // int (chi - cos psi)^(-3/2) -> 2 sqrt(2) / (chi - 1) for every mode.
    for excess in [1e-9, 1e-13] {
        let (mut inverse, mut cubed) = ([0.0; 4], [0.0; 4]);
        azimuthal_integrals(excess, &mut inverse, &mut cubed);
        for value in cubed {
            assert!((value * excess / (2.0 * SQRT_2) - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn far_rings_decay_like_their_order() {
    // Q_(m-1/2) ~ chi^(-m-1/2): the ratio of neighbours tends to (m + 1/2) / (2 (m+1) chi).
    let chi = 3e5;
    let (mut inverse, mut cubed) = ([0.0; 6], [0.0; 6]);
    azimuthal_integrals(chi - 1.0, &mut inverse, &mut cubed);
    for m in 0..5 {
        let expected = (m as f64 + 0.5) / (2.0 * (m as f64 + 1.0) * chi);
        let expected = if m == 0 { 0.25 / chi } else { expected };
        assert!(
            (inverse[m + 1] / inverse[m] / expected - 1.0).abs() < 1e-8,
            "{m}"
        );
        assert!(cubed[m] > 0.0);
    }
}
