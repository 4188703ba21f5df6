//! What every room uses: physical constants and the millimetre border, progress and interruption,
//! and the error statement that every stage attaches to its numbers.

pub mod accuracy;
pub mod progress;
pub mod units;
