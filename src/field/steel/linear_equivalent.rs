//! The linear core that is taken for one along a magnetisation curve where cores are coupled.
//!
//! Its permeability is the one with which the core alone, at the curve's current, has the same
//! dB_z/dz on the axis at one height. A core's moment goes as 1 / (N + x), N its demagnetising factor
//! and x the inverse of its susceptibility: so the inverse of the gradient that it adds is nearly
//! linear in x, and secants reach the solution in a few steps. What no permeability can give, the
//! gradient at other places and the flux linkage, is compared and stated.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::cored_coil::{Excitation, densities};
use super::double_layer::operators;
use super::generatrix::{Generatrix, Resolution};
use super::magnetized::MagnetizedCore;
use super::saturated_coil::{CoilWithCurve, SaturatedCoil, SaturatedCoilError};
use crate::winding::OnEdge;

/// Difference at the height, in stated errors of the core along its curve, that ends the search.
const CLOSE: f64 = 0.01;
/// Solutions after which the closest is taken; 3 to 5 are usual.
const MOST_SOLUTIONS: usize = 40;
/// Least x: more permeable steel changes no field by more.
const LEAST: f64 = 1e-9;
/// Largest x: less susceptible steel adds nothing.
const LARGEST: f64 = 1e9;
/// Heights at which gradients are compared, the first as close as errors are estimated, each twice as far from the
/// core as the last, until its moment alone counts.
const HEIGHTS: i32 = 9;
/// Distances from the axis there, in radii.
const ACROSS: [f64; 7] = [0.0, 0.4, 0.8, 1.0, 1.3, 1.7, 3.0];

/// Smaller currents that are looked at, over the largest: from saturation down to where permeability is that of no field.
const SMALLER: [f64; 5] = [0.7, 0.4, 0.15, 0.03, 0.002];
/// Tolerance of their resolution.
const SMALLER_TOLERANCE: f64 = 1e-3;
/// What currents between them may differ by more.
const SMALLER_MARGIN: f64 = 1.15;

/// How its errors are known.
pub const AGAINST_THE_CURVE: &str = "the largest difference of one linear core from one along the B-H curve at the \
                                     largest current of a coil, both alone; what saturation changes between cores \
                                     is not in it";

/// The linear core in the place of one along a curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinearEquivalent {
    /// Its relative permeability.
    pub relative_permeability: f64,
    /// Difference of its flux linkage, relative to the one along the curve.
    pub flux_error: f64,
    /// Differences of its gradients from those of the one along the curve.
    pub gradient: GradientDifferences,
}

/// How far the gradients of one core are from those of another, at heights above both.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GradientDifferences(
    /// Heights, m, ascending, and the largest difference at each, relative to the largest |grad B| there.
    Vec<[f64; 2]>,
);

impl GradientDifferences {
    fn with(self, change: impl Fn(f64) -> f64) -> Self {
        let changed = self.0.into_iter();
        Self(
            changed
                .map(|[z_m, differs]| [z_m, change(differs)])
                .collect(),
        )
    }

    /// The larger one at every height; both are at the same heights.
    fn or_more(self, other: &Self) -> Self {
        let pairs = self.0.into_iter().zip(&other.0);
        Self(pairs.map(|([z_m, a], [_, b])| [z_m, a.max(*b)]).collect())
    }

    /// The largest from `lowest_m` up, relative to the largest |grad B| at a height; closer to the core than a tenth of
    /// its radius none is known.
    #[must_use]
    pub fn largest_from(&self, lowest_m: f64) -> f64 {
        let above = self.0.partition_point(|[z_m, _]| *z_m <= lowest_m);
        let from = &self.0[above.saturating_sub(1)..];
        from.iter()
            .fold(0.0, |most, [_, differs]| most.max(*differs))
    }
}

/// One winding with a core of any permeability, per ampere.
struct AnyPermeability<'a> {
    outline: &'a Generatrix,
    potential: [DVector<f64>; 1],
    flux_weights_wb_per_a: DVector<f64>,
    operator: DMatrix<f64>,
}

impl AnyPermeability<'_> {
    /// The core whose susceptibility is 1 / `x`, and its part of the inductance, H.
    fn at(&self, x: f64) -> (MagnetizedCore, f64) {
        let mut density = densities(
            self.outline,
            self.operator.clone(),
            permeability(x),
            &self.potential,
        );
        let density = density.remove(0);
        let added_h = self.flux_weights_wb_per_a.dot(&density);
        let layer = MagnetizedCore::new(self.outline.clone(), density.as_slice().to_vec());
        (layer, added_h)
    }
}

fn permeability(x: f64) -> f64 {
    1.0 + 1.0 / x
}

impl CoilWithCurve<'_> {
    /// The linear core that adds what `state` adds to dB_z/dz on the axis at `height_m`, or at a tenth of
    /// the radius above the core where that is higher; where none does, the closest. The search begins
    /// with the permeability `first`.
    ///
    /// Domain: `first` >= 1.
    ///
    /// # Errors
    /// A place on the winding's edge.
    pub fn linear_equivalent(
        &self,
        state: &SaturatedCoil,
        first: f64,
        height_m: f64,
    ) -> Result<LinearEquivalent, OnEdge> {
        let (along, height_m) = (&state.layer, height_m.max(self.closest_m()));
        let quadrature = Resolution::for_tolerance(state.relative_error).quadrature;
        let outline = along.outline();
        let excitation = Excitation::new(self.winding, outline, quadrature)?;
        let core = AnyPermeability {
            outline,
            flux_weights_wb_per_a: excitation.flux_weights_wb_per_a(outline),
            potential: [excitation.potential],
            operator: operators(outline, 1, quadrature).remove(0),
        };
        let expected = along.field(0.0, height_m);
        let size = (self.winding.field(0.0, height_m)? + expected).gradient_norm();
        let close = CLOSE * state.relative_error * size / expected.dbz_dz.abs();
        let first = (1.0 / (first - 1.0)).clamp(LEAST, LARGEST);
        let x = susceptibility_inverse(first, close, |x| {
            expected.dbz_dz / core.at(x).0.field(0.0, height_m).dbz_dz - 1.0
        });
        let (layer, added_h) = core.at(x);
        Ok(LinearEquivalent {
            relative_permeability: permeability(x),
            flux_error: self.flux_difference(state.added_inductance_h, added_h)
                + state.relative_error,
            gradient: self
                .gradient_differences(along, &layer)?
                .with(|differs| differs + state.relative_error),
        })
    }

    /// How far the gradients per ampere at smaller currents are from those at `current_a`, with a margin for the currents
    /// between those looked at. Those at which no state is found are left out.
    ///
    /// # Errors
    /// As [`CoilWithCurve::solve`], at `current_a`.
    pub fn smaller_currents(
        &self,
        current_a: f64,
    ) -> Result<GradientDifferences, SaturatedCoilError> {
        // Of one resolution, whose errors are alike at all currents.
        let resolution = Resolution::for_tolerance(SMALLER_TOLERANCE);
        let at = |share: f64| self.at_resolution(share * current_a, &resolution);
        let largest = at(1.0)?.layer;
        let mut all = self.gradient_differences(&largest, &largest)?;
        for share in SMALLER {
            match at(share) {
                Ok(smaller) => {
                    all = all.or_more(&self.gradient_differences(&largest, &smaller.layer)?);
                }
                Err(SaturatedCoilError::Stalled) => {}
                Err(other) => return Err(other),
            }
        }
        Ok(all.with(|differs| SMALLER_MARGIN * differs))
    }

    /// How far the gradients per ampere of the core `other` are from those of `one`.
    fn gradient_differences(
        &self,
        one: &MagnetizedCore,
        other: &MagnetizedCore,
    ) -> Result<GradientDifferences, OnEdge> {
        let at = (0..HEIGHTS).map(|step| {
            let above_m = (self.closest_m() - self.shape.top_m) * f64::from(step).exp2();
            let z_m = self.shape.top_m + above_m;
            let differs = self.gradient_difference(one, other, z_m, &ACROSS)?;
            Ok([z_m, differs])
        });
        Ok(GradientDifferences(at.collect::<Result<_, OnEdge>>()?))
    }
}

/// Where `excess`, which rises with x, is within `close` of nothing; where that is nowhere, where it is
/// least. Secants from `first` on, and geometric means where these leave the bracket.
fn susceptibility_inverse(first: f64, close: f64, excess: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (LEAST, LARGEST);
    let (mut x, mut before) = (first, None::<[f64; 2]>);
    let mut best = [first, f64::INFINITY];
    for _ in 0..MOST_SOLUTIONS {
        let value = excess(x);
        if value.abs() < best[1] {
            best = [x, value.abs()];
        }
        if !value.is_finite() || value.abs() <= close {
            break;
        }
        if value < 0.0 {
            low = x;
        } else {
            high = x;
        }
        let next = match before {
            Some([other, of_other]) => x - value * (x - other) / (value - of_other),
            None if value < 0.0 => 2.0 * x,
            None => 0.5 * x,
        };
        before = Some([x, value]);
        x = if low < next && next < high {
            next
        } else {
            (low * high).sqrt()
        };
    }
    best[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a uniformly magnetised core, whose gradient goes as 1 / (N + x).
    #[test]
    fn the_inverse_of_a_susceptibility_is_that_of_the_gradient() {
        let of = |first: f64, demagnetising: f64, expected: f64| {
            let excess = |x: f64| expected * (demagnetising + x) - 1.0;
            susceptibility_inverse(first, 1e-12, excess)
        };
        for first in [LEAST, 1e-3, 0.2, LARGEST] {
            let x = of(first, 0.03, 1.0 / 0.05);
            assert!((x / 0.02 - 1.0).abs() < 1e-9, "{first}: {x}");
            // More than any steel adds.
            assert!(of(first, 0.03, 1.0 / 0.02) < 2.0 * LEAST, "{first}");
        }
        // Nothing to go by.
        assert_eq!(susceptibility_inverse(0.3, 1e-12, |_| f64::NAN), 0.3);
    }
}
