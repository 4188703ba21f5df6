//! Thousands of small problems against exhaustive search.

use fluxform_lambda::{Solution, Status};
use fluxform_numerics::real::Real;

use fluxform_testing::Random;
use fluxform_testing::force_problems::{Case, D, d, small_case, telling_lambdas};
use fluxform_testing::least_error::Search;

fn check_small(seed: u64) {
    let case = small_case(seed);
    let search = Search::new(&case);
    let solution = case.solve();
    assert_ne!(solution.status, Status::Stalled, "{seed}: {case:?}");
    let mean_square = case.mean_square();
    for lambda in telling_lambdas(&solution) {
        let scale = lambda * lambda * mean_square + 1e-40;
        let exact = search.least_error(lambda, true);
        let found = solution.path.error_n2(lambda);
        assert!(
            (found - exact).abs() <= 1e-13 * scale,
            "{seed} at {lambda}: {found:e} not {exact:e}; {case:?}"
        );
        let currents: Vec<D> = solution
            .path
            .currents_a(lambda)
            .iter()
            .map(|&v| d(v))
            .collect();
        let direct = case.error(d(lambda), &currents).nearest();
        // Rounding the currents themselves moves the forces, at worst along the error.
        let size: f64 = (0..currents.len())
            .map(|i| search.gram[i][i].nearest().sqrt() * Real::abs(currents[i]).nearest())
            .sum();
        let rounding = 4.0 * f64::EPSILON * (exact / case.heights.len() as f64).sqrt() * size;
        assert!(
            (direct - exact).abs() <= 1e-13 * scale + rounding,
            "{seed} at {lambda}: currents give {direct:e} not {exact:e}; {case:?}"
        );
        assert!(
            search.keeps_within_doubles(&currents),
            "{seed} at {lambda}: {currents:?}"
        );
    }
    let breakpoints = solution.path.breakpoints();
    let reported = breakpoints.iter().skip(1).all(|b| !b.events.is_empty());
    assert!(
        reported || solution.rank < case.coils(),
        "{seed}: {breakpoints:?}"
    );
    check_criteria(seed, &case, &search, &solution);
}

fn check_criteria(seed: u64, case: &Case, search: &Search, solution: &Solution) {
    let turns = telling_lambdas(solution);
    let far = turns[turns.len() - 1] * 1e3;
    if case.mean_square() == 0.0 {
        assert!(
            solution.constants.lambda_jnd_n_per_m.is_none()
                && solution.constants.lambda_linear_n_per_m.is_none()
        );
        return;
    }
    match solution.constants.lambda_linear_n_per_m {
        None => assert!(
            search.excess(far) < 1e-13,
            "{seed}: a limit binds; {case:?}"
        ),
        Some(linear) => {
            if linear > 0.0 {
                let before = search.excess(linear * (1.0 - 1e-9));
                assert!(
                    before < 1e-15,
                    "{seed}: {before:e} below lambda_linear {linear}; {case:?}"
                );
            }
            let near = if linear == 0.0 {
                turns[0] * 1e-3
            } else {
                linear * 1.01
            };
            let after = search.excess(near);
            assert!(
                after > 1e-14,
                "{seed}: {after:e} above lambda_linear {linear}; {case:?}"
            );
        }
    }
    match solution.constants.lambda_jnd_n_per_m {
        None => assert!(search.excess(far) <= 0.0049 + 1e-12, "{seed}: {case:?}"),
        Some(jnd) => {
            if jnd > 0.0 {
                let there = search.excess(jnd);
                assert!(
                    (there - 0.0049).abs() < 1e-12,
                    "{seed}: {there} at lambda_jnd {jnd}; {case:?}"
                );
            }
            for factor in [1.001, 1.1, 3.0, 1e3] {
                let beyond = search.excess(jnd * factor + if jnd == 0.0 { far } else { 0.0 });
                assert!(
                    beyond > 0.0049,
                    "{seed}: {beyond} beyond lambda_jnd {jnd}; {case:?}"
                );
            }
        }
    }
    match solution.constants.lambda_saturation_n_per_m {
        None => assert!(solution.constants.lambda_linear_n_per_m.is_none(), "{seed}"),
        Some(last) => {
            // Beyond it the same currents stay best.
            let currents: Vec<D> = solution
                .path
                .currents_a(last)
                .iter()
                .map(|&v| d(v))
                .collect();
            for lambda in [last * 1.5 + 0.1, last * 30.0 + 1.0] {
                let scale = lambda * lambda * case.mean_square();
                let still = case.error(d(lambda), &currents).nearest();
                let exact = search.least_error(lambda, true);
                assert!(
                    (still - exact).abs() < 1e-13 * scale,
                    "{seed}: beyond {last}; {case:?}"
                );
            }
        }
    }
}

#[test]
fn small_problems_match_exhaustive_search() {
    for seed in 0..2500 {
        check_small(seed);
    }
}

#[test]
fn an_offset_is_compensated_exactly() {
    for seed in 0..400 {
        let mut case = small_case(seed);
        let mut n = Random::new(seed + 77_777);
        let strength = [0.01, 0.3, 5.0][n.below(3)];
        case.offset = Some(case.heights.iter().map(|_| strength * n.normal()).collect());
        let search = Search::new(&case);
        let solution = case.solve();
        assert_ne!(solution.status, Status::Stalled, "{seed}: {case:?}");
        let offset_square = case.error(D::ZERO, &vec![D::ZERO; case.coils()]).nearest();
        for lambda in telling_lambdas(&solution).into_iter().chain([0.0]) {
            let scale = lambda * lambda * case.mean_square() + offset_square;
            let (exact, found) = (
                search.least_error(lambda, true),
                solution.path.error_n2(lambda),
            );
            assert!(
                (found - exact).abs() <= 1e-13 * scale,
                "{seed} at {lambda}: {found:e} not {exact:e}; {case:?}"
            );
        }
        let excess = |lambda: f64| {
            let scale = lambda * lambda * case.mean_square() + offset_square;
            (search.least_error(lambda, true) - search.least_error(lambda, false)) / scale
        };
        if let Some(linear) = solution.constants.lambda_linear_n_per_m {
            assert!(
                excess(linear * (1.0 - 1e-9)) < 1e-14 || linear == 0.0,
                "{seed}: {case:?}"
            );
        }
        if let Some(jnd) = solution.constants.lambda_jnd_n_per_m {
            let over = |lambda: f64| search.excess(lambda) - 0.0049;
            assert!(jnd == 0.0 || over(jnd) < 1e-12, "{seed}: {case:?}");
            assert!(
                (1..40).all(|k| over((jnd + 1e-3) * 1.3_f64.powi(k)) > 0.0),
                "{seed}: {case:?}"
            );
        }
    }
}
