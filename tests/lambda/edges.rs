//! Degenerate problems with closed answers, criteria, refusals.

use fluxform::lambda::{Criterion, Settings, Solution, Status, solve};

use crate::case::Case;

fn plain_case() -> Case {
    Case {
        forces: vec![0.7, 0.2, 0.3, 1.1, 0.4, 0.5],
        heights: vec![0.05, 0.03, 0.04],
        offset: None,
        lower: vec![0.0; 2],
        upper: vec![1.3, 0.9],
        total: Some(1.9),
        ohm: vec![6.0, 5.0],
    }
}

fn all_lambdas(s: &Solution) -> [Option<f64>; 3] {
    [
        s.lambda_linear_n_per_m,
        s.lambda_jnd_n_per_m,
        s.lambda_saturation_n_per_m,
    ]
}

#[test]
fn nothing_to_render_and_nothing_wanted_are_results() {
    let mut attract = plain_case();
    attract.forces.iter_mut().for_each(|v| *v = -*v);
    let solution = attract.solve();
    assert_eq!(solution.status, Status::NothingRendered);
    assert_eq!(all_lambdas(&solution), [None; 3]);
    assert!(solution.chosen.is_none());
    assert!((solution.path.error_n2(2.0) - 4.0 * attract.mean_square()).abs() < 1e-17);

    let mut flat = plain_case();
    flat.heights = vec![0.0; 3];
    let solution = flat.solve();
    assert_eq!(solution.status, Status::NothingWanted);
    assert_eq!(
        (all_lambdas(&solution), solution.lambda_floor_n_per_m),
        ([None; 3], None)
    );
    assert_eq!(solution.path.error_n2(7.0), 0.0);
}

#[test]
fn limits_of_zero_bind_at_once() {
    let mut none = plain_case();
    none.upper = vec![0.0; 2];
    let mut total = plain_case();
    total.total = Some(0.0);
    for case in [none, total] {
        let solution = case.solve();
        assert_eq!(solution.status, Status::Solved);
        assert_eq!(all_lambdas(&solution), [Some(0.0); 3]);
        assert_eq!(solution.path.currents_a(3.0), [0.0, 0.0]);
        assert!((solution.path.error_n2(3.0) / (9.0 * case.mean_square()) - 1.0).abs() < 1e-15);
    }
}

#[test]
fn one_point_and_one_coil_have_closed_forms() {
    // One point: the error is zero until the force runs out.
    let point = Case {
        forces: vec![0.7, 0.4],
        heights: vec![0.05],
        upper: vec![1.3, 0.9],
        total: None,
        ..plain_case()
    };
    let most = 0.7 * 1.3 + 0.4 * 0.9;
    let solution = point.solve();
    assert_eq!(solution.rank, 1);
    let close = |a: Option<f64>, b: f64| (a.expect("binds") / b - 1.0).abs() < 1e-14;
    assert!(close(solution.lambda_linear_n_per_m, most / 0.05));
    assert!(close(solution.lambda_saturation_n_per_m, most / 0.05));
    // (lambda h - most)^2 = w^2 lambda^2 h^2.
    assert!(close(
        solution.lambda_jnd_n_per_m,
        most / 0.05 / (1.0 - 0.07)
    ));
    let chosen = solution.chosen.expect("binds");
    assert!((chosen.relative_rms_error.expect("positive") / 0.07 - 1.0).abs() < 1e-12);
    assert!((solution.lambda_floor_n_per_m.expect("positive") - 0.8e-3 / 0.05).abs() < 1e-16);
    // Least power at one point: currents as force over resistance.
    let currents = solution.path.currents_a(4.0);
    assert!(
        (currents[0] / currents[1] / ((0.7 / 6.0) / (0.4 / 5.0)) - 1.0).abs() < 1e-13,
        "{currents:?}"
    );
}

#[test]
fn the_criterion_chooses() {
    let case = plain_case();
    for criterion in [
        Criterion::Jnd,
        Criterion::Linear,
        Criterion::Saturation,
        Criterion::Maxmin,
    ] {
        let settings = Settings {
            criterion,
            jnd_weight: 0.11,
            at_n_per_m: Some(2.3),
        };
        let solution = solve(&case.problem(), &settings).expect("well formed");
        let [linear, jnd, saturation] = all_lambdas(&solution);
        let chosen = solution.chosen.expect("limits bind");
        let expected = match criterion {
            Criterion::Jnd => jnd,
            Criterion::Linear => linear,
            Criterion::Saturation => saturation,
            Criterion::Maxmin => solution.lambda_maxmin_n_per_m,
            other => panic!("{other:?} has no line here"),
        };
        assert_eq!(Some(chosen.lambda_n_per_m), expected);
        let at = solution.at.expect("asked for");
        assert_eq!(at.lambda_n_per_m, 2.3);
        assert!((at.rms_error_n.powi(2) - solution.path.error_n2(2.3)).abs() < 1e-18);
    }
    let strict = Settings {
        jnd_weight: 0.0,
        ..Settings::default()
    };
    let solution = solve(&case.problem(), &strict).expect("well formed");
    assert_eq!(solution.lambda_jnd_n_per_m, solution.lambda_linear_n_per_m);
}

#[test]
fn malformed_problems_are_refused_with_the_place() {
    let message = |change: &dyn Fn(&mut Case)| {
        let mut case = plain_case();
        change(&mut case);
        solve(&case.problem(), &Settings::default())
            .expect_err("malformed")
            .to_string()
    };
    assert_eq!(
        message(&|c| c.heights.clear()),
        "no constraint points: at least one height is needed"
    );
    assert_eq!(
        message(&|c| c.upper.clear()),
        "no coils: at least one current limit is needed"
    );
    assert_eq!(
        message(&|c| {
            c.forces.pop();
        }),
        "forces_n_per_a has 5 entries, expected 6"
    );
    assert_eq!(
        message(&|c| c.forces[3] = f64::NAN),
        "forces_n_per_a[3] is NaN: only finite numbers can be used"
    );
    assert_eq!(
        message(&|c| c.upper[1] = -0.4),
        "upper_a[1] is -0.4, expected a limit of zero or above"
    );
    assert_eq!(
        message(&|c| c.lower[0] = 0.4),
        "lower_a[0] is 0.4, expected a limit of zero or below"
    );
    assert_eq!(
        message(&|c| c.total = Some(-1.5)),
        "total_max_a[0] is -1.5, expected a limit of zero or above"
    );
    assert_eq!(
        message(&|c| c.ohm[1] = 0.0),
        "resistance_ohm[1] is 0, expected a positive resistance"
    );
}

#[test]
fn a_value_that_is_no_number_is_refused_wherever_it_stands() {
    for points in 1..=4 {
        let mut case = plain_case();
        case.heights = vec![0.05; points];
        case.forces = vec![0.7; 2 * points];
        for place in 0..points {
            for value in [f64::NAN, f64::INFINITY] {
                let mut bad = case.clone();
                bad.heights[place] = value;
                let refused = solve(&bad.problem(), &Settings::default()).unwrap_err();
                assert!(refused.to_string().contains("finite"), "{refused}");
            }
        }
    }
}
