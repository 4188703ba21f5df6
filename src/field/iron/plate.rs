//! A plate's outline, its holes, and how its faces are cut about feet and holes.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::face::{Curve, Face, Point};
use fluxform_numerics::vec3::plus;

/// Places closer than that are one, m.
pub(super) const SAME_M: f64 = 1e-9;

/// A point far out along a direction from another, m.
pub(super) fn beyond(at: Point, along: Point) -> Point {
    plus(at, along.map(|a| 1e3 * a))
}

/// A ring wider than this many of its inner radii is cut more finely there.
const WIDE: f64 = 3.0;

/// The outline of a plate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outline {
    /// Sides along x and y, m.
    Rectangle([f64; 2]),
    /// Diameter, m.
    Round(f64),
}

/// A disc in plan: a core's foot, or a hole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Its middle, m.
    pub at_m: [f64; 2],
    /// Its radius, m.
    pub radius_m: f64,
}

impl Site {
    /// How far apart the rims of two are, m; below nothing where they cut each other.
    fn apart_m(&self, other: &Self) -> f64 {
        let [x, y] = [0, 1].map(|axis| self.at_m[axis] - other.at_m[axis]);
        x.hypot(y) - self.radius_m - other.radius_m
    }
}

/// A level plate of steel.
#[derive(Debug, Clone, PartialEq)]
pub struct Plate {
    /// Its outline about its middle.
    pub outline: Outline,
    /// Its middle, m.
    pub centre_m: [f64; 2],
    /// Height of its upper face, m.
    pub top_m: f64,
    /// Thickness, m.
    pub thickness_m: f64,
    /// Relative permeability less one.
    pub chi: f64,
    /// Holes through it.
    pub holes: Vec<Site>,
}

impl Plate {
    pub(super) fn contains(&self, [x, y]: [f64; 2], margin_m: f64) -> bool {
        let (x, y) = (x - self.centre_m[0], y - self.centre_m[1]);
        match self.outline {
            Outline::Rectangle([a, b]) => {
                x.abs() + margin_m < 0.5 * a && y.abs() + margin_m < 0.5 * b
            }
            Outline::Round(diameter) => x.hypot(y) + margin_m < 0.5 * diameter,
        }
    }
}

/// Why bodies cannot be solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Fault {
    /// A core is not wholly on the plate.
    #[error("the core of coil {0} is not wholly above the plate")]
    BesidePlate(usize),
    /// A hole cuts the plate's edge, or nearly.
    #[error("hole {hole} is less than {:.3} mm from the plate's edge", .least_m * 1e3)]
    HoleAtEdge {
        /// Its index.
        hole: usize,
        /// The least length that is resolved, m.
        least_m: f64,
    },
    /// A hole cuts the foot of a core, or nearly.
    #[error("hole {hole} is less than {:.3} mm from the foot of coil {coil}'s core", .least_m * 1e3)]
    HoleAtFoot {
        /// Its index.
        hole: usize,
        /// The coil's.
        coil: usize,
        /// The least length that is resolved, m.
        least_m: f64,
    },
    /// A hole cuts another, or nearly.
    #[error("holes {other} and {hole} are less than {:.3} mm apart", .least_m * 1e3)]
    HolesMeet {
        /// Its index.
        hole: usize,
        /// That of the other.
        other: usize,
        /// The least length that is resolved, m.
        least_m: f64,
    },
}

impl Plate {
    /// Whether a map of the plane to itself, about the plate's middle, keeps its holes.
    #[must_use]
    pub fn keeps_holes(&self, map: impl Fn([f64; 2]) -> [f64; 2]) -> bool {
        let from_middle = |site: &Site| [0, 1].map(|axis| site.at_m[axis] - self.centre_m[axis]);
        self.holes.iter().all(|hole| {
            let image = map(from_middle(hole));
            let same = |other: &Site| {
                let [x, y] = from_middle(other);
                (x - image[0]).hypot(y - image[1]) < SAME_M
                    && (other.radius_m - hole.radius_m).abs() < SAME_M
            };
            self.holes.iter().any(same)
        })
    }
}

/// The steel between a hole and an edge is resolved from this part of the hole's radius on.
const LEAST_LEFT: f64 = 0.1;

pub(super) fn is_apart(hole: &Site, other: &Site) -> bool {
    hole.apart_m(other) >= LEAST_LEFT * hole.radius_m
}

/// `feet`: those of the cores that stand on the plate.
pub(super) fn check_holes(plate: &Plate, feet: Option<&Vec<Site>>) -> Result<(), Fault> {
    for (hole, site) in plate.holes.iter().enumerate() {
        let least_m = LEAST_LEFT * site.radius_m;
        if !plate.contains(site.at_m, site.radius_m + least_m) {
            return Err(Fault::HoleAtEdge { hole, least_m });
        }
        let cut = |other: &Site| !is_apart(site, other);
        if let Some(coil) = feet.and_then(|feet| feet.iter().position(cut)) {
            return Err(Fault::HoleAtFoot {
                hole,
                coil,
                least_m,
            });
        }
        let others = &plate.holes[..hole];
        if let Some(other) = others.iter().position(cut) {
            return Err(Fault::HolesMeet {
                hole,
                other,
                least_m,
            });
        }
    }
    Ok(())
}

/// The part of the plate nearer to one core or hole than to the others: about its axis, lines n.x = c and
/// the plate's rim.
pub(super) struct Cell {
    /// n, c, and whether it is the plate's edge.
    lines: Vec<([f64; 2], f64, bool)>,
    /// The middle of a round plate, and its radius.
    rim: Option<([f64; 2], f64)>,
}

impl Cell {
    pub(super) fn new(plate: &Plate, sites: &[Site], own: usize) -> Self {
        let [x, y] = sites[own].at_m;
        let to_centre = [plate.centre_m[0] - x, plate.centre_m[1] - y];
        let mut lines = Vec::new();
        let mut rim = None;
        match plate.outline {
            Outline::Rectangle([a, b]) => {
                for (normal, half) in [
                    ([1.0, 0.0], 0.5 * a),
                    ([-1.0, 0.0], 0.5 * a),
                    ([0.0, 1.0], 0.5 * b),
                    ([0.0, -1.0], 0.5 * b),
                ] {
                    let c = half + normal[0] * to_centre[0] + normal[1] * to_centre[1];
                    lines.push((normal, c, true));
                }
            }
            Outline::Round(diameter) => rim = Some((to_centre, 0.5 * diameter)),
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
        Self { lines, rim }
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
        if let Some((centre, radius)) = self.rim {
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
            let (mut low, mut high) = ((f64::from(k) + 0.37) * step, (f64::from(k) + 1.37) * step);
            let (first, last) = (self.border(low).1, self.border(high).1);
            if first == last {
                continue;
            }
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
        }
        out.sort_by(f64::total_cmp);
        out.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        out
    }

    /// The cell less its disc, at a height; whether the layer changes quickly at the disc.
    pub(super) fn ring(&self, site: &Site, z_m: f64, normal: Point, joined: bool) -> Vec<Face> {
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
            let edge = line >= self.lines.len() || self.lines[line].2;
            let border = match self.rim {
                Some((centre, radius)) if line == self.lines.len() => {
                    let middle = [x + centre[0], y + centre[1], z_m];
                    let angle = |p: Point| (p[1] - middle[1]).atan2(p[0] - middle[0]);
                    let first = angle(a);
                    let mut turn = angle(b) - first;
                    if turn < 0.0 {
                        turn += TAU;
                    }
                    debug_assert!(turn < PI);
                    Curve::arc(middle, radius, first, first + turn)
                }
                _ => Curve::segment(a, b),
            };
            let centre = [x, y, z_m];
            Face::ruled(
                Curve::arc(centre, radius_m, from, to),
                border,
                [false, false, graded, edge],
                beyond(centre, normal),
            )
        };
        angles.windows(2).map(part).collect()
    }
}
