//! Eigenvalues of symmetric matrices with a bound on the iterations.
//!
//! The implicit QL iteration takes two or three steps an eigenvalue; numbers that are none, or overflow, may
//! keep it from ever ending. The largest eigenvalue alone needs no iteration of that kind: of the tridiagonal
//! matrix with the same eigenvalues the signs of its leading minors count those below a number, and bisection
//! ends after as many steps as a number has bits.

use nalgebra::{DMatrix, Dyn, SymmetricEigen, linalg::SymmetricTridiagonal};

/// Steps an eigenvalue after which the iteration is given up.
const MOST_STEPS: usize = 30;
/// Halvings of the range of eigenvalues.
const HALVINGS: usize = 64;

/// Eigenvalues and eigenvectors of a symmetric `matrix`, of which the lower triangle is read; `None` where a
/// number is none, or the iteration does not end within 30 steps a value.
#[must_use]
pub fn symmetric_eigen(matrix: DMatrix<f64>) -> Option<SymmetricEigen<f64, Dyn>> {
    if matrix.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let most = MOST_STEPS * matrix.nrows().max(1);
    SymmetricEigen::try_new(matrix, f64::EPSILON, most)
}

/// The largest eigenvalue of a symmetric `matrix`, of which the lower triangle is read; `None` of an empty
/// one, or where a number is none.
#[must_use]
pub fn largest_eigenvalue(matrix: DMatrix<f64>) -> Option<f64> {
    let size = matrix.amax();
    if matrix.is_empty() || matrix.iter().any(|v| !v.is_finite()) {
        return None;
    }
    if size == 0.0 || matrix.len() == 1 {
        return Some(matrix[(0, 0)]);
    }
    let (diagonal, beside) = SymmetricTridiagonal::new(matrix / size).unpack_tridiagonal();
    let reach = |i: usize| beside.get(i).map_or(0.0, |b| b.abs());
    let radius = |i: usize| reach(i) + if i > 0 { reach(i - 1) } else { 0.0 };
    // Gershgorin's discs hold all eigenvalues.
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    for (i, value) in diagonal.iter().enumerate() {
        low = low.max(*value);
        high = high.max(value + radius(i));
    }
    // All pivots of the matrix less `shift` are below zero.
    let above_all = |shift: f64| {
        let mut pivot = 1.0;
        diagonal.iter().enumerate().all(|(i, value)| {
            let before = if i > 0 { beside[i - 1] } else { 0.0 };
            pivot = value - shift - before * before / pivot;
            pivot < 0.0
        })
    };
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if above_all(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high * size)
}
