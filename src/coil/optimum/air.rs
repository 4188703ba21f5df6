//! The air coil as the optimiser sees it: exact kernels with exact derivatives.

use super::axis_gradient::{self, axis_gradient};
use super::model::{CoilModel, NoResponse, Response, Sloped, Window};
use crate::section_integrals::{Accuracy, FINE, section_integrals};
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::magnet::MagnetRule;

/// Relative size of a node's distance from the axis that counts as none.
const ON_AXIS: f64 = 1e-12;

/// An air coil under a magnet on its axis.
#[derive(Debug, Clone, PartialEq)]
pub struct AirCoil {
    /// Height above the winding's top face and vertical moment of the magnet's dipoles.
    dipoles: Vec<(f64, f64)>,
    height_m: f64,
    accuracy: &'static Accuracy,
}

/// Why there is no air model.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoAirCoil {
    /// A dipole at or below the winding's top face.
    #[error("the magnet must be above the winding's top face: raise the target")]
    TooLow,
    /// A dipole off the axis.
    #[error(
        "a tilted or very close cylinder is not optimised for: use [magnet] model = \"dipole\""
    )]
    OffAxis,
    /// No moment, so no force.
    #[error("the magnet has no vertical moment: no coil exerts a force on it")]
    NoMoment,
}

impl AirCoil {
    /// An air coil whose target, the magnet's centre, is `height_m` above its top face.
    ///
    /// # Errors
    /// [`NoAirCoil`].
    pub fn new(height_m: f64, magnet: &MagnetRule) -> Result<Self, NoAirCoil> {
        let mut dipoles = Vec::with_capacity(magnet.nodes().len());
        let mut total = 0.0;
        for node in magnet.nodes() {
            let [x, y, z] = node.offset_m;
            let above_m = height_m + z;
            if !(above_m > 0.0 && above_m.is_finite()) {
                return Err(NoAirCoil::TooLow);
            }
            if x.hypot(y) > ON_AXIS * above_m {
                return Err(NoAirCoil::OffAxis);
            }
            total += node.moment_a_m2[2];
            dipoles.push((above_m, node.moment_a_m2[2]));
        }
        if !(total.abs() > 0.0 && total.is_finite()) {
            return Err(NoAirCoil::NoMoment);
        }
        // The force's sign is the magnet's; what is maximised is its size.
        for (_, moment) in &mut dipoles {
            *moment *= total.signum();
        }
        Ok(Self {
            dipoles,
            height_m,
            accuracy: &FINE,
        })
    }

    /// The same coil, its inductance to another accuracy.
    #[must_use]
    pub(crate) fn with_accuracy(self, accuracy: &'static Accuracy) -> Self {
        Self { accuracy, ..self }
    }
}

impl CoilModel for AirCoil {
    fn response(
        &self,
        window: &Window,
        turns_per_m2: f64,
        current_a: f64,
        with_inductance: bool,
    ) -> Result<Response, NoResponse> {
        let mut force_n = Sloped::default();
        for &(z_m, moment) in &self.dipoles {
            let part = axis_gradient(window, z_m).times(MU_0_T_M_PER_A * turns_per_m2 * moment);
            force_n.value += part.value;
            for (sum, slope) in force_n.slope.iter_mut().zip(part.slope) {
                *sum += slope;
            }
        }
        let per_ampere = force_n.value;
        force_n = force_n.times(current_a);
        force_n.slope[3] = per_ampere;
        let mut inductance_h = Sloped::default();
        if with_inductance {
            let sums = section_integrals(
                window.inner_radius_m,
                window.depth_m,
                window.length_m,
                self.accuracy,
            );
            inductance_h = Sloped {
                value: sums.value,
                slope: [
                    sums.by_depth - sums.inner,
                    sums.by_depth,
                    sums.by_length,
                    0.0,
                ],
            }
            .times(MU_0_T_M_PER_A * turns_per_m2 * turns_per_m2);
        }
        Ok(Response {
            force_n,
            inductance_h,
            ..Response::default()
        })
    }

    fn relative_error(&self) -> f64 {
        self.accuracy
            .relative_error
            .max(axis_gradient::RELATIVE_ERROR)
    }

    fn air_dipoles(&self) -> Option<&[(f64, f64)]> {
        Some(&self.dipoles)
    }

    fn length_scale_m(&self) -> f64 {
        self.height_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_spread_around_the_magnet_s_height() {
        let model = AirCoil::new(0.037, &MagnetRule::dipole([0.0, 0.0, 0.7])).expect("above");
        assert_eq!(model.length_scale_m(), 0.037);
        assert_eq!(model.air_dipoles(), Some(&[(0.037, 0.7)][..]));
    }
}
