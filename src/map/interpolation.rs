//! The error of interpolating a map between its nodes.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::tabulate::{Components, Grid, MapError, PlacedCoil, tabulate};
use fluxform_base::progress::Silent;
use fluxform_field::source::AxialSource;
use fluxform_numerics::lagrange::{self, ORDER_NODES};

/// The largest error found of a component, and at how many places it was looked for: relative to its largest value at
/// the height, or on the planes of nodes around it where nodes miss the peak and that is smaller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct InterpolationError {
    /// Relative error.
    pub largest: f64,
    /// Places, over all coils.
    pub samples: usize,
}

/// Samples find the largest error but for this factor: the cubic's error peaks within a few
/// percent of the middle of a cell, and the samples lie in the middles of cells, faces and edges.
pub const SAFETY: f64 = 1.25;

/// The relative error falls as the fourth power of the step over the height: the lowest cells
/// decide, and the highest because its stencil is one-sided.
const LOWEST: usize = 4;
const HIGHEST: usize = 1;
/// A cell at the border has so much more error of the same difference, from a one-sided stencil (see
/// [`fluxform_numerics::lagrange`]).
const BORDER: f64 = 43.0 / 24.0;
/// Most layers beside those that are looked at because the map itself changes faster there.
const FASTER: usize = 4;
/// Of an axis with so many nodes at most, quarters of cells are looked at too.
const FEW: usize = 5;

/// Direct values of one or more components of the gradient of coils on a grid, each [coil, z, y, x].
pub type Direct<'a> = &'a dyn Fn(&[PlacedCoil], &Grid) -> Result<Vec<Vec<f64>>, MapError>;

/// [`interpolation_errors_by`] of dB_z/dz for identical coils, each with `source` about its axis.
///
/// # Errors
/// See [`tabulate`].
pub fn interpolation_error(
    source: &dyn AxialSource,
    coils: &[PlacedCoil],
    grid: &Grid,
    gz: &[f64],
    tolerance: f64,
) -> Result<InterpolationError, MapError> {
    let direct = |coils: &[PlacedCoil], places: &Grid| {
        let map = tabulate(source, coils, places, Components::Gz, tolerance, &Silent)?;
        Ok(vec![map.gz_t_per_m_per_a])
    };
    let found = interpolation_errors_by(&direct, coils, grid, &[gz])?;
    Ok(found[0])
}

/// What an error at the height `z_m` is relative to: the largest value there, or on the planes of nodes around it where
/// that is smaller, since a runtime knows no other. `nodes` are their heights and the largest value of each plane.
#[must_use]
pub fn error_scale(there: f64, nodes: (&[f64], &[f64]), z_m: f64) -> f64 {
    let (heights_m, largest) = nodes;
    let near = largest[lagrange::around(heights_m, z_m)].iter();
    match near.copied().fold(0.0, f64::max) {
        near if near > 0.0 => there.min(near),
        _ => there,
    }
}

/// The middles of cells, faces and edges in the layers that decide, by how fast the map changes on the planes of
/// nodes; of a few cells their quarters too.
fn staggered(grid: &Grid, changes: &[f64]) -> [Grid; 7] {
    let [x, y, z] = [&grid.x_m, &grid.y_m, &grid.z_m];
    let middles = |nodes: &[f64]| -> Vec<f64> {
        if nodes.len() < 2 {
            return nodes.to_vec();
        }
        nodes
            .windows(2)
            .map(|pair| 0.5 * (pair[0] + pair[1]))
            .collect()
    };
    // A sideways component is zero in the middle of a cell that lies evenly about an axis, and relative to the values
    // at its height a long cell's error peaks in its upper part; of many cells others show the error.
    let inside = |nodes: &[f64]| -> Vec<f64> {
        if nodes.len() > FEW {
            return middles(nodes);
        }
        let quarters = |pair: &[f64]| [0.25, 0.5, 0.75].map(|t| pair[0] + t * (pair[1] - pair[0]));
        match nodes {
            [_] => nodes.to_vec(),
            _ => nodes.windows(2).flat_map(quarters).collect(),
        }
    };
    let layers = |heights: Vec<f64>| -> Vec<f64> {
        if z.len() <= FEW {
            return heights;
        }
        // Of planes, or of the layers between two.
        let beside = z.len() - heights.len();
        let change = |k: usize| changes[k].max(changes[k + beside]);
        let chosen = decisive(heights.len(), change);
        chosen.into_iter().map(|k| heights[k]).collect()
    };
    [
        (inside(x), inside(y), inside(z)),
        // Where the errors along two axes have the sign that the third's has not.
        (x.clone(), inside(y), inside(z)),
        (inside(x), y.clone(), inside(z)),
        (inside(x), inside(y), z.clone()),
        (inside(x), y.clone(), z.clone()),
        (x.clone(), inside(y), z.clone()),
        (x.clone(), y.clone(), inside(z)),
    ]
    .map(|(x_m, y_m, z_m)| Grid {
        x_m,
        y_m,
        z_m: layers(z_m),
    })
}

/// The lowest of so many layers and the highest, and those in which the map changes faster than in all of them.
fn decisive(count: usize, change: impl Fn(usize) -> f64) -> Vec<usize> {
    let top = count.saturating_sub(HIGHEST);
    let (mut chosen, others): (Vec<usize>, Vec<usize>) =
        (0..count).partition(|k| *k < LOWEST || *k >= top);
    let known = chosen.iter().map(|k| change(*k)).fold(0.0, f64::max);
    let mut faster: Vec<usize> = others.into_iter().filter(|k| change(*k) > known).collect();
    faster.sort_by(|a, b| change(*b).total_cmp(&change(*a)));
    chosen.extend(faster.into_iter().take(FASTER));
    chosen.sort_unstable();
    chosen
}

/// Of every plane of nodes the largest difference of as many orders as a cubic leaves out, along any axis, of one coil's
/// values: what the error of interpolation follows.
fn differences(map: &[f64], [columns, rows, planes]: [usize; 3]) -> Vec<f64> {
    let axes = [(columns, 1), (rows, columns), (planes, columns * rows)];
    let of_axis = |node: usize, (count, stride): (usize, usize)| -> f64 {
        if count < 2 {
            return 0.0;
        }
        let place = (node / stride) % count;
        let order = ORDER_NODES.min(count - 1);
        let start = place.saturating_sub(order / 2).min(count - 1 - order);
        let first = node - (place - start) * stride;
        let mut parts: [f64; ORDER_NODES + 1] = [0.0; ORDER_NODES + 1];
        for (k, part) in parts[..=order].iter_mut().enumerate() {
            *part = map[first + k * stride];
        }
        for last in (1..=order).rev() {
            for k in 0..last {
                parts[k] = parts[k + 1] - parts[k];
            }
        }
        let at_border = place < order / 2 || place + order / 2 >= count;
        if at_border {
            BORDER * parts[0].abs()
        } else {
            parts[0].abs()
        }
    };
    let of_node = |node: usize| axes.iter().map(|axis| of_axis(node, *axis)).sum::<f64>();
    let plane = columns * rows;
    let largest = |level: usize| {
        (level * plane..(level + 1) * plane)
            .map(of_node)
            .fold(0.0, f64::max)
    };
    (0..planes).map(largest).collect()
}

/// Compares interpolated components (each [coil, z, y, x] on `grid`) with direct values in the
/// middle of cells, faces and edges, in the four lowest layers, the highest and those in which the map changes faster,
/// for a few coils that differ in where their axes lie and those whose map changes fastest: an error for each component.
///
/// # Errors
/// Those of `direct`.
pub fn interpolation_errors_by(
    direct: Direct<'_>,
    coils: &[PlacedCoil],
    grid: &Grid,
    maps: &[&[f64]],
) -> Result<Vec<InterpolationError>, MapError> {
    let [x, y, z] = [&grid.x_m, &grid.y_m, &grid.z_m];
    let nodes = x.len() * y.len() * z.len();
    let plane_nodes = x.len() * y.len();
    let (watched, changes) = decisive_coils(coils, grid, maps);
    let on_nodes: Vec<Vec<f64>> = maps
        .iter()
        .map(|map| {
            let plane = |level: usize| {
                let of =
                    move |coil: &usize| &map[coil * nodes + level * plane_nodes..][..plane_nodes];
                watched.iter().flat_map(of)
            };
            let size = |level| plane(level).fold(0.0_f64, |most, value| most.max(value.abs()));
            (0..z.len()).map(size).collect()
        })
        .collect();
    let placed: Vec<PlacedCoil> = watched.iter().map(|coil| coils[*coil]).collect();
    let nothing = InterpolationError {
        largest: 0.0,
        samples: 0,
    };
    let mut all = vec![nothing; maps.len()];
    for places in staggered(grid, &changes) {
        let exact = direct(&placed, &places)?;
        let plane = places.x_m.len() * places.y_m.len();
        let stencils = |nodes: &[f64], at: &[f64]| -> Vec<lagrange::Stencil> {
            at.iter()
                .filter_map(|p| lagrange::stencil(nodes, *p))
                .collect()
        };
        let along_x = stencils(x, &places.x_m);
        let along_y = stencils(y, &places.y_m);
        let along_z = stencils(z, &places.z_m);
        let components = all.iter_mut().zip(maps).zip(&exact).zip(&on_nodes);
        for (((worst, map), exact), on_nodes) in components {
            for (k, stencil_z) in along_z.iter().enumerate() {
                let mut error = 0.0_f64;
                let mut size = 0.0_f64;
                for (place, coil) in watched.iter().enumerate() {
                    let map = &map[coil * nodes..(coil + 1) * nodes];
                    let start = (place * places.z_m.len() + k) * plane;
                    let values =
                        interpolate_plane(map, [x.len(), y.len()], stencil_z, &along_y, &along_x);
                    for (value, direct) in values.iter().zip(&exact[start..start + plane]) {
                        error = error.max((value - direct).abs());
                        size = size.max(direct.abs());
                    }
                }
                let size = error_scale(size, (z, on_nodes), places.z_m[k]);
                if size > 0.0 {
                    worst.largest = worst.largest.max(SAFETY * error / size);
                }
                worst.samples += plane * watched.len();
            }
        }
    }
    Ok(all)
}

/// The coils that are watched, and how fast the maps change on every plane of nodes, relative to the largest value there
/// or on the planes next to it.
fn decisive_coils(coils: &[PlacedCoil], grid: &Grid, maps: &[&[f64]]) -> (Vec<usize>, Vec<f64>) {
    let counts = [grid.x_m.len(), grid.y_m.len(), grid.z_m.len()];
    let plane = counts[0] * counts[1];
    let mut watched = watched(coils, grid);
    let mut changes = vec![0.0_f64; counts[2]];
    for map in maps {
        let of_coils = map.par_chunks_exact(plane * counts[2]);
        let mut all: Vec<Vec<f64>> = of_coils.map(|map| differences(map, counts)).collect();
        let size = |level: usize| {
            let planes = map.chunks_exact(plane).skip(level).step_by(counts[2]);
            let sizes = planes.flatten().map(|value| value.abs());
            sizes.fold(0.0, f64::max)
        };
        let sizes: Vec<f64> = (0..counts[2]).map(size).collect();
        for (level, largest) in changes.iter_mut().enumerate() {
            let near = &sizes[level.saturating_sub(1)..(level + 2).min(counts[2])];
            let size = near.iter().copied().fold(f64::INFINITY, f64::min);
            for of_coil in &mut all {
                of_coil[level] = if size > 0.0 {
                    of_coil[level] / size
                } else {
                    0.0
                };
                *largest = largest.max(of_coil[level]);
            }
        }
        let change = |coil: &usize| all[*coil].iter().copied().fold(0.0, f64::max);
        let fastest = (0..coils.len()).max_by(|a, b| change(a).total_cmp(&change(b)));
        let known = watched.iter().map(change).fold(0.0, f64::max);
        watched.extend(fastest.filter(|coil| change(coil) > known));
    }
    (watched, changes)
}

/// The coils nearest to the grid's centre and farthest from it, by index, and those whose axes are nearest to a node
/// of the plan and to the middle of a cell: the coils are alike, and its place decides whether its peak falls on inner
/// cells or on the border's, on nodes or between them.
fn watched(coils: &[PlacedCoil], grid: &Grid) -> Vec<usize> {
    let middle = |nodes: &[f64]| 0.5 * (nodes[0] + nodes[nodes.len() - 1]);
    let (cx, cy) = (middle(&grid.x_m), middle(&grid.y_m));
    let distance = |coil: &PlacedCoil| (coil.axis_m[0] - cx).hypot(coil.axis_m[1] - cy);
    let off_nodes = |coil: &PlacedCoil| {
        let [x, y] = coil.axis_m;
        off_node(&grid.x_m, x) + off_node(&grid.y_m, y)
    };
    // Alike but for rounding: the one that is watched already.
    let nearly = |share: f64| (share * 1e6).round();
    let least_and_most = |score: &dyn Fn(&PlacedCoil) -> f64| {
        let order = |a: &usize, b: &usize| score(&coils[*a]).total_cmp(&score(&coils[*b]));
        [
            (0..coils.len()).min_by(order),
            (0..coils.len()).max_by(order),
        ]
    };
    let ends = least_and_most(&distance).into_iter().flatten();
    let mut all: Vec<usize> = ends.collect();
    all.dedup();
    let score = |coil: &PlacedCoil| nearly(off_nodes(coil));
    for extreme in least_and_most(&score).into_iter().flatten() {
        if !all
            .iter()
            .any(|k| score(&coils[*k]) == score(&coils[extreme]))
        {
            all.push(extreme);
        }
    }
    all
}

/// How far `place` is from the nearest of `nodes`, in the cell's width: 0 on a node, 1/2 in the middle of a cell; of a
/// place beside them as if they went on.
fn off_node(nodes: &[f64], place: f64) -> f64 {
    let [.., before, last] = nodes else {
        return 0.0;
    };
    let above = nodes.partition_point(|node| *node <= place);
    let (from, width) = match (above.checked_sub(1), nodes.get(above)) {
        (Some(below), Some(next)) => (nodes[below], next - nodes[below]),
        (None, _) => (nodes[0], nodes[1] - nodes[0]),
        (Some(_), None) => (*last, last - before),
    };
    let cells = (place - from) / width;
    (cells - cells.round()).abs()
}

/// One height of a tensor-product interpolation: along z, then y, then x.
fn interpolate_plane(
    map: &[f64],
    [columns, rows]: [usize; 2],
    stencil_z: &lagrange::Stencil,
    along_y: &[lagrange::Stencil],
    along_x: &[lagrange::Stencil],
) -> Vec<f64> {
    let weighted = |out: &mut [f64], stencil: &lagrange::Stencil, source: &[f64]| {
        let length = out.len();
        for (k, weight) in stencil.weights[..stencil.count].iter().enumerate() {
            let from = (stencil.start + k) * length;
            for (value, node) in out.iter_mut().zip(&source[from..from + length]) {
                *value += weight * node;
            }
        }
    };
    let mut at_z = vec![0.0; columns * rows];
    weighted(&mut at_z, stencil_z, map);
    let mut values = Vec::with_capacity(along_y.len() * along_x.len());
    for stencil_y in along_y {
        let mut row = vec![0.0; columns];
        weighted(&mut row, stencil_y, &at_z);
        values.extend(along_x.iter().map(|stencil| {
            let near = &row[stencil.start..stencil.start + stencil.count];
            near.iter()
                .zip(&stencil.weights)
                .map(|(v, w)| v * w)
                .sum::<f64>()
        }));
    }
    values
}
