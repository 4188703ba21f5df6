//! The least largest error over lambda. Exact, without a knob: what is swept is its size.

use super::{Measured, curve, stage};
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::force::forces;
use crate::inputs::SEED_AIR;
use crate::test_surface::dome_m;
use fluxform::RunError;
use fluxform::lambda::Settings;
use fluxform::lambda::worst::worst_point;
use fluxform::progress::Progress;

/// Points along either axis of the plan.
const SAMPLES: [usize; 6] = [6, 11, 21, 31, 61, 121];
const DEFAULT: usize = 61;
/// Places along the path where it is proven.
const PROVEN: [f64; 3] = [0.7, 1.0, 1.3];

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    let (sizes, stated) = sizes(pace, progress)?;
    Ok(Measured {
        curves: StageCurves {
            stage: "worst-point".to_owned(),
            timed: "the whole path over lambda, with and without upper limits, forces given"
                .to_owned(),
            error_of: "the largest error".to_owned(),
            default: "no knob: exact, in double-double over the points that decide".to_owned(),
            curves: vec![sizes],
        },
        accuracy: stage(
            stated,
            "lambda max h",
            "rounding of the forces of the points that are not in the program",
        ),
    })
}

fn sizes(pace: &Pace, progress: &dyn Progress) -> Result<(Curve, f64), RunError> {
    let mut rows = Vec::new();
    let mut stated = 0.0_f64;
    for &samples in pace.settings(&SAMPLES, 4) {
        let given = forces(&SEED_AIR, 3, samples, dome_m)?;
        let problem = given.problem();
        let (solution, timing) = pace.time(progress, || {
            Ok(worst_point(&problem, &Settings::default())?)
        })?;
        let jnd = solution.lambda_jnd_n_per_m.unwrap_or(1.0);
        let gap = PROVEN.iter().fold(0.0_f64, |most, part| {
            let point = solution.at(&problem, part * jnd);
            most.max(point.gap_n / point.worst_error_n)
        });
        stated = solution.accuracy.estimate;
        let found = Found {
            knob: samples as f64,
            default: samples == DEFAULT,
            items: given.height_m.len(),
            error: if solution.complete { gap } else { f64::NAN },
            stated: Some(stated),
        };
        rows.push(found.timed(&timing));
    }
    let curve = curve(
        "the seed's array in air under a dome",
        "points along x and y",
        "lower bound by the multipliers, computed from the points: a bound",
        0.0,
        rows,
    );
    Ok((curve, stated))
}
