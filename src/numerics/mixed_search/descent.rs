//! Local search for the largest of a function under limits, both cheap: sequential quadratic
//! programmes with a damped quasi-Newton matrix, from any start, within a box.
//!
//! Maximise min_k f_k(u) with c_i(u) <= 0. A start may break limits; where none can be met, the result
//! breaks them least. Derivatives are central differences, since a value costs microseconds.

use nalgebra::{DMatrix, DVector};

use crate::quadratic_program::minimise;
use fluxform_base::progress::poll;

/// A function to be maximised and its limits, at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// The objective is the least of these.
    pub objectives: Vec<f64>,
    /// Each at most 0; relative to the limit, as its objectives' logarithm.
    pub limits: Vec<f64>,
}

/// Cost of a unit of a violated limit, in units of the objective; far above any multiplier.
pub const PENALTY: f64 = 20.0;

impl Judged {
    /// The least of the objectives.
    #[must_use]
    pub fn objective(&self) -> f64 {
        self.objectives
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min)
    }

    /// By how much the limit that is broken most is broken; 0 where none is.
    #[must_use]
    pub fn excess(&self) -> f64 {
        let worst = |a: f64, b: &f64| if b.is_nan() { f64::INFINITY } else { a.max(*b) };
        self.limits.iter().fold(0.0, worst)
    }

    /// The objective less what broken limits cost; minus infinity where something is undefined.
    #[must_use]
    pub fn merit(&self) -> f64 {
        let merit = self.objective() - PENALTY * self.excess();
        if merit.is_nan() {
            f64::NEG_INFINITY
        } else {
            merit
        }
    }
}

/// Where a local search ended.
#[derive(Debug, Clone)]
pub struct Ended {
    /// The place.
    pub u: Vec<f64>,
    /// The values there.
    pub judged: Judged,
}

const TURNS: usize = 40;
const HALVINGS: usize = 10;
/// Half the distance of the places of a difference.
const STEP: f64 = 1e-5;
/// A move below which the search ends.
const STILL: f64 = 1e-7;
/// Curvature of what has none of its own: the objective's least, and the largest excess.
const FLAT: f64 = 1e-4;
/// Share of the expected gain that a step must bring.
const ENOUGH: f64 = 1e-3;

/// The best place in `low..=high` near `start`; coordinates whose bounds are equal do not move. A stop ends it
/// between two steps.
///
/// ```
/// use fluxform_base::progress::{interruptible, request_stop};
/// use fluxform_numerics::mixed_search::descent::{Judged, climb};
/// use std::cell::Cell;
///
/// let (calls, stop_at) = (Cell::new(0), Cell::new(usize::MAX));
/// let of = |u: &[f64]| {
///     calls.set(calls.get() + 1);
///     if calls.get() == stop_at.get() {
///         request_stop();
///     }
///     Judged {
///         objectives: vec![-(u[0] - 0.3).powi(4)],
///         limits: vec![u[0] - 0.8],
///     }
/// };
/// let ended = interruptible(|| climb(&of, &[0.9], &[0.0], &[1.0])).unwrap();
/// assert!((ended.u[0] - 0.3).abs() < 0.02);
///
/// stop_at.set(calls.replace(0) / 2);
/// assert!(interruptible(|| climb(&of, &[0.9], &[0.0], &[1.0])).is_err());
/// ```
pub fn climb(of: &dyn Fn(&[f64]) -> Judged, start: &[f64], low: &[f64], high: &[f64]) -> Ended {
    let u: Vec<f64> = start
        .iter()
        .zip(low.iter().zip(high))
        .map(|(u, (low, high))| u.clamp(*low, *high))
        .collect();
    let free: Vec<usize> = (0..u.len()).filter(|&i| high[i] > low[i]).collect();
    let judged = of(&u);
    let mut ended = Ended { judged, u };
    if free.is_empty() || !ended.judged.merit().is_finite() {
        return ended;
    }
    let mut curvature = DMatrix::identity(free.len(), free.len());
    let mut slopes = Slopes::new(of, &ended.u, &ended.judged, (&free, low, high));
    for _ in 0..TURNS {
        poll();
        let Ended { u, judged } = &ended;
        let room = |ends: &[f64]| -> Vec<f64> { free.iter().map(|&i| ends[i] - u[i]).collect() };
        let Some(step) = slopes.step(judged, &curvature, (&room(low), &room(high))) else {
            break;
        };
        let Some((next, found)) = along(of, &ended.u, &free, &step, &ended.judged, low, high)
        else {
            break;
        };
        let moved = DVector::from_fn(free.len(), |i, _| next[free[i]] - ended.u[free[i]]);
        let before = slopes.lagrangian(&step);
        slopes = Slopes::new(of, &next, &found, (&free, low, high));
        update(&mut curvature, &moved, &(slopes.lagrangian(&step) - before));
        (ended.u, ended.judged) = (next, found);
        if step.d.amax() < STILL || !ended.judged.merit().is_finite() {
            break;
        }
    }
    ended
}

struct Step {
    d: DVector<f64>,
    /// Multipliers of the objectives, and of the limits.
    objectives: Vec<f64>,
    limits: Vec<f64>,
    /// The merit that the linear model expects.
    expected: f64,
}

/// The longest part of the step that brings enough of what it promises.
fn along(
    of: &dyn Fn(&[f64]) -> Judged,
    u: &[f64],
    free: &[usize],
    step: &Step,
    judged: &Judged,
    low: &[f64],
    high: &[f64],
) -> Option<(Vec<f64>, Judged)> {
    let promised = step.expected - judged.merit();
    if promised <= 0.0 {
        return None;
    }
    (0..HALVINGS).find_map(|halving| {
        let part = 0.5_f64.powi(halving as i32);
        let mut next = u.to_vec();
        for (&i, d) in free.iter().zip(step.d.iter()) {
            next[i] = (u[i] + part * d).clamp(low[i], high[i]);
        }
        let found = of(&next);
        (found.merit() > judged.merit() + ENOUGH * part * promised).then_some((next, found))
    })
}

/// Derivatives with respect to the free coordinates, one row a function.
struct Slopes {
    objectives: DMatrix<f64>,
    limits: DMatrix<f64>,
}

impl Slopes {
    /// At `u`, where the values are `here`.
    fn new(
        of: &dyn Fn(&[f64]) -> Judged,
        u: &[f64],
        here: &Judged,
        (free, low, high): (&[usize], &[f64], &[f64]),
    ) -> Self {
        let mut objectives = DMatrix::zeros(here.objectives.len(), free.len());
        let mut limits = DMatrix::zeros(here.limits.len(), free.len());
        for (column, &i) in free.iter().enumerate() {
            let mut at = u.to_vec();
            let ends = [(u[i] - STEP).max(low[i]), (u[i] + STEP).min(high[i])];
            let [below, above] = ends.map(|end| {
                at[i] = end;
                of(&at)
            });
            let set = |slopes: &mut DMatrix<f64>, a: &[f64], b: &[f64]| {
                for (row, (a, b)) in a.iter().zip(b).enumerate() {
                    let slope = (b - a) / (ends[1] - ends[0]);
                    slopes[(row, column)] = if slope.is_finite() { slope } else { 0.0 };
                }
            };
            set(&mut objectives, &below.objectives, &above.objectives);
            set(&mut limits, &below.limits, &above.limits);
        }
        Self { objectives, limits }
    }

    /// The step of the quadratic model, whose variables are the move, the objective's change and the
    /// largest excess.
    fn step(
        &self,
        judged: &Judged,
        curvature: &DMatrix<f64>,
        (low, high): (&[f64], &[f64]),
    ) -> Option<Step> {
        let (size, goals, bounds) = (low.len(), judged.objectives.len(), judged.limits.len());
        let (gain, excess) = (size, size + 1);
        let mut b = DMatrix::identity(size + 2, size + 2) * FLAT;
        b.view_mut((0, 0), (size, size)).copy_from(curvature);
        let mut g = DVector::zeros(size + 2);
        g[gain] = -1.0;
        g[excess] = PENALTY;
        let count = goals + bounds + 1 + 2 * size;
        let mut rows = DMatrix::zeros(count, size + 2);
        let mut limits = DVector::zeros(count);
        let least = judged.objective();
        for k in 0..goals {
            rows.view_mut((k, 0), (1, size))
                .copy_from(&(-self.objectives.row(k)));
            rows[(k, gain)] = 1.0;
            limits[k] = judged.objectives[k] - least;
        }
        for k in 0..bounds {
            rows.view_mut((goals + k, 0), (1, size))
                .copy_from(&self.limits.row(k));
            rows[(goals + k, excess)] = -1.0;
            limits[goals + k] = -judged.limits[k];
        }
        rows[(goals + bounds, excess)] = -1.0;
        for i in 0..size {
            let row = goals + bounds + 1 + 2 * i;
            rows[(row, i)] = 1.0;
            limits[row] = high[i];
            rows[(row + 1, i)] = -1.0;
            limits[row + 1] = -low[i];
        }
        let minimum = minimise(&b, &g, &rows, &limits)?;
        Some(Step {
            expected: least + minimum.step[gain] - PENALTY * minimum.step[excess].max(0.0),
            d: minimum.step.rows(0, size).into_owned(),
            objectives: minimum.multipliers[..goals].to_vec(),
            limits: minimum.multipliers[goals..goals + bounds].to_vec(),
        })
    }

    /// Gradient of the Lagrangian at the step's multipliers.
    fn lagrangian(&self, step: &Step) -> DVector<f64> {
        let part = |slopes: &DMatrix<f64>, weights: &[f64]| {
            slopes.tr_mul(&DVector::from_column_slice(weights))
        };
        part(&self.limits, &step.limits) - part(&self.objectives, &step.objectives)
    }
}

/// Powell's damped update: the matrix stays positive definite.
fn update(b: &mut DMatrix<f64>, moved: &DVector<f64>, turned: &DVector<f64>) {
    let curved = &*b * moved;
    let own = moved.dot(&curved);
    if own <= f64::MIN_POSITIVE {
        return;
    }
    let given = moved.dot(turned);
    let share = if given < 0.2 * own {
        0.8 * own / (own - given)
    } else {
        1.0
    };
    let mixed = share * turned + (1.0 - share) * &curved;
    let along = moved.dot(&mixed);
    *b += &mixed * mixed.transpose() / along - &curved * curved.transpose() / own;
}
