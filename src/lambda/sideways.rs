//! The sideways force that static currents and eq. 8 leave, and what three rows of eq. 8 change.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::feedback::FeedbackError;
use super::vector_feedback::{CurrentsOf, VectorProblem, sums_at};

/// How far the force along x and y is off the requested one, which has none unless it is along the surface's normal, at
/// the chosen lambda, by the force of the coils; the pull of the unpowered steel counts upward only, and `pull_share` says
/// what that leaves out. Shares are root mean squares over the points, over that of the requested force; angles are
/// between the given force and the requested one, medians over the points above height 0 by their weights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sideways {
    /// Points looked at, evenly among all; for feedback without any sideways force up to a thousand of them.
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
    /// Share of the points at which position feedback gives all three components.
    pub vector_reached: f64,
    /// Mean power of that over the power of feedback of the upward force alone; where it is out of
    /// reach both give the nearest force.
    pub vector_power_ratio: f64,
    /// Share of the unpowered steel's own sideways pull, which neither the shares above nor feedback
    /// count, from a hundred points, to about a tenth of itself; absent where its upward pull is not counted either.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pull_share: Option<f64>,
}

/// How far the forces at `lambda_n_per_m` are off the requested ones sideways, with static currents and with feedback of
/// the upward part alone, and at the points `followed` with feedback of all three components. `None`
/// where no force is requested.
///
/// # Errors
/// Where the problem is malformed.
///
/// # Panics
/// When directions, sideways forces or the currents are fewer than the problem's, and for a point that it does not have.
pub fn sideways(
    vectors: &VectorProblem,
    lambda_n_per_m: f64,
    static_currents_a: &[f64],
    followed: &[usize],
) -> Result<Option<Sideways>, FeedbackError> {
    let every: Vec<usize> = (0..vectors.upward.points()).collect();
    let of = |points, currents_of| sums_at(vectors, points, lambda_n_per_m, currents_of);
    let fixed = of(&every, CurrentsOf::Static(static_currents_a))?;
    if fixed.requested <= 0.0 {
        return Ok(None);
    }
    let (fixed, feedback) = (
        fixed.rendering(),
        of(&every, CurrentsOf::Upward)?.rendering(),
    );
    // Power is compared at the same points.
    let upward = of(followed, CurrentsOf::Upward)?.rendering();
    let vector = of(followed, CurrentsOf::Vector)?.rendering();
    Ok(Some(Sideways {
        points: every.len(),
        static_share: fixed.sideways_share,
        static_median_deg: fixed.direction_median_deg,
        feedback_share: feedback.sideways_share,
        feedback_median_deg: feedback.direction_median_deg,
        feedback_reached: feedback.reached,
        vector_reached: vector.reached,
        vector_power_ratio: vector.mean_power_w / upward.mean_power_w,
        pull_share: None,
    }))
}
