//! A bundle's map arranged for a control loop: all coils at one position in one pass.
//!
//! `[z, y, x, coil]`, already multiplied by the magnet's moment, the coils in groups of four: the
//! 64 nodes that take part at a position are 64 runs of neighbouring numbers, and a group's sums
//! stay in registers. Values are those of
//! [`Bundle::force_per_ampere`] up to rounding. Nothing is allocated after [`ForceMap::new`].

use super::load::Bundle;
use super::npz::MapArrays;
use fluxform_numerics::lagrange::{ORDER_NODES, Stencil, around, beside, stencil};

/// Coils summed together.
const GROUP: usize = 4;
/// The most nodes that take part at a position.
const MOST_NODES: usize = ORDER_NODES * ORDER_NODES * ORDER_NODES;

/// Upward force per ampere of every coil of an array, over a box.
#[derive(Debug, Clone)]
pub struct ForceMap {
    axes_m: [Vec<f64>; 3],
    coils: usize,
    /// Coils with a map, by index in the array.
    kept: Vec<usize>,
    /// `[z, y, x, group of kept coils]`, N/A; beyond the last coil zero.
    force_n_per_a: Vec<[f64; GROUP]>,
    /// The same along x and y, where the bundle holds them.
    sides_n_per_a: Option<[Vec<[f64; GROUP]>; 2]>,
    /// `[z, y, x]`, N.
    passive_n: Option<Vec<f64>>,
    /// The largest |force per ampere| along x, y and z of any coil on every plane of nodes, N/A.
    largest_n_per_a: Vec<[f64; 3]>,
}

impl ForceMap {
    /// Arranges the map of `bundle`.
    #[must_use]
    pub fn new(bundle: &Bundle) -> Self {
        Self::of_map(&bundle.map)
    }

    /// Arranges `map`.
    #[must_use]
    pub fn of_map(map: &MapArrays) -> Self {
        let [kept, nz, ny, nx] = map.shape();
        let nodes = nz * ny * nx;
        let [m_x, m_y, m_z] = map.runtime.moment_a_m2;
        let gradient = map
            .gradient_t_per_m_per_a
            .as_deref()
            .filter(|_| m_x != 0.0 || m_y != 0.0);
        let groups = kept.div_ceil(GROUP);
        let arranged = |axis: usize, along_z: &[f64]| {
            let mut force_n_per_a = vec![[0.0; GROUP]; nodes * groups];
            for coil in 0..kept {
                for node in 0..nodes {
                    let at = coil * nodes + node;
                    force_n_per_a[node * groups + coil / GROUP][coil % GROUP] = match gradient {
                        Some(g) => {
                            let column = &g[9 * at..9 * at + 9];
                            m_x * column[axis] + m_y * column[3 + axis] + m_z * column[6 + axis]
                        }
                        None => m_z * along_z[at],
                    };
                }
            }
            force_n_per_a
        };
        let force_n_per_a = arranged(2, &map.gz_t_per_m_per_a);
        let sides = map.sides();
        let plane = ny * nx * groups;
        let size = |most: f64, value: &f64| most.max(value.abs());
        let sides_n_per_a = sides.map(|[gx, gy]| [arranged(0, gx), arranged(1, gy)]);
        let largest = |level: usize| {
            [0, 1, 2].map(|axis| {
                let values = match (&sides_n_per_a, axis) {
                    (_, 2) => &force_n_per_a,
                    (Some(sides), _) => &sides[axis],
                    (None, _) => return 0.0,
                };
                let plane = &values[level * plane..(level + 1) * plane];
                plane.as_flattened().iter().fold(0.0, size)
            })
        };
        Self {
            axes_m: [&map.x_m, &map.y_m, &map.z_m].map(|axis| axis.to_vec()),
            coils: map.runtime.current_max_a.len(),
            kept: map.coil.iter().map(|&coil| coil as usize).collect(),
            largest_n_per_a: (0..nz).map(largest).collect(),
            force_n_per_a,
            sides_n_per_a,
            passive_n: map.passive_force_n.as_deref().map(<[f64]>::to_vec),
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
    pub fn at(&self, position_m: [f64; 3], force_n_per_a: &mut [f64]) -> Option<f64> {
        let near = self.near(position_m)?;
        let force = &mut force_n_per_a[..self.coils];
        if self.kept.len() < self.coils {
            force.fill(0.0);
        }
        self.each_sum(&near, &self.force_n_per_a, |coil, sum| force[coil] = sum);
        Some(self.pull_n(&near))
    }

    /// Whether the map holds all three components of the force.
    #[must_use]
    pub fn has_vectors(&self) -> bool {
        self.sides_n_per_a.is_some()
    }

    /// As [`ForceMap::at`], along x, y and z; `None` also where the map holds the upward component alone.
    ///
    /// # Panics
    /// When `force_n_per_a` is shorter than the array.
    pub fn vectors_at(&self, position_m: [f64; 3], force_n_per_a: &mut [[f64; 3]]) -> Option<f64> {
        let [along_x, along_y] = self.sides_n_per_a.as_ref()?;
        let near = self.near(position_m)?;
        let force = &mut force_n_per_a[..self.coils];
        if self.kept.len() < self.coils {
            force.fill([0.0; 3]);
        }
        for (axis, values) in [along_x, along_y, &self.force_n_per_a]
            .into_iter()
            .enumerate()
        {
            self.each_sum(&near, values, |coil, sum| force[coil][axis] = sum);
        }
        Some(self.pull_n(&near))
    }

    /// The nodes that take part at a position; `None` outside.
    fn near(&self, position_m: [f64; 3]) -> Option<Near> {
        Some(self.nodes_of(&self.stencils(position_m)?))
    }

    fn stencils(&self, position_m: [f64; 3]) -> Option<[Stencil; 3]> {
        let [x, y, z] = &self.axes_m;
        Some([
            stencil(x, position_m[0])?,
            stencil(y, position_m[1])?,
            stencil(z, position_m[2])?,
        ])
    }

    /// The nodes of stencils along x, y and z.
    fn nodes_of(&self, [x, y, z]: &[Stencil; 3]) -> Near {
        let [row, rows] = [self.axes_m[0].len(), self.axes_m[1].len()];
        let mut near = Near {
            nodes: [(0, 0.0); MOST_NODES],
            count: 0,
        };
        for k in 0..z.count {
            for j in 0..y.count {
                let share = z.weights[k] * y.weights[j];
                let first = ((z.start + k) * rows + y.start + j) * row + x.start;
                for i in 0..x.count {
                    near.nodes[near.count] = (first + i, share * x.weights[i]);
                    near.count += 1;
                }
            }
        }
        near
    }

    /// About how far the interpolated force of currents and of the unpowered steel may be off along x, y and z, N:
    /// where nodes beside those that take part ([`beside`]) would put it, two to four times the error where the map
    /// resolves the field. Along x and y 0 where the map holds the upward component alone. `None` outside the map.
    #[must_use]
    pub fn interpolation_error_n(
        &self,
        position_m: [f64; 3],
        currents_a: &[f64],
    ) -> Option<[f64; 3]> {
        let stencils = self.stencils(position_m)?;
        let mut error_n = [0.0; 3];
        for (axis, error_n) in error_n.iter_mut().enumerate() {
            let each_n = |stencils: &[Stencil; 3]| {
                let near = self.nodes_of(stencils);
                let mut each_n = vec![0.0; self.coils + 1];
                let values = match (&self.sides_n_per_a, axis) {
                    (_, 2) => &self.force_n_per_a,
                    (Some(sides), _) => &sides[axis],
                    (None, _) => return each_n,
                };
                self.each_sum(&near, values, |coil, sum| {
                    each_n[coil] = sum * currents_a[coil]
                });
                if axis == 2 {
                    each_n[self.coils] = self.pull_n(&near);
                }
                each_n
            };
            let given_n = each_n(&stencils);
            let off_n = |along: usize, other: Stencil| -> f64 {
                let mut stencils = stencils;
                stencils[along] = other;
                let terms = each_n(&stencils).into_iter().zip(&given_n);
                terms.map(|(other, given)| (other - given).abs()).sum()
            };
            for (along, nodes) in self.axes_m.iter().enumerate() {
                let others = beside(nodes, position_m[along]).into_iter();
                *error_n += others.map(|other| off_n(along, other)).fold(0.0, f64::max);
            }
        }
        Some(error_n)
    }

    /// Hands the interpolated value of every coil with a map to `put`.
    fn each_sum(&self, near: &Near, values: &[[f64; GROUP]], mut put: impl FnMut(usize, f64)) {
        let groups = self.kept.len().div_ceil(GROUP);
        for (group, coils) in self.kept.chunks(GROUP).enumerate() {
            let mut sums = [0.0; GROUP];
            for &(node, weight) in near.nodes() {
                let values = &values[node * groups + group];
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum += weight * value;
                }
            }
            for (&coil, sum) in coils.iter().zip(sums) {
                put(coil, sum);
            }
        }
    }

    fn pull_n(&self, near: &Near) -> f64 {
        self.passive_n.as_ref().map_or(0.0, |passive| {
            let terms = near.nodes().iter();
            terms.map(|&(node, weight)| weight * passive[node]).sum()
        })
    }

    /// The largest |force per ampere| of any coil on the planes of nodes around a height, along x, y and z, N/A; along x
    /// and y 0 where the map holds the upward component alone.
    #[must_use]
    pub fn largest_near_n_per_a(&self, z_m: f64) -> [f64; 3] {
        let planes = self.largest_n_per_a[around(&self.axes_m[2], z_m)].iter();
        planes.fold([0.0; 3], |most, plane| {
            [0, 1, 2].map(|axis| most[axis].max(plane[axis]))
        })
    }
}

/// Nodes with their weights at a position.
struct Near {
    nodes: [(usize, f64); MOST_NODES],
    count: usize,
}

impl Near {
    fn nodes(&self) -> &[(usize, f64)] {
        &self.nodes[..self.count]
    }
}
