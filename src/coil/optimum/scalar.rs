//! Searches in one variable, by argmin: Brent's root finder and Brent's minimiser.

use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::brent::{BrentOpt, BrentRoot};

/// A function of one variable as argmin wants it.
struct Of<F>(F);

impl<F: Fn(f64) -> f64> CostFunction for Of<F> {
    type Param = f64;
    type Output = f64;

    fn cost(&self, x: &f64) -> Result<f64, Error> {
        Ok((self.0)(*x))
    }
}

const ITERATIONS: u64 = 100;

/// Where `f` changes sign between `lo` and `hi`, to `tolerance`; `None` where it does not.
#[must_use]
pub fn root(f: impl Fn(f64) -> f64, lo: f64, hi: f64, tolerance: f64) -> Option<f64> {
    let result = Executor::new(Of(f), BrentRoot::new(lo, hi, tolerance))
        .configure(|state| state.param(0.5 * (lo + hi)).max_iters(ITERATIONS))
        .timer(false)
        .run()
        .ok()?;
    result.state().get_best_param().copied()
}

/// Where `f` is largest between `lo` and `hi`, and its value there: a maximum inside, or an end.
/// Domain: one maximum.
#[must_use]
pub fn maximum(f: impl Fn(f64) -> f64, lo: f64, hi: f64) -> (f64, f64) {
    let (at_lo, at_hi) = (f(lo), f(hi));
    let ends = if at_hi > at_lo {
        (hi, at_hi)
    } else {
        (lo, at_lo)
    };
    if hi - lo <= f64::EPSILON * hi.abs() {
        return ends;
    }
    let inside = Executor::new(
        Of(|x| -f(x)),
        BrentOpt::new(lo, hi).set_tolerance(1e-8, 0.0),
    )
    .configure(|state| state.max_iters(ITERATIONS))
    .timer(false)
    .run()
    .ok()
    .and_then(|result| {
        let state = result.state();
        Some((*state.get_best_param()?, -state.get_best_cost()))
    });
    match inside {
        Some((x, value)) if value > ends.1 => (x, value),
        _ => ends,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_a_root_or_reports_none() {
        let x = root(|x| x * x * x - 0.7, 0.0, 1.3, 1e-14).expect("brackets it");
        assert!((x - 0.7_f64.cbrt()).abs() < 1e-13);
        assert_eq!(root(|x| x * x + 0.7, -1.3, 0.7, 1e-14), None);
    }

    #[test]
    fn finds_a_maximum_inside_or_at_an_end() {
        let (x, value) = maximum(|x| x * (-x / 0.7).exp(), 0.1, 2.9);
        assert!((x - 0.7).abs() < 1e-7 && (value - 0.7 / 1.0_f64.exp()).abs() < 1e-15);
        assert_eq!(maximum(|x| 1.3 * x, 0.2, 0.7).0, 0.7);
        assert_eq!(maximum(|x| -x, 0.2, 0.2).0, 0.2);
    }
}
