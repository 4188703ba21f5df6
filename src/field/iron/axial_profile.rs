//! B_z of a winding over the radius, in planes across its axis close to its ends: one value there takes hundreds of
//! loops, and a face of steel thousands of values.

use super::face::{Panel, SAME_M};
use crate::winding::{OnEdge, Winding};
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;

/// Distance of a plane from a winding's end, in outer radii, below which the profile is worth its nodes.
const CLOSE: f64 = 0.1;
/// Its range, in outer radii; beyond, the field takes few loops.
const RANGE: f64 = 3.0;
/// Nodes of a piece.
const NODES: usize = 8;
/// Error of a piece's integral over the radius, relative to the range's with the field within a long winding.
const TOLERANCE: f64 = 1e-8;
/// Places within a piece, over [-1, 1], at which it is held against the field.
const CHECKED: [f64; 3] = [-0.99, 0.1, 0.99];

/// In one plane.
pub(super) struct AxialProfile {
    z_m: f64,
    /// Where the pieces begin, and the last ends, m.
    ends_m: Vec<f64>,
    /// At the nodes of every piece, T/A.
    values_t: Vec<[f64; NODES]>,
    basis: Basis,
}

impl AxialProfile {
    /// Those of the planes of `panels` close to the ends of `winding`.
    ///
    /// # Errors
    /// A node on the winding's edge.
    pub(super) fn of(panels: &[Panel], winding: &Winding) -> Result<Vec<Self>, OnEdge> {
        let close_m = CLOSE * winding.outer_radius_m;
        let heights_m = panels.iter().filter_map(|panel| {
            let z_m = level_m(panel)?;
            (z_m.abs().min((z_m + winding.length_m).abs()) < close_m).then_some(z_m)
        });
        let mut found: Vec<Self> = Vec::new();
        for z_m in heights_m {
            if !found.iter().any(|profile| profile.is_at(z_m)) {
                found.push(Self::new(winding, z_m)?);
            }
        }
        Ok(found)
    }

    fn new(winding: &Winding, z_m: f64) -> Result<Self, OnEdge> {
        let mut profile = Self {
            z_m,
            ends_m: vec![0.0],
            values_t: Vec::new(),
            basis: Basis::new(gauss::rule(NODES)),
        };
        let range_m = RANGE * winding.outer_radius_m;
        let within_t =
            winding.current_density_per_m2() * (winding.outer_radius_m - winding.inner_radius_m);
        let within_t = fluxform_base::units::MU_0_T_M_PER_A * within_t;
        // From the axis outwards; kinks are at the winding's radii.
        let mut left = vec![
            [winding.outer_radius_m, range_m],
            [winding.inner_radius_m, winding.outer_radius_m],
            [0.0, winding.inner_radius_m],
        ];
        left.retain(|[from, to]| to > from);
        while let Some([from, to]) = left.pop() {
            let at = |x: f64| from + 0.5 * (to - from) * (1.0 + x);
            let field_t = |x: f64| Ok::<f64, OnEdge>(winding.field(at(x), z_m)?.b_z);
            let mut values_t = [0.0; NODES];
            for (value, x) in values_t.iter_mut().zip(&gauss::rule(NODES).nodes) {
                *value = field_t(*x)?;
            }
            let mut error_t = 0.0_f64;
            for x in CHECKED {
                error_t = error_t.max((profile.interpolated(&values_t, x) - field_t(x)?).abs());
            }
            let middle = at(0.0);
            if error_t * (to - from) > TOLERANCE * within_t * range_m
                && from < middle
                && middle < to
            {
                left.extend([[middle, to], [from, middle]]);
            } else {
                profile.ends_m.push(to);
                profile.values_t.push(values_t);
            }
        }
        Ok(profile)
    }

    fn interpolated(&self, values_t: &[f64; NODES], x: f64) -> f64 {
        let mut weights = [0.0; NODES];
        self.basis.weights(x, &mut weights);
        weights.iter().zip(values_t).map(|(w, v)| w * v).sum()
    }

    fn is_at(&self, z_m: f64) -> bool {
        (z_m - self.z_m).abs() <= SAME_M
    }

    /// Whether a panel lies in its plane.
    pub(super) fn is_of(&self, panel: &Panel) -> bool {
        level_m(panel).is_some_and(|z_m| self.is_at(z_m))
    }

    /// B_z at a radius, T/A; `None` beyond its range.
    pub(super) fn b_z(&self, r_m: f64) -> Option<f64> {
        let piece = self.ends_m.partition_point(|end| *end <= r_m);
        let values_t = self.values_t.get(piece.checked_sub(1)?)?;
        let [from, to] = [self.ends_m[piece - 1], self.ends_m[piece]];
        Some(self.interpolated(values_t, 2.0 * (r_m - from) / (to - from) - 1.0))
    }
}

/// The height of a panel in a plane across the axis, m.
fn level_m(panel: &Panel) -> Option<f64> {
    let [x, y, _] = panel.plane?;
    (x == 0.0 && y == 0.0).then_some(panel.centre_m[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_in_the_plane_of_an_end_is_the_winding_s_field() {
        let winding = Winding {
            inner_radius_m: 0.012,
            outer_radius_m: 0.019,
            length_m: 0.02,
            turns: 280.0,
        };
        for z_m in [0.0, -0.02, 3e-4] {
            let profile = AxialProfile::new(&winding, z_m).unwrap();
            let centre_t = winding.field(0.0, z_m).unwrap().b_z;
            for k in 0..200 {
                let r_m = 0.056 * f64::from(k) / 200.0 + 1e-5;
                let exact_t = winding.field(r_m, z_m).unwrap().b_z;
                let off = profile.b_z(r_m).unwrap() - exact_t;
                assert!(off.abs() < 1e-5 * centre_t, "{z_m} {r_m} {off:e}");
            }
            assert_eq!(profile.b_z(0.06), None);
        }
    }
}
