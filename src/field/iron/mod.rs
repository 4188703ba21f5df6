//! Steel of any shape: bodies bounded by panels, such as a plate that joins the cores.
//!
//! In steel H = -grad u, and with chi = mu_r - 1 on the two sides of a surface, its normal n' from the first
//! to the second,
//!
//! ```text
//! (1 + (chi_1 + chi_2) / 2) u(x) + PV int (chi_1 - chi_2) u(y) n'.(x - y) / (4 pi |x - y|^3) dS = phi(x),
//! ```
//!
//! phi being the windings' potential. Where steel joins there is no surface, so the flux's way is exact;
//! a constant layer on a closed body gives nothing outside it and is a row's diagonal. Of very permeable steel
//! the constant is left open by the equation: it is set to a mean of nothing.

mod arrangement;
pub mod array;
mod axial_profile;
mod blocks;
pub mod bodies;
pub mod clearance;
pub mod face;
mod inductance;
pub mod mesh_body;
mod near_sources;
mod panel_columns;
mod parts;
pub mod passive;
pub mod peaks;
pub mod plate;
pub mod potential;
pub mod prisms;
mod round_faces;
pub mod surface;
mod system;
pub mod uniform;
