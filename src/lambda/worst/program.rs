//! A linear program with one parameter, followed exactly from vertex to vertex.
//!
//! `min z_last` over `z = (x, z_last)` with rows `a . z >= constant + lambda slope`. At fixed
//! active rows z is linear in lambda; the dual simplex method replaces the row that is about to
//! be violated. Everything is done in double-double on a few hundred rows, so that nearly
//! dependent rows cost no digits. Ties are decided by a second objective (among equally
//! good x those of the least weighted sum), then by the order of the rows (Bland's rule).

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

/// A row below its bound by less than this share of the bounds' size is met: rows of doubles
/// that ought to be equal differ by about as much, and as active rows would be nearly dependent.
const MET: f64 = 2e-15;
/// The same where all bounds are zero.
const MET_AT_ZERO: f64 = 1e-26;
/// Rates of a slack up to this are none, for the same reason.
const STILL: f64 = 1e-14;
/// Multipliers, and pivots, that differ by less are equal, or none.
const EQUAL: f64 = 1e-22;
/// Pivots that are taken where a smaller one leaves rows that depend on each other.
const SOUND: f64 = 1e-12;
/// Entries of an inverse above this size amplify rounding.
const STEEP: f64 = 1e4;
/// Rows that are requested before a step, at most: where one more ends it, the step is taken back.
const TWINS: usize = 4;
/// Exchanges after which the inverse is recomputed.
const FRESH: usize = 16;

/// Kinds of a row's left-hand side.
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
    /// The same in doubles.
    rough: Vec<f64>,
    constant: Vec<Num>,
    slope: Vec<Num>,
    /// Weights of the second objective; zero for the last variable.
    second: Vec<Num>,
    /// Sizes of the bounds: of constants that may be small beside the parameter's, and of slopes.
    size: [f64; 2],
    /// A row below its bound by less than this share of the bounds' size is met.
    met: f64,
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

/// How the following ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// The last piece has no end.
    Whole,
    /// No x satisfies the rows.
    Infeasible,
    /// The iteration limit was met.
    Stalled,
    /// The work that was allowed is done.
    Costly,
}

/// Work that a path may still take, in entries of an inverse that are changed: a measure of time
/// that does not depend on the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Work(pub usize);

impl Work {
    /// Takes as much; false where that is more than is left.
    pub fn take(&mut self, entries: usize) -> bool {
        let enough = self.0 >= entries;
        self.0 = self.0.saturating_sub(entries);
        enough
    }
}

impl Program {
    /// A program without rows; `second` has one weight a variable but the last, `size` the
    /// largest constant and slope that its rows may have, `leeway` the share of them by which rows
    /// may be missed.
    pub fn new(second: Vec<Num>, size: [f64; 2], leeway: f64) -> Self {
        let mut second = second;
        second.push(Num::ZERO);
        Self {
            width: second.len(),
            kinds: Vec::new(),
            dense: Vec::new(),
            rough: Vec::new(),
            constant: Vec::new(),
            slope: Vec::new(),
            second,
            size,
            met: MET.max(leeway),
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
        self.rough.extend(row.iter().map(|v| v.to_f64()));
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

    /// Sizes of the bounds: of constants, and of slopes.
    pub fn size(&self) -> [f64; 2] {
        self.size
    }

    /// Constant and slope of the bound of row `r`.
    pub fn bound(&self, r: usize) -> (Num, Num) {
        (self.constant[r], self.slope[r])
    }

    /// Left-hand side of row `r` in doubles.
    pub fn rough_times(&self, r: usize, z: &[f64]) -> f64 {
        match self.kinds[r] {
            Kind::Rising(i) => z[i],
            Kind::Falling(i) => -z[i],
            Kind::Dense(number) => f64::dot(
                &self.rough[number * self.width..(number + 1) * self.width],
                z,
            ),
        }
    }

    /// Left-hand side of row `r`, one coefficient a variable.
    pub fn coefficients(&self, r: usize) -> Vec<Num> {
        let mut row = vec![Num::ZERO; self.width];
        match self.kinds[r] {
            Kind::Rising(i) => row[i] = Num::ONE,
            Kind::Falling(i) => row[i] = -Num::ONE,
            Kind::Dense(number) => row.copy_from_slice(self.dense_row(number)),
        }
        row
    }

    /// Follows the minimiser from `lambda = 0` on. The rows of `basis` must be independent and
    /// their multipliers, the second objective's where those are zero, not negative. Before the
    /// minimiser moves on, `ask` is given its position, its rate, and the step to the next turn
    /// if there is one; it adds a row that seems to end the step earlier, or returns false: that
    /// costs `ask_work`.
    pub fn follow(
        &mut self,
        basis: &[usize],
        work: &mut Work,
        ask_work: usize,
        mut ask: impl FnMut(&mut Self, &Stand) -> bool,
    ) -> (Vec<Piece>, End) {
        let mut pieces: Vec<Piece> = Vec::new();
        let Some(mut vertex) = Vertex::new(self, basis.to_vec()) else {
            return (pieces, End::Stalled);
        };
        let mut lambda = Num::ZERO;
        let mut exchanges_here = 0;
        let mut hasty: Option<Hasty> = None;
        let patience = 40 + 4 * self.width;
        // Far more than there are turns: it ends what rounding keeps going in circles.
        let limit = 20_000 + 1000 * self.width;
        let entries = self.width * self.width;
        // Turning at one lambda never takes more than a part of the work that is left.
        let standing = (50 * patience).min(work.0 / (4 * entries));
        for _ in 0..limit {
            fluxform_base::progress::poll();
            vertex.place(self, lambda);
            let cautious = exchanges_here > patience;
            let (mut entering, next, asked) =
                self.look_further(&mut vertex, lambda, cautious, &mut ask);
            if !work.take(entries + asked * ask_work) {
                return (pieces, End::Costly);
            }
            // A row that the last step did not know and that is violated where it led ended it
            // earlier.
            if let Some(before) = hasty.take_if(|h| entering.is_some_and(|row| row >= h.rows)) {
                (vertex, lambda) = (before.vertex, before.lambda);
                exchanges_here = before.exchanges_here;
                while pieces.last().is_some_and(|last| last.start > lambda) {
                    pieces.pop();
                }
                vertex.active.resize(self.rows(), false);
                continue;
            }
            if entering.is_none() {
                let piece = vertex.piece(lambda);
                // A piece of no length is none.
                if pieces.last().is_some_and(|last| last.start == lambda) {
                    pieces.pop();
                }
                pieces.push(piece);
                let Some((row, step)) = next else {
                    return (pieces, End::Whole);
                };
                if step > Num::ZERO {
                    hasty = (asked >= TWINS).then(|| Hasty {
                        vertex: vertex.clone(),
                        lambda,
                        exchanges_here,
                        rows: self.rows(),
                    });
                    lambda += step;
                    exchanges_here = 0;
                }
                entering = Some(row);
            }
            exchanges_here += 1;
            if exchanges_here > standing {
                break;
            }
            let Some(row) = entering else { break };
            match vertex.exchange(self, row, cautious) {
                Exchange::Done => {}
                Exchange::Impossible => return (pieces, End::Infeasible),
                Exchange::Singular => break,
            }
        }
        (pieces, End::Stalled)
    }

    /// As [`Self::look`], with the rows that `ask` adds; and how many it added.
    ///
    /// A row may turn out not to end the step, a twin of an active one: then another may. A step
    /// without end is never taken before the last of them.
    fn look_further(
        &mut self,
        vertex: &mut Vertex,
        lambda: Num,
        cautious: bool,
        ask: &mut impl FnMut(&mut Self, &Stand) -> bool,
    ) -> (Option<usize>, Option<(usize, Num)>, usize) {
        let (mut entering, mut next) = self.look(vertex, lambda, cautious);
        let mut asked = 0;
        while entering.is_none() && (asked < TWINS || next.is_none()) {
            fluxform_base::progress::poll();
            let stand = Stand {
                lambda,
                z: &vertex.z,
                rate: &vertex.rate,
                step: next.map(|(_, step)| step),
            };
            if !ask(self, &stand) {
                break;
            }
            asked += 1;
            vertex.active.resize(self.rows(), false);
            (entering, next) = self.look(vertex, lambda, cautious);
        }
        (entering, next, asked)
    }

    /// The row that is violated most, and the one that will be first as lambda grows with the
    /// step till then (of several that with the largest rate); cautiously the first of each.
    fn look(
        &self,
        vertex: &Vertex,
        lambda: Num,
        cautious: bool,
    ) -> (Option<usize>, Option<(usize, Num)>) {
        let size = self.size[0] + lambda.to_f64() * self.size[1];
        let met = self.met * size + MET_AT_ZERO;
        let sum = |z: &[Num]| z.iter().map(|v| v.to_f64().abs()).sum::<f64>();
        let rough = |z: &[Num]| z.iter().map(|v| v.to_f64()).collect::<Vec<f64>>();
        // Doubles show which rows may matter; entries of rows are at most about 2.
        let rounding = 4.0 * f64::EPSILON * (self.width + 4) as f64;
        let slack_error = rounding * (sum(&vertex.z) + size);
        let rate_error = rounding * (sum(&vertex.rate) + self.size[1]);
        let (z, speed, at) = (rough(&vertex.z), rough(&vertex.rate), lambda.to_f64());
        let slack = |r: usize| self.times(r, &vertex.z) - self.constant[r] - lambda * self.slope[r];
        let (mut worst, mut within) = (None::<(usize, f64)>, f64::INFINITY);
        // Rows that may be first, and the soonest that they can be.
        let mut candidates: Vec<(usize, f64)> = Vec::new();
        for r in (0..self.rows()).filter(|&r| !vertex.active[r]) {
            let (value, rate) = self.roughly(r, &z, &speed, at);
            if value - slack_error < -met {
                let below = slack(r).to_f64();
                if below < -met && worst.is_none_or(|(_, least)| below < least && !cautious) {
                    worst = Some((r, below));
                }
            }
            if worst.is_some() || rate - rate_error >= -STILL {
                continue;
            }
            let soonest = (value - slack_error).max(0.0) / (rate_error - rate);
            if soonest <= within {
                candidates.push((r, soonest));
            }
            if rate + rate_error < -STILL {
                within = within.min((value + slack_error).max(0.0) / -(rate + rate_error));
            }
        }
        if worst.is_some() {
            return (worst.map(|(r, _)| r), None);
        }
        let mut next: Option<(usize, Num, Num)> = None;
        for (r, _) in candidates
            .into_iter()
            .filter(|&(_, soonest)| soonest <= within)
        {
            let rate = self.times(r, &vertex.rate) - self.slope[r];
            if rate.to_f64() >= -STILL {
                continue;
            }
            let step = slack(r).larger(Num::ZERO) / -rate;
            let sooner = next.is_none_or(|(_, least, steepest)| {
                step < least || (step == least && rate < steepest && !cautious)
            });
            if sooner {
                next = Some((r, step, rate));
            }
        }
        (None, next.map(|(r, step, _)| (r, step)))
    }

    /// Slack of row `r` and its rate in doubles.
    fn roughly(&self, r: usize, z: &[f64], rate: &[f64], lambda: f64) -> (f64, f64) {
        let (value, speed) = (self.rough_times(r, z), self.rough_times(r, rate));
        let slope = self.slope[r].to_f64();
        (
            value - self.constant[r].to_f64() - lambda * slope,
            speed - slope,
        )
    }
}

/// The state of the minimiser.
pub(super) struct Stand<'a> {
    pub lambda: Num,
    pub z: &'a [Num],
    pub rate: &'a [Num],
    /// The way to the next turn by the rows so far.
    pub step: Option<Num>,
}

enum Exchange {
    Done,
    /// No multiplier can give way: the rows contradict each other.
    Impossible,
    /// The active rows depend on each other within rounding.
    Singular,
}

/// Where a step began before which more rows might have been requested.
struct Hasty {
    vertex: Vertex,
    lambda: Num,
    exchanges_here: usize,
    /// Rows that were known.
    rows: usize,
}

/// The active rows, their matrix row by row, and its inverse column by column.
#[derive(Clone)]
struct Vertex {
    basis: Vec<usize>,
    active: Vec<bool>,
    matrix: Vec<Vec<Num>>,
    inverse: Vec<Vec<Num>>,
    /// Whether solutions need a correction: rows that are nearly dependent.
    steep: bool,
    z: Vec<Num>,
    rate: Vec<Num>,
    exchanges: usize,
}

impl Vertex {
    fn new(program: &Program, basis: Vec<usize>) -> Option<Self> {
        let mut active = vec![false; program.rows()];
        for &r in &basis {
            active[r] = true;
        }
        let mut vertex = Self {
            matrix: basis.iter().map(|&r| program.coefficients(r)).collect(),
            inverse: Vec::new(),
            basis,
            active,
            steep: false,
            z: Vec::new(),
            rate: Vec::new(),
            exchanges: 0,
        };
        vertex.renew().then_some(vertex)
    }

    /// Recomputes the inverse; false where the rows depend on each other.
    fn renew(&mut self) -> bool {
        let Some(fresh) = inverse(self.matrix.clone()) else {
            return false;
        };
        self.inverse = fresh;
        self.weigh();
        true
    }

    fn weigh(&mut self) {
        let entries = self.inverse.iter().flatten();
        self.steep = entries.fold(0.0_f64, |most, v| most.max(v.to_f64().abs())) > STEEP;
    }

    /// z with `matrix z = right`.
    fn solve(&self, right: &[Num]) -> Vec<Num> {
        let mut z = vec![Num::ZERO; right.len()];
        let add = |z: &mut [Num], right: &[Num]| {
            for (column, &value) in self.inverse.iter().zip(right) {
                if value != Num::ZERO {
                    Num::add_scaled(z, value, column);
                }
            }
        };
        add(&mut z, right);
        if self.steep {
            let pairs = self.matrix.iter().zip(right);
            let rest: Vec<Num> = pairs.map(|(row, &b)| b - Num::dot(row, &z)).collect();
            add(&mut z, &rest);
        }
        z
    }

    /// y with `matrix' y = right`.
    fn solve_transposed(&self, right: &[Num]) -> Vec<Num> {
        let times = |right: &[Num]| -> Vec<Num> {
            self.inverse.iter().map(|c| Num::dot(c, right)).collect()
        };
        let mut y = times(right);
        if self.steep {
            let mut rest = right.to_vec();
            for (row, &value) in self.matrix.iter().zip(&y) {
                Num::add_scaled(&mut rest, -value, row);
            }
            for (value, more) in y.iter_mut().zip(times(&rest)) {
                *value += more;
            }
        }
        y
    }

    /// z at `lambda` and its rate, from the active rows. Solved for at lambda itself: a steep
    /// rate would cancel against the rest.
    fn place(&mut self, program: &Program, lambda: Num) {
        let at = |&r: &usize| program.constant[r] + lambda * program.slope[r];
        let here: Vec<Num> = self.basis.iter().map(at).collect();
        let slope: Vec<Num> = self.basis.iter().map(|&r| program.slope[r]).collect();
        self.z = self.solve(&here);
        self.rate = self.solve(&slope);
    }

    fn multipliers(&self) -> Vec<Num> {
        let mut unit = vec![Num::ZERO; self.basis.len()];
        if let Some(last) = unit.last_mut() {
            *last = Num::ONE;
        }
        let y = self.solve_transposed(&unit);
        y.into_iter().map(|y| y.larger(Num::ZERO)).collect()
    }

    fn piece(&self, lambda: Num) -> Piece {
        Piece {
            start: lambda,
            z: self.z.clone(),
            rate: self.rate.clone(),
            active: self.basis.iter().copied().zip(self.multipliers()).collect(),
        }
    }

    /// Makes row `entering` active in place of the one whose multiplier vanishes first.
    fn exchange(&mut self, program: &Program, entering: usize, cautious: bool) -> Exchange {
        let row = program.coefficients(entering);
        let share = self.solve_transposed(&row);
        for least in [EQUAL, SOUND] {
            match self.leaving(program, &share, least, cautious) {
                Some(k) if self.replace(k, entering, &row, &share) => return Exchange::Done,
                None if least == EQUAL => return Exchange::Impossible,
                _ => {}
            }
        }
        Exchange::Singular
    }

    /// Makes row `entering` active in place `k`; false, with nothing changed, where the rows then
    /// depend on each other.
    fn replace(&mut self, k: usize, entering: usize, row: &[Num], share: &[Num]) -> bool {
        let pivot = share[k];
        let (leaving, old) = (
            self.basis[k],
            std::mem::replace(&mut self.matrix[k], row.to_vec()),
        );
        self.active[leaving] = false;
        self.active[entering] = true;
        self.basis[k] = entering;
        self.exchanges += 1;
        if self.exchanges.is_multiple_of(FRESH) || pivot.to_f64() < 1e-4 || self.steep {
            if self.renew() {
                return true;
            }
            self.active[entering] = false;
            self.active[leaving] = true;
            self.basis[k] = leaving;
            self.matrix[k] = old;
            return false;
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
        self.weigh();
        true
    }

    /// Place in the basis of the row that gives way to one with the given shares, of those above
    /// `least`.
    fn leaving(
        &self,
        program: &Program,
        share: &[Num],
        least: f64,
        cautious: bool,
    ) -> Option<usize> {
        let multipliers = self.multipliers();
        let second = self.solve_transposed(&program.second);
        let ratios = |values: &[Num]| -> Vec<Num> {
            values
                .iter()
                .zip(share)
                .map(|(&v, &part)| v / part)
                .collect()
        };
        let equal = Num::of(EQUAL);
        let candidates: Vec<usize> = (0..share.len())
            .filter(|&k| share[k] > Num::of(least))
            .collect();
        // The smallest ratio, then among those equal to it the smallest second one, and so on.
        let smallest = |among: Vec<usize>, values: &[Num]| -> Vec<usize> {
            let ratio = ratios(values);
            let Some(best) = among
                .iter()
                .copied()
                .reduce(|a, b| if ratio[b] < ratio[a] { b } else { a })
            else {
                return among;
            };
            // Equal within what rounding leaves of the multiplier.
            let close = |&k: &usize| (ratio[k] - ratio[best]) * share[k] <= equal;
            among.into_iter().filter(close).collect()
        };
        let mut left = smallest(candidates, &multipliers);
        if !cautious {
            left = smallest(left, &second);
            return left
                .into_iter()
                .reduce(|a, b| if share[b] > share[a] { b } else { a });
        }
        left.into_iter().min_by_key(|&k| self.basis[k])
    }
}

/// Columns of the inverse of a matrix given row by row, by Gauss and Jordan with row pivoting;
/// `None` where its rows depend on each other.
fn inverse(mut left: Vec<Vec<Num>>) -> Option<Vec<Vec<Num>>> {
    let n = left.len();
    let mut right: Vec<Vec<Num>> = (0..n)
        .map(|k| {
            let mut unit = vec![Num::ZERO; n];
            unit[k] = Num::ONE;
            unit
        })
        .collect();
    for k in 0..n {
        let best = (k..n).reduce(|a, b| {
            if left[b][k].abs() > left[a][k].abs() {
                b
            } else {
                a
            }
        })?;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Doubles only show which rows need a closer look: with rows that differ by less than their
    /// rounding, and a parameter of any size, the same are found as by looking at all of them.
    #[test]
    fn no_row_that_matters_is_passed_over() {
        let mut random = fluxform_numerics::random::Random::new(21);
        let mut next = || random.between(-1.0, 1.0);
        let mut found = [0; 2];
        for case in 0..600 {
            let lambda = Num::of([0.0, 0.7, 1.3e3, 1.7e6][case % 4]);
            let mut program = Program::new(vec![Num::ONE; 3], [1.0, 1.0], 0.0);
            let size = 1.0 + lambda.to_f64();
            let z: Vec<Num> = (0..4).map(|_| Num::of(size * next())).collect();
            let rate: Vec<Num> = (0..4).map(|_| Num::of(next())).collect();
            // About the edge of what is met, or all at a distance.
            let base = if case % 3 == 0 {
                -MET
            } else {
                0.1 * next().abs()
            };
            for _ in 0..12 {
                let row: Vec<Num> = (0..4).map(|_| Num::of(next())).collect();
                let slope = Num::of(next());
                for _ in 0..4 {
                    let slack = size * (base + 1e-16 * next());
                    let constant = Num::dot(&row, &z) - lambda * slope - Num::of(slack);
                    program.dense(&row, constant, slope);
                }
            }
            let vertex = Vertex {
                basis: Vec::new(),
                active: (0..program.rows()).map(|r| r % 7 == 3).collect(),
                matrix: Vec::new(),
                inverse: Vec::new(),
                steep: false,
                z,
                rate,
                exchanges: 0,
            };
            let rows = || (0..program.rows()).filter(|&r| !vertex.active[r]);
            let slack = |r: usize| {
                program.times(r, &vertex.z) - program.constant[r] - lambda * program.slope[r]
            };
            let met = program.met * size + MET_AT_ZERO;
            let worst = rows()
                .filter(|&r| slack(r).to_f64() < -met)
                .min_by(|&r, &s| slack(r).to_f64().total_cmp(&slack(s).to_f64()));
            let (entering, next_row) = program.look(&vertex, lambda, false);
            assert_eq!(entering, worst, "{case}");
            let step = |r: usize| {
                let rate = program.times(r, &vertex.rate) - program.slope[r];
                let left = slack(r).larger(Num::ZERO) / -rate;
                (rate.to_f64() < -STILL).then_some(left)
            };
            let least = rows().filter_map(step).reduce(Num::smaller);
            if worst.is_none() {
                assert_eq!(next_row.map(|(_, step)| step), least, "{case}");
                assert_eq!(next_row.and_then(|(r, _)| step(r)), least, "{case}");
            }
            found[usize::from(worst.is_none())] += 1;
        }
        assert!(found.iter().all(|&n| n > 50), "{found:?}");
    }
}
