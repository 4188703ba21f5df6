//! The result of a study: the felt error with each kind of currents, and what each uncertainty costs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use fluxform_base::uncertainty::{Cause, Uncertainty};

/// Errors of the felt force: root mean squares of its difference from the requested one over the points and the
/// uncertainties, relative to that of the requested force: of static currents and of feedback those of all points with
/// nothing uncertain, and what the uncertainties add at the points of the study; of others those of its points.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct FeltError {
    /// Of the whole vector.
    pub expected: f64,
    /// Of its upward part.
    pub vertical: f64,
    /// Of its sideways part.
    pub sideways: f64,
    /// The longest difference at any point that was found within the bounds, relative to the largest requested force: of
    /// states on them and of the random displays, and of all points with nothing uncertain where those are looked at,
    /// which are no proof that there is no longer one.
    pub worst: f64,
    /// Mean power in the coils, W.
    pub mean_power_w: f64,
}

/// The error that currents of one kind promise, and that of random displays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CurrentsError {
    /// By the quadratic form; `worst` is the longest of those that a search on the bounds, the random displays and all
    /// points with nothing uncertain have.
    pub promised: FeltError,
    /// Of random displays within the bounds; `worst` is the worst of them, at the points of the study alone.
    pub realised: FeltError,
}

/// A point of the trade-off between error and power.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TradeOff {
    /// The price of power at which both are least together, N^2/W.
    pub price_n2_per_w: f64,
    /// Mean power over the points, W.
    pub mean_power_w: f64,
    /// See [`FeltError`].
    pub expected: f64,
    /// See [`FeltError`].
    pub vertical: f64,
    /// See [`FeltError`].
    pub sideways: f64,
}

impl TradeOff {
    pub(super) fn at((price_n2_per_w, error): &(f64, FeltError)) -> Self {
        Self {
            price_n2_per_w: *price_n2_per_w,
            mean_power_w: error.mean_power_w,
            expected: error.expected,
            vertical: error.vertical,
            sideways: error.sideways,
        }
    }
}

/// Currents chosen for the uncertainties: of the least expected error for the power they may take, the upward one where
/// that alone is requested.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RobustSetting {
    /// The chosen price of power, N^2/W: with it a runtime finds the currents at any place.
    pub price_n2_per_w: f64,
    /// Their errors.
    pub error: CurrentsError,
    /// Error against power, the least power first.
    pub trade_off: Vec<TradeOff>,
    /// Static currents, A; absent where every point has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub currents_a: Option<Vec<f64>>,
}

/// A share of the requested force with each kind of currents.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Shares {
    /// With the static currents.
    #[serde(rename = "static")]
    pub fixed: f64,
    /// With feedback, currents of least power.
    pub feedback: f64,
    /// With feedback, currents chosen for the uncertainties.
    pub robust: f64,
}

/// The error that one uncertainty causes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CauseCost {
    /// Which.
    pub cause: Cause,
    /// Its bound: m, degrees, C or a share.
    pub bound: f64,
    /// The error that it adds alone: the root of the difference of squares with and without it.
    pub alone: Shares,
    /// By how much the expected error that currents are chosen for falls when its bound is half as large: the
    /// vector's, or the upward one where that alone is requested. Currents for the uncertainties are chosen again.
    pub halving_gains: Shares,
}

/// The felt error under uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Study {
    /// The bounds.
    pub given: Uncertainty,
    /// The force constant, N/m.
    pub lambda_n_per_m: f64,
    /// Points at which forces around them are looked at, evenly among all.
    pub points: usize,
    /// Random displays.
    pub draws: usize,
    /// The limit of the mean power, W; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power_cap_w: Option<f64>,
    /// The static currents.
    #[serde(rename = "static")]
    pub fixed: CurrentsError,
    /// Feedback, currents of least power.
    pub feedback: CurrentsError,
    /// Static currents chosen for the uncertainties.
    pub robust_static: RobustSetting,
    /// Feedback, currents chosen for the uncertainties.
    pub robust: RobustSetting,
    /// The expected errors of the same currents if nothing were uncertain.
    pub exact: Shares,
    /// By how much the expected errors may be off, being those of some points; of `robust`, which is of the points of
    /// the study alone, with what feedback at those is found to be off. Absent in files of programs without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampling: Option<Shares>,
    /// The error that each uncertainty causes, the one first whose halving gains most.
    pub causes: Vec<CauseCost>,
}
