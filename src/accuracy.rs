//! The error estimate that every stage reports beside its numbers, and how sure an optimum is.

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

/// How sure it is that no coil is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CertificateKind {
    /// The best near one starting point.
    Local,
    /// The best of several.
    Multistart,
    /// The best of every number of layers and turns, each with the best bore found.
    Exhaustive,
    /// Proven.
    Global,
}

impl CertificateKind {
    /// Of local searches alone, by their number.
    #[must_use]
    pub fn of_searches(starts: usize) -> Self {
        if starts == 1 {
            Self::Local
        } else {
            Self::Multistart
        }
    }

    /// The word in artefacts, tables and pages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Local => "local",
            Self::Multistart => "multistart",
            Self::Exhaustive => "exhaustive",
            Self::Global => "global",
        }
    }

    /// What the result is the best of.
    #[must_use]
    pub fn scope(self) -> &'static str {
        match self {
            Self::Local => "the best near one starting point",
            Self::Multistart => "the best of many starting points",
            Self::Exhaustive => {
                "exhaustive: the best of every number of layers and turns per layer, each with \
                 the best bore found"
            }
            Self::Global => "proven best",
        }
    }

    /// What remains open where no bound on the force is stated.
    #[must_use]
    pub fn open_question(self) -> &'static str {
        match self {
            Self::Local | Self::Multistart => "nothing is proven",
            Self::Exhaustive => "bores between those tried are not bounded",
            Self::Global => "no bound is stated",
        }
    }
}
