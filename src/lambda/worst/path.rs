//! The worst-point path in SI units: the least largest error and its currents at any lambda.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::constraint_generation::Followed;
use super::program::Piece;
use super::scaled::Scaled;
use crate::path::{Event, Limits, Standing};
use crate::problem::ForceProblem;
use crate::qr_reduction::times_power;
use fluxform_numerics::real::Real;

/// Slopes of t* that differ by less, relative to max h, are one.
const SAME_SLOPE: f64 = 1e-13;
/// Multipliers below this share are rounding.
const NO_MULTIPLIER: f64 = 1e-14;

/// A force constant at which t* turns.
#[derive(Debug, Clone, PartialEq)]
pub struct Turn {
    /// Force constant, N/m.
    pub lambda_n_per_m: f64,
    /// t*: the largest error at any point, N.
    pub worst_error_n: f64,
    /// Currents, A; between turns they are linear in lambda.
    pub currents_a: Vec<f64>,
    /// The points that decide from here to the next turn.
    pub active: Vec<ActivePoint>,
    /// Change in the currents.
    pub events: Vec<Event>,
}

/// A point that decides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ActivePoint {
    /// Its row in `points.csv`, from 0.
    pub point: usize,
    /// Positive where the force is too weak, negative where it is too strong; absolute values
    /// sum to 1.
    pub multiplier: f64,
}

/// t* and currents as functions of the force constant.
#[derive(Debug, Clone)]
pub struct WorstPath {
    turns: Vec<Turn>,
    /// Slopes of t* and of the currents beyond the last turn.
    last_slope_m: f64,
    last_rates: Vec<f64>,
}

impl WorstPath {
    pub(super) fn new(problem: &ForceProblem, scaled: &Scaled, followed: &Followed) -> Self {
        let unit = |piece: &Piece| times_power(piece.start.to_f64(), scaled.lambda_unit());
        let error = |z: f64| times_power(z, scaled.force_unit());
        let top = scaled.top().to_f64();
        let mut turns: Vec<Turn> = Vec::new();
        let mut slope = f64::NEG_INFINITY;
        let (mut last_slope_m, mut last_rates) = (0.0, vec![0.0; problem.coils()]);
        for (k, piece) in followed.pieces.iter().enumerate() {
            let last = piece.z.len() - 1;
            let rate = piece.rate[last].to_f64();
            // The last piece's currents hold without end, so it always counts.
            let ends = k + 1 == followed.pieces.len();
            if !turns.is_empty() && !ends && rate - slope <= SAME_SLOPE * top {
                continue;
            }
            let turn = Turn {
                lambda_n_per_m: unit(piece),
                worst_error_n: error(piece.z[last].to_f64().max(0.0)),
                currents_a: scaled.currents_a(&piece.z),
                active: active(&followed.rows, piece),
                events: Vec::new(),
            };
            let close = |last: &Turn| {
                turn.lambda_n_per_m - last.lambda_n_per_m <= SAME_SLOPE * turn.lambda_n_per_m
            };
            if turns.len() > 1 && turns.last().is_some_and(close) {
                turns.pop();
            }
            turns.push(turn);
            slope = rate;
            last_slope_m = times_power(rate, scaled.force_unit() - scaled.lambda_unit());
            last_rates = scaled
                .amperes(&piece.rate)
                .iter()
                .map(|&r| times_power(r, -scaled.lambda_unit()))
                .collect();
        }
        if turns.is_empty() {
            // Nothing could be followed: without currents errors are no larger than this.
            last_slope_m = scaled.height_m();
            turns.push(Turn {
                lambda_n_per_m: 0.0,
                worst_error_n: scaled.offset_n(),
                currents_a: vec![0.0; problem.coils()],
                active: Vec::new(),
                events: Vec::new(),
            });
        }
        let mut path = Self {
            turns,
            last_slope_m,
            last_rates,
        };
        path.name_events(problem);
        path
    }

    /// The turns of t*, lambda ascending, the first at 0.
    #[must_use]
    pub fn turns(&self) -> &[Turn] {
        &self.turns
    }

    /// The turn that begins the piece of `lambda`, and the next one.
    fn locate(&self, lambda: f64) -> (&Turn, Option<&Turn>) {
        let after = self
            .turns
            .partition_point(|turn| turn.lambda_n_per_m <= lambda)
            .max(1);
        (&self.turns[after - 1], self.turns.get(after))
    }

    /// t*(lambda), N.
    #[must_use]
    pub fn worst_error_n(&self, lambda_n_per_m: f64) -> f64 {
        let (turn, next) = self.locate(lambda_n_per_m);
        let step = lambda_n_per_m - turn.lambda_n_per_m;
        match next {
            Some(next) => {
                let share = step / (next.lambda_n_per_m - turn.lambda_n_per_m);
                turn.worst_error_n + share * (next.worst_error_n - turn.worst_error_n)
            }
            None => turn.worst_error_n + step * self.last_slope_m,
        }
    }

    /// Currents at `lambda`, A: those of the turns on either side, mixed.
    #[must_use]
    pub fn currents_a(&self, lambda_n_per_m: f64) -> Vec<f64> {
        let (turn, next) = self.locate(lambda_n_per_m);
        let step = lambda_n_per_m - turn.lambda_n_per_m;
        match next {
            Some(next) => {
                let share = step / (next.lambda_n_per_m - turn.lambda_n_per_m);
                let pairs = turn.currents_a.iter().zip(&next.currents_a);
                pairs.map(|(a, b)| (1.0 - share) * a + share * b).collect()
            }
            None => {
                let pairs = turn.currents_a.iter().zip(&self.last_rates);
                pairs.map(|(a, rate)| a + step * rate).collect()
            }
        }
    }

    /// The points that decide at `lambda`.
    #[must_use]
    pub fn active(&self, lambda_n_per_m: f64) -> &[ActivePoint] {
        &self.locate(lambda_n_per_m).0.active
    }

    fn name_events(&mut self, problem: &ForceProblem) {
        let limits = Limits {
            lower_a: problem.lower_a.to_vec(),
            upper_a: problem.upper_a.to_vec(),
            total_max_a: problem.total_max_a,
        };
        let mut before: Vec<Standing> = limits.at_zero();
        for k in 0..self.turns.len() {
            let here = limits.standing(&self.turns[k].currents_a);
            let next = self
                .turns
                .get(k + 1)
                .map(|next| limits.standing(&next.currents_a));
            // At rest on a piece is what rests at both of its ends.
            let after: Vec<Standing> = match next {
                Some(next) => here
                    .into_iter()
                    .zip(next)
                    .map(|(a, b)| if a == b { a } else { Standing::Between })
                    .collect(),
                None => here,
            };
            let mut events = Vec::new();
            for (i, &standing) in after.iter().enumerate() {
                limits.changes(i, before[i], standing, &mut events);
            }
            self.turns[k].events = events;
            before = after;
        }
    }
}

pub(super) fn active(rows: &[Option<(usize, bool)>], piece: &Piece) -> Vec<ActivePoint> {
    let mut all: Vec<ActivePoint> = piece
        .active
        .iter()
        .filter_map(|&(row, multiplier)| {
            let (point, up) = rows[row]?;
            let size = multiplier.to_f64();
            (size > NO_MULTIPLIER).then_some(ActivePoint {
                point,
                multiplier: if up { size } else { -size },
            })
        })
        .collect();
    all.sort_by_key(|active| active.point);
    all
}
