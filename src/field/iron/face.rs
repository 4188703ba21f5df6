//! Smooth pieces of a body's surface, and the panels that cut them up.
//!
//! A face is ruled: straight lines join two curves, each an arc or a segment. That makes sides of
//! cylinders, flat pieces between an arc and a line, boxes and triangles, all of them exact.

use serde::{Deserialize, Serialize};

use fluxform_numerics::gauss;
use fluxform_numerics::vec3::{cross, dot, minus, norm, plus};

/// Places closer than that are one, m.
pub(super) const SAME_M: f64 = 1e-9;

/// A point or a vector, m.
pub type Point = [f64; 3];

/// `t` from 0 to 1 goes along centre + cos(a) first + sin(a) second + t line, a from `from` to `to`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    centre_m: Point,
    first_m: Point,
    second_m: Point,
    line_m: Point,
    from: f64,
    to: f64,
}

impl Curve {
    /// The segment from `a` to `b`, m.
    #[must_use]
    pub fn segment(a: Point, b: Point) -> Self {
        Self {
            centre_m: a,
            first_m: [0.0; 3],
            second_m: [0.0; 3],
            line_m: minus(b, a),
            from: 0.0,
            to: 0.0,
        }
    }

    /// The arc in a level plane about `centre_m` between two angles.
    #[must_use]
    pub fn arc(centre_m: Point, radius_m: f64, from: f64, to: f64) -> Self {
        Self {
            centre_m,
            first_m: [radius_m, 0.0, 0.0],
            second_m: [0.0, radius_m, 0.0],
            line_m: [0.0; 3],
            from,
            to,
        }
    }

    fn at(&self, t: f64) -> (Point, Point) {
        let turn = self.to - self.from;
        let (s, c) = (self.from + turn * t).sin_cos();
        let point = std::array::from_fn(|i| {
            self.centre_m[i] + c * self.first_m[i] + s * self.second_m[i] + t * self.line_m[i]
        });
        let slope = std::array::from_fn(|i| {
            turn * (c * self.second_m[i] - s * self.first_m[i]) + self.line_m[i]
        });
        (point, slope)
    }

    fn length_m(&self) -> f64 {
        (self.to - self.from).abs() * norm(self.first_m) + norm(self.line_m)
    }

    fn turn(&self) -> f64 {
        if norm(self.first_m) > 0.0 {
            (self.to - self.from).abs()
        } else {
            0.0
        }
    }

    fn mapped(&self, turn: impl Fn(Point) -> Point, shift_m: Point) -> Self {
        Self {
            centre_m: plus(turn(self.centre_m), shift_m),
            first_m: turn(self.first_m),
            second_m: turn(self.second_m),
            line_m: turn(self.line_m),
            ..*self
        }
    }
}

/// The shape of a face over (u, v) in the unit square.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Shape {
    /// (1 - v) a(u) + v b(u).
    Ruled(Curve, Curve),
    /// The sixth of an ellipsoid of half-axes (m) that looks along an axis.
    Ball {
        centre_m: Point,
        half_m: Point,
        axis: usize,
        sign: f64,
    },
}

/// A sharp or open side: how panels are graded towards u = 0, u = 1, v = 0, v = 1.
pub type Edges = [bool; 4];

/// A smooth piece of surface between two materials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Face {
    shape: Shape,
    plane: bool,
    /// Whether the normal is turned.
    flipped: bool,
    edges: Edges,
    /// Cuts along v, where sources touch it.
    cuts: Vec<f64>,
    /// Relative permeability less one of what the normal leaves and of what it enters.
    pub(super) chi: [f64; 2],
    /// The connected piece of steel that it bounds.
    pub(super) body: usize,
    /// The coil in whose bore it lies.
    pub(super) bore: Option<usize>,
    /// The coils through whose bores it is joined from below.
    pub(super) above: Vec<usize>,
    /// Whether it is one of many pieces of something smooth, of which small ones need fewer nodes.
    facet: bool,
}

impl Face {
    /// The ruled face between `a` and `b`, its normal on the side of `outside_m`.
    #[must_use]
    pub fn ruled(a: Curve, b: Curve, edges: Edges, outside_m: Point) -> Self {
        let mut face = Self::of(Shape::Ruled(a, b), edges);
        let (at, normal) = face.point(0.5, 0.5);
        face.flipped = dot(minus(outside_m, at), normal) < 0.0;
        face
    }

    /// The six faces of an ellipsoid.
    #[must_use]
    pub fn ball(centre_m: Point, half_m: Point) -> Vec<Self> {
        let face = |k: usize| {
            let sign = if k < 3 { 1.0 } else { -1.0 };
            let shape = Shape::Ball {
                centre_m,
                half_m,
                axis: k % 3,
                sign,
            };
            let mut face = Self::of(shape, [false; 4]);
            let (at, normal) = face.point(0.5, 0.5);
            face.flipped = dot(minus(at, centre_m), normal) < 0.0;
            face
        };
        (0..6).map(face).collect()
    }

    fn of(shape: Shape, edges: Edges) -> Self {
        Self {
            plane: Self::is_plane(&shape),
            shape,
            flipped: false,
            edges,
            cuts: Vec::new(),
            chi: [0.0; 2],
            body: 0,
            bore: None,
            above: Vec::new(),
            facet: false,
        }
    }

    /// Cut at `v` as if at an edge.
    #[must_use]
    pub fn cut(mut self, v: f64) -> Self {
        if v > 0.0 && v < 1.0 {
            self.cuts.push(v);
        }
        self
    }

    /// With steel of this relative permeability less one behind it, and nothing before it.
    #[must_use]
    pub fn of_steel(mut self, chi: f64) -> Self {
        self.chi = [chi, 0.0];
        self
    }

    /// A piece of something that may be smooth.
    #[must_use]
    pub(super) fn facet(mut self) -> Self {
        self.facet = true;
        self
    }

    /// Nodes along a side of its panels.
    fn order(&self, resolution: &Resolution) -> usize {
        let ([u, v], _) = self.extent();
        if !self.facet || self.edges.contains(&true) || u.max(v) > resolution.panel_m {
            return resolution.order;
        }
        (resolution.order - 1).max(1)
    }

    /// Its normal reversed: the surface of a cavity.
    #[must_use]
    pub fn turned(mut self) -> Self {
        self.flipped = !self.flipped;
        self
    }

    /// The face turned by a rotation and then shifted.
    #[must_use]
    pub fn moved(mut self, turn: impl Fn(Point) -> Point + Copy, shift_m: Point) -> Self {
        match &mut self.shape {
            Shape::Ruled(a, b) => {
                *a = a.mapped(turn, shift_m);
                *b = b.mapped(turn, shift_m);
            }
            Shape::Ball { centre_m, .. } => *centre_m = plus(turn(*centre_m), shift_m),
        }
        self
    }

    /// A point and the normal there, as long as the surface's measure.
    #[must_use]
    pub fn point(&self, u: f64, v: f64) -> (Point, Point) {
        self.across(u).at(v)
    }

    /// The line of one u.
    fn across(&self, u: f64) -> Across<'_> {
        let ends = match &self.shape {
            Shape::Ruled(a, b) => [a.at(u), b.at(u)],
            Shape::Ball { .. } => Default::default(),
        };
        Across {
            face: self,
            u,
            ends,
        }
    }

    /// Its corners and its middle, m.
    pub(super) fn corners_m(&self) -> [Point; 5] {
        let places = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (0.5, 0.5)];
        places.map(|(u, v)| self.point(u, v).0)
    }

    /// Whether it is on both sides of a plane x = or y =.
    pub(super) fn straddles(&self, axis: usize, plane_m: f64) -> bool {
        let beyond = |sign: f64| {
            let mut corners = self.corners_m().into_iter();
            corners.any(|at| sign * (at[axis] - plane_m) > SAME_M)
        };
        beyond(1.0) && beyond(-1.0)
    }

    /// Whether a shape lies in a plane, on which its layer does not act.
    fn is_plane(shape: &Shape) -> bool {
        match shape {
            Shape::Ruled(a, b) => {
                a.turn() == 0.0 && b.turn() == 0.0
                    || (a.centre_m[2] == b.centre_m[2]
                        && [a, b].iter().all(|c| {
                            c.first_m[2] == 0.0 && c.second_m[2] == 0.0 && c.line_m[2] == 0.0
                        }))
            }
            Shape::Ball { .. } => false,
        }
    }

    /// Lengths along u and v, m, and the angle that u turns by.
    fn extent(&self) -> ([f64; 2], f64) {
        match &self.shape {
            Shape::Ruled(a, b) => {
                let gap = |t: f64| norm(minus(a.at(t).0, b.at(t).0));
                let across = gap(0.0).max(gap(1.0)).max(gap(0.5));
                (
                    [a.length_m().max(b.length_m()), across],
                    a.turn().max(b.turn()),
                )
            }
            Shape::Ball { half_m, .. } => {
                let most = half_m.iter().copied().fold(0.0, f64::max);
                ([1.6 * most; 2], 1.6)
            }
        }
    }

    /// Its panels.
    #[must_use]
    pub fn panels(&self, number: usize, resolution: &Resolution) -> Vec<Panel> {
        let ([long_u, long_v], turn) = self.extent();
        let least = (turn * resolution.per_turn as f64 / std::f64::consts::TAU).ceil();
        let levels = |sharp: bool| if sharp { resolution.levels } else { 0 };
        let [u0, u1, v0, v1] = self.edges.map(levels);
        // A turn is as smooth as its radius, however large that is.
        let along_u = if turn > 0.0 { 0.5 * long_u } else { long_u };
        let us = resolution.breaks(along_u, [u0, u1], least);
        let least_v = match self.shape {
            Shape::Ball { .. } => least,
            Shape::Ruled(..) => 1.0,
        };
        let mut vs = vec![0.0];
        let mut from = 0.0;
        for to in self.cuts.iter().copied().chain([1.0]) {
            let at = |end: f64, edge: i32| {
                if end == 0.0 || end == 1.0 {
                    edge
                } else {
                    resolution.levels / 2
                }
            };
            let ends = [at(from, v0), at(to, v1)];
            let part = resolution.breaks((to - from) * long_v, ends, least_v);
            vs.extend(part[1..].iter().map(|t| from + (to - from) * t));
            from = to;
        }
        let order = self.order(resolution);
        let mut panels = Vec::new();
        for u in us.windows(2) {
            for v in vs.windows(2) {
                panels.push(Panel::new(self, number, [u[0], u[1], v[0], v[1]], order));
            }
        }
        panels
    }
}

/// Points of a face at one u: what depends on u alone is computed once for all of them.
struct Across<'a> {
    face: &'a Face,
    u: f64,
    /// Of a ruled face the ends of the line, and their slopes along u.
    ends: [(Point, Point); 2],
}

impl Across<'_> {
    /// A point and the normal there, as long as the surface's measure.
    fn at(&self, v: f64) -> (Point, Point) {
        let (at, along_u, along_v) = match &self.face.shape {
            Shape::Ruled(..) => {
                let [(pa, sa), (pb, sb)] = self.ends;
                let mix = |x: Point, y: Point| std::array::from_fn(|i| (1.0 - v) * x[i] + v * y[i]);
                (mix(pa, pb), mix(sa, sb), minus(pb, pa))
            }
            Shape::Ball {
                centre_m,
                half_m,
                axis,
                sign,
            } => ball_point(*centre_m, *half_m, *axis, *sign, self.u, v),
        };
        let normal = cross(along_u, along_v);
        let normal = if self.face.flipped {
            normal.map(|n| -n)
        } else {
            normal
        };
        (at, normal)
    }
}

fn ball_point(
    centre_m: Point,
    half_m: Point,
    axis: usize,
    sign: f64,
    u: f64,
    v: f64,
) -> (Point, Point, Point) {
    // Equal angles: the cube's face stretched by a tangent.
    let angle = std::f64::consts::FRAC_PI_4;
    let (a, b) = (
        (angle * (2.0 * u - 1.0)).tan(),
        (angle * (2.0 * v - 1.0)).tan(),
    );
    let (da, db) = (2.0 * angle * (1.0 + a * a), 2.0 * angle * (1.0 + b * b));
    let long = (1.0 + a * a + b * b).sqrt();
    let place = |along: [f64; 3]| -> Point {
        let mut out = [0.0; 3];
        for (k, value) in along.iter().enumerate() {
            out[(axis + k) % 3] = *value;
        }
        std::array::from_fn(|i| out[i] * half_m[i])
    };
    let cube = long.powi(3);
    (
        plus(centre_m, place([sign / long, a / long, b / long])),
        place([
            -sign * a * da / cube,
            da * (1.0 + b * b) / cube,
            -a * b * da / cube,
        ]),
        place([
            -sign * b * db / cube,
            -a * b * db / cube,
            db * (1.0 + a * a) / cube,
        ]),
    )
}

/// Ratio of neighbouring panels towards an edge, where the layer grows like a root of the distance.
const GRADING: f64 = 0.2;

/// How finely surfaces are cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Resolution {
    /// Nodes along each side of a panel.
    pub order: usize,
    /// Panels about a whole turn.
    pub per_turn: usize,
    /// Steps towards an edge, each `GRADING` times as long.
    pub levels: i32,
    /// Length of a panel far from edges, at most, m.
    pub panel_m: f64,
}

impl Resolution {
    /// Where a side `length_m` long is cut, from 0 to 1, in at least `least` panels, graded to the ends by as
    /// many steps as `levels` says.
    fn breaks(&self, length_m: f64, levels: [i32; 2], least: f64) -> Vec<f64> {
        let count = (length_m / self.panel_m).round().max(least).max(1.0);
        let count = if levels[0].min(levels[1]) > 0 {
            count.max(2.0)
        } else {
            count
        };
        let step = 1.0 / count;
        let graded = |end: usize| (1..=levels[end]).map(move |k| step * GRADING.powi(k));
        let mut out = vec![0.0];
        out.extend(graded(0).collect::<Vec<_>>().into_iter().rev());
        out.extend((1..count as usize).map(|k| k as f64 * step));
        out.extend(graded(1).map(|h| 1.0 - h));
        out.push(1.0);
        out
    }
}

/// A rectangle of a face's parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Panel {
    /// The face's number.
    pub(super) face: usize,
    /// From and to along u, from and to along v.
    pub(super) range: [f64; 4],
    /// Nodes along each side.
    pub(super) order: usize,
    /// A ball about it, m.
    pub(super) centre_m: Point,
    pub(super) radius_m: f64,
    /// Lengths along u and v, m.
    pub(super) sides_m: [f64; 2],
    /// The plane that it lies in: a normal, if it does.
    pub(super) plane: Option<Point>,
}

impl Panel {
    pub(super) fn new(face: &Face, number: usize, range: [f64; 4], order: usize) -> Self {
        let [u0, u1, v0, v1] = range;
        let (um, vm) = (0.5 * (u0 + u1), 0.5 * (v0 + v1));
        let [first, middle, last] = [u0, um, u1].map(|u| face.across(u));
        let at = |line: &Across<'_>, v| line.at(v).0;
        let (centre_m, normal) = middle.at(vm);
        let rim = [
            at(&first, v0),
            at(&first, v1),
            at(&last, v0),
            at(&last, v1),
            at(&middle, v0),
            at(&middle, v1),
            at(&first, vm),
            at(&last, vm),
        ];
        let radius_m = (rim.iter()).fold(0.0_f64, |r, p| r.max(norm(minus(*p, centre_m))));
        let apart = |a: usize, b: usize| norm(minus(rim[a], rim[b]));
        Self {
            face: number,
            range,
            order,
            centre_m,
            radius_m,
            sides_m: [
                apart(0, 2).max(apart(1, 3)).max(apart(6, 7)),
                apart(0, 1).max(apart(2, 3)).max(apart(4, 5)),
            ],
            plane: face.plane.then(|| normal.map(|n| n / norm(normal))),
        }
    }

    /// Its halves across the longer side.
    pub(super) fn halves(&self, face: &Face) -> [Self; 2] {
        let [u0, u1, v0, v1] = self.range;
        let cut = if self.sides_m[0] >= self.sides_m[1] {
            let um = 0.5 * (u0 + u1);
            [[u0, um, v0, v1], [um, u1, v0, v1]]
        } else {
            let vm = 0.5 * (v0 + v1);
            [[u0, u1, v0, vm], [u0, u1, vm, v1]]
        };
        cut.map(|range| Self::new(face, self.face, range, self.order))
    }

    /// The nodes of a rule with `orders` nodes along u and v.
    pub(super) fn nodes(&self, face: &Face, orders: [usize; 2]) -> Vec<Node> {
        let [first, second] = orders.map(gauss::rule);
        let [u0, u1, v0, v1] = self.range;
        let quarter = 0.25 * (u1 - u0) * (v1 - v0);
        let mut nodes = Vec::with_capacity(orders[0] * orders[1]);
        for (x, weight_u) in first.nodes.iter().zip(&first.weights) {
            let line = face.across(u0 + 0.5 * (u1 - u0) * (1.0 + x));
            for (y, weight_v) in second.nodes.iter().zip(&second.weights) {
                let (place_m, normal) = line.at(v0 + 0.5 * (v1 - v0) * (1.0 + y));
                let weight = quarter * weight_u * weight_v;
                nodes.push(Node {
                    place_m,
                    area_m2: normal.map(|n| weight * n),
                });
            }
        }
        nodes
    }
}

/// A node of a panel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Where, m.
    pub place_m: Point,
    /// The area that it stands for, along the normal, m^2.
    pub area_m2: Point,
}
