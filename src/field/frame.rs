//! From a coil's cylindrical coordinates to the array's Cartesian ones.

use super::winding::AxialField;

/// Field and gradient in Cartesian coordinates, per ampere.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CartesianField {
    /// B_x, B_y, B_z, T/A.
    pub field_t_per_a: [f64; 3],
    /// `[i][j]` = dB_i/dx_j, T/m/A.
    pub gradient_t_per_m_per_a: [[f64; 3]; 3],
}

/// Turns a coil's field at horizontal offset (`dx_m`, `dy_m`) from its axis into Cartesian
/// components. On the axis the direction is immaterial: B_r = 0 and dB_r/dr = B_r/r.
#[must_use]
pub fn to_cartesian(axial: &AxialField, dx_m: f64, dy_m: f64) -> CartesianField {
    let r = dx_m.hypot(dy_m);
    let (c, s) = if r > 0.0 {
        (dx_m / r, dy_m / r)
    } else {
        (1.0, 0.0)
    };
    let difference = axial.dbr_dr - axial.br_over_r;
    let xy = c * s * difference;
    CartesianField {
        field_t_per_a: [c * axial.b_r, s * axial.b_r, axial.b_z],
        gradient_t_per_m_per_a: [
            [axial.br_over_r + c * c * difference, xy, c * axial.dbr_dz],
            [xy, axial.br_over_r + s * s * difference, s * axial.dbr_dz],
            [c * axial.dbz_dr, s * axial.dbz_dr, axial.dbz_dz],
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trace_is_kept_and_the_frame_turns() {
        let axial = AxialField {
            b_r: 0.3,
            b_z: -0.7,
            dbr_dr: 0.4,
            dbr_dz: 0.9,
            dbr_dz_over_r: 0.9 / 1.14,
            dbz_dr: 0.8,
            dbz_dz: -0.55,
            br_over_r: 0.15,
        };
        let (dx, dy) = (0.3, -1.1);
        let field = to_cartesian(&axial, dx, dy);
        let g = field.gradient_t_per_m_per_a;
        assert!((g[0][0] + g[1][1] + g[2][2]).abs() < 1e-15);
        // Along the radial direction the derivative of B is (dBr/dr, dBz/dr).
        let r = f64::hypot(dx, dy);
        let n = [dx / r, dy / r, 0.0];
        let along: Vec<f64> = (0..3)
            .map(|i| (0..3).map(|j| g[i][j] * n[j]).sum())
            .collect();
        assert!((along[0] * n[0] + along[1] * n[1] - 0.4).abs() < 1e-15);
        assert!((along[2] - 0.8).abs() < 1e-15);
    }
}
