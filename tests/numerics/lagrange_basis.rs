//! Lagrange polynomials on Gauss nodes, on polynomials of their degree.

use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;

#[test]
fn interpolates_differentiates_and_integrates_polynomials() {
    for order in [1, 2, 5, 9, 16] {
        let rule = gauss::rule(order);
        let basis = Basis::new(rule);
        let degree = order as i32 - 1;
        let f = |x: f64| (0.7 + 0.4 * x).powi(degree);
        let slope = |x: f64| f64::from(degree) * 0.4 * (0.7 + 0.4 * x).powi(degree - 1);
        let sum = |x: f64| (0.7 + 0.4 * x).powi(degree + 1) / (0.4 * f64::from(degree + 1));
        let samples: Vec<f64> = rule.nodes.iter().map(|x| f(*x)).collect();
        let dot = |row: &[f64]| row.iter().zip(&samples).map(|(a, b)| a * b).sum::<f64>();
        let mut weights = vec![0.0; order];
        for x in [-1.0, -0.37, 0.81, rule.nodes[0]] {
            basis.weights(x, &mut weights);
            assert!((dot(&weights) - f(x)).abs() < 1e-14);
        }
        for (row, x) in basis.derivative().iter().zip(&rule.nodes) {
            assert!((dot(row) - slope(*x)).abs() < 1e-12);
        }
        let ends = rule.nodes.iter().chain([&1.0]);
        for (row, x) in basis.integral().iter().zip(ends) {
            assert!((dot(row) - (sum(*x) - sum(-1.0))).abs() < 1e-14);
        }
    }
}
