//! The box that limits span, contradictions among them, and limits whose absence leaves the
//! force without a maximum.

use std::f64::consts::PI;

use super::problem::{Bounded, LimitName, Problem, Regime};
use crate::circuit::SETTLING_TIME_CONSTANTS;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_design::message_text::number;

/// Ranges that every coil within the limits keeps; infinite where nothing bounds them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    /// Inner radius, m.
    pub inner_m: [f64; 2],
    /// Outer radius, m.
    pub outer_m: [f64; 2],
    /// Least depth: one layer, m.
    pub depth_min_m: f64,
    /// Length, m.
    pub length_m: [f64; 2],
    /// (a2^2 - a1^2) L, m^3: what limits of resistance, heat, mass and wire come to.
    pub volume_m3: [f64; 2],
    /// Five L/R, s; infinite where drivers close current loops, whose times are not bounded
    /// over boxes.
    pub settling_max_s: f64,
}

/// Two limits that no coil meets together.
#[derive(Debug, Clone, PartialEq)]
pub struct Contradiction {
    /// The two, or one and geometry.
    pub between: [LimitName; 2],
    /// By how much, in the first one's SI unit.
    pub by: f64,
    /// In words.
    pub message: String,
}

/// Slack of a comparison of two limits.
const TOUCHING: f64 = 1e-12;

impl Domain {
    /// The ranges of `problem`.
    #[must_use]
    pub fn of(problem: &Problem<'_>) -> Self {
        let limit = |name| problem.limit_of(name);
        let wire_m = problem.strand.diameter_m;
        let per_volume = problem.strand.resistance_per_volume();
        let least_ohm = problem
            .bounds
            .iter()
            .filter_map(|bound| least_resistance_ohm(problem, bound));
        let least = least_ohm.fold(0.0, f64::max) / per_volume;
        let mut most = f64::INFINITY;
        for bound in &problem.bounds {
            let resistance = match (bound.name, problem.regime) {
                (LimitName::Resistance, _) => bound.limit,
                (LimitName::Power, Regime::Driver) => {
                    bound.limit / problem.task.current_max_a / problem.task.current_max_a
                }
                (LimitName::Voltage, _) => bound.limit / problem.task.current_max_a,
                (LimitName::ArrayPower, Regime::Driver) => {
                    // Of one ohm, at the voltage that gives the strongest driver its current: the supply may allow
                    // those that reverse farther no more.
                    let task = problem.task;
                    let voltage_v = task.voltage_v.map(|_| task.current_max_a);
                    let [heat_w, _] = task.drivers.most_heat_w(voltage_v, 1.0);
                    bound.limit / heat_w
                }
                (LimitName::Mass, _) => {
                    most = most.min(bound.limit / problem.strand.mass_per_volume());
                    continue;
                }
                (LimitName::ArrayMass, _) => {
                    let mass_kg = bound.limit / problem.task.drivers.ends_a.len() as f64;
                    most = most.min(mass_kg / problem.strand.mass_per_volume());
                    continue;
                }
                (LimitName::WireLength, _) => {
                    most = most.min(bound.limit / problem.strand.length_per_volume());
                    continue;
                }
                _ => continue,
            };
            most = most.min(resistance / per_volume);
        }
        let half = |name, default: f64| limit(name).map_or(default, |v| 0.5 * v);
        let inner_m = limit(LimitName::FixedInner)
            .map_or([half(LimitName::InnerDiameter, 0.0), f64::INFINITY], |v| {
                [0.5 * v; 2]
            });
        let outer_m = limit(LimitName::FixedOuter).map_or_else(
            || {
                let most = limit(LimitName::OuterDiameter).or(limit(LimitName::Pitch));
                [0.0, most.map_or(f64::INFINITY, |v| 0.5 * v)]
            },
            |v| [0.5 * v; 2],
        );
        let length_m = limit(LimitName::FixedLength).map_or(
            [wire_m, limit(LimitName::Length).unwrap_or(f64::INFINITY)],
            |v| [v; 2],
        );
        Self {
            inner_m: [
                inner_m[0],
                inner_m[1].min(outer_m[1] - wire_m).max(inner_m[0]),
            ],
            outer_m: [outer_m[0].max(inner_m[0] + wire_m), outer_m[1]],
            depth_min_m: wire_m,
            length_m,
            volume_m3: [least, most],
            settling_max_s: limit(LimitName::Settling)
                .filter(|_| !problem.closes_a_loop())
                .unwrap_or(f64::INFINITY),
        }
    }

    /// The first pair of limits that exclude each other whatever the coil.
    #[must_use]
    pub fn contradiction(problem: &Problem<'_>) -> Option<Contradiction> {
        given_outside_its_limit(problem)
            .or_else(|| no_room_for_a_layer(problem))
            .or_else(|| no_room_for_a_turn(problem))
            .or_else(|| Self::of(problem).resistance_out_of_reach(problem))
    }

    /// The least resistance that the current or the power needs, above the largest allowed.
    fn resistance_out_of_reach(&self, problem: &Problem<'_>) -> Option<Contradiction> {
        let [least, most] = self.volume_m3;
        if least <= most * (1.0 + TOUCHING) {
            return None;
        }
        let bounds = problem.bounds.iter();
        let lower = bounds
            .filter_map(|bound| Some((bound.name, least_resistance_ohm(problem, bound)?)))
            .max_by(|a, b| a.1.total_cmp(&b.1))?
            .0;
        let ratio = least / most;
        Some(Contradiction {
            between: [LimitName::Resistance, lower],
            by: (ratio - 1.0) * most * problem.strand.resistance_per_volume(),
            message: format!(
                "the least resistance that {} asks for is {ratio} times the largest allowed",
                lower.key()
            ),
        })
    }

    /// Limits of which one is missing so that the force has a maximum; empty where it has one.
    ///
    /// At a given current a longer or wider coil always pulls harder. Any limit on the amount of
    /// wire ends that, as does the supply's voltage; so does the settling time, unless the widest
    /// coil meets it at any length. Without those it takes both an outer diameter and a length.
    #[must_use]
    pub fn missing(&self, problem: &Problem<'_>) -> Vec<LimitName> {
        let ends = self.volume_m3[1].is_finite()
            || self.settling_max_s < self.longest_settling_s(problem)
            || problem.regime == Regime::Supply;
        if ends || (self.outer_m[1].is_finite() && self.length_m[1].is_finite()) {
            return Vec::new();
        }
        let mut missing = Vec::new();
        if !self.outer_m[1].is_finite() {
            missing.push(LimitName::OuterDiameter);
        }
        if !self.length_m[1].is_finite() {
            missing.push(LimitName::Length);
        }
        missing
    }

    /// Settling time, s, that the widest coil in air approaches as its length grows: per length
    /// L = mu_0 J^2 2 pi int r^2 (a2 - r) dr. Infinite without a limit on the outer diameter, where
    /// the length is limited, and with a core, whose flux is not counted here.
    fn longest_settling_s(&self, problem: &Problem<'_>) -> f64 {
        let (inner, outer) = (self.inner_m[0], self.outer_m[1]);
        let is_air = problem.model.air_dipoles().is_some();
        if !(is_air && outer.is_finite() && self.length_m[1].is_infinite()) {
            return f64::INFINITY;
        }
        let density = problem.strand.turns_per_m2();
        let area_m4 = outer.powi(4) - 4.0 * outer * inner.powi(3) + 3.0 * inner.powi(4);
        let inductance_h_per_m = MU_0_T_M_PER_A * density * density * PI / 6.0 * area_m4;
        let resistance_ohm_per_m =
            problem.strand.resistance_per_volume() * (outer * outer - inner * inner);
        SETTLING_TIME_CONSTANTS * inductance_h_per_m / resistance_ohm_per_m
    }

    /// A wide but finite box to start from, in scaled coordinates: ln of mean radius, depth and
    /// length.
    #[must_use]
    pub(crate) fn starting_box(&self, scale_m: f64) -> [[f64; 2]; 3] {
        const WIDE: f64 = 6.0;
        let volume = if self.volume_m3[1].is_finite() {
            self.volume_m3[1].cbrt()
        } else {
            self.volume_m3[0].cbrt()
        };
        let far = WIDE * scale_m.max(volume);
        let outer = self.outer_m[1].min(far.max(2.0 * self.outer_m[0]));
        let lo = self.inner_m[0] + 0.5 * self.depth_min_m;
        let deepest = (outer - self.inner_m[0]).max(self.depth_min_m);
        let longest = self.length_m[1].min(far.max(2.0 * self.length_m[0]));
        let ln = |lo: f64, hi: f64| [lo.ln(), hi.max(lo).ln()];
        [
            ln(lo.max(0.02 * outer.min(far)).min(outer), outer),
            ln(self.depth_min_m.max(1e-3 * deepest), deepest),
            ln(self.length_m[0].max(1e-3 * longest), longest),
        ]
    }
}

/// The least resistance, ohm, that a limit asks for where the supply's voltage sets the current.
fn least_resistance_ohm(problem: &Problem<'_>, bound: &Bounded) -> Option<f64> {
    let task = problem.task;
    let voltage_v = task
        .voltage_v
        .filter(|_| problem.regime == Regime::Supply)?;
    match bound.name {
        LimitName::Current => Some(voltage_v / bound.limit),
        LimitName::Power => Some(voltage_v / bound.limit * voltage_v),
        LimitName::ArrayPower => {
            let from_ohm = voltage_v / task.current_max_a;
            let drivers = &task.drivers;
            Some(drivers.least_resistance_ohm(voltage_v, bound.limit, from_ohm))
        }
        _ => None,
    }
}

/// Millimetres of a length in their shortest form, to 14 digits: sizes that differ by [`TOUCHING`] may contradict
/// each other.
pub(super) fn mm(length_m: f64) -> String {
    let length_mm = length_m * 1e3;
    let rounded = format!("{length_mm:.13e}").parse().unwrap_or(length_mm);
    format!("{} mm", number(rounded))
}

/// Of a difference of sizes like `size_m` the digits that are no rounding.
fn difference(difference_m: f64, size_m: f64) -> f64 {
    let step_m = 0.1 * TOUCHING * size_m;
    let digits = (difference_m.abs() / step_m).log10().max(0.0) as usize;
    format!("{difference_m:.digits$e}")
        .parse()
        .unwrap_or(difference_m)
}

/// Of two limits on one size the first that is set, with its value in metres.
fn either<const N: usize>(
    problem: &Problem<'_>,
    names: [LimitName; N],
) -> Option<(LimitName, f64)> {
    let limit = |name| problem.limit_of(name).map(|value| (name, value));
    names.into_iter().find_map(limit)
}

/// A size that is given and outside its own limit.
fn given_outside_its_limit(problem: &Problem<'_>) -> Option<Contradiction> {
    let (fixed, limits) = (&problem.task.fixed, &problem.task.limits);
    // Given, limit and by how much the given one exceeds it, m.
    let sizes = [
        (
            (LimitName::InnerDiameter, LimitName::FixedInner),
            (fixed.inner_diameter_m, limits.inner_diameter_min_m),
            -1.0,
        ),
        (
            (LimitName::OuterDiameter, LimitName::FixedOuter),
            (fixed.outer_diameter_m, limits.outer_diameter_max_m),
            1.0,
        ),
        (
            (LimitName::Pitch, LimitName::FixedOuter),
            (fixed.outer_diameter_m, problem.task.pitch_m),
            1.0,
        ),
        (
            (LimitName::Length, LimitName::FixedLength),
            (fixed.length_m, limits.length_max_m),
            1.0,
        ),
    ];
    sizes.into_iter().find_map(|((name, fixed), size, sign)| {
        let (Some(given), Some(bound)) = size else {
            return None;
        };
        let excess = sign * (given - bound);
        (excess > TOUCHING * bound).then(|| Contradiction {
            between: [name, fixed],
            by: excess,
            message: format!(
                "the given {} of {} is outside its limit of {}",
                name.key(),
                mm(given),
                mm(bound)
            ),
        })
    })
}

fn no_room_for_a_layer(problem: &Problem<'_>) -> Option<Contradiction> {
    let wire_m = problem.strand.diameter_m;
    let (outer_name, outer_m) = either(
        problem,
        [
            LimitName::FixedOuter,
            LimitName::OuterDiameter,
            LimitName::Pitch,
        ],
    )?;
    let (inner_name, inner_m) = either(problem, [LimitName::FixedInner, LimitName::InnerDiameter])
        .unwrap_or((LimitName::OneLayer, 0.0));
    let missing = inner_m + 2.0 * wire_m - outer_m;
    (missing > TOUCHING * outer_m).then(|| Contradiction {
        between: [outer_name, inner_name],
        by: missing,
        message: format!(
            "an outer diameter of {} leaves no room for one layer of {} wire around a bore of {}: \
             {} are missing",
            mm(outer_m),
            mm(wire_m),
            mm(inner_m),
            mm(difference(missing, outer_m))
        ),
    })
}

fn no_room_for_a_turn(problem: &Problem<'_>) -> Option<Contradiction> {
    let wire_m = problem.strand.diameter_m;
    let (name, length_m) = either(problem, [LimitName::FixedLength, LimitName::Length])?;
    (wire_m - length_m > TOUCHING * wire_m).then(|| Contradiction {
        between: [name, LimitName::OneTurn],
        by: wire_m - length_m,
        message: format!(
            "a length of {} leaves no room for one turn of {} wire",
            mm(length_m),
            mm(wire_m)
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::tests::{HEIGHT_M, air, task};
    use fluxform_design::Limits;

    /// "0.000000 mm are missing", and "a length of 0.700000 mm leaves no room for one turn of 0.700000 mm wire".
    #[test]
    fn regression_sizes_that_contradict_each_other_were_printed_alike() {
        let model = air(HEIGHT_M);
        let of = |limits: Limits| {
            let task = task(limits, None);
            let problems = Problem::of_wire(&model, &task, task.strands[0]);
            Domain::contradiction(&problems[0]).map(|found| found.message)
        };
        let layer = |inner_mm: f64| {
            of(Limits {
                outer_diameter_max_m: Some(0.038),
                inner_diameter_min_m: Some(inner_mm * 1e-3),
                ..Limits::default()
            })
        };
        let said = |inner: &str, missing: &str| {
            Some(format!(
                "an outer diameter of 38 mm leaves no room for one layer of 0.7 mm wire around a bore of \
                 {inner} mm: {missing} mm are missing"
            ))
        };
        assert_eq!(layer(36.6), None);
        assert_eq!(layer(36.600_000_1), said("36.6000001", "1e-7"));
        assert_eq!(layer(36.600_000_000_1), said("36.6000000001", "1e-10"));
        assert_eq!(layer(37.3), said("37.3", "0.7"));
        assert_eq!(layer(36.723_456_7), said("36.7234567", "0.1234567"));
        let turn = |length_mm: f64| {
            of(Limits {
                length_max_m: Some(length_mm * 1e-3),
                ..Limits::default()
            })
        };
        assert_eq!(turn(0.7), None);
        assert_eq!(
            turn(0.699_999_9).as_deref(),
            Some("a length of 0.6999999 mm leaves no room for one turn of 0.7 mm wire")
        );
    }

    /// The supply's regime asks for a least resistance, and a limit may ask for less.
    #[test]
    fn a_least_resistance_over_the_largest_is_a_contradiction() {
        let model = air(HEIGHT_M);
        let of = |limits: Limits, voltage_v: f64| {
            let task = task(limits, Some(voltage_v));
            let problems = Problem::of_wire(&model, &task, task.strands[0]);
            assert_eq!(Domain::contradiction(&problems[0]), None);
            Domain::contradiction(&problems[1])
        };
        let up_to = |resistance_ohm, power_max_w| Limits {
            resistance_max_ohm: Some(resistance_ohm),
            power_max_w,
            ..Limits::default()
        };
        // 36 V at no more than 2 A; 4 V at no more than 3 W and 2 A.
        for (limits, voltage_v, lower, by_ohm) in [
            (up_to(6.0, None), 36.0, LimitName::Current, 12.0),
            (up_to(5.0, Some(3.0)), 4.0, LimitName::Power, 1.0 / 3.0),
        ] {
            let found = of(limits, voltage_v).expect("a contradiction");
            assert_eq!(found.between, [LimitName::Resistance, lower]);
            assert!((found.by / by_ohm - 1.0).abs() < 1e-9, "{found:?}");
        }
        assert_eq!(of(up_to(18.0, None), 36.0), None);
        assert_eq!(of(up_to(5.4, Some(3.0)), 4.0), None);
    }
}
