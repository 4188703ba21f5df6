//! Arrays of a `map.npz`, the conditions on every one, and the faults of one that breaks them.

use std::borrow::Cow;

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

/// An array of real numbers in a `map.npz`.
#[derive(Debug, Clone, PartialEq)]
pub struct Array<'a> {
    /// Its name.
    pub name: &'static str,
    /// The length along every dimension; empty for a single number.
    pub shape: Vec<usize>,
    /// Its numbers in C order.
    pub values: Cow<'a, [f64]>,
}

impl<'a> Array<'a> {
    pub(super) fn new(
        name: &'static str,
        shape: &[usize],
        values: impl Into<Cow<'a, [f64]>>,
    ) -> Self {
        Self {
            name,
            shape: shape.to_vec(),
            values: values.into(),
        }
    }

    /// The same with numbers of its own.
    #[must_use]
    pub fn into_owned(self) -> Array<'static> {
        Array {
            name: self.name,
            shape: self.shape,
            values: Cow::Owned(self.values.into_owned()),
        }
    }

    /// As many numbers as its shape says, each finite and in range.
    pub(super) fn check(&self) -> Result<(), NpzError> {
        let &Self {
            name, ref values, ..
        } = self;
        let sizes = &mut self.shape.iter();
        let count = sizes.try_fold(1_usize, |n, size| n.checked_mul(*size));
        let count = count.ok_or_else(|| bad(name, "is too large"))?;
        if values.len() != count {
            let message = format!("must hold {count} numbers, holds {}", values.len());
            return Err(bad(name, message));
        }
        if all_within(values, LARGEST) {
            return Ok(());
        }
        let finite = values.iter().all(|value| value.is_finite());
        let not_finite = "holds a number that is not finite";
        Err(bad(name, if finite { BEYOND } else { not_finite }))
    }
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
const BEYOND: &str = "holds a number beyond 1e30, which no coil or magnet gives";
/// Nodes lie no farther out, m, and are no closer to each other: nor are products of three such
/// distances, by which the interpolation divides, nothing.
const FARTHEST_M: f64 = 1e6;
const CLOSEST_M: f64 = 1e-15;

/// Whether every number is finite and none larger; in blocks, so that it runs at memory speed.
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
