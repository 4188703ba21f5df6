//! Least squares over scaled currents: columns, an optional sum row, and steps of their factorisation.

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

    /// `target - sum a_i x_i` over the listed variables.
    pub fn remainder(&self, target: &[Num], x: impl Iterator<Item = (usize, Num)>) -> Vec<Num> {
        let mut rest = target.to_vec();
        subtract(&mut rest, x, |i| self.filled(i));
        rest
    }
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
}

/// Operations from which two threads are quicker than one.
pub(super) const WORTH_THREADS: usize = 1 << 16;

/// A number of each of `count`, each of so many operations.
pub(super) fn of_each(
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

/// Entries of one portion of a difference.
const PORTION: usize = 128;

/// Subtracts multiples of columns from a vector.
pub(super) fn subtract<'c>(
    from: &mut [Num],
    multiples: impl Iterator<Item = (usize, Num)>,
    column: impl Fn(usize) -> &'c [Num] + Sync,
) {
    let multiples: Vec<(usize, Num)> = multiples.filter(|(_, x)| *x != Num::ZERO).collect();
    let subtract = |part: &mut [Num], first: usize| {
        for &(i, x) in &multiples {
            Num::add_scaled(part, -x, column(i).get(first..).unwrap_or_default());
        }
    };
    if multiples.len() * from.len() < WORTH_THREADS {
        subtract(from, 0);
    } else {
        (from.par_chunks_mut(PORTION).enumerate())
            .for_each(|(k, part)| subtract(part, k * PORTION));
    }
}
