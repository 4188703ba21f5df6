//! The sideways force at the chosen lambda, which the vertical problem does not see, and the felt error of the
//! force vector.

use rayon::prelude::*;

use crate::RunError;
use crate::bundle::headline::FeltForce;
use crate::bundle::lambda_file::LambdaFile;
use crate::force_direction::RequestedForce;
use crate::lambda::all_points::AllPoints;
use crate::lambda::sideways::{Sideways, sideways};
use crate::lambda::vector_feedback::VectorProblem;
use crate::lambda::{ForceProblem, GivenForce};
use crate::numerics::spread::spread;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::passive::{self, Pull};
use crate::scene::steel::{SMALLER_CURRENTS, Solved};

use super::LambdaOptions;
use super::feedback::render_error;
use super::points::ForcePoints;
use super::uncertain::{Chosen, study_of};

/// Forces per ampere along each axis at the points looked at, at most: their memory and time.
const NUMBERS: usize = 400_000;
/// Points looked at in any case.
const LEAST_POINTS: usize = 1000;
/// Of them those at which currents give all three components, at most,
const MOST_FOLLOWED: usize = 1000;
/// and those at which the steel's sideways pull is computed, half a millisecond each.
const MOST_PULLED: usize = 100;

/// How far forces per ampere are others at smaller currents, beyond what the static currents' own state leaves out, which is
/// part of the computation.
fn beyond_static(file: &LambdaFile) -> f64 {
    let static_state = (file.working_point.as_ref()).map_or(0.0, |of| of.deviation_from_linear);
    let smaller_currents = (file.accuracy.get(SMALLER_CURRENTS)).map_or(0.0, |of| of.estimate);
    (smaller_currents - static_state).max(0.0)
}

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
    let (Some(currents_a), Some(lambda)) = (&file.currents_a, file.lambda_n_per_m) else {
        return Ok(());
    };
    let chosen = Chosen::new(points, (NUMBERS / scene.coils.len()).max(LEAST_POINTS));
    let positions_m = &chosen.positions_m;
    let pull = passive::counted(scene, positions_m)?;
    let offset_n = pull.as_ref().map(|pull| pull.forces_z_n(positions_m));
    let vectors = field.force_vectors_n_per_a("vectors", scene, solved, positions_m, progress)?;
    let resistance_ohm = scene.resistances_ohm();
    let of_axis = |axis: usize| -> Vec<f64> { vectors.iter().map(|force| force[axis]).collect() };
    let [along_x, along_y, upward] = [0, 1, 2].map(of_axis);
    let given = ForceProblem {
        forces_n_per_a: &upward,
        height_m: &chosen.height_m,
        offset_n: offset_n.as_deref(),
        weights: chosen.weights.as_deref(),
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
    let direction = chosen.directions(points, force);
    let vectors = VectorProblem {
        upward: of_z,
        sides_n_per_a: sides,
        direction: &direction,
    };
    let quarters = chosen.quarters(points);
    let some = spread(positions_m.len(), MOST_FOLLOWED);
    let own_a = options.wiring.own(currents_a);
    let sideways = sideways(&vectors, lambda, &own_a, &some).map_err(render_error)?;
    let vector = force.direction.is_vector();
    let all = AllPoints::new(vectors, &quarters, (lambda, &own_a), vector);
    let all = all.map_err(render_error)?;
    let study = study_of(&all, (scene, solved), points, (options, force), progress)?;
    let (fixed, feedback) = (all.fixed.given, all.feedback.given);
    let pull_share = pull.map(|pull| sideways_share(&pull, positions_m, &given, lambda));
    let felt = FeltForce::new(&all, study.as_ref(), pull_share, beyond_static(file));
    if let Some(headline) = &mut file.headline {
        headline.add_felt(felt);
    }
    if vector {
        let above_saturation = file.given_force.is_some_and(|of| of.above_saturation);
        let marked = |of| GivenForce {
            above_saturation,
            ..of
        };
        file.given_force = fixed.map(marked);
        if let Some(headline) = &mut file.headline {
            headline.static_currents = file.given_force;
            headline.feedback = feedback;
        }
    }
    file.uncertainty = study;
    file.sideways = sideways.map(|found| Sideways {
        pull_share,
        ..found
    });
    Ok(())
}

/// The steel's sideways pull, root mean square over that of the requested force, to about a tenth of itself: of some
/// points, as the upward pull of all is to theirs.
fn sideways_share(
    pull: &Pull,
    positions_m: &[[f64; 3]],
    problem: &ForceProblem,
    lambda_n_per_m: f64,
) -> f64 {
    let square = |point: usize, force_n: f64| problem.weight(point) * force_n * force_n;
    let sum = |force_n: &dyn Fn(usize) -> f64, points: &[usize]| -> f64 {
        points
            .iter()
            .map(|point| square(*point, force_n(*point)))
            .sum()
    };
    let some = spread(positions_m.len(), MOST_PULLED);
    let of_point = |point: &usize| {
        let [x_n, y_n, _] = pull.force_n(positions_m[*point]);
        square(*point, x_n.hypot(y_n))
    };
    let sideways: Vec<f64> = some.par_iter().map(of_point).collect();
    let all: Vec<usize> = (0..positions_m.len()).collect();
    let upward = |point: usize| problem.offset_n.map_or(0.0, |all| all[point]);
    let requested = sum(&|point| lambda_n_per_m * problem.height_m[point], &all);
    let of_some = sum(&upward, &some);
    if of_some == 0.0 {
        return 0.0;
    }
    let ratio = sideways.iter().sum::<f64>() / of_some;
    (ratio * sum(&upward, &all) / requested).sqrt()
}
