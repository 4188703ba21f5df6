//! Where the currents no longer change: sums that bind, coils that tie, rounding that must not decide.

use fluxform_lambda::{Settings, solve};

use fluxform_testing::Random;
use fluxform_testing::force_problems::{Case, D, d, small_case};
use fluxform_testing::least_error::Search;

/// A ring of coils over points that turn with it, one coil in the middle, a sum that binds: all coils
/// of the ring tie, in fours or more as in a 3 x 3 array. `coupling` mixes the neighbours' forces in.
fn ring(seed: u64, coupling: f64) -> Case {
    let mut n = Random::new(seed);
    let around = 2 + n.below(3);
    let points = 2 * around;
    let near: Vec<f64> = (0..points).map(|_| n.between(0.1, 1.0)).collect();
    let middle = n.between(0.3, 1.0);
    let coils = around + 1;
    let mut forces = Vec::new();
    for j in 0..points {
        let plain: Vec<f64> = (0..around)
            .map(|i| near[(j + points - 2 * i) % points])
            .collect();
        let mixed = |i: usize| {
            plain[i] - coupling * (plain[(i + 1) % around] + plain[(i + around - 1) % around])
        };
        forces.extend((0..around).map(mixed));
        forces.push(middle * (1.0 + 0.3 * (j % 2) as f64));
    }
    let limit = n.between(0.5, 2.0);
    let total = limit * coils as f64 * n.between(0.1, 0.9);
    Case {
        forces,
        heights: (0..points).map(|j| 0.05 + 0.01 * (j % 2) as f64).collect(),
        offset: None,
        lower: vec![0.0; coils],
        upper: vec![limit; coils],
        total: Some(total),
        ohm: vec![6.0; coils],
    }
}

fn largest_change(a: &[f64], b: &[f64]) -> f64 {
    let pairs = a.iter().zip(b);
    pairs.fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

/// Nothing changes beyond it that shows in the error, by exhaustive search, and something does below.
fn check(case: &Case, what: &str) -> Option<f64> {
    let solution = case.solve();
    let last = solution
        .constants
        .lambda_saturation_n_per_m
        .filter(|&last| last > 0.0)?;
    let search = Search::new(case);
    let currents = solution.path.currents_a(last);
    let exact: Vec<D> = currents.iter().map(|&v| d(v)).collect();
    for factor in [1.001, 1.7, 30.0, 1e3, 1e5, 1e8, 1e11] {
        let lambda = last * factor;
        let scale = lambda * lambda * case.mean_square();
        if factor <= 30.0 {
            let still = case.error(d(lambda), &exact).nearest();
            let best = search.least_error(lambda, true);
            assert!(
                (still - best).abs() < 1e-13 * scale,
                "{what} at {lambda}: {case:?}"
            );
        }
        // Further out the search itself rounds: the certificate proves the currents.
        let settings = Settings {
            at_n_per_m: Some(lambda),
            ..Settings::default()
        };
        let proven = solve(&case.problem(), &settings).expect("well formed").at;
        let gap = proven.expect("requested").duality_gap_n2;
        assert!(gap <= 1e-8 * scale, "{what} at {lambda}: {gap}; {case:?}");
        let there = solution.path.currents_a(lambda);
        let size = currents.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        // Near copies may trade what no force shows.
        if solution.rank == case.coils() {
            let moved = largest_change(&there, &currents);
            assert!(
                moved <= 1e-7 * size,
                "{what} at {lambda}: moved by {moved}; {case:?}"
            );
        }
    }
    if solution.rank == case.coils() {
        let moved = largest_change(&solution.path.currents_a(0.9 * last), &currents);
        assert!(
            moved > 1e-9 * currents.iter().fold(0.0, |s, v| s + v.abs()),
            "{what}: {case:?}"
        );
    }
    let turns = solution.path.breakpoints();
    assert!(
        turns.iter().all(|turn| turn.lambda_n_per_m <= last),
        "{what}: {case:?}"
    );
    Some(last)
}

/// Rounding of the forces once decided which of the tied coils takes what the sum leaves, at a lambda
/// of one over that rounding.
#[test]
fn rounding_does_not_decide_where_currents_stop_changing() {
    let mut bound = 0;
    for seed in 0..400 {
        let case = ring(seed, [0.0, 0.2, -0.1][seed as usize % 3]);
        let what = format!("ring {seed}");
        let Some(last) = check(&case, &what) else {
            continue;
        };
        for size in [1e-15, 1e-12, 1e-10] {
            let mut rounded = case.clone();
            let mut n = Random::new(seed + 99);
            rounded
                .forces
                .iter_mut()
                .for_each(|g| *g *= 1.0 + size * n.normal());
            let found = check(&rounded, &what).expect("the sum binds");
            let off = (found / last - 1.0).abs();
            assert!(
                off < 1e-6,
                "{what}, rounded to {size:e}: {found} not {last}; {case:?}"
            );
        }
        bound += 1;
    }
    assert!(bound > 350, "{bound}");
}

/// Any problem whose sum binds, ties and copies among them.
#[test]
fn sums_that_bind_end_where_exhaustive_search_says() {
    let mut bound = 0;
    for seed in 0..1500 {
        let mut case = small_case(seed + 50_000);
        let mut n = Random::new(seed + 7);
        let all: f64 = case.upper.iter().sum();
        case.total = Some(all * n.between(0.05, 0.95));
        bound += usize::from(check(&case, &format!("small {seed}")).is_some());
    }
    assert!(bound > 900, "{bound}");
}

/// A difference that is no rounding decides, however far out.
#[test]
fn a_small_true_difference_still_counts() {
    for (difference, far) in [(1e-3, 1e2), (1e-5, 1e4), (1e-6, 1e5)] {
        let case = Case {
            forces: vec![1.0 + difference, 0.2, 0.2, 1.0],
            heights: vec![0.05; 2],
            offset: None,
            lower: vec![0.0; 2],
            upper: vec![2.0; 2],
            total: Some(1.3),
            ohm: vec![6.0; 2],
        };
        let last = case
            .solve()
            .constants
            .lambda_saturation_n_per_m
            .expect("the sum binds");
        assert!(last > far, "{difference}: {last}");
        assert!(case.solve().path.currents_a(2.0 * last)[1] < 1e-12);
    }
}
