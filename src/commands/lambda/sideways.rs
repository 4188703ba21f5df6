//! The sideways force at the chosen lambda, which the vertical problem does not see.

use crate::RunError;
use crate::bundle::lambda_file::LambdaFile;
use crate::lambda::feedback::FeedbackError;
use crate::lambda::sideways::sideways;
use crate::lambda::{ForceProblem, Wiring};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::passive;
use crate::scene::steel::Solved;

use super::points::WantedPoints;

/// Points looked at, at most: means and medians of a force that changes over centimetres.
const MOST_POINTS: usize = 1000;

/// Adds the sideways force of `file`'s currents and of feedback to it, if it has currents.
///
/// # Errors
/// Points that cannot be computed; interruption.
pub(crate) fn add(
    file: &mut LambdaFile,
    scene: &Scene,
    solved: &Solved,
    field: ShapeField,
    points: &WantedPoints,
    wiring: &Wiring,
    progress: &dyn Progress,
) -> Result<(), RunError> {
    let (Some(currents_a), Some(lambda)) = (&file.currents_a, file.lambda_n_per_m) else {
        return Ok(());
    };
    let every = points.height_m.len().div_ceil(MOST_POINTS).max(1);
    let rows = || (0..points.height_m.len()).step_by(every);
    let positions_m: Vec<_> = rows().map(|row| points.positions_m[row]).collect();
    let height_m: Vec<_> = rows().map(|row| points.height_m[row]).collect();
    let all = points.weights();
    let weights: Option<Vec<_>> = all.map(|all| rows().map(|row| all[row]).collect());
    let pull = if scene.design.magnet.passive_force {
        passive::pull(scene, &positions_m, false)?
    } else {
        None
    };
    let offset_n = pull.map(|pull| pull.forces_z_n(&positions_m));
    let vectors = field.force_vectors_n_per_a(scene, solved, &positions_m, progress)?;
    let resistance_ohm = scene.resistances_ohm();
    let of_axis = |axis: usize| -> Vec<f64> { vectors.iter().map(|force| force[axis]).collect() };
    let [along_x, along_y, upward] = [0, 1, 2].map(of_axis);
    let given = ForceProblem {
        forces_n_per_a: &upward,
        height_m: &height_m,
        offset_n: offset_n.as_deref(),
        weights: weights.as_deref(),
        lower_a: &scene.lower_a,
        upper_a: &scene.upper_a,
        total_max_a: scene.design.supply.total_current_max_a,
        resistance_ohm: &resistance_ohm,
    };
    let wired = [&along_x, &along_y, &upward].map(|rows| {
        wiring.apply(&ForceProblem {
            forces_n_per_a: rows,
            ..given
        })
    });
    let [of_x, of_y, of_z] = [0, 1, 2].map(|axis| wired[axis].problem(&given));
    let sides = [of_x.forces_n_per_a, of_y.forces_n_per_a];
    file.sideways = sideways(&of_z, sides, lambda, currents_a).map_err(|error| match error {
        FeedbackError::Problem(problem) => RunError::from(problem),
        FeedbackError::Allocator(limits) => RunError::Input(limits.to_string()),
    })?;
    Ok(())
}
