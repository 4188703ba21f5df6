//! Coils in air that can be wound, in boxes over layers, turns and bore.
//!
//! Boxes are bounded as in the continuous problem and cut until layers and turns are single
//! numbers; what remains is a search in the bore alone, itself bounded. Nothing is rounded to.

use super::best_bore::Bores;
use super::best_first::{CoilSets, Parts, WHOLE, least, whole};
use super::branch_and_bound::{self, GAP};
use super::candidates::{Leaf, SHARE};
use super::domain::Domain;
use super::interval_bounds::{Bounding, Cell, Multipliers};
use super::local_searches::Solved;
use super::problem::Problem;
use fluxform_base::progress::poll;
use fluxform_numerics::interval::Interval;

const USED: f64 = 0.9;
/// Most boxes of one coil's bore, and of one that a current loop's time holds back, for which there is no bound.
const BORES: usize = 20_000;
const UNBOUNDED_BORES: usize = 100;

/// A box of coils.
#[derive(Debug, Clone, Copy)]
pub(super) struct LatticeBox {
    layers: [u64; 2],
    turns: [u64; 2],
    inner: Interval,
}

impl LatticeBox {
    fn cell(&self, wire_m: f64) -> Cell {
        let span =
            |range: [u64; 2]| Interval::new(range[0] as f64 * wire_m, range[1] as f64 * wire_m);
        Cell {
            inner: self.inner,
            depth: span(self.layers),
            length: span(self.turns),
        }
    }

    /// Both halves along what is widest; layers and turns are not both single numbers.
    fn halves(&self, wire_m: f64) -> [Self; 2] {
        let relative = |range: [u64; 2]| (range[1] - range[0]) as f64 / range[1] as f64;
        let (n, m) = (relative(self.layers), relative(self.turns));
        let size = self.inner.hi + 0.5 * self.layers[1] as f64 * wire_m;
        let inner = (self.inner.hi - self.inner.lo) / size;
        let (mut low, mut high) = (*self, *self);
        let cut = |low: &mut [u64; 2], high: &mut [u64; 2]| {
            let middle = low[0] + (low[1] - low[0]) / 2;
            low[1] = middle;
            high[0] = middle + 1;
        };
        if inner > n && inner > m {
            let middle = 0.5 * (self.inner.lo + self.inner.hi);
            low.inner.hi = middle;
            high.inner.lo = middle;
        } else if n >= m {
            cut(&mut low.layers, &mut high.layers);
        } else {
            cut(&mut low.turns, &mut high.turns);
        }
        [low, high]
    }
}

/// One problem's coils.
pub(super) struct BoundedCoils<'a> {
    bores: Bores<'a>,
    bounding: Bounding<'a>,
    /// Whether the settling time holds the continuous optimum back, or may be why there is none.
    with_settling: bool,
    best_ln: f64,
}

impl<'a> BoundedCoils<'a> {
    /// `None` for a coil with a core. `best_ln` is ln F of a coil that can be wound.
    pub fn new(solved: &'a Solved<'a>, domain: Domain, best_ln: f64) -> Option<Self> {
        let problem = &solved.problem;
        let multipliers = solved
            .best
            .as_ref()
            .map_or_else(Multipliers::default, |local| {
                Multipliers::of(problem, local)
            });
        let with_settling = multipliers.settling > 0.0 || solved.best.is_none();
        Some(Self {
            bounding: Bounding::new(problem, domain, multipliers, with_settling)?,
            bores: Bores::of(problem),
            with_settling,
            best_ln,
        })
    }

    fn wire_m(&self) -> f64 {
        self.bores.problem.strand.diameter_m
    }

    /// The box without what limits exclude, and an upper bound of ln F; `None` where nothing is
    /// left.
    fn bounded(&self, mut coils: LatticeBox, enough_ln: f64) -> Option<(f64, LatticeBox)> {
        let wire_m = self.wire_m();
        let cell = self.bounding.contracted(coils.cell(wire_m))?;
        coils.inner = cell.inner;
        for (range, span) in [
            (&mut coils.layers, cell.depth),
            (&mut coils.turns, cell.length),
        ] {
            range[0] = range[0].max(least(span.lo / wire_m));
            range[1] = range[1].min((span.hi / wire_m + WHOLE).floor() as u64);
            if range[0] > range[1] {
                return None;
            }
        }
        let bound_ln = self.bounding.ln_force(&coils.cell(wire_m), enough_ln)?;
        Some((bound_ln, coils))
    }

    /// The best bore of one coil; the contraction leaves rounding's slack on both sides.
    fn best(&self, layers: u64, turns: u64, inner: Interval) -> Option<Leaf> {
        let domain = &self.bounding.domain;
        let depth_m = layers as f64 * self.wire_m();
        let lo = inner.lo.max(domain.inner_m[0]);
        let hi = inner.hi.min(domain.outer_m[1] - depth_m).max(lo);
        self.bores.best(layers, turns, [lo, hi], f64::NEG_INFINITY)
    }

    /// Proves that no bore of one coil exceeds `value` by more than the gap.
    fn bound_bores(&self, cell: Cell, value: f64, parts: &mut Parts<LatticeBox>) {
        let enough = value + USED * GAP;
        let unbounded = self.with_settling && self.bores.problem.closes_a_loop();
        let most = if unbounded { UNBOUNDED_BORES } else { BORES };
        let mut stack = vec![cell];
        let mut count = 0;
        while let Some(cell) = stack.pop() {
            poll();
            count += 1;
            parts.cells += 1;
            let Some(cell) = self.bounding.contracted(cell) else {
                continue;
            };
            let Some(bound) = self.bounding.ln_force(&cell, enough) else {
                continue;
            };
            let middle = 0.5 * (cell.inner.lo + cell.inner.hi);
            let cut = middle > cell.inner.lo && middle < cell.inner.hi;
            if bound <= enough || !cut || count > most {
                parts.bound_ln = parts.bound_ln.max(bound);
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

impl CoilSets for BoundedCoils<'_> {
    type Set = LatticeBox;

    fn problem(&self) -> &Problem<'_> {
        self.bores.problem
    }

    fn all(&self, enough_ln: f64) -> Parts<LatticeBox> {
        let all = branch_and_bound::whole(&self.bounding.domain);
        // The limits' contraction knows no least length.
        let range = |span: Interval| {
            [
                least(span.lo / self.wire_m()),
                whole(span.hi / self.wire_m()),
            ]
        };
        let all = LatticeBox {
            layers: range(all.depth),
            turns: range(all.length),
            inner: all.inner,
        };
        Parts {
            sets: self.bounded(all, enough_ln).into_iter().collect(),
            cells: 1,
            ..Parts::default()
        }
    }

    fn parts(&self, coils: &LatticeBox, enough_ln: f64) -> Parts<LatticeBox> {
        let mut parts = Parts::default();
        let wire_m = self.wire_m();
        if coils.layers[0] == coils.layers[1] && coils.turns[0] == coils.turns[1] {
            let leaf = self.best(coils.layers[0], coils.turns[0], coils.inner);
            let value = leaf.map_or(f64::NEG_INFINITY, |leaf| leaf.ln_force);
            parts.coils.extend(leaf);
            let best_ln = self.best_ln.max(enough_ln - (-SHARE).ln_1p());
            self.bound_bores(coils.cell(wire_m), value.max(best_ln), &mut parts);
        } else {
            parts.cells = 2;
            let halves = coils
                .halves(wire_m)
                .map(|half| self.bounded(half, enough_ln));
            parts.sets = halves.into_iter().flatten().collect();
        }
        parts
    }
}

/// Coils next to a problem's continuous optimum that can be wound.
pub(super) fn next_to_continuous(solved: &Solved<'_>) -> Vec<Leaf> {
    let Some(local) = &solved.best else {
        return Vec::new();
    };
    let window = Problem::window(local.x);
    let mut domain = Domain::of(&solved.problem);
    domain.inner_m[1] = domain.inner_m[1].min(4.0 * window.outer_radius_m());
    let bores = Bores::of(&solved.problem);
    let wire_m = solved.problem.strand.diameter_m;
    let around = |size_m: f64| {
        let nearest = whole(size_m / wire_m);
        nearest.saturating_sub(2).max(1)..=nearest + 2
    };
    let mut leaves = Vec::new();
    for layers in around(window.depth_m) {
        for turns in around(window.length_m) {
            let range = bores.range(&domain, 0.0, layers, turns);
            leaves.extend(
                range.and_then(|range| bores.best(layers, turns, range, f64::NEG_INFINITY)),
            );
        }
    }
    leaves
}
