//! `discretize --inspect`: the content of a surface file.

use std::path::Path;

use serde::Serialize;

use super::picture::{Outline, PictureData, Scale, picture};
use super::{ParsedBytes, shape_error};
use crate::RunError;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::design::Design;
use crate::force_direction::RequestedForce;
use crate::numerics::axis::Axis;
use crate::plot::plane::PlanePlot;
use crate::progress::Progress;
use crate::shape::bodies::BodyOptions;
use crate::shape::certificate::by_cell;
use crate::shape::deviation::CERTIFY_SECONDS;
use crate::shape::document::{
    AxisRequest, GridRequest, Placement, ShapeDocument, SurfaceFormat, SurfaceSource,
};
use crate::shape::file_mesh::Bounds;
use crate::shape::height::Grid;
use crate::shape::hidden::Hidden;
use crate::shape::scattered::Probe;
use crate::shape::{MeshReport, ShapeError, Surface};

/// Points along either side of the picture.
const PICTURE_POINTS: usize = 100;

/// The JSON of `discretize --inspect`.
#[derive(Debug, Clone, Serialize)]
pub struct Inspection {
    /// Layout of the artefact.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Input files.
    pub inputs: Vec<Input>,
    /// The content of the file; lengths in its own unit.
    pub surface: MeshReport,
    /// How much of it a height map cannot show.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hidden: Option<Hidden>,
    /// Where the surface lies; absent where nothing places it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub placed: Option<Placed>,
}

/// Where a placed surface lies, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Placed {
    /// Lower corner of its box.
    pub bounds_min_m: [f64; 3],
    /// Upper corner.
    pub bounds_max_m: [f64; 3],
    /// Lower corner of the design's workspace, where one was named.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub workspace_min_m: Option<[f64; 3]>,
    /// Upper corner.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub workspace_max_m: Option<[f64; 3]>,
    /// Whether the surface lies wholly in that workspace.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inside: Option<bool>,
}

/// The object inspected.
#[derive(Debug, Clone)]
pub struct Inspected {
    /// The surface, placed as it is drawn; of [`Inspected::bare`] as the file has it.
    pub document: ShapeDocument,
    /// The unit as stated; `None` without one.
    pub stated_m: Option<f64>,
    /// Whether something places it.
    pub placed: bool,
    /// The array that it is drawn over.
    pub over: Option<Box<Design>>,
}

impl Inspected {
    /// The file at `path` as it is.
    #[must_use]
    pub fn bare(path: &Path, stated_m: Option<f64>, bodies: BodyOptions) -> Self {
        let carries = SurfaceFormat::of(path).is_some_and(SurfaceFormat::carries_unit);
        let name = path.file_name().unwrap_or(path.as_os_str());
        let extent = AxisRequest::Extent(PICTURE_POINTS);
        Self {
            document: ShapeDocument {
                name: name.to_string_lossy().into_owned(),
                source: SurfaceSource::File {
                    path: path.to_owned(),
                    unit_m: if carries {
                        stated_m
                    } else {
                        Some(stated_m.unwrap_or(1.0))
                    },
                },
                bodies,
                scale: [1.0; 3],
                placement: Placement::default(),
                force: RequestedForce::default(),
                grid: GridRequest {
                    x: extent,
                    y: extent,
                },
                weights: None,
                direction_jnd_deg: crate::units::DIRECTION_JND_DEG,
                grid_is_given: true,
            },
            stated_m,
            placed: false,
            over: None,
        }
    }

    fn path(&self) -> &Path {
        match &self.document.source {
            SurfaceSource::File { path, .. } => path,
            SurfaceSource::Primitive(_) => Path::new(""),
        }
    }
}

/// Looks at a file; `inputs` holds the document that names it, if there is one. The picture shows
/// it from above, in millimetres where its unit is known.
///
/// # Errors
/// A file that is no surface; interruption.
pub fn inspect(
    inspected: &Inspected,
    mut inputs: Vec<Input>,
    draw: bool,
    progress: &dyn Progress,
) -> Result<(Inspection, Option<PlanePlot>), RunError> {
    let document = &inspected.document;
    let failed = |source: ShapeError| shape_error(document, source);
    let mut parsed = ParsedBytes::default();
    let report =
        MeshReport::of_file_observed(inspected.path(), &document.bodies, &mut parsed, progress)
            .map_err(failed)?;
    parsed.add_to(&mut inputs, inspected.path());
    // A mesh without area is no surface, and is reported as that.
    let surface = match Surface::open(document, progress) {
        Ok((surface, _)) => Some(surface),
        Err(error @ ShapeError::UnitDiffers { .. }) => return Err(failed(error)),
        Err(error) if draw || inspected.placed => return Err(failed(error)),
        Err(_) => None,
    };
    let plot = match &surface {
        Some(surface) if draw => Some(drawn(inspected, surface, progress)?),
        _ => None,
    };
    let bounds = surface.as_ref().map(Surface::extent);
    let inspection = Inspection {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        inputs,
        hidden: surface.as_ref().and_then(Hidden::of),
        placed: bounds
            .filter(|_| inspected.placed)
            .map(|bounds| placed(bounds, inspected.over.as_deref())),
        surface: report,
    };
    Ok((inspection, plot))
}

fn placed(bounds: Bounds, over: Option<&Design>) -> Placed {
    let ends = over.map(|design| {
        let workspace = &design.workspace;
        [workspace.x_m, workspace.y_m, workspace.z_m].map(|axis| [axis.from, axis.to])
    });
    let rounding_m = 1e-9;
    let within = |ends: &[[f64; 2]; 3]| {
        (0..3).all(|k| {
            bounds.min_m[k] >= ends[k][0] - rounding_m && bounds.max_m[k] <= ends[k][1] + rounding_m
        })
    };
    Placed {
        bounds_min_m: bounds.min_m,
        bounds_max_m: bounds.max_m,
        workspace_min_m: ends.map(|ends| ends.map(|[from, _]| from)),
        workspace_max_m: ends.map(|ends| ends.map(|[_, to]| to)),
        inside: ends.as_ref().map(within),
    }
}

fn drawn(
    inspected: &Inspected,
    surface: &Surface,
    progress: &dyn Progress,
) -> Result<PlanePlot, RunError> {
    let document = &inspected.document;
    let carries = SurfaceFormat::of(inspected.path()).is_some_and(SurfaceFormat::carries_unit);
    let scale = if carries || inspected.stated_m.is_some() {
        Scale::MILLIMETRES
    } else {
        Scale::FILE
    };
    let [x_m, y_m] = surface.extent().plan().map(|[from, to]| Axis {
        from,
        to,
        samples: if to > from { PICTURE_POINTS } else { 1 },
    });
    let grid = Grid { x_m, y_m };
    let samples = surface
        .heights(&grid, progress)
        .map_err(|source| shape_error(document, source))?;
    let probe = Probe::new(surface, &grid);
    let (x, y) = (grid.x_m.nodes(), grid.y_m.nodes());
    let at = |index: usize| probe.at([x[index % x.len()], y[index / x.len()]]);
    let marks: Vec<_> = (0..grid.len())
        .map(|index| at(index).map(|(_, marks)| marks))
        .collect();
    let heights: Vec<_> = samples.iter().map(|s| s.map(|s| s.height_m)).collect();
    // Where its effort is spent the picture is without bounds.
    let cells = by_cell(surface, &grid, &samples, CERTIFY_SECONDS, progress)?.unwrap_or_default();
    Ok(picture(&PictureData {
        title: document.name.clone(),
        scale,
        grid: &grid,
        heights: &heights,
        marks: &marks,
        cells: &cells,
        over: inspected.over.as_deref().map(Outline::of),
    }))
}
