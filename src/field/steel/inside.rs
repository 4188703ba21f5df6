//! Flux density inside linear cores: the largest |B| below the surface, and the mean.
//!
//! B = B_incident + mu_0 grad(D v), v being the core's double layer. The core's own winding is
//! evaluated as it stands. What all else sends is known as a potential phi on the outline; inside
//! it is the potential of another layer there,
//!
//! ```text
//! (1 - W) w = phi,    B = mu_0 grad(D w),
//! ```
//!
//! so v + w says everything, for any permeability down to 1. |grad u|^2 of a harmonic u is
//! subharmonic: |B| is largest on the surface of the region looked at, and only that is scanned.

use nalgebra::DMatrix;
use rayon::prelude::*;
use std::f64::consts::TAU;

use super::CoreShape;
use super::array::CoupledArray;
use super::bore::bore_field;
use super::cored_coil::CoredCoil;
use super::double_layer::operators;
use super::generatrix::{Face, Generatrix, Panel, Resolution};
use super::layer_gradient::{COMPONENTS, gradient_operators};
use crate::field::winding::{OnEdge, Winding};
use crate::numerics::gauss;
use crate::numerics::lagrange_basis::Basis;
use crate::units::MU_0_T_M_PER_A;

/// Depth below which the core's largest |B| is told, m.
const DEPTH_M: f64 = 1e-3;
/// The same in radii, if that is less.
const DEPTH_RADII: f64 = 0.1;
/// Least room, as a share of radius and length, that is left inside the depth.
const DEEPEST: f64 = 0.25;
/// Target of the quadratures over the outline, relative to the kernels.
const QUADRATURE: f64 = 1e-7;
/// The curve along which |B| is scanned: the surface at the depth, in a half plane.
const SCAN: Resolution = Resolution {
    order: 8,
    ratio: 0.3,
    tip: 0.0,
    quadrature: QUADRATURE,
};
/// Samples a node of that curve, before the best is polished.
const SAMPLES: usize = 2;
/// Angles a mode of the scan, and of the mean.
const ANGLES: usize = 8;
/// The volume's rule: nodes of this outline's side times nodes of its bottom.
const VOLUME: Resolution = Resolution {
    order: 4,
    ratio: 0.2,
    tip: 0.2,
    quadrature: QUADRATURE,
};
/// Closest to the axis that is evaluated, in radii; the field is even there.
const AXIS: f64 = 1e-3;

/// The flux density inside one core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoreField {
    /// Largest |B| at the depth asked for or deeper, T.
    pub peak_t: f64,
    /// Where that is, m: in the array's coordinates, heights above the windings' top.
    pub peak_at_m: [f64; 3],
    /// Mean of |B| over the whole core's volume, T.
    pub mean_t: f64,
    /// Estimated error of either, relative to it: the larger. Of outline and modes, what the
    /// last polynomial degrees of every panel and the last mode contribute; of the mean, what a
    /// node a panel less changes. No less than the estimate of the coil's own solution, if that
    /// has one.
    pub relative_error: f64,
}

/// The depth at which a core's peak is told: 1 mm, a tenth of the radius if that is less; a
/// quarter of the length in flatter discs.
///
/// At a sharp edge |B| of linear steel has no maximum.
#[must_use]
pub fn peak_depth_m(shape: CoreShape) -> f64 {
    allowed_depth_m(shape, DEPTH_M.min(DEPTH_RADII * shape.radius_m))
}

fn allowed_depth_m(shape: CoreShape, depth_m: f64) -> f64 {
    depth_m.min(DEEPEST * shape.radius_m.min(shape.length_m()))
}

impl CoredCoil {
    /// |B| in the core at `current_a`; the largest at least `depth_m` below the surface.
    ///
    /// Domain: depth > 0, see [`peak_depth_m`]; deeper than a quarter of radius or length is taken
    /// as that quarter. The closer to the edges of the steel, the finer the outline must be.
    ///
    /// # Errors
    /// A point on the winding's edge: the core is not in the bore.
    pub fn core_field(&self, current_a: f64, depth_m: f64) -> Result<CoreField, OnEdge> {
        let outline = self.core.outline();
        let density = self.core.density_a();
        let layers = DMatrix::from_column_slice(density.len(), 1, density) * current_a;
        let core = Core {
            layers,
            current_a,
            position_m: [0.0, 0.0],
        };
        let field = core_fields(outline, &self.winding, &[core], depth_m)?[0];
        Ok(CoreField {
            // A coil solved at a resolution of the caller's has no estimate, NaN: max drops it.
            relative_error: field.relative_error.max(self.relative_error),
            ..field
        })
    }
}

impl CoupledArray {
    /// |B| in every core with `currents_a` in the coils, all modes; the largest at least
    /// `depth_m` below each core's surface.
    ///
    /// Domain: as many currents as coils; else as for [`CoredCoil::core_field`].
    ///
    /// # Errors
    /// A point on the winding's edge: the cores are not in the bores.
    pub fn core_fields(&self, currents_a: &[f64], depth_m: f64) -> Result<Vec<CoreField>, OnEdge> {
        self.core_fields_of(currents_a, depth_m, false)
    }

    /// What all other modes add to the largest |B| of the axisymmetric one in every core, T.
    ///
    /// # Errors
    /// As [`CoupledArray::core_fields`].
    pub fn transverse_peaks_t(&self, currents_a: &[f64], depth_m: f64) -> Result<Vec<f64>, OnEdge> {
        let all = self.core_fields_of(currents_a, depth_m, false)?;
        let axial = self.core_fields_of(currents_a, depth_m, true)?;
        Ok(all
            .iter()
            .zip(&axial)
            .map(|(all, axial)| (all.peak_t - axial.peak_t).max(0.0))
            .collect())
    }

    fn core_fields_of(
        &self,
        currents_a: &[f64],
        depth_m: f64,
        axial_only: bool,
    ) -> Result<Vec<CoreField>, OnEdge> {
        let outline = &self.response.outline;
        let count = self.positions_m.len();
        let mut modes: Vec<DMatrix<f64>> = Vec::with_capacity(count);
        for core in 0..count {
            let mut potential = vec![0.0; self.response.size()];
            for (drive, current) in self.potentials.iter().zip(currents_a) {
                for (sum, value) in potential.iter_mut().zip(&drive[core]) {
                    *sum += current * value;
                }
            }
            let mut of_core = self.response.modes_of(&potential);
            if axial_only {
                let columns = of_core.ncols();
                of_core.columns_mut(1, columns - 1).fill(0.0);
            }
            modes.push(of_core);
        }
        let sent = incident_layers(outline, &self.response.exchange.to_nodes, &modes);
        let cores: Vec<Core> = modes
            .iter()
            .zip(sent)
            .enumerate()
            .map(|(core, (modes, sent))| {
                let current_a = currents_a.get(core).copied().unwrap_or(0.0);
                let mut layers = self.response.layers_of(modes) + sent;
                layers.column_mut(0).axpy(current_a, &self.own_layer, 1.0);
                Core {
                    layers,
                    current_a,
                    position_m: self.positions_m[core],
                }
            })
            .collect();
        core_fields(outline, &self.winding, &cores, depth_m)
    }
}

/// The layers w with (1 - W) w = phi of potentials on the exchange rings, [core][node, column].
fn incident_layers(
    outline: &Generatrix,
    to_nodes: &DMatrix<f64>,
    potentials: &[DMatrix<f64>],
) -> Vec<DMatrix<f64>> {
    let nodes = outline.nodes.len();
    let columns = potentials.first().map_or(1, DMatrix::ncols);
    let mut out = vec![DMatrix::zeros(nodes, columns); potentials.len()];
    // A core alone hears nothing.
    if potentials.iter().all(|p| p.iter().all(|v| *v == 0.0)) {
        return out;
    }
    for (mode, w) in operators(outline, columns.div_ceil(2), QUADRATURE)
        .into_iter()
        .enumerate()
    {
        let mine: Vec<usize> = (0..columns).filter(|c| c.div_ceil(2) == mode).collect();
        let rings = DMatrix::from_fn(to_nodes.ncols(), mine.len() * out.len(), |ring, place| {
            potentials[place / mine.len()][(ring, mine[place % mine.len()])]
        });
        let system = DMatrix::identity(nodes, nodes) - w;
        let solved = system
            .lu()
            .solve(&(to_nodes * rings))
            .expect("eigenvalues of W lie in [0, 1), so those of the matrix are positive");
        for (place, column) in solved.column_iter().enumerate() {
            out[place / mine.len()].set_column(mine[place % mine.len()], &column);
        }
    }
    out
}

/// One core to be looked into.
struct Core {
    /// Layers on the nodes at the given currents: column 0 for mode 0, then cosine and sine of
    /// every mode, A. They hold all but the own winding's field.
    layers: DMatrix<f64>,
    current_a: f64,
    position_m: [f64; 2],
}

fn core_fields(
    outline: &Generatrix,
    winding: &Winding,
    cores: &[Core],
    depth_m: f64,
) -> Result<Vec<CoreField>, OnEdge> {
    let shape = outline.shape;
    let depth_m = allowed_depth_m(shape, depth_m);
    let full: Vec<DMatrix<f64>> = cores.iter().map(|c| c.layers.clone()).collect();
    let reduced: Vec<DMatrix<f64>> = full.iter().map(|l| reduced(outline, l)).collect();
    let layers: Vec<&DMatrix<f64>> = full.iter().chain(&reduced).collect();
    let currents: Vec<f64> = (0..2)
        .flat_map(|_| cores.iter().map(|c| c.current_a))
        .collect();

    let curve = scan_curve(winding, shape, depth_m);
    let fine = Volume::new(winding, shape, VOLUME.order);
    let coarse = Volume::new(winding, shape, VOLUME.order - 1);
    let mut targets: Vec<(f64, f64)> = curve.nodes.iter().map(|n| (n.r_m, n.z_m)).collect();
    let first_fine = targets.len();
    targets.extend(&fine.points);
    let first_coarse = targets.len();
    targets.extend(&coarse.points);
    let fields = fields_at(outline, winding, &targets, &layers, &currents)?;

    let peaks: Vec<(f64, f64, f64, f64)> = fields[..cores.len()]
        .par_iter()
        .map(|field| scan(&curve, field, AXIS * shape.radius_m))
        .collect();
    let targets: Vec<(f64, f64)> = peaks.iter().map(|(_, r, z, _)| (*r, *z)).collect();
    let there = fields_at(outline, winding, &targets, &layers, &currents)?;

    Ok(cores
        .iter()
        .enumerate()
        .map(|(index, core)| {
            let (scanned, r_m, z_m, angle) = peaks[index];
            let at = |field: &Field| field.at(index, angle);
            let (b, without) = (at(&there[index]), at(&there[index + cores.len()]));
            let peak_t = norm(b);
            let lost = norm([b[0] - without[0], b[1] - without[1], b[2] - without[2]]);
            let mean_t = fine.mean(&fields[index], first_fine);
            let less = fine.mean(&fields[index + cores.len()], first_fine);
            let coarser = coarse.mean(&fields[index], first_coarse);
            let share = |error: f64, of: f64| if of > 0.0 { error / of } else { 0.0 };
            let relative_error = share(lost + (scanned - peak_t).abs(), peak_t).max(share(
                (less - mean_t).abs() + (coarser - mean_t).abs(),
                mean_t,
            ));
            let (sin, cos) = angle.sin_cos();
            let [x_m, y_m] = core.position_m;
            CoreField {
                peak_t,
                peak_at_m: [x_m + r_m * cos, y_m + r_m * sin, z_m],
                mean_t,
                relative_error,
            }
        })
        .collect())
}

fn norm(b: [f64; 3]) -> f64 {
    b[0].hypot(b[1]).hypot(b[2])
}

/// The layers without every panel's highest polynomial degree, without the upper half of the
/// degrees next to the steel's edges, where they decay slowly, and without the last mode.
fn reduced(outline: &Generatrix, layers: &DMatrix<f64>) -> DMatrix<f64> {
    let order = outline.order;
    let polynomials = legendre(order);
    let weights = &gauss::rule(order).weights;
    let panels = &outline.panels;
    let at_edge = |index: usize| {
        let other = |neighbour: Option<&Panel>| {
            neighbour.is_some_and(|panel| panel.face != panels[index].face)
        };
        other(index.checked_sub(1).map(|i| &panels[i])) || other(panels.get(index + 1))
    };
    let kept: Vec<usize> = (0..panels.len())
        .map(|index| if at_edge(index) { order / 2 } else { order - 1 })
        .collect();
    let mut out = layers.clone();
    for (values, kept) in out
        .as_mut_slice()
        .chunks_mut(order)
        .zip(kept.iter().cycle())
    {
        for polynomial in &polynomials[*kept..] {
            let weighted = || polynomial.iter().zip(weights).map(|(p, w)| p * w);
            let square: f64 = weighted().zip(polynomial).map(|(a, p)| a * p).sum();
            let share = weighted()
                .zip(values.iter())
                .map(|(a, v)| a * v)
                .sum::<f64>()
                / square;
            for (value, p) in values.iter_mut().zip(polynomial) {
                *value -= share * p;
            }
        }
    }
    let columns = out.ncols();
    if columns > 1 {
        out.columns_mut(columns - 2, 2).fill(0.0);
    }
    out
}

/// Legendre polynomials of degree 0 to `order` - 1 on the nodes of that order.
fn legendre(order: usize) -> Vec<Vec<f64>> {
    let nodes = &gauss::rule(order).nodes;
    let mut out = vec![vec![1.0; order], nodes.clone()];
    for degree in 2..order {
        let k = degree as f64;
        let next = nodes
            .iter()
            .enumerate()
            .map(|(i, x)| {
                ((2.0 * k - 1.0) * x * out[degree - 1][i] - (k - 1.0) * out[degree - 2][i]) / k
            })
            .collect();
        out.push(next);
    }
    out.truncate(order);
    out
}

/// B at some targets in one core: [component and target, column of the modes], T.
struct Field {
    values: DMatrix<f64>,
}

impl Field {
    /// (B_r, B_theta, B_z) at a target and an angle.
    fn at(&self, target: usize, angle: f64) -> [f64; 3] {
        let rows = target * COMPONENTS..(target + 1) * COMPONENTS;
        combine(
            angle,
            |component, column| self.values[(rows.start + component, column)],
            self.values.ncols(),
        )
    }
}

/// (B_r, B_theta, B_z) at an angle from the components' modes.
fn combine(angle: f64, value: impl Fn(usize, usize) -> f64, columns: usize) -> [f64; 3] {
    let mut b = [value(0, 0), 0.0, value(1, 0)];
    for cosine in (1..columns).step_by(2) {
        let sine = cosine + 1;
        let (s, c) = (sine as f64 * 0.5 * angle).sin_cos();
        b[0] += c * value(0, cosine) + s * value(0, sine);
        b[1] += c * value(2, sine) - s * value(2, cosine);
        b[2] += c * value(1, cosine) + s * value(1, sine);
    }
    b
}

/// The fields of all `layers` with their own windings' currents.
fn fields_at(
    outline: &Generatrix,
    winding: &Winding,
    targets: &[(f64, f64)],
    layers: &[&DMatrix<f64>],
    currents_a: &[f64],
) -> Result<Vec<Field>, OnEdge> {
    let columns = layers.first().map_or(1, |l| l.ncols());
    let modes = columns.div_ceil(2);
    let own = targets
        .par_iter()
        .map(|(r_m, z_m)| bore_field(winding, *r_m, *z_m, QUADRATURE))
        .collect::<Result<Vec<_>, _>>()?;
    let operators = gradient_operators(outline, targets, modes, QUADRATURE);
    let products: Vec<DMatrix<f64>> = operators
        .par_iter()
        .enumerate()
        .map(|(mode, operator)| {
            let mine = columns_of(mode);
            let width = mine.len();
            let side_by_side =
                DMatrix::from_fn(outline.nodes.len(), width * layers.len(), |node, place| {
                    MU_0_T_M_PER_A * layers[place / width][(node, mine.start + place % width)]
                });
            operator.tr_mul(&side_by_side)
        })
        .collect();
    Ok(currents_a
        .iter()
        .enumerate()
        .map(|(index, current_a)| {
            let mut values = DMatrix::zeros(COMPONENTS * targets.len(), columns);
            for (mode, product) in products.iter().enumerate() {
                let mine = columns_of(mode);
                let width = mine.len();
                values
                    .columns_mut(mine.start, width)
                    .copy_from(&product.columns(index * width, width));
            }
            for (target, (b_r, b_z)) in own.iter().enumerate() {
                values[(COMPONENTS * target, 0)] += current_a * b_r;
                values[(COMPONENTS * target + 1, 0)] += current_a * b_z;
            }
            Field { values }
        })
        .collect())
}

/// A mode's columns in a core's layers.
fn columns_of(mode: usize) -> std::ops::Range<usize> {
    (2 * mode).saturating_sub(1)..2 * mode + 1
}

/// The surface `depth_m` inside, cut into panels as fine as what lies that far off.
fn scan_curve(winding: &Winding, shape: CoreShape, depth_m: f64) -> Generatrix {
    let inner = CoreShape {
        radius_m: shape.radius_m - depth_m,
        bottom_m: shape.bottom_m + depth_m,
        top_m: shape.top_m - depth_m,
    };
    let tip_m = depth_m.max(winding.inner_radius_m - inner.radius_m);
    let smaller = inner.radius_m.min(0.5 * inner.length_m());
    Generatrix::new(
        inner,
        &[(0.0, tip_m), (-winding.length_m, tip_m)],
        &Resolution {
            tip: depth_m / smaller,
            ..SCAN
        },
    )
}

/// Largest |B| on the curve, and where: (|B|, r, z, angle).
fn scan(curve: &Generatrix, field: &Field, nearest_m: f64) -> (f64, f64, f64, f64) {
    let order = curve.order;
    let basis = Basis::new(gauss::rule(order));
    let columns = field.values.ncols();
    let mut weights = vec![0.0; order];
    // The components' modes on a panel at -1 <= x <= 1.
    let mut modes_at = |panel: usize, x: f64| {
        basis.weights(x, &mut weights);
        let mut modes = vec![[0.0; COMPONENTS]; columns];
        for (place, weight) in weights.iter().enumerate() {
            let row = COMPONENTS * (panel * order + place);
            for (column, slot) in modes.iter_mut().enumerate() {
                for (component, value) in slot.iter_mut().enumerate() {
                    *value += weight * field.values[(row + component, column)];
                }
            }
        }
        modes
    };
    let size = |modes: &[[f64; COMPONENTS]], angle: f64| {
        norm(combine(
            angle,
            |component, column| modes[column][component],
            columns,
        ))
    };
    let angles = if columns == 1 {
        1
    } else {
        ANGLES * columns.div_ceil(2)
    };
    let samples = SAMPLES * order;
    let mut best = (f64::NEG_INFINITY, 0, 0.0, 0.0);
    for panel in 0..curve.panels.len() {
        for sample in 0..=samples {
            let x = 2.0 * sample as f64 / samples as f64 - 1.0;
            let modes = modes_at(panel, x);
            for k in 0..angles {
                let angle = TAU * k as f64 / angles as f64;
                let value = size(&modes, angle);
                if value > best.0 {
                    best = (value, panel, x, angle);
                }
            }
        }
    }
    // Steps to the four sides that shrink where none of them leads higher.
    let (mut value, panel, mut x, mut angle) = best;
    let (mut step, mut turn) = (
        2.0 / samples as f64,
        if columns == 1 {
            0.0
        } else {
            TAU / angles as f64
        },
    );
    while step > 1e-5 {
        let moves = [(step, 0.0), (-step, 0.0), (0.0, turn), (0.0, -turn)];
        let next = moves
            .into_iter()
            .map(|(dx, dt)| ((x + dx).clamp(-1.0, 1.0), angle + dt))
            .map(|(x, angle)| (size(&modes_at(panel, x), angle), x, angle))
            .fold((value, x, angle), |a, b| if b.0 > a.0 { b } else { a });
        if next.0 > value {
            (value, x, angle) = next;
        } else {
            step *= 0.5;
            turn *= 0.5;
        }
    }
    let panel = curve.panels[panel];
    let coordinate = panel.from_m + 0.5 * (panel.to_m - panel.from_m) * (1.0 + x);
    let (r_m, z_m, _) = curve.shape.on(panel.face, coordinate);
    (value, r_m.max(nearest_m), z_m, angle)
}

/// A rule over the core's half plane.
struct Volume {
    points: Vec<(f64, f64)>,
    /// Weights with r, their sum one.
    weights: Vec<f64>,
}

impl Volume {
    fn new(winding: &Winding, shape: CoreShape, order: usize) -> Self {
        let outline = Generatrix::of_coil(winding, shape, &Resolution { order, ..VOLUME });
        let on = |normal: [f64; 2]| outline.nodes.iter().filter(move |n| n.normal == normal);
        let across = on(shape.on(Face::Bottom, 0.0).2);
        let along: Vec<_> = on(shape.on(Face::Side, 0.0).2).collect();
        let total = 0.5 * shape.radius_m * shape.radius_m * shape.length_m();
        let (points, weights) = across
            .flat_map(|a| {
                along.iter().map(move |b| {
                    let area = a.weight_m * b.weight_m;
                    ((a.r_m, b.z_m), a.r_m * area / total)
                })
            })
            .unzip();
        Self { points, weights }
    }

    /// Mean of |B| of a field whose targets from `first` on are the points.
    fn mean(&self, field: &Field, first: usize) -> f64 {
        let columns = field.values.ncols();
        let angles = if columns == 1 {
            1
        } else {
            ANGLES * columns.div_ceil(2)
        };
        let mut sum = 0.0;
        for (place, weight) in self.weights.iter().enumerate() {
            let ring: f64 = (0..angles)
                .map(|k| norm(field.at(first + place, TAU * k as f64 / angles as f64)))
                .sum();
            sum += weight * ring / angles as f64;
        }
        sum
    }
}
