//! Nodal bases on an axis: tolerances, matrices, symmetry and the number of nodes.

use fluxform_numerics::spectral::Spectral;

/// The least number n of nodes with 4 n^growth exp(-n rate) <= tolerance.
fn nodes_of(rate: f64, growth: f64, tolerance: f64) -> usize {
    let left = |n: f64| 4.0 * n.powf(growth) * (-n * rate).exp();
    (3..999_u16)
        .find(|n| left(f64::from(*n)) <= tolerance)
        .map(usize::from)
        .expect("a thousand are enough")
}

/// Largest error of interpolation relative to `size` at the place.
fn error(axis: &Spectral, f: &dyn Fn(f64) -> f64, size: &dyn Fn(f64) -> f64) -> f64 {
    let (from, to) = (axis.nodes[0], axis.nodes[axis.len() - 1]);
    (0..997)
        .map(|i| from + (to - from) * f64::from(i) / 996.0)
        .map(|x| {
            let weights = axis.cardinal(x);
            let value: f64 = weights
                .iter()
                .zip(&axis.nodes)
                .map(|(w, x)| w * f(*x))
                .sum();
            (value - f(x)).abs() / size(x)
        })
        .fold(0.0, f64::max)
}

#[test]
fn both_maps_reach_their_tolerance_without_many_nodes_to_spare() {
    for tolerance in [1e-4, 1e-6, 1e-9] {
        // Singular at 0.43 +- 0.3 i.
        let f = |x: f64| (1.0 / ((x - 0.43).powi(2) + 0.09)).powf(1.5) * 0.027;
        let nodes = Spectral::strip_nodes(-1.3, 0.7, 0.3, tolerance);
        let found = error(&Spectral::strip(-1.3, 0.7, nodes), &f, &|_| 1.0);
        assert!(found < tolerance, "{tolerance:e}: {found:e}");
        let plain = nodes_of(0.3_f64.asinh(), 1.0, tolerance);
        assert!(nodes.1 < plain, "fewer than plain Chebyshev points");
        // Singular at 0.2, falling by three decades.
        let f = |x: f64| (x - 0.2).powi(-3) + 0.3 * (x - 0.1).powi(-4);
        let nodes = Spectral::rising_nodes(0.7, 5.7, 0.2, tolerance);
        let found = error(&Spectral::rising(0.7, 5.7, 0.2, nodes), &f, &f);
        assert!(found < tolerance, "{tolerance:e}: {found:e}");
    }
}

#[test]
fn mass_and_stiffness_are_what_they_say() {
    let f = |x: f64| (1.3 * x).sin() + 0.2;
    let slope = |x: f64| 1.3 * (1.3 * x).cos();
    let integral = |g: &dyn Fn(f64) -> f64| -> f64 {
        let n = 20_000;
        let width = 1.7 / f64::from(n);
        (0..n)
            .map(|i| width * g(0.3 + width * (f64::from(i) + 0.5)))
            .sum()
    };
    let axes = [
        Spectral::strip(0.3, 2.0, Spectral::strip_nodes(0.3, 2.0, 1.0, 1e-9)),
        Spectral::rising(0.3, 2.0, -0.4, 24),
    ];
    for axis in &axes {
        let (n, u) = (axis.len(), axis.nodes.iter().map(|x| f(*x)));
        let u: Vec<f64> = u.collect();
        let mass: f64 = axis.mass().iter().zip(&u).map(|(m, u)| m * u * u).sum();
        assert!((mass / integral(&|x| f(x) * f(x)) - 1.0).abs() < 1e-7);
        let stiffness: f64 = (axis.stiffness().chunks_exact(n).zip(&u))
            .map(|(row, v)| v * row.iter().zip(&u).map(|(k, u)| k * u).sum::<f64>())
            .sum();
        assert!((stiffness / integral(&|x| slope(x).powi(2)) - 1.0).abs() < 1e-7);
    }
}

#[test]
fn intervals_without_length_and_symmetric_ones() {
    let point = Spectral::strip(0.7, 0.7, Spectral::strip_nodes(0.7, 0.7, 1.3, 1e-6));
    assert_eq!((point.len(), point.cardinal(0.7)), (1, vec![1.0]));
    assert_eq!(Spectral::rising_nodes(0.7, 0.7, 0.1, 1e-6), 1);
    let axis = Spectral::strip(-0.7, 0.7, Spectral::strip_nodes(-0.7, 0.7, 0.2, 1e-6));
    for (low, high) in axis.nodes.iter().zip(axis.nodes.iter().rev()) {
        assert_eq!(*low, -*high);
    }
}

#[test]
fn nodes_that_rise_follow_the_bernstein_ellipse() {
    // From 1 to 16 about 0 the geometric mean is 4: half-axes 5/3 and 4/3, hence a rate of 3.
    for tolerance in [1e-3, 1e-6, 1e-12] {
        assert_eq!(
            Spectral::rising_nodes(1.0, 16.0, 0.0, tolerance),
            nodes_of(3.0_f64.ln(), 3.5, tolerance)
        );
    }
}

#[test]
fn an_odd_rule_has_its_middle_node_at_zero() {
    // Newton's method leaves 1e-32 with some of them.
    for n in [3, 5, 7, 9, 13, 27, 31, 55] {
        // A strip hardly bent, about zero: its nodes are the rule's.
        let axis = Spectral::strip(-1.3, 1.3, (0.7, n));
        assert_eq!(axis.nodes[n / 2], 0.0);
    }
}
