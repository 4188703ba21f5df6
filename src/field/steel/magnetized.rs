//! The field of a magnetised core, axisymmetric: B of the double layer on its outline.
//!
//! A layer of density v (A) is the surface current K = -dv/ds around the axis, s along the
//! outline: what the magnetisation M = -grad v bounds. Its loops give mu_0 (H + M) everywhere,
//! outside and inside, with no difference of large terms.

pub(super) mod loops;

use serde::{Deserialize, Serialize};

use super::generatrix::{Face, Generatrix, Panel};
use crate::ring::{RingPoint, ring_field};
use crate::winding::AxialField;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::dual::Dual;
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;

/// Target of the quadrature over a panel, relative to the panel's own field.
const TOLERANCE: f64 = 1e-12;
/// Nodes on a piece of a panel close to the point.
const PIECE_ORDER: usize = 12;
/// Depth of halving at which a piece is taken as it is.
const MAX_HALVINGS: usize = 50;

/// A core's outline with its double-layer density.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct MagnetizedCore {
    outline: Generatrix,
    density_a: Vec<f64>,
    /// dv/ds at the nodes, A/m.
    slope_a_per_m: Vec<f64>,
    /// Where two panels meet: radius, height, jump of v, A.
    jumps: Vec<(f64, f64, f64)>,
    basis: Basis,
}

impl MagnetizedCore {
    /// The density at the nodes of another outline of the same core, A.
    #[must_use]
    pub(super) fn density_on(&self, other: &Generatrix) -> Vec<f64> {
        let order = self.outline.order;
        let mut weights = vec![0.0; order];
        let mut panel = 0;
        let panels = &self.outline.panels;
        let mut out = Vec::with_capacity(other.nodes.len());
        for (theirs, nodes) in other.panels.iter().zip(other.nodes.chunks(other.order)) {
            for node in nodes {
                let at_m = match theirs.face {
                    Face::Bottom | Face::Top => node.r_m,
                    Face::Side => node.z_m,
                };
                // Both outlines run the same way.
                let holds = |panel: &Panel| {
                    let (from_m, to_m) = panel.range_m();
                    panel.face == theirs.face && from_m <= at_m && at_m <= to_m
                };
                while panel + 1 < panels.len() && !holds(&panels[panel]) {
                    panel += 1;
                }
                let Panel { from_m, to_m, .. } = panels[panel];
                let x = 2.0 * (at_m - from_m) / (to_m - from_m) - 1.0;
                self.basis.weights(x.clamp(-1.0, 1.0), &mut weights);
                let values = &self.density_a[panel * order..(panel + 1) * order];
                out.push(weights.iter().zip(values).map(|(w, v)| w * v).sum());
            }
        }
        out
    }

    /// The layer with density `density_a` at the nodes of `outline`.
    #[must_use]
    pub fn new(outline: Generatrix, density_a: Vec<f64>) -> Self {
        let order = outline.order;
        let basis = Basis::new(gauss::rule(order));
        let derivative = basis.derivative();
        let (mut at_start, mut at_end) = (vec![0.0; order], vec![0.0; order]);
        basis.weights(-1.0, &mut at_start);
        basis.weights(1.0, &mut at_end);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut slope_a_per_m = Vec::with_capacity(density_a.len());
        let mut jumps = Vec::new();
        let mut before: Option<f64> = None;
        for (panel, values) in outline.panels.iter().zip(density_a.chunks(order)) {
            let scale = 2.0 / panel.length_m();
            slope_a_per_m.extend(derivative.iter().map(|row| scale * dot(row, values)));
            if let Some(end) = before {
                let (r_m, z_m, _) = outline.shape.on(panel.face, panel.from_m);
                jumps.push((r_m, z_m, dot(&at_start, values) - end));
            }
            before = Some(dot(&at_end, values));
        }
        Self {
            outline,
            density_a,
            slope_a_per_m,
            jumps,
            basis,
        }
    }

    /// The outline.
    #[must_use]
    pub fn outline(&self) -> &Generatrix {
        &self.outline
    }

    /// v at the nodes, A.
    #[must_use]
    pub fn density_a(&self) -> &[f64] {
        &self.density_a
    }

    /// B and its gradient, T and T/m, at radius `r_m` and height `z_m`, off the core's surface.
    #[must_use]
    pub fn field(&self, r_m: f64, z_m: f64) -> AxialField {
        fluxform_base::progress::poll();
        let mut sums = Sums::default();
        let order = self.outline.order;
        let shape = self.outline.shape;
        let far = TOLERANCE.powf(-0.5 / order as f64).max(1.5);
        let mut weights = vec![0.0; order];
        for (index, panel) in self.outline.panels.iter().enumerate() {
            let (foot, gap) = match panel.face {
                Face::Side => (z_m, r_m - shape.radius_m),
                Face::Bottom => (r_m, z_m - shape.bottom_m),
                Face::Top => (r_m, z_m - shape.top_m),
            };
            let (lo, hi) = panel.range_m();
            let (lo, hi) = (lo - foot, hi - foot);
            let nodes = index * order..(index + 1) * order;
            if gauss::bernstein_radius(lo, hi, 0.0, gap) >= far {
                for (node, slope) in self.outline.nodes[nodes.clone()]
                    .iter()
                    .zip(&self.slope_a_per_m[nodes])
                {
                    sums.add(
                        r_m,
                        node.r_m,
                        node.r_m - r_m,
                        z_m - node.z_m,
                        -slope * node.weight_m,
                    );
                }
                continue;
            }
            let from = panel.from_m - foot;
            let length = panel.to_m - panel.from_m;
            let slopes = &self.slope_a_per_m[nodes];
            pieces(lo, hi, gap, MAX_HALVINGS, &mut |offset, weight| {
                self.basis
                    .weights(2.0 * (offset - from) / length - 1.0, &mut weights);
                let slope: f64 = weights.iter().zip(slopes).map(|(a, b)| a * b).sum();
                let current = -slope * weight;
                match panel.face {
                    Face::Side => sums.add(r_m, shape.radius_m, -gap, -offset, current),
                    Face::Bottom | Face::Top => {
                        sums.add(r_m, r_m + offset, offset, gap, current);
                    }
                }
            });
        }
        for (radius, height, jump) in &self.jumps {
            sums.add(r_m, *radius, radius - r_m, z_m - height, -jump);
        }
        sums.field(r_m)
    }
}

fn pieces(lo: f64, hi: f64, gap: f64, halvings: usize, visit: &mut impl FnMut(f64, f64)) {
    let far = TOLERANCE.powf(-0.5 / PIECE_ORDER as f64);
    if halvings == 0 || gauss::bernstein_radius(lo, hi, 0.0, gap) >= far {
        let rule = gauss::rule(PIECE_ORDER);
        let (half, middle) = (0.5 * (hi - lo), 0.5 * (lo + hi));
        for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
            visit(middle + half * x, half * weight);
        }
        return;
    }
    let middle = 0.5 * (lo + hi);
    pieces(lo, middle, gap, halvings - 1, visit);
    pieces(middle, hi, gap, halvings - 1, visit);
}

/// Sums over loops, over mu_0.
#[derive(Default)]
struct Sums {
    b_z: f64,
    b_r_over_r: f64,
    dbz_dz: f64,
    dbr_dz_over_r: f64,
}

impl Sums {
    fn add(&mut self, r_m: f64, radius_m: f64, offset_m: f64, u_m: f64, current_a: f64) {
        if current_a == 0.0 || (offset_m == 0.0 && u_m == 0.0) {
            return;
        }
        let ring = ring_field(RingPoint {
            radius_m,
            r_m,
            offset_m,
            u_m: Dual::variable(u_m),
        });
        self.b_z += current_a * ring.b_z.re;
        self.b_r_over_r += current_a * ring.b_r_over_r.re;
        self.dbz_dz += current_a * ring.b_z.du;
        self.dbr_dz_over_r += current_a * ring.b_r_over_r.du;
    }

    fn field(&self, r_m: f64) -> AxialField {
        let mu_0 = MU_0_T_M_PER_A;
        let (dbz_dz, br_over_r) = (mu_0 * self.dbz_dz, mu_0 * self.b_r_over_r);
        let dbr_dz_over_r = mu_0 * self.dbr_dz_over_r;
        let dbr_dz = dbr_dz_over_r * r_m;
        AxialField {
            b_r: br_over_r * r_m,
            b_z: mu_0 * self.b_z,
            dbr_dr: -br_over_r - dbz_dz,
            dbr_dz,
            dbr_dz_over_r,
            dbz_dr: dbr_dz,
            dbz_dz,
            br_over_r,
        }
    }
}
