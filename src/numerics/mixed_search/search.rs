//! The search: evaluations in batches, descents on their surrogate.

use rayon::prelude::*;

use super::descent::{Ended, Judged};
use super::rounding;
use super::surrogate::Surrogate;
use super::variable::{Region, Values, Variable, WHOLE};
use crate::random::Random;
use fluxform_base::progress::Interrupted;

/// An expensive function, in the variables' own units.
pub trait Problem: Sync {
    /// The variables.
    fn variables(&self) -> &[Variable];

    /// The design that is made of `x`, which is what is evaluated: lengths may be rounded.
    fn made(&self, x: &[f64]) -> Vec<f64> {
        x.to_vec()
    }

    /// The costly outputs at `x`; `None` where there is no such design.
    ///
    /// # Errors
    /// Interruption.
    fn outputs(&self, x: &[f64]) -> Result<Option<Vec<f64>>, Interrupted>;

    /// Objective and limits from `x` and its outputs, estimated or computed.
    fn judge(&self, x: &[f64], outputs: &[f64]) -> Judged;

    /// Reports the evaluations so far and the best objective that meets the limits.
    fn report(&self, _evaluations: usize, _best: Option<f64>) {}
}

/// How the search goes about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Where the sequence begins.
    pub seed: u64,
    /// Descents of their own.
    pub starts: usize,
    /// Most evaluations.
    pub evaluations: usize,
    /// Width of the trust region, as a share of the ranges, at which a descent ends.
    pub finest: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 1,
            starts: 3,
            evaluations: 240,
            finest: 2e-3,
        }
    }
}

/// A design that was evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Its variables.
    pub x: Vec<f64>,
    /// Its costly outputs; `None` where there are none.
    pub outputs: Option<Vec<f64>>,
}

/// Evaluated together.
const BATCH: usize = 4;
/// Designs about the given one before the first descent, beside one per variable.
const NEAR_GIVEN: usize = 2;
/// Designs over all ranges before the second: what the surrogate promises far off teaches more than chance does.
const SPREAD: usize = 4;
/// Width of the first trust region, of that of a descent in the same valley, and of the widest.
const FIRST_WIDTH: f64 = 0.3;
const WIDEST: f64 = 0.6;
/// Width at which the first descent ends: designs spread over all ranges come before its last digits.
const COARSE: f64 = 0.05;
/// Width of the region in which a design is refined.
const REFINED_WIDTH: f64 = 0.02;
/// Places from which a design within the limits is looked for.
const FEASIBLE_STARTS: usize = 12;
/// Factors on a region's width after success at its border, and after failure.
const WIDER: f64 = 1.6;
const NARROWER: f64 = 0.5;
/// Gains, as shares of the expected one, that count as success, and as a failure.
const GOOD: f64 = 0.5;
const POOR: f64 = 0.05;
/// Places nearer to a sample than this share of the trust region teach nothing.
const NEAR: f64 = 0.02;
/// Places from which the surrogate's best over all ranges is looked for.
const FAR_STARTS: usize = 4;
/// Places among which the one farthest from all samples is chosen.
const SCATTERED: usize = 40;
/// Merit that is not worth a step.
const NO_GAIN: f64 = 1e-6;
/// Excess that is rounding.
pub const MET: f64 = 1e-9;

/// A search and what it has learned.
pub struct Search<'a> {
    problem: &'a dyn Problem,
    settings: Settings,
    samples: Vec<Sample>,
    random: Random,
    /// Descents that came to their end, and where.
    ends: Vec<Vec<f64>>,
    /// Where the first descent, a coarse one, ended.
    near_given: Option<Vec<f64>>,
    /// Whether designs were spread over all ranges.
    spread: bool,
    /// Whether every design was evaluated.
    complete: bool,
}

impl<'a> Search<'a> {
    /// A search that has evaluated nothing.
    #[must_use]
    pub fn new(problem: &'a dyn Problem, settings: Settings) -> Self {
        Self {
            problem,
            settings,
            samples: Vec::new(),
            random: Random::new(settings.seed),
            ends: Vec::new(),
            near_given: None,
            spread: false,
            complete: false,
        }
    }

    /// Every design that was evaluated, in order.
    #[must_use]
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Where each completed descent ended.
    #[must_use]
    pub fn ends(&self) -> &[Vec<f64>] {
        &self.ends
    }

    /// Whether the variables are whole or listed and every design was evaluated.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// Objective and limits of a design that was evaluated.
    #[must_use]
    pub fn judged(&self, sample: &Sample) -> Option<Judged> {
        let outputs = sample.outputs.as_ref()?;
        Some(self.problem.judge(&sample.x, outputs))
    }

    /// The best design that was evaluated: of those that meet the limits, or that breaks them least.
    #[must_use]
    pub fn best(&self) -> Option<(&Sample, Judged)> {
        let judged = self
            .samples
            .iter()
            .filter_map(|s| Some((s, self.judged(s)?)));
        judged
            .filter(|(_, judged)| judged.merit().is_finite())
            .reduce(|a, b| if better(&b.1, &a.1) { b } else { a })
    }

    /// Evaluates the `given` designs and descends from the best design near the first of them; then
    /// from designs spread over all ranges, until every descent has ended or the evaluations are used
    /// up. What was learned stays where it is interrupted.
    ///
    /// # Errors
    /// Interruption.
    pub fn run(&mut self, given: &[Vec<f64>]) -> Result<(), Interrupted> {
        if let Some(all) = self.all_designs() {
            self.evaluate(all)?;
            self.complete = true;
            return Ok(());
        }
        let size = self.problem.variables().len();
        let mut first = given.to_vec();
        if let Some(given) = given.first() {
            // Limits that cost nothing are met before the first descent.
            first.push(self.least_broken(given).0);
        }
        self.evaluate(first)?;
        if let Some(near) = self.samples.last().map(|sample| self.units(&sample.x)) {
            self.scatter(&near, FIRST_WIDTH, size + NEAR_GIVEN)?;
        }
        let everywhere = vec![0.5; size];
        if !self.spread {
            // What lies near the given design is known soon; the next descent is one far from there.
            if let Some(center) = self.start(0).filter(|_| !self.spent()) {
                let end = self.descend(center, FIRST_WIDTH, COARSE)?;
                self.near_given = Some(end);
            }
            self.spread = true;
            self.scatter(&everywhere, 1.0, self.samples.len() + SPREAD)?;
        }
        for start in self.ends.len()..self.settings.starts {
            if self.spent() {
                break;
            }
            // Where nothing is known far from the given design, what is near it counts.
            let far = self.start(start);
            let Some(center) = far.or_else(|| self.near_given.take().and_then(|_| self.start(0)))
            else {
                break;
            };
            let end = self.descend(center, FIRST_WIDTH, self.settings.finest)?;
            if self.spent() {
                break;
            }
            self.ends.push(end);
        }
        Ok(())
    }

    /// Every design, where those are not more than may be evaluated.
    fn all_designs(&self) -> Option<Vec<Vec<f64>>> {
        let mut all = vec![Vec::new()];
        for variable in self.problem.variables() {
            let values = variable.all(self.settings.evaluations / all.len())?;
            all = all
                .iter()
                .flat_map(|x: &Vec<f64>| values.iter().map(|value| [&x[..], &[*value]].concat()))
                .collect();
        }
        Some(all)
    }

    /// Evaluates scattered designs of a region until there are `count` in all.
    fn scatter(&mut self, center: &[f64], width: f64, count: usize) -> Result<(), Interrupted> {
        while self.samples.len() < count.min(self.settings.evaluations) {
            let left = count - self.samples.len();
            let batch = self.scattered(center, width, left.min(BATCH));
            if batch.is_empty() {
                break;
            }
            self.evaluate(batch)?;
        }
        Ok(())
    }

    /// Allows more evaluations: this many in all.
    pub fn allow(&mut self, evaluations: usize) {
        self.settings.evaluations = evaluations;
    }

    /// Descends once more from the best design, in a narrow region: what outputs mean has changed a
    /// little.
    ///
    /// # Errors
    /// Interruption.
    pub fn refine(&mut self) -> Result<(), Interrupted> {
        self.descend_from_best(REFINED_WIDTH)
    }

    /// Descends once more from the best design, as a start does: it was evaluated after they ended.
    ///
    /// # Errors
    /// Interruption.
    pub fn go_on(&mut self) -> Result<(), Interrupted> {
        self.descend_from_best(FIRST_WIDTH)
    }

    fn descend_from_best(&mut self, width: f64) -> Result<(), Interrupted> {
        if self.complete {
            return Ok(());
        }
        let merits = self.samples.iter().enumerate();
        let merits = merits.filter_map(|(index, s)| Some((self.judged(s)?, index)));
        let best = merits.reduce(|a, b| if better(&b.0, &a.0) { b } else { a });
        if let Some((_, center)) = best {
            self.descend(center, width, self.settings.finest)?;
        }
        Ok(())
    }

    /// The design that breaks those limits least that need no costly outputs, from `given` and from
    /// the sequence's first places.
    #[must_use]
    pub fn least_broken(&self, given: &[f64]) -> (Vec<f64>, Judged) {
        let variables = self.problem.variables();
        let everywhere = (vec![0.0; given.len()], vec![1.0; given.len()]);
        let of = |u: &[f64]| {
            let judged = self.problem.judge(&self.values(u), &[]);
            Judged {
                objectives: vec![0.0],
                ..judged
            }
        };
        let mut random = Random::new(self.settings.seed);
        let mut starts = vec![self.units(given), vec![0.5; given.len()]];
        starts.extend((0..FEASIBLE_STARTS).map(|_| given.iter().map(|_| random.unit()).collect()));
        let mut best = (given.to_vec(), of(&self.units(given)));
        for start in starts {
            if best.1.excess() <= MET {
                break;
            }
            let ended = rounding::climb_whole(variables, &of, &start, &everywhere);
            if let Some(ended) = ended.filter(|e| e.judged.excess() < best.1.excess()) {
                best = (self.values(&ended.u), ended.judged);
            }
        }
        best
    }

    /// Designs that have outputs.
    fn known(&self) -> usize {
        self.samples.iter().filter(|s| s.outputs.is_some()).count()
    }

    fn spent(&self) -> bool {
        self.samples.len() >= self.settings.evaluations
    }

    /// A descent starts from the best design of those that lie far from every end; the first from one far from
    /// where the coarse descent ended, if that is known.
    fn start(&self, number: usize) -> Option<usize> {
        let ends = if number == 0 {
            self.near_given.as_slice()
        } else {
            &self.ends
        };
        let apart = |sample: &Sample| {
            let u = self.units(&sample.x);
            let far = |end: &Vec<f64>| distance(&u, &self.units(end)) > FIRST_WIDTH;
            ends.iter().all(far)
        };
        let judged = self
            .samples
            .iter()
            .enumerate()
            .filter_map(|(index, sample)| {
                let merit = self.judged(sample)?.merit();
                (merit.is_finite() && apart(sample)).then_some((merit, index))
            });
        judged
            .reduce(|a, b| if b.0 > a.0 { b } else { a })
            .map(|(_, index)| index)
    }

    /// Follows the surrogate from sample `center` until the trust region is not wider than `finest`.
    fn descend(&mut self, center: usize, width: f64, finest: f64) -> Result<Vec<f64>, Interrupted> {
        let (mut center, mut width) = (center, width);
        while width > finest && !self.spent() {
            let at = self.units(&self.samples[center].x);
            let Some(surrogate) = self.surrogate() else {
                // Too few designs have outputs: those near one that has are tried first.
                let known = self.known();
                let near = self.scattered(&at, width, BATCH);
                self.evaluate(near)?;
                if self.known() == known {
                    width *= NARROWER;
                }
                continue;
            };
            let now = self
                .judged(&self.samples[center])
                .map_or(f64::NEG_INFINITY, |j| j.merit());
            let inside = self.region(&at, width);
            let mut batch = Vec::new();
            let mut expected = f64::NEG_INFINITY;
            for (part, region) in [(1.0, &inside), (0.5, &self.region(&at, 0.5 * width))] {
                let ended = self.climb(&surrogate, &at, region);
                if let Some(ended) = ended.filter(|ended| ended.judged.merit() > now + NO_GAIN) {
                    if part == 1.0 {
                        expected = ended.judged.merit();
                    }
                    batch.push(ended.u);
                }
            }
            // One far off, where the surrogate promises most.
            if width > 0.1 * FIRST_WIDTH {
                batch.extend(self.far(&surrogate, now));
            }
            let mut batch = self.new_places(batch, NEAR * width);
            let others = self.scattered(&at, width, BATCH - batch.len());
            batch.extend(others);
            let first = self.samples.len();
            if batch.is_empty() {
                width *= NARROWER;
                continue;
            }
            self.evaluate(batch)?;
            let best = (first..self.samples.len())
                .filter_map(|index| Some((self.judged(&self.samples[index])?.merit(), index)))
                .reduce(|a, b| if b.0 > a.0 { b } else { a });
            let Some((merit, index)) = best.filter(|(merit, _)| *merit > now + NO_GAIN) else {
                width *= NARROWER;
                continue;
            };
            let share = (merit - now) / (expected - now);
            center = index;
            let moved = distance(&self.units(&self.samples[index].x), &at);
            if moved > width {
                // From a far place.
                width = width.max(0.5 * FIRST_WIDTH);
            } else if share > GOOD && moved > 0.7 * width {
                width = (width * WIDER).min(WIDEST);
            } else if share < POOR || moved < 0.2 * width {
                width *= NARROWER;
            }
        }
        Ok(self.samples[center].x.clone())
    }

    /// Where climbs from places drawn over all ranges end that the surrogate promises most of, above `now`.
    fn far(&mut self, surrogate: &Surrogate, now: f64) -> Option<Vec<f64>> {
        let size = self.problem.variables().len();
        let everywhere = (vec![0.0; size], vec![1.0; size]);
        let starts: Vec<_> = (0..FAR_STARTS)
            .map(|_| self.random_place(&everywhere))
            .collect();
        let ends = starts
            .iter()
            .filter_map(|from| self.climb(surrogate, from, &everywhere));
        let promised = ends.map(|end| (end.judged.merit(), end.u));
        let best = promised.reduce(|a, b| if b.0 > a.0 { b } else { a });
        best.filter(|(merit, _)| *merit > now).map(|(_, u)| u)
    }

    /// The surrogate of all outputs.
    #[must_use]
    pub fn surrogate(&self) -> Option<Surrogate> {
        let known = self
            .samples
            .iter()
            .filter_map(|s| Some((self.units(&s.x), s.outputs.clone()?)));
        let (centers, values): (Vec<_>, Vec<_>) = known.unzip();
        Surrogate::new(centers, &values)
    }

    /// The best place of a region by the surrogate, from the region's centre and from chance, whole
    /// variables whole.
    fn climb(&self, surrogate: &Surrogate, from: &[f64], region: &Region) -> Option<Ended> {
        let of = |u: &[f64]| self.estimated(surrogate, u);
        rounding::climb_whole(self.problem.variables(), &of, from, region)
    }

    /// Objective and limits at `u` as the surrogate has them.
    #[must_use]
    pub fn estimated(&self, surrogate: &Surrogate, u: &[f64]) -> Judged {
        self.problem.judge(&self.values(u), &surrogate.at(u))
    }

    /// The best design by the surrogate near a sample when some limits or variables are otherwise:
    /// `judge` takes the place of the problem's, `fixed` holds variables at values.
    #[must_use]
    pub fn climb_otherwise(
        &self,
        surrogate: &Surrogate,
        judge: &dyn Fn(&[f64], &[f64]) -> Judged,
        from: &[f64],
        fixed: &[(usize, f64)],
    ) -> Option<(Vec<f64>, Ended)> {
        let variables = self.problem.variables();
        let mut start = self.units(from);
        let (mut low, mut high) = (vec![0.0; start.len()], vec![1.0; start.len()]);
        for (index, value) in fixed {
            let at = variables[*index].unit(*value);
            (start[*index], low[*index], high[*index]) = (at, at, at);
        }
        let of = |u: &[f64]| judge(&self.values(u), &surrogate.at(u));
        let ended = rounding::climb_whole(variables, &of, &start, &(low, high))?;
        Some((self.values(&ended.u), ended))
    }

    /// The region of this half width about `center`; whole variables may move by one at least.
    fn region(&self, center: &[f64], width: f64) -> Region {
        let ends = |(u, variable): (&f64, &Variable)| {
            let x = variable.value(*u);
            let room = 1e-6 * (variable.high - variable.low);
            let next = match &variable.values {
                Values::Continuous => [x, x],
                Values::Whole => [x - 1.0, x + 1.0],
                Values::Listed(_) => [
                    variable.neighbours(x - 3.0 * room)[0],
                    variable.neighbours(x + 3.0 * room)[1],
                ],
            };
            let [below, above] = next.map(|x| variable.unit(x));
            (
                (u - width).min(below).max(0.0),
                (u + width).max(above).min(1.0),
            )
        };
        center
            .iter()
            .zip(self.problem.variables())
            .map(ends)
            .unzip()
    }

    fn random_place(&mut self, (low, high): &Region) -> Vec<f64> {
        let variables = self.problem.variables();
        let place = low
            .iter()
            .zip(high)
            .map(|(low, high)| self.random.between(*low, *high));
        let place: Vec<f64> = place.collect();
        place
            .iter()
            .zip(variables)
            .map(|(u, variable)| variable.nearest(*u))
            .collect()
    }

    /// At most `count` places of a region that are farthest from all samples and from each other,
    /// among those that break cheap limits little.
    fn scattered(&mut self, center: &[f64], width: f64, count: usize) -> Vec<Vec<f64>> {
        let region = self.region(center, width);
        let places: Vec<_> = (0..SCATTERED).map(|_| self.random_place(&region)).collect();
        let surrogate = self.surrogate();
        let none = vec![f64::NAN; 0];
        let broken = |u: &[f64]| match &surrogate {
            Some(surrogate) => self.estimated(surrogate, u).excess(),
            None => self.problem.judge(&self.values(u), &none).excess(),
        };
        let mut rated: Vec<(f64, Vec<f64>)> = places.into_iter().map(|u| (broken(&u), u)).collect();
        rated.sort_by(|a, b| a.0.total_cmp(&b.0));
        rated.truncate(SCATTERED / 4);
        let mut known: Vec<_> = self.samples.iter().map(|s| self.units(&s.x)).collect();
        let mut chosen = Vec::new();
        for _ in 0..count {
            let gap = |u: &[f64]| {
                known
                    .iter()
                    .map(|k| distance(u, k))
                    .fold(f64::INFINITY, f64::min)
            };
            let best = rated
                .iter()
                .map(|(_, u)| (gap(u), u))
                .reduce(|a, b| if b.0 > a.0 { b } else { a });
            let Some((gap, u)) = best else { break };
            if gap < NEAR * width {
                break;
            }
            known.push(u.clone());
            chosen.push(u.clone());
        }
        chosen.iter().map(|u| self.values(u)).collect()
    }

    /// Those places, in the variables' units, that are far enough from all samples and each other.
    fn new_places(&self, places: Vec<Vec<f64>>, apart: f64) -> Vec<Vec<f64>> {
        let mut known: Vec<_> = self.samples.iter().map(|s| self.units(&s.x)).collect();
        let mut chosen = Vec::new();
        for u in places {
            if known.iter().all(|k| distance(k, &u) > apart) {
                chosen.push(self.values(&u));
                known.push(u);
            }
        }
        chosen
    }

    /// Evaluates designs as they are made, but for those that were evaluated before, on all cores; returns nothing
    /// where interrupted but keeps those that are complete.
    ///
    /// # Errors
    /// Interruption.
    pub fn evaluate(&mut self, designs: Vec<Vec<f64>>) -> Result<(), Interrupted> {
        let made = designs.iter().map(|x| self.problem.made(x));
        let mut designs: Vec<Vec<f64>> = made.collect();
        designs.retain(|x| self.samples.iter().all(|sample| sample.x != *x));
        designs.dedup();
        designs.truncate(
            self.settings
                .evaluations
                .saturating_sub(self.samples.len())
                .max(1),
        );
        let outputs: Vec<_> = designs
            .par_iter()
            .map(|x| self.problem.outputs(x))
            .collect();
        for (x, outputs) in designs.into_iter().zip(outputs) {
            let outputs = outputs?.filter(|all| all.iter().all(|value| value.is_finite()));
            self.samples.push(Sample { x, outputs });
        }
        let best = self.best().filter(|(_, judged)| judged.excess() <= MET);
        let best = best.map(|(_, judged)| judged.objective());
        self.problem.report(self.samples.len(), best);
        Ok(())
    }

    /// Coordinates in 0 to 1.
    #[must_use]
    pub fn units(&self, x: &[f64]) -> Vec<f64> {
        let variables = self.problem.variables();
        x.iter()
            .zip(variables)
            .map(|(x, variable)| variable.unit(*x))
            .collect()
    }

    fn values(&self, u: &[f64]) -> Vec<f64> {
        let variables = self.problem.variables();
        let value = |(u, variable): (&f64, &Variable)| match variable.values {
            Values::Continuous => variable.value(*u),
            Values::Whole | Values::Listed(_) => {
                let x = variable.value(*u);
                let near = variable.nearest_value(x);
                // Relaxed values stay as they are.
                if (near - x).abs() < WHOLE * (variable.high - variable.low) {
                    near
                } else {
                    x
                }
            }
        };
        u.iter().zip(variables).map(value).collect()
    }
}

/// Whether `a` is to be preferred: a design within its limits, then the larger objective.
fn better(a: &Judged, b: &Judged) -> bool {
    match (a.excess() <= MET, b.excess() <= MET) {
        (true, false) => true,
        (false, true) => false,
        (true, true) => a.objective() > b.objective(),
        (false, false) => a.merit() > b.merit(),
    }
}

/// The largest difference of a coordinate.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}
