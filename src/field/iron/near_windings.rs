//! Panels near windings are no larger than what changes there, however large the body is.

use super::face::{Face, Panel};
use crate::winding::Winding;

/// Longest side of a panel relative to its distance from a winding's section and the section's width, over which the
/// layer changes below a winding's end however close that is.
const LONGEST: f64 = 2.0;
/// Least width that counts, in inner radii: a narrow winding's peak of the layer holds little of it.
const NARROW: f64 = 0.25;

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

    /// Adds `panel` of `face` to `out`, halved as long as it is too large for its distance.
    pub(super) fn add_halved(&self, panel: Panel, face: &Face, out: &mut Vec<Panel>) {
        let axes_m = self.positions_m.iter();
        let distance_m = axes_m
            .map(|axis| from_section_m(&panel, &self.winding, *axis))
            .fold(f64::INFINITY, f64::min);
        let inner_m = self.winding.inner_radius_m;
        let width_m = (self.winding.outer_radius_m - inner_m).max(NARROW * inner_m);
        if panel.sides_m[0].max(panel.sides_m[1]) <= LONGEST * (distance_m + width_m) {
            out.push(panel);
            return;
        }
        for half in panel.halves(face) {
            self.add_halved(half, face, out);
        }
    }
}
