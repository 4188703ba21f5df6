//! The largest flux density along the curve that bounds a region of a core.
//!
//! A panel's nodes give the field's modes; between them the panel's polynomials stand for it.
//! Samples of |B| along the panels and around the axis that no neighbour exceeds are followed to
//! the maximum beside them; what the panels' highest degrees contribute bounds what is missed.

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::CoreShape;
use super::generatrix::{Generatrix, Resolution};
use super::layer_gradient::COMPONENTS;
use crate::winding::Winding;
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;

/// Target of the quadratures over the outline, relative to the kernels.
pub(super) const QUADRATURE: f64 = 1e-8;
/// Share of a panel's two highest degrees that the degrees beyond them give together.
const BEYOND: f64 = 0.3;
/// Nodes a panel of the finest scan.
pub(super) const SCAN_ORDER: usize = 14;
/// By how much a further node a panel of [`SCAN`] lowers what its polynomials miss.
const FALL: f64 = 3.4;
/// Fewest nodes a panel of a scan.
const LEAST_ORDER: f64 = 4.0;
/// The curve along which |B| is scanned: the surface at the depth, in a half plane. Its panels'
/// polynomials stand for the field between the nodes: panels graded so miss about 3.4^-order of it,
/// and what is missed moves a flat maximum far.
const SCAN: Resolution = Resolution {
    order: SCAN_ORDER,
    ratio: 0.3,
    tip: 0.0,
    quadrature: QUADRATURE,
};
/// Samples that are higher than their neighbours and at least this share of the highest are
/// followed to the maximum beside them: the highest sample need not lie beside the largest.
const FOLLOWED: f64 = 0.95;
/// Angles a mode of the scan, and of the mean.
const ANGLES: usize = 8;

pub(super) fn norm(b: [f64; 3]) -> f64 {
    b[0].hypot(b[1]).hypot(b[2])
}

/// A polynomial's share in another, as weights of that one's values at the nodes.
pub(super) fn projection(polynomial: &[f64], weights: &[f64]) -> Vec<f64> {
    let weighted = || polynomial.iter().zip(weights).map(|(p, w)| p * w);
    let square: f64 = weighted().zip(polynomial).map(|(a, p)| a * p).sum();
    weighted().map(|value| value / square).collect()
}

/// Nodes a panel with which a scan misses at most `tolerance` of the field, up to [`SCAN_ORDER`].
pub(super) fn scan_order(tolerance: f64) -> usize {
    let order = (-tolerance.ln() / FALL.ln()).ceil();
    order.clamp(LEAST_ORDER, SCAN_ORDER as f64) as usize
}

/// Legendre polynomials of degree 0 to `order` - 1 on the nodes of that order.
pub(super) fn legendre(order: usize) -> Vec<Vec<f64>> {
    let nodes = &gauss::rule(order).nodes;
    let mut out = vec![vec![1.0; order], nodes.clone()];
    for degree in 2..order {
        let k = degree as f64;
        let next = nodes
            .iter()
            .enumerate()
            .map(|(i, x)| {
                ((2.0 * k - 1.0) * x * out[degree - 1][i] - (k - 1.0) * out[degree - 2][i]) / k
            })
            .collect();
        out.push(next);
    }
    out.truncate(order);
    out
}

/// B at some targets in one core: [component and target, column of the modes], T.
pub(super) struct Field {
    pub(super) values: DMatrix<f64>,
}

impl Field {
    /// (B_r, B_theta, B_z) at a target and an angle, given as [`turns`].
    pub(super) fn at(&self, target: usize, turns: &[(f64, f64)]) -> [f64; 3] {
        let row = target * COMPONENTS;
        combine(turns, |component, column| {
            self.values[(row + component, column)]
        })
    }

    pub(super) fn modes(&self) -> usize {
        self.values.ncols().div_ceil(2)
    }
}

/// (sin, cos) of an angle's multiples, from 1 to `modes` - 1.
pub(super) fn turns(angle: f64, modes: usize) -> Vec<(f64, f64)> {
    (1..modes).map(|m| (m as f64 * angle).sin_cos()).collect()
}

/// The same of angles all around, some for every mode; of one alone without transverse modes.
pub(super) fn turns_around(modes: usize) -> Vec<Vec<(f64, f64)>> {
    let count = if modes == 1 { 1 } else { ANGLES * modes };
    (0..count)
        .map(|k| turns(TAU * k as f64 / count as f64, modes))
        .collect()
}

/// (B_r, B_theta, B_z) at an angle, given as [`turns`], from the components' modes.
pub(super) fn combine(turns: &[(f64, f64)], value: impl Fn(usize, usize) -> f64) -> [f64; 3] {
    let mut b = [value(0, 0), 0.0, value(1, 0)];
    for (mode, (s, c)) in turns.iter().enumerate() {
        let (cosine, sine) = (2 * mode + 1, 2 * mode + 2);
        b[0] += c * value(0, cosine) + s * value(0, sine);
        b[1] += c * value(2, sine) - s * value(2, cosine);
        b[2] += c * value(1, cosine) + s * value(1, sine);
    }
    b
}

/// The surface `depth_m` inside, cut into panels as fine as what lies that far off.
pub(super) fn scan_curve(
    winding: &Winding,
    shape: CoreShape,
    depth_m: f64,
    order: usize,
) -> Generatrix {
    let inner = CoreShape {
        radius_m: shape.radius_m - depth_m,
        bottom_m: shape.bottom_m + depth_m,
        top_m: shape.top_m - depth_m,
    };
    let tip_m = depth_m.max(winding.inner_radius_m - inner.radius_m);
    let smaller = inner.radius_m.min(0.5 * inner.length_m());
    Generatrix::new(
        inner,
        &[(0.0, tip_m), (-winding.length_m, tip_m)],
        &Resolution {
            tip: depth_m / smaller,
            order,
            ..SCAN
        },
    )
}

/// Largest |B| on the curve, from the nodes' fields.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peak {
    /// By the panels' polynomials.
    pub(super) scanned_t: f64,
    /// No |B| on the curve is larger, by the panels' highest degrees.
    pub(super) bound_t: f64,
    /// Radius and height.
    pub(super) place_m: (f64, f64),
    pub(super) angle: f64,
}

pub(super) fn scans(curve: &Generatrix, fields: &[Field], nearest_m: f64) -> Vec<Peak> {
    fields
        .par_iter()
        .map(|field| scan(curve, field, nearest_m))
        .collect()
}

pub(super) fn scan(curve: &Generatrix, field: &Field, nearest_m: f64) -> Peak {
    fluxform_base::progress::poll();
    let polynomials = Polynomials::new(curve.order, field);
    let around = turns_around(field.modes());
    let between = TAU / around.len() as f64;
    let highest: Vec<Sample> = (0..curve.panels.len())
        .flat_map(|panel| polynomials.local_maxima(panel, &around))
        .collect();
    let most_t = highest
        .iter()
        .fold(0.0_f64, |m, sample| m.max(sample.size_t));
    let (mut best, mut bound_t) = (highest[0], 0.0_f64);
    for sample in highest {
        let followed = if sample.size_t >= FOLLOWED * most_t {
            polynomials.follow(sample, between)
        } else {
            sample
        };
        if followed.size_t > best.size_t {
            best = followed;
        }
        bound_t = bound_t.max(followed.size_t + polynomials.missed_t(sample.panel));
    }
    let panel = curve.panels[best.panel];
    let coordinate = panel.from_m + 0.5 * (panel.to_m - panel.from_m) * (1.0 + best.x);
    let (r_m, z_m, _) = curve.shape.on(panel.face, coordinate);
    Peak {
        scanned_t: best.size_t,
        bound_t,
        place_m: (r_m.max(nearest_m), z_m),
        angle: best.angle,
    }
}

/// |B| at a place of a scanned curve.
#[derive(Debug, Clone, Copy)]
struct Sample {
    size_t: f64,
    panel: usize,
    /// On the panel, -1 to 1.
    x: f64,
    angle: f64,
}

/// The field along a curve, a polynomial on every panel.
struct Polynomials<'a> {
    field: &'a Field,
    basis: Basis,
    order: usize,
    /// Places on a panel that are sampled, and the nodes' shares in them.
    samples: Vec<(f64, Vec<f64>)>,
    legendre: Vec<Vec<f64>>,
}

impl<'a> Polynomials<'a> {
    fn new(order: usize, field: &'a Field) -> Self {
        let basis = Basis::new(gauss::rule(order));
        let samples = (0..=order)
            .map(|sample| {
                let x = 2.0 * sample as f64 / order as f64 - 1.0;
                let mut weights = vec![0.0; order];
                basis.weights(x, &mut weights);
                (x, weights)
            })
            .collect();
        Self {
            field,
            basis,
            order,
            samples,
            legendre: legendre(order),
        }
    }

    /// The components' modes on a panel, the nodes counting as `weights`.
    fn modes(&self, panel: usize, weights: &[f64]) -> Vec<[f64; COMPONENTS]> {
        let mut modes = vec![[0.0; COMPONENTS]; self.field.values.ncols()];
        for (place, weight) in weights.iter().enumerate() {
            let row = COMPONENTS * (panel * self.order + place);
            for (column, slot) in modes.iter_mut().enumerate() {
                for (component, value) in slot.iter_mut().enumerate() {
                    *value += weight * self.field.values[(row + component, column)];
                }
            }
        }
        modes
    }

    /// The samples of a panel that no neighbour on it, or beside it in angle, exceeds.
    fn local_maxima(&self, panel: usize, around: &[Vec<(f64, f64)>]) -> Vec<Sample> {
        let sizes: Vec<Vec<f64>> = self
            .samples
            .iter()
            .map(|(_, weights)| {
                let modes = self.modes(panel, weights);
                around.iter().map(|turns| size_t(&modes, turns)).collect()
            })
            .collect();
        let (rows, angles) = (sizes.len(), around.len());
        let mut found = Vec::new();
        for (row, (x, _)) in self.samples.iter().enumerate() {
            for turn in 0..angles {
                let size_t = sizes[row][turn];
                let highest = [
                    (row.saturating_sub(1), turn),
                    ((row + 1).min(rows - 1), turn),
                    (row, (turn + 1) % angles),
                    (row, (turn + angles - 1) % angles),
                ]
                .into_iter()
                .all(|(row, turn)| size_t >= sizes[row][turn]);
                if highest {
                    found.push(Sample {
                        size_t,
                        panel,
                        x: *x,
                        angle: TAU * turn as f64 / angles as f64,
                    });
                }
            }
        }
        found
    }

    /// Steps to the four sides that shrink where none of them leads higher.
    fn follow(&self, mut at: Sample, between: f64) -> Sample {
        let (mut step, mut turn) = (2.0 / self.order as f64, between);
        let mut weights = vec![0.0; self.order];
        let several = self.field.modes() > 1;
        while step > 1e-5 {
            let moves = [(step, 0.0), (-step, 0.0), (0.0, turn), (0.0, -turn)];
            let count = if several { moves.len() } else { 2 };
            let mut next = at;
            for (dx, dt) in &moves[..count] {
                let (x, angle) = ((at.x + dx).clamp(-1.0, 1.0), at.angle + dt);
                self.basis.weights(x, &mut weights);
                let turned = turns(angle, self.field.modes());
                let size_t = size_t(&self.modes(at.panel, &weights), &turned);
                if size_t > next.size_t {
                    next = Sample {
                        size_t,
                        x,
                        angle,
                        ..at
                    };
                }
            }
            if next.size_t > at.size_t {
                at = next;
            } else {
                step *= 0.5;
                turn *= 0.5;
            }
        }
        at
    }

    /// Part of the field that a panel's polynomials miss, T: from one degree to the next a panel's
    /// terms fall by 3.4 or more.
    fn missed_t(&self, panel: usize) -> f64 {
        let weights = &gauss::rule(self.order).weights;
        let highest = self.order.saturating_sub(2);
        self.legendre[highest..]
            .iter()
            .map(|polynomial| {
                let modes = self.modes(panel, &projection(polynomial, weights));
                let sum = modes.iter().fold([0.0; COMPONENTS], |sum, mode| {
                    std::array::from_fn(|i| sum[i] + mode[i].abs())
                });
                BEYOND * norm(sum)
            })
            .sum()
    }
}

fn size_t(modes: &[[f64; COMPONENTS]], turns: &[(f64, f64)]) -> f64 {
    norm(combine(turns, |component, column| modes[column][component]))
}
