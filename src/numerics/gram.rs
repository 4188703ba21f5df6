//! The triangular factor of a tall matrix of doubles from its columns' products, in double-double.
//!
//! Products of doubles are exact in two doubles, so that a row costs half the operations of a reflection
//! and each is cheaper. Products square the condition number: a backward error of the factor is that of
//! double-double times the condition of the matrix, so that this is for conditions far from 1e15, and a
//! column that nearly depends on those before it is refused.
//!
//! Sums are those of Ogita, Rump and Oishi (Accurate sum and dot product, SIAM J. Sci. Comput. 26, 2005)
//! within a chunk of rows, and double-double sums of the chunks in order; the factorisation is
//! Cholesky's. The result does not depend on the number of threads, nor on the machine.

use std::ops::Range;

use rayon::prelude::*;

use super::dispatch::{self, Kernel, LANES, Lanes};
use super::double_double::{DoubleDouble, two_product};
use super::qr::Triangle;
use super::real::Real;

/// Rows of a chunk: two panels of eight columns stay in the first-level cache.
const CHUNK_ROWS: usize = 256;
/// Rows of a parallel task, where that makes no more of them than [`MOST_TASKS`].
const TASK_ROWS: usize = 4 * CHUNK_ROWS;
/// Each holds products of its own.
const MOST_TASKS: usize = 16;
/// Left columns whose sums are held in registers.
const SIDE: usize = 2;
/// A column whose square outside the span of those before it is a smaller share is refused.
const LEAST_SHARE: f64 = 1e-22;

/// A sum with its rounding.
#[derive(Clone, Copy)]
struct Sums {
    high: Lanes,
    low: Lanes,
}

impl Sums {
    const ZERO: Self = Self {
        high: Lanes([0.0; LANES]),
        low: Lanes([0.0; LANES]),
    };

    /// Adds `left right`, whose parts below `left` are `rest`.
    #[inline(always)]
    fn add<const FMA: bool>(&mut self, (left, rest): (f64, f64), right: Lanes) {
        let product = right * left;
        let error = if FMA {
            Lanes(std::array::from_fn(|k| {
                right.0[k].mul_add(left, -product.0[k])
            }))
        } else {
            Lanes(right.0.map(|right| two_product(left, right).1))
        };
        let sum = self.high + product;
        let part = sum - self.high;
        let lost = (self.high - (sum - part)) + (product - part);
        self.high = sum;
        self.low = self.low + (lost + (error + right * rest));
    }
}

/// Columns in panels of eight, row by row within a panel.
struct Panels {
    entries: Vec<[f64; LANES]>,
    rows: usize,
}

impl Panels {
    fn new(columns: usize) -> Self {
        Self {
            entries: vec![[0.0; LANES]; columns.div_ceil(LANES) * CHUNK_ROWS],
            rows: 0,
        }
    }

    /// Takes `rows` rows stored column by column, `CHUNK_ROWS` apart.
    fn pack(&mut self, block: &[f64], rows: usize) {
        self.rows = rows;
        for (j, column) in block.chunks_exact(CHUNK_ROWS).enumerate() {
            let panel = &mut self.entries[j / LANES * CHUNK_ROWS..][..rows];
            for (entries, &value) in panel.iter_mut().zip(column) {
                entries[j % LANES] = value;
            }
        }
    }

    fn panel(&self, k: usize) -> &[[f64; LANES]] {
        &self.entries[k * CHUNK_ROWS..][..self.rows]
    }
}

/// Adds the products of the columns of a chunk, weighted row by row, to `sums`: column `j` holds those with
/// columns `0..=j` and, up to the end of its panel, some of the others.
struct AddProducts<'a> {
    panels: &'a Panels,
    weights: &'a [f64],
    columns: usize,
    sums: &'a mut [DoubleDouble],
}

impl Kernel for AddProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let count = self.columns.div_ceil(LANES);
        let mut left = vec![[(0.0, 0.0); SIDE]; self.panels.rows];
        for first in (0..self.columns).step_by(SIDE) {
            fluxform_base::progress::poll();
            let panel = self.panels.panel(first / LANES);
            for ((left, entries), &weight) in left.iter_mut().zip(panel).zip(self.weights) {
                *left = std::array::from_fn(|k| two_product(weight, entries[first % LANES + k]));
            }
            for right in first / LANES..count {
                let mut sums = [Sums::ZERO; SIDE];
                for (left, &right) in left.iter().zip(self.panels.panel(right)) {
                    for k in 0..SIDE {
                        sums[k].add::<FMA>(left[k], Lanes(right));
                    }
                }
                let last = self.columns.min((right + 1) * LANES);
                for (lane, j) in (right * LANES..last).enumerate() {
                    for (k, i) in (first..self.columns.min(first + SIDE)).enumerate() {
                        self.sums[j * self.columns + i] +=
                            DoubleDouble::exactly(sums[k].high.0[lane])
                                + DoubleDouble::exactly(sums[k].low.0[lane]);
                    }
                }
            }
        }
    }
}

/// R of `A = QR` for `A` of `rows` rows and `columns` columns, row `i` times the root of weight `i`;
/// `None` where a column is too near to the span of those before it.
///
/// `fill(range, block, stride)` writes rows `range` of `A` without their weights into `block` column by
/// column, columns `stride` apart, and `weigh(range, weights)` their weights. Entries and weights should be of order
/// one at most.
pub fn triangular_factor_by_products(
    rows: usize,
    columns: usize,
    fill: impl Fn(Range<usize>, &mut [f64], usize) + Sync,
    weigh: impl Fn(Range<usize>, &mut [f64]) + Sync,
) -> Option<Triangle<DoubleDouble>> {
    let task_rows = TASK_ROWS.max(rows.div_ceil(MOST_TASKS));
    let sum = |task: usize| {
        let end = rows.min((task + 1) * task_rows);
        let mut sums = vec![DoubleDouble::ZERO; columns * columns];
        let mut block = vec![0.0; CHUNK_ROWS * columns];
        let mut weights = [0.0; CHUNK_ROWS];
        let mut panels = Panels::new(columns);
        for start in (task * task_rows..end).step_by(CHUNK_ROWS) {
            let range = start..end.min(start + CHUNK_ROWS);
            fill(range.clone(), &mut block, CHUNK_ROWS);
            weigh(range.clone(), &mut weights[..range.len()]);
            panels.pack(&block, range.len());
            dispatch::run(AddProducts {
                panels: &panels,
                weights: &weights,
                columns,
                sums: &mut sums,
            });
        }
        sums
    };
    let tasks: Vec<_> = (0..rows.div_ceil(task_rows))
        .into_par_iter()
        .map(sum)
        .collect();
    let mut tasks = tasks.into_iter();
    let mut products = tasks.next()?;
    for task in tasks {
        for (sum, more) in products.iter_mut().zip(task) {
            *sum += more;
        }
    }
    cholesky(columns, products)
}

/// The factor of the matrix whose column `j` holds the products with columns `0..=j`.
fn cholesky(columns: usize, products: Vec<DoubleDouble>) -> Option<Triangle<DoubleDouble>> {
    let mut entries = products;
    for j in 0..columns {
        fluxform_base::progress::poll();
        let (before, rest) = entries.split_at_mut(j * columns);
        let column = &mut rest[..columns];
        for i in 0..j {
            let earlier = &before[i * columns..][..=i];
            column[i] = (column[i] - DoubleDouble::dot(&earlier[..i], column)) / earlier[i];
        }
        let square = column[j];
        let outside = square - DoubleDouble::dot(&column[..j], &column[..j]);
        if outside <= DoubleDouble::of(LEAST_SHARE) * square {
            return None;
        }
        column[j] = outside.sqrt();
        column[j + 1..].fill(DoubleDouble::ZERO);
    }
    Some(Triangle::of(columns, entries))
}
