//! Tabulation over the workspace and its error.

pub mod catmull_rom;
pub mod harmonic;
pub mod interpolation;
pub mod multipole;
pub mod multipole_fit;
pub mod radii;
pub mod sampled;
pub mod sampler;
pub mod tabulate;

pub use interpolation::{InterpolationError, interpolation_error, interpolation_error_by};
pub use tabulate::{Components, FieldMap, tabulate};
