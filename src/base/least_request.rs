//! From which request on an error is stated relative to it.

/// Ratios are looked at where at least this share of the largest force is requested: towards none they say nothing.
pub const LEAST_REQUEST: f64 = 0.05;

/// The lowest height at which ratios to the requested force are looked at, m; `None` where no force is requested.
#[must_use]
pub fn lowest_requested_m(height_m: impl IntoIterator<Item = f64> + Clone) -> Option<f64> {
    let highest_m = height_m.clone().into_iter().fold(0.0, f64::max);
    let counted = height_m
        .into_iter()
        .filter(|h| *h > LEAST_REQUEST * highest_m);
    counted.reduce(f64::min)
}
