//! The double layer on panels: its operator at the nodes, and dipoles for places some way off.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::ops::Range;

use super::face::{Face, Node, Panel, Point, Resolution};
use super::near_sources::{LongestSide, add_halved};
use super::parts::{Parts, Place, coordinate_rounding_m};
use crate::steel::clearance::Clearance;
use crate::steel::passive::reaction::Induced;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;
use fluxform_numerics::vec3::{dot, minus, norm};

/// Distance in half sides from which on a panel's own nodes integrate the kernel.
pub(super) const FAR: f64 = 3.0;
/// Length of the panels of dipoles relative to their distance.
const DIPOLE_PANEL: f64 = 1.5;
/// Most nodes along a side of them.
const MOST_DIPOLES: usize = 24;

/// How a place lies to a panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Distance {
    /// In its plane, where its layers give nothing.
    InPlane,
    /// So close that it is taken in parts.
    Near,
    /// So far that its own nodes integrate the kernel.
    Far,
}

/// Faces cut into panels, with nodes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Surface {
    pub(super) faces: Vec<Face>,
    panels: Vec<Panel>,
    /// The first node of every panel.
    firsts: Vec<usize>,
    /// The panel of every node.
    panel_of: Vec<u32>,
    /// Panel by panel.
    pub(super) nodes: Vec<Node>,
    /// By the number of nodes along a panel's side, less one.
    bases: Vec<Basis>,
}

impl Surface {
    /// `faces` cut as `resolution` asks for, and so that no side is longer than `longest_m` says.
    #[must_use]
    pub(super) fn new(
        faces: Vec<Face>,
        resolution: &Resolution,
        longest_m: &LongestSide<'_>,
    ) -> Self {
        let mut panels: Vec<Panel> = Vec::new();
        for (number, face) in faces.iter().enumerate() {
            for panel in face.panels(number, resolution) {
                add_halved(panel, face, longest_m, &mut panels);
            }
        }
        let (mut nodes, mut firsts, mut panel_of) = (Vec::new(), Vec::new(), Vec::new());
        for (number, panel) in panels.iter().enumerate() {
            firsts.push(nodes.len());
            nodes.extend(panel.nodes(&faces[panel.face], [panel.order; 2]));
            panel_of.resize(nodes.len(), number as u32);
        }
        let bases = (1..=resolution.order).map(|order| Basis::new(gauss::rule(order)));
        Self {
            bases: bases.collect(),
            faces,
            panels,
            firsts,
            panel_of,
            nodes,
        }
    }

    /// Number of unknowns.
    #[must_use]
    pub fn size(&self) -> usize {
        self.nodes.len()
    }

    /// The face of a node.
    #[must_use]
    pub fn face_of(&self, node: usize) -> &Face {
        &self.faces[self.panels[self.panel_of[node] as usize].face]
    }

    /// A node's place in its face's parameters, and the distance of its neighbours in them.
    pub(super) fn parameters(&self, node: usize) -> [[f64; 2]; 2] {
        let number = self.panel_of[node] as usize;
        let Panel { order, range, .. } = self.panels[number];
        let [u0, u1, v0, v1] = range;
        let nodes = &gauss::rule(order).nodes;
        let at = |from: f64, to: f64, k: usize| from + 0.5 * (to - from) * (1.0 + nodes[k]);
        let within = node - self.firsts[number];
        let place = [at(u0, u1, within / order), at(v0, v1, within % order)];
        [place, [u1 - u0, v1 - v0].map(|side| side / order as f64)]
    }

    /// How a place lies to a panel.
    pub(super) fn distance_class(&self, number: usize, target_m: Point) -> Distance {
        let panel = &self.panels[number];
        let away = minus(target_m, panel.centre_m);
        let distance = norm(away);
        // What lies in the panel's plane; of a small body far from the origin as its coordinates round.
        let is_in = |normal: Point| {
            dot(normal, away).abs()
                < 1e-12 * (distance + panel.radius_m) + coordinate_rounding_m(target_m)
        };
        if panel.plane.is_some_and(is_in) {
            return Distance::InPlane;
        }
        if self.is_far(number, target_m) {
            Distance::Far
        } else {
            Distance::Near
        }
    }

    /// Whether the nodes of a panel are enough to integrate what it gives at a place.
    pub(super) fn is_far(&self, panel: usize, target_m: Point) -> bool {
        let panel = &self.panels[panel];
        let distance = norm(minus(target_m, panel.centre_m)) - panel.radius_m;
        distance > FAR * 0.5 * panel.sides_m[0].max(panel.sides_m[1])
    }

    /// The panels, one after the other.
    pub(super) fn panels(&self) -> &[Panel] {
        &self.panels
    }

    /// Every face as one panel, and the numbers of those that it is cut into.
    pub(super) fn whole_faces(&self) -> Vec<(Panel, Range<usize>)> {
        let faces = self.faces.iter().enumerate();
        let mut start = 0;
        faces
            .map(|(number, face)| {
                let panels = self.panels[start..].iter();
                let first = start;
                start += panels.take_while(|panel| panel.face == number).count();
                let whole = Panel::new(face, number, [0.0, 1.0, 0.0, 1.0], 1);
                (whole, first..start)
            })
            .collect()
    }

    /// The nodes of a panel.
    pub(super) fn nodes_of(&self, panel: usize) -> Range<usize> {
        let first = self.firsts[panel];
        first..first + self.panels[panel].order.pow(2)
    }

    /// Where a node is, seen from a panel.
    pub(super) fn place_of(&self, node: usize, panel: usize) -> Place {
        if self.panel_of[node] as usize == panel {
            Place::OnPanel
        } else {
            Place::OffPanel
        }
    }

    /// The parts of a panel: none yet.
    pub(super) fn parts_of(&self, number: usize) -> Parts<'_> {
        let panel = &self.panels[number];
        Parts::new(&self.faces[panel.face], self.basis_of(number), panel)
    }

    /// The basis on the nodes along a side of a panel.
    pub(super) fn basis_of(&self, panel: usize) -> &Basis {
        &self.bases[self.panels[panel].order - 1]
    }

    /// B of the layer `values`, one per node, at a place off the surface, and its gradient.
    #[must_use]
    pub(super) fn induced(&self, target_m: Point, values: &[f64]) -> Induced {
        let mut sum = Induced::default();
        self.elements(target_m, values, |node, value| {
            let strength = MU_0_T_M_PER_A * value / (4.0 * PI);
            sum.add_element(minus(target_m, node.place_m), node.area_m2, strength);
        });
        sum
    }

    /// Visits nodes with the layer `values` there, close enough to integrate what they give at a place off
    /// the surface.
    fn elements(&self, target_m: Point, values: &[f64], mut visit: impl FnMut(&Node, f64)) {
        for panel in 0..self.panels.len() {
            let own = self.nodes_of(panel);
            let values = &values[own.clone()];
            let mut visit_all = |values: &[f64], nodes: &[Node]| {
                values
                    .iter()
                    .zip(nodes)
                    .for_each(|(v, node)| visit(node, *v));
            };
            if self.is_far(panel, target_m) {
                visit_all(values, &self.nodes[own]);
                continue;
            }
            self.parts_of(panel).visit(target_m, &mut |rule| {
                visit_all(&rule.interpolated(values), &rule.nodes);
            });
        }
    }

    /// Dipoles that stand for the layers `values` (`[node][drive]`) at places with `clearance`: their places with
    /// unit normals, and their moments [dipole, drive].
    #[must_use]
    pub fn dipoles(
        &self,
        drives: usize,
        values: &[f64],
        clearance: Clearance,
        tolerance: f64,
    ) -> (Vec<[f64; 6]>, Vec<f64>) {
        let parts: Vec<_> = (self.whole_faces().into_par_iter())
            .map(|(whole, panels)| {
                let mut out = (Vec::new(), Vec::new());
                self.add_dipoles(
                    &whole, panels, drives, values, clearance, tolerance, &mut out,
                );
                out
            })
            .collect();
        let mut all = (Vec::new(), Vec::new());
        for (places, moments) in parts {
            all.0.extend(places);
            all.1.extend(moments);
        }
        all
    }

    #[expect(clippy::too_many_arguments, reason = "the recursion's state")]
    fn add_dipoles(
        &self,
        part: &Panel,
        panels: Range<usize>,
        drives: usize,
        values: &[f64],
        clearance: Clearance,
        tolerance: f64,
        out: &mut (Vec<[f64; 6]>, Vec<f64>),
    ) {
        fluxform_base::progress::poll();
        let face = &self.faces[part.face];
        let [low_m, high_m] = [-part.radius_m, part.radius_m].map(|by| part.centre_m[2] + by);
        let distance = clearance.from_heights_m(low_m, high_m);
        if part.sides_m[0].max(part.sides_m[1]) > DIPOLE_PANEL * distance {
            for half in part.halves(face) {
                self.add_dipoles(
                    &half,
                    panels.clone(),
                    drives,
                    values,
                    clearance,
                    tolerance,
                    out,
                );
            }
            return;
        }
        let orders = part.sides_m.map(|side| {
            let ratio = 2.0 * distance / side.max(1e-9 * distance);
            let digits = (1.0 / tolerance).ln() / (ratio + ratio.hypot(1.0)).ln();
            (digits.ceil() as usize + 1).clamp(2, MOST_DIPOLES)
        });
        let moments = self.moments(part, orders, panels, drives, values);
        for node in part.nodes(face, orders) {
            let area = norm(node.area_m2);
            let [nx, ny, nz] = node.area_m2.map(|n| n / area);
            let [x, y, z] = node.place_m;
            out.0.push([x, y, z, nx, ny, nz]);
        }
        out.1.extend(moments);
    }

    /// Moments at the nodes of a part of a face, [node][drive], that act from afar as the layers on it do.
    fn moments(
        &self,
        part: &Panel,
        orders: [usize; 2],
        panels: Range<usize>,
        drives: usize,
        values: &[f64],
    ) -> Vec<f64> {
        let face = &self.faces[part.face];
        let [first, second] = orders.map(|order| Basis::new(gauss::rule(order)));
        let mut moments = vec![0.0; orders[0] * orders[1] * drives];
        let (mut wu, mut wv) = (vec![0.0; orders[0]], vec![0.0; orders[1]]);
        let mut layer = vec![0.0; drives];
        for index in panels {
            let panel = &self.panels[index];
            let [pu0, pu1, pv0, pv1] = panel.range;
            let [u0, u1, v0, v1] = part.range;
            let shared = [pu0.max(u0), pu1.min(u1), pv0.max(v0), pv1.min(v1)];
            if shared[1] <= shared[0] || shared[3] <= shared[2] {
                continue;
            }
            let (first_node, count) = (self.firsts[index], panel.order);
            let basis = &self.bases[count - 1];
            let (mut ou, mut ov) = (vec![0.0; count], vec![0.0; count]);
            let fine = orders.map(|order| count + order.div_ceil(2));
            let rules = fine.map(gauss::rule);
            let common = Panel {
                range: shared,
                ..*panel
            };
            for (k, node) in common.nodes(face, fine).iter().enumerate() {
                let x = [rules[0].nodes[k / fine[1]], rules[1].nodes[k % fine[1]]];
                let at = |side: usize| {
                    let (from, to) = (shared[2 * side], shared[2 * side + 1]);
                    from + 0.5 * (to - from) * (1.0 + x[side])
                };
                let within = |range: [f64; 4], side: usize| {
                    let (lo, hi) = (range[2 * side], range[2 * side + 1]);
                    2.0 * (at(side) - lo) / (hi - lo) - 1.0
                };
                basis.weights(within(panel.range, 0), &mut ou);
                basis.weights(within(panel.range, 1), &mut ov);
                layer.fill(0.0);
                for (a, wa) in ou.iter().enumerate() {
                    for (b, wb) in ov.iter().enumerate() {
                        let from = (first_node + a * count + b) * drives;
                        for (sum, value) in layer.iter_mut().zip(&values[from..from + drives]) {
                            *sum += wa * wb * value;
                        }
                    }
                }
                first.weights(within(part.range, 0), &mut wu);
                second.weights(within(part.range, 1), &mut wv);
                let area = norm(node.area_m2);
                for (a, wa) in wu.iter().enumerate() {
                    for (b, wb) in wv.iter().enumerate() {
                        let to = (a * orders[1] + b) * drives;
                        for (moment, value) in moments[to..to + drives].iter_mut().zip(&layer) {
                            *moment += wa * wb * area * value;
                        }
                    }
                }
            }
        }
        moments
    }
}

/// A node's image under mirrors of these signs at these planes.
pub(super) fn mirrored(node: &Node, [sx, sy]: [f64; 2], [cx, cy]: [f64; 2]) -> Node {
    let [x, y, z] = node.place_m;
    let [ax, ay, az] = node.area_m2;
    Node {
        place_m: [cx + sx * (x - cx), cy + sy * (y - cy), z],
        area_m2: [sx * ax, sy * ay, az],
    }
}
