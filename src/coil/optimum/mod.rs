//! The coil of equation 11: the strongest force at the target within the limits.
//!
//! Variables are the inner and outer radius and the length; turns are what fits,
//! N = (a2 - a1)/d x L/d, not rounded in the continuous problem. At least one layer and one turn
//! a layer must fit: less is no coil. The rated current is min(I_max, V/R).
//!
//! 1. `problem`: in logarithms of mean radius, depth and length, limits become ratios of order
//!    one and the amount of wire a plane, whatever the scale. Where the driver gives way to the
//!    supply the force has a kink: either side is solved as its own smooth problem.
//! 2. `search`: from many starts, `sqp` quadratic steps with exact active sets, then
//!    Newton on the optimality conditions: coils and multipliers to 1e-10. The settling time,
//!    whose inductance costs a thousand times more than the force, is left out first: a best coil
//!    that meets it anyway needs no more.
//! 3. `branch_and_bound`: force, wire and inductance are monotone in the window, so boxes of coils are
//!    bounded by their corners and, with `interval_bounds`'s interval derivatives and the multipliers,
//!    to second order. No coil is better than the bound: that is the certificate.
//! 4. `wound`: whole layers and turns, sets of coils taken apart best first (`best_first`), in air
//!    under the same bounds (`bounded_coils`), with a core under those of cheaper models and their
//!    measured errors (`screened_coils`).
//!
//! argmin has no solver for nonlinear limits; it does what is a search in one variable
//! (`scalar`).
//!
//! A cored coil enters through the same [`model::CoilModel`]. `cored` tabulates what the steel
//! adds to force, inductance and flux density: roughly for the starting points (`search` goes on
//! from the different ends that may be best), coarsely about those and, about the optimum found,
//! sharply (`surrogate`). Nothing bounds its force: the continuous optimum's certificate is of kind
//! `multistart`, that of wound coils, each of which is tried (`exhaustive`), of that name.

pub mod air;
pub mod alternatives;
pub mod axis_gradient;
mod best_bore;
mod best_first;
mod bounded_coils;
pub mod branch_and_bound;
pub mod candidates;
pub mod cored;
#[cfg(test)]
mod cored_tests;
mod diagnosis;
pub mod domain;
pub mod interval_bounds;
pub mod landscape;
pub mod lazy_table;
mod local_searches;
mod loop_settling;
pub mod model;
pub mod near_optimal_bore;
mod nearest_whole;
pub mod neighbours;
pub mod outcome;
pub mod problem;
mod scalar;
mod screened_coils;
pub mod search;
pub mod sqp;
pub mod starts;
mod surrogate;
pub mod task;
#[cfg(test)]
mod tests;
mod whole_sizes;
pub mod wound;

pub use local_searches::Settings;
pub use model::{CoilModel, Strand, Window};
pub use outcome::{
    Advantage, Alternative, BestCoil, Certificate, CertificateKind, Ending, LimitUse,
    OptimumStatus, Outcome, Valley, WholeTurns, WireOutcome,
};
pub use problem::{Fixed, LimitName, Task};
pub use search::optimise;
pub use wound::optimise_wound;
