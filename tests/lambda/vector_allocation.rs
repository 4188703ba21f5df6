//! The allocation of a force vector against an exhaustive search over every coil's state.

use fluxform_lambda::{Reach, VectorAllocation, VectorAllocator};
use nalgebra::{DMatrix, DVector};

use fluxform_testing::Random;

const SIDEWAYS: f64 = 0.3;

/// One allocation problem.
#[derive(Debug, Clone)]
struct Problem {
    force_n_per_a: Vec<[f64; 3]>,
    resistance_ohm: Vec<f64>,
    lower_a: Vec<f64>,
    upper_a: Vec<f64>,
    total_a: Option<f64>,
    requested_n: [f64; 3],
}

impl Problem {
    fn random(random: &mut Random) -> Self {
        let coils = 1 + (random.unit() * 5.0) as usize;
        let two_way = random.unit() < 0.5;
        let force_n_per_a: Vec<[f64; 3]> = (0..coils)
            .map(|_| std::array::from_fn(|_| 0.2 * (random.unit() - 0.4)))
            .collect();
        let upper_a: Vec<f64> = (0..coils).map(|_| 0.3 + 2.0 * random.unit()).collect();
        let lower_a = upper_a.iter().map(|u| if two_way { -u } else { 0.0 });
        let lower_a: Vec<f64> = lower_a.collect();
        let total_a = (random.unit() < 0.5).then(|| 0.2 + 2.0 * random.unit());
        // Half of the requests are within reach, or were without the sum's limit.
        let requested_n = if random.unit() < 0.5 {
            let mut force = [0.0; 3];
            for i in 0..coils {
                let current = lower_a[i] + random.unit() * (upper_a[i] - lower_a[i]);
                for k in 0..3 {
                    force[k] += force_n_per_a[i][k] * current;
                }
            }
            force
        } else {
            std::array::from_fn(|_| 0.8 * (random.unit() - 0.5))
        };
        Self {
            force_n_per_a,
            resistance_ohm: (0..coils).map(|_| 1.0 + 6.0 * random.unit()).collect(),
            lower_a,
            upper_a,
            total_a,
            requested_n,
        }
    }

    fn coils(&self) -> usize {
        self.force_n_per_a.len()
    }

    fn solve(&self) -> (Vec<f64>, VectorAllocation) {
        let (lower, upper) = (&self.lower_a, &self.upper_a);
        let resistance = &self.resistance_ohm;
        let mut allocator =
            VectorAllocator::new(resistance, lower, upper, self.total_a, SIDEWAYS).unwrap();
        let mut currents = vec![f64::NAN; self.coils()];
        let result = allocator.allocate(&self.force_n_per_a, self.requested_n, &mut currents);
        (currents, result)
    }

    fn power_w(&self, currents: &[f64]) -> f64 {
        let terms = currents.iter().zip(&self.resistance_ohm);
        terms.map(|(i, r)| r * i * i).sum()
    }

    /// |w (G I - f)|, N.
    fn missing_n(&self, currents: &[f64]) -> f64 {
        let missing = (0..3).map(|k| {
            let given = currents.iter().zip(&self.force_n_per_a);
            let given: f64 = given.map(|(i, g)| g[k] * i).sum();
            let weight = if k < 2 { SIDEWAYS } else { 1.0 };
            (weight * (given - self.requested_n[k])).powi(2)
        });
        missing.sum::<f64>().sqrt()
    }

    fn within_limits(&self, currents: &[f64], slack: f64) -> bool {
        let sum: f64 = currents.iter().sum();
        (0..self.coils()).all(|i| {
            currents[i] >= self.lower_a[i] - slack && currents[i] <= self.upper_a[i] + slack
        }) && self.total_a.is_none_or(|total| sum <= total + slack)
    }

    /// The least distance from the request and the least power at it, over all states of the coils
    /// and of the sum.
    fn exhaustive(&self) -> (f64, f64) {
        let coils = self.coils();
        let mut best = (f64::INFINITY, f64::INFINITY);
        for state in 0..3_usize.pow(coils as u32) {
            for binds in [false, true] {
                let Some(currents) = self.of_state(state, binds) else {
                    continue;
                };
                if !self.within_limits(&currents, 1e-9) {
                    continue;
                }
                let (missing, power) = (self.missing_n(&currents), self.power_w(&currents));
                let nearer = missing < best.0 - 1e-10;
                if nearer || (missing < best.0 + 1e-10 && power < best.1) {
                    best = (missing.min(best.0), power);
                }
            }
        }
        best
    }

    /// The currents nearest to the request, of least power among those, with every coil at a limit
    /// but the free ones.
    fn of_state(&self, state: usize, binds: bool) -> Option<Vec<f64>> {
        let mut currents = vec![0.0; self.coils()];
        let mut free = Vec::new();
        let mut rest = state;
        for (i, current) in currents.iter_mut().enumerate() {
            match rest % 3 {
                0 => *current = self.lower_a[i],
                1 => free.push(i),
                _ => *current = self.upper_a[i],
            }
            rest /= 3;
        }
        let total = self.total_a.filter(|_| binds);
        if free.is_empty() || (binds && total.is_none()) {
            return (!binds).then_some(currents);
        }
        // In x = sqrt(R) I the least power is the least norm. A sum that binds is met along the
        // null space of the ones.
        let root: Vec<f64> = free
            .iter()
            .map(|i| self.resistance_ohm[*i].sqrt())
            .collect();
        let n = free.len();
        let rows = DMatrix::from_fn(3, n, |k, a| {
            let weight = if k < 2 { SIDEWAYS } else { 1.0 };
            weight * self.force_n_per_a[free[a]][k] / root[a]
        });
        let missing = DVector::from_fn(3, |k, _| {
            let weight = if k < 2 { SIDEWAYS } else { 1.0 };
            let held: f64 = (0..self.coils())
                .map(|i| self.force_n_per_a[i][k] * currents[i])
                .sum();
            weight * (self.requested_n[k] - held)
        });
        let solution = match total {
            None => pseudo_inverse(&rows) * missing,
            Some(total) => {
                let ones = DVector::from_fn(n, |a, _| 1.0 / root[a]);
                let held: f64 = currents.iter().sum();
                let along = &ones * ((total - held) / ones.norm_squared());
                let across =
                    DMatrix::identity(n, n) - &ones * ones.transpose() / ones.norm_squared();
                let moved = &rows * &across;
                &along + &across * (pseudo_inverse(&moved) * (missing - &rows * &along))
            }
        };
        for (a, i) in free.iter().enumerate() {
            currents[*i] = solution[a] / root[a];
        }
        Some(currents)
    }
}

/// A^T (A A^T)^+ of a matrix with three rows.
fn pseudo_inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let product = matrix * matrix.transpose();
    let eigen = product.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|value| {
        if value > 1e-13 * largest {
            1.0 / value
        } else {
            0.0
        }
    });
    let vectors = &eigen.eigenvectors;
    matrix.transpose() * vectors * DMatrix::from_diagonal(&inverse) * vectors.transpose()
}

#[test]
fn currents_are_those_of_the_exhaustive_search() {
    let mut random = Random::new(5);
    let (mut reached, mut out_of_reach, mut unproven) = (0, 0, 0);
    for number in 0..2000 {
        let problem = Problem::random(&mut random);
        let (currents, result) = problem.solve();
        let (missing, power) = problem.exhaustive();
        assert!(
            problem.within_limits(&currents, 1e-9),
            "{number}: {problem:?} {currents:?}"
        );
        let own = problem.missing_n(&currents);
        assert!(
            (own - missing).abs() <= 1e-9,
            "{number}: missing {own} of {missing}; {problem:?}"
        );
        let own = problem.power_w(&currents);
        let close = (own - power).abs() <= 1e-7 * power.max(1e-6);
        assert!(
            close,
            "{number}: power {own} of {power}; {problem:?} {currents:?}"
        );
        match result.reach {
            Reach::Reached => reached += 1,
            Reach::Saturated => out_of_reach += 1,
        }
        unproven += usize::from(!result.proven);
    }
    assert!(
        reached > 300 && out_of_reach > 300,
        "{reached} {out_of_reach}"
    );
    assert_eq!(unproven, 0);
}

/// Broke: coils without force on drivers that reverse counted among the free ones, and what was nearest was not found.
#[test]
fn coils_without_force_leave_the_nearest_force_to_the_others() {
    let mut random = Random::new(23);
    let (mut out_of_reach, mut full) = (0, 0);
    for number in 0..1500 {
        let mut problem = Problem::random(&mut random);
        let idle = 1 + number % 3;
        for (k, limit) in [0.9, 0.4, 1.3].into_iter().take(idle).enumerate() {
            let at = k.min(problem.coils());
            problem.force_n_per_a.insert(at, [0.0; 3]);
            problem.resistance_ohm.insert(at, 5.0 + k as f64);
            problem.lower_a.insert(at, -limit);
            problem.upper_a.insert(at, 0.7);
        }
        if problem.coils() > 5 {
            continue;
        }
        let (currents, result) = problem.solve();
        let (missing, power) = problem.exhaustive();
        assert!(
            problem.within_limits(&currents, 1e-9),
            "{number}: {problem:?} {currents:?}"
        );
        assert!(result.proven, "{number}: {problem:?} {currents:?}");
        let own = problem.missing_n(&currents);
        assert!(
            (own - missing).abs() <= 1e-9,
            "{number}: missing {own} of {missing}; {problem:?}"
        );
        let own = problem.power_w(&currents);
        let close = (own - power).abs() <= 1e-7 * power.max(1e-6);
        assert!(
            close,
            "{number}: power {own} of {power}; {problem:?} {currents:?}"
        );
        out_of_reach += usize::from(result.reach == Reach::Saturated);
        let sum: f64 = currents.iter().sum();
        let binds = problem.total_a.is_some_and(|total| sum > total - 1e-9);
        full += usize::from(binds && result.reach == Reach::Saturated);
    }
    assert!(out_of_reach > 300 && full > 30, "{out_of_reach} {full}");
}

#[test]
fn a_force_far_beyond_reach_keeps_the_limits() {
    let mut random = Random::new(17);
    for _ in 0..3000 {
        let mut problem = Problem::random(&mut random);
        let coils = 2 + (random.unit() * 23.0) as usize;
        let force = |random: &mut Random| {
            std::array::from_fn(|_| (random.unit() - 0.5) * 10_f64.powf(-4.0 * random.unit()))
        };
        problem.force_n_per_a = (0..coils).map(|_| force(&mut random)).collect();
        problem.resistance_ohm = (0..coils).map(|_| 1.0 + 6.0 * random.unit()).collect();
        problem.upper_a = (0..coils).map(|_| 3.0 * random.unit()).collect();
        problem.lower_a = vec![0.0; coils];
        let most: f64 = problem.upper_a.iter().sum();
        problem.total_a = Some(most * random.unit());
        let times = 10_f64.powf(9.0 * random.unit());
        problem.requested_n = problem.requested_n.map(|f| f * times);
        let (currents, _) = problem.solve();
        assert!(
            problem.within_limits(&currents, 1e-9),
            "{} A of {:?} A for {:?}",
            currents.iter().sum::<f64>(),
            problem.total_a,
            problem.requested_n
        );
    }
}

/// An array of coils like dipoles on a square grid, the finger above it.
fn array(side: usize, position_m: [f64; 3]) -> Vec<[f64; 3]> {
    let pitch_m = 0.05;
    let half = 0.5 * pitch_m * (side as f64 - 1.0);
    let place = |i: usize| pitch_m * i as f64 - half;
    let coils = (0..side * side).map(|i| [place(i % side), place(i / side)]);
    coils
        .map(|[x, y]| {
            // The force between two dipoles along z at this offset, in units of its axial value at
            // 30 mm.
            let d = [position_m[0] - x, position_m[1] - y, position_m[2] + 0.02];
            let r2: f64 = d.iter().map(|v| v * v).sum();
            let cos2 = d[2] * d[2] / r2;
            let size = 0.1 * (0.05_f64.powi(2) / r2).powi(2) / 2.0;
            let r = r2.sqrt();
            let side = size * (5.0 * cos2 - 1.0);
            [
                side * d[0] / r,
                side * d[1] / r,
                size * (5.0 * cos2 - 3.0) * d[2] / r,
            ]
        })
        .collect()
}

fn allocator(coils: usize, lower_a: f64, total_a: Option<f64>) -> VectorAllocator {
    let (ohm, lower, upper) = (vec![6.0; coils], vec![lower_a; coils], vec![2.0; coils]);
    VectorAllocator::new(&ohm, &lower, &upper, total_a, SIDEWAYS).unwrap()
}

#[test]
fn mirrored_places_get_mirrored_currents() {
    let mut allocator = allocator(9, 0.0, None);
    let (mut here, mut there) = (vec![0.0; 9], vec![0.0; 9]);
    for k in 0..200 {
        let [x, y] = [0.0003 * f64::from(k), 0.011];
        let force = 0.002 * f64::from(k);
        let a = allocator.allocate(
            &array(3, [x, y, 0.03]),
            [0.3 * force, 0.0, force],
            &mut here,
        );
        let b = allocator.allocate(
            &array(3, [-x, y, 0.03]),
            [-0.3 * force, 0.0, force],
            &mut there,
        );
        assert_eq!(a.reach, b.reach);
        for row in 0..3 {
            for column in 0..3 {
                let pair = [here[3 * row + column], there[3 * row + 2 - column]];
                assert!((pair[0] - pair[1]).abs() < 1e-9, "{k}: {here:?} {there:?}");
            }
        }
    }
}

#[test]
fn forces_do_not_jump_along_a_path_nor_do_currents_within_reach() {
    // Through places within and out of reach: with an eighth of the step the largest change falls,
    // which a jump's would not; towards the end of reach currents grow like a square root. Out of
    // reach a weak coil may cross its whole range while the force hardly moves.
    let change = |steps: u32, total, lift_n| {
        let mut allocator = allocator(9, 0.0, total);
        let mut last: Option<(Vec<f64>, [f64; 3], Reach)> = None;
        let mut largest = [0.0_f64; 2];
        for k in 0..=steps {
            let t = f64::from(k) / f64::from(steps);
            let (s, c) = ((7.0 * t).sin(), (5.0 * t).cos());
            let at = [0.09 * (t - 0.5), 0.04 * s, 0.03 + 0.01 * c];
            let mut currents = vec![0.0; 9];
            let request = [0.02 * (9.0 * t).sin(), 0.0, 0.02 + lift_n * t];
            let result = allocator.allocate(&array(3, at), request, &mut currents);
            assert!(result.proven, "{t}");
            if let Some((before, force, reach)) = &last {
                let differences = before.iter().zip(&currents).map(|(a, b)| (a - b).abs());
                if *reach == Reach::Reached && result.reach == Reach::Reached {
                    largest[0] = differences.fold(largest[0], f64::max);
                }
                let differences = force
                    .iter()
                    .zip(&result.force_n)
                    .map(|(a, b)| (a - b).abs());
                largest[1] = differences.fold(largest[1], f64::max);
            }
            last = Some((currents, result.force_n, result.reach));
        }
        largest
    };
    for (total, lift_n) in [(None, 0.12), (Some(5.0), 0.12), (None, 0.01)] {
        let (coarse, fine) = (change(4000, total, lift_n), change(32_000, total, lift_n));
        for k in 0..2 {
            assert!(fine[k] < 0.4 * coarse[k], "{total:?}: {coarse:?} {fine:?}");
        }
    }
}

#[test]
fn large_and_stiff_arrays_are_proven() {
    let mut random = Random::new(11);
    let mut unproven = 0;
    for side in [5, 8, 12] {
        let coils = side * side;
        for k in 0..40 {
            let resistance = (0..coils).map(|_| 10f64.powf(4.0 * random.unit() - 2.0));
            let resistance: Vec<f64> = resistance.collect();
            let upper: Vec<f64> = (0..coils)
                .map(|_| 10f64.powf(3.0 * random.unit() - 2.0))
                .collect();
            let lower = vec![0.0; coils];
            let total = (k % 2 == 0).then(|| 0.2 * upper.iter().sum::<f64>());
            let mut allocator =
                VectorAllocator::new(&resistance, &lower, &upper, total, SIDEWAYS).unwrap();
            let at = [
                0.1 * (random.unit() - 0.5),
                0.1 * (random.unit() - 0.5),
                0.02,
            ];
            let mut currents = vec![0.0; coils];
            let force = 10f64.powf(3.0 * random.unit() - 3.0);
            let request = [0.3 * force, -0.2 * force, force];
            let result = allocator.allocate(&array(side, at), request, &mut currents);
            // The limits hold whether or not the optimum is proven.
            for (i, upper) in currents.iter().zip(&upper) {
                assert!(*i >= 0.0 && i <= upper, "{side} {k}: {result:?}");
            }
            unproven += usize::from(!result.proven);
        }
    }
    // Resistances over four decades and limits over three, a sum that binds, a force out of reach.
    assert!(unproven <= 2, "{unproven} of 120");
}

/// Broke: coils that are alike by symmetry share what the sum leaves in more than one way, and the nearest force was
/// not proven. The nearest is then that of the least power, which is alike for coils that are alike.
#[test]
fn coils_alike_by_symmetry_are_proven_out_of_reach() {
    let mut random = Random::new(29);
    let mut out_of_reach = 0;
    for number in 0..600 {
        let side = 2 + number % 4;
        let coils = side * side;
        let of = |random: &mut Random| 10f64.powf(2.0 * random.unit() - 1.0);
        let at = [
            0.0,
            0.025 * (number % 3) as f64,
            0.01 + 0.04 * random.unit(),
        ];
        let request =
            [0.0, of(&mut random) * (number % 2) as f64, of(&mut random)].map(|part| 0.3 * part);
        let (resistance, upper) = (vec![6.0; coils], vec![2.0; coils]);
        let lower = vec![-0.5 * (number % 5) as f64; coils];
        let total = Some(2.0 * coils as f64 * random.unit());
        let mut allocator =
            VectorAllocator::new(&resistance, &lower, &upper, total, SIDEWAYS).unwrap();
        let mut currents = vec![0.0; coils];
        let result = allocator.allocate(&array(side, at), request, &mut currents);
        let case = format!("{number} {at:?} {total:?} {request:?}: {result:?} {currents:?}");
        assert!(result.proven, "{case}");
        out_of_reach += usize::from(result.reach == Reach::Saturated);
        // Columns of the array left and right of the plane x = 0.
        for row in currents.chunks(side) {
            let back = row.iter().rev();
            assert!(
                row.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-8),
                "{case}"
            );
        }
    }
    assert!(out_of_reach > 100, "{out_of_reach}");
}

#[test]
#[ignore = "prints times"]
#[allow(clippy::disallowed_methods, clippy::print_stdout)]
fn time_of_a_step() {
    for side in [3, 8] {
        let coils = side * side;
        let mut allocator = allocator(coils, 0.0, None);
        let mut currents = vec![0.0; coils];
        let places: Vec<_> = (0..1000)
            .map(|k| array(side, [1e-5 * f64::from(k), 0.007, 0.03]))
            .collect();
        for force in [0.05, 0.3] {
            let start = std::time::Instant::now();
            for forces in &places {
                allocator.allocate(forces, [0.0, 0.0, force], &mut currents);
            }
            println!(
                "{coils} coils, {force} N: {:?} a step",
                start.elapsed() / 1000
            );
        }
    }
}
