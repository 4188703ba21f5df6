//! The array that renders the shapes best: coil, core, wire and positions together, within the design's limits.
//!
//! [`space::Space`] turns numbers into designs, [`problem::ArrayProblem`] judges them by the one table
//! of limits, `numerics::mixed_search` finds the best; what the force constants are is asked of a
//! [`problem::Physics`].

pub mod choice;
mod plate;
pub mod positions;
pub mod problem;
pub mod search;
pub mod space;
pub mod study;
#[cfg(test)]
mod tests;
pub mod worth;
