//! The force constant: the exact path of e*(lambda) and its criteria (eq. 9 and 10).
//!
//! One static current vector `I` for a whole object renders `lambda h_j` at its points;
//! `e*(lambda)` is the least mean square error within the current limits. It is piecewise
//! quadratic and is followed exactly, from `lambda = 0` to where no coil moves any more.
//!
//! The room knows numbers alone: forces, heights and limits of any origin.
//!
//! ```
//! use fluxform_lambda::{ForceProblem, Settings, solve};
//!
//! # fn main() -> Result<(), fluxform_lambda::ProblemError> {
//! // Two coils, each felt at one of two points 50 mm high, a third point between them.
//! let problem = ForceProblem {
//!     forces_n_per_a: &[0.13, 0.0, 0.05, 0.07, 0.0, 0.11],
//!     height_m: &[0.05, 0.05, 0.05],
//!     offset_n: None,
//!     weights: None,
//!     lower_a: &[0.0, 0.0],
//!     upper_a: &[2.0, 1.3],
//!     total_max_a: None,
//!     resistance_ohm: &[6.0, 6.0],
//! };
//! let solution = solve(&problem, &Settings::default())?;
//! let linear = solution.constants.lambda_linear_n_per_m.unwrap_or(f64::INFINITY);
//! let chosen = solution.chosen.as_ref().map_or(0.0, |chosen| chosen.lambda_n_per_m);
//! assert!(linear > 0.0 && linear <= chosen);
//!
//! // Below lambda_linear no limit binds: currents are proportional to lambda, and the residual is
//! // at right angles to every coil's forces.
//! let currents = solution.path.currents_a(0.7 * linear);
//! let row = |j: usize| &problem.forces_n_per_a[2 * j..2 * j + 2];
//! for coil in 0..2 {
//!     let slope: f64 = (0..3)
//!         .map(|j| {
//!             let given: f64 = row(j).iter().zip(&currents).map(|(g, i)| g * i).sum();
//!             row(j)[coil] * (given - 0.7 * linear * 0.05)
//!         })
//!         .sum();
//!     assert!(slope.abs() < 1e-15);
//! }
//!
//! // Drivers of twice the current render twice the stiffness.
//! let stronger = ForceProblem { upper_a: &[4.0, 2.6], ..problem };
//! let twice = solve(&stronger, &Settings::default())?.constants.lambda_linear_n_per_m;
//! assert!((twice.unwrap_or(0.0) / linear - 2.0).abs() < 1e-12);
//! # Ok(())
//! # }
//! ```

pub mod all_points;
mod allocation;
mod basis;
pub mod between;
mod certificate;
mod cone;
mod criteria;
pub mod enclosure;
mod exact_start;
pub mod feedback;
mod followed;
mod given;
mod homotopy;
pub mod limit;
mod model;
mod path;
mod pivoted;
mod power;
mod problem;
mod qr_reduction;
mod rest;
pub mod sampling;
pub mod sideways;
mod solve;
pub mod two_fingers;
pub mod uncertainty;
mod vector_allocation;
pub mod vector_feedback;
pub mod vector_static;
mod wiring;
pub mod worst;

pub use allocation::{Allocation, Allocator, AllocatorError, Reach};
pub use fluxform_base::force_constant::{Criterion, ForceConstants, Jnd, NamedConstant};
pub use followed::Precision;
pub use given::GivenForce;
pub use path::{Breakpoint, Event, Path};
pub use problem::{ForceProblem, ProblemError, Settings};
pub use solve::{OperatingPoint, Solution, Status, constant, relative_error, solve};
pub use vector_allocation::{
    MET as VECTOR_MET, SIDEWAYS_WEIGHT, VectorAllocation, VectorAllocator,
};
pub use wiring::{Rewired, Wiring, WiringError};
