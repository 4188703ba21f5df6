//! The largest force constant with no point too weak.

use super::constraint_generation::Search;
use super::path::{ActivePoint, active};
use super::program::End;
use super::scaled::{Form, Limits, NOTHING, Scaled};
use crate::problem::{ForceProblem, ProblemError, Settings};
use crate::qr_reduction::{largest_entries, times_power};
use fluxform_numerics::real::Real;

/// The largest lambda with `G I + offset >= lambda h` at every point, and currents for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Maxmin {
    /// Force constant, N/m.
    pub lambda_n_per_m: f64,
    /// Currents, A.
    pub currents_a: Vec<f64>,
    /// The points that decide: no currents within the limits give all of them more.
    pub active: Vec<ActivePoint>,
}

/// Solves that linear program; `None` where no height is above zero, or where not even
/// `lambda = 0` can be held against the offset.
///
/// # Errors
/// Where the problem is malformed.
pub fn maxmin(problem: &ForceProblem) -> Result<Option<Maxmin>, ProblemError> {
    problem.validate(&Settings::default())?;
    Ok(largest(problem, &largest_entries(problem)))
}

/// The same for a problem that is well formed.
pub(crate) fn largest(problem: &ForceProblem, entries: &[f64]) -> Option<Maxmin> {
    let scaled = Scaled::new(problem, entries, Form::Least, Limits::All);
    if problem.height_m[scaled.highest] <= 0.0 {
        return None;
    }
    let followed = Search::new(&scaled, Form::Least).follow(&scaled);
    if followed.end != End::Whole {
        return None;
    }
    let piece = followed.pieces.last()?;
    let (currents, last) = piece.z.split_at(piece.z.len() - 1);
    let lambda = -last[0].to_f64();
    // Rounding of the forces that flow may turn zero round.
    let flowing: f64 = currents.iter().map(|x| x.to_f64().abs()).sum();
    let lambda = if lambda.abs() <= f64::EPSILON * flowing + NOTHING {
        0.0
    } else {
        lambda
    };
    (lambda >= 0.0).then(|| Maxmin {
        lambda_n_per_m: times_power(lambda, scaled.lambda_unit()),
        currents_a: scaled.currents_a(&piece.z),
        active: active(&followed, piece),
    })
}
