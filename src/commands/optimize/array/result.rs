//! The result of `optimize --for`, SI: JSON, screen and tables are made of it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::physics::Constant;
use crate::bundle::artefact::Input;
use crate::coil::array_search::search::SearchedChoice;
use crate::coil::array_search::study::Study;
use crate::coil::limits::LimitCheck;
use crate::plot::array::ArrayPlot;

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
    /// The force constant that was made large.
    pub constant: Constant,
    /// How several shapes become one number.
    pub objective: &'static str,
    /// That number for the best array: force constants relative to the given design's.
    pub gain: f64,
    /// Every shape.
    pub shapes: Vec<ShapeGain>,
    /// The variables of the best array by key, in the key's unit.
    pub values: BTreeMap<String, f64>,
    /// The design's limits as `evaluate` has them, for the best array.
    pub limits: BTreeMap<&'static str, LimitCheck>,
    /// The same for the given design.
    pub limits_given: BTreeMap<&'static str, LimitCheck>,
    /// Whether `evaluate` finds every limit met.
    pub limits_met: bool,
    /// What surrounds the best array; absent where it was interrupted.
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

/// What the best array does for a shape.
#[derive(Debug, Clone, Serialize)]
pub struct ShapeGain {
    /// Its name.
    pub shape: String,
    /// Force constant of the given design, N/m.
    pub lambda_before_n_per_m: f64,
    /// That of the best array, N/m.
    pub lambda_n_per_m: f64,
    /// Their ratio.
    pub gain: f64,
}

/// What is known of how good the best array is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArrayCertificate {
    /// `multistart`: the best of several descents; nothing is proven.
    pub kind: &'static str,
    /// Descents that came to their end.
    pub starts: usize,
    /// The objective at the end of each.
    pub ends: Vec<f64>,
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
