//! One core along its B-H curve, alone with its winding at a given current.

use super::JobError;
use super::scene::Scene;
use super::steel::SceneCore;
use crate::field::steel::bh_curve::BhCurve;
use crate::field::steel::cored_coil::Excitation;
use crate::field::steel::generatrix::{Generatrix, Resolution};
use crate::field::steel::magnetized::MagnetizedCore;
use crate::field::steel::saturated::{CoreField, SaturatedCore, Status};
use crate::field::winding::AxialField;

/// Default tolerance along a B-H curve: the curve's kinks cross the elements, so that digits are
/// dear.
pub const SATURATED_TOLERANCE: f64 = 1e-4;
/// Refinements after which a tolerance that is not reached is given up, with its estimate.
const MAX_REFINEMENTS: usize = 3;
/// Distance above the core, in radii, below which no error is estimated.
const CLOSEST: f64 = 0.1;

/// A core at one current.
#[derive(Debug, Clone)]
pub struct AtCurrent {
    /// The steel's layer over the current.
    pub layer: MagnetizedCore,
    /// Flux of the layer through the winding over the current, H.
    pub added_inductance_h: f64,
    /// |B| inside.
    pub inside: CoreField,
    /// Estimated error: of the gradient on the axis at the height asked for, relative to
    /// |grad B|, and of the flux linkage; the larger. The difference of two resolutions.
    pub relative_error: f64,
}

impl AtCurrent {
    /// Solves to an estimated error below `tolerance` at `height_m`, or as far as the refinements
    /// carry.
    ///
    /// Domain: a current that is not 0.
    ///
    /// # Errors
    /// A core that cannot be meshed; a curve along which no state is found.
    pub fn new(
        scene: &Scene,
        core: &SceneCore,
        curve: &BhCurve,
        current_a: f64,
        tolerance: f64,
        height_m: f64,
    ) -> Result<Self, JobError> {
        let closest_m = core.shape.top_m.max(0.0) + CLOSEST * core.shape.radius_m;
        let height_m = height_m.max(closest_m);
        let mut aim = tolerance;
        let mut refined = 0;
        loop {
            let resolution = Resolution::for_tolerance(aim);
            let solve = |r: &Resolution| Self::at_resolution(scene, core, curve, current_a, r);
            let coarse = solve(&resolution.coarser())?;
            let mut fine = solve(&resolution)?;
            let field = fine.field(scene, height_m)?;
            let other = coarse.field(scene, height_m)?;
            let air_h = scene.circuit.inductance_h;
            let gradient = (field.dbz_dz - other.dbz_dz).abs() / field.gradient_norm();
            let flux = (fine.added_inductance_h - coarse.added_inductance_h).abs()
                / (air_h + fine.added_inductance_h).abs();
            fine.relative_error = gradient.max(flux);
            if fine.relative_error <= tolerance || refined == MAX_REFINEMENTS {
                return Ok(fine);
            }
            refined += 1;
            aim *= 0.1;
        }
    }

    fn at_resolution(
        scene: &Scene,
        core: &SceneCore,
        curve: &BhCurve,
        current_a: f64,
        resolution: &Resolution,
    ) -> Result<Self, JobError> {
        let outline = Generatrix::of_coil(&scene.winding, core.shape, resolution);
        let excitation = Excitation::new(&scene.winding, &outline, resolution.quadrature)?;
        let solver = SaturatedCore::new(&outline, resolution.quadrature)
            .map_err(|fault| JobError::Input(format!("[core] with a B-H curve: {fault}")))?;
        let solution = solver.solve(&(&excitation.potential * current_a), curve, None);
        if solution.status == Status::Stalled {
            return Err(no_state(current_a));
        }
        let flux_wb = solver.flux_linkage_wb(&solution, &excitation.potential);
        let inside = solver.field(&solution, curve);
        let density = (&solution.v_a / current_a).as_slice().to_vec();
        Ok(Self {
            layer: MagnetizedCore::new(outline, density),
            added_inductance_h: flux_wb / current_a,
            inside,
            relative_error: f64::NAN,
        })
    }

    /// Winding and steel on the axis, over the current.
    ///
    /// # Errors
    /// A place on the winding's edge.
    pub fn field(&self, scene: &Scene, height_m: f64) -> Result<AxialField, JobError> {
        Ok(scene.winding.field(0.0, height_m)? + self.layer.field(0.0, height_m))
    }
}

/// What is said when no state of the steel was found.
pub(super) fn no_state(current_a: f64) -> JobError {
    JobError::Input(format!(
        "[core] with a B-H curve: no state of the steel was found at {current_a} A; check the \
         curve for jumps, or give core.relative_permeability"
    ))
}
