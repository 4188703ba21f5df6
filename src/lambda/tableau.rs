//! The basis by pivots on its Gram matrix, for columns that are far from dependent.
//!
//! The sweep operator (A. P. Dempster, Elements of Continuous Multivariate Analysis, 1969) keeps, of the
//! symmetric matrix of the columns' products `C`, bordered by their products with the targets and by the
//! weights of the equality,
//!
//! ```text
//! [ -M          M C_FB                  ]    F: the variables that move,  B: all others and the border,
//! [ C_BF M      C_BB - C_BF M C_FB      ]    M = C_FF^-1.
//! ```
//!
//! Rates, values and reduced gradients of the minimiser are rows of it, so that a variable that enters or
//! leaves costs one pivot: half the square of their number in operations, where a new factorisation costs
//! the cube. Products square the condition number, so that this is for double-double numbers and
//! conditions far from their end; residuals and the gradients of results are taken from the columns.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::basis::{Basis, Target, Values};
use super::model::{Factor, Model};

/// Above this condition number of the columns their products say too little.
pub(super) const MOST_CONDITION: f64 = 1e6;
/// Roundings of the products, the pivots and what becomes of them.
const ROUNDINGS: f64 = 1e3;
/// A column whose square outside the span of the others is below this share depends on them.
const DEPENDENT: f64 = 1e-15;

/// A symmetric matrix, its rows up to the diagonal one after another.
#[derive(Debug, Clone)]
struct Symmetric {
    size: usize,
    entries: Vec<Num>,
}

impl Symmetric {
    fn new(size: usize, of: impl Fn(usize, usize) -> Num) -> Self {
        let row = |i: usize| (0..=i).map(move |j| (i, j));
        let entries = (0..size).flat_map(row).map(|(i, j)| of(i, j));
        Self {
            size,
            entries: entries.collect(),
        }
    }

    /// Row `i` up to the diagonal.
    fn row(&self, i: usize) -> &[Num] {
        &self.entries[i * (i + 1) / 2..][..=i]
    }

    fn at(&self, i: usize, j: usize) -> Num {
        self.row(i.max(j))[i.min(j)]
    }

    /// Row `i` to its end.
    fn whole_row(&self, i: usize) -> Vec<Num> {
        (0..self.size).map(|j| self.at(i, j)).collect()
    }

    /// The product with a vector.
    fn times(&self, vector: &[Num]) -> Vec<Num> {
        let mut product = vec![Num::ZERO; self.size];
        for i in 0..self.size {
            let row = self.row(i);
            product[i] += Num::dot(row, vector);
            if vector[i] != Num::ZERO {
                Num::add_scaled(&mut product[..i], vector[i], row);
            }
        }
        product
    }

    /// Exchanges what variable `k` gives for what it takes; `enters` says which way.
    fn pivot(&mut self, k: usize, enters: bool) {
        let mut row = self.whole_row(k);
        let pivot = row[k];
        row[k] = Num::ZERO;
        let factor = -(Num::ONE / pivot);
        for i in 0..self.size {
            if row[i] != Num::ZERO {
                let own = &mut self.entries[i * (i + 1) / 2..][..=i];
                Num::add_scaled(own, factor * row[i], &row);
            }
        }
        let factor = if enters { -factor } else { factor };
        for (i, &value) in row.iter().enumerate() {
            let (high, low) = (i.max(k), i.min(k));
            self.entries[high * (high + 1) / 2 + low] = factor * value;
        }
        self.entries[k * (k + 1) / 2 + k] = -(Num::ONE / pivot);
    }
}

/// The matrix of the products of all columns that a path needs, before any pivot.
#[derive(Debug, Clone)]
pub(super) struct Products(Symmetric);

impl Products {
    /// Of the coils' columns (all but the slack's).
    pub fn new(model: &Model) -> Self {
        let coils = coils(model);
        Self(Symmetric::new(coils, |i, j| {
            fluxform_base::progress::poll();
            Num::dot(model.filled(i), model.filled(j))
        }))
    }
}

fn coils(model: &Model) -> usize {
    model.count() - usize::from(model.weight.is_some())
}

/// The basis. With an equality the last variable is its slack, whose column is zero.
pub(super) struct Tableau<'a> {
    model: &'a Model,
    target: Target,
    resolution: f64,
    /// Coils, then the slope, the constant and the weights.
    matrix: Symmetric,
    coils: usize,
    /// Squares of the columns' norms.
    square: Vec<Num>,
    members: Vec<usize>,
    pivot: Option<usize>,
    slack_moves: bool,
    /// Pivots made.
    pub pivots: usize,
}

impl<'a> Tableau<'a> {
    /// Without members. `condition` is that of the columns, `products` are theirs.
    pub fn new(model: &'a Model, target: Target, products: &Products, condition: f64) -> Self {
        let coils = coils(model);
        let border = |row: usize, i: usize| match (row, i.checked_sub(coils)) {
            (0, None) => Num::dot(model.filled(i), &target.slope),
            (1, None) => Num::dot(model.filled(i), &target.constant),
            (_, None) => model.weight_of(i),
            // Of the targets with each other nothing is asked.
            _ => Num::ZERO,
        };
        let matrix = Symmetric::new(coils + 3, |i, j| match i.checked_sub(coils) {
            None => products.0.at(i, j),
            Some(row) => border(row, j),
        });
        Self {
            model,
            resolution: ROUNDINGS * Num::EPSILON * condition * condition,
            square: (0..coils).map(|i| matrix.at(i, i)).collect(),
            matrix,
            coils,
            target,
            members: Vec::new(),
            pivot: None,
            slack_moves: false,
            pivots: 0,
        }
    }

    fn slope(&self) -> usize {
        self.coils
    }

    fn constant(&self) -> usize {
        self.coils + 1
    }

    fn weights(&self) -> usize {
        self.coils + 2
    }

    fn slack(&self) -> Option<usize> {
        self.model.weight.as_ref().map(|_| self.coils)
    }

    /// Lets a coil move; false if it depends on those that do.
    fn enter(&mut self, coil: usize) -> bool {
        let rest = self.matrix.at(coil, coil);
        if rest <= Num::of(DEPENDENT) * self.square[coil] {
            return false;
        }
        self.matrix.pivot(coil, true);
        self.pivots += 1;
        self.members.push(coil);
        true
    }

    fn leave(&mut self, place: usize) {
        let coil = self.members.remove(place);
        self.matrix.pivot(coil, false);
        self.pivots += 1;
    }

    fn choose_pivot(&mut self) {
        let slack = self.slack().filter(|_| self.slack_moves);
        self.pivot = slack.or_else(|| Factor::pivot_of(self.model, &self.members));
    }

    /// The equality's multiplier for a column of the matrix that leaves `total` to its weights.
    fn multiplier(&self, column_weights: Num, total: Num) -> Num {
        let binds = self.slack().is_some() && !self.slack_moves && !self.members.is_empty();
        if !binds {
            return Num::ZERO;
        }
        let w = self.weights();
        (total + column_weights) / self.matrix.at(w, w)
    }

    /// The changes, from a column of the matrix and the multiplier; the pivot takes the rest of `total`.
    fn moved(&self, column: &[Num], nu: Num, total: Num) -> Vec<Num> {
        let mut x = vec![Num::ZERO; self.model.count()];
        let mut left = total;
        let weights = self.matrix.row(self.weights());
        for &i in self.members.iter().filter(|&&i| Some(i) != self.pivot) {
            x[i] = column[i] - nu * weights[i];
            left -= self.model.weight_of(i) * x[i];
        }
        if let Some(pivot) = self.pivot {
            x[pivot] = left / self.model.weight_of(pivot);
        }
        x
    }
}

impl Basis for Tableau<'_> {
    fn model(&self) -> &Model {
        self.model
    }

    fn target(&self) -> &Target {
        &self.target
    }

    fn set(&mut self, variables: &[usize]) {
        let mut listed = vec![false; self.model.count()];
        variables.iter().for_each(|&i| listed[i] = true);
        for place in (0..self.members.len()).rev() {
            if !listed[self.members[place]] {
                self.leave(place);
            }
        }
        self.members.iter().for_each(|&i| listed[i] = false);
        self.slack_moves = self.slack().is_some_and(|slack| listed[slack]);
        for &i in variables {
            if i < self.coils && listed[i] {
                self.enter(i);
            }
        }
        self.choose_pivot();
    }

    fn add(&mut self, _: &[usize], variable: usize) -> bool {
        let added = if Some(variable) == self.slack() {
            self.slack_moves = true;
            true
        } else {
            self.enter(variable)
        };
        self.choose_pivot();
        added
    }

    fn members(&self) -> &[usize] {
        &self.members
    }

    fn pivot(&self) -> Option<usize> {
        self.pivot
    }

    fn independence(&self) -> f64 {
        let outside = |&i: &usize| -1.0 / (self.square[i] * self.matrix.at(i, i)).to_f64();
        let least = self.members.iter().map(outside).fold(1.0, f64::min);
        least.max(DEPENDENT).sqrt()
    }

    fn resolution(&self) -> f64 {
        self.resolution
    }

    fn rates(&mut self) -> Vec<Num> {
        let column = self.matrix.row(self.slope());
        let nu = self.multiplier(self.matrix.at(self.weights(), self.slope()), Num::ZERO);
        self.moved(column, nu, Num::ZERO)
    }

    fn residual_rate(&self, rates: &[Num]) -> Vec<Num> {
        let moving = self.members.iter().map(|&i| (i, rates[i]));
        (self.model)
            .remainder(&self.target.slope, Num::ZERO, moving)
            .0
    }

    fn gradient_rates(&self) -> Vec<Num> {
        let (column, weights) = (
            self.matrix.row(self.slope()),
            self.matrix.row(self.weights()),
        );
        let nu = self.multiplier(self.matrix.at(self.weights(), self.slope()), Num::ZERO);
        let mut gradient: Vec<Num> = (0..self.coils)
            .map(|i| column[i] - nu * weights[i])
            .collect();
        gradient.extend(
            self.slack()
                .map(|slack| -(nu * self.model.weight_of(slack))),
        );
        for &i in self.members.iter().chain(&self.pivot) {
            gradient[i] = Num::ZERO;
        }
        gradient
    }

    fn values(
        &self,
        lambda: Num,
        total: Num,
        fixed: &[(usize, Num)],
        _: (&[Num], &[Num]),
    ) -> Values {
        let mut shares = vec![Num::ZERO; self.matrix.size];
        let (mut left, mut of_coils) = (total, total);
        for &(i, x) in fixed {
            let used = self.model.weight_of(i) * x;
            left -= used;
            match shares[..self.coils].get_mut(i) {
                Some(share) => *share = -x,
                None => of_coils -= used,
            }
        }
        shares[self.slope()] = lambda;
        shares[self.constant()] = Num::ONE;
        let column = self.matrix.times(&shares);
        let nu = self.multiplier(column[self.weights()], of_coils);
        let x = self.moved(&column, nu, left);
        // Not from the matrix: what it has lost shows in the members' gradients.
        let mut target = self.target.constant.clone();
        Num::add_scaled(&mut target, lambda, &self.target.slope);
        let moving = self.members.iter().map(|&i| (i, x[i]));
        let all = fixed.iter().copied().chain(moving);
        let residual = self.model.remainder(&target, Num::ZERO, all).0;
        let gradient = (0..self.model.count())
            .map(|i| Num::dot(self.model.filled(i), &residual) - nu * self.model.weight_of(i))
            .collect();
        Values {
            x,
            residual,
            gradient,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::homotopy::{Bounds, Follower, Trace};
    use fluxform_numerics::random::Random;

    /// Columns, bounds and targets of one problem.
    struct Case {
        model: Model,
        bounds: Bounds,
        offset: Option<Vec<Num>>,
        slope: Vec<Num>,
    }

    impl Case {
        fn path(&self, condition: Option<f64>) -> Trace {
            let follower = Follower {
                model: &self.model,
                bounds: &self.bounds,
                condition,
                start: None,
            };
            follower.path(self.offset.as_deref(), &self.slope)
        }

        /// Both ways give one path.
        fn assert_same(&self, what: &str) -> Trace {
            let (by_pivots, by_factors) = (self.path(Some(30.0)), self.path(None));
            assert!(by_pivots.pivots.is_some(), "{what}: {:e}", by_pivots.flaw);
            assert!(by_factors.complete && by_factors.pivots.is_none(), "{what}");
            let starts = by_factors.pieces.iter().chain(&by_pivots.pieces);
            for start in starts.map(|piece| piece.start) {
                for lambda in [start, start + Num::of(0.1) * start + Num::of(1e-3)] {
                    let at = |trace: &Trace| {
                        let later = trace.pieces.partition_point(|piece| piece.start <= lambda);
                        let piece = &trace.pieces[later.max(1) - 1];
                        [piece.x_at(lambda), piece.residual_at(lambda)].concat()
                    };
                    let size = Num::ONE + lambda;
                    for (a, b) in at(&by_pivots).iter().zip(&at(&by_factors)) {
                        let off = ((*a - *b).abs() / size).to_f64();
                        assert!(off < 1e-20, "{what} at {lambda:?}: {off:e}");
                    }
                }
            }
            by_pivots
        }
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
    }

    #[test]
    fn pivots_and_factorisations_give_one_path() {
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
            case.assert_same(&format!("round {round}"));
        }
    }

    /// A breakpoint costs a few pivots, each of which is half the square of the number of coils in
    /// operations, however many coils there are and however many events fall together.
    #[test]
    fn a_breakpoint_costs_a_few_pivots() {
        for side in [4, 8, 12] {
            let coils = side * side;
            let mut random = Random::new(side as u64);
            let uneven: Vec<f64> = (0..4 * coils).map(|_| random.between(0.2, 1.8)).collect();
            for slopes in [&[][..], &uneven] {
                let trace = array(side, slopes)
                    .summed(0.5 * coils as f64)
                    .path(Some(30.0));
                let (pieces, pivots) = (trace.pieces.len(), trace.pivots.unwrap());
                assert!(trace.complete);
                assert!(
                    pivots <= 2 * (coils + pieces),
                    "{coils}: {pieces}, {pivots}"
                );
            }
        }
    }

    #[test]
    fn a_pivot_and_its_reverse_restore_the_matrix() {
        let case = array(3, &[]);
        let mut matrix = Products::new(&case.model).0;
        let before = matrix.clone();
        for k in [4, 0, 7, 2] {
            matrix.pivot(k, true);
        }
        let inverse = |i: usize, j: usize| -matrix.at(i, j);
        // Of the swept block times the products' block: the identity.
        for i in [0, 2, 4, 7] {
            for j in [0, 2, 4, 7] {
                let sum = [0, 2, 4, 7]
                    .iter()
                    .fold(Num::ZERO, |sum, &k| sum + inverse(i, k) * before.at(k, j));
                let requested = if i == j { Num::ONE } else { Num::ZERO };
                assert!((sum - requested).abs().to_f64() < 1e-28);
            }
        }
        for k in [0, 2, 4, 7] {
            matrix.pivot(k, false);
        }
        for (a, b) in matrix.entries.iter().zip(&before.entries) {
            assert!((*a - *b).abs().to_f64() < 1e-28);
        }
    }
}
