//! What the error of the constraint points does to the force constant.
//!
//! The points' error budget moves surface and magnet together. All points are lifted
//! by it and the problem is solved again with the forces there: a first-order estimate of how far
//! lambda may move, not a bound, because the errors of single points need not agree.

use super::super::JobError;
use super::super::kept::ShapeField;
use super::super::scene::Scene;
use super::super::steel::Solved;
use super::points::WantedPoints;
use crate::accuracy::StageAccuracy;
use crate::lambda::{self, ForceProblem, Settings, Solution};
use crate::progress::Progress;

/// The share of the lowest height by which points are moved at most: beyond, first order ends.
const MOST_OF_HEIGHT: f64 = 0.02;

/// What is solved again.
pub(super) struct Moved<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) solved: &'a Solved,
    pub(super) field: ShapeField<'a>,
    pub(super) points: &'a WantedPoints,
    pub(super) offset_n: Option<&'a [f64]>,
    pub(super) solution: &'a Solution,
}

/// How far lambda moves with the points' error budget; `None` without a lambda or a budget.
///
/// # Errors
/// A problem that cannot be solved; interruption.
pub(super) fn of_points(
    moved: &Moved<'_>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Option<StageAccuracy>, JobError> {
    let (Some(budget_m), Some(chosen)) = (moved.points.budget_m, &moved.solution.chosen) else {
        return Ok(None);
    };
    let step_m = budget_m.min(MOST_OF_HEIGHT * moved.points.lowest_m());
    if !(step_m > 0.0 && chosen.lambda_n_per_m > 0.0) {
        return Ok(None);
    }
    // Lifted only: the steel's solution was made for the points and above.
    let Some(there) = lambda_at(moved, step_m, settings, progress)? else {
        return Ok(None);
    };
    let shift = (there / chosen.lambda_n_per_m - 1.0).abs();
    Ok(Some(StageAccuracy {
        estimate: shift * (budget_m / step_m),
        relative_to: "lambda".to_owned(),
        method: "an estimate: all points lifted by their error budget (grid, \
                 tessellation, rounding), forces and lambda computed again, to first order"
            .to_owned(),
    }))
}

fn lambda_at(
    moved: &Moved<'_>,
    lift_m: f64,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Option<f64>, JobError> {
    let scene = moved.scene;
    let mut positions = moved.points.positions_m.clone();
    positions.iter_mut().for_each(|p| p[2] += lift_m);
    let forces =
        (moved.field).forces_n_per_a("lifted", scene, moved.solved, &positions, progress)?;
    let heights: Vec<f64> = positions.iter().map(|p| p[2]).collect();
    let resistance_ohm = scene.resistances_ohm();
    let problem = ForceProblem {
        forces_n_per_a: &forces,
        height_m: &heights,
        offset_n: moved.offset_n,
        weights: moved.points.weights.as_deref(),
        lower_a: &scene.lower_a,
        upper_a: &scene.upper_a,
        total_max_a: scene.design.supply.total_current_max_a,
        resistance_ohm: &resistance_ohm,
    };
    let settings = Settings {
        at_n_per_m: None,
        ..*settings
    };
    Ok(lambda::solve(&problem, &settings)?
        .chosen
        .map(|chosen| chosen.lambda_n_per_m))
}
