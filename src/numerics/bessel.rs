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
