//! A harmonic field in a box from its values on the box's faces.
//!
//! Every Cartesian component of a field above its sources is harmonic, so its values on the six
//! faces of a box decide it inside: the samples grow with the box's surface, not its volume. The
//! faces are interpolated to one tensor grid, Laplace's equation gives the rest, and a Legendre
//! series in x and y at every node of z, cut where the field no longer needs it, is the table.

use rayon::prelude::*;

use super::sampler::{GRADIENT, Sampler, series};
use super::tabulate::{Components, MapError};
use crate::numerics::laplace::Laplace;
use crate::numerics::matrix::{product, transpose};
use crate::numerics::spectral::Spectral;

/// A box, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// From, to.
    pub x_m: [f64; 2],
    /// From, to.
    pub y_m: [f64; 2],
    /// From, to.
    pub z_m: [f64; 2],
}

/// The field of every drive in a box.
#[derive(Debug, Clone)]
pub struct Table {
    x: Spectral,
    y: Spectral,
    z: Spectral,
    /// [series][node of z]
    blocks: Vec<Vec<Block>>,
    /// Largest component at every node of z: of the gradient, T/m/A, and of the field, T/A.
    sizes: Vec<[f64; 2]>,
    /// Number of points that were sampled.
    pub samples: usize,
}

/// Legendre coefficients of one plane, [degree in y, degree in x].
#[derive(Debug, Clone)]
struct Block {
    rows: usize,
    columns: usize,
    coefficients: Vec<f64>,
}

/// Share of the tolerance that cutting the series may take.
const CUT: f64 = 0.1;

/// One node of z: where its values are sampled, and how they reach the table's nodes.
struct Layer {
    x: Spectral,
    y: Spectral,
    /// Sampled all over; on its border otherwise.
    full: bool,
    /// From the layer's nodes to the table's, [table node, layer node].
    to_x: Vec<f64>,
    to_y: Vec<f64>,
}

impl Layer {
    fn points(&self, z_m: f64) -> Vec<[f64; 3]> {
        let (x, y) = (&self.x.nodes, &self.y.nodes);
        let mut points = Vec::new();
        if self.full {
            for y in y {
                points.extend(x.iter().map(|x| [*x, *y, z_m]));
            }
            return points;
        }
        for y in [y[0], y[y.len() - 1]] {
            points.extend(x.iter().map(|x| [*x, y, z_m]));
        }
        for x in [x[0], x[x.len() - 1]] {
            points.extend(y.iter().map(|y| [x, *y, z_m]));
        }
        points
    }

    /// Values at [`Layer::points`] to a plane of the table's nodes, [y, x].
    fn spread(&self, values: &[f64], plane: &mut [f64]) {
        let (mx, my) = (self.x.len(), self.y.len());
        let (nx, ny) = (self.to_x.len() / mx, self.to_y.len() / my);
        if self.full {
            let mut half = vec![0.0; my * nx];
            product(values, &transpose(&self.to_x, mx), mx, &mut half);
            product(&self.to_y, &half, my, plane);
            return;
        }
        let (rows, columns) = values.split_at(2 * mx);
        let mut line = vec![0.0; ny];
        for (side, column) in columns.chunks_exact(my).enumerate() {
            product(&self.to_y, column, my, &mut line);
            for (row, value) in plane.chunks_exact_mut(nx).zip(&line) {
                row[side * (nx - 1)] = *value;
            }
        }
        for (side, row) in rows.chunks_exact(mx).enumerate() {
            let start = side * (ny - 1) * nx;
            product(&self.to_x, row, mx, &mut plane[start..start + nx]);
        }
    }
}

/// Rows of cardinal functions of `axis` at `points`.
fn rows(axis: &Spectral, points: &[f64]) -> Vec<f64> {
    points.iter().flat_map(|p| axis.cardinal(*p)).collect()
}

impl Table {
    /// Number of points that a table of `extent` over sources below `top_m` would sample, about.
    #[must_use]
    pub fn samples_needed(extent: Extent, top_m: f64, tolerance: f64) -> f64 {
        let [bottom, top] = extent.z_m.map(|z| {
            let nodes = |[from, to]: [f64; 2]| {
                Spectral::strip_nodes(from, to, z - top_m, tolerance).1 as f64
            };
            [nodes(extent.x_m), nodes(extent.y_m)]
        });
        let layers = Spectral::rising_nodes(extent.z_m[0], extent.z_m[1], top_m, tolerance) as f64;
        let ends = bottom[0] * bottom[1] + top[0] * top[1];
        if bottom.contains(&1.0) {
            return 0.5 * layers * ends;
        }
        ends + layers * (bottom[0] + bottom[1] + top[0] + top[1])
    }

    /// The table of every drive of `sampler` in `extent`, whose lower end lies above the
    /// sampler's top, aiming at `tolerance` relative to the largest component at each height;
    /// whether that is reached, a comparison must tell.
    ///
    /// # Errors
    /// The sampler's.
    pub fn new(
        sampler: &dyn Sampler,
        extent: Extent,
        components: Components,
        tolerance: f64,
    ) -> Result<Self, MapError> {
        let top_m = sampler.top_m();
        let [from, to] = extent.z_m;
        let layers = Spectral::rising_nodes(from, to, top_m, tolerance);
        let z = Spectral::rising(from, to, top_m, layers);
        let axis = |[from, to]: [f64; 2], z: f64| {
            let nodes = Spectral::strip_nodes(from, to, z - top_m, tolerance);
            Spectral::strip(from, to, nodes)
        };
        let (x, y) = (axis(extent.x_m, from), axis(extent.y_m, from));
        let layers: Vec<Layer> = (z.nodes.iter().enumerate())
            .map(|(k, z_m)| {
                let (own_x, own_y) = (axis(extent.x_m, *z_m), axis(extent.y_m, *z_m));
                Layer {
                    full: k == 0 || k + 1 == z.len() || x.len() == 1 || y.len() == 1,
                    to_x: rows(&own_x, &x.nodes),
                    to_y: rows(&own_y, &y.nodes),
                    x: own_x,
                    y: own_y,
                }
            })
            .collect();
        let mut points = Vec::new();
        let mut starts = vec![0];
        for (layer, z_m) in layers.iter().zip(&z.nodes) {
            points.extend(layer.points(*z_m));
            starts.push(points.len());
        }
        let count = sampler.drives() * series(components);
        let mut samples = vec![0.0; count * points.len()];
        sampler.sample(&points, components, &mut samples)?;

        let plane = x.len() * y.len();
        let laplace = Laplace::new(&x, &y, &z);
        let nodal: Vec<Vec<f64>> = samples
            .par_chunks_exact(points.len())
            .map(|values| {
                let mut u = vec![0.0; plane * z.len()];
                for (k, (layer, out)) in layers.iter().zip(u.chunks_exact_mut(plane)).enumerate() {
                    layer.spread(&values[starts[k]..starts[k + 1]], out);
                }
                laplace.fill(&mut u);
                u
            })
            .collect();
        let mut sizes = vec![[0.0_f64; 2]; z.len()];
        for (place, u) in nodal.iter().enumerate() {
            for (size, out) in sizes.iter_mut().zip(u.chunks_exact(plane)) {
                let size = &mut size[kind(place, components)];
                *size = out.iter().fold(*size, |size, value| size.max(value.abs()));
            }
        }
        let (to_x, to_y) = (transpose(&x.to_legendre(), x.len()), y.to_legendre());
        let blocks = nodal
            .into_par_iter()
            .enumerate()
            .map(|(place, u)| {
                (u.chunks_exact(plane).zip(&sizes))
                    .map(|(values, size)| {
                        let mut half = vec![0.0; plane];
                        product(values, &to_x, x.len(), &mut half);
                        let mut full = vec![0.0; plane];
                        product(&to_y, &half, y.len(), &mut full);
                        let budget = CUT * tolerance * size[kind(place, components)];
                        Block::cut(&full, x.len(), budget)
                    })
                    .collect()
            })
            .collect();
        Ok(Self {
            x,
            y,
            z,
            blocks,
            sizes,
            samples: points.len(),
        })
    }

    /// The box.
    #[must_use]
    pub fn extent(&self) -> Extent {
        let [x_m, y_m, z_m] =
            [&self.x, &self.y, &self.z].map(|axis| [axis.nodes[0], axis.nodes[axis.len() - 1]]);
        Extent { x_m, y_m, z_m }
    }

    /// Numbers of nodes along x, y and z.
    #[must_use]
    pub fn degrees(&self) -> [usize; 3] {
        [self.x.len(), self.y.len(), self.z.len()]
    }

    /// Number of coefficients kept, over all drives and components.
    #[must_use]
    pub fn coefficients(&self) -> usize {
        self.blocks
            .iter()
            .flatten()
            .map(|block| block.coefficients.len())
            .sum()
    }

    /// Nodes of z, m: between them the interpolation along z errs most.
    #[must_use]
    pub fn heights_m(&self) -> &[f64] {
        &self.z.nodes
    }

    /// Largest component of the gradient, T/m/A, and of the field, T/A, over all drives at each
    /// of [`Table::heights_m`]; of what the table holds.
    #[must_use]
    pub fn sizes(&self) -> &[[f64; 2]] {
        &self.sizes
    }

    /// What evaluation at (`x_m`, `y_m`), nodes of a grid, has in common for all heights.
    #[must_use]
    pub fn stencil(&self, x_m: &[f64], y_m: &[f64]) -> Stencil {
        let polynomials = |axis: &Spectral, points: &[f64]| -> Vec<f64> {
            let n = axis.len();
            let mut out = vec![0.0; n * points.len()];
            for (point, out) in points.iter().zip(out.chunks_exact_mut(n)) {
                axis.legendre(*point, out);
            }
            transpose(&out, n)
        };
        Stencil {
            x: polynomials(&self.x, x_m),
            y: polynomials(&self.y, y_m),
            columns: x_m.len(),
            rows: y_m.len(),
        }
    }

    /// One component of one drive (`place` = drive times components plus component) on a grid at
    /// height `z_m` within the box, [y, x].
    pub fn plane(&self, place: usize, z_m: f64, stencil: &Stencil, out: &mut [f64]) {
        let block = self.block(place, z_m);
        let mut half = vec![0.0; block.rows * stencil.columns];
        let along_x = &stencil.x[..block.columns * stencil.columns];
        product(&block.coefficients, along_x, block.columns, &mut half);
        let along_y = &stencil.y[..block.rows * stencil.rows];
        let along_y = transpose(along_y, stencil.rows);
        product(&along_y, &half, block.rows, out);
    }

    /// The same at scattered points of one height.
    #[must_use]
    pub fn points(&self, place: usize, z_m: f64, points_m: &[[f64; 2]]) -> Vec<f64> {
        let block = self.block(place, z_m);
        let (mut px, mut py) = (vec![0.0; block.columns], vec![0.0; block.rows]);
        points_m
            .iter()
            .map(|[x, y]| {
                self.x.legendre(*x, &mut px);
                self.y.legendre(*y, &mut py);
                (block.coefficients.chunks_exact(block.columns).zip(&py))
                    .map(|(row, py)| py * row.iter().zip(&px).map(|(c, p)| c * p).sum::<f64>())
                    .sum()
            })
            .collect()
    }

    /// The series at one height. Degrees that the node below does not need, no node above does:
    /// the field is the smoother the farther it is from its sources.
    fn block(&self, place: usize, z_m: f64) -> Block {
        let blocks = &self.blocks[place];
        let below = self.z.nodes.partition_point(|node| *node <= z_m).max(1) - 1;
        let most = |size: fn(&Block) -> usize| blocks[below..].iter().map(size).max();
        let rows = most(|block| block.rows).unwrap_or(1);
        let columns = most(|block| block.columns).unwrap_or(1);
        let mut coefficients = vec![0.0; rows * columns];
        for (block, weight) in blocks.iter().zip(self.z.cardinal(z_m)) {
            let lines = block.coefficients.chunks_exact(block.columns);
            for (out, line) in coefficients.chunks_exact_mut(columns).zip(lines) {
                for (value, c) in out.iter_mut().zip(line) {
                    *value += weight * c;
                }
            }
        }
        Block {
            rows,
            columns,
            coefficients,
        }
    }
}

/// Polynomials at the nodes of a grid.
#[derive(Debug, Clone)]
pub struct Stencil {
    /// [degree, node]
    x: Vec<f64>,
    y: Vec<f64>,
    columns: usize,
    rows: usize,
}

/// Of the gradient or of the field.
pub(super) fn kind(place: usize, components: Components) -> usize {
    usize::from(place % series(components) >= GRADIENT)
}

impl Block {
    /// The series without its highest degrees, as far as their sum stays below `budget`.
    fn cut(full: &[f64], columns: usize, budget: f64) -> Self {
        let rows = full.len() / columns;
        let sums = |outer: usize, at: &dyn Fn(usize, usize) -> f64, inner: usize| -> usize {
            let mut left = 0.5 * budget;
            (1..outer)
                .rev()
                .find(|i| {
                    left -= (0..inner).map(|j| at(*i, j).abs()).sum::<f64>();
                    left < 0.0
                })
                .map_or(1, |last| last + 1)
        };
        let kept_rows = sums(rows, &|i, j| full[i * columns + j], columns);
        let kept_columns = sums(columns, &|i, j| full[j * columns + i], rows);
        Self {
            rows: kept_rows,
            columns: kept_columns,
            coefficients: full
                .chunks_exact(columns)
                .take(kept_rows)
                .flat_map(|row| row[..kept_columns].iter().copied())
                .collect(),
        }
    }
}
