//! `discretize`: a surface to its constraint points.

use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::Serialize;

use super::made_with::{PointsAsked, surface};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{
    FLUXFORM_VERSION, FileEntry, Input, InputDigest, Options, SCHEMA_VERSION,
};
use crate::bundle::atomic::{FileSet, Overwrite};
use crate::bundle::manifest::{AxisSummary, PointsGrid};
use crate::bundle::seal::to_record;
use crate::bundle::table::PointRow;
use crate::plot::plane::PlanePlot;
use crate::point_weights::Weights;
use crate::progress::Progress;
use crate::scene::cached_field::ShapeField;
use crate::scene::tolerances::ErrorTarget;
use crate::shape::certificate::{Certificate, Certify, stated_tessellation};
use crate::shape::deviation::CERTIFY_SECONDS;
use crate::shape::document::{GridRequest, ShapeDocument, SurfaceSource};
use crate::shape::hidden::Hidden;
use crate::shape::holes::Holes;
use crate::shape::point_flags::{Marks, single_sheets};
use crate::shape::points::Known;
use crate::shape::surface::{ByteObserver, LARGEST_FILE, read_file};
use crate::shape::{
    ConstraintPoints, Discretized, Settings, ShapeError, Surface, discretize_surface,
};

pub(crate) mod between_points;
pub(crate) mod command;
pub(crate) mod fewest_points;
pub mod inspect;
mod inspect_command;
mod picture;
pub mod scattered;
mod table;

use between_points::between_points;
use fewest_points::fewest_points;
use picture::{PictureData, Scale};

/// The points of a grid and their figures.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct PointsReport {
    /// The points.
    pub discretized: Discretized,
    /// How the document says that they count.
    pub weights: Option<Weights>,
    /// Whether the grid was given, and no points are to be added to it.
    pub grid_is_given: bool,
    /// The JSON result.
    pub summary: PointsSummary,
}

/// The JSON summary of `discretize`; SI.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct PointsSummary {
    /// Layout of the artefact.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Name of the shape.
    pub shape: String,
    /// Input files.
    pub inputs: Vec<Input>,
    /// The options of the run.
    #[serde(skip_serializing_if = "Options::is_empty")]
    pub made_with: Options,
    /// Number of points.
    pub points: usize,
    /// How they count in lambda's mean; absent where all count alike.
    #[serde(skip_serializing_if = "Weights::is_equal")]
    pub weights: Weights,
    /// Grid points without surface, skipped.
    pub outside: usize,
    /// Of the grid points without surface those inside the silhouette, skipped or filled.
    pub holes: usize,
    /// How many points lie on a wall, a rim, a crease, or where sheets lie over each other.
    pub marks: MarkCounts,
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
    /// How much of the surface a height map cannot show; absent for a primitive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hidden: Option<Hidden>,
    /// How far the interpolated points may lie from the surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation: Option<DeviationSummary>,
    /// The outcome of a requested error; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requested: Option<RequestedHeights>,
    /// Each part of the heights' error: `points` (rounding), `grid`, `tessellation`.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// The table beside it, as written.
    pub files: Vec<FileEntry>,
}

/// How many points are marked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct MarkCounts {
    /// On a vertical wall.
    pub wall: usize,
    /// Where the surface ends.
    pub rim: usize,
    /// Where two faces meet at an angle.
    pub crease: usize,
    /// Where more sheets lie over each other than the two of a body.
    pub overhang: usize,
}

/// How far the bilinear interpolation between the points may lie from the surface; SI. Over the
/// cells of which all four corners are points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DeviationSummary {
    /// The most by which the surface lies above the interpolation, m.
    pub above_m: f64,
    /// Where, x and y, m.
    pub above_at_m: [f64; 2],
    /// The most by which it lies below, m.
    pub below_m: f64,
    /// Where, x and y, m.
    pub below_at_m: [f64; 2],
    /// The Hausdorff distance is at least this, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hausdorff_lower_m: Option<f64>,
    /// And at most this, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hausdorff_upper_m: Option<f64>,
    /// Where the lower value was found, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hausdorff_at_m: Option<[f64; 3]>,
    /// Cells with four points.
    pub cells: usize,
    /// Cells through which the silhouette passes; a runtime's force ends there.
    pub silhouette_cells: usize,
    /// So far in plan the silhouette is uncertain, m.
    pub silhouette_m: f64,
    /// Cells without a point that have surface all the same.
    pub missed_cells: usize,
    /// Grid, tessellation and rounding together, m.
    pub budget_m: f64,
}

impl MarkCounts {
    fn of(marks: &[Marks]) -> Self {
        let count = |kind: fn(&Marks) -> bool| marks.iter().filter(|m| kind(m)).count();
        Self {
            wall: count(|m| m.wall),
            rim: count(|m| m.rim),
            crease: count(|m| m.crease.is_some()),
            overhang: count(|m| m.overhang),
        }
    }
}

impl DeviationSummary {
    fn new(certificate: &Certificate) -> Option<Self> {
        let vertical = &certificate.vertical;
        // Without a cell of four points there is no deviation.
        (vertical.cells.inner > 0 && vertical.worst().value_m.is_finite()).then(|| {
            let apart = certificate.hausdorff;
            Self {
                above_m: vertical.above.value_m.max(0.0),
                above_at_m: vertical.above.at_m,
                below_m: vertical.below.value_m.max(0.0),
                below_at_m: vertical.below.at_m,
                hausdorff_lower_m: apart.map(|apart| apart.lower_m),
                hausdorff_upper_m: apart.map(|apart| apart.upper_m),
                hausdorff_at_m: apart.map(|apart| apart.at_m),
                cells: vertical.cells.inner,
                silhouette_cells: vertical.cells.silhouette,
                silhouette_m: certificate.silhouette_m,
                missed_cells: vertical.cells.missed,
                budget_m: certificate.budget_m(),
            }
        })
    }
}

/// The options of `discretize` for the points of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointsOptions {
    /// The treatment of holes.
    pub holes: Holes,
    /// How the points are compared with the surface.
    pub certify: Certify,
    /// Time that the certificate may take, s of one core about.
    pub certify_seconds: u64,
    /// Whether a picture will be drawn.
    pub picture: bool,
    /// Whether points are flagged, and the areas that they stand for are computed.
    pub marks: bool,
    /// How the points count, instead of what the document says.
    pub weights: Option<Weights>,
    /// The largest error of heights between the points, which are as few as hold it.
    pub error: Option<ErrorTarget>,
}

impl PointsOptions {
    /// As the record states them; `file` is the shape file's entry among the inputs.
    fn made_with(&self, document: &ShapeDocument, file: Option<&Input>) -> Options {
        let PointsOptions {
            holes,
            certify,
            certify_seconds,
            picture: _,
            marks: _,
            weights,
            error,
        } = *self;
        Options::of(&PointsAsked {
            weights,
            error: error.map(|target| target.error),
            refine: error.is_some_and(|target| target.refine),
            holes: Some(holes.name()),
            certify: Some(certify.name()),
            certify_seconds: (certify_seconds != CERTIFY_SECONDS).then_some(certify_seconds),
            surface: surface(document, file),
            ..PointsAsked::default()
        })
    }
}

impl Default for PointsOptions {
    fn default() -> Self {
        Self {
            holes: Holes::Skip,
            certify: Certify::Vertical,
            certify_seconds: CERTIFY_SECONDS,
            picture: false,
            marks: true,
            weights: None,
            error: None,
        }
    }
}

/// Discretises `document` as [`run_with`] does by default.
///
/// # Errors
/// As [`run_with`].
pub fn run(
    document: &ShapeDocument,
    inputs: Vec<Input>,
    progress: &dyn Progress,
) -> Result<PointsReport, RunError> {
    run_with(document, inputs, &PointsOptions::default(), progress)
}

/// Discretises `document`. `inputs` holds the document's own entry, if it is a file; the surface's
/// is added.
///
/// # Errors
/// A surface that gives no points; interruption.
pub fn run_with(
    document: &ShapeDocument,
    inputs: Vec<Input>,
    options: &PointsOptions,
    progress: &dyn Progress,
) -> Result<PointsReport, RunError> {
    let made_with = options.made_with(document, inputs.first());
    let opened = OpenedSurface::new(document, inputs, progress)?;
    let mut document = Cow::Borrowed(document);
    let chosen = options
        .error
        .filter(|target| target.refine || !document.grid_is_given);
    if let Some(target) = chosen {
        let (samples, _) = fewest_points(&document, target, progress, |tried| {
            let between = opened.between_points(tried, options, progress)?;
            Ok(between.map(|error| error / target.error))
        })?;
        document = Cow::Owned(document.with_samples(samples));
    }
    let mut report = opened.discretize(&document, options, None, progress)?;
    report.summary.made_with = made_with;
    if let Some(target) = options.error {
        report.state_requested(target, chosen.is_some());
    }
    Ok(report)
}

impl PointsReport {
    /// States what became of the requested error of heights between the points, with a warning where it is exceeded.
    fn state_requested(&mut self, target: ErrorTarget, chosen: bool) {
        let (between, jumps) = between_points(self);
        let found = between.map_or(0.0, |part| part.error);
        let met = found <= target.error;
        if !met {
            let advice = if chosen {
                "; the most points that are tried do not hold it; --max-deviation grades points"
            } else {
                "; the shape gives its points, which are obeyed (--refine chooses them)"
            };
            let of = "heights between the points are off by up to";
            self.summary
                .warnings
                .push(target.exceeded(of, found, advice));
        }
        self.summary.requested = Some(RequestedHeights {
            error: target.error,
            met,
            between_points: found,
            jumps,
        });
    }
}

/// The outcome of a requested error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RequestedHeights {
    /// Requested of heights between the points, relative to the lowest one of their cell that counts.
    pub error: f64,
    /// Whether it holds.
    pub met: bool,
    /// The error.
    pub between_points: f64,
    /// Share of the points at a jump, which no grid follows and the error leaves out; absent without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jumps: Option<f64>,
}

/// A document's surface, read, and the inputs with the digest of the bytes that were parsed.
pub(crate) struct OpenedSurface {
    surface: Surface,
    warnings: Vec<String>,
    inputs: Vec<Input>,
    /// The certificates of the last grids, which a search comes back to.
    certified: Mutex<VecDeque<(CertificateAsked, Certificate)>>,
}

/// The grid that is compared with the surface, and how.
type CertificateAsked = (GridRequest, Holes, Certify, u64);

/// Certificates that are held: a search ends with one of the last grids that it tries.
const CERTIFICATES_HELD: usize = 4;

impl OpenedSurface {
    /// Reads the surface that `document` names; `inputs` holds the document's own entry, if it is a
    /// file.
    ///
    /// # Errors
    /// A file without a surface.
    pub(crate) fn new(
        document: &ShapeDocument,
        mut inputs: Vec<Input>,
        progress: &dyn Progress,
    ) -> Result<Self, RunError> {
        let mut parsed = ParsedBytes::default();
        let (surface, warnings) = Surface::open_observed(document, &mut parsed, progress)
            .map_err(|source| shape_error(document, source))?;
        if let SurfaceSource::File { path, .. } = &document.source {
            parsed.add_to(&mut inputs, path);
        }
        Ok(Self {
            surface,
            warnings,
            inputs,
            certified: Mutex::default(),
        })
    }

    /// The document's own entry, if it is a file, and the surface's.
    pub(crate) fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    /// As [`Self::discretize`], flagged by `marks`, with what an earlier run cached for these points and this surface
    /// as `what`.
    ///
    /// # Errors
    /// As [`run_with`].
    pub(crate) fn discretize_cached(
        &self,
        (what, document, marks): (&str, &ShapeDocument, bool),
        field: ShapeField,
        progress: &dyn Progress,
    ) -> Result<PointsReport, RunError> {
        let cached = field.points(what, document, &self.inputs);
        let known: Option<Known> = cached.known();
        let complete = known
            .as_ref()
            .is_some_and(|known| known.certificate.is_some() && (known.marked.is_some() || !marks));
        let options = PointsOptions {
            marks,
            ..PointsOptions::default()
        };
        let report = self.discretize(document, &options, known, progress)?;
        if !complete {
            cached.keep(&report.discretized.known());
        }
        Ok(report)
    }

    /// The error of heights between the points of `document`, as [`between_points`] of its grid states it; `None` where
    /// no force is requested. Where the surface jumps no certificate decides it, and none is computed.
    ///
    /// # Errors
    /// As [`run_with`].
    pub(crate) fn between_points(
        &self,
        document: &ShapeDocument,
        options: &PointsOptions,
        progress: &dyn Progress,
    ) -> Result<Option<f64>, RunError> {
        let certified = PointsOptions {
            marks: false,
            ..*options
        };
        let heights_alone = PointsOptions {
            certify: Certify::No,
            ..certified
        };
        let estimated = self.discretize(document, &heights_alone, None, progress)?;
        let (mut part, jumps) = between_points(&estimated);
        if jumps.is_none() && certified.certify != Certify::No {
            let report = self.discretize(document, &certified, None, progress)?;
            part = between_points(&report).0;
        }
        Ok(part.map(|part| part.error))
    }

    /// The certificate of one of the last grids.
    fn certified_before(&self, asked: &CertificateAsked) -> Option<Certificate> {
        let held = self
            .certified
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let same = held.iter().find(|(of, _)| of == asked);
        same.map(|(_, certificate)| certificate.clone())
    }

    /// The points of `document`, whose grid alone may differ from that of the document that was opened.
    /// Those of a grid that was certified alike among the last few take that certificate.
    ///
    /// # Errors
    /// As [`run_with`].
    pub(crate) fn discretize(
        &self,
        document: &ShapeDocument,
        options: &PointsOptions,
        known: Option<Known>,
        progress: &dyn Progress,
    ) -> Result<PointsReport, RunError> {
        let asked = (
            document.grid,
            options.holes,
            options.certify,
            options.certify_seconds,
        );
        let mut known = known.unwrap_or_default();
        known.certificate = known.certificate.or_else(|| self.certified_before(&asked));
        let settings = Settings {
            holes: options.holes,
            certify: options.certify,
            certify_seconds: options.certify_seconds,
            known,
            marks: options.marks,
            cells: options.picture,
        };
        let surface = (&self.surface, self.warnings.clone());
        let discretized = discretize_surface(document, surface, &settings, progress)
            .map_err(|source| shape_error(document, source))?;
        if let Some(certificate) = &discretized.certificate {
            let mut held = self
                .certified
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            held.retain(|(of, _)| *of != asked);
            held.truncate(CERTIFICATES_HELD - 1);
            held.push_front((asked, certificate.clone()));
        }
        let mut report = report(document, self.inputs.clone(), discretized);
        if let Some(weights) = options.weights {
            report.weights = Some(weights);
            report.summary.weights = weights;
        }
        Ok(report)
    }
}

/// The digest of a surface file's bytes as they are parsed.
#[derive(Default)]
struct ParsedBytes(InputDigest);

impl ByteObserver for ParsedBytes {
    fn restart(&mut self) {
        self.0 = InputDigest::default();
    }

    fn observe(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }
}

impl ParsedBytes {
    /// Adds the file to `inputs`, unless it is among them.
    fn add_to(self, inputs: &mut Vec<Input>, path: &Path) {
        let input = self.0.input(path.display().to_string());
        if !inputs.iter().any(|known| known.path == input.path) {
            inputs.push(input);
        }
    }
}

/// The points and their figures.
fn report(document: &ShapeDocument, inputs: Vec<Input>, discretized: Discretized) -> PointsReport {
    let facts = discretized.points.facts();
    let mut accuracy = BTreeMap::from([("points", discretized.accuracy.clone())]);
    let mut warnings = discretized.warnings.clone();
    let mut deviation = None;
    let stated = discretized.mesh.as_ref().and_then(stated_tessellation);
    accuracy.extend(stated.map(|stage| ("tessellation", stage)));
    if let Some(certificate) = &discretized.certificate {
        deviation = DeviationSummary::new(certificate);
        if deviation.is_some() {
            accuracy.extend(certificate.stages());
        }
        let missed = certificate.vertical.cells.missed;
        if missed > 0 {
            warnings.push(format!(
                "{missed} cells of the grid have surface but no point: take more samples"
            ));
        }
    }
    if let (Some(reader), Some(stage)) = (&discretized.read_by, accuracy.get_mut("tessellation")) {
        stage.method = format!("{}; read by {reader}", stage.method);
    }
    warnings.extend(single_sheets(&discretized.points.marks));
    let summary = PointsSummary {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        shape: document.name.clone(),
        inputs,
        made_with: Options::default(),
        points: facts.points,
        weights: document.weights.unwrap_or_default(),
        outside: facts.outside,
        holes: discretized.points.holes,
        marks: MarkCounts::of(&discretized.points.marks),
        min_height_m: facts.min_height_m,
        max_height_m: facts.max_height_m,
        rms_height_m: facts.rms_height_m,
        grid_x_m: discretized.points.grid.x_m.into(),
        grid_y_m: discretized.points.grid.y_m.into(),
        bounds_min_m: discretized.bounds.min_m,
        bounds_max_m: discretized.bounds.max_m,
        triangles: discretized.mesh.as_ref().map(|mesh| mesh.triangles),
        degenerate_triangles: discretized.mesh.as_ref().map(|mesh| mesh.degenerate),
        hidden: discretized.hidden,
        deviation,
        requested: None,
        accuracy,
        warnings,
        files: Vec::new(),
    };
    PointsReport {
        discretized,
        weights: document.weights,
        grid_is_given: document.grid_is_given,
        summary,
    }
}

fn shape_error(document: &ShapeDocument, source: ShapeError) -> RunError {
    match source {
        ShapeError::Interrupted(interrupted) => RunError::from(interrupted),
        source => RunError::Shape {
            name: document.name.clone(),
            source,
        },
    }
}

/// `inputs` and the surface file that `document` names as it is now, paths as given: for what is
/// refused before the surface is parsed.
pub(crate) fn with_surface(document: &ShapeDocument, mut inputs: Vec<Input>) -> Vec<Input> {
    if let SurfaceSource::File { path, .. } = &document.source {
        // A file that cannot be read is reported, with the reason, by the reader that comes next.
        if let Ok(bytes) = read_file(path, LARGEST_FILE) {
            let mut digest = ParsedBytes::default();
            digest.observe(&bytes);
            digest.add_to(&mut inputs, path);
        }
    }
    inputs
}

/// The rows of `points.csv`.
#[must_use]
pub fn point_rows(points: &ConstraintPoints) -> Vec<PointRow> {
    (0..points.len()).map(|k| point_row(points, k)).collect()
}

fn point_row(points: &ConstraintPoints, k: usize) -> PointRow {
    PointRow {
        x_m: points.x_m[k],
        y_m: points.y_m[k],
        height_m: points.height_m[k],
        normal: points.normal[k],
    }
}

/// The grid of the points as a manifest states it, without graded points.
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
        table::of_grid(out, &self.discretized.points, self.summary.weights)
    }

    /// The points' heights and flags, and how far the surface departs between them.
    #[must_use]
    pub fn picture(&self) -> PlanePlot {
        let points = &self.discretized.points;
        let mut heights = vec![None; points.grid.len()];
        let mut marks = vec![None; points.grid.len()];
        for (row, &index) in points.grid_index.iter().enumerate() {
            heights[index] = Some(points.height_m[row]);
            marks[index] = Some(points.marks[row]);
        }
        picture::picture(&PictureData {
            title: format!("{}: constraint points", self.summary.shape),
            scale: Scale::MILLIMETRES,
            grid: &points.grid,
            heights: &heights,
            marks: &marks,
            cells: self.discretized.cells_m.as_deref().unwrap_or(&[]),
            over: None,
        })
    }

    /// Writes the points to `path` and the summary beside them, `points.csv` and `points.json`:
    /// both or none. Existing files are replaced only with `force` or when its summary is of the same
    /// inputs and lists it unchanged.
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

/// A table and its summary beside it, written both or none.
pub struct TableFiles {
    folder: PathBuf,
    name: String,
    summary: String,
    overwrite: Overwrite,
}

impl TableFiles {
    /// Those of the table at `path`, made from `inputs`.
    ///
    /// # Errors
    /// An invalid name, or one that ends as the summary does.
    pub fn new(path: &Path, force: bool, inputs: &[Input]) -> Result<Self, RunError> {
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let name = name.ok_or_else(|| {
            RunError::Input(format!(
                "{}: name a file to write the points to",
                path.display()
            ))
        })?;
        let summary = Path::new(&name)
            .with_extension("json")
            .to_string_lossy()
            .into_owned();
        if summary == name {
            return Err(RunError::Input(format!(
                "{}: the summary takes the ending .json; name the points otherwise",
                path.display()
            )));
        }
        let folder = match path.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        Ok(Self {
            overwrite: Overwrite::new(force, folder.join(&summary), inputs),
            folder: folder.to_path_buf(),
            name,
            summary,
        })
    }

    /// The options of the run.
    #[must_use]
    pub fn made_with(mut self, options: &Options) -> Self {
        self.overwrite = self.overwrite.made_with(options);
        self
    }

    /// Where they go.
    #[must_use]
    pub fn paths(&self) -> [PathBuf; 2] {
        [&self.name, &self.summary].map(|name| self.folder.join(name))
    }

    /// Refuses early when one of them must not be replaced.
    ///
    /// # Errors
    /// [`RunError::Write`].
    pub fn check(&self) -> Result<(), RunError> {
        for path in self.paths() {
            self.overwrite.check(&path)?;
        }
        Ok(())
    }

    fn table(
        &self,
        csv: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(FileEntry, FileSet), RunError> {
        let mut set = FileSet::begin(&self.folder, self.overwrite.clone());
        let written = set.write(&self.name, |out| csv(out))?;
        Ok((FileEntry::new(&self.name, written), set))
    }

    fn summary(&self, mut set: FileSet, summary: &impl Serialize) -> Result<(), RunError> {
        set.write(&self.summary, |out| {
            let json = to_record(summary).map_err(io::Error::other)?;
            out.write_all(&json)
        })?;
        Ok(set.commit()?)
    }
}
