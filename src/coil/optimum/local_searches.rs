//! Problems with the best local optimum known of each, and local searches from many starts.

use rayon::prelude::*;

use super::domain::Contradiction;
use super::model::Window;
use super::problem::{LimitName, Problem};
use super::sqp::{self, FEASIBLE, Local, Smooth};
use fluxform_base::progress::{Interrupted, Progress};

/// How the search is carried out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Local searches for each wire and regime.
    pub starts: usize,
    /// Shifts the sequence of starts.
    pub seed: u64,
    /// Boxes that a certificate may take; 0 for none.
    pub cells: usize,
    /// Another coil to start from.
    pub initial: Option<Window>,
    /// Whether the range of nearly equal bores is requested.
    pub valley: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            starts: 24,
            seed: 1,
            cells: 4_000_000,
            initial: None,
            valley: true,
        }
    }
}

/// One problem and the best local optimum known of it.
pub(super) struct Solved<'a> {
    pub problem: Problem<'a>,
    pub best: Option<Local>,
    pub contradiction: Option<Contradiction>,
    pub missing: Vec<LimitName>,
    pub evaluations: usize,
    pub starts: usize,
}

impl Solved<'_> {
    pub fn force_n(&self) -> Option<f64> {
        self.best
            .as_ref()
            .map(|local| (-local.point.objective).exp())
    }
}

pub(super) fn best_of<'b, 'a>(problems: &'b [Solved<'a>]) -> Option<&'b Solved<'a>> {
    let mut winner: Option<&Solved<'_>> = None;
    for solved in problems {
        let force = solved.force_n().unwrap_or(0.0);
        if force > winner.and_then(Solved::force_n).unwrap_or(0.0) {
            winner = Some(solved);
        }
    }
    winner
}

/// Local searches of all problems together.
pub(super) fn starts_of(problems: &[Solved<'_>]) -> usize {
    problems.iter().map(|solved| solved.starts).sum()
}

pub(super) fn keep_better(problem: &Problem<'_>, best: &mut Option<Local>, local: Local) {
    let feasible = local.violation(problem) <= FEASIBLE;
    let better = best
        .as_ref()
        .is_none_or(|best| local.point.objective < best.point.objective);
    if feasible && better {
        *best = Some(local);
    }
}

/// Where local searches from `points` end, each `items` of progress.
pub(super) fn locals(
    problem: &(impl Smooth + Sync),
    points: Vec<[f64; 3]>,
    items: u64,
    progress: &dyn Progress,
) -> Result<Vec<Local>, Interrupted> {
    let found: Vec<Result<Option<Local>, Interrupted>> = points
        .into_par_iter()
        .map(|x| {
            progress.check()?;
            let local = sqp::solve(problem, x);
            progress.advance(items);
            Ok(local)
        })
        .collect();
    let mut ends = Vec::new();
    for local in found {
        ends.extend(local?);
    }
    Ok(ends)
}

/// Most ends of a draft's searches that are searched from again.
const PROMISING: usize = 6;
/// Ends closer than this in every coordinate are one.
const SAME: f64 = 0.03;

/// The different ends of searches on a draft that may be the best one: of those that meet the
/// limits, or else those that violate them least.
pub(super) fn promising(
    draft: &impl Smooth,
    doubt: impl Fn([f64; 3]) -> f64,
    mut ends: Vec<Local>,
) -> Vec<[f64; 3]> {
    let met = |local: &Local| local.violation(draft) <= 1e3 * FEASIBLE;
    if ends.iter().any(met) {
        ends.retain(met);
        ends.sort_by(|a, b| a.point.objective.total_cmp(&b.point.objective));
        let sure = |best: f64, local: &Local| best.min(local.point.objective + doubt(local.x));
        let best = ends.iter().fold(f64::INFINITY, sure);
        ends.retain(|local| local.point.objective - doubt(local.x) <= best);
    } else {
        ends.sort_by(|a, b| a.violation(draft).total_cmp(&b.violation(draft)));
    }
    let mut kept: Vec<[f64; 3]> = Vec::new();
    for local in ends {
        let is_same = |x: &[f64; 3]| (0..3).all(|i| (x[i] - local.x[i]).abs() < SAME);
        if kept.len() < PROMISING && !kept.iter().any(is_same) {
            kept.push(local.x);
        }
    }
    kept
}
