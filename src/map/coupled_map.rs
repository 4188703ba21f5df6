//! Maps of an array without symmetry: planes sampled directly, or through a harmonic table.

use serde::{Deserialize, Serialize};

use rayon::prelude::*;

use super::harmonic::{Extent, Table, kind};
use super::map_source::{GRADIENT, Sampler, five, gz, tensor};
use super::tabulate::{Components, FieldMap, Grid, MapError, PlacedCoil};
use fluxform_base::progress::Progress;

/// The field of every drive over a workspace, to a tolerance relative to the largest component
/// of the gradient (of the field) at each height.
pub struct SampledField<'a> {
    sampler: &'a dyn Sampler,
    components: Components,
    tolerance: f64,
    table: Option<Table>,
    /// How the table was made.
    pub report: TableReport,
}

/// Cost and error of a table.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct TableReport {
    /// Lowest height of the table, m; below it planes are sampled. `None` without a table.
    pub from_m: Option<f64>,
    /// Points sampled for the table and its check, over all attempts.
    pub samples: usize,
    /// Nodes along x, y, z.
    #[serde(rename = "nodes")]
    pub degrees: [usize; 3],
    /// Coefficients kept, over all drives and components.
    pub coefficients: usize,
    /// Places at which the table was compared with direct values.
    pub checks: usize,
    /// Largest difference found there, relative to the largest component at its height.
    pub certificate: f64,
}

/// The certificate must stay below this share of the tolerance: places that were not looked at
/// may be worse.
const SHARE: f64 = 0.5;
/// Share of the tolerance at which the first attempt aims.
const FIRST: f64 = 0.4;
/// Attempts to reach the tolerance; after the last, planes are sampled directly.
const ATTEMPTS: usize = 3;
/// How far below what is needed the next attempt aims.
const NEXT: f64 = 0.25;
/// Places compared on the lowest plane, and on every other.
const CHECKS: [usize; 2] = [64, 16];

impl<'a> SampledField<'a> {
    /// Prepares the field over `workspace`: a table from the height at which it needs fewer
    /// samples than the planes above it, each of which is visited `visits` times, none where it
    /// never does.
    ///
    /// # Errors
    /// The sampler's; interruption.
    pub fn new(
        sampler: &'a dyn Sampler,
        workspace: &Grid,
        components: Components,
        tolerance: f64,
        visits: usize,
        progress: &dyn Progress,
    ) -> Result<Self, MapError> {
        let mut field = Self {
            sampler,
            components,
            tolerance,
            table: None,
            report: TableReport::default(),
        };
        let mut aim = FIRST * tolerance;
        progress.begin("table", ATTEMPTS as u64);
        for _ in 0..ATTEMPTS {
            progress.check()?;
            let Some(extent) = field.worth(workspace, aim, visits) else {
                break;
            };
            let table = Table::new(sampler, extent, components, aim)?;
            progress.check()?;
            let (checks, certificate) = certify(&table, sampler, extent, components)?;
            progress.advance(1);
            let samples = field.report.samples + table.samples + checks;
            field.report.samples = samples;
            if certificate <= SHARE * tolerance {
                field.report = TableReport {
                    from_m: Some(extent.z_m[0]),
                    samples,
                    degrees: table.degrees(),
                    coefficients: table.coefficients(),
                    checks,
                    certificate,
                };
                field.table = Some(table);
                break;
            }
            aim *= NEXT * SHARE * tolerance / certificate;
        }
        progress.end();
        Ok(field)
    }

    /// The box above the plane from which on a table saves most samples.
    fn worth(&self, workspace: &Grid, aim: f64, visits: usize) -> Option<Extent> {
        let ends = |nodes: &[f64]| Some([*nodes.first()?, *nodes.last()?]);
        let (x_m, y_m) = (ends(&workspace.x_m)?, ends(&workspace.y_m)?);
        let z_m = &workspace.z_m;
        let plane = (workspace.x_m.len() * workspace.y_m.len() * visits) as f64;
        let mut best = (0.0_f64, None);
        for (k, from) in z_m.iter().enumerate() {
            if *from <= self.sampler.top_m() {
                continue;
            }
            let extent = Extent {
                x_m,
                y_m,
                z_m: [*from, z_m[z_m.len() - 1]],
            };
            let needed = Table::samples_needed(extent, self.sampler.top_m(), aim)
                + (CHECKS[0] + CHECKS[1]) as f64;
            let saved = (z_m.len() - k) as f64 * plane - needed;
            if saved > best.0 {
                best = (saved, Some(extent));
            }
        }
        best.1
    }

    /// The table, where there is one.
    #[must_use]
    pub fn table(&self) -> Option<&Table> {
        self.table.as_ref()
    }

    /// Maps of `coils`, whose numbers are the sampler's drives, over `grid` within the
    /// workspace; heights outside the table are sampled. The bytes do not depend on the number
    /// of threads if the sampler's do not.
    ///
    /// # Errors
    /// The sampler's; interruption.
    ///
    /// # Panics
    /// When a coil's number is not below the sampler's number of drives.
    pub fn map(
        &self,
        coils: &[PlacedCoil],
        grid: &Grid,
        progress: &dyn Progress,
    ) -> Result<FieldMap, MapError> {
        let (plane, heights) = (grid.x_m.len() * grid.y_m.len(), grid.z_m.len());
        let count = self.components.count();
        let place: Vec<[f64; 2]> = grid
            .y_m
            .iter()
            .flat_map(|y| grid.x_m.iter().map(|x| [*x, *y]))
            .collect();
        progress.begin("map", heights as u64);
        let direct = self.out_of_reach(grid, &place, progress)?;
        let reached: Vec<f64> = (grid.z_m.iter().zip(&direct))
            .filter_map(|(z_m, direct)| direct.is_none().then_some(*z_m))
            .collect();
        let table = (self.table.as_ref().filter(|_| !reached.is_empty()))
            .map(|table| (table, table.stencil(&grid.x_m, &grid.y_m, &reached)));
        let whole = heights * plane;
        let mut gz_out = vec![0.0; coils.len() * whole];
        let mut gradient = vec![0.0; coils.len() * whole * if count > 1 { 9 } else { 0 }];
        let mut field = vec![0.0; coils.len() * whole * if count > GRADIENT { 3 } else { 0 }];
        // One coil is one piece of work.
        let pieces: Vec<_> = pieces(&mut gz_out, coils.len())
            .into_iter()
            .zip(pieces(&mut gradient, coils.len()))
            .zip(pieces(&mut field, coils.len()))
            .zip(coils)
            .collect();
        pieces
            .into_par_iter()
            .for_each(|(((gz_out, gradient), field), coil)| {
                let first = coil.number * count;
                // [component], each [z, y, x].
                let values: Vec<Vec<f64>> = (first..first + count)
                    .into_par_iter()
                    .map(|place| {
                        let tabulated = (table.as_ref())
                            .map_or_else(Vec::new, |(table, stencil)| table.grid(place, stencil));
                        let mut tabulated = tabulated.chunks_exact(plane.max(1));
                        let mut values = Vec::with_capacity(whole);
                        for direct in &direct {
                            let found = match direct {
                                Some(all) => Some(&all[place * plane..(place + 1) * plane]),
                                None => tabulated.next(),
                            };
                            values.extend(found.into_iter().flatten().map(|v| coil.gain * v));
                        }
                        values
                    })
                    .collect();
                gz_out.copy_from_slice(&values[gz(self.components)]);
                for (at, out) in gradient.chunks_exact_mut(9).enumerate() {
                    out.copy_from_slice(&tensor(five(self.components, |c| values[c][at])));
                }
                for (at, out) in field.chunks_exact_mut(3).enumerate() {
                    for (value, component) in out.iter_mut().zip(&values[GRADIENT..]) {
                        *value = component[at];
                    }
                }
            });
        progress.end();
        Ok(FieldMap {
            x_m: grid.x_m.clone(),
            y_m: grid.y_m.clone(),
            z_m: grid.z_m.clone(),
            coils: coils.iter().map(|c| c.number).collect(),
            gz_t_per_m_per_a: gz_out,
            gradient_t_per_m_per_a: (count > 1).then_some(gradient),
            field_t_per_a: (count > GRADIENT).then_some(field),
            relative_error: self.tolerance,
            distinct_radii: 0,
            tabulated: direct.iter().any(Option::is_none),
        })
    }

    /// Samples at the nodes of the planes that the table does not reach; `None` for the others.
    fn out_of_reach(
        &self,
        grid: &Grid,
        nodes_m: &[[f64; 2]],
        progress: &dyn Progress,
    ) -> Result<Vec<Option<Vec<f64>>>, MapError> {
        let plane = |z_m: &f64| {
            progress.check()?;
            let sampled = if self.holds(grid, *z_m) {
                None
            } else {
                let points: Vec<[f64; 3]> = nodes_m.iter().map(|[x, y]| [*x, *y, *z_m]).collect();
                let series = self.sampler.drives() * self.components.count();
                let mut out = vec![0.0; series * nodes_m.len()];
                self.sampler.sample(&points, self.components, &mut out)?;
                Some(out)
            };
            progress.advance(1);
            Ok(sampled)
        };
        grid.z_m.iter().map(plane).collect()
    }

    /// Whether the table reaches the plane of `grid` at `z_m`.
    fn holds(&self, grid: &Grid, z_m: f64) -> bool {
        let within = |nodes: &[f64], [from, to]: [f64; 2]| {
            nodes.first().is_some_and(|first| *first >= from)
                && nodes.last().is_some_and(|last| *last <= to)
        };
        (self.table.as_ref()).is_some_and(|table| {
            let extent = table.extent();
            within(&grid.x_m, extent.x_m)
                && within(&grid.y_m, extent.y_m)
                && within(&[z_m], extent.z_m)
        })
    }
}

/// `values` in `count` equal pieces, empty ones where there are no values.
fn pieces(values: &mut [f64], count: usize) -> Vec<&mut [f64]> {
    if values.is_empty() {
        return (0..count).map(|_| &mut [][..]).collect();
    }
    let each = values.len() / count;
    values.chunks_exact_mut(each).collect()
}

/// Compares `table` with direct values, on its lowest and highest planes and in the middles
/// between its nodes along z: number of places, largest difference relative to the largest
/// component at the height.
fn certify(
    table: &Table,
    sampler: &dyn Sampler,
    extent: Extent,
    components: Components,
) -> Result<(usize, f64), MapError> {
    let top_m = sampler.top_m();
    let nodes = table.heights_m();
    let mut heights = vec![nodes[0]];
    let middle = |pair: &[f64]| top_m + ((pair[0] - top_m) * (pair[1] - top_m)).sqrt();
    heights.extend(nodes.windows(2).map(middle));
    heights.extend(nodes.last());
    // The plane's points differ from height to height: one sequence runs on (M. Roberts' R2).
    let mut unit = [0.5, 0.5];
    let mut next = || -> [f64; 2] {
        const STEP: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];
        unit = [0, 1].map(|i| (unit[i] + STEP[i]).fract());
        let [u, v] = unit;
        [
            extent.x_m[0] + u * (extent.x_m[1] - extent.x_m[0]),
            extent.y_m[0] + v * (extent.y_m[1] - extent.y_m[0]),
        ]
    };
    let planes: Vec<Vec<[f64; 2]>> = (0..heights.len())
        .map(|k| (0..CHECKS[usize::from(k > 0)]).map(|_| next()).collect())
        .collect();
    let points: Vec<[f64; 3]> = (planes.iter().zip(&heights))
        .flat_map(|(plane, z)| plane.iter().map(move |[x, y]| [*x, *y, *z]))
        .collect();
    let count = sampler.drives() * components.count();
    let mut exact = vec![0.0; count * points.len()];
    sampler.sample(&points, components, &mut exact)?;
    let mut certificate = 0.0_f64;
    let mut start = 0;
    for (k, (plane, z_m)) in planes.iter().zip(&heights).enumerate() {
        let mut errors = [0.0_f64; 2];
        // The field falls with height: it is no smaller here than at the next node.
        let mut sizes = table.sizes()[k.min(nodes.len() - 1)];
        let values: Vec<Vec<f64>> = (plane.par_iter())
            .map(|[x, y]| table.at([*x, *y, *z_m]))
            .collect();
        for place in 0..count {
            let kind = kind(place, components);
            let row = &exact[place * points.len() + start..][..plane.len()];
            for (direct, values) in row.iter().zip(&values) {
                let error = (direct - values[place]).abs();
                // A value that is none must not pass.
                errors[kind] = errors[kind].max(if error.is_nan() { f64::INFINITY } else { error });
                sizes[kind] = sizes[kind].max(direct.abs());
            }
        }
        for (error, size) in errors.into_iter().zip(sizes) {
            if error > 0.0 {
                certificate = certificate.max(error / size);
            }
        }
        start += plane.len();
    }
    Ok((points.len(), certificate))
}
