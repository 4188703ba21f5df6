//! Faces that lie in sheets over each other: which sheets hide those below, in one pass.
//!
//! How many faces lie over a point changes only where an edge is crossed, and not even there where
//! two faces meet on either side of it. So where, inside a rectangle, every edge of a set of faces
//! has as many of them on its left as on its right, that number is the same all over it: their
//! area over the rectangle's. At least 1: they cover it, and what lies lower than all of them is
//! hidden. Exactly 1: none of them hides any other. A fan of any number of facets, or a fine mesh
//! over its floor, is seen through in the time that sorting takes.

use super::piece::{Face, Point, Rect};
use super::{Faces, TOGETHER};

/// So many of the upper sheets are tried together.
const MOST_SHEETS: usize = 4;
/// How far the ratio of areas may be off a whole number by rounding.
const RATIO: f64 = 1e-6;

/// Sheets that may be seen in a rectangle.
pub(super) struct Sheets {
    /// Faces without those below sheets that cover the rectangle.
    pub(super) faces: Vec<u32>,
    /// Whether these cover it, none over another.
    pub(super) plain: bool,
}

/// A face's part in the rectangle.
struct Part {
    face: u32,
    low_m: f64,
    high_m: f64,
    area: f64,
}

/// An edge's ends in plan, in their own order.
type Ends = [[u64; 2]; 2];

impl Faces {
    /// The faces of `among` without those under sheets that cover the rectangle.
    pub(super) fn sheets(&self, rect: &Rect, among: &[u32]) -> Sheets {
        let mut parts: Vec<Part> = among
            .iter()
            .filter_map(|face| self.part(*face, rect))
            .collect();
        parts.sort_by(|p, q| q.high_m.total_cmp(&p.high_m).then(p.face.cmp(&q.face)));
        let faces = |count: usize| parts[..count].iter().map(|part| part.face).collect();
        for count in self.ends_of_sheets(&parts) {
            let Some(number) = self.number_over(rect, &parts[..count]) else {
                continue;
            };
            if number > 0 {
                return Sheets {
                    faces: faces(count),
                    plain: number == 1,
                };
            }
        }
        Sheets {
            faces: faces(parts.len()),
            plain: false,
        }
    }

    fn part(&self, face: u32, rect: &Rect) -> Option<Part> {
        let part = self.list[face as usize].within(rect);
        // A sliver counts as well: its edges are its neighbours'.
        if part.corners().is_empty() {
            return None;
        }
        let heights = (part.corners().iter()).map(|p| self.list[face as usize].height(*p));
        let (low_m, high_m) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| {
            (low.min(h), high.max(h))
        });
        Some(Part {
            face,
            low_m,
            high_m,
            area: part.area(),
        })
    }

    /// How many of the parts, the highest first, belong to the first sheet, the first two and so
    /// on: below each of these numbers all others lie lower.
    fn ends_of_sheets(&self, parts: &[Part]) -> Vec<usize> {
        let mut ends = Vec::new();
        let mut lowest = f64::INFINITY;
        for (k, part) in parts.iter().enumerate() {
            if k > 0 && part.high_m < lowest - self.hair.height_m {
                ends.push(k);
                if ends.len() == MOST_SHEETS {
                    break;
                }
            }
            lowest = lowest.min(part.low_m);
        }
        if ends.len() < MOST_SHEETS && parts.len() > TOGETHER {
            ends.push(parts.len());
        }
        ends
    }

    /// How many of the parts lie over every point of the rectangle; `None` where that differs.
    fn number_over(&self, rect: &Rect, parts: &[Part]) -> Option<usize> {
        let area: f64 = parts.iter().map(|part| part.area).sum();
        let [width, depth] = rect.sides();
        let ratio = area / (width * depth);
        let off = (ratio - ratio.round()).abs();
        if off.is_nan() || off > RATIO * ratio.max(1.0) {
            return None;
        }
        // An edge along the border may have its other face outside.
        let hair = 4.0 * self.hair.plan_m;
        let inside = Rect {
            low_m: rect.low_m.map(|c| c + hair),
            high_m: rect.high_m.map(|c| c - hair),
        };
        let mut edges: Vec<(Ends, i32)> = Vec::new();
        for part in parts {
            edges_inside(&self.list[part.face as usize], &inside, &mut edges);
        }
        edges.sort_unstable();
        let level = |group: &[(Ends, i32)]| group.iter().map(|edge| edge.1).sum::<i32>() == 0;
        let level = edges.chunk_by(|a, b| a.0 == b.0).all(level);
        level.then_some(ratio.round() as usize)
    }
}

/// The face's edges that pass through the inside of the rectangle: their ends, and on which side
/// the face is.
fn edges_inside(face: &Face, rect: &Rect, edges: &mut Vec<(Ends, i32)>) {
    for k in 0..3 {
        let (a, b) = (face.corners[k], face.corners[(k + 1) % 3]);
        if !passes(a, b, rect) {
            continue;
        }
        // Adding 0 turns -0 into 0.
        let [p, q] = [a, b].map(|p| p.map(|c| (c + 0.0).to_bits()));
        edges.push(if p <= q { ([p, q], 1) } else { ([q, p], -1) });
    }
}

/// Whether a segment may have a point inside the rectangle: never false where it has.
fn passes(a: Point, b: Point, rect: &Rect) -> bool {
    for k in 0..2 {
        if a[k].max(b[k]) <= rect.low_m[k] || a[k].min(b[k]) >= rect.high_m[k] {
            return false;
        }
    }
    let side = |p: Point| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let sides = rect.corners().map(side);
    let largest = sides.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
    // A sign that rounding may turn counts as both sides.
    let slack = 1e-12 * largest;
    sides.iter().any(|s| *s < slack) && sides.iter().any(|s| *s > -slack)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deviation::Looks;
    use crate::document::Placement;
    use crate::file_mesh::{FileMesh, Triangle};
    use crate::height::Grid;
    use crate::mesh::Mesh;
    use crate::placement::Transform;
    use fluxform_numerics::axis::Axis;

    const RECT: Rect = Rect {
        low_m: [-0.7, -0.6],
        high_m: [0.5, 0.8],
    };

    fn sheets_of(triangles: Vec<Triangle>) -> (usize, bool) {
        let file = FileMesh {
            triangles,
            ..FileMesh::default()
        };
        let mesh = Mesh::place(file, &Transform::new(1.0, &Placement::default())).unwrap();
        let axis = Axis {
            from: -1.0,
            to: 1.0,
            samples: 2,
        };
        let grid = Grid {
            x_m: axis,
            y_m: axis,
        };
        let faces = Faces::new(&mesh, &grid, Looks::endless());
        let sheets = faces.sheets(&RECT, &faces.all());
        (sheets.faces.len(), sheets.plain)
    }

    /// A fan of so many facets around a point, its border far outside.
    fn fan(count: usize, [x, y]: [f64; 2], height: f64, rim: f64) -> Vec<Triangle> {
        let at = |k: usize| {
            let t = std::f64::consts::TAU * (k % count) as f64 / count as f64;
            [x + 5.0 * t.cos(), y + 5.0 * t.sin(), rim]
        };
        (0..count)
            .map(|k| [[x, y, height], at(k), at(k + 1)])
            .collect()
    }

    #[test]
    fn a_fan_over_its_floor_is_one_plain_sheet() {
        let cone = fan(100, [0.1, -0.2], 2.0, 1.0);
        let floor = fan(70, [-0.1, 0.3], 0.2, 0.1);
        let (count, plain) = sheets_of([floor.clone(), cone.clone()].concat());
        assert!(plain && count == sheets_of(cone.clone()).0, "{count}");
        // With a facet missing the floor is seen through the hole.
        for hole in [0, 37] {
            let mut open = cone.clone();
            open.remove(hole);
            let (_, plain) = sheets_of([floor.clone(), open].concat());
            assert!(!plain, "{hole}");
        }
    }

    /// A facet too many makes up for the area of one that is missing, not for its edges.
    #[test]
    fn what_overlaps_is_no_plain_sheet() {
        let mut twice = fan(16, [0.1, -0.2], 2.0, 1.0);
        twice[3] = twice[11];
        assert!(!sheets_of(twice.clone()).1);
        let whole = fan(16, [0.1, -0.2], 2.0, 1.0);
        // Two fans through each other cover the rectangle twice.
        let other = fan(20, [0.2, 0.3], 1.8, 1.1);
        let (count, plain) = sheets_of([whole, other].concat());
        assert!(!plain && count == 36, "{count}");
    }

    #[test]
    fn an_edge_passes_through_a_rectangle_from_either_end() {
        for (a, b, expected) in [
            ([-2.0, -2.0], [2.0, 2.0], true),
            ([-2.0, 0.0], [0.0, 0.7], true),
            ([-2.0, 0.0], [-0.6, 2.5], false),
            ([0.1, 0.1], [0.2, 0.2], true),
            ([-0.7, -2.0], [-0.7, 2.0], false),
            ([-2.0, 0.9], [2.0, 0.9], false),
        ] {
            assert_eq!(passes(a, b, &RECT), expected, "{a:?} {b:?}");
            assert_eq!(passes(b, a, &RECT), expected, "{b:?} {a:?}");
        }
    }
}
