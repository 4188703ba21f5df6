//! The fewest points of a grid that hold a requested error.

use crate::RunError;
use crate::progress::Progress;
use crate::scene::tolerances::ErrorTarget;
use crate::shape::document::{AxisRequest, ShapeDocument};

/// Samples along the longer side of the first grid.
const FIRST: usize = 17;
/// Samples along either side, at most: beyond, tables and files are of no use to a runtime.
const MOST: usize = 769;
/// The same where nobody requested an error.
const MOST_BY_DEFAULT: usize = 193;
/// Attempts at most.
const ATTEMPTS: usize = 8;
/// How much finer a grid becomes from one attempt to the next.
const FINER: std::ops::RangeInclusive<f64> = 1.2..=3.0;
/// The order with which the error of a smooth surface falls.
pub(crate) const SMOOTH: f64 = 2.0;
/// Orders of convergence that an attempt is trusted to show.
const ORDERS: std::ops::RangeInclusive<f64> = 0.7..=SMOOTH;
/// A grid that uses less of its share is wasteful, unless one a little coarser fails.
const WASTE: f64 = 0.5;
const CLOSE: f64 = 1.25;
/// Between one that fails and one that holds with so many times the intervals another is tried: where a
/// surface ends or breaks, the error falls irregularly.
const WIDE: f64 = 2.0;
/// A little more than the law says, so that the next attempt holds.
const SPARE: f64 = 1.08;

/// The fewest samples of `document` whose excess, times which they exceed what is allowed, is 1 or less, and the
/// power of the spacing with which it falls; its own where there is no excess to speak of (`None`).
///
/// # Errors
/// Those of `excess`; interruption.
pub(crate) fn fewest_points(
    document: &ShapeDocument,
    target: ErrorTarget,
    progress: &dyn Progress,
    excess: impl FnMut(&ShapeDocument) -> Result<Option<f64>, RunError>,
) -> Result<([usize; 2], f64), RunError> {
    let most = if target.by_default {
        MOST_BY_DEFAULT
    } else {
        MOST
    };
    let (of_document, longest) = samples_of(document);
    let sampled = |intervals: f64| {
        let factor = intervals / longest as f64;
        document.with_samples(of_document.map(|samples| match samples {
            1 => 1,
            more => (((more - 1) as f64 * factor).round() as usize + 1).clamp(5, most),
        }))
    };
    let search = Search::new((FIRST - 1) as f64, (most - 1) as f64);
    let (fewest, order) = search.run(sampled, progress, excess)?;
    Ok((samples_of(&fewest).0, order))
}

/// The samples of `document` where every interval of its grid is divided into the fewest equal ones whose excess is
/// 1 or less.
///
/// # Errors
/// Those of `excess`; interruption.
pub(crate) fn fewest_divisions(
    document: &ShapeDocument,
    progress: &dyn Progress,
    excess: impl FnMut(&ShapeDocument) -> Result<Option<f64>, RunError>,
) -> Result<[usize; 2], RunError> {
    let (of_document, longest) = samples_of(document);
    let most = ((MOST - 1) / longest).max(1);
    let divided = |intervals: f64| {
        let divisions = (intervals.round() as usize).div_ceil(longest).min(most);
        document.with_samples(of_document.map(|samples| (samples - 1) * divisions + 1))
    };
    let search = Search::new(longest as f64, (most * longest) as f64);
    let (fewest, _) = search.run(divided, progress, excess)?;
    Ok(samples_of(&fewest).0)
}

/// The samples along x and y, and the intervals along the longer side.
fn samples_of(document: &ShapeDocument) -> ([usize; 2], usize) {
    let samples = [document.grid.x, document.grid.y].map(AxisRequest::samples);
    let longest = samples[0].max(samples[1]).saturating_sub(1).max(1);
    (samples, longest)
}

/// A search for the fewest intervals whose excess is 1 or less.
struct Search {
    /// Those to be tried.
    intervals: f64,
    /// So many at most.
    limit: f64,
    /// With which power of the spacing the excess falls.
    order: f64,
    /// The most that fail, with their excess.
    most: Option<(f64, f64)>,
    /// The fewest that hold.
    fewest: Option<(f64, f64)>,
}

impl Search {
    fn new(intervals: f64, limit: f64) -> Self {
        Self {
            intervals,
            limit,
            order: SMOOTH,
            most: None,
            fewest: None,
        }
    }

    /// The document that `sampled` makes of the fewest intervals, and the order of convergence.
    fn run(
        mut self,
        sampled: impl Fn(f64) -> ShapeDocument,
        progress: &dyn Progress,
        mut excess: impl FnMut(&ShapeDocument) -> Result<Option<f64>, RunError>,
    ) -> Result<(ShapeDocument, f64), RunError> {
        for _ in 0..ATTEMPTS {
            progress.check()?;
            let tried = sampled(self.intervals);
            self.intervals = samples_of(&tried).1 as f64;
            if self
                .fewest
                .is_some_and(|(fewest, _)| fewest == self.intervals)
            {
                break;
            }
            let Some(excess) = excess(&tried)? else {
                return Ok((tried, self.order));
            };
            if !self.tried(excess) {
                break;
            }
        }
        let fewest = self.fewest.map(|(intervals, _)| intervals);
        Ok((sampled(fewest.unwrap_or(self.intervals)), self.order))
    }

    /// Takes the excess of the intervals that were tried; whether others are worth a try.
    fn tried(&mut self, excess: f64) -> bool {
        // An estimate that falls faster than that of a smooth surface is small by luck, and of many that are
        // tried the luckiest would be taken.
        let smooth = self.most.map_or(0.0, |(few, other)| {
            other * (few / self.intervals).powf(SMOOTH)
        });
        let excess = excess.max(smooth);
        let now = (self.intervals, excess);
        let before = self.most.or(self.fewest);
        if let Some((intervals, other)) = before
            && excess > 0.0
        {
            let order = (other / excess).ln() / (now.0 / intervals).ln();
            if order.is_finite() {
                self.order = order.clamp(*ORDERS.start(), *ORDERS.end());
            }
        }
        let fails = excess > 1.0;
        if fails {
            self.most = Some(now);
        } else {
            self.fewest = Some(now);
        }
        match (self.most, self.fewest) {
            // Between what fails and what holds, unless that holds closely.
            (Some((few, _)), Some((many, excess))) => {
                self.intervals = (few * many).sqrt().round();
                let wasteful = excess < WASTE || many > WIDE * few;
                wasteful && many > CLOSE * few && self.intervals < many
            }
            (Some((few, excess)), None) => {
                let finer = SPARE * excess.powf(1.0 / self.order);
                self.intervals = (few * finer.clamp(*FINER.start(), *FINER.end())).min(self.limit);
                few < self.limit
            }
            // The first one holds.
            (None, _) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regression_a_grid_was_taken_whose_estimate_was_small_by_luck() {
        let mut search = Search::new(16.0, 768.0);
        assert!(search.tried(3.5));
        search.intervals = 23.0;
        assert!(search.tried(0.36) && search.fewest.is_none());
        search.intervals = 46.0;
        search.tried(0.8);
        assert_eq!(search.fewest, Some((46.0, 0.8)));
    }
}
