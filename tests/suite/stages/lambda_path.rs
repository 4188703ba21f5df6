//! The force constant's path. It is exact and has no knob; what is swept is how hard the problem
//! is, and how large.

use serde::Deserialize;

use super::{Measured, curve, stage};
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::force::{Forces, forces};
use crate::inputs::{LAMBDA, SEED_AIR};
use crate::test_surface::dome_m;
use fluxform::RunError;
use fluxform::lambda::{self, ForceProblem, Settings, Solution};
use fluxform::progress::Progress;

/// Points along either axis of the plan.
const SAMPLES: [usize; 7] = [11, 21, 31, 61, 121, 241, 481];
const DEFAULT: usize = 61;

#[derive(Deserialize)]
struct Oracle {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    forces_n_per_a: Vec<f64>,
    height_m: Vec<f64>,
    lower_a: Vec<f64>,
    upper_a: Vec<f64>,
    total_max_a: Option<f64>,
    points: Vec<Point>,
}

#[derive(Deserialize)]
struct Point {
    lambda_n_per_m: f64,
    relative_error: String,
}

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    let sizes = sizes(pace, progress)?;
    let stated = sizes.rows.iter().find(|row| row.default);
    let stated = stated.and_then(|row| row.stated_error).unwrap_or(2e-14);
    Ok(Measured {
        curves: StageCurves {
            stage: "lambda-path".to_owned(),
            timed: "the whole path over lambda and the constants on it, forces given".to_owned(),
            error_of: "lambda^2 mean(h^2)".to_owned(),
            default: "no knob: exact; doubles or double-double as the problem asks".to_owned(),
            curves: vec![sizes, conditions(pace, progress)?],
        },
        accuracy: stage(
            stated,
            "lambda^2 mean(h^2)",
            "first-order effect of the columns' rounding",
        ),
    })
}

fn number(text: &str) -> f64 {
    text.parse().unwrap_or(f64::NAN)
}

/// Largest error of e*.
fn error_of(case: &Case, solution: &Solution) -> f64 {
    let mean = case.height_m.iter().map(|h| h * h).sum::<f64>() / case.height_m.len() as f64;
    let mut worst = 0.0_f64;
    for point in &case.points {
        let scale = point.lambda_n_per_m.powi(2) * mean;
        let found = solution.path.error_n2(point.lambda_n_per_m) / scale;
        worst = worst.max((found - number(&point.relative_error)).abs());
    }
    worst
}

/// Nine coils whose forces are ever more alike.
fn conditions(pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let oracle: Oracle = LAMBDA.values()?;
    // Two kinds of problem a condition number, which ends their names.
    let conditions: Vec<f64> = oracle
        .cases
        .iter()
        .filter_map(|case| case.name.strip_prefix("spread ")?.parse().ok())
        .collect();
    let mut rows = Vec::new();
    for &condition in pace.settings(&conditions, conditions.len()) {
        let ours = |case: &&Case| {
            let ending = case.name.split(' ').next_back();
            ending.and_then(|text| text.parse().ok()) == Some(condition)
        };
        let cases: Vec<&Case> = oracle.cases.iter().filter(ours).collect();
        let (found, timing) = pace.time(progress, || {
            let solve = |case: &&Case| {
                let problem = ForceProblem {
                    forces_n_per_a: &case.forces_n_per_a,
                    height_m: &case.height_m,
                    offset_n: None,
                    weights: None,
                    lower_a: &case.lower_a,
                    upper_a: &case.upper_a,
                    total_max_a: case.total_max_a,
                    resistance_ohm: &vec![6.0; case.upper_a.len()],
                };
                Ok(lambda::solve(&problem, &Settings::default())?)
            };
            cases
                .iter()
                .map(solve)
                .collect::<Result<Vec<_>, RunError>>()
        })?;
        let pairs = found.iter().zip(&cases);
        let error = pairs.fold(0.0_f64, |most, (found, case)| {
            most.max(error_of(case, found))
        });
        let stated = found
            .iter()
            .fold(0.0_f64, |m, s| m.max(s.accuracy.estimate));
        let found = Found {
            knob: condition,
            default: false,
            items: cases.len(),
            error,
            stated: Some(stated),
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        "nine coils, 14 points, forces ever more alike",
        "condition number",
        "exact rational numbers, lambda.py",
        1e-16,
        rows,
    ))
}

/// The seed's array in air under a dome.
fn sizes(pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let mut rows = Vec::new();
    for &samples in pace.settings(&SAMPLES, 5) {
        let given: Forces = forces(&SEED_AIR, 3, samples, dome_m)?;
        let problem = given.problem();
        let (solution, timing) = pace.time(progress, || {
            Ok(lambda::solve(&problem, &Settings::default())?)
        })?;
        let gap = solution.chosen.as_ref().map_or(f64::NAN, |chosen| {
            let mean =
                given.height_m.iter().map(|h| h * h).sum::<f64>() / given.height_m.len() as f64;
            chosen.duality_gap_n2 / (chosen.lambda_n_per_m.powi(2) * mean)
        });
        let found = Found {
            knob: samples as f64,
            default: samples == DEFAULT,
            items: given.height_m.len(),
            error: gap,
            stated: Some(solution.accuracy.estimate),
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        "the seed's array in air under a dome",
        "points along x and y",
        "duality gap at lambda_jnd, from the points and not from the solver: a bound",
        0.0,
        rows,
    ))
}
