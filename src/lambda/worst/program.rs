//! A linear program with one parameter, followed exactly from vertex to vertex.
//!
//! `min z_last` over `z = (x, z_last)` with rows `a . z >= constant + lambda slope`. At fixed
//! active rows z is linear in lambda; the dual simplex method replaces the row that is about to
//! be violated. Everything is done in double-double on a few hundred rows, so that what doubles
//! cannot tell apart is still told apart. Ties are decided by a second objective (among equally
//! good x those of the least weighted sum), then by the order of the rows (Bland's rule).

use crate::numerics::double_double::DoubleDouble as Num;
use crate::numerics::real::Real;

/// A row below its bound by less than this share of the bounds' size is met.
const MET: f64 = 1e-17;
/// The same where all bounds are zero.
const MET_AT_ZERO: f64 = 1e-26;
/// Rates of a slack up to this are none.
const STILL: f64 = 1e-18;
/// Multipliers, and pivots, that differ by less are equal, or none.
const EQUAL: f64 = 1e-22;
/// Exchanges after which the inverse is made anew.
const FRESH: usize = 16;

/// What a row's left-hand side is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// `x_i`.
    Rising(usize),
    /// `-x_i`.
    Falling(usize),
    /// The dense row of that number.
    Dense(usize),
}

/// The rows, and the second objective.
#[derive(Debug, Clone)]
pub(super) struct Program {
    /// Variables, the minimised one last.
    width: usize,
    kinds: Vec<Kind>,
    dense: Vec<Num>,
    constant: Vec<Num>,
    slope: Vec<Num>,
    /// Weights of the second objective; zero for the last variable.
    second: Vec<Num>,
    /// Sizes of the bounds: of constants that may be small beside the parameter's, and of slopes.
    size: [f64; 2],
}

/// A vertex that is optimal from `start` on, as far as the next piece.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub start: Num,
    pub z: Vec<Num>,
    pub rate: Vec<Num>,
    /// Active rows with their multipliers.
    pub active: Vec<(usize, Num)>,
}

impl Piece {
    /// The variables at `lambda`.
    pub fn at(&self, lambda: Num) -> Vec<Num> {
        let step = lambda - self.start;
        let pairs = self.z.iter().zip(&self.rate);
        pairs.map(|(&z, &rate)| z + step * rate).collect()
    }
}

/// How the following ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// The last piece has no end.
    Whole,
    /// No x satisfies the rows.
    Infeasible,
    /// The iteration limit was met.
    Stalled,
}

impl Program {
    /// A program without rows; `second` has one weight a variable but the last, `size` the
    /// largest constant and slope that its rows may have.
    pub fn new(second: Vec<Num>, size: [f64; 2]) -> Self {
        let mut second = second;
        second.push(Num::ZERO);
        Self {
            width: second.len(),
            kinds: Vec::new(),
            dense: Vec::new(),
            constant: Vec::new(),
            slope: Vec::new(),
            second,
            size,
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.kinds.len()
    }

    fn push(&mut self, kind: Kind, constant: Num, slope: Num) -> usize {
        self.kinds.push(kind);
        self.constant.push(constant);
        self.slope.push(slope);
        self.kinds.len() - 1
    }

    /// `x_i >= lower`.
    pub fn at_least(&mut self, i: usize, lower: Num) -> usize {
        self.push(Kind::Rising(i), lower, Num::ZERO)
    }

    /// `x_i <= upper`.
    pub fn at_most(&mut self, i: usize, upper: Num) -> usize {
        self.push(Kind::Falling(i), -upper, Num::ZERO)
    }

    /// `row . z >= constant + lambda slope`.
    pub fn dense(&mut self, row: &[Num], constant: Num, slope: Num) -> usize {
        let number = self.dense.len() / self.width;
        self.dense.extend_from_slice(row);
        self.push(Kind::Dense(number), constant, slope)
    }

    fn dense_row(&self, number: usize) -> &[Num] {
        &self.dense[number * self.width..(number + 1) * self.width]
    }

    /// Left-hand side of row `r`.
    fn times(&self, r: usize, z: &[Num]) -> Num {
        match self.kinds[r] {
            Kind::Rising(i) => z[i],
            Kind::Falling(i) => -z[i],
            Kind::Dense(number) => Num::dot(self.dense_row(number), z),
        }
    }

    fn coefficients(&self, r: usize) -> Vec<Num> {
        let mut row = vec![Num::ZERO; self.width];
        match self.kinds[r] {
            Kind::Rising(i) => row[i] = Num::ONE,
            Kind::Falling(i) => row[i] = -Num::ONE,
            Kind::Dense(number) => row.copy_from_slice(self.dense_row(number)),
        }
        row
    }

    /// Follows the minimiser from `lambda = 0` on. The rows of `basis` must be independent and
    /// their multipliers, the second objective's where those are zero, not negative.
    pub fn follow(&self, basis: &[usize]) -> (Vec<Piece>, End) {
        let mut pieces: Vec<Piece> = Vec::new();
        let Some(mut vertex) = Vertex::new(self, basis.to_vec()) else {
            return (pieces, End::Stalled);
        };
        let mut lambda = Num::ZERO;
        let mut exchanges_here = 0;
        let patience = 40 + 4 * self.width;
        let limit = 4000 + 60 * (self.width + self.rows());
        for _ in 0..limit {
            vertex.place(self);
            let cautious = exchanges_here > patience;
            let mut entering = self.violated(&vertex, lambda, cautious);
            if entering.is_none() {
                let piece = vertex.piece(lambda);
                let step = self.next_event(&vertex, lambda, &piece);
                // A piece of no length is none.
                if pieces.last().is_some_and(|last| last.start == lambda) {
                    pieces.pop();
                }
                pieces.push(piece);
                let Some((row, step)) = step else {
                    return (pieces, End::Whole);
                };
                if step > Num::ZERO {
                    lambda += step;
                    exchanges_here = 0;
                }
                entering = Some(row);
            }
            exchanges_here += 1;
            let Some(row) = entering else { break };
            match vertex.exchange(self, row, cautious) {
                Exchange::Done => {}
                Exchange::Impossible => return (pieces, End::Infeasible),
                Exchange::Singular => break,
            }
        }
        (pieces, End::Stalled)
    }

    /// A row that is not met, or will not be as lambda grows: the worst one, or the first.
    fn violated(&self, vertex: &Vertex, lambda: Num, first: bool) -> Option<usize> {
        let size = self.size[0] + lambda.to_f64() * self.size[1];
        let met = MET * size + MET_AT_ZERO;
        let z = vertex.at(lambda);
        // Those below their bound come first, then those that will be.
        let mut worst: Option<(usize, bool, f64)> = None;
        for r in 0..self.rows() {
            if vertex.active[r] {
                continue;
            }
            let slack = (self.times(r, &z) - self.constant[r] - lambda * self.slope[r]).to_f64();
            let found = if slack < -met {
                (r, true, slack)
            } else if slack <= met {
                let rate = (self.times(r, &vertex.rate) - self.slope[r]).to_f64();
                if rate >= -STILL {
                    continue;
                }
                (r, false, rate)
            } else {
                continue;
            };
            if first {
                return Some(r);
            }
            if worst.is_none_or(|(_, below, by)| (found.1 && !below) || (found.1 == below && found.2 < by)) {
                worst = Some(found);
            }
        }
        worst.map(|(r, _, _)| r)
    }

    /// The first row to be violated as lambda grows, and how far off.
    fn next_event(&self, vertex: &Vertex, lambda: Num, piece: &Piece) -> Option<(usize, Num)> {
        let mut first: Option<(usize, Num)> = None;
        for r in 0..self.rows() {
            if vertex.active[r] {
                continue;
            }
            let rate = self.times(r, &piece.rate) - self.slope[r];
            if rate.to_f64() >= -STILL {
                continue;
            }
            let slack = self.times(r, &piece.z) - self.constant[r] - lambda * self.slope[r];
            let step = slack.larger(Num::ZERO) / -rate;
            if first.is_none_or(|(_, least)| step < least) {
                first = Some((r, step));
            }
        }
        first
    }
}

enum Exchange {
    Done,
    /// No multiplier can give way: the rows contradict each other.
    Impossible,
    /// The active rows depend on each other within rounding.
    Singular,
}

/// The active rows and the inverse of their matrix, column by column.
struct Vertex {
    basis: Vec<usize>,
    active: Vec<bool>,
    inverse: Vec<Vec<Num>>,
    constant: Vec<Num>,
    rate: Vec<Num>,
    exchanges: usize,
}

impl Vertex {
    fn new(program: &Program, basis: Vec<usize>) -> Option<Self> {
        let mut active = vec![false; program.rows()];
        for &r in &basis {
            active[r] = true;
        }
        Some(Self {
            inverse: inverse(program, &basis)?,
            basis,
            active,
            constant: Vec::new(),
            rate: Vec::new(),
            exchanges: 0,
        })
    }

    /// `z = constant + lambda rate` from the active rows.
    fn place(&mut self, program: &Program) {
        let combine = |bounds: &[Num]| {
            let mut sum = vec![Num::ZERO; program.width];
            for (column, &r) in self.inverse.iter().zip(&self.basis) {
                if bounds[r] != Num::ZERO {
                    Num::add_scaled(&mut sum, bounds[r], column);
                }
            }
            sum
        };
        let (constant, rate) = (combine(&program.constant), combine(&program.slope));
        self.constant = constant;
        self.rate = rate;
    }

    fn at(&self, lambda: Num) -> Vec<Num> {
        let pairs = self.constant.iter().zip(&self.rate);
        pairs.map(|(&c, &rate)| c + lambda * rate).collect()
    }

    fn piece(&self, lambda: Num) -> Piece {
        let last = self.basis.len() - 1;
        Piece {
            start: lambda,
            z: self.at(lambda),
            rate: self.rate.clone(),
            active: self
                .basis
                .iter()
                .zip(&self.inverse)
                .map(|(&r, column)| (r, column[last].larger(Num::ZERO)))
                .collect(),
        }
    }

    /// Makes row `entering` active in place of the one whose multiplier vanishes first.
    fn exchange(&mut self, program: &Program, entering: usize, cautious: bool) -> Exchange {
        let row = program.coefficients(entering);
        let last = program.width - 1;
        let share: Vec<Num> = self.inverse.iter().map(|c| Num::dot(c, &row)).collect();
        let equal = Num::of(EQUAL);
        let mut leaving: Option<(usize, Num, Num)> = None;
        for (k, &part) in share.iter().enumerate() {
            if part <= equal {
                continue;
            }
            let column = &self.inverse[k];
            let first = column[last].larger(Num::ZERO) / part;
            let second = Num::dot(column, &program.second) / part;
            let better = match leaving {
                None => true,
                Some((l, least, least_second)) => {
                    let apart = first - least;
                    // Equal within what rounding leaves of either multiplier.
                    let grain = equal / part.smaller(share[l]).smaller(Num::ONE);
                    let apart_second = second - least_second;
                    if apart.abs() > grain {
                        apart < Num::ZERO
                    } else if !cautious && apart_second.abs() > grain {
                        apart_second < Num::ZERO
                    } else if cautious {
                        self.basis[k] < self.basis[l]
                    } else {
                        part > share[l]
                    }
                }
            };
            if better {
                leaving = Some((k, first, second));
            }
        }
        let Some((k, _, _)) = leaving else {
            return Exchange::Impossible;
        };
        let pivot = share[k];
        self.active[self.basis[k]] = false;
        self.active[entering] = true;
        self.basis[k] = entering;
        self.exchanges += 1;
        if self.exchanges % FRESH == 0 || pivot.to_f64() < 1e-4 {
            let Some(fresh) = inverse(program, &self.basis) else {
                return Exchange::Singular;
            };
            self.inverse = fresh;
            return Exchange::Done;
        }
        let mut column = std::mem::take(&mut self.inverse[k]);
        for value in &mut column {
            *value = *value / pivot;
        }
        for (l, other) in self.inverse.iter_mut().enumerate() {
            if l != k && share[l] != Num::ZERO {
                Num::add_scaled(other, -share[l], &column);
            }
        }
        self.inverse[k] = column;
        Exchange::Done
    }
}

/// Columns of the inverse of the matrix whose rows are the program's rows of `basis`, by Gauss
/// and Jordan with row pivoting; `None` where they depend on each other.
fn inverse(program: &Program, basis: &[usize]) -> Option<Vec<Vec<Num>>> {
    let n = basis.len();
    // Transposed: every column of the inverse solves one system with these rows as columns, so
    // elimination runs over the rows of [M | 1] and ends with [1 | M^-1].
    let mut left: Vec<Vec<Num>> = basis.iter().map(|&r| program.coefficients(r)).collect();
    let mut right: Vec<Vec<Num>> = (0..n)
        .map(|k| {
            let mut unit = vec![Num::ZERO; n];
            unit[k] = Num::ONE;
            unit
        })
        .collect();
    for k in 0..n {
        let best = (k..n).reduce(|a, b| if left[b][k].abs() > left[a][k].abs() { b } else { a })?;
        left.swap(k, best);
        right.swap(k, best);
        let pivot = left[k][k];
        if pivot.abs().to_f64() <= 1e-29 {
            return None;
        }
        for value in left[k][k..].iter_mut().chain(&mut right[k]) {
            *value = *value / pivot;
        }
        let (row, unit) = (left[k].clone(), right[k].clone());
        for l in (0..n).filter(|&l| l != k) {
            let factor = left[l][k];
            if factor != Num::ZERO {
                Num::add_scaled(&mut left[l][k..], -factor, &row[k..]);
                Num::add_scaled(&mut right[l], -factor, &unit);
            }
        }
    }
    Some(
        (0..n)
            .map(|k| right.iter().map(|row| row[k]).collect())
            .collect(),
    )
}
