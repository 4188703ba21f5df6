//! Processor time, measured: warm-up, repeats, median and quartiles.
//!
//! Processor time counts what this process worked, so that other work on the machine hardly
//! shows; with one thread it is the time that an idle machine would take by the clock.
#![allow(clippy::disallowed_methods)] // what this room is for

use std::time::Instant;

use cpu_time::ProcessTime;

use crate::numerics::quantile::quantile;

/// How long a measurement may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Calls are repeated within a sample until it lasts this long, s: the clock's own steps and
    /// cost do not show then.
    pub sample_s: f64,
    /// No further sample once all took this long together, s.
    pub enough_s: f64,
    /// Most samples.
    pub samples: usize,
}

impl Effort {
    /// For figures to keep.
    pub const FULL: Self = Self {
        sample_s: 2e-3,
        enough_s: 2.0,
        samples: 21,
    };
    /// For a glance.
    pub const QUICK: Self = Self {
        sample_s: 1e-3,
        enough_s: 0.25,
        samples: 7,
    };
    /// For many stages in little time.
    pub const GLANCE: Self = Self {
        sample_s: 1e-3,
        enough_s: 0.05,
        samples: 3,
    };
    /// One sample after the warm-up: for tests.
    pub const ONCE: Self = Self {
        sample_s: 0.0,
        enough_s: 0.0,
        samples: 1,
    };
}

/// Seconds of one call.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Processor time of all threads, the median, s.
    pub seconds: f64,
    /// Lower quartile, s.
    pub low_s: f64,
    /// Upper quartile, s.
    pub high_s: f64,
    /// Time by the clock, the least, s.
    pub elapsed_s: f64,
    /// Samples.
    pub samples: usize,
}

/// A stopwatch for processor time and time by the clock.
#[derive(Debug, Clone, Copy)]
pub struct Watch {
    processor: ProcessTime,
    clock: Instant,
}

impl Watch {
    /// Starts.
    #[must_use]
    pub fn start() -> Self {
        Self {
            processor: ProcessTime::now(),
            clock: Instant::now(),
        }
    }

    /// Processor time of all threads since the start, s.
    #[must_use]
    pub fn processor_s(&self) -> f64 {
        self.processor.elapsed().as_secs_f64()
    }

    /// Time by the clock since the start, s.
    #[must_use]
    pub fn elapsed_s(&self) -> f64 {
        self.clock.elapsed().as_secs_f64()
    }
}

/// Runs `work` once to warm up caches and tables, then as often as `effort` says; the last result
/// and the seconds of one call. Work that alone takes longer than is enough is not repeated: its
/// first run counts.
///
/// # Errors
/// Those of `work`.
pub fn measure<T, E>(
    effort: &Effort,
    mut work: impl FnMut() -> Result<T, E>,
) -> Result<(T, Timing), E> {
    let watch = Watch::start();
    let mut result = work()?;
    let (first_s, first_elapsed_s) = (watch.processor_s(), watch.elapsed_s());
    let calls = (effort.sample_s / first_s.max(1e-9)).ceil().max(1.0) as usize;
    let (mut seconds, mut least_s, mut spent_s) = (Vec::new(), f64::INFINITY, first_s);
    while seconds.is_empty() || (seconds.len() < effort.samples && spent_s < effort.enough_s) {
        if seconds.is_empty() && first_s > effort.enough_s && effort.enough_s > 0.0 {
            seconds.push(first_s);
            least_s = first_elapsed_s;
            break;
        }
        let watch = Watch::start();
        for _ in 0..calls {
            // The value of the call before is not held beside the new one.
            result = {
                drop(result);
                work()?
            };
        }
        let took_s = watch.processor_s();
        least_s = least_s.min(watch.elapsed_s() / calls as f64);
        spent_s += took_s;
        seconds.push(took_s / calls as f64);
    }
    let [low_s, median_s, high_s] = quartiles(&mut seconds);
    let timing = Timing {
        seconds: median_s,
        low_s,
        high_s,
        elapsed_s: least_s,
        samples: seconds.len(),
    };
    Ok((result, timing))
}

/// Lower quartile, median and upper quartile of `values`, which are sorted; NaN without values.
#[must_use]
pub fn quartiles(values: &mut [f64]) -> [f64; 3] {
    values.sort_unstable_by(f64::total_cmp);
    [0.25, 0.5, 0.75].map(|part| quantile(values, part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_ends_the_measurement() {
        let failed: Result<((), Timing), &str> = measure(&Effort::FULL, || Err("no"));
        assert_eq!(failed.unwrap_err(), "no");
    }
}
