//! Tabulation over the workspace and its error.

pub mod radii;
pub mod tabulate;

pub use tabulate::{Components, FieldMap, tabulate};
