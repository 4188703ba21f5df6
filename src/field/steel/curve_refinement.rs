//! Solutions along a magnetisation curve: how they are refined, and the error that is stated of
//! them, for one coil and for arrays.
//!
//! Edges converge as their grading says. Where the curve's kinks cross the elements, which wander
//! with the state, errors of consecutive degrees are of one size and of either sign: a try is
//! three solutions, of which the two coarser ones differ by their elements' degree alone, and
//! states what [`error_of_finest`] makes of them.

use super::generatrix::Resolution;
use fluxform_numerics::refinement::error_of_finest;

/// How much smaller a panel is than its neighbour away from the edge, from try to try: the curve's
/// kinks cross the elements inside, where shorter ones help and higher degrees hardly do. After
/// the last a tolerance that is not reached is given up, with its estimate.
const RATIOS: [f64; 4] = [0.2, 0.35, 0.5, 0.5];
/// The coarsest of three solutions needs two nodes a panel.
const LEAST_ORDER: usize = 4;
/// The outline's aim from one try to the next.
const FINER: f64 = 0.3;

/// One of the three solutions of a try.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    /// As [`Level::Coarse`], of elements of a lower degree.
    Coarsest,
    /// A panel and a degree coarser than [`Level::Fine`].
    Coarse,
    /// The one whose error is stated.
    Fine,
}

/// How finely the solutions of one try are cut.
#[derive(Debug, Clone, Copy)]
pub(super) struct Try {
    /// The error that the outline aims at.
    pub(super) aim: f64,
    ratio: f64,
}

impl Try {
    /// The first one for `tolerance`.
    pub(super) fn first(tolerance: f64) -> Self {
        Self {
            aim: tolerance,
            ratio: RATIOS[0],
        }
    }

    /// The outline of one of the try's solutions; `of_aim` is that of linear steel.
    pub(super) fn outline(&self, level: Level, of_aim: Resolution) -> Resolution {
        let fine = Resolution {
            ratio: self.ratio,
            order: of_aim.order.max(LEAST_ORDER),
            ..of_aim
        };
        let coarse = fine.coarser();
        match level {
            Level::Fine => fine,
            Level::Coarse => coarse,
            Level::Coarsest => Resolution {
                order: coarse.order - 1,
                ..coarse
            },
        }
    }
}

/// A problem along a curve that can be solved at any resolution.
pub(super) trait AlongCurve {
    /// A solution at one resolution.
    type Solution;
    /// Why there is none.
    type Error;

    /// Solves; `start` is a coarser solution of the same try.
    ///
    /// # Errors
    /// As the problem has them.
    fn solve(
        &self,
        of: &Try,
        level: Level,
        start: Option<&Self::Solution>,
    ) -> Result<Self::Solution, Self::Error>;

    /// How much two solutions differ in what the error is stated of, relative; infinite where
    /// either cannot be used.
    ///
    /// # Errors
    /// As the problem has them.
    fn difference(&self, a: &Self::Solution, b: &Self::Solution) -> Result<f64, Self::Error>;

    /// Error that a try keeps however finely its outline is cut, relative.
    fn floor(&self, of: &Try) -> f64;
}

/// The solutions of one try and their error.
#[derive(Debug)]
pub(super) struct Refined<S> {
    /// The finest.
    pub(super) fine: S,
    /// The next coarser one and the coarsest.
    pub(super) coarser: [S; 2],
    /// Stated error of the finest.
    pub(super) error: f64,
}

/// Solves to a stated error below `tolerance`, or as far as the tries go; `coarsest` is the
/// coarsest solution of the first try, where it is known.
///
/// # Errors
/// As the problem has them.
pub(super) fn refined<P: AlongCurve>(
    problem: &P,
    first: Try,
    tolerance: f64,
    mut coarsest: Option<P::Solution>,
) -> Result<Refined<P::Solution>, P::Error> {
    let mut of = first;
    let mut best: Option<Refined<P::Solution>> = None;
    for (index, ratio) in RATIOS.into_iter().enumerate() {
        of.ratio = ratio;
        let floor = problem.floor(&of);
        let coarsest = match coarsest.take() {
            Some(known) => known,
            None => problem.solve(&of, Level::Coarsest, None)?,
        };
        let coarse = problem.solve(&of, Level::Coarse, Some(&coarsest))?;
        let before = problem.difference(&coarse, &coarsest)?;
        // Finer outlines mend neither states that cannot be used nor what caps leave.
        let is_last = index + 1 == RATIOS.len() || !before.is_finite() || floor > tolerance;
        // Whatever the finest solution is, the tolerance would not be reached.
        if error_of_finest(0.0, before) > tolerance && !is_last {
            of.aim *= FINER;
            continue;
        }
        let fine = problem.solve(&of, Level::Fine, Some(&coarse))?;
        let last = problem.difference(&fine, &coarse)?;
        let error = error_of_finest(last, before).max(floor);
        let better = best.as_ref().is_none_or(|best| error < best.error);
        if better {
            let coarser = [coarse, coarsest];
            best = Some(Refined {
                fine,
                coarser,
                error,
            });
        }
        if is_last || error <= tolerance {
            break;
        }
        of.aim *= FINER;
    }
    Ok(best.expect("the last try is solved to its end"))
}
