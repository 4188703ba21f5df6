//! `discretize --inspect`: the content of a surface file.

use std::path::Path;

use serde::Serialize;

use super::picture::{PictureData, Scale, picture};
use super::{ParsedBytes, shape_error};
use crate::RunError;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::numerics::axis::Axis;
use crate::plot::plane::PlanePlot;
use crate::progress::Progress;
use crate::shape::certificate::by_cell;
use crate::shape::document::{
    AxisRequest, GridRequest, Placement, ShapeDocument, SurfaceFormat, SurfaceSource,
};
use crate::shape::height::Grid;
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
}

/// Looks at the file at `path`; `inputs` holds the document that names it, if there is one.
///
/// # Errors
/// A file without a surface.
pub fn inspect(path: &Path, mut inputs: Vec<Input>) -> Result<Inspection, RunError> {
    let mut parsed = ParsedBytes::default();
    let surface = MeshReport::of_file_observed(path, &mut parsed)
        .map_err(|source| shape_error(&as_it_is(path, 1.0), source))?;
    parsed.add_to(&mut inputs, path);
    Ok(Inspection {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        inputs,
        surface,
    })
}

/// The surface as the file has it, from above; in millimetres where its unit is known.
///
/// # Errors
/// A file without a surface; interruption.
pub fn drawn(
    path: &Path,
    stated_m: Option<f64>,
    progress: &dyn Progress,
) -> Result<PlanePlot, RunError> {
    let carries = SurfaceFormat::of(path).is_some_and(SurfaceFormat::carries_unit);
    let scale = if carries || stated_m.is_some() {
        Scale::MILLIMETRES
    } else {
        Scale::FILE
    };
    let mut document = as_it_is(path, stated_m.unwrap_or(1.0));
    if let SurfaceSource::File { unit_m, .. } = &mut document.source
        && carries
    {
        *unit_m = stated_m;
    }
    let failed = |source: ShapeError| shape_error(&document, source);
    let (surface, _) = Surface::open(&document).map_err(failed)?;
    let [x_m, y_m] = surface.extent().plan().map(|[from, to]| Axis {
        from,
        to,
        samples: if to > from { PICTURE_POINTS } else { 1 },
    });
    let grid = Grid { x_m, y_m };
    let samples = surface.heights(&grid, progress).map_err(failed)?;
    let probe = Probe::new(&surface, &grid);
    let (x, y) = (grid.x_m.nodes(), grid.y_m.nodes());
    let at = |index: usize| probe.at([x[index % x.len()], y[index / x.len()]]);
    let marks: Vec<_> = (0..grid.len())
        .map(|index| at(index).map(|(_, marks)| marks))
        .collect();
    let heights: Vec<_> = samples.iter().map(|s| s.map(|s| s.height_m)).collect();
    // Where its effort is spent the picture is without bounds.
    let cells = by_cell(&surface, &grid, &samples, progress)?.unwrap_or_default();
    Ok(picture(&PictureData {
        title: document.name.clone(),
        scale,
        grid: &grid,
        heights: &heights,
        marks: &marks,
        cells: &cells,
    }))
}

/// The surface, nowhere placed.
fn as_it_is(path: &Path, unit_m: f64) -> ShapeDocument {
    let name = path.file_name().unwrap_or(path.as_os_str());
    let extent = AxisRequest::Extent(PICTURE_POINTS);
    ShapeDocument {
        name: name.to_string_lossy().into_owned(),
        source: SurfaceSource::File {
            path: path.to_owned(),
            unit_m: Some(unit_m),
        },
        scale: [1.0; 3],
        placement: Placement::default(),
        grid: GridRequest {
            x: extent,
            y: extent,
        },
    }
}
