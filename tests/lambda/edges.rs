//! Degenerate problems with closed answers, criteria, refusals.

use fluxform_lambda::worst::{felt, worst_point};
use fluxform_lambda::{Criterion, Settings, Solution, Status, relative_error, solve};

use fluxform_testing::force_problems::{Case, small_case};

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
        s.constants.lambda_linear_n_per_m,
        s.constants.lambda_jnd_n_per_m,
        s.constants.lambda_saturation_n_per_m,
    ]
}

#[test]
fn nothing_to_render_and_no_force_requested_are_results() {
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
        (
            all_lambdas(&solution),
            solution.constants.lambda_floor_n_per_m
        ),
        ([None; 3], None)
    );
    assert_eq!(solution.path.error_n2(7.0), 0.0);
}

/// Nothing is target there, so no error can be a share of it.
#[test]
fn an_error_is_relative_only_where_a_force_is_requested() {
    let at = |lambda: f64| {
        let settings = Settings {
            at_n_per_m: Some(lambda),
            ..Settings::default()
        };
        let case = plain_case();
        let solution = solve(&case.problem(), &settings).unwrap();
        solution.at.unwrap().relative_rms_error
    };
    assert_eq!(at(0.0), None);
    assert!(at(1e-3).is_some_and(|error| error > 0.0 && error < 1.0));
}

/// Without a margin the largest force constant with no loss is where the first limit binds.
#[test]
fn no_noticeable_difference_at_all_is_the_linear_constant() {
    let settings = Settings {
        jnd_weight: 0.0,
        ..Settings::default()
    };
    let mut bound = 0;
    for seed in 0..400 {
        let case = small_case(seed);
        let all = solve(&case.problem(), &settings).unwrap();
        assert_eq!(
            all.constants.lambda_jnd_n_per_m, all.constants.lambda_linear_n_per_m,
            "{seed}"
        );
        let worst = worst_point(&case.problem(), &settings).unwrap();
        let pair = (worst.lambda_jnd_n_per_m, worst.lambda_linear_n_per_m);
        assert_eq!(pair.0, pair.1, "{seed}");
        bound += usize::from(pair.1.is_some_and(|lambda| lambda > 0.0));
    }
    assert!(bound > 100, "{bound}");
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
    assert!(close(solution.constants.lambda_linear_n_per_m, most / 0.05));
    assert!(close(
        solution.constants.lambda_saturation_n_per_m,
        most / 0.05
    ));
    // (lambda h - most)^2 = w^2 lambda^2 h^2.
    assert!(close(
        solution.constants.lambda_jnd_n_per_m,
        most / 0.05 / (1.0 - 0.07)
    ));
    let chosen = solution.chosen.expect("binds");
    assert!((chosen.relative_rms_error.expect("positive") / 0.07 - 1.0).abs() < 1e-12);
    assert!(
        (solution.constants.lambda_floor_n_per_m.expect("positive") - 0.8e-3 / 0.05).abs() < 1e-16
    );
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
            Criterion::Maxmin => solution.constants.lambda_maxmin_n_per_m,
        };
        assert_eq!(Some(chosen.lambda_n_per_m), expected);
        let at = solution.at.expect("requested");
        assert_eq!(at.lambda_n_per_m, 2.3);
        assert!((at.rms_error_n.powi(2) - solution.path.error_n2(2.3)).abs() < 1e-18);
        let rms_height_m = ((0.05_f64.powi(2) + 0.03_f64.powi(2) + 0.04_f64.powi(2)) / 3.0).sqrt();
        let relative = at.rms_error_n / (2.3 * rms_height_m);
        for found in [
            at.relative_rms_error,
            relative_error(&case.problem(), 2.3).expect("well formed"),
        ] {
            assert!((found.expect("requested") / relative - 1.0).abs() < 1e-14);
        }
    }
    let strict = Settings {
        jnd_weight: 0.0,
        ..Settings::default()
    };
    let solution = solve(&case.problem(), &strict).expect("well formed");
    assert_eq!(
        solution.constants.lambda_jnd_n_per_m,
        solution.constants.lambda_linear_n_per_m
    );
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

/// A coil that is nothing beside the others: its constants follow its gain as far as they can be
/// computed, and beyond that it is refused. It once took all memory.
#[test]
fn a_gain_beyond_what_can_be_computed_is_refused() {
    let weak = |gain: f64| {
        let mut case = plain_case();
        case.total = None;
        case.forces.iter_mut().step_by(2).for_each(|g| *g *= gain);
        case
    };
    let linear = |gain: f64| {
        weak(gain)
            .solve()
            .constants
            .lambda_linear_n_per_m
            .expect("binds")
    };
    let unit = linear(1e-3) / 1e-3;
    for gain in [1e-6, 1e-12, 1e-18] {
        let off = (linear(gain) / gain / unit - 1.0).abs();
        assert!(off < 1e-2, "{gain}: {off}");
    }
    for gain in [1e-25, 1e-160, 1e-300, 1e-307, 1e-323] {
        let case = weak(gain);
        let refused = solve(&case.problem(), &Settings::default()).expect_err("too weak");
        let message = refused.to_string();
        assert!(
            message.starts_with("coil 0 gives at most"),
            "{gain}: {message}"
        );
        // The worst-point form ends, whatever the gain.
        worst_point(&case.problem(), &Settings::default()).expect("well formed");
    }
}

#[test]
fn nan_is_refused_in_every_place() {
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

/// One coil over two points of equal height, where it pushes once and three times as much: the
/// current that is not felt to be too weak at the first is felt to be too strong at the second.
#[test]
fn too_strong_a_force_is_felt_as_well() {
    let height = 0.05;
    let case = Case {
        forces: vec![0.7, 2.1],
        heights: vec![height; 2],
        offset: None,
        lower: vec![0.0],
        upper: vec![10.0],
        total: None,
        ohm: vec![5.0],
    };
    for threshold_n in [0.013, 0.3] {
        for share in [0.0, 0.07, 0.3] {
            let found = felt(&case.problem(), share, threshold_n).unwrap().unwrap();
            // lambda h - c <= f and 3 f <= lambda h + c, while c is above share lambda h.
            let target = 2.0 * threshold_n / height;
            let off = (found.lambda_n_per_m / target - 1.0).abs();
            assert!(off < 1e-12, "{share}: {found:?} {target}");
        }
    }
}
