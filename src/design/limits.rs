//! `[limits]`: what a coil and an array may be, each optional; `[cost]`: what they are made of costs.

use super::reader::Section;
use super::rule::{BODY_MM, Bound, Rule, slip};
use fluxform_base::units::m_from_mm;

/// Limits; `None` where the design names none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// Resistance at the wire's temperature, ohm.
    pub resistance_max_ohm: Option<f64>,
    /// Five time constants, s.
    pub settling_max_s: Option<f64>,
    /// Outer diameter, m.
    pub outer_diameter_max_m: Option<f64>,
    /// Inner diameter (a lower limit), m.
    pub inner_diameter_min_m: Option<f64>,
    /// Length, m.
    pub length_max_m: Option<f64>,
    /// Heat at the rated current, W.
    pub power_max_w: Option<f64>,
    /// Mass of wire and core, kg.
    pub mass_max_kg: Option<f64>,
    /// Length of wire, m.
    pub wire_length_max_m: Option<f64>,
    /// Flux density in the core, T.
    pub core_field_max_t: Option<f64>,
    /// Side of the square that holds all coils, m.
    pub footprint_max_m: Option<f64>,
    /// Heat of all coils at their largest currents, W.
    pub array_power_max_w: Option<f64>,
    /// Heat of all coils at the static currents of the shape that takes most, W.
    pub static_power_max_w: Option<f64>,
    /// Mean heat of all coils with position feedback over the shape that takes most, W.
    pub feedback_power_max_w: Option<f64>,
    /// Mass of all coils with their cores, kg.
    pub array_mass_max_kg: Option<f64>,
    /// Five time constants of the slowest pattern of currents in the array, s.
    pub array_settling_max_s: Option<f64>,
    /// Cost of all coils, cores and the plate, in the currency of [`Prices`].
    pub array_cost_max: Option<f64>,
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

const SETTLING_MS: Rule = Rule::any("ms").slips(&[slip(0.0, 0.5, "seconds", 1000.0)]);

/// Reads the section.
pub(crate) fn read(mut s: Section<'_>) -> Limits {
    let mut limit = |key, rule: Rule| s.number(key, &rule.bound(Bound::Limit)).map(|l| l.value);
    let limits = Limits {
        resistance_max_ohm: limit("resistance_max_ohm", Rule::any("ohm")),
        settling_max_s: limit("settling_max_ms", SETTLING_MS).map(|ms| ms / 1000.0),
        outer_diameter_max_m: limit("outer_diameter_max_mm", BODY_MM).map(m_from_mm),
        inner_diameter_min_m: limit("inner_diameter_min_mm", BODY_MM).map(m_from_mm),
        length_max_m: limit("length_max_mm", BODY_MM).map(m_from_mm),
        power_max_w: limit("power_max_w", Rule::any("W")),
        mass_max_kg: limit("mass_max_kg", Rule::any("kg")),
        wire_length_max_m: limit("wire_length_max_m", Rule::any("m")),
        core_field_max_t: limit("core_field_max_t", Rule::any("T")),
        footprint_max_m: limit("footprint_max_mm", BODY_MM).map(m_from_mm),
        array_power_max_w: limit("array_power_max_w", Rule::any("W")),
        static_power_max_w: limit("static_power_max_w", Rule::any("W")),
        feedback_power_max_w: limit("feedback_power_max_w", Rule::any("W")),
        array_mass_max_kg: limit("array_mass_max_kg", Rule::any("kg")),
        array_settling_max_s: limit("array_settling_max_ms", SETTLING_MS).map(|ms| ms / 1000.0),
        array_cost_max: limit("array_cost_max", Rule::any("")),
    };
    s.finish();
    limits
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
