//! Constraint points on no grid: graded to a deviation, or blue noise.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

use super::{MarkCounts, OpenedSurface, TableFiles, shape_error, table};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, FileEntry, Input, Options, SCHEMA_VERSION};
use crate::commands::made_with::{PointsAsked, surface};
use crate::progress::Progress;
use crate::scene::sources::Sampling;
use crate::shape::ShapeError;
use crate::shape::document::ShapeDocument;
use crate::shape::hidden::Hidden;
use crate::shape::point_flags::single_sheets;
use crate::shape::points::requested_grid;
use crate::shape::scattered::adaptive::{Grading, adaptive};
use crate::shape::scattered::poisson::poisson;
use crate::shape::scattered::{Probe, Scattered};

impl Sampling {
    /// As the record states them; `file` is the shape file's entry among the inputs.
    fn made_with(self, document: &ShapeDocument, file: Option<&Input>) -> Options {
        let (adaptive, poisson) = match self {
            Sampling::Adaptive {
                max_deviation_m,
                widest_m,
            } => (Some((max_deviation_m, widest_m)), None),
            Sampling::Poisson { spacing_m, seed } => (None, Some((spacing_m, seed))),
        };
        Options::of(&PointsAsked {
            max_deviation_m: adaptive.map(|(deviation_m, _)| deviation_m),
            widest_m: adaptive.and_then(|(_, widest_m)| widest_m),
            spacing_m: poisson.map(|(spacing_m, _)| spacing_m),
            seed: poisson.map(|(_, seed)| seed),
            surface: surface(document, file),
            ..PointsAsked::default()
        })
    }
}

/// Weighted points and their figures.
#[derive(Debug, Clone)]
pub struct ScatteredReport {
    /// The points.
    pub points: Scattered,
    /// The JSON result.
    pub summary: ScatteredSummary,
}

/// The JSON summary; SI.
#[derive(Debug, Clone, Serialize)]
pub struct ScatteredSummary {
    /// Layout of the artefact.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Name of the shape.
    pub shape: String,
    /// Input files.
    pub inputs: Vec<Input>,
    /// The options of the run.
    pub made_with: Options,
    /// `adaptive` or `poisson`.
    pub sampling: &'static str,
    /// Number of points.
    pub points: usize,
    /// Sum of the points' weights: the plan area of the surface, m^2.
    pub area_m2: f64,
    /// How many points are marked.
    pub marks: MarkCounts,
    /// Lowest height, m.
    pub min_height_m: f64,
    /// Highest height, m.
    pub max_height_m: f64,
    /// How much of the surface a height map cannot show; absent for a primitive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hidden: Option<Hidden>,
    /// Adaptive: bilinear patches within the deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patches: Option<usize>,
    /// Adaptive: patches at a rim or a jump, whose heights nothing bounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub border_patches: Option<usize>,
    /// Adaptive: the widest of these, m; 0 without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub border_width_m: Option<f64>,
    /// Poisson: no place of the surface lies farther from a point in plan, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cover_m: Option<f64>,
    /// `points` (rounding), and for adaptive points `patches`; `borders` where patches are at rims or jumps.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// The table beside it, as written.
    pub files: Vec<FileEntry>,
}

/// Chooses points on `document`'s surface over the region of its grid. `inputs` holds the
/// document's own entry, if it is a file; the surface's is added.
///
/// # Errors
/// A surface that gives no points; interruption.
pub fn run(
    document: &ShapeDocument,
    inputs: Vec<Input>,
    sampling: Sampling,
    progress: &dyn Progress,
) -> Result<ScatteredReport, RunError> {
    let made_with = sampling.made_with(document, inputs.first());
    let OpenedSurface {
        surface,
        mut warnings,
        inputs,
        ..
    } = OpenedSurface::new(document, inputs, progress)?;
    let failed = |source: ShapeError| shape_error(document, source);
    let grid = requested_grid(document, &surface).map_err(failed)?;
    let probe = Probe::new(&surface, &grid);
    let rounding_m = surface.height_rounding_m();
    let mut accuracy = BTreeMap::new();
    let (mut patches, mut border_patches, mut border_width_m) = (None, None, None);
    let mut cover_m = None;
    let (mut points, name) = match sampling {
        Sampling::Adaptive {
            max_deviation_m,
            widest_m,
        } => {
            let grading = Grading {
                max_deviation_m,
                widest_m: widest_m.unwrap_or(f64::INFINITY),
            };
            let found = adaptive(&probe, grading, progress).map_err(failed)?;
            (patches, border_patches) = (Some(found.leaves), Some(found.borders));
            border_width_m = Some(found.border_m);
            let method = "certified: the vertical difference between surface and bilinear patches, but \
                          for those at rims and jumps";
            accuracy.insert("patches", stage(found.vertical_m, method));
            if found.borders > 0 {
                let method = "known: the widest patch at a rim or a jump, so far in plan; heights there \
                              may be off by all of the jump";
                accuracy.insert("borders", stage(found.border_m, method));
            }
            (found.points, "adaptive")
        }
        Sampling::Poisson { spacing_m, seed } => {
            let found = poisson(&probe, spacing_m, seed, progress).map_err(failed)?;
            cover_m = Some(found.cover_m);
            (found.points, "poisson")
        }
    };
    let lowest_m = check_heights(&mut points, rounding_m).map_err(failed)?;
    let method =
        "a-priori: the file's coordinate rounding, in plan times the steepest slope at a point";
    let heights_m = surface.heights_rounding_m(&points.normal);
    accuracy.insert("points", stage(heights_m, method));
    let hidden = Hidden::of(&surface);
    warnings.extend(hidden.and_then(|hidden| hidden.warning()));
    warnings.extend(single_sheets(&points.marks));
    let summary = ScatteredSummary {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        shape: document.name.clone(),
        inputs,
        made_with,
        sampling: name,
        points: points.len(),
        area_m2: points.weight_m2.iter().sum(),
        marks: MarkCounts::of(&points.marks),
        min_height_m: lowest_m.max(0.0),
        max_height_m: points.height_m.iter().copied().fold(0.0, f64::max),
        hidden,
        patches,
        border_patches,
        border_width_m,
        cover_m,
        accuracy,
        warnings,
        files: Vec::new(),
    };
    Ok(ScatteredReport { points, summary })
}

/// An error in m.
fn stage(estimate: f64, method: &str) -> StageAccuracy {
    StageAccuracy {
        estimate,
        relative_to: "1 m".to_owned(),
        method: method.to_owned(),
    }
}

/// The lowest height as it was, m. Heights that are below zero by rounding become zero.
///
/// # Errors
/// No point, or one below zero.
fn check_heights(points: &mut Scattered, rounding_m: f64) -> Result<f64, ShapeError> {
    if points.is_empty() {
        let none = "no point of the surface lies in the region of its grid; change the \
                    translation, the unit or the grid";
        return Err(ShapeError::Document(none.to_owned()));
    }
    let lowest_m = points
        .height_m
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    if lowest_m < -rounding_m {
        let below = points.height_m.iter().filter(|h| **h < -rounding_m).count();
        return Err(ShapeError::BelowZero {
            below,
            points: points.len(),
            lowest_m,
        });
    }
    // A surface that rests on z = 0 may be rounded below it.
    points.height_m.iter_mut().for_each(|h| *h = h.max(0.0));
    Ok(lowest_m)
}

impl ScatteredReport {
    /// Writes the table of points.
    ///
    /// # Errors
    /// The writer's.
    pub fn write_csv(&self, out: &mut dyn Write) -> io::Result<()> {
        table::of_scattered(out, &self.points)
    }

    /// Writes the points to `path` and the summary beside them, as those of a grid.
    ///
    /// # Errors
    /// [`RunError::Write`].
    pub fn write(&mut self, path: &Path, force: bool) -> Result<(), RunError> {
        let files = TableFiles::new(path, force, &self.summary.inputs)?;
        let files = files.made_with(&self.summary.made_with);
        let (table, set) = files.table(|out| self.write_csv(out))?;
        self.summary.files = vec![table];
        files.summary(set, &self.summary)
    }
}
