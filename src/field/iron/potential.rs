//! The scalar potential of a winding where its field has no curl, cut along the bore.
//!
//! A winding is a stack of magnetised discs: M = N / L up to the inner radius, falling to nothing at
//! the outer. Their charges on the two faces give phi, and in the bore the turns passed below:
//!
//! ```text
//! phi(r, z) = f(r, z) - f(r, z + L),  f(r, u) = int s(a) a / (2 agm(|(a + r, u)|, |(a - r, u)|)) da.
//! ```

use crate::winding::Winding;
use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes};
use fluxform_numerics::gauss;

/// How a place is reached from below the winding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Branch {
    /// Round the winding.
    Outside,
    /// In the bore.
    Bore,
    /// Up through the bore, and on.
    Above,
}

impl Winding {
    /// phi with H = -grad phi outside the winding, A per ampere, at radius `r_m` and height `z_m`, to
    /// `tolerance` of a face's; it jumps by the turns where the bore is crossed.
    #[must_use]
    pub fn potential(&self, r_m: f64, z_m: f64, branch: Branch, tolerance: f64) -> f64 {
        let height = ((z_m + self.length_m) / self.length_m).clamp(0.0, 1.0);
        let passed = match branch {
            Branch::Outside => 0.0,
            Branch::Bore => self.turns * height,
            Branch::Above => self.turns,
        };
        let mut rings = Rings::default();
        self.add_charged_face([r_m, z_m], 1.0, tolerance, &mut rings);
        self.add_charged_face([r_m, z_m + self.length_m], -1.0, tolerance, &mut rings);
        dispatch::run(rings) - passed
    }

    /// f above, times `sign`.
    fn add_charged_face(&self, [r_m, u_m]: [f64; 2], sign: f64, tolerance: f64, rings: &mut Rings) {
        let (inner, outer) = (self.inner_radius_m, self.outer_radius_m);
        let full = sign * self.turns / self.length_m;
        for [from, to] in [[0.0, inner], [inner, outer]] {
            if to <= from {
                continue;
            }
            gauss::graded(from - r_m, to - r_m, u_m, tolerance, |offset, weight| {
                let a = r_m + offset;
                let density = full * ((outer - a) / (outer - inner)).clamp(0.0, 1.0);
                rings.farthest2_m2.push((a + r_m) * (a + r_m) + u_m * u_m);
                rings.nearest2_m2.push(offset * offset + u_m * u_m);
                rings.weights.push(0.5 * weight * density * a);
            });
        }
    }
}

/// Charged rings: squares of their farthest and nearest distance, and what is divided by the arithmetic-geometric mean
/// of both distances and summed.
#[derive(Default)]
struct Rings {
    farthest2_m2: Vec<f64>,
    nearest2_m2: Vec<f64>,
    weights: Vec<f64>,
}

impl Kernel for Rings {
    type Output = f64;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> f64 {
        let (far, near) = (
            self.farthest2_m2.chunks(LANES),
            self.nearest2_m2.chunks(LANES),
        );
        let mut sum = 0.0;
        for ((far, near), weights) in far.zip(near).zip(self.weights.chunks(LANES)) {
            let (mut a, mut b) = (Lanes::load(far).sqrt(), Lanes::load(near).sqrt());
            let differ = |a: Lanes, b: Lanes| {
                let pairs = a.0.iter().zip(&b.0);
                pairs.fold(false, |any, (a, b)| any | ((a - b).abs() > 1e-9 * a))
            };
            while differ(a, b) {
                (a, b) = ((a + b) * 0.5, (a * b).sqrt());
            }
            // One step more squares the difference.
            let means = (a + b) * 0.5;
            let terms = weights.iter().zip(means.0);
            sum += terms.map(|(weight, mean)| weight / mean).sum::<f64>();
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_base::units::MU_0_T_M_PER_A;

    /// Its slope is the field, on either branch.
    #[test]
    fn the_potential_has_the_field_as_its_slope() {
        let winding = Winding {
            inner_radius_m: 0.7,
            outer_radius_m: 1.3,
            length_m: 1.9,
            turns: 3.7,
        };
        for (r, z, branch) in [
            (0.4, -0.8, Branch::Bore),
            (0.7, -0.3, Branch::Bore),
            (0.9, 0.4, Branch::Outside),
            (0.3, -2.4, Branch::Outside),
            (0.2, 0.3, Branch::Bore),
            (2.1, -1.1, Branch::Outside),
            (1.6, -0.4, Branch::Above),
        ] {
            let h = 1e-4;
            let slope = |dr: f64, dz: f64| {
                let at = |k: f64| winding.potential(r + k * dr, z + k * dz, branch, 1e-12);
                -(at(-2.0) - 8.0 * at(-1.0) + 8.0 * at(1.0) - at(2.0)) / (12.0 * h)
            };
            let field = winding.field(r, z).unwrap();
            let scale = field.b_z.hypot(field.b_r) / MU_0_T_M_PER_A;
            let along_z = slope(0.0, h) - field.b_z / MU_0_T_M_PER_A;
            assert!(along_z.abs() < 1e-8 * scale, "{r} {z}: {along_z}");
            // On the winding's inner side the slope along r bends.
            if r != winding.inner_radius_m {
                let along_r = slope(h, 0.0) - field.b_r / MU_0_T_M_PER_A;
                assert!(along_r.abs() < 1e-8 * scale, "{r} {z}: {along_r}");
            }
        }
    }
}
