//! The force constant, the currents and their errors.

use super::passive::offset_n;
use super::route::Route;
use super::{Bounds, Check, check, difference, ratio, worst};
use crate::RunError;
use crate::bundle::lambda_file::LambdaFile;
use crate::bundle::load::Bundle;
use crate::field::winding::KERNEL_ERROR;
use crate::lambda::{self, ForceProblem, Settings};
use crate::numerics::spread::spread;
use crate::progress::Progress;

/// Largest difference of a force constant that is solved for again, relative.
const LAMBDA_AGREES: f64 = 1e-8;
/// How much a force constant may move with the stated error of the forces.
const FORCES_MOVE: f64 = 10.0;
/// Largest duality gap, relative to the mean square of the requested force.
const GAP_ALLOWED: f64 = 1e-10;

/// The force constant, the currents and their errors from forces computed again. `weights` are those
/// that the inputs give; `None`: all points alike.
pub(super) fn checks(
    bundle: &Bundle,
    route: &Route,
    bounds: &Bounds,
    weights: Option<&[f64]>,
    progress: &dyn Progress,
) -> Result<Vec<Check>, RunError> {
    let scene = route.scene;
    let positions: Vec<[f64; 3]> = bundle
        .points
        .iter()
        .map(|p| [p.x_m, p.y_m, p.height_m])
        .collect();
    let lowest_m = bundle.map.z_m.first().copied().unwrap_or(0.0);
    let slack = FORCES_MOVE * bounds.forces;
    let solved = route.solved.for_forces(scene, lowest_m)?;
    let forces = scene.forces_n_per_a(&solved, &positions, progress)?;
    let mut checks = vec![sampled_forces(route, bounds, &positions, &forces)?];

    let heights: Vec<f64> = bundle.points.iter().map(|p| p.height_m).collect();
    let stored = &bundle.lambda;
    let offset_n = offset_n(scene, &positions)?;
    let slack = slack + passive_slack(bundle, bounds, offset_n.as_deref(), &heights);
    let agrees = slack.max(LAMBDA_AGREES);
    let resistance_ohm = scene.resistances_ohm();
    let problem = ForceProblem {
        forces_n_per_a: &forces,
        height_m: &heights,
        offset_n: offset_n.as_deref(),
        weights,
        lower_a: &scene.lower_a,
        upper_a: &scene.upper_a,
        total_max_a: scene.design.supply.total_current_max_a,
        resistance_ohm: &resistance_ohm,
    };
    let settings = Settings {
        criterion: stored.criterion,
        jnd_weight: stored.jnd,
        at_n_per_m: stored.lambda_n_per_m,
    };
    let again = lambda::solve(&problem, &settings)?;
    let stored_constants = stored.constants.named().into_iter();
    let chosen = again.chosen.as_ref().map(|c| c.lambda_n_per_m);
    let worst = stored_constants
        .zip(again.constants.named())
        .map(|(stored, again)| (stored.lambda_n_per_m, again.lambda_n_per_m))
        .chain([(stored.lambda_n_per_m, chosen)])
        .map(|(stored, again)| difference(stored.as_slice(), again.as_slice()))
        .fold(0.0, f64::max);
    let how = "all force constants solved for again";
    checks.push(check("lambda", worst, agrees, how.to_owned()));

    if let Some(worst) = &stored.worst_point {
        let lambda = stored.lambda_n_per_m;
        let worst = worst::checks(&problem, &settings, again.status, worst, lambda, agrees)?;
        checks.extend(worst);
    }
    if let (Some(lambda), Some(currents)) = (stored.lambda_n_per_m, &stored.currents_a) {
        checks.extend(currents_checks(stored, &problem, lambda, currents, slack));
    }
    Ok(checks)
}

/// The errors that the stored currents have, and the proof that no others are better. `slack` is
/// how much the stated errors of the forces may move them.
fn currents_checks(
    stored: &LambdaFile,
    problem: &ForceProblem,
    lambda: f64,
    currents: &[f64],
    slack: f64,
) -> Vec<Check> {
    let agrees = slack.max(LAMBDA_AGREES);
    let heights = problem.height_m;
    let residual: Vec<f64> = problem
        .forces_n_per_a
        .chunks_exact(problem.coils())
        .enumerate()
        .map(|(point, row)| {
            let pull = problem.offset_n.map_or(0.0, |offset| offset[point]);
            let pushed: f64 = row.iter().zip(currents).map(|(g, i)| g * i).sum();
            lambda * heights[point] - pull - pushed
        })
        .collect();
    let mean_square_of = |values: &[f64]| {
        let weight = |point: usize| problem.weights.map_or(1.0, |all| all[point]);
        let squares = values.iter().enumerate();
        let sum: f64 = squares.map(|(point, v)| weight(point) * v * v).sum();
        sum / (0..values.len()).map(weight).sum::<f64>()
    };
    // Of lambda = 0 the pull is all that is requested.
    let pull = problem.offset_n.filter(|_| lambda == 0.0);
    let mean_square_force =
        lambda * lambda * mean_square_of(heights) + pull.map_or(0.0, &mean_square_of);
    let rms_force = mean_square_force.sqrt();
    let mean_square = mean_square_of(&residual);
    let largest = residual.iter().fold(0.0_f64, |most, e| most.max(e.abs()));
    let against = |name, stored: Option<f64>, again: f64, how: &str| {
        let off = stored.map_or(f64::INFINITY, |stored| (stored - again).abs());
        check(name, ratio(off, rms_force), agrees, how.to_owned())
    };
    let last = if stored.criterion.is_least_mean_square() {
        let gap = ratio(duality_gap(problem, &residual, currents), mean_square_force);
        let how = "proof of optimality: no currents within the limits are better by more";
        check("duality gap", gap, slack.max(GAP_ALLOWED), how.to_owned())
    } else {
        // These currents are for the weakest point, not for the mean square.
        worst::weakest_point(&residual, rms_force, agrees)
    };
    vec![
        against(
            "rms error",
            stored.rms_error_n,
            mean_square.sqrt(),
            "the mean square error summed over all points",
        ),
        against(
            "worst error",
            stored.worst_error_n,
            largest,
            "the largest error over all points",
        ),
        last,
    ]
}

/// How much the pull's stated error may move force constants and errors, relative.
fn passive_slack(
    bundle: &Bundle,
    bounds: &Bounds,
    offset_n: Option<&[f64]>,
    heights: &[f64],
) -> f64 {
    let Some(offset_n) = offset_n else { return 0.0 };
    let rms = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>().sqrt();
    let stored = [
        bundle.lambda.lambda_n_per_m,
        bundle.lambda.constants.lambda_linear_n_per_m,
    ];
    let least = stored
        .into_iter()
        .flatten()
        .filter(|l| *l > 0.0)
        .reduce(f64::min)
        .unwrap_or(0.0);
    FORCES_MOVE * bounds.pull * ratio(rms(offset_n), least * rms(heights)).min(1.0)
}

fn sampled_forces(
    route: &Route,
    bounds: &Bounds,
    positions: &[[f64; 3]],
    forces: &[f64],
) -> Result<Check, RunError> {
    let coils = route.scene.coils.len();
    let largest = forces.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let moment = route.scene.moment_a_m2;
    let places = spread(forces.len(), route.samples());
    let requested: Vec<(usize, [f64; 3])> = places
        .iter()
        .map(|index| (index % coils, positions[index / coils]))
        .collect();
    let exact = route.gradients(&requested)?;
    let worst = places
        .iter()
        .zip(&exact)
        .map(|(index, gradient)| {
            let exact: f64 = moment.iter().zip(gradient).map(|(m, g)| m * g).sum();
            (forces[*index] - exact).abs()
        })
        .fold(0.0, f64::max);
    let how = format!(
        "{} entries of the force matrix by an independent route",
        places.len()
    );
    // The estimate is relative to |grad B| at each height; the lowest points have the largest.
    let allowed = bounds.forces.max(10.0 * KERNEL_ERROR);
    Ok(check("forces", ratio(worst, largest), allowed, how))
}

/// 2 (max over the feasible z of s'z - s'x), s = G'r/n, weighted where points are: a fractional knapsack (physics of the
/// bound: the error is convex, so no feasible currents lie below its tangent).
fn duality_gap(problem: &ForceProblem, residual: &[f64], currents: &[f64]) -> f64 {
    let coils = currents.len();
    let weight = |point: usize| problem.weights.map_or(1.0, |all| all[point]);
    let whole: f64 = (0..residual.len()).map(weight).sum();
    let mut slope = vec![0.0; coils];
    let rows = problem.forces_n_per_a.chunks_exact(coils);
    for (point, (row, r)) in rows.zip(residual).enumerate() {
        for (s, g) in slope.iter_mut().zip(row) {
            *s += weight(point) * g * r / whole;
        }
    }
    // Start every coil at its better end, then give back the cheapest ones until the sum fits.
    let mut z: Vec<f64> = slope
        .iter()
        .enumerate()
        .map(|(i, s)| {
            if *s > 0.0 {
                problem.upper_a[i]
            } else {
                problem.lower_a[i]
            }
        })
        .collect();
    if let Some(total) = problem.total_max_a {
        let mut excess = z.iter().sum::<f64>() - total;
        let mut order: Vec<usize> = (0..coils).collect();
        order.sort_by(|a, b| slope[*a].total_cmp(&slope[*b]));
        for i in order {
            let back = excess.min(z[i] - problem.lower_a[i]).max(0.0);
            z[i] -= back;
            excess -= back;
        }
    }
    let gain: f64 = slope
        .iter()
        .zip(z.iter().zip(currents))
        .map(|(s, (z, x))| s * (z - x))
        .sum();
    (2.0 * gain).max(0.0)
}
