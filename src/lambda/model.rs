//! Least squares over scaled currents: columns, their factorisation, an optional sum row.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;
use rayon::prelude::*;

/// Columns `a_i` of one least-squares problem and the weights of its equality
/// `sum w_i x_i = total` (a limit on the sum enters as an equality with a slack
/// variable, whose column is zero).
#[derive(Debug, Clone)]
pub(super) struct Model {
    /// Length of a column.
    pub rows: usize,
    columns: Vec<Num>,
    /// Entries of each column up to its last that is not zero.
    filled: Vec<usize>,
    /// Euclidean norms of the columns.
    pub norm: Vec<Num>,
    /// Positive weights of the equality, if there is one.
    pub weight: Option<Vec<Num>>,
    /// Relative error of the columns themselves.
    pub epsilon: f64,
}

/// A column whose part outside the span of the others is below this share depends on them:
/// exact copies leave 1e-31, and no two different columns of doubles come near it.
const DEPENDENT: f64 = 1e-25;
/// The same in units of the rounding that nearly dependent columns amplify.
const DEPENDENT_ROUNDINGS: f64 = 1e3;

/// Share of a column outside the span of others, themselves independent by `independence`, up to which it
/// depends on them.
pub(super) fn least_share(independence: f64) -> f64 {
    DEPENDENT.max(DEPENDENT_ROUNDINGS * Num::EPSILON / independence)
}

impl Model {
    /// Columns stored one after another, `rows` entries each.
    pub fn new(rows: usize, columns: Vec<Num>, weight: Option<Vec<Num>>, epsilon: f64) -> Self {
        let norm = columns
            .chunks_exact(rows)
            .map(|c| Num::dot(c, c).sqrt())
            .collect();
        let last = |c: &[Num]| c.iter().rposition(|&v| v != Num::ZERO);
        let filled = (columns.chunks_exact(rows))
            .map(|c| last(c).map_or(0, |last| last + 1))
            .collect();
        Self {
            rows,
            columns,
            filled,
            norm,
            weight,
            epsilon,
        }
    }

    /// Number of variables.
    pub fn count(&self) -> usize {
        self.norm.len()
    }

    /// Column `i`.
    pub fn column(&self, i: usize) -> &[Num] {
        &self.columns[i * self.rows..(i + 1) * self.rows]
    }

    /// Column `i` without the zeros at its end.
    pub fn filled(&self, i: usize) -> &[Num] {
        &self.column(i)[..self.filled[i]]
    }

    /// Weight of variable `i` in the equality, 0 without one.
    pub(crate) fn weight_of(&self, i: usize) -> Num {
        self.weight.as_ref().map_or(Num::ZERO, |w| w[i])
    }

    /// `target - sum a_i x_i` over the listed variables, and what they leave of `total`.
    pub fn remainder(
        &self,
        target: &[Num],
        total: Num,
        fixed: impl Iterator<Item = (usize, Num)>,
    ) -> (Vec<Num>, Num) {
        let (mut rest, mut left) = (target.to_vec(), total);
        for (i, x) in fixed {
            if x != Num::ZERO {
                Num::add_scaled(&mut rest, -x, self.filled(i));
                left -= self.weight_of(i) * x;
            }
        }
        (rest, left)
    }
}

/// `A = QR` of chosen columns with the equality eliminated: the pivot is the chosen variable of the
/// smallest column per weight, so that the reduced columns `a_j - (w_j / w_p) a_p` never grow beyond
/// twice the originals. Q is kept whole, so that a column comes by one reflection and goes by rotations:
/// the square of the rows in operations; another pivot takes all columns again, the cube.
#[derive(Debug, Clone)]
pub(super) struct Factor {
    rows: usize,
    pivot: Option<usize>,
    /// Variables in the order of their columns, the pivot not among them.
    members: Vec<usize>,
    /// Variables that were tried and depend on the members.
    dependent: Vec<usize>,
    /// The columns of Q, `rows` entries each.
    orthogonal: Vec<Num>,
    /// The columns of R, `rows` entries each.
    triangle: Vec<Num>,
}

/// `1 - v v' scale` on what follows the first rows.
pub(super) struct Reflection {
    vector: Vec<Num>,
    scale: Num,
}

impl Reflection {
    /// The one that leaves the first entry alone, and that entry.
    pub fn onto_first(mut vector: Vec<Num>) -> (Self, Num) {
        let length = Num::dot(&vector, &vector).sqrt();
        let first = if vector[0] > Num::ZERO {
            -length
        } else {
            length
        };
        vector[0] -= first;
        let scale = -(Num::ONE / (first * vector[0]));
        (Self { vector, scale }, first)
    }

    pub fn apply(&self, to: &mut [Num]) {
        let factor = -(self.scale * Num::dot(&self.vector, to));
        Num::add_scaled(to, factor, &self.vector);
    }

    /// The same of every row of a matrix whose columns have `rows` entries.
    fn turn_columns(&self, columns: &mut [Num], rows: usize) {
        let mut along = vec![Num::ZERO; rows];
        for (column, &v) in columns.chunks_exact(rows).zip(&self.vector) {
            Num::add_scaled(&mut along, v, column);
        }
        for (column, &v) in columns.chunks_exact_mut(rows).zip(&self.vector) {
            Num::add_scaled(column, -(self.scale * v), &along);
        }
    }
}

/// Operations from which two threads are quicker than one.
const WORTH_THREADS: usize = 1 << 16;

/// A number of each of `count`, each of so many operations.
fn of_each(
    count: usize,
    operations: usize,
    number: impl Fn(usize) -> Num + Send + Sync,
) -> Vec<Num> {
    if count * operations < WORTH_THREADS {
        return (0..count).map(number).collect();
    }
    let least = WORTH_THREADS / 4 / operations.max(1);
    let numbers = (0..count).into_par_iter().with_min_len(least);
    numbers.map(number).collect()
}

/// The minimiser over the members of a factor.
pub(super) struct Minimiser {
    /// One entry a variable; zero where not a member.
    pub x: Vec<Num>,
    /// Target minus fit.
    pub residual: Vec<Num>,
}

impl Factor {
    /// Factorises the listed variables in order, leaving out those that depend on earlier ones.
    pub fn new(model: &Model, variables: &[usize]) -> Self {
        let rows = model.rows;
        let mut orthogonal = vec![Num::ZERO; rows * rows];
        orthogonal
            .iter_mut()
            .step_by(rows + 1)
            .for_each(|v| *v = Num::ONE);
        let mut factor = Self {
            rows,
            pivot: Self::pivot_of(model, variables),
            members: Vec::with_capacity(variables.len()),
            dependent: Vec::new(),
            orthogonal,
            triangle: Vec::new(),
        };
        factor.try_each(model, variables, 0);
        factor
    }

    /// Becomes the factor of `variables`: members that are not among them leave, the others are tried in
    /// order.
    pub fn change_to(&mut self, model: &Model, variables: &[usize]) {
        if self.pivot != Self::pivot_of(model, variables) {
            *self = Self::new(model, variables);
            return;
        }
        let mut listed = vec![false; model.count()];
        variables.iter().for_each(|&i| listed[i] = true);
        let mut removed = 0;
        for place in (0..self.members.len()).rev() {
            if !listed[self.members[place]] {
                self.remove(place);
                removed += 1;
            }
        }
        self.members.iter().for_each(|&i| listed[i] = false);
        let others: Vec<usize> = variables.iter().copied().filter(|&i| listed[i]).collect();
        self.try_each(model, &others, removed);
    }

    /// Adds what is independent. Those that depended before `removed` members went lie in the span that these
    /// completed: only what has a part along the directions that they left may complete it again.
    fn try_each(&mut self, model: &Model, variables: &[usize], removed: usize) {
        let rows = self.rows;
        let mut in_span = vec![false; model.count()];
        self.dependent.drain(..).for_each(|i| in_span[i] = true);
        let mut left = self.orthogonal[self.members.len() * rows..][..removed * rows].to_vec();
        for &i in variables {
            fluxform_base::progress::poll();
            let along = in_span[i].then(|| self.part_along(model, i, &left));
            if along.as_ref().is_none_or(Option::is_some) && self.push(model, i) {
                // What others have along it is no longer outside.
                if let Some((reflection, _)) = along.flatten().map(Reflection::onto_first) {
                    reflection.turn_columns(&mut left, rows);
                    left.drain(..rows);
                }
            } else if self.pivot != Some(i) {
                self.dependent.push(i);
            }
        }
    }

    /// The part of a variable's column along some directions; `None` where it is rounding.
    fn part_along(&self, model: &Model, variable: usize, directions: &[Num]) -> Option<Vec<Num>> {
        let column = self.reduced(model, variable);
        let part: Vec<Num> = (directions.chunks_exact(self.rows))
            .map(|direction| Num::dot(direction, &column))
            .collect();
        let least = model.norm[variable] * Num::of(least_share(self.independence(model)));
        (Num::dot(&part, &part).sqrt() > least).then_some(part)
    }

    /// A variable's column with the equality eliminated, without zeros at its end.
    fn reduced(&self, model: &Model, variable: usize) -> Vec<Num> {
        let mut column = model.filled(variable).to_vec();
        if let Some(p) = self.pivot {
            column.resize(self.rows, Num::ZERO);
            let share = model.weight_of(variable) / model.weight_of(p);
            Num::add_scaled(&mut column, -share, model.column(p));
        }
        column
    }

    /// The variable of the smallest column per weight, with an equality.
    pub fn pivot_of(model: &Model, variables: &[usize]) -> Option<usize> {
        model.weight.as_ref().and_then(|w| {
            let per_weight = |i: usize| model.norm[i] / w[i];
            variables
                .iter()
                .copied()
                .reduce(|p, i| if per_weight(i) < per_weight(p) { i } else { p })
        })
    }

    /// Adds `variable` to a factor of `before`; false if it depends on them.
    pub fn add(&mut self, model: &Model, before: &[usize], variable: usize) -> bool {
        let changes_pivot = match (self.pivot, &model.weight) {
            (Some(p), Some(w)) => model.norm[variable] * w[p] < model.norm[p] * w[variable],
            (None, Some(_)) => true,
            _ => false,
        };
        if !changes_pivot {
            return self.push(model, variable);
        }
        let all: Vec<usize> = before.iter().copied().chain([variable]).collect();
        let grown = Self::new(model, &all);
        let grows = grown.rank() > self.rank();
        if grows {
            *self = grown;
        }
        grows
    }

    /// Number of variables that may move: the members and the pivot.
    pub fn rank(&self) -> usize {
        self.members.len() + usize::from(self.pivot.is_some())
    }

    /// Whether `variable` may move.
    pub fn contains(&self, variable: usize) -> bool {
        self.pivot == Some(variable) || self.members.contains(&variable)
    }

    /// Variables in the order of their columns, the pivot not among them.
    pub fn members(&self) -> &[usize] {
        &self.members
    }

    /// The variable by which the equality is eliminated.
    pub fn pivot(&self) -> Option<usize> {
        self.pivot
    }

    /// Smallest share of a member's column that lies outside the span of those before it.
    pub fn independence(&self, model: &Model) -> f64 {
        let shares = self
            .members
            .iter()
            .enumerate()
            .map(|(k, &i)| (self.triangle[k * self.rows + k].abs() / model.norm[i]).to_f64());
        shares.fold(1.0, f64::min)
    }

    /// Adds a column by a reflection; false where it depends on those before.
    fn push(&mut self, model: &Model, variable: usize) -> bool {
        let (rows, rank) = (self.rows, self.members.len());
        if self.pivot == Some(variable) || rank == rows {
            return false;
        }
        let mut column = self.turn(&self.reduced(model, variable));
        let rest = column.split_off(rank);
        let outside = Num::dot(&rest, &rest).sqrt();
        if outside <= model.norm[variable] * Num::of(least_share(self.independence(model))) {
            return false;
        }
        let (reflection, diagonal) = Reflection::onto_first(rest);
        reflection.turn_columns(&mut self.orthogonal[rank * rows..], rows);
        column.push(diagonal);
        column.resize(rows, Num::ZERO);
        self.triangle.extend(column);
        self.members.push(variable);
        true
    }

    /// Takes the member in this place out, and turns what its column leaves below the diagonal.
    fn remove(&mut self, place: usize) {
        let rows = self.rows;
        self.members.remove(place);
        self.triangle.drain(place * rows..(place + 1) * rows);
        for k in place..self.members.len() {
            fluxform_base::progress::poll();
            let (a, b) = (self.triangle[k * rows + k], self.triangle[k * rows + k + 1]);
            let length = (a * a + b * b).sqrt();
            let (cos, sin) = (a / length, b / length);
            for column in self.triangle[k * rows..].chunks_exact_mut(rows) {
                let (a, b) = (column[k], column[k + 1]);
                column[k] = cos * a + sin * b;
                column[k + 1] = cos * b - sin * a;
            }
            self.triangle[k * rows + k + 1] = Num::ZERO;
            let (low, high) = self.orthogonal.split_at_mut((k + 1) * rows);
            for (a, b) in low[k * rows..].iter_mut().zip(&mut high[..rows]) {
                (*a, *b) = (cos * *a + sin * *b, cos * *b - sin * *a);
            }
        }
    }

    /// Q' times a vector whose last entries may be left out where they are zero.
    fn turn(&self, vector: &[Num]) -> Vec<Num> {
        let product =
            |k: usize| Num::dot(&self.orthogonal[k * self.rows..][..vector.len()], vector);
        of_each(self.rows, self.rows, product)
    }

    /// Minimises `|target - sum a_i x_i|` over the members with `sum w_i x_i = total`.
    pub fn solve(&self, model: &Model, target: &[Num], total: Num) -> Minimiser {
        let rank = self.members.len();
        let mut rest = target.to_vec();
        if let Some(p) = self.pivot {
            Num::add_scaled(&mut rest, -(total / model.weight_of(p)), model.column(p));
        }
        let mut rest = self.turn(&rest);
        let mut x = vec![Num::ZERO; model.count()];
        let mut left = total;
        for k in (0..rank).rev() {
            let column = &self.triangle[k * self.rows..(k + 1) * self.rows];
            let value = rest[k] / column[k];
            Num::add_scaled(&mut rest[..k], -value, &column[..k]);
            x[self.members[k]] = value;
            left -= model.weight_of(self.members[k]) * value;
        }
        if let Some(p) = self.pivot {
            x[p] = left / model.weight_of(p);
        }
        // The residual is what no member reaches, turned back: no cancellation.
        let mut residual = vec![Num::ZERO; self.rows];
        let behind = self.orthogonal.chunks_exact(self.rows).zip(&rest);
        for (q, &value) in behind.skip(rank) {
            Num::add_scaled(&mut residual, value, q);
        }
        Minimiser { x, residual }
    }

    /// An orthonormal basis of the members' columns (reduced ones, with an equality).
    pub fn orthonormal(&self) -> Vec<Vec<Num>> {
        let columns = self.orthogonal.chunks_exact(self.rows);
        columns
            .take(self.members.len())
            .map(<[Num]>::to_vec)
            .collect()
    }

    /// Reduced gradients `a_i'r - nu w_i` of every variable; zero for the members.
    pub fn gradient(&self, model: &Model, residual: &[Num]) -> Vec<Num> {
        let nu = self.pivot.map_or(Num::ZERO, |p| {
            Num::dot(model.column(p), residual) / model.weight_of(p)
        });
        let mut gradient = of_each(model.count(), self.rows, |i| {
            Num::dot(model.filled(i), residual) - nu * model.weight_of(i)
        });
        for &i in self.members.iter().chain(&self.pivot) {
            gradient[i] = Num::ZERO;
        }
        gradient
    }
}
