//! Legendre functions of half-odd degree, Q_(m-1/2)(chi): the azimuthal modes of 1/distance.
//!
//! With D^2 = 2 r r' (chi - cos psi) between two rings,
//!
//! ```text
//! int_0^2pi cos(m psi) (chi - cos psi)^(-1/2) dpsi = 2 sqrt(2) Q_(m-1/2)(chi),
//! (chi^2 - 1) Q'_(m-1/2) = (m - 1/2) (chi Q_(m-1/2) - Q_(m-3/2)),
//! ```
//!
//! DLMF 14.10.5 and 14.19(v). One arithmetic-geometric mean gives m = 0 and 1; the others follow
//! by the three-term recurrence, upwards where that is stable and else downwards (Miller).

use std::f64::consts::{PI, SQRT_2};

/// Relative size of the mean's last correction at which it stops: the next is its square.
const STOP: f64 = 1e-9;
/// Upward recurrence loses exp(2 m eta), cosh(eta) = chi: allowed up to this exponent.
const UPWARD: f64 = 2.0;

/// The two azimuthal integrals of every mode m < `inverse.len()`:
/// `inverse[m]` = int cos(m psi) (chi - cos psi)^(-1/2) dpsi and
/// `cubed[m]` = int cos(m psi) (chi - cos psi)^(-3/2) dpsi.
///
/// `excess` is chi - 1 > 0, which the caller knows without cancellation.
/// Relative error of either below 1e-13 of mode 0's.
pub fn azimuthal_integrals(excess: f64, inverse: &mut [f64], cubed: &mut [f64]) {
    let chi = 1.0 + excess;
    let (s, d) = ((2.0 * excess + 4.0).sqrt(), (2.0 * excess).sqrt());
    let (mut mean, mut geometric) = (0.5 * (s + d), (s * d).sqrt());
    let mut c = 2.0 / (s + d);
    let mut sum = c * c;
    let mut weight = 1.0;
    while c > STOP * mean {
        let next = 0.5 * (mean + geometric);
        geometric = (mean * geometric).sqrt();
        mean = next;
        c = c * c / (4.0 * mean);
        weight *= 2.0;
        sum += weight * c * c;
    }
    let mean = 0.5 * (mean + geometric);
    let q_0 = PI / mean;
    let q_1 = 0.5 * q_0 * sum;
    let below = 1.0 / (excess * (excess + 2.0));

    let modes = inverse.len();
    inverse[0] = 2.0 * SQRT_2 * q_0;
    // chi Q_0 - Q_1 = (pi / M) (chi - sum / 2).
    cubed[0] = 2.0 * SQRT_2 * q_0 * (chi - 0.5 * sum) * below;
    if modes == 1 {
        return;
    }
    fill_modes(chi, excess, q_0, q_1, inverse);
    for m in 1..modes {
        let nu = m as f64 - 0.5;
        cubed[m] = -2.0 * nu * (chi * inverse[m] - inverse[m - 1]) * below;
    }
}

/// 2 sqrt(2) Q_(m-1/2) for every m.
fn fill_modes(chi: f64, excess: f64, q_0: f64, q_1: f64, out: &mut [f64]) {
    let top = out.len() - 1;
    let eta = (excess + (excess * (excess + 2.0)).sqrt()).ln_1p();
    if top <= 1 || 2.0 * eta * top as f64 <= UPWARD {
        let (mut before, mut value) = (2.0 * SQRT_2 * q_0, 2.0 * SQRT_2 * q_1);
        for (m, slot) in out.iter_mut().enumerate().skip(1) {
            *slot = value;
            let m = m as f64;
            let next = (2.0 * m * chi * value - (m - 0.5) * before) / (m + 0.5);
            (before, value) = (value, next);
        }
        return;
    }
    // Downwards from where the start's error has died out.
    let start = top + 2 + (20.0 / eta) as usize;
    let (mut above, mut value) = (0.0, f64::MIN_POSITIVE / f64::EPSILON);
    for m in (1..=start).rev() {
        if m <= top {
            out[m] = value;
        }
        let k = m as f64;
        let next = (2.0 * k * chi * value - (k + 0.5) * above) / (k - 0.5);
        (above, value) = (value, next);
        if value > 1e200 {
            above *= 1e-200;
            value *= 1e-200;
            for slot in out.iter_mut().skip(m) {
                *slot *= 1e-200;
            }
        }
    }
    let scale = 2.0 * SQRT_2 * q_0 / value;
    for slot in out.iter_mut().skip(1) {
        *slot *= scale;
    }
}
