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
pub mod problem;
mod replay;
mod worst_point;

pub(super) use optimum::posed;

use super::effort::Pace;
use super::inputs::{
    AIR_ALL_LIMITS, AIR_COIL, BuiltIn, CORES, FLAT, LAMBDA, NLOPT, OPTIMUM_AIR, OPTIMUM_CORED,
    SEED, SEED_AIR,
};
use crate::file::{Curve, Row, StageCurves};
use fluxform::RunError;
use fluxform::accuracy::StageAccuracy;
use fluxform::bundle::artefact::Input;
use fluxform::field::winding::Winding;
use fluxform::progress::Progress;
use serde_json::{Value, json};

/// Result of a stage's measurement.
#[derive(Debug, Clone)]
pub struct Measured {
    /// The curves.
    pub curves: StageCurves,
    /// The error that the stage states by default.
    pub accuracy: StageAccuracy,
}

/// A stage: its name on the command line, what goes in, and how it is measured.
#[derive(Debug, Clone, Copy)]
pub struct Stage {
    /// On the command line.
    pub name: &'static str,
    inputs: &'static [BuiltIn],
    run: fn(&Pace, &dyn Progress) -> Result<Measured, RunError>,
}

impl Stage {
    /// Designs and reference values.
    #[must_use]
    pub fn inputs(&self) -> Vec<Input> {
        self.inputs.iter().map(BuiltIn::input).collect()
    }

    /// Measures it, on the threads of the caller.
    ///
    /// # Errors
    /// Those of the stage; interruption.
    pub fn run(&self, pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
        (self.run)(pace, progress)
    }
}

const fn named(
    name: &'static str,
    inputs: &'static [BuiltIn],
    run: fn(&Pace, &dyn Progress) -> Result<Measured, RunError>,
) -> Stage {
    Stage { name, inputs, run }
}

/// Every stage, in the order of a calibration.
pub const STAGES: [Stage; 11] = [
    named("air-field", &[SEED, AIR_COIL], air_field::run),
    named("inductance", &[SEED, AIR_COIL], inductance::run),
    named("cored-coil", &[SEED, CORES], cored_coil::run),
    named("coupled-array", &[SEED], coupled_array::run),
    named("map-table", &[SEED, SEED_AIR], map_table::run),
    named("height-map", &[], height_map::run),
    named("points-against-surface", &[], points::run),
    named("lambda-path", &[SEED_AIR, LAMBDA], lambda_path::run),
    named("worst-point", &[SEED_AIR], worst_point::run),
    named(
        "coil-optimum",
        &[OPTIMUM_AIR, AIR_ALL_LIMITS, OPTIMUM_CORED, NLOPT],
        optimum::run,
    ),
    named("replay", &[SEED_AIR, FLAT], replay::run),
];

/// A curve of this program.
fn curve(name: &str, knob: &str, reference: &str, reference_error: f64, rows: Vec<Row>) -> Curve {
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

/// The seed's design has a core; a copy that lost it is reported like a user's.
fn no_core() -> RunError {
    RunError::Input("the built-in design has no [core]".to_owned())
}

/// A winding for other programs.
fn section(winding: &Winding) -> Value {
    json!({
        "inner_radius_m": winding.inner_radius_m,
        "outer_radius_m": winding.outer_radius_m,
        "length_m": winding.length_m,
        "turns": winding.turns,
    })
}
