//! Conditions on every array of a `map.npz`, and the faults of one that breaks them.

/// Faults of a `map.npz`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NpzError {
    /// Not a zip archive, or cut short.
    #[error("not a readable NPZ archive ({0})")]
    Archive(String),
    /// An array that must be there is not.
    #[error("array {0} is missing")]
    Missing(&'static str),
    /// An array that is not as it must be.
    #[error("array {name} {message}")]
    Array {
        /// Its name.
        name: &'static str,
        /// Expectation and result.
        message: String,
    },
}

pub(super) fn bad(name: &'static str, message: impl Into<String>) -> NpzError {
    NpzError::Array {
        name,
        message: message.into(),
    }
}

/// Numbers of a bundle are no larger, in their SI units: so many of them times each other, as eq. 8
/// and the interpolation multiply them, are still numbers.
pub(super) const LARGEST: f64 = 1e30;
pub(super) const BEYOND: &str = "holds a number beyond 1e30, which no coil or magnet gives";
/// Nodes lie no farther out, m, and are no closer to each other: nor are products of three such
/// distances, by which the interpolation divides, nothing.
const FARTHEST_M: f64 = 1e6;
const CLOSEST_M: f64 = 1e-15;

/// Whether no number is larger; in blocks, as [`all_finite`].
pub(super) fn all_within(values: &[f64], largest: f64) -> bool {
    values.chunks(1024).all(|block| {
        fluxform_base::progress::poll();
        block
            .iter()
            .fold(true, |all, value| all & (value.abs() <= largest))
    })
}

/// Nodes, which increase, between which can be interpolated.
pub(super) fn check_nodes(name: &'static str, nodes: &[f64]) -> Result<(), NpzError> {
    if !all_within(nodes, FARTHEST_M) {
        return Err(bad(name, "must lie within 1e6 m"));
    }
    if nodes.windows(2).any(|pair| pair[1] - pair[0] < CLOSEST_M) {
        return Err(bad(name, "must have nodes at least 1e-15 m apart"));
    }
    Ok(())
}

/// Whether all numbers are finite; in blocks, so that it runs at memory speed.
pub(super) fn all_finite(values: &[f64]) -> bool {
    values.chunks(1024).all(|block| {
        fluxform_base::progress::poll();
        block
            .iter()
            .fold(true, |all, value| all & value.is_finite())
    })
}
