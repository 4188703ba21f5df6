//! The Bessel functions J_0 and J_1, together.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// From here on Hankel's expansion reaches rounding: its smallest term is of the size exp(-2 x).
const FAR: f64 = 25.0;
/// Below this two terms of the power series do.
const NEAR: f64 = 1e-3;

/// J_0 and J_1 at `x` >= 0, each to an absolute error of 1e-15.
///
/// Miller's backward recurrence below 25, Hankel's expansion above (DLMF 10.74(iv), 10.17(i)).
#[must_use]
pub fn j0_j1(x: f64) -> [f64; 2] {
    if x < NEAR {
        let quarter = 0.25 * x * x;
        return [
            1.0 - quarter * (1.0 - 0.25 * quarter),
            0.5 * x * (1.0 - 0.5 * quarter),
        ];
    }
    if x < FAR { miller(x) } else { hankel(x) }
}

/// Downwards from an order where J is negligible, scaled by 1 = J_0 + 2 J_2 + 2 J_4 + ...
fn miller(x: f64) -> [f64; 2] {
    let top = 2 * (22 + (0.6 * x) as u32);
    let (mut above, mut here) = (0.0, 1e-280);
    let mut sum = 2.0 * here;
    for order in (1..=top).rev() {
        let below = 2.0 * f64::from(order) / x * here - above;
        (above, here) = (here, below);
        if order % 2 == 1 {
            sum += if order == 1 { here } else { 2.0 * here };
        }
    }
    [here / sum, above / sum]
}

fn hankel(x: f64) -> [f64; 2] {
    let scale = (2.0 / (PI * x)).sqrt() * FRAC_1_SQRT_2;
    let (sin, cos) = x.sin_cos();
    let [p0, q0] = hankel_sums(0.0, x);
    let [p1, q1] = hankel_sums(4.0, x);
    // The phases are x - pi/4 and x - 3 pi/4.
    [
        scale * (p0 * (cos + sin) - q0 * (sin - cos)),
        scale * (p1 * (sin - cos) + q1 * (cos + sin)),
    ]
}

/// P and Q for 4 nu^2 = `mu`.
fn hankel_sums(mu: f64, x: f64) -> [f64; 2] {
    let mut sums = [1.0, 0.0];
    let mut term = 1.0_f64;
    for k in 1..60_u32 {
        let odd = f64::from(2 * k - 1);
        term *= (mu - odd * odd) / (8.0 * f64::from(k) * x);
        // The signs run + + - - over P, Q, P, Q.
        sums[(k % 2) as usize] += if k % 4 < 2 { term } else { -term };
        if term.abs() < f64::EPSILON * 1e-2 {
            break;
        }
    }
    sums
}

/// The zero of J_1 with number `index` from 1 on: 3.83, 7.02, ...
///
/// McMahon's expansion (DLMF 10.21(vi)) and Newton's method.
#[must_use]
pub fn zero_of_j1(index: u32) -> f64 {
    let b = (f64::from(index) + 0.25) * PI;
    let mut x = b - 0.375 / b + 0.0234375 / (b * b * b);
    for _ in 0..3 {
        let [j0, j1] = j0_j1(x);
        x -= j1 / (j0 - j1 / x);
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

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
        for (x, one, other) in [
            (NEAR, j0_j1(NEAR * (1.0 - 1e-15)), miller(NEAR)),
            (FAR, miller(FAR), hankel(FAR)),
        ] {
            assert!(
                (one[0] - other[0]).abs() < 1e-15 && (one[1] - other[1]).abs() < 1e-15,
                "{x}: {one:?} {other:?}"
            );
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
}
