//! One winding with its core along a magnetisation curve, at one current, to an estimated error.

use nalgebra::DVector;

use super::CoreShape;
use super::cored_coil::Excitation;
use super::curve_refinement::{AlongCurve, Level, Refined, Try, refined};
use super::generatrix::{Generatrix, Resolution};
use super::magnetized::MagnetizedCore;
use super::permeability::Permeability;
use super::saturated::{Convergence, CoreField, SaturatedCore};
use super::spectral_fem::MeshError;
use crate::winding::{OnEdge, Winding};
use fluxform_numerics::refinement::error_of_finest;

/// How much more the differences of |B| inside count, of which the largest is seen at samples:
/// kinks reach it undamped. By the table of
/// `cargo test --test field steel -- --ignored --nocapture along_curves_in_full`.
const INSIDE: f64 = 2.0;
/// Distance above the core, in radii, below which no error is estimated.
const CLOSEST: f64 = 0.1;

/// Why a coil has no state at a current.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SaturatedCoilError {
    /// A node of the outline lies on the winding's edge.
    #[error(transparent)]
    OnEdge(#[from] OnEdge),
    /// The core cannot be meshed.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The iteration found no state of the steel.
    #[error("no state of the steel was found")]
    Stalled,
}

/// A coil whose core saturates.
#[derive(Debug, Clone, Copy)]
pub struct CoilWithCurve<'a> {
    /// The winding.
    pub winding: &'a Winding,
    /// Its self inductance without the core, H.
    pub air_inductance_h: f64,
    /// The core.
    pub shape: CoreShape,
    /// Its material.
    pub law: &'a dyn Permeability,
}

/// The state of a coil with its core at one current.
#[derive(Debug, Clone)]
pub struct SaturatedCoil {
    /// The steel's layer over the current.
    pub layer: MagnetizedCore,
    /// Flux of the layer through the winding over the current, H.
    pub added_inductance_h: f64,
    /// |B| inside.
    pub inside: CoreField,
    /// Estimated error: of the gradient at the height requested and above, relative to the largest
    /// |grad B| there, and of the flux linkage; the larger.
    pub relative_error: f64,
    /// Estimated error of the largest |B| inside, relative to it.
    pub peak_error: f64,
    /// Estimated error of the mean |B| inside, relative to it.
    pub mean_error: f64,
}

impl CoilWithCurve<'_> {
    /// Solves to an estimated error below `tolerance` from `lowest_m` up, or as far as the
    /// refinements carry: [`SaturatedCoil::relative_error`] states what was reached.
    ///
    /// Domain: a current that is not 0. No error is estimated closer to the core's top than a
    /// tenth of its radius.
    ///
    /// # Errors
    /// See [`SaturatedCoilError`].
    pub fn solve(
        &self,
        current_a: f64,
        tolerance: f64,
        lowest_m: f64,
    ) -> Result<SaturatedCoil, SaturatedCoilError> {
        let lowest_m = lowest_m.max(self.closest_m());
        let problem = AtCurrent {
            coil: self,
            current_a,
            lowest_m,
        };
        let first = Try::first(tolerance);
        Ok(stated(refined(&problem, first, tolerance, None)?))
    }

    /// Solves at one resolution; no error is estimated.
    ///
    /// Domain: a current that is not 0.
    ///
    /// # Errors
    /// See [`SaturatedCoilError`].
    pub fn at_resolution(
        &self,
        current_a: f64,
        resolution: &Resolution,
    ) -> Result<SaturatedCoil, SaturatedCoilError> {
        self.from(current_a, resolution, None)
    }

    /// The same, the iteration beginning with the layer of a coarser solution.
    fn from(
        &self,
        current_a: f64,
        resolution: &Resolution,
        start: Option<&SaturatedCoil>,
    ) -> Result<SaturatedCoil, SaturatedCoilError> {
        let outline = Generatrix::of_coil(self.winding, self.shape, resolution);
        let excitation = Excitation::new(self.winding, &outline, resolution.quadrature)?;
        let solver = SaturatedCore::new(&outline, resolution.quadrature)?;
        let start =
            start.map(|coarser| current_a * DVector::from_vec(coarser.layer.density_on(&outline)));
        let potential = &excitation.potential * current_a;
        let solution = solver.solve(&potential, self.law, start.as_ref());
        if solution.status == Convergence::Stalled {
            return Err(SaturatedCoilError::Stalled);
        }
        let flux_wb = solver.flux_linkage_wb(&solution, &excitation.potential);
        let inside = solver.field(&solution, self.law);
        let density = (&solution.v_a / current_a).as_slice().to_vec();
        Ok(SaturatedCoil {
            layer: MagnetizedCore::new(outline, density),
            added_inductance_h: flux_wb / current_a,
            inside,
            relative_error: f64::NAN,
            peak_error: f64::NAN,
            mean_error: f64::NAN,
        })
    }

    /// The least height at which errors are estimated, m.
    pub(super) fn closest_m(&self) -> f64 {
        self.shape.top_m.max(0.0) + CLOSEST * self.shape.radius_m
    }

    /// Largest difference of the gradients at a few heights from `lowest_m` up, relative to the
    /// largest |grad B| at each, and of the flux linkages.
    ///
    /// # Errors
    /// A place on the winding's edge.
    pub fn difference(
        &self,
        a: &SaturatedCoil,
        b: &SaturatedCoil,
        lowest_m: f64,
    ) -> Result<f64, OnEdge> {
        let mut worst = self.flux_difference(a.added_inductance_h, b.added_inductance_h);
        for height in [0.0, 1.0, 4.0] {
            let z_m = lowest_m + height * self.shape.radius_m;
            let differs = self.gradient_difference(&a.layer, &b.layer, z_m, &[0.0, 0.8, 1.7])?;
            worst = worst.max(differs);
        }
        Ok(worst)
    }

    /// Difference of the flux linkages of two cores by their parts of the inductance, relative.
    pub(super) fn flux_difference(&self, added_h: f64, other_added_h: f64) -> f64 {
        (added_h - other_added_h).abs() / (self.air_inductance_h + added_h).abs()
    }

    /// Largest difference of the gradients at the height `z_m` and distances `across` from the axis, in radii,
    /// relative to the largest |grad B| there.
    pub(super) fn gradient_difference(
        &self,
        a: &MagnetizedCore,
        b: &MagnetizedCore,
        z_m: f64,
        across: &[f64],
    ) -> Result<f64, OnEdge> {
        let (mut size, mut differs) = (0.0_f64, 0.0_f64);
        for across in across {
            let r_m = across * self.shape.radius_m;
            let (f, g) = (a.field(r_m, z_m), b.field(r_m, z_m));
            size = size.max((self.winding.field(r_m, z_m)? + f).gradient_norm());
            differs = differs
                .max((f.dbz_dz - g.dbz_dz).abs())
                .max((f.dbr_dz - g.dbr_dz).abs())
                .max((f.br_over_r - g.br_over_r).abs());
        }
        Ok(differs / size)
    }
}

/// A coil at one current, compared from a height up.
struct AtCurrent<'a> {
    coil: &'a CoilWithCurve<'a>,
    current_a: f64,
    lowest_m: f64,
}

impl AlongCurve for AtCurrent<'_> {
    type Solution = SaturatedCoil;
    type Error = SaturatedCoilError;

    fn solve(
        &self,
        of: &Try,
        level: Level,
        start: Option<&SaturatedCoil>,
    ) -> Result<SaturatedCoil, SaturatedCoilError> {
        let resolution = of.outline(level, Resolution::for_tolerance(of.aim));
        self.coil.from(self.current_a, &resolution, start)
    }

    fn difference(&self, a: &SaturatedCoil, b: &SaturatedCoil) -> Result<f64, SaturatedCoilError> {
        Ok(self.coil.difference(a, b, self.lowest_m)?)
    }

    fn floor(&self, _of: &Try) -> f64 {
        0.0
    }
}

/// The finest solution with its errors.
fn stated(solutions: Refined<SaturatedCoil>) -> SaturatedCoil {
    let Refined {
        fine,
        coarser: [coarse, coarsest],
        error,
    } = solutions;
    let field = |pick: fn(&CoreField) -> f64| {
        let [a, b, c] = [&fine.inside, &coarse.inside, &coarsest.inside].map(pick);
        let size = if a > 0.0 { a } else { 1.0 };
        INSIDE * error_of_finest((a - b).abs(), (b - c).abs()) / size + error
    };
    SaturatedCoil {
        relative_error: error,
        peak_error: field(|inside| inside.peak_b_t),
        mean_error: field(|inside| inside.mean_b_t),
        ..fine
    }
}
