//! How far a force constant is from its limit of ever more points.
//!
//! The mean over an object is an integral over its plan area, and the points are nodes of a rule for
//! it. Where the surface ends or breaks within a cell of the grid, the corners describe it badly: finer
//! samples of those cells take the corners' place, and the difference that they make is what these cells
//! are off by; every second sample says how far the samples are off.
//!
//! In the smooth cells every second point along both axes, in each of the four ways to choose them, is
//! a rule of twice the spacing: its weights are those of all points, the points between handing theirs
//! to their neighbours. The error falls with the second power of the spacing, those rules are off four
//! times as far, so they differ from all points by three times the error of these. The largest
//! difference, with a margin, is the estimate.
//!
//! Points that count alike give another limit than the object's, off by the first power of the
//! spacing: their border counts twice. The difference from the same points by area is in the first one.

use super::problem::{ForceProblem, ProblemError, Settings};
use super::solve::constant;

/// Ways to choose every second point along two axes; of scattered points every fourth.
const SUBSETS: usize = 4;
/// Of the largest difference: of 3000 random objects 2, both caps that end in a steep rim on a grid of 13
/// to 37 points a side, are further off than stated, by a factor of 2.2 at most.
const MARGIN: f64 = 1.8;
/// Of the difference that samples of broken cells make, beyond that difference itself.
const MARGIN_OF_CELLS: f64 = 1.5;
/// Of the difference that every second sample makes, which is off twice as far and more.
const MARGIN_OF_SAMPLES: f64 = 1.5;

/// Where points lie in a grid.
#[derive(Debug, Clone, Copy)]
pub struct GridPlaces<'a> {
    /// Grid points along x.
    pub columns: usize,
    /// Grid points along y.
    pub rows: usize,
    /// row * columns + column of each point, ascending.
    pub index: &'a [usize],
    /// Whether each cell, x fastest, is smooth; empty where all are.
    pub smooth: &'a [bool],
}

/// Samples of the cells that are not smooth, one entry each, and what is left to the points.
#[derive(Debug, Clone, Copy)]
pub struct FineSamples<'a> {
    /// Force per ampere of every coil, N/A: one row a sample.
    pub forces_n_per_a: &'a [f64],
    /// Height of each, m.
    pub height_m: &'a [f64],
    /// Force without any current, N; `None`: none.
    pub offset_n: Option<&'a [f64]>,
    /// Plan area of each, in the unit of the points' areas.
    pub areas: &'a [f64],
    /// The same where every second sample along both axes stands for all; 0 for the others.
    pub coarse_areas: &'a [f64],
    /// The area of each point in smooth cells alone (>= 0).
    pub point_areas: &'a [f64],
}

/// Estimate of |lambda / limit - 1| of the chosen constant of `problem`, which is `lambda_n_per_m`,
/// against the limit of ever more points. `areas` holds the plan area that each point stands for (> 0,
/// any unit), whether or not the problem weighs by it; `fine` takes the place of the points in cells
/// that are not smooth. Of points on no grid (`places` is `None`) every fourth is taken, which is an
/// estimate where they are spread at random. `None` where a subset has no constant, and for fewer than
/// three points along both axes.
///
/// # Errors
/// A malformed problem.
pub fn limit_error(
    problem: &ForceProblem,
    lambda_n_per_m: f64,
    areas: &[f64],
    places: Option<GridPlaces>,
    fine: Option<FineSamples>,
    settings: &Settings,
) -> Result<Option<f64>, ProblemError> {
    let settings = Settings {
        at_n_per_m: None,
        ..*settings
    };
    let by_area = ForceProblem {
        weights: Some(areas),
        ..*problem
    };
    let Some(by_points) = constant(&by_area, &settings)?.filter(|lambda| *lambda > 0.0) else {
        return Ok(None);
    };
    let (areas, nearest) = match fine {
        Some(fine) => {
            let all = Rows::of(problem, fine.point_areas, Some((fine, fine.areas)));
            (fine.point_areas, all.constant(problem, &settings)?)
        }
        None => (areas, Some(by_points)),
    };
    let Some(nearest) = nearest else {
        return Ok(None);
    };
    let differs = |points: &[f64], samples: Option<&[f64]>| -> Result<_, ProblemError> {
        let rows = Rows::of(problem, points, fine.zip(samples));
        let other = rows.constant(problem, &settings)?;
        Ok(other.map(|other| (other / nearest - 1.0).abs()))
    };
    let (mut of_spacing, mut of_samples) = (None::<f64>, 0.0_f64);
    for which in 0..SUBSETS {
        let weights = match places {
            Some(places) => places.subset(areas, which),
            None => Some(every_fourth(areas, which)),
        };
        let Some(weights) = weights else { continue };
        let Some(off) = differs(&weights, fine.map(|fine| fine.areas))? else {
            return Ok(None);
        };
        of_spacing = Some(of_spacing.unwrap_or(0.0).max(off));
    }
    if let Some(fine) = fine {
        let Some(off) = differs(areas, Some(fine.coarse_areas))? else {
            return Ok(None);
        };
        of_samples = off;
    }
    let off = (lambda_n_per_m / nearest - 1.0).abs();
    let of_cells = (by_points / nearest - 1.0).abs();
    Ok(of_spacing.map(|of_spacing| {
        off + MARGIN * of_spacing + MARGIN_OF_CELLS * of_cells + MARGIN_OF_SAMPLES * of_samples
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
    /// Whether a weight may be handed along the side from `place` to the next along `axis`: whether it
    /// belongs to a smooth cell.
    fn passes(&self, place: usize, axis: usize) -> bool {
        if self.smooth.is_empty() {
            return true;
        }
        let [column, row] = [place % self.columns, place / self.columns];
        let [across, up] = [self.columns - 1, self.rows - 1];
        let smooth = |column: usize, row: usize| {
            column < across && row < up && self.smooth[row * across + column]
        };
        // The cell on the side's other hand starts one before along the other axis.
        let before = match axis {
            0 => row > 0 && smooth(column, row - 1),
            _ => column > 0 && smooth(column - 1, row),
        };
        before || smooth(column, row)
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
                [place - step, place + step].map(|heir| {
                    Some(heir).filter(|heir| is_point(*heir) && self.passes(place.min(*heir), axis))
                })
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

/// The points of a problem whose weight is above zero, and samples beside them.
struct Rows {
    forces_n_per_a: Vec<f64>,
    height_m: Vec<f64>,
    offset_n: Option<Vec<f64>>,
    weights: Vec<f64>,
}

impl Rows {
    /// The points by `weights`, and the samples by theirs.
    fn of(problem: &ForceProblem, weights: &[f64], fine: Option<(FineSamples, &[f64])>) -> Self {
        let coils = problem.coils();
        let mut all = Self {
            forces_n_per_a: Vec::new(),
            height_m: Vec::new(),
            offset_n: problem.offset_n.map(|_| Vec::new()),
            weights: Vec::new(),
        };
        let mut add = |forces: &[f64], heights: &[f64], offset: Option<&[f64]>, weights: &[f64]| {
            for row in (0..weights.len()).filter(|&row| weights[row] > 0.0) {
                let of_row = &forces[row * coils..(row + 1) * coils];
                all.forces_n_per_a.extend_from_slice(of_row);
                all.height_m.push(heights[row]);
                all.weights.push(weights[row]);
                if let (Some(all), Some(offset)) = (&mut all.offset_n, offset) {
                    all.push(offset[row]);
                }
            }
        };
        let ForceProblem {
            forces_n_per_a,
            height_m,
            offset_n,
            ..
        } = *problem;
        add(forces_n_per_a, height_m, offset_n, weights);
        if let Some((fine, weights)) = fine {
            add(fine.forces_n_per_a, fine.height_m, fine.offset_n, weights);
        }
        all
    }

    fn constant(
        &self,
        problem: &ForceProblem,
        settings: &Settings,
    ) -> Result<Option<f64>, ProblemError> {
        if self.height_m.is_empty() {
            return Ok(None);
        }
        let rows = ForceProblem {
            forces_n_per_a: &self.forces_n_per_a,
            height_m: &self.height_m,
            offset_n: self.offset_n.as_deref(),
            weights: Some(&self.weights),
            ..*problem
        };
        match constant(&rows, settings) {
            // Too weak at these points alone: there is nothing to compare.
            Err(ProblemError::TooWeak { .. }) => Ok(None),
            other => Ok(other?.filter(|lambda| *lambda > 0.0)),
        }
    }
}
