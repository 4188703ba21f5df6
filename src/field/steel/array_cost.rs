//! Cost of solving an array of coupled cores, from its shape alone.

use super::CoreShape;
use super::array::{ArrayResolution, grids_at_once, representatives};
use super::array_request::{FINER, FIRST_AIM};
use super::offsets::Offsets;
use super::reduced_coupling::{BLOCK, is_lattice};
use super::symmetry::motions;

/// Cores of which offsets and symmetries are counted; of more, bounds are used.
const COUNTED: usize = 1500;
/// Applications of the coupling that a solution takes, about.
const STEPS: f64 = 15.0;
/// Solutions: the coarse and the fine one.
const SOLUTIONS: f64 = 2.0;
const NUMBER_BYTES: f64 = 8.0;
/// Unknowns that cores send each other of the pull, as a share of all for every e-fold of the
/// tolerance: 0.017 to 0.04 for cores 2.1 to 10 radii apart, 2.5 to 9 radii long.
const SENT: f64 = 0.022;
/// Matrices of the pull's coupling that are there at once.
const PULL_MATRICES: f64 = 5.0;
/// The tolerance from which on resolutions are refined, once for every power of ten: two refinements at 1e-2,
/// one at 1e-3, none at 1e-4 for 36 to 900 cores 4 radii apart.
const REFINED_FROM: f64 = 1e-4;
/// Coefficients that pass between many cores, as a share of a core's unknowns, for every power of ten of the
/// resolution's aim: 0.35 at 1.8e-3, 0.41 at 6e-4, 0.47 at 2e-4 for cores 4 radii apart.
const PASSED: f64 = 0.127;
/// Steps of a lattice's periodic plane for every core, and matrices of each that are there at once.
const LATTICE_STEPS: f64 = 4.0;
const LATTICE_MATRICES: f64 = 2.0;
/// What passes between cores of one offset, most of which are far, of what passes between the closest.
const FAR: f64 = 0.6;
/// Matrices of a core's grid that are there at once as what passes is chosen.
const GRID_MATRICES: f64 = 12.0;
/// Drives that are solved at the coarse resolution too.
const COMPARED: f64 = 8.0;
/// By how much products of matrices are quicker than what computes their entries.
const QUICKER: f64 = 6.0;
/// Operations of choosing what passes, in cubes of a core's unknowns.
const CHOSEN_CUBES: f64 = 4.0;
/// Operations of factoring and solving for all columns, in cubes of the size.
const PULL_CUBES: f64 = 8.0 / 3.0;
/// Bytes of a pair of cores in the table of offsets.
const PAIR_BYTES: f64 = 24.0;

/// Memory and work of one array.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArrayCost {
    /// Peak memory, bytes.
    pub bytes: f64,
    /// Additions and multiplications of the largest products.
    pub operations: f64,
    /// The error that the caps on resolution leave, relative; far below the tolerance where they do not
    /// bind.
    pub least_error: f64,
}

impl ArrayCost {
    /// The cost of cores of `shape` at `positions_m`, the closest two of them `closest_m` apart, with
    /// windings of `winding_length_m`, to a relative `tolerance`. Right within a factor of about three; of more than 1500 cores a
    /// lower bound.
    #[must_use]
    pub fn new(
        shape: CoreShape,
        winding_length_m: f64,
        positions_m: &[[f64; 2]],
        closest_m: f64,
        tolerance: f64,
    ) -> Self {
        let cores = positions_m.len();
        let (offsets, drives) = if cores <= COUNTED {
            let drives = representatives(cores, &motions(positions_m)).len();
            (grids_at_once(positions_m), drives)
        } else {
            (0, cores.div_ceil(8))
        };
        let refinements = (tolerance / REFINED_FROM).log10().max(0.0);
        let aim = FIRST_AIM * tolerance * FINER.powf(refinements);
        let resolution = ArrayResolution::for_tolerance(aim, shape, closest_m).within_memory(
            shape,
            winding_length_m,
            offsets,
        );
        let size = resolution.unknowns(shape, winding_length_m) as f64;
        let (cores, offsets, drives) = (cores as f64, offsets as f64, drives as f64);
        let least_error = 2.0 * resolution.exchange_error(shape, closest_m);
        if offsets == 0.0 && cores > 1.0 {
            let passed = (-PASSED * aim.log10()).clamp(0.1, 1.0) * size;
            let block = passed * passed;
            // Offsets of a lattice, of which every eighth is computed, or half of all pairs.
            let (products, different, matrices) = if is_lattice(positions_m) {
                let steps = LATTICE_STEPS * cores;
                (steps, 0.5 * cores, LATTICE_MATRICES * steps)
            } else {
                (cores * cores, 0.5 * cores * cores, 0.0)
            };
            let vectors = (STEPS + 4.0) * drives.min(BLOCK as f64) * cores * passed;
            let solved = cores * drives * passed;
            let grids = GRID_MATRICES * size * size;
            return Self {
                bytes: NUMBER_BYTES
                    * ((FAR * different + matrices) * block + vectors + solved + grids),
                operations: STEPS * 4.0 * products * block * (drives + drives.min(COMPARED))
                    / QUICKER
                    + SOLUTIONS * different * size * (10.0 * size + 2.0 * passed)
                    + CHOSEN_CUBES * size.powi(3),
                least_error,
            };
        }
        let matrices = (offsets + 1.0) * size * size;
        let potentials = SOLUTIONS * cores * cores * size;
        let steps = (STEPS + 4.0) * drives * cores * size;
        Self {
            bytes: NUMBER_BYTES * (matrices + potentials + steps) + PAIR_BYTES * cores * cores,
            operations: SOLUTIONS
                * (STEPS * 2.0 * size * size * cores * cores * drives / QUICKER + 10.0 * matrices),
            least_error,
        }
    }

    /// The cost of the pull of unpowered cores on a magnet to `tolerance` of what their coupling adds
    /// (see [`super::passive::neighbours`]): matrices of all potentials that all cores send. Right within
    /// a factor of about three.
    #[must_use]
    pub fn of_pull(
        shape: CoreShape,
        positions_m: &[[f64; 2]],
        closest_m: f64,
        tolerance: f64,
    ) -> Self {
        let resolution = ArrayResolution::for_tolerance(tolerance, shape, closest_m);
        let unknowns = resolution.unknowns(shape, 0.0) as f64;
        let sent = SENT * (1.0 / tolerance).ln() * unknowns;
        let cores = positions_m.len() as f64;
        let size = sent * cores;
        let offsets = if positions_m.len() <= COUNTED {
            Offsets::of_pairs(positions_m).count() as f64
        } else {
            cores
        };
        Self {
            bytes: NUMBER_BYTES * (PULL_MATRICES * size * size + offsets * sent * sent)
                + PAIR_BYTES * cores * cores,
            operations: PULL_CUBES * size.powi(3) + offsets * unknowns * unknowns * sent,
            least_error: 2.0 * resolution.exchange_error(shape, closest_m),
        }
    }
}
