//! `discretize`: a surface to its constraint points.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

use super::JobError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::bundle::atomic::{FileSet, Overwrite, WriteError};
use crate::bundle::json::to_json;
use crate::bundle::manifest::{AxisSummary, PointsGrid};
use crate::bundle::table::{PointRow, write_points};
use crate::progress::Progress;
use crate::shape::document::{ShapeDocument, SurfaceSource};
use crate::shape::{ConstraintPoints, Discretized, ShapeError, discretize};

/// The points and what is to be told about them.
#[derive(Debug, Clone)]
pub struct PointsReport {
    /// The points.
    pub discretized: Discretized,
    /// Figures, as the JSON summary tells them.
    pub summary: PointsSummary,
}

/// The JSON summary of `discretize`; SI.
#[derive(Debug, Clone, Serialize)]
pub struct PointsSummary {
    /// Layout of the artefact.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Name of the shape.
    pub shape: String,
    /// What went in.
    pub inputs: Vec<Input>,
    /// Number of points.
    pub points: usize,
    /// Grid points without surface, skipped.
    pub outside: usize,
    /// Lowest height, m.
    pub min_height_m: f64,
    /// Highest height, m.
    pub max_height_m: f64,
    /// Root mean square of the heights, m.
    pub rms_height_m: f64,
    /// The grid along x.
    pub grid_x_m: AxisSummary,
    /// The grid along y.
    pub grid_y_m: AxisSummary,
    /// Lower corner of the surface, m.
    pub bounds_min_m: [f64; 3],
    /// Upper corner of the surface, m.
    pub bounds_max_m: [f64; 3],
    /// Triangles read; absent for a primitive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub triangles: Option<usize>,
    /// Triangles without area, left out; absent for a primitive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub degenerate_triangles: Option<usize>,
    /// The stage's estimated error.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// What a careful person would mention.
    pub warnings: Vec<String>,
}

/// Discretises `document`. `inputs` holds the document's own entry, if it is a file; the surface's
/// is added.
///
/// # Errors
/// A surface that gives no points; interruption.
pub fn run(
    document: &ShapeDocument,
    inputs: Vec<Input>,
    progress: &dyn Progress,
) -> Result<PointsReport, JobError> {
    let inputs = with_surface(document, inputs)?;
    let discretized = discretize(document, progress).map_err(|source| match source {
        ShapeError::Interrupted(interrupted) => JobError::from(interrupted),
        source => JobError::Shape {
            name: document.name.clone(),
            source,
        },
    })?;
    let facts = discretized.points.facts();
    let summary = PointsSummary {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        shape: document.name.clone(),
        inputs,
        points: facts.points,
        outside: facts.outside,
        min_height_m: facts.min_height_m,
        max_height_m: facts.max_height_m,
        rms_height_m: facts.rms_height_m,
        grid_x_m: discretized.points.grid.x_m.into(),
        grid_y_m: discretized.points.grid.y_m.into(),
        bounds_min_m: discretized.bounds.min_m,
        bounds_max_m: discretized.bounds.max_m,
        triangles: discretized.mesh.as_ref().map(|mesh| mesh.triangles),
        degenerate_triangles: discretized.mesh.as_ref().map(|mesh| mesh.degenerate),
        accuracy: BTreeMap::from([("points", discretized.accuracy.clone())]),
        warnings: discretized.warnings.clone(),
    };
    Ok(PointsReport {
        discretized,
        summary,
    })
}

/// `inputs` and the surface file that `document` names, paths as given.
fn with_surface(document: &ShapeDocument, mut inputs: Vec<Input>) -> Result<Vec<Input>, JobError> {
    if let SurfaceSource::File { path, .. } = &document.source {
        // What cannot be read is told, with the reason, by the reader that comes next.
        if let Ok(bytes) = std::fs::read(path) {
            let input = Input::of_bytes(path.display().to_string(), &bytes);
            if !inputs.iter().any(|known| known.path == input.path) {
                inputs.push(input);
            }
        }
    }
    Ok(inputs)
}

/// The rows of `points.csv`.
#[must_use]
pub fn point_rows(points: &ConstraintPoints) -> Vec<PointRow> {
    (0..points.len())
        .map(|i| PointRow {
            x_m: points.x_m[i],
            y_m: points.y_m[i],
            height_m: points.height_m[i],
            normal: points.normal[i],
        })
        .collect()
}

/// The grid of the points as a manifest tells it.
#[must_use]
pub fn points_grid(points: &ConstraintPoints) -> PointsGrid {
    let present: Vec<bool> = points
        .row_of_grid_point()
        .iter()
        .map(Option::is_some)
        .collect();
    PointsGrid::new(points.grid.x_m, points.grid.y_m, &present)
}

impl PointsReport {
    /// Writes `points.csv`.
    ///
    /// # Errors
    /// The writer's.
    pub fn write_csv(&self, out: &mut dyn Write) -> io::Result<()> {
        write_points(out, &point_rows(&self.discretized.points))
    }

    /// Writes the points to `path` and the summary beside them, `points.csv` and `points.json`:
    /// both or none. What is there is replaced only with `force` or when its summary tells of
    /// the same inputs.
    ///
    /// # Errors
    /// [`JobError::Write`].
    pub fn write(&self, path: &Path, force: bool) -> Result<(), JobError> {
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let name = name.ok_or_else(|| {
            JobError::Input(format!(
                "{}: name a file to write the points to",
                path.display()
            ))
        })?;
        let summary = Path::new(&name)
            .with_extension("json")
            .to_string_lossy()
            .into_owned();
        if summary == name {
            return Err(JobError::Input(format!(
                "{}: the summary takes the ending .json; name the points otherwise",
                path.display()
            )));
        }
        let folder = match path.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let overwrite = Overwrite::new(force, folder.join(&summary), &self.summary.inputs);
        let mut set = FileSet::begin(folder, overwrite)?;
        set.write(&name, |out| self.write_csv(out))?;
        set.write(&summary, |out| {
            let json = to_json(&self.summary).map_err(io::Error::other)?;
            out.write_all(&json)
        })?;
        set.commit().map_err(|error: WriteError| error.into())
    }
}
