//! Quality of worst-point currents, from the points themselves.

use rayon::prelude::*;

use super::path::ActivePoint;
use crate::certificate::best_within_limits;
use crate::problem::ForceProblem;
use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

/// Points looked at together; a maximum does not depend on it.
const CHUNK_POINTS: usize = 4096;

/// Largest error of given currents at any point, N.
pub(super) fn worst_error_n(problem: &ForceProblem, lambda: f64, currents_a: &[f64]) -> f64 {
    let coils = problem.coils();
    problem
        .height_m
        .par_chunks(CHUNK_POINTS)
        .enumerate()
        .map(|(chunk, heights)| {
            let first = chunk * CHUNK_POINTS;
            let rows = problem.forces_n_per_a[first * coils..].chunks_exact(coils);
            let errors = heights.iter().zip(rows).enumerate().map(|(j, (h, row))| {
                let offset = problem.offset_n.map_or(0.0, |offset| offset[first + j]);
                let pushed: f64 = row.iter().zip(currents_a).map(|(g, i)| g * i).sum();
                (lambda * h - offset - pushed).abs()
            });
            errors.fold(0.0, f64::max)
        })
        .reduce(|| 0.0, f64::max)
}

/// A force below which no currents within the limits bring the largest error at `lambda`, N: the
/// error's mean over the active points, weighted by their multipliers, is at most its maximum,
/// and its least value over the limits is a knapsack.
#[must_use]
pub fn lower_bound_n(problem: &ForceProblem, lambda: f64, active: &[ActivePoint]) -> f64 {
    let coils = problem.coils();
    let mut slope = vec![Num::ZERO; coils];
    let (mut requested, mut share) = (Num::ZERO, Num::ZERO);
    for active in active {
        let weight = Num::of(active.multiplier);
        let row = &problem.forces_n_per_a[active.point * coils..(active.point + 1) * coils];
        for (sum, &force) in slope.iter_mut().zip(row) {
            *sum += weight * Num::of(force);
        }
        let offset = problem.offset_n.map_or(0.0, |offset| offset[active.point]);
        requested +=
            weight * (Num::of(lambda) * Num::of(problem.height_m[active.point]) - Num::of(offset));
        share += weight.abs();
    }
    if share <= Num::ZERO {
        return 0.0;
    }
    let slope: Vec<f64> = slope.iter().map(|s| s.to_f64()).collect();
    let best = best_within_limits(problem, &slope);
    let pushed = slope
        .iter()
        .zip(&best)
        .fold(Num::ZERO, |sum, (&s, &i)| sum + Num::of(s) * Num::of(i));
    ((requested - pushed) / share).to_f64().max(0.0)
}
