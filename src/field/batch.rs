//! Many points of one winding at once: the vectorised loop behind maps and force rows.
//!
//! The same radial integrals as [`super::winding`], with one Gauss-Legendre panel a face and a
//! fixed number of AGM steps, both chosen a priori from the geometry and the tolerance. Points
//! for which that rule would need too many nodes, or where the quick form would lose digits,
//! are given to the exact path.

use super::winding::{AxialField, OnEdge, Winding, sheet_end};
use crate::components::Components;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes};
use fluxform_numerics::gauss;

/// Points that share one quadrature rule; fixed, so that results do not depend on threads.
pub(crate) const CHUNK: usize = 256;
/// More nodes than this on one panel cost more than the graded exact path is worth.
const MAX_NODES: usize = 24;
/// Constant of the error bound, relative to the largest |grad B| at the height.
const BOUND_SCALE: f64 = 16.0;
/// Digits that the quick form may lose to rounding, relative to the tolerance.
const ROUNDING_SHARE: f64 = 0.1;

/// The gradient's independent components outside the conductor, per ampere, one entry a point.
#[derive(Debug, Clone, Default)]
pub struct Gradients {
    /// dB_z/dz, T/m/A.
    pub dbz_dz: Vec<f64>,
    /// (dB_r/dz)/r = (dB_z/dr)/r, T/m^2/A; empty for [`Components::Gz`].
    pub dbr_dz_over_r: Vec<f64>,
    /// B_r/r, T/m/A; empty for [`Components::Gz`].
    pub br_over_r: Vec<f64>,
}

/// Numbers of nodes and AGM steps for a chunk of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BatchRule {
    /// Radial nodes for the end face near the points.
    pub near_nodes: usize,
    /// Radial nodes for the far end face.
    pub far_nodes: usize,
    /// AGM steps.
    pub agm_steps: usize,
}

/// Extent of a set of points about one winding, m.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// Smallest and largest distance from the axis.
    pub r_m: [f64; 2],
    /// Smallest and largest height above the top face.
    pub z_m: [f64; 2],
}

impl Extent {
    fn of(r_m: &[f64], z_m: &[f64]) -> Self {
        let range = |v: &[f64]| {
            v.iter()
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], x| {
                    [lo.min(*x), hi.max(*x)]
                })
        };
        Self {
            r_m: range(r_m),
            z_m: range(z_m),
        }
    }
}

impl Winding {
    /// The rule for points in `extent` that keeps the quadrature error of every gradient
    /// component below `tolerance` times the largest |grad B| at the point's height; `None`
    /// where the exact path must be used.
    ///
    /// The integrand is singular at a = r +- i u. With rho the Bernstein radius of that point
    /// about the panel the n-node error is below 16 M rho^(-2n), relatively, where
    /// M = (1 + h rho / (2 c))^2 is the growth of a^2 on that ellipse about the panel's
    /// centre c and half-width h.
    #[must_use]
    pub(crate) fn batch_rule(&self, extent: Extent, tolerance: f64) -> Option<BatchRule> {
        let near_u = extent.z_m[0];
        if near_u <= 0.0 || !extent.z_m[1].is_finite() || !extent.r_m[1].is_finite() {
            return None;
        }
        let farthest = extent.r_m[1].hypot(extent.z_m[1] + self.length_m);
        if !self.keeps_digits(farthest, near_u, tolerance) {
            return None;
        }
        let (a1, a2) = (self.inner_radius_m, self.outer_radius_m);
        let middle = 0.5 * (a1 + a2);
        // The faces' difference is smaller than either by the winding's share of the distance.
        let tolerance = tolerance * (self.length_m / farthest).min(1.0);
        let nodes = |u: f64| {
            let r = middle.clamp(extent.r_m[0], extent.r_m[1]);
            let radius = gauss::bernstein_radius(a1, a2, r, u);
            let growth = 1.0 + 0.5 * (a2 - a1) / (a1 + a2) * radius;
            (1..=MAX_NODES)
                .find(|n| BOUND_SCALE * growth * growth * radius.powi(-2 * *n as i32) <= tolerance)
        };
        Some(BatchRule {
            near_nodes: nodes(near_u)?,
            far_nodes: nodes(near_u + self.length_m)?,
            // An error of tau counts against a^2, not against the distance's square.
            agm_steps: agm_steps(a2, near_u, tolerance * (middle / farthest).powi(2).min(1.0)),
        })
    }

    /// Whether the quick form loses few enough digits: its B_z loses (distance / a)^2 far away and a / u
    /// close by, and the difference of the two faces loses distance / L.
    fn keeps_digits(&self, farthest_m: f64, near_m: f64, tolerance: f64) -> bool {
        let middle = 0.5 * (self.inner_radius_m + self.outer_radius_m);
        let loss = (farthest_m / middle)
            .powi(2)
            .max(self.outer_radius_m / near_m)
            * (farthest_m / self.length_m).max(1.0);
        loss * f64::EPSILON <= ROUNDING_SHARE * tolerance
    }

    /// Whether points as far as `distance_m` from the axis, and not close to the winding, take the quick way.
    #[must_use]
    pub fn is_quick_at(&self, distance_m: f64, tolerance: f64) -> bool {
        self.keeps_digits(
            distance_m.hypot(self.length_m),
            self.outer_radius_m,
            tolerance,
        )
    }

    /// Gradients per ampere at points (`r_m`, `z_m`), z above the top face, to `tolerance`
    /// relative to the largest |grad B| at each point's height.
    ///
    /// # Errors
    /// [`OnEdge`] where a point lies on an edge of the winding.
    ///
    /// # Panics
    /// When the two slices differ in length.
    pub fn gradients(
        &self,
        r_m: &[f64],
        z_m: &[f64],
        tolerance: f64,
        components: Components,
    ) -> Result<Gradients, OnEdge> {
        assert_eq!(r_m.len(), z_m.len(), "one height a radius");
        let mut out = Gradients {
            dbz_dz: vec![0.0; r_m.len()],
            ..Gradients::default()
        };
        if components != Components::Gz {
            out.dbr_dz_over_r = vec![0.0; r_m.len()];
            out.br_over_r = vec![0.0; r_m.len()];
        }
        for start in (0..r_m.len()).step_by(CHUNK) {
            fluxform_base::progress::poll();
            let range = start..(start + CHUNK).min(r_m.len());
            let (r, z) = (&r_m[range.clone()], &z_m[range.clone()]);
            match self.batch_rule(Extent::of(r, z), tolerance) {
                Some(rule) => {
                    let chunk = Chunk {
                        nodes: self.nodes(rule),
                        agm_steps: rule.agm_steps,
                        scale: MU_0_T_M_PER_A * self.current_density_per_m2(),
                        r_m: r,
                        z_m: z,
                        dbz_dz: &mut out.dbz_dz[range.clone()],
                        rest: match components {
                            Components::Gz => None,
                            Components::Force | Components::Gradient | Components::All => Some((
                                &mut out.dbr_dz_over_r[range.clone()],
                                &mut out.br_over_r[range],
                            )),
                        },
                    };
                    dispatch::run(chunk);
                }
                None => {
                    let tolerance = ROUNDING_SHARE * tolerance;
                    for index in range {
                        let AxialField {
                            dbz_dz,
                            dbr_dz_over_r,
                            br_over_r,
                            ..
                        } = self.field_to(r_m[index], z_m[index], tolerance)?;
                        out.dbz_dz[index] = dbz_dz;
                        if components != Components::Gz {
                            out.dbr_dz_over_r[index] = dbr_dz_over_r;
                            out.br_over_r[index] = br_over_r;
                        }
                    }
                }
            }
        }
        Ok(out)
    }

    /// B_z per ampere, T/A, at points above the top face, to `tolerance` relative to the
    /// largest |B| at each point's height; beyond a thousand radii the rounding of the two
    /// faces' difference is what limits it.
    ///
    /// # Errors
    /// [`OnEdge`] where a point lies on an edge of the winding.
    ///
    /// # Panics
    /// When the two slices differ in length.
    pub fn axial_fields(
        &self,
        r_m: &[f64],
        z_m: &[f64],
        tolerance: f64,
    ) -> Result<Vec<f64>, OnEdge> {
        assert_eq!(r_m.len(), z_m.len(), "one height a radius");
        let half = 0.5 * (self.outer_radius_m - self.inner_radius_m);
        let centre = 0.5 * (self.outer_radius_m + self.inner_radius_m);
        let scale = MU_0_T_M_PER_A * self.current_density_per_m2() * half;
        let mut out = Vec::with_capacity(r_m.len());
        for (r, z) in r_m.chunks(CHUNK).zip(z_m.chunks(CHUNK)) {
            fluxform_base::progress::poll();
            let Some(rule) = self.batch_rule(Extent::of(r, z), tolerance) else {
                for (r, z) in r.iter().zip(z) {
                    out.push(self.field_to(*r, *z, ROUNDING_SHARE * tolerance)?.b_z);
                }
                continue;
            };
            // One face's term jumps at a = r; the faces' difference does not: same nodes for both.
            let nodes = gauss::rule(rule.near_nodes);
            out.extend(r.iter().zip(z).map(|(r, z)| {
                let sum: f64 = nodes
                    .nodes
                    .iter()
                    .zip(&nodes.weights)
                    .map(|(x, weight)| {
                        let a = centre + half * x;
                        let face = |u| sheet_end(a, *r, a - r, u);
                        weight * (face(z + self.length_m) - face(*z))
                    })
                    .sum();
                scale * sum
            }));
        }
        Ok(out)
    }

    /// Loops of both faces; the near face's weights are negative.
    fn nodes(&self, rule: BatchRule) -> Vec<Node> {
        let half = 0.5 * (self.outer_radius_m - self.inner_radius_m);
        let centre = 0.5 * (self.outer_radius_m + self.inner_radius_m);
        [
            (rule.near_nodes, 0.0, -half),
            (rule.far_nodes, self.length_m, half),
        ]
        .into_iter()
        .flat_map(|(order, depth_m, scale)| {
            let rule = gauss::rule(order);
            rule.nodes
                .iter()
                .zip(&rule.weights)
                .map(move |(x, w)| Node {
                    radius_m: centre + half * x,
                    depth_m,
                    weight: scale * w,
                })
        })
        .collect()
    }
}

/// AGM steps after which the worst loop's truncation error is below `tolerance`: the smallest
/// d/s over all radii belongs to the outermost loop at r = sqrt(a^2 + u^2).
fn agm_steps(a: f64, u: f64, tolerance: f64) -> usize {
    let r = a.hypot(u);
    let ratio = ((a - r).hypot(u) / (a + r).hypot(u)).max(f64::MIN_POSITIVE);
    let (mut mean, mut geometric, mut correction) =
        (0.5 * (1.0 + ratio), ratio.sqrt(), 0.5 * (1.0 - ratio));
    let mut steps = 1;
    let mut weight = 2.0;
    loop {
        let next = 0.5 * (mean + geometric);
        correction = correction * correction / (4.0 * next);
        // The first neglected term of tau's sum, and the mean's own next correction.
        let after = correction * correction / (4.0 * next);
        if weight * correction * correction < ROUNDING_SHARE * tolerance
            && after < ROUNDING_SHARE * tolerance
        {
            return steps;
        }
        geometric = (mean * geometric).sqrt();
        mean = next;
        weight *= 2.0;
        steps += 1;
    }
}

/// A loop of an end face.
struct Node {
    radius_m: f64,
    depth_m: f64,
    weight: f64,
}

/// A chunk of points with a common rule.
struct Chunk<'a> {
    nodes: Vec<Node>,
    agm_steps: usize,
    scale: f64,
    r_m: &'a [f64],
    z_m: &'a [f64],
    dbz_dz: &'a mut [f64],
    rest: Option<(&'a mut [f64], &'a mut [f64])>,
}

impl Kernel for Chunk<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(mut self) {
        for start in (0..self.r_m.len()).step_by(LANES) {
            let end = (start + LANES).min(self.r_m.len());
            let r = Lanes::load(&self.r_m[start..end]);
            let z = Lanes::load(&self.z_m[start..end]);
            match &mut self.rest {
                None => {
                    let [gz, ..] = sums::<FMA, false>(&self.nodes, self.agm_steps, r, z);
                    (gz * (0.25 * self.scale)).store(&mut self.dbz_dz[start..end]);
                }
                Some((dbr_dz_over_r, br_over_r)) => {
                    let [gz, gr, br] = sums::<FMA, true>(&self.nodes, self.agm_steps, r, z);
                    (gz * (0.25 * self.scale)).store(&mut self.dbz_dz[start..end]);
                    (gr * self.scale).store(&mut dbr_dz_over_r[start..end]);
                    (br * -self.scale).store(&mut br_over_r[start..end]);
                }
            }
        }
    }
}

/// Weighted sums over the loops of 4 b_z, b_r / r and A / r (see [`super::ring`]).
#[inline(always)]
fn sums<const FMA: bool, const ALL: bool>(
    nodes: &[Node],
    agm_steps: usize,
    r: Lanes,
    z: Lanes,
) -> [Lanes; 3] {
    let zero = Lanes::splat(0.0);
    let one = Lanes::splat(1.0);
    let mut total = [zero; 3];
    for node in nodes {
        let offset = Lanes::splat(node.radius_m) - r;
        let u = z + node.depth_m;
        let p = r * (2.0 * node.radius_m);
        let d2 = offset.mul_add::<FMA>(offset, u * u);
        let q = d2 + p;
        let s2 = q + p;
        let (s, d) = (s2.sqrt(), d2.sqrt());
        let mut mean = (s + d) * 0.5;
        let mut geometric = (s * d).sqrt();
        let mut gamma = Lanes::splat(0.5) / mean;
        let mut tau = gamma * gamma;
        let quarter_p = p * 0.25;
        let mut weight = 1.0;
        for _ in 1..agm_steps {
            let next = (mean + geometric) * 0.5;
            geometric = (mean * geometric).sqrt();
            mean = next;
            gamma = gamma * gamma * quarter_p / mean;
            weight *= 2.0;
            tau = (gamma * weight).mul_add::<FMA>(gamma, tau);
        }
        mean = (mean + geometric) * 0.5;
        let s2d2 = s2 * d2;
        let inverse = Lanes::splat(node.weight) / (mean * s2d2);
        let p2 = p * p;
        let shape = one - q * tau;
        let remainder = q - p2 * tau;
        let numerator = remainder * (2.0 * node.radius_m * node.radius_m) - p2 * shape;
        total[0] = numerator.mul_add::<FMA>(inverse, total[0]);
        if ALL {
            let a2 = node.radius_m * node.radius_m;
            total[1] = (u * shape * a2).mul_add::<FMA>(inverse, total[1]);
            total[2] = (tau * s2d2 * a2).mul_add::<FMA>(inverse, total[2]);
        }
    }
    total
}
