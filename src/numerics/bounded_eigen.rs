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

#[cfg(test)]
mod tests {
    use super::*;

    /// Hilbert's, repeated values, two blocks that do not meet, zero, and what has values of both signs.
    fn hard() -> Vec<DMatrix<f64>> {
        let hilbert = DMatrix::from_fn(30, 30, |i, j| 1.0 / (i + j + 1) as f64);
        let repeated = DMatrix::from_fn(23, 23, |i, j| f64::from(u8::from(i == j)) * 1.3);
        let blocks = DMatrix::from_fn(14, 14, |i, j| {
            if i / 7 == j / 7 {
                0.7 + (i * j) as f64
            } else {
                0.0
            }
        });
        let waves = DMatrix::from_fn(40, 40, |i, j| ((i * i + j * j) as f64 * 0.7).sin());
        // Of rank one, and of every size.
        let thin = DMatrix::from_fn(40, 40, |i, j| 0.3_f64.powi((i + j) as i32));
        vec![hilbert, repeated, blocks, waves, thin, DMatrix::zeros(7, 7)]
    }

    #[test]
    fn hard_matrices_end_within_the_bound() {
        for matrix in hard() {
            let eigen = symmetric_eigen(matrix.clone()).expect("ends");
            let off = (eigen.recompose() - &matrix).amax();
            assert!(off <= 1e-13 * matrix.amax().max(1.0), "{off:e}");
        }
    }

    #[test]
    fn the_largest_alone_is_the_largest_of_all() {
        let all = hard().into_iter();
        for matrix in all.chain([DMatrix::from_element(1, 1, -0.7), -hard().remove(0)]) {
            let most = symmetric_eigen(matrix.clone()).unwrap().eigenvalues.max();
            let alone = largest_eigenvalue(matrix.clone()).unwrap();
            let off = (alone - most).abs();
            assert!(
                off <= 1e-14 * matrix.amax() * matrix.nrows() as f64,
                "{off:e}"
            );
        }
    }

    #[test]
    fn numbers_that_are_none_are_refused() {
        for bad in [f64::NAN, f64::INFINITY] {
            let matrix = DMatrix::from_fn(6, 6, |i, j| if i == j { bad } else { 0.7 });
            assert!(symmetric_eigen(matrix.clone()).is_none());
            assert_eq!(largest_eigenvalue(matrix), None);
        }
        assert_eq!(largest_eigenvalue(DMatrix::zeros(0, 0)), None);
    }
}
