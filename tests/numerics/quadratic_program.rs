//! Quadratic programmes, by their optimality conditions.

use fluxform_numerics::quadratic_program::minimise;
use fluxform_numerics::random::Random;
use nalgebra::{DMatrix, DVector};

/// The optimality conditions, on random programmes with more rows than variables.
#[test]
fn satisfies_the_optimality_conditions() {
    let mut random = Random::new(7);
    for size in [1, 3, 7, 13] {
        for _ in 0..20 {
            let half = DMatrix::from_fn(size, size, |_, _| random.normal());
            let b = &half * half.transpose() + 0.1 * DMatrix::identity(size, size);
            let g = DVector::from_fn(size, |_, _| random.normal());
            let rows = DMatrix::from_fn(2 * size + 1, size, |_, _| random.normal());
            let inside = DVector::from_fn(size, |_, _| random.normal());
            let limits =
                &rows * inside + DVector::from_fn(2 * size + 1, |_, _| random.between(0.0, 0.7));
            let minimum = minimise(&b, &g, &rows, &limits).expect("feasible");
            let multipliers = DVector::from_vec(minimum.multipliers);
            let residual = &b * &minimum.step + &g + rows.transpose() * &multipliers;
            let size = g.norm() + (rows.transpose() * &multipliers).norm();
            assert!(residual.norm() < 1e-9 * size, "{residual}");
            for (slack, lambda) in (limits - rows * minimum.step).iter().zip(&multipliers) {
                assert!(*slack > -1e-9 && *lambda >= 0.0, "{slack} {lambda}");
                assert!((slack * lambda).abs() < 1e-8, "{slack} {lambda}");
            }
        }
    }
}

#[test]
fn contradictions_are_reported() {
    let one = DMatrix::identity(2, 2);
    let rows = DMatrix::from_row_slice(2, 2, &[1.0, 1.3, -1.0, -1.3]);
    let limits = DVector::from_vec(vec![0.7, -0.9]);
    assert_eq!(minimise(&one, &DVector::zeros(2), &rows, &limits), None);
}
