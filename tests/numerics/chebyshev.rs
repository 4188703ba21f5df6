//! Chebyshev tables: their error stays below the tolerance, whichever way they are evaluated.

use fluxform_numerics::chebyshev::{Evaluation, Layout, Scattered};
use fluxform_numerics::dispatch;

#[test]
fn the_error_stays_below_the_tolerance() {
    // Singular at 0.4 +- 0.3 i.
    let f = |x: f64| 1.0 / ((x - 0.4).powi(2) + 0.09);
    for tolerance in [1e-4, 1e-8, 1e-12] {
        let layout = Layout::new(-1.3, 2.7, 0.3, tolerance, 4000).expect("fits");
        let values: Vec<f64> = layout.nodes().into_iter().map(f).collect();
        let table = layout.table(&values);
        let points: Vec<f64> = (0..997)
            .map(|i| -1.3 + 4.0 * f64::from(i) / 996.0)
            .collect();
        let mut out = vec![0.0; points.len()];
        dispatch::run(Evaluation {
            table: &table,
            points: &points,
            out: &mut out,
        });
        let worst = points
            .iter()
            .zip(&out)
            .map(|(x, y)| (f(*x) - y).abs() * 0.09)
            .fold(0.0, f64::max);
        assert!(worst < tolerance, "{tolerance:e}: {worst:e}");
        let mut scattered = vec![0.0; 2 * points.len()];
        let backwards: Vec<f64> = points.iter().rev().copied().collect();
        dispatch::run(Scattered {
            tables: &[table.clone(), table.clone()],
            points: &backwards,
            out: &mut scattered,
        });
        for half in scattered.chunks_exact(points.len()) {
            let pairs = half.iter().rev().zip(&out);
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-13 / 0.09));
        }
        let single = points.iter().zip(&out);
        assert!(
            single
                .into_iter()
                .all(|(x, y)| (table.at(*x) - y).abs() < 1e-13 / 0.09)
        );
    }
}

#[test]
fn too_many_nodes_or_no_distance_is_none() {
    assert!(Layout::new(0.0, 1.0, 1e-6, 1e-9, 5000).is_none());
    assert!(Layout::new(0.0, 1.0, 0.0, 1e-9, 5000).is_none());
}
