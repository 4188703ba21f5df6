//! The sideways force on the magnet, which eq. 5 leaves out: what it is with currents that look at the
//! upward force alone, and what it takes to have none.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The force along x and y at the chosen lambda, by that of the coils; the pull of unpowered steel
/// counts upward only. Shares are root mean squares over the points, over that of the requested
/// push; angles are between the given force and upward, medians over the points above height 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sideways {
    /// Points looked at, evenly among all.
    pub points: usize,
    /// Share with the static currents.
    pub static_share: f64,
    /// Angle with the static currents, degrees.
    pub static_median_deg: f64,
    /// Share with position feedback of the upward force (eq. 8).
    pub feedback_share: f64,
    /// Angle with position feedback of the upward force, degrees.
    pub feedback_median_deg: f64,
    /// Share of the points at which position feedback gives the requested upward force.
    pub feedback_reached: f64,
    /// Share of the points at which position feedback gives it without any sideways force.
    pub vector_reached: f64,
    /// Mean power of that over the power of feedback of the upward force alone; where it is out of
    /// reach both give the nearest force.
    pub vector_power_ratio: f64,
}
