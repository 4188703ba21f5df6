//! The strongest coils that can be wound, best first.
//!
//! Sets of coils wait in the order of an upper bound of their force. The first is taken apart until it is
//! one coil with its best bore, and a coil that no waiting set can exceed is the next strongest. The
//! search ends where what waits lacks more than [`SHARE`] of the best, or with as many coils worth a
//! look as are listed.

use std::cmp::Ordering;
use std::collections::{BTreeSet, BinaryHeap};

use rayon::prelude::*;

use super::candidates::{Leaf, Listed, SHARE, describe};
use super::problem::Problem;
use fluxform_base::progress::{Interrupted, Progress};

/// Slack, in turns, of a dimension that must be a whole number of them.
pub(super) const WHOLE: f64 = 1e-9;
/// Sets taken apart at a time; fixed, so that results do not depend on the threads.
const AT_A_TIME: usize = 32;

/// How many whole wires fit, at least one.
pub(super) fn whole(ratio: f64) -> u64 {
    (ratio + WHOLE).floor().clamp(1.0, 1e15) as u64
}

/// The least number of whole wires, at least one, that is not below a ratio.
pub(super) fn least(ratio: f64) -> u64 {
    (ratio - WHOLE).ceil().max(1.0) as u64
}

/// One problem's coils as sets that can be bounded and taken apart.
pub(super) trait CoilSets: Sync {
    type Set: Send + Sync;

    fn problem(&self) -> &Problem<'_>;

    /// Sets that hold every coil whose ln F may reach `enough_ln`.
    fn all(&self, enough_ln: f64) -> Parts<Self::Set>;

    /// Parts of a set that may reach `enough_ln`.
    fn parts(&self, set: &Self::Set, enough_ln: f64) -> Parts<Self::Set>;
}

/// Parts into which a set of coils was divided.
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

/// A set that waits to be divided or listed: strongest first, then earliest.
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
    /// Searches among `problems`' coils, some of which are `known`, taking sets apart until there were `budget`
    /// of them or of their boxes.
    ///
    /// # Errors
    /// Interruption.
    pub fn of(
        problems: &'a [C],
        known: Vec<Vec<Leaf>>,
        budget: usize,
        progress: &dyn Progress,
    ) -> Result<Self, Interrupted> {
        let mut search = Self {
            problems,
            queue: BinaryHeap::new(),
            order: 0,
            best_ln: f64::NEG_INFINITY,
            listed: Listed::default(),
            listed_pairs: BTreeSet::new(),
            bound_ln: f64::NEG_INFINITY,
            cells: 0,
        };
        let known = known.into_iter().map(|coils| Parts {
            coils,
            ..Parts::default()
        });
        known
            .enumerate()
            .for_each(|(of, parts)| search.add(of, parts));
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
            let parts: Vec<Result<Parts<C::Set>, Interrupted>> = sets
                .par_iter()
                .map(|(of, set)| {
                    progress.check()?;
                    Ok(self.problems[*of].parts(set, enough_ln))
                })
                .collect();
            for ((of, _), parts) in sets.iter().zip(parts) {
                let parts = parts?;
                taken += parts.cells.max(1);
                self.add(*of, parts);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_within_rounding_is_a_turn() {
        for turns in [1.0_f64, 3.0, 70.0] {
            let slack = [turns * (1.0 - f64::EPSILON), turns, turns + 0.7];
            assert!(slack.iter().all(|&t| whole(t) == turns as u64));
        }
        assert_eq!((whole(0.3), whole(2.9)), (1, 2));
    }
}
