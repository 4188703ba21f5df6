//! The core's outline in the half plane (r, z), cut into panels with Gauss-Legendre nodes.
//!
//! Order along the outline: bottom face from the axis outwards, side upwards, top face inwards;
//! the outer normal is to the right of that direction.

use super::CoreShape;
use crate::winding::Winding;
use fluxform_numerics::gauss;
use serde::{Deserialize, Serialize};

/// The three faces of the cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Face {
    /// z = bottom, normal down.
    Bottom,
    /// r = radius, normal outwards.
    Side,
    /// z = top, normal up.
    Top,
}

/// A straight piece of one face. The coordinate is r on the end faces and z on the side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Panel {
    /// The face it lies on.
    pub face: Face,
    /// Coordinate where it begins, in the outline's direction, m.
    pub from_m: f64,
    /// Coordinate where it ends, m.
    pub to_m: f64,
}

impl Panel {
    /// Smaller and larger coordinate, m.
    #[must_use]
    pub fn range_m(&self) -> (f64, f64) {
        (self.from_m.min(self.to_m), self.from_m.max(self.to_m))
    }

    /// Coordinate of one of its nodes, m.
    #[must_use]
    pub fn coordinate_of(&self, node: &Node) -> f64 {
        match self.face {
            Face::Side => node.z_m,
            Face::Bottom | Face::Top => node.r_m,
        }
    }

    /// Length, m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        (self.to_m - self.from_m).abs()
    }
}

/// A quadrature node of the outline.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Radius, m.
    pub r_m: f64,
    /// Height, m.
    pub z_m: f64,
    /// Outer normal (r, z).
    pub normal: [f64; 2],
    /// Weight along the outline, m.
    pub weight_m: f64,
}

/// How finely an outline is cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolution {
    /// Gauss nodes a panel.
    pub order: usize,
    /// Length of a panel's nearer neighbour towards an edge, relative to its own.
    pub ratio: f64,
    /// Smallest panel at the steel's edges, relative to the smaller of radius and half length.
    pub tip: f64,
    /// Error allowed to each panel's quadrature, relative to the kernel's total mass.
    pub quadrature: f64,
}

impl Resolution {
    /// The resolution whose difference from the next coarser one is about `tolerance`, relative
    /// to the field outside.
    ///
    /// The double layer's density behaves like rho^(2/3) at an edge of the steel, and what a tip
    /// panel of length t does wrong is felt outside like t^(5/3); each further node on panels
    /// graded by a fifth gains about a digit. The constants are those of the table that
    /// `cargo test --test field steel converges -- --nocapture` prints.
    #[must_use]
    pub fn for_tolerance(tolerance: f64) -> Self {
        let tolerance = tolerance.clamp(1e-12, 0.1);
        Self {
            order: (2.0 - tolerance.log10()).ceil() as usize,
            ratio: 0.2,
            tip: (100.0 * tolerance).powf(0.6).min(0.16),
            quadrature: 0.01 * tolerance,
        }
    }

    /// The resolution whose field is right close to the steel too, to about `tolerance` of the
    /// largest |grad B| a fiftieth of the radius off it.
    ///
    /// Far away the layer's error is felt squared; close by it is felt as it is, and derivatives
    /// of it: half as many nodes again on each panel, and panels graded by less.
    #[must_use]
    pub(crate) fn near_steel(tolerance: f64) -> Self {
        let tolerance = tolerance.clamp(1e-12, 0.1);
        Self {
            order: (3.0 - 1.5 * tolerance.log10()).ceil() as usize,
            ratio: 0.3,
            tip: (0.1 * tolerance).powf(0.6).min(0.05),
            quadrature: 1e-4 * tolerance,
        }
    }

    /// Reference of [`Resolution::near_steel`]: its error is that of more than a node a
    /// panel, so that two may not lie close to each other by chance.
    #[must_use]
    pub(crate) fn coarser_near_steel(&self) -> Self {
        Self {
            order: self.order - 2,
            tip: self.tip / self.ratio,
            quadrature: 10.0 * self.quadrature,
            ..*self
        }
    }

    /// The next coarser resolution: a node a panel and a panel at every edge fewer.
    #[must_use]
    pub fn coarser(&self) -> Self {
        Self {
            order: self.order - 1,
            tip: self.tip / self.ratio,
            ..*self
        }
    }
}

/// The outline of a core with its panels and nodes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Generatrix {
    /// The core.
    pub shape: CoreShape,
    /// Panels in order.
    pub panels: Vec<Panel>,
    /// Nodes a panel.
    pub order: usize,
    /// Nodes in order.
    pub nodes: Vec<Node>,
}

impl Generatrix {
    /// Cuts the outline of `shape`: graded to the edges, and on the side to `marks` =
    /// (height, smallest length requested there) m, where the source's own edges are close.
    #[must_use]
    pub fn new(shape: CoreShape, marks: &[(f64, f64)], resolution: &Resolution) -> Self {
        let CoreShape {
            radius_m,
            bottom_m,
            top_m,
        } = shape;
        let tip_m = resolution.tip * radius_m.min(0.5 * (top_m - bottom_m));
        let cap = graded(0.0, radius_m, radius_m, tip_m, resolution.ratio);
        let mut heights = vec![(bottom_m, tip_m)];
        let mut inner: Vec<(f64, f64)> = marks
            .iter()
            .copied()
            .filter(|(z, _)| *z > bottom_m + tip_m && *z < top_m - tip_m)
            // No panel beside a mark may be long against its distance from the steel's edge.
            .map(|(z, length)| (z, length.min(z - bottom_m).min(top_m - z)))
            .collect();
        inner.sort_by(|a, b| a.0.total_cmp(&b.0));
        heights.extend(inner);
        heights.push((top_m, tip_m));
        let mut side = vec![bottom_m];
        for pair in heights.windows(2) {
            let [(lo, lo_tip), (hi, hi_tip)] = [pair[0], pair[1]];
            let points = graded(
                lo,
                hi,
                lo_tip.max(1e-12 * radius_m),
                hi_tip,
                resolution.ratio,
            );
            side.extend(&points[1..]);
        }
        let mut panels = Vec::new();
        let mut push = |face, points: &[f64]| {
            for pair in points.windows(2) {
                panels.push(Panel {
                    face,
                    from_m: pair[0],
                    to_m: pair[1],
                });
            }
        };
        push(Face::Bottom, &cap);
        push(Face::Side, &side);
        let inwards: Vec<f64> = cap.iter().rev().copied().collect();
        push(Face::Top, &inwards);
        let rule = gauss::rule(resolution.order);
        let nodes = panels
            .iter()
            .flat_map(|panel| {
                let half = 0.5 * (panel.to_m - panel.from_m);
                rule.nodes.iter().zip(&rule.weights).map(move |(x, w)| {
                    // From the nearer end, so that distances from the edges keep their digits.
                    let at = if *x < 0.0 {
                        panel.from_m + half * (1.0 + x)
                    } else {
                        panel.to_m - half * (1.0 - x)
                    };
                    let (r_m, z_m, normal) = shape.on(panel.face, at);
                    Node {
                        r_m,
                        z_m,
                        normal,
                        weight_m: half.abs() * w,
                    }
                })
            })
            .collect();
        Self {
            shape,
            panels,
            order: resolution.order,
            nodes,
        }
    }

    /// The outline of `winding`'s core, graded to where the winding's edges are close.
    #[must_use]
    pub fn of_coil(winding: &Winding, shape: CoreShape, resolution: &Resolution) -> Self {
        let gap_m = (winding.inner_radius_m - shape.radius_m).max(0.0);
        // The potential behaves like d^2 ln d there: half the digits' grading is enough.
        let tip_m = gap_m.max(resolution.tip.sqrt() * shape.radius_m.min(winding.length_m));
        Self::new(
            shape,
            &[(0.0, tip_m), (-winding.length_m, tip_m)],
            resolution,
        )
    }

    /// Area element of every node over the whole turn, m^2.
    pub fn areas_m2(&self) -> impl Iterator<Item = f64> + '_ {
        self.nodes
            .iter()
            .map(|n| std::f64::consts::TAU * n.r_m * n.weight_m)
    }
}

impl CoreShape {
    /// Point (r, z) and outer normal of a face at a coordinate.
    #[must_use]
    pub fn on(&self, face: Face, at_m: f64) -> (f64, f64, [f64; 2]) {
        match face {
            Face::Bottom => (at_m, self.bottom_m, [0.0, -1.0]),
            Face::Side => (self.radius_m, at_m, [1.0, 0.0]),
            Face::Top => (at_m, self.top_m, [0.0, 1.0]),
        }
    }
}

/// Break points of `lo..hi` whose pieces shrink by `ratio` towards both ends, down to the ends'
/// tip lengths; an end whose tip is not smaller than the interval is not graded.
fn graded(lo: f64, hi: f64, lo_tip: f64, hi_tip: f64, ratio: f64) -> Vec<f64> {
    let length = hi - lo;
    let (from_lo, from_hi) = (lo_tip < 0.5 * length, hi_tip < 0.5 * length);
    let reach = if from_lo && from_hi {
        0.5 * length
    } else {
        length
    };
    let offsets = |tip: f64| {
        let mut offsets = Vec::new();
        let mut at = ratio * reach;
        while at > tip {
            offsets.push(at);
            at *= ratio;
        }
        offsets.push(at);
        offsets
    };
    let mut points = vec![lo];
    if from_lo {
        points.extend(offsets(lo_tip).iter().rev().map(|t| lo + t));
    }
    if from_lo && from_hi {
        points.push(lo + reach);
    }
    if from_hi {
        points.extend(offsets(hi_tip).iter().map(|t| hi - t));
    }
    points.push(hi);
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_shrink_towards_the_ends_with_tips_at_any_size() {
        for (lo_tip, hi_tip) in [(1.3, 0.01), (0.03, 0.7), (0.02, 0.004), (0.6, 2.0)] {
            let (lo, hi, ratio) = (0.25, 1.5, 0.2);
            let base = graded(lo, hi, lo_tip, hi_tip, ratio);
            for unit in [2.0_f64.powi(-20), 1.0, 2.0_f64.powi(20)] {
                let points = graded(unit * lo, unit * hi, unit * lo_tip, unit * hi_tip, ratio);
                let scaled: Vec<f64> = base.iter().map(|p| p * unit).collect();
                assert_eq!(points, scaled);
            }
            let lengths: Vec<f64> = base.windows(2).map(|p| p[1] - p[0]).collect();
            assert!(base[0] == lo && base[base.len() - 1] == hi);
            assert!(lengths.iter().all(|length| *length > 0.0));
            // An end whose tip is half the interval or more is left as it is.
            let ends = [(lo_tip, lengths[0]), (hi_tip, lengths[lengths.len() - 1])];
            let longest = lengths.iter().fold(0.0_f64, |m, length| m.max(*length));
            for (tip, length) in ends {
                if tip < 0.625 {
                    assert!(
                        length <= tip && length > 0.9 * ratio * tip,
                        "{tip} {length}"
                    );
                } else {
                    assert_eq!(length, longest);
                }
            }
        }
    }
}
