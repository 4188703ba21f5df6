//! The path of a bounded least-squares minimiser as its target moves along a line.
//!
//! For the target `c0 + lambda c1` the minimiser of `|c0 + lambda c1 - A x|` over
//! `lower <= x <= upper`, `sum w_i x_i = total` is piecewise linear in lambda. Every
//! piece is solved again from its active set, so that errors do not build up; at every
//! breakpoint the next direction is itself a small minimisation over all constraints
//! that are about to change, so that ties need no special case.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::basis::{Basis, QrBasis, Target};
use super::cone::{self, Role};
use super::model::Model;
use super::tableau::{self, Products, Tableau};

/// Relative distance from a bound or a zero multiplier that counts as none.
const GRAIN: f64 = 1e-27;
/// Largest flaw of a path by pivots: with more they have lost digits, and the path is followed by
/// factorisations.
const DRIFT: f64 = 1e-16;

/// Bounds of the variables; `None`: unbounded on that side.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    pub lower: Vec<Option<Num>>,
    pub upper: Vec<Option<Num>>,
    /// Right-hand side of the model's equality.
    pub total: Num,
}

/// The state of a variable on a piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum VariableState {
    /// Both bounds are equal.
    Pinned,
    /// At its lower bound.
    Low,
    /// At its upper bound.
    High,
    /// Between the bounds, moving.
    Free,
    /// Between the bounds, its column dependent on those of others: standing still, or moving where the path
    /// goes straight.
    Held,
}

/// One linear piece; values at its start and rates per unit of lambda.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub start: Num,
    pub place: Vec<VariableState>,
    pub x: Vec<Num>,
    pub x_rate: Vec<Num>,
    /// Target minus fit.
    pub residual: Vec<Num>,
    pub residual_rate: Vec<Num>,
    /// Reduced gradients.
    pub gradient: Vec<Num>,
    gradient_rate: Vec<Num>,
    /// Natural size of a gradient per unit of residual.
    pub gradient_scale: Vec<Num>,
    /// Relative size of rounding on this piece.
    pub noise: f64,
    /// The same of its rates.
    pub blur: f64,
}

/// The pieces in order, the last one without end.
#[derive(Debug, Clone)]
pub(super) struct Trace {
    pub pieces: Vec<Piece>,
    /// False when the iteration limit was met: the last piece is not the minimiser.
    pub complete: bool,
    /// Largest relative violation of the optimality conditions at the pieces' starts, and of
    /// the residual's continuity: its square is the error that it leaves in e*.
    pub flaw: f64,
    /// Pivots made, where the basis was a tableau.
    pub pivots: Option<usize>,
}

/// Values at one lambda, with the rates by which they were reached.
struct State {
    lambda: Num,
    place: Vec<VariableState>,
    x: Vec<Num>,
    x_rate: Vec<Num>,
    gradient: Vec<Num>,
    gradient_rate: Vec<Num>,
    gradient_scale: Vec<Num>,
}

fn norm(v: &[Num]) -> Num {
    Num::dot(v, v).sqrt()
}

impl Piece {
    /// Values of the variables at `lambda`.
    pub(crate) fn x_at(&self, lambda: Num) -> Vec<Num> {
        advance(&self.x, &self.x_rate, lambda - self.start)
    }

    /// Residual at `lambda`.
    pub(crate) fn residual_at(&self, lambda: Num) -> Vec<Num> {
        advance(&self.residual, &self.residual_rate, lambda - self.start)
    }

    /// Reduced gradients at `lambda`.
    pub(crate) fn gradient_at(&self, lambda: Num) -> Vec<Num> {
        advance(&self.gradient, &self.gradient_rate, lambda - self.start)
    }
}

fn advance(value: &[Num], rate: &[Num], by: Num) -> Vec<Num> {
    value.iter().zip(rate).map(|(&v, &r)| v + by * r).collect()
}

/// Variables, a slack's last, that give the target at this lambda exactly, within the bounds.
#[derive(Debug, Clone)]
pub(super) struct ExactStart {
    pub lambda: Num,
    pub x: Vec<Num>,
}

/// A problem whose path is followed.
pub(super) struct Follower<'a> {
    pub model: &'a Model,
    pub bounds: &'a Bounds,
    /// Condition number of the columns where it is known.
    pub condition: Option<f64>,
    /// Where the path goes straight, without an offset.
    pub start: Option<ExactStart>,
}

impl Follower<'_> {
    /// The path from the zero target at `lambda = 0`, where `x = 0` (the slack takes what
    /// the equality leaves), along `offset` first and then along `slope`.
    pub fn path(&self, offset: Option<&[Num]>, slope: &[Num]) -> Trace {
        let condition = self.condition.filter(|&c| c <= tableau::MOST_CONDITION);
        if let Some(condition) = condition {
            let products = Products::new(self.model);
            let basis = |target| Tableau::new(self.model, target, &products, condition);
            let (mut trace, last) = self.path_on(basis, offset, slope);
            trace.pivots = Some(last.pivots);
            if trace.complete && trace.flaw <= DRIFT {
                return trace;
            }
        }
        let basis = |target| QrBasis::new(self.model, target);
        self.path_on(basis, offset, slope).0
    }

    fn path_on<B: Basis>(
        &self,
        basis: impl Fn(Target) -> B,
        offset: Option<&[Num]>,
        slope: &[Num],
    ) -> (Trace, B) {
        let count = self.model.count();
        let mut x = vec![Num::ZERO; count];
        if self.model.weight.is_some() {
            x[count - 1] = self.bounds.total;
        }
        let mut state = State {
            lambda: Num::ZERO,
            place: (0..count).map(|i| self.place_of(i, x[i])).collect(),
            x,
            x_rate: vec![Num::ZERO; count],
            gradient: vec![Num::ZERO; count],
            gradient_rate: vec![Num::ZERO; count],
            gradient_scale: self.model.norm.clone(),
        };
        let mut target = Target::along(slope);
        let mut arrived = true;
        if let Some(offset) = offset {
            let approach = self.follow(state, &mut basis(Target::along(offset)), Some(Num::ONE));
            arrived = approach.complete;
            let last = &approach.pieces[approach.pieces.len() - 1];
            state = State {
                lambda: Num::ZERO,
                place: last.place.clone(),
                x: last.x_at(Num::ONE),
                x_rate: vec![Num::ZERO; count],
                gradient: last.gradient_at(Num::ONE),
                gradient_rate: vec![Num::ZERO; count],
                gradient_scale: last.gradient_scale.clone(),
            };
            target.constant = offset.to_vec();
        }
        let mut basis = basis(target);
        let straight = self.start.as_ref().map(|start| {
            let piece = self.straight(&state, start, &basis);
            state = self.reached(&piece, start);
            piece
        });
        let mut trace = self.follow(state, &mut basis, None);
        trace.pieces.splice(0..0, straight);
        trace.complete &= arrived;
        trace.flaw = self.flaw(&trace.pieces, offset, slope);
        (trace, basis)
    }

    /// The piece from `state`, where nothing flows, to `start`.
    fn straight(&self, state: &State, start: &ExactStart, basis: &impl Basis) -> Piece {
        let rate = |(&to, &from): (&Num, &Num)| (to - from) / start.lambda;
        let x_rate: Vec<Num> = start.x.iter().zip(&state.x).map(rate).collect();
        let place = |i: usize| match state.place[i] {
            VariableState::Free => VariableState::Held,
            _ if x_rate[i] != Num::ZERO => VariableState::Held,
            place => place,
        };
        Piece {
            place: (0..x_rate.len()).map(place).collect(),
            residual: vec![Num::ZERO; self.model.rows],
            residual_rate: vec![Num::ZERO; self.model.rows],
            x_rate,
            ..self.standstill(state, basis.target())
        }
    }

    /// Where that piece ends.
    fn reached(&self, piece: &Piece, start: &ExactStart) -> State {
        let count = self.model.count();
        State {
            lambda: start.lambda,
            place: (0..count).map(|i| self.place_of(i, start.x[i])).collect(),
            x: start.x.clone(),
            x_rate: piece.x_rate.clone(),
            gradient: vec![Num::ZERO; count],
            gradient_rate: vec![Num::ZERO; count],
            gradient_scale: piece.gradient_scale.clone(),
        }
    }

    /// Where a variable of a value within its bounds is.
    fn place_of(&self, i: usize, value: Num) -> VariableState {
        match (self.bounds.lower[i], self.bounds.upper[i]) {
            (Some(lower), Some(upper)) if upper <= lower => VariableState::Pinned,
            (Some(lower), _) if value <= lower => VariableState::Low,
            (_, Some(upper)) if value >= upper => VariableState::High,
            _ => VariableState::Free,
        }
    }

    fn follow(&self, mut state: State, basis: &mut impl Basis, end: Option<Num>) -> Trace {
        let mut pieces: Vec<Piece> = Vec::new();
        let limit = 200 * (self.model.count() + 2);
        for _ in 0..limit {
            fluxform_base::progress::poll();
            let Some((piece, event)) = self.leave(&state, basis) else {
                break;
            };
            let lambda = event.map(|step| piece.start + step);
            pieces.push(piece);
            let piece = &pieces[pieces.len() - 1];
            match lambda {
                Some(lambda) if end.is_none_or(|end| lambda < end) => {
                    state = State {
                        lambda,
                        place: piece.place.clone(),
                        x: piece.x_at(lambda),
                        x_rate: piece.x_rate.clone(),
                        gradient: piece.gradient_at(lambda),
                        gradient_rate: piece.gradient_rate.clone(),
                        gradient_scale: piece.gradient_scale.clone(),
                    };
                }
                _ => {
                    return Trace {
                        pieces,
                        complete: true,
                        flaw: 0.0,
                        pivots: None,
                    };
                }
            }
        }
        if pieces.is_empty() {
            pieces.push(self.standstill(&state, basis.target()));
        }
        Trace {
            pieces,
            complete: false,
            flaw: 0.0,
            pivots: None,
        }
    }

    /// The piece that begins at `state` and the step to its end, `None` for no end. An event
    /// that would end it at once makes its constraint one more that may change here.
    fn leave(&self, state: &State, basis: &mut impl Basis) -> Option<(Piece, Option<Num>)> {
        let mut roles = self.roles(state, basis);
        let tie = Num::of(self.tie(basis)) * state.lambda;
        let arrives = |i: usize| roles[i] != Role::Fixed && self.arrives(state, i, basis);
        let mut likely: Vec<bool> = (0..roles.len()).map(arrives).collect();
        for _ in 0..=2 * self.model.count() {
            fluxform_base::progress::poll();
            let direction = cone::solve(basis, &roles, &likely);
            if !direction.converged {
                return None;
            }
            let piece = self.piece(state, &roles, &direction, basis);
            let Some((i, step, role)) = self.next_event(&piece, &roles, &direction, basis) else {
                return Some((piece, None));
            };
            if step > tie || roles[i] == role {
                return Some((piece, Some(step)));
            }
            roles[i] = role;
            likely.fill(false);
            basis.members().iter().for_each(|&i| likely[i] = true);
        }
        None
    }

    /// Whether a variable at a bound is expected to leave it: its multiplier goes to zero by more than rounding, or
    /// nothing is known of it yet. Nearly dependent columns leave many multipliers within rounding of zero.
    fn arrives(&self, state: &State, i: usize, basis: &impl Basis) -> bool {
        let approach = match state.place[i] {
            VariableState::Low => state.gradient_rate[i],
            VariableState::High => -state.gradient_rate[i],
            VariableState::Pinned | VariableState::Free | VariableState::Held => return false,
        };
        let rounding = Num::of(basis.noise()) * norm(&basis.target().slope);
        state.lambda == Num::ZERO || approach > rounding * state.gradient_scale[i]
    }

    /// Relative distance in lambda below which two events are one: about the error of the columns or
    /// of the arithmetic.
    fn tie(&self, basis: &impl Basis) -> f64 {
        (100.0 * self.model.epsilon).max(basis.resolution())
    }

    /// Which variables may move where: those at a bound whose multiplier is zero, or will
    /// be at once, become one-sided, and so do those that meet a bound.
    fn roles(&self, state: &State, basis: &impl Basis) -> Vec<Role> {
        let target = basis.target();
        let size = norm(&target.constant) + state.lambda.abs() * norm(&target.slope);
        let grain = Num::of(basis.resolution().max(GRAIN));
        let soon = Num::of(self.tie(basis)) * state.lambda;
        let slack = self.model.weight.as_ref().map(|_| self.model.count() - 1);
        (0..self.model.count())
            .map(|i| match state.place[i] {
                VariableState::Pinned => Role::Fixed,
                VariableState::Low | VariableState::High => {
                    let (role, sign) = match state.place[i] {
                        VariableState::Low => (Role::Rising, Num::ONE),
                        _ => (Role::Falling, -Num::ONE),
                    };
                    let distance = -(sign * state.gradient[i]);
                    let approach = (sign * state.gradient_rate[i]).larger(Num::ZERO);
                    let near = (grain * size * state.gradient_scale[i]).larger(soon * approach);
                    if distance <= near { role } else { Role::Fixed }
                }
                VariableState::Free | VariableState::Held => {
                    let down = self.bounds.lower[i].map(|l| state.x[i] - l);
                    let up = self.bounds.upper[i].map(|u| u - state.x[i]);
                    let both = up.zip(down).map(|(up, down)| size.smaller(up + down));
                    let range = both.unwrap_or(size);
                    let range = if Some(i) == slack {
                        self.bounds.total
                    } else {
                        range
                    };
                    let near = |rate: Num| (grain * range).larger(soon * rate.larger(Num::ZERO));
                    let nearer = |up: Num| down.is_none_or(|down| up < down);
                    if up.is_some_and(|up| up <= near(state.x_rate[i]) && nearer(up)) {
                        Role::Falling
                    } else if down.is_some_and(|down| down <= near(-state.x_rate[i])) {
                        Role::Rising
                    } else if state.place[i] == VariableState::Free {
                        Role::Free
                    } else {
                        Role::Held
                    }
                }
            })
            .collect()
    }

    /// Solves the piece from its active set.
    fn piece(
        &self,
        state: &State,
        roles: &[Role],
        direction: &cone::Direction,
        basis: &impl Basis,
    ) -> Piece {
        let mut moves = vec![false; roles.len()];
        for &i in basis.members().iter().chain(&basis.pivot()) {
            moves[i] = true;
        }
        let place: Vec<VariableState> = (0..roles.len())
            .map(|i| match roles[i] {
                Role::Fixed => state.place[i],
                _ if moves[i] => VariableState::Free,
                Role::Free | Role::Held => VariableState::Held,
                Role::Rising => VariableState::Low,
                Role::Falling => VariableState::High,
            })
            .collect();
        let still = |i: usize| match place[i] {
            VariableState::Pinned => Num::ZERO,
            VariableState::Low => self.bounds.lower[i].unwrap_or(state.x[i]),
            VariableState::High => self.bounds.upper[i].unwrap_or(state.x[i]),
            VariableState::Free | VariableState::Held => state.x[i],
        };
        let mut x_rate = direction.rate.clone();
        let mut fixed = Vec::with_capacity(roles.len());
        for i in (0..roles.len()).filter(|&i| place[i] != VariableState::Free) {
            x_rate[i] = Num::ZERO;
            fixed.push((i, still(i)));
        }
        let residual_rate = basis.residual_rate(&x_rate);
        let rates = (&x_rate[..], &residual_rate[..]);
        let mut values = basis.values(state.lambda, self.bounds.total, &fixed, rates);
        for &(i, x) in &fixed {
            values.x[i] = x;
        }
        let slope = norm(&basis.target().slope);
        let share = if slope > Num::ZERO {
            (norm(&residual_rate) / slope).to_f64()
        } else {
            0.0
        };
        Piece {
            start: state.lambda,
            gradient: values.gradient,
            gradient_rate: direction.gradient.clone(),
            gradient_scale: basis.gradient_scales(),
            noise: basis.noise(),
            blur: basis.blur(share),
            place,
            x: values.x,
            x_rate,
            residual: values.residual,
            residual_rate,
        }
    }

    /// The first constraint to change on `piece`: its variable, the step in lambda, and the
    /// role that it takes there.
    fn next_event(
        &self,
        piece: &Piece,
        roles: &[Role],
        direction: &cone::Direction,
        basis: &impl Basis,
    ) -> Option<(usize, Num, Role)> {
        let slope = norm(&basis.target().slope);
        let mut first: Option<(usize, Num, Role)> = None;
        let mut offer = |i: usize, distance: Num, rate: Num, role: Role| {
            let step = distance.larger(Num::ZERO) / rate;
            if first.is_none_or(|(_, least, _)| step < least) {
                first = Some((i, step, role));
            }
        };
        for (i, &role) in roles.iter().enumerate() {
            match piece.place[i] {
                VariableState::Free => {
                    let rate = piece.x_rate[i];
                    let rates = &piece.x_rate;
                    let still = basis.rate_noise(i, rates, slope, piece.blur);
                    if rate.abs() <= still {
                        continue;
                    }
                    match (self.bounds.lower[i], self.bounds.upper[i]) {
                        (Some(lower), _) if rate < Num::ZERO => {
                            offer(i, piece.x[i] - lower, -rate, Role::Rising);
                        }
                        (_, Some(upper)) if rate > Num::ZERO => {
                            offer(i, upper - piece.x[i], rate, Role::Falling);
                        }
                        _ => {}
                    }
                }
                VariableState::Low | VariableState::High
                    if role == Role::Fixed || !direction.blocked[i] =>
                {
                    let (sign, role) = match piece.place[i] {
                        VariableState::Low => (Num::ONE, Role::Rising),
                        _ => (-Num::ONE, Role::Falling),
                    };
                    let rate = sign * piece.gradient_rate[i];
                    if rate > Num::of(piece.noise) * slope * piece.gradient_scale[i] {
                        offer(i, -(sign * piece.gradient[i]), rate, role);
                    }
                }
                _ => {}
            }
        }
        first
    }

    /// As [`Trace::flaw`] says.
    fn flaw(&self, pieces: &[Piece], offset: Option<&[Num]>, slope: &[Num]) -> f64 {
        let mut worst = Num::ZERO;
        for (k, piece) in pieces.iter().enumerate() {
            let size = offset.map_or(Num::ZERO, norm) + piece.start * norm(slope);
            if size <= Num::ZERO {
                continue;
            }
            let mut see = |violation: Num| worst = worst.larger(violation / size);
            for i in 0..self.model.count() {
                let x = piece.x[i] * self.model.norm[i];
                if let Some(lower) = self.bounds.lower[i] {
                    see(lower * self.model.norm[i] - x);
                }
                if let Some(upper) = self.bounds.upper[i] {
                    see(x - upper * self.model.norm[i]);
                }
                let scale = piece.gradient_scale[i];
                match piece.place[i] {
                    VariableState::Low if scale > Num::ZERO => see(piece.gradient[i] / scale),
                    VariableState::High if scale > Num::ZERO => see(-(piece.gradient[i] / scale)),
                    VariableState::Free if scale > Num::ZERO => {
                        see((piece.gradient[i] / scale).abs());
                    }
                    _ => {}
                }
            }
            if k > 0 {
                let reached = pieces[k - 1].residual_at(piece.start);
                let jump: Vec<Num> = reached
                    .iter()
                    .zip(&piece.residual)
                    .map(|(&a, &b)| a - b)
                    .collect();
                see(norm(&jump));
            }
        }
        worst.to_f64()
    }

    /// A piece that stays where `state` is.
    fn standstill(&self, state: &State, target: &Target) -> Piece {
        let values = state.x.iter().copied().enumerate();
        let (rest, _) = self
            .model
            .remainder(&target.constant, self.bounds.total, values);
        Piece {
            start: state.lambda,
            place: state.place.clone(),
            x: state.x.clone(),
            x_rate: vec![Num::ZERO; state.x.len()],
            residual: advance(&rest, &target.slope, state.lambda),
            residual_rate: target.slope.clone(),
            gradient: state.gradient.clone(),
            gradient_rate: vec![Num::ZERO; state.x.len()],
            gradient_scale: state.gradient_scale.clone(),
            noise: self.model.epsilon,
            blur: self.model.epsilon,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns come sooner for a larger target; nothing else is different, rounding included.
    #[test]
    fn a_paths_rounding_does_not_depend_on_the_targets_size() {
        let numbers = |values: &[f64]| values.iter().map(|&v| Num::of(v)).collect::<Vec<_>>();
        let model = Model::new(
            3,
            numbers(&[1.3, 0.2, -0.4, 0.7, 1.1, 0.3]),
            None,
            Num::EPSILON,
        );
        let bounds = Bounds {
            lower: numbers(&[-0.3, 0.0]).into_iter().map(Some).collect(),
            upper: numbers(&[1.7, 0.9]).into_iter().map(Some).collect(),
            total: Num::ZERO,
        };
        let follower = Follower {
            model: &model,
            bounds: &bounds,
            condition: None,
            start: None,
        };
        let path = |size: f64| follower.path(None, &numbers(&[0.7 * size, 1.9 * size, 1.6 * size]));
        let one = path(1.0);
        assert!(one.complete && one.pieces.len() > 1);
        for size in [2.0f64.powi(-30), 2.0f64.powi(30)] {
            let other = path(size);
            assert_eq!(other.pieces.len(), one.pieces.len());
            for (a, b) in one.pieces.iter().zip(&other.pieces) {
                assert_eq!((a.noise, a.blur), (b.noise, b.blur));
                assert_eq!(a.start, b.start * Num::of(size));
                assert_eq!((&a.place, &a.x), (&b.place, &b.x));
            }
        }
    }
}
