//! Maps of what a magnet feels: weighted means of an axisymmetric source's field over many places.
//!
//! At one height the mean depends on where the magnet is relative to a coil's axis alone, and is as
//! smooth as the field at the lowest of its places. So it is computed on few circles about the
//! axis, at as many azimuths as it has modes, and every coil of a map and every grid takes it
//! from there: Chebyshev series in the radius, trigonometric ones in the azimuth.

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::tabulate::{Components, FieldMap, Grid, MapError, PlacedCoil};
use fluxform_base::progress::Progress;
use fluxform_field::source::AxialSource;
use fluxform_numerics::chebyshev::{Evaluation, Layout, Scattered, Table};
use fluxform_numerics::dispatch;

/// Places of a mean, m from its centre, and their weights.
pub type Shares = [([f64; 3], f64)];

/// Places summed by one thread at a time; fixed, so that bytes do not depend on threads.
const PORTION: usize = 16;
/// Azimuths that are tried.
const AZIMUTHS: [usize; 4] = [8, 16, 32, 64];
/// Share of the tolerance given to each of the two series.
const SHARE: f64 = 0.2;
/// Values of a plane below which the means are taken at each place.
const FEWEST: usize = 512;
/// Least extent of the series in the radius, m.
const LEAST_RADIUS_M: f64 = 1e-9;
/// Most radii of a height.
const MOST_RADII: usize = 4000;
/// Components of the gradient: dB_z/dz, then dB_x/dx, dB_x/dy, dB_x/dz, dB_y/dz.
const GRADIENT: usize = 5;

/// Means of one source's gradient at any height, computed where they are first needed.
pub struct MeanField<'a> {
    source: &'a dyn AxialSource,
    count: usize,
    tolerance: f64,
    source_tolerance: f64,
    radius_m: f64,
    heights: Mutex<HashMap<u64, Option<Arc<Height>>>>,
}

/// The means at one height.
struct Height {
    /// [component] of series in the radius, each with its place among the modes.
    series: Vec<Vec<(usize, Table)>>,
    azimuths: usize,
}

impl<'a> MeanField<'a> {
    /// Means of the gradient (of dB_z/dz alone for [`Components::Gz`]) for `coils` on grids within
    /// `grid`, their series to `tolerance` of the largest component at a height, the source
    /// itself to `source_tolerance`; `None` for components that it does not give and for few
    /// places.
    #[must_use]
    pub fn new(
        source: &'a dyn AxialSource,
        coils: &[PlacedCoil],
        grid: &Grid,
        components: Components,
        tolerance: f64,
        source_tolerance: f64,
    ) -> Option<Self> {
        let count = count(components)?;
        if grid.x_m.len() * grid.y_m.len() * coils.len() < FEWEST {
            return None;
        }
        let mut radius_m = LEAST_RADIUS_M;
        for PlacedCoil { axis_m, .. } in coils {
            for x in [grid.x_m.first()?, grid.x_m.last()?] {
                for y in [grid.y_m.first()?, grid.y_m.last()?] {
                    radius_m = radius_m.max((x - axis_m[0]).hypot(y - axis_m[1]));
                }
            }
        }
        Some(Self {
            source,
            count,
            tolerance,
            source_tolerance,
            radius_m,
            heights: Mutex::default(),
        })
    }

    /// The map over `grid` of the means over `shares`; `None` where a height is too close to the
    /// sources or its means have too many modes.
    ///
    /// # Errors
    /// A place on an edge of the source; interruption.
    pub fn map(
        &self,
        shares: &Shares,
        coils: &[PlacedCoil],
        grid: &Grid,
        components: Components,
        progress: &dyn Progress,
    ) -> Result<Option<FieldMap>, MapError> {
        let Some(count) = count(components).filter(|count| *count <= self.count) else {
            return Ok(None);
        };
        progress.begin("map", grid.z_m.len() as u64);
        let mut heights = Vec::with_capacity(grid.z_m.len());
        for z_m in &grid.z_m {
            progress.check()?;
            let Some(height) = self.height(shares, *z_m)? else {
                return Ok(None);
            };
            heights.push(height);
            progress.advance(1);
        }
        let plane = grid.x_m.len() * grid.y_m.len();
        let pieces: Vec<Vec<Vec<f64>>> = coils
            .par_iter()
            .map(|coil| {
                let places = Places::new(grid, coil);
                heights.iter().map(|h| h.at(&places, count)).collect()
            })
            .collect();
        let nodes = coils.len() * heights.len() * plane;
        let mut gz = Vec::with_capacity(nodes);
        let mut gradient = Vec::with_capacity(if count > 1 { 9 * nodes } else { 0 });
        for (coil, pieces) in coils.iter().zip(&pieces) {
            for values in pieces {
                gz.extend(values[..plane].iter().map(|v| coil.gain * v));
                if count == 1 {
                    continue;
                }
                for at in 0..plane {
                    let [zz, xx, xy, xz, yz] =
                        std::array::from_fn(|c| coil.gain * values[c * plane + at]);
                    gradient.extend([xx, xy, xz, xy, -xx - zz, yz, xz, yz, zz]);
                }
            }
        }
        progress.end();
        Ok(Some(FieldMap {
            x_m: grid.x_m.clone(),
            y_m: grid.y_m.clone(),
            z_m: grid.z_m.clone(),
            coils: coils.iter().map(|c| c.number).collect(),
            gz_t_per_m_per_a: gz,
            gradient_t_per_m_per_a: (count > 1).then_some(gradient),
            field_t_per_a: None,
            // The series' and as much for the source, whose errors the weights may add up.
            relative_error: 2.0 * self.tolerance,
            distinct_radii: plane * coils.len(),
            tabulated: true,
        }))
    }

    fn height(&self, shares: &Shares, z_m: f64) -> Result<Option<Arc<Height>>, MapError> {
        let lock = || self.heights.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = lock().get(&z_m.to_bits()) {
            return Ok(known.clone());
        }
        let made = self.made(shares, z_m)?.map(Arc::new);
        lock().insert(z_m.to_bits(), made.clone());
        Ok(made)
    }

    fn made(&self, shares: &Shares, z_m: f64) -> Result<Option<Height>, MapError> {
        let lowest_m = shares.iter().fold(0.0_f64, |low, (o, _)| low.min(o[2]));
        let above_m = z_m + lowest_m - self.source.top_m();
        let aim = SHARE * self.tolerance;
        let Some(layout) = Layout::new(0.0, self.radius_m, above_m, aim, MOST_RADII) else {
            return Ok(None);
        };
        let radii = layout.nodes();
        let rows = shares
            .par_iter()
            .map(|(offset_m, _)| self.source_row(*offset_m, z_m))
            .collect::<Result<Vec<_>, MapError>>()?;
        let mut means: Vec<f64> = Vec::new();
        let mut before = 0;
        for azimuths in AZIMUTHS {
            // Every second azimuth is one of the attempt before.
            let step = azimuths / (azimuths - before);
            let angles: Vec<f64> = (0..azimuths)
                .filter(|k| step == 1 || k % step == 1)
                .map(|k| TAU * k as f64 / azimuths as f64)
                .collect();
            let more = self.means(shares, &rows, &radii, &angles);
            means = interleaved(&means, &more, (before, angles.len(), radii.len()));
            before = azimuths;
            let series = modes(&means, azimuths, radii.len());
            let size = means.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            let largest = |mode: &[f64]| mode.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            // The highest two frequencies: what lies beyond them is smaller still.
            let resolved = series
                .chunks_exact(azimuths * radii.len())
                .flat_map(|modes| modes.chunks_exact(radii.len()).skip(azimuths - 4))
                .all(|mode| largest(mode) <= 0.1 * aim * size);
            if !resolved {
                continue;
            }
            let series = series
                .chunks_exact(azimuths * radii.len())
                .map(|modes| {
                    let modes = modes.chunks_exact(radii.len()).enumerate();
                    modes
                        .filter(|(_, mode)| largest(mode) > 0.01 * aim * size)
                        .map(|(place, mode)| (place, layout.table(mode)))
                        .collect()
                })
                .collect();
            return Ok(Some(Height { series, azimuths }));
        }
        Ok(None)
    }

    /// Means about the axis at `angles`, [component][azimuth][radius], of sources whose `rows` are known.
    fn means(
        &self,
        shares: &Shares,
        rows: &[Option<Vec<Table>>],
        radii: &[f64],
        angles: &[f64],
    ) -> Vec<f64> {
        let size = self.count * angles.len() * radii.len();
        let sums: Vec<Vec<f64>> = shares
            .par_chunks(PORTION)
            .zip(rows.par_chunks(PORTION))
            .map(|(shares, rows)| {
                let mut sum = vec![0.0; size];
                for ((offset_m, share), row) in shares.iter().zip(rows) {
                    fluxform_base::progress::poll();
                    if let Some(row) = row {
                        self.add(*offset_m, *share, row, (radii, angles), &mut sum);
                    }
                }
                sum
            })
            .collect();
        let mut total = vec![0.0; size];
        for sum in sums {
            for (total, value) in total.iter_mut().zip(sum) {
                *total += value;
            }
        }
        total
    }

    /// The source at the height of one place of a mean at `z_m`: series in the radius there, the same for
    /// all azimuths.
    fn source_row(&self, [ox, oy, oz]: [f64; 3], z_m: f64) -> Result<Option<Vec<Table>>, MapError> {
        fluxform_base::progress::poll();
        let z_m = z_m + oz;
        let requested = if self.count == 1 {
            Components::Gz
        } else {
            Components::Gradient
        };
        let farthest_m = self.radius_m + ox.hypot(oy);
        let above_m = z_m - self.source.top_m();
        let aim = self.source_tolerance;
        let Some(layout) = Layout::new(0.0, farthest_m, above_m, aim, usize::MAX) else {
            return Ok(None);
        };
        let nodes = layout.nodes();
        let heights = vec![z_m; nodes.len()];
        let values = self.source.gradients(&nodes, &heights, aim, requested)?;
        let mut tables = vec![layout.table(&values.dbz_dz)];
        if self.count > 1 {
            tables.push(layout.table(&values.dbr_dz_over_r));
            tables.push(layout.table(&values.br_over_r));
        }
        Ok(Some(tables))
    }

    /// Adds one place's share.
    fn add(
        &self,
        [ox, oy, _]: [f64; 3],
        share: f64,
        tables: &[Table],
        (radii, angles): (&[f64], &[f64]),
        sum: &mut [f64],
    ) {
        let size = angles.len() * radii.len();
        let mut distances = vec![0.0; radii.len()];
        let mut found = vec![0.0; tables.len() * radii.len()];
        for (azimuth, angle) in angles.iter().enumerate() {
            let (sine, cosine) = angle.sin_cos();
            let place_of = |radius: f64| (radius * cosine + ox, radius * sine + oy);
            for (distance, radius) in distances.iter_mut().zip(radii) {
                let (x, y) = place_of(*radius);
                *distance = (x * x + y * y).sqrt();
            }
            dispatch::run(Scattered {
                tables,
                points: &distances,
                out: &mut found,
            });
            for (place, radius) in radii.iter().enumerate() {
                let at = azimuth * radii.len() + place;
                let zz = found[place];
                sum[at] += share * zz;
                if self.count > 1 {
                    let (x, y) = place_of(*radius);
                    let square = x * x + y * y;
                    let slope = found[radii.len() + place];
                    let ratio = found[2 * radii.len() + place];
                    let turn = if square > 0.0 {
                        -(2.0 * ratio + zz) / square
                    } else {
                        0.0
                    };
                    sum[size + at] += share * (ratio + turn * x * x);
                    sum[2 * size + at] += share * turn * x * y;
                    sum[3 * size + at] += share * slope * x;
                    sum[4 * size + at] += share * slope * y;
                }
            }
        }
    }
}

/// Rows of both, [component][azimuth][radius], taken in turns: those of `first`, if it has any, before
/// those of `second`.
fn interleaved(
    first: &[f64],
    second: &[f64],
    (rows, more, radii): (usize, usize, usize),
) -> Vec<f64> {
    if rows == 0 {
        return second.to_vec();
    }
    let mut out = Vec::with_capacity(first.len() + second.len());
    let components = first.chunks_exact(rows * radii);
    for (first, second) in components.zip(second.chunks_exact(more * radii)) {
        for (a, b) in first.chunks_exact(radii).zip(second.chunks_exact(radii)) {
            out.extend_from_slice(a);
            out.extend_from_slice(b);
        }
    }
    out
}

/// Number of components that a map's means have; `None` with the field.
fn count(components: Components) -> Option<usize> {
    match components {
        Components::Gz => Some(1),
        Components::Force | Components::Gradient => Some(GRADIENT),
        Components::All => None,
    }
}

/// Fourier series in the azimuth, [component][mode][radius], modes 1, cos, sin, cos 2, sin 2 ...,
/// the last the cosine of half as many turns as there are azimuths.
fn modes(values: &[f64], azimuths: usize, radii: usize) -> Vec<f64> {
    let mut out = vec![0.0; values.len()];
    let size = azimuths * radii;
    for (values, out) in values.chunks_exact(size).zip(out.chunks_exact_mut(size)) {
        for (place, mode) in out.chunks_exact_mut(radii).enumerate() {
            let half = place == 0 || place == azimuths - 1;
            let scale = if half { 1.0 } else { 2.0 } / azimuths as f64;
            for (azimuth, row) in values.chunks_exact(radii).enumerate() {
                let angle = TAU * azimuth as f64 / azimuths as f64;
                let factor = scale * trigonometric(place, angle);
                for (sum, value) in mode.iter_mut().zip(row) {
                    *sum += factor * value;
                }
            }
        }
    }
    out
}

/// The function of the mode at `place`: 1, cos, sin, cos 2, sin 2 ...
fn trigonometric(place: usize, angle: f64) -> f64 {
    let turns = place.div_ceil(2) as f64;
    if place % 2 == 1 || place == 0 {
        (turns * angle).cos()
    } else {
        (turns * angle).sin()
    }
}

/// A grid's places about one coil's axis, ascending in the radius.
struct Places {
    order: Vec<usize>,
    radii_m: Vec<f64>,
    /// cos and sin of the azimuth.
    turns: Vec<[f64; 2]>,
}

impl Places {
    fn new(grid: &Grid, coil: &PlacedCoil) -> Self {
        let offsets: Vec<[f64; 2]> = grid
            .y_m
            .iter()
            .flat_map(|y| {
                let dy = y - coil.axis_m[1];
                grid.x_m.iter().map(move |x| [x - coil.axis_m[0], dy])
            })
            .collect();
        let radius = |place: &usize| offsets[*place][0].hypot(offsets[*place][1]);
        let mut order: Vec<usize> = (0..offsets.len()).collect();
        order.sort_by(|a, b| radius(a).total_cmp(&radius(b)));
        let turn = |place: &usize| {
            let r = radius(place);
            if r > 0.0 {
                offsets[*place].map(|d| d / r)
            } else {
                [1.0, 0.0]
            }
        };
        Self {
            radii_m: order.iter().map(radius).collect(),
            turns: order.iter().map(turn).collect(),
            order,
        }
    }
}

impl Height {
    /// The first `count` components at `places`, [component][place].
    fn at(&self, places: &Places, count: usize) -> Vec<f64> {
        let plane = places.order.len();
        let mut out = vec![0.0; count * plane];
        let mut one = vec![0.0; plane];
        // cos and sin of every number of turns, by the addition theorem.
        let most = self.azimuths / 2;
        let mut cosines = vec![vec![1.0; plane], Vec::new()];
        let mut sines = vec![vec![0.0; plane], Vec::new()];
        cosines[1] = places.turns.iter().map(|t| t[0]).collect();
        sines[1] = places.turns.iter().map(|t| t[1]).collect();
        for k in 2..=most {
            let next = |a: &dyn Fn(usize) -> f64| (0..plane).map(a).collect::<Vec<f64>>();
            let (c, s) = (&cosines, &sines);
            let cosine = next(&|i| c[k - 1][i] * c[1][i] - s[k - 1][i] * s[1][i]);
            let sine = next(&|i| s[k - 1][i] * c[1][i] + c[k - 1][i] * s[1][i]);
            cosines.push(cosine);
            sines.push(sine);
        }
        for (component, series) in self.series.iter().take(count).enumerate() {
            let out = &mut out[component * plane..(component + 1) * plane];
            for (place, table) in series {
                dispatch::run(Evaluation {
                    table,
                    points: &places.radii_m,
                    out: &mut one,
                });
                let turns = place.div_ceil(2);
                let factor = if place % 2 == 1 || *place == 0 {
                    &cosines[turns]
                } else {
                    &sines[turns]
                };
                for ((value, factor), at) in one.iter().zip(factor).zip(&places.order) {
                    out[*at] += value * factor;
                }
            }
        }
        out
    }
}
