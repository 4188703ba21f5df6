//! Among equally good currents, those of least power.
//!
//! Where columns depend on each other the best fit is unique but the currents are not.
//! All minimisers share the fit and every bound whose multiplier is not zero; what is
//! left is a least-distance problem over the dependences, solved as Lawson and Hanson
//! do: by non-negative least squares on its constraints.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::basis::{Basis, Target};
use super::cone::{self, Role};
use super::homotopy::{Bounds, Piece, VariableState};
use super::model::Model;
use super::pivoted::Pivoted;

/// A variable that the dependences move by less than this share is not moved by them.
const UNREACHED: f64 = 1e-22;

/// The scaled currents of least `sum (cost_i x_i)^2` that fit as well as `piece` does at `lambda`.
pub(super) fn least_power(
    model: &Model,
    bounds: &Bounds,
    cost: &[Num],
    piece: &Piece,
    lambda: Num,
    target_norm: Num,
) -> Vec<Num> {
    let coils = cost.len();
    let mut x = piece.x_at(lambda);
    x.truncate(coils);
    for (i, x) in x.iter_mut().enumerate() {
        *x = clipped(bounds, i, *x);
    }
    let gradient = piece.gradient_at(lambda);
    // A bound is left out only if its multiplier is surely there.
    let sure = |i: usize| {
        gradient[i].abs() > Num::of(100.0 * piece.noise) * target_norm * piece.gradient_scale[i]
    };
    let open: Vec<usize> = (0..coils)
        .filter(|&i| match piece.place[i] {
            VariableState::Pinned => false,
            VariableState::Free | VariableState::Held => true,
            VariableState::Low | VariableState::High => !sure(i),
        })
        .collect();
    // Columns of free variables are independent; with a sum that binds, only as long as it is kept.
    let free = |i: &usize| piece.place[*i] == VariableState::Free;
    let sum_binds = model.weight.is_some() && !free(&coils);
    if !sum_binds && open.iter().all(free) {
        return x;
    }
    let kept = open.iter().map(|&i| model.column(i).to_vec()).collect();
    let moves = dependences(kept, &open, cost);
    if moves.is_empty() {
        return x;
    }
    // In p_k = cost x the least power is the least distance, and p = still + basis u.
    let count = open.len();
    let p: Vec<Num> = open.iter().map(|&i| cost[i] * x[i]).collect();
    let mut still = p.clone();
    for vector in &moves {
        Num::add_scaled(&mut still, -Num::dot(vector, &p), vector);
    }
    let mut constraints = Constraints::of(bounds, &open, &moves, cost, &still);
    // Where the sum's multiplier is not zero no change moves the sum: this says nothing then.
    if model.weight.is_some() {
        let share: Vec<Num> = open.iter().map(|&i| model.weight_of(i) / cost[i]).collect();
        let row: Vec<Num> = moves
            .iter()
            .map(|vector| -Num::dot(vector, &share))
            .collect();
        let others = (0..coils).filter(|i| !open.contains(i));
        let used = others.fold(Num::dot(&still, &share), |s, i| {
            s + model.weight_of(i) * x[i]
        });
        constraints.at_least(&row, used - bounds.total);
    }
    let Some(u) = constraints.nearest(moves.len()) else {
        return x;
    };
    let mut best = still;
    for (vector, &u) in moves.iter().zip(&u) {
        Num::add_scaled(&mut best, u, vector);
    }
    for k in 0..count {
        x[open[k]] = clipped(bounds, open[k], best[k] / cost[open[k]]);
    }
    x
}

fn clipped(bounds: &Bounds, i: usize, x: Num) -> Num {
    let x = bounds.lower[i].map_or(x, |lower| x.larger(lower));
    bounds.upper[i].map_or(x, |upper| x.smaller(upper))
}

/// An orthonormal basis, in `cost x`, of the changes that the kept columns do not see.
fn dependences(kept: Vec<Vec<Num>>, open: &[usize], cost: &[Num]) -> Vec<Vec<Num>> {
    let pivoted = Pivoted::new(kept, open.len(), 0.0);
    let mut moves: Vec<Vec<Num>> = Vec::new();
    for j in (0..open.len()).filter(|&j| !pivoted.contains(j)) {
        let mut change = vec![Num::ZERO; open.len()];
        change[j] = cost[open[j]];
        for (&k, share) in pivoted.members.iter().zip(pivoted.shares(j)) {
            change[k] = -(cost[open[k]] * share);
        }
        // What the first pass leaves of others' directions the second takes.
        for vector in moves.iter().chain(&moves) {
            let along = Num::dot(vector, &change);
            Num::add_scaled(&mut change, -along, vector);
        }
        let length = Num::dot(&change, &change).sqrt();
        moves.push(change.iter().map(|&v| v / length).collect());
    }
    moves
}

/// Linear inequalities `row . u >= bound`, rows of unit length.
struct Constraints {
    rows: Vec<Vec<Num>>,
    bounds: Vec<Num>,
}

impl Constraints {
    /// The limits of the open variables, `p = still + moves u` of their `cost x`.
    fn of(
        bounds: &Bounds,
        open: &[usize],
        moves: &[Vec<Num>],
        cost: &[Num],
        still: &[Num],
    ) -> Self {
        let mut constraints = Self {
            rows: Vec::new(),
            bounds: Vec::new(),
        };
        for (k, &i) in open.iter().enumerate() {
            let row: Vec<Num> = moves.iter().map(|vector| vector[k]).collect();
            if let Some(lower) = bounds.lower[i] {
                constraints.at_least(&row, cost[i] * lower - still[k]);
            }
            if let Some(upper) = bounds.upper[i] {
                let row: Vec<Num> = row.iter().map(|&v| -v).collect();
                constraints.at_least(&row, still[k] - cost[i] * upper);
            }
        }
        constraints
    }

    fn at_least(&mut self, row: &[Num], bound: Num) {
        let length = Num::dot(row, row).sqrt();
        // A variable that no change reaches has nothing to say.
        if length.to_f64() > UNREACHED {
            self.rows.push(row.iter().map(|&v| v / length).collect());
            self.bounds.push(bound / length);
        }
    }

    /// The point of least length that satisfies all; `None` if rounding leaves none.
    fn nearest(&self, size: usize) -> Option<Vec<Num>> {
        let unit = self
            .bounds
            .iter()
            .fold(Num::ZERO, |most, b| most.larger(b.abs()));
        if self.bounds.iter().all(|&b| b <= Num::ZERO) {
            return Some(vec![Num::ZERO; size]);
        }
        let mut columns = Vec::new();
        for (row, &bound) in self.rows.iter().zip(&self.bounds) {
            columns.extend_from_slice(row);
            columns.push(bound / unit);
        }
        let count = self.rows.len();
        let model = Model::new(size + 1, columns, None, Num::EPSILON);
        let mut target = vec![Num::ZERO; size + 1];
        target[size] = Num::ONE;
        let mut basis = Basis::new(&model, Target::along(&target));
        let found = cone::solve(&mut basis, &vec![Role::Rising; count], &vec![false; count]);
        let residual = basis.residual_rate(&found.rate);
        let height = residual[size];
        if !found.converged || height.to_f64() <= 1e-15 {
            return None;
        }
        Some(
            residual[..size]
                .iter()
                .map(|&r| -(r / height) * unit)
                .collect(),
        )
    }
}
