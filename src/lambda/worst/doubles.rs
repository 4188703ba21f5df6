//! A program at one force constant, solved in doubles and finished in double-double.
//!
//! Few rows decide: the dual simplex method runs over those that are known, and the points that its
//! vertex misses most join them until none is missed: of many points those of a sample first, then
//! of all the others, which are only looked at in blocks. The costs are raised a little, each by
//! another part, so that arrays whose symmetry leaves many multipliers at zero do not stall it; at
//! the vertex that this gives the true costs return, and the primal simplex method corrects what the
//! raise has moved. Another force constant changes no multiplier, so the next program begins at the
//! last vertex. Position, rate and multipliers of that vertex are refined in double-double.

use rayon::prelude::*;

use super::points::{Course, Held, Points, Probe, bit, first_missed};
use super::pool::Pool;
use super::program::{Piece, Program};
use super::scaled::{Form, Scaled};
use crate::qr_reduction::times_power;
use fluxform_numerics::dispatch::{self, Kernel, mul_add};
use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::random::Random;
use fluxform_numerics::real::Real;

/// Raise of the costs, relative to that of the minimised variable.
const RAISE: f64 = 1e-7;
/// Multipliers that differ by less are equal, in units of the raise.
const TIE: f64 = 0.01;
/// Rounding of a force summed in doubles, in units of the terms' sizes.
const ROUNDINGS: f64 = 8.0;
/// Multipliers up to this size below zero are zero.
const NONE: f64 = 1e-13;
/// Least pivot.
const PIVOT: f64 = 1e-9;
/// Exchanges after which the inverse is recomputed.
const FRESH: usize = 64;
/// The same of position and multipliers.
const AGAIN: usize = 16;
/// Pivots above which position and multipliers keep their digits.
const STEADY: f64 = 1e-3;
/// Violated rows that are looked at again after an exchange.
const LOOKED_AT: usize = 32;
/// Points of which one joins at a time.
const CHUNK: usize = 32;
/// Points of one parallel task: fixed, so that results do not depend on the number of threads.
const TASK: usize = 128 * CHUNK;
/// Exchanges per variable after which a program is given up.
const PATIENCE: usize = 200;
/// Multiplications after which all programs of one problem are given up: seconds.
const WORK: usize = 60_000_000_000;
/// Turns from one method to the other.
const TURNS: usize = 8;
/// Corrections of a solution in double-double.
const CORRECTIONS: usize = 8;

/// Why there is no optimum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Failure {
    /// No x satisfies the rows.
    Infeasible,
    /// The limit of exchanges or of work was met, or the rows depend on each other within rounding.
    Stalled,
}

/// The optimum at one force constant.
pub(super) struct Optimum {
    /// Where it is, how it moves with lambda, and the rows that it rests on.
    pub piece: Piece,
    /// Error of the minimised variable that multipliers below zero leave, and of the points
    /// that rounding hides, both in scaled units.
    pub doubt: f64,
}

/// A program of all points, and its last vertex.
pub(super) struct Doubles<'s, 'a> {
    scaled: &'s Scaled<'a>,
    form: Form,
    pool: Pool<'a>,
    program: Program,
    rows: Vec<Option<(usize, bool)>>,
    /// Of every point of the pool.
    held: Vec<Held>,
    basis: Vec<usize>,
    active: Vec<bool>,
    /// Active rows one after another, and the columns of their inverse.
    matrix: Vec<f64>,
    inverse: Vec<f64>,
    /// Exchanges so far.
    exchanges: usize,
    /// Multiplications that are left.
    /// Multiplications that are left.
    pub work: usize,
    random: Random,
}

impl<'s, 'a> Doubles<'s, 'a> {
    /// The program of the points and limits of `scaled`.
    pub fn new(scaled: &'s Scaled<'a>, form: Form) -> Self {
        let pool = Pool::new(scaled);
        let mut program = scaled.bounds();
        let mut rows = vec![None; program.rows()];
        let first = program.rows();
        let mut held: Vec<Held> = vec![0; pool.count()];
        let highest = pool.place(scaled.highest);
        let signs: &[bool] = if form == Form::Worst {
            &[true, false]
        } else {
            &[true]
        };
        for &up in signs {
            scaled.add_point(&mut program, form, scaled.highest, up);
            rows.push(Some((scaled.highest, up)));
            if let Some(place) = highest {
                held[place] |= bit(up);
            }
        }
        let basis = scaled.first_basis(form, first, (form == Form::Worst).then_some(first + 1));
        let mut active = vec![false; program.rows()];
        for &row in &basis {
            active[row] = true;
        }
        Self {
            scaled,
            form,
            pool,
            program,
            rows,
            held,
            basis,
            active,
            matrix: Vec::new(),
            inverse: Vec::new(),
            exchanges: 0,
            work: WORK,
            random: Random::new(1),
        }
    }

    /// Points and signs of the rows of an optimum; `None` for limits.
    pub fn rows(&self) -> &[Option<(usize, bool)>] {
        &self.rows
    }

    /// The largest force that may be requested at `lambda`.
    pub fn size(&self, lambda: f64) -> f64 {
        let [constant, slope] = self.program.size();
        constant + lambda * slope
    }

    fn width(&self) -> usize {
        self.basis.len()
    }

    /// The optimum at `lambda`, in scaled units; of the form `Least` there is only that at 0.
    pub fn at(&mut self, lambda: Num) -> Result<Optimum, Failure> {
        let limit = self.exchanges + PATIENCE * self.width();
        if self.inverse.is_empty() {
            self.renew()?;
        }
        let mut raise = RAISE;
        for _ in 0..TURNS {
            self.dual(lambda.to_f64(), raise, limit)?;
            let moved = self.primal(lambda.to_f64(), limit)?;
            if !moved || !self.misses(lambda.to_f64()) {
                break;
            }
            raise *= 0.1;
        }
        Ok(self.finish(lambda))
    }

    /// Rows below their bounds by less are met, in scaled units: what rounding leaves of forces.
    fn met(&self, lambda: f64, z: &[f64]) -> f64 {
        let requested = self.size(lambda);
        let pushed: f64 = z.iter().map(|x| 2.0 * x.abs()).sum();
        ROUNDINGS * f64::EPSILON * (requested + pushed) + 1e-25
    }

    fn bound(&self, row: usize, lambda: f64) -> f64 {
        let (constant, slope) = self.program.bound(row);
        constant.to_f64() + lambda * slope.to_f64()
    }

    /// Position at `lambda`, its residual corrected once.
    fn place(&self, lambda: f64) -> Vec<f64> {
        let n = self.width();
        let bounds: Vec<f64> = self.basis.iter().map(|&r| self.bound(r, lambda)).collect();
        let mut z = vec![0.0; n];
        let mut rest = bounds.clone();
        for _ in 0..2 {
            for (column, &value) in self.inverse.chunks_exact(n).zip(&rest) {
                if value != 0.0 {
                    add_scaled(&mut z, value, column);
                }
            }
            for ((rest, row), &bound) in rest
                .iter_mut()
                .zip(self.matrix.chunks_exact(n))
                .zip(&bounds)
            {
                *rest = bound - dot(row, &z);
            }
        }
        z
    }

    /// Products of the inverse's columns with `row`.
    fn shares(&self, row: &[f64]) -> Vec<f64> {
        let columns = self.inverse.chunks_exact(self.width());
        columns.map(|column| dot(column, row)).collect()
    }

    fn coefficients(&self, row: usize) -> Vec<f64> {
        let row = self.program.coefficients(row);
        row.iter().map(|v| v.to_f64()).collect()
    }

    /// Whether the vertex violates a known row, or misses a point outside the pool.
    fn misses(&mut self, lambda: f64) -> bool {
        let z = self.place(lambda);
        !self.all_violated(lambda, &z).is_empty() || self.take_missed(lambda, &z)
    }

    /// Those of the rows that are violated, the most violated ones first, with how much.
    fn violated(
        &self,
        rows: impl Iterator<Item = usize>,
        lambda: f64,
        z: &[f64],
    ) -> Vec<(usize, f64)> {
        let met = self.met(lambda, z);
        let below = |row: usize| self.bound(row, lambda) - self.program.rough_times(row, z);
        let mut violated: Vec<(usize, f64)> = rows
            .filter(|&row| !self.active[row])
            .map(|row| (row, below(row)))
            .filter(|&(_, below)| below > met)
            .collect();
        violated.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        violated
    }

    /// The same of all rows that are known.
    fn all_violated(&self, lambda: f64, z: &[f64]) -> Vec<(usize, f64)> {
        self.violated(0..self.program.rows(), lambda, z)
    }

    /// Runs the dual simplex method with raised costs until no point is missed.
    fn dual(&mut self, lambda: f64, raise: f64, limit: usize) -> Result<(), Failure> {
        let n = self.width();
        // Multipliers that are not negative define the costs.
        let mut multipliers = self.multipliers();
        for value in &mut multipliers {
            *value = value.max(0.0) + raise * (0.5 + self.random.unit());
        }
        let mut cost = vec![0.0; n];
        for (row, &value) in self.matrix.chunks_exact(n).zip(&multipliers) {
            add_scaled(&mut cost, value, row);
        }
        let mut z = self.place(lambda);
        let mut multipliers = self.shares(&cost);
        // Few rows are looked at until none of them is violated any more.
        let mut looked_at: Vec<usize> = Vec::new();
        let mut moved = false;
        loop {
            fluxform_base::progress::poll();
            let mut violated = self.violated(looked_at.iter().copied(), lambda, &z);
            if violated.is_empty() {
                if moved {
                    z = self.place(lambda);
                    moved = false;
                }
                self.spend(n * (self.program.rows() + self.pool.count()))?;
                violated = self.all_violated(lambda, &z);
                violated.truncate(LOOKED_AT);
            }
            looked_at = violated.iter().map(|&(row, _)| row).collect();
            let Some(&(row, below)) = violated.first() else {
                if self.add_missed(lambda, &z) {
                    continue;
                }
                return Ok(());
            };
            // What rounding and ties leave below zero would lead back: more cost there.
            for (k, value) in multipliers.iter_mut().enumerate() {
                if *value < 0.0 {
                    let more = TIE * raise * (0.5 + self.random.unit()) - *value;
                    add_scaled(&mut cost, more, &self.matrix[k * n..(k + 1) * n]);
                    *value += more;
                }
            }
            let coefficients = self.coefficients(row);
            let share = self.shares(&coefficients);
            let leaving = leaving(&multipliers, &share, TIE * raise).ok_or(Failure::Infeasible)?;
            let pivot = share[leaving];
            add_scaled(
                &mut z,
                below / pivot,
                &self.inverse[leaving * n..(leaving + 1) * n],
            );
            moved = true;
            let part = multipliers[leaving] / pivot;
            add_scaled(&mut multipliers, -part, &share);
            multipliers[leaving] = part;
            self.replace(leaving, row, &coefficients, &share)?;
            if pivot < STEADY || self.exchanges.is_multiple_of(AGAIN) {
                z = self.place(lambda);
                multipliers = self.shares(&cost);
                moved = false;
            }
            if self.exchanges > limit {
                return Err(Failure::Stalled);
            }
        }
    }

    /// Runs the primal simplex method from a vertex that misses no point until no multiplier is
    /// negative; whether it moved.
    fn primal(&mut self, lambda: f64, limit: usize) -> Result<bool, Failure> {
        let mut moved = false;
        let patience = self.exchanges + 10 * self.width();
        while self.exchanges < limit.min(patience) {
            fluxform_base::progress::poll();
            self.spend(2 * self.width() * (self.pool.count() + self.program.rows()))?;
            let multipliers = self.multipliers();
            let Some(leaving) = (0..self.width())
                .filter(|&k| multipliers[k] < -NONE)
                .reduce(|a, b| {
                    if multipliers[b] < multipliers[a] {
                        b
                    } else {
                        a
                    }
                })
            else {
                break;
            };
            let z = self.place(lambda);
            let n = self.width();
            let direction = self.inverse[leaving * n..(leaving + 1) * n].to_vec();
            let Some(row) = self.blocking(lambda, &z, &direction) else {
                break;
            };
            let coefficients = self.coefficients(row);
            let share = self.shares(&coefficients);
            self.replace(leaving, row, &coefficients, &share)?;
            moved = true;
        }
        Ok(moved)
    }

    /// The row that is met first on the way from `z` along `direction`; of several nearly at once
    /// the one that is met most squarely.
    fn blocking(&mut self, lambda: f64, z: &[f64], direction: &[f64]) -> Option<usize> {
        let met = self.met(lambda, z);
        let size = direction.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let speeds = |doubles: &Self| -> Vec<(usize, f64, f64)> {
            let all = (0..doubles.program.rows()).filter(|&row| !doubles.active[row]);
            all.filter_map(|row| {
                let speed = -doubles.program.rough_times(row, direction);
                let slack = doubles.program.rough_times(row, z) - doubles.bound(row, lambda);
                (speed > PIVOT * size).then(|| (row, slack.max(0.0), speed))
            })
            .collect()
        };
        let soonest = |rows: &[(usize, f64, f64)]| {
            let steps = rows.iter().map(|&(_, slack, speed)| (slack + met) / speed);
            steps.fold(f64::INFINITY, f64::min)
        };
        let mut rows = speeds(self);
        let course = self.course(lambda, z, direction, soonest(&rows));
        let points = self.pool.points();
        if let Some((place, up)) = first_missed(points, &self.held, &course, self.form) {
            self.add(place, up);
            rows = speeds(self);
        }
        let within = soonest(&rows);
        let near = rows
            .into_iter()
            .filter(|&(_, slack, speed)| slack / speed <= within);
        near.reduce(|a, b| if b.2 > a.2 { b } else { a })
            .map(|(row, ..)| row)
    }

    /// The state at `z` in SI units, moving along `direction`.
    fn course(&self, lambda: f64, z: &[f64], direction: &[f64], step: f64) -> Course {
        let scaled = self.scaled;
        let wide = |z: &[f64]| z.iter().map(|&v| Num::of(v)).collect::<Vec<Num>>();
        let at = self.probe(lambda, z);
        let rates_a = scaled.amperes(&wide(direction));
        let last = direction[direction.len() - 1];
        let force = |v: f64| times_power(v, scaled.force_unit());
        let (lambda_rate, limit_rate_m) = match self.form {
            Form::Worst => (0.0, force(last)),
            Form::Least => (-times_power(last, scaled.lambda_unit()), 0.0),
        };
        Course {
            rounding_n: force(self.met(lambda, z)),
            rounding_m: ROUNDINGS * f64::EPSILON * scaled.pushed_n(&rates_a),
            limit_rate_m,
            lambda_rate,
            step,
            rates_a,
            at,
        }
    }

    /// The condition on all points at `z`, without room for rounding.
    fn probe(&self, lambda: f64, z: &[f64]) -> Probe {
        let wide: Vec<Num> = z.iter().map(|&v| Num::of(v)).collect();
        let last = z[z.len() - 1];
        let (lambda, bound) = match self.form {
            Form::Worst => (lambda, last),
            Form::Least => (-last, 0.0),
        };
        Probe {
            lambda_n_per_m: times_power(lambda, self.scaled.lambda_unit()),
            offset_share: 1.0,
            currents_a: self.scaled.amperes(&wide),
            limit_n: times_power(bound, self.scaled.force_unit()),
        }
    }

    /// Makes a row of the pool's point in this place.
    fn add(&mut self, place: usize, up: bool) {
        self.held[place] |= bit(up);
        let point = self.pool.point(place);
        self.scaled
            .add_point(&mut self.program, self.form, point, up);
        self.rows.push(Some((point, up)));
        self.active.push(false);
    }

    /// Adds the points that `z` misses most, one of every few neighbours; false where it misses none.
    fn add_missed(&mut self, lambda: f64, z: &[f64]) -> bool {
        self.add_missed_of_pool(lambda, z)
            || (self.take_missed(lambda, z) && self.add_missed_of_pool(lambda, z))
    }

    /// Takes the points into the pool that `z` misses; whether there are any.
    fn take_missed(&mut self, lambda: f64, z: &[f64]) -> bool {
        let mut probe = self.probe(lambda, z);
        probe.limit_n += times_power(self.met(lambda, z), self.scaled.force_unit());
        let come = self.pool.take_missed(self.scaled, &[probe], self.form);
        self.held.resize(self.pool.count(), 0);
        come > 0
    }

    fn add_missed_of_pool(&mut self, lambda: f64, z: &[f64]) -> bool {
        let probe = self.probe(lambda, z);
        let rounding_n = times_power(self.met(lambda, z), self.scaled.force_unit());
        let (points, form) = (self.pool.points(), self.form);
        let held = &self.held;
        let tasks = points.height_m.len().div_ceil(TASK);
        let mut missed: Vec<(f64, usize, bool)> = (0..tasks)
            .into_par_iter()
            .flat_map_iter(|task| {
                dispatch::run(Missed {
                    points,
                    held,
                    probe: &probe,
                    form,
                    rounding_n,
                    first: task * TASK,
                })
            })
            .collect();
        missed.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        missed.truncate(self.width().max(8));
        for &(_, place, up) in &missed {
            self.add(place, up);
        }
        !missed.is_empty()
    }

    /// Multipliers by the true cost.
    fn multipliers(&self) -> Vec<f64> {
        let n = self.width();
        let mut unit = vec![0.0; n];
        unit[n - 1] = 1.0;
        let mut y = self.shares(&unit);
        for (row, &value) in self.matrix.chunks_exact(n).zip(&y) {
            add_scaled(&mut unit, -value, row);
        }
        for (value, more) in y.iter_mut().zip(self.shares(&unit)) {
            *value += more;
        }
        y
    }

    /// Makes `row` active in place `k`.
    fn replace(
        &mut self,
        k: usize,
        row: usize,
        coefficients: &[f64],
        share: &[f64],
    ) -> Result<(), Failure> {
        let n = self.width();
        self.active[self.basis[k]] = false;
        self.active[row] = true;
        self.basis[k] = row;
        self.matrix[k * n..(k + 1) * n].copy_from_slice(coefficients);
        self.exchanges += 1;
        self.spend(4 * n * n)?;
        if self.exchanges.is_multiple_of(FRESH) {
            return self.renew();
        }
        let mut column = self.inverse[k * n..(k + 1) * n].to_vec();
        for value in &mut column {
            *value /= share[k];
        }
        for (other, &part) in self.inverse.chunks_exact_mut(n).zip(share) {
            if part != 0.0 {
                add_scaled(other, -part, &column);
            }
        }
        self.inverse[k * n..(k + 1) * n].copy_from_slice(&column);
        Ok(())
    }

    fn spend(&mut self, multiplications: usize) -> Result<(), Failure> {
        let left = self.work.checked_sub(multiplications);
        self.work = left.ok_or(Failure::Stalled)?;
        Ok(())
    }

    /// Recomputes the inverse of the active rows, by Gauss and Jordan with row pivoting.
    fn renew(&mut self) -> Result<(), Failure> {
        let n = self.width();
        self.matrix = self
            .basis
            .iter()
            .flat_map(|&r| self.coefficients(r))
            .collect();
        // The rows of the matrix and of the unit side by side.
        let wide = 2 * n;
        let mut both = vec![0.0; n * wide];
        for k in 0..n {
            both[k * wide..k * wide + n].copy_from_slice(&self.matrix[k * n..(k + 1) * n]);
            both[k * wide + n + k] = 1.0;
        }
        for k in 0..n {
            fluxform_base::progress::poll();
            let size = |row: usize| both[row * wide + k].abs();
            let best = (k..n).fold(k, |a, b| if size(b) > size(a) { b } else { a });
            if size(best) <= 1e-14 {
                return Err(Failure::Stalled);
            }
            if best != k {
                let (low, high) = both.split_at_mut(best * wide);
                low[k * wide..(k + 1) * wide].swap_with_slice(&mut high[..wide]);
            }
            let pivot = both[k * wide + k];
            let row: Vec<f64> = both[k * wide..(k + 1) * wide]
                .iter()
                .map(|v| v / pivot)
                .collect();
            for (l, other) in both.chunks_exact_mut(wide).enumerate() {
                let part = other[k];
                if l != k && part != 0.0 {
                    add_scaled(&mut other[k..], -part, &row[k..]);
                }
            }
            both[k * wide..(k + 1) * wide].copy_from_slice(&row);
        }
        self.inverse = (0..n * n)
            .map(|at| both[(at % n) * wide + n + at / n])
            .collect();
        Ok(())
    }

    /// Position, rate and multipliers of the vertex in double-double.
    fn finish(&self, lambda: Num) -> Optimum {
        let n = self.width();
        let matrix: Vec<Vec<Num>> = self
            .basis
            .iter()
            .map(|&row| self.program.coefficients(row))
            .collect();
        let bounds = self.basis.iter().map(|&r| self.program.bound(r));
        let (here, slope): (Vec<Num>, Vec<Num>) = bounds
            .map(|(constant, slope)| (constant + lambda * slope, slope))
            .unzip();
        let solve = |right: &[Num]| -> Vec<Num> {
            let mut z = vec![Num::ZERO; n];
            let mut before = f64::INFINITY;
            for _ in 0..CORRECTIONS {
                fluxform_base::progress::poll();
                let rest: Vec<f64> = matrix
                    .iter()
                    .zip(right)
                    .map(|(row, &b)| (b - Num::dot(row, &z)).to_f64())
                    .collect();
                let size = rest.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
                if size >= 0.5 * before || size == 0.0 {
                    break;
                }
                before = size;
                let mut step = vec![0.0; n];
                for (column, &value) in self.inverse.chunks_exact(n).zip(&rest) {
                    add_scaled(&mut step, value, column);
                }
                for (z, step) in z.iter_mut().zip(step) {
                    *z += Num::of(step);
                }
            }
            z
        };
        let (z, rate) = (solve(&here), solve(&slope));
        let multipliers = self.fine_multipliers(&matrix);
        let below: f64 = multipliers.iter().map(|y| (-y.to_f64()).max(0.0)).sum();
        let rough: Vec<f64> = z.iter().map(|v| v.to_f64()).collect();
        let largest = rough.iter().fold(1.0_f64, |most, v| most.max(v.abs()));
        let active: Vec<(usize, Num)> = self
            .basis
            .iter()
            .copied()
            .zip(multipliers.into_iter().map(|y| y.larger(Num::ZERO)))
            .collect();
        Optimum {
            doubt: 2.0 * self.met(lambda.to_f64(), &rough) + 2.0 * below * largest,
            piece: Piece {
                start: lambda,
                z,
                rate,
                active,
            },
        }
    }

    fn fine_multipliers(&self, matrix: &[Vec<Num>]) -> Vec<Num> {
        let n = self.width();
        let mut y = vec![Num::ZERO; n];
        let mut before = f64::INFINITY;
        for _ in 0..CORRECTIONS {
            let mut rest = vec![Num::ZERO; n];
            rest[n - 1] = Num::ONE;
            for (row, &value) in matrix.iter().zip(&y) {
                if value != Num::ZERO {
                    Num::add_scaled(&mut rest, -value, row);
                }
            }
            let rest: Vec<f64> = rest.iter().map(|v| v.to_f64()).collect();
            let size = rest.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            if size >= 0.5 * before || size == 0.0 {
                break;
            }
            before = size;
            for (y, more) in y.iter_mut().zip(self.shares(&rest)) {
                *y += Num::of(more);
            }
        }
        y
    }
}

/// Place of the row that gives way: the smallest ratio within what `grain` adds to the
/// multipliers, of those the largest share.
fn leaving(multipliers: &[f64], share: &[f64], grain: f64) -> Option<usize> {
    let all = || (0..share.len()).filter(|&k| share[k] > PIVOT);
    let within = all()
        .map(|k| (multipliers[k].max(0.0) + grain) / share[k])
        .fold(f64::INFINITY, f64::min);
    all()
        .filter(|&k| multipliers[k].max(0.0) / share[k] <= within)
        .reduce(|a, b| if share[b] > share[a] { b } else { a })
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    dispatch::run(Dot(a, b))
}

fn add_scaled(y: &mut [f64], factor: f64, x: &[f64]) {
    dispatch::run(AddScaled(y, factor, x));
}

struct Dot<'a>(&'a [f64], &'a [f64]);

impl Kernel for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> f64 {
        lane_dot::<FMA>(self.0, self.1)
    }
}

struct AddScaled<'a>(&'a mut [f64], f64, &'a [f64]);

impl Kernel for AddScaled<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        for (y, &x) in self.0.iter_mut().zip(self.2) {
            *y = mul_add::<FMA>(self.1, x, *y);
        }
    }
}

#[inline(always)]
fn lane_dot<const FMA: bool>(a: &[f64], b: &[f64]) -> f64 {
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    let mut lanes = [0.0; 8];
    for (x, y) in a8.iter().zip(b8) {
        for k in 0..8 {
            lanes[k] = mul_add::<FMA>(x[k], y[k], lanes[k]);
        }
    }
    let rest = a_rest.iter().zip(b_rest).map(|(x, y)| x * y);
    lanes.into_iter().chain(rest).sum()
}

/// Of every [`CHUNK`] points of a task the one that is missed most, with how much.
struct Missed<'a> {
    points: Points<'a>,
    held: &'a [Held],
    probe: &'a Probe,
    form: Form,
    rounding_n: f64,
    first: usize,
}

impl Kernel for Missed<'_> {
    type Output = Vec<(f64, usize, bool)>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Self::Output {
        let (points, probe) = (self.points, self.probe);
        let coils = points.coils;
        let end = (self.first + TASK).min(points.height_m.len());
        let mut all = Vec::new();
        for from in (self.first..end).step_by(CHUNK) {
            let mut most = (self.rounding_n, 0, false);
            for j in from..end.min(from + CHUNK) {
                let row = &points.forces_n_per_a[j * coils..(j + 1) * coils];
                let offset = points.offset_n.map_or(0.0, |offset| offset[j]);
                let rest = probe.lambda_n_per_m * points.height_m[j]
                    - offset
                    - lane_dot::<FMA>(row, &probe.currents_a);
                if rest - probe.limit_n > most.0 && self.held[j] & bit(true) == 0 {
                    most = (rest - probe.limit_n, j, true);
                }
                let over = -rest - probe.limit_n;
                if self.form == Form::Worst && over > most.0 && self.held[j] & bit(false) == 0 {
                    most = (over, j, false);
                }
            }
            if most.0 > self.rounding_n {
                all.push(most);
            }
        }
        all
    }
}
