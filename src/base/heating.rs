//! How warm a coil becomes: winding and core as one body of one temperature in still air.
//!
//! ```text
//! C dT/dt = I^2 R_a (1 + alpha_a (T - T_a)) - h A (T - T_a)
//! ```
//!
//! with the heat capacity `C` of copper and steel, the resistance `R_a` at the temperature of the air `T_a`,
//! copper's temperature coefficient `alpha_a` there, the surface coefficient `h` and the coil's outside `A`:
//! its mantle and both end faces. One body, because heat crosses a winding in seconds and leaves it in
//! many minutes. Where the first part grows faster than the second there is no steady temperature.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Beyond the melting point of copper no temperature is stated, C.
const MELTED_C: f64 = 1085.0;

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
}

/// Temperatures of a coil under a current that stays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Heating {
    /// The current, A.
    pub current_a: f64,
    /// Heat at the temperature of the air, W.
    pub power_w: f64,
    /// Temperature of the air, C.
    pub ambient_c: f64,
    /// Heat that leaves the surface, W/(m^2 K).
    pub surface_w_per_m2_k: f64,
    /// Temperature in the long run, C; null where it rises without end or copper melts.
    pub steady_c: Option<f64>,
    /// Time in which the difference from the steady temperature falls by the factor e, s; null without one.
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
        let power_w = current_a * current_a * self.resistance_ohm;
        // u' = start + rate u of the rise u.
        let start = power_w / self.capacity_j_per_k;
        let rate = (power_w * self.growth_per_k - self.loss_w_per_k) / self.capacity_j_per_k;
        let stated = |rise: f64| {
            let warm = cooling.ambient_c + rise;
            (warm < MELTED_C).then_some(warm)
        };
        let most_k = cooling.winding_max_c - cooling.ambient_c;
        Heating {
            current_a,
            power_w,
            ambient_c: cooling.ambient_c,
            surface_w_per_m2_k: cooling.surface_w_per_m2_k,
            steady_c: if rate < 0.0 {
                stated(-start / rate)
            } else {
                None
            },
            time_constant_s: (rate < 0.0).then(|| -1.0 / rate),
            heating_s: cooling.heating_s,
            after_c: stated(rise_k(start, rate, cooling.heating_s)),
            winding_max_c: cooling.winding_max_c,
            winding_max_s: time_s(start, rate, most_k),
        }
    }
}

/// The rise after a time, K.
fn rise_k(start: f64, rate: f64, time_s: f64) -> f64 {
    if rate == 0.0 {
        start * time_s
    } else {
        start * (rate * time_s).exp_m1() / rate
    }
}

/// The time until a rise of `rise_k`, s; `None` where it is never reached.
fn time_s(start: f64, rate: f64, rise_k: f64) -> Option<f64> {
    if rise_k <= 0.0 {
        return Some(0.0);
    }
    let grown = rate * rise_k / start;
    match start > 0.0 && grown > -1.0 {
        true if rate == 0.0 => Some(rise_k / start),
        true => Some(grown.ln_1p() / rate),
        false => None,
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
        }
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
