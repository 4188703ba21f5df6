//! Functions of a magnet's distance from a core's axis and of its height, as Chebyshev series.
//!
//! All are even in the distance r. They are taken over y = 2 (t/T)^2 - 1, t = asinh(r/c), and
//! over ln(z - base): far from the core they vary slowly, and nodes crowd where they do not.

use std::f64::consts::PI;

/// The domain and the number of nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Scale c of the distances, m.
    pub scale_m: f64,
    /// Largest distance, m.
    pub far_m: f64,
    /// Height from which the logarithm counts, m; below `heights_m`.
    pub base_m: f64,
    /// Lowest and highest height, m.
    pub heights_m: [f64; 2],
    /// Nodes over the distance and over the height.
    pub nodes: [usize; 2],
}

/// A function's value and derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Value {
    /// f.
    pub value: f64,
    /// (1/r) df/dr, finite on the axis.
    pub slope_over_r: f64,
    /// df/dz.
    pub slope_z: f64,
}

impl Grid {
    fn stretch(&self) -> f64 {
        (self.far_m / self.scale_m).asinh()
    }

    fn logs(&self) -> [f64; 2] {
        self.heights_m.map(|z| (z - self.base_m).ln())
    }

    /// Node `k` of the distance.
    #[must_use]
    pub fn distance_m(&self, k: usize) -> f64 {
        let y = chebyshev_node(k, self.nodes[0]);
        self.scale_m * (self.stretch() * (0.5 * (1.0 + y)).sqrt()).sinh()
    }

    /// Node `k` of the height.
    #[must_use]
    pub fn height_m(&self, k: usize) -> f64 {
        let [lo, hi] = self.logs();
        let y = chebyshev_node(k, self.nodes[1]);
        self.base_m + (0.5 * (lo + hi) + 0.5 * (hi - lo) * y).exp()
    }
}

/// Several functions on one grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Tables {
    grid: Grid,
    functions: usize,
    /// [height, distance, function].
    coefficients: Vec<f64>,
}

impl Tables {
    /// From values [height, distance, function] on the grid's nodes.
    #[must_use]
    pub fn new(grid: Grid, functions: usize, values: &[f64]) -> Self {
        let [across, up] = grid.nodes;
        let mut half = vec![0.0; values.len()];
        for (from, to) in values
            .chunks(across * functions)
            .zip(half.chunks_mut(across * functions))
        {
            transform(from, to, across, functions);
        }
        let mut coefficients = vec![0.0; values.len()];
        transform(&half, &mut coefficients, up, across * functions);
        Self {
            grid,
            functions,
            coefficients,
        }
    }

    /// Size of the last coefficients over the distance and over the height, each relative to the
    /// largest of its function.
    #[must_use]
    pub fn tails(&self) -> [f64; 2] {
        let [across, up] = self.grid.nodes;
        let mut tails = [0.0_f64; 2];
        for f in 0..self.functions {
            let at =
                |j: usize, k: usize| self.coefficients[(j * across + k) * self.functions + f].abs();
            let mut last = [0.0_f64; 2];
            let mut largest = f64::MIN_POSITIVE;
            for j in 0..up {
                for k in 0..across {
                    largest = largest.max(at(j, k));
                    if k + 2 >= across {
                        last[0] = last[0].max(at(j, k));
                    }
                    if j + 2 >= up {
                        last[1] = last[1].max(at(j, k));
                    }
                }
            }
            for (tail, last) in tails.iter_mut().zip(last) {
                *tail = tail.max(last / largest);
            }
        }
        tails
    }

    /// Every function at a distance and height of the domain.
    #[must_use]
    pub fn at(&self, r_m: f64, z_m: f64) -> Vec<Value> {
        let grid = &self.grid;
        let [across, up] = grid.nodes;
        let stretch = grid.stretch();
        let t = (r_m / grid.scale_m).asinh();
        let y = 2.0 * (t / stretch) * (t / stretch) - 1.0;
        // dy/dr / r = 4 t/(r T^2) dt/dr.
        let t_over_r = if t < 1e-4 {
            1.0 / grid.scale_m
        } else {
            t / r_m
        };
        let rate_over_r = 4.0 * t_over_r / (stretch * stretch) / r_m.hypot(grid.scale_m);
        let [lo, hi] = grid.logs();
        let above = z_m - grid.base_m;
        let u = (2.0 * above.ln() - lo - hi) / (hi - lo);
        let rate_z = 2.0 / ((hi - lo) * above);
        let (mut t_r, mut d_r) = (vec![0.0; across], vec![0.0; across]);
        let (mut t_z, mut d_z) = (vec![0.0; up], vec![0.0; up]);
        polynomials(y, &mut t_r, &mut d_r);
        polynomials(u, &mut t_z, &mut d_z);
        let zero = Value {
            value: 0.0,
            slope_over_r: 0.0,
            slope_z: 0.0,
        };
        let mut out = vec![zero; self.functions];
        for (j, row) in self
            .coefficients
            .chunks(across * self.functions)
            .enumerate()
        {
            for (k, entries) in row.chunks(self.functions).enumerate() {
                let value = t_z[j] * t_r[k];
                let slope_over_r = rate_over_r * t_z[j] * d_r[k];
                let slope_z = rate_z * d_z[j] * t_r[k];
                for (to, c) in out.iter_mut().zip(entries) {
                    to.value += c * value;
                    to.slope_over_r += c * slope_over_r;
                    to.slope_z += c * slope_z;
                }
            }
        }
        out
    }
}

fn chebyshev_node(k: usize, count: usize) -> f64 {
    (PI * (k as f64 + 0.5) / count as f64).cos()
}

/// Values on `count` nodes to coefficients, for `width` functions side by side.
fn transform(values: &[f64], out: &mut [f64], count: usize, width: usize) {
    for k in 0..count {
        let norm = if k == 0 { 1.0 } else { 2.0 } / count as f64;
        for i in 0..count {
            let factor = norm * (PI * k as f64 * (i as f64 + 0.5) / count as f64).cos();
            for f in 0..width {
                out[k * width + f] += factor * values[i * width + f];
            }
        }
    }
}

/// T_k and T_k' at x.
fn polynomials(x: f64, values: &mut [f64], slopes: &mut [f64]) {
    for k in 0..values.len() {
        (values[k], slopes[k]) = match k {
            0 => (1.0, 0.0),
            1 => (x, 1.0),
            _ => (
                2.0 * x * values[k - 1] - values[k - 2],
                2.0 * values[k - 1] + 2.0 * x * slopes[k - 1] - slopes[k - 2],
            ),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_even_function_and_its_slopes() {
        let grid = Grid {
            scale_m: 0.013,
            far_m: 0.17,
            base_m: 0.002,
            heights_m: [0.011, 0.083],
            nodes: [40, 24],
        };
        let f = |r: f64, z: f64| (-1.7 * ((r * r + z * z) / 0.03f64.powi(2)).ln_1p()).exp();
        let mut values = Vec::new();
        for j in 0..grid.nodes[1] {
            for k in 0..grid.nodes[0] {
                let (r, z) = (grid.distance_m(k), grid.height_m(j));
                values.extend([f(r, z), z * z]);
            }
        }
        let tables = Tables::new(grid, 2, &values);
        for (r, z) in [(0.0, 0.03), (0.007, 0.011), (0.041, 0.027), (0.17, 0.083)] {
            let h = 1e-7;
            let found = tables.at(r, z);
            assert!((found[0].value - f(r, z)).abs() < 1e-8);
            let slope = (f(r, z + h) - f(r, z - h)) / (2.0 * h);
            assert!((found[0].slope_z - slope).abs() < 1e-5 * (1.0 + slope.abs()));
            let slope = (f(r + h, z) - f((r - h).abs(), z)) / (2.0 * h);
            assert!((r * found[0].slope_over_r - slope).abs() < 1e-5 * (1.0 + slope.abs()));
            assert!((found[1].slope_z - 2.0 * z).abs() < 1e-8);
        }
        assert!(
            tables.tails().iter().all(|t| *t < 1e-7),
            "{:?}",
            tables.tails()
        );
    }
}
