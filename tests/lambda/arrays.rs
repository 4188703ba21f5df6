//! Arrays like the real one: ties, far and coincident coils, scaling laws, many points.

use fluxform_lambda::worst::worst_point;
use fluxform_lambda::{Event, Settings, Solution, Status, solve};

use fluxform_testing::Random;
use fluxform_testing::force_problems::{Case, D, d, telling_lambdas};

/// Point dipoles in place of coils: a smooth, symmetric array like the real one.
fn dipole_array(positions: &[[f64; 2]], points: &[[f64; 3]]) -> Vec<f64> {
    let depth = 0.03;
    let force = |c: &[f64; 2], p: &[f64; 3]| {
        let (x, y, z) = (p[0] - c[0], p[1] - c[1], p[2] + depth);
        let flat = x * x + y * y;
        1.0e-6 * z * (2.0 * z * z - 3.0 * flat) / (flat + z * z).powf(3.5)
    };
    points
        .iter()
        .flat_map(|p| positions.iter().map(move |c| force(c, p)))
        .collect()
}

fn square_array(side: usize, pitch_m: f64) -> Vec<[f64; 2]> {
    let at = |k: usize| pitch_m * (k as f64 - 0.5 * (side as f64 - 1.0));
    (0..side * side)
        .map(|i| [at(i % side), at(i / side)])
        .collect()
}

fn flat_points(samples: usize, height_m: f64) -> Vec<[f64; 3]> {
    let at = |k: usize| 0.1 * (k as f64 / (samples as f64 - 1.0)) - 0.05;
    (0..samples * samples)
        .map(|k| [at(k % samples), at(k / samples), height_m])
        .collect()
}

fn array_case(positions: &[[f64; 2]], points: &[[f64; 3]]) -> Case {
    let m = positions.len();
    Case {
        forces: dipole_array(positions, points),
        heights: points.iter().map(|p| p[2]).collect(),
        offset: None,
        lower: vec![0.0; m],
        upper: vec![2.0; m],
        total: Some(2.0 * m as f64),
        ohm: vec![6.1; m],
    }
}

/// The currents' own proof: errors from the points, in double-double, and the duality gap.
fn assert_proved(case: &Case, solution: &Solution, what: &str) {
    assert_eq!(solution.status, Status::Solved, "{what}");
    let (m, points) = (case.coils(), case.heights.len() as f64);
    for lambda in telling_lambdas(solution) {
        let settings = Settings {
            at_n_per_m: Some(lambda),
            ..Settings::default()
        };
        let point = solve(&case.problem(), &settings)
            .expect("well formed")
            .at
            .expect("requested");
        let scale = lambda * lambda * case.mean_square();
        // The gap of rounded currents: their rounding's forces times what the limits allow.
        let reach: f64 = (0..m)
            .map(|i| {
                let column = case
                    .forces
                    .iter()
                    .skip(i)
                    .step_by(m)
                    .map(|g| g * g)
                    .sum::<f64>();
                (column / points).sqrt() * (case.upper[i] - case.lower[i])
            })
            .sum();
        let bound = 1e-13 * scale + 4.0 * f64::EPSILON * scale.sqrt() * reach;
        let gap = point.duality_gap_n2;
        assert!(gap <= bound, "{what} at {lambda}: {:e}", gap / scale);
        let currents: Vec<D> = point.currents_a.iter().map(|&v| d(v)).collect();
        let direct = case.error(d(lambda), &currents).nearest();
        assert!(
            (direct - solution.path.error_n2(lambda)).abs() <= 1e-13 * scale,
            "{what} at {lambda}"
        );
        assert!(
            (point.rms_error_n.powi(2) - direct).abs() <= 1e-13 * scale,
            "{what} at {lambda}"
        );
    }
}

#[test]
fn arrays_prove_their_own_optimality() {
    let points = flat_points(21, 0.05);
    let mut hill = points.clone();
    for p in &mut hill {
        p[2] = 0.03 + 0.05 * (-300.0 * (p[0] * p[0] + p[1] * p[1])).exp();
    }
    let seed = square_array(3, 0.05);
    for shape in [&points, &hill] {
        assert_proved(
            &array_case(&seed, shape),
            &array_case(&seed, shape).solve(),
            "3 x 3",
        );
        let wide = square_array(5, 0.05);
        assert_proved(
            &array_case(&wide, shape),
            &array_case(&wide, shape).solve(),
            "5 x 5",
        );
        for distance in [0.6, 1.5] {
            let mut far = seed.clone();
            far[0][0] -= distance;
            far[7][1] += distance;
            let mut case = array_case(&far, shape);
            assert_proved(&case, &case.solve(), "far coils");
            case.total = Some(7.3);
            assert_proved(&case, &case.solve(), "far coils and a sum");
        }
        let mut case = array_case(&seed, shape);
        for i in 0..9 {
            case.upper[i] = 2.0 * 10.0_f64.powf(-0.75 * i as f64);
        }
        case.upper[4] = 0.0;
        assert_proved(&case, &case.solve(), "six decades of limits");
        case.total = Some(0.9);
        assert_proved(&case, &case.solve(), "six decades and a sum");
        let mut twins = seed.clone();
        twins[5] = twins[2];
        twins[8] = twins[2];
        let case = array_case(&twins, shape);
        let solution = case.solve();
        assert_eq!(solution.rank, 7);
        assert_proved(&case, &solution, "coincident coils");
    }
}

#[test]
fn the_symmetric_array_changes_four_coils_at_once() {
    let solution = array_case(&square_array(3, 0.05), &flat_points(61, 0.05)).solve();
    let path = solution.path.breakpoints();
    for group in [[0, 2, 6, 8], [1, 3, 5, 7]] {
        let meet = |i: usize| {
            path.iter()
                .position(|b| b.events.contains(&Event::MeetsUpper(i)))
                .expect("every coil saturates")
        };
        assert!(group.iter().all(|&i| meet(i) == meet(group[0])), "{path:?}");
    }
    assert_eq!(path[0].events.len(), 9);
    assert_eq!(path[0].events[3].to_string(), "coil 3 leaves zero");
    let last = path[path.len() - 1].lambda_n_per_m;
    assert_eq!(solution.constants.lambda_saturation_n_per_m, Some(last));
}

#[test]
fn force_constants_scale_as_the_equations_do() {
    let base = array_case(&square_array(3, 0.05), &flat_points(15, 0.05));
    let all = |s: &Solution| {
        [
            s.constants.lambda_linear_n_per_m,
            s.constants.lambda_jnd_n_per_m,
            s.constants.lambda_saturation_n_per_m,
        ]
        .map(|v| v.expect("limits bind"))
    };
    let expected = all(&base.solve());
    for (force, height, current) in [
        (1.7, 1.0, 1.0),
        (1.0, 0.3, 1.0),
        (1.0, 1.0, 13.0),
        (1e-120, 1e80, 1e-30),
        (1e150, 1e-150, 1e3),
        (3e-7, 2e5, 7e9),
    ] {
        let mut case = base.clone();
        case.forces.iter_mut().for_each(|v| *v *= force);
        case.heights.iter_mut().for_each(|v| *v *= height);
        case.upper.iter_mut().for_each(|v| *v *= current);
        case.total = case.total.map(|v| v * current);
        for (found, base) in all(&case.solve()).iter().zip(expected) {
            let ratio = found / (force / height * current) / base;
            assert!(
                (ratio - 1.0).abs() < 1e-12,
                "{force} {height} {current}: {ratio}"
            );
        }
    }
}

#[test]
fn order_does_not_matter() {
    let mut case = array_case(&square_array(3, 0.05), &flat_points(9, 0.05));
    case.upper = (0..9).map(|i| 0.7 + 0.13 * f64::from(i * i % 7)).collect();
    case.total = Some(6.3);
    let (m, n) = (9, case.heights.len());
    let coil = |i: usize| (i * 4 + 2) % m;
    let point = |j: usize| (j * 5 + 3) % n;
    let mixed = Case {
        forces: (0..n * m)
            .map(|k| case.forces[point(k / m) * m + coil(k % m)])
            .collect(),
        heights: (0..n).map(|j| case.heights[point(j)]).collect(),
        upper: (0..m).map(|i| case.upper[coil(i)]).collect(),
        ..case.clone()
    };
    let (a, b) = (case.solve(), mixed.solve());
    for lambda in telling_lambdas(&a) {
        let (x, y) = (a.path.currents_a(lambda), b.path.currents_a(lambda));
        assert!(
            (0..m).all(|i| (y[i] - x[coil(i)]).abs() < 1e-11),
            "{x:?} {y:?}"
        );
        assert!((a.path.error_n2(lambda) / b.path.error_n2(lambda) - 1.0).abs() < 1e-11);
    }
}

#[test]
fn the_error_is_convex_smooth_and_relatively_growing() {
    for seed in 0..40 {
        let mut n = Random::new(seed + 5);
        let (points, m) = (12 + n.below(30), 1 + n.below(12));
        let case = Case {
            forces: (0..points * m).map(|_| n.normal() + 0.8).collect(),
            heights: (0..points).map(|_| n.between(0.02, 0.09)).collect(),
            offset: None,
            lower: vec![0.0; m],
            upper: (0..m).map(|_| n.between(0.1, 2.0)).collect(),
            total: Some(n.between(0.3, 2.0)),
            ohm: vec![1.0; m],
        };
        let solution = case.solve();
        let pieces = solution.path.quadratics();
        for pair in pieces.windows(2) {
            let ((_, a), (at, b)) = (pair[0], pair[1]);
            let value = |q: [f64; 3]| (q[0] * at + q[1]) * at + q[2];
            let slope = |q: [f64; 3]| 2.0 * q[0] * at + q[1];
            let scale = at * at * case.mean_square();
            assert!((value(a) - value(b)).abs() < 1e-13 * scale);
            assert!((slope(a) - slope(b)).abs() < 1e-12 * scale / at);
        }
        assert!(pieces.iter().all(|(_, q)| q[0] >= 0.0));
        let last = pieces[pieces.len() - 1].0;
        let relative = |k: i32| {
            let lambda = last * 1.5 * f64::from(k) / 200.0;
            solution.path.error_n2(lambda) / (lambda * lambda)
        };
        assert!(
            (1..200).all(|k| relative(k + 1) >= relative(k) * (1.0 - 1e-13)),
            "{seed}"
        );
    }
}

#[test]
fn thousands_of_points_do_not_wear_the_sums_down() {
    // Twenty thousand rows go through several chunks and two groups.
    let case = array_case(&square_array(3, 0.05), &flat_points(142, 0.05));
    let solution = case.solve();
    assert_proved(&case, &solution, "142 x 142");
    let pool = |n| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .expect("a small pool")
    };
    let bits = |s: Solution| {
        let point = s.chosen.expect("limits bind");
        (
            point.currents_a,
            point.rms_error_n,
            point.worst_error_n,
            point.duality_gap_n2,
            s.constants.lambda_jnd_n_per_m,
        )
    };
    assert_eq!(
        bits(pool(1).install(|| case.solve())),
        bits(pool(3).install(|| case.solve()))
    );
}

/// Of many more coils than points the reduction once held NaN, and nothing was rendered.
#[test]
fn more_coils_than_points_render_more_than_fewer() {
    let points = flat_points(3, 0.03);
    let mut before = 0.0;
    for side in [3, 5, 7, 9] {
        let solution = array_case(&square_array(side, 0.025), &points).solve();
        assert_eq!(
            (solution.status, solution.rank),
            (Status::Solved, points.len()),
            "{side}"
        );
        let linear = solution.constants.lambda_linear_n_per_m;
        let linear = linear.unwrap_or_else(|| panic!("{side}: nothing is rendered"));
        // The inner coils are those of the smaller array.
        assert!(
            linear >= before * (1.0 - 1e-12),
            "{side}: {linear} {before}"
        );
        let error_n = solution.path.error_n2(linear).sqrt();
        assert!(
            side == 3 || error_n < 1e-12 * linear * 0.03,
            "{side}: {error_n:e}"
        );
        before = linear;
    }
}

/// The program without the drivers' size went round in circles, and no constant was found.
#[test]
fn the_worst_point_of_closely_spaced_coils_is_found() {
    let mut case = array_case(&square_array(15, 0.01), &flat_points(31, 0.03));
    case.total = None;
    let problem = case.problem();
    let worst = worst_point(&problem, &Settings::default()).expect("well formed");
    assert!(worst.complete);
    let linear = worst.lambda_linear_n_per_m.expect("limits bind");
    let floor = worst.floor.expect("no offset");
    for (share, has_left) in [(0.5, false), (0.98, false), (1.02, true)] {
        let at = worst.at(&problem, share * linear);
        let requested_n = share * linear * 0.03;
        assert!(at.gap_n < 1e-10 * requested_n, "{share}: {:e}", at.gap_n);
        let above = at.worst_error_n / requested_n - floor;
        assert_eq!(above.abs() > 1e-11, has_left, "{share}: {above:e}");
    }
}
