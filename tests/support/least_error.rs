//! The minimum by exhaustive search over all active sets, in double-double.

use fluxform_numerics::real::Real;

use crate::force_problems::{Case, D, d};

/// `G'G`, `G'h` and `G'offset` in double-double, formed once for all searches.
pub struct Search<'a> {
    case: &'a Case,
    /// G'G.
    pub gram: Vec<Vec<D>>,
    pull: Vec<D>,
    push: Vec<D>,
}

impl<'a> Search<'a> {
    pub fn new(case: &'a Case) -> Self {
        let m = case.coils();
        let column = |i: usize| -> Vec<D> {
            case.forces
                .iter()
                .skip(i)
                .step_by(m)
                .map(|&v| d(v))
                .collect()
        };
        let columns: Vec<Vec<D>> = (0..m).map(column).collect();
        let heights: Vec<D> = case.heights.iter().map(|&v| d(v)).collect();
        let offset: Vec<D> = (0..case.heights.len())
            .map(|j| d(case.offset.as_ref().map_or(0.0, |o| o[j])))
            .collect();
        Self {
            case,
            gram: columns
                .iter()
                .map(|a| columns.iter().map(|b| D::dot(a, b)).collect())
                .collect(),
            pull: columns.iter().map(|a| D::dot(a, &heights)).collect(),
            push: columns.iter().map(|a| D::dot(a, &offset)).collect(),
        }
    }

    /// The least error over every choice of coils at a limit or free and of the sum at its
    /// limit or not: the minimum is the best of those that keep within the limits.
    pub fn least_error(&self, lambda: f64, limited: bool) -> f64 {
        let m = self.case.coils();
        let mut best: Option<D> = None;
        for code in 0..3_usize.pow(m as u32) {
            let place: Vec<usize> = (0..m).map(|i| code / 3_usize.pow(i as u32) % 3).collect();
            if !limited && place.contains(&1) {
                continue;
            }
            for sum_is_met in [false, true] {
                if sum_is_met && (!limited || self.case.total.is_none()) {
                    continue;
                }
                let Some(x) = self.stationary(lambda, &place, sum_is_met, limited) else {
                    continue;
                };
                if self.keeps_within(&x, limited) {
                    let e = self.case.error(d(lambda), &x);
                    if best.is_none_or(|b| e < b) {
                        best = Some(e);
                    }
                }
            }
        }
        best.expect("zero currents are always possible").nearest()
    }

    /// Whether zero keeps coil `i`'s driver from going below (or above) it, whatever its size.
    fn one_way(&self, i: usize) -> (bool, bool) {
        let pulls = self.case.lower[i] < 0.0;
        (!pulls, pulls && self.case.upper[i] == 0.0)
    }

    pub fn keeps_within(&self, x: &[D], limited: bool) -> bool {
        let slip = d(1e-24);
        let size = x
            .iter()
            .zip(&self.case.upper)
            .fold(D::ZERO, |s, (v, &u)| s + Real::abs(*v) + d(u));
        let within = (0..x.len()).all(|i| {
            let (low, high) = (d(self.case.lower[i]), d(self.case.upper[i]));
            let (of_low, of_high) = if limited {
                (true, true)
            } else {
                self.one_way(i)
            };
            (!of_low || x[i] >= low - slip * (size + Real::abs(low)))
                && (!of_high || x[i] <= high + slip * (size + high))
        });
        let sum = x.iter().fold(D::ZERO, |s, v| s + *v);
        let total = self.case.total.filter(|_| limited);
        within && total.is_none_or(|t| sum <= d(t) + slip * (size + d(t)))
    }

    /// Gaussian elimination on the normal equations of the free coils; `None` if singular.
    /// Coils that are not free rest at a limit, or at zero without the drivers' size.
    pub fn stationary(
        &self,
        lambda: f64,
        place: &[usize],
        sum_is_met: bool,
        limited: bool,
    ) -> Option<Vec<D>> {
        let m = place.len();
        let mut x: Vec<D> = (0..m)
            .map(|i| match place[i] {
                0 if limited => d(self.case.lower[i]),
                1 => d(self.case.upper[i]),
                _ => D::ZERO,
            })
            .collect();
        let free: Vec<usize> = (0..m).filter(|&i| place[i] == 2).collect();
        let size = free.len() + usize::from(sum_is_met);
        let mut rows: Vec<Vec<D>> = Vec::new();
        for &i in &free {
            // Rows and columns scaled to a unit diagonal.
            let scale = |k: usize| Real::sqrt(self.gram[k][k]);
            if scale(i) <= D::ZERO {
                return None;
            }
            let mut row: Vec<D> = free
                .iter()
                .map(|&k| self.gram[i][k] / (scale(i) * scale(k)))
                .collect();
            let mut right = d(lambda) * self.pull[i] - self.push[i];
            for k in (0..m).filter(|k| !free.contains(k)) {
                right -= self.gram[i][k] * x[k];
            }
            if sum_is_met {
                row.push(D::ONE / scale(i));
            }
            row.push(right / scale(i));
            rows.push(row);
        }
        if sum_is_met {
            let mut row: Vec<D> = free
                .iter()
                .map(|&k| D::ONE / Real::sqrt(self.gram[k][k]))
                .collect();
            let left = x.iter().fold(d(self.case.total?), |s, &v| s - v);
            row.extend([D::ZERO, left]);
            rows.push(row);
        }
        let solution = eliminate(rows, size)?;
        for (k, &i) in free.iter().enumerate() {
            x[i] = solution[k] / Real::sqrt(self.gram[i][i]);
        }
        Some(x)
    }
}

pub fn eliminate(mut rows: Vec<Vec<D>>, size: usize) -> Option<Vec<D>> {
    for row in &mut rows {
        let most = row[..size]
            .iter()
            .fold(D::ZERO, |s, v| s.larger(Real::abs(*v)));
        if most <= D::ZERO {
            return None;
        }
        for v in row.iter_mut() {
            *v = *v / most;
        }
    }
    for k in 0..size {
        let pivot = (k..size).reduce(|a, b| {
            if Real::abs(rows[b][k]) > Real::abs(rows[a][k]) {
                b
            } else {
                a
            }
        })?;
        rows.swap(k, pivot);
        if Real::abs(rows[k][k]) < d(1e-25) {
            return None;
        }
        let (above, below) = rows.split_at_mut(k + 1);
        let top = &above[k];
        for row in below {
            let factor = row[k] / top[k];
            D::add_scaled(&mut row[k..], -factor, &top[k..]);
        }
    }
    let mut x = vec![D::ZERO; size];
    for k in (0..size).rev() {
        let known = (k + 1..size).fold(rows[k][size], |s, j| s - rows[k][j] * x[j]);
        x[k] = known / rows[k][k];
    }
    Some(x)
}

impl Search<'_> {
    pub fn keeps_within_doubles(&self, x: &[D]) -> bool {
        let within =
            (0..x.len()).all(|i| x[i] >= d(self.case.lower[i]) && x[i] <= d(self.case.upper[i]));
        let sum = x.iter().fold(0.0, |s, v| s + v.nearest());
        let size = x.iter().fold(0.0, |s, v| s + v.nearest().abs());
        within && self.case.total.is_none_or(|t| sum <= t + 2e-14 * size)
    }

    /// `(e* - e_0) / (lambda^2 mean(h^2))`.
    pub fn excess(&self, lambda: f64) -> f64 {
        let scale = lambda * lambda * self.case.mean_square();
        (self.least_error(lambda, true) - self.least_error(lambda, false)) / scale
    }
}
