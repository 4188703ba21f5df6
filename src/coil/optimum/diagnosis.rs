//! Why there is no coil, and which limit is nearest to blame.

use super::domain::Domain;
use super::local_searches::{self, Settings, Solved};
use super::model::Window;
use super::outcome::{OptimumStatus, Violation};
use super::problem::{LimitName, Problem, Regime};
use super::sqp::{FEASIBLE, Local, Point, Smooth};
use super::starts;
use fluxform_base::progress::{Interrupted, Progress};

/// The sum of the squared violations of all limits that can be blamed, geometry held.
struct Violated<'a>(&'a Problem<'a>);

impl Violated<'_> {
    fn blamed(&self, row: usize) -> bool {
        !self.0.bounds[row].name.is_geometry()
    }
}

impl Smooth for Violated<'_> {
    fn at(&self, x: [f64; 3]) -> Option<Point> {
        let mut point = self.0.at(x)?;
        point.objective = 0.0;
        point.slope = [0.0; 3];
        for row in 0..point.rows.len() {
            if !self.blamed(row) {
                continue;
            }
            let over = point.rows[row].max(0.0);
            point.objective += 0.5 * over * over;
            for i in 0..3 {
                point.slope[i] += over * point.normals[row][i];
            }
            point.rows[row] = -1.0;
            point.normals[row] = [0.0; 3];
        }
        Some(point)
    }

    fn is_equality(&self, row: usize) -> bool {
        self.0.is_equality(row)
    }
}

/// The status of problems none of which has a coil.
///
/// # Errors
/// Interruption.
pub(super) fn why_none(
    problems: &[Solved<'_>],
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<OptimumStatus, Interrupted> {
    let mut least: Option<(f64, Window, Vec<Violation>)> = None;
    for solved in problems.iter().filter(|s| s.contradiction.is_none()) {
        let problem = &solved.problem;
        let domain = Domain::of(problem);
        let scale_m = problem.model.length_scale_m();
        let mut points: Vec<[f64; 3]> = (0..settings.starts.max(1))
            .map(|index| starts::start(&domain, scale_m, settings.seed, index))
            .collect();
        points.push(Problem::coordinates(&Window {
            inner_radius_m: domain.inner_m[0],
            depth_m: domain.depth_min_m,
            length_m: domain.length_m[0],
        }));
        let ends = match problem.model.draft() {
            Some(draft) => {
                let draft = problem.with_model(&*draft);
                let ends = local_searches::locals(&Violated(&draft), points, 0, progress)?;
                // Violations are sums of squares, whose errors no model states.
                let starts = local_searches::promising(&Violated(&draft), |_| f64::INFINITY, ends);
                local_searches::locals(&Violated(problem), starts, 0, progress)?
            }
            None => local_searches::locals(&Violated(problem), points, 0, progress)?,
        };
        for local in ends {
            if local.violation(&Violated(problem)) > 1e3 * FEASIBLE {
                continue;
            }
            if least
                .as_ref()
                .is_some_and(|(sum, ..)| *sum <= local.point.objective)
            {
                continue;
            }
            let window = Problem::window(local.x);
            let violations = violations(problem, window);
            least = Some((local.point.objective, window, violations));
        }
    }
    if let Some((_, window, violations)) = least {
        return Ok(OptimumStatus::Infeasible {
            violations,
            least: window,
        });
    }
    // The driver's side is the plainer story.
    let reported = problems
        .iter()
        .find(|s| s.contradiction.is_some() && s.problem.regime == Regime::Driver)
        .or(problems.iter().find(|s| s.contradiction.is_some()));
    Ok(match reported.and_then(|s| s.contradiction.clone()) {
        Some(contradiction) => OptimumStatus::Contradictory(contradiction),
        None => OptimumStatus::Infeasible {
            violations: Vec::new(),
            least: Window {
                inner_radius_m: 0.0,
                depth_m: 0.0,
                length_m: 0.0,
            },
        },
    })
}

/// The sum of the squared violations of a window's limits; infinite where its geometry or a given size is
/// impossible, or the model fails.
pub(super) fn miss(problem: &Problem<'_>, window: Window) -> f64 {
    let Some(point) = Violated(problem).at(Problem::coordinates(&window)) else {
        return f64::INFINITY;
    };
    let held = point.rows.iter().zip(&problem.bounds).all(|(&row, bound)| {
        let over = if bound.name.is_equality() {
            row.abs()
        } else {
            row
        };
        over <= 1e3 * FEASIBLE
    });
    if held { point.objective } else { f64::INFINITY }
}

/// Limits that a window breaks, worst first.
pub(super) fn violations(problem: &Problem<'_>, window: Window) -> Vec<Violation> {
    let Some(rated) = problem.rate(window) else {
        return Vec::new();
    };
    let point = problem.scaled(&rated);
    let mut broken: Vec<Violation> = problem
        .bounds
        .iter()
        .zip(&rated.values)
        .zip(&point.rows)
        .filter(|((bound, _), row)| {
            let given = bound.name.is_equality() && row.abs() > FEASIBLE;
            given || (**row > FEASIBLE && !bound.name.is_geometry())
        })
        .map(|((bound, value), &row)| Violation {
            name: bound.name,
            value: value.value,
            limit: bound.limit,
            excess: row.exp_m1(),
        })
        .collect();
    broken.sort_by(|a, b| b.excess.total_cmp(&a.excess));
    broken
}

/// The window of a local optimum with the active sizes set to their limits exactly and the last
/// rounding taken off the length.
pub(super) fn snapped(problem: &Problem<'_>, local: &Local) -> Window {
    let mut window = Problem::window(local.x);
    let active = |name: LimitName| {
        let row = problem.bounds.iter().position(|bound| bound.name == name)?;
        (local.multipliers[row] != 0.0 || name.is_equality()).then(|| problem.bounds[row].limit)
    };
    let outer_m = window.outer_radius_m();
    if let Some(inner_m) = active(LimitName::FixedInner).or(active(LimitName::InnerDiameter)) {
        window.inner_radius_m = 0.5 * inner_m;
        window.depth_m = outer_m - window.inner_radius_m;
    }
    if let Some(outer_m) = active(LimitName::FixedOuter)
        .or(active(LimitName::OuterDiameter))
        .or(active(LimitName::Pitch))
    {
        window.depth_m = 0.5 * outer_m - window.inner_radius_m;
    }
    if let Some(length_m) = active(LimitName::FixedLength).or(active(LimitName::Length)) {
        window.length_m = length_m;
    } else if problem.regime == Regime::Driver
        && let Some(rated) = problem.rate(window)
    {
        let over = problem
            .scaled(&rated)
            .rows
            .iter()
            .zip(&problem.bounds)
            .filter(|(_, bound)| !bound.name.is_geometry())
            .fold(0.0_f64, |most, (&row, _)| most.max(row));
        // Resistance and its like are proportional to the length, L/R grows more slowly.
        if over < 1e-6 {
            window.length_m *= 1.0 - 2.0 * over;
        }
    }
    window
}
