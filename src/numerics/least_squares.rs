//! Linear least squares of few columns, by singular values, with degenerate directions reported.
//!
//! Minimises |b - A x|. Columns are divided by their lengths first, so that units do not decide what
//! counts as small; directions whose singular value is below [`CUTOFF`] of the largest are not
//! solved for: the least step is taken and the columns in them are named. Standard errors are those
//! of independent errors of equal size in b (Golub and Van Loan, *Matrix Computations*, 5.5).

use nalgebra::{DMatrix, DVector};

use super::bounded_svd::svd;

/// Singular values below this part of the largest are taken as zero; columns shorter than this part
/// of the longest as without effect.
pub const CUTOFF: f64 = 1e-5;
/// A column whose share in the directions left out exceeds this is not determined.
const SHARE: f64 = 1e-4;

/// The solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// One a column; the least ones where they are not determined.
    pub values: Vec<f64>,
    /// Standard errors for errors of size one in `b`; `None` where a column is not determined.
    pub unit_errors: Vec<Option<f64>>,
    /// Columns that change nothing.
    pub without_effect: Vec<usize>,
    /// Sets of columns of which only some combinations are determined.
    pub degenerate: Vec<Vec<usize>>,
    /// Number of directions solved for.
    pub rank: usize,
    /// Sum of the squares of b that the columns take away.
    pub removed: f64,
}

/// Least squares of `columns` against `b`. Columns should be given in steps of comparable meaning,
/// since their lengths are compared for what has no effect.
#[must_use]
pub fn solve(columns: &[Vec<f64>], b: &[f64]) -> Solution {
    let count = columns.len();
    let lengths: Vec<f64> = columns.iter().map(|c| norm(c)).collect();
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    let effective = |length: f64| length > CUTOFF * longest && length > 0.0;
    let used: Vec<usize> = (0..count).filter(|j| effective(lengths[*j])).collect();
    let mut solution = Solution {
        values: vec![0.0; count],
        unit_errors: vec![None; count],
        without_effect: (0..count).filter(|j| !effective(lengths[*j])).collect(),
        degenerate: Vec::new(),
        rank: 0,
        removed: 0.0,
    };
    if used.is_empty() || b.is_empty() {
        return solution;
    }
    let matrix = DMatrix::from_fn(b.len(), used.len(), |i, k| {
        columns[used[k]][i] / lengths[used[k]]
    });
    let rhs = DVector::from_column_slice(b);
    let Some((singular_values, u, v_t)) = with_vectors(matrix) else {
        // Nothing is known of any combination.
        solution.degenerate.push(used);
        return solution;
    };
    let largest = singular_values.iter().copied().fold(0.0, f64::max);
    let lost = singular_values
        .iter()
        .filter(|singular| **singular <= CUTOFF * largest)
        .count();
    let mut null_share = vec![0.0; used.len()];
    let mut variance = vec![0.0; used.len()];
    for (k, &singular) in singular_values.iter().enumerate() {
        let direction = v_t.row(k);
        if singular > CUTOFF * largest {
            let along = u.column(k).dot(&rhs);
            solution.rank += 1;
            solution.removed += along * along;
            for (j, part) in direction.iter().enumerate() {
                solution.values[used[j]] += part * along / (singular * lengths[used[j]]);
                variance[j] += (part / singular).powi(2);
            }
        } else {
            for (share, part) in null_share.iter_mut().zip(direction.iter()) {
                *share += part * part;
            }
            let named = (0..used.len()).filter(|j| direction[*j].powi(2) > SHARE / lost as f64);
            solution.degenerate.push(named.map(|j| used[j]).collect());
        }
    }
    // More columns than rows: the directions that no singular value stands for.
    if used.len() > b.len() {
        for (j, share) in null_share.iter_mut().enumerate() {
            let kept: f64 = (0..v_t.nrows()).map(|k| v_t[(k, j)].powi(2)).sum();
            *share += 1.0 - kept;
        }
        solution.degenerate.push(used.clone());
    }
    for (j, &column) in used.iter().enumerate() {
        if null_share[j] <= SHARE {
            solution.unit_errors[column] = Some(variance[j].sqrt() / lengths[column]);
        }
    }
    solution
}

/// The singular values and vectors; `None` where their iteration is given up.
fn with_vectors(matrix: DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>, DMatrix<f64>)> {
    let svd = svd(matrix, [true, true])?;
    Some((svd.singular_values, svd.u?, svd.v_t?))
}

/// Euclidean length.
#[must_use]
pub fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}
