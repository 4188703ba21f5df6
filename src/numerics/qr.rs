//! The triangular factor of a tall matrix, by Householder reflections over fixed row chunks.
//!
//! Each chunk of rows is stacked under the running factor and reduced, many columns in parallel; groups of
//! chunks run in parallel and are merged in order, so that the result does not
//! depend on the number of threads. The backward error is that of a plain
//! Householder QR, column by column; the matrix times its transpose is never formed.

use std::ops::Range;

use fluxform_base::progress;
use rayon::prelude::*;

use super::real::Real;

/// Rows reduced at a time: ten columns of them stay in the first-level cache.
const CHUNK_ROWS: usize = 256;
/// Columns whose reflections the others take together, side by side.
const PANEL_COLUMNS: usize = 32;
/// Chunks of one parallel task.
const GROUP_CHUNKS: usize = 64;
/// Squares of what is left of a column up to which it is nothing. Where columns depend on others, as where
/// they are more than the rows, rounding is left, and of the next one the rounding of that, down to where
/// squares underflow and reflections are not finite.
const NOTHING: f64 = 1e-200;

/// An upper triangular factor: column `j` holds its entries `0..=j`, the rest is zero.
#[derive(Debug, Clone)]
pub struct Triangle<T> {
    size: usize,
    /// Column by column, `size` entries each.
    entries: Vec<T>,
}

impl<T: Real> Triangle<T> {
    fn zero(size: usize) -> Self {
        Self {
            size,
            entries: vec![T::ZERO; size * size],
        }
    }

    /// `size` columns one after another, zero below the diagonal.
    pub(crate) fn of(size: usize, entries: Vec<T>) -> Self {
        Self { size, entries }
    }

    /// Number of rows and columns.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// Column `j`, all `size` entries.
    #[must_use]
    pub fn column(&self, j: usize) -> &[T] {
        &self.entries[j * self.size..(j + 1) * self.size]
    }

    /// All columns one after another, `size` entries each.
    #[must_use]
    pub fn into_columns(self) -> Vec<T> {
        self.entries
    }

    /// Replaces this factor by that of itself over `block`: `rows` rows stored
    /// column by column, `stride` apart. The block is overwritten.
    fn absorb(&mut self, block: &mut [T], rows: usize, stride: usize) {
        let n = self.size;
        for start in (0..n).step_by(PANEL_COLUMNS) {
            let width = PANEL_COLUMNS.min(n - start);
            let (panel, others) = block[start * stride..].split_at_mut(width * stride);
            let (above, others_above) = self.entries[start * n..].split_at_mut(width * n);
            let above = above.chunks_exact_mut(n);
            let mut reflections: Vec<Reflection<T>> = Vec::with_capacity(width);
            for (row, (column, above)) in (start..).zip(panel.chunks_exact_mut(stride).zip(above)) {
                progress::poll();
                reflections.iter().for_each(|r| r.apply(above, column));
                reflections.extend(Reflection::new(row, above, &column[..rows]));
            }
            if others.is_empty() {
                break;
            }
            let above = others_above.par_chunks_exact_mut(n);
            (others.par_chunks_exact_mut(stride).zip(above)).for_each(|(column, above)| {
                progress::poll();
                reflections.iter().for_each(|r| r.apply(above, column));
            });
        }
    }
}

/// `1 - (top, below)(top, below)' scale` on one row of the factor and the rows of a block under it.
struct Reflection<'a, T> {
    row: usize,
    top: T,
    below: &'a [T],
    scale: T,
}

impl<'a, T: Real> Reflection<'a, T> {
    /// The one that leaves nothing of a column `below` this row, where there is anything; its entry of the factor
    /// takes it up.
    fn new(row: usize, above: &mut [T], below: &'a [T]) -> Option<Self> {
        let square = T::dot(below, below);
        if square <= T::of(NOTHING) {
            return None;
        }
        let alpha = above[row];
        let norm = (alpha * alpha + square).sqrt();
        let beta = if alpha > T::ZERO { -norm } else { norm };
        let top = alpha - beta;
        above[row] = beta;
        Some(Self {
            row,
            top,
            below,
            // |(top, below)|^2 = -2 beta top.
            scale: -(T::ONE / (beta * top)),
        })
    }

    /// Of another column.
    fn apply(&self, above: &mut [T], column: &mut [T]) {
        let entry = &mut above[self.row];
        let factor = -(self.scale * (self.top * *entry + T::dot(self.below, column)));
        *entry += factor * self.top;
        T::add_scaled(column, factor, self.below);
    }
}

/// R of `A = QR`, `A` of `rows` rows and `columns` columns (`rows` may be the smaller).
///
/// `fill(range, block, stride)` writes rows `range` of `A` into `block` column by
/// column, columns `stride` apart. The largest entries of a column should be of order one. Signs of R's
/// diagonal are arbitrary.
pub fn triangular_factor<T: Real>(
    rows: usize,
    columns: usize,
    fill: impl Fn(Range<usize>, &mut [T], usize) + Sync,
) -> Triangle<T> {
    let group_rows = CHUNK_ROWS * GROUP_CHUNKS;
    let reduce = |group: usize| {
        let end = rows.min((group + 1) * group_rows);
        let mut factor = Triangle::zero(columns);
        let mut block = vec![T::ZERO; CHUNK_ROWS * columns];
        for start in (group * group_rows..end).step_by(CHUNK_ROWS) {
            let range = start..end.min(start + CHUNK_ROWS);
            let filled = range.len();
            fill(range, &mut block, CHUNK_ROWS);
            factor.absorb(&mut block, filled, CHUNK_ROWS);
        }
        factor
    };
    let groups = rows.div_ceil(group_rows);
    if groups <= 1 {
        return reduce(0);
    }
    let factors: Vec<Triangle<T>> = (0..groups).into_par_iter().map(reduce).collect();
    let mut merged = Triangle::zero(columns);
    for mut factor in factors {
        merged.absorb(&mut factor.entries, columns, columns);
    }
    merged
}
