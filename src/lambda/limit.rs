//! How far a force constant is from its limit of ever more points.
//!
//! The mean over an object is an integral over its plan area, and the points are nodes of a rule for
//! it. Every second point along both axes, in each of the four ways to choose them, is a rule of
//! twice the spacing: its weights are those of all points, the points between handing theirs to
//! their neighbours. Where the error falls with the second power of the spacing, those rules are off
//! four times as far, so they differ from all points by three times the error of these; where
//! heights jump, errors depend on where the jump falls among the nodes, and the four rules show how
//! much. The largest difference, with a margin, is the estimate.
//!
//! Points that count alike give another limit than the object's, off by the first power of the
//! spacing: their border counts twice. The difference from the same points by area is added.

use super::problem::{ForceProblem, ProblemError, Settings};
use super::solve::constant;

/// Ways to choose every second point along two axes; of scattered points every fourth.
const SUBSETS: usize = 4;
/// Of the largest difference: of 1800 random objects it alone fell short of the error in 12, by a
/// factor of 1.7 at most, where the errors of different parts of a surface cancel in one rule and
/// not in another.
const MARGIN: f64 = 1.8;
/// The same where the surface ends inside the grid: what lies between the last points and the
/// silhouette is in no subset, and with some grids it cancels in all four; a cap on nothing fell short
/// of its error by a factor of 2.4 with the margin of whole grids.
const MARGIN_AT_RIMS: f64 = 5.0;

/// Where points lie in a grid.
#[derive(Debug, Clone, Copy)]
pub struct GridPlaces<'a> {
    /// Grid points along x.
    pub columns: usize,
    /// Grid points along y.
    pub rows: usize,
    /// row * columns + column of each point, ascending.
    pub index: &'a [usize],
}

/// A force constant against the object's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitError {
    /// Estimate of |lambda / limit - 1|.
    pub estimate: f64,
    /// lambda by the points' areas, N/m: the nearest to the limit that these points give.
    pub by_area_n_per_m: f64,
}

/// The error of the chosen constant of `problem`, which is `lambda_n_per_m`, against the limit of
/// ever more points. `areas` holds the plan area that each point stands for (> 0, any unit), whether
/// or not the problem weighs by it. Of points on no grid (`places` is `None`) every fourth is taken,
/// which is an estimate where they are spread at random. `None` where a subset has no constant, and
/// for fewer than three points along both axes.
///
/// # Errors
/// A malformed problem.
pub fn limit_error(
    problem: &ForceProblem,
    lambda_n_per_m: f64,
    areas: &[f64],
    places: Option<GridPlaces>,
    settings: &Settings,
) -> Result<Option<LimitError>, ProblemError> {
    let settings = Settings {
        at_n_per_m: None,
        ..*settings
    };
    let by_area = ForceProblem {
        weights: Some(areas),
        ..*problem
    };
    let Some(all) = constant(&by_area, &settings)?.filter(|lambda| *lambda > 0.0) else {
        return Ok(None);
    };
    let mut largest = 0.0_f64;
    let mut subsets = 0;
    for which in 0..SUBSETS {
        let weights = match places {
            Some(places) => places.subset(areas, which),
            None => Some(every_fourth(areas, which)),
        };
        let Some(weights) = weights else { continue };
        let Some(other) = Subset::of(problem, &weights).constant(problem, &settings)? else {
            return Ok(None);
        };
        largest = largest.max((other / all - 1.0).abs());
        subsets += 1;
    }
    let by_rule = (lambda_n_per_m / all - 1.0).abs();
    let margin = if places.is_some_and(|places| places.has_rims()) {
        MARGIN_AT_RIMS
    } else {
        MARGIN
    };
    Ok((subsets > 0).then_some(LimitError {
        estimate: by_rule + margin * largest,
        by_area_n_per_m: all,
    }))
}

fn every_fourth(areas: &[f64], which: usize) -> Vec<f64> {
    let weight = |(point, area): (usize, &f64)| match point % SUBSETS == which {
        true => *area,
        false => 0.0,
    };
    areas.iter().enumerate().map(weight).collect()
}

impl GridPlaces<'_> {
    /// Whether the surface ends inside the grid.
    fn has_rims(&self) -> bool {
        self.index.len() < self.columns * self.rows
    }

    /// The weights of every second point along both axes, the `which`-th of four ways; 0 where a point
    /// is left out. `None` where no axis has three points.
    fn subset(&self, areas: &[f64], which: usize) -> Option<Vec<f64>> {
        let mut row_of = vec![usize::MAX; self.columns * self.rows];
        for (row, &place) in self.index.iter().enumerate() {
            row_of[place] = row;
        }
        if self.columns.max(self.rows) < 3 {
            return None;
        }
        let first = [which % 2, which / 2];
        let is_point = |place: usize| row_of[place] != usize::MAX;
        // The nodes that take over from one along an axis, `step` apart. Ends of the grid stay: a rule that
        // reaches beyond its nodes has other errors, which may cancel those it is to show. Where the
        // surface ends inside the grid all points together reach beyond theirs, so a subset does too.
        let takes = |axis: usize, place: usize| -> [Option<usize>; 2] {
            let (step, samples) = [(1, self.columns), (self.columns, self.rows)][axis];
            let at = place / step % samples;
            let inner = at > 0 && at + 1 < samples;
            // Counted from the nearer end, so that both ends have cells of twice the width at once.
            let counted = at.min(samples - 1 - at);
            let heirs = if counted % 2 != first[axis] && inner {
                [place - step, place + step].map(|heir| Some(heir).filter(|heir| is_point(*heir)))
            } else {
                [None; 2]
            };
            if heirs == [None; 2] {
                [Some(place), None]
            } else {
                heirs
            }
        };
        let mut weights = vec![0.0; areas.len()];
        for (&place, &area) in self.index.iter().zip(areas) {
            let mut heirs = [usize::MAX; 4];
            let mut count = 0;
            for beside in takes(0, place).into_iter().flatten() {
                let column = beside % self.columns;
                for above in takes(1, place).into_iter().flatten() {
                    let heir = row_of[above / self.columns * self.columns + column];
                    if heir != usize::MAX {
                        heirs[count] = heir;
                        count += 1;
                    }
                }
            }
            for &heir in &heirs[..count] {
                weights[heir] += area / count as f64;
            }
        }
        Some(weights)
    }
}

/// The points of a problem whose weight is above zero.
struct Subset {
    forces_n_per_a: Vec<f64>,
    height_m: Vec<f64>,
    offset_n: Option<Vec<f64>>,
    weights: Vec<f64>,
}

impl Subset {
    fn of(problem: &ForceProblem, weights: &[f64]) -> Self {
        let rows: Vec<usize> = (0..weights.len())
            .filter(|&row| weights[row] > 0.0)
            .collect();
        let pick = |values: &[f64]| rows.iter().map(|&row| values[row]).collect();
        let coils = problem.coils();
        let mut forces_n_per_a = Vec::with_capacity(rows.len() * coils);
        for &row in &rows {
            let forces = &problem.forces_n_per_a[row * coils..(row + 1) * coils];
            forces_n_per_a.extend_from_slice(forces);
        }
        Self {
            forces_n_per_a,
            height_m: pick(problem.height_m),
            offset_n: problem.offset_n.map(pick),
            weights: pick(weights),
        }
    }

    fn constant(
        &self,
        problem: &ForceProblem,
        settings: &Settings,
    ) -> Result<Option<f64>, ProblemError> {
        if self.height_m.is_empty() {
            return Ok(None);
        }
        let subset = ForceProblem {
            forces_n_per_a: &self.forces_n_per_a,
            height_m: &self.height_m,
            offset_n: self.offset_n.as_deref(),
            weights: Some(&self.weights),
            ..*problem
        };
        match constant(&subset, settings) {
            // Too weak at these points alone: there is nothing to compare.
            Err(ProblemError::TooWeak { .. }) => Ok(None),
            other => other,
        }
    }
}
