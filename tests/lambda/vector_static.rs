//! Static currents for a force vector: least squares by another route, and the bounds of the longest error.

use fluxform_lambda::vector_feedback::VectorProblem;
use fluxform_lambda::vector_static::{VectorCurrents, sideways_weight, vector_static};
use fluxform_lambda::{ForceProblem, Settings};
use fluxform_numerics::random::Random;

const COILS: usize = 4;
const POINTS: usize = 23;

struct Sample {
    axes: [Vec<f64>; 3],
    heights: Vec<f64>,
    direction: Vec<[f64; 3]>,
    offset: Vec<f64>,
}

impl Sample {
    fn random(random: &mut Random) -> Self {
        let mut forces = |mean: f64| -> Vec<f64> {
            (0..COILS * POINTS)
                .map(|_| mean + random.between(-0.06, 0.06))
                .collect()
        };
        let axes = [forces(0.0), forces(0.0), forces(0.08)];
        let mut tilted = || {
            let [x, y] = [random.between(-0.5, 0.5), random.between(-0.5, 0.5)];
            [x, y, (1.0 - x * x - y * y).sqrt()]
        };
        let direction = (0..POINTS).map(|_| tilted()).collect();
        Self {
            axes,
            direction,
            heights: (0..POINTS).map(|_| random.between(0.03, 0.08)).collect(),
            offset: (0..POINTS).map(|_| random.between(-0.01, 0.0)).collect(),
        }
    }

    fn problem(&self, total: Option<f64>) -> VectorProblem<'_> {
        VectorProblem {
            upward: ForceProblem {
                forces_n_per_a: &self.axes[2],
                height_m: &self.heights,
                offset_n: Some(&self.offset),
                weights: None,
                lower_a: &[-0.5, 0.0, 0.0, -1.0],
                upper_a: &[1.3, 0.7, 1.7, 1.1],
                total_max_a: total,
                resistance_ohm: &[6.0, 5.0, 7.0, 6.5],
            },
            sides_n_per_a: [&self.axes[0], &self.axes[1]],
            direction: &self.direction,
        }
    }

    /// Weighted errors of all points.
    fn errors(&self, weight: f64, lambda: f64, currents: &[f64]) -> Vec<f64> {
        let of = |point: usize| {
            let part = |axis: usize| {
                let row = &self.axes[axis][point * COILS..(point + 1) * COILS];
                let given: f64 = row.iter().zip(currents).map(|(g, i)| g * i).sum();
                let pull = if axis == 2 { self.offset[point] } else { 0.0 };
                let expected = lambda * self.heights[point] * self.direction[point][axis];
                let scale = if axis == 2 { 1.0 } else { weight };
                scale * (given + pull - expected)
            };
            (0..3).map(|axis| part(axis).powi(2)).sum::<f64>().sqrt()
        };
        (0..POINTS).map(of).collect()
    }
}

fn mean_square(errors: &[f64]) -> f64 {
    errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64
}

/// Nothing but the upward component entered the static currents.
#[test]
fn no_other_currents_within_the_limits_err_less() {
    let mut random = Random::new(33);
    for case in 0..30 {
        let sample = Sample::random(&mut random);
        let total = (case % 2 == 0).then_some(2.1);
        // Below 4 degrees sideways errors count more than upward ones: angles below that were all the same.
        let (degrees, expected) = [(25.0, 0.15), (2.0, 2.0)][case / 2 % 2];
        let weight = sideways_weight(0.07, degrees);
        assert!((weight / expected - 1.0).abs() < 5e-3, "{weight}");
        let problem = sample.problem(total);
        let found = vector_static(&problem, weight, &Settings::default(), Some(1.1)).unwrap();
        let limits = problem.upward;
        let of_all = [found.at_chosen.as_ref(), found.own.as_ref()];
        for of in of_all.into_iter().flatten() {
            let VectorCurrents {
                lambda_n_per_m: lambda,
                currents_a,
                ..
            } = of;
            let own = mean_square(&sample.errors(weight, *lambda, currents_a));
            assert!(
                (own.sqrt() / of.weighted_rms_error_n - 1.0).abs() < 1e-9,
                "case {case}"
            );
            let longest = |errors: Vec<f64>| errors.into_iter().fold(0.0, f64::max);
            let worst = longest(sample.errors(weight, *lambda, &of.worst.currents_a));
            assert!(
                (worst / of.worst.worst_error_n - 1.0).abs() < 1e-9,
                "case {case}"
            );
            let (low, high) = (of.worst.at_least_n, of.worst.worst_error_n);
            assert!(
                low <= high * (1.0 + 1e-9) && high <= 1.05 * low,
                "case {case}: {low} {high}"
            );
            for _ in 0..2000 {
                let near = random.unit() < 0.5;
                let mut other: Vec<f64> = (0..COILS)
                    .map(|i| {
                        let (low, high) = (limits.lower_a[i], limits.upper_a[i]);
                        let anywhere = random.between(low, high);
                        if near {
                            (of.worst.currents_a[i] + 0.02 * anywhere).clamp(low, high)
                        } else {
                            anywhere
                        }
                    })
                    .collect();
                let sum: f64 = other.iter().sum();
                if let Some(total) = total.filter(|total| sum > *total) {
                    other
                        .iter_mut()
                        .for_each(|i| *i = i.min(0.0) + i.max(0.0) * total / (sum + 2.0));
                }
                if total.is_some_and(|total| other.iter().sum::<f64>() > total) {
                    continue;
                }
                let errors = sample.errors(weight, *lambda, &other);
                assert!(mean_square(&errors) >= own * (1.0 - 1e-9), "case {case}");
                assert!(longest(errors) >= low * (1.0 - 1e-9), "case {case}");
            }
        }
    }
}

#[test]
fn of_upward_requests_alone_the_weight_zero_is_the_upward_problem() {
    let sample = Sample::random(&mut Random::new(5));
    let problem = sample.problem(None);
    let straight = vec![[0.0, 0.0, 1.0]; POINTS];
    let upright = VectorProblem {
        direction: &straight,
        ..problem
    };
    let found = vector_static(&upright, 1e-9, &Settings::default(), None).unwrap();
    let upward = fluxform_lambda::solve(&problem.upward, &Settings::default()).unwrap();
    let pair = (
        found.constants.lambda_linear_n_per_m,
        upward.constants.lambda_linear_n_per_m,
    );
    let (Some(a), Some(b)) = pair else {
        panic!("{pair:?}")
    };
    assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
    assert_eq!(found.constants.lambda_maxmin_n_per_m, None);
}
