//! Points as dense as a deviation asks for: a quadtree whose leaves are bilinear patches.
//!
//! A rectangle is quartered until the surface covers all of it and its patch lies within the deviation
//! everywhere, certified as for a grid. Where the surface jumps or ends no patch can follow it; there the
//! quartering stops at rectangles no wider than the deviation, so that the step is known to that in
//! plan, and what such a rectangle weighs is its area that has surface. Where none of its corners has any, a
//! place that has is a point.

use std::collections::BTreeMap;

use super::{Probe, Scattered};
use crate::deviation::{Patch, Rect};
use crate::error::ShapeError;
use crate::height::Sample;
use crate::point_areas::LEAST;
use crate::point_flags::Marks;
use fluxform_base::progress::Progress;

/// Rectangles along the longer side to begin with.
const FIRST: f64 = 4.0;
/// A rectangle is quartered so often at most.
const DEEPEST: u32 = 20;

/// Points graded to a deviation.
#[derive(Debug, Clone, PartialEq)]
pub struct Adaptive {
    /// The points, weighted by the area of the leaves around them.
    pub points: Scattered,
    /// Leaves within the deviation.
    pub leaves: usize,
    /// The largest vertical difference in these, m.
    pub vertical_m: f64,
    /// Leaves at a rim or a jump, which the surface leaves or which it crosses in a step.
    pub borders: usize,
    /// The widest of these, m.
    pub border_m: f64,
}

/// Contents of patches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grading {
    /// How far, vertically, a patch may lie from the surface, m.
    pub max_deviation_m: f64,
    /// No patch is wider than this, m; infinite: as wide as the deviation allows.
    pub widest_m: f64,
}

/// A node's place, in steps of the finest rectangle.
type Node = [u32; 2];

struct Work<'a> {
    probe: &'a Probe<'a>,
    progress: &'a dyn Progress,
    /// Rectangles along each axis before the first quartering.
    first: [u32; 2],
    grading: Grading,
    /// Ordered by y, then x: the order of the output.
    nodes: BTreeMap<Node, Option<(Sample, Marks, f64)>>,
    /// Points between the nodes.
    between: Vec<([f64; 2], (Sample, Marks, f64))>,
    found: usize,
    result: Adaptive,
}

/// Points such that bilinear patches between them lie within the deviation of the surface,
/// vertically, or are no wider than it.
///
/// # Errors
/// [`ShapeError::Document`] for a deviation or a width that is not positive or asks for too many points;
/// [`ShapeError::Interrupted`].
pub fn adaptive(
    probe: &Probe<'_>,
    grading: Grading,
    progress: &dyn Progress,
) -> Result<Adaptive, ShapeError> {
    let max_deviation_m = grading.max_deviation_m;
    if !(max_deviation_m > 0.0 && max_deviation_m.is_finite()) {
        return Err(ShapeError::Document(format!(
            "the deviation is {} mm; it must be positive",
            max_deviation_m * 1000.0
        )));
    }
    if grading.widest_m.is_nan() || grading.widest_m <= 0.0 {
        return Err(ShapeError::Document(format!(
            "the widest patch is {} mm; it must be positive",
            grading.widest_m * 1000.0
        )));
    }
    let sides = probe.plan_m.sides();
    let longer = sides[0].max(sides[1]);
    if !(sides[0] > 0.0 && sides[1] > 0.0) {
        return Err(ShapeError::Document(
            "points to a deviation need a region with area; give two ends along x and y".into(),
        ));
    }
    let first = sides.map(|side| (FIRST * side / longer).ceil() as u32);
    let mut work = Work {
        probe,
        progress,
        first,
        grading,
        nodes: BTreeMap::new(),
        between: Vec::new(),
        found: 0,
        result: Adaptive {
            points: Scattered::default(),
            leaves: 0,
            vertical_m: 0.0,
            borders: 0,
            border_m: 0.0,
        },
    };
    let all = probe.faces();
    progress.begin("points", u64::from(first[0] * first[1]));
    for row in 0..first[1] {
        for column in 0..first[0] {
            let low = [column, row].map(|n| n << DEEPEST);
            let members = probe.faces_over(&work.rect(low, 1 << DEEPEST), &all);
            work.refine(low, DEEPEST, &members)?;
            progress.advance(1);
        }
    }
    progress.end();
    let Work {
        nodes,
        between,
        mut result,
        first,
        ..
    } = work;
    let at_nodes = nodes.into_iter().filter_map(|([row, column], node)| {
        let p = place(probe, first, [column, row]);
        Some((p, node?))
    });
    let mut all: Vec<_> = at_nodes.chain(between).collect();
    all.sort_by(|(p, _), (q, _)| p[1].total_cmp(&q[1]).then(p[0].total_cmp(&q[0])));
    for (p, (sample, marks, weight_m2)) in all {
        result.points.push(p, (sample, marks), weight_m2);
    }
    Ok(result)
}

/// A node's coordinates, m; both ends exact.
fn place(probe: &Probe<'_>, first: [u32; 2], node: Node) -> [f64; 2] {
    [0, 1].map(|k| {
        let last = f64::from(first[k]) * f64::from(1u32 << DEEPEST);
        let n = f64::from(node[k]);
        if n == last {
            return probe.plan_m.high_m[k];
        }
        let (a, b) = (probe.plan_m.low_m[k], probe.plan_m.high_m[k]);
        if n == 0.0 {
            a
        } else {
            ((last - n) * a + n * b) / last
        }
    })
}

impl Work<'_> {
    fn rect(&self, low: Node, size: u32) -> Rect {
        Rect {
            low_m: place(self.probe, self.first, low),
            high_m: place(self.probe, self.first, low.map(|n| n + size)),
        }
    }

    fn height_m(&mut self, node: Node) -> Option<f64> {
        let (probe, first) = (self.probe, self.first);
        let found = &mut self.found;
        let value = self.nodes.entry([node[1], node[0]]).or_insert_with(|| {
            let (sample, marks) = probe.at(place(probe, first, node))?;
            *found += 1;
            Some((sample, marks, 0.0))
        });
        value.map(|(sample, _, _)| sample.height_m)
    }

    fn refine(&mut self, low: Node, level: u32, members: &[u32]) -> Result<(), ShapeError> {
        self.progress.check()?;
        self.probe
            .check_count(self.found, "allow a larger deviation")?;
        let size = 1 << level;
        let rect = self.rect(low, size);
        let corners =
            [[0, 0], [size, 0], [0, size], [size, size]].map(|[x, y]| [low[0] + x, low[1] + y]);
        let heights = corners.map(|corner| self.height_m(corner));
        let sides = rect.sides();
        let widest_m = sides[0].max(sides[1]);
        if heights.iter().all(Option::is_none) && !self.probe.may_have_surface(&rect, members) {
            return Ok(());
        }
        if let [Some(a), Some(b), Some(c), Some(d)] = heights
            && (widest_m <= self.grading.widest_m || level == 0)
        {
            let corners_m = [a, b, c, d];
            let off_m = self.probe.deviation_m(&Patch { rect, corners_m }, members);
            // A hole or a notch between the corners is no surface that could deviate.
            if off_m <= self.grading.max_deviation_m && self.probe.covers_all(&rect, members) {
                self.result.leaves += 1;
                self.result.vertical_m = self.result.vertical_m.max(off_m);
                self.weigh(&corners, sides[0] * sides[1]);
                return Ok(());
            }
        }
        if widest_m <= self.grading.max_deviation_m || level == 0 {
            if heights.iter().all(Option::is_none) {
                self.weigh_between(&rect, members, widest_m);
                return Ok(());
            }
            self.result.borders += 1;
            self.result.border_m = self.result.border_m.max(widest_m);
            let covered_m2 = self.probe.covered_m2(&rect, members);
            self.weigh(&corners, covered_m2.max(LEAST * sides[0] * sides[1]));
            return Ok(());
        }
        let half = size / 2;
        for [x, y] in [[0, 0], [half, 0], [0, half], [half, half]] {
            let corner = [low[0] + x, low[1] + y];
            let members = self.probe.faces_over(&self.rect(corner, half), members);
            self.refine(corner, level - 1, &members)?;
        }
        Ok(())
    }

    /// Makes a point of the surface over a rectangle between its corners, if there is any.
    fn weigh_between(&mut self, rect: &Rect, members: &[u32], widest_m: f64) {
        let Some(standing) = self.probe.standing(rect, members) else {
            return;
        };
        let Some((sample, marks)) = self.probe.at(standing.at_m) else {
            return;
        };
        self.found += 1;
        self.result.borders += 1;
        self.result.border_m = self.result.border_m.max(widest_m);
        let point = (sample, marks, standing.area_m2);
        self.between.push((standing.at_m, point));
    }

    /// Gives a leaf's area to its corners with surface, in equal parts.
    fn weigh(&mut self, corners: &[Node; 4], area_m2: f64) {
        let has = |corner: &&Node| matches!(self.nodes.get(&[corner[1], corner[0]]), Some(Some(_)));
        let share_m2 = area_m2 / corners.iter().filter(has).count() as f64;
        for corner in corners {
            if let Some(Some((_, _, weight_m2))) = self.nodes.get_mut(&[corner[1], corner[0]]) {
                *weight_m2 += share_m2;
            }
        }
    }
}
