//! The part of a triangle that is seen from above, among the triangles over it.
//!
//! The visible part of a piece is the piece without the convex regions where others are higher.
//! A supremum over it needs its border alone: parts of the piece's own sides, and parts of the
//! hiding regions' sides. Which parts, is decided on lines beside them, a hair inside the piece or
//! outside the region, so that what is shared with a neighbour needs no exact arithmetic.

use super::Looks;
use super::piece::{Extreme, Face, Hair, Point, Polygon, along};

/// How a piece is looked at: the resolution, and how much may yet be looked at.
#[derive(Clone, Copy)]
pub(super) struct Look<'a> {
    pub(super) hair: Hair,
    pub(super) effort: &'a Looks,
}

/// Looks that cutting one polygon by another takes.
const CUTS: usize = 4;

/// So many of the others are looked at first: what they hide needs no more.
pub(super) const HIGHEST: usize = 16;

/// The largest value over the visible part of `piece`, a part of `face`; `None` when it is hidden,
/// or where the effort is spent. Among many `others` the highest should come first.
pub(super) fn supremum_over_visible(
    face: &Face,
    piece: &Polygon,
    others: &[Face],
    look: Look<'_>,
    value: &impl Fn(Point) -> f64,
) -> Option<Extreme> {
    let Look { hair, effort } = look;
    if effort.spend(CUTS * others.len()) {
        return None;
    }
    if others.len() > HIGHEST
        && supremum_over_visible(face, piece, &others[..HIGHEST], look, value).is_none()
    {
        return None;
    }
    let regions: Vec<Polygon> = others
        .iter()
        .map(|other| other.hides(face, piece, hair.height_m))
        .filter(|region| region.width() > hair.plan_m / 4.0)
        .collect();
    if regions.is_empty() {
        return Some(piece.supremum(value));
    }
    // Every side of every region is held against every region.
    if effort.spend(CUTS * regions.len() * (regions.len() + 1)) {
        return None;
    }
    let mut best = None;
    let mut hidden = Vec::with_capacity(regions.len());
    let mut consider = |a: Point, b: Point, turn: f64, best: &mut Option<Extreme>| {
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        if length <= 16.0 * hair.plan_m {
            return;
        }
        // To the left of a -> b lies the inside of a counter-clockwise polygon.
        let step = turn * hair.plan_m / length;
        let offset = [-(b[1] - a[1]) * step, (b[0] - a[0]) * step];
        let beside = [a, b].map(|p| [p[0] + offset[0], p[1] + offset[1]]);
        let Some(mut open) = crossing(piece, beside, hair.plan_m) else {
            return;
        };
        hidden.clear();
        let slack = 8.0 * hair.plan_m / length;
        for region in &regions {
            if let Some([from, to]) = crossing(region, beside, hair.plan_m) {
                hidden.push([from - slack, to + slack]);
            }
        }
        hidden.sort_by(|p, q| p[0].total_cmp(&q[0]));
        let mut keep = |part: [f64; 2]| {
            if part[1] - part[0] > 2.0 * slack {
                let found = along(a, b, part, value);
                *best = Some(best.map_or(found, |best| best.or(found)));
            }
        };
        for [from, to] in &hidden {
            keep([open[0], open[1].min(*from)]);
            open[0] = open[0].max(*to);
        }
        keep(open);
    };
    for (a, b) in piece.sides() {
        consider(a, b, 1.0, &mut best);
    }
    for region in &regions {
        for (a, b) in region.sides() {
            consider(a, b, -1.0, &mut best);
        }
    }
    best
}

/// The part of a segment inside a convex polygon, as fractions of it.
fn crossing(polygon: &Polygon, [from, to]: [Point; 2], hair_m: f64) -> Option<[f64; 2]> {
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for (a, b) in polygon.sides() {
        // Two cuts through one corner leave it twice; what lies between has no direction.
        if (b[0] - a[0]).abs().max((b[1] - a[1]).abs()) < hair_m / 16.0 {
            continue;
        }
        let side = |p: Point| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
        let (start, end) = (side(from), side(to));
        if start < 0.0 && end < 0.0 {
            return None;
        }
        if start < 0.0 {
            first = first.max(start / (start - end));
        } else if end < 0.0 {
            last = last.min(start / (start - end));
        }
    }
    (first < last).then_some([first, last])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_is_cut_where_it_crosses_the_polygon() {
        let square = Polygon::of(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        let close = |found: Option<[f64; 2]>, requested: [f64; 2]| {
            let found = found.unwrap();
            assert!(
                (0..2).all(|k| (found[k] - requested[k]).abs() < 1e-15),
                "{found:?}"
            );
        };
        close(
            crossing(&square, [[-0.7, 0.3], [1.3, 0.3]], 1e-9),
            [0.35, 0.85],
        );
        close(
            crossing(&square, [[0.2, 0.7], [0.4, 1.3]], 1e-9),
            [0.0, 0.5],
        );
        assert!(crossing(&square, [[-0.7, 1.3], [1.3, 1.3]], 1e-9).is_none());
    }
}
