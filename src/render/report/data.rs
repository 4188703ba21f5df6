//! The contents of a bundle's page, SI.

use fluxform_base::force_constant::{Criterion, NamedConstant};

use crate::plot::lambda::LambdaPlot;

use super::field::Field;
use super::measured::MeasuredCurve;
use super::surface::Surface;

/// A calibrated object.
#[derive(Debug, Clone, PartialEq)]
pub struct BundleFacts<'a> {
    /// Name of the design.
    pub design: &'a str,
    /// Name of the shape.
    pub shape: &'a str,
    /// Program that made it.
    pub version: &'a str,
    /// Path and digest of what went in.
    pub inputs: Vec<(&'a str, &'a str)>,
    /// How lambda was chosen, and its weight.
    pub criterion: Criterion,
    /// The relative error that `jnd` allows to be added.
    pub jnd: f64,
    /// At the chosen lambda, if there is one.
    pub chosen: Option<Chosen>,
    /// Rank of the force matrix.
    pub rank: usize,
    /// Number of constraint points.
    pub points: usize,
    /// The named constants and what each means.
    pub constants: Vec<NamedConstant>,
    /// The coils of the array.
    pub coils: Vec<CoilFacts>,
    /// Limit of the sum of the currents, A.
    pub total_max_a: Option<f64>,
    /// The design's limits.
    pub limits: Vec<LimitRow>,
    /// Limits that are not looked at here.
    pub unchecked: Vec<&'static str>,
    /// The points that decide the least largest error, and their shares.
    pub deciding: Vec<Deciding>,
    /// Each stage's estimated error.
    pub accuracy: Vec<StageFacts<'a>>,
    /// The errors that a force gathers on its way.
    pub budget: Vec<BudgetPart>,
    /// What was left out: what, why, what it costs.
    pub left_out: Vec<(&'a str, &'a str, f64)>,
    /// Where the path turns.
    pub breakpoints: Vec<Breakpoint<'a>>,
    /// Error and currents over lambda.
    pub curves: &'a LambdaPlot,
    /// Where the least largest error turns: lambda, N/m, and error, N.
    pub worst_turns: Vec<(f64, f64)>,
    /// The points as a surface.
    pub surface: Surface,
    /// Maps at a few heights.
    pub field: Field,
    /// Warnings for the user.
    pub warnings: &'a [String],
    /// The bundle's other files.
    pub files: Vec<&'a str>,
    /// Error against run time of the program, measured beforehand.
    pub error_time: Option<ErrorTime<'a>>,
}

/// The chosen force constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chosen {
    /// N/m.
    pub lambda_n_per_m: f64,
    /// Root mean square of the force error, N.
    pub rms_error_n: f64,
    /// Largest force error, N.
    pub worst_error_n: f64,
    /// The first over the rms force.
    pub relative_rms_error: Option<f64>,
    /// Bound on the error of the mean squared error, N^2.
    pub duality_gap_n2: f64,
    /// Where the force is most wrong.
    pub worst_at: Option<WorstPlace>,
}

/// The point whose force is most wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorstPlace {
    /// m.
    pub position_m: [f64; 3],
    /// N.
    pub wanted_n: f64,
    /// N.
    pub given_n: f64,
}

/// A coil of the array.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoilFacts {
    /// Its axis, m.
    pub axis_m: [f64; 2],
    /// Outer radius of its winding, m.
    pub radius_m: f64,
    /// At the chosen lambda, A.
    pub current_a: f64,
    /// A.
    pub min_a: f64,
    /// A.
    pub max_a: f64,
}

impl CoilFacts {
    /// Whether it carries all it may, either way.
    #[must_use]
    pub fn at_limit(&self) -> bool {
        self.current_a >= self.max_a || (self.current_a <= self.min_a && self.min_a < 0.0)
    }
}

/// A limit of the design beside the coil's value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitRow {
    /// Its name in artefacts, unit last.
    pub name: &'static str,
    /// The coil's value.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// Whether it is met.
    pub met: bool,
}

/// A point that decides the least largest error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deciding {
    /// m.
    pub position_m: [f64; 3],
    /// Its share of the proof, positive where the force is too weak.
    pub share: f64,
}

/// A stage's estimated error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageFacts<'a> {
    /// Its key in the manifest.
    pub name: &'a str,
    /// Relative to what `relative_to` names.
    pub estimate: f64,
    /// What that is.
    pub relative_to: &'a str,
    /// How it was made.
    pub method: &'a str,
}

/// A part of the error that a force gathers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BudgetPart {
    /// What adds it.
    pub name: &'static str,
    /// Relative to the force, as `basis` states.
    pub part: f64,
    /// How it follows from the stages' estimates.
    pub basis: &'static str,
}

/// A turn of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Breakpoint<'a> {
    /// N/m.
    pub lambda_n_per_m: f64,
    /// What happens.
    pub event: &'a str,
}

/// Error against run time, from a table that is shipped.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorTime<'a> {
    /// The curve of the computation that this run's accuracy costs most in; the row at this run's
    /// tolerance is marked.
    pub curve: MeasuredCurve<'a>,
    /// What is timed.
    pub timed: &'a str,
    /// What the errors are relative to.
    pub error_of: &'a str,
    /// The tolerance of this run.
    pub tolerance: f64,
    /// Program that was measured.
    pub version: &'a str,
    /// What it was measured on.
    pub machine: &'a str,
}
