//! The solved path in SI units: errors and currents at any force constant.

use std::fmt;

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::homotopy::{Bounds, Piece, Trace, VariableState};
use super::model::Model;
use super::power;
use super::problem::ForceProblem;
use super::qr_reduction::{Reduced, power_of_two, times_power};

/// Changes at a breakpoint. Coils are numbered from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A coil begins to carry current.
    LeavesZero(usize),
    /// A coil's current has gone back to zero and stays there.
    ReturnsToZero(usize),
    /// A coil meets its upper limit.
    MeetsUpper(usize),
    /// A coil comes back from its upper limit.
    LeavesUpper(usize),
    /// A coil meets its lower limit (below zero).
    MeetsLower(usize),
    /// A coil comes back from its lower limit (below zero).
    LeavesLower(usize),
    /// The sum of the currents meets its limit.
    TotalMeetsLimit,
    /// The sum of the currents falls below its limit again.
    TotalLeavesLimit,
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LeavesZero(i) => write!(f, "coil {i} leaves zero"),
            Self::ReturnsToZero(i) => write!(f, "coil {i} returns to zero"),
            Self::MeetsUpper(i) => write!(f, "coil {i} meets its upper limit"),
            Self::LeavesUpper(i) => write!(f, "coil {i} comes back from its upper limit"),
            Self::MeetsLower(i) => write!(f, "coil {i} meets its lower limit"),
            Self::LeavesLower(i) => write!(f, "coil {i} comes back from its lower limit"),
            Self::TotalMeetsLimit => write!(f, "the sum meets its limit"),
            Self::TotalLeavesLimit => write!(f, "the sum leaves its limit"),
        }
    }
}

/// A force constant at which the path turns.
#[derive(Debug, Clone, PartialEq)]
pub struct Breakpoint {
    /// Force constant, N/m.
    pub lambda_n_per_m: f64,
    /// Currents there, A.
    pub currents_a: Vec<f64>,
    /// Changes there; several at once are common.
    pub events: Vec<Event>,
}

/// Relative differences up to this are rounding in a path that is returned.
const TIE: f64 = 1e-14;

/// The state of a coil or the sum between two breakpoints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Standing {
    Lower,
    Upper,
    Between,
}

/// The limits in SI units, and what changes at them.
#[derive(Debug, Clone)]
pub(super) struct Limits {
    pub lower_a: Vec<f64>,
    pub upper_a: Vec<f64>,
    pub total_max_a: Option<f64>,
}

/// One piece in SI units.
#[derive(Debug, Clone)]
struct SiPiece {
    /// Its start and what that rounds off: on a steep piece the remainder counts.
    start: f64,
    start_rest: f64,
    currents: Vec<f64>,
    rates: Vec<f64>,
    residual: Vec<f64>,
    residual_rate: Vec<f64>,
    /// Per coil, then for the sum.
    standing: Vec<Standing>,
}

/// Data for least-power currents where the currents of a minimiser are not unique.
#[derive(Debug, Clone)]
struct Ambiguous {
    model: Model,
    bounds: Bounds,
    pieces: Vec<Piece>,
    cost: Vec<Num>,
    heights: Num,
    lambda_scale: i32,
}

/// e* and the currents as functions of the force constant, exact on every piece.
#[derive(Debug, Clone)]
pub struct Path {
    pieces: Vec<SiPiece>,
    ambiguous: Option<Box<Ambiguous>>,
    limits: Limits,
    current_scale: Vec<i32>,
    /// Mean square error over lambda^2 up to which there may be none, m^2; 0 where it is exact.
    doubt_m2: f64,
    /// First pieces after each breakpoint.
    turns: Vec<usize>,
}

impl Path {
    /// Converts a scaled path whose errors are known to the share `doubt` of the requested force's mean square.
    pub(super) fn new(
        problem: &ForceProblem,
        reduced: &Reduced,
        bounds: &Bounds,
        trace: &Trace,
        doubt: f64,
    ) -> Self {
        let coils = problem.coils();
        let force = reduced.force_unit_n();
        let scale = reduced.lambda_scale;
        let current_scale: Vec<i32> = (0..coils).map(|i| reduced.current_scale(i)).collect();
        let pieces = trace
            .pieces
            .iter()
            .map(|piece| {
                let nearest = piece.start.to_f64();
                let rest = (piece.start - Num::of(nearest)).to_f64();
                let (x, residual) = (&piece.x, &piece.residual);
                let current =
                    |i: usize, v: Num, more: i32| times_power(v.to_f64(), more - current_scale[i]);
                SiPiece {
                    start: times_power(nearest, scale),
                    start_rest: times_power(rest, scale),
                    currents: (0..coils).map(|i| current(i, x[i], 0)).collect(),
                    rates: (0..coils)
                        .map(|i| current(i, piece.x_rate[i], -scale))
                        .collect(),
                    residual: residual.iter().map(|v| v.to_f64() * force).collect(),
                    residual_rate: piece
                        .residual_rate
                        .iter()
                        .map(|v| times_power(v.to_f64() * force, -scale))
                        .collect(),
                    standing: (0..piece.x.len())
                        .map(|i| {
                            // The slack of the sum lies between zero and the limit.
                            let lower = bounds.lower[i].unwrap_or(Num::ZERO);
                            let upper = bounds.upper[i].unwrap_or(bounds.total);
                            standing_of(piece.place[i], x[i], piece.x_rate[i], lower, upper)
                        })
                        .collect(),
                }
            })
            .collect();
        let mut path = Self {
            pieces,
            ambiguous: None,
            limits: Limits {
                lower_a: problem.lower_a.to_vec(),
                upper_a: problem.upper_a.to_vec(),
                total_max_a: problem.total_max_a,
            },
            current_scale,
            doubt_m2: doubt * problem.rms_height_m().powi(2),
            turns: Vec::new(),
        };
        path.turns = path.turns();
        path
    }

    /// Makes `currents` those of least power among equally good ones.
    pub(super) fn with_least_power(
        mut self,
        problem: &ForceProblem,
        reduced: &Reduced,
        trace: &Trace,
    ) -> Self {
        let (model, bounds) = reduced.limited(problem);
        let most = self.current_scale.iter().copied().max().unwrap_or(0);
        let cost = problem
            .resistance_ohm
            .iter()
            .zip(&self.current_scale)
            .map(|(&ohm, &k)| Real::sqrt(Num::of(ohm)) * Num::of(power_of_two(most - k)))
            .collect();
        let heights = reduced.heights();
        self.ambiguous = Some(Box::new(Ambiguous {
            model,
            bounds,
            pieces: trace.pieces.clone(),
            cost,
            heights: Real::sqrt(Num::dot(heights, heights)),
            lambda_scale: reduced.lambda_scale,
        }));
        self.turns = self.turns();
        self
    }

    /// Index of the piece that holds `lambda`, and the step from its start.
    fn locate(&self, lambda: f64) -> (usize, f64) {
        let step = |piece: &SiPiece| (lambda - piece.start) - piece.start_rest;
        let index = self
            .pieces
            .partition_point(|piece| step(piece) >= 0.0)
            .saturating_sub(1);
        (index, step(&self.pieces[index]))
    }

    /// Mean square error e*(lambda), N^2, for `lambda_n_per_m >= 0`.
    #[must_use]
    pub fn error_n2(&self, lambda_n_per_m: f64) -> f64 {
        let (index, step) = self.locate(lambda_n_per_m);
        let piece = &self.pieces[index];
        let square = |(r, d): (&f64, &f64)| (r + step * d).powi(2);
        piece
            .residual
            .iter()
            .zip(&piece.residual_rate)
            .map(square)
            .sum()
    }

    /// The best currents at `lambda_n_per_m >= 0`, A; where several are equally good, those of
    /// least power.
    #[must_use]
    pub fn currents_a(&self, lambda_n_per_m: f64) -> Vec<f64> {
        if let Some(a) = &self.ambiguous {
            let (index, _) = self.locate(lambda_n_per_m);
            let lambda = Num::of(times_power(lambda_n_per_m, -a.lambda_scale));
            let norm = lambda * a.heights;
            let x =
                power::least_power(&a.model, &a.bounds, &a.cost, &a.pieces[index], lambda, norm);
            let scales = self.current_scale.iter();
            let currents = x.iter().zip(scales);
            return self.within(currents.map(|(x, scale)| times_power(x.to_f64(), -scale)));
        }
        self.fitting_a(lambda_n_per_m)
    }

    /// Best currents, A, whatever power they take.
    pub(super) fn fitting_a(&self, lambda_n_per_m: f64) -> Vec<f64> {
        let (index, step) = self.locate(lambda_n_per_m);
        let piece = &self.pieces[index];
        let currents = piece.currents.iter().zip(&piece.rates);
        self.within(currents.map(|(current, rate)| current + step * rate))
    }

    fn within(&self, currents: impl Iterator<Item = f64>) -> Vec<f64> {
        let limits = self.limits.lower_a.iter().zip(&self.limits.upper_a);
        let limited = currents.zip(limits);
        limited
            .map(|(current, (lower, upper))| current.clamp(*lower, *upper) + 0.0)
            .collect()
    }

    /// `e* = A lambda^2 + B lambda + C` on every piece: its start, N/m, and A, B, C.
    #[must_use]
    pub fn quadratics(&self) -> Vec<(f64, [f64; 3])> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        self.turns
            .iter()
            .map(|&k| {
                let piece = &self.pieces[k];
                let a = dot(&piece.residual_rate, &piece.residual_rate);
                let b = 2.0 * dot(&piece.residual, &piece.residual_rate);
                let c = dot(&piece.residual, &piece.residual);
                (
                    piece.start,
                    [
                        a,
                        b - 2.0 * a * piece.start,
                        c + piece.start * (a * piece.start - b),
                    ],
                )
            })
            .collect()
    }

    /// All force constants at which the path turns, from 0 on, with currents and events.
    #[must_use]
    pub fn breakpoints(&self) -> Vec<Breakpoint> {
        let mut before = self.limits.at_zero();
        let mut all = Vec::with_capacity(self.turns.len());
        for (k, &turn) in self.turns.iter().enumerate() {
            let start = self.pieces[turn].start;
            let end = self.turns.get(k + 1).map(|&next| self.pieces[next].start);
            let after = self.standing(turn, end);
            let mut events = Vec::new();
            for i in 0..after.len() {
                self.limits.changes(i, before[i], after[i], &mut events);
            }
            if k == 0 {
                self.first_moves(&after, end, &mut events);
            }
            all.push(Breakpoint {
                lambda_n_per_m: start,
                currents_a: self.currents_a(start),
                events,
            });
            before = after;
        }
        all
    }

    /// The smallest force constant beyond which the currents no longer change; `None` where the path
    /// never turns.
    pub(super) fn last_turn(&self) -> Option<f64> {
        let last = self.turns.last().map(|&k| self.pieces[k].start);
        last.filter(|&lambda| lambda > 0.0)
    }

    /// Pieces at which something visible changes: ties within rounding count once, and where
    /// currents are ambiguous only a change of the fit counts. None count where there may be no error.
    fn turns(&self) -> Vec<usize> {
        let mut turns: Vec<usize> = Vec::new();
        for (k, piece) in self.pieces.iter().enumerate() {
            if turns
                .last()
                .is_some_and(|&last| piece.start - self.pieces[last].start <= TIE * piece.start)
            {
                turns.pop();
            }
            if turns.last().is_none_or(|&last| {
                self.differ(&self.pieces[last], piece) && !self.is_doubtful(piece)
            }) {
                turns.push(k);
            }
        }
        turns
    }

    fn is_doubtful(&self, piece: &SiPiece) -> bool {
        let square = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
        self.doubt_m2 > 0.0
            && square(&piece.residual_rate) <= self.doubt_m2
            && square(&piece.residual) <= self.doubt_m2 * piece.start.powi(2)
    }

    fn differ(&self, before: &SiPiece, after: &SiPiece) -> bool {
        let pairs = || before.residual_rate.iter().zip(&after.residual_rate);
        let scale: f64 = pairs().map(|(b, _)| b.abs()).sum();
        let fit = pairs().any(|(b, a)| (a - b).abs() > TIE * scale);
        fit || (self.ambiguous.is_none() && before.standing != after.standing)
    }

    /// Standing on the piece `turn`, which lasts until `end`.
    fn standing(&self, turn: usize, end: Option<f64>) -> Vec<Standing> {
        if self.ambiguous.is_none() {
            return self.pieces[turn].standing.clone();
        }
        let start = self.pieces[turn].start;
        let currents = self.currents_a(end.map_or(2.0 * start + 1.0, |end| 0.5 * (start + end)));
        self.limits.standing(&currents)
    }

    /// Coils that may go both ways leave zero without leaving a limit.
    fn first_moves(&self, after: &[Standing], end: Option<f64>, events: &mut Vec<Event>) {
        let currents = self.currents_a(end.map_or(1.0, |end| 0.5 * end));
        for (i, current) in currents.iter().enumerate() {
            let both_ways = self.limits.lower_a[i] < 0.0 && self.limits.upper_a[i] > 0.0;
            if both_ways && after[i] == Standing::Between && *current != 0.0 {
                events.push(Event::LeavesZero(i));
            }
        }
    }
}

impl Limits {
    /// Standing of every coil, and of the sum if it is limited, without currents.
    pub(crate) fn at_zero(&self) -> Vec<Standing> {
        let of_coil = |i: usize| match (self.lower_a[i] < 0.0, self.upper_a[i] > 0.0) {
            (true, true) => Standing::Between,
            (true, false) => Standing::Upper,
            _ => Standing::Lower,
        };
        let mut standing: Vec<Standing> = (0..self.upper_a.len()).map(of_coil).collect();
        standing.extend(self.total_max_a.map(|_| Standing::Between));
        standing
    }

    /// The same at given currents.
    pub fn standing(&self, currents: &[f64]) -> Vec<Standing> {
        let near = |a: f64, b: f64, range: f64| (a - b).abs() <= 1e-13 * range;
        let mut standing: Vec<Standing> = (0..currents.len())
            .map(|i| {
                let range = self.upper_a[i] - self.lower_a[i];
                if near(currents[i], self.lower_a[i], range) {
                    Standing::Lower
                } else if near(currents[i], self.upper_a[i], range) {
                    Standing::Upper
                } else {
                    Standing::Between
                }
            })
            .collect();
        standing.extend(self.total_max_a.map(|total| {
            let sum: f64 = currents.iter().sum();
            if near(sum, total, total) {
                Standing::Lower
            } else {
                Standing::Between
            }
        }));
        standing
    }

    /// Change that brings entry `i` from one state to the other.
    pub fn changes(&self, i: usize, before: Standing, after: Standing, events: &mut Vec<Event>) {
        if before == after {
            return;
        }
        if i == self.upper_a.len() {
            let met = after == Standing::Lower;
            events.push(if met {
                Event::TotalMeetsLimit
            } else {
                Event::TotalLeavesLimit
            });
            return;
        }
        let zero_below = self.lower_a[i] == 0.0;
        let zero_above = self.upper_a[i] == 0.0;
        match before {
            Standing::Lower if zero_below => events.push(Event::LeavesZero(i)),
            Standing::Upper if zero_above => events.push(Event::LeavesZero(i)),
            Standing::Lower => events.push(Event::LeavesLower(i)),
            Standing::Upper => events.push(Event::LeavesUpper(i)),
            Standing::Between => {}
        }
        match after {
            Standing::Lower if zero_below => events.push(Event::ReturnsToZero(i)),
            Standing::Upper if zero_above => events.push(Event::ReturnsToZero(i)),
            Standing::Lower => events.push(Event::MeetsLower(i)),
            Standing::Upper => events.push(Event::MeetsUpper(i)),
            Standing::Between => {}
        }
    }
}

/// A free variable that rests on a bound is at that bound, although its multiplier is zero.
fn standing_of(place: VariableState, x: Num, rate: Num, lower: Num, upper: Num) -> Standing {
    let rests_on =
        |bound: Num| rate == Num::ZERO && (x - bound).abs() <= Num::of(1e-14) * (upper - lower);
    match place {
        VariableState::Low | VariableState::Pinned => Standing::Lower,
        VariableState::High => Standing::Upper,
        VariableState::Free | VariableState::Held if rests_on(lower) => Standing::Lower,
        VariableState::Free | VariableState::Held if rests_on(upper) => Standing::Upper,
        VariableState::Free | VariableState::Held => Standing::Between,
    }
}
