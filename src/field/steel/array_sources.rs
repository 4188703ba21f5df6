//! The steel's field above an array, as that of point dipoles about its cores.
//!
//! Cores are alike, so that their dipoles are at the same places about every axis, fewer of them the
//! farther a point is from the core. Where many drives magnetise all cores, what they magnetise a core to
//! are sums of few patterns: the field of each pattern about each core is found once for a point, and the
//! amplitudes turn them into the fields of all drives, one product of matrices for many points.

use nalgebra::{DMatrix, DMatrixView};
use rayon::prelude::*;
use std::f64::consts::PI;

use super::CoreShape;
use super::symmetry::{Images, Motion, centre_m, motions};
use crate::components::Components;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes};
use fluxform_numerics::matrix::add_product;

/// Values of a drive that are one piece of work, about, and pieces of fewer values; fixed, so that results
/// do not depend on threads.
const PIECE: usize = 192;
const LEAST_PIECES: usize = 4;
/// Dipoles whose kernels are there at once.
const BLOCK: usize = 128;
/// Cores whose patterns' fields are there at once.
const CORES: usize = 64;

/// Position (m) and outer normal of a dipole.
pub(crate) type DipolePlace = [f64; 6];

/// Dipoles about a core that do from a distance on.
#[derive(Debug, Clone)]
pub(super) struct Level {
    /// The distance from the core, m.
    from_m: f64,
    /// About an axis at the origin.
    places: Vec<DipolePlace>,
    /// Layer moments of one core after the other, or of all alike, A m^2 per ampere: of every [`BLOCK`] of
    /// dipoles [column, dipole].
    moments: Vec<Vec<f64>>,
}

impl Level {
    /// From `from_m` on: dipoles at `places`, with `moments`, [dipole, column], of one core after the other or
    /// of all alike.
    pub(super) fn new(
        from_m: f64,
        places: Vec<DipolePlace>,
        moments: impl Iterator<Item = DMatrix<f64>>,
    ) -> Self {
        let in_blocks = |moments: DMatrix<f64>| {
            let starts = (0..moments.nrows()).step_by(BLOCK);
            starts
                .flat_map(|start| {
                    let rows = moments.rows(start, BLOCK.min(moments.nrows() - start));
                    rows.iter().copied().collect::<Vec<f64>>()
                })
                .collect()
        };
        Self {
            from_m,
            places,
            moments: moments.map(in_blocks).collect(),
        }
    }
}

/// Dipoles that stand for all cores of an array, for every drive.
#[derive(Debug, Clone)]
pub struct ArraySources {
    drives: usize,
    top_m: f64,
    /// The origin of distances; `None` where there is one level only.
    shape: Option<CoreShape>,
    /// The cores' axes, m.
    positions_m: Vec<[f64; 2]>,
    /// By rising distance.
    levels: Vec<Level>,
    /// Amplitudes of the patterns that the moments' columns are, [core and pattern, drive]; `None` where the
    /// columns are the drives themselves.
    amplitudes: Option<DMatrix<f64>>,
    /// The array's centre, m, and its motions, where the drives are its coils; none otherwise.
    symmetry: ([f64; 2], Vec<Motion>),
}

impl ArraySources {
    /// Cores of `shape` at `positions_m`, their dipoles at `levels`, of `amplitudes` where these are given.
    pub(super) fn of_levels(
        shape: CoreShape,
        positions_m: &[[f64; 2]],
        drives: usize,
        levels: Vec<Level>,
        amplitudes: Option<DMatrix<f64>>,
    ) -> Self {
        Self {
            drives,
            top_m: shape.top_m,
            shape: Some(shape),
            positions_m: positions_m.to_vec(),
            levels,
            amplitudes,
            symmetry: Default::default(),
        }
    }

    /// Dipoles given as such: places (m) with unit normals, and layer moments, [dipole, drive].
    pub(crate) fn of_dipoles(
        drives: usize,
        top_m: f64,
        places: Vec<DipolePlace>,
        moments: &[f64],
    ) -> Self {
        let moments = DMatrix::from_row_slice(places.len(), drives, moments);
        let level = Level::new(0.0, places, std::iter::once(moments));
        Self {
            drives,
            top_m,
            shape: None,
            positions_m: vec![[0.0; 2]],
            levels: vec![level],
            amplitudes: None,
            symmetry: Default::default(),
        }
    }

    /// The same, whose drives are the coils at `positions_m`, in their order: their symmetry is used.
    pub(super) fn driven_by_coils(self, positions_m: &[[f64; 2]]) -> Self {
        Self {
            symmetry: (centre_m(positions_m), motions(positions_m)),
            ..self
        }
    }

    /// The same at these currents of the drives, together one drive of one ampere.
    ///
    /// # Panics
    /// When there are not as many currents as drives.
    #[must_use]
    pub fn at_currents(&self, currents_a: &[f64]) -> Self {
        assert_eq!(currents_a.len(), self.drives);
        let currents_a = DMatrix::from_column_slice(self.drives, 1, currents_a);
        let mut levels = self.levels.clone();
        if self.amplitudes.is_none() {
            for level in &mut levels {
                let dipoles = level.places.len();
                for moments in &mut level.moments {
                    let mut summed = Vec::with_capacity(dipoles);
                    for block in moments.chunks(BLOCK * self.drives) {
                        let length = block.len() / self.drives;
                        let block = DMatrixView::from_slice(block, length, self.drives);
                        summed.extend((block * &currents_a).iter());
                    }
                    *moments = summed;
                }
            }
        }
        Self {
            drives: 1,
            levels,
            amplitudes: self.amplitudes.as_ref().map(|all| all * currents_a),
            symmetry: Default::default(),
            positions_m: self.positions_m.clone(),
            ..*self
        }
    }

    /// Number of drives.
    #[must_use]
    pub fn drives(&self) -> usize {
        self.drives
    }

    /// Height of the cores' top, m.
    #[must_use]
    pub fn top_m(&self) -> f64 {
        self.top_m
    }

    /// Number of dipoles that stand for all cores where a point is close to all of them.
    #[must_use]
    pub fn count(&self) -> usize {
        let dipoles = |level: &Level| level.places.len() * self.positions_m.len();
        self.levels.first().map_or(0, dipoles)
    }

    /// Numbers that it holds, about.
    #[must_use]
    pub fn size(&self) -> usize {
        let moments = self.levels.iter().flat_map(|level| &level.moments);
        moments.map(Vec::len).sum::<usize>() + self.amplitudes.as_ref().map_or(0, DMatrix::len)
    }

    /// The steel's field per ampere of every drive at `points_m`, [drive, component, point].
    ///
    /// # Panics
    /// When `out` has another length than drives x components x points.
    pub fn sample(&self, points_m: &[[f64; 3]], parts: Components, out: &mut [f64]) {
        let columns = self.drives * parts.count();
        assert_eq!(out.len(), columns * points_m.len());
        let (centre_m, motions) = &self.symmetry;
        if motions.len() > 1 {
            let images = Images::new(motions, *centre_m, points_m);
            let mut sector = vec![0.0; columns * images.sector_m.len()];
            self.sample_all(&images.sector_m, parts, &mut sector);
            images.spread(parts, &sector, out);
        } else {
            self.sample_all(points_m, parts, out);
        }
    }

    /// The same without the array's symmetry.
    pub(super) fn sample_all(&self, points_m: &[[f64; 3]], parts: Components, out: &mut [f64]) {
        let columns = self.drives * parts.count();
        let piece = (PIECE / parts.count()).min(points_m.len().div_ceil(LEAST_PIECES));
        let piece = piece.next_multiple_of(LANES).max(LANES);
        let chunks: Vec<DMatrix<f64>> = points_m
            .par_chunks(piece)
            .map(|points| {
                dispatch::run(Pass {
                    sources: self,
                    points,
                    parts,
                })
            })
            .collect();
        for (chunk, values) in chunks.iter().enumerate() {
            let count = piece.min(points_m.len() - chunk * piece);
            let slots = count.next_multiple_of(LANES);
            for (column, values) in values.as_slice().chunks_exact(slots).enumerate() {
                let at = column * points_m.len() + chunk * piece;
                out[at..at + count].copy_from_slice(&values[..count]);
            }
        }
        assert_eq!(out.len(), columns * points_m.len());
    }

    /// The level that does for a place at `[x, y, z]` from a core's axis.
    fn level_at(&self, [x, y, z]: [f64; 3]) -> usize {
        let Some(shape) = &self.shape else {
            return 0;
        };
        let distance_m = shape.distance_m(x.hypot(y), z);
        let beyond = |level: &Level| level.from_m <= distance_m;
        self.levels[1..].iter().take_while(|l| beyond(l)).count()
    }
}

/// One chunk of points: [component and point, drive], points filled up to whole [`Lanes`].
struct Pass<'a> {
    sources: &'a ArraySources,
    points: &'a [[f64; 3]],
    parts: Components,
}

impl Kernel for Pass<'_> {
    type Output = DMatrix<f64>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> DMatrix<f64> {
        match self.parts {
            Components::Gz => self.run_parts::<FMA, 1>(),
            Components::Force => self.run_parts::<FMA, 3>(),
            Components::Gradient => self.run_parts::<FMA, 5>(),
            Components::All => self.run_parts::<FMA, 8>(),
        }
    }
}

impl Pass<'_> {
    #[inline(always)]
    fn run_parts<const FMA: bool, const PARTS: usize>(self) -> DMatrix<f64> {
        let sources = self.sources;
        let rows = PARTS * self.points.len().next_multiple_of(LANES);
        let mut out = DMatrix::zeros(rows, sources.drives);
        let mut scratch = Scratch::default();
        let cores = sources.positions_m.len();
        let Some(amplitudes) = &sources.amplitudes else {
            for core in 0..cores {
                self.add_core::<FMA, PARTS>(core, &mut scratch, out.as_mut_slice());
            }
            return out;
        };
        let patterns = amplitudes.nrows() / cores;
        let mut fields = vec![0.0; rows * patterns * CORES.min(cores)];
        for first in (0..cores).step_by(CORES) {
            let count = CORES.min(cores - first);
            let fields = &mut fields[..rows * patterns * count];
            fields.fill(0.0);
            for (k, fields) in fields.chunks_exact_mut(rows * patterns).enumerate() {
                self.add_core::<FMA, PARTS>(first + k, &mut scratch, fields);
            }
            let fields = DMatrixView::from_slice(fields, rows, patterns * count);
            let amplitudes = amplitudes.rows(first * patterns, patterns * count);
            out.gemm(1.0, &fields, &amplitudes, 1.0);
        }
        out
    }

    /// Adds the fields of all columns of one core's moments, [column, component, point].
    #[inline(always)]
    fn add_core<const FMA: bool, const PARTS: usize>(
        &self,
        core: usize,
        scratch: &mut Scratch,
        out: &mut [f64],
    ) {
        fluxform_base::progress::poll();
        let sources = self.sources;
        let [x_m, y_m] = sources.positions_m[core];
        scratch.about.clear();
        for [x, y, z] in self.points {
            let about = [x - x_m, y - y_m, *z];
            scratch.about.push((about, sources.level_at(about)));
        }
        let slots = self.points.len().next_multiple_of(LANES);
        for (number, level) in sources.levels.iter().enumerate() {
            scratch.near.clear();
            let here = scratch.about.iter().enumerate();
            let here = here.filter(|(_, (_, at))| *at == number);
            scratch.near.extend(here.map(|(k, _)| k));
            if scratch.near.is_empty() || level.places.is_empty() {
                continue;
            }
            let moments = &level.moments[core.min(level.moments.len() - 1)];
            let columns = moments.len() / level.places.len();
            let wide = scratch.near.len().next_multiple_of(LANES);
            scratch.sums.clear();
            scratch.sums.resize(columns * PARTS * wide, 0.0);
            scratch.kernels.resize(BLOCK * PARTS * wide, 0.0);
            let blocks = level.places.chunks(BLOCK);
            for (places, moments) in blocks.zip(moments.chunks(BLOCK * columns)) {
                for (group, near) in scratch.near.chunks(LANES).enumerate() {
                    let axis = |axis: usize| {
                        Lanes(std::array::from_fn(|lane| {
                            scratch.about[near[lane.min(near.len() - 1)]].0[axis]
                        }))
                    };
                    let at = [axis(0), axis(1), axis(2)];
                    for (place, rows) in places
                        .iter()
                        .zip(scratch.kernels.chunks_exact_mut(PARTS * wide))
                    {
                        let kernel = dipole::<FMA, PARTS>(at, place);
                        for (part, kernel) in kernel.iter().enumerate() {
                            let start = part * wide + group * LANES;
                            kernel.store(&mut rows[start..start + LANES]);
                        }
                    }
                }
                let kernels = &scratch.kernels[..places.len() * PARTS * wide];
                add_product(moments, kernels, places.len(), &mut scratch.sums);
            }
            for (out, sums) in out
                .chunks_exact_mut(slots)
                .zip(scratch.sums.chunks_exact(wide))
            {
                for (k, sum) in scratch.near.iter().zip(sums) {
                    out[*k] += sum;
                }
            }
        }
    }
}

/// Room for one core's part of a pass.
#[derive(Default)]
struct Scratch {
    /// Every point from the core's axis, and its level.
    about: Vec<([f64; 3], usize)>,
    /// Points at one level.
    near: Vec<usize>,
    /// [dipole, component, point].
    kernels: Vec<f64>,
    /// [column, component, point].
    sums: Vec<f64>,
}

/// Field of a layer element of unit moment: of a point dipole -n, A m^2.
#[inline(always)]
fn dipole<const FMA: bool, const PARTS: usize>(
    [x, y, z]: [Lanes; 3],
    place: &DipolePlace,
) -> [Lanes; PARTS] {
    let [px, py, pz, nx, ny, nz] = *place;
    let (dx, dy, dz) = (x - px, y - py, z - pz);
    let square = dx.mul_add::<FMA>(dx, dy.mul_add::<FMA>(dy, dz * dz));
    let inverse2 = Lanes::splat(1.0) / square;
    let inverse = inverse2.sqrt();
    let inverse3 = inverse * inverse2;
    let along = (dx * nx) + (dy * ny) + (dz * nz);
    let scale = inverse3 * inverse2 * (-3.0 * MU_0_T_M_PER_A / (4.0 * PI));
    // G_ij = scale (n_i d_j + n_j d_i + s (delta_ij - 5 d_i d_j / d^2)).
    let steep = along * inverse2 * -5.0;
    let zz = scale * (dz * (2.0 * nz) + along + steep * (dz * dz));
    let mut out = [Lanes::splat(0.0); PARTS];
    if PARTS == 1 {
        out[0] = zz;
        return out;
    }
    let mut parts = [Lanes::splat(0.0); 8];
    parts[0] = scale * (dx * (2.0 * nx) + along + steep * (dx * dx));
    parts[1] = scale * (dy * nx + dx * ny + steep * (dx * dy));
    parts[2] = scale * (dz * nx + dx * nz + steep * (dx * dz));
    parts[3] = scale * (dz * ny + dy * nz + steep * (dy * dz));
    parts[4] = zz;
    if PARTS == 8 {
        // B_i = scale s d_i + mu_0 n_i / (4 pi d^3).
        let even = inverse3 * (MU_0_T_M_PER_A / (4.0 * PI));
        let strength = scale * along;
        parts[5] = strength * dx + even * nx;
        parts[6] = strength * dy + even * ny;
        parts[7] = strength * dz + even * nz;
    }
    // Those along z alone: the last of the gradient's.
    let first = if PARTS == 3 { 2 } else { 0 };
    out.copy_from_slice(&parts[first..first + PARTS]);
    out
}
