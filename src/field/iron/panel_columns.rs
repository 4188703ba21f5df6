//! What the layers on the nodes of panels give at many places: the potential int n'.(x - y) / (4 pi |x - y|^3) v(y) dS,
//! and its field.

use std::f64::consts::PI;

use super::face::{Node, Point};
use super::parts::{Parts, Place, Rule};
use super::surface::{Distance, Surface};
use crate::dipole::potential;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes};

/// Of the kernel.
const SCALE: f64 = 1.0 / (4.0 * PI);
/// Most nodes along a panel's side.
const MOST_ORDER: usize = 8;

/// Places, nodes of the surface or off it.
#[derive(Default)]
pub(super) struct Targets {
    axes_m: [Vec<f64>; 3],
    /// The node at the place, where there is one.
    nodes: Vec<Option<usize>>,
}

impl Targets {
    pub(super) fn push(&mut self, place_m: Point, node: Option<usize>) {
        for (axis, at) in self.axes_m.iter_mut().zip(place_m) {
            axis.push(at);
        }
        self.nodes.push(node);
    }

    pub(super) fn count(&self) -> usize {
        self.nodes.len()
    }

    fn place_m(&self, target: usize) -> Point {
        [0, 1, 2].map(|k| self.axes_m[k][target])
    }

    /// Some places, the last repeated where they are fewer than lanes.
    #[inline(always)]
    fn lanes(&self, some: &[usize]) -> [Lanes; 3] {
        let of = |k: usize| {
            Lanes(std::array::from_fn(|lane| {
                self.axes_m[k][some[lane.min(some.len() - 1)]]
            }))
        };
        [of(0), of(1), of(2)]
    }
}

impl Surface {
    /// Adds to `columns`, [node of the panel][target], what the layers of a panel's nodes give at `targets`; at nodes as a
    /// principal value, to which the place of a node itself gives nothing.
    pub(super) fn panel_columns(&self, panel: usize, targets: &Targets, columns: &mut [f64]) {
        let (mut far, mut near) = (Vec::new(), Vec::new());
        for target in 0..targets.count() {
            match self.distance_class(panel, targets.place_m(target)) {
                Distance::InPlane => {}
                Distance::Near => near.push(target),
                Distance::Far => far.push(target),
            }
        }
        dispatch::run(FarColumns {
            targets,
            some: &far,
            nodes: &self.nodes[self.nodes_of(panel)],
            columns,
        });
        if near.is_empty() {
            return;
        }
        let order = self.panels()[panel].order;
        let place = |target: usize| {
            let place = targets.nodes[target].map(|node| self.place_of(node, panel));
            (targets.place_m(target), place.unwrap_or(Place::OffPanel))
        };
        let mut parts: Parts<'_> = self.parts_of(panel);
        parts.visit_all(&place, &mut near, &mut |rule, some| {
            dispatch::run(NearColumns {
                targets,
                some,
                rule,
                order,
                columns,
            });
        });
    }

    /// B of the layer `values`, one per node, at a place off the surface, T.
    #[must_use]
    pub fn field_t(&self, target_m: Point, values: &[f64]) -> Point {
        let mut target = Targets::default();
        target.push(target_m, None);
        self.fields_t(&target, values)[0]
    }

    /// The same at `targets`.
    pub(super) fn fields_t(&self, targets: &Targets, values: &[f64]) -> Vec<Point> {
        let mut fields_t = vec![[0.0; 3]; targets.count()];
        let place = |target: usize| (targets.place_m(target), Place::OffPanel);
        for panel in 0..self.panels().len() {
            fluxform_base::progress::poll();
            let nodes = self.nodes_of(panel);
            let values = &values[nodes.clone()];
            let is_far = |target: &usize| self.is_far(panel, targets.place_m(*target));
            let (far, mut near): (Vec<_>, Vec<_>) = (0..targets.count()).partition(is_far);
            dispatch::run(Fields {
                targets,
                some: &far,
                nodes: &self.nodes[nodes],
                values,
                fields_t: &mut fields_t,
            });
            if near.is_empty() {
                continue;
            }
            let mut parts: Parts<'_> = self.parts_of(panel);
            parts.visit_all(&place, &mut near, &mut |rule, some| {
                dispatch::run(Fields {
                    targets,
                    some,
                    nodes: &rule.nodes,
                    values: &rule.interpolated(values),
                    fields_t: &mut fields_t,
                });
            });
        }
        fields_t
    }
}

/// B that nodes with a layer give, added to that of some targets.
struct Fields<'a> {
    targets: &'a Targets,
    some: &'a [usize],
    nodes: &'a [Node],
    values: &'a [f64],
    fields_t: &'a mut [Point],
}

impl Kernel for Fields<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        for some in self.some.chunks(LANES) {
            let at = self.targets.lanes(some);
            let mut sums = [Lanes::splat(0.0); 3];
            for (node, value) in self.nodes.iter().zip(self.values) {
                let (y, n) = (node.place_m, node.area_m2);
                let d = [at[0] - y[0], at[1] - y[1], at[2] - y[2]];
                let square = d[0].mul_add::<FMA>(d[0], d[1].mul_add::<FMA>(d[1], d[2] * d[2]));
                let size = Lanes::splat(MU_0_T_M_PER_A * SCALE * value) / (square * square.sqrt());
                let along = (d[0] * n[0] + d[1] * n[1] + d[2] * n[2]) * 3.0 / square;
                for ((sum, d), n) in sums.iter_mut().zip(d).zip(n) {
                    *sum = *sum + size * (Lanes::splat(n) - along * d);
                }
            }
            for (lane, target) in some.iter().enumerate() {
                for (field, sum) in self.fields_t[*target].iter_mut().zip(&sums) {
                    *field += sum.0[lane];
                }
            }
        }
    }
}

/// The columns of a panel's own nodes.
struct FarColumns<'a> {
    targets: &'a Targets,
    some: &'a [usize],
    nodes: &'a [Node],
    columns: &'a mut [f64],
}

impl Kernel for FarColumns<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let count = self.targets.count();
        for some in self.some.chunks(LANES) {
            let at = self.targets.lanes(some);
            for (node, column) in self.nodes.iter().zip(self.columns.chunks_exact_mut(count)) {
                let values = potential::<FMA>(at, node.place_m, node.area_m2, SCALE);
                // Mostly one after the other.
                if some.len() == LANES && some[LANES - 1] == some[0] + LANES - 1 {
                    let column = &mut column[some[0]..][..LANES];
                    column.iter_mut().zip(values.0).for_each(|(c, v)| *c += v);
                } else {
                    some.iter()
                        .zip(values.0)
                        .for_each(|(at, v)| column[*at] += v);
                }
            }
        }
    }
}

/// The part of columns that the nodes of a part of the panel give, `order` nodes along each side of the panel.
struct NearColumns<'a> {
    targets: &'a Targets,
    some: &'a [usize],
    rule: &'a Rule,
    order: usize,
    columns: &'a mut [f64],
}

impl Kernel for NearColumns<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let Self { rule, order, .. } = self;
        let count = self.targets.count();
        let [first, second] = &rule.bases;
        for some in self.some.chunks(LANES) {
            let at = self.targets.lanes(some);
            let mut sums = [[Lanes::splat(0.0); MOST_ORDER]; MOST_ORDER];
            let lines = rule.nodes.chunks_exact(rule.order);
            for (nodes, first) in lines.zip(first.chunks_exact(order)) {
                let mut line = [Lanes::splat(0.0); MOST_ORDER];
                for (node, second) in nodes.iter().zip(second.chunks_exact(order)) {
                    let values = potential::<FMA>(at, node.place_m, node.area_m2, SCALE);
                    // At the node itself 0/0.
                    let values = Lanes(values.0.map(|v| if v.is_nan() { 0.0 } else { v }));
                    for (sum, weight) in line.iter_mut().zip(second) {
                        *sum = *sum + values * *weight;
                    }
                }
                for (sums, weight) in sums.iter_mut().zip(first) {
                    for (sum, line) in sums[..order].iter_mut().zip(&line) {
                        *sum = *sum + *line * *weight;
                    }
                }
            }
            for (a, sums) in sums[..order].iter().enumerate() {
                for (b, sum) in sums[..order].iter().enumerate() {
                    let column = &mut self.columns[(a * order + b) * count..][..count];
                    for (target, value) in some.iter().zip(sum.0) {
                        column[*target] += value;
                    }
                }
            }
        }
    }
}
