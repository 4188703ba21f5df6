//! The parts into which a panel is halved towards places close to it, with their nodes: taken for many places
//! together, because places near each other take mostly the same ones.

use super::face::{Face, Node, Panel, Point};
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;
use fluxform_numerics::vec3::{minus, norm};

/// Distance in half sides from which on the nodes of a finer rule integrate the kernel.
const NEAR: f64 = 1.1;
/// Halvings about a node of a curved panel itself, after which what is left is nothing.
const MOST_ON_PANEL: usize = 14;
/// The same about a place off the panel, however thin the wall between: halving ends by itself, at the latest where the
/// centres of both halves round to one.
const MOST_OFF_PANEL: usize = 112;
/// Nodes of the finer rule beyond the panel's own.
const MORE_NODES: usize = 3;

/// By how much coordinates like those of a place, of turned and moved bodies, may be rounded, m.
pub(super) fn coordinate_rounding_m(place_m: Point) -> f64 {
    64.0 * f64::EPSILON * norm(place_m)
}

/// A panel of a face and its parts so far.
pub(super) struct Parts<'a> {
    face: &'a Face,
    basis: &'a Basis,
    /// The whole panel first.
    parts: Vec<Part>,
}

struct Part {
    panel: Panel,
    /// The number of the first of its halves; the other follows.
    halves: Option<usize>,
    rule: Option<Rule>,
}

/// Where a place is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// A node of the panel itself.
    OnPanel,
    /// Anywhere else, however close: the other side of a thin wall.
    OffPanel,
}

/// The finer rule on a part.
pub(super) struct Rule {
    /// Nodes along each side.
    pub(super) order: usize,
    /// `order` along v for every one along u.
    pub(super) nodes: Vec<Node>,
    /// The whole panel's basis at the nodes along u and along v.
    pub(super) bases: [Vec<f64>; 2],
}

impl<'a> Parts<'a> {
    /// Those of `panel`, with the basis on its nodes along a side.
    pub(super) fn new(face: &'a Face, basis: &'a Basis, panel: &Panel) -> Self {
        Self {
            face,
            basis,
            parts: vec![Part::new(*panel)],
        }
    }

    /// Visits parts small enough for their rules to integrate the kernel at a place off the panel.
    pub(super) fn visit(&mut self, target_m: Point, visit: &mut impl FnMut(&Rule)) {
        let target = |_| (target_m, Place::OffPanel);
        self.visit_part(&target, &mut [0], [0; 2], &mut |rule, _| visit(rule));
    }

    /// The same at `some` of many targets, each part with those for which it is small enough.
    pub(super) fn visit_all(
        &mut self,
        target: &impl Fn(usize) -> (Point, Place),
        some: &mut [usize],
        visit: &mut impl FnMut(&Rule, &[usize]),
    ) {
        self.visit_part(target, some, [0; 2], visit);
    }

    /// The part of a number and a depth, or its parts.
    fn visit_part(
        &mut self,
        target: &impl Fn(usize) -> (Point, Place),
        some: &mut [usize],
        [number, depth]: [usize; 2],
        visit: &mut impl FnMut(&Rule, &[usize]),
    ) {
        let part = &self.parts[number].panel;
        let half = 0.5 * part.sides_m[0].max(part.sides_m[1]);
        let mut halved = 0;
        for k in 0..some.len() {
            let (target_m, place) = target(some[k]);
            let most = match place {
                Place::OnPanel => MOST_ON_PANEL,
                Place::OffPanel => MOST_OFF_PANEL,
            };
            let distance = norm(minus(target_m, part.centre_m)) - part.radius_m;
            if distance < NEAR * half && depth < most && half > coordinate_rounding_m(target_m) {
                some.swap(k, halved);
                halved += 1;
            }
        }
        let (halved, enough) = some.split_at_mut(halved);
        if !enough.is_empty() {
            let (whole, part) = (self.parts[0].panel, &mut self.parts[number]);
            let rule = (part.rule).get_or_insert_with(|| {
                let order = whole.order + MORE_NODES;
                Rule::new(self.face, self.basis, &whole, &part.panel, order)
            });
            visit(rule, enough);
        }
        if !halved.is_empty() {
            let first = self.halves(number);
            for half in [first, first + 1] {
                self.visit_part(target, halved, [half, depth + 1], visit);
            }
        }
    }

    /// The number of the first of a part's halves.
    fn halves(&mut self, number: usize) -> usize {
        if let Some(first) = self.parts[number].halves {
            return first;
        }
        let first = self.parts.len();
        let halves = self.parts[number].panel.halves(self.face);
        self.parts.extend(halves.map(Part::new));
        self.parts[number].halves = Some(first);
        first
    }
}

impl Part {
    fn new(panel: Panel) -> Self {
        Self {
            panel,
            halves: None,
            rule: None,
        }
    }
}

impl Rule {
    /// That of `order` nodes along each side of `part` of `whole`.
    pub(super) fn new(
        face: &Face,
        basis: &Basis,
        whole: &Panel,
        part: &Panel,
        order: usize,
    ) -> Self {
        let values = |side: usize| {
            let (lo, hi) = (whole.range[2 * side], whole.range[2 * side + 1]);
            let (from, to) = (part.range[2 * side], part.range[2 * side + 1]);
            let mut values = vec![0.0; order * whole.order];
            let places = values.chunks_exact_mut(whole.order);
            for (x, weights) in gauss::rule(order).nodes.iter().zip(places) {
                let at = from + 0.5 * (to - from) * (1.0 + x);
                basis.weights(2.0 * (at - lo) / (hi - lo) - 1.0, weights);
            }
            values
        };
        Self {
            order,
            nodes: part.nodes(face, [order; 2]),
            bases: [values(0), values(1)],
        }
    }

    /// The layer at its nodes, of `values` at those of the whole panel.
    pub(super) fn interpolated(&self, values: &[f64]) -> Vec<f64> {
        let [first, second] = &self.bases;
        let count = first.len() / self.order;
        let sum = |of: &[f64], with: &[f64]| of.iter().zip(with).map(|(a, b)| a * b).sum::<f64>();
        let mut out = Vec::with_capacity(self.nodes.len());
        let mut line = vec![0.0; count];
        for first in first.chunks_exact(count) {
            for (b, value) in line.iter_mut().enumerate() {
                *value = (first.iter().zip(values.chunks_exact(count)))
                    .map(|(a, row)| a * row[b])
                    .sum();
            }
            out.extend(second.chunks_exact(count).map(|second| sum(second, &line)));
        }
        out
    }
}
