//! The worst-point form of many coils: against linear programs solved by HiGHS, and against proofs
//! by multipliers that are computed here.

use fluxform_lambda::Settings;
use fluxform_lambda::worst::{ActivePoint, least_worst_error, maxmin, worst_point};
use fluxform_testing::force_problems::Case;

/// The linear congruential generator of Knuth's MMIX.
struct Numbers(u64);

impl Numbers {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }
}

fn force(x: f64, y: f64, z: f64) -> f64 {
    let flat = x * x + y * y;
    let r2 = flat + z * z;
    1.0e-6 * z * (2.0 * z * z - 3.0 * flat) / (r2 * r2 * r2 * r2.sqrt())
}

/// The problem of that number in `tests/oracles/worst_point.py`, and its force constant.
fn array(k: u64) -> (Case, f64) {
    let ends = [
        (100, 5),
        (150, 6),
        (175, 7),
        (188, 8),
        (196, 10),
        (199, 12),
        (200, 15),
    ];
    let side = ends.into_iter().find(|&(end, _)| k < end).unwrap().1;
    let mut numbers = Numbers(k);
    let pitch = numbers.between(0.03, 0.06);
    let jitter = if k.is_multiple_of(2) {
        0.0
    } else {
        0.2 * pitch
    };
    let middle = 0.5 * (side as f64 - 1.0);
    let coils: Vec<[f64; 2]> = (0..side * side)
        .map(|i| {
            let x = ((i % side) as f64 - middle) * pitch + numbers.between(-jitter, jitter);
            let y = ((i / side) as f64 - middle) * pitch + numbers.between(-jitter, jitter);
            [x, y]
        })
        .collect();
    let half = middle * pitch;
    let level = numbers.between(0.03, 0.06);
    let rough = if k.is_multiple_of(4) {
        0.0
    } else {
        0.3 * level
    };
    let (mut forces, mut heights, mut offset) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..2 * side * side + 50 {
        let (x, y) = (numbers.between(-half, half), numbers.between(-half, half));
        let h = level + numbers.between(-rough, rough);
        forces.extend(coils.iter().map(|c| force(x - c[0], y - c[1], h + 0.03)));
        heights.push(h);
        if k.is_multiple_of(7) {
            offset.push(numbers.between(-2e-3, 0.0));
        }
    }
    let upper: Vec<f64> = coils.iter().map(|_| numbers.between(0.5, 2.0)).collect();
    let pull = if k.is_multiple_of(3) { -0.5 } else { 0.0 };
    let case = Case {
        lower: upper.iter().map(|u| pull * u).collect(),
        total: k.is_multiple_of(5).then(|| 0.4 * upper.iter().sum::<f64>()),
        offset: (!offset.is_empty()).then_some(offset),
        ohm: vec![6.0; upper.len()],
        forces,
        heights,
        upper,
    };
    let at = numbers.between(0.05, 0.6);
    (case, at)
}

fn row(case: &Case, j: usize) -> &[f64] {
    &case.forces[j * case.coils()..(j + 1) * case.coils()]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn offset(case: &Case, j: usize) -> f64 {
    case.offset.as_ref().map_or(0.0, |offset| offset[j])
}

/// The most that currents within the limits make of `sum slope_i I_i`: all at their lower limits, and
/// what the sum leaves for those that gain most.
fn most(case: &Case, slope: &[f64]) -> f64 {
    let mut order: Vec<usize> = (0..slope.len()).collect();
    order.sort_by(|&a, &b| slope[b].total_cmp(&slope[a]));
    let mut left = case.total.unwrap_or(f64::INFINITY) - case.lower.iter().sum::<f64>();
    let mut value = dot(slope, &case.lower);
    for i in order.into_iter().filter(|&i| slope[i] > 0.0) {
        let more = (case.upper[i] - case.lower[i]).min(left);
        value += slope[i] * more;
        left -= more;
    }
    value
}

/// Requested minus reached force, weighted by the points' multipliers: sums of the requested forces
/// per unit of lambda, of the offsets, and of what currents make of it at most.
fn weighted(case: &Case, active: &[ActivePoint]) -> [f64; 4] {
    let mut slope = vec![0.0; case.coils()];
    let [mut height, mut pull, mut share] = [0.0; 3];
    for point in active {
        for (sum, force) in slope.iter_mut().zip(row(case, point.point)) {
            *sum += point.multiplier * force;
        }
        height += point.multiplier * case.heights[point.point];
        pull += point.multiplier * offset(case, point.point);
        share += point.multiplier.abs();
    }
    [height, pull, most(case, &slope), share]
}

fn top(case: &Case) -> f64 {
    case.heights
        .iter()
        .fold(0.0, |most: f64, h| most.max(h.abs()))
}

fn assert_within_limits(case: &Case, currents: &[f64], what: &str) {
    let sum: f64 = currents.iter().sum();
    assert!(
        case.total.is_none_or(|total| sum <= total * (1.0 + 1e-12)),
        "{what}"
    );
    for (i, &current) in currents.iter().enumerate() {
        assert!(
            case.lower[i] <= current && current <= case.upper[i],
            "{what}: {i}"
        );
    }
}

/// t* at `lambda`, with a proof that nothing within the limits is better.
fn proved(case: &Case, lambda: f64, what: &str) -> f64 {
    let point = least_worst_error(&case.problem(), lambda);
    assert_within_limits(case, &point.currents_a, what);
    let error = |j: usize| {
        lambda * case.heights[j] - offset(case, j) - dot(row(case, j), &point.currents_a)
    };
    let worst = (0..case.heights.len()).fold(0.0_f64, |most, j| most.max(error(j).abs()));
    let [height, pull, reached, share] = weighted(case, &point.active);
    let least = (lambda * height - pull - reached) / share;
    let allowed = 2e-12 * lambda * top(case);
    assert!(worst - least <= allowed, "{what}: {worst} {least}");
    assert!((worst - point.worst_error_n).abs() <= allowed, "{what}");
    worst
}

/// The largest lambda with no point too weak, with a proof.
fn proved_maxmin(case: &Case, what: &str) -> Option<f64> {
    let found = maxmin(&case.problem()).expect("well formed")?;
    assert_within_limits(case, &found.currents_a, what);
    let lambda = found.lambda_n_per_m;
    for j in 0..case.heights.len() {
        let given = offset(case, j) + dot(row(case, j), &found.currents_a);
        let lacks = lambda * case.heights[j] - given;
        assert!(
            lacks <= 2e-12 * lambda * top(case) + 1e-15,
            "{what}: {j} lacks {lacks}"
        );
    }
    let [height, pull, reached, _] = weighted(case, &found.active);
    let bound = (pull + reached) / height;
    assert!(
        bound - lambda <= 1e-10 * lambda + 1e-12,
        "{what}: {lambda} {bound}"
    );
    Some(lambda)
}

#[derive(serde::Deserialize)]
struct Oracle {
    cases: Vec<OracleCase>,
}

#[derive(serde::Deserialize)]
struct OracleCase {
    worst_error_n: f64,
    lambda_maxmin_n_per_m: Option<f64>,
}

/// 200 arrays, half of them regular, with drivers that reverse, sums, offsets and flat surfaces among
/// them, against HiGHS (`tests/oracles/worst_point.py`).
#[test]
fn two_hundred_arrays_match_another_solver() {
    let oracle: Oracle =
        serde_json::from_str(include_str!("../oracles/worst_point.json")).expect("the oracle file");
    assert_eq!(oracle.cases.len(), 200);
    for (k, other) in oracle.cases.iter().enumerate() {
        let (case, lambda) = array(k as u64);
        let what = format!("array {k}");
        let least = proved(&case, lambda, &what);
        // Its tolerances are 1e-10 of a millinewton a row, and a share of that a multiplier.
        let allowed = 1e-7 * lambda * top(&case);
        assert!(
            (least - other.worst_error_n).abs() <= allowed,
            "{what}: {least}"
        );
        let most = proved_maxmin(&case, &what);
        let off = match (most, other.lambda_maxmin_n_per_m) {
            (Some(a), Some(b)) => (a - b).abs(),
            (None, None) => 0.0,
            _ => f64::INFINITY,
        };
        assert!(
            off <= 1e-7,
            "{what}: {most:?} {:?}",
            other.lambda_maxmin_n_per_m
        );
    }
}

/// A square array under a plate over the whole of it, points in a square grid: every tie there is.
fn symmetric(side: usize, nodes: usize) -> Case {
    let pitch = 0.05;
    let middle = 0.5 * (side as f64 - 1.0);
    let half = middle * pitch;
    let at = |k: usize| (2.0 * k as f64 / (nodes as f64 - 1.0) - 1.0) * half;
    let mut forces = Vec::new();
    for j in 0..nodes * nodes {
        for i in 0..side * side {
            let x = ((i % side) as f64 - middle) * pitch;
            let y = ((i / side) as f64 - middle) * pitch;
            forces.push(force(at(j % nodes) - x, at(j / nodes) - y, 0.08));
        }
    }
    Case {
        forces,
        heights: vec![0.05; nodes * nodes],
        offset: None,
        lower: vec![0.0; side * side],
        upper: vec![2.0; side * side],
        total: Some(1000.0),
        ohm: vec![6.0; side * side],
    }
}

/// The constants lie where they are defined, by errors that are proved: t_0 is a line, t* is on it up
/// to the first and a just-noticeable difference above it at the second.
#[test]
fn constants_of_symmetric_arrays_do_not_need_the_path() {
    let mut left_out = 0;
    for (side, nodes) in [(7, 29), (8, 31), (10, 31), (15, 31)] {
        let case = symmetric(side, nodes);
        let settings = Settings::default();
        let solution = worst_point(&case.problem(), &settings).expect("well formed");
        assert!(solution.complete);
        left_out += usize::from(solution.path.is_none());
        let open = Case {
            upper: vec![2e3; side * side],
            total: None,
            ..case.clone()
        };
        let top = top(&case);
        let floor = solution.floor.unwrap();
        let what = format!("{side} x {side}");
        let free = proved(&open, 1.0, &what) / top;
        assert!((free - floor).abs() <= 1e-9, "{what}: {floor} {free}");
        let excess = |lambda: f64| proved(&case, lambda, &what) / (lambda * top) - floor;
        let linear = solution.lambda_linear_n_per_m.unwrap();
        assert!(excess(linear).abs() <= 1e-11, "{what}: {}", excess(linear));
        assert!(excess(linear * (1.0 + 1e-6)) > 1e-9, "{what}");
        let jnd = solution.lambda_jnd_n_per_m.unwrap();
        let off = excess(jnd) - settings.jnd_weight;
        assert!(off.abs() <= 1e-11, "{what}: {off}");
        assert!(excess(jnd * (1.0 + 1e-6)) > settings.jnd_weight, "{what}");
        proved_maxmin(&case, &what).unwrap();
    }
    assert!(left_out > 0, "no array was too much work");
}
