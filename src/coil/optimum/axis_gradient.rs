//! |dB_z/dz| of a winding on its axis above it, with exact derivatives, at any distance.
//!
//! Per ampere and over mu_0 J, with b(a, u) = a^2 / (2 (a^2 + u^2)^(3/2)) one loop's field,
//!
//! ```text
//! h = int_a1^a2 D(a) da,   D(a) = b(a, z) - b(a, z + L),
//! dh/da2 = D(a2),   -dh/da1 = D(a1),   dh/dL = E(a2) - E(a1),
//! E(a) = a^3 / (2 u (a^2 + u^2)^(3/2)),   u = z + L.
//! ```
//!
//! D is formed without subtraction, so that a short coil far away keeps all its digits. Every
//! loop below the point contributes with the same sign: h grows with the window.

use super::model::{Sloped, Window};
use fluxform_numerics::gauss;

/// Relative error of the value; the sums have positive terms only.
pub const RELATIVE_ERROR: f64 = 1e-14;
const TOLERANCE: f64 = 1e-15;

/// One loop's field on the axis at the window's top less that at its bottom, over mu_0 I, 1/m:
/// D(a) for a target `z_m` > 0 above the top face.
#[must_use]
pub(crate) fn loop_difference(a_m: f64, z_m: f64, length_m: f64) -> f64 {
    let far = z_m + length_m;
    let (s1, s2) = (a_m.hypot(z_m), a_m.hypot(far));
    // s2^3 - s1^3 = (s2^2 - s1^2) (s1^2 + s1 s2 + s2^2) / (s1 + s2), in ratios that stay in range.
    let (angle, ratio) = (a_m / s1, s1 / s2);
    let closer = (length_m / (s1 + s2)) * ((z_m + far) / s2);
    0.5 * angle * angle * closer * (ratio * ratio + ratio + 1.0) / s1
}

/// dh/dL's primitive E(a) at depth `u_m` = z + L below the target.
fn end_primitive(a_m: f64, u_m: f64) -> f64 {
    let t = a_m / a_m.hypot(u_m);
    0.5 * t * t * t / u_m
}

/// h and its derivatives by inner radius (depth held), depth and length. `z_m` > 0.
#[must_use]
pub(crate) fn axis_gradient(window: &Window, z_m: f64) -> Sloped {
    let (a1, a2) = (window.inner_radius_m, window.outer_radius_m());
    let length = window.length_m;
    let mut value = 0.0;
    gauss::graded(a1, a2, z_m, TOLERANCE, |a, weight| {
        value += weight * loop_difference(a, z_m, length);
    });
    // The depth as rounded against the radius.
    value *= window.depth_m / (a2 - a1);
    let (inner, outer) = (
        loop_difference(a1, z_m, length),
        loop_difference(a2, z_m, length),
    );
    let u = z_m + length;
    Sloped {
        value,
        slope: [
            outer - inner,
            outer,
            end_primitive(a2, u) - end_primitive(a1, u),
            0.0,
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_base::units::MU_0_T_M_PER_A;
    use fluxform_field::winding::Winding;

    fn window(a: f64, w: f64, l: f64) -> Window {
        Window {
            inner_radius_m: a,
            depth_m: w,
            length_m: l,
        }
    }

    #[test]
    fn agrees_with_the_field_kernel() {
        for (a, w, l, z) in [
            (0.012, 0.007, 0.1, 0.03),
            (0.0, 0.7, 0.3, 1.3),
            (0.4, 0.01, 2.3, 0.05),
            (0.01, 0.02, 0.03, 70.0),
        ] {
            let source = Winding {
                inner_radius_m: a,
                outer_radius_m: a + w,
                length_m: l,
                turns: w * l,
            };
            let field = source.field(0.0, z).expect("above the winding");
            let value = axis_gradient(&window(a, w, l), z).value * MU_0_T_M_PER_A;
            let error = value / field.dbz_dz.abs() - 1.0;
            assert!(error.abs() < 1e-12, "{a} {w} {l} {z}: {error:e}");
        }
    }

    #[test]
    fn taylor_test_of_the_slopes() {
        for (a, w, l, z) in [(0.012, 0.007, 0.1, 0.03), (0.7, 1.9, 0.4, 0.3)] {
            let base = axis_gradient(&window(a, w, l), z);
            for i in 0..3 {
                let remainder = |h: f64| {
                    let mut x = [a, w, l];
                    let step = h * x[i];
                    x[i] += step;
                    let moved = axis_gradient(&window(x[0], x[1], x[2]), z).value;
                    (moved - base.value - step * base.slope[i]).abs()
                };
                let order = (remainder(1e-3) / remainder(1e-4)).log10();
                assert!((order - 2.0).abs() < 0.05, "{i}: {order}");
            }
        }
    }
}
