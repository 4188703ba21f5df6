//! How warm a coil becomes: winding and core as one body of one temperature in still air.
//!
//! ```text
//! C dT/dt = I^2 R_a (1 + alpha_a (T - T_a)) - h A (T - T_a)
//! ```
//!
//! with the heat capacity `C` of copper and steel, the resistance `R_a` at the temperature of the air `T_a`,
//! copper's temperature coefficient `alpha_a` there, the surface coefficient `h` and the coil's outside `A`:
//! its mantle and both end faces. One body, because heat crosses a winding in seconds and leaves it in
//! many minutes. Where the first part grows faster than the second there is no steady temperature, unless the supply's
//! voltage `V` ends the current: where `I R > V` the heat is `V^2 / R`, of the resistance `R` of the warm winding.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Beyond the melting point of copper no temperature is stated, C.
const MELTED_C: f64 = 1085.0;
/// To the last bits of a rise.
const BISECTIONS: usize = 60;

/// How a coil loses heat, and how warm it may become.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cooling {
    /// Heat that leaves its surface, W/(m^2 K).
    pub surface_w_per_m2_k: f64,
    /// Temperature of the air, C.
    pub ambient_c: f64,
    /// Temperature that the wire's insulation withstands continuously, C.
    pub winding_max_c: f64,
    /// How long currents flow for which a temperature is stated, s.
    pub heating_s: f64,
}

/// A coil as a body that is heated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WarmCoil {
    /// Resistance at the temperature of the air, ohm.
    pub resistance_ohm: f64,
    /// Relative growth of the resistance there, 1/K.
    pub growth_per_k: f64,
    /// Heat capacity, J/K.
    pub capacity_j_per_k: f64,
    /// Heat that leaves it, W/K.
    pub loss_w_per_k: f64,
    /// The supply's voltage, V; `None` without a limit.
    pub voltage_v: Option<f64>,
}

/// Temperatures of a coil under a current that stays, as far as the supply's voltage drives it through the warm winding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Heating {
    /// The current at the temperature of the air, A.
    pub current_a: f64,
    /// Heat at the temperature of the air, W.
    pub power_w: f64,
    /// Temperature of the air, C.
    pub ambient_c: f64,
    /// Heat that leaves the surface, W/(m^2 K).
    pub surface_w_per_m2_k: f64,
    /// Temperature in the long run, C; null where it rises without end or copper melts.
    pub steady_c: Option<f64>,
    /// Time in which the difference from the steady temperature falls by the factor e near it, s; null without one.
    pub time_constant_s: Option<f64>,
    /// How long the current flows for the next temperature, s.
    pub heating_s: f64,
    /// Temperature after that time, C; null where copper melts.
    pub after_c: Option<f64>,
    /// Temperature that the insulation withstands continuously, C.
    pub winding_max_c: f64,
    /// Time until that is reached, s; null where it never is.
    pub winding_max_s: Option<f64>,
}

impl WarmCoil {
    /// Its temperatures under `current_a`, beginning at that of the air.
    #[must_use]
    pub fn heated(&self, current_a: f64, cooling: &Cooling) -> Heating {
        let held = self.held(current_a);
        // Where the resistance has grown so much that the current ends.
        let limited = self.voltage_v.map(|voltage_v| {
            let growth = voltage_v / (current_a.abs() * self.resistance_ohm);
            let from_k = ((growth - 1.0) / self.growth_per_k).max(0.0);
            (from_k, self.limited(voltage_v))
        });
        // Of a current that stays where it never comes so far.
        let limited =
            limited.and_then(|(from_k, limited)| Some((from_k, held.time_s(from_k)?, limited)));
        let (steady_k, time_constant_s) = match limited {
            Some((_, _, limited)) => (Some(limited.steady_k), Some(limited.time_constant_s())),
            None => (
                held.steady_k(),
                held.steady_k().map(|_| -1.0 / held.rate_per_s),
            ),
        };
        let rise_k = match limited {
            Some((from_k, from_s, limited)) if cooling.heating_s > from_s => {
                limited.rise_k(from_k, cooling.heating_s - from_s)
            }
            _ => held.rise_k(cooling.heating_s),
        };
        let most_k = cooling.winding_max_c - cooling.ambient_c;
        let winding_max_s = match limited {
            Some((from_k, from_s, limited)) if most_k > from_k => {
                limited.time_s(from_k, most_k).map(|time_s| from_s + time_s)
            }
            _ => held.time_s(most_k),
        };
        let stated = |rise: f64| {
            let warm = cooling.ambient_c + rise;
            (warm < MELTED_C).then_some(warm)
        };
        let steady_c = steady_k.and_then(stated);
        let first_a = (self.voltage_v)
            .map_or(f64::INFINITY, |voltage_v| voltage_v / self.resistance_ohm)
            .min(current_a.abs());
        Heating {
            current_a: first_a,
            power_w: first_a * first_a * self.resistance_ohm,
            ambient_c: cooling.ambient_c,
            surface_w_per_m2_k: cooling.surface_w_per_m2_k,
            steady_c,
            time_constant_s: time_constant_s.filter(|_| steady_c.is_some()),
            heating_s: cooling.heating_s,
            after_c: stated(rise_k),
            winding_max_c: cooling.winding_max_c,
            winding_max_s,
        }
    }

    /// The rise while the current stays.
    fn held(&self, current_a: f64) -> HeldCurrent {
        let power_w = current_a * current_a * self.resistance_ohm;
        HeldCurrent {
            start_k_per_s: power_w / self.capacity_j_per_k,
            rate_per_s: (power_w * self.growth_per_k - self.loss_w_per_k) / self.capacity_j_per_k,
        }
    }

    /// The rise while the voltage stays.
    fn limited(&self, voltage_v: f64) -> HeldVoltage {
        let (loss, growth) = (self.loss_w_per_k, self.growth_per_k);
        let power_w = voltage_v * voltage_v / self.resistance_ohm;
        // The positive root of loss u (1 + growth u) = power.
        let root = (1.0 + 4.0 * growth * power_w / loss).sqrt();
        HeldVoltage {
            steady_k: 2.0 * power_w / loss / (1.0 + root),
            growth_per_k: growth,
            loss_per_s: loss / self.capacity_j_per_k,
        }
    }
}

/// u' = start + rate u of the rise u.
#[derive(Debug, Clone, Copy)]
struct HeldCurrent {
    start_k_per_s: f64,
    rate_per_s: f64,
}

impl HeldCurrent {
    /// In the long run, K; `None` where it rises without end.
    fn steady_k(self) -> Option<f64> {
        (self.rate_per_s < 0.0).then(|| -self.start_k_per_s / self.rate_per_s)
    }

    /// The rise after a time, K.
    fn rise_k(self, time_s: f64) -> f64 {
        let (start, rate) = (self.start_k_per_s, self.rate_per_s);
        if rate == 0.0 {
            start * time_s
        } else {
            start * (rate * time_s).exp_m1() / rate
        }
    }

    /// The time until a rise of `rise_k`, s; `None` where it is never reached.
    fn time_s(self, rise_k: f64) -> Option<f64> {
        if rise_k <= 0.0 {
            return Some(0.0);
        }
        let (start, rate) = (self.start_k_per_s, self.rate_per_s);
        let grown = rate * rise_k / start;
        match start > 0.0 && grown > -1.0 {
            true if rate == 0.0 => Some(rise_k / start),
            true => Some(grown.ln_1p() / rate),
            false => None,
        }
    }
}

/// (1 + g u) u' = l (s - u) (1 + g (s + u)) of the rise u, which ends at s.
#[derive(Debug, Clone, Copy)]
struct HeldVoltage {
    steady_k: f64,
    growth_per_k: f64,
    loss_per_s: f64,
}

impl HeldVoltage {
    fn time_constant_s(self) -> f64 {
        let grown = self.growth_per_k * self.steady_k;
        (1.0 + grown) / (self.loss_per_s * (1.0 + 2.0 * grown))
    }

    /// The time from a rise to another, s, by partial fractions; `None` where the other is never reached.
    fn time_s(self, from_k: f64, to_k: f64) -> Option<f64> {
        if to_k >= self.steady_k {
            return None;
        }
        let grown = self.growth_per_k * self.steady_k;
        let ahead = ((self.steady_k - from_k) / (self.steady_k - to_k)).ln();
        let behind = |rise_k: f64| 1.0 + grown + self.growth_per_k * rise_k;
        let behind = (behind(to_k) / behind(from_k)).ln();
        let sum = (1.0 + grown) * ahead - grown * behind;
        Some(sum / (self.loss_per_s * (1.0 + 2.0 * grown)))
    }

    /// The rise after a time from a rise on, K: by bisection of the time, which grows with it.
    fn rise_k(self, from_k: f64, time_s: f64) -> f64 {
        let (mut low_k, mut high_k) = (from_k, self.steady_k);
        for _ in 0..BISECTIONS {
            let middle_k = 0.5 * (low_k + high_k);
            if self
                .time_s(from_k, middle_k)
                .is_some_and(|at_s| at_s < time_s)
            {
                low_k = middle_k;
            } else {
                high_k = middle_k;
            }
        }
        low_k
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COOLING: Cooling = Cooling {
        surface_w_per_m2_k: 11.0,
        ambient_c: 23.0,
        winding_max_c: 130.0,
        heating_s: 47.0,
    };

    fn coil() -> WarmCoil {
        WarmCoil {
            resistance_ohm: 5.3,
            growth_per_k: 3.9e-3,
            capacity_j_per_k: 310.0,
            loss_w_per_k: 0.17,
            voltage_v: None,
        }
    }

    /// A current that the supply drives through the cold winding alone: stated was what it would heat if it stayed.
    #[test]
    fn regression_a_voltage_s_end_of_the_current_was_not_counted() {
        let current_a = 2.4;
        let volts = |of: f64| Some(of * current_a * coil().resistance_ohm);
        let stays_c = coil().heated(current_a, &COOLING).steady_c.unwrap();
        for of in [0.9, 1.0, 1.15] {
            let coil = WarmCoil {
                voltage_v: volts(of),
                ..coil()
            };
            let slope = |u: f64| {
                let warm_ohm = coil.resistance_ohm * (1.0 + coil.growth_per_k * u);
                let flows_a = current_a.min(coil.voltage_v.unwrap() / warm_ohm);
                (flows_a.powi(2) * warm_ohm - coil.loss_w_per_k * u) / coil.capacity_j_per_k
            };
            let (mut u, mut reached_s, step_s) = (0.0, 0.0, 0.01);
            let cooling = Cooling {
                heating_s: 900.0,
                winding_max_c: 60.0,
                ..COOLING
            };
            for step in 0..90_000 {
                let ahead = u + step_s * slope(u);
                u += 0.5 * step_s * (slope(u) + slope(ahead));
                if u < 37.0 {
                    reached_s = step_s * f64::from(step + 1);
                }
            }
            let heating = coil.heated(current_a, &cooling);
            assert!(
                (heating.after_c.unwrap() - 23.0 - u).abs() < 1e-5 * u,
                "{of}"
            );
            assert!(
                (heating.winding_max_s.unwrap() - reached_s).abs() < 0.02,
                "{of}"
            );
            let steady_k = heating.steady_c.unwrap() - 23.0;
            assert!(
                steady_k + 23.0 < 0.6 * stays_c,
                "{of}: {steady_k} {stays_c}"
            );
            assert!(slope(steady_k).abs() < 1e-12, "{of}");
            let first_a = current_a * of.min(1.0);
            assert!((heating.current_a / first_a - 1.0).abs() < 1e-15);
            // Near the end the difference falls by e in the time constant.
            let [a, b] = [1e-4, 2e-4].map(|off| slope(steady_k * (1.0 - off)) / (steady_k * off));
            let constant_s = heating.time_constant_s.unwrap();
            assert!((constant_s * (2.0 * a - b) - 1.0).abs() < 1e-5, "{of}");
        }
        let ample = WarmCoil {
            voltage_v: Some(36.0),
            ..coil()
        };
        assert_eq!(ample.heated(0.4, &COOLING), coil().heated(0.4, &COOLING));
    }

    /// Against small steps of Heun's rule.
    #[test]
    fn temperatures_follow_the_balance_of_heat() {
        let (coil, current_a) = (coil(), 1.1);
        let heating = coil.heated(current_a, &COOLING);
        let slope = |u: f64| {
            (current_a.powi(2) * coil.resistance_ohm * (1.0 + coil.growth_per_k * u)
                - coil.loss_w_per_k * u)
                / coil.capacity_j_per_k
        };
        let (mut u, step_s) = (0.0, 0.01);
        for _ in 0..4700 {
            let ahead = u + step_s * slope(u);
            u += 0.5 * step_s * (slope(u) + slope(ahead));
        }
        assert!((heating.after_c.unwrap() - 23.0 - u).abs() < 1e-8 * u);
        let steady_k = heating.steady_c.unwrap() - 23.0;
        assert!(slope(steady_k).abs() < 1e-15);
        let late = COOLING.heating_s * 1e4;
        let long = Cooling {
            heating_s: late,
            ..COOLING
        };
        let after = coil.heated(current_a, &long).after_c.unwrap();
        assert!((after - 23.0 - steady_k).abs() < 1e-9 * steady_k);
    }

    /// More heat than the surface loses: no steady temperature, but a time until the insulation fails.
    #[test]
    fn a_current_beyond_what_the_surface_loses_has_no_steady_temperature() {
        let coil = coil();
        let limit_a = (coil.loss_w_per_k / coil.growth_per_k / coil.resistance_ohm).sqrt();
        let hot = coil.heated(1.01 * limit_a, &COOLING);
        assert_eq!((hot.steady_c, hot.time_constant_s), (None, None));
        let reached_s = hot.winding_max_s.unwrap();
        let then = Cooling {
            heating_s: reached_s,
            ..COOLING
        };
        let at = coil.heated(1.01 * limit_a, &then).after_c.unwrap();
        assert!((at - COOLING.winding_max_c).abs() < 1e-9, "{at}");
        let day = Cooling {
            heating_s: 1e9,
            ..COOLING
        };
        assert_eq!(coil.heated(1.01 * limit_a, &day).after_c, None);
        assert_eq!(coil.heated(0.0, &COOLING).winding_max_s, None);
        assert_eq!(coil.heated(0.0, &COOLING).steady_c, Some(23.0));
        let cool = coil.heated(0.4, &COOLING);
        assert!(cool.steady_c.unwrap() < COOLING.winding_max_c && cool.winding_max_s.is_none());
    }
}
