//! An array of identical cored coils: all cores respond to each driven coil.
//!
//! With q the moments of every core on its exchange grid, T one core's response, K the
//! potential that moments send to the other cores and p that of the driven winding,
//!
//! ```text
//! q - T K q = T p + q_own,
//! ```
//!
//! q_own being the driven coil's own core under its own winding, solved on the fine outline.
//! Plain iteration stalls (the array's cores return each other's flux); GMRES needs a dozen steps.
//! A few cores exchange potentials on their whole grids; many only what passes between them (see
//! `reduced_coupling`).

use serde::{Deserialize, Serialize};

use nalgebra::{DMatrix, DVector};

use super::CoreShape;
use super::core_layers::CoreLayers;
use super::cored_coil::Excitation;
use super::coupling::{Coupling, different_offsets};
use super::equivalent_dipoles::{ArraySources, Near, spread_over};
use super::exchange::{Grading, LEAST_GAP, PART, side_panels};
use super::generatrix::{Generatrix, Resolution};
use super::reduced_coupling::{OneCore, Received, ReducedCoupling};
use super::response::{Response, Rings};
use super::symmetry::{Motion, motions};
use crate::components::Components;
use crate::winding::{OnEdge, Winding};
use fluxform_base::units::MU_0_T_M_PER_A;

/// Most azimuthal modes; beyond, the stated error grows.
const MOST_MODES: usize = 17;
/// Most unknowns a core, and most entries of all the dense matrices (2.4 GB): cores closer than
/// about half their radius ask for more, and the stated error grows.
const MOST_UNKNOWNS: usize = 3500;
const MOST_ENTRIES: usize = 300_000_000;
/// Cores up to which whole grids are exchanged: of more, only what passes between them.
const MOST_WHOLE: usize = 16;
/// Share of the tolerance that each part may have which is left out of what passes: a few hundredths
/// of it is what they come to.
const PASSED_SHARE: f64 = 0.2;
/// Share of the tolerance given to the linear solver.
const SOLVER_SHARE: f64 = 0.01;

/// How finely a coupled array is solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArrayResolution {
    /// The outline of each core.
    pub outline: Resolution,
    /// Azimuthal modes.
    pub modes: usize,
    /// Length of the exchange panels beside the ends of cores and windings, m.
    pub panel_m: f64,
    /// Exchange rings a panel.
    pub order: usize,
    /// Relative residual of the linear solver.
    pub residual: f64,
}

impl ArrayResolution {
    /// The resolution for a relative error `tolerance`, `closest_m` being the smallest distance
    /// of two axes.
    ///
    /// A mode m that a core sends to another, and gets back, decays like ((d - R)/R)^(-2 m); the
    /// kernels between two cores are analytic within their gap.
    #[must_use]
    pub fn for_tolerance(tolerance: f64, shape: CoreShape, closest_m: f64) -> Self {
        let tolerance = tolerance.clamp(1e-9, 0.1);
        // The outline is the cheap part, and the edges' error decays slowest.
        let outline = Resolution::for_tolerance(0.3 * tolerance);
        let residual = SOLVER_SHARE * tolerance;
        if closest_m.is_infinite() {
            return Self {
                outline,
                modes: 1,
                panel_m: shape.length_m().max(shape.radius_m),
                order: 2,
                residual,
            };
        }
        let radius_m = shape.radius_m;
        let decay = 2.0 * ((closest_m - radius_m) / radius_m).ln();
        let modes = 2 + ((1.0 / tolerance).ln() / decay.max(1e-3)).ceil() as usize;
        let gap_m = (closest_m - 2.0 * radius_m).max(LEAST_GAP * radius_m);
        Self {
            outline,
            modes: modes.clamp(2, MOST_MODES),
            panel_m: PART * gap_m,
            order: (2.0 - 1.3 * tolerance.log10()).ceil() as usize,
            residual,
        }
    }

    /// The exchange panels of a core about which a winding reaches `winding_length_m` down.
    pub(super) fn grading(&self, shape: CoreShape, winding_length_m: f64) -> Grading {
        Grading::new(self.panel_m, shape, winding_length_m)
    }

    /// Unknowns a core.
    pub(super) fn unknowns(&self, shape: CoreShape, winding_length_m: f64) -> usize {
        let grading = self.grading(shape, winding_length_m);
        let side = side_panels(shape, |z_m| grading.length_m(z_m)).len();
        let end = (shape.radius_m / self.panel_m).ceil().max(1.0) as usize;
        let rings = self.order * (side + 2 * end);
        rings * self.angles()
    }

    /// Longer exchange panels, if these would take more memory than the caps for an array with
    /// `offsets` different offsets between cores.
    pub(super) fn within_memory(
        mut self,
        shape: CoreShape,
        winding_length_m: f64,
        offsets: usize,
    ) -> Self {
        let entries = (MOST_ENTRIES / (offsets + 1)) as f64;
        let most = MOST_UNKNOWNS.min(entries.sqrt() as usize);
        while self.unknowns(shape, winding_length_m) > most
            && self.panel_m < shape.length_m() + shape.radius_m
        {
            self.panel_m *= 1.1;
        }
        self
    }

    /// Error of what the closest cores exchange, relative: aliasing in the azimuth, quadrature
    /// along the panels.
    pub(super) fn exchange_error(&self, shape: CoreShape, closest_m: f64) -> f64 {
        let radius_m = shape.radius_m;
        let azimuth = (radius_m / (closest_m - radius_m)).powf(2.0 * self.modes as f64);
        let ratio = 2.0 * (closest_m - 2.0 * radius_m) / self.panel_m;
        let along = (ratio + 1.0_f64.hypot(ratio)).powf(-2.0 * self.order as f64);
        azimuth.max(along)
    }

    /// Angles of the exchange grid: a multiple of four, for the array's symmetries; enough for
    /// the modes' products.
    #[must_use]
    pub fn angles(&self) -> usize {
        (2 * self.modes).next_multiple_of(4)
    }

    /// The next coarser resolution.
    #[must_use]
    pub fn coarser(&self) -> Self {
        Self {
            outline: self.outline.coarser(),
            modes: (self.modes - 1).max(1),
            order: (self.order - 1).max(2),
            ..*self
        }
    }
}

/// The solved array, per ampere in each coil.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct CoupledArray {
    /// Axes, m.
    pub positions_m: Vec<[f64; 2]>,
    /// The winding of every coil.
    pub winding: Winding,
    /// One core's response.
    pub response: Response,
    /// Layer of mode 0 of a driven coil's own core under its own winding, A/A, on the nodes.
    pub own_layer: DVector<f64>,
    /// Potential sent to every core by all others, A/A.
    potentials: Potentials,
    /// Steel's part of self and mutual inductances, [coil, drive], H.
    pub added_inductance_h: DMatrix<f64>,
    /// Estimated error: of the gradients above, relative to the largest |grad B| at the height,
    /// and of the inductances, relative to the largest; the larger. The difference from the next
    /// coarser resolution, or twice what is known of the exchange between the cores.
    pub relative_error: f64,
    /// Relative residual of the linear solver.
    pub relative_residual: f64,
    /// Applications of the coupling.
    pub iterations: usize,
}

/// The potentials that every core receives for one ampere in each coil.
#[derive(Debug, Clone, Serialize, Deserialize)]
enum Potentials {
    /// [drive][core][exchange grid].
    Whole(Vec<Vec<Vec<f64>>>),
    Reduced(Received),
}

/// Refinements after which a tolerance that is not reached is given up, with its estimate.
const MOST_REFINEMENTS: usize = 4;
/// The first resolution's aim, in tolerances: resolutions do better than they aim at as a rule.
const FIRST_AIM: f64 = 2.0;
/// Distance above the cores, in radii, below which no error is estimated.
const CLOSEST: f64 = 0.1;
/// Heights above the cores, in radii, below which the outline is resolved for places close to it.
const NEAR: f64 = 0.5;
/// Modes that each refinement adds where places close to the cores are requested.
const MODES_NEAR: usize = 2;
/// Drives of many coils of which two resolutions are compared, at most, and the distance of the coils
/// about which, in the smallest of two.
const MOST_COMPARED: usize = 8;
const BESIDE: f64 = 1.6;
/// Places about every coil at which two resolutions are compared, in units of its outer radius.
const PLACES: [[f64; 2]; 5] = [[0.0, 0.0], [0.6, 0.2], [0.7, 0.2], [-0.4, 1.1], [1.5, -1.2]];

impl CoupledArray {
    /// Solves to an estimated error below `tolerance` at heights from `lowest_m` up, or as far as
    /// the caps on resolution allow: [`CoupledArray::relative_error`] says what was reached.
    ///
    /// Domain: as for [`CoupledArray::at_resolution`].
    ///
    /// # Errors
    /// A node of the outline on the winding's edge.
    pub fn new(
        winding: &Winding,
        shape: CoreShape,
        relative_permeability: f64,
        positions_m: &[[f64; 2]],
        tolerance: f64,
        lowest_m: f64,
    ) -> Result<Self, OnEdge> {
        let closest_m = closest_m(positions_m);
        let offsets = grids_at_once(positions_m);
        let top_m = shape.top_m.max(0.0);
        let lowest_m = lowest_m.max(top_m + CLOSEST * shape.radius_m);
        let near = lowest_m < top_m + NEAR * shape.radius_m;
        let solve = |resolution: &ArrayResolution| {
            Self::at_resolution(
                winding,
                shape,
                relative_permeability,
                positions_m,
                resolution,
            )
        };
        let mut aim = FIRST_AIM * tolerance;
        let mut best: Option<Self> = None;
        for refinement in 0..=MOST_REFINEMENTS {
            let mut resolution = ArrayResolution::for_tolerance(aim, shape, closest_m);
            if near && resolution.modes > 1 {
                // Close to a core its own modes are seen, before they have come back from another.
                resolution.modes = (resolution.modes + MODES_NEAR * refinement).min(MOST_MODES);
            }
            let mut resolution = resolution.within_memory(shape, winding.length_m, offsets);
            let mut coarse = resolution.coarser();
            if near {
                resolution.outline = Resolution::near_steel(0.3 * aim);
                coarse.outline = resolution.outline.coarser_near_steel();
            }
            let coarse = solve(&coarse)?;
            let mut fine = solve(&resolution)?;
            // Where the caps bind, two wrong solutions may agree by chance.
            let exchange = 2.0 * resolution.exchange_error(shape, closest_m);
            fine.relative_error = exchange.max(fine.difference(&coarse, lowest_m, tolerance)?);
            let better = best
                .as_ref()
                .is_none_or(|b| fine.relative_error < b.relative_error);
            let reached = fine.relative_error <= tolerance;
            if better {
                best = Some(fine);
            }
            if reached || !better || exchange > tolerance {
                break;
            }
            aim *= 0.3;
        }
        Ok(best.expect("at least one resolution was solved"))
    }

    fn difference(&self, other: &Self, lowest_m: f64, tolerance: f64) -> Result<f64, OnEdge> {
        let shape = self.response.outline.shape;
        let (drives, about) = self.compared();
        let distance_m = lowest_m - shape.top_m;
        let near = (lowest_m, distance_m, 0.05 * tolerance);
        let sources = |array: &Self| {
            if drives.len() == array.positions_m.len() {
                ArraySources::of_coils(array, near, false)
            } else {
                ArraySources::of_drives(array, &drives, near, false)
            }
        };
        let (fine, coarse) = (sources(self), sources(other));
        let parts = Components::Gradient;
        let mut worst = 0.0_f64;
        for height in [0.0, 1.0, 4.0] {
            let z_m = lowest_m + height * shape.radius_m;
            let reach = self.winding.outer_radius_m;
            let points: Vec<[f64; 3]> = (about.iter())
                .flat_map(|[x, y]| PLACES.map(|[dx, dy]| [x + reach * dx, y + reach * dy, z_m]))
                .collect();
            let mut values = vec![0.0; drives.len() * parts.count() * points.len()];
            let mut others = values.clone();
            fine.sample(&points, parts, &mut values);
            coarse.sample(&points, parts, &mut others);
            // The winding's own gradient adds to the largest, which lies above it.
            let air = self.winding.field(0.0, z_m)?.gradient_norm();
            let size = values.iter().fold(0.0_f64, |m, v| m.max(v.abs())) + air;
            let difference = values
                .iter()
                .zip(&others)
                .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            worst = worst.max(difference / size);
        }
        let added = &self.added_inductance_h;
        let size = added
            .amax()
            .max(0.1 * MU_0_T_M_PER_A * self.winding.turns.powi(2) * self.winding.inner_radius_m);
        Ok(worst.max((added - &other.added_inductance_h).amax() / size))
    }

    /// Drives of which two resolutions are compared, and axes about which: of a few coils all, of many
    /// some that are not equivalent, and their neighbours.
    fn compared(&self) -> (Vec<usize>, Vec<[f64; 2]>) {
        let all = &self.positions_m;
        if all.len() <= MOST_WHOLE {
            return ((0..all.len()).collect(), all.clone());
        }
        let first = representatives(all.len(), &motions(all));
        let chosen = spread_over(first.len(), MOST_COMPARED);
        let drives: Vec<usize> = chosen.into_iter().map(|k| first[k]).collect();
        let reach_m = BESIDE * closest_m(all);
        let beside = |[x, y]: &&[f64; 2]| {
            let apart = |drive: &usize| (all[*drive][0] - x).hypot(all[*drive][1] - y);
            drives.iter().any(|drive| apart(drive) <= reach_m)
        };
        let about = all.iter().filter(beside).copied().collect();
        (drives, about)
    }

    /// Solves at one resolution.
    ///
    /// Domain: cores apart by more than nothing, windings apart or touching.
    ///
    /// # Errors
    /// A node of the outline on the winding's edge.
    pub fn at_resolution(
        winding: &Winding,
        shape: CoreShape,
        relative_permeability: f64,
        positions_m: &[[f64; 2]],
        resolution: &ArrayResolution,
    ) -> Result<Self, OnEdge> {
        let (mut array, excitation) = Self::uncoupled(
            winding,
            shape,
            relative_permeability,
            positions_m,
            resolution,
        )?;
        if positions_m.len() > MOST_WHOLE {
            array.couple_reduced(&excitation, resolution);
        } else {
            array.couple(&excitation, resolution);
        }
        Ok(array)
    }

    fn uncoupled(
        winding: &Winding,
        shape: CoreShape,
        relative_permeability: f64,
        positions_m: &[[f64; 2]],
        resolution: &ArrayResolution,
    ) -> Result<(Self, Excitation), OnEdge> {
        let outline = Generatrix::of_coil(winding, shape, &resolution.outline);
        let excitation = Excitation::new(winding, &outline, resolution.outline.quadrature)?;
        let exchange = Rings::graded(
            &outline,
            resolution.order,
            &resolution.grading(shape, winding.length_m),
        );
        let response = Response::new(
            outline,
            exchange,
            resolution.angles(),
            resolution.modes,
            relative_permeability,
            resolution.outline.quadrature,
        );
        let own_layer = response.axial_layer(&excitation.potential);
        let array = Self {
            positions_m: positions_m.to_vec(),
            winding: *winding,
            response,
            own_layer,
            potentials: Potentials::Whole(Vec::new()),
            added_inductance_h: DMatrix::zeros(positions_m.len(), positions_m.len()),
            relative_error: f64::NAN,
            relative_residual: 0.0,
            iterations: 0,
        };
        Ok((array, excitation))
    }

    fn couple(&mut self, excitation: &Excitation, resolution: &ArrayResolution) {
        let cores = self.positions_m.len();
        let size = self.response.size();
        let coupling = Coupling::new(
            &self.winding,
            &self.positions_m,
            &self.response,
            resolution.residual,
        );
        let symmetries = motions(&self.positions_m);
        let drives = representatives(cores, &symmetries);

        // Moments [size, core] side by side for every drive: column = drive * cores + core.
        let columns = drives.len() * cores;
        let mut sent = DMatrix::zeros(size, columns);
        let mut own = DMatrix::zeros(size, columns);
        let own_moments = self.response.on_grid(&self.own_layer);
        for (place, drive) in drives.iter().enumerate() {
            for core in (0..cores).filter(|c| c != drive) {
                sent.column_mut(place * cores + core)
                    .copy_from_slice(&coupling.winding(core, *drive).potential);
            }
            own.set_column(place * cores + drive, &own_moments);
        }
        let solved = coupling.solve(sent, &own, resolution.residual);
        self.relative_residual = solved.relative_residual;
        self.iterations = solved.iterations;
        let (potentials, moments) = (solved.potentials, solved.moments);

        // Every drive from its representative.
        let of_drive = |drive: usize| {
            let (place, motion) = drives
                .iter()
                .enumerate()
                .find_map(|(place, first)| {
                    symmetries
                        .iter()
                        .find(|m| m.coil[*first] == drive)
                        .map(|m| (place, m))
                })
                .expect("every coil is the image of a representative");
            let moved = |from: &DMatrix<f64>| -> Vec<Vec<f64>> {
                let mut out = vec![Vec::new(); cores];
                for core in 0..cores {
                    out[motion.coil[core]] =
                        self.moved(motion, from.column(place * cores + core).as_slice());
                }
                out
            };
            (moved(&potentials), moved(&moments))
        };
        let all: Vec<_> = (0..cores).map(of_drive).collect();

        // Flux through coil i of the layers of all cores.
        let weights = excitation.flux_weights_wb_per_a(&self.response.outline);
        let own_flux = weights.dot(&self.own_layer);
        let by_ring = self.response.layers[0].tr_mul(&weights);
        let rings = self.response.exchange.rings.len();
        for (drive, (potentials, moments)) in all.iter().enumerate() {
            for (coil, at_coil) in potentials.iter().enumerate() {
                let mut flux = if coil == drive { own_flux } else { 0.0 };
                for values in at_coil.chunks(rings) {
                    let share: f64 = values.iter().zip(by_ring.iter()).map(|(a, b)| a * b).sum();
                    flux += share / self.response.angles as f64;
                }
                flux += coupling.flux_of_others_wb(coil, |core| &moments[core]);
                self.added_inductance_h[(coil, drive)] = flux;
            }
        }
        self.potentials = Potentials::Whole(all.into_iter().map(|(p, _)| p).collect());
    }

    fn couple_reduced(&mut self, excitation: &Excitation, resolution: &ArrayResolution) {
        let cores = self.positions_m.len();
        let symmetries = motions(&self.positions_m);
        let weights = excitation.flux_weights_wb_per_a(&self.response.outline);
        let core = OneCore {
            response: &self.response,
            winding: &self.winding,
            own_moments: self.response.on_grid(&self.own_layer),
            flux_by_ring: self.response.layers[0].tr_mul(&weights),
        };
        let closest_m = closest_m(&self.positions_m);
        let cut = PASSED_SHARE / SOLVER_SHARE * resolution.residual;
        let coupling = ReducedCoupling::new(&core, &self.positions_m, closest_m, cut);
        let first = representatives(cores, &symmetries);
        let solved = coupling.solve(&core, &symmetries, &first, resolution.residual);
        self.added_inductance_h = solved.inductance_h;
        let own_flux = weights.dot(&self.own_layer);
        for coil in 0..cores {
            self.added_inductance_h[(coil, coil)] += own_flux;
        }
        self.relative_residual = solved.relative_residual;
        self.iterations = solved.iterations;
        self.potentials = Potentials::Reduced(solved.received);
    }

    fn moved(&self, motion: &Motion, values: &[f64]) -> Vec<f64> {
        let rings = self.response.exchange.rings.len();
        let mut out = vec![0.0; values.len()];
        for (k, block) in values.chunks(rings).enumerate() {
            let to = motion.angle(k, self.response.angles);
            out[to * rings..(to + 1) * rings].copy_from_slice(block);
        }
        out
    }

    /// Azimuthal modes, as [`Response::modes_of`] has them, of what one core receives with currents in
    /// the coils, A.
    pub(super) fn modes_at(&self, core: usize, currents_a: &[f64]) -> DMatrix<f64> {
        match &self.potentials {
            Potentials::Whole(potentials) => {
                let mut potential = vec![0.0; self.response.size()];
                for (drive, current) in potentials.iter().zip(currents_a) {
                    for (sum, value) in potential.iter_mut().zip(&drive[core]) {
                        *sum += current * value;
                    }
                }
                self.response.modes_of(&potential)
            }
            Potentials::Reduced(received) => {
                let currents = currents_a.iter().copied().enumerate();
                received.modes(currents, core, &self.response)
            }
        }
    }

    /// Layers of one core for one driven coil, on the nodes: column 0 for mode 0, then cosine
    /// and sine of every mode, A/A.
    #[must_use]
    pub fn layers(&self, drive: usize, core: usize) -> DMatrix<f64> {
        let modes = match &self.potentials {
            Potentials::Whole(potentials) => self.response.modes_of(&potentials[drive][core]),
            Potentials::Reduced(received) => {
                received.modes(std::iter::once((drive, 1.0)), core, &self.response)
            }
        };
        let mut layers = self.response.layers_of(&modes);
        if drive == core {
            layers.column_mut(0).axpy(1.0, &self.own_layer, 1.0);
        }
        layers
    }

    /// The layers of all cores for some drives.
    pub(super) fn core_layers<'a>(&'a self, drives: &'a [usize]) -> CoreLayers<'a> {
        let (cores, response) = (self.positions_m.len(), &self.response);
        let waves = 2 * response.layers.len() - 1;
        match &self.potentials {
            Potentials::Whole(potentials) => {
                let all =
                    (0..cores).flat_map(|core| drives.iter().map(move |drive| (*drive, core)));
                let modes = all
                    .clone()
                    .map(|(drive, core)| response.modes_of(&potentials[drive][core]));
                let mut on_nodes = response.layers_of_all(&modes.collect::<Vec<_>>());
                for (place, _) in all.enumerate().filter(|(_, (drive, core))| drive == core) {
                    let mut column = on_nodes.column_mut(place * waves);
                    column += &self.own_layer;
                }
                CoreLayers::of_each((cores, drives.len()), waves, on_nodes)
            }
            Potentials::Reduced(received) => {
                // The last pattern is the driven coil's own.
                let on_nodes = received.on_nodes(response);
                let own = on_nodes.ncols();
                let mut on_nodes = on_nodes.resize_horizontally(own + waves, 0.0);
                on_nodes.set_column(own, &self.own_layer);
                let of_drive = move |place: usize| {
                    let received = received.of_drive(drives[place]);
                    let own = received.nrows();
                    let mut all = received.resize_vertically(own + 1, 0.0);
                    all[(own, drives[place])] = 1.0;
                    all
                };
                let size = (cores, drives.len());
                CoreLayers::of_patterns(size, waves, on_nodes, Box::new(of_drive))
            }
        }
    }
}

impl ArraySources {
    /// Dipoles for points no closer than `distance_m` to any core and no lower than `lowest_m`,
    /// to a relative error `tolerance`.
    #[must_use]
    pub fn of_array(array: &CoupledArray, lowest_m: f64, distance_m: f64, tolerance: f64) -> Self {
        Self::of_coils(array, (lowest_m, distance_m, tolerance), false)
    }

    /// The same for many points: as few dipoles as a comparison with those of
    /// [`ArraySources::of_array`] allows, which costs about what these cost for a hundred points.
    #[must_use]
    pub fn for_many_points(
        array: &CoupledArray,
        lowest_m: f64,
        distance_m: f64,
        tolerance: f64,
    ) -> Self {
        Self::of_coils(array, (lowest_m, distance_m, tolerance), true)
    }

    fn of_coils(array: &CoupledArray, near: (f64, f64, f64), many: bool) -> Self {
        let drives: Vec<usize> = (0..array.positions_m.len()).collect();
        Self::of_drives(array, &drives, near, many).driven_by_coils(&array.positions_m)
    }

    /// Dipoles for some of the drives.
    fn of_drives(
        array: &CoupledArray,
        drives: &[usize],
        (lowest_m, distance_m, tolerance): (f64, f64, f64),
        many: bool,
    ) -> Self {
        Self::new(
            &array.response.outline,
            &array.positions_m,
            &array.core_layers(drives),
            Near {
                lowest_m,
                distance_m,
                tolerance,
                many,
                winding: &array.winding,
            },
        )
    }
}

/// Matrices of whole exchange grids that are there at once: one for every different offset of a few
/// cores, none of many.
pub(super) fn grids_at_once(positions_m: &[[f64; 2]]) -> usize {
    if positions_m.len() > MOST_WHOLE {
        0
    } else {
        different_offsets(positions_m)
    }
}

/// Smallest distance of two axes, m; infinite for one coil.
#[must_use]
pub fn closest_m(positions_m: &[[f64; 2]]) -> f64 {
    let mut closest = f64::INFINITY;
    for (i, a) in positions_m.iter().enumerate() {
        for b in &positions_m[i + 1..] {
            closest = closest.min((a[0] - b[0]).hypot(a[1] - b[1]));
        }
    }
    closest
}

/// The first coil of every set of equivalent ones.
pub(super) fn representatives(cores: usize, symmetries: &[Motion]) -> Vec<usize> {
    (0..cores)
        .filter(|coil| symmetries.iter().all(|m| m.coil[*coil] >= *coil))
        .collect()
}

#[cfg(test)]
mod tests;
