//! The magnet as a point dipole (eq. 1, 2, 5).

use fluxform_numerics::dispatch::Lanes;
use std::f64::consts::PI;

/// Moment of a uniformly magnetised cylinder, A m^2.
#[must_use]
pub fn cylinder_moment_a_m2(diameter_m: f64, length_m: f64, magnetization_a_per_m: f64) -> f64 {
    magnetization_a_per_m * PI * 0.25 * diameter_m * diameter_m * length_m
}

/// Force of a dipole `moment_a_m2` in a field of gradient `gradient[i][j] = dB_i/dx_j`, N:
/// F_j = sum_i m_i dB_i/dx_j (eq. 2).
#[must_use]
pub fn force_n(moment_a_m2: [f64; 3], gradient_t_per_m: [[f64; 3]; 3]) -> [f64; 3] {
    std::array::from_fn(|j| {
        (0..3)
            .map(|i| moment_a_m2[i] * gradient_t_per_m[i][j])
            .sum()
    })
}

/// `scale` times n.(x - y) / |x - y|^3 of a dipole n at y, at places x.
#[inline(always)]
pub(crate) fn potential<const FMA: bool>(
    x: [Lanes; 3],
    y: [f64; 3],
    n: [f64; 3],
    scale: f64,
) -> Lanes {
    let d = [x[0] - y[0], x[1] - y[1], x[2] - y[2]];
    let square = d[0].mul_add::<FMA>(d[0], d[1].mul_add::<FMA>(d[1], d[2] * d[2]));
    let along = d[0] * n[0] + d[1] * n[1] + d[2] * n[2];
    along * scale / (square * square.sqrt())
}

/// The moment vector of a magnet whose axis is tilted about x, then about y; `along_z_a_m2`
/// is its component before the tilt.
#[must_use]
pub fn tilted_moment_a_m2(along_z_a_m2: f64, tilt_deg: [f64; 2]) -> [f64; 3] {
    let (sx, cx) = tilt_deg[0].to_radians().sin_cos();
    let (sy, cy) = tilt_deg[1].to_radians().sin_cos();
    // Rotation about x takes z to (0, -sin, cos); rotation about y then turns x and z.
    [
        along_z_a_m2 * sy * cx,
        -along_z_a_m2 * sx,
        along_z_a_m2 * cy * cx,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_seed_magnet() {
        let moment = cylinder_moment_a_m2(0.01, 0.01, 1.1579e6);
        assert!((moment - 0.909_41).abs() < 5e-6);
    }

    #[test]
    fn a_tilt_keeps_the_length() {
        let m = tilted_moment_a_m2(-0.9, [13.0, -27.0]);
        let norm = m.iter().map(|v| v * v).sum::<f64>().sqrt();
        assert!((norm - 0.9).abs() < 1e-15);
        assert_eq!(tilted_moment_a_m2(-0.9, [0.0, 0.0])[2], -0.9);
    }

    #[test]
    fn the_force_is_the_gradient_of_m_dot_b() {
        let gradient = [[0.3, 0.1, -0.2], [0.1, -0.7, 0.5], [-0.2, 0.5, 0.4]];
        let force = force_n([0.2, -0.6, 1.1], gradient);
        let expected = [
            0.2 * 0.3 - 0.6 * 0.1 + 1.1 * -0.2,
            0.2 * 0.1 - 0.6 * -0.7 + 1.1 * 0.5,
            0.2 * -0.2 - 0.6 * 0.5 + 1.1 * 0.4,
        ];
        for (f, e) in force.iter().zip(expected) {
            assert!((f - e).abs() < 1e-15);
        }
    }
}
