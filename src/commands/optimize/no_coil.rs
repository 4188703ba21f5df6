//! Why there is no best coil, in words, with what to do.

use super::NoCoil;
use crate::coil::circuit::CoilSize;
use crate::coil::limits::LIMITS;
use crate::coil::optimum::outcome::Violation;
use crate::coil::optimum::{OptimumStatus, Outcome};

/// Why there is no coil; `None` where there is one.
pub(super) fn why(outcome: &Outcome, wound: bool) -> Option<NoCoil> {
    match &outcome.status {
        OptimumStatus::Optimal => None,
        OptimumStatus::Contradictory(contradiction) => Some(NoCoil {
            message: format!("no coil meets the limits: {}", contradiction.message),
            violations: Vec::new(),
            least: None,
            missing: Vec::new(),
        }),
        OptimumStatus::Infeasible { violations, least } => Some(NoCoil {
            message: infeasible(violations, wound, outcome.continuous.is_some()),
            violations: violations.clone(),
            least: Some(CoilSize::from(least)).filter(|size| size.length_m > 0.0),
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
                missing: missing.clone(),
            })
        }
    }
}

/// Where coils of any turns meet the limits, those of whole turns were compared next to the best one alone.
fn infeasible(violations: &[Violation], wound: bool, any_turns_do: bool) -> String {
    let kind = if wound {
        "coil that can be wound"
    } else {
        "coil"
    };
    let least = if any_turns_do {
        "of the whole coils next to the best one of any turns, the one that misses least has"
    } else if wound {
        "even the coil of any turns that misses least has"
    } else {
        "even the coil that misses least has"
    };
    let Some(worst) = violations.first() else {
        return format!("no {kind} meets the limits");
    };
    let blamed = worst.name.limit();
    let (unit, scale) = blamed.written;
    let [value, limit] = apart(worst.value * scale, worst.limit * scale);
    let others = violations.len() - 1;
    let more = match others {
        0 => String::new(),
        1 => ", and one more limit is missed".to_owned(),
        n => format!(", and {n} more limits are missed"),
    };
    format!(
        "no {kind} meets the limits: nearest to blame is {}; {least} {value} {unit} where {limit} {unit} are allowed, {:.1} % off{more}",
        blamed.design_key,
        worst.excess.abs() * 100.0
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
