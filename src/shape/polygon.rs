//! Faces with more than three corners, cut into triangles.

use std::collections::HashMap;

use earcut::Earcut;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};

use crate::file_mesh::Triangle;
use fluxform_numerics::vec3::{cross, dot, minus};

/// A face with more corners was not written by a program that draws faces, and to cut it could
/// take minutes.
pub(super) const MOST_CORNERS: usize = 50_000;
/// Ears of more corners than this may take a time that grows with their square.
const MOST_EARS: usize = 1000;
/// How far the areas of a polygon and of its triangles may differ by rounding.
const SAME_AREA: f64 = 1e-9;
/// Turns smaller than this, against the polygon's area, are rounding and no notch.
const FLAT_TURN: f64 = 1e-9;

/// Cuts polygons; keeps its working memory from one to the next.
pub(super) struct Cutter {
    earcut: Earcut<f64>,
    plan: Vec<[f64; 2]>,
    corners: Vec<u32>,
}

impl Cutter {
    pub(super) fn new() -> Self {
        Self {
            earcut: Earcut::new(),
            plan: Vec::new(),
            corners: Vec::new(),
        }
    }

    /// Adds the triangles of a simple polygon: a fan where it is convex, ears where it is not (a
    /// fan would cover its notches). Fewer than three corners are no face.
    pub(super) fn cut(&mut self, polygon: &[[f64; 3]], triangles: &mut Vec<Triangle>) {
        if polygon.len() > 3 {
            let normal = area_vector(polygon);
            if !is_convex(polygon, normal) && self.cut_notched(polygon, normal) {
                let corners = self.corners.chunks_exact(3);
                triangles.extend(corners.map(|c| [0, 1, 2].map(|k| polygon[c[k] as usize])));
                return;
            }
        }
        // Of a polygon that crosses itself a fan keeps at least the sides.
        if let [first, rest @ ..] = polygon {
            triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
    }

    /// Cuts the polygon as seen along the axis that its normal is nearest to; false where no way
    /// of cutting covers its area.
    fn cut_notched(&mut self, polygon: &[[f64; 3]], normal: [f64; 3]) -> bool {
        let mut drop = 0;
        for k in 1..3 {
            if normal[k].abs() > normal[drop].abs() {
                drop = k;
            }
        }
        let (mut u, mut v) = ((drop + 1) % 3, (drop + 2) % 3);
        if normal[drop] < 0.0 {
            (u, v) = (v, u);
        }
        self.plan.clear();
        self.plan.extend(polygon.iter().map(|p| [p[u], p[v]]));
        let twice_area = normal[drop].abs();
        // Ears may be left out where corners lie in a row or twice: that opens the surface there.
        let ears = polygon.len() <= MOST_EARS && {
            self.earcut
                .earcut(self.plan.iter().copied(), &[], &mut self.corners);
            self.turn_alike();
            self.covers(twice_area)
        };
        if ears && self.corners.len() == 3 * (polygon.len() - 2) {
            return true;
        }
        let of_ears = std::mem::take(&mut self.corners);
        self.corners = constrained(&self.plan);
        self.turn_alike();
        if self.covers(twice_area) {
            return true;
        }
        self.corners = of_ears;
        ears
    }

    /// The order in which a triangle's corners come out is not promised: it is made the polygon's.
    fn turn_alike(&mut self) {
        for corners in self.corners.chunks_exact_mut(3) {
            if twice_area(&self.plan, corners) < 0.0 {
                corners.swap(1, 2);
            }
        }
    }

    /// Whether the triangles have the polygon's area.
    fn covers(&self, expected: f64) -> bool {
        let triangles = self.corners.chunks_exact(3);
        let sum: f64 = triangles.map(|c| twice_area(&self.plan, c)).sum();
        (sum - expected).abs() <= SAME_AREA * expected
    }
}

fn twice_area(plan: &[[f64; 2]], corners: &[u32]) -> f64 {
    let [a, b, c] = [0, 1, 2].map(|k| plan[corners[k] as usize]);
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// A corner of a polygon among the vertices of a triangulation.
struct Corner {
    at: Point2<f64>,
    index: u32,
}

impl HasPosition for Corner {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.at
    }
}

/// The triangles inside a polygon by a Delaunay triangulation that keeps its sides, each as three
/// corners; none where that cannot be. A triangle is inside where a way to it from outside crosses
/// an odd number of sides.
fn constrained(plan: &[[f64; 2]]) -> Vec<u32> {
    let corner = |(index, &[x, y]): (usize, &[f64; 2])| Corner {
        // Adding 0 turns -0 into 0.
        at: Point2::new(x + 0.0, y + 0.0),
        index: index as u32,
    };
    let corners: Vec<Corner> = plan.iter().enumerate().map(corner).collect();
    let count = plan.len();
    let side = |k: usize| [k, (k + 1) % count];
    let bits = |p: Point2<f64>| [p.x.to_bits(), p.y.to_bits()];
    let ends = |a: Point2<f64>, b: Point2<f64>| {
        let (a, b) = (bits(a), bits(b));
        if a < b { [a, b] } else { [b, a] }
    };
    // A side that is passed both ways, as to a hole, is crossed twice.
    let mut passed: HashMap<[[u64; 2]; 2], u32> = HashMap::new();
    let mut sides = Vec::with_capacity(count);
    for [a, b] in (0..count).map(side) {
        let (p, q) = (corners[a].at, corners[b].at);
        if p != q {
            *passed.entry(ends(p, q)).or_default() += 1;
            sides.push([a, b]);
        }
    }
    let mut crossed = false;
    let made =
        ConstrainedDelaunayTriangulation::<Corner>::try_bulk_load_cdt(corners, sides, |_| {
            crossed = true;
        });
    let Ok(made) = made else { return Vec::new() };
    if crossed {
        return Vec::new();
    }
    let mut inside: Vec<Option<bool>> = vec![None; made.num_all_faces()];
    let outer = made.outer_face();
    inside[outer.fix().index()] = Some(false);
    let mut open: Vec<_> = made.convex_hull().map(|edge| edge.rev()).collect();
    open.extend(made.convex_hull());
    while let Some(edge) = open.pop() {
        fluxform_base::progress::poll();
        let (here, there) = (edge.face(), edge.rev().face());
        let (Some(state), None) = (inside[here.fix().index()], inside[there.fix().index()]) else {
            continue;
        };
        let [from, to] = edge.positions();
        let times = match edge.is_constraint_edge() {
            // A side that a corner lies on was parted; it is passed once.
            true => passed.get(&ends(from, to)).copied().unwrap_or(1),
            false => 0,
        };
        inside[there.fix().index()] = Some(state ^ (times % 2 == 1));
        if let Some(face) = there.as_inner() {
            open.extend(face.adjacent_edges());
        }
    }
    made.inner_faces()
        .filter(|face| inside[face.fix().index()] == Some(true))
        .flat_map(|face| face.vertices().map(|vertex| vertex.data().index))
        .collect()
}

/// Polygons by their corners' indices, and where each is in its file.
#[derive(Default)]
pub(super) struct Faces {
    /// Indices of all corners.
    indices: Vec<u32>,
    /// Where each face's corners end, and its place.
    ends: Vec<(u32, u32)>,
}

impl Faces {
    /// Adds a corner to the face that is being read.
    pub(super) fn push_index(&mut self, index: u32) {
        self.indices.push(index);
    }

    /// How many corners the face that is being read has.
    pub(super) fn corners(&self) -> usize {
        self.indices.len() - self.ends.last().map_or(0, |end| end.0 as usize)
    }

    /// The face that was being read is whole.
    pub(super) fn end_face(&mut self, place: usize) {
        let place = u32::try_from(place).unwrap_or(u32::MAX);
        self.ends.push((self.indices.len() as u32, place));
    }

    /// True without a face.
    pub(super) fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The faces' triangles, and how many faces have fewer than three corners.
    ///
    /// # Errors
    /// The place and the index of a corner without a vertex.
    pub(super) fn cut(
        &self,
        vertices: &[[f64; 3]],
    ) -> Result<(Vec<Triangle>, usize), (usize, u32)> {
        let expected = self.indices.len().saturating_sub(2 * self.ends.len());
        let mut triangles = Vec::with_capacity(expected);
        let mut cutter = Cutter::new();
        let mut polygon = Vec::new();
        let (mut from, mut short) = (0, 0);
        for &(end, place) in &self.ends {
            fluxform_base::progress::poll();
            polygon.clear();
            for &index in &self.indices[from..end as usize] {
                let vertex = vertices.get(index as usize);
                polygon.push(*vertex.ok_or((place as usize, index))?);
            }
            from = end as usize;
            short += usize::from(polygon.len() < 3);
            cutter.cut(&polygon, &mut triangles);
        }
        Ok((triangles, short))
    }
}

/// Twice the polygon's vector area.
fn area_vector(polygon: &[[f64; 3]]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for pair in polygon[1..].windows(2) {
        let part = cross(minus(pair[0], polygon[0]), minus(pair[1], polygon[0]));
        for k in 0..3 {
            sum[k] += part[k];
        }
    }
    sum
}

/// True where no corner turns against the polygon's sense.
fn is_convex(polygon: &[[f64; 3]], normal: [f64; 3]) -> bool {
    let n = polygon.len();
    let least = -FLAT_TURN * dot(normal, normal);
    (0..n).all(|i| {
        let [a, b, c] = [i, i + 1, i + 2].map(|k| polygon[k % n]);
        dot(cross(minus(b, a), minus(c, b)), normal) >= least
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn areas(polygon: &[[f64; 3]]) -> (f64, [f64; 3]) {
        let mut triangles = Vec::new();
        Cutter::new().cut(polygon, &mut triangles);
        assert_eq!(triangles.len(), polygon.len().saturating_sub(2));
        let (mut total, mut vector) = (0.0, [0.0; 3]);
        for t in &triangles {
            let twice = area_vector(t);
            total += 0.5 * twice.iter().map(|c| c * c).sum::<f64>().sqrt();
            for k in 0..3 {
                vector[k] += 0.5 * twice[k];
            }
        }
        (total, vector)
    }

    /// Wherever it lies and whichever way it runs, the pieces cover the polygon once: the sum of
    /// their areas is the length of the sum of their area vectors.
    #[test]
    fn notched_polygons_are_covered_once() {
        let notched = [[0.0, 0.0], [4.0, 0.3], [4.1, 3.0], [2.0, 0.7], [0.2, 3.3]];
        let lift = |[x, y]: [f64; 2]| [x + 0.7, 0.3 * x - y, 1.3 * y + 0.2 * x];
        let mut polygon: Vec<[f64; 3]> = notched.map(lift).to_vec();
        for _ in 0..2 {
            for turn in 0..polygon.len() {
                polygon.rotate_left(1);
                let (total, vector) = areas(&polygon);
                let whole = area_vector(&polygon).map(|c| 0.5 * c);
                let length = whole.iter().map(|c| c * c).sum::<f64>().sqrt();
                assert!((total - length).abs() < 1e-12 * length, "{turn}");
                for k in 0..3 {
                    assert!((vector[k] - whole[k]).abs() < 1e-12 * length, "{turn}");
                }
            }
            polygon.reverse();
        }
    }

    /// Corners in a row or twice lost ears, and the neighbours' sides stood open.
    #[test]
    fn every_side_of_a_polygon_is_a_side_of_its_triangles() {
        let row = [
            [0.0, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [3.0, 0.0],
            [3.0, 2.0],
            [2.0, 2.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [0.0, 2.0],
        ];
        // A square hole, reached along a bridge.
        let bridged = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ];
        let spiral: Vec<[f64; 2]> = (0..4000)
            .map(|k| {
                let back = k >= 2000;
                let t = f64::from(if back { 3999 - k } else { k }) / 50.0;
                let r = 1.0 + 0.1 * t + if back { 0.2 } else { 0.0 };
                [r * t.cos(), r * t.sin()]
            })
            .collect();
        for (plan, area) in [
            (row.to_vec(), Some(5.0)),
            (bridged.to_vec(), Some(12.0)),
            (spiral, None),
        ] {
            let polygon: Vec<[f64; 3]> = plan.iter().map(|[x, y]| [*x, *y, 0.7]).collect();
            let mut triangles = Vec::new();
            Cutter::new().cut(&polygon, &mut triangles);
            let whole = 0.5 * area_vector(&polygon)[2].abs();
            assert!(area.is_none_or(|area| (whole - area).abs() < 1e-12));
            let areas = triangles.iter().map(|t| 0.5 * area_vector(t)[2].abs());
            assert!((areas.sum::<f64>() - whole).abs() < 1e-9 * whole);
            let has = |a: [f64; 3], b: [f64; 3]| {
                let mut sides = triangles
                    .iter()
                    .flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]);
                sides.any(|(p, q)| (p, q) == (a, b) || (q, p) == (a, b))
            };
            for k in (0..polygon.len()).step_by(1 + polygon.len() / 100) {
                let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
                assert!(a == b || has(a, b), "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn what_is_no_polygon_gives_no_surface() {
        let p = [0.7, 1.3, -0.2];
        for n in 0..3 {
            assert_eq!(areas(&vec![p; n]).0, 0.0);
        }
        assert_eq!(areas(&[p; 5]).0, 0.0);
    }

    #[test]
    fn a_notch_turns_against_the_rest() {
        let mut pentagon = [
            [0.0, 0.0, 0.3],
            [1.3, 0.0, 0.3],
            [1.3, 0.7, 0.3],
            [0.6, 1.1, 0.3],
            [0.0, 0.7, 0.3],
        ];
        assert!(is_convex(&pentagon, area_vector(&pentagon)));
        pentagon[3][1] = 0.2;
        assert!(!is_convex(&pentagon, area_vector(&pentagon)));
    }
}
