//! The worst-point form of a bundle against forces computed again.

use super::{Check, RunError, check, difference, ratio};
use crate::bundle::lambda_file::WorstPointFile;
use crate::lambda::worst::{lower_bound_n, worst_point};
use crate::lambda::{ForceProblem, Settings, Status};

/// Constants solved for again, the largest error at any point, and the proof that the points
/// named in the file give: no currents within the limits bring it much lower. `status` is that of
/// the mean square's solution: where nothing is rendered there are no constants.
pub(super) fn checks(
    problem: &ForceProblem,
    settings: &Settings,
    status: Status,
    stored: &WorstPointFile,
    lambda_n_per_m: Option<f64>,
    agrees: f64,
) -> Result<Vec<Check>, RunError> {
    let again = worst_point(problem, settings)?;
    let rendered = |lambda: Option<f64>| lambda.filter(|_| status != Status::NothingRendered);
    let constants = [
        (
            stored.lambda_linear_n_per_m,
            rendered(again.lambda_linear_n_per_m),
        ),
        (
            stored.lambda_jnd_n_per_m,
            rendered(again.lambda_jnd_n_per_m),
        ),
    ];
    let worst = constants
        .iter()
        .map(|(stored, again)| difference(stored.as_slice(), again.as_slice()))
        .fold(0.0, f64::max);
    let how = "the worst-point force constants solved for again";
    let mut checks = vec![check("worst-point lambda", worst, agrees, how.to_owned())];
    let (Some(lambda), Some(currents), Some(error), Some(active)) = (
        lambda_n_per_m,
        &stored.currents_a,
        stored.worst_error_n,
        &stored.active,
    ) else {
        return Ok(checks);
    };
    let largest_of = |values: &[f64]| values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    // Of lambda = 0 the pull is all that is requested.
    let requested = match problem.offset_n {
        Some(pull) if lambda == 0.0 => largest_of(pull),
        _ => lambda * largest_of(problem.height_m),
    };
    let coils = problem.coils();
    let points = problem.points();
    if currents.len() != coils || active.iter().any(|active| active.point >= points) {
        let how = "currents and points that the file names do not exist";
        checks.push(check("worst-point error", f64::MAX, agrees, how.to_owned()));
        return Ok(checks);
    }
    let rows = problem.forces_n_per_a.chunks_exact(coils);
    let largest = rows.enumerate().fold(0.0_f64, |most, (point, row)| {
        let pull = problem.offset_n.map_or(0.0, |offset| offset[point]);
        let pushed: f64 = row.iter().zip(currents).map(|(g, i)| g * i).sum();
        most.max((lambda * problem.height_m[point] - pull - pushed).abs())
    });
    let how = "the largest error of the worst-point currents over all points";
    checks.push(check(
        "worst-point error",
        ratio((error - largest).abs(), requested),
        agrees,
        how.to_owned(),
    ));
    let gap = largest - lower_bound_n(problem, lambda, active);
    let how = "proof of optimality from the points that decide";
    checks.push(check(
        "worst-point gap",
        ratio(gap.max(0.0), requested),
        agrees,
        how.to_owned(),
    ));
    Ok(checks)
}

/// With the criterion maxmin: how much the weakest point lacks.
pub(super) fn weakest_point(residual_n: &[f64], wanted_n: f64, allowed: f64) -> Check {
    let lacks = residual_n.iter().copied().fold(0.0, f64::max);
    let how = "the force that the weakest point lacks";
    check(
        "weakest point",
        ratio(lacks, wanted_n),
        allowed,
        how.to_owned(),
    )
}
