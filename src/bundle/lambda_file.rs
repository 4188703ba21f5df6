//! `lambda.json`, and what `fluxform lambda` prints.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::artefact::Input;
use super::headline::Headline;
use fluxform_base::accuracy::StageAccuracy;
use fluxform_base::force_direction::{ForceDirection, NormalForce};
use fluxform_base::heating::Heating;
use fluxform_base::point_weights::Weights;
use fluxform_lambda::feedback::Rendered;
pub use fluxform_lambda::sideways::Sideways;
pub use fluxform_lambda::two_fingers::TwoFingers;
pub use fluxform_lambda::uncertainty::{CurrentsError, RobustSetting, Study, TradeOff};
use fluxform_lambda::vector_feedback::VectorRendering;
pub use fluxform_lambda::vector_static::{VectorCurrents, VectorStatic};
use fluxform_lambda::worst::ActivePoint;
use fluxform_lambda::{Criterion, ForceConstants, GivenForce, Wiring};

/// The path of e*(lambda) and the constants read off it. `null` where a limit never binds or
/// nothing can be rendered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LambdaFile {
    /// Layout, `major.minor.patch`.
    pub schema_version: String,
    /// Program that wrote it.
    pub fluxform_version: String,
    /// Name of the design.
    pub design: String,
    /// Name of the shape.
    pub shape: String,
    /// Inputs, paths as given on the command line.
    pub inputs: Vec<Input>,
    /// Force constants that eq. 10 reads off the path.
    #[serde(flatten)]
    pub constants: ForceConstants,
    /// The one chosen, N/m.
    pub lambda_n_per_m: Option<f64>,
    /// How it was chosen.
    pub criterion: Criterion,
    /// The relative error that `jnd` allows to be added.
    pub jnd: f64,
    /// Static currents at the chosen lambda, A, one per coil of the array: those of the least mean
    /// square error; with `maxmin` currents that leave no point too weak.
    pub currents_a: Option<Vec<f64>>,
    /// Root mean square of the force error at the chosen lambda, N.
    pub rms_error_n: Option<f64>,
    /// Largest force error at the chosen lambda, N.
    pub worst_error_n: Option<f64>,
    /// RMS error over lambda times the RMS height.
    pub relative_rms_error: Option<f64>,
    /// Bound on the error of the mean squared force error, N^2.
    pub duality_gap_n2: Option<f64>,
    /// Rank of the force matrix.
    pub rank: usize,
    /// Number of constraint points.
    pub points: usize,
    /// How they count in the mean; absent where all count alike.
    #[serde(default, skip_serializing_if = "Weights::is_equal")]
    pub weights: Weights,
    /// Breakpoints, lambda ascending; between them the currents are linear in lambda.
    pub path: Vec<PathStep>,
    /// The same by the largest error at any point; absent in files of programs without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worst_point: Option<WorstPointFile>,
    /// The largest lambda whose errors are not felt at any point; absent in files of programs
    /// without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<TolerancePoint>,
    /// Coils broken or in series on request; absent when none are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wiring: Option<Wiring>,
    /// The same object with one change at a time, the first as given; absent when not requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variants: Option<Vec<LambdaVariant>>,
    /// The same object with position feedback, currents of their own at every point; absent when
    /// not requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedback: Option<FeedbackFile>,
    /// Currents and errors at the requested lambda with `--at`; absent when none was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<AtLambda>,
    /// Where the points are not the grid's: what that changes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampling: Option<SampledPoints>,
    /// Response of the steel at the chosen currents; with a B-H curve only, along which
    /// forces of several currents do not add up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub working_point: Option<WorkingPointForces>,
    /// How much of the requested force the chosen currents give; absent without any and in files of
    /// programs without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub given_force: Option<GivenForce>,
    /// The sideways force at the chosen lambda; absent without one and in files of programs without
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sideways: Option<Sideways>,
    /// The felt error under the uncertainties given; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Study>,
    /// How warm the coil of the largest current becomes while it flows; absent without a lambda and in
    /// files of programs without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hottest_coil: Option<Heating>,
    /// The headline; absent without a lambda and in files of older programs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub headline: Option<Headline>,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<String, StageAccuracy>,
}

/// Points on no grid, weighted by the area each stands for, against those of the grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SampledPoints {
    /// `adaptive` or `poisson`.
    pub sampling: String,
    /// Sum of the weights: the plan area of the surface, m^2.
    pub area_m2: f64,
    /// Points of the grid.
    pub grid_points: usize,
    /// Value on the grid's points, N/m.
    pub grid_lambda_linear_n_per_m: Option<f64>,
    /// Value on the grid's points, N/m.
    pub grid_lambda_jnd_n_per_m: Option<f64>,
    /// Value on the grid's points, N/m.
    pub grid_lambda_saturation_n_per_m: Option<f64>,
    /// The chosen one by the grid's points, N/m.
    pub grid_lambda_n_per_m: Option<f64>,
    /// The chosen lambda over that of the grid, less 1.
    pub relative_change: Option<f64>,
}

/// Rendering with position feedback: at every point the currents of least power that give the
/// requested force there. A pair in series counts as one coil.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FeedbackFile {
    /// The largest that every point can be given.
    #[serde(flatten)]
    pub largest: LargestGiven,
    /// The smallest that every point can be given, N/m: above zero only where a force without
    /// currents is too strong.
    pub smallest_lambda_n_per_m: f64,
    /// The static currents at the chosen lambda; null without one.
    pub without: Option<StaticRendering>,
    /// With feedback at the same lambda; null without one.
    pub at_chosen: Option<Rendered>,
    /// With feedback at its own largest lambda; null without one.
    pub at_largest: Option<Rendered>,
    /// The same demand above and below the surface; absent when not requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shell: Option<FeedbackShell>,
    /// Two fingers on the array at the chosen lambda; absent when not requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub two_fingers: Option<TwoFingers>,
    /// The force vector; absent where the upward force alone is requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vector: Option<VectorFeedbackFile>,
}

/// A force vector rendered with position feedback, beside what other currents make of the same request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct VectorFeedbackFile {
    /// Where the requested force points.
    pub direction: ForceDirection,
    /// How large a force along the normal is; absent for other directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_force: Option<NormalForce>,
    /// The largest at which every point gets its vector.
    #[serde(flatten)]
    pub largest: LargestGiven,
    /// The static currents at the chosen lambda; null without one, as the next two.
    #[serde(rename = "static")]
    pub fixed: Option<VectorRendering>,
    /// Static currents chosen for all three components; absent in files of programs without them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub static_vector: Option<VectorStatic>,
    /// Feedback of the upward part alone, at the chosen lambda.
    pub upward: Option<VectorRendering>,
    /// Feedback of all three components, at the chosen lambda.
    pub vector: Option<VectorRendering>,
    /// The same at its own largest lambda; null without one.
    pub at_largest: Option<VectorRendering>,
}

/// The largest force constant that all points can be given; a place between them may allow less.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LargestGiven {
    /// N/m; null where there is none above zero.
    pub lambda_n_per_m: Option<f64>,
    /// Why there is none; null where there is one.
    pub reason: Option<String>,
    /// Where it is decided.
    pub decided_at: Option<FeedbackPlace>,
}

/// A place that decides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FeedbackPlace {
    /// The point, a row of `points.csv` from 0.
    pub point: usize,
    /// Where the magnet's centre is, m.
    pub position_m: [f64; 3],
}

/// Static currents at the chosen lambda.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StaticRendering {
    /// N/m.
    pub lambda_n_per_m: f64,
    /// N.
    pub rms_error_n: f64,
    /// N.
    pub worst_error_n: f64,
    /// Largest |current| of any coil, A.
    pub largest_current_a: f64,
    /// Power in the coils, W.
    pub power_w: f64,
}

/// The demand lambda h(x, y) at places above and below the surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FeedbackShell {
    /// How far it reaches up and down, m.
    pub reach_m: f64,
    /// Layers, the surface in the middle.
    pub layers: usize,
    /// Distance of two layers, m.
    pub spacing_m: f64,
    /// No place is lower, m: the workspace's lowest, or the surface's.
    pub floor_m: f64,
    /// Places below that, looked at there instead.
    pub clipped: usize,
    /// Places in the layers.
    pub places: usize,
    /// Places between the layers, looked at where the largest force may fall there.
    #[serde(default)]
    pub places_between: usize,
    /// The largest that every place can be given.
    #[serde(flatten)]
    pub largest: LargestGiven,
    /// The smallest that every place can be given, N/m.
    pub smallest_lambda_n_per_m: f64,
    /// The largest by every second layer, N/m.
    pub every_second_lambda_n_per_m: Option<f64>,
}

/// The largest lambda up to which every point's error can be kept within
/// `max(share lambda h, threshold)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TolerancePoint {
    /// N/m; null where no force is requested, where any is tolerated, or where none can be kept.
    pub lambda_n_per_m: Option<f64>,
    /// The part of the requested force that is not felt: `jnd`.
    pub share: f64,
    /// The force that is not felt at all, N.
    pub threshold_n: f64,
    /// The point whose error takes up most of its tolerance, a row of `points.csv` from 0.
    pub point: Option<usize>,
    /// That part of its tolerance.
    pub part: Option<f64>,
    /// Currents that keep it, A, one per coil of the array.
    pub currents_a: Option<Vec<f64>>,
}

/// The force constants with one change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LambdaVariant {
    /// The change.
    pub name: String,
    /// Its wiring.
    #[serde(flatten)]
    pub wiring: Wiring,
    /// Whether the force without currents counts.
    pub passive_force: bool,
    /// Whether any coil may carry a negative current.
    pub pulls: bool,
    /// Force constants that eq. 10 reads off the path.
    #[serde(flatten)]
    pub constants: ForceConstants,
    /// N/m.
    pub worst_point_lambda_jnd_n_per_m: Option<f64>,
    /// The one chosen, N/m.
    pub lambda_n_per_m: Option<f64>,
    /// Its change relative to the chosen one as given.
    pub relative_change: Option<f64>,
    /// At the chosen lambda, A, one per coil of the array.
    pub currents_a: Option<Vec<f64>>,
    /// N.
    pub rms_error_n: Option<f64>,
    /// RMS error over lambda times the RMS height.
    pub relative_rms_error: Option<f64>,
    /// N.
    pub worst_error_n: Option<f64>,
    /// Power in the coils at the chosen lambda, W.
    pub power_w: Option<f64>,
}

/// Forces along the B-H curve at the chosen currents.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorkingPointForces {
    /// Largest difference from the sum of the coils' forces with which lambda was solved, at any
    /// point, relative to the largest force.
    pub deviation_from_linear: f64,
    /// Root mean square of the force error, N.
    pub rms_error_n: f64,
    /// Largest force error, N.
    pub worst_error_n: f64,
    /// Largest |B| in every core, T.
    pub peak_field_t: Vec<f64>,
    /// Mean |B| in every core, T.
    pub mean_field_t: Vec<f64>,
}

/// A breakpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PathStep {
    /// N/m.
    pub lambda_n_per_m: f64,
    /// A, one per coil of the array.
    pub currents_a: Vec<f64>,
    /// The event, such as "coil 4 meets its upper limit".
    pub event: String,
}

/// Currents and errors at a given lambda.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AtLambda {
    /// N/m.
    pub lambda_n_per_m: f64,
    /// A, one per coil of the array.
    pub currents_a: Vec<f64>,
    /// N.
    pub rms_error_n: f64,
    /// N.
    pub worst_error_n: f64,
    /// The least largest error at this lambda.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worst_point: Option<WorstPointAt>,
}

/// The path of t*(lambda), the least largest error at any point, and the constants read off it.
/// `null` where a limit never binds or nothing can be rendered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorstPointFile {
    /// Where the first limit binds, N/m.
    pub lambda_linear_n_per_m: Option<f64>,
    /// The largest lambda at which limits add less than a just-noticeable difference of the
    /// largest requested force to t*, N/m.
    pub lambda_jnd_n_per_m: Option<f64>,
    /// t* over lambda times the largest height, as long as no limit binds.
    pub relative_floor: Option<f64>,
    /// t* at the chosen lambda, N.
    pub worst_error_n: Option<f64>,
    /// The same over lambda times the largest height.
    pub relative_worst_error: Option<f64>,
    /// Currents at the chosen lambda, A, one per coil of the array.
    pub currents_a: Option<Vec<f64>>,
    /// Bound on the error of `worst_error_n`, N.
    pub gap_n: Option<f64>,
    /// The points that decide at the chosen lambda, and their shares of the proof.
    pub active: Option<Vec<ActivePoint>>,
    /// Where t* turns, lambda ascending; between them t* and the currents are linear in lambda.
    pub path: Vec<WorstPointStep>,
    /// Present and true where `path` is empty because it turns too often to be followed; the
    /// constants and currents hold all the same, but for a linear one that the error of t* hides: null.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub path_left_out: bool,
    /// Present and true where both constants are null because they could not be solved for; what holds at the chosen
    /// lambda does so to within `gap_n`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub constants_unknown: bool,
}

/// A turn of t*.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorstPointStep {
    /// N/m.
    pub lambda_n_per_m: f64,
    /// t*, N.
    pub worst_error_n: f64,
    /// A, one per coil of the array.
    pub currents_a: Vec<f64>,
    /// The points that decide from here on, rows of `points.csv` from 0.
    pub active_points: Vec<usize>,
    /// The event, such as "coil 4 meets its upper limit".
    pub event: String,
}

/// The least largest error at a given lambda.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorstPointAt {
    /// N.
    pub worst_error_n: f64,
    /// Proof of optimality: no currents within the limits are better by more than this, N.
    #[serde(default)]
    pub gap_n: Option<f64>,
    /// A, one per coil of the array.
    pub currents_a: Vec<f64>,
}
