//! Vectors of three numbers, in the order of operations that results depend on to the last bit.

/// a + b.
#[must_use]
#[inline]
pub fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a - b.
#[must_use]
#[inline]
pub fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a . b.
#[must_use]
#[inline]
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a x b.
#[must_use]
#[inline]
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// |a|; its square must neither overflow nor vanish.
#[must_use]
#[inline]
pub fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
