//! The best coil that can be wound: whole layers, whole turns a layer, any bore.
//!
//! OD = ID + 2 n d and L = m d. Boxes over (n, m, bore) are bounded as in the continuous problem
//! and cut until n and m are single numbers; what remains is a search in the bore alone
//! (argmin's Brent), itself bounded. Nothing is rounded to: a box is dropped only where it is
//! proven to hold no coil within [`SHARE`] of the best.

use std::collections::VecDeque;

use rayon::prelude::*;

use super::branch::{self, GAP};
use super::domain::Domain;
use super::enclosure::{Bounding, Cell, Multipliers};
use super::exhaustive;
use super::listing::{
    Leaf, SHARE, WoundCoil, WoundOutcome, around_optimum, describe, once_each, rounded_status,
    worth_a_look,
};
use super::model::{CoilModel, Window};
use super::outcome::{Certificate, CertificateKind, Status};
use super::problem::{LimitName, Problem, Regime, Task};
use super::scalar;
use super::search::{self, Settings, Solved};
use super::sequential::FEASIBLE;
use fluxform_base::progress::{Interrupted, Progress};
use fluxform_numerics::interval::Interval;

const USED: f64 = 0.9;
const PORTIONS: usize = 64;
/// Slack, in turns, of a dimension that must be a whole number of them.
const WHOLE: f64 = 1e-9;
/// Most boxes of one coil's bore.
const BORES: usize = 20_000;

/// A box of coils.
#[derive(Debug, Clone, Copy)]
struct Lattice {
    layers: [u64; 2],
    turns: [u64; 2],
    inner: Interval,
}

#[derive(Default)]
struct Found {
    leaves: Vec<Leaf>,
    upper_ln: Option<f64>,
    cells: usize,
}

impl Found {
    fn bounded_by(&mut self, ln: f64) {
        self.upper_ln = Some(self.upper_ln.map_or(ln, |old| old.max(ln)));
    }

    fn add(&mut self, other: Self) {
        self.leaves.extend(other.leaves);
        if let Some(ln) = other.upper_ln {
            self.bounded_by(ln);
        }
        self.cells += other.cells;
    }
}

/// Maximises |force| over the coils that can be wound within `task`. Coils for which no bounds
/// exist, cored ones, are examined one by one ([`super::exhaustive`]).
///
/// # Errors
/// Interruption.
pub fn optimise_wound(
    model: &dyn CoilModel,
    task: &Task,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<WoundOutcome, Interrupted> {
    if model.air_dipoles().is_none() {
        return exhaustive::optimise(model, task, settings, progress);
    }
    let none = WoundOutcome::none;
    let problems = match search::solve_all(model, task, settings, progress)? {
        Ok(problems) => problems,
        Err((status, problems)) => return Ok(none(status, &problems)),
    };
    let open: Vec<&Solved<'_>> = problems
        .iter()
        .filter(|solved| solved.contradiction.is_none())
        .collect();
    let mut best_ln = f64::NEG_INFINITY;
    for solved in &open {
        for leaf in near_continuous(solved) {
            best_ln = best_ln.max(leaf.ln_force);
        }
    }
    progress.begin("wind", open.len() as u64);
    let mut found = Found::default();
    let mut coils: Vec<(usize, Leaf)> = Vec::new();
    let mut complete = true;
    for (index, solved) in open.iter().enumerate() {
        // Without a coil to compare with, any positive force counts.
        let reach_n = best_ln.max(-600.0).exp() * (1.0 - SHARE);
        let domain = branch::finite_domain(&solved.problem, reach_n).or_else(|| {
            // Nothing bounds the coil for certain: what is near the continuous optimum.
            complete = false;
            around_optimum(solved)
        });
        let Some(part) = domain.and_then(|domain| Winder::new(solved, domain, best_ln)) else {
            complete = false;
            continue;
        };
        let mut part = part.enumerate(settings.cells / 4, progress)?;
        coils.extend(part.leaves.drain(..).map(|leaf| (index, leaf)));
        found.add(part);
        progress.advance(1);
    }
    progress.end();
    let Some(&(_, top)) = coils
        .iter()
        .max_by(|a, b| a.1.ln_force.total_cmp(&b.1.ln_force))
    else {
        let status = rounded_status(&open);
        return Ok(none(status, &problems));
    };
    let mut list: Vec<WoundCoil> = coils
        .iter()
        .filter(|(_, leaf)| leaf.ln_force >= top.ln_force + (-SHARE).ln_1p())
        .filter_map(|(index, leaf)| describe(&open[*index].problem, leaf))
        .collect();
    list.sort_by(|a, b| b.force_n.total_cmp(&a.force_n));
    let best = list.first().cloned();
    let alternatives = best
        .as_ref()
        .map_or_else(Vec::new, |best| worth_a_look(best, &list));
    let upper_ln = found.upper_ln.unwrap_or(top.ln_force).max(top.ln_force);
    let gap = (upper_ln - top.ln_force).exp_m1();
    complete &= gap.is_finite();
    Ok(WoundOutcome {
        status: Status::Optimal,
        best,
        alternatives,
        certificate: Certificate {
            kind: if complete && gap <= GAP {
                CertificateKind::Global
            } else {
                CertificateKind::of_searches(search::starts_of(&problems))
            },
            upper_bound_n: complete.then(|| upper_ln.exp()),
            gap: complete.then_some(gap),
            cells: found.cells,
        },
        ..WoundOutcome::none(Status::Optimal, &problems)
    })
}

/// Coils next to a problem's continuous optimum.
fn near_continuous(solved: &Solved<'_>) -> Vec<Leaf> {
    let Some(local) = &solved.best else {
        return Vec::new();
    };
    let problem = &solved.problem;
    let window = Problem::window(local.x);
    let domain = Domain::of(problem);
    let wire = problem.strand.diameter_m;
    let (n, m) = (window.depth_m / wire, window.length_m / wire);
    let around = |v: f64| {
        let whole = (v + WHOLE).floor().max(1.0) as u64;
        whole.saturating_sub(2).max(1)..=whole + 2
    };
    let mut leaves = Vec::new();
    for layers in around(n) {
        for turns in around(m) {
            let inner = Interval::new(
                domain.inner_m[0],
                domain.inner_m[1].min(4.0 * window.outer_radius_m()),
            );
            let lattice = Lattice {
                layers: [layers; 2],
                turns: [turns; 2],
                inner,
            };
            if let Some(bounding) = Bounding::new(problem, domain, Multipliers::default(), false)
                && let Some(cell) = bounding.contracted(cell_of(&lattice, wire))
            {
                leaves.extend(best_bore(problem, &bounding, layers, turns, cell.inner));
            }
        }
    }
    leaves
}

fn cell_of(lattice: &Lattice, wire_m: f64) -> Cell {
    let span = |range: [u64; 2]| Interval::new(range[0] as f64 * wire_m, range[1] as f64 * wire_m);
    Cell {
        inner: lattice.inner,
        depth: span(lattice.layers),
        length: span(lattice.turns),
    }
}

/// The best bore of one coil within `inner`; `None` where none meets the limits.
fn best_bore(
    problem: &Problem<'_>,
    bounding: &Bounding<'_>,
    layers: u64,
    turns: u64,
    inner: Interval,
) -> Option<Leaf> {
    let wire_m = problem.strand.diameter_m;
    let window = |inner_radius_m: f64| Window {
        inner_radius_m,
        depth_m: layers as f64 * wire_m,
        length_m: turns as f64 * wire_m,
    };
    let ln_force = |a: f64| bounding.ln_force_at(&window(a));
    // The contraction leaves rounding's slack on both sides.
    let domain = &bounding.domain;
    let lo = inner.lo.max(domain.inner_m[0]);
    let depth_m = layers as f64 * wire_m;
    let hi = inner.hi.min(domain.outer_m[1] - depth_m).max(lo);
    let (mut at, mut value) = scalar::maximum(ln_force, lo, hi);
    let settling = problem.limit_of(LimitName::Settling);
    let row = problem
        .bounds
        .iter()
        .position(|b| b.name == LimitName::Settling);
    if let (Some(limit), Some(row)) = (settling, row) {
        let over = |a: f64| {
            problem
                .rate(window(a))
                .map_or(1.0, |rated| rated.values[row].value / limit - 1.0)
        };
        if over(at) > 0.0 {
            // A wider bore settles more slowly.
            if over(lo) > 0.0 {
                return None;
            }
            let end = scalar::root(over, lo, at, 1e-13 * at)?;
            (at, value) = scalar::maximum(ln_force, lo, end);
        }
    }
    let mut point = problem.scaled(&problem.rate(window(at))?);
    // The last rounding is taken off the bore: a narrower coil has less wire.
    let over = point.rows.iter().fold(0.0_f64, |most, &row| most.max(row));
    if over > 0.0 && over <= FEASIBLE && problem.regime == Regime::Driver {
        let less = (at - 4.0 * over * (at + depth_m)).max(lo);
        point = problem.scaled(&problem.rate(window(less))?);
        at = less;
        value = ln_force(at);
    }
    let met = point.rows.iter().enumerate().all(|(row, &value)| {
        let value = if problem.bounds[row].name.is_equality() {
            value.abs()
        } else {
            value
        };
        value <= FEASIBLE
    });
    met.then(|| Leaf {
        layers,
        turns,
        window: window(at),
        ln_force: value,
    })
}

/// Enumerates one problem's coils.
struct Winder<'a> {
    problem: &'a Problem<'a>,
    bounding: Bounding<'a>,
    /// Coils below this are of no interest.
    enough_ln: f64,
    best_ln: f64,
}

impl<'a> Winder<'a> {
    fn new(solved: &'a Solved<'a>, domain: Domain, best_ln: f64) -> Option<Self> {
        let problem = &solved.problem;
        let multipliers = solved
            .best
            .as_ref()
            .map_or_else(Multipliers::default, |local| {
                Multipliers::of(problem, &local.multipliers)
            });
        let with_settling = multipliers.settling > 0.0;
        Some(Self {
            bounding: Bounding::new(problem, domain, multipliers, with_settling)?,
            problem,
            enough_ln: best_ln + (-SHARE).ln_1p(),
            best_ln,
        })
    }

    fn enumerate(&self, budget: usize, progress: &dyn Progress) -> Result<Found, Interrupted> {
        let wire_m = self.problem.strand.diameter_m;
        let whole = branch::whole(&self.bounding.domain);
        let most = |hi: f64| ((hi / wire_m + WHOLE).floor()).clamp(1.0, 1e15) as u64;
        let first = Lattice {
            layers: [1, most(whole.depth.hi)],
            turns: [1, most(whole.length.hi)],
            inner: whole.inner,
        };
        let mut found = Found::default();
        let mut queue = VecDeque::from([first]);
        while queue.len() < PORTIONS {
            let Some(lattice) = queue.pop_front() else {
                break;
            };
            self.visit(lattice, &mut found, |half| queue.push_back(half));
        }
        let parts: Vec<Result<Found, Interrupted>> = queue
            .into_par_iter()
            .map(|lattice| {
                let mut found = Found::default();
                let mut stack = vec![lattice];
                while let Some(lattice) = stack.pop() {
                    if found.cells.is_multiple_of(1024) {
                        progress.check()?;
                    }
                    if found.cells >= budget {
                        // Not enumerated: nothing is proven.
                        found.bounded_by(f64::INFINITY);
                        break;
                    }
                    self.visit(lattice, &mut found, |half| stack.push(half));
                }
                Ok(found)
            })
            .collect();
        for part in parts {
            found.add(part?);
        }
        found.leaves = once_each(found.leaves);
        Ok(found)
    }

    fn visit(&self, mut lattice: Lattice, found: &mut Found, mut hand_on: impl FnMut(Lattice)) {
        found.cells += 1;
        let wire_m = self.problem.strand.diameter_m;
        let Some(cell) = self.bounding.contracted(cell_of(&lattice, wire_m)) else {
            return;
        };
        lattice.inner = cell.inner;
        for (range, span) in [
            (&mut lattice.layers, cell.depth),
            (&mut lattice.turns, cell.length),
        ] {
            range[0] = range[0].max((span.lo / wire_m - WHOLE).ceil().max(1.0) as u64);
            range[1] = range[1].min((span.hi / wire_m + WHOLE).floor() as u64);
            if range[0] > range[1] {
                return;
            }
        }
        let tight = cell_of(&lattice, wire_m);
        let Some(bound) = self.bounding.ln_force(&tight, self.enough_ln) else {
            return;
        };
        if bound <= self.enough_ln {
            found.bounded_by(bound);
            return;
        }
        let relative = |range: [u64; 2]| (range[1] - range[0]) as f64 / range[1] as f64;
        let (n, m) = (relative(lattice.layers), relative(lattice.turns));
        if n == 0.0 && m == 0.0 {
            let [layers, turns] = [lattice.layers[0], lattice.turns[0]];
            let leaf = best_bore(self.problem, &self.bounding, layers, turns, lattice.inner);
            let value = leaf.map_or(f64::NEG_INFINITY, |leaf| leaf.ln_force);
            found.leaves.extend(leaf);
            self.bound_bores(tight, value.max(self.best_ln), found);
            return;
        }
        let inner =
            (lattice.inner.hi - lattice.inner.lo) / (lattice.inner.hi + 0.5 * tight.depth.hi);
        let (mut low, mut high) = (lattice, lattice);
        let cut = |low: &mut [u64; 2], high: &mut [u64; 2]| {
            let middle = low[0] + (low[1] - low[0]) / 2;
            low[1] = middle;
            high[0] = middle + 1;
        };
        if inner > n && inner > m {
            let middle = 0.5 * (lattice.inner.lo + lattice.inner.hi);
            low.inner.hi = middle;
            high.inner.lo = middle;
        } else if n >= m {
            cut(&mut low.layers, &mut high.layers);
        } else {
            cut(&mut low.turns, &mut high.turns);
        }
        hand_on(low);
        hand_on(high);
    }

    /// Proves that no bore of one coil exceeds `value` by more than the gap.
    fn bound_bores(&self, cell: Cell, value: f64, found: &mut Found) {
        let enough = value + USED * GAP;
        let mut stack = vec![cell];
        let mut count = 0;
        while let Some(cell) = stack.pop() {
            count += 1;
            found.cells += 1;
            let Some(cell) = self.bounding.contracted(cell) else {
                continue;
            };
            let Some(bound) = self.bounding.ln_force(&cell, enough) else {
                continue;
            };
            let middle = 0.5 * (cell.inner.lo + cell.inner.hi);
            let cut = middle > cell.inner.lo && middle < cell.inner.hi;
            if bound <= enough || !cut || count > BORES {
                found.bounded_by(bound);
                continue;
            }
            let (mut low, mut high) = (cell, cell);
            low.inner.hi = middle;
            high.inner.lo = middle;
            stack.push(low);
            stack.push(high);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::tests::{HEIGHT_M, air, quick, seed_limits, task};
    use fluxform_base::progress::Silent;
    use fluxform_design::Limits;

    /// Without a budget only the portions are made, one cut each, and nothing is proven.
    #[test]
    fn no_portion_takes_more_than_its_budget() {
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
        let winder = Winder::new(&problems[0], domain, f64::NEG_INFINITY).expect("an air coil");
        let found = winder.enumerate(0, &Silent).expect("runs");
        assert_eq!(found.cells, PORTIONS - 1);
        assert_eq!(found.upper_ln, Some(f64::INFINITY));
    }
}
