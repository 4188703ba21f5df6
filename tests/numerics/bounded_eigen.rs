//! Eigenvalues of hard symmetric matrices: the iterations end, and what is no number is refused.

use fluxform_numerics::bounded_eigen::{largest_eigenvalue, symmetric_eigen};
use nalgebra::DMatrix;

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
