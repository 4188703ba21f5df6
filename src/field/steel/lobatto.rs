//! Polynomials on one element: Lagrange bases, and the Gauss-Lobatto nodes of continuous ones.

use nalgebra::DMatrix;

/// Largest degree of an element that [`nodes`] is used with.
pub const MAX_DEGREE: usize = 24;

/// Gauss-Lobatto nodes of degree `degree` on [-1, 1], ascending: the ends and the zeros of
/// P'_degree; `degree + 1` of them. Error: a few units of the last digit.
///
/// Domain: 1 <= degree <= [`MAX_DEGREE`].
#[must_use]
pub fn nodes(degree: usize) -> Vec<f64> {
    let n = degree as f64;
    (0..=degree)
        .map(|k| {
            if k == 0 || k == degree {
                return if k == 0 { -1.0 } else { 1.0 };
            }
            // From the Chebyshev points Newton's method on x P_n - P_(n-1), which is
            // (x^2 - 1) P'_n / n and whose derivative is (n + 1) P_n.
            let mut x = -(std::f64::consts::PI * k as f64 / n).cos();
            for _ in 0..20 {
                let (before, value) = legendre(degree, x);
                let step = (x * value - before) / ((n + 1.0) * value);
                x -= step;
                if step.abs() <= f64::EPSILON {
                    break;
                }
            }
            x
        })
        .collect()
}

/// P_(n-1)(x) and P_n(x), n >= 1.
fn legendre(degree: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    for k in 2..=degree {
        let k = k as f64;
        (before, value) = (
            value,
            ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k,
        );
    }
    (before, value)
}

/// Values at the points `x` of the Lagrange polynomials on `nodes`: row by point, column by node.
///
/// Error: rounding times the nodes' Lebesgue constant. Rows sum to 1 up to rounding.
#[must_use]
pub fn values(nodes: &[f64], x: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(x.len(), nodes.len(), |row, j| product(nodes, x[row], &[j]))
}

/// Derivatives at the points `x` of the Lagrange polynomials on `nodes`, as [`values`].
#[must_use]
pub fn slopes(nodes: &[f64], x: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(x.len(), nodes.len(), |row, j| {
        (0..nodes.len())
            .filter(|&k| k != j)
            .map(|k| product(nodes, x[row], &[j, k]) / (nodes[j] - nodes[k]))
            .sum()
    })
}

/// Product of (x - x_m) / (x_j - x_m) over the nodes m that are not in `without`; j is its first.
fn product(nodes: &[f64], x: f64, without: &[usize]) -> f64 {
    let own = nodes[without[0]];
    (0..nodes.len())
        .filter(|m| !without.contains(m))
        .map(|m| (x - nodes[m]) / (own - nodes[m]))
        .product()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_numerics::gauss;

    #[test]
    fn nodes_of_known_degrees() {
        assert_eq!(nodes(1), [-1.0, 1.0]);
        let four = nodes(4);
        assert!((four[1] + (3.0_f64 / 7.0).sqrt()).abs() < 1e-15 && four[2].abs() < 1e-15);
        for degree in 2..=MAX_DEGREE {
            let nodes = nodes(degree);
            assert!(nodes.windows(2).all(|pair| pair[0] < pair[1]), "{degree}");
            // At a zero of P'_n the recurrence x P_n = P_(n-1) holds.
            for &x in &nodes[1..degree] {
                let (before, value) = legendre(degree, x);
                assert!((x * value - before).abs() < 1e-14, "{degree} {x}");
            }
        }
    }

    #[test]
    fn polynomials_and_their_slopes_come_back() {
        let f = |x: f64| 0.7 + x * (1.3 - x * (0.4 + 2.1 * x * x * x));
        let df = |x: f64| 1.3 - 0.8 * x - 10.5 * x.powi(4);
        for nodes in [nodes(5), gauss::rule(6).nodes.clone()] {
            let at = nalgebra::DVector::from_iterator(6, nodes.iter().map(|&x| f(x)));
            let x = [-1.0, -0.37, 0.11, 0.8, 1.0];
            let (value, slope) = (values(&nodes, &x) * &at, slopes(&nodes, &x) * &at);
            for (k, &x) in x.iter().enumerate() {
                assert!((value[k] - f(x)).abs() < 1e-13);
                assert!((slope[k] - df(x)).abs() < 1e-12);
            }
        }
    }
}
