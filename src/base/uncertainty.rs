//! Uncertainties of a display in use: bounds, each quantity evenly distributed within its own,
//! as the Guide to the Expression of Uncertainty in Measurement (JCGM 100:2008, 4.3.7) takes a bound of
//! which no more is known.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

use super::units::MAGNET_COEFFICIENT_PER_K;

/// Bounds of what is uncertain; 0 where it is exact.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Uncertainty {
    /// How far the magnet may be from where it is measured or meant to be, along each axis, m.
    pub sensor_m: f64,
    /// How far the finger may tilt the magnet, in any direction, degrees.
    pub tilt_deg: f64,
    /// How much warmer the magnet may become, C.
    pub heat_c: f64,
    /// Share by which each driver's current may be off.
    pub driver: f64,
}

/// A quantity that is uncertain.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    JsonSchema,
    IntoStaticStr,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The position.
    #[strum(serialize = "position sensor")]
    Sensor,
    /// The finger's angle.
    #[strum(serialize = "tilt of the finger")]
    Tilt,
    /// The magnet's temperature.
    #[strum(serialize = "heat of the magnet")]
    Heat,
    /// The currents.
    #[strum(serialize = "drivers")]
    Driver,
}

impl Cause {
    /// All of them.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        self.into()
    }
}

/// Bounds on the command line, which take the place of a design's own as far as they are given.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct UncertaintyOverride {
    /// `--sensor-error`, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_m: Option<f64>,
    /// `--tilt`, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tilt_deg: Option<f64>,
    /// `--heat`, C.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heat_c: Option<f64>,
    /// `--driver-error`, relative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub driver: Option<f64>,
    /// `--power-cap`, W.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power_cap_w: Option<f64>,
}

impl UncertaintyOverride {
    /// The bounds that result for a design.
    #[must_use]
    pub fn over(self, own: Uncertainty) -> Uncertainty {
        Uncertainty {
            sensor_m: self.sensor_m.unwrap_or(own.sensor_m),
            tilt_deg: self.tilt_deg.unwrap_or(own.tilt_deg),
            heat_c: self.heat_c.unwrap_or(own.heat_c),
            driver: self.driver.unwrap_or(own.driver),
        }
    }

    /// Whether every number given is within the bounds that make sense.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let (least, most) = (Uncertainty::default(), Uncertainty::MOST);
        let given = self.over(least);
        let within = |cause: &Cause| (0.0..=most.of(*cause)).contains(&given.of(*cause));
        let cap = self.power_cap_w.unwrap_or(1.0);
        Cause::ALL.iter().all(within) && cap > 0.0 && cap.is_finite()
    }

    /// Whether none is given.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// Means over what scales or turns a force, by which its mean square follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// Mean of the magnet's strength over that at its stated temperature.
    pub gain: f64,
    /// Mean of its square.
    pub gain_square: f64,
    /// Mean share of the moment along its own axis.
    pub along: f64,
    /// Mean of its square.
    pub along_square: f64,
    /// Mean square of the share along either axis across; its mean is 0.
    pub across_square: f64,
    /// What the pull of unpowered steel has in these means.
    pub pull: PullMoments,
    /// Mean square of a driver's relative error.
    pub driver_square: f64,
}

/// Means of the steel's pull over that on the magnet as stated, its cube and fourth power of the strength among them:
/// the pull goes with the square of the moment ([`relative_pull`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PullMoments {
    /// Mean.
    pub mean: f64,
    /// Mean of its square.
    pub square: f64,
    /// Mean of it times the magnet's strength and the share along its own axis.
    pub times_moment: f64,
}

impl PullMoments {
    /// For a strength evenly between `weakest` and 1, and these means of the tilt's cosine and its powers up to the
    /// fourth.
    #[must_use]
    pub fn new(weakest: f64, [one, two, three, four]: [f64; 4]) -> Self {
        let power = |n: i32| (0..=n).map(|k| weakest.powi(k)).sum::<f64>() / f64::from(n + 1);
        Self {
            mean: power(2) * 0.5 * (1.0 + two),
            square: power(4) * 0.25 * (1.0 + 2.0 * two + four),
            times_moment: power(3) * 0.5 * (one + three),
        }
    }
}

/// The steel's pull on a moment along the magnet's own axis and both across, over that on a moment 1 along it: that of
/// the image of an upright magnet's moment in a half space of steel.
#[must_use]
pub fn relative_pull([along, across, other]: [f64; 3]) -> f64 {
    along * along + 0.5 * (across * across + other * other)
}

/// 1 less the mean cosine of an angle even over a disc of this radius: int_0^x (2 t / x^2) (1 - cos t) dt.
fn less_than_cosine(x: f64) -> f64 {
    let square = x * x;
    if x < 0.03 {
        return square * (0.25 - square * (1.0 / 72.0 - square / 2880.0));
    }
    1.0 - 2.0 * (x * x.sin() - 2.0 * (0.5 * x).sin().powi(2)) / square
}

impl Uncertainty {
    /// The largest bounds that make sense: half a metre, a finger on its side, a magnet that is no magnet
    /// any more, a driver that does nothing.
    pub const MOST: Self = Self {
        sensor_m: 0.5,
        tilt_deg: 90.0,
        heat_c: 300.0,
        driver: 1.0,
    };

    /// Whether everything is exact.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    fn part(&mut self, cause: Cause) -> &mut f64 {
        match cause {
            Cause::Sensor => &mut self.sensor_m,
            Cause::Tilt => &mut self.tilt_deg,
            Cause::Heat => &mut self.heat_c,
            Cause::Driver => &mut self.driver,
        }
    }

    /// The bound of one cause.
    #[must_use]
    pub fn of(mut self, cause: Cause) -> f64 {
        *self.part(cause)
    }

    /// One cause alone.
    #[must_use]
    pub fn only(self, cause: Cause) -> Self {
        let mut one = Self::default();
        *one.part(cause) = self.of(cause);
        one
    }

    /// All of them, one being half as large.
    #[must_use]
    pub fn halved(mut self, cause: Cause) -> Self {
        *self.part(cause) *= 0.5;
        self
    }

    /// The magnet's strength at a share (0 to 1) of the largest warming, over the stated one.
    #[must_use]
    pub fn strength(&self, share: f64) -> f64 {
        1.0 + MAGNET_COEFFICIENT_PER_K * self.heat_c * share
    }

    /// The means. The tilt is even over a disc of directions around the moment's own.
    #[must_use]
    pub fn moments(&self) -> Moments {
        let weakest = self.strength(1.0);
        let tilt = self.tilt_deg.to_radians();
        let [one, two, three, four] = [1.0, 2.0, 3.0, 4.0].map(|k| less_than_cosine(k * tilt));
        let (along, along_square) = (1.0 - one, 1.0 - 0.5 * two);
        // cos^3 = (3 cos t + cos 3 t) / 4, cos^4 = (3 + 4 cos 2 t + cos 4 t) / 8.
        let (cube, fourth) = (
            1.0 - 0.25 * (3.0 * one + three),
            1.0 - 0.125 * (4.0 * two + four),
        );
        Moments {
            gain: 0.5 * (1.0 + weakest),
            gain_square: (1.0 + weakest + weakest * weakest) / 3.0,
            along,
            along_square,
            across_square: 0.25 * two,
            pull: PullMoments::new(weakest, [along, along_square, cube, fourth]),
            driver_square: self.driver * self.driver / 3.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_sums_over_the_bounds() {
        let given = Uncertainty {
            sensor_m: 0.003,
            tilt_deg: 23.0,
            heat_c: 70.0,
            driver: 0.07,
        };
        let steps = 20_000;
        let at = |k: i32| (f64::from(k) + 0.5) / f64::from(steps);
        let mean =
            |of: &dyn Fn(f64) -> f64| (0..steps).map(|k| of(at(k))).sum::<f64>() / f64::from(steps);
        // Even over a disc: the square of the radius is even.
        let tilt = |u: f64| (given.tilt_deg.to_radians() * u.sqrt()).cos();
        let moments = given.moments();
        // Strength and tilt are independent; the pull goes with the square of the strength.
        let strength = |power: i32| mean(&|u| given.strength(u).powi(power));
        let pull = |u: f64| {
            let (cos, sin) = (tilt(u), (1.0 - tilt(u).powi(2)).sqrt());
            relative_pull([cos, 0.6 * sin, 0.8 * sin])
        };
        for (found, expected) in [
            (moments.gain, mean(&|u| given.strength(u))),
            (moments.gain_square, mean(&|u| given.strength(u).powi(2))),
            (moments.along, mean(&tilt)),
            (moments.along_square, mean(&|u| tilt(u).powi(2))),
            (
                moments.across_square,
                mean(&|u| 0.5 * (1.0 - tilt(u).powi(2))),
            ),
            (
                moments.driver_square,
                mean(&|u| (given.driver * (2.0 * u - 1.0)).powi(2)),
            ),
            (moments.pull.mean, strength(2) * mean(&pull)),
            (
                moments.pull.square,
                strength(4) * mean(&|u| pull(u).powi(2)),
            ),
            (
                moments.pull.times_moment,
                strength(3) * mean(&|u| tilt(u) * pull(u)),
            ),
        ] {
            assert!((found - expected).abs() < 1e-8, "{found} {expected}");
        }
        let exact_but_for_tilt = Uncertainty::default();
        let exact = exact_but_for_tilt.moments();
        assert_eq!(
            [exact.gain, exact.along_square, exact.across_square],
            [1.0, 1.0, 0.0]
        );
        for tilt_deg in [1e-300, 1e-160, 1e-6, 0.0859, 0.086] {
            let small = Uncertainty {
                tilt_deg,
                ..exact_but_for_tilt
            };
            let (moments, square) = (small.moments(), tilt_deg.to_radians().powi(2));
            for (found, deficit) in [
                (moments.along, 0.25),
                (moments.along_square, 0.5),
                (moments.pull.mean, 0.25),
                (moments.pull.times_moment, 0.5),
            ] {
                assert!(
                    (found - 1.0 + deficit * square).abs() < 1e-12,
                    "{tilt_deg} {found}"
                );
            }
            assert!((moments.across_square - 0.25 * square).abs() <= 1e-6 * square);
        }
    }
}
