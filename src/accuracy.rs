//! The error estimate that every stage reports beside its numbers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One stage's estimated error and how it was estimated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageAccuracy {
    /// Estimated error, relative to what `relative_to` names.
    pub estimate: f64,
    /// The quantity the estimate is relative to.
    pub relative_to: String,
    /// How the estimate was made: an a-priori bound, two resolutions, samples.
    pub method: String,
}
