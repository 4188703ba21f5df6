//! A harmonic field in a box from its values on the box's faces.
//!
//! Every Cartesian component of a field above its sources is harmonic, so its values on the six
//! faces of a box decide it inside: the samples grow with the box's surface, not its volume. The
//! faces are interpolated to one tensor grid and Laplace's equation gives the rest. The table keeps
//! every layer, a node of z, on the nodes in x and y that its own distance from the sources needs.

use rayon::prelude::*;

use super::map_source::{GRADIENT, Sampler};
use super::tabulate::{Components, MapError};
use fluxform_numerics::laplace::Laplace;
use fluxform_numerics::matrix::{product, transpose};
use fluxform_numerics::spectral::Spectral;

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
    extent: Extent,
    z: Spectral,
    layers: Vec<Layer>,
    /// Where every layer's values begin, and their number.
    starts: Vec<usize>,
    /// [series], then layer by layer [y, x].
    values: Vec<Vec<f64>>,
    /// Largest component at every node of z: of the gradient, T/m/A, and of the field, T/A.
    sizes: Vec<[f64; 2]>,
    /// Number of points that were sampled.
    pub samples: usize,
}

/// One node of z: the nodes in x and y that it needs.
#[derive(Debug, Clone)]
struct Layer {
    x: Spectral,
    y: Spectral,
    /// Sampled all over; on its border otherwise.
    full: bool,
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
}

/// Between the nodes of a layer and those of the lowest, which has most.
struct Transfer {
    full: bool,
    /// [node below, layer's node], and for x its transpose.
    to_x: Vec<f64>,
    to_x_transposed: Vec<f64>,
    to_y: Vec<f64>,
    /// [layer's node, node below]; for x transposed.
    from_x_transposed: Vec<f64>,
    from_y: Vec<f64>,
}

impl Transfer {
    fn new(layer: &Layer, lowest: &Layer) -> Self {
        let to_x = rows(&layer.x, &lowest.x.nodes);
        Self {
            full: layer.full,
            to_x_transposed: transpose(&to_x, layer.x.len()),
            to_x,
            to_y: rows(&layer.y, &lowest.y.nodes),
            from_x_transposed: transpose(&rows(&lowest.x, &layer.x.nodes), lowest.x.len()),
            from_y: rows(&lowest.y, &layer.y.nodes),
        }
    }

    /// Values at [`Layer::points`] to a plane of the lowest layer's nodes, [y, x].
    fn spread(&self, layer: &Layer, values: &[f64], plane: &mut [f64]) {
        let (mx, my) = (layer.x.len(), layer.y.len());
        let (nx, ny) = (self.to_x.len() / mx, self.to_y.len() / my);
        if self.full {
            let mut half = vec![0.0; my * nx];
            product(values, &self.to_x_transposed, mx, &mut half);
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

    /// A plane of the lowest layer's nodes to the layer's own.
    fn gather(&self, layer: &Layer, plane: &[f64], out: &mut [f64]) {
        let (mx, my) = (layer.x.len(), layer.y.len());
        let (nx, ny) = (self.to_x.len() / mx, self.to_y.len() / my);
        let mut half = vec![0.0; my * nx];
        product(&self.from_y, plane, ny, &mut half);
        product(&half, &self.from_x_transposed, nx, out);
    }
}

/// Rows of cardinal functions of `axis` at `points`.
fn rows(axis: &Spectral, points: &[f64]) -> Vec<f64> {
    points.iter().flat_map(|p| axis.cardinal(*p)).collect()
}

impl Table {
    /// Number of points that a table of `extent` over sources below `top_m` would sample, about.
    #[must_use]
    pub(crate) fn samples_needed(extent: Extent, top_m: f64, tolerance: f64) -> f64 {
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
    /// whether that is reached, only a comparison shows.
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
        let layers: Vec<Layer> = (z.nodes.iter().enumerate())
            .map(|(k, z_m)| {
                let (x, y) = (axis(extent.x_m, *z_m), axis(extent.y_m, *z_m));
                let end = k == 0 || k + 1 == z.len();
                Layer {
                    full: end || x.len() == 1 || y.len() == 1,
                    x,
                    y,
                }
            })
            .collect();
        let lowest = &layers[0];
        let (x, y) = (&lowest.x, &lowest.y);
        let transfers: Vec<Transfer> = (layers.iter())
            .map(|layer| Transfer::new(layer, lowest))
            .collect();
        let (mut points, mut asked, mut starts) = (Vec::new(), vec![0], vec![0]);
        for (layer, z_m) in layers.iter().zip(&z.nodes) {
            points.extend(layer.points(*z_m));
            asked.push(points.len());
            starts.push(starts[starts.len() - 1] + layer.x.len() * layer.y.len());
        }
        let count = sampler.drives() * components.count();
        let mut samples = vec![0.0; count * points.len()];
        sampler.sample(&points, components, &mut samples)?;

        let plane = x.len() * y.len();
        let laplace = Laplace::new(x, y, &z);
        let values: Vec<Vec<f64>> = samples
            .par_chunks_exact(points.len())
            .map(|samples| {
                let mut u = vec![0.0; plane * z.len()];
                for (k, out) in u.chunks_exact_mut(plane).enumerate() {
                    fluxform_base::progress::poll();
                    transfers[k].spread(&layers[k], &samples[asked[k]..asked[k + 1]], out);
                }
                laplace.fill(&mut u);
                let mut values = vec![0.0; starts[z.len()]];
                for (k, plane) in u.chunks_exact(plane).enumerate() {
                    let out = &mut values[starts[k]..starts[k + 1]];
                    transfers[k].gather(&layers[k], plane, out);
                }
                values
            })
            .collect();
        let mut sizes = vec![[0.0_f64; 2]; z.len()];
        for (place, values) in values.iter().enumerate() {
            for (k, size) in sizes.iter_mut().enumerate() {
                let size = &mut size[kind(place, components)];
                let layer = &values[starts[k]..starts[k + 1]];
                *size = (layer.iter()).fold(*size, |size, value| size.max(value.abs()));
            }
        }
        Ok(Self {
            extent,
            z,
            layers,
            starts,
            values,
            sizes,
            samples: points.len(),
        })
    }

    /// The box.
    #[must_use]
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// Numbers of nodes along x and y in the lowest layer, and along z.
    #[must_use]
    pub fn degrees(&self) -> [usize; 3] {
        let lowest = &self.layers[0];
        [lowest.x.len(), lowest.y.len(), self.z.len()]
    }

    /// Number of values kept, over all drives and components.
    #[must_use]
    pub fn coefficients(&self) -> usize {
        self.values.iter().map(Vec::len).sum()
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

    /// Tables for evaluation on a grid within the box, common to all drives and components.
    #[must_use]
    pub fn stencil(&self, x_m: &[f64], y_m: &[f64], z_m: &[f64]) -> Stencil {
        let layers = (self.layers.iter())
            .map(|layer| {
                let x = transpose(&rows(&layer.x, x_m), layer.x.len());
                (x, rows(&layer.y, y_m))
            })
            .collect();
        Stencil {
            layers,
            z: rows(&self.z, z_m),
            columns: x_m.len(),
            plane: x_m.len() * y_m.len(),
        }
    }

    /// One component of one drive (`place` = drive times components plus component) on the
    /// stencil's grid, [z, y, x].
    #[must_use]
    pub fn grid(&self, place: usize, stencil: &Stencil) -> Vec<f64> {
        let plane = stencil.plane;
        let mut planes = vec![0.0; self.z.len() * plane];
        for (k, (x, y)) in stencil.layers.iter().enumerate() {
            let values = &self.values[place][self.starts[k]..self.starts[k + 1]];
            let (mx, my) = (self.layers[k].x.len(), self.layers[k].y.len());
            let mut half = vec![0.0; my * stencil.columns];
            product(values, x, mx, &mut half);
            product(y, &half, my, &mut planes[k * plane..(k + 1) * plane]);
        }
        let mut out = vec![0.0; stencil.z.len() / self.z.len() * plane];
        product(&stencil.z, &planes, self.z.len(), &mut out);
        out
    }

    /// Every component of every drive at one point within the box, \[series\].
    #[must_use]
    pub fn at(&self, [x_m, y_m, z_m]: [f64; 3]) -> Vec<f64> {
        let mut out = vec![0.0; self.values.len()];
        for (k, weight) in self.z.cardinal(z_m).into_iter().enumerate() {
            let layer = &self.layers[k];
            let (x, y) = (layer.x.cardinal(x_m), layer.y.cardinal(y_m));
            let mut column = vec![0.0; x.len()];
            for (out, values) in out.iter_mut().zip(&self.values) {
                let values = &values[self.starts[k]..self.starts[k + 1]];
                // Along y first: many sums at a time.
                column.fill(0.0);
                for (row, y) in values.chunks_exact(x.len()).zip(&y) {
                    for (sum, value) in column.iter_mut().zip(row) {
                        *sum += y * value;
                    }
                }
                let sum: f64 = column.iter().zip(&x).map(|(v, x)| v * x).sum();
                *out += weight * sum;
            }
        }
        out
    }
}

/// Weights of a table's nodes on a grid.
#[derive(Debug, Clone)]
pub struct Stencil {
    /// For every layer along x, [node, grid], and along y, [grid, node].
    layers: Vec<(Vec<f64>, Vec<f64>)>,
    /// [grid, node]
    z: Vec<f64>,
    columns: usize,
    plane: usize,
}

/// Of the gradient or of the field.
pub(super) fn kind(place: usize, components: Components) -> usize {
    usize::from(place % components.count() >= GRADIENT)
}
