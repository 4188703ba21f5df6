//! Quantiles of samples.

/// The value below which the `part` of `ascending` lies: between the order statistics at (n - 1) `part`,
/// linearly; NaN without values.
///
/// Domain: `part` in `[0, 1]`.
#[must_use]
pub fn quantile(ascending: &[f64], part: f64) -> f64 {
    let Some(last) = ascending.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = part * last as f64;
    let below = at.floor() as usize;
    let above = (below + 1).min(last);
    ascending[below] + (at - below as f64) * (ascending[above] - ascending[below])
}

/// The same of values with weights, each in the middle of its own: weights that are all alike give [`quantile`].
///
/// Domain: `part` in `[0, 1]`, weights above zero.
#[must_use]
pub fn weighted_quantile(ascending: &[(f64, f64)], part: f64) -> f64 {
    let (Some(first), Some(last)) = (ascending.first(), ascending.last()) else {
        return f64::NAN;
    };
    let total: f64 = ascending.iter().map(|(_, weight)| weight).sum();
    // From the middle of the first weight to that of the last.
    let at = part * (total - 0.5 * (first.1 + last.1));
    let (mut below, mut sum) = (first, 0.0);
    for next in &ascending[1..] {
        let step = 0.5 * (below.1 + next.1);
        if sum + step >= at {
            return below.0 + ((at - sum) / step).clamp(0.0, 1.0) * (next.0 - below.0);
        }
        (below, sum) = (next, sum + step);
    }
    last.0
}
