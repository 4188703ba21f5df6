//! From points and coils to a small scaled least-squares problem.
//!
//! The columns of forces, the heights and the offset go through one QR of
//! `[G, h, -offset] / sqrt(n)`, its rows scaled by the roots of the points' weights; what
//! remains has as many rows as columns. Of columns far from dependent its R is that of their products
//! in double-double. All scales are powers of two: with `2^k_i` near the norm of coil i's column,
//! `x_i = I_i 2^(k_i - f)` and `lambda' = lambda 2^(k_h - f)`, where `2^f` newtons is
//! the largest force within the limits. Every column then has a norm between 1 and 2.

use std::ops::Range;

use rayon::prelude::*;

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::gram::triangular_factor_by_products;
use fluxform_numerics::qr::triangular_factor;
use fluxform_numerics::real::Real;

use super::homotopy::Bounds;
use super::model::{Model, Reflection};
use super::pivoted::Pivoted;
use super::problem::ForceProblem;

/// A dependence among columns below this share of a column lies within the rounding of its entries.
const HIDDEN_IN_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// `2^exponent`, or the nearest end of the normal range.
pub(super) fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent.clamp(-1022, 1023) + 1023) as u64) << 52)
}

/// `value 2^exponent`, rounded only outside the normal range.
pub(super) fn times_power(value: f64, exponent: i32) -> f64 {
    let half = exponent / 2;
    value * power_of_two(half) * power_of_two(exponent - half)
}

/// The exponent k with `2^k <= |value| < 2^(k+1)`; 0 for 0.
pub(super) fn exponent_of(value: f64) -> i32 {
    if value == 0.0 {
        return 0;
    }
    let biased = ((value.to_bits() >> 52) & 0x7ff) as i32;
    if biased == 0 {
        exponent_of(value * power_of_two(200)) - 200
    } else {
        biased - 1023
    }
}

/// Largest absolute value of every column: coils, heights, offset.
pub(super) fn largest_entries(problem: &ForceProblem) -> Vec<f64> {
    let coils = problem.coils();
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let columns: Vec<Vec<f64>> = problem
        .forces_n_per_a
        .par_chunks(coils * 16_384)
        .map(|rows| {
            let mut most = vec![0.0_f64; coils];
            for row in rows.chunks_exact(coils) {
                for (most, value) in most.iter_mut().zip(row) {
                    *most = most.max(value.abs());
                }
            }
            most
        })
        .collect();
    let coil = |i: usize| columns.iter().fold(0.0_f64, |most, part| most.max(part[i]));
    let rest = [Some(problem.height_m), problem.offset_n];
    (0..coils)
        .map(coil)
        .chain(rest.into_iter().flatten().map(largest))
        .collect()
}

/// The coils that count: all but those with neither force nor current, such as broken ones, unless that is all.
pub(super) fn counted_coils(problem: &ForceProblem, largest: &[f64]) -> Vec<usize> {
    let all = 0..problem.coils();
    let counts = |&i: &usize| largest[i] > 0.0 || problem.reach_a(i) > 0.0;
    let counted: Vec<usize> = all.clone().filter(counts).collect();
    if counted.is_empty() {
        return all.collect();
    }
    counted
}

/// The columns of those coils, of heights and offset, with the exponents of their largest values.
fn counted_columns(problem: &ForceProblem, largest: &[f64]) -> Vec<(usize, i32)> {
    let rest = problem.coils()..largest.len();
    let all = counted_coils(problem, largest).into_iter().chain(rest);
    all.map(|j| (j, exponent_of(largest[j]))).collect()
}

/// The triangular factor and the exponents of its columns' scales.
#[derive(Debug, Clone)]
pub(super) struct Reduced {
    /// R of `[G, h, -offset] / sqrt(n)`, or the matrix itself where points are fewer than coils; column i
    /// divided by `2^scale[i]`. Coils that do not count have a column of zeros.
    columns: Vec<Vec<Num>>,
    /// Powers of two, of order of each column's root mean square.
    scale: Vec<i32>,
    coils: usize,
    /// Coils that count.
    counted: Vec<usize>,
    /// Exponent f of the unit of force.
    force_scale: i32,
    /// The same of lambda': `lambda = lambda' 2^lambda_scale`.
    pub lambda_scale: i32,
    /// Relative error of an operation on the points.
    pub epsilon: f64,
}

/// A problem whose dependences are exact.
pub(super) struct Clean {
    pub reduced: Reduced,
    /// Number of independent columns among the coils'.
    pub rank: usize,
    /// By how much every coil's column was moved, in the unit of the columns.
    pub moved: Vec<Num>,
}

impl Clean {
    /// Bound on what that changes in the fit of any currents within the limits, in units of force.
    pub fn most_moved(&self, problem: &ForceProblem) -> Num {
        let of_coil = |(i, &moved): (usize, &Num)| {
            moved
                * Num::of(times_power(
                    problem.reach_a(i),
                    self.reduced.current_scale(i),
                ))
        };
        (self.moved.iter().enumerate().map(of_coil)).fold(Num::ZERO, |sum, of_coil| sum + of_coil)
    }
}

fn copy<T>(to: &mut [T], from: impl Iterator<Item = T>) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = from;
    }
}

/// Rows `range` of the columns `which` of `[G, h, -offset]`, each over two to its exponent, written column by column.
fn fill_rows<T: Real>(
    problem: &ForceProblem,
    which: &[(usize, i32)],
    range: Range<usize>,
    block: &mut [T],
    stride: usize,
) {
    let coils = problem.coils();
    let rows = &problem.forces_n_per_a[range.start * coils..range.end * coils];
    // Two factors: the scale of a column of tiny entries alone would overflow.
    let factors = |k: i32| (power_of_two(-k / 2), power_of_two(-k - -k / 2));
    for (column, &(j, k)) in block.chunks_exact_mut(stride).zip(which) {
        let (a, b) = factors(k);
        let scaled = |v: &f64| T::of(v * a * b);
        match (j.checked_sub(coils), problem.offset_n) {
            (None, _) => copy(column, rows.chunks_exact(coils).map(|row| scaled(&row[j]))),
            (Some(0), _) => copy(column, problem.height_m[range.clone()].iter().map(scaled)),
            (_, offset) => {
                let offset = offset.map_or(&[][..], |offset| &offset[range.clone()]);
                copy(column, offset.iter().map(|v| -scaled(v)));
            }
        }
    }
}

impl Reduced {
    /// By reflections of the points, whatever the columns.
    pub fn new<T: Real>(problem: &ForceProblem, largest: &[f64]) -> Self {
        let counted = counted_columns(problem, largest);
        let heaviest = T::of(problem.heaviest());
        let fill = |range: Range<usize>, block: &mut [T], stride: usize| {
            fill_rows(problem, &counted, range.clone(), block, stride);
            let Some(weights) = problem.weights else {
                return;
            };
            for column in block.chunks_exact_mut(stride) {
                for (entry, &weight) in column.iter_mut().zip(&weights[range.clone()]) {
                    *entry = *entry * (T::of(weight) / heaviest).sqrt();
                }
            }
        };
        let (points, width) = (problem.points(), counted.len());
        let left_out = largest.len() - width;
        // Of fewer points than coils the rows themselves are the least that says everything.
        let columns = if points + left_out < problem.coils() {
            let mut block = vec![T::ZERO; points * width];
            fill(0..points, &mut block, points);
            block
        } else {
            triangular_factor(points, width, fill).into_columns()
        };
        let total = match problem.weights {
            None => Num::of(problem.points() as f64),
            Some(weights) => {
                let heaviest = Num::of(problem.heaviest());
                let sum = |sum: Num, &w: &f64| sum + Num::of(w) / heaviest;
                weights.iter().fold(Num::ZERO, sum)
            }
        };
        Self::of_columns(problem, counted, &columns, total, T::EPSILON)
    }

    /// By the products of the columns, in double-double: quicker, for coils' columns of this condition
    /// number. `None` where a column or the heights depend too nearly on others.
    pub fn by_products(problem: &ForceProblem, largest: &[f64], condition: f64) -> Option<Self> {
        let counted = counted_columns(problem, largest);
        let unit = power_of_two(-exponent_of(problem.heaviest()));
        let triangle = triangular_factor_by_products(
            problem.points(),
            counted.len(),
            |range, block, stride| fill_rows(problem, &counted, range, block, stride),
            |range, to| match problem.weights {
                None => to.fill(1.0),
                Some(weights) => copy(to, weights[range].iter().map(|&weight| weight * unit)),
            },
        )?;
        let total = match problem.weights {
            None => Num::of(problem.points() as f64),
            Some(weights) => {
                let sum = |sum: Num, &w: &f64| sum + Num::of(w * unit);
                weights.iter().fold(Num::ZERO, sum)
            }
        };
        let epsilon = Num::EPSILON * condition;
        let columns = triangle.into_columns();
        Some(Self::of_columns(problem, counted, &columns, total, epsilon))
    }

    /// From what the scaled columns of `counted` coils, heights and offset, whose weights add up to `total`, are turned
    /// to, one after another.
    fn of_columns<T: Real>(
        problem: &ForceProblem,
        counted: Vec<(usize, i32)>,
        turned: &[T],
        total: Num,
        epsilon: f64,
    ) -> Self {
        let coils = problem.coils();
        let root = Num::ONE / total.sqrt();
        let rows = turned.len() / counted.len();
        let all = coils + 1 + usize::from(problem.offset_n.is_some());
        let (mut scale, mut columns) = (vec![0; all], vec![vec![Num::ZERO; rows]; all]);
        for (column, &(j, exponent)) in turned.chunks_exact(rows).zip(&counted) {
            let column: Vec<Num> = column.iter().map(|&v| v.widened() * root).collect();
            let more = exponent_of(Num::dot(&column, &column).sqrt().to_f64());
            let factor = Num::of(power_of_two(-more));
            columns[j] = column.into_iter().map(|v| v * factor).collect();
            scale[j] = exponent + more;
        }
        let counted: Vec<usize> = (counted.into_iter().map(|(j, _)| j))
            .filter(|&j| j < coils)
            .collect();
        let reach = |i: usize| problem.reach_a(i);
        let force_scale = (counted.iter().copied())
            .filter(|&i| reach(i) > 0.0 && columns[i].iter().any(|&v| v != Num::ZERO))
            .map(|i| exponent_of(reach(i)) + scale[i])
            .max()
            .unwrap_or(0);
        let lambda_scale = force_scale - scale[coils];
        Self {
            columns,
            scale,
            coils,
            counted,
            force_scale,
            lambda_scale,
            epsilon,
        }
    }

    fn rows(&self) -> usize {
        self.columns[0].len()
    }

    fn model(&self, weight: Option<Vec<Num>>) -> Model {
        let mut columns = self.columns[..self.coils].concat();
        if weight.is_some() {
            columns.extend(std::iter::repeat_n(Num::ZERO, self.rows()));
        }
        Model::new(self.rows(), columns, weight, self.epsilon)
    }

    /// Number of coils that count.
    pub fn counted(&self) -> usize {
        self.counted.len()
    }

    /// Condition number in the Frobenius norm of the counted coils' columns, each scaled to unit length; infinite
    /// where they depend on each other.
    pub fn condition(&self) -> f64 {
        let n = self.counted();
        let units: Vec<Vec<f64>> = (self.counted.iter())
            .enumerate()
            .map(|(j, coil)| {
                let column = &self.columns[*coil];
                let norm = Num::dot(column, column).sqrt();
                column[..=j].iter().map(|&v| (v / norm).to_f64()).collect()
            })
            .collect();
        let mut total = 0.0;
        for k in 0..n {
            fluxform_base::progress::poll();
            // Column k of the inverse, by back substitution.
            let mut inverse = vec![0.0; k + 1];
            inverse[k] = 1.0;
            for i in (0..=k).rev() {
                inverse[i] /= units[i][i];
                let value = inverse[i];
                f64::add_scaled(&mut inverse[..i], -value, &units[i]);
            }
            total += f64::dot(&inverse, &inverse);
        }
        let condition = (n as f64 * total).sqrt();
        if condition.is_finite() {
            condition
        } else {
            f64::INFINITY
        }
    }

    /// Number of independent columns among the coils'.
    pub fn rank(&self) -> usize {
        let coils = self.columns[..self.coils].to_vec();
        Pivoted::new(coils, self.coils, 0.0).members.len()
    }

    /// The same problem with every dependence made exact, those too that only rounding hides; `None` where there is
    /// none.
    pub(crate) fn with_clean_dependences(&self) -> Option<Clean> {
        let pivoted = self.pivoted(HIDDEN_IN_ROUNDING)?;
        let length = |column: &[Num]| Num::dot(column, column).sqrt();
        let norm: Vec<Num> = self.columns.iter().map(|column| length(column)).collect();
        let mut moved = vec![Num::ZERO; self.coils];
        let mut columns = pivoted.turned.clone();
        for j in (0..self.coils).filter(|&j| norm[j] > Num::ZERO && !pivoted.contains(j)) {
            columns[j].fill(Num::ZERO);
            for (&i, share) in pivoted.members.iter().zip(pivoted.shares(j)) {
                if (share * norm[i] / norm[j]).abs() > Num::of(HIDDEN_IN_ROUNDING) {
                    Num::add_scaled(&mut columns[j], share, &pivoted.turned[i]);
                }
            }
            let mut off = pivoted.turned[j].clone();
            Num::add_scaled(&mut off, -Num::ONE, &columns[j]);
            moved[j] = length(&off);
        }
        Some(self.cut(columns, pivoted.members.len(), moved))
    }

    /// The same problem without what columns have outside the span of those that are independent by more than `share`;
    /// `None` where all are.
    pub(crate) fn without_weak_parts(&self, share: f64) -> Option<Clean> {
        let pivoted = self.pivoted(share)?;
        let rank = pivoted.members.len();
        let mut columns = pivoted.turned;
        let cut = columns[..self.coils].iter_mut().map(|column| {
            let outside = &mut column[rank..];
            let length = Num::dot(outside, outside).sqrt();
            outside.fill(Num::ZERO);
            length
        });
        let moved = cut.collect();
        Some(self.cut(columns, rank, moved))
    }

    /// `None` where the columns of all counted coils are independent.
    fn pivoted(&self, share: f64) -> Option<Pivoted> {
        let pivoted = Pivoted::new(self.columns.clone(), self.coils, share);
        (pivoted.members.len() < self.counted()).then_some(pivoted)
    }

    /// Turned columns, those of coils without anything below `rank`, with the fewest rows: one below it is enough for
    /// the heights, one more for the offset.
    fn cut(&self, mut columns: Vec<Vec<Num>>, rank: usize, moved: Vec<Num>) -> Clean {
        let rows = self.rows().min(rank + columns.len() - self.coils);
        for (row, j) in (rank..rows).zip(self.coils..) {
            let rest = columns[j].split_off(row);
            if rest.iter().any(|&v| v != Num::ZERO) {
                let (reflection, first) = Reflection::onto_first(rest);
                columns[j].push(first);
                (columns[j + 1..].iter_mut())
                    .for_each(|column| reflection.apply(&mut column[row..]));
            }
        }
        columns
            .iter_mut()
            .for_each(|column| column.resize(rows, Num::ZERO));
        Clean {
            reduced: Self {
                columns,
                ..self.clone()
            },
            rank,
            moved,
        }
    }

    /// The target's direction per unit of lambda', in units of force.
    pub fn heights(&self) -> &[Num] {
        &self.columns[self.coils]
    }

    /// Force that the currents must balance at lambda = 0.
    pub fn offset(&self) -> Option<Vec<Num>> {
        let column = self.columns.get(self.coils + 1)?;
        let factor = Num::of(times_power(
            1.0,
            self.scale[self.coils + 1] - self.force_scale,
        ));
        Some(column.iter().map(|&v| v * factor).collect())
    }

    /// `x_i = I_i 2^(this)`.
    pub(crate) fn current_scale(&self, i: usize) -> i32 {
        self.scale[i] - self.force_scale
    }

    /// One unit of force in newtons.
    pub(crate) fn force_unit_n(&self) -> f64 {
        power_of_two(self.force_scale)
    }

    /// One unit of the target's direction in metres.
    pub(crate) fn height_unit_m(&self) -> f64 {
        power_of_two(self.scale[self.coils])
    }

    /// The problem with all its limits; a limit on the sum has its slack as the last variable.
    pub fn limited(&self, problem: &ForceProblem) -> (Model, Bounds) {
        let scaled = |i: usize, v: f64| Num::of(times_power(v, self.current_scale(i)));
        let mut lower: Vec<Option<Num>> = (0..self.coils)
            .map(|i| Some(scaled(i, problem.lower_a[i])))
            .collect();
        let mut upper: Vec<Option<Num>> = (0..self.coils)
            .map(|i| Some(scaled(i, problem.upper_a[i])))
            .collect();
        let Some(total_a) = problem.total_max_a else {
            return (
                self.model(None),
                Bounds {
                    lower,
                    upper,
                    total: Num::ZERO,
                },
            );
        };
        // In units of the limit itself; of the largest coil's share where it is zero.
        let ampere = |i: usize| -self.current_scale(i);
        let unit = if total_a > 0.0 {
            exponent_of(total_a)
        } else {
            (0..self.coils).map(ampere).max().unwrap_or(0)
        };
        let mut weight: Vec<Num> = (0..self.coils)
            .map(|i| Num::of(power_of_two(ampere(i) - unit)))
            .collect();
        weight.push(Num::ONE);
        lower.push(Some(Num::ZERO));
        upper.push(None);
        (
            self.model(Some(weight)),
            Bounds {
                lower,
                upper,
                total: Num::of(times_power(total_a, -unit)),
            },
        )
    }

    /// The problem without the drivers' size: without a limit on the sum, and of every coil's
    /// limits only a zero that keeps the driver from reversing is left.
    pub(crate) fn unlimited(&self, problem: &ForceProblem) -> (Model, Bounds) {
        let directions = (0..self.coils).map(|i| problem.directions(i));
        let zero_unless = |goes: bool| (!goes).then_some(Num::ZERO);
        let bounds = Bounds {
            lower: directions.clone().map(|d| zero_unless(d.down)).collect(),
            upper: directions.map(|d| zero_unless(d.up)).collect(),
            total: Num::ZERO,
        };
        (self.model(None), bounds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_invert_powers_of_two() {
        for k in [-1074, -1030, -1022, -7, 0, 1, 700, 1023] {
            let value = times_power(1.0, k);
            assert_eq!(exponent_of(value), k);
            let kept = if k < -1030 { 1.0 } else { 0.75 };
            assert_eq!(times_power(times_power(0.75, k), -k), kept);
        }
        assert_eq!(exponent_of(-0.7), -1);
        assert_eq!(exponent_of(0.0), 0);
    }

    /// A column that is another one, a small share of a third, and next to nothing of its own.
    #[test]
    fn shares_within_rounding_are_left_out_whatever_the_columns_length() {
        let unit = f64::EPSILON;
        for length in [1.0, 1.9] {
            for (share, kept) in [(30.0 * unit, false), (100.0 * unit, true)] {
                let along = |v: [f64; 3]| v.map(|v| Num::of(v * length)).to_vec();
                let reduced = Reduced {
                    columns: vec![
                        along([1.0, 0.0, 0.0]),
                        along([0.0, 1.0, 0.0]),
                        along([1.0, share, 10.0 * unit]),
                    ],
                    scale: vec![0; 3],
                    coils: 3,
                    counted: vec![0, 1, 2],
                    force_scale: 0,
                    lambda_scale: 0,
                    epsilon: Num::EPSILON,
                };
                assert_eq!(reduced.rank(), 3);
                let Clean {
                    reduced: clean,
                    rank,
                    ..
                } = reduced.with_clean_dependences().unwrap();
                assert_eq!((rank, clean.rank()), (2, 2));
                assert_eq!(clean.rows(), 2);
                let requested = if kept { share } else { 0.0 };
                for (column, requested) in clean.columns.iter().zip([1.0, requested]) {
                    let found = Num::dot(column, &clean.columns[2]).to_f64();
                    let off = (found / length.powi(2) - requested).abs();
                    assert!(off < 1e-25, "{length} {share}: {off}");
                }
            }
        }
    }
}
