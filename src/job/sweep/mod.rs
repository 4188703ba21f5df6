//! `sweep`: a grid of designs, planned, computed in parts that may be cut short, and merged.
//!
//! A row is what `evaluate` tells of the coil alone; the array's inductances, which no column
//! shows, are not computed.

pub mod axis;
pub mod front;
pub mod merge;
pub mod plan;
mod point;
pub mod run;
