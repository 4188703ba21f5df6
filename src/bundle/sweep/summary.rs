//! The JSON file beside a merged sweep's table.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::artefact::{FileEntry, Input};

/// `sweep_merge.json` beside `sweep.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MergeSummary {
    /// Layout, `major.minor.patch`.
    pub schema_version: String,
    /// Program that wrote it.
    pub fluxform_version: String,
    /// Name of the design.
    pub design: String,
    /// The plan, then the plan's own inputs.
    pub inputs: Vec<Input>,
    /// Digest that the plan carries.
    pub plan_sha256: String,
    /// Designs of the plan.
    pub points: u64,
    /// Rows of the table.
    pub rows: u64,
    /// Points that were missing.
    pub missing: u64,
    /// Rows of designs that cannot be computed.
    pub failed: u64,
    /// Rows whose accuracy is not the one asked for.
    pub inaccurate: u64,
    /// Designs that meet all their limits.
    pub limits_met: u64,
    /// Whether the fronts are among those alone; where none meets them, among all.
    pub front_meets_limits: bool,
    /// Designs on a front.
    pub front: u64,
    /// The designs' largest force, N; absent where there is none.
    pub largest_force_n: Option<f64>,
    /// Table, plot and front.
    pub files: Vec<FileEntry>,
}
