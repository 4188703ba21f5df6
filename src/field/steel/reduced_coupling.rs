//! The exchange of hundreds of identical cores, in the few potentials that they send each other.
//!
//! Fields that arrive at a core from elsewhere are smooth there: with the columns of P, orthonormal potentials
//! on its exchange grid, and of Q, the moments that are felt elsewhere, the potential that one core sends
//! another is K = P A Q' but for a stated part, and the moments q of every core follow from b = Q' q,
//!
//! ```text
//! b - B A b = B p + Q' q_own,     B = Q' T P,
//! ```
//!
//! in the notation of [`super::array`]. The first columns of P and Q carry what comes from far: cores far
//! apart exchange those alone. On a lattice A is block-Toeplitz and is applied by Fourier transforms;
//! between scattered cores pair by pair. A quarter turn or a mirror of an offset exchanges columns of one
//! azimuthal number, so that one eighth of the plane decides all of A.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::coupling::{GridPoint, Sent, between_cores, from_winding, grid_points};
use super::offsets::{Offsets, ROUNDING, extent_m};
use super::response::Response;
use super::symmetry::Motion;
use crate::winding::Winding;
use fluxform_numerics::block_toeplitz::BlockToeplitz;
use fluxform_numerics::bounded_svd::svd;
use fluxform_numerics::gmres::{Outcome, gmres};

/// Most applications of the exchange.
const MOST_STEPS: usize = 120;
/// Columns that cores answer to at a time: a few milliseconds.
const ANSWERED: usize = 256;
/// Drives that are solved together, at most: fixed, so that bytes do not depend on who solves which.
pub(super) const BLOCK: usize = 10;
/// Distances, in the smallest of two axes, from which on fewer columns do.
const DISTANCES: [f64; 4] = [8.0, 4.0, 2.0, 1.0];
/// Cells of a lattice for every core on it, at most, for which transforms pay.
const MOST_CELLS: usize = 4;

/// A potential, or moments, on a core's exchange grid that are one azimuthal wave.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Wave {
    mode: usize,
    sine: bool,
    /// Amplitude on every ring.
    rings: DVector<f64>,
}

impl Wave {
    /// Its column among those of [`Response::modes_of`].
    fn column(&self) -> usize {
        (2 * self.mode).saturating_sub(usize::from(!self.sine))
    }

    fn on_grid(&self, angles: usize) -> DVector<f64> {
        let rings = self.rings.len();
        DVector::from_fn(rings * angles, |i, _| {
            let turn = TAU * ((self.mode * (i / rings)) % angles) as f64 / angles as f64;
            self.rings[i % rings] * if self.sine { turn.sin() } else { turn.cos() }
        })
    }
}

/// Orthonormal waves by falling distance of what needs them.
struct Basis {
    waves: Vec<Wave>,
    /// [grid, wave].
    on_grid: DMatrix<f64>,
    /// How many do from each of [`DISTANCES`] on.
    counts: [usize; DISTANCES.len()],
}

/// Parts of one azimuthal number of columns on a grid, cosine and sine side by side, in fewer columns
/// with the same products.
fn parts_of_mode(columns: &DMatrix<f64>, rings: usize, mode: usize) -> DMatrix<f64> {
    let angles = columns.nrows() / rings;
    let sines: &[bool] = if mode == 0 { &[false] } else { &[false, true] };
    let mut parts = DMatrix::zeros(rings, sines.len() * columns.ncols());
    for (place, sine) in sines.iter().enumerate() {
        let mut part = parts.columns_mut(place * columns.ncols(), columns.ncols());
        for k in 0..angles {
            let turn = TAU * ((mode * k) % angles) as f64 / angles as f64;
            let share = norm(mode, angles) * if *sine { turn.sin() } else { turn.cos() };
            part.zip_apply(&columns.rows(k * rings, rings), |sum, v| *sum += share * v);
        }
    }
    fluxform_base::progress::poll();
    parts.transpose().qr().r().transpose()
}

/// The factor that makes a wave with amplitudes of norm one a vector of norm one on the grid.
fn norm(mode: usize, angles: usize) -> f64 {
    (if mode == 0 { 1.0 } else { 2.0 } / angles as f64).sqrt()
}

/// The largest singular value; where it is not known, the length of the longest column, which is no more.
fn largest_of(columns: DMatrix<f64>) -> f64 {
    let longest = (columns.column_iter()).fold(0.0_f64, |most, column| most.max(column.norm()));
    svd(columns, [false, false]).map_or(longest, |svd| svd.singular_values.max())
}

/// Orthonormal directions that carry `columns` but for parts below `least`; where singular values are not
/// known, directions that carry all of them.
fn carrying(columns: DMatrix<f64>, least: f64) -> DMatrix<f64> {
    let whole = || columns.clone().qr().q();
    let Some(svd) = svd(columns.clone(), [true, false]) else {
        return whole();
    };
    // Sorted by falling singular value.
    let large = svd.singular_values.iter().filter(|s| **s > least);
    (svd.u.as_ref()).map_or_else(whole, |u| u.columns(0, large.count()).into_owned())
}

impl Basis {
    /// Waves that carry all columns of `examples`, one matrix for each of [`DISTANCES`], but for parts
    /// below `cut` of the largest; `constant` is put first.
    fn new(response: &Response, examples: &[DMatrix<f64>], cut: f64, constant: bool) -> Self {
        let (rings, angles) = (response.exchange.rings.len(), response.angles);
        let modes = response.layers.len();
        let parts: Vec<DMatrix<f64>> = (0..examples.len() * modes)
            .into_par_iter()
            .map(|i| parts_of_mode(&examples[i / modes], rings, i % modes))
            .collect();
        let mut found: Vec<DMatrix<f64>> = (0..modes)
            .map(|mode| {
                let count = usize::from(constant && mode == 0);
                DMatrix::from_element(rings, count, (1.0 / rings as f64).sqrt())
            })
            .collect();
        let mut waves = Vec::new();
        let mut push = |mode: usize, columns: &DMatrix<f64>| {
            let sines: &[bool] = if mode == 0 { &[false] } else { &[false, true] };
            for column in columns.column_iter() {
                waves.extend(sines.iter().map(|sine| Wave {
                    mode,
                    sine: *sine,
                    rings: column * norm(mode, angles),
                }));
            }
            waves.len()
        };
        let mut count = push(0, &found[0]);
        let without = |part: &DMatrix<f64>, known: &DMatrix<f64>| {
            let once = part - known * (known.transpose() * part);
            &once - known * (known.transpose() * &once)
        };
        // The nearest come last.
        let largest = parts[parts.len() - modes..]
            .iter()
            .zip(&found)
            .map(|(part, known)| largest_of(without(part, known)))
            .fold(0.0, f64::max);
        let mut counts = [0; DISTANCES.len()];
        for (distance, parts) in parts.chunks(modes).enumerate() {
            for (mode, part) in parts.iter().enumerate() {
                let more = carrying(without(part, &found[mode]), cut * largest);
                count = push(mode, &more);
                let first = found[mode].ncols();
                let known = std::mem::replace(&mut found[mode], DMatrix::zeros(0, 0));
                found[mode] = known.resize_horizontally(first + more.ncols(), 0.0);
                found[mode]
                    .columns_mut(first, more.ncols())
                    .copy_from(&more);
            }
            counts[distance] = count;
        }
        let columns: Vec<DVector<f64>> = waves.iter().map(|wave| wave.on_grid(angles)).collect();
        Self {
            on_grid: if columns.is_empty() {
                DMatrix::zeros(rings * angles, 0)
            } else {
                DMatrix::from_columns(&columns)
            },
            waves,
            counts,
        }
    }

    /// How many waves carry what comes from `distance` smallest distances away.
    fn count_at(&self, distance: f64) -> usize {
        let near = DISTANCES
            .iter()
            .position(|from| distance >= from * (1.0 - 1e-9));
        self.counts[near.unwrap_or(DISTANCES.len() - 1)]
    }
}

/// Coefficients of waves after a motion of what they describe; rows beyond the matrix are zero.
fn turned(waves: &[Wave], motion: &Motion, coefficients: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = coefficients.clone();
    // Cosine and sine lie side by side.
    for row in (0..coefficients.nrows()).filter(|row| waves[*row].sine) {
        let [[cc, cs], [sc, ss]] = [false, true].map(|sine| motion.wave(waves[row].mode, sine));
        for column in 0..coefficients.ncols() {
            let (c, s) = (coefficients[(row - 1, column)], coefficients[(row, column)]);
            out[(row - 1, column)] = c * cc + s * sc;
            out[(row, column)] = c * cs + s * ss;
        }
    }
    out
}

/// The exchange between two cores at one offset of the first eighth of the plane.
struct Passed {
    /// Coefficients received for coefficients sent.
    block: DMatrix<f64>,
    /// Those received of the sender's winding, per ampere.
    winding: DMatrix<f64>,
    /// Flux through the sender's winding for coefficients at the receiver, Wb/A, and of the receiver's
    /// core under its own winding.
    flux: DMatrix<f64>,
    own_flux_wb: f64,
}

/// The cores' places: cells and steps of a lattice, m, where they are on one, and the offsets that occur.
struct Layout {
    lattice: Option<(Vec<[usize; 2]>, [f64; 2])>,
    offsets: Offsets,
}

/// The cells of places on a lattice that they fill to a good part, and its steps, m.
fn lattice(positions_m: &[[f64; 2]]) -> Option<(Vec<[usize; 2]>, [f64; 2])> {
    let extent = extent_m(positions_m);
    let axis = |axis: usize| {
        let mut values: Vec<f64> = positions_m.iter().map(|p| p[axis]).collect();
        values.sort_by(f64::total_cmp);
        let (first, last) = (values[0], values[values.len() - 1]);
        let gaps = values.windows(2).map(|pair| pair[1] - pair[0]);
        let least = gaps
            .filter(|gap| *gap > ROUNDING * extent)
            .fold(f64::INFINITY, f64::min);
        if least.is_infinite() {
            return Some((first, extent, 1));
        }
        let steps = ((last - first) / least).round();
        let step = (last - first) / steps;
        let on = |v: &f64| {
            let cells = (v - first) / step;
            (cells - cells.round()).abs() * step <= ROUNDING * extent
        };
        (steps < 1e6 && values.iter().all(on)).then_some((first, step, steps as usize + 1))
    };
    let (x, y) = (axis(0)?, axis(1)?);
    if x.2 * y.2 > MOST_CELLS * positions_m.len() {
        return None;
    }
    let cells = positions_m.iter().map(|p| {
        [(p[0], x), (p[1], y)].map(|(v, (first, step, _))| ((v - first) / step).round() as usize)
    });
    Some((cells.collect(), [x.1, y.1]))
}

/// Whether cores at these places exchange potentials by Fourier transforms.
pub(super) fn is_lattice(positions_m: &[[f64; 2]]) -> bool {
    lattice(positions_m).is_some()
}

impl Layout {
    fn new(positions_m: &[[f64; 2]]) -> Self {
        let lattice = lattice(positions_m);
        let offsets = match &lattice {
            Some((cells, step_m)) => Offsets::on_lattice(cells, *step_m),
            None => Offsets::of_pairs(positions_m),
        };
        Self { lattice, offsets }
    }
}

/// How the exchange is applied to all cores.
enum Exchange {
    Lattice {
        potentials: Box<BlockToeplitz>,
        flux: Box<BlockToeplitz>,
    },
    Pairs,
}

/// The exchange of an array's cores, ready to be solved for any drives.
pub(super) struct ReducedCoupling<'a> {
    positions_m: &'a [[f64; 2]],
    closest_m: f64,
    received: Basis,
    felt: Basis,
    layout: Layout,
    passed: Vec<Passed>,
    exchange: Exchange,
    /// B of the module's head, [felt, received].
    answer: DMatrix<f64>,
    /// Coefficients felt of a core under its own winding.
    own: DVector<f64>,
    /// Flux through the core's own coil for each coefficient received, Wb/A, and of its own layer.
    flux: DVector<f64>,
    own_flux_wb: f64,
}

/// Potentials that every core receives, per ampere of every drive.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Received {
    waves: Vec<Wave>,
    /// [wave, core] for the first drive of every set of equivalent ones.
    of_first: Vec<DMatrix<f64>>,
    /// Of every drive its first and the motion from there.
    from: Vec<(usize, usize)>,
    /// The array's motions, and of every core where it comes from.
    motions: Vec<(Motion, Vec<usize>)>,
}

impl Received {
    /// Azimuthal modes at one core as [`Response::modes_of`] has them, for currents of all drives, A.
    pub(super) fn modes(
        &self,
        currents_a: impl Iterator<Item = (usize, f64)>,
        core: usize,
        response: &Response,
    ) -> DMatrix<f64> {
        let mut sum = DMatrix::zeros(self.waves.len(), 1);
        for (drive, current_a) in currents_a {
            let (first, motion) = self.from[drive];
            let (motion, origins) = &self.motions[motion];
            let column = self.of_first[first].columns(origins[core], 1).into_owned();
            sum += turned(&self.waves, motion, &column) * current_a;
        }
        let rings = response.exchange.rings.len();
        let mut modes = DMatrix::zeros(rings, 2 * response.layers.len() - 1);
        for (wave, coefficient) in self.waves.iter().zip(sum.iter()) {
            modes
                .column_mut(wave.column())
                .axpy(*coefficient, &wave.rings, 1.0);
        }
        modes
    }
}

impl Received {
    /// Layers of every wave on the nodes, [node, column of [`Response::modes_of`]] side by side.
    pub(super) fn on_nodes(&self, response: &Response) -> DMatrix<f64> {
        let columns = 2 * response.layers.len() - 1;
        let mut out = DMatrix::zeros(response.outline.nodes.len(), columns * self.waves.len());
        for (number, wave) in self.waves.iter().enumerate() {
            let layer = &response.layers[wave.mode] * &wave.rings;
            out.set_column(number * columns + wave.column(), &layer);
        }
        out
    }

    /// Potentials that every core receives for one drive, [wave, core].
    pub(super) fn of_drive(&self, drive: usize) -> DMatrix<f64> {
        let (first, motion) = self.from[drive];
        let (motion, origins) = &self.motions[motion];
        turned(
            &self.waves,
            motion,
            &self.of_first[first].select_columns(origins),
        )
    }
}

/// The solutions for some drives.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SolvedBlock {
    pub(super) drives: Vec<usize>,
    waves: Vec<Wave>,
    /// Potentials that every core receives, [wave, core], for each.
    received: Vec<DMatrix<f64>>,
    /// Steel's flux through every coil, [coil, drive], Wb/A.
    flux_wb: DMatrix<f64>,
    relative_residual: f64,
    iterations: usize,
}

/// Solved blocks put together.
pub(super) struct Joined {
    pub(super) received: Received,
    /// Steel's part of self and mutual inductances, [coil, drive], H; zero for drives of no block.
    pub(super) inductance_h: DMatrix<f64>,
    pub(super) relative_residual: f64,
    pub(super) iterations: usize,
}

impl Joined {
    /// The blocks' drives and their images under the array's motions, `symmetries`.
    pub(super) fn new(blocks: &[SolvedBlock], cores: usize, symmetries: &[Motion]) -> Self {
        let motions = symmetries.iter().map(|motion| {
            let mut origins = vec![0; cores];
            for (from, to) in motion.coil.iter().enumerate() {
                origins[*to] = from;
            }
            (motion.clone(), origins)
        });
        let mut joined = Self {
            received: Received {
                waves: blocks
                    .first()
                    .map_or(Vec::new(), |block| block.waves.clone()),
                of_first: Vec::new(),
                from: vec![(0, 0); cores],
                motions: motions.collect(),
            },
            inductance_h: DMatrix::zeros(cores, cores),
            relative_residual: 0.0,
            iterations: 0,
        };
        for block in blocks {
            joined.relative_residual = joined.relative_residual.max(block.relative_residual);
            joined.iterations = joined.iterations.max(block.iterations);
            for (column, drive) in block.drives.iter().enumerate() {
                let place = joined.received.of_first.len();
                joined
                    .received
                    .of_first
                    .push(block.received[column].clone());
                for (number, motion) in symmetries.iter().enumerate().rev() {
                    let to = motion.coil[*drive];
                    joined.received.from[to] = (place, number);
                    for coil in 0..cores {
                        joined.inductance_h[(motion.coil[coil], to)] =
                            block.flux_wb[(coil, column)];
                    }
                }
            }
        }
        joined
    }
}

/// One core: its response, winding and layer under it.
pub(super) struct OneCore<'a> {
    pub(super) response: &'a Response,
    pub(super) winding: &'a Winding,
    /// Moments on the exchange grid under its own winding, A m^2 a radian per ampere.
    pub(super) own_moments: DVector<f64>,
    /// Flux of its own layer through the coil, Wb/A.
    pub(super) own_flux_wb: f64,
    /// Flux through the coil for a potential of mode 0 on each ring, Wb/A.
    pub(super) flux_by_ring: DVector<f64>,
}

/// Flux through a core's own coil for each coefficient of `waves`, `by_ring` being that for a potential of
/// mode 0 on each ring, Wb/A.
fn own_flux(waves: &[Wave], by_ring: &DVector<f64>) -> DVector<f64> {
    let of_wave = |wave: &Wave| match wave.mode {
        0 => wave.rings.dot(by_ring),
        _ => 0.0,
    };
    DVector::from_iterator(waves.len(), waves.iter().map(of_wave))
}

impl<'a> ReducedCoupling<'a> {
    /// Cores at `positions_m`, the closest two `closest_m` apart; parts of what is exchanged below `cut`
    /// of the largest are left out.
    pub(super) fn new(
        core: &OneCore,
        positions_m: &'a [[f64; 2]],
        closest_m: f64,
        cut: f64,
    ) -> Self {
        let response = core.response;
        let points = grid_points(response);
        let size = core.own_moments.norm().max(f64::MIN_POSITIVE);
        let (received, felt): (Vec<_>, Vec<_>) = DISTANCES
            .par_iter()
            .map(|distance| {
                let offset_m = [distance * closest_m, 0.0];
                let sent = between_cores(&points, response, offset_m);
                let winding = from_winding(core.winding, &points, offset_m, cut).potential;
                let winding = DVector::from_vec(winding) / size;
                let felt = sent.transpose();
                let columns = sent.ncols();
                let mut received = sent.resize_horizontally(columns + 1, 0.0);
                received.set_column(columns, &winding);
                (received, felt)
            })
            .unzip();
        let received = Basis::new(response, &received, cut, true);
        let felt = Basis::new(response, &felt, cut, false);
        let layout = Layout::new(positions_m);
        let responses = response.moments_of(&received.waves);
        let mut coupling = Self {
            positions_m,
            closest_m,
            answer: felt.on_grid.tr_mul(&responses),
            own: felt.on_grid.tr_mul(&core.own_moments),
            flux: own_flux(&received.waves, &core.flux_by_ring),
            own_flux_wb: core.own_flux_wb,
            received,
            felt,
            layout,
            passed: Vec::new(),
            exchange: Exchange::Pairs,
        };
        coupling.passed = (coupling.layout.offsets.first_m.par_iter())
            .map(|offset_m| coupling.passed_at(core, &points, &responses, *offset_m, cut))
            .collect();
        coupling.exchange = coupling.exchange();
        coupling
    }

    fn passed_at(
        &self,
        core: &OneCore,
        points: &[GridPoint],
        responses: &DMatrix<f64>,
        offset_m: [f64; 2],
        cut: f64,
    ) -> Passed {
        let distance = offset_m[0].hypot(offset_m[1]) / self.closest_m;
        let received = self
            .received
            .on_grid
            .columns(0, self.received.count_at(distance));
        let felt = self.felt.on_grid.columns(0, self.felt.count_at(distance));
        let sent = between_cores(points, core.response, offset_m) * felt;
        let Sent {
            potential,
            normal_field_t,
        } = from_winding(core.winding, points, offset_m, cut);
        let normal = DVector::from_vec(normal_field_t) * (-TAU / core.response.angles as f64);
        let potential = DMatrix::from_vec(potential.len(), 1, potential);
        Passed {
            block: received.tr_mul(&sent),
            winding: self.received.on_grid.tr_mul(&potential),
            flux: responses
                .tr_mul(&normal)
                .reshape_generic(nalgebra::Dyn(responses.ncols()), nalgebra::Dyn(1)),
            own_flux_wb: normal.dot(&core.own_moments),
        }
    }

    fn motion(&self, number: usize) -> &Motion {
        &self.layout.offsets.motions[number]
    }

    /// The block for a receiver at `offset_m` from the sender, into `block`.
    fn put_block(&self, offset_m: [f64; 2], block: &mut DMatrix<f64>) {
        if let Some((number, motion)) = self.layout.offsets.of(offset_m) {
            let (first, motion) = (&self.passed[number].block, self.motion(motion));
            let rows = turned(&self.received.waves, motion, first);
            let both = turned(&self.felt.waves, motion, &rows.transpose()).transpose();
            block.view_mut((0, 0), both.shape()).copy_from(&both);
        }
    }

    /// Flux through a coil at the origin for coefficients at a core at `offset_m`, [1, received].
    fn put_flux(&self, offset_m: [f64; 2], block: &mut DMatrix<f64>) {
        if let Some((number, motion)) = self.layout.offsets.of(offset_m) {
            let (flux, motion) = (&self.passed[number].flux, self.motion(motion));
            let flux = turned(&self.received.waves, motion, flux);
            block.copy_from(&flux.transpose());
        }
    }

    fn exchange(&self) -> Exchange {
        let Some((cells, pitch_m)) = &self.layout.lattice else {
            return Exchange::Pairs;
        };
        let offset = |step: [isize; 2]| [0, 1].map(|axis| step[axis] as f64 * pitch_m[axis]);
        let (received, felt) = (self.received.waves.len(), self.felt.waves.len());
        Exchange::Lattice {
            potentials: Box::new(BlockToeplitz::new(
                cells,
                (received, felt),
                |step, block| {
                    self.put_block(offset(step), block);
                },
            )),
            flux: Box::new(BlockToeplitz::new(cells, (1, received), |step, block| {
                // From the coil to the core.
                self.put_flux(offset(step).map(|x| -x), block);
            })),
        }
    }

    /// Sums over all other cores pair by pair, of blocks of `rows` that `put` fills.
    fn pairs(
        &self,
        values: &DMatrix<f64>,
        rows: usize,
        put: impl Fn([f64; 2], &mut DMatrix<f64>) + Sync,
    ) -> DMatrix<f64> {
        let cores = self.positions_m.len();
        let columns = values.nrows() / cores.max(1);
        let sums: Vec<DMatrix<f64>> = (self.positions_m.par_iter())
            .map(|at| {
                let mut sum = DMatrix::zeros(rows, values.ncols());
                for (sender, from) in self.positions_m.iter().enumerate() {
                    fluxform_base::progress::poll();
                    let mut block = DMatrix::zeros(rows, columns);
                    put([at[0] - from[0], at[1] - from[1]], &mut block);
                    sum.gemm(1.0, &block, &values.rows(sender * columns, columns), 1.0);
                }
                sum
            })
            .collect();
        let mut out = DMatrix::zeros(rows * cores, values.ncols());
        for (core, sum) in sums.iter().enumerate() {
            out.rows_mut(core * rows, rows).copy_from(sum);
        }
        out
    }

    /// Coefficients received for coefficients felt, all cores one after the other in every column.
    fn send(&self, felt: &DMatrix<f64>) -> DMatrix<f64> {
        match &self.exchange {
            Exchange::Lattice { potentials, .. } => potentials.apply(felt),
            Exchange::Pairs => self.pairs(felt, self.received.waves.len(), |offset_m, block| {
                self.put_block(offset_m, block);
            }),
        }
    }

    /// Flux through every coil of all other cores for the coefficients that these receive.
    fn flux_wb(&self, received: &DMatrix<f64>) -> DMatrix<f64> {
        match &self.exchange {
            Exchange::Lattice { flux, .. } => flux.apply(received),
            Exchange::Pairs => self.pairs(received, 1, |[x, y], block| {
                self.put_flux([-x, -y], block);
            }),
        }
    }

    /// Cores' answers, coefficients felt for coefficients received.
    fn answers(&self, received: DMatrix<f64>) -> DMatrix<f64> {
        let (cores, columns) = (self.positions_m.len(), received.ncols());
        let (rows, size) = (self.received.waves.len(), self.felt.waves.len());
        let received =
            received.reshape_generic(nalgebra::Dyn(rows), nalgebra::Dyn(cores * columns));
        let mut felt = DMatrix::zeros(size, cores * columns);
        for first in (0..cores * columns).step_by(ANSWERED) {
            fluxform_base::progress::poll();
            let count = ANSWERED.min(cores * columns - first);
            let received = received.columns(first, count);
            (felt.columns_mut(first, count)).gemm(1.0, &self.answer, &received, 0.0);
        }
        felt.reshape_generic(nalgebra::Dyn(size * cores), nalgebra::Dyn(columns))
    }

    /// Solves for one ampere in each of some coils in turn, to a relative `residual`.
    pub(super) fn solve(&self, drives: &[usize], residual: f64) -> SolvedBlock {
        let cores = self.positions_m.len();
        let size = self.received.waves.len();
        let (solved, outcome) = self.solve_some(drives, residual);
        let mut flux_wb = self.flux_wb(&solved);
        let mut received = Vec::with_capacity(drives.len());
        for (column, drive) in drives.iter().enumerate() {
            let of_drive = solved.column(column).into_owned();
            let of_drive = of_drive.reshape_generic(nalgebra::Dyn(size), nalgebra::Dyn(cores));
            for coil in 0..cores {
                let [from, to] = [coil, *drive].map(|at| self.positions_m[at]);
                let offset_m = [to[0] - from[0], to[1] - from[1]];
                let driven = self.layout.offsets.of(offset_m);
                flux_wb[(coil, column)] += self.flux.dot(&of_drive.column(coil))
                    + driven.map_or(0.0, |(number, _)| self.passed[number].own_flux_wb);
            }
            flux_wb[(*drive, column)] += self.own_flux_wb;
            received.push(of_drive);
        }
        SolvedBlock {
            drives: drives.to_vec(),
            waves: self.received.waves.clone(),
            received,
            flux_wb,
            relative_residual: outcome.relative_residual,
            iterations: outcome.iterations,
        }
    }

    /// Coefficients that every core receives, windings' and cores', for some drives.
    fn solve_some(&self, drives: &[usize], residual: f64) -> (DMatrix<f64>, Outcome) {
        let cores = self.positions_m.len();
        let (rows, size) = (self.received.waves.len(), self.felt.waves.len());
        let mut windings = DMatrix::zeros(rows * cores, drives.len());
        for (column, drive) in drives.iter().enumerate() {
            let from = self.positions_m[*drive];
            for (core, at) in self.positions_m.iter().enumerate() {
                let offset_m = [at[0] - from[0], at[1] - from[1]];
                if let Some((number, motion)) = self.layout.offsets.of(offset_m) {
                    let (winding, motion) = (&self.passed[number].winding, self.motion(motion));
                    let winding = turned(&self.received.waves, motion, winding);
                    windings
                        .view_mut((core * rows, column), (rows, 1))
                        .copy_from(&winding);
                }
            }
        }
        let mut rhs = self.answers(windings.clone());
        for (column, drive) in drives.iter().enumerate() {
            let mut own = rhs.view_mut((drive * size, column), (size, 1));
            own += &self.own;
        }
        let outcome = gmres(&rhs, residual, MOST_STEPS, |felt| {
            felt - self.answers(self.send(felt))
        });
        (windings + self.send(&outcome.solutions), outcome)
    }
}

impl Response {
    /// Moments on the exchange grid for potentials that are waves, [grid, wave].
    fn moments_of(&self, waves: &[Wave]) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.size(), waves.len());
        for (mut column, wave) in out.column_iter_mut().zip(waves) {
            let answer = Wave {
                rings: self.ring_moments(wave.mode) * &wave.rings,
                ..wave.clone()
            };
            column.copy_from(&answer.on_grid(self.angles));
        }
        out
    }
}
