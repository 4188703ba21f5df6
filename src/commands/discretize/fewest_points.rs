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

/// `document` with the fewest samples whose excess, times which they exceed what is allowed, is 1 or less, and the
/// power of the spacing with which it falls; its own where there is no excess to speak of (`None`).
///
/// # Errors
/// Those of `excess`; interruption.
pub(crate) fn fewest_points(
    document: &ShapeDocument,
    target: ErrorTarget,
    progress: &dyn Progress,
    mut excess: impl FnMut(&ShapeDocument) -> Result<Option<f64>, RunError>,
) -> Result<(ShapeDocument, f64), RunError> {
    let most = if target.by_default {
        MOST_BY_DEFAULT
    } else {
        MOST
    };
    let of_document = [document.grid.x, document.grid.y].map(AxisRequest::samples);
    let longest = of_document[0].max(of_document[1]).saturating_sub(1).max(1);
    let sampled = |intervals: f64| {
        let factor = intervals / longest as f64;
        document.with_samples(of_document.map(|samples| match samples {
            1 => 1,
            more => (((more - 1) as f64 * factor).round() as usize + 1).clamp(5, most),
        }))
    };
    let mut search = Search::new((FIRST - 1) as f64);
    for _ in 0..ATTEMPTS {
        progress.check()?;
        let tried = sampled(search.intervals);
        let Some(excess) = excess(&tried)? else {
            return Ok((tried, search.order));
        };
        if !search.tried(excess, (most - 1) as f64) {
            break;
        }
    }
    let fewest = search.fewest.map(|(intervals, _)| intervals);
    Ok((sampled(fewest.unwrap_or(search.intervals)), search.order))
}

/// A search for the fewest intervals whose excess is 1 or less.
struct Search {
    /// Those to be tried.
    intervals: f64,
    /// With which power of the spacing the excess falls.
    order: f64,
    /// The most that fail, with their excess.
    most: Option<(f64, f64)>,
    /// The fewest that hold.
    fewest: Option<(f64, f64)>,
}

impl Search {
    fn new(intervals: f64) -> Self {
        Self {
            intervals,
            order: SMOOTH,
            most: None,
            fewest: None,
        }
    }

    /// Takes the excess of the intervals that were tried; whether others are worth a try. There are
    /// at most `most` of them.
    fn tried(&mut self, excess: f64, most: f64) -> bool {
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
                self.intervals = (few * finer.clamp(*FINER.start(), *FINER.end())).min(most);
                few < most
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
        let mut search = Search::new(16.0);
        assert!(search.tried(3.5, 768.0));
        search.intervals = 23.0;
        assert!(search.tried(0.36, 768.0) && search.fewest.is_none());
        search.intervals = 46.0;
        search.tried(0.8, 768.0);
        assert_eq!(search.fewest, Some((46.0, 0.8)));
    }
}
