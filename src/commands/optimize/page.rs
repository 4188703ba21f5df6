//! The page of an optimisation.

use super::result::{CircuitFacts, Optimization, SizeFacts};
use crate::report::optimum::{ActiveLimit, Alternative, OptimumFacts, page};

/// What `optimize` tells as one HTML page.
#[must_use]
pub fn html(result: &Optimization) -> String {
    page(&OptimumFacts {
        design: &result.design,
        version: result.fluxform_version,
        inputs: result
            .inputs
            .iter()
            .map(|input| (input.path.as_str(), input.sha256.as_str()))
            .collect(),
        none: result.no_coil.as_ref().map(|none| none.message.as_str()),
        found: result
            .objective
            .map(|best| (best.force_n, best.current_a, best.height_m)),
        coil: properties(result),
        limits: result
            .limits
            .iter()
            .chain(&result.bounds)
            .map(|(name, limit)| ActiveLimit {
                name,
                value: limit.value,
                limit: limit.limit,
                active: limit.active,
                sensitivity_n_per_unit: limit.sensitivity_n_per_unit,
            })
            .collect(),
        certificate: result.certificate.kind.name(),
        scope: [
            result.certificate.kind.scope(),
            result.certificate.kind.open_question(),
        ],
        bound: (result.certificate.upper_bound_n, result.certificate.gap),
        searched: [result.starts, result.evaluations, result.certificate.cells],
        alternatives: result
            .alternatives
            .iter()
            .map(|one| Alternative {
                size_m: [
                    one.size.inner_diameter_m,
                    one.size.outer_diameter_m,
                    one.size.length_m,
                ],
                force_n: one.force_n,
                lost: one.force_lost,
                wire_mass_kg: one.wire_mass_kg,
                power_w: one.power_w,
                better: one.better.clone(),
            })
            .collect(),
        notes: &result.notes,
    })
}

/// A number's name, and where it stands.
type Column<T> = (&'static str, fn(&T) -> f64);

/// The best coil's numbers beside those of the design's own.
fn properties(result: &Optimization) -> Vec<(&'static str, f64, Option<f64>)> {
    let (Some(coil), Some(best)) = (&result.coil, &result.objective) else {
        return Vec::new();
    };
    let given = result.given.as_ref();
    let force_n = given.map(|given| given.force_n);
    let mut rows = vec![("force_n", best.force_n, force_n)];
    let (size, own) = (coil.size, given.map(|given| given.size));
    let sizes: [Column<SizeFacts>; 3] = [
        ("inner_diameter_m", |size| size.inner_diameter_m),
        ("outer_diameter_m", |size| size.outer_diameter_m),
        ("length_m", |size| size.length_m),
    ];
    rows.extend(sizes.map(|(name, of)| (name, of(&size), own.as_ref().map(of))));
    rows.extend([
        ("turns", coil.turns, given.map(|given| given.turns)),
        ("wire_diameter_m", coil.wire_diameter_m, None),
    ]);
    let (circuit, own) = (coil.circuit, given.map(|given| given.circuit));
    let circuits: [Column<CircuitFacts>; 5] = [
        ("resistance_ohm", |circuit| circuit.resistance_ohm),
        ("settling_s", |circuit| circuit.settling_s),
        ("power_w", |circuit| circuit.power_w),
        ("mass_kg", |circuit| circuit.mass_kg),
        ("wire_length_m", |circuit| circuit.wire_length_m),
    ];
    rows.extend(circuits.map(|(name, of)| (name, of(&circuit), own.as_ref().map(of))));
    rows
}
