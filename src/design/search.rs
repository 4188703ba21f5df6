//! `[search]`: what `optimize --for` may vary, each key as the design names it.
//!
//! Two numbers are a range, one or more than two a list of choices. Keys that only a list makes sense
//! for (wires, rows, magnets) take lists of any length.

use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::reader::Section;
use super::rule::{BODY_MM, Bound, MAGNET_MM, OFFSET_MM, Rule, WIRE_MM};

/// A key that may be searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchKey {
    /// `coil.inner_diameter_mm`.
    InnerDiameter,
    /// `coil.outer_diameter_mm`.
    OuterDiameter,
    /// `coil.length_mm`.
    Length,
    /// `wire.diameter_mm`.
    Wire,
    /// `core.clearance_mm`.
    Clearance,
    /// `core.above_mm`.
    Above,
    /// `core.below_mm`.
    Below,
    /// `plate.thickness_mm`.
    PlateThickness,
    /// `plate.x_mm`.
    PlateX,
    /// `plate.y_mm`.
    PlateY,
    /// `plate.diameter_mm`.
    PlateDiameter,
    /// `plate.gap_mm`.
    PlateGap,
    /// `array.pitch_mm`.
    Pitch,
    /// `array.rows`.
    Rows,
    /// `array.columns`.
    Columns,
    /// `array.move_mm`: how far coils may move along x and y.
    Move,
    /// `shapes.height_mm`: how far the shapes are raised.
    Height,
}

/// The values that a key may have, in its own unit.
#[derive(Debug, Clone, PartialEq)]
pub enum SearchValues {
    /// All of these and between, the first below the second.
    Range([f64; 2]),
    /// One of these, rising.
    Listed(Vec<f64>),
}

impl SearchValues {
    /// The least and the largest.
    #[must_use]
    pub fn ends(&self) -> [f64; 2] {
        match self {
            Self::Range(ends) => *ends,
            Self::Listed(list) => [list[0], list[list.len() - 1]],
        }
    }
}

/// Which coils move alike.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum Symmetry {
    /// Those that the symmetries of a square map to each other.
    #[default]
    Square,
    /// Those that lie mirrored about the x or the y axis.
    Mirrored,
    /// None: every coil by itself.
    Free,
}

/// How the coils of an array lie.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum SearchLayout {
    /// Rows and columns.
    Grid,
    /// Every other row shifted by half a pitch, rows closer together: neighbours on triangles.
    Shifted,
    /// One coil in the centre, the others on a ring whose radius is the pitch at least.
    Ring,
}

/// `[search]`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SearchSpace {
    /// The keys that vary, each once.
    pub keys: Vec<(SearchKey, SearchValues)>,
    /// Layouts to choose from; empty: as given.
    pub layouts: Vec<SearchLayout>,
    /// Magnets to choose from, diameter and length, mm; empty: as given.
    pub magnets_mm: Vec<[f64; 2]>,
    /// Which coils move alike.
    pub symmetry: Symmetry,
    /// Whether a coil without a core is tried too.
    pub without_core: bool,
    /// Whether an array without its plate is tried too.
    pub without_plate: bool,
}

impl SearchSpace {
    /// The values of a key that varies.
    #[must_use]
    pub fn values(&self, key: SearchKey) -> Option<&SearchValues> {
        self.keys
            .iter()
            .find(|(known, _)| *known == key)
            .map(|(_, values)| values)
    }

    /// Whether a coil alone, its wire or its core differs between the designs.
    #[must_use]
    pub fn changes_coil(&self) -> bool {
        self.without_core || self.keys.iter().any(|(key, _)| key.is_of_coil())
    }
}

const TWICE: &str = "a choice is there twice";
const ONCE: &str = "give each value once";

const COUNT: Rule = Rule::any("").bound(Bound::AtLeast(1.0));
const BODY: Rule = BODY_MM.positive();
const GAP: Rule = OFFSET_MM.bound(Bound::NotNegative);

/// A key with its path in a design and the rule on its values.
type Row = (SearchKey, &'static str, Rule);

/// The keys, section by section.
static KEYS: [Row; 17] = [
    (SearchKey::InnerDiameter, "coil.inner_diameter_mm", BODY),
    (SearchKey::OuterDiameter, "coil.outer_diameter_mm", BODY),
    (SearchKey::Length, "coil.length_mm", BODY),
    (SearchKey::Wire, "wire.diameter_mm", WIRE_MM.positive()),
    (SearchKey::Clearance, "core.clearance_mm", GAP),
    (SearchKey::Above, "core.above_mm", OFFSET_MM),
    (SearchKey::Below, "core.below_mm", OFFSET_MM),
    (SearchKey::PlateThickness, "plate.thickness_mm", BODY),
    (SearchKey::PlateX, "plate.x_mm", BODY),
    (SearchKey::PlateY, "plate.y_mm", BODY),
    (SearchKey::PlateDiameter, "plate.diameter_mm", BODY),
    (SearchKey::PlateGap, "plate.gap_mm", GAP),
    (SearchKey::Pitch, "array.pitch_mm", BODY),
    (SearchKey::Rows, "array.rows", COUNT),
    (SearchKey::Columns, "array.columns", COUNT),
    (SearchKey::Move, "array.move_mm", OFFSET_MM),
    (SearchKey::Height, "shapes.height_mm", OFFSET_MM),
];

/// The section `of`, its [`KEYS`] read into `space`.
fn section<'a>(space: &mut SearchSpace, s: &mut Section<'a>, of: &'static str) -> Section<'a> {
    let mut section = s.section(of);
    for (key, path, rule) in &KEYS {
        if let Some((_, name)) = path.split_once('.').filter(|(first, _)| *first == of) {
            add(space, &mut section, *key, name, rule);
        }
    }
    section
}

/// Reads the section.
pub(crate) fn read(mut s: Section<'_>) -> SearchSpace {
    let mut space = SearchSpace::default();
    section(&mut space, &mut s, "coil").finish();
    section(&mut space, &mut s, "wire").finish();
    let mut core = section(&mut space, &mut s, "core");
    space.without_core = core.flag_or("none", false);
    core.finish();
    let mut plate = section(&mut space, &mut s, "plate");
    space.without_plate = plate.flag_or("none", false);
    plate.finish();
    let mut array = section(&mut space, &mut s, "array");
    space.layouts = array.choices("layout");
    space.symmetry = array.choice("symmetry").unwrap_or_default();
    array.finish();
    let mut magnet = s.section("magnet");
    let sizes = magnet.pairs("size_mm", &MAGNET_MM.positive(), MAGNETS_MAX);
    space.magnets_mm = sizes
        .unwrap_or_default()
        .iter()
        .map(|size| size.value)
        .collect();
    let mut others = space.magnets_mm.iter().enumerate();
    if others.any(|(index, size)| space.magnets_mm[..index].contains(size)) {
        magnet.fault("size_mm", TWICE, ONCE);
    }
    magnet.finish();
    section(&mut space, &mut s, "shapes").finish();
    s.finish();
    space
}

/// Most magnets to choose from.
const MAGNETS_MAX: usize = 100;

impl SearchKey {
    /// Its path in a design, like `coil.length_mm`.
    #[must_use]
    pub fn path(self) -> &'static str {
        KEYS[self as usize].1
    }

    /// Whether it is one of a coil alone.
    fn is_of_coil(self) -> bool {
        let of_coil = ["coil.", "wire.", "core."];
        of_coil.iter().any(|of| self.path().starts_with(of))
    }

    /// Whether its values are whole numbers.
    fn is_count(self) -> bool {
        KEYS[self as usize].2 == COUNT
    }

    /// Whether two values are two choices, not the ends of a range.
    fn is_listed(self) -> bool {
        self.is_count() || self == Self::Wire
    }
}

fn add(
    space: &mut SearchSpace,
    s: &mut Section<'_>,
    key: SearchKey,
    name: &'static str,
    rule: &Rule,
) {
    let Some(given) = s.numbers(name, rule) else {
        return;
    };
    let mut list = given.value;
    if list.is_empty() || list.iter().any(|value| value.is_nan()) {
        return;
    }
    if let ([low, high], false) = (&list[..], key.is_listed()) {
        if low < high {
            space.keys.push((key, SearchValues::Range([*low, *high])));
        } else {
            let message = format!("the range from {low} to {high} holds no values");
            s.fault(
                name,
                message,
                "write the lower end first; one value alone fixes the key",
            );
        }
        return;
    }
    if key.is_count() && list.iter().any(|v| v.fract() != 0.0) {
        s.fault(name, "expected whole numbers", "as in rows = [3, 4, 5]");
    }
    list.sort_by(f64::total_cmp);
    if list.windows(2).any(|pair| pair[0] == pair[1]) {
        s.fault(name, TWICE, ONCE);
    }
    space.keys.push((key, SearchValues::Listed(list)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_has_its_own_row() {
        for (index, (key, path, _)) in KEYS.iter().enumerate() {
            assert_eq!(*key as usize, index, "{path}");
        }
    }
}
