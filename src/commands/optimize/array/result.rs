//! The result of `optimize --for`, SI: JSON, screen and tables are made of it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::physics::Constant;
use crate::accuracy::CertificateKind;
use crate::bundle::artefact::Input;
use crate::coil::array_search::search::SearchedChoice;
use crate::coil::array_search::study::Study;
use crate::coil::limits::LimitCheck;
use crate::plot::array::ArrayPlot;
use crate::report::limits::label;

/// The result; all SI.
#[derive(Debug, Clone, Serialize)]
pub struct ArrayOptimization {
    /// Layout of the artefact.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Name of the design.
    pub design: String,
    /// The files it was made from.
    pub inputs: Vec<Input>,
    /// How it ended.
    pub status: ArrayEnding,
    /// The force constant that was made large, or the error.
    pub constant: Constant,
    /// The force constant at which the error was made small, N/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_n_per_m: Option<f64>,
    /// How several shapes become one number.
    pub objective: &'static str,
    /// That number for the best array: force constants relative to the given design's.
    pub gain: f64,
    /// Every shape.
    pub shapes: Vec<ShapeGain>,
    /// The variables of the best array by key, in the key's unit.
    pub values: BTreeMap<String, f64>,
    /// The design's limits as `evaluate` has them, for the best array, and the ends of `[search]` that it misses, in the
    /// unit of their key.
    pub limits: BTreeMap<&'static str, LimitCheck>,
    /// The same for the given design.
    pub limits_given: BTreeMap<&'static str, LimitCheck>,
    /// Whether all of these are met.
    pub limits_met: bool,
    /// The surroundings of the best array; absent where the run was interrupted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub study: Option<Study>,
    /// How sure it is.
    pub certificate: ArrayCertificate,
    /// How accurately force constants were computed.
    pub levels: Vec<LevelSummary>,
    /// Arrays that were computed.
    pub evaluations: usize,
    /// The best gain so far by the number of arrays computed, each time it grew, at the accuracy of the
    /// search and of the choice that was best.
    pub history: Vec<Improvement>,
    /// Choices of layout, magnet and core that were searched, the best first.
    pub choices: Vec<SearchedChoice>,
    /// Where the sequence of designs begins.
    pub seed: u64,
    /// The given array and the best one, as drawings.
    #[serde(skip)]
    pub drawn: [Option<ArrayPlot>; 2],
    /// The best design, TOML.
    #[serde(skip)]
    pub design_text: String,
    /// Warnings for the user.
    #[serde(skip)]
    pub warnings: Vec<String>,
}

impl ArrayOptimization {
    /// Names of the limits that the best array misses.
    #[must_use]
    pub fn missed(&self) -> Vec<String> {
        let missed = self.limits.iter().filter(|(_, check)| !check.met);
        missed.map(|(key, _)| label(key)).collect()
    }
}

/// A gain that was larger than all before it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Improvement {
    /// Arrays computed until then.
    pub evaluations: usize,
    /// The gain.
    pub gain: f64,
}

/// How a search of arrays ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ArrayEnding {
    /// Every descent came to its end, or the evaluations were used up.
    Done,
    /// No array that was computed meets every limit: the one that breaks them least.
    Infeasible,
    /// The user stopped it: the best so far, as accurately as the search knows it.
    Interrupted,
}

/// The best array's result for a shape.
#[derive(Debug, Clone, Serialize)]
pub struct ShapeGain {
    /// Its name.
    pub shape: String,
    /// Force constant of the given design, N/m; absent where an error is made small.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lambda_before_n_per_m: Option<f64>,
    /// That of the best array, N/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lambda_n_per_m: Option<f64>,
    /// Error of the given design, relative to the requested force, rms; absent where a force constant is made
    /// large.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_error_before: Option<f64>,
    /// That of the best array.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_error: Option<f64>,
    /// By what factor the constant is larger, or the error smaller.
    pub gain: f64,
}

/// The certificate of the best array.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArrayCertificate {
    /// The proof, or the search.
    pub kind: CertificateKind,
    /// Descents that came to their end.
    pub starts: usize,
    /// The objective at the end of each that meets every limit.
    pub ends: Vec<f64>,
    /// No array of the search gains more; null where nothing is proven.
    pub upper_bound: Option<f64>,
    /// The bound over the gain, less one.
    pub gap: Option<f64>,
    /// Arrays that were computed for the proof.
    pub cells: usize,
}

/// One level of accuracy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LevelSummary {
    /// `search` or `full`.
    pub level: &'static str,
    /// Tolerance of the forces.
    pub tolerance: f64,
    /// Points of all shapes.
    pub points: usize,
    /// Largest relative difference of a force constant from full accuracy, over given and best design.
    pub lambda_error: f64,
    /// The same of the ratio of the two, which the search compares.
    pub gain_error: f64,
}

impl ShapeGain {
    /// What is made large or small, of the given design and of the best array, each as text.
    #[must_use]
    pub fn written(&self, constant: fn(f64) -> String, share: fn(f64) -> String) -> [String; 2] {
        let one = |lambda: Option<f64>, error: Option<f64>| match (lambda, error) {
            (Some(lambda), _) => format!("{} N/m", constant(lambda)),
            (None, Some(error)) => share(error),
            (None, None) => String::new(),
        };
        [
            one(self.lambda_before_n_per_m, self.relative_error_before),
            one(self.lambda_n_per_m, self.relative_error),
        ]
    }
}
