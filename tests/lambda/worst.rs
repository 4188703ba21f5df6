//! The worst-point form against every vertex of small problems, and on degenerate ones.

use fluxform::lambda::worst::{WorstSolution, worst_point};
use fluxform::lambda::Settings;

use crate::case::{Case, Numbers, small_case};
use crate::vertices::Vertices;

fn solved(case: &Case) -> WorstSolution {
    worst_point(&case.problem(), &Settings::default()).expect("a well-formed problem")
}

fn top(case: &Case) -> f64 {
    case.heights.iter().fold(0.0, |most: f64, h| most.max(h.abs()))
}

/// Force constants at, between and beyond the turns.
fn telling(solution: &WorstSolution) -> Vec<f64> {
    let turns: Vec<f64> = solution.path.turns().iter().map(|t| t.lambda_n_per_m).collect();
    let mut all = vec![0.0];
    for pair in turns.windows(2) {
        all.extend([0.5 * (pair[0] + pair[1]), pair[1]]);
    }
    let last = turns[turns.len() - 1];
    all.extend([last * 1.3 + 0.7, last * 17.0 + 0.3]);
    all
}

fn assert_within_limits(case: &Case, currents: &[f64], what: &str) {
    for (i, &current) in currents.iter().enumerate() {
        let (low, high) = (case.lower[i], case.upper[i]);
        let grain = 4.0 * f64::EPSILON * (high - low);
        assert!((low - grain..=high + grain).contains(&current), "{what}: coil {i} {current}");
    }
    if let Some(total) = case.total {
        let sum: f64 = currents.iter().sum();
        let size: f64 = currents.iter().map(|v| v.abs()).sum();
        assert!(sum <= total + 1e-14 * size, "{what}: {sum} above {total}");
    }
}

/// Everything that holds at any force constant; the oracle where it is affordable.
fn check(case: &Case, what: &str) -> WorstSolution {
    let solution = solved(case);
    assert!(solution.complete, "{what}: stalled, {case:?}");
    let most_offset = case.offset.iter().flatten().fold(0.0_f64, |most, o| most.max(o.abs()));
    let vertices = (case.coils() < 4).then(|| Vertices::new(case, true));
    for lambda in telling(&solution) {
        let scale = lambda * top(case) + most_offset;
        let point = solution.at(&case.problem(), lambda);
        assert_within_limits(case, &point.currents_a, what);
        let told = solution.path.worst_error_n(lambda);
        let sum = |amperes: &dyn Fn(usize) -> f64| -> f64 {
            let column = |i: usize| case.forces.iter().skip(i).step_by(case.coils());
            let most = |i: usize| column(i).fold(0.0_f64, |m, g| m.max(g.abs()));
            (0..case.coils()).map(|i| most(i) * amperes(i)).sum()
        };
        let rounding = 1e-13 * scale + 1e-14 * sum(&|i| point.currents_a[i].abs()) + 1e-25;
        // Rounded multipliers leave forces times what the limits allow.
        let proof = rounding + 1e-15 * sum(&|i| case.upper[i] - case.lower[i]);
        assert!(
            (point.worst_error_n - told).abs() <= rounding,
            "{what} at {lambda}: currents give {:e}, path {told:e}; {case:?}", point.worst_error_n
        );
        assert!(point.gap_n <= proof, "{what} at {lambda}: gap {:e} of {proof:e}; {case:?}", point.gap_n);
        if let (Some(vertices), true) = (&vertices, scale > 0.0) {
            let exact = vertices.least(lambda, scale);
            assert!(
                (exact - told).abs() <= rounding,
                "{what} at {lambda}: {told:e} not {exact:e}; {case:?}"
            );
        }
    }
    solution
}

#[test]
fn small_problems_match_every_vertex() {
    for seed in 0..600 {
        check(&small_case(seed), &format!("{seed}"));
    }
}

#[test]
fn an_offset_is_part_of_it() {
    for seed in 0..300 {
        let mut case = small_case(seed);
        let mut n = Numbers(seed + 4711);
        let strength = [0.01, 0.3, 5.0][n.below(3)];
        case.offset = Some(case.heights.iter().map(|_| strength * n.normal()).collect());
        check(&case, &format!("offset {seed}"));
    }
}
