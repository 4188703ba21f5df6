//! Coils with steel cores: against oracles by other formulations, closed forms and physics.

// Some tests print tables: errors, estimates and times.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

mod array;
mod claims;
mod convergence;
mod crowded;
mod demagnetization;
mod extremes;
mod field;
mod memory;
mod near;
mod oracle;
mod saturation;
pub mod support;
mod working_points;
