//! The largest force constant with no point too weak.

use super::constraint_generation::Search;
use super::doubles::{Doubles, Failure};
use super::path::{ActivePoint, active};
use super::program::{End, Piece, Work};
use super::scaled::{Form, Limits, NOTHING, Scaled};
use crate::problem::{ForceProblem, ProblemError, Settings};
use crate::qr_reduction::{largest_entries, times_power};
use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

/// Work up to which the program is solved in double-double throughout.
const WORK: Work = Work(2_000_000);
/// The same where doubles do not lead to a solution.
const LAST_WORK: Work = Work(100_000_000);

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
    let (piece, active) = solution(&scaled)?;
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
        active,
    })
}

/// The program's optimum and the points that decide it: exactly where that is little work, else in
/// doubles with an exact finish.
fn solution(scaled: &Scaled) -> Option<(Piece, Vec<ActivePoint>)> {
    let exactly = |mut work: Work| {
        let followed = Search::new(scaled, Form::Least).follow(scaled, &mut work);
        let last = followed.pieces.last().cloned();
        let piece = last.map(|piece| {
            let active = active(&followed.rows, &piece);
            (piece, active)
        });
        (followed.end, piece)
    };
    if scaled.within(WORK) {
        match exactly(WORK) {
            (End::Whole, solution) => return solution,
            (End::Infeasible, _) => return None,
            (End::Stalled | End::Costly, _) => {}
        }
    }
    let mut doubles = Doubles::new(scaled, Form::Least);
    match doubles.at(Num::ZERO) {
        Ok(optimum) => {
            let active = active(doubles.rows(), &optimum.piece);
            Some((optimum.piece, active))
        }
        Err(Failure::Infeasible) => None,
        Err(Failure::Stalled) => match exactly(LAST_WORK) {
            (End::Whole, solution) => solution,
            (End::Infeasible | End::Stalled | End::Costly, _) => None,
        },
    }
}
