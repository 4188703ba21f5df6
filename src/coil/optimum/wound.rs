//! The best coil that can be wound: whole layers, whole turns a layer, any bore.
//!
//! OD = ID + 2 n d and L = m d. Boxes over (n, m, bore) are bounded as in the continuous problem
//! and cut until n and m are single numbers; what remains is a search in the bore alone
//! (argmin's Brent), itself bounded. Nothing is rounded to: a box is dropped only where it is
//! proven to hold no coil within [`SHARE`] of the best.

use std::collections::{BTreeMap, VecDeque};

use rayon::prelude::*;

use super::branch::{self, GAP};
use super::diagnosis;
use super::domain::Domain;
use super::enclosure::{Bounding, Cell, Multipliers};
use super::model::{CoilModel, Strand, Window};
use super::outcome::{BestCoil, Certificate, CertificateKind, LimitUse, Status, Violation};
use super::problem::{LimitName, Problem, Regime, Task};
use super::scalar;
use super::search::{self, Settings, Solved};
use super::sequential::FEASIBLE;
use crate::numerics::interval::Interval;
use crate::progress::{Interrupted, Progress};

/// Share of the best force that a listed coil may lack.
pub const SHARE: f64 = 0.01;
const USED: f64 = 0.9;
const PORTIONS: usize = 64;
/// Slack, in turns, of a dimension that must be a whole number of them.
const WHOLE: f64 = 1e-9;
/// Most boxes of one coil's bore.
const BORES: usize = 20_000;

/// A coil that can be wound.
#[derive(Debug, Clone, PartialEq)]
pub struct WoundCoil {
    /// Its wire.
    pub strand: Strand,
    /// Layers n.
    pub layers: u64,
    /// Turns a layer m.
    pub turns_per_layer: u64,
    /// Its section.
    pub window: Window,
    /// Rated current, A.
    pub current_a: f64,
    /// |force| at the target, N.
    pub force_n: f64,
    /// Mass of the wire's metal, kg.
    pub wire_mass_kg: f64,
    /// Heat at the rated current, W.
    pub power_w: f64,
    /// The limits; sensitivities are the continuous problem's and zero here.
    pub limits: Vec<LimitUse>,
}

/// The best coil that can be wound, and others worth a look.
#[derive(Debug, Clone, PartialEq)]
pub struct WoundOutcome {
    /// How it ended.
    pub status: Status,
    /// The best; present with [`Status::Optimal`].
    pub best: Option<WoundCoil>,
    /// Coils within [`SHARE`] of its force that are shorter, lighter or cooler, none of them
    /// beaten by another in force, length, mass and heat together; strongest first.
    pub alternatives: Vec<WoundCoil>,
    /// What is proven.
    pub certificate: Certificate,
    /// Best force of a coil whose turns need not be whole, N.
    pub continuous_n: Option<f64>,
    /// That coil, with what its limits cost.
    pub continuous: Option<BestCoil>,
    /// Evaluations of a coil by the local searches.
    pub evaluations: usize,
    /// Local searches.
    pub starts: usize,
}

/// A box of coils.
#[derive(Debug, Clone, Copy)]
struct Lattice {
    layers: [u64; 2],
    turns: [u64; 2],
    inner: Interval,
}

/// One coil with its best bore.
#[derive(Debug, Clone, Copy)]
struct Leaf {
    layers: u64,
    turns: u64,
    window: Window,
    ln_force: f64,
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

/// Maximises |force| over the coils that can be wound within `task`, an air coil's.
///
/// # Errors
/// Interruption.
pub fn optimise_wound(
    model: &dyn CoilModel,
    task: &Task,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<WoundOutcome, Interrupted> {
    let none = |status: Status, problems: &[Solved<'_>]| WoundOutcome {
        status,
        best: None,
        alternatives: Vec::new(),
        certificate: Certificate {
            kind: CertificateKind::Multistart,
            upper_bound_n: None,
            gap: None,
            cells: 0,
        },
        continuous_n: search::best_of(problems).and_then(Solved::force_n),
        continuous: search::best_of(problems).and_then(search::describe),
        evaluations: problems.iter().map(|s| s.evaluations).sum(),
        starts: problems.iter().map(|s| s.starts).sum(),
    };
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
                CertificateKind::Multistart
            },
            upper_bound_n: complete.then(|| upper_ln.exp()),
            gap: complete.then_some(gap),
            cells: found.cells,
        },
        ..none(Status::Optimal, &problems)
    })
}

/// A finite box about a problem's continuous optimum.
fn around_optimum(solved: &Solved<'_>) -> Option<Domain> {
    const WIDER: f64 = 3.0;
    let window = Problem::window(solved.best.as_ref()?.x);
    let mut domain = Domain::of(&solved.problem);
    domain.outer_m[1] = domain.outer_m[1].min(WIDER * window.outer_radius_m());
    domain.length_m[1] = domain.length_m[1].min(WIDER * window.length_m);
    Some(domain)
}

/// Why no coil can be wound though coils of any turns exist: what the nearest whole one breaks.
fn rounded_status(open: &[&Solved<'_>]) -> Status {
    let mut least: Option<(Vec<Violation>, Window)> = None;
    for solved in open {
        let Some(local) = &solved.best else { continue };
        let wire_m = solved.problem.strand.diameter_m;
        let mut window = Problem::window(local.x);
        let whole = |length_m: f64| (length_m / wire_m).floor().max(1.0) * wire_m;
        window.depth_m = whole(window.depth_m);
        window.length_m = whole(window.length_m);
        let broken = diagnosis::violations(&solved.problem, window);
        if least.is_none() {
            least = Some((broken, window));
        }
    }
    let (violations, least) = least.unwrap_or((
        Vec::new(),
        Window {
            inner_radius_m: 0.0,
            depth_m: 0.0,
            length_m: 0.0,
        },
    ));
    Status::Infeasible { violations, least }
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
                    if found.cells > budget {
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

/// The best leaf of every coil, in order of layers and turns.
fn once_each(leaves: Vec<Leaf>) -> Vec<Leaf> {
    let mut best: BTreeMap<(u64, u64), Leaf> = BTreeMap::new();
    for leaf in leaves {
        let slot = best.entry((leaf.layers, leaf.turns)).or_insert(leaf);
        if leaf.ln_force > slot.ln_force {
            *slot = leaf;
        }
    }
    best.into_values().collect()
}

fn describe(problem: &Problem<'_>, leaf: &Leaf) -> Option<WoundCoil> {
    let rated = problem.rate(leaf.window)?;
    let point = problem.scaled(&rated);
    let limits = problem
        .bounds
        .iter()
        .enumerate()
        .filter(|(_, bound)| {
            !matches!(
                bound.name,
                LimitName::Axis | LimitName::OneLayer | LimitName::OneTurn
            )
        })
        .map(|(row, bound)| LimitUse {
            name: bound.name,
            value: rated.values[row].value,
            limit: bound.limit,
            active: point.rows[row].abs() <= 1e-9,
            sensitivity_n_per_unit: 0.0,
        })
        .collect();
    let volume = leaf.window.volume_over_pi_m3().value;
    let resistance_ohm = volume * problem.strand.resistance_per_volume();
    Some(WoundCoil {
        strand: problem.strand,
        layers: leaf.layers,
        turns_per_layer: leaf.turns,
        window: leaf.window,
        current_a: rated.current_a,
        force_n: rated.force_n.value,
        wire_mass_kg: volume * problem.strand.mass_per_volume(),
        power_w: rated.current_a * rated.current_a * resistance_ohm,
        limits,
    })
}

/// Of coils sorted by force: those better than `best` in length, mass or heat, and not beaten
/// by a stronger one in all three.
fn worth_a_look(best: &WoundCoil, sorted: &[WoundCoil]) -> Vec<WoundCoil> {
    let traits = |coil: &WoundCoil| [coil.window.length_m, coil.wire_mass_kg, coil.power_w];
    let mut kept: Vec<WoundCoil> = Vec::new();
    for coil in sorted.iter().skip(1) {
        // Rounding is no advantage.
        let beaten = |other: &WoundCoil| {
            traits(other)
                .iter()
                .zip(traits(coil))
                .all(|(theirs, ours)| *theirs <= ours * (1.0 + 1e-9))
        };
        if !beaten(best) && !kept.iter().any(beaten) {
            kept.push(coil.clone());
        }
    }
    kept
}
