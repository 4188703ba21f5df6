//! The magnetic potential inside a cylindrical core, by spectral elements.
//!
//! In the core H = -grad u and B = mu_0 mu(|H|) H with div B = 0. On the half plane r >= 0 the
//! weak form of an axisymmetric u is
//!
//! ```text
//! int 2 pi r mu(|grad u|) grad u . grad w dr dz = int 2 pi r (mu d_n u) w ds   for every w.
//! ```
//!
//! Elements are rectangles of a tensor mesh, u on each a polynomial of equal degree in r and z
//! through the Gauss-Lobatto nodes; integrals by Gauss's rule with one node more than the degree,
//! which is exact for constant mu. The left side is the [`Interior::flux`] of u: zero at inner
//! nodes when div B = 0, the flux through the surface at boundary nodes, in A m (over mu_0). Its
//! derivative is the tangent stiffness, with mu 1 + (mu' / |h|) h h' in place of mu: symmetric and
//! positive where B grows with H. Eliminating the inner nodes leaves the map from the boundary's
//! values to its flux (Dirichlet to Neumann).

#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::condensation::{Condensed, Element, NotPositive, Plan};
use super::lobatto;
use super::permeability::{Constant, Permeability};
use fluxform_numerics::gauss;

/// A mesh that cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// Breakpoints must be finite, strictly increasing, at least two; radii begin at 0.
    #[error("the core's breakpoints in {axis} must be finite and increasing")]
    Breakpoints {
        /// `r` or `z`.
        axis: &'static str,
    },
    /// The degree is outside 1..=[`lobatto::MAX_DEGREE`].
    #[error("elements of degree {degree} are not made")]
    Degree {
        /// As requested.
        degree: usize,
    },
}

/// A point of the core's half plane with H there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Radius, m.
    pub r_m: f64,
    /// Height, m.
    pub z_m: f64,
    /// Radial component of grad u = -H, A/m.
    pub gradient_r: f64,
    /// Axial component of grad u = -H, A/m.
    pub gradient_z: f64,
}

impl Sample {
    /// |H|, A/m.
    #[must_use]
    pub fn h_a_per_m(&self) -> f64 {
        self.gradient_r.hypot(self.gradient_z)
    }
}

/// The mesh of a core, with what its constant-permeability problem needs.
#[derive(Debug)]
pub struct Interior {
    r_breaks_m: Vec<f64>,
    z_breaks_m: Vec<f64>,
    reference: Reference,
    plan: Plan,
    boundary: Vec<usize>,
    laplace: Condensed,
}

/// One element's polynomials on [-1, 1].
#[derive(Debug)]
struct Reference {
    degree: usize,
    nodes: Vec<f64>,
    /// Values and slopes of the basis at the quadrature's nodes: node by basis function.
    values: DMatrix<f64>,
    slopes: DMatrix<f64>,
    /// Products of two basis functions in r at every node, in four blocks: slope-slope,
    /// slope-value, value-slope, value-value; pair of functions by node.
    pairs_r: DMatrix<f64>,
    /// The blocks that belong to them in z: node by pair.
    pairs_z: [DMatrix<f64>; 4],
}

impl Reference {
    fn new(degree: usize) -> Self {
        let nodes = lobatto::nodes(degree);
        let points = &gauss::rule(degree + 1).nodes;
        let (values, slopes) = (
            lobatto::values(&nodes, points),
            lobatto::slopes(&nodes, points),
        );
        let count = degree + 1;
        let factors = [
            (&slopes, &slopes),
            (&slopes, &values),
            (&values, &slopes),
            (&values, &values),
        ];
        let product =
            |(first, second): (&DMatrix<f64>, &DMatrix<f64>), node: usize, pair: usize| {
                first[(node, pair % count)] * second[(node, pair / count)]
            };
        let pairs_r = DMatrix::from_fn(count * count, 4 * count, |pair, column| {
            product(factors[column / count], column % count, pair)
        });
        let pairs_z = [3, 2, 1, 0].map(|block: usize| {
            DMatrix::from_fn(count, count * count, |node, pair| {
                product(factors[block], node, pair)
            })
        });
        Self {
            degree,
            nodes,
            values,
            slopes,
            pairs_r,
            pairs_z,
        }
    }
}

/// One element's place in the mesh.
#[derive(Clone, Copy)]
struct Cell {
    /// Index of the element in r and in z.
    at: (usize, usize),
    r_m: (f64, f64),
    z_m: (f64, f64),
}

impl Cell {
    /// d/dr and d/dz of the reference coordinates, 1/m.
    fn stretch(&self) -> (f64, f64) {
        (
            2.0 / (self.r_m.1 - self.r_m.0),
            2.0 / (self.z_m.1 - self.z_m.0),
        )
    }
}

fn between((lo, hi): (f64, f64), x: f64) -> f64 {
    if x < 0.0 {
        lo + 0.5 * (hi - lo) * (1.0 + x)
    } else {
        hi - 0.5 * (hi - lo) * (1.0 - x)
    }
}

fn increasing(breaks: &[f64]) -> bool {
    breaks.len() >= 2
        && breaks.iter().all(|x| x.is_finite())
        && breaks.windows(2).all(|pair| pair[0] < pair[1])
}

impl Interior {
    /// The mesh with the given breakpoints (radii from 0 to R, heights from bottom to top), and
    /// elements of `degree`.
    ///
    /// Time: about one Newton step.
    ///
    /// # Errors
    /// [`MeshError`]; breakpoints too close for their elements' stiffness to be distinguished from zero
    /// count as breakpoints that do not increase.
    pub fn new(r_breaks_m: &[f64], z_breaks_m: &[f64], degree: usize) -> Result<Self, MeshError> {
        if !increasing(r_breaks_m) || r_breaks_m[0] != 0.0 {
            return Err(MeshError::Breakpoints { axis: "r" });
        }
        if !increasing(z_breaks_m) {
            return Err(MeshError::Breakpoints { axis: "z" });
        }
        if degree == 0 || degree > lobatto::MAX_DEGREE {
            return Err(MeshError::Degree { degree });
        }
        let (across, along) = (r_breaks_m.len() - 1, z_breaks_m.len() - 1);
        let (columns, rows) = (across * degree + 1, along * degree + 1);
        let mut boundary: Vec<usize> = (0..columns).collect();
        boundary.extend((1..rows).map(|j| j * columns + columns - 1));
        boundary.extend((0..columns - 1).rev().map(|i| (rows - 1) * columns + i));
        let mut interior = Self {
            r_breaks_m: r_breaks_m.to_vec(),
            z_breaks_m: z_breaks_m.to_vec(),
            reference: Reference::new(degree),
            plan: Plan::default(),
            boundary,
            laplace: Condensed::default(),
        };
        let elements: Vec<Vec<usize>> = (0..across * along)
            .map(|index| interior.element_nodes(interior.cell(index)))
            .collect();
        interior.plan = Plan::new(
            &elements,
            &merges(across, along),
            &interior.boundary,
            rows * columns,
        );
        interior.laplace = interior
            .linearize(
                &DVector::zeros(rows * columns),
                &Constant { relative: 1.0 },
                None,
            )
            .map_err(|NotPositive| MeshError::Breakpoints { axis: "r and z" })?;
        Ok(interior)
    }

    /// Number of nodes.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.columns() * ((self.z_breaks_m.len() - 1) * self.reference.degree + 1)
    }

    /// Radius and height of every node, m: radius running fastest.
    #[must_use]
    pub fn nodes_m(&self) -> Vec<(f64, f64)> {
        let axis = |breaks: &[f64]| -> Vec<f64> {
            let inner = breaks.windows(2).flat_map(|ends| {
                self.reference.nodes[..self.reference.degree]
                    .iter()
                    .map(|&x| between((ends[0], ends[1]), x))
            });
            inner.chain(breaks.last().copied()).collect()
        };
        let r_m = axis(&self.r_breaks_m);
        axis(&self.z_breaks_m)
            .into_iter()
            .flat_map(|z_m| r_m.iter().map(move |&r_m| (r_m, z_m)))
            .collect()
    }

    /// The surface's nodes along the generatrix: bottom face outwards, side upwards, top face
    /// inwards. Both ends lie on the axis.
    #[must_use]
    pub fn boundary(&self) -> &[usize] {
        &self.boundary
    }

    /// Radius of the core, m.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.r_breaks_m[self.r_breaks_m.len() - 1]
    }

    /// Volume of the core, m^3.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        let radius_m = self.radius_m();
        let height_m = self.z_breaks_m[self.z_breaks_m.len() - 1] - self.z_breaks_m[0];
        std::f64::consts::PI * radius_m * radius_m * height_m
    }

    /// Map from boundary values to boundary flux when mu = 1, m.
    #[must_use]
    pub fn laplace_schur_m(&self) -> &DMatrix<f64> {
        &self.laplace.matrix
    }

    /// The harmonic function with the given boundary values.
    #[must_use]
    pub fn harmonic(&self, boundary_values: &DVector<f64>) -> DVector<f64> {
        self.plan.expand(&self.laplace, boundary_values)
    }

    /// Weak flux of mu grad u at every node, A m (see the module).
    #[must_use]
    pub fn flux(&self, u: &DVector<f64>, law: &dyn Permeability) -> DVector<f64> {
        let mut flux = DVector::zeros(u.len());
        for index in 0..self.cell_count() {
            let cell = self.cell(index);
            let nodes = self.element_nodes(cell);
            let load = self.element(cell, &nodes, u, law, None).load;
            for (&node, value) in nodes.iter().zip(&load) {
                flux[node] += value;
            }
        }
        flux
    }

    /// Stiffness and [`Interior::flux`] at u, condensed onto the boundary: a change of
    /// the boundary values by d changes the flux, once the inner equations are satisfied, from
    /// `load` by `matrix` d.
    ///
    /// That is the tangent without `change`. With it, a change of u, the permeability along grad u is the mean
    /// dB/dH over as far either way as that change moves H ([`Permeability::mean_differential`]).
    ///
    /// # Errors
    /// [`NotPositive`] when the law's differential permeability is not positive or u not finite.
    pub fn linearize(
        &self,
        u: &DVector<f64>,
        law: &dyn Permeability,
        change: Option<&DVector<f64>>,
    ) -> Result<Condensed, NotPositive> {
        self.plan.condense(|index| {
            let cell = self.cell(index);
            self.element(cell, &self.element_nodes(cell), u, law, Some(change))
        })
    }

    /// Newton's correction of every node that goes with the boundary's: the inner equations of
    /// [`Interior::linearize`] are satisfied.
    #[must_use]
    pub fn correction(&self, linear: &Condensed, boundary: &DVector<f64>) -> DVector<f64> {
        // The unknown of `expand` is minus the correction, whose load is the flux itself.
        -self.plan.expand(linear, &-boundary)
    }

    /// Integral over the core of `density`, a function of the place and grad u, by the
    /// elements' quadrature.
    #[must_use]
    pub fn integral(&self, u: &DVector<f64>, mut density: impl FnMut(Sample) -> f64) -> f64 {
        let mut sum = 0.0;
        for index in 0..self.cell_count() {
            let cell = self.cell(index);
            let local = self.local(&self.element_nodes(cell), u);
            let (gradient_r, gradient_z) = self.gradients(cell, &local);
            for a in 0..local.nrows() {
                for b in 0..local.ncols() {
                    let (r_m, z_m, weight) = self.point(cell, a, b);
                    sum += weight
                        * density(Sample {
                            r_m,
                            z_m,
                            gradient_r: gradient_r[(a, b)],
                            gradient_z: gradient_z[(a, b)],
                        });
                }
            }
        }
        sum
    }

    /// Visits grad u at twice the quadrature's nodes either way, each moved inwards to the nearest point that is
    /// `depth_m` inside the surface: a sampling of the core without its skin, ends included.
    /// A depth beyond the core's middle is cut there.
    pub fn sample_inside(&self, u: &DVector<f64>, depth_m: f64, mut visit: impl FnMut(Sample)) {
        let along_r = self.depths(&self.r_breaks_m, 0.0, depth_m);
        let along_z = self.depths(&self.z_breaks_m, depth_m, depth_m);
        let degree = self.reference.degree;
        for (ez, z_m, z_values, z_slopes) in &along_z {
            for (er, r_m, r_values, r_slopes) in &along_r {
                let nodes = self.element_nodes(self.cell(ez * (self.r_breaks_m.len() - 1) + er));
                let stretch = self.cell(ez * (self.r_breaks_m.len() - 1) + er).stretch();
                let (mut gradient_r, mut gradient_z) = (0.0, 0.0);
                for (k, &node) in nodes.iter().enumerate() {
                    let (i, j) = (k % (degree + 1), k / (degree + 1));
                    gradient_r += r_slopes[i] * z_values[j] * u[node];
                    gradient_z += r_values[i] * z_slopes[j] * u[node];
                }
                visit(Sample {
                    r_m: *r_m,
                    z_m: *z_m,
                    gradient_r: stretch.0 * gradient_r,
                    gradient_z: stretch.1 * gradient_z,
                });
            }
        }
    }

    /// How well the elements resolve u: the part of u that polynomials of one degree less miss,
    /// in the energy norm int mu |grad u|^2, relative to u's own. It shows a mesh that is too
    /// coarse from one that is not; it is no bound.
    #[must_use]
    pub fn resolution(&self, u: &DVector<f64>, law: &dyn Permeability) -> f64 {
        let nodes = &self.reference.nodes;
        let Some(lower) = self.reference.degree.checked_sub(1).filter(|&d| d > 0) else {
            return 1.0;
        };
        let coarse = lobatto::nodes(lower);
        let there_and_back = lobatto::values(&coarse, nodes) * lobatto::values(nodes, &coarse);
        let (mut missed, mut whole) = (0.0, 0.0);
        for index in 0..self.cell_count() {
            let cell = self.cell(index);
            let local = self.local(&self.element_nodes(cell), u);
            let rest = &local - &there_and_back * &local * there_and_back.transpose();
            let (own, lost) = (self.gradients(cell, &local), self.gradients(cell, &rest));
            for a in 0..local.nrows() {
                for b in 0..local.ncols() {
                    let at = (a, b);
                    let h = own.0[at].hypot(own.1[at]);
                    let weight = self.point(cell, a, b).2 * law.response(h).relative;
                    whole += weight * h * h;
                    missed += weight * lost.0[at].hypot(lost.1[at]).powi(2);
                }
            }
        }
        if missed == 0.0 {
            0.0
        } else {
            (missed / whole).sqrt()
        }
    }

    fn columns(&self) -> usize {
        (self.r_breaks_m.len() - 1) * self.reference.degree + 1
    }

    fn cell_count(&self) -> usize {
        (self.r_breaks_m.len() - 1) * (self.z_breaks_m.len() - 1)
    }

    fn cell(&self, index: usize) -> Cell {
        let across = self.r_breaks_m.len() - 1;
        let (er, ez) = (index % across, index / across);
        Cell {
            at: (er, ez),
            r_m: (self.r_breaks_m[er], self.r_breaks_m[er + 1]),
            z_m: (self.z_breaks_m[ez], self.z_breaks_m[ez + 1]),
        }
    }

    fn element_nodes(&self, cell: Cell) -> Vec<usize> {
        let degree = self.reference.degree;
        let first = cell.at.1 * degree * self.columns() + cell.at.0 * degree;
        (0..=degree)
            .flat_map(|j| (0..=degree).map(move |i| (i, j)))
            .map(|(i, j)| first + j * self.columns() + i)
            .collect()
    }

    fn local(&self, nodes: &[usize], u: &DVector<f64>) -> DMatrix<f64> {
        let count = self.reference.degree + 1;
        DMatrix::from_iterator(count, count, nodes.iter().map(|&node| u[node]))
    }

    /// Components of grad u at the quadrature's nodes, r along the rows.
    fn gradients(&self, cell: Cell, local: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let Reference { values, slopes, .. } = &self.reference;
        let (stretch_r, stretch_z) = cell.stretch();
        (
            slopes * local * values.transpose() * stretch_r,
            values * local * slopes.transpose() * stretch_z,
        )
    }

    /// Place and volume (2 pi r dr dz) of a node of the quadrature.
    fn point(&self, cell: Cell, a: usize, b: usize) -> (f64, f64, f64) {
        let rule = gauss::rule(self.reference.degree + 1);
        let (r_m, z_m) = (
            between(cell.r_m, rule.nodes[a]),
            between(cell.z_m, rule.nodes[b]),
        );
        let stretch = cell.stretch();
        let weight = rule.weights[a] * rule.weights[b] / (stretch.0 * stretch.1);
        (r_m, z_m, TAU * r_m * weight)
    }

    /// One element's flux and, where requested, its stiffness: see [`Interior::linearize`].
    fn element(
        &self,
        cell: Cell,
        nodes: &[usize],
        u: &DVector<f64>,
        law: &dyn Permeability,
        stiffness: Option<Option<&DVector<f64>>>,
    ) -> Element {
        let Reference { values, slopes, .. } = &self.reference;
        let count = self.reference.degree + 1;
        let (stretch_r, stretch_z) = cell.stretch();
        let (mut flux_r, mut flux_z) = self.gradients(cell, &self.local(nodes, u));
        let change = stiffness
            .flatten()
            .map(|change| self.gradients(cell, &self.local(nodes, change)));
        let mut tangent = [(); 3].map(|()| DMatrix::zeros(count, count));
        for b in 0..count {
            for a in 0..count {
                let at = (a, b);
                let (g_r, g_z) = (flux_r[at], flux_z[at]);
                let h = g_r.hypot(g_z);
                let response = law.response(h);
                let weight = self.point(cell, a, b).2;
                flux_r[at] = weight * stretch_r * response.relative * g_r;
                flux_z[at] = weight * stretch_z * response.relative * g_z;
                // Along grad u the differential permeability counts, across it B / H.
                let (e_r, e_z) = if h > 0.0 {
                    (g_r / h, g_z / h)
                } else {
                    (0.0, 0.0)
                };
                let reach = change
                    .as_ref()
                    .map_or(0.0, |(c_r, c_z)| c_r[at].hypot(c_z[at]));
                let along = law.mean_differential(h, reach) - response.relative;
                tangent[0][at] =
                    weight * stretch_r * stretch_r * (response.relative + along * e_r * e_r);
                tangent[1][at] = weight * stretch_r * stretch_z * along * e_r * e_z;
                tangent[2][at] =
                    weight * stretch_z * stretch_z * (response.relative + along * e_z * e_z);
            }
        }
        let load = slopes.tr_mul(&flux_r) * values + values.tr_mul(&flux_z) * slopes;
        let load = DVector::from_column_slice(load.as_slice());
        let matrix = if stiffness.is_some() {
            self.stiffness(&tangent)
        } else {
            DMatrix::zeros(0, 0)
        };
        Element { matrix, load }
    }

    /// Element matrix from the weighted tangent's rr, rz and zz components at the nodes.
    fn stiffness(&self, [rr, rz, zz]: &[DMatrix<f64>; 3]) -> DMatrix<f64> {
        fluxform_base::progress::poll();
        let count = self.reference.degree + 1;
        let pairs = count * count;
        let mut right = DMatrix::zeros(4 * count, pairs);
        for (block, (tensor, in_z)) in [rr, rz, rz, zz]
            .iter()
            .zip(&self.reference.pairs_z)
            .enumerate()
        {
            right
                .rows_mut(block * count, count)
                .gemm(1.0, tensor, in_z, 0.0);
        }
        // Entry ((i, k), (j, l)) of the product couples the nodes (i, j) and (k, l).
        let product = &self.reference.pairs_r * right;
        let mut matrix = DMatrix::zeros(pairs, pairs);
        for l in 0..count {
            for k in 0..count {
                let mut column = matrix.column_mut(k + count * l);
                for j in 0..count {
                    for i in 0..count {
                        column[i + count * j] = product[(i + count * k, j + count * l)];
                    }
                }
            }
        }
        matrix
    }

    /// Twice the quadrature's nodes along one axis, moved inwards from its ends: element, place, values
    /// and slopes (in the reference coordinate) of its basis there.
    fn depths(
        &self,
        breaks: &[f64],
        below_m: f64,
        above_m: f64,
    ) -> Vec<(usize, f64, Vec<f64>, Vec<f64>)> {
        let (first, last) = (breaks[0], breaks[breaks.len() - 1]);
        let middle = if below_m > 0.0 {
            0.5 * (first + last)
        } else {
            first
        };
        let (lo, hi) = ((first + below_m).min(middle), (last - above_m).max(middle));
        let mut places: Vec<f64> = breaks
            .windows(2)
            .flat_map(|ends| {
                let rule = gauss::rule((2 * self.reference.degree + 2).min(gauss::MAX_ORDER));
                rule.nodes
                    .iter()
                    .map(|&x| between((ends[0], ends[1]), x).clamp(lo, hi))
            })
            .collect();
        places.dedup();
        places
            .into_iter()
            .map(|place| {
                let element = breaks[1..breaks.len() - 1].partition_point(|&end| end <= place);
                let (left, right) = (breaks[element], breaks[element + 1]);
                let x = [((place - left) - (right - place)) / (right - left)];
                let row = |matrix: DMatrix<f64>| matrix.as_slice().to_vec();
                (
                    element,
                    place,
                    row(lobatto::values(&self.reference.nodes, &x)),
                    row(lobatto::slopes(&self.reference.nodes, &x)),
                )
            })
            .collect()
    }
}

/// Elements merge into layers of equal height, neighbouring layers pairwise until one is left.
fn merges(across: usize, along: usize) -> Vec<Vec<usize>> {
    let mut merges: Vec<Vec<usize>> = (0..along)
        .map(|ez| (ez * across..(ez + 1) * across).collect())
        .collect();
    let mut level: Vec<usize> = (0..along).map(|ez| across * along + ez).collect();
    while level.len() > 1 {
        let mut next = Vec::with_capacity(level.len().div_ceil(2));
        for pair in level.chunks(2) {
            if let [lower, upper] = *pair {
                next.push(across * along + merges.len());
                merges.push(vec![lower, upper]);
            } else {
                next.push(pair[0]);
            }
        }
        level = next;
    }
    merges
}
