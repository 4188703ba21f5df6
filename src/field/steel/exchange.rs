//! Panels of the exchange rings along a core's side: short where fields vary, longer far from there.
//!
//! The field of a neighbour varies over the gap between the cores only near the ends of cores and
//! windings. At a distance s from all of these the layers, and so what they send, are analytic
//! within about s: panels as long as s keep the error of those of a gap's length beside an end, and
//! their number grows like the logarithm of length over gap. The kernel itself still varies over
//! the gap there: on long panels it is integrated against the layer's interpolation.

use super::CoreShape;
use super::generatrix::Panel;

/// Shortest panels and the heights that they surround.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grading {
    /// Length of a panel beside an end, m; > 0.
    pub shortest_m: f64,
    /// Heights of the ends of cores and windings, m.
    pub ends_m: [f64; 4],
}

impl Grading {
    /// Panels of `shortest_m` at the ends of a core of `shape` and of a winding from 0 down to
    /// `-winding_length_m`.
    #[must_use]
    pub fn new(shortest_m: f64, shape: CoreShape, winding_length_m: f64) -> Self {
        Self {
            shortest_m,
            ends_m: [shape.top_m, 0.0, -winding_length_m, shape.bottom_m],
        }
    }

    /// Length of the panel that reaches down from `z_m`: at most its distance from every end, m.
    #[must_use]
    pub fn length_m(&self, z_m: f64) -> f64 {
        let room = |end_m: f64| {
            if end_m < z_m {
                // The panel's lower end is as far from the end as the panel is long.
                0.5 * (z_m - end_m)
            } else {
                end_m - z_m
            }
        };
        let free_m = self
            .ends_m
            .map(room)
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        free_m.max(self.shortest_m)
    }

    /// Whether a panel is longer than those beside an end: the kernel varies over parts of it.
    #[must_use]
    pub fn stretches(&self, length_m: f64) -> bool {
        length_m > 1.25 * self.shortest_m
    }
}

/// (from, to) of the panels of a core's side from the top down; one that begins at z is at most
/// about `length_m(z)` long.
#[must_use]
pub(crate) fn side_panels(shape: CoreShape, length_m: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let mut panels = Vec::new();
    let mut top = shape.top_m;
    while top > shape.bottom_m {
        let left = top - shape.bottom_m;
        let mut length = length_m(top).min(left);
        // No sliver at the end.
        if left - length < 0.5 * length {
            length = if left < 1.2 * length {
                left
            } else {
                0.5 * left
            };
        }
        let bottom = if length >= left {
            shape.bottom_m
        } else {
            top - length
        };
        panels.push((bottom, top));
        top = bottom;
    }
    panels
}

/// A panel longer than the gap, and its first ring.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Stretched {
    /// Index of its first ring.
    pub first: usize,
    /// Where it is.
    pub panel: Panel,
}

impl Stretched {
    /// The panel in parts over each of which a kernel is smooth that is singular `gap_m` beside
    /// the height `z_m`.
    #[must_use]
    pub fn parts(&self, z_m: f64, gap_m: f64) -> Vec<(f64, f64)> {
        let mut open = vec![self.panel.range_m()];
        let mut parts = Vec::new();
        while let Some((lo, hi)) = open.pop() {
            let off_m = (lo - z_m).max(z_m - hi).max(0.0);
            if hi - lo <= PART * gap_m.max(off_m) {
                parts.push((lo, hi));
            } else {
                let middle = 0.5 * (lo + hi);
                open.extend([(middle, hi), (lo, middle)]);
            }
        }
        parts
    }
}

/// Length of a panel over which a kernel is smooth, in distances from where it is singular.
pub const PART: f64 = 1.5;
/// Gap between cores that touch, or nearly, in radii.
pub(crate) const LEAST_GAP: f64 = 0.05;

#[cfg(test)]
mod tests {
    use super::*;

    fn core(length_m: f64) -> CoreShape {
        CoreShape {
            radius_m: 0.007,
            bottom_m: -length_m,
            top_m: 0.0,
        }
    }

    /// They were as many as gaps fit on the core: 20 for 1 m, 20 000 for 1 km.
    #[test]
    fn panels_grow_with_the_logarithm_of_length_over_gap() {
        let count = |length_m: f64| {
            let grading = Grading::new(0.051, core(length_m), 0.7 * length_m);
            side_panels(core(length_m), |z| grading.length_m(z)).len()
        };
        let counts = [1.0, 10.0, 100.0, 1000.0].map(count);
        for pair in counts.windows(2) {
            assert!(pair[1] - pair[0] <= 16, "{counts:?}");
        }
        // A short core is cut as evenly as ever.
        let even = side_panels(core(0.1), |_| 0.051);
        let grading = Grading::new(0.051, core(0.1), 0.1);
        assert_eq!(even, side_panels(core(0.1), |z| grading.length_m(z)));
    }

    #[test]
    fn panels_are_no_longer_than_their_distance_from_every_end() {
        let grading = Grading::new(0.013, core(1.7), 0.6);
        for (from, to) in side_panels(core(1.7), |z| grading.length_m(z)) {
            if grading.stretches(to - from) {
                for end in grading.ends_m {
                    let off = (from - end).max(end - to);
                    assert!(1.5 * off >= to - from, "{from} {to} at {end}");
                }
            }
        }
    }

    #[test]
    fn parts_cover_a_panel_and_are_short_beside_the_height() {
        let panel = Panel {
            face: super::super::generatrix::Face::Side,
            from_m: -0.7,
            to_m: -0.2,
        };
        let parts = Stretched { first: 0, panel }.parts(-0.31, 0.01);
        let total: f64 = parts.iter().map(|(lo, hi)| hi - lo).sum();
        assert!((total - 0.5).abs() < 1e-15);
        assert!(parts.len() < 24, "{}", parts.len());
        for (lo, hi) in parts {
            let off = (lo + 0.31_f64).max(-0.31 - hi).max(0.01);
            assert!(hi - lo <= PART * off);
        }
    }
}
