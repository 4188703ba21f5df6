//! Convex pieces of the plan, and the extremes of a plane minus a bilinear patch over them.
//!
//! The difference is a saddle: inside a polygon it has no extremum, along an edge it is quadratic.
//! So its supremum is at a corner or at the stationary point of an edge, in closed form.

use crate::file_mesh::Triangle;
use serde::{Deserialize, Serialize};

/// Corners of a triangle cut by a rectangle, by three lines and by a plane.
const MOST_CORNERS: usize = 12;

pub(super) type Point = [f64; 2];

/// Lengths below which two places in plan are not distinguished.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hair {
    /// m.
    pub(super) plan_m: f64,
    /// m.
    pub(super) height_m: f64,
}

/// An axis-aligned rectangle, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    /// Lower corner.
    pub low_m: Point,
    /// Upper corner.
    pub high_m: Point,
}

impl Rect {
    pub(crate) fn centre(&self) -> Point {
        [0, 1].map(|k| 0.5 * (self.low_m[k] + self.high_m[k]))
    }

    /// The place at these parts of its sides.
    pub(super) fn at(&self, part: Point) -> Point {
        [0, 1].map(|k| self.low_m[k] + part[k] * (self.high_m[k] - self.low_m[k]))
    }

    pub(crate) fn sides(&self) -> Point {
        [0, 1].map(|k| self.high_m[k] - self.low_m[k])
    }

    /// Whether a point lies in it, borders included.
    pub(super) fn holds(&self, p: Point) -> bool {
        (0..2).all(|k| self.low_m[k] <= p[k] && p[k] <= self.high_m[k])
    }

    /// Its four corners, in turn.
    pub(crate) fn corners(&self) -> [Point; 4] {
        let ([x, y], [u, v]) = (self.low_m, self.high_m);
        [[x, y], [u, y], [u, v], [x, v]]
    }

    /// The part of a segment inside.
    pub(super) fn along(&self, segment: Segment) -> Option<Segment> {
        (0..2).try_fold(segment, |part, k| {
            part.cut(|p| p[k] - self.low_m[k])?
                .cut(|p| self.high_m[k] - p[k])
        })
    }

    /// The two halves along an axis.
    pub(super) fn halves(&self, k: usize) -> [Self; 2] {
        let (mut lower, mut upper) = (*self, *self);
        lower.high_m[k] = self.centre()[k];
        upper.low_m[k] = lower.high_m[k];
        [lower, upper]
    }

    /// The four quarters, x fastest.
    pub(super) fn quarters(&self) -> [Self; 4] {
        let middle = self.centre();
        [0, 1, 2, 3].map(|q| {
            let upper = [q & 1, q >> 1];
            let pick = |k: usize, from: f64, to: f64| if upper[k] == 1 { to } else { from };
            Self {
                low_m: [0, 1].map(|k| pick(k, self.low_m[k], middle[k])),
                high_m: [0, 1].map(|k| pick(k, middle[k], self.high_m[k])),
            }
        })
    }
}

/// A part of a straight line in plan.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    /// Two places on the line, m.
    pub(super) ends_m: [Point; 2],
    /// Where the part begins and ends, as fractions of the way from one to the other.
    pub(super) part: [f64; 2],
}

impl Segment {
    fn at(&self, t: f64) -> Point {
        let [a, b] = self.ends_m;
        [0, 1].map(|k| a[k] + t * (b[k] - a[k]))
    }

    /// The part of it where the function, linear along it, is not negative.
    fn cut(mut self, inside: impl Fn(Point) -> f64) -> Option<Self> {
        let [from, to] = self.part;
        let [start, end] = self.part.map(|t| inside(self.at(t)));
        if start < 0.0 && end < 0.0 {
            return None;
        }
        let zero = from + (to - from) * (start / (start - end));
        if start < 0.0 {
            self.part[0] = zero;
        } else if end < 0.0 {
            self.part[1] = zero;
        }
        (self.part[0] < self.part[1]).then_some(self)
    }
}

/// Heights at a rectangle's corners, bilinear between them, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch {
    /// Where it lies.
    pub rect: Rect,
    /// Heights at the corners, x fastest.
    pub corners_m: [f64; 4],
}

impl Patch {
    /// The interpolated height, m.
    #[must_use]
    pub fn height_m(&self, p: Point) -> f64 {
        let [u, v] = [0, 1].map(|k| {
            let side = self.rect.high_m[k] - self.rect.low_m[k];
            (p[k] - self.rect.low_m[k]) / side
        });
        let [a, b, c, d] = self.corners_m;
        let (low, high) = (a + u * (b - a), c + u * (d - c));
        low + v * (high - low)
    }

    /// The axis along which part of the patch is longer in space.
    pub(super) fn longer(&self, part: &Rect) -> usize {
        let centre = part.centre();
        let lengths = [0, 1].map(|k| {
            let (mut low, mut high) = (centre, centre);
            (low[k], high[k]) = (part.low_m[k], part.high_m[k]);
            (high[k] - low[k]).hypot(self.height_m(high) - self.height_m(low))
        });
        usize::from(lengths[1] > lengths[0])
    }

    /// No less than the steepest rise along x plus that along y.
    fn steepness(&self) -> f64 {
        let [a, b, c, d] = self.corners_m;
        let [width, depth] = self.rect.sides();
        (b - a).abs().max((d - c).abs()) / width + (c - a).abs().max((d - b).abs()) / depth
    }

    /// Residual of the corners' heights about the best plane: zero for a flat patch.
    pub(super) fn twist_m(&self) -> f64 {
        let [a, b, c, d] = self.corners_m;
        (a - b) - (c - d)
    }
}

/// A triangle that is no wall, as a plane over its plan; corners counter-clockwise.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    pub(super) corners: [Point; 3],
    origin: [f64; 3],
    slope: Point,
    pub(super) heights: [f64; 2],
}

impl Face {
    /// `None` for a triangle without area in plan.
    pub(super) fn new(triangle: &Triangle) -> Option<Self> {
        let [a, mut b, mut c] = *triangle;
        let across = |b: [f64; 3], c: [f64; 3]| {
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let mut double_area = across(b, c);
        if double_area < 0.0 {
            (b, c) = (c, b);
            double_area = -double_area;
        }
        let (u, v) = (
            [b[0] - a[0], b[1] - a[1], b[2] - a[2]],
            [c[0] - a[0], c[1] - a[1], c[2] - a[2]],
        );
        let slope = [
            (u[2] * v[1] - v[2] * u[1]) / double_area,
            (v[2] * u[0] - u[2] * v[0]) / double_area,
        ];
        let plan = |p: [f64; 3]| [p[0], p[1]];
        slope.iter().all(|s| s.is_finite()).then(|| Self {
            corners: [plan(a), plan(b), plan(c)],
            origin: a,
            slope,
            heights: [a[2].min(b[2]).min(c[2]), a[2].max(b[2]).max(c[2])],
        })
    }

    /// A level face whose plan holds the rectangle.
    pub(super) fn floor(rect: &Rect, height_m: f64) -> Option<Self> {
        let [width, depth] = rect.sides();
        let [x, y] = rect.low_m;
        let corner = |x, y| [x, y, height_m];
        Self::new(&[
            corner(x - width, y - depth),
            corner(x + 4.0 * width, y - depth),
            corner(x - width, y + 4.0 * depth),
        ])
    }

    /// Height over a point of the plan that belongs to the triangle.
    pub(super) fn height(&self, p: Point) -> f64 {
        // A sliver's slope is huge: what rounding adds must not leave the triangle.
        self.plane(p).clamp(self.heights[0], self.heights[1])
    }

    /// The height of its plane at any point, and not below its corners.
    pub(super) fn at_least(&self, p: Point) -> f64 {
        self.plane(p).max(self.heights[0])
    }

    /// The height of its plane at any point, and not above its corners.
    pub(super) fn at_most(&self, p: Point) -> f64 {
        self.plane(p).min(self.heights[1])
    }

    fn plane(&self, p: Point) -> f64 {
        let rise =
            self.slope[0] * (p[0] - self.origin[0]) + self.slope[1] * (p[1] - self.origin[1]);
        self.origin[2] + rise
    }

    /// Distance of a point of the plan from the line of a side, positive inside, times the side's length, m^2.
    fn inward_m2(&self, k: usize, p: Point) -> f64 {
        let (a, b) = (self.corners[k], self.corners[(k + 1) % 3]);
        (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    }

    /// Whether a point of the plan lies in the triangle or no farther than `slack_m` beyond a side.
    pub(super) fn holds(&self, p: Point, slack_m: f64) -> bool {
        (0..3).all(|k| {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % 3]);
            self.inward_m2(k, p) >= -slack_m * (b[0] - a[0]).hypot(b[1] - a[1])
        })
    }

    /// The part of a segment over the triangle.
    pub(super) fn along(&self, segment: Segment) -> Option<Segment> {
        (0..3).try_fold(segment, |part, k| part.cut(|p| self.inward_m2(k, p)))
    }

    /// Length in space of a step along an axis.
    pub(super) fn length(&self, k: usize, step: f64) -> f64 {
        step.hypot(step * self.slope[k])
    }

    /// No less than what [`Face::height`] is above the patch, and below it, anywhere in the rectangle, rounding
    /// included, m: what is left of a bilinear difference over a rectangle is largest at a corner.
    pub(super) fn most_off_m(&self, rect: &Rect, patch: &Patch, hair: Hair) -> [f64; 2] {
        let (mut low_m, mut high_m) = (rect.low_m, rect.high_m);
        for k in 0..2 {
            let (low, high) = self.range(k);
            (low_m[k], high_m[k]) = (low_m[k].max(low), high_m[k].min(high));
        }
        let [lowest, highest] = self.heights;
        let slope = self.slope[0].abs() + self.slope[1].abs() + patch.steepness();
        let rounding = hair.height_m + slope * hair.plan_m;
        let corners = Rect { low_m, high_m }.corners();
        corners
            .into_iter()
            .fold([f64::NEG_INFINITY; 2], |[above, below], corner| {
                // A sliver's plane may leave the heights of its corners, which it is held to.
                let (plane, patch) = (self.plane(corner), patch.height_m(corner));
                let (most, least) = (plane.max(lowest), plane.min(highest));
                [
                    above.max(most - patch + rounding),
                    below.max(patch - least + rounding),
                ]
            })
    }

    /// Whether the plan of the triangle may have area in common with the rectangle.
    pub(super) fn overlaps(&self, rect: &Rect) -> bool {
        for k in 0..2 {
            let (low, high) = self.range(k);
            if high <= rect.low_m[k] || low >= rect.high_m[k] {
                return false;
            }
        }
        (0..3).all(|k| {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % 3]);
            let inward = [a[1] - b[1], b[0] - a[0]];
            let far = [0, 1].map(|k| {
                if inward[k] > 0.0 {
                    rect.high_m[k]
                } else {
                    rect.low_m[k]
                }
            });
            inward[0] * (far[0] - a[0]) + inward[1] * (far[1] - a[1]) > 0.0
        })
    }

    pub(super) fn range(&self, k: usize) -> (f64, f64) {
        let [a, b, c] = self.corners.map(|p| p[k]);
        (a.min(b).min(c), a.max(b).max(c))
    }

    /// The part of the triangle's plan inside the rectangle.
    pub(super) fn within(&self, rect: &Rect) -> Polygon {
        let mut polygon = Polygon::of(&self.corners);
        for k in 0..2 {
            polygon = polygon.cut(|p| p[k] - rect.low_m[k]);
            polygon = polygon.cut(|p| rect.high_m[k] - p[k]);
        }
        polygon
    }

    /// The part of `polygon` over which this triangle is higher than `other` by more than
    /// `margin`.
    pub(super) fn hides(&self, other: &Self, polygon: &Polygon, margin: f64) -> Polygon {
        if self.heights[1] <= other.heights[0] + margin {
            return Polygon::of(&[]);
        }
        for k in 0..2 {
            let (low, high) = self.range(k);
            let (from, to) = polygon.range(k);
            if high <= from || low >= to {
                return Polygon::of(&[]);
            }
        }
        let part = (0..3).fold(*polygon, |part, k| part.cut(|p| self.inward_m2(k, p)));
        part.cut(|p| self.height(p) - other.height(p) - margin)
    }

    /// The part of a segment over `other` that [`Self::hides`] has inside. Cut by the triangle's own lines: those
    /// of a region's short sides have lost their direction to rounding.
    pub(super) fn hides_along(
        &self,
        other: &Self,
        segment: Segment,
        margin: f64,
    ) -> Option<Segment> {
        let part = self.along(segment)?;
        part.cut(|p| self.height(p) - other.height(p) - margin)
    }
}

/// A convex polygon, counter-clockwise.
#[derive(Debug, Clone, Copy)]
pub(super) struct Polygon {
    corners: [Point; MOST_CORNERS],
    count: usize,
}

impl Polygon {
    pub(super) fn of(corners: &[Point]) -> Self {
        let mut polygon = Self {
            corners: [[0.0; 2]; MOST_CORNERS],
            count: 0,
        };
        for corner in corners {
            polygon.push(*corner);
        }
        polygon
    }

    fn push(&mut self, corner: Point) {
        // Rounding cannot make a convex polygon gain more than one corner a cut.
        if self.count < MOST_CORNERS {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    pub(super) fn corners(&self) -> &[Point] {
        &self.corners[..self.count]
    }

    /// The mean of its corners, which lies inside.
    pub(super) fn middle(&self) -> Point {
        let sum = |k: usize| self.corners().iter().map(|corner| corner[k]).sum::<f64>();
        [0, 1].map(|k| sum(k) / self.count as f64)
    }

    /// Each side as its two ends.
    pub(super) fn sides(&self) -> impl Iterator<Item = (Point, Point)> + '_ {
        let corners = self.corners();
        (0..corners.len()).map(move |k| (corners[k], corners[(k + 1) % corners.len()]))
    }

    pub(super) fn range(&self, k: usize) -> (f64, f64) {
        let fold = |(low, high): (f64, f64), p: &Point| (low.min(p[k]), high.max(p[k]));
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        self.corners().iter().fold(start, fold)
    }

    /// The part where the function, linear over the polygon, is not negative.
    pub(super) fn cut(&self, inside: impl Fn(Point) -> f64) -> Self {
        let mut kept = Self::of(&[]);
        if self.count == 0 {
            return kept;
        }
        let mut previous = self.corners[self.count - 1];
        let mut before = inside(previous);
        for &corner in self.corners() {
            let here = inside(corner);
            if (before < 0.0 && here > 0.0) || (before > 0.0 && here < 0.0) {
                let t = before / (before - here);
                kept.push([0, 1].map(|k| previous[k] + t * (corner[k] - previous[k])));
            }
            if here >= 0.0 {
                kept.push(corner);
            }
            (previous, before) = (corner, here);
        }
        kept
    }

    /// Area over half the perimeter: about the width of a thin piece.
    pub(super) fn width(&self) -> f64 {
        let perimeter: f64 = (self.sides())
            .map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1]))
            .sum();
        if perimeter > 0.0 {
            2.0 * self.area() / perimeter
        } else {
            0.0
        }
    }

    /// Area, seen from the first corner, where least is lost in the sum.
    pub(super) fn area(&self) -> f64 {
        if self.count < 3 {
            return 0.0;
        }
        let origin = self.corners[0];
        let twice = self.sides().map(|(a, b)| {
            (a[0] - origin[0]) * (b[1] - origin[1]) - (a[1] - origin[1]) * (b[0] - origin[0])
        });
        0.5 * twice.sum::<f64>()
    }

    /// The largest value over the polygon of a function that is quadratic along every line and
    /// has no maximum inside.
    pub(super) fn supremum(&self, value: impl Fn(Point) -> f64) -> Extreme {
        self.sides().fold(Extreme::NONE, |best, (a, b)| {
            best.or(along(a, b, [0.0, 1.0], &value))
        })
    }
}

/// A value and where it is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Extreme {
    /// The value; minus infinity for none.
    pub value_m: f64,
    /// Its place in plan, m.
    pub at_m: Point,
}

impl Extreme {
    pub(super) const NONE: Self = Self {
        value_m: f64::NEG_INFINITY,
        at_m: [0.0; 2],
    };

    /// The larger; of equal ones the first.
    pub(super) fn or(self, other: Self) -> Self {
        if other.value_m > self.value_m {
            other
        } else {
            self
        }
    }
}

/// The largest value of a quadratic over part of a segment, exactly.
pub(super) fn along(a: Point, b: Point, part: [f64; 2], value: &impl Fn(Point) -> f64) -> Extreme {
    let at = |t: f64| [0, 1].map(|k| a[k] + t * (b[k] - a[k]));
    let [from, to] = part;
    let points = [at(from), at(0.5 * (from + to)), at(to)];
    let [first, middle, last] = points.map(value);
    let curvature = 2.0 * (first + last) - 4.0 * middle;
    let slope = last - first - curvature;
    let ends = Extreme {
        value_m: first,
        at_m: points[0],
    }
    .or(Extreme {
        value_m: last,
        at_m: points[2],
    });
    let stationary = -slope / (2.0 * curvature);
    if curvature < 0.0 && stationary > 0.0 && stationary < 1.0 {
        let peak = at(from + stationary * (to - from));
        return ends.or(Extreme {
            value_m: value(peak),
            at_m: peak,
        });
    }
    ends
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_numerics::random::Random;

    #[test]
    fn a_floor_is_level_and_holds_its_rectangle() {
        let rect = Rect {
            low_m: [0.3, -0.7],
            high_m: [1.6, 0.2],
        };
        let floor = Face::floor(&rect, 0.11).unwrap();
        for p in rect.corners() {
            assert!(floor.holds(p, -0.01) && floor.height(p) == 0.11, "{p:?}");
        }
    }

    #[test]
    fn a_segment_is_cut_where_it_crosses_rectangle_and_triangle() {
        let square = Rect {
            low_m: [0.0; 2],
            high_m: [1.0; 2],
        };
        let face = Face::new(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
        let of = |a: Point, b: Point| Segment {
            ends_m: [a, b],
            part: [0.0, 1.0],
        };
        let close = |found: Option<Segment>, expected: [f64; 2]| {
            let found = found.unwrap().part;
            assert!(
                (0..2).all(|k| (found[k] - expected[k]).abs() < 1e-15),
                "{found:?}"
            );
        };
        let across = of([-0.7, 0.3], [1.3, 0.3]);
        close(square.along(across), [0.35, 0.85]);
        close(face.along(across), [0.35, 0.7]);
        close(square.along(of([0.2, 0.7], [0.4, 1.3])), [0.0, 0.5]);
        let beside = of([-0.7, 1.3], [1.3, 1.3]);
        assert!(square.along(beside).is_none() && face.along(beside).is_none());
    }

    #[test]
    fn a_parabola_is_largest_at_its_vertex_on_any_part() {
        let (a, b) = ([0.7, 0.2], [1.9, 1.1]);
        // Vertex at 0.37 of the whole segment.
        let value = |p: Point| {
            let t = (p[0] - a[0]) / (b[0] - a[0]);
            1.3 - 5.0 * (t - 0.37) * (t - 0.37)
        };
        for part in [[0.0, 1.0], [0.2, 0.5], [0.3, 0.9], [0.05, 0.38]] {
            assert!((along(a, b, part, &value).value_m - 1.3).abs() < 1e-14);
        }
        let end = along(a, b, [0.5, 0.9], &value).value_m;
        assert!((end - (1.3 - 5.0 * 0.13 * 0.13)).abs() < 1e-14);
    }

    /// Slivers and steep faces among them, cut by a rectangle or not.
    #[test]
    fn no_face_is_farther_off_than_the_corners_say() {
        let mut random = Random::new(11);
        let (mut compared, mut tight) = (0, 0);
        for case in 0..20_000 {
            let mut next = || random.between(-1.0, 1.0);
            let thin = 10_f64.powi(-(case % 13));
            let from = [next(), next(), next()];
            let along = [next(), next(), next()];
            let away = [thin * next(), thin * next(), next()];
            let corner = |a: f64, b: f64| [0, 1, 2].map(|k| from[k] + a * along[k] + b * away[k]);
            let triangle = [corner(0.0, 0.0), corner(1.0, 0.0), corner(next(), 1.0)];
            let rect = Rect {
                low_m: [-0.3 + 0.2 * next(), -0.3 + 0.2 * next()],
                high_m: [0.4 + 0.2 * next(), 0.4 + 0.2 * next()],
            };
            let patch = Patch {
                rect,
                corners_m: [0; 4].map(|_| next()),
            };
            let part = rect.quarters()[case as usize % 4];
            let Some(face) = Face::new(&triangle) else {
                continue;
            };
            let inside = face.within(&part);
            if inside.count == 0 {
                continue;
            }
            let hair = Hair {
                plan_m: 1e-12,
                height_m: 1e-12,
            };
            let off = |sign: f64| {
                let value = |p| sign * (face.height(p) - patch.height_m(p));
                inside.supremum(value).value_m
            };
            let most = face.most_off_m(&part, &patch, hair);
            for (found, most) in [off(1.0), off(-1.0)].into_iter().zip(most) {
                assert!(found <= most, "{case}: {found} {most}");
                tight += usize::from(most - found < 1e-3);
            }
            compared += 1;
        }
        assert!(compared > 2000 && tight > 100, "{compared} {tight}");
    }
}
