//! Gauss-Legendre rules: exact to their degree, of an order that bounds a pole's error.

use fluxform_numerics::gauss::{bernstein_radius, order_for, rule};
use std::f64::consts::PI;

#[test]
fn integrates_polynomials_up_to_its_degree_exactly() {
    for order in [1, 2, 5, 16, 33, 64] {
        let rule = rule(order);
        for degree in
            [0, order / 2, order, 2 * order - 2, 2 * order - 1].map(|d| d.min(2 * order - 1))
        {
            let sum: f64 = rule
                .nodes
                .iter()
                .zip(&rule.weights)
                .map(|(x, w)| w * x.powi(degree as i32))
                .sum();
            let exact = if degree % 2 == 0 {
                2.0 / (degree as f64 + 1.0)
            } else {
                0.0
            };
            assert!(
                (sum - exact).abs() < 4e-15,
                "order {order} degree {degree}: {sum}"
            );
        }
    }
}

#[test]
fn the_order_rule_bounds_a_pole() {
    // 1 / (x - z0) with z0 = 0.3 + 0.7 i: the real part's integral in closed form.
    let (re, im) = (0.3_f64, 0.7_f64);
    let exact = 0.5 * (((1.0 - re).powi(2) + im * im) / ((1.0 + re).powi(2) + im * im)).ln();
    let radius = bernstein_radius(-1.0, 1.0, re, im);
    for tolerance in [1e-3, 1e-6, 1e-9, 1e-12] {
        let order = order_for(radius, 4.0 * PI, tolerance).expect("moderate radius");
        let rule = rule(order);
        let sum: f64 = rule
            .nodes
            .iter()
            .zip(&rule.weights)
            .map(|(x, w)| w * (x - re) / ((x - re).powi(2) + im * im))
            .sum();
        assert!((sum - exact).abs() <= tolerance, "{order}: {sum} {exact}");
        // and does not waste: two nodes fewer would miss a tolerance a hundred times smaller
        assert!(order < 4 + ((1.0 / tolerance).ln() / (2.0 * radius.ln())) as usize);
    }
}

#[test]
fn bernstein_radius_of_known_points() {
    assert!((bernstein_radius(-1.0, 1.0, 0.0, 0.75) - 2.0).abs() < 1e-15);
    assert!((bernstein_radius(1.0, 3.0, 3.25, 0.0) - 2.0).abs() < 1e-15);
    assert_eq!(order_for(1.0, 1.0, 1e-3), None);
}
