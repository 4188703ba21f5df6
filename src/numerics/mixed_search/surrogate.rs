//! Several smooth functions of a few variables from their values at scattered points: cubic radial
//! functions with a linear tail.
//!
//! s(u) = sum_k w_k |u - u_k|^3 + c_0 + c'u, sum w_k = 0, sum w_k u_k = 0: of all functions through the
//! values the one that bends least. A little smoothing keeps points that are very close from turning
//! the noise of their values into slopes.

use nalgebra::{DMatrix, DVector};

/// Smoothing: the share of a unit distance cubed that is added to the diagonal.
const SMOOTHING: f64 = 1e-7;

/// The fitted functions.
#[derive(Debug, Clone)]
pub struct Surrogate {
    centers: Vec<Vec<f64>>,
    /// One column a function: weights, then the constant and the slopes.
    weights: DMatrix<f64>,
}

impl Surrogate {
    /// The functions with `values[k]` at `centers[k]`; `None` of fewer points than decide a plane, or
    /// where they all lie in one.
    #[must_use]
    pub fn new(centers: Vec<Vec<f64>>, values: &[Vec<f64>]) -> Option<Self> {
        let (count, size) = (centers.len(), centers.first()?.len());
        if count <= size {
            return None;
        }
        let tail = size + 1;
        let matrix = DMatrix::from_fn(count + tail, count + tail, |i, j| match (i, j) {
            _ if i < count && j < count && i != j => cubed(&centers[i], &centers[j]),
            _ if i < count && j < count => SMOOTHING,
            _ if i < count => plane(&centers[i], j - count),
            _ if j < count => plane(&centers[j], i - count),
            _ => 0.0,
        });
        let outputs = values.first()?.len();
        let right = DMatrix::from_fn(count + tail, outputs, |i, j| {
            if i < count { values[i][j] } else { 0.0 }
        });
        let weights = matrix.lu().solve(&right)?;
        weights
            .iter()
            .all(|w| w.is_finite())
            .then_some(Self { centers, weights })
    }

    /// The functions' values at `u`.
    #[must_use]
    pub fn at(&self, u: &[f64]) -> Vec<f64> {
        let count = self.centers.len();
        let mut basis = DVector::zeros(self.weights.nrows());
        for (value, center) in basis.iter_mut().zip(&self.centers) {
            *value = cubed(u, center);
        }
        for j in 0..=u.len() {
            basis[count + j] = plane(u, j);
        }
        self.weights.tr_mul(&basis).as_slice().to_vec()
    }
}

fn plane(u: &[f64], column: usize) -> f64 {
    if column == 0 { 1.0 } else { u[column - 1] }
}

fn cubed(a: &[f64], b: &[f64]) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    square * square.sqrt()
}
