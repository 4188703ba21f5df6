//! The allocation against an exhaustive search over every coil's state.

use fluxform_lambda::{Allocation, Allocator, AllocatorError, Reach};

use fluxform_testing::Random;

/// One allocation problem.
#[derive(Debug, Clone)]
struct Problem {
    force_n_per_a: Vec<f64>,
    resistance_ohm: Vec<f64>,
    lower_a: Vec<f64>,
    upper_a: Vec<f64>,
    total_a: Option<f64>,
    wanted_n: f64,
}

/// Result of an exhaustive search.
struct Exhaustive {
    /// The largest force in the expected direction.
    most_n: f64,
    /// The least power that gives the requested force.
    power_w: Option<f64>,
}

const LOW: usize = 0;
const FREE: usize = 1;

impl Problem {
    fn coils(&self) -> usize {
        self.force_n_per_a.len()
    }

    fn solve(&self) -> (Vec<f64>, Allocation, f64) {
        let mut allocator = self.allocator();
        let mut currents = vec![f64::NAN; self.coils()];
        let found = allocator.allocate(&self.force_n_per_a, self.wanted_n, &mut currents);
        let certificate =
            allocator.certificate(&self.force_n_per_a, self.wanted_n, &currents, &found);
        (currents, found, certificate)
    }

    fn allocator(&self) -> Allocator {
        let total = self.total_a;
        Allocator::new(&self.resistance_ohm, &self.lower_a, &self.upper_a, total).unwrap()
    }

    /// sum |G_i| times the largest |I_i|: the size that forces are compared with.
    fn size_n(&self) -> f64 {
        (0..self.coils())
            .map(|i| self.force_n_per_a[i].abs() * self.upper_a[i].max(-self.lower_a[i]))
            .sum()
    }

    fn power_w(&self, currents: &[f64]) -> f64 {
        let terms = currents.iter().zip(&self.resistance_ohm);
        terms.map(|(i, r)| r * i * i).sum()
    }

    /// Force and power of currents within all limits up to rounding.
    fn judged(&self, currents: &[f64]) -> Option<(f64, f64)> {
        for (i, current) in currents.iter().enumerate() {
            let slack = 1e-12 * (self.upper_a[i] - self.lower_a[i]);
            if *current < self.lower_a[i] - slack || *current > self.upper_a[i] + slack {
                return None;
            }
        }
        let size: f64 = currents.iter().map(|c| c.abs()).sum();
        if self
            .total_a
            .is_some_and(|total| currents.iter().sum::<f64>() > total + 1e-12 * (size + total))
        {
            return None;
        }
        let terms = currents.iter().zip(&self.force_n_per_a);
        let force = terms.map(|(i, g)| i * g).sum();
        Some((force, self.power_w(currents)))
    }

    /// Tries all 3^n states: at the lower limit, free, at the upper one; the sum binding or not.
    fn exhaustive(&self) -> Exhaustive {
        let n = self.coils();
        let sign = if self.wanted_n < 0.0 { -1.0 } else { 1.0 };
        let mut most_n = f64::NEG_INFINITY;
        let mut power_w: Option<f64> = None;
        for code in 0..3usize.pow(n as u32) {
            let states: Vec<usize> = (0..n).map(|i| code / 3usize.pow(i as u32) % 3).collect();
            let free: Vec<usize> = (0..n).filter(|&i| states[i] == FREE).collect();
            let at_limits: Vec<f64> = (0..n)
                .map(|i| match states[i] {
                    FREE => 0.0,
                    LOW => self.lower_a[i],
                    _ => self.upper_a[i],
                })
                .collect();
            let sum: f64 = at_limits.iter().sum();
            let force: f64 = (0..n).map(|i| at_limits[i] * self.force_n_per_a[i]).sum();
            // The largest force is at a corner: at most one coil is free, by the sum.
            if free.len() <= 1 {
                let mut corner = at_limits.clone();
                if let (Some(&i), Some(total)) = (free.first(), self.total_a) {
                    corner[i] = total - sum;
                }
                if let Some((force, _)) = self.judged(&corner) {
                    most_n = most_n.max(sign * force);
                }
            }
            for sum_binds in [false, true] {
                let Some(currents) = self.stationary(&free, &at_limits, force, sum, sum_binds)
                else {
                    continue;
                };
                if let Some((force, power)) = self.judged(&currents) {
                    let terms = currents.iter().zip(&self.force_n_per_a);
                    let size: f64 = terms.map(|(i, g)| (i * g).abs()).sum();
                    if (force - self.wanted_n).abs() <= 1e-12 * (size + self.wanted_n.abs()) {
                        power_w = Some(power_w.map_or(power, |least| least.min(power)));
                    }
                }
            }
        }
        Exhaustive { most_n, power_w }
    }

    /// The free coils by the equations of the multipliers.
    fn stationary(
        &self,
        free: &[usize],
        at_limits: &[f64],
        force: f64,
        sum: f64,
        sum_binds: bool,
    ) -> Option<Vec<f64>> {
        let mut currents = at_limits.to_vec();
        let conductance = |i: usize| 1.0 / self.resistance_ohm[i];
        let g = &self.force_n_per_a;
        if !sum_binds {
            let square: f64 = free.iter().map(|&i| g[i] * g[i] * conductance(i)).sum();
            for &i in free.iter().filter(|_| square > 0.0) {
                currents[i] = (self.wanted_n - force) / square * g[i] * conductance(i);
            }
            return Some(currents);
        }
        let left = self.total_a? - sum;
        let weight: f64 = free.iter().map(|&i| conductance(i)).sum();
        if free.is_empty() {
            return None;
        }
        let mean = free.iter().map(|&i| g[i] * conductance(i)).sum::<f64>() / weight;
        let spread: f64 = free
            .iter()
            .map(|&i| (g[i] - mean).powi(2) * conductance(i))
            .sum();
        let mu = if spread > 1e-26 * weight * mean * mean {
            (self.wanted_n - force - mean * left) / spread
        } else {
            0.0
        };
        for &i in free {
            currents[i] = (mu * (g[i] - mean) + left / weight) * conductance(i);
        }
        Some(currents)
    }
}

/// Generic, tied, near-tied and badly scaled problems, with zeros and negative limits.
fn problem(random: &mut Random, kind: usize) -> Problem {
    let n = 1 + random.below(5);
    let decades = |random: &mut Random| 10f64.powf(6.0 * (random.unit() - 0.5));
    let mut problem = Problem {
        force_n_per_a: Vec::new(),
        resistance_ohm: Vec::new(),
        lower_a: Vec::new(),
        upper_a: Vec::new(),
        total_a: None,
        wanted_n: 0.0,
    };
    for _ in 0..n {
        let mut g = 2.0 * random.unit() - 0.6;
        let mut upper = 0.3 + 2.0 * random.unit();
        let reverses = random.unit() < 0.4;
        let mut lower = if reverses { -1.5 * random.unit() } else { 0.0 };
        let mut r = 3.0 + 4.0 * random.unit();
        match kind {
            1 => {
                (g, upper, r) = ((3.0 * g).round() / 3.0, 1.3, 6.0);
                lower = if reverses { -0.7 } else { 0.0 };
            }
            2 => {
                upper *= decades(random);
                lower *= decades(random);
            }
            3 => {
                g *= decades(random);
                r *= decades(random);
                upper *= decades(random);
            }
            4 => {
                if random.unit() < 0.3 {
                    upper = 0.0;
                }
                if random.unit() < 0.3 {
                    g = if random.unit() < 0.5 { 0.0 } else { 0.7 };
                }
            }
            5 => g = 0.7 * (1.0 + 1e-15 * (6.0 * random.unit()).round()),
            _ => {}
        }
        problem.force_n_per_a.push(g);
        problem.resistance_ohm.push(r);
        problem.lower_a.push(lower);
        problem.upper_a.push(upper);
    }
    if random.unit() < 0.7 {
        let all: f64 = problem.upper_a.iter().sum();
        let part = if random.unit() < 0.1 {
            0.0
        } else {
            random.unit()
        };
        problem.total_a = Some(all * part);
    }
    problem.wanted_n = if random.unit() < 0.2 { -1.0 } else { 1.0 };
    let most_n = problem.exhaustive().most_n.abs();
    problem.wanted_n *= most_n
        * match random.below(10) {
            0 => 1.0,
            1 => 1.0 - 1e-9 * random.unit(),
            2 => 0.0,
            _ => 1.3 * random.unit(),
        };
    problem
}

#[test]
fn exhaustive_search_over_all_states_finds_nothing_better() {
    let mut random = Random::new(3);
    let (mut reached, mut saturated, mut sums) = (0, 0, 0);
    let mut worst = 0.0_f64;
    for round in 0..12_000 {
        let problem = problem(&mut random, round % 6);
        let size = problem.size_n();
        // A force in the last digits of its terms means nothing.
        if problem.wanted_n != 0.0 && problem.wanted_n.abs() < 1e-9 * size {
            continue;
        }
        let exhaustive = problem.exhaustive();
        let (currents, found, certificate) = problem.solve();
        let context = || format!("{round}: {problem:?} {currents:?} {found:?}");
        worst = worst.max(certificate);
        assert!(certificate <= 1e-12, "{certificate:e} {}", context());
        assert!(problem.judged(&currents).is_some(), "{}", context());
        let expected = problem.wanted_n.abs();
        let sign = problem.wanted_n.signum();
        let want = expected.min(exhaustive.most_n.max(0.0)) * sign;
        let missing = (found.force_n - want).abs();
        assert!(missing <= 1e-12 * size, "{missing:e} {}", context());
        match found.reach {
            Reach::Reached => {
                reached += 1;
                assert!(
                    expected <= exhaustive.most_n.max(0.0) + 1e-12 * size,
                    "{}",
                    context()
                );
            }
            Reach::Saturated => {
                saturated += 1;
                assert!(
                    expected >= exhaustive.most_n - 1e-12 * size,
                    "{}",
                    context()
                );
            }
        }
        sums += usize::from(found.nu_v != 0.0);
        // Next to the largest force the search's own rounding decides its power.
        if let (Some(least), true) = (exhaustive.power_w, expected < 0.999_999 * exhaustive.most_n)
        {
            let power = problem.power_w(&currents);
            assert!(
                power <= least * (1.0 + 1e-8),
                "{power} {least} {}",
                context()
            );
        }
    }
    assert!(
        reached > 5_000 && saturated > 1_500 && sums > 300,
        "{reached} reached, {saturated} saturated, {sums} with a binding sum"
    );
    assert!(worst < 1e-13, "worst certificate {worst:e}");
}

/// Broke: with a lower limit of -1e30 A, 8 A flowed where the sum may be 5 A.
#[test]
fn extreme_limits_are_kept_to_the_last_ampere() {
    let mut random = Random::new(29);
    let ends = [0.0, 1e-30, 1e-9, 0.7, 2.0, 8.0, 1e9, 1e30];
    let (mut reached, mut saturated) = (0, 0);
    for round in 0..20_000 {
        let coils = 1 + random.below(5);
        let mut pick =
            |n: usize| -> Vec<f64> { (0..n).map(|_| ends[random.below(ends.len())]).collect() };
        let (upper, lower, total) = (pick(coils), pick(coils), pick(1)[0]);
        let mut between = |from: f64, to: f64| from + (to - from) * random.unit();
        let forces: Vec<f64> = (0..coils)
            .map(|_| {
                let force: f64 = between(-0.3, 1.0);
                // Some alike, some none.
                (8.0 * force).round() / 8.0
            })
            .collect();
        let problem = Problem {
            force_n_per_a: forces,
            resistance_ohm: (0..coils).map(|_| between(3.0, 9.0)).collect(),
            lower_a: lower.iter().map(|a| -a).collect(),
            upper_a: upper,
            total_a: (round % 4 > 0).then_some(total),
            wanted_n: between(-8.0, 20.0),
        };
        let (currents, found, certificate) = problem.solve();
        let context = || format!("{round}: {problem:?} {currents:?} {found:?}");
        assert!(certificate <= 1e-12, "{certificate:e} {}", context());
        let limits = problem.lower_a.iter().zip(&problem.upper_a);
        for (current, (lower, upper)) in currents.iter().zip(limits) {
            assert!(lower <= current && current <= upper, "{}", context());
        }
        let sum: f64 = currents.iter().sum();
        let size: f64 = currents.iter().map(|current| current.abs()).sum();
        if let Some(total) = problem.total_a {
            assert!(sum - total <= 1e-12 * (size + total), "{sum} {}", context());
        }
        match found.reach {
            Reach::Reached => {
                reached += 1;
                let terms = currents.iter().zip(&problem.force_n_per_a);
                let size: f64 = terms.map(|(i, g)| (i * g).abs()).sum();
                let missing = (found.force_n - problem.wanted_n).abs();
                let allowed = 1e-11 * (size + problem.wanted_n.abs());
                assert!(missing <= allowed, "{missing:e} {}", context());
            }
            Reach::Saturated => saturated += 1,
        }
    }
    assert!(
        reached > 3_000 && saturated > 3_000,
        "{reached} {saturated}"
    );
}

#[test]
fn other_currents_of_the_same_force_cost_more() {
    // Nine coils: any move that keeps the force and the limits raises the power.
    let mut random = Random::new(11);
    for round in 0..300 {
        let mut problem = Problem {
            force_n_per_a: (0..9).map(|_| 0.3 * random.unit() - 0.05).collect(),
            resistance_ohm: (0..9).map(|_| 5.0 + 2.0 * random.unit()).collect(),
            lower_a: vec![if round % 2 == 0 { 0.0 } else { -0.7 }; 9],
            upper_a: vec![1.3; 9],
            total_a: (round % 3 == 0).then_some(3.1),
            wanted_n: 0.4 * random.unit(),
        };
        let (mut currents, found, _) = problem.solve();
        if found.reach == Reach::Saturated {
            problem.wanted_n = 0.9 * found.force_n;
            currents = problem.solve().0;
        }
        let (force, power) = problem.judged(&currents).unwrap();
        assert!((force - problem.wanted_n).abs() < 1e-13);
        for _ in 0..200 {
            let (i, j) = (random.below(9), random.below(9));
            let g = &problem.force_n_per_a;
            if i == j || g[j] == 0.0 {
                continue;
            }
            let step = 1e-3 * (random.unit() - 0.5);
            let mut other = currents.clone();
            other[i] += step;
            other[j] -= step * g[i] / g[j];
            let within = (0..9).all(|k| (problem.lower_a[k]..=1.3).contains(&other[k]))
                && problem
                    .total_a
                    .is_none_or(|t| other.iter().sum::<f64>() <= t);
            if within {
                let more = problem.power_w(&other);
                assert!(more >= power - 1e-13, "{round}: {more} {power}");
            }
        }
    }
}

#[test]
fn the_answer_scales_with_units_and_turns_with_the_sign() {
    let base = Problem {
        force_n_per_a: vec![0.13, 0.07, -0.02, 0.21],
        resistance_ohm: vec![6.07, 5.3, 7.1, 6.6],
        lower_a: vec![0.0, -0.7, -0.3, 0.0],
        upper_a: vec![2.0, 1.3, 0.7, 1.1],
        total_a: Some(2.6),
        wanted_n: 0.43,
    };
    let (currents, found, _) = base.solve();
    assert!(found.nu_v != 0.0, "the sum binds");
    let mut turned = base.clone();
    turned.force_n_per_a.iter_mut().for_each(|g| *g *= -3.7e-5);
    turned.wanted_n *= -3.7e-5;
    for (a, b) in currents.iter().zip(turned.solve().0) {
        assert!((a - b).abs() < 1e-13, "{a} {b}");
    }
    let mut dearer = base.clone();
    dearer.resistance_ohm.iter_mut().for_each(|r| *r *= 1e4);
    for (a, b) in currents.iter().zip(dearer.solve().0) {
        assert!((a - b).abs() < 1e-13, "{a} {b}");
    }
    // Equal coils share alike; without a force nothing flows.
    let equal = Problem {
        force_n_per_a: vec![0.2; 4],
        resistance_ohm: vec![6.0; 4],
        lower_a: vec![0.0; 4],
        upper_a: vec![2.0; 4],
        total_a: Some(8.0),
        wanted_n: 0.52,
    };
    assert!(equal.solve().0.iter().all(|i| (i - 0.65).abs() < 1e-15));
    let none = Problem {
        force_n_per_a: vec![0.0; 4],
        ..equal
    };
    let (currents, found, certificate) = none.solve();
    assert_eq!((found.reach, found.force_n), (Reach::Saturated, 0.0));
    assert!(currents.iter().all(|i| *i == 0.0) && certificate == 0.0);
}

#[test]
fn a_force_that_is_no_number_is_not_reached() {
    let problem = Problem {
        force_n_per_a: vec![0.13, -0.02],
        resistance_ohm: vec![6.07, 7.1],
        lower_a: vec![-0.3; 2],
        upper_a: vec![2.0; 2],
        total_a: Some(2.6),
        wanted_n: f64::NAN,
    };
    let (currents, found, _) = problem.solve();
    assert_eq!((found.reach, currents), (Reach::Saturated, vec![0.0; 2]));
}

#[test]
fn limits_that_no_array_has_are_refused() {
    let refused = |r: &[f64], l: &[f64], u: &[f64], total| {
        Allocator::new(r, l, u, total).expect_err("outside the domain")
    };
    assert_eq!(refused(&[1.0], &[], &[1.0], None), AllocatorError::Lengths);
    let coil = AllocatorError::Coil { coil: 0 };
    for (r, l, u) in [
        (0.0, 0.0, 1.0),
        (-6.0, 0.0, 1.0),
        (f64::NAN, 0.0, 1.0),
        (6.0, 0.1, 1.0),
        (6.0, -1.0, -0.1),
        (6.0, 0.0, f64::INFINITY),
        (1e-310, 0.0, 1.0),
    ] {
        assert_eq!(refused(&[r], &[l], &[u], None), coil, "{r} {l} {u}");
    }
    for total in [-0.1, f64::NAN, f64::INFINITY] {
        let found = refused(&[6.0], &[0.0], &[1.0], Some(total));
        assert_eq!(found, AllocatorError::Total);
    }
}

#[test]
fn the_certificate_measures_every_fault() {
    let (force, ohm) = ([0.7, 1.3, -0.2], [6.0, 5.0, 7.0]);
    let (lower, upper) = ([0.0, 0.0, -0.4], [1.5, 0.8, 0.9]);
    for (total, expected) in [
        (None, 1.1),
        (Some(1.1), 1.2),
        (Some(1.1), -9.0),
        (Some(1.1), 9.0),
    ] {
        let mut allocator = Allocator::new(&ohm, &lower, &upper, total).unwrap();
        let mut currents = [0.0; 3];
        let found = allocator.allocate(&force, expected, &mut currents);
        let judged = |currents: &[f64], expected: f64, found: &Allocation| {
            allocator.certificate(&force, expected, currents, found)
        };
        assert!(judged(&currents, expected, &found) < 1e-14, "{expected}");
        // A current that is not the optimum's, to either side.
        for (i, step) in [(0, 0.01), (1, -0.02), (2, 0.03)] {
            let mut other = currents;
            other[i] += step;
            assert!(judged(&other, expected, &found) > 1e-3, "{expected}: {i}");
        }
        if found.reach == Reach::Reached {
            // The missing force over the sizes of its terms.
            let size: f64 = force
                .iter()
                .zip(&currents)
                .map(|(g, i)| (g * i).abs())
                .sum();
            let missing = judged(&currents, expected + 0.1, &found);
            let wanted_fault = 0.1 / (size + expected + 0.1);
            assert!((missing - wanted_fault).abs() < 1e-12, "{missing}");
            // Multipliers of another problem.
            for other in [
                Allocation {
                    mu: 1.1 * found.mu,
                    ..found
                },
                Allocation {
                    nu_v: found.nu_v - 0.5,
                    ..found
                },
            ] {
                assert!(judged(&currents, expected, &other) > 1e-3);
            }
        }
    }
    // 0.3 A above the sum's limit of 1.1 A, over the sizes of both and of the lower limits.
    let allocator = Allocator::new(&[6.0; 2], &[-0.2, 0.0], &[1.0; 2], Some(1.1)).unwrap();
    let claim = Allocation {
        reach: Reach::Reached,
        force_n: 1.4,
        mu: 12.0,
        center_n_per_a: 0.0,
        nu_v: -7.8,
    };
    let fault = allocator.certificate(&[1.0; 2], 1.4, &[0.7; 2], &claim);
    assert!((fault - 0.3 / (1.4 + 0.2 + 1.1)).abs() < 1e-12, "{fault}");
}
