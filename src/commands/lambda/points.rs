//! The points that a force constant is solved for: those of a grid, or weighted ones on no grid.

use std::collections::BTreeMap;

use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::Input;
use crate::commands::discretize::PointsReport;
use crate::commands::discretize::scattered::ScatteredReport;
use crate::force_direction::RequestedForce;
use crate::lambda::limit::{self, limit_error};
use crate::lambda::{ForceProblem, ProblemError, Settings};
use crate::point_weights::Weights;

/// Places, what is requested there, and what is known of their error.
#[derive(Debug, Clone)]
pub(crate) struct WantedPoints {
    /// Where the magnet's centre is wanted, m.
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
    /// Whether they are as dense as the surface needs them, on no grid.
    pub(super) graded: bool,
    /// Name of the shape.
    pub(crate) shape: String,
    /// Input files.
    pub(crate) inputs: Vec<Input>,
    /// Each part of the heights' error; `points` is the rounding.
    pub(crate) accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Where the points lie in their grid, if they are those of one.
    pub(super) grid: Option<GridPlaces>,
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

impl WantedPoints {
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
            graded: false,
            shape: summary.shape.clone(),
            inputs: summary.inputs.clone(),
            accuracy: summary.accuracy.clone(),
            grid: Some(GridPlaces {
                columns: points.grid.x_m.samples,
                rows: points.grid.y_m.samples,
                plan_m: points.grid.plan(),
                index: points.grid_index.clone(),
            }),
            warnings: summary.warnings.clone(),
        }
    }

    pub(crate) fn of_scattered(report: &ScatteredReport) -> Self {
        let (points, summary) = (&report.points, &report.summary);
        // The patches' deviation is in it; without patches nothing is known between the points.
        let patches = summary.accuracy.contains_key("patches");
        Self {
            positions_m: positions_m(&points.x_m, &points.y_m, &points.height_m),
            height_m: points.height_m.clone(),
            normals: points.normal.clone(),
            other_normals: Vec::new(),
            rule: Weights::Area,
            areas: points.weight_m2.clone(),
            graded: patches,
            shape: summary.shape.clone(),
            inputs: summary.inputs.clone(),
            accuracy: summary.accuracy.clone(),
            grid: None,
            warnings: summary.warnings.clone(),
        }
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

    /// How far the constant of these points is from the limit of ever more of them, relative; `None`
    /// for graded points, whose patches are compared with wider ones instead, and for too few.
    ///
    /// # Errors
    /// A malformed problem.
    pub(crate) fn error_against_limit(
        &self,
        problem: &ForceProblem,
        lambda_n_per_m: f64,
        settings: &Settings,
    ) -> Result<Option<f64>, ProblemError> {
        if self.areas.len() != problem.points() || self.graded {
            return Ok(None);
        }
        let grid = self.grid.as_ref().map(|grid| limit::GridPlaces {
            columns: grid.columns,
            rows: grid.rows,
            index: &grid.index,
        });
        let found = limit_error(problem, lambda_n_per_m, &self.areas, grid, settings)?;
        Ok(found.map(|found| found.estimate))
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

fn positions_m(x_m: &[f64], y_m: &[f64], z_m: &[f64]) -> Vec<[f64; 3]> {
    let plan = x_m.iter().zip(y_m).zip(z_m);
    plan.map(|((x, y), z)| [*x, *y, *z]).collect()
}
