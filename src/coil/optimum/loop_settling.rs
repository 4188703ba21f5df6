//! The time that a current loop takes for a step, with its derivatives.
//!
//! `Circuit::settling_under_s`: the supply's voltage drives the current until the loop asks for less, and the loop's
//! bandwidth ends it. At that current both are equally fast, so that where it lies does not count to first order.

use super::model::Sloped;
use crate::circuit::SETTLING_TIME_CONSTANTS;

/// Part of the voltage beyond which the logarithm goes on as a straight line: no coil within the limits has so much,
/// and a search that passes through others is led back.
const STEEP: f64 = 0.995;

/// Who brings a current about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Loop {
    /// Bandwidth of the current loop, Hz.
    pub bandwidth_hz: f64,
    /// The supply's voltage, V.
    pub voltage_v: Option<f64>,
}

impl Loop {
    /// Time, s, until a step to `current` (A) of a coil of `resistance` (ohm) and `inductance` (H) has settled.
    pub(super) fn settling_s(
        self,
        resistance: Sloped,
        inductance: Sloped,
        current: Sloped,
    ) -> Sloped {
        let left = (-SETTLING_TIME_CONSTANTS).exp();
        let pace = std::f64::consts::TAU * self.bandwidth_hz;
        let (r, l, i) = (resistance.value, inductance.value, current.value);
        let Some(voltage_v) = self.voltage_v else {
            return Sloped {
                value: -left.ln() / pace,
                slope: [0.0; 4],
            };
        };
        let goal_a = (1.0 - left) * i;
        let taken_a = if l * pace > r {
            ((l * pace * i - voltage_v) / (l * pace - r)).max(0.0)
        } else {
            0.0
        };
        let until_a = taken_a.min(goal_a);
        // -ln(1 - x) and its derivative by x.
        let share = until_a * r / voltage_v;
        let at = share.min(STEEP);
        let steep = 1.0 / (1.0 - at);
        let rise = steep.ln() + (share - at) * steep;
        let mut value = l / r * rise;
        let by_l = rise / r;
        let by_r = (l / r) * (steep * share - rise) / r;
        let mut by_i = 0.0;
        if taken_a < goal_a {
            value += ((i - taken_a) / (left * i)).ln() / pace;
            by_i = (1.0 / (i - taken_a) - 1.0 / i) / pace;
        } else {
            by_i += l / r * steep * (1.0 - left) * r / voltage_v;
        }
        let slope = |k: usize| {
            by_l * inductance.slope[k] + by_r * resistance.slope[k] + by_i * current.slope[k]
        };
        Sloped {
            value,
            slope: std::array::from_fn(slope),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::circuit::Circuit;
    use fluxform_design::{Driver, Supply};

    #[test]
    fn it_is_the_circuit_s_and_its_slopes_are_those_of_small_steps() {
        let exact = |r: f64, l: f64, i: f64, voltage_v| {
            let supply = Supply {
                current_max_a: vec![i],
                current_min_a: vec![0.0],
                total_current_max_a: None,
                voltage_v,
                driver: Driver::Current,
                bandwidth_hz: 700.0,
            };
            let circuit = Circuit {
                resistance_ohm: r,
                inductance_h: l,
                ..Circuit::default()
            };
            circuit.settling_under_s(&supply, i)
        };
        let alone = |value: f64, k: usize| {
            let mut slope = [0.0; 4];
            slope[k] = 1.0;
            Sloped { value, slope }
        };
        // Slow and fast loops, much and little voltage, none.
        for voltage_v in [Some(13.0), Some(36.0), Some(300.0), None] {
            for (r, l, i) in [(6.0, 0.07, 2.0), (5.0, 0.7, 1.3), (3.0, 1e-4, 2.0)] {
                let of = Loop {
                    bandwidth_hz: 700.0,
                    voltage_v,
                };
                let time = of.settling_s(alone(r, 0), alone(l, 1), alone(i, 2));
                let now = exact(r, l, i, voltage_v);
                assert!((time.value / now - 1.0).abs() < 1e-13);
                let small = 1e-5;
                let by = |k: usize| {
                    let moved = |sign: f64| {
                        let factor = |of: usize| if of == k { 1.0 + sign * small } else { 1.0 };
                        exact(r * factor(0), l * factor(1), i * factor(2), voltage_v)
                    };
                    (moved(1.0) - moved(-1.0)) / (2.0 * small) / [r, l, i][k]
                };
                for k in 0..3 {
                    let error = (time.slope[k] - by(k)) * [r, l, i][k] / now;
                    assert!(error.abs() < 1e-7, "{voltage_v:?} {r} {l} {i} {k}: {error}");
                }
            }
        }
    }
}
