//! Anderson's acceleration: affine maps end after as many steps as dimensions, others gain.

use fluxform_numerics::anderson::Anderson;
use nalgebra::{DMatrix, DVector};

#[test]
fn an_affine_map_takes_as_many_steps_as_dimensions() {
    // Contracts nowhere: the plain iteration diverges.
    let matrix = DMatrix::from_row_slice(3, 3, &[1.7, 0.3, 0.0, -0.2, -1.9, 0.4, 0.1, 0.6, 2.3]);
    let shift = DVector::from_vec(vec![0.7, -1.3, 0.4]);
    let mut anderson = Anderson::new(5);
    let mut x = DVector::zeros(3);
    for _ in 0..5 {
        x = anderson.next(&x, &matrix * &x + &shift);
    }
    assert!((&matrix * &x + &shift - &x).norm() < 1e-9);
}

#[test]
fn a_nonlinear_map_gains_over_the_plain_iteration() {
    let map = |x: &DVector<f64>| DVector::from_vec(vec![(x[1] + 0.3).cos(), 0.9 * x[0].sin()]);
    let error = |depth: usize| {
        let mut anderson = Anderson::new(depth);
        let mut x = DVector::from_vec(vec![0.2, 0.1]);
        for _ in 0..9 {
            x = anderson.next(&x, map(&x));
        }
        (map(&x) - x).norm()
    };
    assert!(error(3) < 1e-6 * error(0), "{} {}", error(3), error(0));
    // At the fixed point nothing is left to combine.
    let mut anderson = Anderson::new(3);
    let x = DVector::zeros(2);
    for _ in 0..4 {
        assert_eq!(anderson.next(&x, x.clone()), x);
    }
}
