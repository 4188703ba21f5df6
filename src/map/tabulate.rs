//! Field-gradient maps of an array of identical coils on a grid.
//!
//! At one height a coil's field depends on the distance from its axis alone. Distances that
//! repeat are computed once; where few repeat, a Chebyshev table over the distance replaces
//! the direct sums once it is the cheaper of the two.

use serde::{Deserialize, Serialize};

use rayon::prelude::*;

use super::radii::Radii;
use fluxform_base::progress::{Interrupted, Progress};
pub use fluxform_field::components::Components;
use fluxform_field::frame::to_cartesian;
use fluxform_field::source::AxialSource;
use fluxform_field::winding::{AxialField, OnEdge};
use fluxform_numerics::chebyshev::{Evaluation, Layout};
use fluxform_numerics::dispatch;

/// Maps per ampere of every coil over a grid, C order.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FieldMap {
    /// Nodes along x, m.
    pub x_m: Vec<f64>,
    /// Nodes along y, m.
    pub y_m: Vec<f64>,
    /// Nodes along z, m.
    pub z_m: Vec<f64>,
    /// Coil numbers in the design.
    pub coils: Vec<usize>,
    /// dB_z/dz, T/m/A, [coil, z, y, x].
    pub gz_t_per_m_per_a: Vec<f64>,
    /// dB_i/dx_j, T/m/A, [coil, z, y, x, i, j].
    pub gradient_t_per_m_per_a: Option<Vec<f64>>,
    /// B, T/A, [coil, z, y, x, 3].
    pub field_t_per_a: Option<Vec<f64>>,
    /// Bound of the error of every gradient component relative to the largest |grad B| at its
    /// height (of the field relative to the largest |B|).
    pub relative_error: f64,
    /// Number of distinct distances from the axes.
    pub distinct_radii: usize,
    /// Whether radial tables replaced direct sums on any height.
    pub tabulated: bool,
}

/// Why a map could not be made.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// A node lies on an edge of a source.
    #[error(transparent)]
    OnEdge(#[from] OnEdge),
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// The grid of a map, m.
#[derive(Debug, Clone)]
pub struct Grid {
    /// Nodes along x.
    pub x_m: Vec<f64>,
    /// Nodes along y.
    pub y_m: Vec<f64>,
    /// Nodes along z.
    pub z_m: Vec<f64>,
}

/// A coil of the array: its number in the design, its axis and its measured scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedCoil {
    /// Number in the design.
    pub number: usize,
    /// Axis, m.
    pub axis_m: [f64; 2],
    /// Scale of its map.
    pub gain: f64,
}

/// A table is worth its nodes when it has this many times fewer of them than there are
/// distinct distances: a node costs some ten loops, a lookup some ten operations.
const TABLE_GAIN: usize = 4;
/// Share of the tolerance given to the direct sums; the table takes as much, rounding the rest.
const SHARE: f64 = 0.4;

/// `N` numbers of every node's field, times the coil's gain.
fn spread<const N: usize>(
    (planes, plane): (usize, usize),
    of: impl Fn(usize, usize) -> (f64, [f64; N]) + Sync,
) -> Vec<f64> {
    let mut out = vec![0.0; planes * plane * N];
    out.par_chunks_mut(N * plane.max(1))
        .enumerate()
        .for_each(|(piece, out)| {
            for (place, values) in out.as_chunks_mut::<N>().0.iter_mut().enumerate() {
                let (gain, numbers) = of(piece, place);
                *values = numbers.map(|number| gain * number);
            }
        });
    out
}

/// Maps of identical `coils`, each with `source` about its axis, over `grid`, every component to
/// `tolerance` relative to the largest |grad B| at its height. The bytes do not depend on the
/// number of threads.
///
/// # Errors
/// A node on an edge of the source; interruption.
pub fn tabulate(
    source: &dyn AxialSource,
    coils: &[PlacedCoil],
    grid: &Grid,
    components: Components,
    tolerance: f64,
    progress: &dyn Progress,
) -> Result<FieldMap, MapError> {
    let axes: Vec<[f64; 2]> = coils.iter().map(|c| c.axis_m).collect();
    let radii = Radii::new(&grid.x_m, &grid.y_m, &axes);
    progress.begin("map", grid.z_m.len() as u64);
    let levels: Vec<Level> = grid
        .z_m
        .par_iter()
        .map(|z_m| {
            progress.check()?;
            let level = Level::new(source, &radii.distinct_m, *z_m, components, tolerance)?;
            progress.advance(1);
            Ok(level)
        })
        .collect::<Result<_, MapError>>()?;
    progress.end();

    let plane = grid.x_m.len() * grid.y_m.len();
    let heights = grid.z_m.len();
    let planes = coils.len() * heights;
    let mut gz = vec![0.0; planes * plane];
    // One plane of one coil is one piece of work.
    gz.par_chunks_mut(plane.max(1))
        .enumerate()
        .for_each(|(piece, out)| {
            let (coil, level) = (piece / heights, &levels[piece % heights]);
            let index = &radii.index[coil * plane..(coil + 1) * plane];
            let gain = coils[coil].gain;
            for (value, radius) in out.iter_mut().zip(index) {
                *value = gain * level.dbz_dz[*radius as usize];
            }
        });
    let cartesian = |piece: usize, place: usize| {
        let (coil, level) = (piece / heights, &levels[piece % heights]);
        let radius = radii.index[coil * plane + place] as usize;
        let dx = grid.x_m[place % grid.x_m.len()] - coils[coil].axis_m[0];
        let dy = grid.y_m[place / grid.x_m.len()] - coils[coil].axis_m[1];
        (
            to_cartesian(&level.axial(radius, dx.hypot(dy)), dx, dy),
            coils[coil].gain,
        )
    };
    let size = (planes, plane);
    let gradient = (components != Components::Gz).then(|| {
        spread::<9>(size, |piece, place| {
            let (field, gain) = cartesian(piece, place);
            let flat = field.gradient_t_per_m_per_a;
            (gain, std::array::from_fn(|k| flat[k / 3][k % 3]))
        })
    });
    let field = (components == Components::All).then(|| {
        spread::<3>(size, |piece, place| {
            let (field, gain) = cartesian(piece, place);
            (gain, field.field_t_per_a)
        })
    });
    Ok(FieldMap {
        x_m: grid.x_m.clone(),
        y_m: grid.y_m.clone(),
        z_m: grid.z_m.clone(),
        coils: coils.iter().map(|c| c.number).collect(),
        gz_t_per_m_per_a: gz,
        gradient_t_per_m_per_a: gradient,
        field_t_per_a: field,
        relative_error: tolerance,
        distinct_radii: radii.distinct_m.len(),
        tabulated: levels.iter().any(|level| level.tabulated),
    })
}

/// One height: the field at every distinct distance, per ampere.
struct Level {
    dbz_dz: Vec<f64>,
    /// Empty unless the gradient is requested.
    dbr_dz_over_r: Vec<f64>,
    br_over_r: Vec<f64>,
    /// Empty unless the field is requested.
    b_z: Vec<f64>,
    tabulated: bool,
}

impl Level {
    fn new(
        source: &dyn AxialSource,
        radii_m: &[f64],
        z_m: f64,
        components: Components,
        tolerance: f64,
    ) -> Result<Self, OnEdge> {
        let most = radii_m.len() / TABLE_GAIN;
        let above_m = z_m - source.top_m();
        let layout = radii_m
            .last()
            .and_then(|last| Layout::new(radii_m[0], *last, above_m, SHARE * tolerance, most));
        let Some(layout) = layout else {
            return Self::direct(source, radii_m, z_m, components, SHARE * tolerance);
        };
        let nodes = Self::direct(source, &layout.nodes(), z_m, components, SHARE * tolerance)?;
        let lookup = |values: &[f64]| {
            if values.is_empty() {
                return Vec::new();
            }
            let table = layout.table(values);
            let mut out = vec![0.0; radii_m.len()];
            dispatch::run(Evaluation {
                table: &table,
                points: radii_m,
                out: &mut out,
            });
            out
        };
        Ok(Self {
            dbz_dz: lookup(&nodes.dbz_dz),
            dbr_dz_over_r: lookup(&nodes.dbr_dz_over_r),
            br_over_r: lookup(&nodes.br_over_r),
            b_z: lookup(&nodes.b_z),
            tabulated: true,
        })
    }

    fn direct(
        source: &dyn AxialSource,
        radii_m: &[f64],
        z_m: f64,
        components: Components,
        tolerance: f64,
    ) -> Result<Self, OnEdge> {
        let heights = vec![z_m; radii_m.len()];
        let gradients = source.gradients(radii_m, &heights, tolerance, components)?;
        let b_z = if components == Components::All {
            source.axial_fields(radii_m, &heights, tolerance)?
        } else {
            Vec::new()
        };
        Ok(Self {
            dbz_dz: gradients.dbz_dz,
            dbr_dz_over_r: gradients.dbr_dz_over_r,
            br_over_r: gradients.br_over_r,
            b_z,
            tabulated: false,
        })
    }

    /// The field at a distinct distance, outside the conductor, at the true distance `r_m`.
    fn axial(&self, radius: usize, r_m: f64) -> AxialField {
        let (dbz_dz, br_over_r) = (self.dbz_dz[radius], self.br_over_r[radius]);
        let dbr_dz_over_r = self.dbr_dz_over_r[radius];
        let dbr_dz = dbr_dz_over_r * r_m;
        AxialField {
            b_r: br_over_r * r_m,
            b_z: self.b_z.get(radius).copied().unwrap_or(0.0),
            dbr_dr: -br_over_r - dbz_dz,
            dbr_dz,
            dbr_dz_over_r,
            dbz_dr: dbr_dz,
            dbz_dz,
            br_over_r,
        }
    }
}
