//! Both paths of one problem, from columns and in an arithmetic in which they can be trusted.

use fluxform_base::force_constant::Criterion;
use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::criteria::{Comparison, VISIBLE};
use super::exact_start::{NearLinear, exact_start};
use super::homotopy::{Bounds, Follower, Piece, Trace};
use super::model::Model;
use super::path::Path;
use super::problem::{ForceProblem, Settings};
use super::qr_reduction::{Reduced, counted_coils};
use super::rest;

/// Above this condition number of the coils' columns doubles do not decide.
const PLAIN_CONDITION: f64 = 1e3;
/// Up to this condition number, found in doubles, no column depends on others within rounding.
const INDEPENDENT: f64 = 1e10;
/// Error of e*, relative to lambda^2 mean(h^2), up to which doubles are enough.
const PLAIN_ERROR: f64 = 2e-14;
/// Share of a column outside the span of others that is weak: currents within the limits do little with it. Where the
/// best error is of the order of the least share, multipliers are of its square and rounding over it: this is above the
/// third root of rounding.
const WEAK: f64 = 1e-8;
/// The same for lambda_jnd alone.
const WEAK_FOR_JND: f64 = 1e-6;
/// Change of e* at lambda_jnd, relative to the excess there, that leaves lambda_jnd alone.
const SMALL: f64 = 1e-6;
/// Change of e*, relative to lambda^2 mean(h^2), up to which dependences are taken as exact.
const SHOWN: f64 = 1e-11;
/// Changes of the basis after which a path is given up, as a multiple of those of the path without weak parts:
/// rounding leads it round and round.
const ASTRAY: usize = 5;
/// Largest relative violation of optimality that is taken for rounding: its square counts.
const FLAW: f64 = 1e-8;

/// The arithmetic in which the points were reduced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 53 bits.
    Double,
    /// About 105 bits.
    DoubleDouble,
}

/// How much of the path is needed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Extent {
    /// All of it.
    Whole,
    /// Up to lambda_jnd of this weight above zero, if there is no offset: beyond, the path comes to rest.
    ToJnd(f64),
}

impl Extent {
    /// What the chosen constant needs.
    pub fn of(settings: &Settings) -> Self {
        match settings.criterion {
            Criterion::Jnd if settings.jnd_weight > 0.0 => Self::ToJnd(settings.jnd_weight),
            _ => Self::Whole,
        }
    }

    /// The share of `lambda^2` beyond which e* is not needed.
    fn most_error(self, unlimited: &Piece, heights: &[Num]) -> Option<Num> {
        let square = |v: &[Num]| Num::dot(v, v);
        match self {
            Self::Whole => None,
            Self::ToJnd(weight) => {
                let share = Num::of(weight) * Num::of(weight);
                Some(square(&unlimited.residual_rate) + share * square(heights))
            }
        }
    }
}

/// Both paths of one reduced problem.
pub(super) struct Solved {
    pub reduced: Reduced,
    model: Model,
    bounds: Bounds,
    /// The bounds of `unlimited`.
    free_bounds: Bounds,
    pub limited: Trace,
    pub unlimited: Trace,
    /// Rounding in e*, relative to `lambda^2 mean(h^2)`.
    pub error: f64,
    pub flaw: f64,
    /// Share of `lambda^2 mean(h^2)` up to which e* may be off since weak parts are left out.
    pub doubt: f64,
    /// Where the first limit binds, if the limited path does not show it.
    linear: Option<Num>,
}

/// A problem whose paths are followed, from one reduction or another.
struct Task<'p> {
    problem: &'p ForceProblem<'p>,
    extent: Extent,
    near_linear: NearLinear,
}

/// The path without the drivers' size.
struct Unlimited {
    bounds: Bounds,
    trace: Trace,
    /// Rounding in e* on it, relative to `lambda^2 mean(h^2)`.
    error: f64,
}

impl Unlimited {
    fn new(problem: &ForceProblem, reduced: &Reduced) -> Self {
        let (model, bounds) = reduced.unlimited(problem);
        let follower = Follower {
            model: &model,
            bounds: &bounds,
            start: None,
            most_error: None,
            most_changes: None,
        };
        let trace = follower.path(reduced.offset().as_deref(), reduced.heights());
        let error = rounding(&model, &trace, reduced.heights());
        Self {
            bounds,
            trace,
            error,
        }
    }
}

impl<'p> Task<'p> {
    fn new(problem: &'p ForceProblem<'p>, extent: Extent) -> Self {
        Self {
            problem,
            extent,
            near_linear: NearLinear::default(),
        }
    }

    /// Both paths; the limited one is given up after this many changes of its basis.
    fn solved(&self, reduced: Reduced, most_changes: Option<usize>) -> Solved {
        let unlimited = Unlimited::new(self.problem, &reduced);
        self.with(reduced, unlimited, most_changes)
    }

    fn with(&self, reduced: Reduced, free: Unlimited, most_changes: Option<usize>) -> Solved {
        let problem = self.problem;
        let offset = reduced.offset();
        let heights = reduced.heights();
        let (model, bounds) = reduced.limited(problem);
        let unlimited = &free.trace.pieces[0];
        let most_error = self.extent.most_error(unlimited, heights);
        let rate = &unlimited.residual_rate;
        let follower = Follower {
            model: &model,
            bounds: &bounds,
            start: exact_start(
                problem,
                &reduced,
                (&model, &bounds),
                rate,
                &self.near_linear,
            ),
            most_error: most_error.filter(|_| offset.is_none()),
            most_changes,
        };
        let mut limited = follower.path(offset.as_deref(), heights);
        let mut error = rounding(&model, &limited, heights).max(free.error);
        if limited.complete && rest::bring_to_rest(&mut limited, offset.as_deref(), heights) {
            error += rest::COST;
        }
        Solved {
            model,
            bounds,
            free_bounds: free.bounds,
            error,
            flaw: limited.flaw.max(free.trace.flaw),
            doubt: 0.0,
            linear: None,
            limited,
            unlimited: free.trace,
            reduced,
        }
    }

    /// From the reduction in doubles; `None` where that is not enough.
    fn plainly(&self, reduced: Reduced) -> Option<Solved> {
        let free = Unlimited::new(self.problem, &reduced);
        if free.error > PLAIN_ERROR {
            return None;
        }
        let solved = self.with(reduced, free, None);
        (solved.reliable() && solved.error <= PLAIN_ERROR).then_some(solved)
    }

    /// Where columns may depend on each other: dependences that lie within the rounding of the forces are
    /// taken as exact, provided that this does not show in e*. With the number of independent columns.
    fn dependent(&self, reduced: Reduced) -> (Solved, usize) {
        let clean = reduced.with_clean_dependences();
        let exact = match &clean {
            Some(clean) => (&clean.reduced, clean.rank),
            None => (&reduced, reduced.counted()),
        };
        // The whole path over few points is straight as long as the force is exact.
        let few = self.problem.points() < reduced.counted();
        let pays = !few || matches!(self.extent, Extent::ToJnd(_));
        let strong = pays.then(|| self.strong(&reduced, exact, None));
        let mut strong = match strong.flatten() {
            Some((strong, true)) => return (strong, exact.1),
            strong => strong.map(|(strong, _)| strong),
        };
        let most = |strong: &Option<Solved>| Some(ASTRAY * strong.as_ref()?.limited.changes);
        let most_of_clean = most(&strong);
        let exact = (exact.0.clone(), exact.1);
        let clean = clean.map(|clean| {
            let moved = clean.most_moved(self.problem);
            let mut solved = self.solved(clean.reduced, most_of_clean);
            let change = solved.change(moved);
            solved.error += change;
            (solved, clean.rank, change)
        });
        let clean = clean.filter(|(clean, _, _)| clean.reliable());
        match clean {
            Some((clean, rank, change)) if change <= SHOWN => (clean, rank),
            clean => {
                if clean.is_none() && strong.is_none() {
                    let exact = (&exact.0, exact.1);
                    let mut others = [WEAK, WEAK_FOR_JND].into_iter();
                    let other = others.find_map(|share| self.strong(&reduced, exact, Some(share)));
                    strong = other.map(|(strong, _)| strong);
                }
                let literal = self.solved(reduced, most(&strong));
                let rank = literal.reduced.rank();
                match clean {
                    _ if literal.reliable() => (literal, rank),
                    Some((clean, rank, _)) => (clean, rank),
                    None => (in_place_of(literal, rank, strong), rank),
                }
            }
        }
    }

    /// Without the weak parts of columns, which add hundreds of breakpoints, decided by rounding where the force can be
    /// rendered all but exactly: they count for e_0 only, whose currents have no limit. `exact` has the given number of
    /// independent columns. With whether a bound says that this is enough. `at_any_cost` is the share of weak parts where
    /// the path cannot be followed with them.
    fn strong(
        &self,
        reduced: &Reduced,
        (exact, rank): (&Reduced, usize),
        at_any_cost: Option<f64>,
    ) -> Option<(Solved, bool)> {
        let share = at_any_cost.unwrap_or(match self.extent {
            Extent::Whole => WEAK,
            Extent::ToJnd(_) => WEAK_FOR_JND,
        });
        if self.problem.offset_n.is_some() {
            return None;
        }
        let strong = reduced.without_weak_parts(share)?;
        if strong.rank == rank {
            return None;
        }
        let moved = strong.most_moved(self.problem);
        let length = |v: &[Num]| Num::dot(v, v).sqrt();
        let heights = strong.reduced.heights();
        let (height, weak) = (length(heights), length(&heights[strong.rank..]));
        // No path changes that.
        if at_any_cost.is_none()
            && matches!(self.extent, Extent::Whole)
            && weak * weak > Num::of(SHOWN) * height * height
        {
            return None;
        }
        let free = Unlimited::new(self.problem, exact);
        let mut solved = self.with(strong.reduced, free, None);
        // The change is largest at the first breakpoint; lambda_jnd lies on the last piece but that of rest.
        let pieces = &solved.limited.pieces;
        let start = |place: usize| pieces.get(place).map(|piece| piece.start);
        let (change, most) = match self.extent {
            Extent::Whole => {
                let requested = start(1)? * height;
                let share = weak / height + moved / requested;
                (share * share, SHOWN)
            }
            Extent::ToJnd(weight) => {
                let requested = start(pieces.len().saturating_sub(2).max(1))? * height;
                let share = moved / requested;
                let change = (Num::of(2.0) * weak / height + share) * share;
                (change, SMALL * weight * weight)
            }
        };
        let change = change.to_f64();
        solved.error += change;
        solved.doubt = change;
        let reliable = solved.reliable();
        reliable.then_some((solved, change <= most))
    }
}

impl Solved {
    /// e* and e_0 side by side.
    pub fn comparison(&self) -> Comparison<'_> {
        let heights = self.reduced.heights();
        Comparison {
            limited: &self.limited,
            unlimited: &self.unlimited,
            mean_square: Num::dot(heights, heights),
            visible: VISIBLE.max(self.doubt),
        }
    }

    /// The limited path in SI units.
    pub fn path(&self, problem: &ForceProblem) -> Path {
        let Self {
            reduced,
            bounds,
            limited,
            ..
        } = self;
        Path::new(problem, reduced, bounds, limited, self.doubt)
    }

    /// lambda_linear, scaled, with `rank` independent columns.
    pub fn linear(&self, comparison: &Comparison<'_>, rank: usize) -> Option<Num> {
        if comparison.mean_square <= Num::ZERO {
            None
        } else if self.linear.is_some() {
            self.linear
        } else if rank == self.reduced.counted() {
            comparison.linear(&self.model, &self.bounds, &self.free_bounds)
        } else {
            comparison.linear_by_error()
        }
    }

    pub fn reliable(&self) -> bool {
        self.limited.complete && self.unlimited.complete && self.flaw <= FLAW
    }

    /// Bound on the change of e*, relative to `lambda^2 mean(h^2)`, where the fit of any currents within the limits
    /// moves by no more than `moved`, in its unit.
    fn change(&self, moved: Num) -> f64 {
        let heights = self.reduced.heights();
        let height = Num::dot(heights, heights).sqrt();
        let change = |piece: &Piece| {
            let error = Num::dot(&piece.residual, &piece.residual).sqrt();
            let requested = piece.start * height;
            ((error + error + moved) * moved / (requested * requested)).to_f64()
        };
        let pieces = self.limited.pieces.iter();
        let changes = pieces.filter(|piece| piece.start > Num::ZERO).map(change);
        changes.fold(0.0, f64::max)
    }
}

/// First-order effect of the columns' rounding on e*, at the breakpoints: the residual times
/// the sum of all columns' contributions, and a margin for the sums over points.
fn rounding(model: &Model, trace: &Trace, heights: &[Num]) -> f64 {
    let size = Num::dot(heights, heights).sqrt();
    let mut worst = 1.0_f64;
    for piece in &trace.pieces {
        // On the first piece everything grows with lambda: its rates will do.
        let (x, residual, requested) = if piece.start > Num::ZERO {
            (&piece.x, &piece.residual, piece.start * size)
        } else {
            (&piece.x_rate, &piece.residual_rate, size)
        };
        if requested > Num::ZERO {
            let moved = x
                .iter()
                .zip(&model.norm)
                .fold(Num::ZERO, |s, (&x, &n)| s + x.abs() * n);
            let share =
                Num::dot(residual, residual).sqrt() / requested * (moved / requested + Num::ONE);
            worst = worst.max(share.to_f64());
        }
    }
    20.0 * model.epsilon * worst
}

/// Both paths, the number of independent columns, and the arithmetic of their reduction.
pub(super) fn solve_paths(
    problem: &ForceProblem,
    largest: &[f64],
    extent: Extent,
) -> (Solved, usize, Precision) {
    let task = Task::new(problem, extent);
    let counted = counted_coils(problem, largest);
    let mut condition = None;
    if problem.points() >= counted.len() && counted.iter().all(|&coil| largest[coil] > 0.0) {
        let reduced = Reduced::new::<f64>(problem, largest);
        let plain = reduced.condition();
        condition = Some(plain).filter(|&condition| condition <= INDEPENDENT);
        if plain <= PLAIN_CONDITION
            && let Some(solved) = task.plainly(reduced)
        {
            return (solved, counted.len(), Precision::Double);
        }
    }
    let reduced = condition
        .and_then(|condition| Reduced::by_products(problem, largest, condition))
        .unwrap_or_else(|| Reduced::new::<Num>(problem, largest));
    let (solved, rank) = match condition {
        Some(_) => (task.solved(reduced, None), counted.len()),
        None => task.dependent(reduced),
    };
    (solved, rank, Precision::DoubleDouble)
}

/// The path without weak parts where the one with them cannot be followed to its end: what they move is least at the
/// last breakpoints, and the first one is known. Its flaw is one that a proof at the chosen force constant outweighs.
fn in_place_of(literal: Solved, rank: usize, strong: Option<Solved>) -> Solved {
    let linear = literal.linear(&literal.comparison(), rank);
    match strong {
        Some(strong) if linear.is_some() => Solved {
            flaw: 1.0,
            doubt: SHOWN,
            linear,
            ..strong
        },
        _ => literal,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qr_reduction::largest_entries;

    /// Dipoles 10 mm apart under points 200 mm above: what is left out of nearly dependent columns changes e* by no more
    /// than is said, and lambda_jnd not at all.
    #[test]
    fn weak_parts_of_columns_leave_the_force_alone() {
        let (side, samples, height) = (7, 9, 0.2_f64);
        let force = |i: usize, j: usize| {
            let middle = |k: usize, of: usize| k as f64 - 0.5 * (of as f64 - 1.0);
            let apart = |a: usize, b: usize| 0.01 * (middle(a, side) - middle(b, samples));
            let flat = apart(i % side, j % samples).powi(2) + apart(i / side, j / samples).powi(2);
            1e-5 * height * (2.0 * height.powi(2) - 3.0 * flat) / (flat + height.powi(2)).powf(3.5)
        };
        let (coils, points) = (side * side, samples * samples);
        let forces: Vec<f64> = (0..points)
            .flat_map(|j| (0..coils).map(move |i| force(i, j)))
            .collect();
        let all = |value: f64| vec![value; coils];
        // What uneven currents give, so that limits alone leave an error.
        let heights: Vec<f64> = (forces.chunks_exact(coils))
            .map(|row| {
                let currents = (0..coils).map(|i| 1.0 + 0.5 * (i as f64).sin());
                row.iter().zip(currents).map(|(f, i)| f * i).sum::<f64>()
            })
            .collect();
        let problem = ForceProblem {
            forces_n_per_a: &forces,
            height_m: &heights,
            offset_n: None,
            weights: None,
            lower_a: &all(0.0),
            upper_a: &all(2.0),
            total_max_a: None,
            resistance_ohm: &all(6.1),
        };
        let weight = Settings::default().jnd_weight;
        let reduced = Reduced::new::<Num>(&problem, &largest_entries(&problem));
        let (exact, rank) = match reduced.with_clean_dependences() {
            Some(clean) => (clean.reduced, clean.rank),
            None => (reduced.clone(), coils),
        };
        let literal = Task::new(&problem, Extent::Whole).solved(exact.clone(), None);
        let jnd = |solved: &Solved| solved.comparison().jnd(weight).unwrap().to_f64();
        let e = |solved: &Solved, lambda: Num| {
            let pieces = &solved.limited.pieces;
            let later = pieces.partition_point(|piece| piece.start <= lambda);
            let residual = pieces[later - 1].residual_at(lambda);
            Num::dot(&residual, &residual)
        };
        for extent in [Extent::Whole, Extent::ToJnd(weight)] {
            let task = Task::new(&problem, extent);
            let (strong, enough) = task.strong(&reduced, (&exact, rank), None).unwrap();
            assert!(enough);
            assert!(strong.reduced.heights().len() < rank && strong.doubt > 0.0);
            assert!((jnd(&strong) / jnd(&literal) - 1.0).abs() < 1e-9);
            let until = match extent {
                Extent::Whole => 3.0,
                Extent::ToJnd(_) => 1.0,
            };
            for k in 1..40 {
                let lambda = Num::of(until * jnd(&literal) * f64::from(k) / 40.0);
                let requested = lambda * lambda * literal.comparison().mean_square;
                let off = ((e(&strong, lambda) - e(&literal, lambda)) / requested).to_f64();
                let known = match extent {
                    Extent::Whole => strong.doubt,
                    Extent::ToJnd(weight) => SMALL * weight * weight,
                };
                assert!(off.abs() <= known, "{k}: {off:e} {known:e}");
            }
        }
    }
}
