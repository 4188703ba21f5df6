//! The search itself: every choice begins, the better half goes on, the best is made at full accuracy.

use std::collections::BTreeMap;

use serde::Serialize;

use fluxform_base::progress::{Interrupted, interruptible, to_its_end};
use fluxform_design::Design;
use fluxform_numerics::mixed_search::{MET, Problem, Search, Settings};

use super::choice::{Choice, choices};
use super::problem::{ArrayProblem, Bounded, Level, Objective, Physical, Physics, Room, in_ranges};
use super::space::Space;
use crate::limits::LimitName;

/// Why no search begins where no key varies.
pub const NOTHING_SEARCHED: &str =
    "nothing is searched: add [search] with a range for a key, like array.pitch_mm = [40, 60]";

/// The settings of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// The objective.
    pub objective: Objective,
    /// Evaluations, starts and seed.
    pub settings: Settings,
    /// Where cores and shapes may reach.
    pub room: Room,
    /// Whether the best choice of every number of coils is searched to its end, not the best of all alone.
    pub every_count: bool,
}

/// Why there is no search.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refused {
    /// Keys or ranges.
    #[error("{0}")]
    Space(String),
    /// No design within the ranges meets the limits that need no forces.
    #[error(
        "no design within [search] meets {limits}; the nearest, {nearest}, has {broken}: widen the ranges or relax a limit"
    )]
    Contradiction {
        /// The limits that contradict each other or the ranges.
        limits: String,
        /// The design that breaks them least.
        nearest: String,
        /// By how much.
        broken: String,
    },
    /// The given design renders nothing that it could be compared with.
    #[error(
        "the given design renders no force for {0}, so there is nothing to compare with: check magnet.polarity (\"repel\" for drivers that do not reverse), lower the shapes, or raise the limits of [supply]"
    )]
    NothingRendered(String),
}

/// A design with what was computed of it.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Its variables, as made.
    pub x: Vec<f64>,
    /// The computed arrays.
    pub physical: Physical,
    /// Its limits.
    pub bounds: Vec<Bounded>,
    /// To which accuracy.
    pub level: Level,
}

impl Candidate {
    /// Whether every limit is met.
    #[must_use]
    pub fn is_feasible(&self) -> bool {
        self.bounds.iter().all(Bounded::is_met)
    }

    /// The larger, the better: whether it meets every limit, at least those that were not given up, whether it is in the
    /// search's ranges, then its merit.
    fn rank(&self, problem: &ArrayProblem) -> (bool, bool, bool, f64) {
        let judged = problem.judged(Some(&self.physical), &self.bounds);
        let keeps_others = self.bounds.iter().all(Bounded::is_met_or_given_up);
        let ranged = in_ranges(&self.bounds);
        (self.is_feasible(), keeps_others, ranged, judged.merit())
    }

    /// The design at `x` to full accuracy.
    fn of(problem: &ArrayProblem, x: &[f64], physical: Physical) -> Self {
        let x = problem.made(x);
        Self {
            bounds: problem.bounds(&x, Some(&physical)),
            x,
            physical,
            level: Level::Full,
        }
    }

    /// The given design, as far as the search's ranges hold it, where that is of the problem's choice and meets every
    /// limit.
    fn given(problem: &ArrayProblem, design: &Design) -> Result<Option<Self>, Interrupted> {
        if !problem.space.holds(design) {
            return Ok(None);
        }
        let x = problem.space.given(design);
        let physical = problem.compute_fully(&x)?;
        let given = physical.map(|physical| Self::of(problem, &x, physical));
        Ok(given.filter(Self::is_feasible))
    }
}

/// What has no order in a search: layout, magnet, core and plate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArrayChoice {
    /// Rows and columns; null where the positions are the design's own.
    pub rows_columns: Option<[usize; 2]>,
    /// How they lie; null where that is as given.
    pub layout: Option<&'static str>,
    /// Diameter and length of the magnet, m.
    pub magnet_m: [f64; 2],
    /// Whether there are cores.
    pub core: bool,
    /// Whether there is a plate.
    pub plate: bool,
}

impl ArrayChoice {
    /// That of a space.
    pub(super) fn of(space: &Space) -> Self {
        let base = space.base();
        Self {
            rows_columns: space.layout().map(|(_, counts)| counts),
            layout: space.layout().map(|(layout, _)| layout.into()),
            magnet_m: [base.magnet.diameter_m, base.magnet.length_m],
            core: base.core.is_some(),
            plate: base.plate.is_some(),
        }
    }
}

/// A choice of layout, magnet and core, and the best array of it that was computed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SearchedChoice {
    /// Coils of the array.
    pub coils: usize,
    /// What it is.
    #[serde(flatten)]
    pub choice: ArrayChoice,
    /// Arrays of it that were computed.
    pub evaluations: usize,
    /// The largest objective within the limits; null where none was met. At the accuracy of the search where this choice
    /// was not searched to its end and no trade-offs are requested.
    pub objective: Option<f64>,
    /// The array, by key.
    pub values: BTreeMap<String, f64>,
    /// Whether every array of it was computed.
    #[serde(skip)]
    pub complete: bool,
}

impl SearchedChoice {
    fn of(problem: &ArrayProblem, search: &Search) -> Self {
        let space = &problem.space;
        let best = problem.best(search);
        let values = best
            .as_ref()
            .map_or_else(BTreeMap::new, |(sample, _)| space.named(&sample.x));
        let met = best.filter(|(_, judged)| judged.excess() <= MET);
        Self {
            coils: space.coils(),
            choice: ArrayChoice::of(space),
            evaluations: search.samples().len(),
            objective: met.map(|(_, judged)| judged.objective().exp()),
            values,
            complete: search.is_complete(),
        }
    }
}

/// A choice that was searched to its end beside the best one.
pub struct Finished<'a> {
    /// Its problem.
    pub problem: &'a ArrayProblem<'a>,
    /// The search over it.
    pub search: Search<'a>,
    /// Its best design.
    pub best: Candidate,
}

/// The result of a search.
pub struct Found<'a> {
    /// The problem of the best choice.
    pub problem: &'a ArrayProblem<'a>,
    /// The search over it.
    pub search: Search<'a>,
    /// The best design.
    pub best: Candidate,
    /// Evaluations of all choices.
    pub evaluations: usize,
    /// Every choice that was searched.
    pub choices: Vec<SearchedChoice>,
    /// The best choices of other numbers of coils, where these were searched to their end.
    pub others: Vec<Finished<'a>>,
    /// Whether every number of coils was to be searched to its end.
    pub every_count: bool,
    /// Whether it was interrupted.
    pub interrupted: bool,
}

impl Found<'_> {
    /// Goes on from a better design than the best one, where one has been computed since that was accepted, with at
    /// most this many evaluations; whether a better one is accepted now.
    ///
    /// # Errors
    /// Interruption.
    pub(super) fn go_on(&mut self, evaluations: usize) -> Result<bool, Interrupted> {
        let known = self.best.rank(self.problem);
        let since = self
            .problem
            .best(&self.search)
            .filter(|(_, judged)| judged.excess() <= MET);
        if since.is_none_or(|(_, judged)| judged.merit() <= known.3 + WORTH) {
            return Ok(false);
        }
        let before = self.search.samples().len();
        self.search.allow(before + evaluations);
        self.search.go_on()?;
        let accepted = accept(self.problem, &mut self.search, None)?;
        self.evaluations += self.search.samples().len() - before;
        let Some(best) = accepted.filter(|best| best.rank(self.problem) > known) else {
            return Ok(false);
        };
        self.best = best;
        self.choices[0] = SearchedChoice::of(self.problem, &self.search);
        Ok(true)
    }
}

/// Relative gain of the objective for which the search goes on.
const WORTH: f64 = 1e-3;
/// Descents to the limits of full accuracy.
const CORRECTIONS: usize = 4;
/// Evaluations of each, at most.
const CORRECTING: usize = 24;
/// Evaluations that every one of several choices has at least, per variable and in all.
const LEAST_EVALUATIONS: usize = 16;

/// What is searched.
pub struct Problems<'a> {
    /// A problem a choice.
    pub all: Vec<ArrayProblem<'a>>,
    /// Choices of which there is no array, and why.
    pub refused: Vec<String>,
}

/// The problems of every choice, after what can be known without forces.
///
/// # Errors
/// Keys, ranges and limits that contradict each other, in every choice.
pub fn problems<'a>(
    design: &Design,
    request: &Request,
    reference: &[f64],
    physics: &'a dyn Physics,
) -> Result<Problems<'a>, Refused> {
    let made = |choice: Choice| {
        let space = Space::new(design, &design.search, &choice).map_err(Refused::Space);
        let objective = request.objective.clone();
        let problem = space
            .map(|space| ArrayProblem::new(space, physics, objective, reference, request.room));
        (choice, problem)
    };
    let made = choices(design, &design.search).into_iter().map(made);
    let made: Vec<(Choice, Result<ArrayProblem, Refused>)> = made.collect();
    let unchanged = made
        .iter()
        .flat_map(|(_, problem)| problem)
        .map(ArrayProblem::unchanged_limits);
    let unchanged = unchanged.reduce(|known, other| {
        known
            .into_iter()
            .filter(|bound| other.contains(bound))
            .collect()
    });
    let mut faults = Vec::new();
    let mut all = Vec::new();
    for (choice, problem) in made {
        let searched = problem.and_then(|mut problem| {
            let keys = unchanged.iter().flatten().map(|bound| bound.key);
            keys.for_each(|key| problem.leave_out(key));
            possible(problem, design, request)
        });
        match searched {
            Ok(problem) => all.push(problem),
            Err(refused) => faults.push((choice, refused)),
        }
    }
    let refused = faults
        .iter()
        .map(|(choice, refused)| format!("{}: {refused}", choice.described()));
    let refused = refused.collect();
    match faults.into_iter().next() {
        Some((_, refused)) if all.is_empty() => Err(refused),
        _ if all.len() == 1 && all[0].space.axes().is_empty() => {
            Err(Refused::Space(NOTHING_SEARCHED.to_owned()))
        }
        _ => Ok(Problems { all, refused }),
    }
}

/// `problem`, if any of its designs meets the limits that need no forces.
fn possible<'a>(
    problem: ArrayProblem<'a>,
    design: &Design,
    request: &Request,
) -> Result<ArrayProblem<'a>, Refused> {
    let given = problem.space.given(design);
    let search = Search::new(&problem, request.settings);
    let (x, judged) = search.least_broken(&given);
    if judged.excess() <= MET {
        return Ok(problem);
    }
    let nearest = problem.space.axes().iter().zip(&x);
    let nearest: Vec<String> = nearest
        .map(|(axis, x)| format!("{} = {}", axis.key(), short(*x)))
        .collect();
    let bounds = problem.bounds(&x, None);
    let broken = bounds.iter().filter(|bound| bound.is_broken());
    let broken: Vec<String> = broken
        .map(|bound| format!("{} {}", label(bound), in_unit(bound, bound.value)))
        .collect();
    let limits: Vec<String> = contradicting(problem, &given, &bounds, request.settings)
        .iter()
        .map(|bound| {
            let sign = if bound.at_least { ">=" } else { "<=" };
            format!("{} {sign} {}", label(bound), in_unit(bound, bound.limit))
        })
        .collect();
    Err(Refused::Contradiction {
        limits: limits.join(" and "),
        nearest: nearest.join(", "),
        broken: broken.join(", "),
    })
}

/// Limits that cannot be met together, whereas they can without any one of them; `nearest` are the limits of the
/// design that breaks them least.
fn contradicting(
    mut problem: ArrayProblem<'_>,
    given: &[f64],
    nearest: &[Bounded],
    settings: Settings,
) -> Vec<Bounded> {
    for bound in nearest {
        problem.leave_out(bound.key);
        let (_, judged) = Search::new(&problem, settings).least_broken(given);
        if judged.excess() <= MET {
            problem.take_in(bound.key);
        }
    }
    let left: Vec<&'static str> = problem.bounds(given, None).iter().map(|b| b.key).collect();
    // The ranges of layers and turns end at the coil's limits, whatever is left out.
    let ends_range = |bound: &Bounded| {
        let range = if bound.name == Some(LimitName::OuterDiameter) {
            "search.coil.outer_diameter_mm"
        } else if bound.name == Some(LimitName::Length) {
            "search.coil.length_mm"
        } else {
            return false;
        };
        let low = nearest.iter().find(|b| b.key == range && b.at_least);
        left.contains(&range) && low.is_some_and(|low| low.limit > bound.limit * 1e3)
    };
    let needed = nearest.iter().filter(|bound| {
        // Of a range the end that is broken.
        let broken = bound.excess() > 0.0 || !bound.key.starts_with("search.");
        (left.contains(&bound.key) && broken) || ends_range(bound)
    });
    needed.copied().collect()
}

/// What the user wrote, or would write, for a limit.
fn label(bound: &Bounded) -> &'static str {
    bound.name.map_or(bound.key, |name| name.limit().label)
}

/// In the unit of a limit's design key.
fn in_unit(bound: &Bounded, value: f64) -> String {
    let (unit, per_unit) = match bound.name {
        Some(name) => name.limit().written,
        None if bound.key.ends_with("_m") => ("mm", 1e3),
        None => ("mm", 1.0),
    };
    format!("{} {unit}", short(value * per_unit))
}

/// Four digits.
fn short(value: f64) -> String {
    let rounded = format!("{value:.3e}");
    rounded
        .parse::<f64>()
        .map_or(rounded, |value| value.to_string())
}

/// Searches the best choice of every number of coils but the first choice's to its end: which these are, each with
/// its best design, how many arrays that took, and whether it was interrupted.
fn finish_counts(
    problems: &[ArrayProblem<'_>],
    design: &Design,
    settings: Settings,
    first: usize,
    left_out: &mut [(usize, Search<'_>)],
) -> (Vec<(usize, Candidate)>, usize, bool) {
    let coils = |index: usize| problems[index].space.coils();
    let (mut done, mut evaluations) = (vec![coils(first)], 0);
    let mut finished = Vec::new();
    for (other, search) in left_out.iter_mut().rev() {
        if done.contains(&coils(*other)) {
            continue;
        }
        done.push(coils(*other));
        let problem = &problems[*other];
        let before = search.samples().len();
        search.allow(settings.evaluations);
        let ended = interruptible(|| {
            search.run(&[problem.space.given(design)])?;
            accept(problem, search, Some(design))
        });
        evaluations += search.samples().len() - before;
        match ended.and_then(|ended| ended) {
            Ok(best) => finished.extend(best.map(|best| (*other, best))),
            Err(Interrupted) => return (finished, evaluations, true),
        }
    }
    (finished, evaluations, false)
}

/// Arrays of each of so many choices while these are compared.
fn compared_each(going: usize, settings: Settings) -> usize {
    (settings.evaluations / (2 * going)).max(LEAST_EVALUATIONS)
}

/// Arrays of all of so many choices that are computed before one of them is searched to its end.
#[must_use]
pub fn compared(choices: usize, settings: Settings) -> usize {
    let (mut going, mut all) = (choices, 0);
    while going > 1 {
        all += going * compared_each(going, settings);
        going = going.div_ceil(2);
    }
    all
}

/// Searches all that are `going` with ever more evaluations until one is left; those left out, the worst first, the
/// evaluations, and whether it was interrupted.
fn halved<'a>(
    problems: &'a [ArrayProblem<'a>],
    design: &Design,
    settings: Settings,
    going: &mut Vec<(usize, Search<'a>)>,
) -> (Vec<(usize, Search<'a>)>, usize, bool) {
    let mut evaluations = 0;
    let mut left_out: Vec<(usize, Search<'a>)> = Vec::new();
    let mut interrupted = false;
    // The better half goes on with twice as many evaluations each.
    while going.len() > 1 && !interrupted {
        let each = compared_each(going.len(), settings);
        for (index, search) in going.iter_mut() {
            let before = search.samples().len();
            search.allow(before + each);
            interrupted = is_stopped(|| search.run(&[problems[*index].space.given(design)]));
            evaluations += search.samples().len() - before;
            if interrupted {
                break;
            }
        }
        let merit = |search: &Search| {
            search
                .best()
                .map_or(f64::NEG_INFINITY, |(_, judged)| judged.merit())
        };
        going.sort_by(|a, b| merit(&b.1).total_cmp(&merit(&a.1)).then(a.0.cmp(&b.0)));
        let worse = going.split_off(going.len().div_ceil(2));
        left_out.extend(worse.into_iter().rev());
    }
    (left_out, evaluations, interrupted)
}

/// Searches every problem and computes the best design to full accuracy.
///
/// # Errors
/// Interruption before anything is known.
pub fn run<'a>(
    problems: &'a [ArrayProblem<'a>],
    design: &Design,
    request: &Request,
) -> Result<Option<Found<'a>>, Interrupted> {
    let settings = request.settings;
    let mut going: Vec<(usize, Search<'a>)> = problems
        .iter()
        .enumerate()
        .map(|(index, problem)| (index, Search::new(problem, settings)))
        .collect();
    let (mut left_out, mut evaluations, mut interrupted) =
        halved(problems, design, settings, &mut going);
    let Some(mut chosen) = going.into_iter().next() else {
        return Ok(None);
    };
    let accepted = match interrupted {
        false => interruptible(|| {
            let all = (problems, &mut left_out[..]);
            run_to_end(all, &mut chosen, design, settings, &mut evaluations)
        })
        .and_then(|accepted| accepted),
        true => Err(Interrupted),
    };
    interrupted |= accepted.is_err();
    let (index, search) = chosen;
    let problem = &problems[index];
    let mut finished = Vec::new();
    if request.every_count && !interrupted {
        let (others, more, stopped) =
            finish_counts(problems, design, settings, index, &mut left_out);
        finished = others;
        evaluations += more;
        let made_known =
            |(index, search): &(usize, Search<'_>)| know_best(&problems[*index], search);
        interrupted = stopped || is_stopped(|| left_out.iter().try_for_each(made_known));
    }
    let (best, choices) = to_its_end(|| {
        let best = accepted.unwrap_or_else(|Interrupted| searched(problem, &search));
        let all = std::iter::once((index, &search)).chain(
            left_out
                .iter()
                .rev()
                .map(|(index, search)| (*index, search)),
        );
        let choices: Vec<_> = all
            .map(|(index, search)| SearchedChoice::of(&problems[index], search))
            .collect();
        (best, choices)
    });
    let others = left_out.into_iter().filter_map(|(index, search)| {
        let at = finished.iter().position(|(other, _)| *other == index)?;
        Some(Finished {
            problem: &problems[index],
            search,
            best: finished.swap_remove(at).1,
        })
    });
    let others = others.collect();
    Ok(best.map(|best| Found {
        problem,
        search,
        best,
        evaluations,
        choices,
        others,
        every_count: request.every_count,
        interrupted,
    }))
}

/// Searches the `chosen` problem to its end; its best design, or the given one where that is better: of a choice that
/// was left out, it takes the place of the chosen one.
fn run_to_end<'a>(
    (problems, left_out): (&'a [ArrayProblem<'a>], &mut [(usize, Search<'a>)]),
    chosen: &mut (usize, Search<'a>),
    design: &Design,
    settings: Settings,
    evaluations: &mut usize,
) -> Result<Option<Candidate>, Interrupted> {
    let (index, search) = chosen;
    let problem = &problems[*index];
    let before = search.samples().len();
    search.allow(settings.evaluations.max(before + LEAST_EVALUATIONS));
    let ended = interruptible(|| {
        search.run(&[problem.space.given(design)])?;
        accept(problem, search, Some(design))
    });
    *evaluations += search.samples().len() - before;
    let best = ended.and_then(|ended| ended)?;
    let holds = |(index, _): &&mut (usize, Search)| problems[*index].space.holds(design);
    let Some(own) = left_out.iter_mut().find(holds) else {
        return Ok(best);
    };
    let given = Candidate::given(&problems[own.0], design)?;
    let rank = best.as_ref().map(|best| best.rank(problem));
    Ok(match given {
        Some(given) if Some(given.rank(&problems[own.0])) > rank => {
            std::mem::swap(chosen, own);
            Some(given)
        }
        _ => best,
    })
}

/// Computes the best design of a search to full accuracy, and what is the best then.
fn know_best(problem: &ArrayProblem, search: &Search) -> Result<(), Interrupted> {
    for _ in 0..CORRECTIONS {
        match problem.best(search) {
            Some((sample, _)) if !problem.is_known_fully(&sample.x) => {
                problem.compute_fully(&sample.x)?;
            }
            _ => break,
        }
    }
    Ok(())
}

/// Whether the user's stop ended `search`, wherever it was.
fn is_stopped<T>(search: impl FnOnce() -> Result<T, Interrupted>) -> bool {
    interruptible(search).and_then(|ended| ended).is_err()
}

/// The best design as the search knows it.
fn searched(problem: &ArrayProblem, search: &Search) -> Option<Candidate> {
    let (sample, _) = problem.best(search)?;
    let physical = problem.properties(sample)?;
    Some(Candidate {
        bounds: problem.bounds(&sample.x, Some(&physical)),
        x: sample.x.clone(),
        physical,
        level: Level::Search,
    })
}

/// The best design computed to full accuracy; where that breaks a limit, the search goes on with
/// what full accuracy adds. The given design, if any, where that is better: the search's accuracy may mistake others
/// for better ones.
fn accept(
    problem: &ArrayProblem,
    search: &mut Search,
    given: Option<&Design>,
) -> Result<Option<Candidate>, Interrupted> {
    if problem.give_up_unmet(search) {
        search.allow(search.samples().len() + CORRECTING);
        search.refine()?;
    }
    let mut best: Option<Candidate> = None;
    for _ in 0..CORRECTIONS {
        let Some((sample, _)) = problem.best(search) else {
            break;
        };
        let (x, Some(outputs)) = (sample.x.clone(), sample.outputs.clone()) else {
            break;
        };
        let Some(physical) = problem.correct(&x, &outputs)? else {
            break;
        };
        let candidate = Candidate::of(problem, &x, physical);
        let better = (best.as_ref()).is_none_or(|b| candidate.rank(problem) > b.rank(problem));
        let same = best.as_ref().is_some_and(|b| b.x == candidate.x);
        if better {
            best = Some(candidate);
        }
        if same {
            break;
        }
        search.allow(search.samples().len() + CORRECTING);
        search.refine()?;
    }
    let rank = best.as_ref().map(|best| best.rank(problem));
    let given = match given {
        Some(design) => Candidate::given(problem, design)?,
        None => None,
    };
    Ok(given
        .filter(|given| Some(given.rank(problem)) > rank)
        .or(best))
}
