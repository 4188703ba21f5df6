//! A plate's outline and its holes, and why steel cannot be solved.

use super::face::SAME_M;
use super::round_faces::Site;

/// The outline of a plate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outline {
    /// Sides along x and y, m.
    Rectangle([f64; 2]),
    /// Diameter, m.
    Round(f64),
}

impl Outline {
    pub(super) fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Rectangle(own), Self::Rectangle(other)) => {
                (0..2).all(|k| (own[k] - other[k]).abs() < SAME_M)
            }
            (Self::Round(own), Self::Round(other)) => (own - other).abs() < SAME_M,
            _ => false,
        }
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
    fn contains(&self, [x, y]: [f64; 2], margin_m: f64) -> bool {
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
    /// Steel round a circle that is neither wholly on other steel nor wholly off it.
    #[error(
        "the circle of {:.3} mm about ({:.3}, {:.3}) mm crosses an edge or another circle of the steel it touches",
        2e3 * .0.radius_m, 1e3 * .0.at_m[0], 1e3 * .0.at_m[1]
    )]
    Crosses(Site),
    /// Bodies that touch, but have no common direction along which they are prisms.
    #[error("a box or cylinder touches others that are not upright about one direction with it")]
    Askew,
    /// Joined steel that closes a loop through a winding.
    #[error("the steel joined to the core of coil {0} closes a loop through its winding")]
    Loop(usize),
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

/// A site with the steel about it that is resolved.
pub(super) fn widened(site: &Site) -> Site {
    Site {
        radius_m: (1.0 + LEAST_LEFT) * site.radius_m,
        ..*site
    }
}

impl Plate {
    /// Refuses holes that cut its edge, each other or one of the `feet` of cores on it, or nearly.
    pub(super) fn check_holes(&self, feet: &[Site]) -> Result<(), Fault> {
        for (hole, site) in self.holes.iter().enumerate() {
            let least_m = LEAST_LEFT * site.radius_m;
            if !self.contains(site.at_m, site.radius_m + least_m) {
                return Err(Fault::HoleAtEdge { hole, least_m });
            }
            let cut = |other: &Site| !is_apart(site, other);
            if let Some(coil) = feet.iter().position(cut) {
                return Err(Fault::HoleAtFoot {
                    hole,
                    coil,
                    least_m,
                });
            }
            let others = &self.holes[..hole];
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
}
