//! Panels near windings and magnets are no larger than what changes there, however large the body is.

use super::face::{Face, Panel, Point};
use crate::winding::Winding;
use fluxform_numerics::vec3::norm;

/// Longest side of a panel relative to its distance from a winding's section and the section's width, over which the
/// layer changes below a winding's end however close that is.
const LONGEST: f64 = 2.0;
/// Least width that counts, in inner radii: a narrow winding's peak of the layer holds little of it.
const NARROW: f64 = 0.25;
/// Longest side of a panel relative to its distance from a magnet.
const LONGEST_BESIDE_MAGNET: f64 = 1.5;

/// The longest side that a panel of a face may have, m.
pub(super) type LongestSide<'a> = dyn Fn(&Panel, &Face) -> f64 + 'a;

/// Adds `panel` of `face` to `out`, halved as long as a side is too long.
pub(super) fn add_halved(
    panel: Panel,
    face: &Face,
    longest_m: &LongestSide<'_>,
    out: &mut Vec<Panel>,
) {
    if panel.sides_m[0].max(panel.sides_m[1]) <= longest_m(&panel, face) {
        out.push(panel);
        return;
    }
    for half in panel.halves(face) {
        add_halved(half, face, longest_m, out);
    }
}

/// Distance of a panel from the section of a winding about `axis_m`, m; no more than it is.
pub(super) fn from_section_m(panel: &Panel, winding: &Winding, axis_m: [f64; 2]) -> f64 {
    let [x, y, z] = panel.centre_m;
    let r = (x - axis_m[0]).hypot(y - axis_m[1]);
    let across = (winding.inner_radius_m - r).max(r - winding.outer_radius_m);
    let along = (-winding.length_m - z).max(z);
    (along.max(0.0).hypot(across.max(0.0)) - panel.radius_m).max(0.0)
}

/// Equal windings.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Windings {
    winding: Winding,
    /// Their axes, m.
    positions_m: Vec<[f64; 2]>,
}

impl Windings {
    pub(super) fn new(winding: Winding, positions_m: &[[f64; 2]]) -> Self {
        Self {
            winding,
            positions_m: positions_m.to_vec(),
        }
    }

    /// The longest side that a panel may have for its distance, m.
    pub(super) fn longest_m(&self, panel: &Panel) -> f64 {
        let axes_m = self.positions_m.iter();
        let distance_m = axes_m
            .map(|axis| from_section_m(panel, &self.winding, *axis))
            .fold(f64::INFINITY, f64::min);
        let inner_m = self.winding.inner_radius_m;
        let width_m = (self.winding.outer_radius_m - inner_m).max(NARROW * inner_m);
        LONGEST * (distance_m + width_m)
    }
}

/// Where dipoles of magnets may be.
pub(super) struct MagnetRoom {
    /// Boxes, from corner to corner, m.
    pub(super) boxes_m: Vec<[Point; 2]>,
    /// The least distance that counts, m; > 0.
    pub(super) least_m: f64,
}

impl MagnetRoom {
    /// The longest side that a panel may have for its distance, m.
    pub(super) fn longest_m(&self, panel: &Panel) -> f64 {
        let from_box = |[low, high]: &[Point; 2]| {
            let off: Point = std::array::from_fn(|i| {
                let at = panel.centre_m[i];
                (low[i] - at).max(at - high[i]).max(0.0)
            });
            norm(off) - panel.radius_m
        };
        let distances_m = self.boxes_m.iter().map(from_box);
        let distance_m = distances_m.fold(f64::INFINITY, f64::min);
        LONGEST_BESIDE_MAGNET * distance_m.max(self.least_m)
    }
}
