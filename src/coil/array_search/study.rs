//! The surroundings of the best array: the worth of limits, the gain from each variable, how far each may
//! move, designs that are easier to make, and what the objective costs in mass, heat and time.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::Serialize;

use fluxform_base::progress::Interrupted;
use fluxform_design::Design;
use fluxform_numerics::front::front;
use fluxform_numerics::mixed_search::descent::Judged;
use fluxform_numerics::mixed_search::surrogate::Surrogate;
use fluxform_numerics::mixed_search::{Problem, Sample, Search, Values};

use super::problem::{ArrayProblem, Bounded, Physical};
use super::search::{ArrayChoice, Candidate, Found};
use super::worth::{LimitWorth, worths};
use crate::limits::LimitName;

/// The gain from a variable, and how far it may move.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VariableStudy {
    /// Its key.
    pub key: String,
    /// Its value in the best design.
    pub value: f64,
    /// That of the given design, moved into the range.
    pub given: f64,
    /// The best objective with the given value, the others searched again; null where none meets the
    /// limits.
    pub objective_without: Option<f64>,
    /// Ends between which the objective loses at most one per cent, the others following; by the
    /// surrogate.
    pub range: [f64; 2],
    /// The ends of the search.
    pub searched: [f64; 2],
}

/// A design beside the best one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Neighbour {
    /// What it is.
    pub what: String,
    /// Its variables by key.
    pub values: BTreeMap<String, f64>,
    /// Its objective.
    pub objective: f64,
}

/// A point of a trade-off: no design that was evaluated costs less and gives as much.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrontPoint {
    /// The quantity that is traded.
    pub quantity: &'static str,
    /// Its value, in the unit of its name.
    pub value: f64,
    /// The objective; to full accuracy, as the value, where every number of coils is searched to its end.
    pub objective: f64,
    /// Coils of the array.
    pub coils: usize,
    /// Of which choice it is.
    #[serde(flatten)]
    pub choice: ArrayChoice,
    /// The variables by key.
    pub values: BTreeMap<String, f64>,
}

/// All of it.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Study {
    /// Every limit, with what it is worth.
    pub limits: Vec<LimitWorth>,
    /// Every variable.
    pub variables: Vec<VariableStudy>,
    /// Designs that are easier to make.
    pub neighbours: Vec<Neighbour>,
    /// Trade-offs.
    pub front: Vec<FrontPoint>,
    /// Every design that was computed.
    #[serde(skip)]
    pub designs: Vec<TradedDesign>,
    /// Of these the ones on the front of each quantity.
    #[serde(skip)]
    pub on_front: [Vec<usize>; 3],
}

/// A design with what it costs.
#[derive(Debug, Clone, PartialEq)]
pub struct TradedDesign {
    /// The objective.
    pub objective: f64,
    /// The quantities of [`TRADED`].
    pub costs: [f64; 3],
    /// Whether it meets every limit.
    pub met: bool,
    /// Whether it does but for that of each quantity.
    met_but: [bool; 3],
    coils: usize,
    choice: ArrayChoice,
    values: BTreeMap<String, f64>,
    /// Of which search it is a sample, the best choice's first, and its variables there.
    source: usize,
    x: Vec<f64>,
    /// Whether it was computed to full accuracy.
    full: bool,
}

/// Better designs met in the surroundings of the best from which the search goes on, at most.
const TIMES_BETTER: usize = 3;
/// Loss of the objective that a range allows.
const LOSS: f64 = 0.01;
/// Weight of a range's width: limits' multipliers stay below the penalty for variables this flat.
const FLATTEST: f64 = 0.02;
/// Parts of the best design's mass, heat and time for which the best is computed, from the nearest on.
const PARTS: [&[f64]; 2] = [&[0.92, 0.8, 0.65, 0.5, 0.4, 0.32, 0.25], &[1.15, 1.4]];
/// Descents in turn that gain less than this are the last.
const PATIENCE: usize = 2;
const NO_BETTER: f64 = 1e-3;
/// Share of a range by which the starts of a descent lie apart.
const APART: f64 = 0.2;
/// Steps to which neighbours' lengths are rounded, mm: every array of the coarser one is one of the finer one too.
const STEPS_MM: [f64; 2] = [1.0, 0.5];
/// Times that a front is computed to full accuracy: the arrays that come onto it when others fall are few.
const FRONTS: usize = 4;
/// How much work the trade-offs are worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Evaluations that the study may add to a search.
    pub evaluations: usize,
    /// Descents for each value at most, every one on a surrogate that knows where the one before ended.
    descents: usize,
    /// Starts of each beside the end of the one before.
    other_starts: usize,
    /// Ways along [`PARTS`]; a second one knows what the first has computed.
    ways: usize,
}

impl Effort {
    /// More where the trade-offs are requested, of every number of coils.
    #[must_use]
    pub const fn of(every_count: bool) -> Self {
        match every_count {
            true => Self {
                evaluations: 200,
                descents: 8,
                other_starts: 6,
                ways: 4,
            },
            false => Self {
                evaluations: 80,
                descents: 2,
                other_starts: 0,
                ways: 2,
            },
        }
    }

    /// Descents on surrogates that the study may take.
    #[must_use]
    pub const fn climbs(self) -> usize {
        self.evaluations * (1 + self.other_starts)
    }
}

/// The quantities that are traded for the objective, by key.
pub const TRADED: [(&str, LimitName); 3] = [
    ("array_mass_kg", LimitName::ArrayMass),
    ("array_power_w", LimitName::ArrayPower),
    ("array_settling_s", LimitName::ArraySettling),
];

/// A quantity of a design.
fn traded(problem: &ArrayProblem, x: &[f64], physical: &Physical, name: LimitName) -> Option<f64> {
    let design = problem.space.design(x);
    ArrayProblem::evaluated(&design, Some(physical), name.limit().value)?
}

/// A search and its best design.
struct View<'s, 'a> {
    problem: &'a ArrayProblem<'a>,
    search: &'s mut Search<'a>,
    best: Candidate,
    surrogate: Surrogate,
    effort: Effort,
}

/// The surroundings of `found`, compared with `design`. Where a better design within the limits is met there, the search
/// goes on from it, and they are those of what that gives.
///
/// # Errors
/// Interruption.
pub fn study(found: &mut Found<'_>, design: &Design) -> Result<Study, Interrupted> {
    let evaluations = Effort::of(found.every_count).evaluations;
    for _ in 0..TIMES_BETTER {
        let around = surroundings(found, design)?;
        if !found.go_on(evaluations)? {
            return Ok(around);
        }
    }
    surroundings(found, design)
}

fn surroundings(found: &mut Found<'_>, design: &Design) -> Result<Study, Interrupted> {
    let (search, best) = (&mut found.search, found.best.clone());
    let effort = Effort::of(found.every_count);
    let before = search.samples().len();
    // The same for every number of coils, so that at each the best of all is known.
    let here = TRADED.map(|(_, name)| traded(found.problem, &best.x, &best.physical, name));
    let Some(mut view) = View::new(found.problem, search, best, effort) else {
        return Ok(Study::default());
    };
    let limits = worths(view.problem, &view.surrogate, &view.best);
    let variables = view.variables(design)?;
    let neighbours = view.neighbours()?;
    view.trade(&here)?;
    found.evaluations += found.search.samples().len() - before;
    for other in &mut found.others {
        let before = other.search.samples().len();
        if let Some(mut view) =
            View::new(other.problem, &mut other.search, other.best.clone(), effort)
        {
            view.trade(&here)?;
        }
        found.evaluations += other.search.samples().len() - before;
    }
    let (designs, on_front) = fronts(found, &here)?;
    let mut front = Vec::new();
    for ((quantity, _), (cost, on)) in TRADED.iter().zip(on_front.iter().enumerate()) {
        let on: &Vec<usize> = on;
        front.extend(on.iter().map(|index| FrontPoint {
            quantity,
            value: designs[*index].costs[cost],
            objective: designs[*index].objective,
            coils: designs[*index].coils,
            choice: designs[*index].choice.clone(),
            values: designs[*index].values.clone(),
        }));
    }
    Ok(Study {
        limits,
        variables,
        neighbours,
        front,
        designs,
        on_front,
    })
}

/// Every design that was computed, and which of them are on the front of each quantity. Where every number of coils was
/// searched to its end, those are computed to full accuracy first.
fn fronts(
    found: &Found<'_>,
    here: &[Option<f64>; 3],
) -> Result<(Vec<TradedDesign>, [Vec<usize>; 3]), Interrupted> {
    let others = found.others.iter();
    let others = others.map(|other| (other.problem, &other.search));
    let searches: Vec<_> = std::iter::once((found.problem, &found.search))
        .chain(others)
        .collect();
    let all = || -> Vec<TradedDesign> {
        let of = |(source, (problem, search))| traded_designs(problem, search, source);
        searches.iter().copied().enumerate().flat_map(of).collect()
    };
    let on_fronts = |designs: &[TradedDesign], accurate: bool| {
        std::array::from_fn(|cost| on_front(designs, cost, here[cost], accurate))
    };
    if found.every_count {
        for _ in 0..FRONTS {
            let designs = all();
            let on: [Vec<usize>; 3] = on_fronts(&designs, false);
            let on = on.iter().flatten().map(|index| &designs[*index]);
            let estimated: Vec<_> = on.filter(|design| !design.full).collect();
            if estimated.is_empty() {
                break;
            }
            for design in estimated {
                searches[design.source].0.compute_fully(&design.x)?;
            }
        }
    }
    let designs = all();
    let on = on_fronts(&designs, found.every_count);
    Ok((designs, on))
}

/// Every design of a search that was computed.
fn traded_designs(problem: &ArrayProblem, search: &Search, source: usize) -> Vec<TradedDesign> {
    let design = |sample: &Sample| {
        let physical = problem.properties(sample)?;
        let bounds = problem.bounds(&sample.x, Some(&physical));
        let met_but = TRADED.map(|(_, name)| {
            let mut others = bounds.iter().filter(|bound| bound.name != Some(name));
            others.all(Bounded::is_met)
        });
        let costs = TRADED.map(|(_, name)| traded(problem, &sample.x, &physical, name));
        let [Some(mass), Some(power), Some(settling)] = costs else {
            return None;
        };
        let judged = problem.judged(Some(&physical), &bounds);
        Some(TradedDesign {
            coils: problem.space.coils(),
            choice: ArrayChoice::of(&problem.space),
            objective: judged.objective().exp(),
            costs: [mass, power, settling],
            met: bounds.iter().all(Bounded::is_met),
            met_but,
            values: problem.space.named(&sample.x),
            source,
            x: sample.x.clone(),
            full: problem.is_known_fully(&sample.x),
        })
    };
    search.samples().iter().filter_map(design).collect()
}

impl<'s, 'a> View<'s, 'a> {
    /// `None` of a search that knows too little.
    fn new(
        problem: &'a ArrayProblem<'a>,
        search: &'s mut Search<'a>,
        best: Candidate,
        effort: Effort,
    ) -> Option<Self> {
        search.allow(search.samples().len() + effort.evaluations);
        Some(Self {
            problem,
            surrogate: search.surrogate()?,
            search,
            best,
            effort,
        })
    }

    fn named(&self, x: &[f64]) -> BTreeMap<String, f64> {
        let space = &self.problem.space;
        space.named(&self.problem.made(x))
    }

    /// The problem's own judgement of what the surrogate has.
    fn judge(&self, x: &[f64], outputs: &[f64]) -> Judged {
        let physical = self.problem.estimate(outputs);
        self.problem.judged(
            physical.as_ref(),
            &self.problem.bounds(x, physical.as_ref()),
        )
    }

    /// The objective of a design that is evaluated for it, where it meets the limits.
    fn evaluated(&mut self, x: Vec<f64>) -> Result<Option<f64>, Interrupted> {
        let x = self.problem.made(&x);
        self.search.evaluate(vec![x.clone()])?;
        let sample = self.search.samples().iter().find(|sample| sample.x == x);
        let judged = sample.and_then(|sample| self.problem.judged_sample(sample));
        // A surrogate's design may be off a limit by its own error.
        let met = judged.filter(|judged| judged.excess() <= OFF);
        Ok(met.map(|judged| judged.objective().exp()))
    }

    fn variables(&mut self, design: &Design) -> Result<Vec<VariableStudy>, Interrupted> {
        let given = self.problem.space.given(design);
        let mut all = Vec::new();
        for (index, axis) in self.problem.space.axes().to_vec().into_iter().enumerate() {
            let variable = self.problem.space.variables()[index].clone();
            let x = self.best.x.clone();
            let judge = |x: &[f64], outputs: &[f64]| self.judge(x, outputs);
            let search = &self.search;
            let held =
                search.climb_otherwise(&self.surrogate, &judge, &x, &[(index, given[index])]);
            let held = held.filter(|(_, ended)| ended.judged.excess() <= OFF);
            let range = [false, true].map(|up| self.end_of_range(index, up));
            let objective_without = match held {
                Some((x, _)) => self.evaluated(x)?,
                None => None,
            };
            all.push(VariableStudy {
                key: axis.key(),
                value: x[index],
                given: given[index],
                objective_without,
                range,
                searched: [variable.low, variable.high],
            });
        }
        Ok(all)
    }

    /// How far a variable can be moved while the objective loses at most a hundredth.
    fn end_of_range(&self, index: usize, up: bool) -> f64 {
        let variable = &self.problem.space.variables()[index];
        let width = variable.high - variable.low;
        let sign = if up { 1.0 } else { -1.0 };
        let x = &self.best.x;
        let surrogate = &self.surrogate;
        let search = &self.search;
        let here = self.judge(x, &surrogate.at(&search.units(x))).objective();
        let judge = |x: &[f64], outputs: &[f64]| {
            let mut judged = self.judge(x, outputs);
            judged
                .limits
                .push(here + (1.0 - LOSS).ln() - judged.objective());
            judged.objectives = vec![FLATTEST * sign * x[index] / width];
            judged
        };
        let ended = search.climb_otherwise(surrogate, &judge, x, &[]);
        let moved = ended.filter(|(_, ended)| ended.judged.excess() <= OFF);
        let end = moved.map_or(x[index], |(x, _)| x[index]);
        if up {
            end.max(x[index])
        } else {
            end.min(x[index])
        }
    }

    /// The best designs with lengths of half and whole millimetres.
    fn neighbours(&mut self) -> Result<Vec<Neighbour>, Interrupted> {
        let mut all: Vec<Neighbour> = Vec::new();
        for step in STEPS_MM {
            let rounded = match self.rounded(step) {
                Some(x) => {
                    let values = self.named(&x);
                    let objective = self.evaluated(x)?;
                    objective.map(|objective| (values, objective))
                }
                None => None,
            };
            let coarser = all.last().map(|one| (one.values.clone(), one.objective));
            let best = [coarser, rounded].into_iter().flatten();
            if let Some((values, objective)) = best.reduce(|a, b| if b.1 > a.1 { b } else { a }) {
                all.push(Neighbour {
                    what: format!("lengths of {step} mm steps"),
                    values,
                    objective,
                });
            }
        }
        all.reverse();
        Ok(all)
    }

    /// The best design with lengths that are multiples of `step`, rounded one after the other, by the surrogate; `None`
    /// where one has no such value.
    fn rounded(&self, step: f64) -> Option<Vec<f64>> {
        let mut x = self.best.x.clone();
        let mut fixed: Vec<(usize, f64)> = Vec::new();
        let variables = self.problem.space.variables().iter().enumerate();
        for (index, variable) in variables.filter(|(_, v)| v.values == Values::Continuous) {
            let judge = |x: &[f64], outputs: &[f64]| self.judge(x, outputs);
            let near = [
                (x[index] / step).floor() * step,
                (x[index] / step).ceil() * step,
            ];
            let tried = near
                .iter()
                .filter(|v| (variable.low..=variable.high).contains(*v))
                .filter_map(|v| {
                    let held: Vec<_> = fixed.iter().copied().chain([(index, *v)]).collect();
                    let ended = self
                        .search
                        .climb_otherwise(&self.surrogate, &judge, &x, &held)?;
                    Some((ended.1.judged.merit(), *v, ended.0))
                });
            let (_, value, at) = tried.reduce(|a, b| if b.0 > a.0 { b } else { a })?;
            fixed.push((index, value));
            x = at;
        }
        Some(x)
    }

    /// Computes the best designs of less and more mass, heat and time, one from the next.
    fn trade(&mut self, here: &[Option<f64>; 3]) -> Result<(), Interrupted> {
        for (cost, here) in here.iter().enumerate() {
            let Some(here) = here else { continue };
            for parts in [PARTS; 2].into_iter().flatten().take(self.effort.ways) {
                let mut x = self.best.x.clone();
                for part in parts {
                    x = self.trade_below(x, cost, part * here)?;
                }
            }
        }
        Ok(())
    }

    /// Computes the best design of which a quantity is `most` at most, every time by a surrogate that knows the one
    /// before, until it is no better; `from` where there is none.
    fn trade_below(
        &mut self,
        from: Vec<f64>,
        cost: usize,
        most: f64,
    ) -> Result<Vec<f64>, Interrupted> {
        let (_, name) = TRADED[cost];
        let mut best: Option<(f64, Vec<f64>)> = None;
        let mut no_better = 0;
        for _ in 0..self.effort.descents {
            let x = best.as_ref().map_or(&from, |(_, x)| x);
            let next = self.best_below(x, name, most);
            let next = next.map(|next| self.problem.made(&next));
            let Some(next) = next.filter(|next| next != x) else {
                break;
            };
            self.search.evaluate(vec![next.clone()])?;
            if let Some(surrogate) = self.search.surrogate() {
                self.surrogate = surrogate;
            }
            let computed = self.search.samples().iter().find(|s| s.x == next);
            let outputs = computed.and_then(|sample| sample.outputs.as_ref());
            let merit = outputs.map_or(f64::NEG_INFINITY, |all| {
                self.judge_below(&next, all, name, most).merit()
            });
            let before = best.as_ref().map_or(f64::NEG_INFINITY, |(merit, _)| *merit);
            no_better = match merit > before + NO_BETTER {
                true => 0,
                false => no_better + 1,
            };
            if merit > before {
                best = Some((merit, next));
            }
            if no_better == PATIENCE {
                break;
            }
        }
        Ok(best.map_or(from, |(_, x)| x))
    }

    /// What the problem's judgement is where a quantity is `most` at most instead of its own limit.
    fn judge_below(&self, x: &[f64], outputs: &[f64], name: LimitName, most: f64) -> Judged {
        let physical = self.problem.estimate(outputs);
        let mut bounds = self.problem.bounds(x, physical.as_ref());
        bounds.retain(|bound| bound.name != Some(name));
        let mut judged = self.problem.judged(physical.as_ref(), &bounds);
        let value = physical.and_then(|p| traded(self.problem, x, &p, name));
        judged.limits.push((value.unwrap_or(f64::NAN) / most).ln());
        judged
    }

    /// The best design by the surrogate under that judgement.
    fn best_below(&self, from: &[f64], name: LimitName, most: f64) -> Option<Vec<f64>> {
        let judge = |x: &[f64], outputs: &[f64]| self.judge_below(x, outputs, name, most);
        let starts = self.starts(from, &judge);
        let climb = |start: &Vec<f64>| {
            let search = &self.search;
            search.climb_otherwise(&self.surrogate, &judge, start, &[])
        };
        let ends: Vec<_> = starts.par_iter().filter_map(climb).collect();
        let met = ends.into_iter();
        let met = met.filter(|(_, ended)| ended.judged.excess() <= OFF);
        let best = met.reduce(|a, b| {
            if b.1.judged.merit() > a.1.judged.merit() {
                b
            } else {
                a
            }
        });
        best.map(|(x, _)| x)
    }

    /// `from` and the best computed designs that lie apart from it and each other: what costs less may lie in another
    /// valley.
    fn starts(&self, from: &[f64], judge: &dyn Fn(&[f64], &[f64]) -> Judged) -> Vec<Vec<f64>> {
        let search = &self.search;
        let known = search.samples().iter();
        let mut rated: Vec<(f64, &Vec<f64>)> = known
            .filter_map(|s| Some((judge(&s.x, s.outputs.as_ref()?).merit(), &s.x)))
            .filter(|(merit, _)| merit.is_finite())
            .collect();
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut starts = vec![from.to_vec()];
        for (_, x) in rated {
            let u = search.units(x);
            let apart = |other: &Vec<f64>| {
                let other = search.units(other);
                u.iter().zip(&other).any(|(a, b)| (a - b).abs() > APART)
            };
            if starts.len() <= self.effort.other_starts && starts.iter().all(apart) {
                starts.push(x.clone());
            }
        }
        starts
    }
}

/// For every part of `here`, what the best design costs, the best of the designs that cost at most so much and meet all limits but that of the cost,
/// ascending: others that nothing happens to beat are not the best for what they cost. `accurate`: of those alone that
/// were computed to full accuracy.
fn on_front(
    designs: &[TradedDesign],
    cost: usize,
    here: Option<f64>,
    accurate: bool,
) -> Vec<usize> {
    let met: Vec<usize> = (0..designs.len())
        .filter(|index| designs[*index].met_but[cost] && (designs[*index].full || !accurate))
        .collect();
    let points: Vec<[f64; 2]> = met
        .iter()
        .map(|index| [designs[*index].costs[cost], designs[*index].objective])
        .collect();
    let unbeaten = front(&points);
    let parts = PARTS.into_iter().flatten().chain(&[1.0]);
    let targets = here
        .into_iter()
        .flat_map(|here| parts.clone().map(move |part| part * here));
    let mut on: Vec<usize> = targets
        .map(|most| unbeaten.partition_point(|at| points[*at][0] <= most * (1.0 + OFF)))
        .filter(|below| *below > 0)
        .collect();
    on.sort_unstable();
    on.dedup();
    on.iter().map(|below| met[unbeaten[below - 1]]).collect()
}

/// Excess that is the surrogate's error.
const OFF: f64 = 2e-4;
