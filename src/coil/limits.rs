//! The limits of equation 11 and of good practice, checked on a coil.

use std::collections::BTreeMap;

use serde::Serialize;

use super::circuit::{Circuit, turns_that_fit};
use fluxform_design::Design;

/// Relative difference between turns and turns that fit that counts as none.
const FULL: f64 = 1e-12;

/// A limit beside the value it bounds, SI.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LimitCheck {
    /// The coil's value.
    pub value: f64,
    /// The limit: an upper one but for `inner_diameter_m`.
    pub limit: f64,
    /// Whether the value respects the limit; equality does.
    pub met: bool,
}

/// Every limit the design names, by the names that artefacts use, and `winding_fill`, which
/// always holds: turns over turns that fit.
///
/// `power_w` is the heat at the rated current, `mass_kg` the mass of wire and core,
/// `core_field_t` the flux density in the core where there is one.
#[must_use]
pub fn check(
    design: &Design,
    circuit: &Circuit,
    power_w: f64,
    mass_kg: f64,
    core_field_t: Option<f64>,
) -> BTreeMap<&'static str, LimitCheck> {
    let limits = &design.limits;
    let mut checks = BTreeMap::new();
    let mut at_most = |name, value: f64, limit: Option<f64>| {
        if let Some(limit) = limit {
            checks.insert(
                name,
                LimitCheck {
                    value,
                    limit,
                    met: value <= limit,
                },
            );
        }
    };
    at_most(
        "resistance_ohm",
        circuit.resistance_ohm,
        limits.resistance_max_ohm,
    );
    at_most("settling_s", circuit.settling_s(), limits.settling_max_s);
    at_most("power_w", power_w, limits.power_max_w);
    at_most("mass_kg", mass_kg, limits.mass_max_kg);
    at_most(
        "wire_length_m",
        circuit.wire_length_m,
        limits.wire_length_max_m,
    );
    if let Some(core_field_t) = core_field_t {
        at_most("core_field_t", core_field_t, limits.core_field_max_t);
    }
    if let Some(coil) = &design.coil {
        at_most(
            "outer_diameter_m",
            coil.outer_diameter_m,
            limits.outer_diameter_max_m,
        );
        at_most("length_m", coil.length_m, limits.length_max_m);
        let fits = turns_that_fit(coil, &design.wire);
        let fill = circuit.turns / fits;
        // A window of whole layers is full but for the rounding of its dimensions.
        let fill = if (fill - 1.0).abs() <= FULL {
            1.0
        } else {
            fill
        };
        at_most("winding_fill", fill, Some(1.0));
        if let Some(limit) = limits.inner_diameter_min_m {
            let value = coil.inner_diameter_m;
            checks.insert(
                "inner_diameter_m",
                LimitCheck {
                    value,
                    limit,
                    met: value >= limit,
                },
            );
        }
    }
    checks
}
