//! One triangle seen from above: which points of the plan it covers, and how high.
//!
//! Vertices are put into one canonical order first, so that neighbours evaluate a shared edge
//! identically and orientation does not matter. Sides are decided by exact predicates.

use fluxform_numerics::double_double::DoubleDouble;
use robust::{Coord, orient2d};

use crate::file_mesh::Triangle;
use fluxform_numerics::vec3::{cross, minus};

/// |n_z| below which a sliver in plan is taken as a vertical wall.
pub(super) const WALL_NORMAL_Z: f64 = 1e-4;
/// Cancellation in the weights beyond which they are computed in double-double.
const CANCELLATION: f64 = 16.0;

type Point = [f64; 2];
type Vertex = [f64; 3];

/// How a triangle meets the vertical line through a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Contact {
    /// Not at all.
    None,
    /// Inside, on an edge or on a vertex, exactly.
    Covers(f64),
    /// Outside, but within reach of an edge.
    Near(f64),
    /// On, or within reach of, a vertical wall.
    Wall(f64),
}

impl Contact {
    /// The surface's height there. What is within reach counts like what covers: on a silhouette rounding
    /// alone decides between the two.
    pub(super) fn height(self) -> Option<f64> {
        match self {
            Self::None => None,
            Self::Covers(height) | Self::Near(height) | Self::Wall(height) => Some(height),
        }
    }
}

/// A triangle prepared for many points.
pub(super) struct Seen {
    /// Canonically ordered.
    vertices: [Vertex; 3],
    /// Twice the area in plan.
    orientation: f64,
    wall: bool,
    reach: f64,
    /// The highest vertex.
    top: f64,
}

impl Seen {
    /// `reach`: how far outside an edge a point still touches it, m.
    pub(super) fn new(triangle: &Triangle, reach: f64) -> Self {
        let vertices = ordered(triangle);
        let [a, b, c] = vertices;
        let orientation = side(a, b, [c[0], c[1]]);
        let wall = stands_upright(&vertices, orientation, reach);
        Self {
            vertices,
            orientation,
            wall,
            reach,
            top: a[2].max(b[2]).max(c[2]),
        }
    }

    /// True where all of this triangle is lower than `height`.
    pub(super) fn is_hidden_below(&self, height: f64) -> bool {
        self.top < height
    }

    /// A range of x that holds every point of row `y` that this triangle touches.
    pub(super) fn columns(&self, y: f64) -> [f64; 2] {
        self.columns_between(y, y)
    }

    /// The same for every row between two.
    pub(super) fn columns_between(&self, from: f64, to: f64) -> [f64; 2] {
        let (low, high) = (from - self.reach, to + self.reach);
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        let [a, b, c] = self.vertices;
        for (p, q) in [(a, b), (b, c), (a, c)] {
            let (p, q) = if p[1] <= q[1] { (p, q) } else { (q, p) };
            if q[1] < low || p[1] > high {
                continue;
            }
            for (end, cut, beyond) in [(p, low, p[1] < low), (q, high, q[1] > high)] {
                let x = if beyond {
                    p[0] + (cut - p[1]) / (q[1] - p[1]) * (q[0] - p[0])
                } else {
                    end[0]
                };
                range = [range[0].min(x), range[1].max(x)];
            }
        }
        // The cut's rounding is a few units of the largest x.
        let slack = self.reach + 16.0 * f64::EPSILON * a[0].abs().max(b[0].abs()).max(c[0].abs());
        [range[0] - slack, range[1] + slack]
    }

    /// How the vertical line through `p` meets the triangle.
    pub(super) fn contact(&self, p: Point) -> Contact {
        if self.wall {
            // Of a wall's three edges one within reach will do.
            let near = |(a, b)| edge_contact(a, b, p, self.reach).is_some();
            return match self.edges().into_iter().any(near) {
                true => Contact::Wall(self.wall_top(p)),
                false => Contact::None,
            };
        }
        let [a, b, c] = self.vertices;
        let sign = self.orientation.signum();
        let weights = [
            side(b, c, p) * sign,
            side(c, a, p) * sign,
            side(a, b, p) * sign,
        ];
        if weights.iter().all(|w| *w >= 0.0) {
            return Contact::Covers(self.inside(weights, p));
        }
        if self.is_far(weights) {
            return Contact::None;
        }
        self.near(p).map_or(Contact::None, Contact::Near)
    }

    /// True where the point lies so far beyond one side that `near` need not be asked: twice the
    /// reach, which leaves room for all rounding on the way.
    fn is_far(&self, weights: [f64; 3]) -> bool {
        let [a, b, c] = self.vertices;
        // No side is longer than the sum of its two extents.
        let beyond = |weight: f64, (p, q): (Vertex, Vertex)| {
            weight < -2.0 * self.reach * ((p[0] - q[0]).abs() + (p[1] - q[1]).abs())
        };
        beyond(weights[0], (b, c)) || beyond(weights[1], (c, a)) || beyond(weights[2], (a, b))
    }

    fn edges(&self) -> [(Vertex, Vertex); 3] {
        let [a, b, c] = self.vertices;
        [(a, b), (b, c), (a, c)]
    }

    /// The highest of the edges' points nearest to `p`, of the edges within reach.
    fn near(&self, p: Point) -> Option<f64> {
        let heights = self.edges().into_iter();
        heights
            .filter_map(|(a, b)| edge_contact(a, b, p, self.reach))
            .reduce(f64::max)
    }

    /// Height of a wall's top beside `p`, measured along the wall.
    fn wall_top(&self, p: Point) -> f64 {
        let [a, b, c] = self.vertices;
        let low = [0, 1].map(|k| a[k].min(b[k]).min(c[k]));
        let high = [0, 1].map(|k| a[k].max(b[k]).max(c[k]));
        let k = usize::from(high[1] - low[1] > high[0] - low[0]);
        let at = p[k].clamp(low[k], high[k]);
        let spanning = self
            .edges()
            .into_iter()
            .filter(|(a, b)| a[k].min(b[k]) <= at && at <= a[k].max(b[k]));
        spanning.fold(f64::NEG_INFINITY, |top, (a, b)| {
            top.max(edge_height_at(a, b, k, at))
        })
    }

    /// Height at a covered point; the vertices' own heights are met exactly.
    fn inside(&self, weights: [f64; 3], p: Point) -> f64 {
        let [a, b, c] = self.vertices;
        if a[2] == b[2] && b[2] == c[2] {
            return a[2];
        }
        // On an edge both neighbours must give the same number: only its two ends matter.
        match weights.map(|w| w == 0.0) {
            [true, _, _] => return edge_height(b, c, p),
            [_, true, _] => return edge_height(a, c, p),
            [_, _, true] => return edge_height(a, b, p),
            _ => {}
        }
        let sum = weights[0] + weights[1] + weights[2];
        let size = [(b, c), (a, c), (a, b)].map(|(q, r)| magnitude(q, r, p));
        let weights = if size[0] + size[1] + size[2] > CANCELLATION * sum {
            let sign = self.orientation.signum();
            [(b, c), (c, a), (a, b)].map(|(q, r)| sign * precise_side(q, r, p))
        } else {
            weights
        };
        let z = [a[2], b[2], c[2]];
        // From the vertex that weighs most, the correction is smallest.
        let mut near = 0;
        for k in 1..3 {
            if weights[k] > weights[near] {
                near = k;
            }
        }
        let (k, l) = ((near + 1) % 3, (near + 2) % 3);
        let rise = weights[k] * (z[k] - z[near]) + weights[l] * (z[l] - z[near]);
        let height = z[near] + rise / (weights[0] + weights[1] + weights[2]);
        height.clamp(z[0].min(z[1]).min(z[2]), z[0].max(z[1]).max(z[2]))
    }
}

/// False where a triangle's box in plan lies beyond `reach` of `p`: then [`Seen::contact`] is none.
pub(super) fn may_touch(triangle: &Triangle, p: Point, reach: f64) -> bool {
    let [a, b, c] = triangle;
    let within = |k: usize| {
        p[k] >= a[k].min(b[k]).min(c[k]) - reach && p[k] <= a[k].max(b[k]).max(c[k]) + reach
    };
    within(0) && within(1)
}

/// Whether a triangle is upright, or as nearly as the file's rounding can make a wall that did.
pub(super) fn is_wall(triangle: &Triangle, reach: f64) -> bool {
    let vertices = ordered(triangle);
    let [a, b, c] = vertices;
    stands_upright(&vertices, side(a, b, [c[0], c[1]]), reach)
}

/// [`is_wall`] of ordered vertices, with twice their area in plan.
fn stands_upright(vertices: &[Vertex; 3], orientation: f64, reach: f64) -> bool {
    if orientation == 0.0 {
        return true;
    }
    let [a, b, c] = vertices;
    let extent = |k: usize| a[k].max(b[k]).max(c[k]) - a[k].min(b[k]).min(c[k]);
    // No side is longer than this: of most triangles nothing more need be known.
    if orientation.abs() > reach * (extent(0) + extent(1)) {
        return false;
    }
    let longest = [(a, b), (b, c), (a, c)].map(|(p, q)| (p[0] - q[0]).hypot(p[1] - q[1]));
    let longest = longest[0].max(longest[1]).max(longest[2]);
    orientation.abs() <= reach * longest && upward_normal(vertices)[2] <= WALL_NORMAL_Z
}

/// The unit normal that looks up (n_z >= 0), whatever the vertices' order.
pub(super) fn upward_normal(triangle: &Triangle) -> Vertex {
    let [a, b, c] = ordered(triangle);
    let normal = cross(minus(b, a), minus(c, a));
    let largest = normal.iter().fold(0.0, |m: f64, n| m.max(n.abs()));
    if largest == 0.0 {
        // Placement can round an area away; such a sliver has no direction of its own.
        return [0.0, 0.0, 1.0];
    }
    let scaled = normal.map(|n| n / largest);
    let length = (scaled[0] * scaled[0] + scaled[1] * scaled[1] + scaled[2] * scaled[2]).sqrt();
    let turn = if scaled[2] < 0.0 { -length } else { length };
    // Adding 0 turns -0 into 0.
    scaled.map(|n| n / turn + 0.0)
}

/// Lexicographic order of x, y, z.
fn ordered(triangle: &Triangle) -> [Vertex; 3] {
    let [mut a, mut b, mut c] = *triangle;
    if b < a {
        (a, b) = (b, a);
    }
    if c < b {
        (b, c) = (c, b);
    }
    if b < a {
        (a, b) = (b, a);
    }
    [a, b, c]
}

fn coord(v: Vertex) -> Coord<f64> {
    Coord { x: v[0], y: v[1] }
}

/// Twice the area of a, b, p in plan, positive to the left of a -> b; its sign is exact.
fn side(a: Vertex, b: Vertex, p: Point) -> f64 {
    orient2d(coord(a), coord(b), Coord { x: p[0], y: p[1] })
}

/// The sum of the two products whose difference [`side`] is.
fn magnitude(a: Vertex, b: Vertex, p: Point) -> f64 {
    ((a[0] - p[0]) * (b[1] - p[1])).abs() + ((a[1] - p[1]) * (b[0] - p[0])).abs()
}

/// [`side`] to full relative accuracy, in double-double.
fn precise_side(a: Vertex, b: Vertex, p: Point) -> f64 {
    let offset = |v: Vertex, k: usize| DoubleDouble::exactly(v[k]) - DoubleDouble::exactly(p[k]);
    (offset(a, 0) * offset(b, 1) - offset(a, 1) * offset(b, 0)).nearest()
}

/// Height of the edge at its point beside `p`; depends on the two ends alone.
fn edge_height(a: Vertex, b: Vertex, p: Point) -> f64 {
    let k = usize::from((b[1] - a[1]).abs() > (b[0] - a[0]).abs());
    edge_height_at(a, b, k, p[k])
}

/// Height of the edge where its coordinate `k` is `at`; the top of an edge that is upright.
fn edge_height_at(a: Vertex, b: Vertex, k: usize, at: f64) -> f64 {
    let span = b[k] - a[k];
    if span == 0.0 {
        return a[2].max(b[2]);
    }
    let (from_a, from_b) = ((at - a[k]) / span, (b[k] - at) / span);
    let rise = b[2] - a[2];
    let height = if from_a <= from_b {
        a[2] + from_a * rise
    } else {
        b[2] - from_b * rise
    };
    height.clamp(a[2].min(b[2]), a[2].max(b[2]))
}

/// Height of the edge's point nearest to `p` in plan, if within `reach`.
fn edge_contact(a: Vertex, b: Vertex, p: Point, reach: f64) -> Option<f64> {
    let within =
        |slack: f64, k: usize| p[k] >= a[k].min(b[k]) - slack && p[k] <= a[k].max(b[k]) + slack;
    if !within(reach, 0) || !within(reach, 1) {
        return None;
    }
    let span = [b[0] - a[0], b[1] - a[1]];
    let square = span[0] * span[0] + span[1] * span[1];
    let foot = if square == 0.0 {
        [a[0], a[1]]
    } else {
        let across = side(a, b, p);
        if across == 0.0 && within(0.0, 0) && within(0.0, 1) {
            return Some(edge_height(a, b, p));
        }
        if across.abs() > reach * square.sqrt() {
            return None;
        }
        let along = ((p[0] - a[0]) * span[0] + (p[1] - a[1]) * span[1]) / square;
        let along = along.clamp(0.0, 1.0);
        [a[0] + along * span[0], a[1] + along * span[1]]
    };
    let near = (p[0] - foot[0]).hypot(p[1] - foot[1]) <= reach;
    near.then(|| edge_height(a, b, foot))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the unit of length: the quick way out must not be taken within reach.
    #[test]
    fn a_point_is_near_an_edge_within_reach_of_it_in_any_unit() {
        for power in [-40, -10, 0, 10, 40] {
            let unit = 2.0f64.powi(power);
            let at = |v: [f64; 3]| v.map(|c| c * unit);
            let triangle = [[0.0, 0.0, 0.2], [7.0, 0.0, 0.2], [0.0, 3.0, 0.2]].map(at);
            let seen = Seen::new(&triangle, 1e-3 * unit);
            for (below, requested) in [
                (-0.1, Contact::Covers(0.2 * unit)),
                (0.9e-3, Contact::Near(0.2 * unit)),
                (1.1e-3, Contact::None),
                (5e-3, Contact::None),
                (2.0, Contact::None),
            ] {
                let p = [1.3 * unit, -below * unit];
                assert_eq!(seen.contact(p), requested, "{power} {below}");
            }
        }
    }

    /// Near a low corner of a triangle that rises very high, whichever corner that is.
    #[test]
    fn a_height_is_as_fine_as_the_corner_that_it_is_near() {
        let corners = [[0.0, 0.0], [8.0, 0.0], [4.0, 8.0]];
        for (low, high) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
            let third = 3 - low - high;
            let mut triangle = corners.map(|[x, y]| [x, y, 0.7]);
            triangle[high][2] = 2.0f64.powi(40);
            triangle[third][2] = 1.3;
            // Powers of two, so that the place is exact.
            let (share, aside) = (2.0f64.powi(-42), 2.0f64.powi(-44));
            let p = [0, 1].map(|k| {
                let from = corners[low][k];
                from + share * (corners[high][k] - from) + aside * (corners[third][k] - from)
            });
            let rise = share * (triangle[high][2] - 0.7) + aside * 0.6;
            let Contact::Covers(height) = Seen::new(&triangle, 0.0).contact(p) else {
                panic!("{low} {high}: not covered");
            };
            assert!(
                (height - 0.7 - rise).abs() < 1e-15,
                "{low} {high}: {height}"
            );
        }
    }
}
