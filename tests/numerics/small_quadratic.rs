//! Quadratic programmes in three variables, by their optimality conditions.

use fluxform_numerics::small_quadratic::{Row, minimise};
use fluxform_numerics::vec3::dot;

fn row(normal: [f64; 3], limit: f64) -> Row {
    Row {
        normal,
        limit,
        equality: false,
    }
}

#[test]
fn satisfies_the_optimality_conditions() {
    let b = [[2.0, 0.3, -0.1], [0.3, 1.3, 0.2], [-0.1, 0.2, 0.7]];
    let g = [-1.7, -2.3, -0.9];
    let rows = [
        row([1.0, 0.7, 0.2], 0.4),
        row([-0.3, 1.3, 0.0], 0.6),
        row([0.0, 0.1, 1.1], 0.9),
        row([1.0, 0.7, 0.2], 0.8),
    ];
    let minimum = minimise(b, g, &rows).expect("feasible");
    for i in 0..3 {
        let mut residual = dot(b[i], minimum.step) + g[i];
        for (row, lambda) in rows.iter().zip(&minimum.multipliers) {
            residual += lambda * row.normal[i];
        }
        assert!(residual.abs() < 1e-13);
    }
    for (row, &lambda) in rows.iter().zip(&minimum.multipliers) {
        let slack = row.limit - dot(row.normal, minimum.step);
        assert!(slack > -1e-13 && lambda >= 0.0 && (lambda * slack).abs() < 1e-13);
    }
}

#[test]
fn equalities_hold_and_contradictions_are_reported() {
    let one = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut rows = vec![Row {
        equality: true,
        ..row([1.0, 1.3, 0.0], 0.7)
    }];
    let minimum = minimise(one, [0.0; 3], &rows).expect("feasible");
    assert!((dot(rows[0].normal, minimum.step) - 0.7).abs() < 1e-15);
    rows.push(row([-1.0, -1.3, 0.0], -0.9));
    assert_eq!(minimise(one, [0.0; 3], &rows), None);
}
/// Regression: the corner of two rows 1e-6 apart was off by 2e-5, the square of that angle
/// having been lost.
#[test]
fn nearly_parallel_rows_keep_their_corner() {
    let one = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for angle in [1e-3, 1e-5, 1e-6] {
        let rows = [
            row([1.0, 0.0, 0.0], 1.3),
            row([-1.0 + angle, angle, 0.0], 1.3 * (-1.0 + angle)),
        ];
        let minimum = minimise(one, [-2.0, -1.0, -0.4], &rows).expect("feasible");
        for (found, requested) in minimum.step.iter().zip([1.3, 0.0, 0.4]) {
            assert!(
                (found - requested).abs() < 1e-15 / angle,
                "{angle:e}: {found:e}"
            );
        }
    }
}
