//! The lengths of a plate that a search may vary.

use fluxform_design::iron::{Plate, PlateOutline};
use fluxform_design::search::SearchKey;

/// The keys of a plate.
pub(super) const KEYS: [SearchKey; 5] = [
    SearchKey::PlateThickness,
    SearchKey::PlateX,
    SearchKey::PlateY,
    SearchKey::PlateDiameter,
    SearchKey::PlateGap,
];

fn length_of(plate: &mut Plate, key: SearchKey) -> Option<&mut f64> {
    match (key, &mut plate.outline) {
        (SearchKey::PlateThickness, _) => Some(&mut plate.thickness_m),
        (SearchKey::PlateGap, _) => Some(&mut plate.gap_m),
        (SearchKey::PlateX, PlateOutline::Rectangle([x, _])) => Some(x),
        (SearchKey::PlateY, PlateOutline::Rectangle([_, y])) => Some(y),
        (SearchKey::PlateDiameter, PlateOutline::Round(diameter)) => Some(diameter),
        _ => None,
    }
}

/// The length that a key names, m; `None` where a plate of this outline has none.
pub(super) fn length_m(plate: &Plate, key: SearchKey) -> Option<f64> {
    length_of(&mut plate.clone(), key).copied()
}

/// Sets the length that a key names, m.
pub(super) fn set(plate: &mut Plate, key: SearchKey, value_m: f64) {
    if let Some(length) = length_of(plate, key) {
        *length = value_m;
    }
}
