//! The optimiser's outcomes in the words of the result.

use std::collections::BTreeMap;

use super::{
    ALTERNATIVES_MAX, AlternativeFacts, FixedFacts, NoCoil, Search, SizeFacts, ViolationFacts,
    WireFacts,
};
use crate::coil::limits::LIMITS;
use crate::coil::optimum::alternatives::{Alternative, Reduced};
use crate::coil::optimum::outcome::Violation;
use crate::coil::optimum::problem::Regime;
use crate::coil::optimum::{
    BestCoil, Fixed, LimitName, OptimumStatus, Outcome, Window, WoundCoil, WoundOutcome,
};

pub(super) fn status(status: &OptimumStatus) -> &'static str {
    match status {
        OptimumStatus::Optimal => "optimal",
        OptimumStatus::Infeasible { .. } | OptimumStatus::Contradictory(_) => "infeasible",
        OptimumStatus::Unbounded { .. } => "unbounded",
    }
}

/// Why there is no coil; `None` where there is one.
pub(super) fn no_coil(status: &OptimumStatus, wound: bool) -> Option<NoCoil> {
    match status {
        OptimumStatus::Optimal => None,
        OptimumStatus::Contradictory(found) => Some(NoCoil {
            message: format!("no coil meets the limits: {}", found.message),
            violations: Vec::new(),
            least: None,
            missing: Vec::new(),
        }),
        OptimumStatus::Infeasible { violations, least } => Some(NoCoil {
            message: infeasible(violations, wound),
            violations: violations
                .iter()
                .map(|broken| ViolationFacts {
                    name: broken.name.key(),
                    value: broken.value,
                    limit: broken.limit,
                    excess: broken.excess.exp_m1(),
                })
                .collect(),
            least: Some(size(least)).filter(|size| size.length_m > 0.0),
            missing: Vec::new(),
        }),
        OptimumStatus::Unbounded { missing } => {
            let keys: Vec<&str> = missing.iter().map(|name| name.limit().design_key).collect();
            let sizes = match keys.as_slice() {
                [] => "limits on outer diameter and length".to_owned(),
                keys => keys.join(" and "),
            };
            let ending = LIMITS.iter().filter(|limit| limit.ends_growth);
            let ending: Vec<&str> = ending.map(|limit| limit.design_key).collect();
            Some(NoCoil {
                message: format!(
                    "the force grows without end: set {sizes}, or one of {}",
                    ending.join(", ")
                ),
                violations: Vec::new(),
                least: None,
                missing: missing.iter().map(|name| name.key()).collect(),
            })
        }
    }
}

fn infeasible(violations: &[Violation], wound: bool) -> String {
    let kind = if wound {
        "coil that can be wound"
    } else {
        "coil"
    };
    let Some(worst) = violations.first() else {
        return format!("no {kind} meets the limits");
    };
    let blamed = worst.name.limit();
    let (unit, scale) = blamed.written;
    let [value, limit] = apart(worst.value * scale, worst.limit * scale);
    let others = violations.len() - 1;
    let besides = match others {
        0 => String::new(),
        1 => ", and one more limit is missed".to_owned(),
        n => format!(", and {n} more limits are missed"),
    };
    format!(
        "no {kind} meets the limits: nearest to blame is {}; even the coil that misses least has \
         {value} {unit} where {limit} {unit} are allowed, {:.1} % off{besides}",
        blamed.design_key,
        worst.excess.exp_m1().abs() * 100.0
    )
}

/// Two numbers with as many digits as it takes to see that they differ, at least five.
fn apart(a: f64, b: f64) -> [String; 2] {
    let with = |digits: usize| {
        [a, b].map(|value| {
            let exponent = if value == 0.0 {
                0
            } else {
                value.abs().log10().floor() as i32
            };
            if (-4..15).contains(&exponent) {
                let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
                format!("{value:.decimals$}")
            } else {
                format!("{value:.*e}", digits - 1)
            }
        })
    };
    (5..17)
        .map(with)
        .find(|[a, b]| a != b)
        .unwrap_or_else(|| with(17))
}

pub(super) fn fixed(fixed: &Fixed, best: Option<&BestCoil>) -> BTreeMap<&'static str, FixedFacts> {
    let mut told = BTreeMap::new();
    for (name, value) in [
        (LimitName::FixedInner, fixed.inner_diameter_m),
        (LimitName::FixedOuter, fixed.outer_diameter_m),
        (LimitName::FixedLength, fixed.length_m),
    ] {
        let Some(value) = value else { continue };
        let used = best.and_then(|best| best.limits.iter().find(|used| used.name == name));
        let facts = FixedFacts {
            value,
            sensitivity_n_per_unit: used.map(|used| used.sensitivity_n_per_unit),
        };
        told.insert(name.key(), facts);
    }
    told
}

fn size(window: &Window) -> SizeFacts {
    SizeFacts {
        inner_diameter_m: 2.0 * window.inner_radius_m,
        outer_diameter_m: 2.0 * window.outer_radius_m(),
        length_m: window.length_m,
    }
}

pub(super) fn continuous(found: Outcome, around: &[Alternative]) -> Search {
    let wire = |wire: &crate::coil::optimum::outcome::WireOutcome| WireFacts {
        wire_diameter_m: wire.strand.diameter_m,
        force_n: wire.force_n,
    };
    Search {
        status: found.status,
        whole: None,
        continuous_n: found.best.as_ref().map(|best| best.force_n),
        continuous: found.best.clone(),
        alternatives: found.best.as_ref().map_or_else(Vec::new, |best| {
            let mut list: Vec<AlternativeFacts> = Vec::new();
            for coil in around.iter().map(|coil| other(coil, best)) {
                if !list.iter().any(|known| same(known, &coil)) {
                    list.push(coil);
                }
            }
            list
        }),
        best: found.best,
        certificate: found.certificate,
        evaluations: found.evaluations,
        starts: found.starts,
        valley_m: found.valley_m,
        wires: found.wires.iter().map(wire).collect(),
    }
}

fn other(found: &Alternative, best: &BestCoil) -> AlternativeFacts {
    let volume = found.window.volume_over_pi_m3().value;
    let resistance_ohm = volume * found.strand.resistance_per_volume();
    let wire_mass_kg = volume * found.strand.mass_per_volume();
    let power_w = found.current_a * found.current_a * resistance_ohm;
    let best_volume = best.window.volume_over_pi_m3().value;
    let best_w =
        best.current_a * best.current_a * best_volume * best.strand.resistance_per_volume();
    let named = match found.reduced {
        Reduced::Length => "shorter",
        Reduced::Mass => "lighter",
        Reduced::Power => "cooler",
    };
    AlternativeFacts {
        size: size(&found.window),
        turns: found.turns,
        layers: None,
        turns_per_layer: None,
        wire_diameter_m: found.strand.diameter_m,
        force_n: found.force_n,
        force_lost: 0.0,
        wire_mass_kg,
        power_w,
        better: better(
            [found.window.length_m, wire_mass_kg, power_w],
            [
                best.window.length_m,
                best_volume * best.strand.mass_per_volume(),
                best_w,
            ],
            Some(named),
        ),
    }
}

/// Whether two coils differ by less than what alternatives are found to.
fn same(a: &AlternativeFacts, b: &AlternativeFacts) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-3 * b;
    near(a.size.length_m, b.size.length_m)
        && near(a.size.outer_diameter_m, b.size.outer_diameter_m)
        && near(a.wire_mass_kg, b.wire_mass_kg)
}

/// In what the first is better than the second by more than rounding.
fn better(ours: [f64; 3], theirs: [f64; 3], besides: Option<&'static str>) -> Vec<&'static str> {
    let words = ["shorter", "lighter", "cooler"];
    let less = |(ours, theirs): (f64, f64)| ours < theirs * (1.0 - 1e-9);
    words
        .into_iter()
        .zip(ours.into_iter().zip(theirs))
        .filter(|(word, values)| less(*values) || besides == Some(*word))
        .map(|(word, _)| word)
        .collect()
}

pub(super) fn wound(found: WoundOutcome) -> Search {
    let traits = |coil: &WoundCoil| [coil.window.length_m, coil.wire_mass_kg, coil.power_w];
    let alternative = |coil: &WoundCoil, best: &WoundCoil| AlternativeFacts {
        size: size(&coil.window),
        turns: (coil.layers * coil.turns_per_layer) as f64,
        layers: Some(coil.layers),
        turns_per_layer: Some(coil.turns_per_layer),
        wire_diameter_m: coil.strand.diameter_m,
        force_n: coil.force_n,
        force_lost: 0.0,
        wire_mass_kg: coil.wire_mass_kg,
        power_w: coil.power_w,
        better: better(traits(coil), traits(best), None),
    };
    let alternatives = found.best.as_ref().map_or_else(Vec::new, |best| {
        let list = &found.alternatives;
        // Of many the strongest, the weakest and those evenly between.
        let told = list.len().min(ALTERNATIVES_MAX);
        let at = |k: usize| k * (list.len() - 1) / (told - 1).max(1);
        (0..told).map(|k| alternative(&list[at(k)], best)).collect()
    });
    Search {
        whole: found
            .best
            .as_ref()
            .map(|best| [best.layers, best.turns_per_layer]),
        best: found.best.as_ref().map(best_coil),
        status: found.status,
        continuous: found.continuous,
        continuous_n: found.continuous_n,
        certificate: found.certificate,
        evaluations: found.evaluations,
        starts: found.starts,
        valley_m: None,
        wires: Vec::new(),
        alternatives,
    }
}

fn best_coil(coil: &WoundCoil) -> BestCoil {
    let supply = coil
        .limits
        .iter()
        .any(|used| used.name == LimitName::Current);
    BestCoil {
        window: coil.window,
        strand: coil.strand,
        turns: (coil.layers * coil.turns_per_layer) as f64,
        regime: if supply {
            Regime::Supply
        } else {
            Regime::Driver
        },
        current_a: coil.current_a,
        force_n: coil.force_n,
        limits: coil.limits.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A limit of 1e-9 ohm was once printed as 0.00000 ohm.
    #[test]
    fn compared_numbers_show_what_is_compared() {
        assert_eq!(apart(5.9e-9, 1e-9), ["5.9000e-9", "1.0000e-9"]);
        assert_eq!(apart(6.2, 6.0), ["6.2000", "6.0000"]);
        assert_eq!(apart(6.000_000_1, 6.0), ["6.0000001", "6.0000000"]);
        assert_eq!(apart(0.000_31, 0.0), ["0.00031000", "0.0000"]);
    }
}
