//! The interface between a map and an axisymmetric source: a winding with or without a core.

use super::batch::Gradients;
use super::components::Components;
use super::winding::{OnEdge, Winding};

/// A source that is symmetric about the z axis, per ampere. Outside its conductors and cores the
/// field is the gradient of a harmonic function.
pub trait AxialSource: Sync {
    /// Gradients per ampere at points (`r_m`, `z_m`), to `tolerance` relative to the largest
    /// |grad B| at each point's height; of `components` those that belong to the gradient.
    ///
    /// # Errors
    /// [`OnEdge`] where the gradient is unbounded at a point.
    fn gradients(
        &self,
        r_m: &[f64],
        z_m: &[f64],
        tolerance: f64,
        components: Components,
    ) -> Result<Gradients, OnEdge>;

    /// B_z per ampere, T/A, to `tolerance` relative to the largest |B| at each point's height.
    ///
    /// # Errors
    /// [`OnEdge`] where the gradient is unbounded at a point.
    fn axial_fields(&self, r_m: &[f64], z_m: &[f64], tolerance: f64) -> Result<Vec<f64>, OnEdge>;

    /// Height of the highest singularity, m: the field is analytic above it.
    fn top_m(&self) -> f64;
}

impl AxialSource for Winding {
    fn gradients(
        &self,
        r_m: &[f64],
        z_m: &[f64],
        tolerance: f64,
        components: Components,
    ) -> Result<Gradients, OnEdge> {
        Self::gradients(self, r_m, z_m, tolerance, components)
    }

    fn axial_fields(&self, r_m: &[f64], z_m: &[f64], tolerance: f64) -> Result<Vec<f64>, OnEdge> {
        Self::axial_fields(self, r_m, z_m, tolerance)
    }

    fn top_m(&self) -> f64 {
        0.0
    }
}
