//! Errors at given currents, from the points themselves, and a proof of their quality.

use rayon::prelude::*;

use fluxform_numerics::real::Real;

use super::problem::ForceProblem;

/// Rows summed together: fixed, so that sums do not depend on the number of threads.
const CHUNK_POINTS: usize = 4096;

/// Quality of the forces at given currents.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Check {
    /// Mean square of requested minus given force, N^2.
    pub mean_square_n2: f64,
    /// Largest absolute difference, N.
    pub worst_n: f64,
    /// Upper bound of the mean square's distance from its minimum, N^2.
    pub gap_n2: f64,
}

/// Evaluates currents at `lambda` over all points, in the precision `T`.
pub(super) fn check<T: Real>(problem: &ForceProblem, lambda: f64, currents_a: &[f64]) -> Check {
    let coils = problem.coils();
    let heaviest = T::of(problem.heaviest());
    let currents: Vec<T> = currents_a.iter().map(|&v| T::of(v)).collect();
    let parts: Vec<(T, f64, Vec<T>)> = problem
        .height_m
        .par_chunks(CHUNK_POINTS)
        .enumerate()
        .map(|(chunk, heights)| {
            let first = chunk * CHUNK_POINTS;
            let rows = problem.forces_n_per_a[first * coils..].chunks_exact(coils);
            let (mut square, mut worst) = (T::ZERO, 0.0_f64);
            let mut gradient = vec![T::ZERO; coils];
            for (j, (&height, row)) in heights.iter().zip(rows).enumerate() {
                let mut residual = T::of(lambda) * T::of(height);
                if let Some(offset) = problem.offset_n {
                    residual -= T::of(offset[first + j]);
                }
                for (&force, &current) in row.iter().zip(&currents) {
                    residual -= T::of(force) * current;
                }
                // The weight counts in the sums, not in the error at the point.
                let weight = problem
                    .weights
                    .map_or(T::ONE, |w| T::of(w[first + j]) / heaviest);
                let weighted = weight * residual;
                square += weighted * residual;
                worst = worst.max(residual.abs().to_f64());
                for (sum, &force) in gradient.iter_mut().zip(row) {
                    *sum += T::of(force) * weighted;
                }
            }
            (square, worst, gradient)
        })
        .collect();
    let (mut square, mut worst) = (T::ZERO, 0.0_f64);
    let mut gradient = vec![T::ZERO; coils];
    for (part, most, sums) in parts {
        square += part;
        worst = worst.max(most);
        T::add_scaled(&mut gradient, T::ONE, &sums);
    }
    let points = match problem.weights {
        None => T::of(problem.points() as f64),
        Some(weights) => weights
            .iter()
            .fold(T::ZERO, |sum, &w| sum + T::of(w) / heaviest),
    };
    let gradient: Vec<f64> = gradient.iter().map(|&g| (g / points).to_f64()).collect();
    Check {
        mean_square_n2: (square / points).to_f64(),
        worst_n: worst,
        gap_n2: gap(problem, &gradient, currents_a),
    }
}

/// `2 max over z within the limits of gradient . (z - currents)`: the error cannot fall by
/// more, since it is convex.
fn gap(problem: &ForceProblem, gradient: &[f64], currents_a: &[f64]) -> f64 {
    let best = best_within_limits(problem, gradient);
    let gain: f64 = (0..best.len())
        .map(|i| gradient[i] * (best[i] - currents_a[i]))
        .sum();
    2.0 * gain.max(0.0)
}

/// The currents within the limits that maximise `gradient . z`, a fractional knapsack: from the
/// lower limits, the coil with the steepest gradient is raised first, until the sum is used up.
pub(super) fn best_within_limits(problem: &ForceProblem, gradient: &[f64]) -> Vec<f64> {
    let mut best = problem.lower_a.to_vec();
    let mut left = problem
        .total_max_a
        .map(|total| total - best.iter().sum::<f64>());
    let mut order: Vec<usize> = (0..gradient.len()).filter(|&i| gradient[i] > 0.0).collect();
    order.sort_by(|&a, &b| gradient[b].total_cmp(&gradient[a]));
    for i in order {
        let wish = problem.upper_a[i] - best[i];
        let step = left.map_or(wish, |left| wish.min(left));
        best[i] = if step == wish {
            problem.upper_a[i]
        } else {
            best[i] + step
        };
        left = left.map(|left| left - step);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_numerics::double_double::DoubleDouble;

    #[test]
    fn the_gap_bounds_the_error_of_any_currents() {
        // Two points, two coils; the minimum under the sum's limit lies on its edge.
        let problem = ForceProblem {
            forces_n_per_a: &[0.7, 0.2, 0.3, 1.1],
            height_m: &[1.3, 0.9],
            offset_n: None,
            weights: None,
            lower_a: &[-0.4, 0.0],
            upper_a: &[1.5, 2.0],
            total_max_a: Some(1.2),
            resistance_ohm: &[6.0, 6.0],
        };
        let error = |i: &[f64]| check::<f64>(&problem, 1.7, i).mean_square_n2;
        let mut least = f64::INFINITY;
        for k in 0..=1900 {
            for l in 0..=200 {
                let i = [-0.4 + 0.001 * f64::from(k), 0.01 * f64::from(l)];
                if i[0] + i[1] <= 1.2 {
                    least = least.min(error(&i));
                }
            }
        }
        for i in [[0.1, 0.3], [1.2, 0.0], [-0.4, 1.6], [0.62, 0.58]] {
            let found = check::<f64>(&problem, 1.7, &i);
            assert!(found.mean_square_n2 - least <= found.gap_n2 + 1e-12);
            let fine = check::<DoubleDouble>(&problem, 1.7, &i);
            assert!((fine.gap_n2 - found.gap_n2).abs() < 1e-14);
            assert!((fine.worst_n - found.worst_n).abs() < 1e-15);
        }
    }

    /// Whatever unit the weights have.
    #[test]
    fn weights_count_as_repeated_points_do() {
        let problem = |forces_n_per_a, height_m, weights| ForceProblem {
            forces_n_per_a,
            height_m,
            offset_n: None,
            weights,
            lower_a: &[-0.4, 0.0],
            upper_a: &[1.5, 2.0],
            total_max_a: Some(1.2),
            resistance_ohm: &[6.0, 6.0],
        };
        let repeated = [0.7, 0.2, 0.7, 0.2, 0.7, 0.2, 0.3, 1.1];
        let requested = problem(&repeated, &[1.3, 1.3, 1.3, 0.9], None);
        let requested = check::<f64>(&requested, 1.7, &[0.1, 0.3]);
        for weights in &[[0.3, 0.1], [3.0, 1.0], [3e9, 1e9]] {
            let found = problem(&repeated[4..], &[1.3, 0.9], Some(weights));
            let found = check::<f64>(&found, 1.7, &[0.1, 0.3]);
            let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-14;
            assert!(close(found.mean_square_n2, requested.mean_square_n2));
            assert!(
                close(found.gap_n2, requested.gap_n2),
                "{found:?} {requested:?}"
            );
            assert_eq!(found.worst_n, requested.worst_n);
        }
    }
}
