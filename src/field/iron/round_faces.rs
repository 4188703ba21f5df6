//! Faces about circles: discs, sides of cylinders, and rings between discs and what is around them.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::face::{Curve, Face, Point, SAME_M};
use fluxform_numerics::vec3::plus;

/// The direction in which heights grow.
pub(super) const UP: Point = [0.0, 0.0, 1.0];

/// A point far out along a direction from another, m.
pub(super) fn beyond(at: Point, along: Point) -> Point {
    plus(at, along.map(|a| 1e3 * a))
}

/// A ring wider than this many of its inner radii is cut more finely there.
const WIDE: f64 = 3.0;

/// A disc in plan: a core's foot, or a hole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Its middle, m.
    pub at_m: [f64; 2],
    /// Its radius, m.
    pub radius_m: f64,
}

impl Site {
    /// Distance of its middle from a place, m.
    pub(super) fn distance_m(&self, at_m: [f64; 2]) -> f64 {
        let [x, y] = [0, 1].map(|axis| self.at_m[axis] - at_m[axis]);
        x.hypot(y)
    }

    /// How far apart the rims of two are, m; below nothing where they cut each other.
    pub(super) fn apart_m(&self, other: &Self) -> f64 {
        self.distance_m(other.at_m) - self.radius_m - other.radius_m
    }

    /// Whether another lies within it, clear of its rim.
    pub(super) fn holds(&self, other: &Self) -> bool {
        self.radius_m - self.distance_m(other.at_m) - other.radius_m > SAME_M
    }

    pub(super) fn is(&self, other: &Self) -> bool {
        self.distance_m(other.at_m) < SAME_M && (self.radius_m - other.radius_m).abs() < SAME_M
    }
}

fn quarters() -> [[f64; 2]; 4] {
    [0.0, 1.0, 2.0, 3.0].map(|k| [k * FRAC_PI_2, (k + 1.0) * FRAC_PI_2])
}

/// A level disc in four parts, its normal up.
pub(super) fn disc([x, y]: [f64; 2], radius_m: f64, z_m: f64, sharp: bool) -> Vec<Face> {
    let centre = [x, y, z_m];
    let part = |[from, to]: [f64; 2]| {
        Face::ruled(
            Curve::segment(centre, centre),
            Curve::arc(centre, radius_m, from, to),
            [false, false, false, sharp],
            beyond(centre, UP),
        )
    };
    quarters().map(part).to_vec()
}

/// The side of an upright cylinder in four parts, its normal outwards.
pub(super) fn cylinder_side([x, y]: [f64; 2], radius_m: f64, [low, high]: [f64; 2]) -> Vec<Face> {
    let part = |[from, to]: [f64; 2]| {
        let (s, c) = (0.5 * (from + to)).sin_cos();
        Face::ruled(
            Curve::arc([x, y, low], radius_m, from, to),
            Curve::arc([x, y, high], radius_m, from, to),
            [false, false, true, true],
            beyond([x, y, 0.5 * (low + high)], [c, s, 0.0]),
        )
    };
    quarters().map(part).to_vec()
}

/// The part of a face in plan nearer to one disc than to the others: about its axis, lines n.x = c and the face's rim.
pub(super) struct Cell {
    /// n, c, and whether the layer changes quickly there.
    lines: Vec<([f64; 2], f64, bool)>,
    /// The middle of a round face, its radius, and whether the layer changes quickly there.
    rim: Option<([f64; 2], f64, bool)>,
}

/// A face's outline in plan, whose sides the layer changes quickly at or not.
#[derive(Debug, Clone, Copy)]
pub(super) enum Rim {
    /// The least and the largest corner, m; sides at the least x, the largest x, the least y, the largest y.
    Rectangle([[f64; 2]; 2], [bool; 4]),
    /// A disc.
    Round(Site, bool),
}

impl Cell {
    /// That of disc `own` of `sites`, all within `rim`.
    pub(super) fn new(rim: Rim, sites: &[Site], own: usize) -> Self {
        let [x, y] = sites[own].at_m;
        let mut lines = Vec::new();
        let mut round = None;
        match rim {
            Rim::Rectangle([low, high], sharp) => lines.extend([
                ([1.0, 0.0], high[0] - x, sharp[1]),
                ([-1.0, 0.0], x - low[0], sharp[0]),
                ([0.0, 1.0], high[1] - y, sharp[3]),
                ([0.0, -1.0], y - low[1], sharp[2]),
            ]),
            Rim::Round(disc, sharp) => {
                round = Some(([disc.at_m[0] - x, disc.at_m[1] - y], disc.radius_m, sharp));
            }
        }
        for (number, other) in sites.iter().enumerate() {
            let d = [other.at_m[0] - x, other.at_m[1] - y];
            let long = d[0].hypot(d[1]);
            if number != own {
                // Tangents to both discs are as long from anywhere on the line: it passes between them.
                let powers = sites[own].radius_m.powi(2) - other.radius_m.powi(2);
                let offset = 0.5 * (long + powers / long);
                lines.push(([d[0] / long, d[1] / long], offset, false));
            }
        }
        Self { lines, rim: round }
    }

    /// Distance of the border at an angle, m, and which line it is (as many as there are: the rim).
    fn border(&self, angle: f64) -> (f64, usize) {
        let (s, c) = angle.sin_cos();
        let mut nearest = (f64::INFINITY, 0);
        for (number, (normal, offset, _)) in self.lines.iter().enumerate() {
            let along = normal[0] * c + normal[1] * s;
            if along > 0.0 && offset / along < nearest.0 {
                nearest = (offset / along, number);
            }
        }
        if let Some((centre, radius, _)) = self.rim {
            let along = centre[0] * c + centre[1] * s;
            let square = radius * radius - centre[0].powi(2) - centre[1].powi(2);
            let distance = along + (along * along + square).sqrt();
            if distance < nearest.0 {
                nearest = (distance, self.lines.len());
            }
        }
        nearest
    }

    /// Angles between which the border is one line: the quarters, and where another takes over.
    fn angles(&self) -> Vec<f64> {
        let mut out: Vec<f64> = (0..=4).map(|k| f64::from(k) * FRAC_PI_2).collect();
        let steps = 720;
        let step = TAU / f64::from(steps);
        for k in 0..steps {
            // Off the quarters, so that a corner lies within.
            let (mut low, end) = ((f64::from(k) + 0.37) * step, (f64::from(k) + 1.37) * step);
            let (mut first, last) = (self.border(low).1, self.border(end).1);
            // Of a long narrow face the short side lies between two that are sampled.
            while first != last {
                let mut high = end;
                while high - low > 1e-14 * TAU {
                    let middle = 0.5 * (low + high);
                    if middle == low || middle == high {
                        break;
                    }
                    if self.border(middle).1 == first {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                out.push(high % TAU);
                low = high;
                first = self.border(high).1;
            }
        }
        out.sort_by(f64::total_cmp);
        out.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        out
    }

    /// The cell less its disc, at a height, its normal up; `joined`: whether the layer changes quickly at the disc.
    pub(super) fn ring(&self, site: &Site, z_m: f64, joined: bool) -> Vec<Face> {
        let ([x, y], radius_m) = (site.at_m, site.radius_m);
        let angles = self.angles();
        // Far out the layer changes over the distance from the axis.
        let widest = angles
            .iter()
            .fold(0.0_f64, |w, angle| w.max(self.border(*angle).0));
        let graded = joined || widest > WIDE * radius_m;
        let part = |pair: &[f64]| {
            let [from, to] = [pair[0], pair[1]];
            let line = self.border(0.5 * (from + to)).1;
            let on_line = |angle: f64| {
                let (s, c) = angle.sin_cos();
                let (distance, _) = if line < self.lines.len() {
                    let (n, offset, _) = self.lines[line];
                    (offset / (n[0] * c + n[1] * s), line)
                } else {
                    self.border(angle)
                };
                [x + distance * c, y + distance * s, z_m]
            };
            let (a, b) = (on_line(from), on_line(to));
            let edge = (self.lines.get(line)).map_or_else(
                || self.rim.is_some_and(|(.., sharp)| sharp),
                |(.., sharp)| *sharp,
            );
            let border = match self.rim {
                Some((centre, radius, _)) if line == self.lines.len() => {
                    let middle = [x + centre[0], y + centre[1], z_m];
                    let angle = |p: Point| (p[1] - middle[1]).atan2(p[0] - middle[0]);
                    let first = angle(a);
                    let mut turn = angle(b) - first;
                    if turn < 0.0 {
                        turn += TAU;
                    }
                    assert!(turn < PI);
                    Curve::arc(middle, radius, first, first + turn)
                }
                _ => Curve::segment(a, b),
            };
            let centre = [x, y, z_m];
            Face::ruled(
                Curve::arc(centre, radius_m, from, to),
                border,
                [false, false, graded, edge],
                beyond(centre, UP),
            )
        };
        angles.windows(2).map(part).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beyond 20 m the short side of a face 0.15 m wide lay between two sampled angles: a corner of it was 4e11 km away, and
    /// its panels were halved until the stack ended.
    #[test]
    fn regression_the_short_side_of_a_long_face_was_passed_over() {
        let site = |x: f64| Site {
            at_m: [x, 0.0],
            radius_m: 0.019,
        };
        for long_m in [0.15, 12.0, 30.0, 1e4] {
            let corners = [[-0.075, -0.5 * long_m], [0.075, 0.5 * long_m]];
            let rim = Rim::Rectangle(corners, [true; 4]);
            let cell = Cell::new(rim, &[site(-0.025), site(0.025)], 1);
            for pair in cell.angles().windows(2) {
                let inside = [0.1, 0.5, 0.9].map(|share| pair[0] + share * (pair[1] - pair[0]));
                let [first, middle, last] = inside.map(|angle| cell.border(angle).1);
                assert!(first == middle && last == middle, "{long_m} {pair:?}");
            }
        }
    }
}
