//! A coil as a body that its current heats ([`fluxform_base::heating`]).

use std::f64::consts::PI;

use fluxform_base::heating::{Cooling, WarmCoil};
use fluxform_base::units::{
    COPPER_HEAT_CAPACITY_J_PER_KG_K, COPPER_TEMPERATURE_COEFFICIENT_PER_K, REFERENCE_TEMPERATURE_C,
    STEEL_HEAT_CAPACITY_J_PER_KG_K,
};
use fluxform_field::winding::Winding;

use super::circuit::Circuit;

/// A coil of this winding and circuit, whose resistance is that at `wire_c`, with a core of `core_kg`: its
/// mantle and end faces lose heat, of a coil without a core the faces of the winding. No voltage limits its current.
#[must_use]
pub fn warm_coil(
    winding: &Winding,
    circuit: &Circuit,
    wire_c: f64,
    core_kg: f64,
    cooling: &Cooling,
) -> WarmCoil {
    let warmth =
        |c: f64| 1.0 + COPPER_TEMPERATURE_COEFFICIENT_PER_K * (c - REFERENCE_TEMPERATURE_C);
    let ambient = warmth(cooling.ambient_c);
    let (outer, inner) = (winding.outer_radius_m, winding.inner_radius_m);
    let hollow = if core_kg > 0.0 { 0.0 } else { inner };
    let surface_m2 = 2.0 * PI * (outer * winding.length_m + (outer * outer - hollow * hollow));
    WarmCoil {
        resistance_ohm: circuit.resistance_ohm * ambient / warmth(wire_c),
        growth_per_k: COPPER_TEMPERATURE_COEFFICIENT_PER_K / ambient,
        capacity_j_per_k: COPPER_HEAT_CAPACITY_J_PER_KG_K * circuit.wire_mass_kg
            + STEEL_HEAT_CAPACITY_J_PER_KG_K * core_kg,
        loss_w_per_k: cooling.surface_w_per_m2_k * surface_m2,
        voltage_v: None,
    }
}
