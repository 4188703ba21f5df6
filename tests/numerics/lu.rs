//! Factors of dense systems, whose solutions give the right-hand sides back.

use fluxform_numerics::lu::Factored;
use fluxform_numerics::random::Random;
use nalgebra::DMatrix;

/// Sizes within, on and beyond the end of a block of 48 columns; small leading entries ask for exchanged rows.
#[test]
fn the_solution_gives_the_right_hand_sides_back() {
    for size in [1, 7, 48, 49, 245] {
        let mut random = Random::new(17);
        let mut matrix = DMatrix::from_fn(size, size, |_, _| random.between(-0.5, 0.5));
        for k in 0..size {
            matrix[(k, k)] *= 1e-9;
        }
        let expected = DMatrix::from_fn(size, 3, |_, _| random.between(-0.3, 0.7));
        let mut found = &matrix * &expected;
        Factored::new(matrix).unwrap().solve(&mut found);
        let error = (&found - &expected).amax();
        assert!(error < 1e-9, "{size}: {error:e}");
    }
}

#[test]
fn a_singular_matrix_has_no_factors() {
    let mut matrix = DMatrix::from_fn(5, 5, |i, j| 0.7 + (3 * i + 2 * j) as f64 % 4.3);
    matrix.column_mut(3).fill(0.0);
    assert!(Factored::new(matrix).is_none());
}
