//! The largest of an expensive function of continuous and whole variables under limits.
//!
//! Costly are some smooth outputs (the logarithm of a force constant, of a settling time); objective
//! and limits follow from them, and from the variables, at no cost. So all evaluations serve one
//! [`surrogate::Surrogate`], whatever limits they meet: it is climbed within a trust region about the
//! best design (`descent`), whole variables by branching, and what is found is evaluated. Several
//! starts share the evaluations. Batches have a fixed size and sums a fixed order, so the outcome does
//! not depend on the number of threads; the sequence follows from the seed.

pub mod descent;
mod rounding;
mod search;
pub mod surrogate;
mod variable;

pub use search::{MET, Problem, Sample, Search, Settings};
pub use variable::{Values, Variable};
