//! The path of a bounded least-squares minimiser as its target moves along a line.
//!
//! For the target `c0 + lambda c1` the minimiser of `|c0 + lambda c1 - A x|` over
//! `lower <= x <= upper`, `sum w_i x_i = total` is piecewise linear in lambda. Every
//! piece is solved anew from its active set, so that errors do not build up; at every
//! breakpoint the next direction is itself a small minimisation over all constraints
//! that are about to change, so that ties need no special case.

use crate::numerics::real::Real;

use super::cone::{self, Role};
use super::model::Model;

/// Bounds of the variables; `None` above: unbounded.
#[derive(Debug, Clone)]
pub(super) struct Bounds<T> {
    pub lower: Vec<T>,
    pub upper: Vec<Option<T>>,
    /// Right-hand side of the model's equality.
    pub total: T,
}

/// Where a variable stands on a piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// Both bounds are equal.
    Pinned,
    /// At its lower bound.
    Low,
    /// At its upper bound.
    High,
    /// Between the bounds, moving.
    Free,
    /// Between the bounds, standing still because its column depends on those of free variables.
    Held,
}

/// One linear piece; values at its start and rates per unit of lambda.
#[derive(Debug, Clone)]
pub(super) struct Piece<T> {
    pub start: T,
    pub place: Vec<Place>,
    pub x: Vec<T>,
    pub x_rate: Vec<T>,
    /// Target minus fit.
    pub residual: Vec<T>,
    pub residual_rate: Vec<T>,
    /// Reduced gradients.
    pub gradient: Vec<T>,
    gradient_rate: Vec<T>,
    /// Natural size of a gradient per unit of residual.
    pub gradient_scale: Vec<T>,
    /// Relative size of rounding on this piece.
    pub noise: f64,
}

/// The pieces in order, the last one without end.
#[derive(Debug, Clone)]
pub(super) struct Trace<T> {
    pub pieces: Vec<Piece<T>>,
    /// False when the iteration limit was met: the last piece is not the minimiser.
    pub complete: bool,
}

/// A line of targets, `constant + lambda slope`.
#[derive(Debug, Clone)]
pub(super) struct Target<T> {
    pub constant: Vec<T>,
    pub slope: Vec<T>,
}

/// Values at one lambda, with the rates by which they were reached.
struct State<T> {
    lambda: T,
    place: Vec<Place>,
    x: Vec<T>,
    x_rate: Vec<T>,
    gradient: Vec<T>,
    gradient_rate: Vec<T>,
    gradient_scale: Vec<T>,
    noise: f64,
}

fn norm<T: Real>(v: &[T]) -> T {
    T::dot(v, v).sqrt()
}

/// Relative distance in lambda below which two events are one: far above rounding, and
/// so small that its square does not show in the error.
fn tie<T: Real>() -> T {
    T::of(T::EPSILON.powf(0.65))
}

impl<T: Real> Piece<T> {
    /// Values of the variables at `lambda`.
    pub fn x_at(&self, lambda: T) -> Vec<T> {
        advance(&self.x, &self.x_rate, lambda - self.start)
    }

    /// Residual at `lambda`.
    pub fn residual_at(&self, lambda: T) -> Vec<T> {
        advance(&self.residual, &self.residual_rate, lambda - self.start)
    }

    /// Reduced gradients at `lambda`.
    pub fn gradient_at(&self, lambda: T) -> Vec<T> {
        advance(&self.gradient, &self.gradient_rate, lambda - self.start)
    }
}

fn advance<T: Real>(value: &[T], rate: &[T], by: T) -> Vec<T> {
    value.iter().zip(rate).map(|(&v, &r)| v + by * r).collect()
}

/// What a problem needs to be followed.
pub(super) struct Follower<'a, T> {
    pub model: &'a Model<T>,
    pub bounds: &'a Bounds<T>,
}

impl<T: Real> Follower<'_, T> {
    /// The path from the zero target at `lambda = 0`, where `x = 0` (the slack takes what
    /// the equality leaves), along `offset` first and then along `slope`.
    pub fn path(&self, offset: Option<&[T]>, slope: &[T]) -> Trace<T> {
        let count = self.model.count();
        let zero = vec![T::ZERO; self.model.rows];
        let mut state = State {
            lambda: T::ZERO,
            place: (0..count).map(|i| self.place_of_zero(i)).collect(),
            x: vec![T::ZERO; count],
            x_rate: vec![T::ZERO; count],
            gradient: vec![T::ZERO; count],
            gradient_rate: vec![T::ZERO; count],
            gradient_scale: self.model.norm.clone(),
            noise: T::EPSILON,
        };
        if self.model.weight.is_some() {
            state.x[count - 1] = self.bounds.total;
        }
        let Some(offset) = offset else {
            return self.follow(
                state,
                &Target {
                    constant: zero,
                    slope: slope.to_vec(),
                },
                None,
            );
        };
        let approach = self.follow(
            state,
            &Target {
                constant: zero,
                slope: offset.to_vec(),
            },
            Some(T::ONE),
        );
        let last = &approach.pieces[approach.pieces.len() - 1];
        let state = State {
            lambda: T::ZERO,
            place: last.place.clone(),
            x: last.x_at(T::ONE),
            x_rate: vec![T::ZERO; count],
            gradient: last.gradient_at(T::ONE),
            gradient_rate: vec![T::ZERO; count],
            gradient_scale: last.gradient_scale.clone(),
            noise: last.noise,
        };
        let target = Target {
            constant: offset.to_vec(),
            slope: slope.to_vec(),
        };
        let mut trace = self.follow(state, &target, None);
        trace.complete &= approach.complete;
        trace
    }

    fn place_of_zero(&self, i: usize) -> Place {
        let lower = self.bounds.lower[i];
        let value = if self.model.weight.is_some() && i + 1 == self.model.count() {
            self.bounds.total
        } else {
            T::ZERO
        };
        match self.bounds.upper[i] {
            Some(upper) if upper <= lower => Place::Pinned,
            _ if value <= lower => Place::Low,
            Some(upper) if value >= upper => Place::High,
            _ => Place::Free,
        }
    }

    fn follow(&self, mut state: State<T>, target: &Target<T>, end: Option<T>) -> Trace<T> {
        let mut pieces: Vec<Piece<T>> = Vec::new();
        let limit = 200 * (self.model.count() + 2);
        for _ in 0..limit {
            let Some((piece, event)) = self.leave(&state, target) else {
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
                        noise: piece.noise,
                    };
                }
                _ => {
                    return Trace {
                        pieces,
                        complete: true,
                    };
                }
            }
        }
        if pieces.is_empty() {
            pieces.push(self.standstill(&state, target));
        }
        Trace {
            pieces,
            complete: false,
        }
    }

    /// The piece that begins at `state` and the step to its end, `None` for no end. An event
    /// that would end it at once makes its constraint one more that may change here.
    fn leave(&self, state: &State<T>, target: &Target<T>) -> Option<(Piece<T>, Option<T>)> {
        let mut roles = self.roles(state, target);
        for _ in 0..=2 * self.model.count() {
            let direction = cone::solve(self.model, &roles, &target.slope);
            if !direction.converged {
                return None;
            }
            let piece = self.piece(state, target, &roles, &direction);
            let Some((i, step, role)) = self.next_event(&piece, &roles, &direction, target) else {
                return Some((piece, None));
            };
            if step > tie::<T>() * state.lambda || roles[i] == role {
                return Some((piece, Some(step)));
            }
            roles[i] = role;
        }
        None
    }

    /// Which variables may move where: those at a bound whose multiplier is zero, or will
    /// be at once, become one-sided, and so do those that meet a bound.
    fn roles(&self, state: &State<T>, target: &Target<T>) -> Vec<Role> {
        let size = norm(&target.constant) + state.lambda.abs() * norm(&target.slope);
        let noise = T::of(state.noise);
        let soon = tie::<T>() * state.lambda;
        let slack = self.model.weight.as_ref().map(|_| self.model.count() - 1);
        (0..self.model.count())
            .map(|i| match state.place[i] {
                Place::Pinned => Role::Fixed,
                Place::Low | Place::High => {
                    let (role, sign) = match state.place[i] {
                        Place::Low => (Role::Rising, T::ONE),
                        _ => (Role::Falling, -T::ONE),
                    };
                    let distance = -(sign * state.gradient[i]);
                    let approach = (sign * state.gradient_rate[i]).larger(T::ZERO);
                    let near = (noise * size * state.gradient_scale[i]).larger(soon * approach);
                    if distance <= near { role } else { Role::Fixed }
                }
                Place::Free | Place::Held => {
                    let down = state.x[i] - self.bounds.lower[i];
                    let up = self.bounds.upper[i].map(|u| u - state.x[i]);
                    let range = up.map_or(size, |up| size.smaller(up + down));
                    let range = if Some(i) == slack {
                        self.bounds.total
                    } else {
                        range
                    };
                    let near = |rate: T| (noise * range).larger(soon * rate.larger(T::ZERO));
                    if up.is_some_and(|up| up <= near(state.x_rate[i]) && up < down) {
                        Role::Falling
                    } else if down <= near(-state.x_rate[i]) {
                        Role::Rising
                    } else if state.place[i] == Place::Free {
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
        state: &State<T>,
        target: &Target<T>,
        roles: &[Role],
        direction: &cone::Direction<T>,
    ) -> Piece<T> {
        let factor = &direction.factor;
        let place: Vec<Place> = (0..roles.len())
            .map(|i| match roles[i] {
                Role::Fixed => state.place[i],
                _ if factor.contains(i) => Place::Free,
                Role::Free | Role::Held => Place::Held,
                Role::Rising => Place::Low,
                Role::Falling => Place::High,
            })
            .collect();
        let still = |i: usize| match place[i] {
            Place::Pinned => T::ZERO,
            Place::Low => self.bounds.lower[i],
            Place::High => self.bounds.upper[i].unwrap_or(state.x[i]),
            Place::Free | Place::Held => state.x[i],
        };
        let fixed = (0..roles.len())
            .filter(|&i| place[i] != Place::Free)
            .map(|i| (i, still(i)));
        let (rest, total) = self
            .model
            .remainder(&target.constant, self.bounds.total, fixed);
        let base = factor.solve(self.model, &rest, total);
        let at = |base: T, rate: T| base + state.lambda * rate;
        let x = (0..roles.len())
            .map(|i| {
                if place[i] == Place::Free {
                    at(base.x[i], direction.rate[i])
                } else {
                    still(i)
                }
            })
            .collect();
        let x_rate = (0..roles.len())
            .map(|i| {
                if place[i] == Place::Free {
                    direction.rate[i]
                } else {
                    T::ZERO
                }
            })
            .collect();
        let residual: Vec<T> = base
            .residual
            .iter()
            .zip(&direction.residual)
            .map(|(&b, &r)| at(b, r))
            .collect();
        Piece {
            start: state.lambda,
            gradient: factor.gradient(self.model, &residual),
            gradient_rate: direction.gradient.clone(),
            gradient_scale: (0..roles.len())
                .map(|i| factor.gradient_scale(self.model, i))
                .collect(),
            noise: factor.noise(),
            place,
            x,
            x_rate,
            residual,
            residual_rate: direction.residual.clone(),
        }
    }

    /// The first constraint to change on `piece`: its variable, the step in lambda, and the
    /// role that it takes there.
    fn next_event(
        &self,
        piece: &Piece<T>,
        roles: &[Role],
        direction: &cone::Direction<T>,
        target: &Target<T>,
    ) -> Option<(usize, T, Role)> {
        let slope = norm(&target.slope);
        let mut first: Option<(usize, T, Role)> = None;
        let mut offer = |i: usize, distance: T, rate: T, role: Role| {
            let step = distance.larger(T::ZERO) / rate;
            if first.is_none_or(|(_, least, _)| step < least) {
                first = Some((i, step, role));
            }
        };
        for (i, &role) in roles.iter().enumerate() {
            match piece.place[i] {
                Place::Free => {
                    let rate = piece.x_rate[i];
                    if rate.abs()
                        <= direction
                            .factor
                            .rate_noise(self.model, i, &piece.x_rate, slope)
                    {
                        continue;
                    }
                    if rate < T::ZERO {
                        offer(i, piece.x[i] - self.bounds.lower[i], -rate, Role::Rising);
                    } else if let Some(upper) = self.bounds.upper[i] {
                        offer(i, upper - piece.x[i], rate, Role::Falling);
                    }
                }
                Place::Low | Place::High if role == Role::Fixed || !direction.blocked[i] => {
                    let (sign, role) = match piece.place[i] {
                        Place::Low => (T::ONE, Role::Rising),
                        _ => (-T::ONE, Role::Falling),
                    };
                    let rate = sign * piece.gradient_rate[i];
                    if rate > T::of(piece.noise) * slope * piece.gradient_scale[i] {
                        offer(i, -(sign * piece.gradient[i]), rate, role);
                    }
                }
                _ => {}
            }
        }
        first
    }

    /// Largest relative violation of the optimality conditions at the pieces' starts, and of
    /// the residual's continuity: its square is the error that it leaves in e*.
    pub fn flaw(&self, trace: &Trace<T>, offset: Option<&[T]>, slope: &[T]) -> f64 {
        let mut worst = T::ZERO;
        for (k, piece) in trace.pieces.iter().enumerate() {
            let size = offset.map_or(T::ZERO, norm) + piece.start * norm(slope);
            if size <= T::ZERO {
                continue;
            }
            let mut see = |violation: T| worst = worst.larger(violation / size);
            for i in 0..self.model.count() {
                let x = piece.x[i] * self.model.norm[i];
                see(self.bounds.lower[i] * self.model.norm[i] - x);
                if let Some(upper) = self.bounds.upper[i] {
                    see(x - upper * self.model.norm[i]);
                }
                let scale = piece.gradient_scale[i];
                match piece.place[i] {
                    Place::Low if scale > T::ZERO => see(piece.gradient[i] / scale),
                    Place::High if scale > T::ZERO => see(-(piece.gradient[i] / scale)),
                    _ => {}
                }
            }
            if k > 0 {
                let reached = trace.pieces[k - 1].residual_at(piece.start);
                let jump: Vec<T> = reached
                    .iter()
                    .zip(&piece.residual)
                    .map(|(&a, &b)| a - b)
                    .collect();
                see(norm(&jump));
            }
        }
        worst.to_f64()
    }

    /// A piece that stays where `state` is: only for a path that could not begin.
    fn standstill(&self, state: &State<T>, target: &Target<T>) -> Piece<T> {
        let values = state.x.iter().copied().enumerate();
        let (rest, _) = self
            .model
            .remainder(&target.constant, self.bounds.total, values);
        Piece {
            start: state.lambda,
            place: state.place.clone(),
            x: state.x.clone(),
            x_rate: vec![T::ZERO; state.x.len()],
            residual: advance(&rest, &target.slope, state.lambda),
            residual_rate: target.slope.clone(),
            gradient: state.gradient.clone(),
            gradient_rate: vec![T::ZERO; state.x.len()],
            gradient_scale: state.gradient_scale.clone(),
            noise: state.noise,
        }
    }
}
