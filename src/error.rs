//! Why a command gave no result, and its exit code.

use crate::bundle::atomic::WriteError;
use crate::bundle::load::BundleError;
use crate::field::winding::OnEdge;
use crate::lambda::ProblemError;
use crate::map::tabulate::MapError;
use crate::progress::Interrupted;
use crate::shape::ShapeError;

/// Why a job gave no result. Messages say what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
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
    /// An object that the array cannot render where it is.
    #[error("{0}")]
    Misplaced(String),
    /// There is a result, but not one to go on with.
    #[error("{0}")]
    Unmet(String),
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl From<MapError> for RunError {
    fn from(error: MapError) -> Self {
        match error {
            MapError::OnEdge(on_edge) => on_edge.into(),
            MapError::Interrupted(interrupted) => interrupted.into(),
        }
    }
}

impl RunError {
    /// The process's exit code: 3 a bad input, 4 an output that is not ours or cannot be
    /// written, 5 a bundle that fails its checks, 130 interrupted.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Interrupted(_) => 130,
            Self::Write(_)
            | Self::Sweep(_)
            | Self::NoForceConstant(_)
            | Self::Misplaced(_)
            | Self::Unmet(_) => 4,
            Self::Bundle(BundleError::NoBundle { .. } | BundleError::Schema { .. }) => 3,
            Self::Bundle(_) => 5,
            _ => 3,
        }
    }
}
