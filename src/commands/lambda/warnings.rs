//! Warnings about a force constant: why there is none, why it is zero, where it is not felt.

use super::PosedProblem;
use super::points::ForcePoints;
use crate::lambda::feedback::reachable;
use crate::lambda::worst::WorstSolution;
use crate::lambda::{ForceProblem, Solution, Status};

/// More deciding points than this are counted, not listed.
const LISTED: usize = 3;

/// Every warning about a solution, the points' own first.
pub(super) fn all(posed: &PosedProblem, solution: &Solution, worst: &WorstSolution) -> Vec<String> {
    let (points, problem) = (posed.points, &posed.problem);
    let mut warnings = points.warnings.clone();
    warnings.extend(of_status(solution.status).map(str::to_owned));
    let criterion = posed.options.settings.criterion;
    match &solution.chosen {
        None if solution.status == Status::Solved => {
            warnings.push(if criterion.is_least_mean_square() {
                format!(
                    "the limits never bind by the criterion {}: lambda is null; choose another \
                     with --criterion",
                    criterion.name()
                )
            } else {
                no_maxmin(points, problem)
            });
        }
        Some(chosen) if chosen.lambda_n_per_m == 0.0 => {
            warnings.push(if criterion.is_least_mean_square() {
                format!(
                    "lambda is 0 by the criterion {}: {}",
                    criterion.name(),
                    binds_at_zero(problem)
                )
            } else {
                maxmin_is_zero(points, problem, &solution.maxmin_points)
            });
        }
        Some(chosen) => warnings.extend(
            solution
                .constants
                .lambda_floor_n_per_m
                .filter(|floor| chosen.lambda_n_per_m < *floor)
                .map(|floor| {
                    format!(
                        "the lowest point is not felt: lambda {:.4} N/m gives it less than the \
                         0.8 mN a finger feels (lambda_floor {floor:.4} N/m)",
                        chosen.lambda_n_per_m
                    )
                }),
        ),
        None => {}
    }
    let chosen = solution.chosen.as_ref();
    warnings.extend(chosen.and_then(|chosen| unbounded_sum(problem, &chosen.currents_a)));
    if !worst.complete {
        warnings.push(
            "neither the worst-point path could be followed to its end nor its force constants be solved for without it: \
             they are not known; the least error at the chosen lambda is proven to within its gap"
                .to_owned(),
        );
    } else if worst.path.is_none() {
        warnings.push(
            "the worst-point path is left out: with so many coils, or so much symmetry, it turns \
             too often to be followed; its force constants and currents hold all the same, but for \
             lambda_linear where the error of the worst point hides it"
                .to_owned(),
        );
    }
    warnings
}

/// That the currents' sum is further below zero than its limit, which bounds it from above alone.
fn unbounded_sum(problem: &ForceProblem, currents_a: &[f64]) -> Option<String> {
    let total_a = problem.total_max_a?;
    let sum_a: f64 = currents_a.iter().sum();
    (sum_a < -total_a).then(|| {
        format!(
            "the currents' sum is {sum_a:.3} A: total_current_max_a bounds it from above alone, at {total_a} A; \
             where the supply cannot carry that below zero, lower current_min_a"
        )
    })
}

fn of_status(status: Status) -> Option<&'static str> {
    match status {
        Status::Solved => None,
        Status::NothingWanted => Some(
            "every height is zero: no force is requested, so no limit binds and lambda is null",
        ),
        Status::NothingRendered => Some(
            "no currents within the limits, alike at all these points, push the magnet up on average: lambda is null; \
             check magnet.polarity (\"repel\" for drivers that do not reverse), current_max_a, the \
             coils that are broken and the object's place",
        ),
        Status::Stalled => Some(
            "the path could not be followed to its end: numbers beyond its last breakpoint are \
             not the minimum; please report this design and shape",
        ),
    }
}

/// A point's number and place.
fn place(points: &ForcePoints, point: usize) -> String {
    let [x, y, z] = points.positions_m[point].map(|v| v * 1e3);
    format!("point {point} (x {x:.4}, y {y:.4}, z {z:.4} mm)")
}

/// The point at which the largest force within reach is least, and that force, N.
fn weakest(problem: &ForceProblem) -> Option<(usize, f64)> {
    let most = reachable(problem).ok()?.most_n.into_iter().enumerate();
    most.reduce(|a, b| if b.1 < a.1 { b } else { a })
}

/// Why maxmin is null although forces can be rendered.
fn no_maxmin(points: &ForcePoints, problem: &ForceProblem) -> String {
    if problem.height_m.iter().all(|&h| h <= 0.0) {
        return "no height is above zero, so no point can be too weak: lambda is null by the \
                criterion maxmin"
            .to_owned();
    }
    match weakest(problem) {
        Some((point, most_n)) if most_n < 0.0 => format!(
            "lambda is null by the criterion maxmin: at {} the pull without currents leaves the \
             magnet {:.4} mN short of no force, whatever the currents within the limits",
            place(points, point),
            -most_n * 1e3
        ),
        _ => "lambda is null by the criterion maxmin: no currents within the limits make up for \
              the pull without currents at all points at once"
            .to_owned(),
    }
}

/// Why no lambda above zero leaves every point strong enough.
fn maxmin_is_zero(points: &ForcePoints, problem: &ForceProblem, deciding: &[usize]) -> String {
    let height = |point: usize| problem.height_m[point];
    match weakest(problem) {
        Some((point, most_n)) if most_n <= 0.0 && height(point) > 0.0 => format!(
            "lambda is 0 by the criterion maxmin: no current within the limits pushes the magnet \
             up at {}; leave it out of the object, or bring coils nearer to it",
            place(points, point)
        ),
        _ => {
            let mut named: Vec<String> = deciding
                .iter()
                .take(LISTED)
                .map(|&point| place(points, point))
                .collect();
            if deciding.len() > LISTED {
                named.push(format!("{} more", deciding.len() - LISTED));
            }
            format!(
                "lambda is 0 by the criterion maxmin: no currents within the limits push the magnet \
                 up at every point at once; what helps one point pulls down at another ({}): \
                 drivers that reverse (current_min_a) or other points help",
                named.join(", ")
            )
        }
    }
}

/// The limit that binds before any force is rendered.
fn binds_at_zero(problem: &ForceProblem) -> String {
    if problem.total_max_a == Some(0.0) {
        return "the sum of the currents may not exceed 0 A; raise total_current_max_a".to_owned();
    }
    let dead: Vec<String> = (0..problem.coils())
        .filter(|&i| problem.upper_a[i] == 0.0 && problem.lower_a[i] == 0.0)
        .filter(|&i| {
            let mut rows = problem.forces_n_per_a.chunks_exact(problem.coils());
            rows.any(|row| row[i] != 0.0)
        })
        .map(|i| i.to_string())
        .collect();
    if !dead.is_empty() {
        let [limits, are, them] = match dead.len() {
            1 => ["limit of coil", "is", "it"],
            _ => ["limits of coils", "are", "them"],
        };
        return format!(
            "the current {limits} {} {are} 0 A; raise {them}, or leave coils that carry no current out of the \
             array (positions_mm); of a coil with a core `lambda --broken` keeps the core",
            dead.join(", ")
        );
    }
    if problem.offset_n.is_some() {
        return "the force without currents (magnet.passive_force) already asks for more current \
                than the limits give"
            .to_owned();
    }
    "a limit binds at the smallest force already".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each reason for a lambda of zero is the one that holds.
    #[test]
    fn a_lambda_of_zero_is_blamed_on_what_binds() {
        let problem = ForceProblem {
            forces_n_per_a: &[0.7, 0.2, 0.3, 1.1],
            height_m: &[0.05, 0.03],
            offset_n: None,
            weights: None,
            lower_a: &[0.0; 2],
            upper_a: &[1.3, 0.9],
            total_max_a: Some(0.0),
            resistance_ohm: &[6.0, 5.0],
        };
        assert!(binds_at_zero(&problem).contains("total_current_max_a"));
        let dead = ForceProblem {
            total_max_a: None,
            upper_a: &[1.3, 0.0],
            ..problem
        };
        assert!(binds_at_zero(&dead).contains("coil 1 is 0 A"));
        let pulled = ForceProblem {
            total_max_a: None,
            offset_n: Some(&[-3.0, -3.0]),
            ..problem
        };
        assert!(binds_at_zero(&pulled).contains("passive_force"));
    }
}
