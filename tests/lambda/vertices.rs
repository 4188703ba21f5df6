//! The least largest error by trying every vertex, in double-double.

use fluxform_numerics::real::Real;

use fluxform_testing::force_problems::{Case, D, d};

/// `a . (x, t) >= constant + lambda slope`.
type Row = (Vec<D>, D, D);

/// `sign G I + offset >= lambda height` at a point.
pub struct Demand {
    pub point: usize,
    pub sign: f64,
    pub height: f64,
    pub offset: f64,
}

/// A.
const BEYOND: f64 = 1e12;

/// The rows of a case's limits.
fn limits(case: &Case, limited: bool) -> Vec<Row> {
    let m = case.coils();
    let mut rows = Vec::new();
    let unit = |i: usize, v: f64| {
        let mut row = vec![D::ZERO; m + 1];
        row[i] = d(v);
        row
    };
    for i in 0..m {
        // Without the drivers' size only a zero that keeps a driver from reversing is left; beyond
        // any current of interest a limit makes sure of a vertex.
        let (low, high) = (case.lower[i], case.upper[i]);
        let size = |v: f64, open: bool| {
            if limited || !open {
                v
            } else {
                v.signum() * BEYOND
            }
        };
        let down = low < 0.0;
        let up = high > 0.0 || !down;
        rows.push((unit(i, 1.0), d(size(low, down)), D::ZERO));
        if limited || down {
            rows.push((unit(i, -1.0), d(-size(high, up)), D::ZERO));
        }
    }
    if let (true, Some(total)) = (limited, case.total) {
        let row = (0..=m)
            .map(|i| if i < m { d(-1.0) } else { D::ZERO })
            .collect();
        rows.push((row, d(-total), D::ZERO));
    }
    rows
}

/// Rows `a . (x, t) >= constant + lambda slope` of the worst-point program.
pub struct Vertices {
    rows: Vec<Row>,
    width: usize,
}

impl Vertices {
    /// With all limits, or without the drivers' size.
    pub fn new(case: &Case, limited: bool) -> Self {
        let m = case.coils();
        let mut rows = Vec::new();
        for (j, &h) in case.heights.iter().enumerate() {
            let offset = case.offset.as_ref().map_or(0.0, |o| o[j]);
            for sign in [1.0, -1.0] {
                let force = |i: usize| d(sign * case.forces[j * m + i]);
                let row: Vec<D> = (0..m).map(force).chain([D::ONE]).collect();
                rows.push((row, d(-sign * offset), d(sign * h)));
            }
        }
        rows.extend(limits(case, limited));
        Self { rows, width: m + 1 }
    }

    /// The largest lambda that meets all demands within the limits; `scale` is the size of forces.
    pub fn largest(case: &Case, demands: &[Demand], scale: f64) -> f64 {
        let m = case.coils();
        let mut rows: Vec<Row> = demands
            .iter()
            .map(|demand| {
                let force = |i: usize| d(demand.sign * case.forces[demand.point * m + i]);
                let row = (0..m).map(force).chain([d(demand.height)]).collect();
                (row, d(-demand.offset), D::ZERO)
            })
            .collect();
        rows.extend(limits(case, true));
        let width = m + 1;
        -Self { rows, width }.least(0.0, scale)
    }

    /// The least t at `lambda`; `scale` is the size of forces.
    pub fn least(&self, lambda: f64, scale: f64) -> f64 {
        let bounds: Vec<D> = self
            .rows
            .iter()
            .map(|(_, c, s)| *c + d(lambda) * *s)
            .collect();
        let mut best = f64::INFINITY;
        let mut chosen: Vec<usize> = (0..self.width).collect();
        loop {
            if let Some(z) = self.solve(&chosen, &bounds) {
                let t = z[self.width - 1].nearest();
                let met = |(row, bound): (&(Vec<D>, D, D), &D)| {
                    (D::dot(&row.0, &z) - *bound).nearest() >= -1e-15 * scale
                };
                if t < best && self.rows.iter().zip(&bounds).all(met) {
                    best = t;
                }
            }
            // The next combination.
            let n = self.rows.len();
            let Some(k) = (0..self.width)
                .rev()
                .find(|&k| chosen[k] < n - self.width + k)
            else {
                return best;
            };
            chosen[k] += 1;
            for l in k + 1..self.width {
                chosen[l] = chosen[l - 1] + 1;
            }
        }
    }

    fn solve(&self, chosen: &[usize], bounds: &[D]) -> Option<Vec<D>> {
        let n = self.width;
        let mut a: Vec<Vec<D>> = chosen
            .iter()
            .map(|&r| self.rows[r].0.iter().copied().chain([bounds[r]]).collect())
            .collect();
        for k in 0..n {
            let size = |l: usize| Real::abs(a[l][k]).nearest();
            let best = (k..n).reduce(|p, q| if size(q) > size(p) { q } else { p })?;
            a.swap(k, best);
            if Real::abs(a[k][k]).nearest() < 1e-22 {
                return None;
            }
            let pivot = a[k].clone();
            for row in a.iter_mut().skip(k + 1) {
                let factor = row[k] / pivot[k];
                D::add_scaled(row, -factor, &pivot);
            }
        }
        let mut z = vec![D::ZERO; n];
        for k in (0..n).rev() {
            let known = (k + 1..n).fold(a[k][n], |s, l| s - a[k][l] * z[l]);
            z[k] = known / a[k][k];
        }
        Some(z)
    }
}
