//! The points that a force constant is solved for: those of a grid, or weighted ones on no grid.

use std::collections::BTreeMap;

use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::Input;
use crate::commands::discretize::PointsReport;
use crate::commands::discretize::scattered::ScatteredReport;
use crate::force_direction::RequestedForce;

/// Places, what is wanted there, and what is known of their error.
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
    /// Area each stands for, m^2; `None`: all alike.
    pub(crate) weights: Option<Vec<f64>>,
    /// Name of the shape.
    pub(crate) shape: String,
    /// Input files.
    pub(crate) inputs: Vec<Input>,
    /// Each part of the heights' error; `points` is the rounding.
    pub(crate) accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// All parts together, m; `None` where the surface between the points was not looked at.
    pub(crate) budget_m: Option<f64>,
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
    pub(crate) fn of_grid(report: &PointsReport) -> Self {
        let points = &report.discretized.points;
        let summary = &report.summary;
        Self {
            positions_m: positions_m(&points.x_m, &points.y_m, &points.height_m),
            height_m: points.height_m.clone(),
            normals: points.normal.clone(),
            other_normals: points.marks.iter().map(|marks| marks.crease).collect(),
            weights: None,
            shape: summary.shape.clone(),
            inputs: summary.inputs.clone(),
            accuracy: summary.accuracy.clone(),
            budget_m: summary.deviation.map(|deviation| deviation.budget_m),
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
        let budget_m = summary.accuracy.values().map(|stage| stage.estimate).sum();
        Self {
            positions_m: positions_m(&points.x_m, &points.y_m, &points.height_m),
            height_m: points.height_m.clone(),
            normals: points.normal.clone(),
            other_normals: Vec::new(),
            weights: Some(points.weight_m2.clone()),
            shape: summary.shape.clone(),
            inputs: summary.inputs.clone(),
            accuracy: summary.accuracy.clone(),
            budget_m: patches.then_some(budget_m),
            grid: None,
            warnings: summary.warnings.clone(),
        }
    }

    /// The requested force over lambda times the height, at each point.
    pub(super) fn directions(&self, force: RequestedForce) -> Vec<[f64; 3]> {
        let normals = self.normals.iter().enumerate();
        let other = |row: usize| self.other_normals.get(row).copied().flatten();
        normals
            .map(|(row, normal)| force.vector(*normal, other(row)))
            .collect()
    }

    /// Plan area of each point against an inner one's, where they are those of a grid: on its border
    /// half, in its corners a quarter. What a rim cuts off inside counts as whole: on average it is.
    pub(crate) fn area_weights(&self) -> Option<Vec<f64>> {
        let grid = self.grid.as_ref()?;
        let part = |at: usize, count: usize| if at == 0 || at + 1 == count { 0.5 } else { 1.0 };
        let weight = |k: &usize| {
            let (column, row) = (k % grid.columns, k / grid.columns);
            part(column, grid.columns) * part(row, grid.rows)
        };
        Some(grid.index.iter().map(weight).collect())
    }

    /// Every second point along both axes of a grid, its ends among them.
    pub(crate) fn every_second(&self) -> Option<Vec<usize>> {
        let grid = self.grid.as_ref()?;
        let even =
            |k: usize| (k % grid.columns).is_multiple_of(2) && (k / grid.columns).is_multiple_of(2);
        let places = grid.index.iter().enumerate();
        let chosen = places.filter(|(_, k)| even(**k));
        Some(chosen.map(|(row, _)| row).collect())
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
