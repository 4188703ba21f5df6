//! J_0, J_1 and the zeros of J_1, against values of 30 digits and where one method takes over from another.

use fluxform_numerics::bessel::{j0_j1, zero_of_j1};
use std::f64::consts::PI;

/// (x, J_0, J_1): the doubles nearest `besselj(n, x)` of mpmath 1.3 at 30 digits.
const VALUES: &[(f64, f64, f64)] = &[
    (1e-9, 1.0, 5e-10),
    (0.0007, 0.9999998775000037, 0.00034999997856250043),
    (0.0013, 0.9999995775000446, 0.0006499998626875096),
    (0.37, 0.966066726438513, 0.1818521944063313),
    (1.3, 0.6200859895615091, 0.5220232474146604),
    (2.404, 0.00042865974491466984, 0.5193256007917423),
    (3.83, -0.4027588095334348, 0.000687248220597037),
    (7.7, 0.23455913958646438, 0.181312715324588),
    (13.1, 0.21288819752206037, -0.04885247333422378),
    (24.9, 0.0832459683530155, -0.13485569953140886),
    (25.1, 0.10827567149994945, -0.11463478413442257),
    (61.7, -0.03468510612812872, -0.09575456271106458),
    (700.3, -0.014720428163750597, 0.026302534845541667),
    (123456.7, -0.0016644830258065926, -0.0015447138905300933),
];

#[test]
fn agrees_with_mpmath() {
    for &(x, j0, j1) in VALUES {
        let found = j0_j1(x);
        assert!((found[0] - j0).abs() < 1e-15, "{x}: {} {j0}", found[0]);
        assert!(
            (found[1] - j1).abs() < 1e-15 * j1.abs().max(x.min(1.0)),
            "{x}: {} {j1}",
            found[1]
        );
    }
}

#[test]
fn the_methods_meet() {
    // Another method on either side of each place.
    for x in [1e-3, 25.0_f64] {
        let below = x.next_down();
        let (one, other) = (j0_j1(below), j0_j1(x));
        // J_0' = -J_1, J_1' = J_0 - J_1 / x.
        let slopes = [-other[1], other[0] - other[1] / x];
        for n in 0..2 {
            let off = other[n] - one[n] - slopes[n] * (x - below);
            assert!(off.abs() < 1e-15, "J_{n} at {x}: {off:e}");
        }
    }
}

#[test]
fn zeros_are_zeros() {
    assert!((zero_of_j1(1) - 3.831_705_970_207_512).abs() < 1e-15 * 4.0);
    for index in [1, 2, 7, 8, 9, 131, 90_001] {
        let x = zero_of_j1(index);
        let [j0, j1] = j0_j1(x);
        assert!(
            j1.abs() < 4.0 * f64::EPSILON * x * j0.abs(),
            "{index}: {j1:e}"
        );
        assert!((x - (f64::from(index) + 0.25) * PI).abs() < 0.1);
    }
}
