//! Parts used by every room: physical constants and the millimetre border, progress and interruption,
//! the error statement that every stage attaches to its numbers, choices by name, units of length, the
//! force constants, and which force is requested, and from which size on.

pub mod accuracy;
pub mod choice;
pub mod digits;
pub mod force_constant;
pub mod force_direction;
pub mod heating;
pub mod least_request;
pub mod length_unit;
pub mod point_weights;
pub mod progress;
pub mod uncertainty;
pub mod units;
