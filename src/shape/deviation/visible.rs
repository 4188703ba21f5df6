//! The part of a triangle that is seen from above, among the triangles over it.
//!
//! The visible part of a piece is the piece without the convex regions where others are higher.
//! A supremum over it needs its border alone: parts of the piece's own sides, and parts of the
//! hiding regions' sides. Which parts, is decided on lines beside them, a hair inside the piece or
//! outside the region, so that what is shared with a neighbour needs no exact arithmetic.

use super::Looks;
use super::piece::{Extreme, Face, Hair, Point, Polygon, Rect, Segment, along};

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

/// The largest value over the visible part of `piece`, the part of `face` within `rect`; `None` when it is
/// hidden, or where the effort is spent. Among many `others` the highest should come first.
pub(super) fn supremum_over_visible(
    face: &Face,
    (rect, piece): (&Rect, &Polygon),
    others: &[Face],
    look: Look<'_>,
    value: &impl Fn(Point) -> f64,
) -> Option<Extreme> {
    let Look { hair, effort } = look;
    // What hides so narrow a piece is not distinguished.
    if piece.width() <= hair.plan_m || effort.spend(CUTS * others.len()) {
        return None;
    }
    if others.len() > HIGHEST
        && supremum_over_visible(face, (rect, piece), &others[..HIGHEST], look, value).is_none()
    {
        return None;
    }
    let regions: Vec<(&Face, Polygon)> = others
        .iter()
        .map(|other| (other, other.hides(face, piece, hair.height_m)))
        .filter(|(_, region)| region.width() > hair.plan_m / 4.0)
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
        let beside = Segment {
            ends_m: [a, b].map(|p| [p[0] + offset[0], p[1] + offset[1]]),
            part: [0.0, 1.0],
        };
        let Some(beside) = rect.along(beside).and_then(|part| face.along(part)) else {
            return;
        };
        let mut open = beside.part;
        hidden.clear();
        let slack = 8.0 * hair.plan_m / length;
        for (other, _) in &regions {
            if let Some(behind) = other.hides_along(face, beside, hair.height_m) {
                let [from, to] = behind.part;
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
    for (_, region) in &regions {
        for (a, b) in region.sides() {
            consider(a, b, -1.0, &mut best);
        }
    }
    best
}
