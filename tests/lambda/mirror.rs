//! Magnets turned over and currents reversed: every result is the mirror image.

use fluxform_lambda::feedback::{Span, reachable};
use fluxform_lambda::worst::{felt, maxmin, worst_point};
use fluxform_lambda::{Settings, Status};

use fluxform_testing::Random;
use fluxform_testing::force_problems::{Case, small_case};

/// Drivers that push, reverse, and pull, without a limit on the sum.
fn mixed(seed: u64) -> Case {
    let mut case = small_case(seed + 90_000);
    let mut n = Random::new(seed + 3);
    case.total = None;
    for i in 0..case.coils() {
        let size = case.upper[i].max(0.3);
        let other = size * n.between(0.2, 1.5);
        (case.lower[i], case.upper[i]) =
            [(0.0, size), (-other, size), (-size, size), (-size, 0.0)][n.below(4)];
    }
    case
}

fn mirrored(case: &Case) -> Case {
    let negative = |values: &[f64]| values.iter().map(|v| 0.0 - v).collect::<Vec<f64>>();
    Case {
        forces: negative(&case.forces),
        lower: negative(&case.upper),
        upper: negative(&case.lower),
        ..case.clone()
    }
}

fn close(a: Option<f64>, b: Option<f64>, seed: u64, what: &str, case: &Case) {
    let same = match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() <= 1e-12 * a.abs().max(b.abs()),
        (a, b) => a.is_none() && b.is_none(),
    };
    assert!(same, "{seed}, {what}: {a:?} {b:?}; {case:?}");
}

/// With drivers that reverse, a magnet that is attracted once had no force constant at all.
#[test]
fn turned_magnets_and_reversed_drivers_mirror_every_constant() {
    let mut found = 0;
    for seed in 0..2000 {
        let case = mixed(seed);
        let other = mirrored(&case);
        let (a, b) = (case.solve(), other.solve());
        assert_eq!((a.status, a.rank), (b.status, b.rank), "{seed}: {case:?}");
        found +=
            usize::from(a.constants.lambda_linear_n_per_m.is_some() && a.status == Status::Solved);
        let compare = |a, b, what| close(a, b, seed, what, &case);
        compare(
            a.constants.lambda_linear_n_per_m,
            b.constants.lambda_linear_n_per_m,
            "linear",
        );
        compare(
            a.constants.lambda_jnd_n_per_m,
            b.constants.lambda_jnd_n_per_m,
            "jnd",
        );
        compare(
            a.constants.lambda_saturation_n_per_m,
            b.constants.lambda_saturation_n_per_m,
            "saturation",
        );
        compare(
            a.constants.lambda_maxmin_n_per_m,
            b.constants.lambda_maxmin_n_per_m,
            "maxmin",
        );
        let largest = |case: &Case| maxmin(&case.problem()).unwrap().map(|m| m.lambda_n_per_m);
        compare(largest(&case), largest(&other), "maxmin alone");
        if let (Some(x), Some(y), true) = (&a.chosen, &b.chosen, a.rank == case.coils()) {
            let size = case
                .upper
                .iter()
                .chain(&case.lower)
                .fold(0.0_f64, |m, v| m.max(v.abs()));
            for (x, y) in x.currents_a.iter().zip(&y.currents_a) {
                assert!((x + y).abs() <= 1e-9 * size, "{seed}: {x} {y}; {case:?}");
            }
        }
        let settings = Settings::default();
        let worst = |case: &Case| worst_point(&case.problem(), &settings).unwrap();
        let (x, y) = (worst(&case), worst(&other));
        assert!(x.complete && y.complete, "{seed}: {case:?}");
        compare(
            x.lambda_linear_n_per_m,
            y.lambda_linear_n_per_m,
            "worst-point linear",
        );
        compare(
            x.lambda_jnd_n_per_m,
            y.lambda_jnd_n_per_m,
            "worst-point jnd",
        );
        let unfelt = |case: &Case| felt(&case.problem(), 0.07, 0.8e-3).unwrap();
        compare(
            unfelt(&case).map(|f| f.lambda_n_per_m),
            unfelt(&other).map(|f| f.lambda_n_per_m),
            "not felt",
        );
        let alone = |case: &Case| {
            let mut span = Span::default();
            span.add(&case.heights, &reachable(&case.problem()).unwrap());
            span.largest().ok().map(|at| at.lambda_n_per_m)
        };
        compare(alone(&case), alone(&other), "with feedback");
    }
    assert!(found > 1000, "{found}");
}
