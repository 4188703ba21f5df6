//! Products of vectors, by the identities between them.

use fluxform_numerics::vec3::{cross, dot, minus, norm, plus};

/// Lagrange's identity, and that the product is perpendicular to both.
#[test]
fn products_fit_each_other() {
    let (a, b) = ([0.7, -1.3, 2.9], [-1.7, 0.3, 0.11]);
    let c = cross(a, b);
    let lagrange = dot(a, a) * dot(b, b) - dot(a, b).powi(2);
    assert!((dot(c, c) - lagrange).abs() < 1e-14 * lagrange);
    assert!(dot(c, a).abs() < 1e-14 && dot(c, b).abs() < 1e-14);
    assert!((norm(minus(plus(a, b), b)) - norm(a)).abs() < 1e-15);
}
