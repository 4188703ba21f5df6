//! The path of a bounded least-squares minimiser as its target moves along a line.
//!
//! For the target `c0 + lambda c1` the minimiser of `|c0 + lambda c1 - A x|` over
//! `lower <= x <= upper`, `sum w_i x_i = total` is piecewise linear in lambda. Every
//! piece is solved again from its active set, so that errors do not build up; at every
//! breakpoint the next direction is itself a small minimisation over all constraints
//! that are about to change, so that ties need no special case.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::basis::{Basis, Target};
use super::cone::{self, Role};
use super::model::Model;

/// Relative distance from a bound or a zero multiplier that counts as none.
const GRAIN: f64 = 1e-27;

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
    /// Columns that came into the basis or went.
    pub changes: usize,
}

impl Trace {
    fn of(pieces: Vec<Piece>, complete: bool) -> Self {
        Self {
            pieces,
            complete,
            flaw: 0.0,
            changes: 0,
        }
    }
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
    /// Where the path goes straight, without an offset.
    pub start: Option<ExactStart>,
    /// Square of the residual over `lambda^2`, beyond which the path is not needed: it comes to rest at the next
    /// breakpoint. Without an offset this share never falls.
    pub most_error: Option<Num>,
    /// Changes of the basis after which the path is given up.
    pub most_changes: Option<usize>,
}

impl Follower<'_> {
    /// The path from the zero target at `lambda = 0`, where `x = 0` (the slack takes what
    /// the equality leaves), along `offset` first and then along `slope`.
    pub fn path(&self, offset: Option<&[Num]>, slope: &[Num]) -> Trace {
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
            let mut basis = Basis::new(self.model, Target::along(offset));
            let approach = self.follow(state, &mut basis, Some(Num::ONE));
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
        let mut basis = Basis::new(self.model, target);
        let straight = self.start.as_ref().map(|start| {
            let piece = self.straight(&state, start, &basis);
            state = self.reached(&piece, start);
            piece
        });
        let mut trace = self.follow(state, &mut basis, None);
        trace.pieces.splice(0..0, straight);
        trace.complete &= arrived;
        trace.flaw = self.flaw(&trace.pieces, offset, slope);
        trace.changes = basis.changes;
        trace
    }

    /// The piece from `state`, where nothing flows, to `start`.
    fn straight(&self, state: &State, start: &ExactStart, basis: &Basis) -> Piece {
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

    fn follow(&self, mut state: State, basis: &mut Basis, end: Option<Num>) -> Trace {
        let mut pieces: Vec<Piece> = Vec::new();
        let limit = 200 * (self.model.count() + 2);
        for _ in 0..limit {
            fluxform_base::progress::poll();
            if self.most_changes.is_some_and(|most| basis.changes > most) {
                break;
            }
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
                    if self.is_far(piece, lambda) {
                        pieces.push(self.standstill(&state, basis.target()));
                        return Trace::of(pieces, true);
                    }
                }
                _ => return Trace::of(pieces, true),
            }
        }
        if pieces.is_empty() {
            pieces.push(self.standstill(&state, basis.target()));
        }
        Trace::of(pieces, false)
    }

    /// Whether the path is not needed beyond `lambda`, the end of `piece`.
    fn is_far(&self, piece: &Piece, lambda: Num) -> bool {
        self.most_error.is_some_and(|most| {
            let residual = piece.residual_at(lambda);
            Num::dot(&residual, &residual) > most * lambda * lambda
        })
    }

    /// The piece that begins at `state` and the step to its end, `None` for no end. An event
    /// that would end it at once makes its constraint one more that may change here.
    fn leave(&self, state: &State, basis: &mut Basis) -> Option<(Piece, Option<Num>)> {
        let mut roles = self.roles(state, basis);
        let tie = Num::of(self.tie()) * state.lambda;
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
    fn arrives(&self, state: &State, i: usize, basis: &Basis) -> bool {
        let approach = match state.place[i] {
            VariableState::Low => state.gradient_rate[i],
            VariableState::High => -state.gradient_rate[i],
            VariableState::Pinned | VariableState::Free | VariableState::Held => return false,
        };
        let rounding = Num::of(basis.noise()) * norm(&basis.target().slope);
        state.lambda == Num::ZERO || approach > rounding * state.gradient_scale[i]
    }

    /// Relative distance in lambda below which two events are one: about the error of the columns.
    fn tie(&self) -> f64 {
        100.0 * self.model.epsilon
    }

    /// Which variables may move where: those at a bound whose multiplier is zero, or will
    /// be at once, become one-sided, and so do those that meet a bound.
    fn roles(&self, state: &State, basis: &Basis) -> Vec<Role> {
        let target = basis.target();
        let size = norm(&target.constant) + state.lambda.abs() * norm(&target.slope);
        let grain = Num::of(GRAIN);
        let soon = Num::of(self.tie()) * state.lambda;
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
        basis: &Basis,
    ) -> Piece {
        let mut moves = vec![false; roles.len()];
        basis.moving().for_each(|i| moves[i] = true);
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
        let values = basis.values(state.lambda, self.bounds.total, &fixed);
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
        basis: &Basis,
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
        let rest = self.model.remainder(&target.constant, values);
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
    use fluxform_numerics::random::Random;

    /// Columns, bounds and targets of one problem.
    struct Case {
        model: Model,
        bounds: Bounds,
        offset: Option<Vec<Num>>,
        slope: Vec<Num>,
    }

    /// `side` by `side` coils under points on a grid of twice as many; the columns of mirrored coils are
    /// mirrored to the last bit, so that up to eight events fall together.
    fn array(side: usize, slopes: &[f64]) -> Case {
        let samples = 2 * side;
        let at = |k: usize, of: usize| (2 * k) as f64 - (of - 1) as f64;
        let mut columns = Vec::new();
        for coil in 0..side * side {
            for point in 0..samples * samples {
                let along =
                    |coil: usize, point: usize| (at(coil, side) - 0.5 * at(point, samples)).powi(2);
                let apart =
                    along(coil % side, point % samples) + along(coil / side, point / samples);
                columns.push(Num::of((1.0 - 0.2 * apart) * (-0.4 * apart).exp()));
            }
        }
        let slope = (0..samples * samples).map(|point| {
            let far = at(point % samples, samples).abs() + at(point / samples, samples).abs();
            Num::of(slopes.get(point).copied().unwrap_or(1.0 + 0.03 * far))
        });
        let coils = side * side;
        Case {
            slope: slope.collect(),
            model: Model::new(samples * samples, columns, None, Num::EPSILON),
            bounds: Bounds {
                lower: vec![Some(Num::ZERO); coils],
                upper: vec![Some(Num::of(0.7)); coils],
                total: Num::ZERO,
            },
            offset: None,
        }
    }

    impl Case {
        /// The same with a limit on the sum.
        fn summed(mut self, total: f64) -> Self {
            let mut columns: Vec<Num> = (0..self.model.count())
                .flat_map(|i| self.model.column(i).to_vec())
                .collect();
            columns.extend(vec![Num::ZERO; self.model.rows]);
            let weight = vec![Num::ONE; self.model.count() + 1];
            self.model = Model::new(self.model.rows, columns, Some(weight), Num::EPSILON);
            self.bounds.lower.push(Some(Num::ZERO));
            self.bounds.upper.push(None);
            self.bounds.total = Num::of(total);
            self
        }

        fn path(&self) -> Trace {
            let follower = Follower {
                model: &self.model,
                bounds: &self.bounds,
                start: None,
                most_error: None,
                most_changes: None,
            };
            follower.path(self.offset.as_deref(), &self.slope)
        }

        /// No variable that may grow gains more, for its weight, than any that may shrink would lose.
        fn assert_least(&self, piece: &Piece, lambda: Num, what: &str) {
            let x = piece.x_at(lambda);
            let mut target = vec![Num::ZERO; self.model.rows];
            let constant = self.offset.as_ref().unwrap_or(&target).clone();
            Num::add_scaled(&mut target, Num::ONE, &constant);
            Num::add_scaled(&mut target, lambda, &self.slope);
            let size = norm(&target) + Num::ONE;
            let (model, grain) = (&self.model, Num::of(1e-22) * size);
            let residual = model.remainder(&target, x.iter().copied().enumerate());
            for (a, b) in residual.iter().zip(piece.residual_at(lambda)) {
                assert!((*a - b).abs() < grain, "{what}");
            }
            let total = (0..x.len()).fold(Num::ZERO, |sum, i| sum + model.weight_of(i) * x[i]);
            let summed = model.weight.is_some();
            assert!(!summed || (total - self.bounds.total).abs() < grain);
            // Without an equality nothing has to be given for what is gained.
            let (mut gain, mut loss) = match summed {
                true => (None, None),
                false => (Some(Num::ZERO), Some(Num::ZERO)),
            };
            for (i, &x) in x.iter().enumerate() {
                let room = |to: Option<Num>| to.is_none_or(|to| (x - to).abs() > grain);
                let (lower, upper) = (self.bounds.lower[i], self.bounds.upper[i]);
                assert!(lower.is_none_or(|lower| x > lower - grain), "{what}");
                assert!(upper.is_none_or(|upper| x < upper + grain), "{what}");
                let weight = if summed { model.weight_of(i) } else { Num::ONE };
                let slope = Num::dot(model.column(i), &residual) / weight;
                if room(upper) {
                    gain = Some(gain.map_or(slope, |gain: Num| gain.larger(slope)));
                }
                if room(lower) {
                    loss = Some(loss.map_or(slope, |loss: Num| loss.smaller(slope)));
                }
            }
            if let (Some(gain), Some(loss)) = (gain, loss) {
                let off = ((gain - loss) / size).to_f64();
                assert!(off < 1e-20, "{what}: {off:e}");
            }
        }
    }

    #[test]
    fn every_piece_is_the_minimiser_from_end_to_end() {
        let mut random = Random::new(7);
        for round in 0..24 {
            let side = 2 + round % 3;
            let coils = side * side;
            let uneven: Vec<f64> = (0..4 * coils).map(|_| random.between(0.2, 1.8)).collect();
            let mut case = array(side, if round % 4 == 0 { &[] } else { &uneven });
            if round % 2 == 0 {
                // Some reverse, some are unlimited, one is off.
                for i in 0..coils {
                    case.bounds.lower[i] = [Some(Num::of(-0.4)), Some(Num::ZERO), None][i % 3];
                }
                case.bounds.lower[1] = Some(Num::ZERO);
                case.bounds.upper[1] = Some(Num::ZERO);
            } else {
                // The largest sum is the sum of the largest, or less.
                let share = [1.0, 0.4, 0.05][round % 3];
                case = case.summed(0.7 * share * coils as f64);
            }
            if round % 5 == 0 {
                let offset = (0..4 * coils).map(|_| Num::of(random.between(-0.3, 0.3)));
                case.offset = Some(offset.collect());
            }
            let trace = case.path();
            assert!(trace.complete && trace.flaw < 1e-24, "round {round}");
            for (k, piece) in trace.pieces.iter().enumerate() {
                let end = match trace.pieces.get(k + 1) {
                    Some(next) => next.start,
                    None => Num::of(2.0) * piece.start + Num::ONE,
                };
                let middle = Num::of(0.5) * (piece.start + end);
                for lambda in [piece.start, middle, end] {
                    case.assert_least(piece, lambda, &format!("round {round} at {lambda:?}"));
                }
            }
        }
    }

    /// A breakpoint costs a few changes, each of which is about the square of the number of coils in
    /// operations, however many coils there are and however many events fall together.
    #[test]
    fn a_breakpoint_costs_a_few_changes() {
        for side in [4, 8, 12] {
            let coils = side * side;
            let mut random = Random::new(side as u64);
            let uneven: Vec<f64> = (0..4 * coils).map(|_| random.between(0.2, 1.8)).collect();
            for slopes in [&[][..], &uneven] {
                for case in [
                    array(side, slopes),
                    array(side, slopes).summed(0.5 * coils as f64),
                ] {
                    let trace = case.path();
                    let (pieces, changes) = (trace.pieces.len(), trace.changes);
                    assert!(trace.complete);
                    let most = match case.model.weight {
                        // Another pivot of the sum takes all again.
                        Some(_) => pieces * coils,
                        None => 2 * (coils + pieces),
                    };
                    assert!(changes <= most, "{coils}: {pieces}, {changes}");
                }
            }
        }
    }

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
        let path = |size: f64| {
            Case {
                model: model.clone(),
                bounds: bounds.clone(),
                offset: None,
                slope: numbers(&[0.7 * size, 1.9 * size, 1.6 * size]),
            }
            .path()
        };
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
