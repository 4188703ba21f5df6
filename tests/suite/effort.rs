//! How much of every curve is measured, and how carefully.

use crate::file::Row;
use fluxform::RunError;
use fluxform::commands::bench::clock::{Effort, Timing, measure};
use fluxform::progress::Progress;

/// How much is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Of every curve only so many rows, the coarsest; a curve's own choice is below that.
    pub most_rows: usize,
    /// Whether the finest and slowest rows are left out.
    pub quick: bool,
    /// Warm-up and repeats.
    pub effort: Effort,
}

impl Pace {
    /// Every row, for figures to keep.
    pub const FULL: Self = Self {
        most_rows: usize::MAX,
        quick: false,
        effort: Effort::FULL,
    };
    /// All stages in less than a minute.
    pub const QUICK: Self = Self {
        most_rows: usize::MAX,
        quick: true,
        effort: Effort::QUICK,
    };

    /// The coarsest `rows` of every curve, each measured once.
    #[must_use]
    pub fn coarsest(rows: usize) -> Self {
        Self {
            most_rows: rows,
            quick: true,
            effort: Effort::ONCE,
        }
    }

    /// The settings of a knob that are measured: all, or the first `quick` of them.
    #[must_use]
    pub fn settings<'a, T>(&self, all: &'a [T], quick: usize) -> &'a [T] {
        let most = if self.quick { quick } else { all.len() };
        &all[..most.min(self.most_rows).min(all.len())]
    }

    /// Measures `work`.
    ///
    /// # Errors
    /// Those of `work`; interruption.
    pub fn time<T>(
        &self,
        progress: &dyn Progress,
        work: impl FnMut() -> Result<T, RunError>,
    ) -> Result<(T, Timing), RunError> {
        progress.check()?;
        let measured = measure(&self.effort, work)?;
        progress.advance(1);
        Ok(measured)
    }
}

/// Entries of a row in addition to its seconds.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// The knob.
    pub knob: f64,
    /// Whether it is the default.
    pub default: bool,
    /// Work that the seconds measure.
    pub items: usize,
    /// Largest error found.
    pub error: f64,
    /// Error stated by the stage itself.
    pub stated: Option<f64>,
}

impl Found {
    /// The row, with its seconds. An error that is not a number counts as the largest there is.
    #[must_use]
    pub fn timed(self, timing: &Timing) -> Row {
        let error = if self.error.is_finite() {
            self.error
        } else {
            f64::MAX
        };
        Row {
            knob: self.knob,
            default: self.default,
            items: self.items as u64,
            error,
            stated_error: self.stated.filter(|stated| stated.is_finite()),
            seconds: timing.seconds,
            seconds_low: timing.low_s,
            seconds_high: timing.high_s,
            repeats: timing.samples as u64,
        }
    }
}
