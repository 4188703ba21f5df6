//! Local optimisation: sequential quadratic programming in three variables, then Newton.
//!
//! argmin has no solver for nonlinear limits, and an augmented Lagrangian around its BFGS needs
//! hundreds of evaluations for six digits where the active set gives all of them in a dozen: with
//! three unknowns each step's quadratic programme is solved exactly. argmin does the searches in
//! one variable (`wound`, `near_optimal_bore`).

use nalgebra::{DMatrix, DVector};

use fluxform_numerics::least_squares;
use fluxform_numerics::small_quadratic::{Row, minimise};
use fluxform_numerics::vec3::dot;

/// A smooth problem's values and slopes at a point: minimise `objective` with `rows` <= 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// The objective.
    pub objective: f64,
    /// Its slope.
    pub slope: [f64; 3],
    /// Limits, met where not positive (zero for equalities).
    pub rows: Vec<f64>,
    /// Their slopes.
    pub normals: Vec<[f64; 3]>,
}

impl Point {
    /// Of an optimum that row `row` limits among the rows `active`, the least multiplier of that row: where rows depend
    /// on each other multipliers are many, and to move this row alone is worth the least. `None` where no rows balance
    /// the slope.
    #[must_use]
    pub fn least_multiplier(
        &self,
        row: usize,
        active: &[usize],
        problem: &dyn Smooth,
    ) -> Option<f64> {
        let slope = self.slope.map(|s| -s);
        let mut least: Option<f64> = None;
        // Of all sets of at most three rows, those that are independent and push the right way.
        for set in 1_u32..1 << active.len().min(MOST_ACTIVE) {
            let rows = active
                .iter()
                .enumerate()
                .filter(|(at, _)| set >> at & 1 == 1);
            let rows: Vec<usize> = rows.map(|(_, row)| *row).collect();
            let normals: Vec<Vec<f64>> =
                rows.iter().map(|row| self.normals[*row].to_vec()).collect();
            let found = least_squares::solve(&normals, &slope);
            let independent = found.rank == rows.len();
            let balances = found.removed >= (1.0 - BALANCED * BALANCED) * dot(slope, slope);
            let strongest = found
                .values
                .iter()
                .fold(0.0_f64, |most, v| most.max(v.abs()));
            let mut each = rows.iter().zip(&found.values);
            let push = each
                .all(|(row, value)| *value >= -BALANCED * strongest || problem.is_equality(*row));
            if independent && balances && push {
                let own = rows.iter().position(|other| *other == row);
                let own = own.map_or(0.0, |k| found.values[k].max(0.0));
                least = Some(least.map_or(own, |least| least.min(own)));
            }
        }
        least
    }
}

/// A smooth problem in three scaled variables of order one.
pub trait Smooth {
    /// The point at `x`; `None` outside the domain.
    fn at(&self, x: [f64; 3]) -> Option<Point>;
    /// Whether row `row` must vanish.
    fn is_equality(&self, row: usize) -> bool;
}

/// Where a local search ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Local {
    /// Where.
    pub x: [f64; 3],
    /// Values there.
    pub point: Point,
    /// One a row.
    pub multipliers: Vec<f64>,
    /// Evaluations it took.
    pub evaluations: usize,
}

/// Most iterations.
const ITERATIONS: usize = 80;
/// Longest step in any variable: a factor of e.
const LONGEST: f64 = 1.0;
/// A step shorter than this ends the search.
const SHORTEST: f64 = 1e-10;
/// Rows above this are not met.
pub(crate) const FEASIBLE: f64 = 1e-10;
/// Rows whose sets are tried for the least multipliers.
const MOST_ACTIVE: usize = 8;
/// How far a slope may be from the rows that balance it, relative.
const BALANCED: f64 = 1e-6;
/// A row this close to its limit is active.
pub(super) const ACTIVE: f64 = 1e-9;
/// Shares of a row's violation that a step is to remove, in turn.
const REMOVE: [f64; 4] = [1.0, 0.5, 0.1, 0.0];

impl Local {
    /// A point as it is; `None` outside the domain.
    pub(super) fn at(problem: &dyn Smooth, x: [f64; 3]) -> Option<Self> {
        let point = problem.at(x)?;
        Some(Self {
            x,
            multipliers: vec![0.0; point.rows.len()],
            point,
            evaluations: 1,
        })
    }

    /// The largest violation.
    #[must_use]
    pub fn violation(&self, problem: &dyn Smooth) -> f64 {
        violations(problem, &self.point).fold(0.0, f64::max)
    }
}

fn violations<'a>(problem: &'a dyn Smooth, point: &'a Point) -> impl Iterator<Item = f64> + 'a {
    point.rows.iter().enumerate().map(|(row, &value)| {
        if problem.is_equality(row) {
            value.abs()
        } else {
            value.max(0.0)
        }
    })
}

fn step(problem: &dyn Smooth, point: &Point, b: [[f64; 3]; 3]) -> Option<(Local, f64)> {
    for remove in REMOVE {
        let rows: Vec<Row> = point
            .rows
            .iter()
            .zip(&point.normals)
            .enumerate()
            .map(|(row, (&value, &normal))| {
                let equality = problem.is_equality(row);
                let kept = if equality || value > 0.0 {
                    (1.0 - remove) * value
                } else {
                    0.0
                };
                Row {
                    normal,
                    limit: kept - value,
                    equality,
                }
            })
            .collect();
        if let Some(minimum) = minimise(b, point.slope, &rows) {
            let local = Local {
                x: minimum.step,
                point: point.clone(),
                multipliers: minimum.multipliers,
                evaluations: 0,
            };
            return Some((local, remove));
        }
    }
    None
}

/// A local minimiser from `start`; the best point reached where it does not converge.
/// `None` where the start is outside the domain.
#[must_use]
pub fn solve(problem: &dyn Smooth, start: [f64; 3]) -> Option<Local> {
    let mut x = start;
    let mut point = problem.at(x)?;
    let mut evaluations = 1;
    let mut b = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut multipliers = vec![0.0; point.rows.len()];
    let mut weight = 1.0_f64;
    for _ in 0..ITERATIONS {
        fluxform_base::progress::poll();
        let Some((found, removed)) = step(problem, &point, b) else {
            break;
        };
        multipliers = found.multipliers;
        let length = found.x.iter().fold(0.0_f64, |s, v| s.max(v.abs()));
        let violated: f64 = violations(problem, &point).sum();
        if length < SHORTEST {
            break;
        }
        let direction = found.x.map(|v| v * (LONGEST / length).min(1.0));
        let shrink = (LONGEST / length).min(1.0);
        let strongest = multipliers.iter().fold(0.0_f64, |s, v| s.max(v.abs()));
        weight = weight.max(2.0 * strongest).min(1e8);
        let merit = |p: &Point| p.objective + weight * violations(problem, p).sum::<f64>();
        let here = merit(&point);
        let descent = dot(point.slope, direction) - weight * removed * shrink * violated;
        let mut share = 1.0;
        let mut next = None;
        while share > 1e-9 {
            let moved: [f64; 3] = std::array::from_fn(|i| x[i] + share * direction[i]);
            evaluations += 1;
            if let Some(trial) = problem.at(moved) {
                // Rounding may hide the descent close to the end.
                let rounding = 4.0 * f64::EPSILON * (1.0 + here.abs());
                if merit(&trial) <= here + 1e-4 * share * descent.min(0.0) + rounding {
                    next = Some((moved, trial));
                    break;
                }
            }
            share *= if share > 0.2 { 0.5 } else { 0.2 };
        }
        let Some((moved, trial)) = next else { break };
        let s: [f64; 3] = std::array::from_fn(|i| moved[i] - x[i]);
        let before = lagrangian_slope(&point, &multipliers);
        let after = lagrangian_slope(&trial, &multipliers);
        update(&mut b, s, std::array::from_fn(|i| after[i] - before[i]));
        x = moved;
        point = trial;
    }
    let mut local = Local {
        x,
        point,
        multipliers,
        evaluations,
    };
    polish(problem, &mut local);
    Some(local)
}

fn lagrangian_slope(point: &Point, multipliers: &[f64]) -> [f64; 3] {
    let mut slope = point.slope;
    for (normal, lambda) in point.normals.iter().zip(multipliers) {
        for (value, n) in slope.iter_mut().zip(normal) {
            *value += lambda * n;
        }
    }
    slope
}

/// Powell's damped update: B stays positive definite.
fn update(b: &mut [[f64; 3]; 3], s: [f64; 3], y: [f64; 3]) {
    let bs = b.map(|row| dot(row, s));
    let (sbs, sy) = (dot(s, bs), dot(s, y));
    if !(sbs > 0.0 && sbs.is_finite()) {
        return;
    }
    let theta = if sy >= 0.2 * sbs {
        1.0
    } else {
        0.8 * sbs / (sbs - sy)
    };
    let r: [f64; 3] = std::array::from_fn(|i| theta * y[i] + (1.0 - theta) * bs[i]);
    let sr = dot(s, r);
    if !(sr > 0.0 && sr.is_finite()) {
        return;
    }
    for i in 0..3 {
        for j in 0..3 {
            b[i][j] += r[i] * r[j] / sr - bs[i] * bs[j] / sbs;
        }
    }
}

/// Step of the central differences that make the Lagrangian's second derivatives.
const DIFFERENCE: f64 = 1e-4;

/// Central differences of the Lagrangian's slope at `x`; `None` where the problem ends.
fn second_derivatives(
    problem: &dyn Smooth,
    x: [f64; 3],
    multipliers: &[f64],
    evaluations: &mut usize,
) -> Option<[[f64; 3]; 3]> {
    let mut second = [[0.0; 3]; 3];
    for i in 0..3 {
        let slope_at = |side: f64| {
            let mut moved = x;
            moved[i] += side * DIFFERENCE;
            Some(lagrangian_slope(&problem.at(moved)?, multipliers))
        };
        *evaluations += 2;
        let (up, down) = (slope_at(1.0)?, slope_at(-1.0)?);
        for j in 0..3 {
            second[i][j] = (up[j] - down[j]) / (2.0 * DIFFERENCE);
        }
    }
    Some(second)
}

/// Newton's step in `x` and the new multipliers of the active rows, in this order; `None` if the
/// conditions are singular.
fn newton_step(second: &[[f64; 3]; 3], point: &Point, active: &[usize]) -> Option<DVector<f64>> {
    let size = 3 + active.len();
    let mut matrix = DMatrix::zeros(size, size);
    let mut right = DVector::zeros(size);
    for i in 0..3 {
        for j in 0..3 {
            matrix[(i, j)] = 0.5 * (second[i][j] + second[j][i]);
        }
        right[i] = -point.slope[i];
    }
    for (k, &row) in active.iter().enumerate() {
        for i in 0..3 {
            matrix[(3 + k, i)] = point.normals[row][i];
            matrix[(i, 3 + k)] = point.normals[row][i];
        }
        right[3 + k] = -point.rows[row];
    }
    matrix.lu().solve(&right)
}

/// Newton on the optimality conditions of the active rows; kept where it converges to a point
/// that meets every row.
fn polish(problem: &dyn Smooth, local: &mut Local) {
    let active: Vec<usize> = (0..local.multipliers.len())
        .filter(|&row| local.multipliers[row] != 0.0 || problem.is_equality(row))
        .collect();
    if active.len() > 3 {
        return;
    }
    let mut x = local.x;
    let mut point = local.point.clone();
    let mut multipliers = local.multipliers.clone();
    for _ in 0..4 {
        let Some(second) = second_derivatives(problem, x, &multipliers, &mut local.evaluations)
        else {
            return;
        };
        let Some(solution) = newton_step(&second, &point, &active) else {
            return;
        };
        let length = (0..3).fold(0.0_f64, |s, i| s.max(solution[i].abs()));
        if length.is_nan() || length >= 0.1 {
            return;
        }
        for (i, value) in x.iter_mut().enumerate() {
            *value += solution[i];
        }
        for (k, &row) in active.iter().enumerate() {
            multipliers[row] = solution[3 + k];
            if !problem.is_equality(row) && multipliers[row] < 0.0 {
                return;
            }
        }
        local.evaluations += 1;
        let Some(moved) = problem.at(x) else { return };
        point = moved;
        if length < 1e-13 {
            break;
        }
    }
    let before = local.violation(problem);
    let polished = Local {
        x,
        point,
        multipliers,
        evaluations: local.evaluations,
    };
    let allowed = before.max(FEASIBLE);
    // A saddle has a worse objective; what the limits' rounding is worth is no loss.
    let worth = 2.0 * allowed * (1.0 + polished.multipliers.iter().sum::<f64>().abs());
    if polished.violation(problem) <= allowed
        && polished.point.objective <= local.point.objective + worth
    {
        *local = polished;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// minimise x^2 + 1.3 y^2 + 0.7 z^2 + x y, with x y z >= 1.7 and x <= 0.9 in logarithms.
    struct Powers;

    impl Smooth for Powers {
        fn at(&self, p: [f64; 3]) -> Option<Point> {
            let [x, y, z] = p.map(f64::exp);
            Some(Point {
                objective: x * x + 1.3 * y * y + 0.7 * z * z + x * y,
                slope: [x * (2.0 * x + y), y * (2.6 * y + x), 1.4 * z * z],
                rows: vec![1.7_f64.ln() - p[0] - p[1] - p[2], x / 0.9 - 1.0],
                normals: vec![[-1.0; 3], [x / 0.9, 0.0, 0.0]],
            })
        }
        fn is_equality(&self, _: usize) -> bool {
            false
        }
    }

    #[test]
    fn ends_where_the_optimality_conditions_hold() {
        for start in [[0.0; 3], [2.0, -1.0, 1.5], [-3.0, 2.0, 0.3]] {
            let local = solve(&Powers, start).expect("in the domain");
            let slope = lagrangian_slope(&local.point, &local.multipliers);
            assert!(slope.iter().all(|s| s.abs() < 1e-9), "{slope:?}");
            assert!(local.violation(&Powers) < 1e-12);
            assert!(local.multipliers.iter().all(|&l| l >= 0.0));
            assert!(local.evaluations < 80, "{}", local.evaluations);
        }
    }
}
