//! Flux density inside linear cores: the largest |B| below the surface, and the mean.
//!
//! B = B_incident + mu_0 grad(D v), v being the core's double layer. The core's own winding is
//! evaluated as it is. What all else sends is known as a potential phi on the outline; inside
//! it is the potential of another layer there,
//!
//! ```text
//! (1 - W) w = phi,    B = mu_0 grad(D w),
//! ```
//!
//! so v + w says everything, for any permeability down to 1. |grad u|^2 of a harmonic u is
//! subharmonic: |B| is largest on the surface of the region looked at, and only that is scanned.

use nalgebra::{DMatrix, Dyn, LU};
use rayon::prelude::*;

use super::CoreShape;
use super::array::CoupledArray;
use super::bore::{bore_field, nested_bore_fields};
use super::cored_coil::CoredCoil;
use super::double_layer::operators;
use super::generatrix::{Face, Generatrix, Panel, Resolution};
use super::layer_gradient::{COMPONENTS, axial_gradient_operator, gradient_operators};
use super::magnetized::MagnetizedCore;
use super::peak_search::{
    Field, Peak, QUADRATURE, SCAN_ORDER, legendre, norm, projection, scan, scan_curve, scan_order,
    scans, turns, turns_around,
};
use crate::winding::{OnEdge, Winding};
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::gauss;

/// Factor by which the layers' last degrees count in the peak's error, where the
/// difference of two solutions is known as well and where it is not: alone it is at times a
/// thirtieth of the error, the rest coming from all of the outline. By the table of
/// `cargo test --test field steel -- --ignored --nocapture claimed_in_full`.
const LOST_BESIDE_DIFFERENCE: f64 = 0.1;
const LOST_ALONE: f64 = 3.0;
/// Depth below which the core's largest |B| is reported, m.
const DEPTH_M: f64 = 1e-3;
/// The same in radii, if that is less.
const DEPTH_RADII: f64 = 0.1;
/// Least room, as a share of radius and length, that is left inside the depth.
const DEEPEST: f64 = 0.25;
/// The same where the peak was found: close to the surface the kernels exceed what their sum
/// gives by radius over depth.
const PEAK_QUADRATURE: f64 = 1e-11;
/// The volume's rule: nodes of this outline's side times nodes of its bottom; its order is that for a
/// solution of no stated error.
const VOLUME: Resolution = Resolution {
    order: 4,
    ratio: 0.2,
    tip: 0.2,
    quadrature: QUADRATURE,
};
/// The volume's order where the solution errs by `relative_error`: each node more gains about a digit.
fn volume_order(relative_error: f64) -> usize {
    let digits = -relative_error.clamp(1e-9, 1e-4).log10();
    if digits.is_nan() {
        VOLUME.order
    } else {
        VOLUME.order + (digits - 4.0).ceil() as usize
    }
}

/// Closest to the axis that is evaluated, in radii; the field is even there.
const AXIS: f64 = 1e-3;

/// The flux density inside one core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoreField {
    /// Largest |B| at the depth requested or deeper, T.
    pub peak_t: f64,
    /// Where that is, m: in the array's coordinates, heights above the windings' top.
    pub peak_at_m: [f64; 3],
    /// Mean of |B| over the whole core's volume, T.
    pub mean_t: f64,
    /// Estimated error of the peak, relative to it: the difference from the next coarser
    /// solution there, if there is one, what the last polynomial degrees of every panel and the
    /// last mode contribute, and by how much |B| can be larger elsewhere. No less than the
    /// estimate of the solution itself, if that has one.
    pub peak_error: f64,
    /// Estimated error of the mean, relative to it: what the same degrees and mode contribute,
    /// and a node a panel of the volume's rule.
    pub mean_error: f64,
}

impl CoreField {
    /// The larger of both estimated errors.
    #[must_use]
    pub fn relative_error(&self) -> f64 {
        self.peak_error.max(self.mean_error)
    }
}

/// The depth at which a core's peak is reported: 1 mm, a tenth of the radius if that is less; a
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

impl MagnetizedCore {
    /// |B| in a core that answers to `winding` alone, at `current_a`, as [`CoredCoil::core_field`] has it; of its errors
    /// those that a coarser solution shows are not known here.
    ///
    /// # Errors
    /// A point on the winding's edge: the core is not in the bore.
    pub fn core_field(
        &self,
        winding: &Winding,
        current_a: f64,
        depth_m: f64,
    ) -> Result<CoreField, OnEdge> {
        self.inside(winding, current_a, depth_m, LOST_ALONE, VOLUME.order)
    }

    fn inside(
        &self,
        winding: &Winding,
        current_a: f64,
        depth_m: f64,
        lost_counts: f64,
        order: usize,
    ) -> Result<CoreField, OnEdge> {
        let density = self.density_a();
        let core = Core {
            layers: DMatrix::from_column_slice(density.len(), 1, density) * current_a,
            current_a,
            position_m: [0.0, 0.0],
        };
        let fields = core_fields(
            self.outline(),
            winding,
            &[core],
            depth_m,
            lost_counts,
            order,
        )?;
        Ok(fields[0])
    }
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
        let shape = self.core.outline().shape;
        let lost_counts = if self.coarser.is_some() {
            LOST_BESIDE_DIFFERENCE
        } else {
            LOST_ALONE
        };
        let order = volume_order(self.relative_error);
        let field = (self.core).inside(&self.winding, current_a, depth_m, lost_counts, order)?;
        // A coil solved at a resolution of the caller's has no estimate, NaN: max drops it.
        let differs = match &self.coarser {
            Some(coarser) => {
                let differs_t = self.differs_t(coarser, &field, allowed_depth_m(shape, depth_m));
                share(current_a.abs() * differs_t, field.peak_t)
            }
            None => 0.0,
        };
        Ok(CoreField {
            peak_error: (field.peak_error + differs).max(self.relative_error),
            mean_error: field.mean_error.max(self.relative_error),
            ..field
        })
    }

    /// Largest difference from the B of the coarser solution, at the peak and a depth beside it
    /// to either side: at one place both may agree by chance. T/A.
    fn differs_t(&self, coarser: &MagnetizedCore, peak: &CoreField, depth_m: f64) -> f64 {
        let shape = self.core.outline().shape;
        let [x_m, y_m, z_m] = peak.peak_at_m;
        let r_m = x_m.hypot(y_m);
        [(0.0, 0.0), (-depth_m, 0.0), (0.0, depth_m), (0.0, -depth_m)]
            .into_iter()
            .map(|(dr_m, dz_m)| {
                let r_m = (r_m + dr_m).max(AXIS * shape.radius_m);
                let z_m = (z_m + dz_m).clamp(shape.bottom_m + depth_m, shape.top_m - depth_m);
                let (a, b) = (self.core.field(r_m, z_m), coarser.field(r_m, z_m));
                (a.b_r - b.b_r).hypot(a.b_z - b.b_z)
            })
            .fold(0.0, f64::max)
    }
}

/// The largest |B| per ampere at least `depth_m` below the surface of the cores of `coils`, which
/// differ in their windings' outer radii alone, ascending ([`CoredCoil::family`]), T/A:
/// [`CoreField::peak_t`] without the rest, quadratures to `tolerance`. Works on the calling thread.
///
/// # Errors
/// As [`CoredCoil::core_field`].
pub fn peaks_of_family_t(
    coils: &[CoredCoil],
    depth_m: f64,
    tolerance: f64,
) -> Result<Vec<f64>, OnEdge> {
    let Some(first) = coils.first() else {
        return Ok(Vec::new());
    };
    let outline = first.core.outline();
    let shape = outline.shape;
    let scan_depth_m = allowed_depth_m(shape, depth_m);
    let curve = scan_curve(&first.winding, shape, scan_depth_m, scan_order(tolerance));
    let windings: Vec<Winding> = coils.iter().map(|coil| coil.winding).collect();
    let targets = places(&curve);
    let own: Vec<Vec<(f64, f64)>> = targets
        .iter()
        .map(|(r_m, z_m)| nested_bore_fields(&windings, *r_m, *z_m, tolerance))
        .collect::<Result<_, _>>()?;
    let operator = axial_gradient_operator(outline, &targets, tolerance);
    let axial = |operator: &DMatrix<f64>, coil: &CoredCoil| {
        let density = DMatrix::from_column_slice(outline.nodes.len(), 1, coil.core.density_a());
        operator.tr_mul(&(density * MU_0_T_M_PER_A))
    };
    coils
        .iter()
        .enumerate()
        .map(|(index, coil)| {
            let mut values = axial(&operator, coil);
            for (target, own) in own.iter().enumerate() {
                values[(COMPONENTS * target, 0)] += own[index].0;
                values[(COMPONENTS * target + 1, 0)] += own[index].1;
            }
            let peak = scan(&curve, &Field { values }, AXIS * shape.radius_m);
            let (r_m, z_m) = peak.place_m;
            let steel = axial(
                &axial_gradient_operator(outline, &[(r_m, z_m)], tolerance),
                coil,
            );
            let (b_r, b_z) = bore_field(&coil.winding, r_m, z_m, tolerance)?;
            Ok(norm([steel[(0, 0)] + b_r, 0.0, steel[(1, 0)] + b_z]))
        })
        .collect()
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
        self.fields_in(&self.cores(&Incident::new(self), currents_a), depth_m)
    }

    /// [`CoupledArray::core_fields`] of every core, and the same of the axisymmetric mode alone.
    ///
    /// # Errors
    /// As [`CoupledArray::core_fields`].
    pub fn core_fields_and_axial(
        &self,
        currents_a: &[f64],
        depth_m: f64,
    ) -> Result<[Vec<CoreField>; 2], OnEdge> {
        let mut cores = self.cores(&Incident::new(self), currents_a);
        let all = self.fields_in(&cores, depth_m)?;
        for core in &mut cores {
            let columns = core.layers.ncols();
            core.layers.columns_mut(1, columns - 1).fill(0.0);
        }
        Ok([all, self.fields_in(&cores, depth_m)?])
    }

    fn fields_in(&self, cores: &[Core], depth_m: f64) -> Result<Vec<CoreField>, OnEdge> {
        let (outline, winding) = (&self.response.outline, &self.winding);
        let fields = core_fields(outline, winding, cores, depth_m, LOST_ALONE, VOLUME.order)?;
        Ok(fields
            .into_iter()
            .map(|field| CoreField {
                peak_error: field.peak_error.max(self.relative_error),
                mean_error: field.mean_error.max(self.relative_error),
                ..field
            })
            .collect())
    }

    fn cores(&self, incident: &Incident, currents_a: &[f64]) -> Vec<Core> {
        let count = self.positions_m.len();
        let modes: Vec<DMatrix<f64>> = (0..count)
            .map(|core| self.modes_at(core, currents_a))
            .collect();
        let sent = incident.layers(&self.response.exchange.to_nodes, &modes);
        modes
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
            .collect()
    }
}

/// Tables for the flux density in the cores of one array, whatever the currents.
#[derive(Debug)]
pub struct Inspection {
    incident: Incident,
    curve: Generatrix,
    at_curve: Targets,
}

impl Inspection {
    /// Prepares for [`Inspection::peaks_t`] at `depth_m` below the cores' surfaces.
    ///
    /// # Errors
    /// As [`CoupledArray::core_fields`].
    pub fn new(array: &CoupledArray, depth_m: f64) -> Result<Self, OnEdge> {
        let outline = &array.response.outline;
        let (winding, shape) = (&array.winding, outline.shape);
        let incident = Incident::new(array);
        let curve = scan_curve(winding, shape, allowed_depth_m(shape, depth_m), SCAN_ORDER);
        let at_curve = Targets::new(
            outline,
            winding,
            places(&curve),
            incident.modes(),
            QUADRATURE,
        )?;
        Ok(Self {
            incident,
            curve,
            at_curve,
        })
    }

    /// The largest |B| in every core of the array that this was made for, T, as
    /// As [`CoupledArray::core_fields`], without mean and error.
    ///
    /// # Errors
    /// As [`CoupledArray::core_fields`].
    pub fn peaks_t(&self, array: &CoupledArray, currents_a: &[f64]) -> Result<Vec<f64>, OnEdge> {
        self.peaks_of(array, &array.cores(&self.incident, currents_a))
    }

    fn peaks_of(&self, array: &CoupledArray, cores: &[Core]) -> Result<Vec<f64>, OnEdge> {
        let outline = &array.response.outline;
        let layers: Vec<&DMatrix<f64>> = cores.iter().map(|c| &c.layers).collect();
        let currents: Vec<f64> = cores.iter().map(|c| c.current_a).collect();
        let fields = self.at_curve.fields(&layers, &currents);
        let peaks = scans(&self.curve, &fields, AXIS * outline.shape.radius_m);
        let there = Targets::new(
            outline,
            &array.winding,
            peaks.iter().map(|peak| peak.place_m).collect(),
            self.incident.modes(),
            PEAK_QUADRATURE,
        )?;
        let fields = there.fields(&layers, &currents);
        Ok(fields
            .iter()
            .zip(&peaks)
            .enumerate()
            .map(|(core, (field, peak))| norm(field.at(core, &turns(peak.angle, field.modes()))))
            .collect())
    }
}

/// 1 - W on an outline, factorised, one system a mode.
#[derive(Debug)]
struct Incident {
    systems: Vec<LU<f64, Dyn, Dyn>>,
}

impl Incident {
    fn new(array: &CoupledArray) -> Self {
        let outline = &array.response.outline;
        let nodes = outline.nodes.len();
        let modes = operators(outline, array.response.layers.len(), QUADRATURE);
        let systems = modes
            .into_iter()
            .map(|w| (DMatrix::identity(nodes, nodes) - w).lu())
            .collect();
        Self { systems }
    }

    fn modes(&self) -> usize {
        self.systems.len()
    }

    /// The layers w with (1 - W) w = phi of potentials on the exchange rings, [core][node, column].
    fn layers(&self, to_nodes: &DMatrix<f64>, potentials: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
        let nodes = to_nodes.nrows();
        let columns = columns_of(self.modes() - 1).end;
        let mut out = vec![DMatrix::zeros(nodes, columns); potentials.len()];
        // A core alone hears nothing.
        if potentials.iter().all(|p| p.iter().all(|v| *v == 0.0)) {
            return out;
        }
        for (mode, system) in self.systems.iter().enumerate() {
            let mine = columns_of(mode);
            let width = mine.len();
            let rings = DMatrix::from_fn(to_nodes.ncols(), width * out.len(), |ring, place| {
                potentials[place / width][(ring, mine.start + place % width)]
            });
            let solved = system
                .solve(&(to_nodes * rings))
                .expect("eigenvalues of W lie in [0, 1), so those of the matrix are positive");
            for (place, column) in solved.column_iter().enumerate() {
                out[place / width].set_column(mine.start + place % width, &column);
            }
        }
        out
    }
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
    lost_counts: f64,
    order: usize,
) -> Result<Vec<CoreField>, OnEdge> {
    let shape = outline.shape;
    let depth_m = allowed_depth_m(shape, depth_m);
    let full: Vec<DMatrix<f64>> = cores.iter().map(|c| c.layers.clone()).collect();
    let reduced: Vec<DMatrix<f64>> = full.iter().map(|l| reduced(outline, l)).collect();
    let layers: Vec<&DMatrix<f64>> = full.iter().chain(&reduced).collect();
    let currents: Vec<f64> = (0..2)
        .flat_map(|_| cores.iter().map(|c| c.current_a))
        .collect();

    let modes = full.first().map_or(1, |l| l.ncols().div_ceil(2));
    let curve = scan_curve(winding, shape, depth_m, SCAN_ORDER);
    let fine = Volume::new(winding, shape, order);
    let coarse = Volume::new(winding, shape, order - 1);
    let mut targets = places(&curve);
    let first_fine = targets.len();
    targets.extend(&fine.points);
    let first_coarse = targets.len();
    targets.extend(&coarse.points);
    let fields =
        Targets::new(outline, winding, targets, modes, QUADRATURE)?.fields(&layers, &currents);

    let peaks = scans(&curve, &fields[..cores.len()], AXIS * shape.radius_m);
    let targets = peaks.iter().map(|peak| peak.place_m).collect();
    let there =
        Targets::new(outline, winding, targets, modes, PEAK_QUADRATURE)?.fields(&layers, &currents);

    Ok(cores
        .iter()
        .enumerate()
        .map(|(index, core)| {
            let Peak {
                scanned_t,
                bound_t,
                place_m: (r_m, z_m),
                angle,
            } = peaks[index];
            let turned = turns(angle, modes);
            let at = |field: &Field| field.at(index, &turned);
            let (b, without) = (at(&there[index]), at(&there[index + cores.len()]));
            let peak_t = norm(b);
            let lost = norm([b[0] - without[0], b[1] - without[1], b[2] - without[2]]);
            let mean_t = fine.mean(&fields[index], first_fine);
            let less = fine.mean(&fields[index + cores.len()], first_fine);
            let coarser = coarse.mean(&fields[index], first_coarse);
            let searched_t = (scanned_t - peak_t).abs() + (bound_t - peak_t).max(0.0);
            let (sin, cos) = angle.sin_cos();
            let [x_m, y_m] = core.position_m;
            CoreField {
                peak_t,
                peak_at_m: [x_m + r_m * cos, y_m + r_m * sin, z_m],
                mean_t,
                peak_error: share(lost_counts * lost + searched_t, peak_t),
                mean_error: share((less - mean_t).abs() + (coarser - mean_t).abs(), mean_t),
            }
        })
        .collect())
}

fn share(error: f64, of: f64) -> f64 {
    if of > 0.0 { error / of } else { 0.0 }
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
            let projection = projection(polynomial, weights);
            let share: f64 = projection.iter().zip(&*values).map(|(a, v)| a * v).sum();
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

/// Places in a core, with what a layer and the own winding give there.
#[derive(Debug)]
struct Targets {
    /// The own winding's (B_r, B_z), T/A.
    own: Vec<(f64, f64)>,
    /// Of every mode.
    operators: Vec<DMatrix<f64>>,
}

impl Targets {
    fn new(
        outline: &Generatrix,
        winding: &Winding,
        places_m: Vec<(f64, f64)>,
        modes: usize,
        quadrature: f64,
    ) -> Result<Self, OnEdge> {
        let own = places_m
            .par_iter()
            .map(|(r_m, z_m)| bore_field(winding, *r_m, *z_m, quadrature))
            .collect::<Result<_, _>>()?;
        let operators = gradient_operators(outline, &places_m, modes, quadrature);
        Ok(Self { own, operators })
    }

    /// The fields of all `layers` with their own windings' currents.
    fn fields(&self, layers: &[&DMatrix<f64>], currents_a: &[f64]) -> Vec<Field> {
        let columns = columns_of(self.operators.len() - 1).end;
        let products: Vec<DMatrix<f64>> = self
            .operators
            .par_iter()
            .enumerate()
            .map(|(mode, operator)| {
                let mine = columns_of(mode);
                let width = mine.len();
                let side_by_side =
                    DMatrix::from_fn(operator.nrows(), width * layers.len(), |node, place| {
                        MU_0_T_M_PER_A * layers[place / width][(node, mine.start + place % width)]
                    });
                // Blocked, unlike a product by a transpose in place.
                operator.transpose() * side_by_side
            })
            .collect();
        currents_a
            .iter()
            .enumerate()
            .map(|(index, current_a)| {
                let mut values = DMatrix::zeros(COMPONENTS * self.own.len(), columns);
                for (mode, product) in products.iter().enumerate() {
                    fluxform_base::progress::poll();
                    let mine = columns_of(mode);
                    let width = mine.len();
                    values
                        .columns_mut(mine.start, width)
                        .copy_from(&product.columns(index * width, width));
                }
                for (target, (b_r, b_z)) in self.own.iter().enumerate() {
                    values[(COMPONENTS * target, 0)] += current_a * b_r;
                    values[(COMPONENTS * target + 1, 0)] += current_a * b_z;
                }
                Field { values }
            })
            .collect()
    }
}

fn places(curve: &Generatrix) -> Vec<(f64, f64)> {
    curve.nodes.iter().map(|n| (n.r_m, n.z_m)).collect()
}

/// A mode's columns in a core's layers.
fn columns_of(mode: usize) -> std::ops::Range<usize> {
    (2 * mode).saturating_sub(1)..2 * mode + 1
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
        let around = turns_around(field.modes());
        let mut sum = 0.0;
        for (place, weight) in self.weights.iter().enumerate() {
            let ring: f64 = around
                .iter()
                .map(|turns| norm(field.at(first + place, turns)))
                .sum();
            sum += weight * ring / around.len() as f64;
        }
        sum
    }
}
