//! The points that a force constant is solved for: those of a grid, or weighted ones on no grid.

use std::collections::BTreeMap;

use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::Input;
use crate::bundle::table::PointRow;
use crate::commands::discretize::PointsReport;
use crate::commands::discretize::scattered::ScatteredReport;
use crate::design::Workspace;
use crate::force_direction::RequestedForce;
use crate::lambda::limit::{self, FineSamples, limit_error};
use crate::lambda::{ForceProblem, ProblemError, Settings, Wiring, constant};
use crate::point_weights::Weights;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::passive;
use crate::scene::steel::Solved;
use crate::shape::point_areas::{FineCells, SMOOTH};

/// Places, what is requested there, and what is known of their error.
#[derive(Debug, Clone)]
pub(crate) struct ForcePoints {
    /// Where the magnet's centre is requested, m.
    pub(crate) positions_m: Vec<[f64; 3]>,
    /// z of each, m.
    pub(crate) height_m: Vec<f64>,
    /// Unit normal of each.
    normals: Vec<[f64; 3]>,
    /// Normal of the other face, of each that lies on a crease; empty where creases are not known.
    other_normals: Vec<Option<[f64; 3]>>,
    /// How they count in the mean.
    pub(crate) rule: Weights,
    /// Plan area each stands for, m^2.
    pub(crate) areas: Vec<f64>,
    /// Name of the shape.
    pub(crate) shape: String,
    /// Input files.
    pub(crate) inputs: Vec<Input>,
    /// Each part of the heights' error; `points` is the rounding.
    pub(crate) accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Where the points lie in their grid, if they are those of one.
    pub(super) grid: Option<GridPlaces>,
    /// Samples of the cells that the points describe badly, if there are any.
    fine: Option<FineCells>,
    /// Warnings for the user.
    pub(crate) warnings: Vec<String>,
}

/// Points as places of a grid.
#[derive(Debug, Clone)]
pub(super) struct GridPlaces {
    /// Grid points along x.
    pub(super) columns: usize,
    /// Grid points along y.
    pub(super) rows: usize,
    /// The ends along x and y, m.
    pub(super) plan_m: [[f64; 2]; 2],
    /// row * columns + column of each point.
    pub(super) index: Vec<usize>,
}

/// The scene and solution with which forces at further places are computed.
#[derive(Clone, Copy)]
pub(crate) struct ForcesAt<'a> {
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) solved: &'a Solved,
    pub(crate) field: ShapeField<'a>,
    pub(crate) progress: &'a dyn Progress,
}

/// The least that a point counts for, of the most.
const LEAST: f64 = 1e-6;
/// Samples are raised to so many times their height again, at most: some lie at the coils.
const MOST_RAISED: f64 = 4.0;

impl ForcePoints {
    /// Those of a grid, which count by `rule`. Where they count by area and nobody gave the grid, samples of the
    /// cells that they describe badly are points too, after those of the grid, none below `workspace` or the
    /// lowest point of the grid.
    pub(crate) fn of_object(report: &PointsReport, rule: Weights, workspace: &Workspace) -> Self {
        let mut points = Self::of_grid(report, rule);
        if rule == Weights::Area && !report.grid_is_given {
            points.add_graded(workspace);
        }
        points
    }

    /// Those of a grid, which count by `rule`.
    pub(crate) fn of_grid(report: &PointsReport, rule: Weights) -> Self {
        let points = &report.discretized.points;
        let summary = &report.summary;
        Self {
            positions_m: positions_m(&points.x_m, &points.y_m, &points.height_m),
            height_m: points.height_m.clone(),
            normals: points.normal.clone(),
            other_normals: points.marks.iter().map(|marks| marks.crease).collect(),
            rule,
            areas: points.area_m2.clone(),
            shape: summary.shape.clone(),
            inputs: summary.inputs.clone(),
            accuracy: summary.accuracy.clone(),
            grid: Some(GridPlaces {
                columns: points.grid.x_m.samples,
                rows: points.grid.y_m.samples,
                plan_m: points.grid.plan(),
                index: points.grid_index.clone(),
            }),
            fine: Some(points.fine.clone()).filter(|fine| !fine.smooth.is_empty()),
            warnings: summary.warnings.clone(),
        }
    }

    /// Makes points of the samples of cells that the grid's points describe badly.
    fn add_graded(&mut self, workspace: &Workspace) {
        let Some(fine) = &self.fine else { return };
        let places = self.sample_places_m(fine, workspace);
        // A point counts, however little.
        let all = || fine.point_area_m2.iter().chain(&fine.area_m2);
        let least_m2 = LEAST * all().copied().fold(0.0, f64::max);
        self.areas = all().map(|area| area.max(least_m2)).collect();
        self.height_m.extend(places.iter().map(|place| place[2]));
        self.normals.extend(&fine.normal);
        self.other_normals.extend(&fine.crease);
        self.positions_m.extend(places);
    }

    /// How many points lie on the grid, where samples of its cells are points too.
    fn before_graded(&self) -> Option<usize> {
        let on_grid = self.grid.as_ref()?.index.len();
        (on_grid < self.positions_m.len()).then_some(on_grid)
    }

    /// As rows of `points.csv`.
    pub(crate) fn rows(&self) -> Vec<PointRow> {
        let places = self
            .positions_m
            .iter()
            .zip(&self.height_m)
            .zip(&self.normals);
        places
            .map(|(([x_m, y_m, _], height_m), normal)| PointRow {
                x_m: *x_m,
                y_m: *y_m,
                height_m: *height_m,
                normal: *normal,
            })
            .collect()
    }

    /// # Errors
    /// Points that cover no area, by which they count.
    pub(crate) fn of_scattered(report: &ScatteredReport) -> Result<Self, RunError> {
        let (points, summary) = (&report.points, &report.summary);
        if points.weight_m2.iter().all(|area| *area == 0.0) {
            return Err(RunError::Input(
                "random points count by area, and a point or a row of them has none: give two ends along x and \
                 y, or leave --poisson out"
                    .to_owned(),
            ));
        }
        Ok(Self {
            positions_m: positions_m(&points.x_m, &points.y_m, &points.height_m),
            height_m: points.height_m.clone(),
            normals: points.normal.clone(),
            other_normals: Vec::new(),
            rule: Weights::Area,
            areas: points.weight_m2.clone(),
            shape: summary.shape.clone(),
            inputs: summary.inputs.clone(),
            accuracy: summary.accuracy.clone(),
            grid: None,
            fine: None,
            warnings: summary.warnings.clone(),
        })
    }

    /// The requested force over lambda times the height, at each point.
    pub(crate) fn directions(&self, force: RequestedForce) -> Vec<[f64; 3]> {
        let normals = self.normals.iter().enumerate();
        let other = |row: usize| self.other_normals.get(row).copied().flatten();
        normals
            .map(|(row, normal)| force.vector(*normal, other(row)))
            .collect()
    }

    /// Weights in the mean; `None`: all alike.
    pub(crate) fn weights(&self) -> Option<&[f64]> {
        match self.rule {
            Weights::Equal => None,
            Weights::Area => Some(&self.areas),
        }
    }

    /// Their places in their grid, if they are those of one.
    pub(super) fn grid_places(&self) -> Option<limit::GridPlaces<'_>> {
        self.grid.as_ref().map(|grid| limit::GridPlaces {
            columns: grid.columns,
            rows: grid.rows,
            index: &grid.index,
            smooth: self.fine.as_ref().map_or(&[], |fine| &fine.smooth),
            smooth_within: SMOOTH,
        })
    }

    /// How far the constant of these points is from the limit of ever more of them, relative; `None`
    /// for points on no grid, which are compared with others instead. `unwired`
    /// is `problem` before `wiring`.
    ///
    /// # Errors
    /// A malformed problem; forces that cannot be computed; interruption.
    pub(crate) fn error_against_limit(
        &self,
        lambda_n_per_m: f64,
        (problem, unwired): (&ForceProblem, &ForceProblem),
        (wiring, settings): (&Wiring, &Settings),
        at: ForcesAt,
    ) -> Result<Option<f64>, RunError> {
        let Some(grid) = self.grid_places() else {
            return Ok(None);
        };
        if self.areas.len() != problem.points() {
            return Ok(None);
        }
        let cells = self.fine.as_ref();
        if let (Some(cells), Some(on_grid)) = (cells, self.before_graded()) {
            let (of_grid, graded) = problem.split_at(on_grid);
            let fine = Some(fine_samples(cells, &graded, true));
            let areas = &self.areas[..on_grid];
            let found = limit_error(&of_grid, lambda_n_per_m, areas, grid, fine, settings)?;
            let raised = self.raised_again(unwired, (wiring, settings), at)?;
            let moved = raised.map_or(0.0, |raised| (raised / lambda_n_per_m - 1.0).abs());
            return Ok(Some(found + moved));
        }
        let places_m = cells.map_or_else(Vec::new, |fine| {
            self.sample_places_m(fine, &at.scene.design.workspace)
        });
        let forces_n_per_a =
            (at.field).forces_n_per_a("cells", at.scene, at.solved, &places_m, at.progress)?;
        let pull = match unwired.offset_n {
            Some(_) if cells.is_some() => passive::pull(at.scene, &places_m, false)?,
            _ => None,
        };
        let offset_n = pull.map(|pull| pull.forces_z_n(&places_m));
        let samples = cells.map(|fine| ForceProblem {
            forces_n_per_a: &forces_n_per_a,
            height_m: &fine.height_m,
            offset_n: offset_n.as_deref(),
            weights: None,
            ..*unwired
        });
        let voltage_v = at.scene.design.supply.voltage_v;
        let rewired = (samples.as_ref()).map(|samples| wiring.apply(samples, voltage_v));
        let wired = samples
            .as_ref()
            .zip(rewired.as_ref())
            .map(|(plain, re)| re.problem(plain));
        let fine = cells.zip(wired.as_ref());
        let fine = fine.map(|(cells, wired)| fine_samples(cells, wired, false));
        let areas = &self.areas;
        let found = limit_error(problem, lambda_n_per_m, areas, grid, fine, settings);
        Ok(Some(found?))
    }

    /// The samples among the points that are lower than the height they are given, and that over theirs.
    pub(super) fn raised(&self) -> Vec<(usize, f64)> {
        let first = self.before_graded();
        let samples = self.fine.iter().flat_map(|fine| fine.height_m.iter());
        let raised = first.into_iter().flat_map(|first| {
            let given = samples.clone().zip(&self.height_m[first..]).enumerate();
            given.map(move |(sample, (own, given))| (first + sample, given / own))
        });
        raised.filter(|(_, by)| *by > 1.0).collect()
    }

    /// The constant where samples that are given a height above their own are as much higher again: as far off as that of
    /// their own heights, at which no forces are computed. `None` without such samples, 0 without a constant.
    fn raised_again(
        &self,
        unwired: &ForceProblem,
        (wiring, settings): (&Wiring, &Settings),
        at: ForcesAt,
    ) -> Result<Option<f64>, RunError> {
        let rows = self.raised();
        if rows.is_empty() {
            return Ok(None);
        }
        let again = |(row, by): &(usize, f64)| {
            let [x, y, z] = self.positions_m[*row];
            [x, y, z * by.min(MOST_RAISED)]
        };
        let places_m: Vec<[f64; 3]> = rows.iter().map(again).collect();
        let field = at.field;
        let forces_n_per_a = field.forces_n_per_a(
            "raised samples",
            at.scene,
            at.solved,
            &places_m,
            at.progress,
        )?;
        let pull = match unwired.offset_n {
            Some(_) => passive::pull(at.scene, &places_m, false)?,
            None => None,
        };
        let pull_n = pull.map(|pull| pull.forces_z_n(&places_m));
        let coils = unwired.coils();
        let mut height_m = unwired.height_m.to_vec();
        let mut all_n_per_a = unwired.forces_n_per_a.to_vec();
        let mut offset_n = unwired.offset_n.map(<[f64]>::to_vec);
        for (k, (row, _)) in rows.iter().enumerate() {
            height_m[*row] = places_m[k][2];
            all_n_per_a[row * coils..(row + 1) * coils]
                .copy_from_slice(&forces_n_per_a[k * coils..(k + 1) * coils]);
            if let (Some(offset_n), Some(pull_n)) = (&mut offset_n, &pull_n) {
                offset_n[*row] = pull_n[k];
            }
        }
        let problem = ForceProblem {
            forces_n_per_a: &all_n_per_a,
            height_m: &height_m,
            offset_n: offset_n.as_deref(),
            ..*unwired
        };
        let rewired = wiring.apply(&problem, at.scene.design.supply.voltage_v);
        match constant(&rewired.problem(&problem), settings) {
            Err(ProblemError::TooWeak { .. }) => Ok(Some(0.0)),
            other => Ok(Some(other?.unwrap_or(0.0))),
        }
    }

    /// Where the magnet is at samples: no lower than the workspace, or the lowest point below it.
    fn sample_places_m(&self, fine: &FineCells, workspace: &Workspace) -> Vec<[f64; 3]> {
        let floor_m = workspace.z_m.from.min(self.lowest_m());
        let heights_m: Vec<f64> = fine.height_m.iter().map(|h| h.max(floor_m)).collect();
        positions_m(&fine.x_m, &fine.y_m, &heights_m)
    }

    /// The lowest place, of points and samples, that forces are computed at, m.
    pub(crate) fn lowest_place_m(&self, workspace: &Workspace) -> f64 {
        let cells = self.fine.iter();
        let samples = cells.flat_map(|fine| self.sample_places_m(fine, workspace));
        samples.map(|[_, _, z]| z).fold(self.lowest_m(), f64::min)
    }

    /// The error of the heights at the points themselves, m: tessellation and rounding.
    pub(super) fn heights_error_m(&self) -> f64 {
        let parts = ["points", "tessellation"].map(|name| self.accuracy.get(name));
        let stages = parts.into_iter().flatten();
        stages.map(|stage| stage.estimate).sum()
    }

    /// The lowest of the points, m.
    pub(crate) fn lowest_m(&self) -> f64 {
        self.height_m.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The parts of the error but the rounding, named as in a manifest.
    pub(super) fn stages(&self) -> BTreeMap<String, StageAccuracy> {
        let stages = self.accuracy.iter();
        stages
            .filter(|(name, _)| **name != "points")
            .map(|(name, stage)| (format!("points_{name}"), stage.clone()))
            .collect()
    }
}

fn fine_samples<'a>(
    cells: &'a FineCells,
    samples: &ForceProblem<'a>,
    are_points: bool,
) -> FineSamples<'a> {
    FineSamples {
        are_points,
        forces_n_per_a: samples.forces_n_per_a,
        height_m: samples.height_m,
        offset_n: samples.offset_n,
        areas: &cells.area_m2,
        coarse_areas: &cells.coarse_area_m2,
        stand_in: &cells.stand_in,
        point_areas: &cells.point_area_m2,
    }
}

fn positions_m(x_m: &[f64], y_m: &[f64], z_m: &[f64]) -> Vec<[f64; 3]> {
    let plan = x_m.iter().zip(y_m).zip(z_m);
    plan.map(|((x, y), z)| [*x, *y, *z]).collect()
}
