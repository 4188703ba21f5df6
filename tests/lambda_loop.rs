//! The path of e*(lambda) against exhaustive search over all active sets, in double-double.

use fluxform::lambda::{ForceProblem, Settings, Solution, Status, solve};
use fluxform::numerics::double_double::DoubleDouble;
use fluxform::numerics::real::Real;

type D = DoubleDouble;

fn d(value: f64) -> D {
    D::exactly(value)
}

/// Deterministic generic numbers.
struct Numbers(u64);

impl Numbers {
    /// Uniform in (0, 1).
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 + 1e-17
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.unit().ln()).sqrt() * (std::f64::consts::TAU * self.unit()).cos()
    }
}

/// An owned problem.
#[derive(Debug, Clone)]
struct Case {
    forces: Vec<f64>,
    heights: Vec<f64>,
    offset: Option<Vec<f64>>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    total: Option<f64>,
    ohm: Vec<f64>,
}

impl Case {
    fn problem(&self) -> ForceProblem<'_> {
        ForceProblem {
            forces_n_per_a: &self.forces,
            height_m: &self.heights,
            offset_n: self.offset.as_deref(),
            lower_a: &self.lower,
            upper_a: &self.upper,
            total_max_a: self.total,
            resistance_ohm: &self.ohm,
        }
    }

    fn coils(&self) -> usize {
        self.upper.len()
    }

    fn solve(&self) -> Solution {
        solve(&self.problem(), &Settings::default()).expect("a well-formed problem")
    }

    /// Mean h^2.
    fn mean_square(&self) -> f64 {
        self.heights.iter().map(|h| h * h).sum::<f64>() / self.heights.len() as f64
    }

    /// Mean square error of given currents.
    fn error(&self, lambda: D, currents: &[D]) -> D {
        let m = self.coils();
        let mut sum = D::ZERO;
        for (j, &h) in self.heights.iter().enumerate() {
            let mut r = lambda * d(h) - d(self.offset.as_ref().map_or(0.0, |o| o[j]));
            for (i, &x) in currents.iter().enumerate() {
                r -= d(self.forces[j * m + i]) * x;
            }
            sum += r * r;
        }
        sum / d(self.heights.len() as f64)
    }
}

/// `G'G`, `G'h` and `G'offset` in double-double, formed once for all searches.
struct Search<'a> {
    case: &'a Case,
    gram: Vec<Vec<D>>,
    pull: Vec<D>,
    push: Vec<D>,
}

impl<'a> Search<'a> {
    fn new(case: &'a Case) -> Self {
        let m = case.coils();
        let column = |i: usize| -> Vec<D> {
            case.forces
                .iter()
                .skip(i)
                .step_by(m)
                .map(|&v| d(v))
                .collect()
        };
        let columns: Vec<Vec<D>> = (0..m).map(column).collect();
        let heights: Vec<D> = case.heights.iter().map(|&v| d(v)).collect();
        let offset: Vec<D> = (0..case.heights.len())
            .map(|j| d(case.offset.as_ref().map_or(0.0, |o| o[j])))
            .collect();
        Self {
            case,
            gram: columns
                .iter()
                .map(|a| columns.iter().map(|b| D::dot(a, b)).collect())
                .collect(),
            pull: columns.iter().map(|a| D::dot(a, &heights)).collect(),
            push: columns.iter().map(|a| D::dot(a, &offset)).collect(),
        }
    }

    /// The least error over every choice of coils at a limit or free and of the sum at its
    /// limit or not: the minimum is the best of those that keep within the limits.
    fn least_error(&self, lambda: f64, limited: bool) -> f64 {
        let m = self.case.coils();
        let mut best: Option<D> = None;
        for code in 0..3_usize.pow(m as u32) {
            let place: Vec<usize> = (0..m).map(|i| code / 3_usize.pow(i as u32) % 3).collect();
            if !limited && place.contains(&1) {
                continue;
            }
            for sum_is_met in [false, true] {
                if sum_is_met && (!limited || self.case.total.is_none()) {
                    continue;
                }
                let Some(x) = self.stationary(lambda, &place, sum_is_met) else {
                    continue;
                };
                if self.keeps_within(&x, limited) {
                    let e = self.case.error(d(lambda), &x);
                    if best.is_none_or(|b| e < b) {
                        best = Some(e);
                    }
                }
            }
        }
        best.expect("zero currents are always possible").nearest()
    }

    fn keeps_within(&self, x: &[D], limited: bool) -> bool {
        let slip = d(1e-24);
        let size = x
            .iter()
            .zip(&self.case.upper)
            .fold(D::ZERO, |s, (v, &u)| s + Real::abs(*v) + d(u));
        let within = (0..x.len()).all(|i| {
            let (low, high) = (d(self.case.lower[i]), d(self.case.upper[i]));
            x[i] >= low - slip * (size + Real::abs(low))
                && (!limited || x[i] <= high + slip * (size + high))
        });
        let sum = x.iter().fold(D::ZERO, |s, v| s + *v);
        let total = self.case.total.filter(|_| limited);
        within && total.is_none_or(|t| sum <= d(t) + slip * (size + d(t)))
    }

    /// Gaussian elimination on the normal equations of the free coils; `None` if singular.
    fn stationary(&self, lambda: f64, place: &[usize], sum_is_met: bool) -> Option<Vec<D>> {
        let m = place.len();
        let mut x: Vec<D> = (0..m)
            .map(|i| match place[i] {
                0 => d(self.case.lower[i]),
                1 => d(self.case.upper[i]),
                _ => D::ZERO,
            })
            .collect();
        let free: Vec<usize> = (0..m).filter(|&i| place[i] == 2).collect();
        let size = free.len() + usize::from(sum_is_met);
        let mut rows: Vec<Vec<D>> = Vec::new();
        for &i in &free {
            // Rows and columns scaled to a unit diagonal.
            let scale = |k: usize| Real::sqrt(self.gram[k][k]);
            if scale(i) <= D::ZERO {
                return None;
            }
            let mut row: Vec<D> = free
                .iter()
                .map(|&k| self.gram[i][k] / (scale(i) * scale(k)))
                .collect();
            let mut right = d(lambda) * self.pull[i] - self.push[i];
            for k in (0..m).filter(|k| !free.contains(k)) {
                right -= self.gram[i][k] * x[k];
            }
            if sum_is_met {
                row.push(D::ONE / scale(i));
            }
            row.push(right / scale(i));
            rows.push(row);
        }
        if sum_is_met {
            let mut row: Vec<D> = free
                .iter()
                .map(|&k| D::ONE / Real::sqrt(self.gram[k][k]))
                .collect();
            let left = x.iter().fold(d(self.case.total?), |s, &v| s - v);
            row.extend([D::ZERO, left]);
            rows.push(row);
        }
        let solution = eliminate(rows, size)?;
        for (k, &i) in free.iter().enumerate() {
            x[i] = solution[k] / Real::sqrt(self.gram[i][i]);
        }
        Some(x)
    }
}

fn eliminate(mut rows: Vec<Vec<D>>, size: usize) -> Option<Vec<D>> {
    for row in &mut rows {
        let most = row[..size]
            .iter()
            .fold(D::ZERO, |s, v| s.larger(Real::abs(*v)));
        if most <= D::ZERO {
            return None;
        }
        for v in row.iter_mut() {
            *v = *v / most;
        }
    }
    for k in 0..size {
        let pivot = (k..size).reduce(|a, b| {
            if Real::abs(rows[b][k]) > Real::abs(rows[a][k]) {
                b
            } else {
                a
            }
        })?;
        rows.swap(k, pivot);
        if Real::abs(rows[k][k]) < d(1e-25) {
            return None;
        }
        for i in k + 1..size {
            let factor = rows[i][k] / rows[k][k];
            for j in k..=size {
                let term = factor * rows[k][j];
                rows[i][j] -= term;
            }
        }
    }
    let mut x = vec![D::ZERO; size];
    for k in (0..size).rev() {
        let known = (k + 1..size).fold(rows[k][size], |s, j| s - rows[k][j] * x[j]);
        x[k] = known / rows[k][k];
    }
    Some(x)
}

/// Random problems with everything that goes wrong: ties, copies, zero columns, limits over
/// decades, limits of zero, a binding sum, currents below zero, few points.
fn small_case(seed: u64) -> Case {
    let mut n = Numbers(seed);
    let m = 1 + n.below(4);
    let points = 1 + n.below(7);
    let style = n.below(8);
    let mut forces: Vec<f64> = (0..points * m)
        .map(|_| match style {
            0 => n.normal(),
            // Few values: ties and exact dependences.
            1 => n.below(3) as f64 * 0.5,
            2 => n.below(5) as f64 - 2.0,
            _ => n.unit(),
        })
        .collect();
    let mut heights: Vec<f64> = (0..points)
        .map(|_| match style {
            1 | 3 => 0.05,
            2 => n.below(3) as f64 * 0.5,
            _ => n.between(0.02, 0.08),
        })
        .collect();
    if style == 4 && m > 1 {
        // A copy, or a nearly equal column.
        let shift = [0.0, 0.0, 1e-3, 1e-6, 1e-9][n.below(5)];
        for j in 0..points {
            forces[j * m + m - 1] = forces[j * m] + shift * n.normal();
        }
    }
    if style == 5 {
        let zero = n.below(m);
        for j in 0..points {
            forces[j * m + zero] = 0.0;
        }
    }
    if style == 6 {
        // A ring of coils over points that turn with it: all coils tie.
        let base: Vec<f64> = (0..m).map(|_| n.unit()).collect();
        forces = (0..m * m).map(|k| base[(k / m + k % m) % m]).collect();
        heights = vec![0.05; m];
    }
    let decades = [0.0, 0.0, 1.0, 6.0][n.below(4)];
    let signed = n.below(4) == 0;
    let equal = style == 6 || n.below(3) == 0;
    let first = 2.0 * 10_f64.powf(n.between(-decades, 0.0));
    let upper: Vec<f64> = (0..m)
        .map(|_| match (equal, n.below(12)) {
            (true, _) => first,
            (false, 0) => 0.0,
            _ => 2.0 * 10_f64.powf(n.between(-decades, 0.0)),
        })
        .collect();
    let lower = upper
        .iter()
        .map(|u| {
            if signed && n.below(4) > 0 {
                -u * n.unit()
            } else {
                0.0
            }
        })
        .collect();
    let all: f64 = upper.iter().sum();
    let total = match n.below(5) {
        0 | 1 => None,
        2 => Some(all),
        3 => Some(if n.below(6) == 0 { 0.0 } else { all * n.unit() }),
        _ => Some(all * 0.5),
    };
    Case {
        heights,
        offset: None,
        lower,
        upper,
        total,
        ohm: (0..m).map(|_| n.between(1.0, 9.0)).collect(),
        forces,
    }
}

/// Force constants that matter: around and between all breakpoints, and far out.
fn telling_lambdas(solution: &Solution) -> Vec<f64> {
    let turns: Vec<f64> = solution
        .path
        .breakpoints()
        .iter()
        .map(|b| b.lambda_n_per_m)
        .collect();
    let mut all = Vec::new();
    for pair in turns.windows(2) {
        all.extend([0.5 * (pair[0] + pair[1]), pair[1]]);
    }
    let last = turns[turns.len() - 1];
    all.extend([last * 1.3 + 0.7, last * 17.0 + 0.3]);
    all
}

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
    check_criteria(seed, &case, &search, &solution);
}

impl Search<'_> {
    fn keeps_within_doubles(&self, x: &[D]) -> bool {
        let within =
            (0..x.len()).all(|i| x[i] >= d(self.case.lower[i]) && x[i] <= d(self.case.upper[i]));
        let sum = x.iter().fold(0.0, |s, v| s + v.nearest());
        let size = x.iter().fold(0.0, |s, v| s + v.nearest().abs());
        within && self.case.total.is_none_or(|t| sum <= t + 2e-14 * size)
    }

    /// `(e* - e_0) / (lambda^2 mean(h^2))`.
    fn excess(&self, lambda: f64) -> f64 {
        let scale = lambda * lambda * self.case.mean_square();
        (self.least_error(lambda, true) - self.least_error(lambda, false)) / scale
    }
}

fn check_criteria(seed: u64, case: &Case, search: &Search, solution: &Solution) {
    let turns = telling_lambdas(solution);
    let far = turns[turns.len() - 1] * 1e3;
    if case.mean_square() == 0.0 {
        assert!(solution.lambda_jnd_n_per_m.is_none() && solution.lambda_linear_n_per_m.is_none());
        return;
    }
    match solution.lambda_linear_n_per_m {
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
    match solution.lambda_jnd_n_per_m {
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
    match solution.lambda_saturation_n_per_m {
        None => assert!(solution.lambda_linear_n_per_m.is_none(), "{seed}"),
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
    let mut bad = 0;
    for seed in 0..std::env::var("N").map_or(3000, |v| v.parse().unwrap()) {
        if std::panic::catch_unwind(|| check_small(seed)).is_err() {
            bad += 1;
        }
    }
    assert_eq!(bad, 0);
}
