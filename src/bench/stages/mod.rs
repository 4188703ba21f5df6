//! The numerical stages, one file each: the knob, the rows, the reference.

mod air_field;
mod cored_coil;
mod coupled_array;
mod height_map;
mod inductance;
mod lambda_path;
mod map_table;
mod optimum;
mod points;
mod replay;
mod worst_point;

pub(super) use optimum::posed;

use super::built_in::BuiltIn;
use super::pace::Pace;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::Input;
use crate::bundle::bench::{Curve, Row, StageCurves};
use crate::job::JobError;
use crate::progress::Progress;

/// What a stage's measurement gives.
#[derive(Debug, Clone)]
pub struct Measured {
    /// The curves.
    pub curves: StageCurves,
    /// What went in.
    pub inputs: Vec<Input>,
    /// What the stage says of its error by default.
    pub accuracy: StageAccuracy,
}

/// Measures one stage.
type Run = fn(&Pace, &dyn Progress) -> Result<Measured, JobError>;

/// Every stage by its name on the command line, in the order of a calibration.
pub const STAGES: [(&str, Run); 11] = [
    ("air-field", air_field::run),
    ("inductance", inductance::run),
    ("cored-coil", cored_coil::run),
    ("coupled-array", coupled_array::run),
    ("map-table", map_table::run),
    ("height-map", height_map::run),
    ("points-against-surface", points::run),
    ("lambda-path", lambda_path::run),
    ("worst-point", worst_point::run),
    ("coil-optimum", optimum::run),
    ("replay", replay::run),
];

/// A curve of this program.
fn curve(
    name: &str,
    knob: &str,
    reference: &str,
    reference_error: f64,
    rows: Vec<Row>,
) -> Curve {
    Curve {
        name: name.to_owned(),
        program: "fluxform".to_owned(),
        knob: knob.to_owned(),
        reference: reference.to_owned(),
        reference_error,
        rows,
    }
}

fn stage(estimate: f64, relative_to: &str, method: &str) -> StageAccuracy {
    StageAccuracy {
        estimate,
        relative_to: relative_to.to_owned(),
        method: method.to_owned(),
    }
}

fn inputs(files: &[BuiltIn]) -> Vec<Input> {
    files.iter().map(BuiltIn::input).collect()
}

/// The seed's design has a core; a copy that lost it is told like a user's.
fn no_core() -> JobError {
    JobError::Input("the built-in design has no [core]".to_owned())
}
