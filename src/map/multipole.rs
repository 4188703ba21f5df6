//! Axisymmetric point multipoles: field and gradient outside a point, of every order.
//!
//! A source at x_s with direction d has terms of order n = 1, 2, ...; a term of coefficient 1 has
//! the scalar potential P_n(cos t) / r^(n+1), r = |x - x_s|, cos t = d.(x - x_s) / r, and the
//! field B = -grad of it, in T where lengths are in m. With w = r cos t and p the part of x - x_s
//! across d, the derivatives are (phi = phi_n)
//! `dphi/dw = -(n+1) phi_(n+1)` and `((1/p) d/dp)^k phi = (-1)^k P_(n+k)^((k)) / r^(n+1+2k)`,
//! so that field and gradient come from the Legendre polynomials and their first two derivatives.

/// Independent numbers of field and gradient: B_x, B_y, B_z, then dB_x/dx, dB_x/dy, dB_x/dz,
/// dB_y/dy, dB_y/dz.
pub const PARTS: usize = 8;

/// A point with a direction, to which terms of every order may belong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Source {
    /// Where, m.
    pub position_m: [f64; 3],
    /// Unit vector.
    pub direction: [f64; 3],
    /// Orders 1 to this one.
    pub orders: usize,
}

impl Source {
    /// Field (T) and gradient (T/m) at `point_m` of each term of coefficient 1, the first of
    /// order 1, handed to `visit` with the term's index. The point must not be the source's own.
    pub fn terms(&self, point_m: [f64; 3], mut visit: impl FnMut(usize, [f64; PARTS])) {
        let d = self.direction;
        let offset: [f64; 3] = std::array::from_fn(|i| point_m[i] - self.position_m[i]);
        let w: f64 = (0..3).map(|i| d[i] * offset[i]).sum();
        let r = offset[0].hypot(offset[1]).hypot(offset[2]);
        let (u, inverse) = (w / r, 1.0 / r);
        let p: [f64; 3] = std::array::from_fn(|i| offset[i] - w * d[i]);
        // P_n and its first two derivatives in u for n - 1 and n, from n = 1 on.
        let (mut below, mut at) = ([1.0, 0.0, 0.0], [u, 1.0, 0.0]);
        let mut rise = |n: usize| {
            let n = n as f64;
            let odd = 2.0 * n + 1.0;
            let next = [
                (odd * u * at[0] - n * below[0]) / (n + 1.0),
                below[1] + odd * at[0],
                below[2] + odd * at[1],
            ];
            (below, at) = (at, next);
            next
        };
        let mut first = rise(1);
        let mut power = inverse * inverse * inverse;
        for n in 1..=self.orders {
            let second = rise(n + 1);
            // 1 / r^(n+2), and n + 1, n + 2 of the derivatives along d.
            let (n1, n2) = ((n + 1) as f64, (n + 2) as f64);
            let across = -first[1] * power * inverse;
            let along = -n1 * first[0] * power;
            let along_along = n1 * n2 * second[0] * power * inverse;
            let along_across = n1 * second[1] * power * inverse * inverse;
            let across_across = second[2] * power * inverse * inverse * inverse;
            let field = |i: usize| -(along * d[i] + across * p[i]);
            let gradient = |i: usize, j: usize| {
                let same = if i == j { 1.0 } else { 0.0 };
                -(along_along * d[i] * d[j]
                    + along_across * (p[i] * d[j] + d[i] * p[j])
                    + across * (same - d[i] * d[j])
                    + across_across * p[i] * p[j])
            };
            visit(
                n - 1,
                [
                    field(0),
                    field(1),
                    field(2),
                    gradient(0, 0),
                    gradient(0, 1),
                    gradient(0, 2),
                    gradient(1, 1),
                    gradient(1, 2),
                ],
            );
            first = second;
            power *= inverse;
        }
    }
}

/// Length of the field and Frobenius norm of the gradient.
#[must_use]
pub fn magnitudes(parts: &[f64; PARTS]) -> [f64; 2] {
    let [bx, by, bz, xx, xy, xz, yy, yz] = *parts;
    let zz = xx + yy;
    [
        (bx * bx + by * by + bz * bz).sqrt(),
        (xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)).sqrt(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: Source = Source {
        position_m: [0.7, -0.2, 0.4],
        direction: [0.36, 0.48, -0.8],
        orders: 6,
    };

    fn potential(point: [f64; 3], n: usize) -> f64 {
        let offset: [f64; 3] = std::array::from_fn(|i| point[i] - SOURCE.position_m[i]);
        let r = offset.iter().map(|x| x * x).sum::<f64>().sqrt();
        let u = (0..3).map(|i| offset[i] * SOURCE.direction[i]).sum::<f64>() / r;
        let (mut below, mut at) = (1.0, u);
        for k in 1..n {
            let k = k as f64;
            (below, at) = (at, ((2.0 * k + 1.0) * u * at - k * below) / (k + 1.0));
        }
        at / r.powi(n as i32 + 1)
    }

    fn parts(point: [f64; 3]) -> Vec<[f64; PARTS]> {
        let mut out = Vec::new();
        SOURCE.terms(point, |_, values| out.push(values));
        out
    }

    #[test]
    fn field_is_minus_the_potential_s_slope_and_the_gradient_the_field_s() {
        let at = [1.3, 0.55, -0.35];
        let h = 1e-5;
        let moved = |axis: usize, by: f64| {
            let mut point = at;
            point[axis] += by;
            point
        };
        for (order, values) in parts(at).into_iter().enumerate() {
            let size = magnitudes(&values);
            for axis in 0..3 {
                let slope = (potential(moved(axis, h), order + 1)
                    - potential(moved(axis, -h), order + 1))
                    / (2.0 * h);
                assert!((values[axis] + slope).abs() < 1e-8 * size[0], "{order}");
                let (ahead, behind) = (parts(moved(axis, h)), parts(moved(axis, -h)));
                let tensor = [[3, 4, 5], [4, 6, 7]];
                for (i, row) in tensor.iter().enumerate() {
                    let slope = (ahead[order][i] - behind[order][i]) / (2.0 * h);
                    assert!(
                        (values[row[axis]] - slope).abs() < 1e-7 * size[1],
                        "{order}"
                    );
                }
                // The third row: dB_z/dz closes the divergence.
                let slope = (ahead[order][2] - behind[order][2]) / (2.0 * h);
                let want = [values[5], values[7], -values[3] - values[6]][axis];
                assert!((want - slope).abs() < 1e-7 * size[1], "{order}");
            }
        }
    }

    #[test]
    fn on_the_axis_a_term_falls_with_its_order() {
        let r = 0.3;
        let at = std::array::from_fn(|i| SOURCE.position_m[i] + r * SOURCE.direction[i]);
        for (index, values) in parts(at).into_iter().enumerate() {
            let n = index as i32 + 1;
            let along: f64 = (0..3).map(|i| values[i] * SOURCE.direction[i]).sum();
            let want = f64::from(n + 1) / r.powi(n + 2);
            assert!((along / want - 1.0).abs() < 1e-12, "{n}");
        }
    }
}
