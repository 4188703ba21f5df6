//! Currents of the least expected error at a measured position, from what a bundle holds.

use fluxform_base::uncertainty::{PullMoments, Uncertainty};

use super::{ErrorForm, ON_AXES, ON_DIAGONALS, Target, displaced};
use crate::problem::ForceProblem;

/// The uncertainties as a runtime needs them. A bundle holds no force on a tilted magnet, so the tilt
/// takes part by the price that was chosen with it, and not here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobustRuntime {
    /// The price of power, N^2/W; above 0.
    pub price_n2_per_w: f64,
    /// How far the magnet may be from where it is measured, along each axis, m.
    pub sensor_m: f64,
    /// Mean square of the magnet's strength over the stated one.
    pub square: f64,
    /// Mean of that strength.
    pub mean: f64,
    /// Mean square of a driver's relative error.
    pub driver_square: f64,
}

impl RobustRuntime {
    /// For what is `given` to be uncertain.
    #[must_use]
    pub fn new(given: &Uncertainty, price_n2_per_w: f64) -> Self {
        let moments = given.moments();
        Self {
            price_n2_per_w,
            sensor_m: given.sensor_m,
            square: moments.gain_square,
            mean: moments.gain,
            driver_square: moments.driver_square,
        }
    }

    /// The places around a measured position at which forces are needed, m, and their weights, which add up
    /// to 1. Places beyond `ends_m` are moved to them: no force is known there.
    pub fn places_m(
        &self,
        position_m: [f64; 3],
        ends_m: [[f64; 2]; 3],
    ) -> impl Iterator<Item = ([f64; 3], f64)> + use<> {
        let sensor_m = self.sensor_m;
        let exact = (sensor_m == 0.0).then_some((position_m, 1.0));
        let around = displaced(ON_AXES.0, ON_DIAGONALS.0).enumerate();
        let around = around.map(move |(k, unit)| {
            let place = std::array::from_fn(|axis| {
                let [from, to] = ends_m[axis];
                (position_m[axis] + sensor_m * unit[axis]).clamp(from, to)
            });
            (place, if k < 6 { ON_AXES.1 } else { ON_DIAGONALS.1 })
        });
        exact
            .into_iter()
            .chain(around.filter(move |_| sensor_m != 0.0))
    }
}

/// The expected error at one position as a function of the currents.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustForm {
    setting: RobustRuntime,
    form: ErrorForm,
}

impl RobustForm {
    /// Without any place, for an array of `coils`.
    #[must_use]
    pub fn new(setting: RobustRuntime, coils: usize) -> Self {
        let form = ErrorForm::new(coils);
        Self { setting, form }
    }

    /// Its setting.
    #[must_use]
    pub fn setting(&self) -> &RobustRuntime {
        &self.setting
    }

    /// Forgets all places.
    pub fn clear(&mut self) {
        self.form.clear();
    }

    /// Adds one component of the force at a place of this weight: what is requested and what the steel's pull on the
    /// magnet as stated gives, N, and the force per ampere of every coil, N/A.
    pub fn add(&mut self, row: &[f64], (request_n, pull_n): (f64, f64), weight: f64) {
        let RobustRuntime {
            square,
            mean,
            driver_square,
            ..
        } = self.setting;
        self.form.add_square(row, weight * square, driver_square);
        // The strength is even between its least and 1.
        let pull = PullMoments::new(2.0 * mean - 1.0, [1.0; 4]);
        let target = Target::new(request_n, pull_n, (mean, 1.0), pull);
        self.form.add_target(row, target, weight);
    }

    /// The expected square of the error, N^2.
    #[must_use]
    pub fn expected_n2(&self, currents_a: &[f64]) -> f64 {
        self.form.value(currents_a)
    }

    /// Leaves in `currents_a` those of the least expected error and priced power, from those within the limits
    /// that are there.
    pub fn minimise(&self, limits: &ForceProblem, currents_a: &mut [f64]) {
        self.form
            .minimise(limits, self.setting.price_n2_per_w, currents_a);
    }
}
