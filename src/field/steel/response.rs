//! The linear response of one core to a smooth field from outside.
//!
//! The field of neighbours varies slowly over a core, and a core's own double layer acts on its
//! neighbours through kernels that are smooth over it. Both pass through a few rings: the
//! potential sent is sampled there, and the layer is felt as moments there, whatever its shape
//! at the edges. The azimuth is a regular grid of angles, in which one core is block-circulant.

use serde::{Deserialize, Serialize};

use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

use super::CoreShape;
use super::double_layer::operators;
use super::exchange::{Grading, Stretched, side_panels};
use super::generatrix::{Face, Generatrix, Panel};
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;

/// A ring of the exchange grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ring {
    /// Radius, m.
    pub r_m: f64,
    /// Height, m.
    pub z_m: f64,
    /// Outer normal (r, z).
    pub normal: [f64; 2],
}

/// A part of a face with rings on it: face, from and to in its coordinate, m.
pub(super) type RingPanel = (Face, f64, f64);

/// Each face cut into panels at most `length_m(z)` long, the side from the top down.
pub(super) fn ring_panels(shape: CoreShape, length_m: impl Fn(f64) -> f64) -> Vec<RingPanel> {
    let mut panels: Vec<RingPanel> = Vec::new();
    for (face, z_m) in [(Face::Bottom, shape.bottom_m), (Face::Top, shape.top_m)] {
        let pieces = (shape.radius_m / length_m(z_m)).ceil().max(1.0);
        for piece in 0..pieces as usize {
            let edge = |k: usize| shape.radius_m * k as f64 / pieces;
            panels.push((face, edge(piece), edge(piece + 1)));
        }
    }
    let side = side_panels(shape, &length_m);
    panels.extend(side.into_iter().map(|(from, to)| (Face::Side, from, to)));
    panels
}

/// Integrals of a panel's layer polynomials times the rings' over what the two panels share;
/// layer times interpolation times r is a polynomial there, for which `product` is exact.
fn gather_shared(
    shape: CoreShape,
    (panel, layer): (&Panel, &Basis),
    ((face, from, to), basis): (&RingPanel, &Basis),
    product: &gauss::Rule,
    mut add: impl FnMut(usize, usize, f64),
) {
    let (lo, hi) = panel.range_m();
    let (lo, hi) = (lo.max(*from), hi.min(*to));
    if *face != panel.face || lo >= hi {
        return;
    }
    let mut shares = vec![0.0; layer.size()];
    let mut values = vec![0.0; basis.size()];
    let (half, middle) = (0.5 * (hi - lo), 0.5 * (lo + hi));
    for (x, weight) in product.nodes.iter().zip(&product.weights) {
        let coordinate = middle + half * x;
        let weight = half * weight * shape.on(panel.face, coordinate).0;
        let length = panel.to_m - panel.from_m;
        layer.weights(
            2.0 * (coordinate - panel.from_m) / length - 1.0,
            &mut shares,
        );
        basis.weights(2.0 * (coordinate - from) / (to - from) - 1.0, &mut values);
        for (ring, value) in values.iter().enumerate() {
            for (place, share) in shares.iter().enumerate() {
                add(place, ring, weight * share * value);
            }
        }
    }
}

/// Rings on a core's outline and the interpolation from them to the outline's nodes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Rings {
    /// The rings.
    pub rings: Vec<Ring>,
    /// Values on the rings to values on the outline's nodes, [outline node, ring].
    pub to_nodes: DMatrix<f64>,
    /// Layers on the outline's nodes to moments on the rings, [outline node, ring].
    gather: DMatrix<f64>,
    /// Panels over parts of which kernels vary.
    pub stretched: Vec<Stretched>,
    /// Rings a panel, at most.
    pub order: usize,
}

impl Rings {
    /// Gauss nodes, `order` a panel, on each face cut into panels at most `length_m(z)` long,
    /// z being the panel's height closest to where the rings are looked at from.
    #[must_use]
    pub fn new(outline: &Generatrix, order: usize, length_m: impl Fn(f64) -> f64) -> Self {
        let panels = ring_panels(outline.shape, length_m);
        let orders = vec![order; panels.len()];
        Self::on_panels(outline, &panels, &orders)
    }

    /// The same on `panels` that cover the outline, of `orders`.
    pub(super) fn on_panels(outline: &Generatrix, panels: &[RingPanel], orders: &[usize]) -> Self {
        let shape = outline.shape;
        let bases: Vec<Basis> = (orders.iter())
            .map(|order| Basis::new(gauss::rule(*order)))
            .collect();
        let firsts: Vec<usize> = (0..orders.len())
            .map(|panel| orders[..panel].iter().sum())
            .collect();
        let mut rings = Vec::with_capacity(orders.iter().sum());
        for ((face, from, to), order) in panels.iter().zip(orders) {
            rings.extend(gauss::rule(*order).nodes.iter().map(|x| {
                let (r_m, z_m, normal) = shape.on(*face, from + 0.5 * (to - from) * (1.0 + x));
                Ring { r_m, z_m, normal }
            }));
        }
        // Weights of all rings at a place of a face; (ring, weight) of those that have one.
        let most = orders.iter().copied().max().unwrap_or(0);
        let mut weights = vec![0.0; most];
        let mut at = |face: Face, coordinate: f64, put: &mut dyn FnMut(usize, f64)| {
            for (index, (of, from, to)) in panels.iter().enumerate() {
                if *of == face && (*from..=*to).contains(&coordinate) {
                    let weights = &mut weights[..orders[index]];
                    bases[index].weights(2.0 * (coordinate - from) / (to - from) - 1.0, weights);
                    for (place, weight) in weights.iter().enumerate() {
                        put(firsts[index] + place, *weight);
                    }
                    return;
                }
            }
        };
        let mut to_nodes = DMatrix::zeros(outline.nodes.len(), rings.len());
        let mut gather = DMatrix::zeros(outline.nodes.len(), rings.len());
        let layer = Basis::new(gauss::rule(outline.order));
        for (index, panel) in outline.panels.iter().enumerate() {
            let first = index * outline.order;
            for (place, node) in outline.nodes[first..first + outline.order]
                .iter()
                .enumerate()
            {
                let coordinate = panel.coordinate_of(node);
                at(panel.face, coordinate, &mut |ring, weight| {
                    to_nodes[(first + place, ring)] = weight;
                });
            }
            for (of, to_ring) in panels.iter().enumerate() {
                let add = |place: usize, ring: usize, share: f64| {
                    gather[(first + place, firsts[of] + ring)] += share;
                };
                let product = gauss::rule((outline.order + orders[of]).div_ceil(2));
                let (panel, to_ring) = ((panel, &layer), (to_ring, &bases[of]));
                gather_shared(shape, panel, to_ring, product, add);
            }
        }
        Self {
            rings,
            to_nodes,
            gather,
            stretched: Vec::new(),
            order: most,
        }
    }

    /// The rings by which the cores of an array exchange potentials: panels graded by `grading`.
    #[must_use]
    pub fn graded(outline: &Generatrix, order: usize, grading: &Grading) -> Self {
        Self::graded_within(outline, order, grading, |_| f64::INFINITY)
    }

    /// The same, panels at z being no longer than `most_m(z)` either.
    #[must_use]
    pub(crate) fn graded_within(
        outline: &Generatrix,
        order: usize,
        grading: &Grading,
        most_m: impl Fn(f64) -> f64,
    ) -> Self {
        let length_m = |z_m: f64| grading.length_m(z_m).min(most_m(z_m));
        let mut rings = Self::new(outline, order, length_m);
        // The side's panels come last.
        let side = side_panels(outline.shape, length_m);
        let ends = rings.rings.len() - order * side.len();
        rings.stretched = side
            .into_iter()
            .enumerate()
            .filter(|(_, (from, to))| grading.stretches(to - from))
            .map(|(index, (from_m, to_m))| Stretched {
                first: ends + index * order,
                panel: Panel {
                    face: Face::Side,
                    from_m,
                    to_m,
                },
            })
            .collect();
        rings
    }

    /// Moments on the rings of layers on the nodes: [ring, layer], A m^2 a radian.
    #[must_use]
    pub fn moments(&self, layers: &DMatrix<f64>) -> DMatrix<f64> {
        self.gather.transpose() * layers
    }
}

/// One core's response: potentials on the exchange grid to layers and to moments.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Response {
    /// The outline on which the layers live.
    pub outline: Generatrix,
    /// The exchange rings.
    pub exchange: Rings,
    /// Angles of the exchange grid, theta = k tau / angles.
    pub angles: usize,
    /// For every mode: layer on the nodes for a unit potential on each ring.
    pub layers: Vec<DMatrix<f64>>,
    /// For every mode: moments on the rings for a unit potential on each ring.
    moments: Vec<DMatrix<f64>>,
    /// Mode 0 for a potential given on the nodes.
    axial: nalgebra::LU<f64, nalgebra::Dyn, nalgebra::Dyn>,
    share: f64,
}

impl Response {
    /// Responses of modes 0 to `modes` - 1 of a core with permeability `relative_permeability`.
    #[must_use]
    pub fn new(
        outline: Generatrix,
        exchange: Rings,
        angles: usize,
        modes: usize,
        relative_permeability: f64,
        quadrature: f64,
    ) -> Self {
        let share = (relative_permeability - 1.0) / relative_permeability;
        let systems: Vec<_> = operators(&outline, modes, quadrature)
            .into_iter()
            .enumerate()
            .map(|(mode, w)| system(&outline, w, relative_permeability, mode).lu())
            .collect();
        let layers: Vec<DMatrix<f64>> = systems
            .iter()
            .enumerate()
            .map(|(mode, lu)| {
                let rhs = &exchange.to_nodes * share;
                let mut layers = lu.solve(&rhs).unwrap_or(rhs);
                if mode == 0 {
                    for mut column in layers.column_iter_mut() {
                        let mean = mean(&outline, column.iter());
                        column.add_scalar_mut(-mean);
                    }
                }
                layers
            })
            .collect();
        let moments = layers.iter().map(|l| exchange.moments(l)).collect();
        let axial = systems
            .into_iter()
            .next()
            .unwrap_or_else(|| DMatrix::identity(1, 1).lu());
        Self {
            outline,
            exchange,
            angles,
            layers,
            moments,
            axial,
            share,
        }
    }

    /// Number of unknowns a core.
    #[must_use]
    pub fn size(&self) -> usize {
        self.angles * self.exchange.rings.len()
    }

    /// The layer of mode 0 for a potential on the nodes, its mean zero.
    #[must_use]
    pub(crate) fn axial_layer(&self, potential: &DVector<f64>) -> DVector<f64> {
        let centred = potential.add_scalar(-mean(&self.outline, potential.iter()));
        let rhs = centred * self.share;
        let mut layer = self.axial.solve(&rhs).unwrap_or(rhs);
        let shift = mean(&self.outline, layer.iter());
        layer.add_scalar_mut(-shift);
        layer
    }

    /// Moments on the rings for potentials on the rings, of azimuthal number `mode`.
    pub(super) fn ring_moments(&self, mode: usize) -> &DMatrix<f64> {
        &self.moments[mode]
    }

    /// The core's moments for potentials on the exchange grid: a dense block-circulant matrix,
    /// index = angle * rings + ring.
    #[must_use]
    pub fn matrix(&self) -> DMatrix<f64> {
        let rings = self.exchange.rings.len();
        let angles = self.angles;
        // The block for an angle difference.
        let blocks: Vec<DMatrix<f64>> = (0..angles)
            .map(|k| {
                let mut block = DMatrix::zeros(rings, rings);
                for (mode, moments) in self.moments.iter().enumerate() {
                    let factor = if mode == 0 { 1.0 } else { 2.0 };
                    let phase = TAU * ((mode * k) % angles) as f64 / angles as f64;
                    block += moments * (factor / angles as f64 * phase.cos());
                }
                block
            })
            .collect();
        let mut matrix = DMatrix::zeros(self.size(), self.size());
        for row in 0..angles {
            for column in 0..angles {
                matrix
                    .view_mut((row * rings, column * rings), (rings, rings))
                    .copy_from(&blocks[(row + angles - column) % angles]);
            }
        }
        matrix
    }

    /// Azimuthal modes of a potential on the exchange grid: column 0 for mode 0, then cosine and
    /// sine of every mode; [ring, column].
    #[must_use]
    pub(crate) fn modes_of(&self, potential: &[f64]) -> DMatrix<f64> {
        let rings = self.exchange.rings.len();
        let mut out = DMatrix::zeros(rings, 2 * self.layers.len() - 1);
        for (k, values) in potential.chunks(rings).enumerate() {
            for mode in 0..self.layers.len() {
                let factor = if mode == 0 { 1.0 } else { 2.0 } / self.angles as f64;
                let (s, c) =
                    (TAU * ((mode * k) % self.angles) as f64 / self.angles as f64).sin_cos();
                for (ring, value) in values.iter().enumerate() {
                    out[(ring, (2 * mode).saturating_sub(1))] += factor * c * value;
                    if mode > 0 {
                        out[(ring, 2 * mode)] += factor * s * value;
                    }
                }
            }
        }
        out
    }

    /// Moments on the exchange grid of a layer of mode 0 on the nodes.
    #[must_use]
    pub fn on_grid(&self, layer: &DVector<f64>) -> DVector<f64> {
        let layer = DMatrix::from_column_slice(layer.len(), 1, layer.as_slice());
        let ring = self.exchange.moments(&layer);
        DVector::from_iterator(
            self.size(),
            (0..self.angles).flat_map(|_| ring.iter().copied()),
        )
    }

    /// Layers on the nodes for the modes that [`Response::modes_of`] gives, same columns.
    #[must_use]
    pub(crate) fn layers_of(&self, modes: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.outline.nodes.len(), modes.ncols());
        for column in 0..modes.ncols() {
            let mode = column.div_ceil(2);
            out.set_column(column, &(&self.layers[mode] * modes.column(column)));
        }
        out
    }
}

impl Response {
    /// [`Response::layers_of`] for many, side by side.
    pub(super) fn layers_of_all(&self, modes: &[DMatrix<f64>]) -> DMatrix<f64> {
        let waves = 2 * self.layers.len() - 1;
        let mut out = DMatrix::zeros(self.outline.nodes.len(), waves * modes.len());
        for wave in 0..waves {
            let of_wave: Vec<_> = modes.iter().map(|modes| modes.column(wave)).collect();
            let layers = &self.layers[wave.div_ceil(2)] * DMatrix::from_columns(&of_wave);
            for (place, layer) in layers.column_iter().enumerate() {
                out.set_column(place * waves + wave, &layer);
            }
        }
        out
    }
}

/// (1/mu_r) + (1 - 1/mu_r) W, with the constants of mode 0 kept finite.
#[must_use]
pub fn system(
    outline: &Generatrix,
    w: DMatrix<f64>,
    relative_permeability: f64,
    mode: usize,
) -> DMatrix<f64> {
    let inverse = 1.0 / relative_permeability;
    let share = (relative_permeability - 1.0) / relative_permeability;
    let mut matrix = w;
    if mode == 0 {
        let total: f64 = outline.areas_m2().sum();
        for (mut column, area) in matrix.column_iter_mut().zip(outline.areas_m2()) {
            column.add_scalar_mut(area / total);
        }
    }
    matrix *= share;
    for i in 0..matrix.nrows() {
        matrix[(i, i)] += inverse;
    }
    matrix
}

/// Mean over the outline's surface.
pub fn mean<'a>(outline: &Generatrix, values: impl Iterator<Item = &'a f64>) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (value, area) in values.zip(outline.areas_m2()) {
        sum += value * area;
        total += area;
    }
    sum / total
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::steel::CoreShape;
    use crate::steel::generatrix::Resolution;

    /// Of a constant, of heights, and of radii: 2 pi a (a^2 (2/3) + a h) / 2 pi a (a + h).
    #[test]
    fn means_over_a_cylinder_s_surface() {
        let (a, h) = (0.7, 1.9);
        let shape = CoreShape {
            radius_m: a,
            bottom_m: 0.3,
            top_m: 0.3 + h,
        };
        let outline = Generatrix::new(shape, &[], &Resolution::for_tolerance(1e-3));
        let of = |value: &dyn Fn(&crate::steel::generatrix::Node) -> f64| {
            let values: Vec<f64> = outline.nodes.iter().map(value).collect();
            mean(&outline, values.iter())
        };
        assert!((of(&|_| 1.3) - 1.3).abs() < 1e-14);
        assert!((of(&|node| node.z_m) - (0.3 + 0.5 * h)).abs() < 1e-14);
        let radii = (2.0 / 3.0 * a * a + a * h) / (a + h);
        assert!((of(&|node| node.r_m) - radii).abs() < 1e-14);
    }
}
