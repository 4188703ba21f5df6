//! The surrogate: exact on planes, closer with more points.

use fluxform_numerics::mixed_search::surrogate::Surrogate;
use fluxform_numerics::random::Random;

fn points(count: usize, size: usize) -> Vec<Vec<f64>> {
    let mut random = Random::new(13);
    let mut point = || (0..size).map(|_| random.unit()).collect();
    (0..count).map(|_| point()).collect()
}

#[test]
fn planes_are_exact_and_values_are_met() {
    let centers = points(23, 3);
    let of = |u: &[f64]| {
        vec![
            0.7 - 1.3 * u[0] + 0.2 * u[2],
            (1.7 * u[0]).sin() * (0.3 + u[1] * u[2]),
        ]
    };
    let values: Vec<_> = centers.iter().map(|u| of(u)).collect();
    let surrogate = Surrogate::new(centers.clone(), &values).expect("enough points");
    for u in points(7, 3) {
        assert!((surrogate.at(&u)[0] - of(&u)[0]).abs() < 1e-8);
    }
    for (u, value) in centers.iter().zip(&values) {
        assert!((surrogate.at(u)[1] - value[1]).abs() < 1e-4);
    }
    assert!(Surrogate::new(points(3, 3), &values[..3]).is_none());
}

/// The error falls with the number of points.
#[test]
fn more_points_come_closer() {
    let of = |u: &[f64]| (1.3 * u[0] - 0.7 * u[1] * u[0]).exp();
    let error = |count: usize| {
        let centers = points(count, 2);
        let values: Vec<_> = centers.iter().map(|u| vec![of(u)]).collect();
        let surrogate = Surrogate::new(centers, &values).expect("enough points");
        let off = |u: &Vec<f64>| (surrogate.at(u)[0] - of(u)).abs();
        points(400, 2)[300..].iter().map(off).fold(0.0, f64::max)
    };
    assert!(
        error(160) < 0.15 * error(20),
        "{} {}",
        error(160),
        error(20)
    );
}
