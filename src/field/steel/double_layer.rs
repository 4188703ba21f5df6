//! The double-layer operator on a core's outline, one dense matrix for each azimuthal mode.
//!
//! (W v)(x) = v(x)/2 + PV int (1/4 pi) n'.(x - y)/|x - y|^3 v(y) dS, for v cos(m theta). W of a
//! constant is zero: every diagonal is what makes the rows' sums vanish in mode 0, so that the
//! small eigenvalues of long cores keep their relative accuracy.

use nalgebra::DMatrix;
use std::f64::consts::PI;

use super::generatrix::{Face, Generatrix, Node, Panel};
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;
use fluxform_numerics::log_rule::LOG_RULE;
use fluxform_numerics::ring_functions::azimuthal_integrals;

/// Most azimuthal modes, m = 0 to this minus one.
pub(crate) const MAX_MODES: usize = 64;
/// Nodes on a piece of a panel close to the target.
const PIECE_ORDER: usize = 12;
/// Longest piece over which the ring kernel is a logarithm times a smooth function, in radii.
const LOG_PIECE: f64 = 1.0;

/// The kernel of mode m < `out.len()`, the source ring's radius included:
/// (r'/4 pi) int cos(m psi) n'.(x - y)/|x - y|^3 dpsi, 1/m.
///
/// `dr_m` = r - r' and `dz_m` = z - z' are passed beside the radii so that they keep their digits.
pub fn kernel(r_m: f64, source_r_m: f64, dr_m: f64, dz_m: f64, normal: [f64; 2], out: &mut [f64]) {
    let product = 2.0 * r_m * source_r_m;
    let excess = (dr_m * dr_m + dz_m * dz_m) / product;
    // Clearing room for all modes would cost as much as one of them.
    let (mut one, mut all);
    let inverse: &mut [f64] = if out.len() == 1 {
        one = [0.0];
        &mut one
    } else {
        all = [0.0; MAX_MODES];
        &mut all[..out.len()]
    };
    azimuthal_integrals(excess, inverse, out);
    let scale = source_r_m / (4.0 * PI * product * product.sqrt());
    // n'.(x - y) = n_r (r cos psi - r') + n_z (z - z'), r cos psi = r chi - r (chi - cos psi).
    let radial = (dr_m * (r_m + source_r_m) + dz_m * dz_m) / (2.0 * source_r_m);
    for (cubed, inverse) in out.iter_mut().zip(inverse.iter()) {
        let along_r = radial * *cubed - r_m * inverse;
        *cubed = scale * (normal[0] * along_r + normal[1] * dz_m * *cubed);
    }
}

/// W of modes 0 to `modes` - 1 on the nodes of `outline`.
#[must_use]
pub fn operators(outline: &Generatrix, modes: usize, tolerance: f64) -> Vec<DMatrix<f64>> {
    let count = outline.nodes.len();
    let order = outline.order;
    let mut matrices = vec![DMatrix::zeros(count, count); modes];
    let basis = Basis::new(gauss::rule(order));
    let mut values = [0.0; MAX_MODES];
    let mut weights = vec![0.0; order];
    // exp(-2 order ln(radius)) <= tolerance
    let far = tolerance.powf(-0.5 / order as f64);
    for (row, target) in outline.nodes.iter().enumerate() {
        fluxform_base::progress::poll();
        let mut mass = 0.0;
        for (index, panel) in outline.panels.iter().enumerate() {
            let Some(aspect) = Aspect::new(target, panel, outline) else {
                continue;
            };
            let columns = index * order;
            if aspect.radius() >= far {
                for (place, node) in outline.nodes[columns..columns + order].iter().enumerate() {
                    let (dr, dz) = (target.r_m - node.r_m, target.z_m - node.z_m);
                    let out = &mut values[..modes];
                    kernel(target.r_m, node.r_m, dr, dz, node.normal, out);
                    mass += node.weight_m * out[0];
                    for (matrix, value) in matrices.iter_mut().zip(out) {
                        matrix[(row, columns + place)] += node.weight_m * *value;
                    }
                }
                continue;
            }
            aspect.pieces(tolerance, &mut |offset, weight| {
                let (dr, dz, source_r) = match panel.face {
                    Face::Side => (aspect.gap, -offset, outline.shape.radius_m),
                    Face::Bottom | Face::Top => (-offset, aspect.gap, target.r_m + offset),
                };
                let normal = outline.shape.on(panel.face, 0.0).2;
                let out = &mut values[..modes];
                kernel(target.r_m, source_r, dr, dz, normal, out);
                mass += weight * out[0];
                basis.weights(aspect.reference(offset), &mut weights);
                for (matrix, value) in matrices.iter_mut().zip(out) {
                    for (place, share) in weights.iter().enumerate() {
                        matrix[(row, columns + place)] += weight * *value * share;
                    }
                }
            });
        }
        for matrix in &mut matrices {
            matrix[(row, row)] -= mass;
        }
    }
    matrices
}

/// A target as seen from a panel's line.
struct Aspect {
    /// Panel's ends relative to the target's foot on its line, ascending, m.
    lo: f64,
    hi: f64,
    /// Signed distance of the target from the line, m.
    gap: f64,
    /// Offset at which the panel begins, and its signed length, m.
    from: f64,
    length: f64,
    /// Longest piece with one logarithm, m.
    log_piece: f64,
}

impl Aspect {
    /// `None` where the kernel vanishes: a flat face does not act on itself.
    fn new(target: &Node, panel: &Panel, outline: &Generatrix) -> Option<Self> {
        let (foot, gap) = match panel.face {
            Face::Side => (target.z_m, target.r_m - outline.shape.radius_m),
            Face::Bottom => (target.r_m, target.z_m - outline.shape.bottom_m),
            Face::Top => (target.r_m, target.z_m - outline.shape.top_m),
        };
        if panel.face != Face::Side && gap == 0.0 {
            return None;
        }
        let (lo, hi) = panel.range_m();
        Some(Self {
            lo: lo - foot,
            hi: hi - foot,
            gap,
            from: panel.from_m - foot,
            length: panel.to_m - panel.from_m,
            log_piece: LOG_PIECE * outline.shape.radius_m,
        })
    }

    /// Bernstein radius of the kernel's nearest singularity about the panel.
    fn radius(&self) -> f64 {
        gauss::bernstein_radius(self.lo, self.hi, 0.0, self.gap)
    }

    /// The place of an offset in the panel's own direction, -1 to 1.
    fn reference(&self, offset: f64) -> f64 {
        2.0 * (offset - self.from) / self.length - 1.0
    }

    /// Visits offsets and weights of a rule for the kernel over the panel.
    fn pieces(&self, tolerance: f64, visit: &mut impl FnMut(f64, f64)) {
        let radius = tolerance.powf(-0.5 / PIECE_ORDER as f64).max(1.5);
        if self.lo < 0.0 && self.hi > 0.0 {
            self.piece(self.lo, 0.0, radius, visit);
            self.piece(0.0, self.hi, radius, visit);
        } else {
            self.piece(self.lo, self.hi, radius, visit);
        }
    }

    /// Halves until the kernel is smooth, which it is on a piece shorter than its distance from
    /// the target: on the target's own line a piece that reaches it is a logarithm before that.
    fn piece(&self, lo: f64, hi: f64, radius: f64, visit: &mut impl FnMut(f64, f64)) {
        let length = hi - lo;
        if self.gap == 0.0 && (lo == 0.0 || hi == 0.0) && length <= self.log_piece {
            for [t, weight] in LOG_RULE {
                let offset = if lo == 0.0 { t * hi } else { t * lo };
                visit(offset, weight * length);
            }
            return;
        }
        if gauss::bernstein_radius(lo, hi, 0.0, self.gap) >= radius {
            let rule = gauss::rule(PIECE_ORDER);
            let (half, middle) = (0.5 * length, 0.5 * (lo + hi));
            for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
                visit(middle + half * x, half * weight);
            }
            return;
        }
        let middle = 0.5 * (lo + hi);
        self.piece(lo, middle, radius, visit);
        self.piece(middle, hi, radius, visit);
    }
}
