//! Dense systems of some thousand unknowns, factorised once for many right-hand sides.

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};
use rayon::prelude::*;

/// Columns that are eliminated together.
const BLOCK: usize = 48;
/// Columns a portion of work.
const PORTION: usize = 96;

/// P A = L U, rows exchanged for the largest pivot of a column.
///
/// Golub and Van Loan, Matrix Computations, algorithm 3.4.1 with blocks: what a block of columns takes from
/// those on its right is one product, portion by portion of fixed size, so threads change no byte.
#[derive(Debug, Clone)]
pub struct Factored {
    factors: DMatrix<f64>,
    /// The row that each was exchanged with, in order.
    pivots: Vec<usize>,
}

impl Factored {
    /// Factorises a square matrix; `None` where it is singular.
    ///
    /// # Panics
    /// When the matrix is not square.
    #[must_use]
    pub fn new(mut factors: DMatrix<f64>) -> Option<Self> {
        assert!(factors.is_square(), "as many rows as columns");
        let size = factors.nrows();
        let mut pivots = Vec::with_capacity(size);
        for from in (0..size).step_by(BLOCK) {
            fluxform_base::progress::poll();
            let to = (from + BLOCK).min(size);
            let exchanged = eliminate(&mut factors, from, to)?;
            let (left, right) = factors.as_mut_slice().split_at_mut(to * size);
            let block = DMatrixView::from_slice(&left[from * size..], size, to - from);
            right.par_chunks_mut(PORTION * size).for_each(|part| {
                fluxform_base::progress::poll();
                let columns = part.len() / size;
                let mut part = DMatrixViewMut::from_slice(part, size, columns);
                exchange(&mut part, from, &exchanged);
                let mut upper = part.rows_mut(from, to - from);
                let square = block.rows(from, to - from);
                square.solve_lower_triangular_with_diag_unchecked_mut(&mut upper, 1.0);
                let upper = upper.into_owned();
                let mut rest = part.rows_mut(to, size - to);
                rest.gemm(-1.0, &block.rows(to, size - to), &upper, 1.0);
            });
            let mut before = DMatrixViewMut::from_slice(&mut left[..from * size], size, from);
            exchange(&mut before, from, &exchanged);
            pivots.extend(exchanged);
        }
        Some(Self { factors, pivots })
    }

    /// Number of unknowns.
    #[must_use]
    pub fn size(&self) -> usize {
        self.pivots.len()
    }

    /// Replaces every column of `right` by the solution for it.
    ///
    /// # Panics
    /// When `right` has another number of rows.
    pub fn solve(&self, right: &mut DMatrix<f64>) {
        let size = self.size();
        assert_eq!(right.nrows(), size, "as many rows as unknowns");
        exchange(&mut right.as_view_mut(), 0, &self.pivots);
        let blocks: Vec<usize> = (0..size).step_by(BLOCK).collect();
        for from in &blocks {
            fluxform_base::progress::poll();
            let to = (from + BLOCK).min(size);
            let block = self.factors.columns(*from, to - from);
            let mut own = right.rows_mut(*from, to - from);
            let square = block.rows(*from, to - from);
            square.solve_lower_triangular_with_diag_unchecked_mut(&mut own, 1.0);
            let own = own.into_owned();
            let mut rest = right.rows_mut(to, size - to);
            rest.gemm(-1.0, &block.rows(to, size - to), &own, 1.0);
        }
        for from in blocks.iter().rev() {
            fluxform_base::progress::poll();
            let to = (from + BLOCK).min(size);
            let block = self.factors.columns(*from, to - from);
            let mut own = right.rows_mut(*from, to - from);
            let square = block.rows(*from, to - from);
            square.solve_upper_triangular_unchecked_mut(&mut own);
            let own = own.into_owned();
            let mut rest = right.rows_mut(0, *from);
            rest.gemm(-1.0, &block.rows(0, *from), &own, 1.0);
        }
    }
}

/// Eliminates the columns `from` to `to`; the row that each was exchanged with in them, `None` where all that is
/// left of a column is nothing.
fn eliminate(factors: &mut DMatrix<f64>, from: usize, to: usize) -> Option<Vec<usize>> {
    let size = factors.nrows();
    let mut exchanged = Vec::with_capacity(to - from);
    for pivot in from..to {
        let row = pivot + factors.column(pivot).rows_range(pivot..).iamax();
        factors.columns_range_mut(from..to).swap_rows(pivot, row);
        exchanged.push(row);
        let largest = factors[(pivot, pivot)];
        if largest == 0.0 || !largest.is_finite() {
            return None;
        }
        let (mut own, mut others) = factors.columns_range_pair_mut(pivot, pivot + 1..to);
        let mut below = own.rows_range_mut(pivot + 1..);
        below /= largest;
        for mut other in others.column_iter_mut() {
            let factor = other[pivot];
            let mut rest = other.rows_range_mut(pivot + 1..size);
            rest.axpy(-factor, &below, 1.0);
        }
    }
    Some(exchanged)
}

/// Exchanges the rows from `first` on with those of `rows`, in order.
fn exchange(part: &mut DMatrixViewMut<'_, f64>, first: usize, rows: &[usize]) {
    for mut column in part.column_iter_mut() {
        for (row, other) in rows.iter().enumerate() {
            column.swap_rows(first + row, *other);
        }
    }
}
