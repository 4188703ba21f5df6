//! Turns, wire, resistance, time constant, heat and mass of a coil.

use std::f64::consts::PI;

use serde::Serialize;

use super::inductance::self_inductance_h;
use fluxform_base::units::{
    COPPER_DENSITY_KG_PER_M3, COPPER_TEMPERATURE_COEFFICIENT_PER_K, REFERENCE_TEMPERATURE_C,
};
use fluxform_design::{Coil, Driver, Supply, Wire};
use fluxform_field::winding::Winding;

/// Time constants after which a current counts as settled.
pub(crate) const SETTLING_TIME_CONSTANTS: f64 = 5.0;

/// Turns that fit, layers stacked squarely: (OD - ID)/2/d x L/d, not rounded.
#[must_use]
pub fn turns_that_fit(coil: &Coil, wire: &Wire) -> f64 {
    let depth_m = 0.5 * (coil.outer_diameter_m - coil.inner_diameter_m);
    (depth_m / wire.diameter_m) * (coil.length_m / wire.diameter_m)
}

/// The winding as a field source; turns default to what fits.
#[must_use]
pub fn winding(coil: &Coil, wire: &Wire) -> Winding {
    Winding {
        inner_radius_m: 0.5 * coil.inner_diameter_m,
        outer_radius_m: 0.5 * coil.outer_diameter_m,
        length_m: coil.length_m,
        turns: coil.turns.unwrap_or_else(|| turns_that_fit(coil, wire)),
    }
}

/// A coil's dimensions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CoilSize {
    /// Inner diameter, m.
    pub inner_diameter_m: f64,
    /// Outer diameter, m.
    pub outer_diameter_m: f64,
    /// Length, m.
    pub length_m: f64,
}

impl From<&Coil> for CoilSize {
    fn from(coil: &Coil) -> Self {
        Self {
            inner_diameter_m: coil.inner_diameter_m,
            outer_diameter_m: coil.outer_diameter_m,
            length_m: coil.length_m,
        }
    }
}

/// A coil as its driver sees it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Circuit {
    /// Number of turns N.
    pub turns: f64,
    /// Resistance at the wire's temperature, ohm.
    pub resistance_ohm: f64,
    /// Self inductance, H.
    pub inductance_h: f64,
    /// Length of wire, m: N times the mean turn.
    pub wire_length_m: f64,
    /// Mass of the wire's metal, kg.
    pub wire_mass_kg: f64,
}

impl Circuit {
    /// The circuit of an air coil.
    ///
    /// R = rho(T) N pi (a1 + a2) / (pi d^2 / 4), rho(T) = rho (1 + alpha (T - 20 C)).
    #[must_use]
    pub fn of_air_coil(coil: &Coil, wire: &Wire) -> Self {
        Self::of_inductance(coil, wire, self_inductance_h(&winding(coil, wire)))
    }

    /// The circuit of a coil whose inductance is known, as [`Circuit::of_air_coil`].
    #[must_use]
    pub fn of_inductance(coil: &Coil, wire: &Wire, inductance_h: f64) -> Self {
        let winding = winding(coil, wire);
        let wire_length_m = winding.turns * PI * (winding.inner_radius_m + winding.outer_radius_m);
        let section_m2 = 0.25 * PI * wire.conductor_diameter_m * wire.conductor_diameter_m;
        let warmth = 1.0
            + COPPER_TEMPERATURE_COEFFICIENT_PER_K * (wire.temperature_c - REFERENCE_TEMPERATURE_C);
        Self {
            turns: winding.turns,
            resistance_ohm: wire.resistivity_ohm_m * warmth * wire_length_m / section_m2,
            inductance_h,
            wire_length_m,
            wire_mass_kg: wire_length_m * section_m2 * COPPER_DENSITY_KG_PER_M3,
        }
    }

    /// tau = L / R, s.
    #[must_use]
    pub fn time_constant_s(&self) -> f64 {
        self.inductance_h / self.resistance_ohm
    }

    /// Five time constants, s.
    #[must_use]
    pub fn settling_s(&self) -> f64 {
        SETTLING_TIME_CONSTANTS * self.time_constant_s()
    }

    /// Time until less than exp(-5) of a step to `current_a` is left, s: five time constants where the
    /// drivers set voltages; where they close a current loop, `L dI/dt` takes what voltage R I leaves, and
    /// the loop's bandwidth ends it.
    ///
    /// The loop asks for `R I + L w (goal - I)`; while that exceeds the supply's voltage the current
    /// rises as fast as that allows.
    #[must_use]
    pub fn settling_under_s(&self, supply: &Supply, current_a: f64) -> f64 {
        self.step_s(supply, current_a, (-SETTLING_TIME_CONSTANTS).exp())
            .unwrap_or_else(|| self.settling_s())
    }

    /// Time until the part `left` of a step to `current_a`, of either sign, is left under a current loop,
    /// s; `None` where drivers set voltages.
    #[must_use]
    pub fn step_s(&self, supply: &Supply, current_a: f64, left: f64) -> Option<f64> {
        match supply.driver {
            Driver::Voltage => return None,
            Driver::Current => {}
        }
        let current_a = current_a.abs();
        let pace = std::f64::consts::TAU * supply.bandwidth_hz;
        let (inductive, most_a) = (
            self.inductance_h * pace,
            supply.voltage_v.map(|v| v / self.resistance_ohm),
        );
        let (Some(voltage_v), Some(most_a)) = (supply.voltage_v, most_a) else {
            return Some(-left.ln() / pace);
        };
        let goal_a = (1.0 - left) * current_a;
        // Where the loop asks for less than the supply has.
        let taken_a = (inductive * current_a - voltage_v) / (inductive - self.resistance_ohm);
        let taken_a = if inductive > self.resistance_ohm {
            taken_a.max(0.0)
        } else {
            0.0
        };
        let rise_s = |until_a: f64| -self.time_constant_s() * (-until_a / most_a).ln_1p();
        if current_a == 0.0 {
            return Some(0.0);
        }
        Some(if taken_a >= goal_a {
            rise_s(goal_a)
        } else {
            rise_s(taken_a) + ((current_a - taken_a) / (left * current_a)).ln() / pace
        })
    }

    /// Heat at a steady current, W.
    #[must_use]
    pub fn power_w(&self, current_a: f64) -> f64 {
        self.resistance_ohm * current_a * current_a
    }

    /// A current limit of either sign, as far as the supply's voltage over the resistance allows, A.
    #[must_use]
    pub fn reached_a(&self, limit_a: f64, voltage_v: Option<f64>) -> f64 {
        voltage_v.map_or(limit_a, |voltage_v| {
            let most_a = voltage_v / self.resistance_ohm;
            limit_a.min(most_a).max(-most_a)
        })
    }

    /// The rated current of each coil, A: of its two limits, as far as the voltage allows, the one
    /// farther from zero; of two alike the upper one.
    #[must_use]
    pub fn rated_currents_a(&self, supply: &Supply) -> Vec<f64> {
        let limits_a = supply.current_max_a.iter().zip(&supply.current_min_a);
        limits_a
            .map(|(upper, lower)| {
                let both = [upper, lower].map(|limit| self.reached_a(*limit, supply.voltage_v));
                farthest_from_zero(both)
            })
            .collect()
    }

    /// The largest of the coils' rated currents in either direction, with its sign, A.
    #[must_use]
    pub fn rated_current_a(&self, supply: &Supply) -> f64 {
        farthest_from_zero(self.rated_currents_a(supply))
    }
}

/// The current farthest from zero, a positive one of two alike; 0 of none.
#[must_use]
pub fn farthest_from_zero(currents_a: impl IntoIterator<Item = f64>) -> f64 {
    let farther = |most: f64, next: f64| {
        let alike = next.abs() == most.abs();
        if next.abs() > most.abs() || (alike && next > most) {
            next
        } else {
            most
        }
    };
    currents_a.into_iter().fold(0.0, farther)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seed() -> (Coil, Wire) {
        (
            Coil {
                inner_diameter_m: 0.024,
                outer_diameter_m: 0.038,
                length_m: 0.1,
                turns: Some(1429.0),
            },
            Wire {
                diameter_m: 0.0007,
                conductor_diameter_m: 0.0007,
                resistivity_ohm_m: 1.68e-8,
                temperature_c: 20.0,
                choices_m: vec![],
            },
        )
    }

    #[test]
    fn the_seed_coil() {
        let (coil, wire) = seed();
        assert!((turns_that_fit(&coil, &wire) - 1_428.571_428_571).abs() < 1e-9);
        let circuit = Circuit::of_air_coil(&coil, &wire);
        assert!(
            (circuit.resistance_ohm - 6.0753).abs() < 5e-5,
            "{}",
            circuit.resistance_ohm
        );
        // 28 digits from the reference: 0.0145019260634521282419059281
        let error = circuit.inductance_h / 0.014_501_926_063_452_128 - 1.0;
        assert!(error.abs() < 1e-12, "{error:e}");
    }

    #[test]
    fn a_warm_coil_resists_more_and_the_voltage_can_bind() {
        let (coil, mut wire) = seed();
        let cold = Circuit::of_air_coil(&coil, &wire);
        wire.temperature_c = 83.0;
        let warm = Circuit::of_air_coil(&coil, &wire);
        let expected = 1.0 + 3.93e-3 * 63.0;
        assert!((warm.resistance_ohm / cold.resistance_ohm - expected).abs() < 1e-14);
        assert_eq!(cold.reached_a(2.0, Some(36.0)), 2.0);
        assert_eq!(cold.reached_a(2.0, Some(6.0)), 6.0 / cold.resistance_ohm);
    }

    /// Closed forms: all slew, all loop, and the voltage's own exponential where it has no headroom.
    #[test]
    fn a_current_loop_is_as_fast_as_voltage_or_bandwidth_let_it() {
        let (coil, wire) = seed();
        let circuit = Circuit {
            inductance_h: 0.18,
            ..Circuit::of_air_coil(&coil, &wire)
        };
        let supply = |voltage_v, bandwidth_hz| Supply {
            current_max_a: vec![2.0],
            current_min_a: vec![0.0],
            total_current_max_a: None,
            voltage_v,
            driver: Driver::Current,
            bandwidth_hz,
        };
        let left = 0.03;
        let time = |voltage_v, hz| circuit.step_s(&supply(voltage_v, hz), 2.0, left).unwrap();
        let tau = circuit.time_constant_s();
        // So fast a loop that the supply alone counts.
        let slew = -tau * (1.0 - circuit.resistance_ohm * 2.0 * (1.0 - left) / 36.0_f64).ln();
        assert!((time(Some(36.0), 1e7) / slew - 1.0).abs() < 1e-4);
        assert!((time(None, 700.0) * std::f64::consts::TAU * 700.0 + left.ln()).abs() < 1e-12);
        assert_eq!(time(Some(1e9), 700.0), time(None, 700.0));
        // A supply that just holds the current up: five time constants again.
        let bare = Some(circuit.resistance_ohm * 2.0);
        let five = circuit.settling_under_s(&supply(bare, 1e6), 2.0);
        assert!((five / circuit.settling_s() - 1.0).abs() < 1e-9, "{five}");
        // By steps of the loop's own law.
        let (mut current, mut t, h) = (0.0_f64, 0.0, 1e-7);
        let pace = std::f64::consts::TAU * 150.0;
        while current < 2.0 * (1.0 - left) {
            let asked =
                circuit.resistance_ohm * current + circuit.inductance_h * pace * (2.0 - current);
            current +=
                h * (asked.min(36.0) - circuit.resistance_ohm * current) / circuit.inductance_h;
            t += h;
        }
        assert!((time(Some(36.0), 150.0) / t - 1.0).abs() < 1e-4, "{t}");
    }

    #[test]
    fn a_thinner_conductor_changes_the_resistance_only() {
        let (coil, mut wire) = seed();
        let full = Circuit::of_air_coil(&coil, &wire);
        wire.conductor_diameter_m = 0.00065;
        let thin = Circuit::of_air_coil(&coil, &wire);
        assert!(
            (thin.resistance_ohm / full.resistance_ohm - (0.7_f64 / 0.65).powi(2)).abs() < 1e-14
        );
        assert_eq!(thin.inductance_h, full.inductance_h);
        assert_eq!(thin.wire_length_m, full.wire_length_m);
    }
}
