//! A surface named directly on the command line, with its flags.

use std::path::{Path, PathBuf};

use super::unit_names;
use super::{AxisRequest, GridRequest, Placement, ShapeDocument, SurfaceSource};
use crate::bodies::BodyOptions;
use crate::format::SurfaceFormat;
use fluxform_base::force_direction::RequestedForce;
use fluxform_design::message_text::axis_fault;
use fluxform_numerics::axis::Axis;

/// A surface's options on the command line.
#[derive(Debug, Clone, PartialEq)]
pub struct RawSurface {
    /// The surface file.
    pub path: PathBuf,
    /// Metres per unit of the file's coordinates (see [`super::parse_unit`]); where the format
    /// carries its own, it must be the same.
    pub unit_m: Option<f64>,
    /// How bodies are cut into facets, and which of them.
    pub bodies: BodyOptions,
    /// Factors along the file's axes; positive.
    pub scale: [f64; 3],
    /// Rotation, then translation.
    pub placement: Placement,
    /// Samples along x and y.
    pub samples: [usize; 2],
    /// Whether a flag gives them.
    pub samples_are_given: bool,
    /// Ends along x, m; `None`: the surface's own extent.
    pub x_m: Option<[f64; 2]>,
    /// Ends along y, m; `None`: the surface's own extent.
    pub y_m: Option<[f64; 2]>,
}

/// Why a surface on the command line cannot be taken as it is: wrong usage.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RawSurfaceError {
    /// The format carries no unit and none was given.
    #[error("{}: this format carries no unit of length: add --unit ({})", path.display(), unit_names().join(", "))]
    UnitNeeded {
        /// The surface file.
        path: PathBuf,
    },
    /// The file's ending is none that is read.
    #[error(
        "{}: not a surface that is read: expected a shape file (.toml) or {}{}",
        path.display(),
        SurfaceFormat::endings(),
        SurfaceFormat::advice(path).map_or_else(String::new, |advice| format!("; {advice}"))
    )]
    UnknownFormat {
        /// The surface file.
        path: PathBuf,
    },
    /// A number that is not finite.
    #[error("{}: the placement and the unit must be finite numbers, the unit greater than 0", path.display())]
    NotFinite {
        /// The surface file.
        path: PathBuf,
    },
    /// An axis that runs backwards, or has no samples.
    #[error("{}: --{axis} with --grid: {fault} ({help})", path.display())]
    Axis {
        /// The surface file.
        path: PathBuf,
        /// `x` or `y`.
        axis: &'static str,
        /// The fault.
        fault: String,
        /// The advice.
        help: &'static str,
    },
    /// More points than any grid may have.
    #[error("{}: --grid asks for {} x {} points, at most {most} are taken", path.display(), samples[0], samples[1])]
    TooManyPoints {
        /// The surface file.
        path: PathBuf,
        /// Samples along x and y.
        samples: [usize; 2],
        /// The most.
        most: usize,
    },
}

impl ShapeDocument {
    /// A surface given directly; its name is its file's stem. Whether the file exists is for the
    /// reader of surfaces to say.
    ///
    /// # Errors
    /// Wrong usage: no unit for a format that carries none, an unknown ending, an axis that cannot be.
    pub fn raw(surface: &RawSurface) -> Result<Self, RawSurfaceError> {
        let path = surface.path.clone();
        let format = SurfaceFormat::of(&path);
        // The content of a file without an ending states its format once it is read.
        if format.is_none() && path.extension().is_some() {
            return Err(RawSurfaceError::UnknownFormat { path });
        }
        let unit_m = surface.unit_m;
        if unit_m.is_none() && format.is_some_and(|format| !format.carries_unit()) {
            return Err(RawSurfaceError::UnitNeeded { path });
        }
        let Placement {
            translate_m,
            rotate_deg,
            seat: _,
        } = surface.placement;
        let finite = [translate_m, rotate_deg]
            .iter()
            .flatten()
            .all(|v| v.is_finite());
        if !finite || !unit_m.is_none_or(|unit| unit.is_finite() && unit > 0.0) {
            return Err(RawSurfaceError::NotFinite { path });
        }
        Ok(Self {
            name: stem(&path),
            grid: grid(surface)?,
            source: SurfaceSource::File { path, unit_m },
            bodies: surface.bodies.clone(),
            scale: surface.scale,
            placement: surface.placement,
            force: RequestedForce::default(),
            weights: None,
            direction_jnd_deg: fluxform_base::units::DIRECTION_JND_DEG,
            grid_is_given: surface.samples_are_given,
        })
    }
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

fn grid(surface: &RawSurface) -> Result<GridRequest, RawSurfaceError> {
    let [nx, ny] = surface.samples;
    if nx
        .checked_mul(ny)
        .is_none_or(|points| points > super::read::POINTS_MAX)
    {
        return Err(RawSurfaceError::TooManyPoints {
            path: surface.path.clone(),
            samples: surface.samples,
            most: super::read::POINTS_MAX,
        });
    }
    Ok(GridRequest {
        x: axis(surface, "x", nx, surface.x_m)?,
        y: axis(surface, "y", ny, surface.y_m)?,
    })
}

fn axis(
    surface: &RawSurface,
    name: &'static str,
    samples: usize,
    ends: Option<[f64; 2]>,
) -> Result<AxisRequest, RawSurfaceError> {
    // An extent yet unknown is judged as one with two ends.
    let [from, to] = ends.unwrap_or([0.0, if samples == 1 { 0.0 } else { 1.0 }]);
    let asked = Axis { from, to, samples };
    let fault = if from.is_finite() && to.is_finite() {
        axis_fault(&asked, "m")
    } else {
        Some(("expected finite ends".to_owned(), "write FROM,TO"))
    };
    match (fault, ends) {
        (Some((fault, help)), _) => Err(RawSurfaceError::Axis {
            path: surface.path.clone(),
            axis: name,
            fault,
            help,
        }),
        (None, Some(_)) => Ok(AxisRequest::Given(asked)),
        (None, None) => Ok(AxisRequest::Extent(samples)),
    }
}
