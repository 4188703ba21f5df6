//! Every criterion of thousands of small problems against a second exact method: all vertices,
//! or proofs from both sides that share no code with the path.

// The largest errors found are printed with --nocapture.
#![allow(clippy::print_stdout)]

use fluxform_base::units::DETECTION_THRESHOLD_N;
use fluxform_lambda::worst::{felt, maxmin, worst_point};
use fluxform_lambda::{Settings, Status, Wiring, solve};

use crate::vertices::{Demand, Vertices};
use fluxform_testing::Random;
use fluxform_testing::force_problems::{Case, small_case};

fn top(case: &Case) -> f64 {
    case.heights.iter().fold(0.0, |most, &h| most.max(h))
}

/// Largest force that the limits allow at any point.
fn reach(case: &Case) -> f64 {
    let m = case.coils();
    let push = |i: usize| {
        let column = case.forces.iter().skip(i).step_by(m);
        let most = column.fold(0.0_f64, |most, g| most.max(g.abs()));
        most * case.upper[i].max(-case.lower[i])
    };
    (0..m).map(push).sum()
}

#[test]
fn maxmin_is_the_best_of_all_vertices() {
    let (mut tried, mut worst) = (0, 0.0_f64);
    for seed in 0..3000 {
        let case = small_case(seed + 10_000);
        if case.coils() > 3 || top(&case) <= 0.0 {
            continue;
        }
        let demands: Vec<Demand> = (0..case.heights.len())
            .map(|point| Demand {
                point,
                sign: 1.0,
                height: case.heights[point],
                offset: 0.0,
            })
            .collect();
        let size = reach(&case);
        let exact = Vertices::largest(&case, &demands, size);
        let found = maxmin(&case.problem()).expect("well formed");
        let found = found.expect("zero is possible").lambda_n_per_m;
        let error = (found - exact).abs() / (size / top(&case)).max(1e-300);
        assert!(error <= 1e-13, "{seed}: {found:e} not {exact:e}; {case:?}");
        (tried, worst) = (tried + 1, worst.max(error));
    }
    println!("maxmin: {tried} problems, worst error {worst:.1e} of the largest force over max h");
    assert!(tried >= 2000);
}

/// The rows that keep every error within its tolerance, chosen at `lambda`.
fn tolerances(case: &Case, share: f64, lambda: f64) -> Vec<Demand> {
    let each = |point: usize| {
        let h = case.heights[point];
        let (part, fixed) = if share * lambda * h >= DETECTION_THRESHOLD_N {
            (share, 0.0)
        } else {
            (0.0, DETECTION_THRESHOLD_N)
        };
        let offset = case.offset.as_ref().map_or(0.0, |o| o[point]);
        [1.0, -1.0].map(|sign| Demand {
            point,
            sign,
            height: sign * h - part * h,
            offset: sign * offset + fixed,
        })
    };
    (0..case.heights.len()).flat_map(each).collect()
}

#[test]
fn errors_that_nobody_feels_end_where_all_vertices_say() {
    let (mut tried, mut worst, mut most_part) = (0, 0.0_f64, 0.0_f64);
    for seed in 0..4600 {
        let mut case = small_case(seed + 20_000);
        let mut n = Random::new(seed + 5);
        // Heights of zero, and forces so small that a finger does not feel them.
        for h in &mut case.heights {
            *h *= [1.0, 1.0, 0.1, 0.0][n.below(4)];
        }
        let weak = [1.0, 1e-2, 1e-4][n.below(3)];
        case.forces.iter_mut().for_each(|g| *g *= weak);
        if case.coils() > 2 || top(&case) <= 0.0 {
            continue;
        }
        let share = [0.07, 0.3, 0.0][n.below(3)];
        let found = felt(&case.problem(), share, DETECTION_THRESHOLD_N).expect("well formed");
        let found = found.expect("zero is within any tolerance");
        let lambda = found.lambda_n_per_m;
        let size = reach(&case) + DETECTION_THRESHOLD_N;
        let largest = |at: f64| Vertices::largest(&case, &tolerances(&case, share, at), size);
        let error = (largest(lambda) - lambda).abs() / lambda;
        assert!(
            error <= 1e-11,
            "{seed}: {lambda:e}, error {error:e}; {case:?}"
        );
        for factor in [1.0 + 1e-9, 1.01, 1.7, 30.0] {
            let beyond = lambda * factor;
            assert!(
                largest(beyond) < beyond,
                "{seed}: {beyond} is possible; {case:?}"
            );
        }
        assert!(found.part <= 1.0 + 1e-9, "{seed}: {found:?} {case:?}");
        (tried, worst) = (tried + 1, worst.max(error));
        most_part = most_part.max((found.part - 1.0).abs());
    }
    println!(
        "not felt: {tried} problems, worst error {worst:.1e} of lambda, \
         tolerance used up to 1 within {most_part:.1e}"
    );
    assert!(tried >= 2000);
}

/// t* between currents that reach it and a proof that none are better.
fn proven(case: &Case, lambda: f64) -> (f64, f64, Vec<f64>) {
    let solution = worst_point(&case.problem(), &Settings::default()).expect("well formed");
    let point = solution.at(&case.problem(), lambda);
    (point.worst_error_n, point.gap_n, point.currents_a)
}

#[test]
fn worst_point_constants_stand_between_proofs() {
    let (mut tried, mut worst, mut widest) = (0, 0.0_f64, 0.0_f64);
    for seed in 0..5000 {
        let case = small_case(seed + 30_000);
        let top = top(&case);
        let solution = worst_point(&case.problem(), &Settings::default()).expect("well formed");
        assert!(solution.complete, "{seed}: {case:?}");
        let (Some(linear), Some(jnd)) =
            (solution.lambda_linear_n_per_m, solution.lambda_jnd_n_per_m)
        else {
            continue;
        };
        // Limits so wide that none binds stand for none.
        let mut free = case.clone();
        free.total = None;
        free.upper = case.upper.iter().map(|u| u * 1e4 + 1e3).collect();
        // A driver that reverses has no lower limit either.
        let lower = case.lower.iter();
        free.lower = lower
            .map(|l| if *l < 0.0 { l * 1e4 - 1e3 } else { 0.0 })
            .collect();
        let excess = |lambda: f64| {
            let (t, gap, _) = proven(&case, lambda);
            let (t_0, gap_0, currents) = proven(&free, lambda);
            let near =
                |(i, (l, u)): (&f64, (&f64, &f64))| *i > 0.5 * u || (*l < 0.0 && *i < 0.5 * l);
            let binds = currents
                .iter()
                .zip(free.lower.iter().zip(&free.upper))
                .any(near);
            let scale = lambda * top;
            (!binds).then_some(((t - t_0) / scale, (gap + gap_0) / scale))
        };
        if linear <= 0.0 || jnd <= 0.0 || solution.accuracy.estimate > 1e-11 {
            continue;
        }
        let reported = [
            linear * (1.0 - 1e-9),
            linear * 1.01,
            jnd,
            jnd * 1.001,
            jnd * 3.0,
        ];
        let Some(found) = reported.map(excess).into_iter().collect::<Option<Vec<_>>>() else {
            continue;
        };
        let gap = found.iter().fold(0.0_f64, |most, f| most.max(f.1));
        if gap > 1e-9 {
            // Wide limits amplify what rounding leaves of the proof's multipliers.
            continue;
        }
        let room = 1e-11 + gap;
        assert!(found[0].0 <= room, "{seed}: {found:?} {case:?}");
        assert!(found[1].0 > 1e-14 - gap, "{seed}: {found:?} {case:?}");
        let error = (found[2].0 - 0.07).abs();
        assert!(error <= 1e-9 + gap, "{seed}: {found:?} {case:?}");
        assert!(found[3].0 > 0.07 && found[4].0 > 0.07, "{seed}: {found:?}");
        (tried, worst, widest) = (tried + 1, worst.max(error), widest.max(gap));
    }
    println!(
        "worst point: {tried} problems, jnd within {worst:.1e} of lambda max h, \
         proofs within {widest:.1e}"
    );
    assert!(tried >= 2000, "{tried}");
}

#[test]
fn broken_coils_and_pairs_are_the_problems_without_and_with_sums() {
    for seed in 0..400 {
        let case = small_case(seed + 40_000);
        let m = case.coils();
        if m < 3 {
            continue;
        }
        let settings = Settings::default();
        let wiring = Wiring {
            broken: vec![1],
            series: vec![[0, 2]],
        };
        wiring.validate(m).expect("coils that are there");
        let mut by_hand = case.clone();
        // The second of the pair and the broken one go; the first takes the pair's forces.
        by_hand.forces = case
            .forces
            .chunks(m)
            .flat_map(|row| {
                [row[0] + row[2]]
                    .into_iter()
                    .chain(row[3..].iter().copied())
                    .collect::<Vec<_>>()
            })
            .collect();
        let keep = |list: &[f64], first: f64| [&[first], &list[3..]].concat();
        let ohm = case.ohm[0] + case.ohm[2];
        // A supply that drives the first coil beyond its limit, but not the pair.
        let voltage_v = (seed % 2 == 0).then_some(0.7 * case.upper[0] * ohm);
        let most = voltage_v.map_or(f64::INFINITY, |volt| volt / ohm);
        let keep_lower = case.lower[0].max(case.lower[2]).max(-most);
        by_hand.lower = keep(&case.lower, keep_lower);
        by_hand.upper = keep(&case.upper, case.upper[0].min(case.upper[2]).min(most));
        by_hand.ohm = keep(&case.ohm, ohm);
        let problem = case.problem();
        let rewired = wiring.apply(&problem, voltage_v);
        let wired = rewired.problem(&problem);
        let (a, b) = (
            solve(&wired, &settings).expect("well formed"),
            solve(&by_hand.problem(), &settings).expect("well formed"),
        );
        // A column of zeros once took the slower arithmetic.
        assert_eq!(
            (a.precision, a.rank),
            (b.precision, b.rank),
            "{seed}: {case:?}"
        );
        let worst = [&wired, &by_hand.problem()]
            .map(|problem| worst_point(problem, &settings).expect("well formed"));
        let pairs = [
            (
                a.constants.lambda_linear_n_per_m,
                b.constants.lambda_linear_n_per_m,
            ),
            (
                a.constants.lambda_jnd_n_per_m,
                b.constants.lambda_jnd_n_per_m,
            ),
            (
                a.constants.lambda_maxmin_n_per_m,
                b.constants.lambda_maxmin_n_per_m,
            ),
            (worst[0].lambda_jnd_n_per_m, worst[1].lambda_jnd_n_per_m),
        ];
        for (a, b) in pairs {
            assert_eq!(a.is_some(), b.is_some(), "{seed}: {case:?}");
            let (a, b) = (a.unwrap_or(0.0), b.unwrap_or(0.0));
            assert!((a - b).abs() <= 1e-9 * b.abs(), "{seed}: {a} {b} {case:?}");
        }
        let mut currents = a.path.currents_a(1.3);
        wiring.spread(&mut currents);
        assert_eq!((currents[1], currents[2]), (0.0, currents[0]), "{seed}");
    }
    let message = |broken: &[usize], series: &[[usize; 2]]| {
        let wiring = Wiring {
            broken: broken.to_vec(),
            series: series.to_vec(),
        };
        wiring.validate(9).expect_err("wrong").to_string()
    };
    assert_eq!(
        message(&[9], &[]),
        "coil 9 is not in the array: its coils are numbered 0 to 8"
    );
    for twice in [
        message(&[3, 3], &[]),
        message(&[3], &[[1, 3]]),
        message(&[], &[[3, 3]]),
    ] {
        assert_eq!(
            twice,
            "coil 3 is named twice among broken coils and pairs in series"
        );
    }
}

/// Inputs with nothing to solve have answers in every form.
#[test]
fn bad_inputs_have_answers_in_every_form() {
    let plain = Case {
        forces: vec![0.7, 0.2, 0.3, 1.1, 0.4, 0.5],
        heights: vec![0.05, 0.03, 0.04],
        offset: None,
        lower: vec![0.0; 2],
        upper: vec![1.3, 0.9],
        total: Some(1.9),
        ohm: vec![6.0, 5.0],
    };
    let all = |case: &Case| {
        let problem = case.problem();
        let worst = worst_point(&problem, &Settings::default()).expect("well formed");
        assert!(worst.complete, "{case:?}");
        (
            case.solve(),
            worst,
            maxmin(&problem).expect("well formed"),
            felt(&problem, 0.07, DETECTION_THRESHOLD_N).expect("well formed"),
        )
    };
    // No heights: nothing is target.
    let none = Case {
        heights: vec![0.0; 3],
        ..plain.clone()
    };
    let (mean, worst, least, within) = all(&none);
    assert_eq!(mean.status, Status::NothingWanted);
    assert_eq!(worst.lambda_jnd_n_per_m, None);
    assert!(least.is_none() && within.is_none());
    // One point, and the same point many times.
    let one = Case {
        forces: vec![0.7, 0.2],
        heights: vec![0.05],
        total: None,
        ..plain.clone()
    };
    let same = Case {
        forces: [0.7, 0.2].repeat(500),
        heights: vec![0.05; 500],
        ..one.clone()
    };
    let most = (0.7 * 1.3 + 0.2 * 0.9) / 0.05;
    for case in [one, same] {
        let (mean, worst, least, within) = all(&case);
        let close = |found: f64, expected: f64| {
            assert!((found / expected - 1.0).abs() < 1e-13, "{found} {expected}");
        };
        close(mean.constants.lambda_linear_n_per_m.expect("binds"), most);
        close(worst.lambda_linear_n_per_m.expect("binds"), most);
        close(worst.lambda_jnd_n_per_m.expect("binds"), most / 0.93);
        close(least.expect("possible").lambda_n_per_m, most);
        close(within.expect("possible").lambda_n_per_m, most / 0.93);
    }
    // Coils that only pull the magnet down: nothing but what is not felt.
    let mut attract = plain.clone();
    attract.forces.iter_mut().for_each(|g| *g = -*g);
    let (mean, _, least, within) = all(&attract);
    assert_eq!(mean.status, Status::NothingRendered);
    assert_eq!(least.map(|l| l.lambda_n_per_m), Some(0.0));
    let within = within.expect("small forces are not felt").lambda_n_per_m;
    assert!((within - DETECTION_THRESHOLD_N / 0.05).abs() < 1e-15);
    // A pull that no current makes up for.
    let heavy = Case {
        offset: Some(vec![-9.0; 3]),
        ..plain
    };
    let (_, _, least, within) = all(&heavy);
    assert!(least.is_none() && within.is_none());
}
