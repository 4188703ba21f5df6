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

use super::clearance::Clearance;
use serde::{Deserialize, Serialize};

use nalgebra::{DMatrix, DVector};

use super::CoreShape;
pub use super::array_resolution::ArrayResolution;
use super::array_resolution::SOLVER_SHARE;
use super::core_layers::CoreLayers;
use super::cored_coil::Excitation;
use super::coupling::Coupling;
use super::equivalent_dipoles::{ArraySources, Near};
use super::generatrix::Generatrix;
use super::offsets::Offsets;
use super::reduced_coupling::{BLOCK, Joined, OneCore, Received, ReducedCoupling, SolvedBlock};
use super::response::{Response, Rings};
use super::symmetry::{Motion, motions};
use crate::winding::{OnEdge, Winding};

/// Cores up to which whole grids are exchanged: of more, only what passes between them.
pub const MOST_WHOLE: usize = 16;
/// Share of the tolerance that each part may have which is left out of what passes: a few hundredths
/// of it is what they come to.
const PASSED_SHARE: f64 = 0.2;

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
    /// Refinements of the resolution after which it was solved.
    pub(super) refinement: usize,
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

impl CoupledArray {
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

    /// The array without what cores and windings send each other, and one coil's winding about its core.
    ///
    /// # Errors
    /// A node of the outline on the winding's edge.
    pub(super) fn uncoupled(
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
            refinement: 0,
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
            let mut current_a = vec![0.0; cores];
            current_a[*drive] = 1.0;
            let mut of_drive = sent.columns_mut(place * cores, cores);
            of_drive.copy_from(&coupling.of_windings(&current_a));
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
                    let values = from.column(place * cores + core);
                    out[motion.coil[core]] =
                        motion.image_on_grid(self.response.angles, values.as_slice());
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
            let of_others_wb = coupling.flux_of_others_wb(|core| &moments[core]);
            for (coil, at_coil) in potentials.iter().enumerate() {
                let mut flux = if coil == drive { own_flux } else { 0.0 };
                for values in at_coil.chunks(rings) {
                    let share: f64 = values.iter().zip(by_ring.iter()).map(|(a, b)| a * b).sum();
                    flux += share / self.response.angles as f64;
                }
                flux += of_others_wb[coil];
                self.added_inductance_h[(coil, drive)] = flux;
            }
        }
        self.potentials = Potentials::Whole(all.into_iter().map(|(p, _)| p).collect());
    }

    fn couple_reduced(&mut self, excitation: &Excitation, resolution: &ArrayResolution) {
        let positions_m = self.positions_m.clone();
        let coupling = self.reduced(excitation, resolution, &positions_m);
        let first = representatives(positions_m.len(), &motions(&positions_m));
        let solve = |drives: &[usize]| coupling.solve(drives, resolution.residual);
        let blocks: Vec<SolvedBlock> = first.chunks(BLOCK).map(solve).collect();
        self.join(&blocks);
    }

    /// The exchange of the array's cores, which are at `positions_m`.
    pub(super) fn reduced<'a>(
        &self,
        excitation: &Excitation,
        resolution: &ArrayResolution,
        positions_m: &'a [[f64; 2]],
    ) -> ReducedCoupling<'a> {
        let weights = excitation.flux_weights_wb_per_a(&self.response.outline);
        let core = OneCore {
            response: &self.response,
            winding: &self.winding,
            own_moments: self.response.on_grid(&self.own_layer),
            own_flux_wb: weights.dot(&self.own_layer),
            flux_by_ring: self.response.layers[0].tr_mul(&weights),
        };
        let cut = PASSED_SHARE / SOLVER_SHARE * resolution.residual;
        ReducedCoupling::new(&core, positions_m, closest_m(positions_m), cut)
    }

    /// Takes the solutions of blocks of drives; for others and their images the array stays uncoupled.
    pub(super) fn join(&mut self, blocks: &[SolvedBlock]) {
        let solved = Joined::new(blocks, self.positions_m.len(), &motions(&self.positions_m));
        self.added_inductance_h = solved.inductance_h;
        self.relative_residual = solved.relative_residual;
        self.iterations = solved.iterations;
        self.potentials = Potentials::Reduced(solved.received);
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
    /// Dipoles for points with `clearance`, to a relative error `tolerance`.
    #[must_use]
    pub fn of_array(array: &CoupledArray, clearance: Clearance, tolerance: f64) -> Self {
        Self::of_coils(array, (clearance, tolerance), false)
    }

    /// The same for many points: as few dipoles as a comparison with those of
    /// [`ArraySources::of_array`] allows, which costs about what these cost for a hundred points.
    #[must_use]
    pub fn for_many_points(array: &CoupledArray, clearance: Clearance, tolerance: f64) -> Self {
        Self::of_coils(array, (clearance, tolerance), true)
    }

    pub(super) fn of_coils(array: &CoupledArray, near: (Clearance, f64), many: bool) -> Self {
        let drives: Vec<usize> = (0..array.positions_m.len()).collect();
        Self::of_drives(array, &drives, near, many).driven_by_coils(&array.positions_m)
    }

    /// Dipoles for some of the drives.
    pub(super) fn of_drives(
        array: &CoupledArray,
        drives: &[usize],
        (clearance, tolerance): (Clearance, f64),
        many: bool,
    ) -> Self {
        Self::new(
            &array.response.outline,
            &array.positions_m,
            &array.core_layers(drives),
            Near {
                clearance,
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
        Offsets::of_pairs(positions_m).count()
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
