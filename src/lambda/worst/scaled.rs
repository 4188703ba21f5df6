//! Currents, forces and limits in units of order one, all of them powers of two.
//!
//! With `2^k_i` near the largest force per ampere of coil i and `2^f` near the largest force
//! within the limits, `x_i = I_i 2^(k_i - f)`, `t' = t 2^-f` and `lambda' = lambda 2^(k_h - f)`.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::program::{Program, Work};
use crate::problem::ForceProblem;
use crate::qr_reduction::{exponent_of, times_power};

/// Rounding residue of a scaled current, or force per ampere, of zero.
pub(super) const NOTHING: f64 = 1e-24;
/// Exponent of a current whose square is a number.
const MOST_AMPERES: i32 = 511;
/// Exchanges per variable that a program takes at least.
const EXCHANGES: usize = 4;

/// Which rows a point contributes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// `|lambda h - offset - G I| <= t`, least t.
    Worst,
    /// `G I + offset >= lambda h`, largest lambda.
    Least,
}

/// Limits that apply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Limits {
    /// All.
    All,
    /// Only the lower ones.
    Lower,
}

/// The scales of one problem.
pub(super) struct Scaled<'a> {
    pub problem: &'a ForceProblem<'a>,
    /// Largest force per ampere of every coil, largest height, largest offset, all absolute.
    pub largest: &'a [f64],
    /// The point of the largest height, absolute in the worst-point form.
    pub highest: usize,
    force: i32,
    limits: Limits,
    /// Share of lambda max h plus the offset by which points may be missed.
    pub leeway: f64,
    /// The coils that have any effect, on forces or on what others may carry.
    pub live: Vec<usize>,
}

/// Limits of a problem, in place of its own.
pub(super) struct Near {
    lower_a: Vec<f64>,
    upper_a: Vec<f64>,
    total_max_a: Option<f64>,
}

impl Near {
    /// The same points with these.
    pub fn problem<'a>(&'a self, problem: &ForceProblem<'a>) -> ForceProblem<'a> {
        ForceProblem {
            lower_a: &self.lower_a,
            upper_a: &self.upper_a,
            total_max_a: self.total_max_a,
            ..*problem
        }
    }
}

impl<'a> Scaled<'a> {
    pub fn new(
        problem: &'a ForceProblem<'a>,
        largest: &'a [f64],
        form: Form,
        limits: Limits,
    ) -> Self {
        let coils = problem.coils();
        let reach = |i: usize| problem.reach_a(i);
        let moves = |i: usize| limits == Limits::Lower || reach(i) > 0.0;
        // A coil without force may still carry a negative current and so make room in the sum.
        let summed = limits == Limits::All && problem.total_max_a.is_some();
        let counts = |i: usize| largest[i] > 0.0 || (summed && problem.lower_a[i] < 0.0);
        let live: Vec<usize> = (0..coils).filter(|&i| counts(i) && moves(i)).collect();
        let force = (0..coils)
            .filter(|&i| largest[i] > 0.0 && reach(i) > 0.0)
            .map(|i| exponent_of(reach(i)) + exponent_of(largest[i]))
            .max()
            .unwrap_or_else(|| exponent_of(largest[coils]));
        let size = |j: usize| match form {
            Form::Worst => problem.height_m[j].abs(),
            Form::Least => problem.height_m[j],
        };
        let points = 1..problem.points();
        let highest = points.fold(0, |best, j| if size(j) > size(best) { j } else { best });
        Self {
            problem,
            largest,
            highest,
            force,
            limits,
            leeway: 0.0,
            live,
        }
    }

    /// Whether about as many exchanges as programs of this size take are within `work`.
    pub fn within(&self, work: Work) -> bool {
        let width = self.live.len() + 1;
        EXCHANGES * width.pow(3) <= work.0
    }

    /// Largest |height|, m.
    pub fn height_m(&self) -> f64 {
        self.largest[self.problem.coils()]
    }

    /// Largest |offset|, N.
    pub fn offset_n(&self) -> f64 {
        let offset = self.largest.get(self.problem.coils() + 1);
        offset.copied().unwrap_or(0.0)
    }

    /// Exponent of coil i's force per ampere; without force, one that suits its limits.
    fn column(&self, i: usize) -> i32 {
        if self.largest[i] > 0.0 {
            return exponent_of(self.largest[i]);
        }
        self.force - exponent_of(self.problem.reach_a(i))
    }

    fn height(&self) -> i32 {
        exponent_of(self.height_m())
    }

    /// One unit of lambda', N/m.
    pub(crate) fn lambda_unit(&self) -> i32 {
        self.force - self.height()
    }

    /// One unit of force, N.
    pub(crate) fn force_unit(&self) -> i32 {
        self.force
    }

    /// Largest scaled height: 0, or between 1 and 2.
    pub fn top(&self) -> Num {
        Num::of(times_power(self.height_m(), -self.height()))
    }

    /// Size of the forces that currents sum up, N, or of their rates.
    pub(crate) fn pushed_n(&self, amperes: &[f64]) -> f64 {
        let pairs = amperes.iter().zip(self.largest);
        pairs.map(|(ampere, most)| ampere.abs() * most).sum()
    }

    /// Currents, or their rates per unit of lambda', of all coils.
    pub fn amperes(&self, z: &[Num]) -> Vec<f64> {
        let mut amperes = vec![0.0; self.problem.coils()];
        for (&i, x) in self.live.iter().zip(z) {
            let x = x.to_f64();
            if x.abs() > NOTHING {
                amperes[i] = times_power(x, self.force - self.column(i));
            }
        }
        amperes
    }

    /// Currents of all coils, A, within their limits after rounding too.
    pub fn currents_a(&self, z: &[Num]) -> Vec<f64> {
        let mut currents = self.amperes(z);
        for (i, current) in currents.iter_mut().enumerate() {
            *current = current.max(self.problem.lower_a[i]);
            if self.limits == Limits::All {
                *current = current.min(self.problem.upper_a[i]);
            }
        }
        currents
    }

    /// Force of coil `live[k]` at point `j`.
    pub fn force(&self, j: usize, k: usize) -> f64 {
        let i = self.live[k];
        let force = self.problem.forces_n_per_a[j * self.problem.coils() + i];
        times_power(force, -self.column(i))
    }

    /// Height of point `j`.
    pub fn height_of(&self, j: usize) -> f64 {
        times_power(self.problem.height_m[j], -self.height())
    }

    /// What currents are to give at point `j`: lambda h - offset.
    pub fn wanted(&self, j: usize, lambda: f64) -> f64 {
        let offset_n = self.problem.offset_n.map_or(0.0, |offset| offset[j]);
        lambda * self.height_of(j) - times_power(offset_n, -self.force)
    }

    /// The limits' rows, without t, and what they are at least. Of drivers that reverse none is left without their size.
    pub fn limits(&self) -> Vec<(Vec<f64>, f64)> {
        let n = self.live.len();
        if self.limits == Limits::All {
            let program = self.bounds();
            let row = |r| {
                let row: Vec<f64> = program.coefficients(r).iter().map(|v| v.to_f64()).collect();
                (row[..n].to_vec(), program.bound(r).0.to_f64())
            };
            return (0..program.rows()).map(row).collect();
        }
        let one_way = |(k, &i): (usize, &usize)| {
            let go = self.problem.directions(i);
            let mut row = vec![0.0; n];
            row[k] = if go.up { 1.0 } else { -1.0 };
            (go.up != go.down).then_some((row, 0.0))
        };
        self.live.iter().enumerate().filter_map(one_way).collect()
    }

    /// Whether every current has both limits.
    pub fn bounded(&self) -> bool {
        self.limits == Limits::All
    }

    /// What the scaled currents range over, as powers of two; 1 without the drivers' size, but no more than has square
    /// amperes.
    pub fn ranges(&self) -> Vec<f64> {
        let range = |&i: &usize| {
            let exponent = if self.bounded() {
                exponent_of(self.problem.upper_a[i] - self.problem.lower_a[i])
            } else {
                (self.force - self.column(i)).min(MOST_AMPERES)
            };
            times_power(1.0, exponent + self.column(i) - self.force)
        };
        self.live.iter().map(range).collect()
    }

    /// Scaled currents in the middle of their limits, nearer to the lower ones where their sum has little room; without
    /// the drivers' size one ampere where currents flow one way, else zero.
    pub fn middle(&self) -> Vec<f64> {
        let problem = self.problem;
        let middle = |lower: f64, upper: f64, part: f64| lower + part * (upper - lower);
        let [lowest, highest] =
            [problem.lower_a, problem.upper_a].map(|limits| limits.iter().sum::<f64>());
        let share = |most: f64| (0.5 * (most - lowest) / (highest - lowest)).min(0.5);
        let part = problem
            .total_max_a
            .filter(|_| self.bounded())
            .map_or(0.5, share);
        let all = self.live.iter().map(|&i| {
            let current = if self.bounded() {
                middle(problem.lower_a[i], problem.upper_a[i], part)
            } else {
                let go = problem.directions(i);
                f64::from(u8::from(go.up)) - f64::from(u8::from(go.down))
            };
            times_power(current, self.column(i) - self.force)
        });
        all.collect()
    }

    /// Currents of all coils, A, nearest to scaled ones and within the limits of [`Self::limits`].
    pub fn nearest_a(&self, x: &[f64]) -> Vec<f64> {
        let problem = self.problem;
        let wide: Vec<Num> = x.iter().map(|&x| Num::of(x)).collect();
        let mut currents_a = self.amperes(&wide);
        if self.limits == Limits::Lower {
            for (i, current) in currents_a.iter_mut().enumerate() {
                let go = problem.directions(i);
                let [low, high] = [(go.down, f64::NEG_INFINITY), (go.up, f64::INFINITY)]
                    .map(|(open, end)| if open { end } else { 0.0 });
                *current = current.clamp(low, high);
            }
            return currents_a;
        }
        for (i, current) in currents_a.iter_mut().enumerate() {
            *current = current.clamp(problem.lower_a[i], problem.upper_a[i]);
        }
        let total: f64 = currents_a.iter().sum();
        if let Some(most) = problem.total_max_a.filter(|&most| total > most) {
            let lowest: f64 = problem.lower_a.iter().sum();
            let part = (most - lowest) / (total - lowest);
            for (current, lower) in currents_a.iter_mut().zip(problem.lower_a) {
                *current = lower + part * (*current - lower);
            }
        }
        currents_a
    }

    /// Limits that hold the least error back as much as those of [`Self::limits`] do, up to currents of twice these.
    pub fn near(&self, currents_a: &[f64]) -> Near {
        if self.limits == Limits::All {
            return Near {
                lower_a: self.problem.lower_a.to_vec(),
                upper_a: self.problem.upper_a.to_vec(),
                total_max_a: self.problem.total_max_a,
            };
        }
        let twice = currents_a.iter().enumerate();
        let (lower_a, upper_a) = twice
            .map(|(i, current)| {
                let go = self.problem.directions(i);
                let most = 2.0 * current.abs();
                (
                    if go.down { -most } else { 0.0 },
                    if go.up { most } else { 0.0 },
                )
            })
            .unzip();
        Near {
            lower_a,
            upper_a,
            total_max_a: None,
        }
    }

    /// The program with its bounds, before any point. Coil `live[k]` has the row `k` of its
    /// lower limit; with all limits, its upper one is row `live + k`.
    pub fn bounds(&self) -> Program {
        let scaled = |i: usize, v: f64| Num::of(times_power(v, self.column(i) - self.force));
        // The second objective: the sum of the currents of coils that cannot pull, in units of
        // the coil with the largest of them.
        let ampere = |i: usize| self.force - self.column(i);
        let most = self.live.iter().map(|&i| ampere(i)).max().unwrap_or(0);
        let weight = |i: usize| Num::of(times_power(1.0, ampere(i) - most));
        let second = self
            .live
            .iter()
            .map(|&i| {
                if self.problem.lower_a[i] < 0.0 {
                    Num::ZERO
                } else {
                    weight(i)
                }
            })
            .collect();
        let offset = times_power(self.offset_n(), -self.force);
        let mut program = Program::new(second, [offset, self.top().to_f64()], self.leeway);
        for (k, &i) in self.live.iter().enumerate() {
            program.at_least(k, scaled(i, self.problem.lower_a[i]));
        }
        if self.limits == Limits::Lower {
            return program;
        }
        for (k, &i) in self.live.iter().enumerate() {
            program.at_most(k, scaled(i, self.problem.upper_a[i]));
        }
        if let Some(total_a) = self.problem.total_max_a {
            let upper = self.live.iter().map(|&i| Num::of(self.problem.upper_a[i]));
            let all = upper.fold(Num::ZERO, |sum, u| sum + u);
            if all > Num::of(total_a) {
                let mut row: Vec<Num> = self.live.iter().map(|&i| -weight(i)).collect();
                row.push(Num::ZERO);
                program.dense(&row, -Num::of(times_power(total_a, -most)), Num::ZERO);
            }
        }
        program
    }

    /// Adds the row of point `j`: the force too weak (`up`), or too strong.
    pub(crate) fn add_point(&self, program: &mut Program, form: Form, j: usize, up: bool) -> usize {
        let coils = self.problem.coils();
        let sign = if up { Num::ONE } else { -Num::ONE };
        let forces = &self.problem.forces_n_per_a[j * coils..(j + 1) * coils];
        let force = |&i: &usize| sign * Num::of(times_power(forces[i], -self.column(i)));
        let mut row: Vec<Num> = self.live.iter().map(force).collect();
        let height = Num::of(times_power(self.problem.height_m[j], -self.height()));
        let offset = self.problem.offset_n.map_or(0.0, |offset| offset[j]);
        let constant = -(sign * Num::of(times_power(offset, -self.force)));
        match form {
            Form::Worst => {
                row.push(Num::ONE);
                program.dense(&row, constant, sign * height)
            }
            Form::Least => {
                row.push(height);
                program.dense(&row, constant, Num::ZERO)
            }
        }
    }

    /// A first set of active rows whose multipliers are not negative, for a program that has the
    /// rows `up` and `down` of the highest point.
    pub(crate) fn first_basis(&self, form: Form, up: usize, down: Option<usize>) -> Vec<usize> {
        let coils = self.problem.coils();
        let j = self.highest;
        let force = |k: usize| self.problem.forces_n_per_a[j * coils + self.live[k]];
        let all = 0..self.live.len();
        if form == Form::Least {
            // Each coil at the limit that helps this point most.
            let limit = |k: usize| {
                if force(k) > 0.0 {
                    self.live.len() + k
                } else {
                    k
                }
            };
            return all.map(limit).chain([up]).collect();
        }
        // Both rows of the point with one half each, met by the coil that moves it at the least
        // of the second objective, of several the strongest; the others rest at their lower limits.
        let size = |k: usize| times_power(force(k).abs(), -self.column(self.live[k]));
        let cost = |k: usize| {
            let pull = self.problem.lower_a[self.live[k]] < 0.0;
            let ampere = times_power(1.0, -self.column(self.live[k]));
            if pull { 0.0 } else { ampere / size(k) }
        };
        let before =
            |a: usize, b: usize| cost(b) < cost(a) || (cost(b) == cost(a) && size(b) > size(a));
        let chosen = all
            .clone()
            .filter(|&k| size(k) > NOTHING)
            .reduce(|a, b| if before(a, b) { b } else { a });
        match (chosen, down) {
            (Some(chosen), Some(down)) => all.filter(|&k| k != chosen).chain([up, down]).collect(),
            _ => all.chain([up]).collect(),
        }
    }
}
