//! The core's steel: its magnetisation curve, and what a table of it must be.

pub mod bh_check;
pub mod bh_curve;
