//! The plan area that each point of a grid stands for.
//!
//! A cell with surface at all four corners gives each of them a quarter: whole cells inside, halves
//! on the grid's border, quarters in its corners, which is the trapezoidal rule. Where the surface
//! ends within a cell, the places on the cell's sides at which it does are found by bisection; what
//! the straight line between them leaves of the cell goes to the corners that have surface. So the
//! area of a smooth silhouette converges with the second power of the spacing, as the rule does.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::height::Grid;
use fluxform_base::progress::{Interrupted, Progress};

/// Bisections of a side: to 2e-5 of it.
const BISECTIONS: u32 = 16;
/// The least that a point stands for, of a cell: no point counts for nothing.
const LEAST: f64 = 1e-6;
/// Sides between two looks at the progress.
const STRIDE: usize = 1024;

/// A side of a cell, from a node to the next along x (`false`) or y (`true`).
type Side = (usize, bool);

/// The area of every grid point, m^2, x fastest; 0 where `present` is false. Along an axis of one
/// sample, its width is taken as 1 m. `covered` states whether there is surface over a place.
///
/// # Errors
/// [`Interrupted`] when the user asked to stop.
pub(crate) fn areas_m2(
    grid: &Grid,
    present: &[bool],
    covered: &(dyn Fn([f64; 2]) -> bool + Sync),
    progress: &dyn Progress,
) -> Result<Vec<f64>, Interrupted> {
    let [columns, rows] = [grid.x_m.samples, grid.y_m.samples];
    let ends = ends(grid, present, covered, progress)?;
    let step = |samples: usize, width: f64| match samples {
        1 => 1.0,
        more => width / (more - 1) as f64,
    };
    let cell_m2 =
        step(columns, grid.x_m.to - grid.x_m.from) * step(rows, grid.y_m.to - grid.y_m.from);
    let mut areas = vec![0.0; present.len()];
    // The part of a side that has surface, from its corner that does.
    let part = |side: Side| ends.get(&side).copied().unwrap_or(1.0);
    for j in 0..rows.max(2) - 1 {
        fluxform_base::progress::poll();
        for i in 0..columns.max(2) - 1 {
            let first = j * columns + i;
            if columns == 1 || rows == 1 {
                let along_y = columns == 1;
                if present.len() > 1 {
                    let second = first + if along_y { columns } else { 1 };
                    share_line(&mut areas, present, [first, second], part((first, along_y)));
                }
                continue;
            }
            // Around the cell, each corner followed by the side to the next.
            let corners = [first, first + 1, first + columns + 1, first + columns];
            let sides = [
                (first, false),
                (first + 1, true),
                (first + columns, false),
                (first, true),
            ];
            share_cell(&mut areas, present, corners, sides.map(part));
        }
    }
    if present.len() == 1 {
        areas[0] = 1.0;
    }
    for (area, present) in areas.iter_mut().zip(present) {
        *area = if *present {
            area.max(LEAST) * cell_m2
        } else {
            0.0
        };
    }
    Ok(areas)
}

/// Gives a line's covered part to its ends.
fn share_line(areas: &mut [f64], present: &[bool], ends: [usize; 2], part: f64) {
    match ends.map(|end| present[end]) {
        [true, true] => ends.iter().for_each(|&end| areas[end] += 0.5),
        [true, false] => areas[ends[0]] += part,
        [false, true] => areas[ends[1]] += part,
        [false, false] => {}
    }
}

/// Gives the covered part of a cell to its corners with surface; corners and sides go around it.
fn share_cell(areas: &mut [f64], present: &[bool], corners: [usize; 4], parts: [f64; 4]) {
    let has = corners.map(|corner| present[corner]);
    let before = |k: usize| parts[(k + 3) % 4];
    match has.iter().filter(|has| **has).count() {
        0 => {}
        4 => corners.iter().for_each(|&corner| areas[corner] += 0.25),
        3 => {
            let absent = has.iter().position(|has| !has).unwrap_or(0);
            let cut = 0.5 * (1.0 - parts[absent]) * (1.0 - before(absent));
            for (corner, _) in corners.iter().zip(has).filter(|(_, has)| *has) {
                areas[*corner] += (1.0 - cut) / 3.0;
            }
        }
        2 if has[0] != has[2] => {
            // Two neighbours: what the line between the two ends leaves is a trapezium.
            let mixed = (0..4).filter(|&k| has[k] != has[(k + 1) % 4]);
            let area = 0.5 * mixed.map(|k| parts[k]).sum::<f64>();
            for (corner, _) in corners.iter().zip(has).filter(|(_, has)| *has) {
                areas[*corner] += 0.5 * area;
            }
        }
        // One corner, or two across: a triangle each.
        _ => {
            for k in (0..4).filter(|&k| has[k]) {
                areas[corners[k]] += 0.5 * parts[k] * before(k);
            }
        }
    }
}

/// Of every side with surface at one end alone, how far from that end it goes, as a part of it.
fn ends(
    grid: &Grid,
    present: &[bool],
    covered: &(dyn Fn([f64; 2]) -> bool + Sync),
    progress: &dyn Progress,
) -> Result<HashMap<Side, f64>, Interrupted> {
    let columns = grid.x_m.samples;
    let mut mixed: Vec<(Side, [usize; 2])> = Vec::new();
    for k in 0..present.len() {
        if (k + 1) % columns != 0 && present[k] != present[k + 1] {
            mixed.push(((k, false), [k, k + 1]));
        }
        if k + columns < present.len() && present[k] != present[k + columns] {
            mixed.push(((k, true), [k, k + columns]));
        }
    }
    let place = |k: usize| [grid.x_m.node(k % columns), grid.y_m.node(k / columns)];
    let parts: Result<Vec<(Side, f64)>, Interrupted> = mixed
        .par_iter()
        .enumerate()
        .map(|(index, &(side, [a, b]))| {
            if index % STRIDE == 0 {
                progress.check()?;
            }
            fluxform_base::progress::poll();
            let (from, to) = if present[a] {
                (place(a), place(b))
            } else {
                (place(b), place(a))
            };
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                let at = [0, 1].map(|axis| from[axis] + middle * (to[axis] - from[axis]));
                if covered(at) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            // A surface that ends at the node itself goes nowhere from it.
            let part = if low == 0.0 { 0.0 } else { 0.5 * (low + high) };
            Ok((side, part))
        })
        .collect();
    Ok(parts?.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_base::progress::Silent;
    use fluxform_numerics::axis::Axis;

    fn grid(samples: [usize; 2]) -> Grid {
        let axis = |from, to, samples| Axis { from, to, samples };
        Grid {
            x_m: axis(-0.061, 0.058, samples[0]),
            y_m: axis(-0.057, 0.063, samples[1]),
        }
    }

    fn areas(grid: &Grid, covered: impl Fn([f64; 2]) -> bool + Sync) -> Vec<f64> {
        let columns = grid.x_m.samples;
        let present: Vec<bool> = (0..grid.len())
            .map(|k| covered([grid.x_m.node(k % columns), grid.y_m.node(k / columns)]))
            .collect();
        areas_m2(grid, &present, &covered, &Silent).unwrap()
    }

    #[test]
    fn a_whole_grid_has_the_trapezoidal_rule() {
        let grid = grid([5, 4]);
        let areas = areas(&grid, |_| true);
        let cell = (0.119 / 4.0) * (0.12 / 3.0);
        for (k, area) in areas.iter().enumerate() {
            let part = |at: usize, count: usize| if at == 0 || at + 1 == count { 0.5 } else { 1.0 };
            let expected = cell * part(k % 5, 5) * part(k / 5, 4);
            assert!((area / expected - 1.0).abs() < 1e-12, "{k}");
        }
        let line = areas_m2(&self::grid([7, 1]), &[true; 7], &|_| true, &Silent).unwrap();
        assert!((line.iter().sum::<f64>() / 0.119 - 1.0).abs() < 1e-12);
        assert!((line[0] / line[3] - 0.5).abs() < 1e-12);
    }

    /// A rectangle's sides between the nodes are met to the bisection, a disc's rim and what a
    /// function on it sums up to with the second power of the spacing.
    #[test]
    fn silhouettes_converge_with_the_second_power() {
        let coarse = grid([23, 19]);
        let rectangle = |p: [f64; 2]| p[0].abs() <= 0.0371 && p[1].abs() <= 0.0293;
        let area: f64 = areas(&coarse, rectangle).iter().sum();
        // The corners' notch is a triangle each: half a cell at most.
        assert!(
            (area / (4.0 * 0.0371 * 0.0293) - 1.0).abs() < 8e-3,
            "{area}"
        );
        let radius_m = 0.0437;
        let disc = |p: [f64; 2]| p[0].hypot(p[1]) <= radius_m;
        let error = |n: usize| {
            let grid = grid([n, n]);
            let sum: f64 = areas(&grid, disc).iter().sum();
            (sum / (std::f64::consts::PI * radius_m * radius_m) - 1.0).abs()
        };
        let [a, b, c] = [21, 81, 321].map(error);
        assert!(a < 8e-3 && b < a / 8.0 && c < b / 8.0, "{a} {b} {c}");
    }
}
