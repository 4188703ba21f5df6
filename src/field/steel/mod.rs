//! Steel: cores that the coils magnetise.

pub mod array;
pub mod array_cost;
pub mod array_request;
mod array_resolution;
mod array_sources;
pub mod array_steel;
pub mod axial_table;
pub mod bh_check;
pub mod bh_curve;
pub mod bore;
pub mod clearance;
pub mod condensation;
pub mod core_flux_density;
mod core_layers;
pub mod cored_coil;
pub mod coupling;
mod curve_refinement;
pub mod double_layer;
pub mod equivalent_dipoles;
pub mod exchange;
pub mod generatrix;
pub mod layer_gradient;
pub mod linear_equivalent;
pub mod lobatto;
pub mod magnetized;
mod offsets;
pub mod passive;
mod peak_search;
pub mod permeability;
mod reduced_coupling;
pub mod response;
pub mod saturated;
pub mod saturated_array;
pub mod saturated_coil;
pub mod spectral_fem;
pub mod symmetry;
pub mod trace;

use serde::{Deserialize, Serialize};

/// Distance from a core's surface, in its radii, from which on solutions are estimated and places
/// are accepted.
pub const CLOSEST: f64 = 0.02;

/// A cylindrical core on the coil's axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CoreShape {
    /// Radius, m; > 0.
    pub radius_m: f64,
    /// Height of the bottom face, m.
    pub bottom_m: f64,
    /// Height of the top face, m; above the bottom.
    pub top_m: f64,
}

impl CoreShape {
    /// Length, m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.top_m - self.bottom_m
    }

    /// Distance of a place at radius `r_m` and height `z_m` from the surface, m.
    #[must_use]
    pub fn distance_m(&self, r_m: f64, z_m: f64) -> f64 {
        let beside = r_m - self.radius_m;
        let beyond = (z_m - self.top_m).max(self.bottom_m - z_m);
        if beside < 0.0 && beyond < 0.0 {
            return -beside.max(beyond);
        }
        beside.max(0.0).hypot(beyond.max(0.0))
    }

    /// Volume, m^3.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        std::f64::consts::PI * self.radius_m * self.radius_m * self.length_m()
    }
}
