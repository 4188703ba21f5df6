//! What limits are worth: by how much the objective grows where one of them is relaxed.
//!
//! A whole number of layers and turns leaves little room: with these held, the bore alone answers to a limit, and what
//! its multiplier promises ends after hundredths of a millimetre. So both may be fractions here, before and after, and
//! the limit is relaxed by a step that a user might make. Of limits that coincide, one alone then gives nothing.

use rayon::prelude::*;
use serde::Serialize;

use fluxform_numerics::mixed_search::Values;
use fluxform_numerics::mixed_search::descent::{Ended, Judged, climb};
use fluxform_numerics::mixed_search::surrogate::Surrogate;

use super::problem::{ArrayProblem, Bounded, Physical};
use super::search::Candidate;
use super::space::Axis;
use crate::limits::LimitName;

/// A limit of the best array.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LimitWorth {
    /// Its key.
    pub key: &'static str,
    /// The array's value, in the unit of its key.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// Whether it is met.
    pub met: bool,
    /// Whether more of it would give a larger objective.
    pub active: bool,
    /// By how much the objective would grow for one unit more of it, relative: the mean over [`RELAXED`], every other
    /// variable following, layers and turns as fractions; by the surrogate. Below 0 where less of it would.
    pub gain_per_unit: f64,
    /// Which, where it is one of the design's.
    #[serde(skip)]
    pub name: Option<LimitName>,
}

/// Share of itself by which a limit is relaxed: a step that a user makes, and more than the surrogate's error.
pub const RELAXED: f64 = 0.05;
/// Gain from it that is rounding, or the slack between limits that coincide.
const ROUNDING: f64 = 1e-4;
/// A limit that is farther off than this holds nothing back.
const AT_LIMIT: f64 = 1e-3;
/// Excess that a climb leaves.
const BROKEN: f64 = 1e-6;
/// How far variables may move from the best array, as a share of their ranges, and whole ones at least.
const REACH: f64 = 0.3;
const LEAST_REACH: f64 = 1.0;
/// Climbs in turn, each from the end of the one before, and the gain below which the last has ended.
const CLIMBS: usize = 6;
const STILL: f64 = 1e-6;

/// What every limit of `best` is worth.
pub(super) fn worths(
    problem: &ArrayProblem<'_>,
    surrogate: &Surrogate,
    best: &Candidate,
) -> Vec<LimitWorth> {
    let around = Around::new(problem, surrogate, best);
    let start = around.units(&best.x);
    let here = around.climbed(start, None);
    let now = around.bounds(&here.u, None).1;
    let gain = |bound: &Bounded| {
        let held = now.iter().find(|other| same(other, bound))?;
        // Where limits cannot be met, a gain is that of breaking them less.
        if held.excess() < -AT_LIMIT || here.judged.excess() > BROKEN {
            return None;
        }
        let relaxed = bound.relaxed(RELAXED);
        let there = around.climbed(here.u.clone(), Some(&relaxed));
        if there.judged.excess() > BROKEN {
            return None;
        }
        let gain = (there.judged.objective() - here.judged.objective()).exp_m1();
        (gain > ROUNDING).then(|| gain / (relaxed.limit - bound.limit))
    };
    let worth = |bound: &Bounded| {
        let gain_per_unit = gain(bound);
        LimitWorth {
            key: bound.key,
            value: bound.value,
            limit: bound.limit,
            met: bound.is_met(),
            active: gain_per_unit.is_some(),
            gain_per_unit: gain_per_unit.unwrap_or(0.0),
            name: bound.name,
        }
    };
    best.bounds.par_iter().map(worth).collect()
}

fn same(a: &Bounded, b: &Bounded) -> bool {
    a.key == b.key && a.at_least == b.at_least
}

/// Arrays about the best one as the surrogate has them.
struct Around<'s, 'a> {
    problem: &'s ArrayProblem<'a>,
    surrogate: &'s Surrogate,
    low: Vec<f64>,
    high: Vec<f64>,
}

impl<'s, 'a> Around<'s, 'a> {
    fn new(problem: &'s ArrayProblem<'a>, surrogate: &'s Surrogate, best: &Candidate) -> Self {
        let axes = problem.space.axes().iter();
        let variables = axes.zip(problem.space.variables()).zip(&best.x);
        let ends = variables.map(|((axis, variable), x)| {
            let width = variable.high - variable.low;
            let reach = (REACH * width).max(LEAST_REACH);
            let [low, high] = match (&variable.values, axis) {
                // Another wire is another winding.
                (Values::Listed(_), _) => [*x, *x],
                // Their ends follow from the limits, which hold by themselves.
                (Values::Whole, Axis::Layers | Axis::TurnsPerLayer) => {
                    [(x - reach).max(0.5), x + reach]
                }
                (Values::Whole | Values::Continuous, _) => [
                    (x - reach).max(variable.low),
                    (x + reach).min(variable.high),
                ],
            };
            [low, high].map(|end| (end - variable.low) / width)
        });
        let (low, high) = ends.map(|[low, high]| (low, high)).unzip();
        Self {
            problem,
            surrogate,
            low,
            high,
        }
    }

    fn units(&self, x: &[f64]) -> Vec<f64> {
        let variables = x.iter().zip(self.problem.space.variables());
        variables
            .map(|(x, variable)| (x - variable.low) / (variable.high - variable.low))
            .collect()
    }

    fn values(&self, u: &[f64]) -> Vec<f64> {
        let variables = u.iter().zip(self.problem.space.variables());
        variables
            .map(|(u, variable)| variable.low + u * (variable.high - variable.low))
            .collect()
    }

    /// The array at `u` and its limits, of which `other` takes the place of one.
    fn bounds(&self, u: &[f64], other: Option<&Bounded>) -> (Option<Physical>, Vec<Bounded>) {
        let physical = self.problem.estimate(&self.surrogate.at(u));
        let mut bounds = self.problem.bounds(&self.values(u), physical.as_ref());
        for bound in &mut bounds {
            if let Some(other) = other.filter(|other| same(other, bound)) {
                bound.limit = other.limit;
            }
        }
        (physical, bounds)
    }

    fn judged(&self, u: &[f64], other: Option<&Bounded>) -> Judged {
        let (physical, bounds) = self.bounds(u, other);
        self.problem.judged(physical.as_ref(), &bounds)
    }

    /// The best array near `from`, of which `other` takes the place of a limit.
    fn climbed(&self, from: Vec<f64>, other: Option<&Bounded>) -> Ended {
        let of = |u: &[f64]| self.judged(u, other);
        let mut ended = climb(&of, &from, &self.low, &self.high);
        for _ in 1..CLIMBS {
            // A climb begins without curvature; what stopped one does not stop the next.
            let next = climb(&of, &ended.u, &self.low, &self.high);
            let gained = next.judged.merit() - ended.judged.merit();
            if gained > 0.0 {
                ended = next;
            }
            if gained.is_nan() || gained <= STILL {
                break;
            }
        }
        ended
    }
}
