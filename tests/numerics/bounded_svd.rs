//! Singular values of hard matrices: the iterations end, and what is no number is refused.

use fluxform_numerics::bounded_svd::svd;
use nalgebra::DMatrix;

#[test]
fn hard_matrices_end_within_the_bound() {
    let hilbert = |n: usize| DMatrix::from_fn(n, n, |i, j| 1.0 / (i + j + 1) as f64);
    // Graded, repeated and zero values, and one far wider than high.
    let graded = DMatrix::from_fn(40, 23, |i, j| {
        ((i * j + 3) as f64 * 0.7).sin() * 0.3_f64.powi(j as i32)
    });
    let repeated = DMatrix::from_fn(31, 31, |i, j| if (i + j) % 31 == 0 { 1.3 } else { 0.0 });
    let zero = DMatrix::zeros(7, 5);
    let wide = DMatrix::from_fn(3, 50, |i, j| (i as f64 - 0.7 * j as f64).cos());
    for matrix in [hilbert(30), graded, repeated, zero, wide] {
        let svd = svd(matrix.clone(), [true, true]).expect("ends");
        let values = svd.singular_values.clone();
        assert!(values.as_slice().windows(2).all(|pair| pair[0] >= pair[1]));
        let off = (svd.recompose().unwrap() - &matrix).amax();
        // Steep gradings cost digits.
        assert!(off <= 1e-10 * values.max(), "{off:e}");
    }
}

#[test]
fn what_does_not_converge_is_none() {
    let broken = DMatrix::from_fn(6, 6, |i, j| if i == j { f64::NAN } else { 0.7 });
    assert!(svd(broken, [true, true]).is_none());
}
