//! Tabulation over the workspace and its error.

pub mod interpolation;
pub mod radii;
pub mod tabulate;

pub use interpolation::{InterpolationError, interpolation_error};
pub use tabulate::{Components, FieldMap, tabulate};
