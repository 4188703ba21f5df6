//! Piecewise Chebyshev tables of a function of one variable.

use std::f64::consts::PI;

use super::dispatch::{Kernel, LANES, Lanes};

/// Equal panels over an interval, each with one Chebyshev series of the same degree.
#[derive(Debug, Clone)]
pub struct Table {
    from: f64,
    width: f64,
    terms: usize,
    /// [panel][term]
    coefficients: Vec<f64>,
}

/// Where a table's function must be known: the Chebyshev points of every panel.
#[derive(Debug, Clone)]
pub struct Layout {
    from: f64,
    width: f64,
    panels: usize,
    terms: usize,
}

impl Layout {
    /// Panels over `from..to` for a function whose singularities keep a distance of at least
    /// `distance` from every real point, with interpolation error below `tolerance` times the
    /// function's size. `None` when that would take more than `most` nodes.
    ///
    /// With panels of half-width h the singularities lie outside the ellipse of Bernstein
    /// radius rho = d/h + sqrt(1 + (d/h)^2), and n terms leave an error below 16 rho^(-n)
    /// (Trefethen, Approximation Theory and Approximation Practice, theorem 8.2).
    #[must_use]
    pub fn new(from: f64, to: f64, distance: f64, tolerance: f64, most: usize) -> Option<Self> {
        const PANEL_SHARE: f64 = 3.0;
        let panels = ((to - from) * PANEL_SHARE / (2.0 * distance))
            .ceil()
            .max(1.0);
        if !(distance > 0.0 && panels < most as f64) {
            return None;
        }
        let width = (to - from) / panels;
        let ratio = 2.0 * distance / width.max(f64::MIN_POSITIVE);
        let radius = ratio + ratio.hypot(1.0);
        let terms = ((16.0 / tolerance).ln() / radius.ln()).ceil().max(1.0) as usize + 1;
        let layout = Self {
            from,
            width,
            panels: panels as usize,
            terms,
        };
        (layout.panels * layout.terms <= most).then_some(layout)
    }

    /// The nodes, panel by panel.
    #[must_use]
    #[inline]
    pub fn nodes(&self) -> Vec<f64> {
        let n = self.terms as f64;
        (0..self.panels)
            .flat_map(|panel| {
                (0..self.terms).map(move |k| {
                    let x = (PI * (k as f64 + 0.5) / n).cos();
                    self.from + self.width * (panel as f64 + 0.5 + 0.5 * x)
                })
            })
            .collect()
    }

    /// The table from the function's values at [`Layout::nodes`].
    #[must_use]
    pub fn table(&self, values: &[f64]) -> Table {
        let n = self.terms;
        let cosines: Vec<f64> = (0..n * n)
            .map(|place| (PI * (place / n) as f64 * ((place % n) as f64 + 0.5) / n as f64).cos())
            .collect();
        let mut coefficients = Vec::with_capacity(values.len());
        for panel in values.chunks_exact(n) {
            for (j, cosines) in cosines.chunks_exact(n).enumerate() {
                let sum: f64 = panel.iter().zip(cosines).map(|(f, c)| f * c).sum();
                coefficients.push(sum * if j == 0 { 1.0 } else { 2.0 } / n as f64);
            }
        }
        Table {
            from: self.from,
            width: self.width,
            terms: n,
            coefficients,
        }
    }
}

impl Table {
    /// The value at `x`, within the table's interval.
    #[must_use]
    #[inline]
    pub fn at(&self, x: f64) -> f64 {
        let panels = self.coefficients.len() / self.terms;
        let place = (x - self.from) / self.width;
        let panel = (place.max(0.0) as usize).min(panels - 1);
        let series = &self.coefficients[panel * self.terms..(panel + 1) * self.terms];
        let x = 2.0 * (place - panel as f64) - 1.0;
        let (mut newer, mut older) = (0.0, 0.0);
        for c in series[1..].iter().rev() {
            (newer, older) = (2.0 * x * newer - older + c, newer);
        }
        x * newer - older + series[0]
    }
}

/// Evaluates a [`Table`] at ascending points.
pub struct Evaluation<'a> {
    /// The table.
    pub table: &'a Table,
    /// Points, ascending, within the table's interval.
    pub points: &'a [f64],
    /// Values, one per point.
    pub out: &'a mut [f64],
}

impl Kernel for Evaluation<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let Self { table, points, out } = self;
        let panels = table.coefficients.len() / table.terms;
        let mut start = 0;
        for panel in 0..panels {
            let upper = table.from + table.width * (panel + 1) as f64;
            let count = if panel + 1 == panels {
                points.len() - start
            } else {
                points[start..].partition_point(|x| *x < upper)
            };
            let series = &table.coefficients[panel * table.terms..(panel + 1) * table.terms];
            let middle = table.from + table.width * (panel as f64 + 0.5);
            let end = start + count;
            for first in (start..end).step_by(LANES) {
                let last = (first + LANES).min(end);
                let x = (Lanes::load(&points[first..last]) - middle) * (2.0 / table.width);
                clenshaw::<FMA>(series, x).store(&mut out[first..last]);
            }
            start = end;
        }
    }
}

/// Evaluates tables of one [`Layout`] at points in any order.
pub struct Scattered<'a> {
    /// The tables, of one layout.
    pub tables: &'a [Table],
    /// Points within the tables' interval.
    pub points: &'a [f64],
    /// Values, `[table][point]`.
    pub out: &'a mut [f64],
}

impl Kernel for Scattered<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let Self {
            tables,
            points,
            out,
        } = self;
        let Some(first) = tables.first() else {
            return;
        };
        let (terms, last) = (first.terms, first.coefficients.len() / first.terms - 1);
        for (group, points_here) in points.chunks(LANES).enumerate() {
            let place = (Lanes::load(points_here) - first.from) * (1.0 / first.width);
            let panels = place.0.map(|at| (at.max(0.0) as usize).min(last));
            let mut x = place;
            for (x, panel) in x.0.iter_mut().zip(panels) {
                *x = 2.0 * (*x - panel as f64) - 1.0;
            }
            let twice = x * 2.0;
            for (table, out) in tables.iter().zip(out.chunks_exact_mut(points.len())) {
                let mut series = [&table.coefficients[..0]; LANES];
                for (series, panel) in series.iter_mut().zip(panels) {
                    *series = &table.coefficients[panel * terms..(panel + 1) * terms];
                }
                let (mut newer, mut older) = (Lanes::splat(0.0), Lanes::splat(0.0));
                for k in (1..terms).rev() {
                    let next = twice.mul_add::<FMA>(newer, coefficients(&series, k) - older);
                    (newer, older) = (next, newer);
                }
                let value = x.mul_add::<FMA>(newer, coefficients(&series, 0) - older);
                let range = group * LANES..(group * LANES + points_here.len());
                value.store(&mut out[range]);
            }
        }
    }
}

/// Coefficient `k` of every lane's series.
#[inline(always)]
fn coefficients(series: &[&[f64]; LANES], k: usize) -> Lanes {
    let mut out = Lanes::splat(0.0);
    for (value, series) in out.0.iter_mut().zip(series) {
        *value = series[k];
    }
    out
}

/// Sum of c_k T_k(x) by Clenshaw's recurrence.
#[inline(always)]
fn clenshaw<const FMA: bool>(series: &[f64], x: Lanes) -> Lanes {
    let twice = x * 2.0;
    let (mut newer, mut older) = (Lanes::splat(0.0), Lanes::splat(0.0));
    for c in series[1..].iter().rev() {
        let next = twice.mul_add::<FMA>(newer, Lanes::splat(*c) - older);
        (newer, older) = (next, newer);
    }
    x.mul_add::<FMA>(newer, Lanes::splat(series[0]) - older)
}
