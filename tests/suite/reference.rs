//! Values to compare with, by formulas that the program does not use.

use fluxform::field::winding::Winding;
use fluxform::numerics::double_double::DoubleDouble as Num;
use fluxform::numerics::gauss;
use fluxform::units::MU_0_T_M_PER_A;

/// Angles of the circle's trapezoidal rule.
const ANGLES: usize = 192;
/// Radial nodes.
const NODES: usize = 40;

/// dB_z/dz and dB_r/dz per ampere above a winding, T/m/A, without elliptic integrals: the law of
/// Biot and Savart around every loop of both end faces,
///
/// ```text
/// b_z = 1/(4 pi) int a (a - r cos t) / (a^2 + r^2 + u^2 - 2 a r cos t)^(3/2) dt
/// b_r = 1/(4 pi) int a u cos t       / (a^2 + r^2 + u^2 - 2 a r cos t)^(3/2) dt
/// ```
///
/// by the trapezoidal rule, which converges like exp(-n acosh((a^2 + r^2 + u^2) / (2 a r))), and
/// Gauss-Legendre over the radius; sums in double-double, so that the faces' difference keeps its
/// digits. Domain: `z_m` from half the inner radius up. Error: the nodes' rounding, 1e-15 of
/// |grad B|; [`AXIAL_ERROR`] is what the tests hold.
#[must_use]
pub fn axial_gradient(winding: &Winding, r_m: f64, z_m: f64) -> [f64; 2] {
    let near = face(winding, r_m, z_m);
    let far = face(winding, r_m, z_m + winding.length_m);
    let scale = MU_0_T_M_PER_A * winding.current_density_per_m2();
    [0, 1].map(|k| scale * (far[k] - near[k]).nearest())
}

/// Error of [`axial_gradient`], relative to |grad B|.
pub const AXIAL_ERROR: f64 = 1e-14;

fn face(winding: &Winding, r_m: f64, u_m: f64) -> [Num; 2] {
    let rule = gauss::rule(NODES);
    let (centre, half) = (
        0.5 * (winding.inner_radius_m + winding.outer_radius_m),
        0.5 * (winding.outer_radius_m - winding.inner_radius_m),
    );
    let n = Num::exactly;
    let (r, u) = (n(r_m), n(u_m));
    let mut sums = [n(0.0); 2];
    for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
        let a = n(centre + half * x);
        let square = a * a + r * r + u * u;
        let (mut axial, mut radial) = (n(0.0), n(0.0));
        for k in 0..ANGLES {
            let angle = std::f64::consts::TAU * (k as f64 + 0.5) / ANGLES as f64;
            let cosine = n(angle.cos());
            let below = square - n(2.0) * a * r * cosine;
            let cube = below * below.square_root();
            axial += (a - r * cosine) / cube;
            radial += u * cosine / cube;
        }
        let share = a * n(weight * half / (2.0 * ANGLES as f64));
        sums[0] += share * axial;
        sums[1] += share * radial;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_law_of_biot_and_savart_gives_what_the_elliptic_integrals_give() {
        let winding = Winding {
            inner_radius_m: 0.0123,
            outer_radius_m: 0.0191,
            length_m: 0.097,
            turns: 1317.0,
        };
        for (r_m, z_m) in [
            (0.0, 0.0301),
            (0.0137, 0.0103),
            (0.0511, 0.0207),
            (0.09, 0.08),
        ] {
            let field = winding.field(r_m, z_m).unwrap();
            let [dbz_dz, dbr_dz] = axial_gradient(&winding, r_m, z_m);
            let size = field.gradient_norm();
            assert!(
                (dbz_dz - field.dbz_dz).abs() < AXIAL_ERROR * size,
                "{r_m} {z_m}"
            );
            assert!(
                (dbr_dz - field.dbr_dz).abs() < AXIAL_ERROR * size,
                "{r_m} {z_m}"
            );
        }
    }
}
