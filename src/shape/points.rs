//! From a shape document to its constraint points (eq. 6): (x_j, y_j, h_j), x fastest, then y.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::certificate::{Certificate, Certify, by_cell, certify, stated_tessellation};
use crate::deviation::CERTIFY_SECONDS;
use crate::document::{AxisRequest, ShapeDocument};
use crate::error::ShapeError;
use crate::file_mesh::Bounds;
use crate::height::{Grid, Sample};
use crate::hidden::Hidden;
use crate::holes::{self, Holes};
use crate::memory::{self, POINT_BYTES};
use crate::mesh::MeshFacts;
use crate::point_areas::{FineCells, Over, areas_m2};
use crate::point_flags::Marks;
use crate::scattered::Probe;
use crate::surface::Surface;
use fluxform_base::accuracy::StageAccuracy;
use fluxform_base::progress::{Interrupted, Progress};
use fluxform_numerics::axis::Axis;

/// More grid points than this are refused: their files and matrices fit no computer.
const MOST_POINTS: usize = 100_000_000;
/// Grids of more points than this are not compared with their surface: it would take minutes.
const MOST_CERTIFIED: usize = 4_000_000;
/// Points marked between two looks at the progress.
const MARKED_BETWEEN_LOOKS: usize = 4096;

/// The points of a grid that lie on the surface, m; columns of equal length.
#[derive(Debug, Clone, PartialEq)]
pub struct ConstraintPoints {
    /// The grid they were taken from.
    pub grid: Grid,
    /// x of each point.
    pub x_m: Vec<f64>,
    /// y of each point.
    pub y_m: Vec<f64>,
    /// Height of each point above z = 0, never negative.
    pub height_m: Vec<f64>,
    /// Unit normal of each point, n_z >= 0.
    pub normal: Vec<[f64; 3]>,
    /// Each point's place in the grid: row * columns + column; ascending.
    pub grid_index: Vec<usize>,
    /// Flags of each point.
    pub marks: Vec<Marks>,
    /// Plan area that each point stands for, m^2; empty where points are not marked.
    pub area_m2: Vec<f64>,
    /// Cells that the points describe badly, sampled finely; none where points are not marked.
    pub fine: FineCells,
    /// Grid points without surface, skipped.
    pub outside: usize,
    /// Of the grid points without surface those that lie inside the silhouette, skipped or filled.
    pub holes: usize,
}

/// Figures that sum the points up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointFacts {
    /// Number of points.
    pub points: usize,
    /// Grid points without surface.
    pub outside: usize,
    /// Lowest height, m.
    pub min_height_m: f64,
    /// Highest height, m.
    pub max_height_m: f64,
    /// Root mean square of the heights, m.
    pub rms_height_m: f64,
}

impl ConstraintPoints {
    /// Number of points, at least 1 when made by [`discretize`].
    #[must_use]
    pub fn len(&self) -> usize {
        self.height_m.len()
    }

    /// True without points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.height_m.is_empty()
    }

    /// For every grid point, x fastest, its row among the points.
    #[must_use]
    pub fn row_of_grid_point(&self) -> Vec<Option<usize>> {
        let mut rows = vec![None; self.grid.len()];
        for (row, index) in self.grid_index.iter().enumerate() {
            rows[*index] = Some(row);
        }
        rows
    }

    /// Counts and heights.
    #[must_use]
    pub fn facts(&self) -> PointFacts {
        let fold =
            |start, pick: fn(f64, f64) -> f64| self.height_m.iter().copied().fold(start, pick);
        let max_height_m = fold(f64::NEG_INFINITY, f64::max);
        // In one order on any number of threads; scaled, so that no square underflows.
        let scale = if max_height_m > 0.0 {
            max_height_m
        } else {
            1.0
        };
        let squares: f64 = self
            .height_m
            .iter()
            .map(|h| (h / scale) * (h / scale))
            .sum();
        PointFacts {
            points: self.len(),
            outside: self.outside,
            min_height_m: fold(f64::INFINITY, f64::min),
            max_height_m,
            rms_height_m: scale * (squares / self.len() as f64).sqrt(),
        }
    }
}

/// Result of discretising a document.
#[derive(Debug, Clone, PartialEq)]
pub struct Discretized {
    /// The constraint points.
    pub points: ConstraintPoints,
    /// The surface's own box, placed, m.
    pub bounds: Bounds,
    /// Contents of the mesh file; `None` for a primitive.
    pub mesh: Option<MeshFacts>,
    /// Another program that made the mesh file's triangles, with its version.
    pub read_by: Option<String>,
    /// The stage's error, absolute, m.
    pub accuracy: StageAccuracy,
    /// How far the interpolated points may lie from the surface, where it was requested.
    pub certificate: Option<Certificate>,
    /// A bound of the vertical difference for every cell, m, where it was requested; `None` where
    /// a corner has no surface.
    pub cells_m: Option<Vec<Option<f64>>>,
    /// How much of the surface a height map cannot show; `None` for a formula and where points are
    /// not marked.
    pub hidden: Option<Hidden>,
    /// Warnings.
    pub warnings: Vec<String>,
}

impl Discretized {
    /// What another run on the same points and surface need not compute.
    #[must_use]
    pub fn known(&self) -> Known {
        let points = &self.points;
        Known {
            certificate: self.certificate.clone(),
            marked: (!points.area_m2.is_empty()).then(|| Marked {
                marks: points.marks.clone(),
                area_m2: points.area_m2.clone(),
                fine: points.fine.clone(),
                hidden: self.hidden,
            }),
        }
    }
}

/// What is dear to compute of points and their surface, as far as it was computed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// As [`Discretized::certificate`].
    pub certificate: Option<Certificate>,
    /// Flags, areas and what is hidden.
    pub marked: Option<Marked>,
}

/// Flags and areas of all points, as [`ConstraintPoints`] has them, and how much of the surface is hidden.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Marked {
    marks: Vec<Marks>,
    area_m2: Vec<f64>,
    fine: FineCells,
    hidden: Option<Hidden>,
}

/// Options of discretising.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Grid points without surface inside the silhouette.
    pub holes: Holes,
    /// How the points are compared with the surface.
    pub certify: Certify,
    /// Time that it may take, s of one core about; counted, so that every machine stops at the same place.
    pub certify_seconds: u64,
    /// Results of an earlier run for these points and this surface; they are not computed again.
    pub known: Known,
    /// Whether walls, rims, creases, overhangs and the points' areas are looked for.
    pub marks: bool,
    /// Whether the vertical difference is reported for every cell.
    pub cells: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            holes: Holes::default(),
            certify: Certify::default(),
            certify_seconds: CERTIFY_SECONDS,
            known: Known::default(),
            marks: false,
            cells: false,
        }
    }
}

/// Opens the document's surface, places it and samples it over the requested grid.
///
/// # Errors
/// [`ShapeError`]: an unreadable or damaged file, no unit, a grid that does not ascend, a surface
/// outside the grid, no point at all, points below z = 0, an interruption.
pub fn discretize(
    document: &ShapeDocument,
    progress: &dyn Progress,
) -> Result<Discretized, ShapeError> {
    discretize_with(document, &Settings::default(), progress)
}

/// The region that a document asks for, as a grid on its surface.
///
/// # Errors
/// [`ShapeError::Document`] for axes that do not ascend or have too many points, or more than memory is granted for.
pub fn requested_grid(document: &ShapeDocument, surface: &Surface) -> Result<Grid, ShapeError> {
    let [x, y] = surface.extent().plan();
    let grid = Grid {
        x_m: axis("x", document.grid.x, x)?,
        y_m: axis("y", document.grid.y, y)?,
    };
    let count = grid.x_m.samples.saturating_mul(grid.y_m.samples);
    if count > MOST_POINTS {
        return Err(ShapeError::Document(format!(
            "a grid of {} x {} samples has {count} points; at most {MOST_POINTS} are possible",
            grid.x_m.samples, grid.y_m.samples
        )));
    }
    let what = format_args!(
        "the surface and {} x {} points",
        grid.x_m.samples, grid.y_m.samples
    );
    let advice = "ask for fewer points, or for a larger error";
    let bytes = surface.held_bytes() + POINT_BYTES * count as f64;
    memory::within(bytes, what, advice).map_err(ShapeError::Document)?;
    Ok(grid)
}

/// [`discretize`] with holes, marks and a certificate as requested.
///
/// # Errors
/// As [`discretize`]; [`ShapeError::Document`] for holes where they are refused.
pub fn discretize_with(
    document: &ShapeDocument,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Discretized, ShapeError> {
    let (surface, warnings) = Surface::open(document, progress)?;
    discretize_surface(document, (&surface, warnings), settings, progress)
}

/// As [`discretize_with`], for a surface that was opened before, with its warnings.
///
/// # Errors
/// As [`discretize_with`].
pub fn discretize_surface(
    document: &ShapeDocument,
    (surface, mut warnings): (&Surface, Vec<String>),
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Discretized, ShapeError> {
    progress.check()?;
    let grid = requested_grid(document, surface)?;
    let mut samples = surface.heights(&grid, progress)?;
    let found = holes::holes(&grid, &samples);
    if !found.is_empty() {
        warnings.push(treat_holes(settings.holes, &grid, &mut samples, &found)?);
    }
    let rounding_m = surface.height_rounding_m();
    let mut points = collect(&grid, &samples, rounding_m, &surface.extent())?;
    points.holes = found.len();
    let hidden = if settings.marks {
        add_marks(
            &mut points,
            surface,
            settings.known.marked.as_ref(),
            &found,
            progress,
        )?
    } else {
        None
    };
    warnings.extend(hidden.and_then(|hidden| hidden.warning()));
    let certificate = certified(surface, &grid, &samples, settings, &mut warnings, progress)?;
    let cells_m = if settings.cells && grid.len() <= MOST_CERTIFIED {
        by_cell(surface, &grid, &samples, settings.certify_seconds, progress)?
    } else {
        None
    };
    let (mesh, read_by, method) = match surface {
        Surface::Mesh(mesh) => (
            Some(*mesh.facts()),
            mesh.read_by().map(str::to_owned),
            if stated_tessellation(mesh.facts()).is_some() {
                "a-priori: the file's coordinate rounding, in plan times the steepest slope at a point (exact \
                 heights of its triangles)"
            } else {
                "a-priori: the file's coordinate rounding, in plan times the steepest slope at a point (exact \
                 heights of its triangles; the tessellation's own deviation is not in the file)"
            },
        ),
        Surface::Primitive(_) => (None, None, "a-priori: a closed formula in double precision"),
    };
    let accuracy = StageAccuracy {
        estimate: surface.heights_rounding_m(&points.normal),
        relative_to: "1 m".into(),
        method: method.into(),
    };
    Ok(Discretized {
        points,
        bounds: surface.extent(),
        mesh,
        read_by,
        accuracy,
        certificate,
        cells_m,
        hidden,
        warnings,
    })
}

/// Refuses the holes at the grid indices `found`, leaves them or fills them, and says so.
fn treat_holes(
    how: Holes,
    grid: &Grid,
    samples: &mut [Option<Sample>],
    found: &[usize],
) -> Result<String, ShapeError> {
    let [x_mm, y_mm] = [
        grid.x_m.node(found[0] % grid.x_m.samples) * 1000.0,
        grid.y_m.node(found[0] / grid.x_m.samples) * 1000.0,
    ];
    let what = format!(
        "{} grid points inside the silhouette have no surface, the first at ({x_mm:.6}, \
         {y_mm:.6}) mm",
        found.len()
    );
    match how {
        Holes::Error => Err(ShapeError::Document(format!(
            "{what}; mend the surface, or choose --holes skip or --holes fill"
        ))),
        Holes::Skip => Ok(format!("{what}: they give no points")),
        Holes::Fill => {
            holes::fill(grid, samples, found);
            Ok(format!("{what}: heights were filled in from around them"))
        }
    }
}

/// Adds flags, areas and finer points, those of `known` where they were computed before; the area that no
/// height map shows.
fn add_marks(
    points: &mut ConstraintPoints,
    surface: &Surface,
    known: Option<&Marked>,
    found: &[usize],
    progress: &dyn Progress,
) -> Result<Option<Hidden>, ShapeError> {
    if let Some(known) = known {
        points.marks.clone_from(&known.marks);
        points.area_m2.clone_from(&known.area_m2);
        points.fine = known.fine.clone();
        return Ok(known.hidden);
    }
    let probe = Probe::new(surface, &points.grid);
    mark(points, &probe, found, progress)?;
    (points.area_m2, points.fine) = point_areas_m2(points, &probe, progress)?;
    Ok(Hidden::of(surface))
}

/// The certificate that `settings` request, where the grid and the effort allow it.
fn certified(
    surface: &Surface,
    grid: &Grid,
    samples: &[Option<Sample>],
    settings: &Settings,
    warnings: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<Option<Certificate>, ShapeError> {
    if settings.certify == Certify::No {
        return Ok(None);
    }
    if grid.len() > MOST_CERTIFIED {
        warnings.push(format!(
            "the grid has more than {MOST_CERTIFIED} points: how far it departs from the surface \
             between them is not computed"
        ));
        return Ok(None);
    }
    let (how, seconds) = (settings.certify, settings.certify_seconds);
    let certificate = match &settings.known.certificate {
        Some(known) => Some(known.clone()),
        None => certify(surface, grid, samples, how, seconds, progress)?,
    };
    if how == Certify::Distance && matches!(surface, Surface::Primitive(_)) {
        warnings.push(
            "the Hausdorff distance is computed of files alone, and this surface is a formula: the vertical \
             difference is certified, the distance is not; give the surface as a mesh file for --certify distance"
                .into(),
        );
    }
    if certificate.is_none() {
        warnings.push(
            "the effort of a certificate is spent: so many triangles lie over each other that how \
             far the points depart from the surface between them is not computed; the heights are \
             exact all the same (--certify-seconds grants more; or repair or coarsen the mesh)"
                .into(),
        );
    }
    Ok(certificate)
}

/// Finds the flags of each point; `filled` holds grid indices, ascending.
fn mark(
    points: &mut ConstraintPoints,
    probe: &Probe<'_>,
    filled: &[usize],
    progress: &dyn Progress,
) -> Result<(), ShapeError> {
    let places = (0..points.len()).into_par_iter();
    let marks: Result<Vec<Marks>, Interrupted> = places
        .with_min_len(fluxform_base::progress::items_a_task(points.len()))
        .map(|row| {
            if row % MARKED_BETWEEN_LOOKS == 0 {
                progress.check()?;
            }
            fluxform_base::progress::poll();
            let found = probe.at([points.x_m[row], points.y_m[row]]);
            Ok(Marks {
                filled: filled.binary_search(&points.grid_index[row]).is_ok(),
                ..found.map_or(Marks::PLAIN, |(_, marks)| marks)
            })
        })
        .collect();
    points.marks = marks?;
    Ok(())
}

/// The plan area of each point, m^2, and the cells that the points describe badly, whose point areas are
/// those of the points too.
fn point_areas_m2(
    points: &ConstraintPoints,
    probe: &Probe<'_>,
    progress: &dyn Progress,
) -> Result<(Vec<f64>, FineCells), ShapeError> {
    let mut heights_m = vec![None; points.grid.len()];
    for (&place, &height_m) in points.grid_index.iter().zip(&points.height_m) {
        heights_m[place] = Some(height_m);
    }
    let height_at = |p: [f64; 2]| Some(probe.sample(p)?.height_m.max(0.0));
    // Beyond, the lists of faces would take more memory than the points.
    let lattice = (points.grid.len() <= MOST_CERTIFIED)
        .then(|| probe.lattice(&points.grid, &heights_m))
        .flatten();
    let surface = Over {
        height_m: &height_at,
        covers: &|p| probe.covers(p),
        near: &|p| probe.near(p),
        lattice: lattice.as_ref(),
    };
    let (all, mut fine) = areas_m2(&points.grid, &heights_m, surface, progress)?;
    let of_points = |all: &[f64]| points.grid_index.iter().map(|&place| all[place]).collect();
    if !fine.smooth.is_empty() {
        fine.point_area_m2 = of_points(&fine.point_area_m2);
    }
    for (x_m, y_m) in fine.x_m.iter().zip(&fine.y_m) {
        let found = probe.at([*x_m, *y_m]);
        let (normal, crease) = found.map_or(([0.0, 0.0, 1.0], None), |(sample, marks)| {
            (sample.normal, marks.crease)
        });
        fine.normal.push(normal);
        fine.crease.push(crease);
    }
    Ok((of_points(&all), fine))
}

/// The requested axis; its nodes ascend.
fn axis(name: &str, request: AxisRequest, extent: [f64; 2]) -> Result<Axis, ShapeError> {
    let axis = match request {
        AxisRequest::Given(axis) => axis,
        AxisRequest::Extent(samples) => Axis {
            from: extent[0],
            to: extent[1],
            samples,
        },
    };
    let fault = |what: String| {
        Err(ShapeError::Document(format!(
            "the grid's {name} axis {what}"
        )))
    };
    let Axis { from, to, samples } = axis;
    if samples == 0 {
        return fault("has no sample; give at least 1".into());
    }
    if !from.is_finite() || !to.is_finite() {
        return fault(format!(
            "runs from {from} to {to} m; both ends must be finite"
        ));
    }
    let finest = 4.0 * f64::EPSILON * from.abs().max(to.abs());
    let advice = match (samples, request) {
        (1, _) if to - from > finest => {
            "one cannot include both ends; take 2 samples or more, or give the axis two equal ends"
        }
        (1, _) => return Ok(axis),
        // More are refused for their number.
        _ if samples > MOST_POINTS || axis.step() > finest => return Ok(axis),
        (_, AxisRequest::Given(_)) => "the first end must be the smaller one",
        (_, AxisRequest::Extent(_)) => {
            "the surface has no extent along it; give the axis, or one sample"
        }
    };
    fault(format!(
        "runs from {} to {} mm (samples: {samples}); {advice}",
        from * 1000.0,
        to * 1000.0
    ))
}

/// Picks the grid points that lie on the surface.
fn collect(
    grid: &Grid,
    samples: &[Option<Sample>],
    rounding_m: f64,
    bounds: &Bounds,
) -> Result<ConstraintPoints, ShapeError> {
    let found = samples.iter().flatten().count();
    if found == 0 {
        let (surface, plan) = (bounds.plan(), grid.plan());
        let apart = (0..2).any(|k| surface[k][1] < plan[k][0] || surface[k][0] > plan[k][1]);
        return Err(if apart {
            ShapeError::OutsideGrid {
                surface,
                grid: plan,
            }
        } else {
            ShapeError::NoPoint {
                grid_points: grid.len(),
                surface,
                grid: plan,
            }
        });
    }
    let mut points = ConstraintPoints {
        grid: *grid,
        x_m: Vec::with_capacity(found),
        y_m: Vec::with_capacity(found),
        height_m: Vec::with_capacity(found),
        normal: Vec::with_capacity(found),
        grid_index: Vec::with_capacity(found),
        marks: vec![Marks::PLAIN; found],
        area_m2: Vec::new(),
        fine: FineCells::default(),
        outside: samples.len() - found,
        holes: 0,
    };
    let (x, y) = (grid.x_m.nodes(), grid.y_m.nodes());
    let (mut below, mut lowest_m) = (0, 0.0f64);
    for (index, sample) in samples.iter().enumerate() {
        fluxform_base::progress::poll();
        let Some(sample) = sample else { continue };
        if sample.height_m < -rounding_m {
            below += 1;
            lowest_m = lowest_m.min(sample.height_m);
        }
        points.x_m.push(x[index % x.len()]);
        points.y_m.push(y[index / x.len()]);
        // A surface that rests on z = 0 may be rounded below it.
        points.height_m.push(sample.height_m.max(0.0));
        points.normal.push(sample.normal);
        points.grid_index.push(index);
    }
    if below > 0 {
        return Err(ShapeError::BelowZero {
            below,
            points: found,
            lowest_m,
        });
    }
    Ok(points)
}
