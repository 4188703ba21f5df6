//! Sources to field and gradient: the loop, the winding, the magnet.
//!
//! A winding and its steel give field and gradient per ampere; a magnet in that gradient feels a
//! force.
//!
//! ```
//! use fluxform_field::dipole::{cylinder_moment_a_m2, force_n};
//! use fluxform_field::frame::to_cartesian;
//! use fluxform_field::winding::Winding;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let coil = Winding { inner_radius_m: 0.012, outer_radius_m: 0.019, length_m: 0.1, turns: 1429.0 };
//!
//! // A finger's magnet 30 mm above the coil, its moment pointing down, at 2 A: pushed up.
//! let at_target = to_cartesian(&coil.field(0.0, 0.03)?, 0.0, 0.0);
//! let moment = [0.0, 0.0, -cylinder_moment_a_m2(0.01, 0.01, 1.1579e6)];
//! let gradient = at_target.gradient_t_per_m_per_a.map(|row| row.map(|g| 2.0 * g));
//! let force = force_n(moment, gradient);
//! assert!((force[2] - 0.0997).abs() < 1e-4 && force[0] == 0.0);
//!
//! // Far away the winding is a dipole: the gradient on its axis falls as the fourth power.
//! let far = coil.field(0.0, 9.95)?.dbz_dz / coil.field(0.0, 19.95)?.dbz_dz;
//! assert!((far - 16.0).abs() < 1e-3);
//! # Ok(())
//! # }
//! ```

pub mod batch;
pub mod components;
pub mod dipole;
pub mod frame;
pub mod iron;
pub mod magnet;
pub mod ring;
pub mod source;
pub mod steel;
pub mod winding;
