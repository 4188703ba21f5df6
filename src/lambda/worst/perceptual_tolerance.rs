//! The largest force constant whose errors nobody feels: at every point within a share of the
//! requested force there, or below what a finger feels at all.
//!
//! At fixed `lambda_k` every tolerance `max(w lambda h, c)` is one of its two terms, and with
//! that choice the largest lambda is a linear program. Neither term is above the tolerance, so
//! its solution keeps within it too, and it is not below `lambda_k`. The terms chosen at the
//! solution give the next program; where they no longer raise lambda, nothing just above it is
//! within the tolerances. There are as many programs as lambdas at which a choice changes, at
//! most. Where lambda = 0 is within the tolerances, as it is without an offset, all lambdas from
//! there to the result are; without an offset no lambda above it is.

use super::maxmin::{Maxmin, largest};
use crate::problem::{ForceProblem, ProblemError, Settings};
use crate::qr_reduction::largest_entries;

/// More programs than there are choices worth making.
const PROGRAMS: usize = 200;
/// A raise of lambda by a smaller part is rounding.
const NO_RAISE: f64 = 1e-13;

/// The largest force constant within the tolerances, currents for it, and what limits it.
#[derive(Debug, Clone, PartialEq)]
pub struct WithinTolerance {
    /// Force constant, N/m.
    pub lambda_n_per_m: f64,
    /// Currents, A.
    pub currents_a: Vec<f64>,
    /// The point whose error takes up most of its tolerance.
    pub point: usize,
    /// That part: 1 within rounding.
    pub part: f64,
}

/// The largest lambda up to which currents within the limits keep every point's error within
/// `max(share lambda h, threshold_n)`. `None` where there is no largest one (`share >= 1`, or no
/// height above zero), and where errors cannot all be kept within `threshold_n` at any lambda.
///
/// # Errors
/// Where the problem is malformed.
pub fn felt(
    problem: &ForceProblem,
    share: f64,
    threshold_n: f64,
) -> Result<Option<WithinTolerance>, ProblemError> {
    problem.validate(&Settings {
        jnd_weight: share,
        ..Settings::default()
    })?;
    if share >= 1.0 || problem.height_m.iter().all(|&h| h <= 0.0) {
        return Ok(None);
    }
    // Every point twice: the force too weak, and too strong.
    let forces: Vec<f64> = problem
        .forces_n_per_a
        .chunks_exact(problem.coils())
        .flat_map(|row| row.iter().copied().chain(row.iter().map(|g| -g)))
        .collect();
    let (mut lambda, mut best) = (0.0, None::<Maxmin>);
    for _ in 0..PROGRAMS {
        fluxform_base::progress::poll();
        let (mut heights, mut offsets) = (Vec::new(), Vec::new());
        for (j, &h) in problem.height_m.iter().enumerate() {
            let offset = problem.offset_n.map_or(0.0, |offset| offset[j]);
            let (part, fixed) = if share * lambda * h >= threshold_n {
                (share, 0.0)
            } else {
                (0.0, threshold_n)
            };
            heights.extend([(1.0 - part) * h, -(1.0 + part) * h]);
            offsets.extend([offset + fixed, fixed - offset]);
        }
        let doubled = ForceProblem {
            forces_n_per_a: &forces,
            height_m: &heights,
            offset_n: Some(&offsets),
            weights: None,
            ..*problem
        };
        let Some(found) = largest(&doubled, &largest_entries(&doubled)) else {
            break;
        };
        let raised = found.lambda_n_per_m > lambda * (1.0 + NO_RAISE);
        if raised || best.is_none() {
            lambda = found.lambda_n_per_m;
            best = Some(found);
        }
        if !raised {
            break;
        }
    }
    Ok(best.map(|found| {
        let (point, part) = most_of_tolerance(problem, &found, share, threshold_n);
        WithinTolerance {
            lambda_n_per_m: found.lambda_n_per_m,
            currents_a: found.currents_a,
            point,
            part,
        }
    }))
}

/// The point whose error takes up most of its tolerance.
fn most_of_tolerance(
    problem: &ForceProblem,
    found: &Maxmin,
    share: f64,
    threshold_n: f64,
) -> (usize, f64) {
    let rows = problem.forces_n_per_a.chunks_exact(problem.coils());
    let parts = rows.zip(problem.height_m).enumerate().map(|(j, (row, h))| {
        let requested = found.lambda_n_per_m * h;
        let offset = problem.offset_n.map_or(0.0, |offset| offset[j]);
        let pushed: f64 = row.iter().zip(&found.currents_a).map(|(g, i)| g * i).sum();
        let error = (requested - offset - pushed).abs();
        (j, error / (share * requested).max(threshold_n))
    });
    parts.fold(
        (0, 0.0),
        |most, next| if next.1 > most.1 { next } else { most },
    )
}
