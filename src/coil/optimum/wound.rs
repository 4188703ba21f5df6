//! The best coil that can be wound: whole layers, whole turns a layer, any bore.
//!
//! OD = ID + 2 n d and L = m d. Sets of coils wait in the order of an upper bound of their force. The
//! first is taken apart until it is one coil with its best bore, and a coil that no waiting set can
//! exceed is the next strongest. Coils in air are bounded by interval arithmetic
//! (`bounded_coils`), cored ones by cheaper models (`screened_coils`). The search ends where what
//! waits lacks more than [`SHARE`] of the best, or with as many coils worth a look as are listed.

use std::cmp::Ordering;
use std::collections::{BTreeSet, BinaryHeap};

use rayon::prelude::*;

use super::bounded_coils::{BoundedCoils, next_to_continuous};
use super::branch::{self, GAP};
use super::candidates::{
    Leaf, Listed, SHARE, WoundOutcome, around_optimum, describe, rounded_status,
};
use super::model::CoilModel;
use super::outcome::{Certificate, CertificateKind, Status};
use super::problem::{Problem, Task};
use super::screened_coils;
use super::search::{self, Settings, Solved};
use fluxform_base::progress::{Interrupted, Progress};

/// Slack, in turns, of a dimension that must be a whole number of them.
pub(super) const WHOLE: f64 = 1e-9;
/// Sets taken apart at a time; fixed, so that results do not depend on the threads.
const AT_A_TIME: usize = 32;

/// How many whole wires fit, at least one.
pub(super) fn whole(ratio: f64) -> u64 {
    (ratio + WHOLE).floor().clamp(1.0, 1e15) as u64
}

/// One problem's coils as sets that can be bounded and taken apart.
pub(super) trait CoilSets: Sync {
    type Set: Send + Sync;

    fn problem(&self) -> &Problem<'_>;

    /// Sets that hold every coil whose ln F may reach `enough_ln`.
    fn all(&self, enough_ln: f64) -> Parts<Self::Set>;

    /// What a set holds that may reach `enough_ln`.
    fn parts(&self, set: &Self::Set, enough_ln: f64) -> Parts<Self::Set>;
}

/// What a set of coils was taken apart into.
pub(super) struct Parts<S> {
    /// Smaller sets, each with an upper bound of ln F.
    pub sets: Vec<(f64, S)>,
    /// Coils with their best bores.
    pub coils: Vec<Leaf>,
    /// Upper bound of ln F of what is in neither.
    pub bound_ln: f64,
    /// Boxes bounded or coils examined on the way.
    pub cells: usize,
}

impl<S> Default for Parts<S> {
    fn default() -> Self {
        Self {
            sets: Vec::new(),
            coils: Vec::new(),
            bound_ln: f64::NEG_INFINITY,
            cells: 0,
        }
    }
}

enum Content<S> {
    Set(S),
    Coil(Leaf),
}

/// What waits to be taken apart or listed: strongest first, then earliest.
struct Waiting<S> {
    bound_ln: f64,
    order: usize,
    /// Index of its problem.
    of: usize,
    content: Content<S>,
}

impl<S> Ord for Waiting<S> {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_bound = self.bound_ln.total_cmp(&other.bound_ln);
        by_bound.then(other.order.cmp(&self.order))
    }
}

impl<S> PartialOrd for Waiting<S> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<S> PartialEq for Waiting<S> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<S> Eq for Waiting<S> {}

/// The search over all problems' coils.
pub(super) struct Strongest<'a, C: CoilSets> {
    problems: &'a [C],
    queue: BinaryHeap<Waiting<C::Set>>,
    order: usize,
    /// ln F of the strongest coil met.
    best_ln: f64,
    /// The strongest coils.
    pub listed: Listed,
    listed_pairs: BTreeSet<(usize, u64, u64)>,
    /// No coil's ln F exceeds this or the best one's.
    pub bound_ln: f64,
    /// Boxes bounded or coils examined.
    pub cells: usize,
}

impl<'a, C: CoilSets> Strongest<'a, C> {
    /// Searches among `problems`' coils, one of which has `best_ln`, taking at most `budget` sets apart.
    ///
    /// # Errors
    /// Interruption.
    pub fn of(
        problems: &'a [C],
        best_ln: f64,
        budget: usize,
        progress: &dyn Progress,
    ) -> Result<Self, Interrupted> {
        let mut search = Self {
            problems,
            queue: BinaryHeap::new(),
            order: 0,
            best_ln,
            listed: Listed::default(),
            listed_pairs: BTreeSet::new(),
            bound_ln: f64::NEG_INFINITY,
            cells: 0,
        };
        for (of, problem) in problems.iter().enumerate() {
            progress.check()?;
            let parts = problem.all(search.enough_ln());
            search.add(of, parts);
        }
        search.run(budget, progress)?;
        Ok(search)
    }

    fn enough_ln(&self) -> f64 {
        self.best_ln + (-SHARE).ln_1p()
    }

    fn add(&mut self, of: usize, parts: Parts<C::Set>) {
        self.cells += parts.cells;
        self.bound_ln = self.bound_ln.max(parts.bound_ln);
        for leaf in &parts.coils {
            self.best_ln = self.best_ln.max(leaf.ln_force);
        }
        let enough_ln = self.enough_ln();
        let coils = parts.coils.into_iter();
        let coils = coils.map(|leaf| (leaf.ln_force, Content::Coil(leaf)));
        let sets = parts.sets.into_iter();
        let sets = sets.map(|(bound_ln, set)| (bound_ln, Content::Set(set)));
        for (bound_ln, content) in sets.chain(coils) {
            if bound_ln >= enough_ln {
                self.order += 1;
                self.queue.push(Waiting {
                    bound_ln,
                    order: self.order,
                    of,
                    content,
                });
            }
        }
    }

    fn list(&mut self, of: usize, leaf: &Leaf) {
        let fresh = self.listed_pairs.insert((of, leaf.layers, leaf.turns));
        if let (true, Some(coil)) = (fresh, describe(self.problems[of].problem(), leaf)) {
            self.listed.add(coil);
        }
    }

    fn run(&mut self, budget: usize, progress: &dyn Progress) -> Result<(), Interrupted> {
        let mut taken = 0;
        while let Some(first) = self.queue.pop() {
            let enough_ln = self.enough_ln();
            if first.bound_ln < enough_ln || self.listed.is_full() {
                break;
            }
            let set = match first.content {
                Content::Coil(leaf) => {
                    self.list(first.of, &leaf);
                    continue;
                }
                Content::Set(set) => set,
            };
            progress.check()?;
            if taken >= budget {
                self.give_up(first.bound_ln);
                break;
            }
            let mut sets = vec![(first.of, set)];
            while sets.len() < AT_A_TIME {
                let Some(next) = self.queue.pop() else { break };
                match next.content {
                    Content::Set(set) if next.bound_ln >= enough_ln => sets.push((next.of, set)),
                    Content::Set(_) | Content::Coil(_) => {
                        self.queue.push(next);
                        break;
                    }
                }
            }
            taken += sets.len();
            let parts: Vec<Result<Parts<C::Set>, Interrupted>> = sets
                .par_iter()
                .map(|(of, set)| {
                    progress.check()?;
                    Ok(self.problems[*of].parts(set, enough_ln))
                })
                .collect();
            for ((of, _), parts) in sets.iter().zip(parts) {
                self.add(*of, parts?);
            }
        }
        Ok(())
    }

    /// Lists the coils met so far; what waits is bounded by `bound_ln`.
    fn give_up(&mut self, bound_ln: f64) {
        self.bound_ln = self.bound_ln.max(bound_ln);
        for waiting in std::mem::take(&mut self.queue)
            .into_sorted_vec()
            .iter()
            .rev()
        {
            if let Content::Coil(leaf) = &waiting.content
                && leaf.ln_force >= self.enough_ln()
            {
                self.list(waiting.of, leaf);
            }
        }
    }
}

/// Maximises |force| over the coils that can be wound within `task`. Coils for which no bounds
/// exist, cored ones, are examined one by one ([`super::screened_coils`]).
///
/// # Errors
/// Interruption.
pub fn optimise_wound(
    model: &dyn CoilModel,
    task: &Task,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<WoundOutcome, Interrupted> {
    let problems = match search::solve_all(model, task, settings, progress)? {
        Ok(problems) => problems,
        Err((status, problems)) => return Ok(WoundOutcome::none(status, &problems)),
    };
    if model.air_dipoles().is_none() {
        return screened_coils::optimise(model, task, &problems, progress);
    }
    let open: Vec<&Solved<'_>> = problems
        .iter()
        .filter(|solved| solved.contradiction.is_none())
        .collect();
    let near = open.iter().flat_map(|solved| next_to_continuous(solved));
    let best_ln = near.fold(f64::NEG_INFINITY, |most, leaf| most.max(leaf.ln_force));
    // Without a coil to compare with, any positive force counts.
    let reach_n = best_ln.max(-600.0).exp() * (1.0 - SHARE);
    let mut complete = true;
    let mut coils = Vec::new();
    for solved in &open {
        let domain = branch::finite_domain(&solved.problem, reach_n).or_else(|| {
            // Nothing bounds the coil for certain: what is near the continuous optimum.
            complete = false;
            around_optimum(solved)
        });
        match domain.and_then(|domain| BoundedCoils::new(solved, domain, best_ln)) {
            Some(bounded) => coils.push(bounded),
            None => complete = false,
        }
    }
    progress.begin("wind", open.len() as u64);
    let search = Strongest::of(&coils, best_ln, settings.cells / 4, progress)?;
    progress.end();
    let (best, alternatives) = search.listed.finish();
    let Some(best) = best else {
        return Ok(WoundOutcome::none(rounded_status(&open), &problems));
    };
    let top_ln = best.force_n.ln();
    let upper_ln = search.bound_ln.max(top_ln);
    let gap = (upper_ln - top_ln).exp_m1();
    complete &= gap.is_finite();
    Ok(WoundOutcome {
        best: Some(best),
        alternatives,
        certificate: Certificate {
            kind: if complete && gap <= GAP {
                CertificateKind::Global
            } else {
                CertificateKind::of_searches(search::starts_of(&problems))
            },
            upper_bound_n: complete.then(|| upper_ln.exp()),
            gap: complete.then_some(gap),
            cells: search.cells,
        },
        ..WoundOutcome::none(Status::Optimal, &problems)
    })
}

#[cfg(test)]
mod tests {
    use super::super::domain::Domain;
    use super::*;
    use crate::optimum::tests::{HEIGHT_M, air, quick, seed_limits, task};
    use fluxform_base::progress::Silent;
    use fluxform_design::Limits;

    /// Without a budget nothing is taken apart, and what waits is still bounded.
    #[test]
    fn no_more_sets_are_taken_apart_than_the_budget_allows() {
        let limits = Limits {
            settling_max_s: None,
            ..seed_limits()
        };
        let (model, task) = (air(HEIGHT_M), task(limits, None));
        let settings = Settings {
            starts: 2,
            cells: 0,
            ..quick()
        };
        let Ok(problems) = search::solve_all(&model, &task, &settings, &Silent).expect("runs")
        else {
            panic!("bounded");
        };
        let domain = Domain::of(&problems[0].problem);
        let best_ln = problems[0].force_n().expect("a coil").ln();
        let coils = BoundedCoils::new(&problems[0], domain, best_ln).expect("an air coil");
        let coils = [coils];
        let of = |budget| Strongest::of(&coils, best_ln - 0.01, budget, &Silent).expect("runs");
        let none = of(0);
        assert_eq!(none.cells, 1);
        assert!(none.bound_ln > best_ln);
        let some = of(64);
        assert!(some.cells > 64 && some.bound_ln > best_ln && some.bound_ln < none.bound_ln);
    }

    #[test]
    fn a_turn_within_rounding_is_a_turn() {
        for turns in [1.0_f64, 3.0, 70.0] {
            let slack = [turns * (1.0 - f64::EPSILON), turns, turns + 0.7];
            assert!(slack.iter().all(|&t| whole(t) == turns as u64));
        }
        assert_eq!((whole(0.3), whole(2.9)), (1, 2));
    }
}
