//! lambda_jnd over forces that change: its slope, and upper bounds over all forces between two that are known.
//!
//! A force constant lambda is above lambda_jnd where `e*(lambda) / lambda^2 > e_0 + w^2 <h^2>`, e_0 being
//! the least error without the drivers' size per unit of lambda^2 and `<>` the mean over the points. Of
//! any numbers z at the points and any currents y that e_0 allows,
//!
//! ```text
//! e*(lambda) / lambda^2 >= 2 <z h> - <z^2> - 2/lambda max_I <z G I>    (Fenchel; the maximum within the limits),
//! e_0 <= <(h - G y)^2>,
//! ```
//!
//! so that `lambda_jnd <= 2 max_I <z G I> / (2 <z h> - <z^2> - <(h - G y)^2> - w^2 <h^2>)` where the
//! denominator is above zero. With z and y of the solution this is lambda_jnd itself. Both bounds are
//! convex in G for fixed z and y: on a straight line between two matrices their ends decide. z and y are
//! the means of both ends' solutions, so what is lost falls with the length of the line, and with its square
//! where every coil is at a limit: the maximum over the currents of a coil between its limits has a kink. The
//! departure of the true forces from the line counts at its largest.
//!
//! The slope follows from the same currents: lambda_jnd is where `e*(lambda) = lambda^2 (e_0 + w^2 <h^2>)`, and of
//! either least error only the forces change to first order, not the currents (envelope theorem):
//!
//! ```text
//! d lambda = (<r dG I> - lambda^2 <s dG y>) / (<r h> - lambda (e_0 + w^2 <h^2>)),   r = lambda h - G I,  s = h - G y.
//! ```

use fluxform_numerics::real::Real;

use super::certificate::best_within_limits;
use super::followed::{Extent, solve_paths};
use super::problem::{ForceProblem, ProblemError, Settings};
use super::qr_reduction::{largest_entries, times_power};

/// The currents that decide lambda_jnd.
#[derive(Debug, Clone, PartialEq)]
pub struct JndCurrents {
    /// lambda_jnd, N/m.
    pub lambda_n_per_m: f64,
    /// The best currents there, A.
    pub limited_a: Vec<f64>,
    /// The best ones without the drivers' size, A for each N/m.
    pub unlimited_a_per_n_per_m: Vec<f64>,
}

/// The currents of a problem without offset; `None` where lambda_jnd is not above zero, or has no limit.
///
/// # Errors
/// As [`super::solve`].
pub fn jnd_currents(
    problem: &ForceProblem,
    jnd_weight: f64,
) -> Result<Option<JndCurrents>, ProblemError> {
    let settings = Settings {
        jnd_weight,
        ..Settings::default()
    };
    problem.validate(&settings)?;
    let largest = largest_entries(problem);
    problem.comparable(&largest)?;
    let (solved, _, _) = solve_paths(problem, &largest, Extent::of(&settings));
    let Some(scaled) = solved.comparison().jnd(jnd_weight) else {
        return Ok(None);
    };
    let reduced = &solved.reduced;
    let lambda_n_per_m = times_power(scaled.to_f64(), reduced.lambda_scale);
    if !solved.reliable() || problem.offset_n.is_some() || lambda_n_per_m <= 0.0 {
        return Ok(None);
    }
    let path = solved.path(problem);
    // Without offset e_0 has one piece.
    let rates = &solved.unlimited.pieces[0].x_rate;
    let unlimited = rates.iter().take(problem.coils()).enumerate();
    Ok(Some(JndCurrents {
        lambda_n_per_m,
        limited_a: path.currents_a(lambda_n_per_m),
        unlimited_a_per_n_per_m: unlimited
            .map(|(i, rate)| {
                let directions = problem.directions(i);
                let rate = times_power(
                    rate.to_f64(),
                    -reduced.lambda_scale - reduced.current_scale(i),
                );
                rate.clamp(
                    if directions.down {
                        f64::NEG_INFINITY
                    } else {
                        0.0
                    },
                    if directions.up { f64::INFINITY } else { 0.0 },
                )
            })
            .collect(),
    }))
}

impl JndCurrents {
    /// The change of lambda_jnd, N/m, to first order where the forces of `problem` change by `change_n_per_a`, [point,
    /// coil]; a derivative from either side where a breakpoint of the path lies there.
    #[must_use]
    pub fn slope_n_per_m(
        &self,
        problem: &ForceProblem,
        jnd_weight: f64,
        change_n_per_a: &[f64],
    ) -> f64 {
        let (lambda, coils) = (self.lambda_n_per_m, problem.coils());
        let times = |row: &[f64], currents: &[f64]| -> f64 {
            row.iter().zip(currents).map(|(g, i)| g * i).sum()
        };
        let rows = problem.forces_n_per_a.chunks_exact(coils);
        let changes = change_n_per_a.chunks_exact(coils);
        let (mut given, mut along) = (0.0, 0.0);
        for (j, ((row, change), h)) in rows.zip(changes).zip(problem.height_m).enumerate() {
            let weight = problem.weights.map_or(1.0, |weights| weights[j]);
            let limited = lambda * h - times(row, &self.limited_a);
            let unlimited = h - times(row, &self.unlimited_a_per_n_per_m);
            given += weight
                * (limited * times(change, &self.limited_a)
                    - lambda * lambda * unlimited * times(change, &self.unlimited_a_per_n_per_m));
            let allowed = unlimited * unlimited + jnd_weight * jnd_weight * h * h;
            along += weight * (limited * h - lambda * allowed);
        }
        given / along
    }
}

/// Two problems that differ in their forces alone, with the currents that decide either.
#[derive(Debug, Clone, Copy)]
pub struct Between<'a> {
    /// The problems.
    pub ends: [&'a ForceProblem<'a>; 2],
    /// Their currents.
    pub currents: [&'a JndCurrents; 2],
}

/// Sums over points in doubles, relative, many times over.
const ROUNDING: f64 = 1e-11;

impl Between<'_> {
    /// No forces that lie between both ends' but for `off_n_per_a`, [point, coil], have a larger
    /// lambda_jnd, N/m; infinite where nothing is proven.
    #[must_use]
    pub fn jnd_bound_n_per_m(&self, off_n_per_a: &[f64], jnd_weight: f64) -> f64 {
        let [first, _] = self.ends;
        let coils = first.coils();
        let row = |all: &[f64], j: usize| all[j * coils..(j + 1) * coils].to_vec();
        let (mut height, mut dual, mut total) = (0.0, 0.0, 0.0);
        // Of both ends: the error of y, and the gradient <z G>.
        let mut unlimited = [0.0; 2];
        let mut gradient = [vec![0.0; coils], vec![0.0; coils]];
        // The departure of the forces from the line adds to either.
        let (mut unlimited_off, mut gradient_off) = (0.0, vec![0.0; coils]);
        let y: Vec<f64> = (0..coils)
            .map(|i| self.mean(|one| one.unlimited_a_per_n_per_m[i]))
            .collect();
        for (j, h) in first.height_m.iter().enumerate() {
            let weight = first.weights.map_or(1.0, |weights| weights[j]);
            let forces = self.ends.map(|end| row(end.forces_n_per_a, j));
            let residual = |end: usize| {
                let one = self.currents[end];
                let given: f64 = (0..coils).map(|i| forces[end][i] * one.limited_a[i]).sum();
                h - given / one.lambda_n_per_m
            };
            let z = 0.5 * (residual(0) + residual(1));
            total += weight;
            height += weight * h * h;
            dual += weight * z * (2.0 * h - z);
            let off = row(off_n_per_a, j);
            for end in 0..2 {
                let given: f64 = forces[end].iter().zip(&y).map(|(g, y)| g * y).sum();
                unlimited[end] += weight * (h - given).powi(2);
                for (sum, g) in gradient[end].iter_mut().zip(&forces[end]) {
                    *sum += weight * z * g;
                }
            }
            let given: f64 = off.iter().zip(&y).map(|(g, y)| g * y.abs()).sum();
            unlimited_off += weight * given * given;
            for (sum, g) in gradient_off.iter_mut().zip(&off) {
                *sum += weight * z.abs() * g;
            }
        }
        let off: f64 = (0..coils).map(|i| first.reach_a(i) * gradient_off[i]).sum();
        let known = dual - jnd_weight * jnd_weight * height;
        let bound = |end: usize| {
            let best = best_within_limits(first, &gradient[end]);
            let most: f64 = best.iter().zip(&gradient[end]).map(|(i, g)| i * g).sum();
            let error = (unlimited[end].sqrt() + unlimited_off.sqrt()).powi(2);
            let room = known - error - ROUNDING * height;
            if room > 0.0 && total > 0.0 {
                2.0 * (most + off).max(0.0) / room * (1.0 + ROUNDING)
            } else {
                f64::INFINITY
            }
        };
        bound(0).max(bound(1))
    }

    fn mean(&self, of: impl Fn(&JndCurrents) -> f64) -> f64 {
        0.5 * self.currents.iter().map(|one| of(one)).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constant;

    const HEIGHTS: [f64; 6] = [0.3, 0.5, 0.45, 0.7, 0.35, 0.6];

    /// Three coils that move along six points.
    fn forces(place: f64) -> Vec<f64> {
        let at = |j: usize, i: usize| {
            let apart = 0.9 * j as f64 - place * (1.3 + 1.1 * i as f64);
            0.2 / (1.0 + apart * apart)
        };
        (0..6).flat_map(|j| (0..3).map(move |i| at(j, i))).collect()
    }

    fn problem(forces_n_per_a: &[f64]) -> ForceProblem<'_> {
        ForceProblem {
            forces_n_per_a,
            height_m: &HEIGHTS,
            offset_n: None,
            weights: Some(&[1.0, 0.7, 1.3, 1.0, 0.9, 1.1]),
            lower_a: &[0.0, -0.4, 0.0],
            upper_a: &[2.0, 1.5, 1.7],
            total_max_a: Some(3.9),
            resistance_ohm: &[6.0; 3],
        }
    }

    fn bound(places: [f64; 2], off: f64) -> f64 {
        let all = places.map(forces);
        let [a, b] = [problem(&all[0]), problem(&all[1])];
        let currents = [&a, &b].map(|one| jnd_currents(one, 0.07).unwrap().unwrap());
        let between = Between {
            ends: [&a, &b],
            currents: [&currents[0], &currents[1]],
        };
        between.jnd_bound_n_per_m(&[off; 18], 0.07)
    }

    fn lambda(place: f64) -> f64 {
        let forces = forces(place);
        constant(&problem(&forces), &Settings::default())
            .unwrap()
            .unwrap()
    }

    #[test]
    fn the_bound_is_the_constant_where_both_ends_are_the_same() {
        for place in [0.6, 0.8, 1.1] {
            let share = bound([place; 2], 0.0) / lambda(place);
            assert!((0.0..1e-9).contains(&(share - 1.0)), "{place}: {share}");
        }
    }

    /// Taylor: what the slope leaves falls with the square of the step.
    #[test]
    fn the_slope_leaves_a_remainder_of_second_order() {
        let (place, step) = (0.83, 1e-5);
        let [below, at, above] = [place - step, place, place + step].map(forces);
        let change: Vec<f64> = above
            .iter()
            .zip(&below)
            .map(|(above, below)| (above - below) / (2.0 * step))
            .collect();
        let problem = problem(&at);
        let currents = jnd_currents(&problem, 0.07).unwrap().unwrap();
        let slope = currents.slope_n_per_m(&problem, 0.07, &change);
        assert!(slope.abs() > 0.1 * currents.lambda_n_per_m, "{slope}");
        let left = |step: f64| lambda(place + step) - currents.lambda_n_per_m - step * slope;
        let lefts = [8e-3, 4e-3, 2e-3, 1e-3].map(left);
        for pair in lefts.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((1.9..2.1).contains(&order), "{lefts:?}");
        }
    }

    /// It encloses what lies between, and comes closer at least as fast as the ends do.
    #[test]
    fn the_bound_encloses_a_fine_scan_and_its_gap_falls_with_the_distance() {
        let gap = |half: f64| {
            let ends = [0.8 - half, 0.8 + half];
            // |d2/dx2 0.2/(1 + x^2)| <= 0.4, x = place times 3.5 at most.
            let off = 0.4 * 3.5 * 3.5 * (2.0 * half).powi(2) / 8.0;
            let most = (0..=200)
                .map(|k| lambda(ends[0] + half * f64::from(k) / 100.0))
                .fold(0.0, f64::max);
            let bound = bound(ends, off);
            assert!(bound >= most, "{half}: {bound} {most}");
            bound / most - 1.0
        };
        let gaps = [4e-3, 2e-3, 1e-3].map(gap);
        for pair in gaps.windows(2) {
            assert!((2.0..6.0).contains(&(pair[0] / pair[1])), "{gaps:?}");
        }
    }
}
