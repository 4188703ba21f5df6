//! Branch and bound over boxes of windows: no coil within the limits is better than this.

use std::collections::VecDeque;

use rayon::prelude::*;

use super::domain::Domain;
use super::interval_bounds::{Bounding, Cell};
use super::model::Window;
use super::problem::{Problem, Regime};
use fluxform_base::progress::{Interrupted, Progress};
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::interval::Interval;

/// Relative gap that makes a certificate global.
pub const GAP: f64 = 1e-6;
/// Share of it that bounds are allowed, the rest being rounding's.
const USED: f64 = 0.9;
/// Cells at which the work is handed to threads; fixed, so that results do not depend on them.
const PORTIONS: usize = 64;

/// Cells yet to be bounded, each with a bound that holds for it already.
type Stack = Vec<(Cell, f64)>;

/// Proof by a search over cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Proof {
    /// No coil's ln F exceeds this.
    pub upper_ln: f64,
    /// Cells bounded.
    pub cells: usize,
    /// A window better than the incumbent, met on the way.
    pub better: Option<Window>,
}

impl Proof {
    fn nothing() -> Self {
        Self {
            upper_ln: f64::NEG_INFINITY,
            cells: 0,
            better: None,
        }
    }
}

/// The box that holds every coil whose force reaches `force_n`; `None` where no finite one is
/// known (a settling time alone bounds the coil).
#[must_use]
pub(crate) fn finite_domain(problem: &Problem<'_>, force_n: f64) -> Option<Domain> {
    let mut domain = Domain::of(problem);
    if domain.outer_m[1].is_finite() && domain.length_m[1].is_finite() {
        return Some(domain);
    }
    let dipoles = problem.model.air_dipoles()?;
    // F <= source x (force density over volume): see the bounds below.
    let per_volume = match problem.regime {
        Regime::Driver => problem.task.current_max_a * domain.volume_m3[1],
        Regime::Supply => problem.task.voltage_v? / problem.strand.resistance_per_volume(),
    };
    let moment: f64 = dipoles.iter().map(|d| d.1.abs()).sum();
    let z = dipoles.iter().fold(f64::INFINITY, |z, d| z.min(d.0));
    let source = moment * MU_0_T_M_PER_A * problem.strand.turns_per_m2() * per_volume;
    let ratio = source / force_n;
    if !(ratio.is_finite() && ratio > 0.0) {
        return None;
    }
    // A loop's force over its volume is 3/4 a u / rho^5 <= 3/8 rho^-3. A coil with a2 beyond
    // these radii is either hollow, hence far, or flat, hence spread over a disc of area a2^2.
    let outer = (ratio * 2.0 / (3.0 * z)).sqrt().max((3.0 * ratio).cbrt());
    // The part deeper than `deep` gives at most a third, and the rest, deep/length of the
    // volume, at most another third.
    let deep = (1.125 * ratio).cbrt();
    let length = 1.125 * ratio * deep / (z * z * z);
    domain.outer_m[1] = domain.outer_m[1].min(outer.max(2.0 * domain.outer_m[0]));
    domain.length_m[1] = domain.length_m[1].min(length.max(2.0 * domain.length_m[0]));
    (domain.outer_m[1].is_finite() && domain.length_m[1].is_finite()).then_some(domain)
}

/// The whole of a finite domain.
#[must_use]
pub fn whole(domain: &Domain) -> Cell {
    let inner_hi = domain.inner_m[1].min(domain.outer_m[1] - domain.depth_min_m);
    Cell {
        inner: Interval::new(domain.inner_m[0], inner_hi.max(domain.inner_m[0])),
        depth: Interval::new(
            domain.depth_min_m,
            (domain.outer_m[1] - domain.inner_m[0]).max(domain.depth_min_m),
        ),
        length: Interval::new(
            domain.length_m[0],
            domain.length_m[1].max(domain.length_m[0]),
        ),
    }
}

/// Bounds ln F over `cell` to within [`GAP`] of `best_ln` where `budget` cells allow it;
/// otherwise the bound is still one.
///
/// # Errors
/// Interruption.
pub(crate) fn prove(
    bounding: &Bounding<'_>,
    problem: &Problem<'_>,
    cell: Cell,
    best_ln: f64,
    budget: usize,
    progress: &dyn Progress,
) -> Result<Proof, Interrupted> {
    let search = Search {
        bounding,
        problem,
        best_ln,
        enough_ln: best_ln + USED * GAP,
    };
    let mut proof = Proof::nothing();
    let mut queue = VecDeque::from([(cell, f64::INFINITY)]);
    while queue.len() < PORTIONS {
        let Some((cell, _)) = queue.pop_front() else {
            break;
        };
        search.visit(cell, &mut proof, |half| queue.push_back(half));
        if proof.better.is_some() {
            return Ok(proof);
        }
    }
    // Cells near the optimum fall to few portions: what the others leave of the budget is
    // shared again, in rounds that do not depend on the threads.
    let mut open: Vec<Stack> = queue.into_iter().map(|first| vec![first]).collect();
    let mut left = budget;
    while !open.is_empty() && left >= open.len() && proof.better.is_none() {
        let share = left / open.len();
        let parts: Vec<Result<(Proof, Stack), Interrupted>> = open
            .into_par_iter()
            .map(|stack| search.depth_first(stack, share, progress))
            .collect();
        open = Vec::new();
        for part in parts {
            let (part, rest) = part?;
            proof.upper_ln = proof.upper_ln.max(part.upper_ln);
            proof.cells += part.cells;
            proof.better = proof.better.or(part.better);
            left = left.saturating_sub(part.cells);
            if !rest.is_empty() {
                open.push(rest);
            }
        }
    }
    for (_, bound) in open.iter().flatten() {
        proof.upper_ln = proof.upper_ln.max(*bound);
    }
    Ok(proof)
}

struct Search<'a> {
    bounding: &'a Bounding<'a>,
    problem: &'a Problem<'a>,
    best_ln: f64,
    enough_ln: f64,
}

impl Search<'_> {
    /// Works a stack off for `budget` cells; also returns what is left of it.
    fn depth_first(
        &self,
        mut stack: Stack,
        budget: usize,
        progress: &dyn Progress,
    ) -> Result<(Proof, Stack), Interrupted> {
        let mut proof = Proof::nothing();
        while proof.cells < budget && proof.better.is_none() {
            let Some((cell, _)) = stack.pop() else { break };
            if proof.cells.is_multiple_of(1024) {
                progress.check()?;
            }
            self.visit(cell, &mut proof, |half| stack.push(half));
        }
        Ok((proof, stack))
    }

    /// Bounds a cell; hands its halves on where the bound is not good enough.
    fn visit(&self, cell: Cell, proof: &mut Proof, mut hand_on: impl FnMut((Cell, f64))) {
        proof.cells += 1;
        let Some(cell) = self.bounding.contracted(cell) else {
            return;
        };
        let Some(bound) = self.bounding.ln_force(&cell, self.enough_ln) else {
            return;
        };
        if bound <= self.enough_ln {
            proof.upper_ln = proof.upper_ln.max(bound);
            return;
        }
        if let Some(window) = self.better(&cell) {
            proof.better = Some(window);
            return;
        }
        match halves(&cell) {
            Some([low, high]) => {
                hand_on((low, bound));
                hand_on((high, bound));
            }
            // Too small to be cut: the bound remains.
            None => proof.upper_ln = proof.upper_ln.max(bound),
        }
    }

    /// The cell's middle where it is a better coil.
    fn better(&self, cell: &Cell) -> Option<Window> {
        let middle = |i: Interval| 0.5 * (i.lo + i.hi);
        let window = Window {
            inner_radius_m: middle(cell.inner),
            depth_m: middle(cell.depth),
            length_m: middle(cell.length),
        };
        if self.bounding.ln_force_at(&window) <= self.best_ln + GAP {
            return None;
        }
        let point = self.problem.scaled(&self.problem.rate(window)?);
        point.rows.iter().all(|&row| row <= 0.0).then_some(window)
    }
}

/// The cell cut where its relative width is largest; `None` where nothing is left to cut.
fn halves(cell: &Cell) -> Option<[Cell; 2]> {
    let (a, w, l) = (cell.inner, cell.depth, cell.length);
    let wide = |i: Interval, size: f64| (i.hi - i.lo) / size;
    let widths = [wide(a, a.hi + 0.5 * w.hi), wide(w, w.hi), wide(l, l.hi)];
    let most = (0..3).max_by(|&i, &j| widths[i].total_cmp(&widths[j]))?;
    let (mut low, mut high) = (*cell, *cell);
    let (below, above) = match most {
        0 => (&mut low.inner, &mut high.inner),
        1 => (&mut low.depth, &mut high.depth),
        _ => (&mut low.length, &mut high.length),
    };
    let middle = if below.lo > 0.0 && below.hi > 4.0 * below.lo {
        (below.lo * below.hi).sqrt()
    } else {
        0.5 * (below.lo + below.hi)
    };
    if !(middle > below.lo && middle < below.hi) {
        return None;
    }
    below.hi = middle;
    above.lo = middle;
    Some([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::interval_bounds::Multipliers;
    use crate::optimum::tests::{HEIGHT_M, air, seed_limits, task, wire};
    use crate::optimum::{Strand, Task};
    use fluxform_base::progress::Silent;
    use fluxform_design::Limits;

    /// The best coil of the seed's limits without that on the settling time, N.
    const BEST_N: f64 = 0.137_773_265_65;

    /// The proof at the seed's limits, without multipliers: slow.
    fn proven(best_ln: f64, budget: usize) -> (Proof, bool) {
        let limits = Limits {
            settling_max_s: None,
            ..seed_limits()
        };
        let (model, task) = (air(HEIGHT_M), task(limits, None));
        let problem = &Problem::of_wire(&model, &task, task.strands[0])[0];
        let domain = finite_domain(problem, best_ln.exp()).expect("a box");
        let bounding = Bounding::new(problem, domain, Multipliers::default(), false);
        let bounding = bounding.expect("an air coil");
        let cell = whole(&domain);
        let proof = prove(&bounding, problem, cell, best_ln, budget, &Silent).expect("runs");
        let better = proof.better.is_some_and(|window| {
            let rated = problem.rate(window).expect("in the domain");
            let met = problem.scaled(&rated).rows.iter().all(|&row| row <= 0.0);
            met && rated.force_n.value.ln() > best_ln + GAP
        });
        (proof, better)
    }

    #[test]
    fn a_better_coil_on_the_way_is_handed_over() {
        let (proof, better) = proven((0.9 * BEST_N).ln(), 100_000);
        assert!(better, "{proof:?}");
    }

    #[test]
    fn the_budget_is_kept_and_what_is_left_open_stays_bounded() {
        let ln = BEST_N.ln();
        let (first, _) = proven(ln, 0);
        for budget in [640, 3000] {
            let (proof, _) = proven(ln, budget);
            let used = proof.cells - first.cells;
            assert!(used <= budget && used > budget / 2, "{used} {budget}");
            assert!(proof.better.is_none() && proof.upper_ln >= ln);
            assert!(proof.upper_ln <= first.upper_ln);
        }
    }

    /// Without limits on sizes: the box scales with the problem, and no coil beyond it reaches
    /// the force.
    #[test]
    fn the_finite_box_scales_and_holds_all_that_is_strong() {
        let boxes = |k: f64| -> Vec<(Domain, f64)> {
            let limits = Limits {
                resistance_max_ohm: Some(6.0 / k),
                ..Limits::default()
            };
            let task = Task {
                strands: Strand::choices(&wire(0.0007 * k)),
                ..task(limits, Some(8.0 / k))
            };
            let model = air(HEIGHT_M * k);
            let force_n = 0.07 / (k * k);
            let problems = Problem::of_wire(&model, &task, task.strands[0]);
            let of = |problem: &Problem<'_>| {
                let domain = finite_domain(problem, force_n).expect("bounded by the wire");
                let most = domain.volume_m3[1];
                let mut strongest = 0.0_f64;
                let [outer, length] = [domain.outer_m[1], domain.length_m[1]];
                for beyond in [1.01, 1.3, 7.0] {
                    for share in [0.0, 0.3, 0.7, 0.97] {
                        for amount in [1.0, 0.3, 0.01] {
                            // Wide: as long as the wire suffices for; long: as deep.
                            let (a2, l) = (outer * beyond, length * beyond);
                            let a1 = share * a2;
                            let wide = amount * most / (a2 * a2 - a1 * a1);
                            let a = share * outer;
                            let deep = (a * a + amount * most / l).sqrt() - a;
                            for (a, w, l) in [(a1, a2 - a1, wide), (a, deep, l)] {
                                let window = Window {
                                    inner_radius_m: a,
                                    depth_m: w,
                                    length_m: l,
                                };
                                let rated = problem.rate(window).expect("in the domain");
                                strongest = strongest.max(rated.force_n.value);
                            }
                        }
                    }
                }
                assert!(strongest < force_n, "{strongest} {force_n}");
                (domain, force_n)
            };
            problems.iter().map(of).collect()
        };
        let k = 1.7;
        for ((small, _), (large, _)) in boxes(1.0).iter().zip(boxes(k)) {
            for (a, b) in [
                (small.outer_m[1], large.outer_m[1]),
                (small.length_m[1], large.length_m[1]),
            ] {
                assert!((b / a / k - 1.0).abs() < 1e-12, "{a} {b}");
            }
        }
    }
}
