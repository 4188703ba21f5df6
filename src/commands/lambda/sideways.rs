//! The sideways force at the chosen lambda, which the vertical problem does not see, and the felt error of the
//! force vector.

use crate::RunError;
use crate::bundle::headline::{FeltForce, FeltShares};
use crate::bundle::lambda_file::LambdaFile;
use crate::force_direction::RequestedForce;
use crate::lambda::ForceProblem;
use crate::lambda::feedback::FeedbackError;
use crate::lambda::sideways::sideways;
use crate::lambda::vector_feedback::{CurrentsOf, VectorProblem, render_vectors};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::passive;
use crate::scene::steel::Solved;

use super::points::ForcePoints;
use super::{LambdaOptions, uncertain};

/// Points looked at, at most: means and medians of a force that changes over centimetres.
const MOST_POINTS: usize = 1000;

/// Adds the study of what is uncertain, the sideways force of `file`'s currents and of feedback to it, if it has currents.
///
/// # Errors
/// Points that cannot be computed; interruption.
pub(crate) fn add(
    file: &mut LambdaFile,
    scene: &Scene,
    solved: &Solved,
    field: ShapeField,
    points: &ForcePoints,
    (options, force): (&LambdaOptions, RequestedForce),
    progress: &dyn Progress,
) -> Result<(), RunError> {
    uncertain::add(file, scene, solved, points, (options, force), progress)?;
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
        let along = ForceProblem {
            forces_n_per_a: rows,
            ..given
        };
        (options.wiring).apply(&along, scene.design.supply.voltage_v)
    });
    let [of_x, of_y, of_z] = [0, 1, 2].map(|axis| wired[axis].problem(&given));
    let sides = [of_x.forces_n_per_a, of_y.forces_n_per_a];
    let direction = points.directions(force);
    let direction: Vec<[f64; 3]> = rows().map(|row| direction[row]).collect();
    let vectors = VectorProblem {
        upward: of_z,
        sides_n_per_a: sides,
        direction: &direction,
    };
    let followed = if force.direction.is_vector() {
        CurrentsOf::Vector
    } else {
        CurrentsOf::Upward
    };
    let felt = |of| render_vectors(&vectors, lambda, of).map(|rendered| rendered.error_share);
    let found = sideways(&of_z, sides, lambda, currents_a).and_then(|sideways| {
        let exact = FeltShares {
            fixed: felt(CurrentsOf::Static(currents_a))?,
            feedback: felt(followed)?,
            robust: None,
        };
        Ok((sideways, exact))
    });
    let (sideways, exact) = found.map_err(|error| match error {
        FeedbackError::Problem(problem) => RunError::from(problem),
        FeedbackError::Allocator(limits) => RunError::Input(limits.to_string()),
    })?;
    file.sideways = sideways;
    if let Some(headline) = &mut file.headline {
        headline.add_felt(FeltForce::new(exact, file.uncertainty.as_ref()));
    }
    Ok(())
}
