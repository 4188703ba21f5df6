//! The variables that move, and the least squares over them.
//!
//! `A = QR` of the columns that move, by reflections as they come and rotations as they go. Q is not kept:
//! all other columns and the target are turned with them. So whether a column depends on those that move, and its
//! reduced gradient, are read off what it has below R; a change costs the square of the rows in operations.
//! The equality is eliminated by its pivot, the variable that moves of the smallest column per weight, so that the
//! reduced columns `a_j - (w_j / w_p) a_p` never grow beyond twice the originals. Another pivot takes all columns
//! again, the cube.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;
use rayon::prelude::*;

use super::model::{Model, Reflection, WORTH_THREADS, least_share, of_each, subtract};

/// Rates above this share of the target are never taken for rounding.
const MOST_BLUR: f64 = 1e-9;
/// Operations of one step of a rotation, in those of a sum of products.
const ROTATION: usize = 4;

/// A line of targets, `constant + lambda slope`.
#[derive(Debug, Clone)]
pub(super) struct Target {
    pub constant: Vec<Num>,
    pub slope: Vec<Num>,
}

impl Target {
    /// The line through zero along `slope`.
    pub fn along(slope: &[Num]) -> Self {
        Self {
            constant: vec![Num::ZERO; slope.len()],
            slope: slope.to_vec(),
        }
    }
}

/// The minimiser at one lambda.
pub(super) struct Values {
    /// One entry a variable.
    pub x: Vec<Num>,
    /// Target minus fit.
    pub residual: Vec<Num>,
    /// Reduced gradients.
    pub gradient: Vec<Num>,
}

/// Least squares for a line of targets over the variables that move, with the model's equality
/// `sum w_i x_i = total`.
#[derive(Debug, Clone)]
pub(super) struct Basis<'a> {
    model: &'a Model,
    target: Target,
    pivot: Option<usize>,
    /// Variables in the order of their columns in R, the pivot not among them.
    members: Vec<usize>,
    /// Every variable's column with the equality eliminated, then the target's constant and slope and the pivot's own
    /// column, all times Q'. Those of members are R.
    turned: Vec<Vec<Num>>,
    /// Which of those are members.
    is_member: Vec<bool>,
    /// Columns that came or went.
    pub changes: usize,
}

impl<'a> Basis<'a> {
    /// Without members.
    pub fn new(model: &'a Model, target: Target) -> Self {
        Self::of(model, target, &[])
    }

    /// The listed variables move, in this order, but those that depend on earlier ones.
    fn of(model: &'a Model, target: Target, variables: &[usize]) -> Self {
        let pivot = pivot_of(model, variables);
        let reduced = |i: usize| {
            let mut column = model.column(i).to_vec();
            if let Some(p) = pivot {
                let share = model.weight_of(i) / model.weight_of(p);
                Num::add_scaled(&mut column, -share, model.column(p));
            }
            column
        };
        let mut turned: Vec<Vec<Num>> = (0..model.count()).map(reduced).collect();
        turned.extend([target.constant.clone(), target.slope.clone()]);
        turned.extend(pivot.map(|p| model.column(p).to_vec()));
        let mut basis = Self {
            is_member: vec![false; turned.len()],
            model,
            target,
            pivot,
            members: Vec::with_capacity(variables.len()),
            turned,
            changes: 0,
        };
        variables.iter().for_each(|&i| {
            basis.push(i);
        });
        basis
    }

    /// The problem's columns.
    pub fn model(&self) -> &'a Model {
        self.model
    }

    /// The line of targets.
    pub fn target(&self) -> &Target {
        &self.target
    }

    /// Variables that move; with an equality its pivot, which is not among them, moves too.
    pub fn members(&self) -> &[usize] {
        &self.members
    }

    /// Members and pivot.
    pub fn moving(&self) -> impl Iterator<Item = usize> {
        self.members.iter().copied().chain(self.pivot)
    }

    /// Lets the listed variables move and no others; some are left out if they depend on the rest.
    pub fn set(&mut self, variables: &[usize]) {
        if self.pivot != pivot_of(self.model, variables) {
            self.restart(variables);
            return;
        }
        let mut listed = vec![false; self.model.count()];
        variables.iter().for_each(|&i| listed[i] = true);
        for place in (0..self.members.len()).rev() {
            if !listed[self.members[place]] {
                self.remove(place);
            }
        }
        for &i in variables {
            self.push(i);
        }
    }

    /// Adds one to those listed `before`; false if it depends on them.
    pub fn add(&mut self, before: &[usize], variable: usize) -> bool {
        let all = || before.iter().copied().chain([variable]).collect::<Vec<_>>();
        if self.pivot == pivot_of(self.model, &all()) {
            return self.push(variable);
        }
        let rank = self.moving().count();
        let kept = self.clone();
        self.restart(&all());
        let grows = self.moving().count() > rank;
        if !grows {
            *self = kept;
        }
        grows
    }

    fn restart(&mut self, variables: &[usize]) {
        let changes = self.changes;
        *self = Self::of(self.model, self.target.clone(), variables);
        self.changes += changes;
    }

    /// Adds a column by a reflection; false where it depends on those before.
    fn push(&mut self, variable: usize) -> bool {
        fluxform_base::progress::poll();
        let (rows, rank) = (self.model.rows, self.members.len());
        if self.pivot == Some(variable) || self.is_member[variable] || rank == rows {
            return false;
        }
        let rest = &self.turned[variable][rank..];
        let outside = Num::dot(rest, rest).sqrt();
        if outside <= self.model.norm[variable] * Num::of(least_share(self.independence())) {
            return false;
        }
        let (reflection, diagonal) = Reflection::onto_first(rest.to_vec());
        let own = &mut self.turned[variable];
        own[rank] = diagonal;
        own[rank + 1..].fill(Num::ZERO);
        self.is_member[variable] = true;
        self.members.push(variable);
        self.changes += 1;
        for_groups(self.others(), 2 * (rows - rank), |group| {
            group
                .iter_mut()
                .for_each(|column| reflection.apply(&mut column[rank..]));
        });
        true
    }

    /// Takes the member in this place out, and turns what its column leaves below the diagonal.
    fn remove(&mut self, place: usize) {
        let variable = self.members.remove(place);
        self.is_member[variable] = false;
        self.changes += 1;
        let mut rotations: Vec<[Num; 2]> = Vec::with_capacity(self.members.len() - place);
        for (k, &i) in self.members.iter().enumerate().skip(place) {
            fluxform_base::progress::poll();
            let column = &mut self.turned[i];
            Num::rotate(&rotations, [&mut column[place..]]);
            let (a, b) = (column[k], column[k + 1]);
            let length = (a * a + b * b).sqrt();
            rotations.push([a / length, b / length]);
            column[k] = length;
            column[k + 1] = Num::ZERO;
        }
        for_groups(self.others(), ROTATION * rotations.len(), |group| {
            if let [a, b, c, d] = group {
                let columns = [a, b, c, d].map(|column| &mut column[place..]);
                Num::rotate(&rotations, columns);
            } else {
                group
                    .iter_mut()
                    .for_each(|column| Num::rotate(&rotations, [&mut column[place..]]));
            }
        });
    }

    /// What is turned and not in R.
    fn others(&mut self) -> Vec<&mut [Num]> {
        let all = self.turned.iter_mut().zip(&self.is_member);
        all.filter_map(|(column, is_member)| (!is_member).then_some(&mut column[..]))
            .collect()
    }

    /// Smallest share of a member's column that lies outside the span of those before it.
    fn independence(&self) -> f64 {
        let norm = |i: usize| self.model.norm[i].to_f64();
        let shares = (self.members.iter().enumerate())
            .map(|(k, &i)| self.turned[i][k].to_f64().abs() / norm(i));
        shares.fold(1.0, f64::min)
    }

    /// The minimiser for a turned target, with the equality's `total`: one entry a variable, zero where it does not move.
    fn solve(&self, target: &[Num], total: Num) -> Vec<Num> {
        let mut rest = target[..self.members.len()].to_vec();
        let mut x = vec![Num::ZERO; self.model.count()];
        let mut left = total;
        for (k, &i) in self.members.iter().enumerate().rev() {
            let column = &self.turned[i][..=k];
            let value = rest[k] / column[k];
            Num::add_scaled(&mut rest[..k], -value, &column[..k]);
            x[i] = value;
            left -= self.model.weight_of(i) * value;
        }
        if let Some(p) = self.pivot {
            x[p] = left / self.model.weight_of(p);
        }
        x
    }

    /// Reduced gradients `a_i'r - nu w_i` of every variable for the residual of a turned target; zero for what moves.
    fn gradient(&self, target: &[Num]) -> Vec<Num> {
        let rank = self.members.len();
        let rest = &target[rank..];
        of_each(self.model.count(), rest.len(), |i| {
            if self.is_member[i] {
                Num::ZERO
            } else {
                Num::dot(&self.turned[i][rank..], rest)
            }
        })
    }

    /// `target - sum a_i x_i` over the listed variables.
    fn residual(&self, target: &[Num], x: impl Iterator<Item = (usize, Num)>) -> Vec<Num> {
        if self.members.len() == self.model.rows {
            return vec![Num::ZERO; self.model.rows];
        }
        self.model.remainder(target, x)
    }

    fn turned_constant(&self) -> &[Num] {
        &self.turned[self.model.count()]
    }

    fn turned_slope(&self) -> &[Num] {
        &self.turned[self.model.count() + 1]
    }

    /// Rates of the minimiser for the slope alone, whose weights add up to zero.
    pub fn rates(&self) -> Vec<Num> {
        self.solve(self.turned_slope(), Num::ZERO)
    }

    /// `slope - A rates` of the same.
    pub fn residual_rate(&self, rates: &[Num]) -> Vec<Num> {
        let moving = self.moving().map(|i| (i, rates[i]));
        self.residual(&self.target.slope, moving)
    }

    /// Reduced gradients of the same; zero for what moves.
    pub fn gradient_rates(&self) -> Vec<Num> {
        self.gradient(self.turned_slope())
    }

    /// The minimiser at `lambda` where the `fixed` variables have the values given.
    pub fn values(&self, lambda: Num, total: Num, fixed: &[(usize, Num)]) -> Values {
        let model = self.model;
        let mut rest = self.turned_constant().to_vec();
        Num::add_scaled(&mut rest, lambda, self.turned_slope());
        if let Some(p) = self.pivot {
            let share = total / model.weight_of(p);
            Num::add_scaled(&mut rest, -share, &self.turned[model.count() + 2]);
        }
        subtract(&mut rest, fixed.iter().copied(), |i| &self.turned[i]);
        let used = |left: Num, &(i, x): &(usize, Num)| left - model.weight_of(i) * x;
        let mut x = self.solve(&rest, fixed.iter().fold(total, used));
        for &(i, value) in fixed {
            x[i] = value;
        }
        let mut target = self.target.constant.clone();
        Num::add_scaled(&mut target, lambda, &self.target.slope);
        Values {
            residual: self.residual(&target, x.iter().copied().enumerate()),
            gradient: self.gradient(&rest),
            x,
        }
    }

    /// Relative size of the gradients that errors of the columns leave where zero is meant.
    pub fn noise(&self) -> f64 {
        (4 * self.model.rows) as f64 * self.model.epsilon / self.independence()
    }

    /// Natural sizes of the reduced gradients per unit of residual.
    pub fn gradient_scales(&self) -> Vec<Num> {
        let model = self.model;
        let shift = self
            .pivot
            .map_or(Num::ZERO, |p| model.norm[p] / model.weight_of(p));
        (0..model.count())
            .map(|i| model.norm[i] + model.weight_of(i) * shift)
            .collect()
    }

    /// Relative error of the rates: a residual of the given share of the target is felt with
    /// the square of the condition.
    pub fn blur(&self, residual_share: f64) -> f64 {
        (self.noise() * (1.0 + residual_share / self.independence())).min(MOST_BLUR)
    }

    /// Size of a rate that rounding leaves where variable `i` should not move; `blur` is
    /// the same relative to the target.
    pub fn rate_noise(&self, i: usize, rates: &[Num], target_norm: Num, blur: f64) -> Num {
        let mut scale = target_norm;
        if self.pivot == Some(i) {
            let model = self.model;
            let moved = self.members.iter().fold(Num::ZERO, |s, &j| {
                s + model.weight_of(j) * (rates[j].abs() + target_norm)
            });
            scale = scale.larger(moved / model.weight_of(i));
        }
        scale * Num::of(blur)
    }
}

/// The variable of the smallest column per weight, with an equality.
fn pivot_of(model: &Model, variables: &[usize]) -> Option<usize> {
    let weight = model.weight.as_ref()?;
    let per_weight = |i: usize| model.norm[i] / weight[i];
    let smaller = |p, i| if per_weight(i) < per_weight(p) { i } else { p };
    variables.iter().copied().reduce(smaller)
}

/// Columns that are turned at once.
const GROUP: usize = 4;

/// Does the same with all columns, at so many operations each.
fn for_groups(
    mut columns: Vec<&mut [Num]>,
    operations: usize,
    turn: impl Fn(&mut [&mut [Num]]) + Send + Sync,
) {
    if operations * columns.len() < WORTH_THREADS {
        columns.chunks_mut(GROUP).for_each(turn);
    } else {
        columns.par_chunks_mut(GROUP).for_each(turn);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_numerics::random::Random;

    /// Columns in a basis that came and went a hundred times are those of one that was never changed.
    #[test]
    fn a_column_that_comes_and_goes_leaves_no_trace() {
        let mut random = Random::new(17);
        let (rows, count) = (23, 19);
        let mut list = |count: usize| -> Vec<Num> {
            (0..count)
                .map(|_| Num::of(random.between(-1.0, 1.0)))
                .collect()
        };
        let (columns, target) = (list(rows * count), [list(rows), list(rows)]);
        let weights = list(count).into_iter().map(|w| w.abs() + Num::ONE);
        let target = Target {
            constant: target[0].clone(),
            slope: target[1].clone(),
        };
        let fixed = [(3, Num::of(0.7)), (11, Num::of(-1.3))];
        let (lambda, total) = (Num::of(0.9), Num::of(1.7));
        for weight in [None, Some(weights.collect::<Vec<_>>())] {
            let model = Model::new(rows, columns.clone(), weight, Num::EPSILON);
            let mut changed = Basis::new(&model, target.clone());
            for round in 0..100 {
                let left_out =
                    |i: &usize| !fixed.iter().any(|(f, _)| f == i) && (i + round) % 5 > 1;
                let moving: Vec<usize> = (0..count).filter(left_out).collect();
                changed.set(&moving);
                let fresh = Basis::of(&model, target.clone(), &moving);
                let found = [&changed, &fresh].map(|basis| {
                    let rates = basis.rates();
                    let values = basis.values(lambda, total, &fixed);
                    let gradient = basis.gradient_rates();
                    let residual = basis.residual_rate(&rates);
                    let all = [rates, residual, gradient];
                    [all.concat(), values.x, values.residual, values.gradient].concat()
                });
                for (a, b) in found[0].iter().zip(&found[1]) {
                    assert!((*a - *b).abs().to_f64() < 1e-27, "{round}");
                }
            }
            assert!(changed.changes > 500);
        }
    }
}
