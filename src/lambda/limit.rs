//! How far a force constant is from its limit of ever more points.
//!
//! The mean over an object is an integral over its plan area, and the points are nodes of a rule for
//! it. Where the surface ends or breaks within a cell of the grid, the corners describe it badly: finer
//! samples of those cells take the corners' place, and the difference that they make is what these cells
//! are off by, and is counted twice; samples of parts twice as wide say how far the samples are off, and halves of the
//! cells that were drawn to stand for others how far these are.
//! Where the samples are points themselves (graded points), that is nearly all.
//!
//! In the smooth cells, blocks of two by two cells that count by their corners alone, laid in each of
//! four ways, are a rule of twice the spacing. The error falls with the second power of the spacing,
//! those rules are off four times as far, so they differ from all points by three times the error of
//! these, in the share of the area that is in blocks. The largest difference, with a margin, is the
//! estimate. The least force over all places is no mean: with the currents that hold it at the
//! points it may be smaller between them. Where it bends evenly it is taken for a parabola, elsewhere for any convex
//! function; of the samples every second one is taken.
//!
//! Points that count alike give another limit than the object's, off by the first power of the
//! spacing: their border counts twice. The difference from the same points by area is in the first one.

use rayon::prelude::*;

use fluxform_numerics::random::seed_at;

use super::Criterion;
use super::problem::{ForceProblem, ProblemError, Settings};
use super::solve::constant;
use super::worst::{Maxmin, maxmin};

/// The difference from nothing, and from what cannot be known.
const ALL: f64 = 1.0;
/// Ways to lay blocks of two by two cells.
const SUBSETS: usize = 4;
/// The rounding error of a weight, relative to the largest.
const ROUNDING: f64 = 1e-9;
/// Bends of a force over the height are those of a smooth one where the next ones outwards are at least this share.
const ALIKE: f64 = 0.4;
/// What a parabola may leave of such a bend: an eighth of the deepest dip that has it; at an end half of that.
const BETWEEN: f64 = 1.0 / 64.0;
const AT_AN_END: f64 = 1.0 / 16.0;
/// A rule of twice the spacing differs from the points by so many times their error.
const SPACING_TO_ERROR: f64 = 3.0;
/// Of the largest difference: of 4500 random objects on grids of 13 to 37 points a side 7 are further off
/// than stated, 6 of them with graded points, by a factor of 3.2 at most.
pub(crate) const MARGIN: f64 = 1.6;
/// Of the difference from samples with one quartering less, which are off twice as far and more.
const MARGIN_OF_SAMPLES: f64 = 1.5;

/// Ways to draw one of every two cells that stand for others: one or two may agree with all by luck.
const HALVES: u64 = 6;

/// Of what the cells were off by, where the samples are points: the least that is left, since a difference of
/// samples may be small by luck.
const LEFT_OF_CELLS: f64 = 0.02;

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
    /// The height over the middle of a smooth cell is within this share of the mean of its corners.
    pub smooth_within: f64,
}

/// Samples of the cells that are not smooth, one entry each, and what is left to the points.
#[derive(Debug, Clone, Copy)]
pub struct FineSamples<'a> {
    /// Whether the constant was solved with them in place of the points of their cells.
    pub are_points: bool,
    /// Force per ampere of every coil, N/A: one row a sample.
    pub forces_n_per_a: &'a [f64],
    /// Height of each, m.
    pub height_m: &'a [f64],
    /// Force without any current, N; `None`: none.
    pub offset_n: Option<&'a [f64]>,
    /// Plan area of each, in the unit of the points' areas.
    pub areas: &'a [f64],
    /// The same with parts twice as wide; 0 for the samples that this leaves out.
    pub coarse_areas: &'a [f64],
    /// Of each the rank of its cell among those drawn at random that stand for others, in a ratio to their number, if it
    /// is one.
    pub stand_in: &'a [Option<u32>],
    /// The area of each point in smooth cells alone (>= 0).
    pub point_areas: &'a [f64],
}

/// Estimate of |lambda / limit - 1| of the chosen constant of `problem`, which is `lambda_n_per_m`,
/// against the limit of ever more points. `areas` holds the plan area that each point stands for (> 0,
/// any unit), whether or not the problem weighs by it; `fine` takes the place of the points in cells
/// that are not smooth. A rule without a constant, or with 0, differs by all of it; so it
/// does where there is no rule to compare with: fewer than three points along an axis of several. Of several rules
/// those whose path cannot be followed are left out.
///
/// # Errors
/// A malformed problem.
pub fn limit_error(
    problem: &ForceProblem,
    lambda_n_per_m: f64,
    areas: &[f64],
    places: GridPlaces,
    fine: Option<FineSamples>,
    settings: &Settings,
) -> Result<f64, ProblemError> {
    let settings = Settings {
        at_n_per_m: None,
        ..*settings
    };
    let by_area = ForceProblem {
        weights: Some(areas),
        ..*problem
    };
    let with_samples = |fine: FineSamples| {
        Rows::of(problem, fine.point_areas, Some((fine, fine.areas))).constant(problem, &settings)
    };
    let by_points = Found::of(&by_area, &settings)?;
    let (areas, nearest) = match fine {
        Some(fine) => (fine.point_areas, with_samples(fine)?),
        None => (areas, by_points),
    };
    let Found::Constant(nearest) = nearest else {
        return Ok(ALL);
    };
    let apart = |other: Found| match other {
        Found::Constant(other) => Some((other / nearest - 1.0).abs()),
        Found::Nothing => Some(ALL),
        Found::Unfollowed => None,
    };
    let differs = |points: &[f64], samples: Option<&[f64]>| -> Difference {
        let rows = Rows::of(problem, points, fine.zip(samples));
        Ok(apart(rows.constant(problem, &settings)?))
    };
    let of_cells = apart(by_points).unwrap_or(ALL);
    let of_spacing = match settings.criterion {
        Criterion::Maxmin => {
            let rows = Rows::of(problem, areas, fine.map(|fine| (fine, fine.areas)));
            let between = match maxmin(&rows.problem(problem))? {
                Some(found) => places.below(problem, areas, &found),
                None => ALL,
            };
            let of_samples = |fine: FineSamples| {
                largest(&[0, 1], |&which| {
                    differs(areas, Some(&every_other(fine.areas, which)))
                })
            };
            between + fine.map_or(Ok(0.0), of_samples)?
        }
        _ => spacing_off(places, areas, (of_cells, fine), differs)?,
    };
    let of_samples = match fine {
        Some(fine) => {
            let coarse = differs(areas, Some(fine.coarse_areas))?.unwrap_or(ALL);
            coarse + of_choice(areas, fine, differs)?
        }
        None => 0.0,
    };
    let off = (lambda_n_per_m / nearest - 1.0).abs();
    let counted = match fine {
        Some(fine) if fine.are_points => LEFT_OF_CELLS * of_cells,
        _ => of_cells,
    };
    Ok(off + MARGIN * of_spacing + counted + MARGIN_OF_SAMPLES * of_samples)
}

/// By how much halves of the cells that stand for others differ: as far as all of them are off, at random.
fn of_choice(
    areas: &[f64],
    fine: FineSamples,
    differs: impl Fn(&[f64], Option<&[f64]>) -> Difference + Sync,
) -> Result<f64, ProblemError> {
    if fine.stand_in.iter().all(Option::is_none) {
        return Ok(0.0);
    }
    let halves: Vec<u64> = (0..HALVES).collect();
    largest(&halves, |&which| differs(areas, Some(&fine.half(which))))
}

/// By how much rules of twice the spacing differ.
fn spacing_off(
    places: GridPlaces,
    areas: &[f64],
    (of_cells, fine): (f64, Option<FineSamples>),
    differs: impl Fn(&[f64], Option<&[f64]>) -> Difference + Sync,
) -> Result<f64, ProblemError> {
    let ways = (0..SUBSETS).map(|which| places.blocks(areas, which));
    let ways: Vec<(Vec<f64>, f64)> = ways.collect();
    let most = ways.iter().map(|(_, share)| *share).fold(0.0, f64::max);
    if most == 0.0 {
        // Single smooth cells between samples. Where those are not points, the smooth corners are no worse than those
        // of the others were; else the least is known by which they are called smooth.
        let sum = |of: &[f64]| of.iter().sum::<f64>();
        let known = fine.filter(|fine| sum(fine.areas) > 0.0);
        return Ok(known.map_or(ALL, |fine| {
            let [smooth, others] = [areas, fine.areas].map(sum);
            SPACING_TO_ERROR
                * match fine.are_points {
                    true => places.smooth_within * smooth / (smooth + others),
                    false => of_cells * smooth / others,
                }
        }));
    }
    let ways: Vec<_> = (ways.iter().filter(|(_, share)| *share > 0.5 * most)).collect();
    largest(&ways, |(weights, share)| {
        let off = differs(weights, fine.map(|fine| fine.areas))?;
        Ok(off.map(|off| off / share))
    })
}

/// By how much a rule's constant differs, relative; `None` where its path cannot be followed.
type Difference = Result<Option<f64>, ProblemError>;

/// The largest value of `off` over all `ways`, which are looked at side by side, those that are not known left out.
fn largest<T: Sync>(
    ways: &[T],
    off: impl Fn(&T) -> Difference + Sync,
) -> Result<f64, ProblemError> {
    let found: Vec<_> = ways.par_iter().map(&off).collect();
    let found = found.into_iter().collect::<Result<Vec<_>, _>>()?;
    let most = found.into_iter().flatten().reduce(f64::max);
    Ok(most.unwrap_or(ALL))
}

/// The weights of the `which`-th of every two samples.
fn every_other(areas: &[f64], which: usize) -> Vec<f64> {
    let weight = |(sample, area): (usize, &f64)| match sample % 2 == which {
        true => *area,
        false => 0.0,
    };
    areas.iter().enumerate().map(weight).collect()
}

/// By how much a function may be below the smaller of its values at two places, `inner`, where `left` and `right` are
/// the next ones outwards, as far as there are any. Where it bends further out as between them, or ends on one side, as
/// low as a parabola and a share of its bend; else, at a kink, above the lines through the next two places on either
/// side; of two places alone as much as they differ by.
fn dip(left: [Option<f64>; 2], right: [Option<f64>; 2], [from, to]: [f64; 2]) -> f64 {
    let least = from.min(to);
    let bend = |[a, b, c]: [f64; 3]| a - 2.0 * b + c;
    let (Some(before), Some(after)) = (left[0], right[0]) else {
        let three = match (left[0], right[0]) {
            (None, Some(after)) => [from, to, after],
            (Some(before), None) => [to, from, before],
            _ => return (to - from).abs(),
        };
        return least - least_of_parabola(three) + AT_AN_END * bend(three).abs();
    };
    let most = bend([before, from, to]).max(bend([from, to, after]));
    let outwards = [
        left[1].map(|far| bend([far, before, from])),
        right[1].map(|far| bend([to, after, far])),
    ];
    let mut outwards = outwards.into_iter().flatten().peekable();
    if outwards.peek().is_some() && outwards.all(|bend| bend >= ALIKE * most) {
        let below = least_of_parabola([from, to, after]).min(least_of_parabola([to, from, before]));
        return least - below + BETWEEN * most.abs();
    }
    let (a, b) = ([from, 2.0 * from - before], [2.0 * to - after, to]);
    let [first, last] = [a[0] - b[0], a[1] - b[1]];
    let ends = a[0].max(b[0]).min(a[1].max(b[1]));
    let below = match first * last < 0.0 {
        true => ends.min(a[0] + (a[1] - a[0]) * first / (first - last)),
        false => ends,
    };
    (least - below).max(0.0)
}

/// The least between the first two of three places of one spacing.
fn least_of_parabola([end, next, beyond]: [f64; 3]) -> f64 {
    let curved = 0.5 * (end - 2.0 * next + beyond);
    let slope = next - end - curved;
    match curved > 0.0 && slope < 0.0 && -slope < 2.0 * curved {
        true => end - 0.25 * slope * slope / curved,
        false => end.min(next),
    }
}

impl FineSamples<'_> {
    /// The areas where of every two cells that stand for others one does, in the `which`-th of many ways.
    fn half(&self, which: u64) -> Vec<f64> {
        let area = |(area, rank): (&f64, &Option<u32>)| match rank {
            Some(rank) if (seed_at(which, u64::from(rank / 2)) ^ u64::from(*rank)) & 1 == 0 => 0.0,
            Some(_) => 2.0 * area,
            None => *area,
        };
        self.areas.iter().zip(self.stand_in).map(area).collect()
    }
}

impl GridPlaces<'_> {
    /// Whether the place of a point is even or odd along x and y; `None` along an axis of one point. Counted from the
    /// nearer end, so that no parity has the mirror image of what it leaves out.
    pub(crate) fn parity(&self, place: usize) -> [Option<usize>; 2] {
        let [x, y] = [place % self.columns, place / self.columns];
        [(x, self.columns), (y, self.rows)]
            .map(|(at, samples)| (samples > 1).then(|| at.min(samples - 1 - at) % 2))
    }

    /// By how much the force over the height, with the currents of `found`, may be smaller between the points that
    /// count than the constant that these hold, relative; all of it where an axis has two points.
    fn below(&self, problem: &ForceProblem, areas: &[f64], found: &Maxmin) -> f64 {
        if self.columns == 2 || self.rows == 2 {
            return ALL;
        }
        let mut over_height = vec![f64::NAN; self.columns * self.rows];
        let rows = problem.forces_n_per_a.chunks_exact(problem.coils());
        for (row, (forces, &place)) in rows.zip(self.index).enumerate() {
            let forces = forces.iter().zip(&found.currents_a);
            let force_n: f64 = forces.map(|(force, current)| force * current).sum();
            let offset_n = problem.offset_n.map_or(0.0, |offset_n| offset_n[row]);
            if problem.height_m[row] > 0.0 {
                over_height[place] = (force_n + offset_n) / problem.height_m[row];
            }
        }
        // The points of a line from a place, one after the other, as far as the surface is smooth.
        let along = |place: usize, axis: usize, onwards: bool| -> Option<usize> {
            let next = self.beside(place, axis, onwards)?;
            (!over_height[next].is_nan()).then_some(next)
        };
        let dip_at = |place: usize, axis: usize, onwards: bool| -> f64 {
            let Some(next) = along(place, axis, onwards) else {
                return 0.0;
            };
            let outer = |from: usize, onwards: bool| {
                let near = along(from, axis, onwards);
                let far = near.and_then(|near| along(near, axis, onwards));
                [near, far].map(|place| place.map(|place| over_height[place]))
            };
            let inner = [place, next].map(|place| over_height[place]);
            dip(outer(place, !onwards), outer(next, onwards), inner)
        };
        let counting = self.index.iter().zip(areas);
        let counting = counting.filter(|(place, area)| **area > 0.0 && over_height[**place] > 0.0);
        let lowest = counting.map(|(&place, _)| {
            let dips = [0, 1].map(|axis| dip_at(place, axis, true).max(dip_at(place, axis, false)));
            over_height[place] - dips[0] - dips[1]
        });
        let lowest = lowest.fold(f64::INFINITY, f64::min);
        let constant = found.lambda_n_per_m;
        ((constant - lowest) / constant).clamp(0.0, ALL)
    }

    /// The place next to one along x (0) or y (1), where a cell beside the way there is smooth.
    fn beside(&self, place: usize, axis: usize, onwards: bool) -> Option<usize> {
        let at = [place % self.columns, place / self.columns];
        let samples = [self.columns, self.rows];
        let mut from = at;
        if onwards {
            (at[axis] + 1 < samples[axis]).then_some(())?;
        } else {
            from[axis] = from[axis].checked_sub(1)?;
        }
        let across = 1 - axis;
        // With one row or column there are no cells.
        let sides = [from[across].checked_sub(1), Some(from[across])];
        let mut sides = sides.into_iter().flatten();
        let smooth = samples[across] == 1
            || sides.any(|side| {
                let mut cell = from;
                cell[across] = side;
                side + 1 < samples[across] && self.is_smooth(cell[0], cell[1])
            });
        let step = [1, self.columns][axis];
        smooth.then_some(if onwards { place + step } else { place - step })
    }

    /// The weights of the points where every block of two by two smooth cells counts by its corners alone, blocks
    /// laid in the `which`-th of four ways, and the share of all weight that is in blocks. Of one row or column
    /// two intervals are a block.
    fn blocks(&self, areas: &[f64], which: usize) -> (Vec<f64>, f64) {
        let mut row_of = vec![usize::MAX; self.columns * self.rows];
        for (row, &place) in self.index.iter().enumerate() {
            row_of[place] = row;
        }
        let mut weights = areas.to_vec();
        let mut in_blocks = 0.0;
        let beside = [self.columns, self.rows].map(|samples| match samples {
            1 => &[0][..],
            _ => &[-1, 0, 1],
        });
        for (&place, &area) in self.index.iter().zip(areas) {
            let at = [place % self.columns, place / self.columns];
            let first = [which % 2, which / 2];
            let is_middle = [self.columns, self.rows]
                .into_iter()
                .enumerate()
                .all(|(axis, samples)| samples == 1 || at[axis] % 2 == first[axis]);
            if !is_middle {
                continue;
            }
            let Some(block) = self.block(at, beside, &row_of) else {
                continue;
            };
            // Of a cell's area each corner has a share; a block is as many cells as it has corners.
            let corners = block.iter().filter(|(_, sides)| *sides == 0).count() as f64;
            for (row, sides) in block {
                let own = area
                    / f64::from(
                        1 << (beside.iter().filter(|b| b.len() > 1).count() as u32 - sides),
                    );
                weights[row] -= own;
                if sides == 0 {
                    weights[row] += area;
                }
            }
            in_blocks += corners * area;
        }
        let all: f64 = areas.iter().sum();
        let least = areas.iter().copied().fold(0.0, f64::max) * ROUNDING;
        weights
            .iter_mut()
            .filter(|w| **w < least)
            .for_each(|w| *w = 0.0);
        (weights, if all > 0.0 { in_blocks / all } else { 0.0 })
    }

    /// The rows of the points around a place, each with how many axes it shares with it; `None` where one is
    /// missing or a cell between them is not smooth.
    fn block(
        &self,
        at: [usize; 2],
        beside: [&[isize]; 2],
        row_of: &[usize],
    ) -> Option<Vec<(usize, u32)>> {
        let mut block = Vec::with_capacity(9);
        for &up in beside[1] {
            for &right in beside[0] {
                let column = at[0]
                    .checked_add_signed(right)
                    .filter(|c| *c < self.columns)?;
                let row = at[1].checked_add_signed(up).filter(|r| *r < self.rows)?;
                let found = row_of[row * self.columns + column];
                if found == usize::MAX {
                    return None;
                }
                let both = beside[0].len() > 1 && beside[1].len() > 1;
                if both && right < 1 && up < 1 && !self.is_smooth(column, row) {
                    return None;
                }
                let shared = u32::from(right == 0 && beside[0].len() > 1)
                    + u32::from(up == 0 && beside[1].len() > 1);
                block.push((found, shared));
            }
        }
        Some(block)
    }

    fn is_smooth(&self, column: usize, row: usize) -> bool {
        self.smooth.is_empty()
            || (self.smooth.get(row * (self.columns - 1) + column)).is_some_and(|smooth| *smooth)
    }
}

/// The force constant of a rule.
#[derive(Clone, Copy)]
enum Found {
    Constant(f64),
    /// None, or 0.
    Nothing,
    Unfollowed,
}

impl Found {
    fn of(problem: &ForceProblem, settings: &Settings) -> Result<Self, ProblemError> {
        match constant(problem, settings) {
            // Too weak at these points alone.
            Err(ProblemError::TooWeak { .. }) => Ok(Self::Nothing),
            Err(ProblemError::Unfollowed) => Ok(Self::Unfollowed),
            other => Ok(match other? {
                Some(lambda) if lambda > 0.0 => Self::Constant(lambda),
                _ => Self::Nothing,
            }),
        }
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

    /// The problem of these rows instead of those of `problem`.
    fn problem<'a>(&'a self, problem: &ForceProblem<'a>) -> ForceProblem<'a> {
        ForceProblem {
            forces_n_per_a: &self.forces_n_per_a,
            height_m: &self.height_m,
            offset_n: self.offset_n.as_deref(),
            weights: Some(&self.weights),
            ..*problem
        }
    }

    fn constant(&self, problem: &ForceProblem, settings: &Settings) -> Result<Found, ProblemError> {
        match self.height_m.is_empty() {
            true => Ok(Found::Nothing),
            false => Found::of(&self.problem(problem), settings),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of samples of known functions the dip between two places covers that of the function.
    #[test]
    fn a_dip_between_places_is_that_of_the_function() {
        let between = |f: &dyn Fn(f64) -> f64, inside: bool| {
            let [left, right] = [[-1.0, -2.0], [2.0, 3.0]].map(|at| at.map(|x| Some(f(x))));
            let left = if inside { left } else { [None; 2] };
            let found = dip(left, right, [f(0.0), f(1.0)]);
            let least = (0..=1000).map(|k| f(f64::from(k) * 1e-3));
            let least = least.fold(f64::INFINITY, f64::min);
            (found, f(0.0).min(f(1.0)) - least)
        };
        for at in [0.0, 0.1, 0.3, 0.5, 0.8, 1.0] {
            for inside in [true, false] {
                let (found, dips) = between(&|x| (x - at).powi(2), inside);
                assert!(
                    found >= dips - 1e-6 && found < dips + 0.2,
                    "{at} {found} {dips}"
                );
            }
            let (found, dips) = between(&|x| (x - at).abs(), true);
            assert!(
                found >= dips - 1e-9 && found < dips + 0.1,
                "{at} {found} {dips}"
            );
        }
        // It falls evenly, to an end.
        assert_eq!(between(&|x| x, false), (0.0, 0.0));
        assert_eq!(dip([None; 2], [None; 2], [1.0, 3.0]), 2.0);
    }

    /// A rule whose path ends early was off by all of the force constant.
    #[test]
    fn rules_that_cannot_be_followed_are_left_out() {
        let off = |which: &usize| Ok([Some(0.01), None, Some(0.03)][*which]);
        assert_eq!(largest(&[0, 1, 2], off), Ok(0.03));
        assert_eq!(largest(&[1], off), Ok(ALL));
    }
}
