//! A bundle's map arranged for a control loop: all coils at one position in one pass.
//!
//! `[z, y, x, coil]`, already multiplied by the magnet's moment, so the 64 nodes that take part at
//! a position are 64 runs of neighbouring numbers. Values are those of
//! [`Bundle::force_per_ampere`] up to rounding. Nothing is allocated after [`ForceMap::new`].

use super::load::Bundle;
use crate::numerics::lagrange::{Stencil, stencil};

/// Upward force per ampere of every coil of an array, over a box.
#[derive(Debug, Clone)]
pub struct ForceMap {
    axes_m: [Vec<f64>; 3],
    coils: usize,
    /// Coils with a map, by index in the array.
    kept: Vec<usize>,
    /// `[z, y, x, kept coil]`, N/A.
    force_n_per_a: Vec<f64>,
    /// `[z, y, x]`, N.
    passive_n: Option<Vec<f64>>,
    /// The largest |force per ampere| of any coil on every plane of nodes, N/A.
    largest_n_per_a: Vec<f64>,
    /// Room for the kept coils' forces.
    sums: Vec<f64>,
}

impl ForceMap {
    /// Arranges the map of `bundle`.
    #[must_use]
    pub fn new(bundle: &Bundle) -> Self {
        let map = &bundle.map;
        let [kept, nz, ny, nx] = map.shape();
        let nodes = nz * ny * nx;
        let [m_x, m_y, m_z] = map.runtime.moment_a_m2;
        let gradient = map
            .gradient_t_per_m_per_a
            .as_deref()
            .filter(|_| m_x != 0.0 || m_y != 0.0);
        let mut force_n_per_a = vec![0.0; nodes * kept];
        for coil in 0..kept {
            for node in 0..nodes {
                let at = coil * nodes + node;
                force_n_per_a[node * kept + coil] = match gradient {
                    Some(g) => m_x * g[9 * at + 2] + m_y * g[9 * at + 5] + m_z * g[9 * at + 8],
                    None => m_z * map.gz_t_per_m_per_a[at],
                };
            }
        }
        let plane = (ny * nx * kept).max(1);
        let size = |most: f64, value: &f64| most.max(value.abs());
        Self {
            axes_m: [&map.x_m, &map.y_m, &map.z_m].map(|axis| axis.to_vec()),
            coils: bundle.coil_count(),
            kept: map.coil.iter().map(|&coil| coil as usize).collect(),
            largest_n_per_a: force_n_per_a
                .chunks(plane)
                .map(|values| values.iter().fold(0.0, size))
                .collect(),
            force_n_per_a,
            passive_n: map.passive_force_n.as_deref().map(<[f64]>::to_vec),
            sums: vec![0.0; kept],
        }
    }

    /// Coils of the array, those without a map included.
    #[must_use]
    pub fn coils(&self) -> usize {
        self.coils
    }

    /// The ends of the box along x, y and z, m.
    #[must_use]
    pub fn ends_m(&self) -> [[f64; 2]; 3] {
        let ends = |axis: &Vec<f64>| [axis[0], axis[axis.len() - 1]];
        [
            ends(&self.axes_m[0]),
            ends(&self.axes_m[1]),
            ends(&self.axes_m[2]),
        ]
    }

    /// Writes the upward force per ampere of every coil at (x, y, z) m, N/A, zero for coils
    /// without a map, and returns what the unpowered steel adds, N. Outside the map `None`, and
    /// nothing is written.
    ///
    /// # Panics
    /// When `force_n_per_a` is shorter than the array.
    pub fn at(&mut self, position_m: [f64; 3], force_n_per_a: &mut [f64]) -> Option<f64> {
        let [x, y, z] = &self.axes_m;
        let (row, rows) = (x.len(), y.len());
        let x = stencil(x, position_m[0])?;
        let y = stencil(y, position_m[1])?;
        let z = stencil(z, position_m[2])?;
        let kept = self.kept.len();
        self.sums.fill(0.0);
        let mut pull = 0.0;
        for (k, wz) in weights(&z) {
            for (j, wy) in weights(&y) {
                let first = (k * rows + j) * row + x.start;
                let line = &self.force_n_per_a[first * kept..(first + x.count) * kept];
                let share = wz * wy;
                for (values, wx) in line.chunks_exact(kept.max(1)).zip(&x.weights) {
                    let weight = share * wx;
                    for (sum, value) in self.sums.iter_mut().zip(values) {
                        *sum += weight * value;
                    }
                }
                if let Some(passive) = &self.passive_n {
                    let near = &passive[first..first + x.count];
                    let along: f64 = near.iter().zip(&x.weights).map(|(p, w)| p * w).sum();
                    pull += share * along;
                }
            }
        }
        let force = &mut force_n_per_a[..self.coils];
        if kept == self.coils {
            force.copy_from_slice(&self.sums);
        } else {
            force.fill(0.0);
            for (&coil, sum) in self.kept.iter().zip(&self.sums) {
                force[coil] = *sum;
            }
        }
        Some(pull)
    }

    /// The largest |force per ampere| of any coil on the planes of nodes around a height, N/A.
    #[must_use]
    pub fn largest_near_n_per_a(&self, z_m: f64) -> f64 {
        let nodes = &self.axes_m[2];
        let above = nodes.partition_point(|&node| node <= z_m);
        let around = above.saturating_sub(1)..(above + 1).min(nodes.len());
        self.largest_n_per_a[around]
            .iter()
            .copied()
            .fold(0.0, f64::max)
    }
}

/// Nodes that take part along an axis, with their weights.
fn weights(stencil: &Stencil) -> impl Iterator<Item = (usize, f64)> {
    let start = stencil.start;
    let weights = stencil.weights;
    (0..stencil.count).map(move |k| (start + k, weights[k]))
}
