//! Self inductance of a winding of rectangular section, for any aspect ratio.
//!
//! Neumann's double integral over the section with the loops' exact mutual inductance M. In
//! the variables t = |a - b|, s = (a + b)/2, u = |z - z'|
//!
//! ```text
//! L = N^2 / (w^2 l^2) int_0^w 2 dt int_0^l 2 (l - u) du int_(a1 + t/2)^(a2 - t/2) M(s + t/2, s - t/2, u) ds
//! ```
//!
//! every term is positive, so nothing cancels, from a thin disc to a long tube. The logarithm
//! at t = u = 0 is moved into one variable by splitting the (t, u) rectangle along its diagonal
//! (Duffy), and smoothed there by a power substitution.

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::ring::Potentials;
use fluxform_field::winding::Winding;
use fluxform_numerics::gauss;

/// Relative error of [`self_inductance_h`]; held by the tests against 20-digit values.
pub const RELATIVE_ERROR: f64 = 1e-12;
const TOLERANCE: f64 = 1e-14;
/// On the first panel xi = x0 eta^3: xi ln xi becomes eta^5 ln eta.
const POWER: i32 = 3;
const POWER_ORDER: usize = 26;
/// Fewest nodes along the diagonal's other variable, for its smooth part.
const SMOOTH_DISTANCE: f64 = 1.0;

/// Self inductance of `winding`, H, to [`RELATIVE_ERROR`].
#[must_use]
pub fn self_inductance_h(winding: &Winding) -> f64 {
    let width = winding.outer_radius_m - winding.inner_radius_m;
    let length = winding.length_m;
    let (a1, a2) = (winding.inner_radius_m, winding.outer_radius_m);

    let mut loops = Potentials::default();
    let mut along_s = |t: f64, u: f64| {
        let (lo, hi) = (a1 + 0.5 * t, a2 - 0.5 * t);
        gauss::graded(lo, hi, 0.5 * t.hypot(u), TOLERANCE, |s, weight| {
            loops.add_mutual([s + 0.5 * t, s - 0.5 * t], [t, u], weight);
        });
        // Over the width as rounded against the radius, for thin sheets.
        4.0 * (length - u) * loops.sum() * ((width - t) / (hi - lo))
    };
    // Beyond u = 2 s the loops see each other as dipoles: the scale along the diagonal.
    let scale = 0.5 * (a1 + a2) / length.max(width);
    let mut total = 0.0;
    for_each_diagonal_node(scale.min(1.0), |xi, weight_xi| {
        // Below the diagonal u = l xi y; above it t = w xi y.
        let near = width.min(a1 + a2) / length;
        gauss::graded(
            0.0,
            1.0,
            near.min(SMOOTH_DISTANCE),
            TOLERANCE,
            |y, weight_y| {
                total += weight_xi * xi * weight_y * along_s(width * xi, length * xi * y);
            },
        );
        let near = length / width;
        gauss::graded(
            0.0,
            1.0,
            near.min(SMOOTH_DISTANCE),
            TOLERANCE,
            |y, weight_y| {
                total += weight_xi * xi * weight_y * along_s(width * xi * y, length * xi);
            },
        );
    });
    let density = winding.turns / (width * length);
    MU_0_T_M_PER_A * density * density * width * length * total
}

/// Nodes on 0..1 for xi ln xi times a function that varies over `scale`.
fn for_each_diagonal_node(scale: f64, mut visit: impl FnMut(f64, f64)) {
    let rule = gauss::rule(POWER_ORDER);
    for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
        let eta = 0.5 * (1.0 + x);
        let slope = f64::from(POWER) * eta.powi(POWER - 1);
        visit(scale * eta.powi(POWER), 0.5 * weight * scale * slope);
    }
    if scale < 1.0 {
        gauss::graded(scale, 1.0, scale, TOLERANCE, visit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn winding(inner: f64, outer: f64, length: f64) -> Winding {
        Winding {
            inner_radius_m: inner,
            outer_radius_m: outer,
            length_m: length,
            turns: 1429.0,
        }
    }

    #[test]
    fn inductance_scales_with_size_and_turns_squared() {
        let base = self_inductance_h(&winding(0.012, 0.019, 0.1));
        let bigger = self_inductance_h(&winding(0.012 * 1.7, 0.019 * 1.7, 0.17));
        assert!((bigger / base / 1.7 - 1.0).abs() < 1e-13);
        let fewer = Winding {
            turns: 1429.0 / 1.3,
            ..winding(0.012, 0.019, 0.1)
        };
        assert!((base / self_inductance_h(&fewer) / 1.69 - 1.0).abs() < 1e-13);
    }

    #[test]
    fn a_long_thin_solenoid_approaches_the_ideal_one() {
        // Lorenz's current sheet: L = mu_0 N^2 pi a^2 / l (1 - 8 a/(3 pi l) + a^2/(2 l^2) ...).
        let (a, length) = (0.01, 10.0);
        let value = self_inductance_h(&winding(a * (1.0 - 1e-7), a * (1.0 + 1e-7), length));
        let x = a / length;
        let ideal = MU_0_T_M_PER_A * 1429.0_f64.powi(2) * std::f64::consts::PI * a * a / length;
        let series = 1.0 - 8.0 * x / (3.0 * std::f64::consts::PI) + 0.5 * x * x;
        assert!(
            (value / (ideal * series) - 1.0).abs() < 1e-6 * x + 2e-7,
            "{}",
            value / ideal
        );
    }
}
