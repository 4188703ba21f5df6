//! Currents of their own at every point: what is within reach, and what it takes.

use fluxform_lambda::ForceProblem;
use fluxform_lambda::between::{Strongest, gaps};
use fluxform_lambda::feedback::{NoLambda, Reachable, Span, reachable, render};
use fluxform_lambda::worst::maxmin;
use fluxform_numerics::real::Real;

use fluxform_testing::Random;
use fluxform_testing::force_problems::{Case, D, d, small_case};

/// Random rows and limits: ties, zeros, currents below zero, limits over six decades.
fn knapsack(seed: u64) -> Case {
    let mut n = Random::new(seed);
    let coils = 1 + n.below(6);
    let style = n.below(4);
    let force = |n: &mut Random| match style {
        0 => n.below(5) as f64 - 2.0,
        1 => n.unit() * 10_f64.powf(n.between(-6.0, 0.0)),
        _ => n.normal(),
    };
    let forces = (0..coils).map(|_| force(&mut n)).collect();
    let limit = |n: &mut Random| match n.below(6) {
        0 => 0.0,
        1 | 2 => 2.0,
        _ => 2.0 * 10_f64.powf(n.between(-6.0, 0.0)),
    };
    let upper: Vec<f64> = (0..coils).map(|_| limit(&mut n)).collect();
    let lower = (0..coils)
        .map(|_| if n.below(2) == 0 { 0.0 } else { -limit(&mut n) })
        .collect();
    let all: f64 = upper.iter().sum();
    let total = match n.below(4) {
        0 => None,
        1 => Some(0.0),
        _ => Some(all * n.unit()),
    };
    Case {
        forces,
        heights: vec![0.05],
        offset: (n.below(3) == 0).then(|| vec![0.3 * n.normal()]),
        lower,
        upper,
        total,
        ohm: vec![6.0; coils],
    }
}

/// The largest `sign G I` over every vertex of the limits, and the size of its terms.
fn best_vertex(case: &Case, sign: f64) -> (D, f64) {
    let coils = case.coils();
    let (mut best, mut size) = (d(f64::NEG_INFINITY), 0.0);
    for corner in 0..1_usize << coils {
        // No coil between its limits, or one that makes the sum bind.
        for between in 0..=coils {
            let mut currents: Vec<D> = (0..coils)
                .map(|i| {
                    let high = corner >> i & 1 == 1;
                    d(if high { case.upper[i] } else { case.lower[i] })
                })
                .collect();
            let sum = |currents: &[D]| currents.iter().fold(D::ZERO, |s, &i| s + i);
            if between < coils {
                let Some(total) = case.total else { continue };
                currents[between] = D::ZERO;
                currents[between] = d(total) - sum(&currents);
                let i = currents[between];
                if i < d(case.lower[between]) || i > d(case.upper[between]) {
                    continue;
                }
            } else if case.total.is_some_and(|total| sum(&currents) > d(total)) {
                continue;
            }
            let terms = case.forces.iter().zip(&currents);
            let force = terms.fold(D::ZERO, |s, (&g, &i)| s + d(sign * g) * i);
            if force > best {
                best = force;
            }
        }
    }
    let steepest = case
        .forces
        .iter()
        .fold(0.0_f64, |most, g| most.max(g.abs()));
    for (i, g) in case.forces.iter().enumerate() {
        size += g.abs() * case.upper[i].max(-case.lower[i]);
    }
    (best, size.min(steepest * 12.0))
}

#[test]
fn what_is_within_reach_is_the_best_vertex() {
    let (mut bound, mut negative) = (0, 0);
    for seed in 0..3000 {
        let case = knapsack(seed);
        let found = reachable(&case.problem()).unwrap();
        let offset = case.offset.as_ref().map_or(0.0, |offset| offset[0]);
        let (most, size) = best_vertex(&case, 1.0);
        let (least, _) = best_vertex(&case, -1.0);
        let error = (found.most_n[0] - (most + d(offset)).to_f64()).abs();
        assert!(error <= 4e-15 * (size + offset.abs()), "{seed}: {error:e}");
        let error = (found.least_n[0] - (d(offset) - least).to_f64()).abs();
        assert!(error <= 4e-15 * (size + offset.abs()), "{seed}: {error:e}");
        bound += usize::from(case.total.is_some());
        negative += usize::from(case.lower.iter().any(|l| *l < 0.0));
        // The allocation finds the same ends.
        let mut wanting = case.clone();
        wanting.offset = None;
        let far = render(&wanting.problem(), 1e9).unwrap();
        let error = (far.forces_n[0] - most.to_f64()).abs();
        assert!(error <= 2e-13 * size, "{seed}: {error:e}");
    }
    assert!(bound > 1000 && negative > 1000);
}

fn largest(case: &Case) -> Result<f64, NoLambda> {
    let mut span = Span::default();
    span.add(&case.heights, &reachable(&case.problem()).unwrap());
    span.largest().map(|found| found.lambda_n_per_m)
}

#[test]
fn feedback_renders_no_less_than_static_currents() {
    let (mut equal, mut more) = (0, 0);
    for seed in 0..2000 {
        let mut case = small_case(seed);
        let least = maxmin(&case.problem()).unwrap();
        let found = largest(&case).unwrap_or(0.0);
        if let Some(least) = least {
            let fixed = least.lambda_n_per_m;
            assert!(found >= fixed * (1.0 - 1e-12), "{seed}: {found} < {fixed}");
            more += usize::from(found > fixed * 1.001);
        }
        // One point alone is served by either alike.
        case.heights = vec![0.7];
        case.forces.truncate(case.coils());
        let fixed = maxmin(&case.problem()).unwrap().unwrap().lambda_n_per_m;
        let found = largest(&case).unwrap_or(0.0);
        assert!(
            (found - fixed).abs() <= 1e-12 * fixed,
            "{seed}: {found} {fixed}"
        );
        equal += usize::from(fixed > 0.0);
    }
    assert!(equal > 1000 && more > 300, "{equal} {more}");
}

#[test]
fn every_force_is_met_up_to_the_largest_lambda_and_missed_beyond() {
    for seed in 0..500 {
        let case = small_case(seed);
        let Ok(lambda) = largest(&case) else { continue };
        for share in [0.3, 0.77, 1.0] {
            let found = render(&case.problem(), share * lambda).unwrap();
            assert_eq!(
                (found.points_unreached, found.worst_error_n),
                (0, 0.0),
                "{seed}"
            );
        }
        let reach = reachable(&case.problem()).unwrap();
        let found = render(&case.problem(), 1.3 * lambda).unwrap();
        assert!(found.points_unreached > 0, "{seed}");
        let missing = case.heights.iter().zip(&reach.most_n);
        let missing: Vec<f64> = missing
            .map(|(h, most)| (1.3 * lambda * h - most).max(0.0))
            .collect();
        let worst = missing.iter().copied().fold(0.0, f64::max);
        assert!((found.worst_error_n / worst - 1.0).abs() < 1e-9, "{seed}");
        let squares: f64 = missing.iter().map(|m| m * m).sum();
        let rms = (squares / missing.len() as f64).sqrt();
        assert!((found.rms_error_n / rms - 1.0).abs() < 1e-9, "{seed}");
    }
}

#[test]
fn no_other_currents_give_the_same_force_with_less_power() {
    let mut n = Random::new(7);
    for seed in 0..2000 {
        let mut case = small_case(seed);
        case.heights.truncate(1);
        case.heights[0] = 0.7;
        case.forces.truncate(case.coils());
        // Any currents within the limits.
        let mut currents: Vec<f64> = (0..case.coils())
            .map(|i| n.between(case.lower[i].min(0.0), case.upper[i]))
            .collect();
        let sum: f64 = currents.iter().sum();
        if let Some(total) = case.total.filter(|total| sum > *total) {
            currents.iter_mut().for_each(|i| *i *= total / sum);
        }
        let force: f64 = case.forces.iter().zip(&currents).map(|(g, i)| g * i).sum();
        let terms = currents.iter().zip(&case.ohm);
        let power: f64 = terms.map(|(i, ohm)| i * i * ohm).sum();
        if force < 0.0 {
            continue;
        }
        let found = render(&case.problem(), force / 0.7).unwrap();
        assert_eq!(found.points_unreached, 0, "{seed}");
        // Where two forces agree to nine digits, rounding decides how they share a sum that binds.
        assert!(found.mean_power_w <= power * (1.0 + 2e-6), "{seed}");
    }
}

/// Nine coils under a flat square of points, none of them at a coil's axis alone.
fn flat(steps: i32) -> Case {
    let mut case = Case {
        forces: Vec::new(),
        heights: Vec::new(),
        offset: None,
        lower: vec![0.0; 9],
        upper: vec![2.0; 9],
        total: Some(7.0),
        ohm: vec![6.1; 9],
    };
    for row in -steps..=steps {
        for column in -steps..=steps {
            let at = [column, row].map(|k| f64::from(k) * 1.3 / f64::from(steps));
            for coil in 0..9 {
                let axis = [coil % 3, coil / 3].map(|k| f64::from(k) - 1.0);
                let r2 = (at[0] - axis[0]).powi(2) + (at[1] - axis[1]).powi(2);
                // A dipole's pull on the axis, and its reversal beside it.
                let force = (1.0 - 0.9 * r2) / (0.7 + r2).powf(3.5);
                case.forces.push(force);
            }
            case.heights.push(0.05);
        }
    }
    case
}

#[test]
fn a_flat_surface_over_a_square_array_is_served_symmetrically() {
    let case = flat(6);
    let lambda = largest(&case).unwrap();
    let found = render(&case.problem(), 0.8 * lambda).unwrap();
    assert!(found.active_min >= 1 && found.active_max <= 9);
    assert!((found.active_mean - found.active_share.iter().sum::<f64>()).abs() < 1e-12);
    for list in [
        &found.current_max_a,
        &found.current_rms_a,
        &found.active_share,
    ] {
        for orbit in [[0, 2, 6, 8], [1, 3, 5, 7]] {
            for coil in orbit {
                assert!((list[coil] / list[orbit[0]] - 1.0).abs() < 1e-9, "{list:?}");
            }
        }
    }
    assert!(found.max_power_w >= found.mean_power_w);
    // Force by force, power is quadratic in lambda as long as no limit binds.
    let [a, b] = [1e-3, 2e-3].map(|share| {
        let found = render(&case.problem(), share * lambda).unwrap();
        found.mean_power_w
    });
    assert!((b / a - 4.0).abs() < 1e-9, "{a} {b}");
}

#[test]
fn weights_count_as_repeated_points_do() {
    let mut n = Random::new(3);
    let case = flat(2);
    let weights: Vec<f64> = (0..25).map(|_| 1.0 + n.below(3) as f64).collect();
    let mut repeated = case.clone();
    (repeated.forces, repeated.heights) = (Vec::new(), Vec::new());
    for (point, weight) in weights.iter().enumerate() {
        for _ in 0..*weight as usize {
            repeated.heights.push(case.heights[point]);
            let row = &case.forces[9 * point..9 * point + 9];
            repeated.forces.extend_from_slice(row);
        }
    }
    let lambda = 1.2 * largest(&case).unwrap();
    let mut weighted = case.problem();
    weighted.weights = Some(&weights);
    let (a, b) = (
        render(&weighted, lambda).unwrap(),
        render(&repeated.problem(), lambda).unwrap(),
    );
    for (a, b) in [
        (a.rms_error_n, b.rms_error_n),
        (a.mean_power_w, b.mean_power_w),
        (a.active_mean, b.active_mean),
        (a.current_rms_a[3], b.current_rms_a[3]),
        (a.active_share[5], b.active_share[5]),
    ] {
        assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let case = flat(60);
    let at = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| (render(&case.problem(), 7.7), reachable(&case.problem())))
    };
    let (one, three) = (at(1), at(3));
    assert!(one.0.unwrap() == three.0.unwrap() && one.1.unwrap() == three.1.unwrap());
}

#[test]
fn a_force_without_currents_narrows_the_span() {
    let span = |least: &[f64], most: &[f64], heights: &[f64]| {
        let mut span = Span::default();
        let (least_n, most_n) = (least.to_vec(), most.to_vec());
        span.add(heights, &Reachable { least_n, most_n });
        (span.smallest_n_per_m(), span.largest())
    };
    // A push of 0.2 N that no current takes away.
    let (least, most) = span(&[0.2, 0.0], &[0.9, 0.7], &[0.1, 0.1]);
    let most = most.unwrap();
    assert!((least - 2.0).abs() < 1e-12 && (most.lambda_n_per_m - 7.0).abs() < 1e-12);
    assert_eq!((most.point, most.layer), (1, 0));
    // More than the weakest point can be given.
    let (_, none) = span(&[0.8, 0.0], &[0.9, 0.7], &[0.1, 0.1]);
    assert!(matches!(
        none,
        Err(NoLambda::TooStrong {
            strong: 0,
            weak: 1,
            ..
        })
    ));
    // A pull that currents do not overcome.
    let (_, none) = span(&[-0.2], &[-0.1], &[0.1]);
    assert_eq!(none, Err(NoLambda::TooWeak(0)));
    // Points that want nothing decide nothing, unless they cannot be freed.
    let (_, free) = span(&[0.0, 0.0], &[0.0, 0.7], &[0.0, 0.1]);
    assert_eq!(free.unwrap().point, 1);
    let (_, none) = span(&[0.1, 0.0], &[0.2, 0.7], &[0.0, 0.1]);
    assert_eq!(none, Err(NoLambda::Unwanted(0)));
    let (_, none) = span(&[0.0], &[0.2], &[0.0]);
    assert_eq!(none, Err(NoLambda::NothingWanted));
    // A second layer only narrows it.
    let mut span = Span::default();
    let layer = |most: f64| Reachable {
        least_n: vec![0.0],
        most_n: vec![most],
    };
    span.add(&[0.1], &layer(0.7));
    span.add(&[0.1], &layer(0.9));
    span.add(&[0.1], &layer(0.3));
    let most = span.largest().unwrap();
    assert!((most.lambda_n_per_m - 3.0).abs() < 1e-12 && most.layer == 2);
}

/// Largest lambdas at heights `at_m`, where `force` gives each coil's force per ampere.
fn along(
    force: impl Fn(f64) -> [f64; 2],
    lower: [f64; 2],
    total: Option<f64>,
    at_m: &[f64],
) -> Vec<(f64, Strongest)> {
    let strongest = |z: &f64| {
        let row = force(*z);
        let problem = ForceProblem {
            forces_n_per_a: &row,
            height_m: &[0.3],
            offset_n: Some(&[-0.02]),
            weights: None,
            lower_a: &lower,
            upper_a: &[2.0, 1.5],
            total_max_a: total,
            resistance_ohm: &[6.0, 6.0],
        };
        let most_n = reachable(&problem).unwrap().most_n[0];
        (most_n / 0.3, Strongest::new(&problem).unwrap())
    };
    at_m.iter().map(strongest).collect()
}

/// A coil that changes its sign between two places makes the largest force fall like a V: parabolas
/// through three of its values missed a tenth of it.
#[test]
fn what_falls_between_places_is_bounded() {
    let straight = |z: f64| [0.4 * (z - 0.37), 0.1 + 0.05 * z];
    let bent = |z: f64| {
        [
            0.4 * (z - 0.37) + 0.1 * z * z,
            0.1 + 0.05 * z - 0.03 * z * z,
        ]
    };
    let force = |bends: bool| move |z: f64| if bends { bent(z) } else { straight(z) };
    for (bends, lower, total) in [
        (false, [-0.5, -0.5], None),
        (true, [-0.5, -0.5], None),
        (true, [-2.0, 0.0], Some(2.5)),
        (false, [0.0, 0.0], Some(1.0)),
    ] {
        let at_m = [0.0, 0.6, 1.0];
        let places = along(force(bends), lower, total, &at_m);
        let [a, b, c] = &places[..] else {
            unreachable!()
        };
        let found = gaps([&a.1, &b.1, &c.1], |_| at_m);
        assert_eq!(found.len(), 2);
        for (gap, ends) in found.iter().zip(places.windows(2)) {
            let [from, to] = gap.ends_m;
            let fine: Vec<f64> = (0..=1000)
                .map(|k| from + (to - from) * f64::from(k) / 1e3)
                .collect();
            let values = along(force(bends), lower, total, &fine);
            let least = values
                .iter()
                .map(|value| value.0)
                .fold(f64::INFINITY, f64::min);
            let coarse = ends[0].0.min(ends[1].0);
            assert!(gap.least_n_per_m <= least + 1e-12, "{gap:?} {least}");
            // Along a straight line one change of sign is found exactly, and where it is.
            if !bends {
                assert!(
                    (gap.least_n_per_m - least).abs() < 1e-3 * least,
                    "{gap:?} {least}"
                );
            }
            if !bends && lower[0] < 0.0 && gap.ends_m[0] == 0.0 {
                assert!(
                    coarse > 1.2 * least && (gap.lowest_m - 0.37).abs() < 1e-9,
                    "{gap:?}"
                );
            }
        }
    }
}

#[test]
fn a_point_that_wants_nothing_has_no_gaps() {
    let mut problem = two_coils();
    problem.height_m = &[0.0, -0.2];
    let place = Strongest::new(&problem).unwrap();
    let found = gaps([&place; 3], |_| [0.0, 1.0, 3.0]);
    assert!(found.iter().all(|gap| gap.point == 1), "{found:?}");
    // The same force everywhere, downward: both coils drive the other way.
    let most = -reachable(&problem).unwrap().least_n[1] / 0.2;
    for gap in &found {
        assert!((gap.least_n_per_m - most).abs() < 1e-12 * most, "{gap:?}");
    }
}

fn two_coils() -> ForceProblem<'static> {
    ForceProblem {
        forces_n_per_a: &[0.7, 0.2, 0.3, 1.1],
        height_m: &[1.3, 0.9],
        offset_n: None,
        weights: None,
        lower_a: &[-0.4, -0.1],
        upper_a: &[1.5, 2.0],
        total_max_a: Some(1.2),
        resistance_ohm: &[6.0, 6.0],
    }
}
