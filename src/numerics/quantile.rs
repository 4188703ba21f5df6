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
