//! What a command does, from documents to results and artefacts. No screens, no clocks.

pub mod at_current;
mod cached_field;
pub mod calibrate;
pub mod compare;
pub mod cost;
pub mod discretize;
pub mod evaluate;
mod evaluation_sample;
pub mod lambda;
pub mod made_with;
pub mod map;
pub mod maps;
pub mod neighbours;
pub mod optimize;
pub mod passive;
pub mod passive_map;
mod passive_table;
pub mod plan;
pub mod probe;
mod rated;
pub mod replay;
pub mod scan;
pub mod scene;
pub mod single;
pub mod steel;
pub mod sweep;
pub mod verify;
pub mod working_point;

use crate::bundle::atomic::WriteError;
use crate::bundle::load::BundleError;
use crate::field::winding::OnEdge;
use crate::lambda::ProblemError;
use crate::map::tabulate::MapError;
use crate::progress::Interrupted;
use crate::shape::ShapeError;

/// Relative error of the air coil's exact kernel, held by tests against 40-digit values.
pub const KERNEL_ERROR: f64 = 1e-12;

/// Why a job gave no result. Messages say what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// The design asks for physics that this version does not model.
    #[error("{0}")]
    NotModelled(String),
    /// Inputs that contradict each other.
    #[error("{0}")]
    Input(String),
    /// A point on a winding's edge.
    #[error(transparent)]
    OnEdge(#[from] OnEdge),
    /// The shape gives no points.
    #[error("shape {name:?}: {source}")]
    Shape {
        /// Name of the shape.
        name: String,
        /// Why.
        source: ShapeError,
    },
    /// The force problem cannot be stated.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// An artefact was not written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Results of a sweep that are missing or belong to another one.
    #[error("{0}")]
    Sweep(String),
    /// A bundle cannot be used.
    #[error(transparent)]
    Bundle(#[from] BundleError),
    /// A scan that does not determine what is to be fitted.
    #[error("{0}")]
    Scan(String),
    /// A bundle whose force constant is null.
    #[error("{0}")]
    NoForceConstant(String),
    /// There is a result, but not one to go on with.
    #[error("{0}")]
    Unmet(String),
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl From<MapError> for JobError {
    fn from(error: MapError) -> Self {
        match error {
            MapError::OnEdge(on_edge) => on_edge.into(),
            MapError::Interrupted(interrupted) => interrupted.into(),
        }
    }
}

impl JobError {
    /// The process's exit code: 3 a bad input, 4 an output that is not ours or cannot be
    /// written, 5 a bundle that fails its checks, 130 interrupted.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Interrupted(_) => 130,
            Self::Write(_) | Self::Sweep(_) | Self::NoForceConstant(_) | Self::Unmet(_) => 4,
            Self::Bundle(BundleError::NoBundle { .. } | BundleError::Schema { .. }) => 3,
            Self::Bundle(_) => 5,
            _ => 3,
        }
    }
}
