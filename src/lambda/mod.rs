//! The force constant: the exact path of e*(lambda) and its criteria (eq. 9 and 10).
//!
//! One static current vector `I` for a whole object renders `lambda h_j` at its points;
//! `e*(lambda)` is the least mean square error within the current limits. It is piecewise
//! quadratic and is followed exactly, from `lambda = 0` to where no coil moves any more.

mod allocate;
mod certificate;
mod cone;
mod criteria;
pub mod feedback;
mod follow;
mod model;
mod path;
mod power;
mod problem;
mod reduce;
mod solve;
mod wiring;
pub mod worst;

pub use allocate::{Allocation, Allocator, AllocatorError, Reach};
pub use path::{Breakpoint, Event, Path};
pub use problem::{Criterion, ForceProblem, ProblemError, Settings};
pub use solve::{OperatingPoint, Precision, Solution, Status, solve};
pub use wiring::{Rewired, Wiring, WiringError};
