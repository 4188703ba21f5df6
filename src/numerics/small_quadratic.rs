//! Convex quadratic programmes in three variables, solved by trying every active set.
//!
//! minimise 1/2 d'Bd + g'd with a_j'd <= b_j (or = b_j), B positive definite. With three
//! variables at most three rows are independent, so a dozen rows have a few hundred active sets:
//! the first that satisfies all optimality conditions is the solution, without a tolerance on
//! progress and without cycling.

use crate::vec3::dot;

/// One row a'd <= b, or a'd = b.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// a.
    pub normal: [f64; 3],
    /// b.
    pub limit: f64,
    /// Whether it must hold with equality.
    pub equality: bool,
}

/// The minimiser and the multiplier of every row.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// d.
    pub step: [f64; 3],
    /// One a row; not negative for inequalities.
    pub multipliers: Vec<f64>,
}

/// Relative slack within which a row counts as met.
const SLACK: f64 = 1e-10;
/// Relative size of a determinant that counts as zero.
const SINGULAR: f64 = 1e-13;

/// Solutions for the rows' remainders. Each wins back the digits that the first one lost where rows
/// are nearly parallel: twice those of their angle.
const ROUNDS: usize = 3;

/// The minimiser; `None` where the rows contradict each other, or B is not positive definite.
#[must_use]
pub fn minimise(b: [[f64; 3]; 3], g: [f64; 3], rows: &[Row]) -> Option<Minimum> {
    let columns: Vec<[f64; 3]> = rows
        .iter()
        .map(|row| solve3(b, row.normal))
        .collect::<Option<_>>()?;
    let free = solve3(b, g.map(|v| -v))?;
    let fixed: Vec<usize> = (0..rows.len()).filter(|&j| rows[j].equality).collect();
    let others: Vec<usize> = (0..rows.len()).filter(|&j| !rows[j].equality).collect();
    if fixed.len() > 3 {
        return None;
    }
    let room = 3 - fixed.len();
    let mut search = Search {
        rows,
        columns,
        free,
        b,
        g,
        best: None,
    };
    let none = [usize::MAX; 3];
    let count = others.len();
    for size in 0..=room {
        let mut pick = none;
        let firsts = if size > 0 { count } else { 1 };
        for i in 0..firsts {
            let seconds = if size > 1 { i + 1..count } else { 0..1 };
            for j in seconds {
                let thirds = if size > 2 { j + 1..count } else { 0..1 };
                for k in thirds {
                    for (slot, index) in pick.iter_mut().zip([i, j, k]).take(size) {
                        *slot = others[index];
                    }
                    let mut active = fixed.clone();
                    active.extend_from_slice(&pick[..size]);
                    if let Some(minimum) = search.try_active(&active) {
                        return Some(minimum);
                    }
                }
            }
        }
    }
    search.best.map(|(_, minimum)| minimum)
}

struct Search<'a> {
    rows: &'a [Row],
    /// B^-1 a_j.
    columns: Vec<[f64; 3]>,
    /// -B^-1 g.
    free: [f64; 3],
    b: [[f64; 3]; 3],
    g: [f64; 3],
    /// The best point that meets all rows: taken where rounding hides every exact optimum.
    best: Option<(f64, Minimum)>,
}

impl Search<'_> {
    fn try_active(&mut self, active: &[usize]) -> Option<Minimum> {
        let size = active.len();
        // Rows that are not used keep the identity.
        let mut matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for (i, &row) in active.iter().enumerate() {
            for (j, &column) in active.iter().enumerate() {
                matrix[i][j] = dot(self.rows[row].normal, self.columns[column]);
            }
        }
        let (mut lambda, mut step) = ([0.0; 3], self.free);
        for _ in 0..ROUNDS {
            let mut right = [0.0; 3];
            for (value, &row) in right.iter_mut().zip(active) {
                *value = dot(self.rows[row].normal, step) - self.rows[row].limit;
            }
            let change = solve3(matrix, right)?;
            for (i, &row) in active.iter().enumerate() {
                lambda[i] += change[i];
                for (value, column) in step.iter_mut().zip(self.columns[row]) {
                    *value -= change[i] * column;
                }
            }
        }
        let length = dot(step, step).sqrt();
        let met = self.rows.iter().all(|row| {
            let size = dot(row.normal, row.normal).sqrt();
            let excess = dot(row.normal, step) - row.limit;
            let excess = if row.equality { excess.abs() } else { excess };
            excess <= SLACK * (size * (1.0 + length) + row.limit.abs())
        });
        if !met {
            return None;
        }
        let mut multipliers = vec![0.0; self.rows.len()];
        let mut signed = true;
        for (i, &row) in active.iter().enumerate().take(size) {
            multipliers[row] = lambda[i];
            signed &= self.rows[row].equality || lambda[i] >= 0.0;
        }
        let minimum = Minimum { step, multipliers };
        if signed {
            return Some(minimum);
        }
        let curved = self.b.map(|row| dot(row, step));
        let value = 0.5 * dot(curved, step) + dot(self.g, step);
        if self.best.as_ref().is_none_or(|(best, _)| value < *best) {
            self.best = Some((value, minimum));
        }
        None
    }
}

/// Solves a 3 x 3 system by elimination with complete row scaling; `None` where singular.
#[must_use]
pub(crate) fn solve3(mut m: [[f64; 3]; 3], mut r: [f64; 3]) -> Option<[f64; 3]> {
    let scale = m.map(|row| row.iter().fold(0.0_f64, |s, v| s.max(v.abs())));
    for (k, &size) in scale.iter().enumerate() {
        if !(size > 0.0 && size.is_finite()) {
            return None;
        }
        r[k] /= size;
        m[k] = m[k].map(|v| v / size);
    }
    for k in 0..3 {
        let pivot = (k..3).max_by(|&i, &j| m[i][k].abs().total_cmp(&m[j][k].abs()))?;
        if m[pivot][k].abs() < SINGULAR {
            return None;
        }
        m.swap(k, pivot);
        r.swap(k, pivot);
        for i in k + 1..3 {
            let factor = m[i][k] / m[k][k];
            let pivot = m[k];
            for (value, above) in m[i].iter_mut().zip(pivot).skip(k) {
                *value -= factor * above;
            }
            r[i] -= factor * r[k];
        }
    }
    let mut x = [0.0; 3];
    for k in (0..3).rev() {
        let rest: f64 = (k + 1..3).map(|j| m[k][j] * x[j]).sum();
        x[k] = (r[k] - rest) / m[k][k];
    }
    Some(x)
}
