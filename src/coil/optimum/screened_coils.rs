//! Cored coils that can be wound: every number of layers and turns a layer.
//!
//! Little is known for certain about coils with cores. The flux function of coaxial loops obeys a
//! maximum principle, so mutual inductances are positive, and the inductance of windings around
//! one core grows with every turn added and with every bit of steel; nothing alike is known of
//! the force, nor that it has one maximum over the bore. So what bounds a set of coils is a model
//! with its measured error: all coils of a length by the best one whose layers need not be whole,
//! each coil by its best bore, on the draft; then on the coarse model; last on the sharp one, which
//! decides. The certificate says `exhaustive`: no pair was left out, but neither bores between the
//! scan's samples nor a second continuous optimum of a length are bounded.

use rayon::prelude::*;

use super::best_bore::{Bores, summit};
use super::best_first::{CoilSets, Parts, Strongest, least, whole};
use super::candidates::{self, Leaf, around_optimum};
use super::domain::Domain;
use super::local_searches::{self, Solved};
use super::model::{CoilModel, Window};
use super::nearest_whole;
use super::outcome::{BestCoil, Certificate, CertificateKind, Outcome};
use super::problem::{Fixed, LimitName, Problem, Task};
use super::sqp::{self, FEASIBLE};
use super::surrogate;
use fluxform_base::progress::{Interrupted, Progress};

/// Bores narrower than this share of the winding's depth are not looked at, unless the
/// continuous optimum is as narrow: next to no steel.
const NARROW: f64 = 0.05;
/// How far, relatively, the sharp model's best bore may be from the coarse one's.
const NEAR: f64 = 0.02;
/// Most pairs of layers and turns that are examined.
const PAIRS: u64 = 400_000;

/// Maximises |force| over the coils that can be wound within `task`, on any model, `coarse` being
/// its problems solved.
///
/// # Errors
/// Interruption.
pub(super) fn optimise(
    model: &dyn CoilModel,
    task: &Task,
    coarse: &[Solved<'_>],
    progress: &dyn Progress,
) -> Result<Outcome, Interrupted> {
    let sharp_model = surrogate::sharpened(model, task, coarse, progress)?;
    let restated = sharp_model
        .as_deref()
        .map(|sharp| surrogate::restated(sharp, task, coarse));
    let sharp = restated.as_deref().unwrap_or(coarse);
    // Effects unknown to the search, of neighbours say, are screened for too.
    let blunt_model = sharp_model.as_deref().and_then(CoilModel::blunted);
    let blunt = blunt_model.as_deref().unwrap_or(model);
    let draft_model = blunt.draft();
    let open = || sharp.iter().filter(|solved| solved.contradiction.is_none());
    let mut complete = true;
    let mut screened = Vec::new();
    for solved in open() {
        let mut domain = Domain::of(&solved.problem);
        if !(domain.outer_m[1].is_finite() && domain.length_m[1].is_finite()) {
            complete = false;
            match around_optimum(solved) {
                Some(around) => domain = around,
                None => continue,
            }
        }
        screened.push((solved, domain, solved.problem.with_model(blunt)));
    }
    let coils: Vec<ScreenedCoils<'_>> = screened
        .iter()
        .map(|(solved, domain, coarse)| {
            ScreenedCoils::of(solved, *domain, coarse, draft_model.as_deref())
        })
        .collect();
    complete &= coils.iter().all(|coils| coils.count() <= PAIRS);
    progress.begin("wind", coils.len() as u64);
    let near = coils
        .iter()
        .map(|coils| Vec::from_iter(coils.next_to_continuous()));
    let search = Strongest::of(&coils, near.collect(), PAIRS as usize, progress)?;
    progress.end();
    let certificate = |_: &BestCoil| Certificate {
        kind: if complete {
            CertificateKind::Exhaustive
        } else {
            CertificateKind::of_searches(local_searches::starts_of(sharp))
        },
        upper_bound_n: None,
        gap: None,
        cells: search.cells,
    };
    Ok(
        candidates::found(search.listed, sharp, certificate).unwrap_or_else(|| {
            let open: Vec<&Solved<'_>> = open().collect();
            candidates::none(nearest_whole::status(&open), sharp, search.cells)
        }),
    )
}

/// The coils of one wire and regime by layers and turns a layer.
struct ScreenedCoils<'a> {
    /// The sharp model's problem and its continuous optimum.
    solved: &'a Solved<'a>,
    sharp: Bores<'a>,
    coarse: Bores<'a>,
    /// The problem on a rough model that costs next to nothing, where there is one, without the
    /// settling time.
    draft: Option<Problem<'a>>,
    domain: Domain,
    /// Least bore's radius that is looked at over the depth.
    narrow: f64,
    /// First and last number of layers and of turns.
    layers: [u64; 2],
    turns: [u64; 2],
}

/// Coils with equal turns a layer, one coil at any bore, one coil with the coarse model's best bore.
enum CoilSet {
    Row(u64),
    Pair(u64, u64),
    Bore(Leaf),
}

impl<'a> ScreenedCoils<'a> {
    fn of(
        solved: &'a Solved<'a>,
        domain: Domain,
        coarse: &'a Problem<'a>,
        draft: Option<&'a dyn CoilModel>,
    ) -> Self {
        let optimum = solved.best.as_ref().map(|local| Problem::window(local.x));
        let narrow = optimum.map_or(NARROW, |window| {
            NARROW.min(0.5 * window.inner_radius_m / window.depth_m)
        });
        let draft = draft.map(|model| {
            let problem = coarse.with_model(model);
            problem.without(&[LimitName::Settling]).unwrap_or(problem)
        });
        let wire_m = coarse.strand.diameter_m;
        let [shortest, longest] = domain.length_m.map(|length_m| length_m / wire_m);
        let room_m = domain.outer_m[1] - domain.inner_m[0];
        let mut coils = Self {
            solved,
            sharp: Bores::of(&solved.problem),
            coarse: Bores::of(coarse),
            draft,
            domain,
            narrow,
            layers: [1, whole(room_m / wire_m)],
            turns: [least(shortest), whole(longest)],
        };
        if let (true, Some(window)) = (coils.count() > PAIRS, optimum) {
            // Too many: those about the continuous optimum.
            let side = (PAIRS as f64).sqrt();
            let about = |[first, last]: [u64; 2], size_m: f64| {
                let middle = size_m / wire_m;
                let [lo, hi] = [middle - 0.5 * side, middle + 0.5 * side];
                [first.max(lo.max(1.0) as u64), last.min(hi.max(1.0) as u64)]
            };
            coils.layers = about(coils.layers, window.depth_m);
            coils.turns = about(coils.turns, window.length_m);
        }
        coils
    }

    fn count(&self) -> u64 {
        let many = |[first, last]: [u64; 2]| (last + 1).saturating_sub(first);
        many(self.layers).saturating_mul(many(self.turns))
    }

    fn range(&self, layers: u64, turns: u64) -> Option<[f64; 2]> {
        self.coarse.range(&self.domain, self.narrow, layers, turns)
    }

    /// The coil of whole layers and turns next to the continuous optimum.
    fn next_to_continuous(&self) -> Option<Leaf> {
        let window = Problem::window(self.solved.best.as_ref()?.x);
        let wire_m = self.coarse.problem.strand.diameter_m;
        let nearest = |size_m: f64, [first, last]: [u64; 2]| {
            whole(size_m / wire_m).clamp(first, last.max(first))
        };
        let layers = nearest(window.depth_m, self.layers);
        let turns = nearest(window.length_m, self.turns);
        let range = self.range(layers, turns)?;
        let best = self.coarse.best(layers, turns, range, f64::NEG_INFINITY)?;
        self.decided(&best)
    }

    /// Upper bound, by `problem`'s model and its error, of ln F of the coils of a length, layers
    /// not whole: a local search from the continuous optimum; infinite where it finds nothing.
    fn row_bound_ln(&self, problem: &Problem<'_>, turns: u64) -> f64 {
        let (Some(local), None) = (&self.solved.best, problem.task.fixed.length_m) else {
            return f64::INFINITY;
        };
        let length_m = turns as f64 * problem.strand.diameter_m;
        let task = Task {
            fixed: Fixed {
                length_m: Some(length_m),
                ..problem.task.fixed
            },
            ..problem.task.clone()
        };
        // Without the settling time the force can only be higher.
        let row = problem.with_task(&task);
        let row = row.without(&[LimitName::Settling]).unwrap_or(row);
        let field = row
            .bounds
            .iter()
            .position(|b| b.name == LimitName::CoreField);
        let window = Problem::window(local.x);
        let best = [1.0, 0.5].into_iter().filter_map(|thinner| {
            let start = Problem::coordinates(&Window {
                length_m,
                depth_m: window.depth_m * thinner,
                ..window
            });
            let local = sqp::solve(&row, start)?;
            let doubts = row.model.doubts(&Problem::window(local.x));
            // A field that is overstated costs what the limit's multiplier says.
            let by_field = field.map_or(0.0, |row| local.multipliers[row]);
            let doubt_ln = doubts.force_ln + by_field * doubts.core_field_ln;
            (local.violation(&row) <= FEASIBLE).then_some(doubt_ln - local.point.objective)
        });
        best.reduce(f64::max).unwrap_or(f64::INFINITY)
    }

    /// The same of one coil, at its best bore; -infinity where it has none.
    fn pair_bound_ln(&self, problem: &Problem<'_>, layers: u64, turns: u64) -> f64 {
        let Some([lo, hi]) = self.range(layers, turns) else {
            return f64::NEG_INFINITY;
        };
        let window = |a: f64| self.coarse.window(layers, turns, a);
        let ln_force = |a: f64| {
            let rated = problem.rate(window(a));
            rated.map_or(f64::NEG_INFINITY, |rated| rated.force_n.value.ln())
        };
        let (at, value) = summit(ln_force, lo, hi);
        value + problem.model.doubts(&window(at)).force_ln
    }

    /// A coil with its best bore on the sharp model, near that on the coarse one.
    fn decided(&self, leaf: &Leaf) -> Option<Leaf> {
        let [lo, hi] = self.range(leaf.layers, leaf.turns)?;
        let outer_m = leaf.window.outer_radius_m();
        let at = leaf.window.inner_radius_m;
        let near = [lo.max(at - NEAR * outer_m), hi.min(at + NEAR * outer_m)];
        let (layers, turns) = (leaf.layers, leaf.turns);
        self.sharp.best(layers, turns, near, f64::NEG_INFINITY)
    }
}

impl CoilSets for ScreenedCoils<'_> {
    type Set = CoilSet;

    fn problem(&self) -> &Problem<'_> {
        self.sharp.problem
    }

    fn all(&self, _enough_ln: f64) -> Parts<CoilSet> {
        let [first, last] = self.turns;
        let problem = self.draft.as_ref().unwrap_or(self.coarse.problem);
        let row = |turns| (self.row_bound_ln(problem, turns), CoilSet::Row(turns));
        Parts {
            sets: (first..=last).into_par_iter().map(row).collect(),
            cells: self.count() as usize,
            ..Parts::default()
        }
    }

    fn parts(&self, set: &CoilSet, enough_ln: f64) -> Parts<CoilSet> {
        let mut parts = Parts::default();
        let doubt = |leaf: &Leaf| {
            let doubts = self.coarse.problem.model.doubts(&leaf.window);
            doubts.force_ln + doubts.core_field_ln
        };
        match *set {
            CoilSet::Row(turns) => {
                let row_ln = self.row_bound_ln(self.coarse.problem, turns);
                if row_ln < enough_ln {
                    return parts;
                }
                for layers in self.layers[0]..=self.layers[1] {
                    let bound_ln = self.draft.as_ref().map_or(row_ln, |draft| {
                        self.pair_bound_ln(draft, layers, turns).min(row_ln)
                    });
                    parts.sets.push((bound_ln, CoilSet::Pair(layers, turns)));
                }
            }
            CoilSet::Pair(layers, turns) => {
                let range = self.range(layers, turns);
                let best = |range| self.coarse.best(layers, turns, range, f64::NEG_INFINITY);
                if let Some(leaf) = range.and_then(best) {
                    let bound_ln = leaf.ln_force + doubt(&leaf);
                    parts.sets.push((bound_ln, CoilSet::Bore(leaf)));
                }
            }
            CoilSet::Bore(leaf) => parts.coils.extend(self.decided(&leaf)),
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::best_bore::tests::{Opaque, small};
    use crate::optimum::optimise_wound;
    use crate::optimum::tests::{HEIGHT_M, air, quick, task};
    use fluxform_base::progress::Silent;

    #[test]
    fn every_pair_tried_is_as_good_as_a_proof() {
        for settling_max_s in [0.001, 0.0006] {
            let task = task(small(settling_max_s), None);
            let run = |model: &dyn CoilModel| {
                optimise_wound(model, &task, &quick(), &Silent).expect("runs")
            };
            let (tried, proven) = (run(&Opaque(air(HEIGHT_M))), run(&air(HEIGHT_M)));
            assert_eq!(tried.certificate.kind, CertificateKind::Exhaustive);
            assert_eq!(tried.certificate.cells, 14 * 8);
            assert_eq!(proven.certificate.kind, CertificateKind::Global);
            let (a, b) = (tried.best.expect("a coil"), proven.best.expect("a coil"));
            assert_eq!(a.whole, b.whole);
            assert!((a.force_n / b.force_n - 1.0).abs() < 1e-9, "{a:?} {b:?}");
        }
    }
}
