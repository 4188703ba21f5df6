//! Time and memory against size, from which follows where a stage breaks.
//!
//! Every row is a process of its own, so that its peak memory is its own.

mod sizes;

use std::process::Command;

pub use sizes::{LAWS, Spec};

use super::BenchRequest;
use super::memory::peak_bytes;
use crate::file::{Law, Outlook, SizeRow};
use fluxform::RunError;
use fluxform::commands::bench::clock::{Effort, Timing};
use fluxform::progress::Progress;

/// Limits of a scene: an hour of processor time, and memory.
const HOUR_S: f64 = 3600.0;
const MEMORY_BYTES: f64 = 24.0 * 1024.0 * 1024.0 * 1024.0;
/// Relative difference of sizes that are one.
const SAME: f64 = 0.02;
/// Times the seed's size.
const FACTORS: [f64; 2] = [100.0, 10_000.0];
/// The stage that does nothing: what the program takes without work.
pub const IDLE: &str = "idle";
/// The axis whose sizes are numbers of threads.
pub const THREADS: &str = "threads";

const EFFORT: Effort = Effort {
    sample_s: 1e-3,
    enough_s: 1.0,
    samples: 7,
};

/// A straight line through points, with the slope's standard error (0 for two points).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// dy/dx.
    pub slope: f64,
    /// y at x = 0.
    pub intercept: f64,
    /// Standard error of the slope.
    pub slope_error: f64,
}

/// Least squares; NaN for fewer than two points.
#[must_use]
pub fn line(points: &[(f64, f64)]) -> Fit {
    let n = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (mx, my) = (mean(|p| p.0), mean(|p| p.1));
    let xx: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let xy: f64 = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    let slope = xy / xx;
    let intercept = my - slope * mx;
    let left: f64 = points
        .iter()
        .map(|p| (p.1 - intercept - slope * p.0).powi(2))
        .sum();
    let slope_error = if points.len() > 2 {
        (left / (n - 2.0) / xx).sqrt()
    } else {
        0.0
    };
    Fit {
        slope,
        intercept,
        slope_error,
    }
}

/// Measures one size in this process.
///
/// # Errors
/// A stage that is not known; those of the stage.
pub fn size_row(
    stage: &str,
    axis: &str,
    setting: usize,
    threads: usize,
) -> Result<SizeRow, RunError> {
    if stage == IDLE {
        return Ok(row(0.0, threads, &NOTHING));
    }
    let spec = LAWS.iter().find(|s| s.stage == stage && s.axis == axis);
    let spec = spec.ok_or_else(|| RunError::Input(format!("no law of {stage} against {axis}")))?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| RunError::Input(format!("{threads} threads: {error}")))?;
    let (size, timing) = pool.install(|| (spec.run)(setting, &EFFORT))?;
    let size = if axis == THREADS {
        threads as f64
    } else {
        size
    };
    Ok(row(size, threads, &timing))
}

const NOTHING: Timing = Timing {
    seconds: 0.0,
    low_s: 0.0,
    high_s: 0.0,
    elapsed_s: 0.0,
    samples: 0,
};

fn row(size: f64, threads: usize, timing: &Timing) -> SizeRow {
    SizeRow {
        size,
        threads: threads as u64,
        seconds: timing.seconds,
        seconds_low: timing.low_s,
        seconds_high: timing.high_s,
        elapsed_s: timing.elapsed_s,
        peak_bytes: peak_bytes(),
    }
}

/// The requested laws, each size in a process of its own, in their order with those of an `earlier` run.
///
/// # Errors
/// A process that fails; interruption.
pub fn laws(
    request: &BenchRequest,
    earlier: &[Law],
    progress: &dyn Progress,
) -> Result<Vec<Law>, RunError> {
    let quick = request.pace.quick;
    let expected = |spec: &&Spec| request.laws.is_empty() || request.laws.contains(&spec.name());
    let idle = child(IDLE, IDLE, 0, 1)?.peak_bytes;
    let most = std::thread::available_parallelism().map_or(1, usize::from);
    let chosen = LAWS.iter().filter(expected);
    let count = chosen.map(|spec| spec.settings(quick, most).len());
    progress.begin("scaling", count.sum::<usize>() as u64);
    let mut laws = Vec::new();
    for spec in &LAWS {
        if !expected(&spec) {
            let same = |law: &&Law| law.stage == spec.stage && law.axis == spec.axis;
            laws.extend(earlier.iter().find(same).cloned());
            continue;
        }
        let mut sizes = Vec::new();
        for (setting, threads) in spec.settings(quick, most) {
            progress.check()?;
            sizes.push(child(spec.stage, spec.axis, setting, threads)?);
            progress.advance(1);
        }
        laws.push(law(spec, sizes, idle));
    }
    progress.end();
    Ok(laws)
}

/// Runs this program once more for one row.
fn child(stage: &str, axis: &str, setting: usize, threads: usize) -> Result<SizeRow, RunError> {
    let failed =
        |what: String| RunError::Unmet(format!("{stage} against {axis} at {setting}: {what}"));
    let program = std::env::current_exe().map_err(|error| failed(error.to_string()))?;
    let row = format!("{stage}:{axis}:{setting}:{threads}");
    let output = Command::new(program)
        .args(["--size-row", &row])
        .output()
        .map_err(|error| failed(error.to_string()))?;
    if !output.status.success() {
        return Err(failed(String::from_utf8_lossy(&output.stderr).into_owned()));
    }
    serde_json::from_slice(&output.stdout).map_err(|error| failed(error.to_string()))
}

/// Exponents and outlook of the sizes of one law.
#[must_use]
pub fn law(spec: &Spec, sizes: Vec<SizeRow>, idle_bytes: u64) -> Law {
    // Small sizes show the fixed cost, not of the exponent.
    let larger = &sizes[sizes.len() / 2 - usize::from(sizes.len() == 2)..];
    let larger = if larger.len() < 3 {
        &sizes[sizes.len().saturating_sub(3)..]
    } else {
        larger
    };
    let threads = spec.axis == THREADS;
    let of = |value: &dyn Fn(&SizeRow) -> f64| {
        let points: Vec<(f64, f64)> = larger
            .iter()
            .map(|row| (row.size.ln(), value(row).max(1e-12).ln()))
            .collect();
        line(&points)
    };
    let time = of(&|row| if threads { row.elapsed_s } else { row.seconds });
    let beyond = |row: &SizeRow| row.peak_bytes.saturating_sub(idle_bytes).max(1) as f64;
    let memory = of(&beyond);
    let at =
        |fit: &Fit, factor: f64| (fit.intercept + fit.slope * (factor * spec.seed_size).ln()).exp();
    let outlook = FACTORS.iter().filter(|_| !threads).map(|&factor| {
        let size = factor * spec.seed_size;
        let measured = sizes
            .iter()
            .find(|row| (row.size / size - 1.0).abs() < SAME);
        let (seconds, bytes) = match measured {
            Some(row) => (row.seconds, row.peak_bytes as f64),
            None => (at(&time, factor), at(&memory, factor) + idle_bytes as f64),
        };
        let over = [(seconds / HOUR_S, "time"), (bytes / MEMORY_BYTES, "memory")];
        let worst = over.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        let breaks = worst.filter(|(share, _)| *share > 1.0);
        Outlook {
            factor,
            seconds,
            bytes,
            breaks: breaks.map(|(_, what)| what.to_owned()),
        }
    });
    Law {
        stage: spec.stage.to_owned(),
        axis: spec.axis.to_owned(),
        seed_size: spec.seed_size,
        outlook: outlook.collect(),
        sizes,
        seconds_slope: time.slope,
        seconds_slope_error: time.slope_error,
        memory_slope: memory.slope,
        memory_slope_error: memory.slope_error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_with_its_spread() {
        let exact: Vec<(f64, f64)> = (0..5)
            .map(|k| (f64::from(k), 1.3 * f64::from(k) - 0.7))
            .collect();
        let fit = line(&exact);
        assert!((fit.slope - 1.3).abs() < 1e-14 && (fit.intercept + 0.7).abs() < 1e-14);
        assert!(fit.slope_error < 1e-14);
        // y = x with errors +-0.1 in turn: residuals 0.04, -0.12, 0.12, -0.04, so s^2 = 0.032 / 2.
        let rough: Vec<(f64, f64)> = [(0.0, 0.1), (1.0, 0.9), (2.0, 2.1), (3.0, 2.9)].to_vec();
        let fit = line(&rough);
        assert!((fit.slope - 0.96).abs() < 1e-12, "{fit:?}");
        assert!(
            (fit.slope_error - (0.016_f64 / 5.0).sqrt()).abs() < 1e-12,
            "{fit:?}"
        );
    }

    #[test]
    fn a_law_says_where_a_stage_breaks() {
        let sizes = (1..=6)
            .map(|k| {
                let size = f64::from(1 << k);
                SizeRow {
                    size,
                    threads: 1,
                    seconds: 1e-3 * size.powi(3),
                    seconds_low: 0.0,
                    seconds_high: 0.0,
                    elapsed_s: 0.0,
                    peak_bytes: 1_000_000 + (1000.0 * size * size) as u64,
                }
            })
            .collect();
        let spec = &LAWS[0];
        let found = law(spec, sizes, 1_000_000);
        assert!((found.seconds_slope - 3.0).abs() < 1e-9 && found.seconds_slope_error < 1e-9);
        assert!((found.memory_slope - 2.0).abs() < 1e-6);
        let first = &found.outlook[0];
        let size = 100.0 * spec.seed_size;
        assert!((first.seconds / (1e-3 * size.powi(3)) - 1.0).abs() < 1e-6);
        assert_eq!(first.breaks.as_deref(), Some("time"));
    }

    #[test]
    fn one_size_is_measured_and_an_unknown_law_is_refused() {
        let row = size_row("lambda-path", "points", 11, 1).unwrap();
        assert_eq!((row.size, row.threads), (121.0, 1));
        assert!(row.seconds > 0.0 && row.peak_bytes > 0);
        assert!(size_row("lambda-path", "moons", 11, 1).is_err());
        assert_eq!(size_row(IDLE, IDLE, 0, 1).unwrap().seconds, 0.0);
    }
}
