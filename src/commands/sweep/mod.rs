//! `sweep`: a grid of designs, planned, computed in parts that may be cut short, and merged.
//!
//! A row is what `evaluate` reports of the coil alone; the array's inductances, which no column
//! shows, are not computed.

pub mod axis;
pub(crate) mod command;
pub mod merge;
mod merge_command;
pub mod plan;
mod plan_command;
mod point;
pub(crate) use point::toml_value;
pub mod run;
mod run_command;
