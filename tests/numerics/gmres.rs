//! GMRES on a contraction that stalls, and on columns of zeros.

use fluxform_numerics::gmres::gmres;
use nalgebra::DMatrix;

#[test]
fn solves_several_columns_of_a_contraction_that_stalls() {
    // Eigenvalues 1 + 0.82 cos: plain iteration gains 0.82 a step.
    let n = 40;
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        let ring = if (i + 1) % n == j || (j + 1) % n == i {
            0.41
        } else {
            0.0
        };
        let skew = if i > j { 0.003 } else { -0.002 };
        f64::from(u8::from(i == j)) + ring + skew
    });
    let rhs = DMatrix::from_fn(n, 3, |i, j| ((i * i + 3 * j) as f64 * 0.37).sin());
    let outcome = gmres(&rhs, 1e-12, 60, |x| &matrix * x);
    assert!(
        outcome.relative_residual <= 1e-12,
        "{}",
        outcome.relative_residual
    );
    let fault = &matrix * &outcome.solutions - &rhs;
    assert!(fault.norm() < 1e-11 * rhs.norm(), "{}", fault.norm());
}

#[test]
fn a_zero_column_has_a_zero_solution() {
    let mut rhs = DMatrix::from_element(5, 2, 0.7);
    rhs.column_mut(1).fill(0.0);
    let outcome = gmres(&rhs, 1e-14, 10, |x| x * 1.3);
    assert!((outcome.solutions[(2, 0)] - 0.7 / 1.3).abs() < 1e-15);
    assert_eq!(outcome.solutions.column(1).norm(), 0.0);
    assert_eq!(outcome.iterations, 1);
}
