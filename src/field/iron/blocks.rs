//! A matrix in blocks of neighbouring places; those far from each other as products of few columns and rows.
//!
//! A block is evaluated whole, and taken apart by crosses of its largest remaining entries (adaptive cross
//! approximation) until none is above a threshold, which is looked for in all of it.

use nalgebra::{DMatrix, DMatrixView, DVector};
use rayon::prelude::*;

/// Places of a cluster, about.
const CLUSTER: usize = 96;
/// A product is kept up to this part of a block's entries.
const WORTH: f64 = 0.5;
/// Clusters this many of the larger radius apart are far from each other.
pub(super) const FAR: f64 = 0.1;

/// A block of a matrix.
#[derive(Debug, Clone)]
enum Block {
    Whole(DMatrix<f64>),
    /// left right^T.
    Product(DMatrix<f64>, DMatrix<f64>),
}

impl Block {
    /// `whole` with no entry changed by more than `threshold`.
    fn compressed(whole: DMatrix<f64>, threshold: f64) -> Self {
        let (rows, columns) = whole.shape();
        let most = (WORTH * (rows * columns) as f64 / (rows + columns) as f64) as usize;
        let (mut left, mut right): (Vec<DVector<f64>>, Vec<DVector<f64>>) = Default::default();
        let mut row = 0;
        while left.len() < most {
            // The cross of the row's largest entry, then of the largest of that column.
            let rest =
                |mut whole: DVector<f64>, of: &[DVector<f64>], with: &[DVector<f64>], at: usize| {
                    for (of, with) in of.iter().zip(with) {
                        whole.axpy(-with[at], of, 1.0);
                    }
                    whole
                };
            let along = rest(whole.row(row).transpose(), &right, &left, row);
            let column = along.icamax();
            let across = rest(whole.column(column).into_owned(), &left, &right, column);
            let pivot = across.icamax();
            if across[pivot].abs() <= threshold {
                let Some(other) = far_from(&whole, &left, &right, threshold) else {
                    return Self::product(rows, columns, &left, &right);
                };
                row = other;
                continue;
            }
            let along = rest(whole.row(pivot).transpose(), &right, &left, pivot);
            let scaled = along / across[pivot];
            let mut others = across.clone();
            others[pivot] = 0.0;
            row = others.icamax();
            left.push(across);
            right.push(scaled);
        }
        Self::Whole(whole)
    }

    fn product(rows: usize, columns: usize, left: &[DVector<f64>], right: &[DVector<f64>]) -> Self {
        if left.is_empty() {
            return Self::Product(DMatrix::zeros(rows, 0), DMatrix::zeros(columns, 0));
        }
        Self::Product(DMatrix::from_columns(left), DMatrix::from_columns(right))
    }

    fn entries(&self) -> usize {
        match self {
            Self::Whole(whole) => whole.len(),
            Self::Product(left, right) => left.len() + right.len(),
        }
    }

    /// Adds its product with `x` to `out`.
    fn add_to(&self, x: DMatrixView<'_, f64>, out: &mut DMatrix<f64>) {
        match self {
            Self::Whole(whole) => out.gemm(1.0, whole, &x, 1.0),
            Self::Product(_, right) if right.ncols() == 0 => {}
            Self::Product(left, right) => out.gemm(1.0, left, &right.tr_mul(&x), 1.0),
        }
    }

    fn whole(&self) -> DMatrix<f64> {
        match self {
            Self::Whole(whole) => whole.clone(),
            Self::Product(left, right) => left * right.transpose(),
        }
    }
}

/// The row of the largest entry of what a product leaves of `whole`, if that is above `threshold`.
fn far_from(
    whole: &DMatrix<f64>,
    left: &[DVector<f64>],
    right: &[DVector<f64>],
    threshold: f64,
) -> Option<usize> {
    let mut rest = whole.clone();
    if !left.is_empty() {
        let (left, right) = (DMatrix::from_columns(left), DMatrix::from_columns(right));
        rest.gemm(-1.0, &left, &right.transpose(), 1.0);
    }
    let (row, column) = rest.icamax_full();
    (rest[(row, column)].abs() > threshold).then_some(row)
}

/// Places in clusters of neighbours.
#[derive(Debug, Clone)]
pub(super) struct Clusters {
    /// The number of every place, cluster by cluster.
    pub(super) order: Vec<usize>,
    /// Of every cluster the items that it is made of.
    pub(super) items: Vec<Vec<usize>>,
    /// The first place of every cluster, and their number.
    pub(super) starts: Vec<usize>,
}

impl Clusters {
    /// Of items about `centres_m`, each of the places `of_item`.
    pub(super) fn new(
        centres_m: &[[f64; 3]],
        of_item: impl Fn(usize) -> std::ops::Range<usize>,
    ) -> Self {
        let mut items = Vec::new();
        halve(
            centres_m,
            (0..centres_m.len()).collect(),
            &|items| items.iter().map(|item| of_item(*item).len()).sum(),
            &mut items,
        );
        let (mut order, mut starts) = (Vec::new(), vec![0]);
        for cluster in &items {
            order.extend(cluster.iter().flat_map(|item| of_item(*item)));
            starts.push(order.len());
        }
        Self {
            order,
            items,
            starts,
        }
    }

    /// The places of a cluster.
    pub(super) fn places(&self, cluster: usize) -> &[usize] {
        &self.order[self.starts[cluster]..self.starts[cluster + 1]]
    }
}

fn halve(
    centres_m: &[[f64; 3]],
    mut items: Vec<usize>,
    size: &impl Fn(&[usize]) -> usize,
    out: &mut Vec<Vec<usize>>,
) {
    if items.len() < 2 || size(&items) <= CLUSTER {
        // Of no items there is no cluster.
        out.extend(Some(items).filter(|items| !items.is_empty()));
        return;
    }
    let extent = |axis: &usize| {
        let along = items.iter().map(|item| centres_m[*item][*axis]);
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
            (a.min(x), b.max(x))
        });
        high - low
    };
    let longest = (0..3).max_by(|a, b| extent(a).total_cmp(&extent(b)));
    let axis = longest.unwrap_or_default();
    items.sort_by(|a, b| {
        let along = |item: &usize| centres_m[*item][axis];
        along(a).total_cmp(&along(b)).then(a.cmp(b))
    });
    let second = items.split_off(items.len() / 2);
    halve(centres_m, items, size, out);
    halve(centres_m, second, size, out);
}

/// A square matrix in blocks of clusters.
#[derive(Debug, Clone, Default)]
pub(super) struct Blocks {
    /// [row cluster][column cluster].
    blocks: Vec<Vec<Block>>,
}

/// One row of blocks, and what it takes.
pub(super) struct BlockRow(Vec<Block>);

impl BlockRow {
    pub(super) fn with_capacity(clusters: usize) -> Self {
        Self(Vec::with_capacity(clusters))
    }

    /// Adds the next block, entries of which may change by `threshold`; at 0 it is kept as it is. The number of
    /// entries that it takes.
    pub(super) fn push(&mut self, whole: DMatrix<f64>, threshold: f64) -> usize {
        let block = if threshold > 0.0 {
            Block::compressed(whole, threshold)
        } else {
            Block::Whole(whole)
        };
        let entries = block.entries();
        self.0.push(block);
        entries
    }
}

impl Blocks {
    pub(super) fn push(&mut self, row: BlockRow) {
        self.blocks.push(row.0);
    }

    /// The product with `x`, both in the order of places.
    pub(super) fn apply(&self, clusters: &Clusters, x: &DMatrix<f64>) -> DMatrix<f64> {
        let inner = x.select_rows(&clusters.order);
        let columns = x.ncols();
        let parts: Vec<DMatrix<f64>> = (self.blocks.par_iter().enumerate())
            .map(|(number, row)| {
                let mut out = DMatrix::zeros(clusters.places(number).len(), columns);
                for (other, block) in row.iter().enumerate() {
                    fluxform_base::progress::poll();
                    let of = clusters.places(other).len();
                    block.add_to(inner.rows(clusters.starts[other], of), &mut out);
                }
                out
            })
            .collect();
        let mut out = DMatrix::zeros(x.nrows(), columns);
        for (number, part) in parts.iter().enumerate() {
            for (place, row) in clusters.places(number).iter().zip(part.row_iter()) {
                out.row_mut(*place).copy_from(&row);
            }
        }
        out
    }

    /// The whole matrix, in the order of places.
    pub(super) fn whole(&self, clusters: &Clusters) -> DMatrix<f64> {
        let size = clusters.order.len();
        let mut out = DMatrix::zeros(size, size);
        for (number, row) in self.blocks.iter().enumerate() {
            fluxform_base::progress::poll();
            for (other, block) in row.iter().enumerate() {
                let block = block.whole();
                for (k, column) in clusters.places(other).iter().enumerate() {
                    for (value, row) in block.column(k).iter().zip(clusters.places(number)) {
                        out[(*row, *column)] = *value;
                    }
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a line away from others, one of which reaches far.
    #[test]
    fn a_block_is_a_product_to_the_threshold() {
        let whole = DMatrix::from_fn(60, 50, |i, j| {
            let distance = 0.7 + 0.013 * i as f64 + 0.017 * j as f64;
            // Half of the rows see nothing of the first columns.
            if i < 30 && j < 20 {
                0.0
            } else {
                1.3 / distance
            }
        });
        for threshold in [1e-3, 1e-9] {
            let block = Block::compressed(whole.clone(), threshold);
            assert!(
                block.entries() < 60 * 50 / 2,
                "{threshold}: {}",
                block.entries()
            );
            let error = (block.whole() - &whole).amax();
            assert!(error <= threshold, "{error}");
            let x = DMatrix::from_fn(50, 2, |i, j| 0.3 * i as f64 - j as f64);
            let mut product = DMatrix::from_element(60, 2, 0.7);
            block.add_to(x.as_view(), &mut product);
            let exact = (&whole * &x).add_scalar(0.7);
            assert!((product - exact).amax() < 50.0 * 15.0 * threshold);
        }
        let noise = DMatrix::from_fn(40, 40, |i, j| ((i * 7919 + j * 104_729) % 1013) as f64);
        assert!(matches!(Block::compressed(noise, 1e-3), Block::Whole(_)));
        let none = Block::compressed(DMatrix::zeros(30, 20), 1e-3);
        assert_eq!(none.entries(), 0);
    }

    #[test]
    fn clusters_hold_every_place_once() {
        let centres: Vec<[f64; 3]> = (0..200)
            .map(|k| [0.37, 0.71, 0.53].map(|step| (step * f64::from(k)).fract()))
            .collect();
        let clusters = Clusters::new(&centres, |item| 9 * item..9 * item + 9);
        assert!(clusters.items.len() >= 7, "{}", clusters.items.len());
        let mut all = clusters.order.clone();
        all.sort_unstable();
        assert_eq!(all, (0..1800).collect::<Vec<_>>());
    }
}
