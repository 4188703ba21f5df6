//! A surface operator for the tests, from nothing but the loop's field and adaptive quadrature.

use nalgebra::{DMatrix, DVector};

use crate::field::ring::{RingPoint, ring_field};
use crate::field::steel::lobatto;
use crate::numerics::gauss;

/// A cylinder's generatrix in panels of equal order.
pub(super) struct Surface {
    pub(super) r_breaks_m: Vec<f64>,
    pub(super) z_breaks_m: Vec<f64>,
    pub(super) order: usize,
    /// Ends of each panel, (r, z), along the generatrix.
    panels: Vec<[(f64, f64); 2]>,
    /// Radius, height and weight (2 pi r ds) of each Gauss node.
    pub(super) nodes: Vec<(f64, f64, f64)>,
}

/// Breakpoints on 0..1 whose distances from the ends shrink by `ratio`, `levels` times.
pub(super) fn graded(ratio: f64, levels: i32, left: bool, right: bool) -> Vec<f64> {
    let mut breaks = vec![0.0, 1.0];
    let half = if left && right { 0.5 } else { 1.0 };
    for level in 1..=levels {
        let distance = half * ratio.powi(level);
        breaks.extend(left.then_some(distance));
        breaks.extend(right.then_some(1.0 - distance));
    }
    if left && right {
        breaks.push(0.5);
    }
    breaks.sort_by(f64::total_cmp);
    breaks
}

impl Surface {
    pub(super) fn new(r_breaks_m: Vec<f64>, z_breaks_m: Vec<f64>, order: usize) -> Self {
        let (radius, bottom) = (r_breaks_m[r_breaks_m.len() - 1], z_breaks_m[0]);
        let top = z_breaks_m[z_breaks_m.len() - 1];
        let mut corners: Vec<(f64, f64)> = r_breaks_m.iter().map(|&r| (r, bottom)).collect();
        corners.extend(z_breaks_m[1..].iter().map(|&z| (radius, z)));
        corners.extend(r_breaks_m.iter().rev().skip(1).map(|&r| (r, top)));
        let panels: Vec<[(f64, f64); 2]> =
            corners.windows(2).map(|ends| [ends[0], ends[1]]).collect();
        let rule = gauss::rule(order);
        let nodes = panels
            .iter()
            .flat_map(|ends| {
                rule.nodes.iter().zip(&rule.weights).map(|(&x, w)| {
                    let (r, z) = along(*ends, x);
                    let length = (ends[1].0 - ends[0].0).abs() + (ends[1].1 - ends[0].1).abs();
                    (r, z, 0.5 * length * w * std::f64::consts::TAU * r)
                })
            })
            .collect();
        Self {
            r_breaks_m,
            z_breaks_m,
            order,
            panels,
            nodes,
        }
    }

    /// W = 1/2 + D, its diagonal from W 1 = 0.
    pub(super) fn w(&self) -> DMatrix<f64> {
        let count = self.nodes.len();
        let basis_nodes = &gauss::rule(self.order).nodes;
        let mut w = DMatrix::zeros(count, count);
        for (target, &(r, z, _)) in self.nodes.iter().enumerate() {
            for (panel, ends) in self.panels.iter().enumerate() {
                let on_side = ends[0].0 == ends[1].0;
                // The panel's coordinate t runs along r or z; the target's own is t = 0.
                let (start, end, distance) = if on_side {
                    (ends[0].1 - z, ends[1].1 - z, r - ends[0].0)
                } else {
                    (ends[0].0 - r, ends[1].0 - r, z - ends[0].1)
                };
                if !on_side && distance == 0.0 {
                    continue;
                }
                let (lo, hi) = (start.min(end), start.max(end));
                gauss::graded(lo, hi, distance, 1e-10, |t, weight| {
                    let kernel = if on_side {
                        -loop_at(ends[0].0, r, -distance, -t).0
                    } else {
                        let normal = if end > start { -1.0 } else { 1.0 };
                        let (b_z, b_r) = loop_at(r + t, r, t, distance);
                        normal * (distance * b_z + r * b_r) / (r + t)
                    };
                    let x = (2.0 * t - start - end) / (end - start);
                    let basis = lobatto::values(basis_nodes, &[x]);
                    for (k, value) in basis.iter().enumerate() {
                        w[(target, panel * self.order + k)] += weight * kernel * value;
                    }
                });
            }
            let sum: f64 = w.row(target).sum();
            if (sum + 0.5_f64).abs() > 1e-9 {
                println!("row {target} {r} {z} {:e}", sum + 0.5);
            }
            w[(target, target)] -= sum;
        }
        w
    }

    /// H on the axis at height z of the layer `v`, and its derivative: its currents are -dv/ds.
    pub(super) fn axis_field(&self, v: &DVector<f64>, z: f64) -> (f64, f64) {
        let rule = gauss::rule(self.order);
        let slopes = lobatto::slopes(&rule.nodes, &rule.nodes);
        let (mut h_z, mut dh_z) = (0.0, 0.0);
        for (panel, ends) in self.panels.iter().enumerate() {
            let slope = &slopes * v.rows(panel * self.order, self.order);
            for (k, w) in rule.weights.iter().enumerate() {
                let (a, at) = along(*ends, rule.nodes[k]);
                let (u, d2) = (z - at, a * a + (z - at) * (z - at));
                let current = -w * slope[k];
                h_z += current * a * a / (2.0 * d2.powf(1.5));
                dh_z -= current * 1.5 * a * a * u / d2.powf(2.5);
            }
        }
        (h_z, dh_z)
    }

    /// Integral of `slope` (r, z -> components along r, z of a gradient) along the generatrix to
    /// every node.
    pub(super) fn potential(&self, slope: impl Fn(f64, f64) -> (f64, f64)) -> DVector<f64> {
        let (order, rule, fine) = (self.order, gauss::rule(self.order), gauss::rule(8));
        let mut values = DVector::zeros(self.nodes.len());
        let mut so_far = 0.0;
        for (panel, ends) in self.panels.iter().enumerate() {
            let (dr, dz) = (ends[1].0 - ends[0].0, ends[1].1 - ends[0].1);
            let mut last = -1.0;
            for k in 0..=order {
                let next = rule.nodes.get(k).copied().unwrap_or(1.0);
                for (y, w) in fine.nodes.iter().zip(&fine.weights) {
                    let (r, z) = along(*ends, last + 0.5 * (next - last) * (1.0 + y));
                    let (s_r, s_z) = slope(r, z);
                    so_far += 0.25 * (next - last) * w * (s_r * dr + s_z * dz);
                }
                if k < order {
                    values[panel * order + k] = so_far;
                }
                last = next;
            }
        }
        values
    }
}

fn along([from, to]: [(f64, f64); 2], x: f64) -> (f64, f64) {
    let at = |a: f64, b: f64| {
        if x < 0.0 {
            a + 0.5 * (b - a) * (1.0 + x)
        } else {
            b - 0.5 * (b - a) * (1.0 - x)
        }
    };
    (at(from.0, to.0), at(from.1, to.1))
}

/// B_z and B_r over mu_0 of a loop of radius a at radius r, `u` above it.
fn loop_at(a: f64, r: f64, offset: f64, u: f64) -> (f64, f64) {
    let ring = ring_field(RingPoint {
        radius_m: a,
        r_m: r,
        offset_m: offset,
        u_m: u,
    });
    (ring.b_z, ring.b_r_over_r * r)
}
