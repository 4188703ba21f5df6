//! Least squares over scaled currents: columns, their factorisation, an optional sum row.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

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

/// Householder factorisation of chosen columns with the equality eliminated: the pivot
/// is the chosen variable of the smallest column per weight, so that the reduced columns
/// `a_j - (w_j / w_p) a_p` never grow beyond twice the originals.
#[derive(Debug, Clone)]
pub(super) struct Factor {
    rows: usize,
    pivot: Option<usize>,
    /// Variables in the order of their columns, the pivot not among them.
    members: Vec<usize>,
    /// Householder vectors, `rows` entries each.
    reflectors: Vec<Num>,
    scales: Vec<Num>,
    /// Columns of the triangle, `rows` entries each.
    triangle: Vec<Num>,
    /// Smallest share of a member's column that lies outside the span of those before it.
    independence: f64,
    /// The same of every member and those before it.
    independences: Vec<f64>,
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
        let mut factor = Self {
            rows: model.rows,
            pivot: Self::pivot_of(model, variables),
            members: Vec::with_capacity(variables.len()),
            reflectors: Vec::new(),
            scales: Vec::new(),
            triangle: Vec::new(),
            independence: 1.0,
            independences: Vec::new(),
        };
        for &i in variables {
            factor.push(model, i);
        }
        factor
    }

    /// Becomes the factor of `variables`: what this one has of them in the same order, up to the
    /// first difference, is not factorised again.
    pub fn change_to(&mut self, model: &Model, variables: &[usize]) {
        if self.pivot != Self::pivot_of(model, variables) {
            *self = Self::new(model, variables);
            return;
        }
        // Variables that this factor left out are tried again where they differ.
        let mut members = self.members.iter().peekable();
        let mut shared = 0;
        for &i in variables {
            if Some(i) == self.pivot {
                continue;
            }
            if members.next_if_eq(&&i).is_none() {
                break;
            }
            shared += 1;
        }
        self.truncate(shared);
        let is_new = |i: &&usize| !self.members.contains(i);
        for i in variables.iter().filter(is_new).copied().collect::<Vec<_>>() {
            self.push(model, i);
        }
    }

    /// Leaves the first `rank` members.
    fn truncate(&mut self, rank: usize) {
        self.members.truncate(rank);
        self.scales.truncate(rank);
        self.independences.truncate(rank);
        self.reflectors.truncate(rank * self.rows);
        self.triangle.truncate(rank * self.rows);
        self.independence = self.independences.last().copied().unwrap_or(1.0);
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

    /// Adds `variable` to a factor of `before`; `None` if it depends on them.
    pub fn with(&self, model: &Model, before: &[usize], variable: usize) -> Option<Self> {
        let changes_pivot = match (self.pivot, &model.weight) {
            (Some(p), Some(w)) => model.norm[variable] * w[p] < model.norm[p] * w[variable],
            (None, Some(_)) => true,
            _ => false,
        };
        let grown = if changes_pivot {
            let all: Vec<usize> = before.iter().copied().chain([variable]).collect();
            Self::new(model, &all)
        } else {
            let mut grown = self.clone();
            grown.push(model, variable);
            grown
        };
        (grown.rank() > self.rank()).then_some(grown)
    }

    /// Takes the listed variables by the part of their columns that lies outside the span
    /// of those taken, largest share first, as long as it is above `share`.
    pub(crate) fn pivoted(model: &Model, variables: &[usize], share: f64) -> Self {
        let mut taken = Vec::new();
        let mut factor = Self::new(model, &taken);
        // Every column times Q', of which all but the first rows lie outside the span.
        let mut turned: Vec<(usize, Vec<Num>)> = variables
            .iter()
            .filter(|&&i| model.norm[i] > Num::ZERO)
            .map(|&i| (i, model.column(i).to_vec()))
            .collect();
        // Each turn takes one more of them.
        for _ in 0..variables.len() {
            fluxform_base::progress::poll();
            let rank = factor.members.len();
            let outside = |(i, column): &(usize, Vec<Num>)| {
                let rest = &column[rank..];
                (Num::dot(rest, rest).sqrt() / model.norm[*i]).to_f64()
            };
            let best = turned
                .iter()
                .map(|column| (column.0, outside(column)))
                .reduce(|a, b| if b.1 > a.1 { b } else { a });
            let grown = match best {
                Some((i, part)) if part > share => {
                    let grown = factor.with(model, &taken, i);
                    taken.push(i);
                    grown
                }
                _ => None,
            };
            let Some(grown) = grown else {
                break;
            };
            let same_pivot = grown.pivot == factor.pivot;
            factor = grown;
            turned.retain(|(i, _)| !factor.contains(*i));
            for (i, column) in &mut turned {
                if same_pivot {
                    factor.reflect_by(rank, column);
                } else {
                    column.copy_from_slice(model.column(*i));
                    factor.reflect(column);
                }
            }
        }
        factor
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
    pub fn independence(&self) -> f64 {
        self.independence
    }

    fn push(&mut self, model: &Model, variable: usize) {
        let (rows, rank) = (self.rows, self.members.len());
        if self.pivot == Some(variable) || rank == rows {
            return;
        }
        let mut column = model.column(variable).to_vec();
        if let Some(p) = self.pivot {
            Num::add_scaled(
                &mut column,
                -(model.weight_of(variable) / model.weight_of(p)),
                model.column(p),
            );
        }
        self.reflect(&mut column);
        let outside = Num::dot(&column[rank..], &column[rank..]).sqrt();
        let least = DEPENDENT.max(DEPENDENT_ROUNDINGS * Num::EPSILON / self.independence);
        if outside <= model.norm[variable] * Num::of(least) {
            return;
        }
        self.independence = self
            .independence
            .min((outside / model.norm[variable]).to_f64());
        let diagonal = if column[rank] > Num::ZERO {
            -outside
        } else {
            outside
        };
        let mut reflector = column.clone();
        reflector[..rank].fill(Num::ZERO);
        reflector[rank] -= diagonal;
        self.scales.push(-(Num::ONE / (diagonal * reflector[rank])));
        self.reflectors.extend(reflector);
        column[rank] = diagonal;
        self.triangle.extend(column);
        self.independences.push(self.independence);
        self.members.push(variable);
    }

    fn reflect_by(&self, k: usize, vector: &mut [Num]) {
        let reflector = &self.reflectors[k * self.rows + k..(k + 1) * self.rows];
        let factor = -(self.scales[k] * Num::dot(reflector, &vector[k..]));
        Num::add_scaled(&mut vector[k..], factor, reflector);
    }

    /// Multiplies by Q'.
    fn reflect(&self, vector: &mut [Num]) {
        for k in 0..self.members.len() {
            self.reflect_by(k, vector);
        }
    }

    /// Minimises `|target - sum a_i x_i|` over the members with `sum w_i x_i = total`.
    pub fn solve(&self, model: &Model, target: &[Num], total: Num) -> Minimiser {
        let rank = self.members.len();
        let mut rest = target.to_vec();
        if let Some(p) = self.pivot {
            Num::add_scaled(&mut rest, -(total / model.weight_of(p)), model.column(p));
        }
        self.reflect(&mut rest);
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
        rest[..rank].fill(Num::ZERO);
        for k in (0..rank).rev() {
            self.reflect_by(k, &mut rest);
        }
        Minimiser { x, residual: rest }
    }

    /// An orthonormal basis of the members' columns (reduced ones, with an equality).
    pub fn orthonormal(&self) -> Vec<Vec<Num>> {
        let rank = self.members.len();
        (0..rank)
            .map(|k| {
                let mut vector = vec![Num::ZERO; self.rows];
                vector[k] = Num::ONE;
                for l in (0..rank).rev() {
                    self.reflect_by(l, &mut vector);
                }
                vector
            })
            .collect()
    }

    /// Reduced gradients `a_i'r - nu w_i` of every variable; zero for the members.
    pub fn gradient(&self, model: &Model, residual: &[Num]) -> Vec<Num> {
        let nu = self.pivot.map_or(Num::ZERO, |p| {
            Num::dot(model.column(p), residual) / model.weight_of(p)
        });
        let mut gradient: Vec<Num> = (0..model.count())
            .map(|i| Num::dot(model.filled(i), residual) - nu * model.weight_of(i))
            .collect();
        for &i in self.members.iter().chain(&self.pivot) {
            gradient[i] = Num::ZERO;
        }
        gradient
    }
}
