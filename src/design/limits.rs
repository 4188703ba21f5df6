//! `[limits]`: what a coil and an array may be, each optional; `[cost]`: what they are made of costs.

use super::reader::Section;
use super::rule::{BODY_MM, Bound, Rule, slip};
use fluxform_base::units::m_from_mm;

/// The rule on a key's numbers, and their way to SI.
type Unit = (Rule, fn(f64) -> f64);

const MM: Unit = (BODY_MM, m_from_mm);
const MS: Unit = (
    Rule::any("ms").slips(&[slip(0.0, 0.5, "seconds", 1000.0)]),
    |ms| ms / 1000.0,
);

const fn si(unit: &'static str) -> Unit {
    (Rule::any(unit), |value| value)
}

/// The struct, its reader and the keys' meanings from one table: a limit's field, key, unit and meaning.
macro_rules! limits {
    ($($field:ident: $key:literal, $unit:expr, $meaning:literal;)+) => {
        /// Limits, SI; `None` where the design names none.
        #[derive(Debug, Clone, Copy, PartialEq, Default)]
        pub struct Limits {
            $(#[doc = concat!("The ", $meaning, ".")] pub $field: Option<f64>,)+
        }

        /// The meanings of the section's keys.
        pub(crate) const MEANINGS: &[(&str, &str)] = &[$((concat!("limits.", $key), $meaning)),+];

        /// Reads the section.
        pub(crate) fn read(mut s: Section<'_>) -> Limits {
            let mut limit = |key, (rule, si): Unit| {
                let given = s.number(key, &rule.bound(Bound::Limit));
                given.map(|limit| si(limit.value))
            };
            let limits = Limits { $($field: limit($key, $unit)),+ };
            s.finish();
            limits
        }
    };
}

limits! {
    resistance_max_ohm: "resistance_max_ohm", si("ohm"), "resistance at the wire's temperature";
    settling_max_s: "settling_max_ms", MS, "settling of the coil: five time constants, or what its loop takes with `supply.driver = \"current\"`";
    outer_diameter_max_m: "outer_diameter_max_mm", MM, "outer diameter of the winding";
    inner_diameter_min_m: "inner_diameter_min_mm", MM, "bore of the winding, at least; without it `optimize --wound` takes that of a bobbin";
    length_max_m: "length_max_mm", MM, "length of the winding";
    power_max_w: "power_max_w", si("W"), "heat at the rated current";
    mass_max_kg: "mass_max_kg", si("kg"), "mass of wire and core";
    wire_length_max_m: "wire_length_max_m", si("m"), "length of the wire";
    core_field_max_t: "core_field_max_t", si("T"), "flux density in the core of one coil alone; `evaluate` warns where neighbours raise it further";
    footprint_max_m: "footprint_max_mm", MM, "larger side of the rectangle that holds all coils and the plate";
    array_power_max_w: "array_power_max_w", si("W"), "most heat of all coils at currents that the supply allows, in their sum too, where signs count";
    static_power_max_w: "static_power_max_w", si("W"), "heat of all coils at the static currents of the shape that takes most, at its force constant; known only with shapes";
    feedback_power_max_w: "feedback_power_max_w", si("W"), "mean heat of all coils over that shape with position feedback, currents of least power; known only with shapes";
    array_mass_max_kg: "array_mass_max_kg", si("kg"), "mass of all coils, cores and the plate";
    array_settling_max_s: "array_settling_max_ms", MS, "the same of the slowest pattern of currents in the array; without it `optimize --for` takes `settling_max_ms`";
    array_cost_max: "array_cost_max", si(""), "cost of all coils, cores and the plate by `[cost]`";
}

/// Prices in any one currency; 0 where the design names none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Prices {
    /// Of a coil whatever its size: its bobbin, driver and work.
    pub per_coil: f64,
    /// Of a kilogram of wire.
    pub wire_per_kg: f64,
    /// Of a kilogram of steel.
    pub steel_per_kg: f64,
}

/// Reads `[cost]`.
pub(crate) fn prices(mut s: Section<'_>) -> Prices {
    let mut price = |key| {
        let given = s.number(key, &Rule::any("").bound(Bound::NotNegative));
        given.map_or(0.0, |price| price.value)
    };
    let prices = Prices {
        per_coil: price("per_coil"),
        wire_per_kg: price("wire_per_kg"),
        steel_per_kg: price("steel_per_kg"),
    };
    s.finish();
    prices
}
