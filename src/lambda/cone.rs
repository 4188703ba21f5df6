//! Least squares over a cone: the direction in which the minimiser leaves a breakpoint.
//!
//! Lawson and Hanson's active-set method for non-negative least squares, with
//! two-sided variables, either sign of one-sided ones, and one equality.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::basis::Basis;

/// How a variable may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// Not at all.
    Fixed,
    /// Both ways.
    Free,
    /// Both ways, but it gives way where columns depend on each other.
    Held,
    /// Upwards only.
    Rising,
    /// Downwards only.
    Falling,
}

/// The minimiser of `|slope - A d|` over the cone with `w'd = 0`; the basis holds what moves.
pub(super) struct Direction {
    /// d.
    pub rate: Vec<Num>,
    /// Reduced gradients `A'(slope - A d) - nu w`.
    pub gradient: Vec<Num>,
    /// One-sided variables that rounding alone would let in.
    pub blocked: Vec<bool>,
    /// False when the iteration limit was met: the direction is not the minimiser.
    pub converged: bool,
}

/// Minimises `|slope - A d|`; starts with the one-sided variables that are `likely` to move.
pub(super) fn solve(basis: &mut Basis, roles: &[Role], likely: &[bool]) -> Direction {
    let count = basis.model().count();
    let slope = &basis.target().slope;
    let slope_norm = Num::dot(slope, slope).sqrt();
    let with_role = |role: Role| (0..count).filter(move |&i| roles[i] == role);
    let mut moving: Vec<usize> = with_role(Role::Free).chain(with_role(Role::Held)).collect();
    if moving.is_empty() {
        moving.extend(first_of_the_sum(basis, roles));
    }
    let first = moving.first().copied();
    moving.extend((0..count).filter(|&i| likely[i] && first != Some(i)));
    basis.set(&moving);
    let mut rate = vec![Num::ZERO; count];
    let mut blocked = vec![false; count];
    // The variable that has just entered, and is not yet known to move the right way.
    let mut entered = None;
    let limit = 30 * (count + 3);
    for _ in 0..limit {
        fluxform_base::progress::poll();
        let goal = basis.rates();
        if let Some(violators) = step(roles, &moving, &mut rate, &goal) {
            match entered {
                // In exact arithmetic a variable enters in the direction of its gradient.
                Some(i) if violators.contains(&i) => {
                    blocked[i] = true;
                    moving.retain(|&j| j != i);
                }
                _ => moving.retain(|j| !violators.contains(j)),
            }
            if moving.is_empty() {
                moving.extend(first_of_the_sum(basis, roles));
            }
            entered = None;
            basis.set(&moving);
            continue;
        }
        if entered.take().is_some() {
            blocked.fill(false);
        }
        let gradient = basis.gradient_rates();
        for i in most_wanted(basis, roles, &gradient, slope_norm) {
            if blocked[i] || moving.contains(&i) {
                continue;
            }
            if basis.add(&moving, i) {
                moving.push(i);
                entered = Some(i);
                break;
            }
            blocked[i] = true;
        }
        if entered.is_none() {
            return Direction {
                rate,
                gradient,
                blocked,
                converged: true,
            };
        }
    }
    Direction {
        rate: basis.rates(),
        gradient: basis.gradient_rates(),
        blocked,
        converged: false,
    }
}

/// Where there is an equality and nothing two-sided carries it: the variable whose multiplier leaves
/// every rising one satisfied (or, without rising ones, every falling one).
fn first_of_the_sum(basis: &Basis, roles: &[Role]) -> Option<usize> {
    let (model, slope) = (basis.model(), &basis.target().slope);
    model.weight.as_ref()?;
    let pressure = |i: usize| Num::dot(model.filled(i), slope) / model.weight_of(i);
    let with_role = |role: Role| (0..roles.len()).filter(move |&i| roles[i] == role);
    with_role(Role::Rising)
        .reduce(|p, i| if pressure(i) > pressure(p) { i } else { p })
        .or_else(|| {
            with_role(Role::Falling).reduce(|p, i| if pressure(i) < pressure(p) { i } else { p })
        })
}

fn moves_wrongly(role: Role, rate: Num) -> bool {
    match role {
        Role::Rising => rate < Num::ZERO,
        Role::Falling => rate > Num::ZERO,
        _ => false,
    }
}

/// Moves `rate` to `goal`, or as far as the signs allow; then the variables that stopped it.
fn step(roles: &[Role], moving: &[usize], rate: &mut Vec<Num>, goal: &[Num]) -> Option<Vec<usize>> {
    let mut share: Option<Num> = None;
    for &i in moving.iter().filter(|&&i| moves_wrongly(roles[i], goal[i])) {
        let reach = rate[i] / (rate[i] - goal[i]);
        share = Some(share.map_or(reach, |s| s.smaller(reach)));
    }
    let Some(share) = share else {
        rate.clear();
        rate.extend_from_slice(goal);
        return None;
    };
    let mut stopped = Vec::new();
    for &i in moving {
        if moves_wrongly(roles[i], goal[i]) && rate[i] / (rate[i] - goal[i]) <= share {
            stopped.push(i);
        }
    }
    for (r, &g) in rate.iter_mut().zip(goal) {
        *r += share * (g - *r);
    }
    for &i in &stopped {
        rate[i] = Num::ZERO;
    }
    Some(stopped)
}

/// The one-sided variables that gain by moving, largest relative gain first.
fn most_wanted(basis: &Basis, roles: &[Role], gradient: &[Num], slope_norm: Num) -> Vec<usize> {
    let noise = basis.noise() * slope_norm.to_f64();
    let mut requested: Vec<(usize, f64)> = basis
        .gradient_scales()
        .iter()
        .enumerate()
        .filter_map(|(i, scale)| {
            let gain = match roles[i] {
                Role::Rising => gradient[i].to_f64(),
                Role::Falling => -gradient[i].to_f64(),
                _ => return None,
            };
            (gain > noise * scale.to_f64()).then(|| (i, gain / scale.to_f64()))
        })
        .collect();
    requested.sort_by(|a, b| b.1.total_cmp(&a.1));
    requested.into_iter().map(|(i, _)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Target;
    use crate::model::Model;

    fn numbers(values: &[f64]) -> Vec<Num> {
        values.iter().map(|&v| Num::exactly(v)).collect()
    }

    /// Columns in R^3 with generic entries; the last is the slack of a sum.
    fn model(weight: Option<Vec<f64>>) -> Model {
        let columns = [1.3, 0.2, -0.4, 0.7, 1.1, 0.3, -0.6, 0.9, 1.7, 0.0, 0.0, 0.0];
        Model::new(
            3,
            numbers(&columns),
            weight.map(|w| numbers(&w)),
            Num::EPSILON,
        )
    }

    /// The gradient must vanish for what moves and point outwards for what does not.
    fn assert_optimal(model: &Model, roles: [Role; 4], target: &[f64]) {
        for likely in [
            [false; 4],
            roles.map(|role| role == Role::Rising || role == Role::Falling),
        ] {
            assert_direction(model, &roles, &likely, target);
        }
    }

    fn assert_direction(model: &Model, roles: &[Role; 4], likely: &[bool; 4], target: &[f64]) {
        let target = Target::along(&numbers(target));
        let mut basis = Basis::new(model, target);
        let d = solve(&mut basis, roles, likely);
        assert!(d.converged, "{roles:?} {likely:?} {:?}", model.weight);
        let mut residual = basis.target().slope.clone();
        let mut sum = Num::ZERO;
        for i in 0..4 {
            Num::add_scaled(&mut residual, -d.rate[i], model.column(i));
            sum += model.weight_of(i) * d.rate[i];
        }
        assert!(sum.abs().to_f64() < 1e-28);
        for (a, b) in residual.iter().zip(&basis.residual_rate(&d.rate)) {
            assert!((*a - *b).abs().to_f64() < 1e-28);
        }
        for (i, &role) in roles.iter().enumerate() {
            assert!(!moves_wrongly(role, d.rate[i]));
            let (gradient, rate) = (d.gradient[i].to_f64(), d.rate[i].to_f64());
            match role {
                Role::Rising => assert!(gradient < 1e-28 && (gradient * rate).abs() < 1e-28),
                Role::Falling => assert!(gradient > -1e-28 && (gradient * rate).abs() < 1e-28),
                Role::Free | Role::Held => assert!(gradient.abs() < 1e-28),
                Role::Fixed => assert_eq!(rate, 0.0),
            }
        }
    }

    #[test]
    fn every_combination_of_roles_is_solved_to_its_optimality_conditions() {
        use Role::{Falling, Fixed, Free, Held, Rising};
        let all = [Fixed, Free, Held, Rising, Falling];
        let targets = [
            [0.7, -1.3, 0.4],
            [-0.9, 0.1, 1.6],
            [0.3, 0.8, 0.5],
            [-1.1, -0.6, -0.2],
        ];
        for weight in [None, Some(vec![0.7, 1.3, 0.4, 1.0])] {
            let model = model(weight);
            for code in 0..625 {
                let roles = [
                    all[code % 5],
                    all[code / 5 % 5],
                    all[code / 25 % 5],
                    all[code / 125],
                ];
                if roles == [Fixed; 4] {
                    continue;
                }
                for target in &targets {
                    assert_optimal(&model, roles, target);
                }
            }
        }
    }

    #[test]
    fn a_copied_column_is_held_still() {
        let model = Model::new(2, numbers(&[0.7, 1.3, 0.7, 1.3]), None, Num::EPSILON);
        let target = Target::along(&numbers(&[1.1, 0.4]));
        let mut basis = Basis::new(&model, target);
        let d = solve(&mut basis, &[Role::Free, Role::Held], &[false; 2]);
        assert_eq!(basis.members(), &[0]);
        assert_eq!(d.rate[1], Num::ZERO);
    }

    /// With the multiplier that stops the first variable nothing one-sided wants to move.
    #[test]
    fn the_first_of_the_sum_satisfies_all_others() {
        let model = model(Some(vec![0.7, 1.3, 0.4, 1.0]));
        for target in [[0.7, -1.3, 0.4], [-0.9, 0.1, 1.6], [-1.1, -0.6, -0.2]] {
            let target = numbers(&target);
            for (role, sign) in [(Role::Rising, 1.0), (Role::Falling, -1.0)] {
                let basis = Basis::new(&model, Target::along(&target));
                let first = first_of_the_sum(&basis, &[role; 4]).unwrap();
                let pull = |i: usize| Num::dot(model.column(i), &target).to_f64();
                let weight = |i: usize| model.weight_of(i).to_f64();
                let multiplier = pull(first) / weight(first);
                for i in 0..4 {
                    let gradient = pull(i) - multiplier * weight(i);
                    assert!(sign * gradient < 1e-15, "{role:?} {i}: {gradient}");
                }
            }
        }
        let basis = Basis::new(&model, Target::along(&numbers(&[0.7; 3])));
        assert_eq!(first_of_the_sum(&basis, &[Role::Fixed; 4]), None);
    }
}
