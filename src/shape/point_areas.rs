//! The plan area that each point of a grid stands for, and the cells in which points are too few.
//!
//! A cell with surface at all four corners gives each of them a quarter: whole cells inside, halves
//! on the grid's border, quarters in its corners, which is the trapezoidal rule. Where the surface
//! ends within a cell, the places on the cell's sides at which it does are found by bisection; what
//! the straight line between them leaves of the cell goes to the corners that have surface. So the
//! area of a smooth silhouette converges with the second power of the spacing, as the rule does.
//!
//! Where the surface ends or breaks within a cell, its corners alone describe it badly, and no choice
//! among the points shows how badly. Such cells are divided into
//! `FINER` x `FINER` finer ones.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::height::Grid;
use fluxform_base::progress::{Interrupted, Progress};
use fluxform_numerics::axis::Axis;

/// Divisions of either side of a cell that is not smooth.
const FINER: usize = 4;
/// Cells that are sampled, at most: those that depart most from their corners.
const MOST_CELLS: usize = 4096;
/// A cell is smooth whose middle departs by less than this share of its height from its corners' mean.
const SMOOTH: f64 = 1e-3;
/// Bisections of a side: to 2e-5 of it.
const BISECTIONS: u32 = 16;
/// The least that a point stands for, of a cell: no point counts for nothing.
const LEAST: f64 = 1e-6;
/// Sides between two looks at the progress.
const STRIDE: usize = 1024;

/// A side of a cell, from a node to the next along x (`false`) or y (`true`).
type Side = (usize, bool);

/// What there is over a place: its height, m.
pub type HeightAt<'a> = &'a (dyn Fn([f64; 2]) -> Option<f64> + Sync);

/// Cells of a grid whose corners describe the surface badly, sampled on finer places; columns of equal
/// length.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FineCells {
    /// Whether each cell, x fastest, is left to its corners; empty where all are.
    pub smooth: Vec<bool>,
    /// x of each sample, m.
    pub x_m: Vec<f64>,
    /// y of each sample, m.
    pub y_m: Vec<f64>,
    /// Height of each sample, m.
    pub height_m: Vec<f64>,
    /// Plan area that each sample stands for, m^2.
    pub area_m2: Vec<f64>,
    /// The same where every second sample along both axes stands for the cell; 0 for the others.
    pub coarse_area_m2: Vec<f64>,
    /// Plan area that each point of the grid stands for in smooth cells alone, m^2, >= 0.
    pub point_area_m2: Vec<f64>,
}

/// The area of every grid point, m^2, x fastest; 0 where `heights_m` has none. Along an axis of one
/// sample, its width is taken as 1 m. `height_at` is the surface between the points.
///
/// # Errors
/// [`Interrupted`] when the user asked to stop.
pub fn areas_m2(
    grid: &Grid,
    heights_m: &[Option<f64>],
    height_at: HeightAt,
    progress: &dyn Progress,
) -> Result<(Vec<f64>, FineCells), Interrupted> {
    let mut areas = vec![0.0; heights_m.len()];
    let broken = broken_cells(grid, heights_m, height_at, progress)?;
    let mut fine = FineCells::default();
    if !broken.is_empty() {
        fine.smooth = vec![true; (grid.x_m.samples - 1) * (grid.y_m.samples - 1)];
        fine.point_area_m2 = vec![0.0; heights_m.len()];
        for &cell in &broken {
            fine.smooth[cell] = !fine.sample(grid, cell, height_at, progress)?;
        }
    }
    let shares = Shares::new(grid, heights_m, height_at, progress)?;
    shares.each(|cell, points, shares| {
        for (point, share) in points.iter().zip(shares) {
            areas[*point] += share;
            if fine.smooth.get(cell).is_some_and(|smooth| *smooth) {
                fine.point_area_m2[*point] += share;
            }
        }
    });
    shares.keep_all(&mut areas);
    Ok((areas, fine))
}

impl FineCells {
    /// Samples a cell on the nodes of a finer grid; `false` where none has surface.
    fn sample(
        &mut self,
        grid: &Grid,
        cell: usize,
        height_at: HeightAt,
        progress: &dyn Progress,
    ) -> Result<bool, Interrupted> {
        let across = grid.x_m.samples - 1;
        let part = |axis: Axis, node: usize| Axis {
            from: axis.node(node),
            to: axis.node(node + 1),
            samples: FINER + 1,
        };
        let finer = Grid {
            x_m: part(grid.x_m, cell % across),
            y_m: part(grid.y_m, cell / across),
        };
        let nodes = (0..finer.len()).map(|k| [k % (FINER + 1), k / (FINER + 1)]);
        let places: Vec<[f64; 2]> = nodes
            .clone()
            .map(|[i, j]| [finer.x_m.node(i), finer.y_m.node(j)])
            .collect();
        let heights_m: Vec<Option<f64>> = places.iter().map(|place| height_at(*place)).collect();
        let mut areas = vec![0.0; finer.len()];
        let shares = Shares::new(&finer, &heights_m, height_at, progress)?;
        shares.each(|_, points, shares| {
            points
                .iter()
                .zip(shares)
                .for_each(|(point, share)| areas[*point] += share);
        });
        shares.keep_all(&mut areas);
        let total: f64 = areas.iter().sum();
        let is_even = |k: usize| {
            [k % (FINER + 1), k / (FINER + 1)]
                .iter()
                .all(|at| at.is_multiple_of(2))
        };
        let of_even: f64 = (0..areas.len())
            .filter(|k| is_even(*k))
            .map(|k| areas[k])
            .sum();
        for (k, height_m) in heights_m.iter().enumerate() {
            let Some(height_m) = height_m else { continue };
            self.x_m.push(places[k][0]);
            self.y_m.push(places[k][1]);
            self.height_m.push(*height_m);
            self.area_m2.push(areas[k]);
            self.coarse_area_m2.push(match is_even(k) {
                _ if of_even == 0.0 => areas[k],
                true => areas[k] * total / of_even,
                false => 0.0,
            });
        }
        Ok(total > 0.0)
    }
}

/// What each cell of a grid gives its corners.
struct Shares<'a> {
    grid: &'a Grid,
    present: Vec<bool>,
    ends: HashMap<Side, f64>,
    cell_m2: f64,
}

impl<'a> Shares<'a> {
    fn new(
        grid: &'a Grid,
        heights_m: &[Option<f64>],
        height_at: HeightAt,
        progress: &dyn Progress,
    ) -> Result<Self, Interrupted> {
        let present: Vec<bool> = heights_m.iter().map(Option::is_some).collect();
        let step = |axis: Axis| match axis.samples {
            1 => 1.0,
            more => (axis.to - axis.from) / (more - 1) as f64,
        };
        Ok(Self {
            ends: ends(grid, &present, &|p| height_at(p).is_some(), progress)?,
            grid,
            present,
            cell_m2: step(grid.x_m) * step(grid.y_m),
        })
    }

    /// Calls `take` with every cell, its corners, and the area that each gets, m^2; of a grid of one row
    /// or column with every side and its ends.
    fn each(&self, mut take: impl FnMut(usize, &[usize], &[f64])) {
        let [columns, rows] = [self.grid.x_m.samples, self.grid.y_m.samples];
        // The part of a side that has surface, from its corner that does.
        let part = |side: Side| self.ends.get(&side).copied().unwrap_or(1.0);
        let has = |point: usize| self.present[point];
        if columns == 1 || rows == 1 {
            let along_y = columns == 1;
            for first in 0..(columns * rows).saturating_sub(1) {
                let ends = [first, first + 1];
                let shares = line_shares(ends.map(has), part((first, along_y)));
                take(first, &ends, &shares.map(|share| share * self.cell_m2));
            }
            return;
        }
        for j in 0..rows - 1 {
            fluxform_base::progress::poll();
            for i in 0..columns - 1 {
                let first = j * columns + i;
                // Around the cell, each corner followed by the side to the next.
                let corners = [first, first + 1, first + columns + 1, first + columns];
                let sides = [
                    (first, false),
                    (first + 1, true),
                    (first + columns, false),
                    (first, true),
                ];
                let shares = cell_shares(corners.map(has), sides.map(part));
                let cell = j * (columns - 1) + i;
                take(cell, &corners, &shares.map(|share| share * self.cell_m2));
            }
        }
    }

    /// Sees to it that every point with surface stands for some, and a point alone for 1 m^2.
    fn keep_all(&self, areas: &mut [f64]) {
        for (area, present) in areas.iter_mut().zip(&self.present) {
            if *present {
                *area = area.max(LEAST * self.cell_m2);
            }
        }
        if let [area] = areas {
            *area = 1.0;
        }
    }
}

/// The cells in which the surface ends or departs from its corners, ascending: of too many those that
/// depart most.
fn broken_cells(
    grid: &Grid,
    heights_m: &[Option<f64>],
    height_at: HeightAt,
    progress: &dyn Progress,
) -> Result<Vec<usize>, Interrupted> {
    let [columns, rows] = [grid.x_m.samples, grid.y_m.samples];
    let across = columns.saturating_sub(1);
    let departs = |cell: usize| {
        let first = cell / across * columns + cell % across;
        let corners = [first, first + 1, first + columns, first + columns + 1];
        let known = corners.map(|corner| heights_m[corner]);
        match known.iter().flatten().count() {
            0 => 0.0,
            4 => {
                let mean = 0.25 * known.iter().flatten().sum::<f64>();
                let middle = [(grid.x_m, cell % across), (grid.y_m, cell / across)]
                    .map(|(axis, node)| 0.5 * (axis.node(node) + axis.node(node + 1)));
                height_at(middle).map_or(0.0, |height| ((height - mean) / mean).abs())
            }
            _ => f64::INFINITY,
        }
    };
    let cells = 0..across * rows.saturating_sub(1);
    let mut broken: Vec<(usize, f64)> = cells
        .into_par_iter()
        .map(|cell| {
            if cell % STRIDE == 0 {
                progress.check()?;
            }
            fluxform_base::progress::poll();
            Ok((cell, departs(cell)))
        })
        .filter(|found| !found.as_ref().is_ok_and(|(_, by)| *by <= SMOOTH))
        .collect::<Result<_, Interrupted>>()?;
    if broken.len() > MOST_CELLS {
        broken.sort_by(|(a, by_a), (b, by_b)| by_b.total_cmp(by_a).then(a.cmp(b)));
        broken.truncate(MOST_CELLS);
        broken.sort_by_key(|(cell, _)| *cell);
    }
    Ok(broken.into_iter().map(|(cell, _)| cell).collect())
}

/// The covered part of a line that each end with surface gets.
fn line_shares(has: [bool; 2], part: f64) -> [f64; 2] {
    match has {
        [true, true] => [0.5, 0.5],
        [true, false] => [part, 0.0],
        [false, true] => [0.0, part],
        [false, false] => [0.0, 0.0],
    }
}

/// The covered part of a cell that each corner with surface gets; corners and sides go around it.
fn cell_shares(has: [bool; 4], parts: [f64; 4]) -> [f64; 4] {
    let before = |k: usize| parts[(k + 3) % 4];
    let each = |share: f64| has.map(|has| if has { share } else { 0.0 });
    match has.iter().filter(|has| **has).count() {
        0 => [0.0; 4],
        4 => [0.25; 4],
        3 => {
            let absent = has.iter().position(|has| !has).unwrap_or(0);
            each((1.0 - 0.5 * (1.0 - parts[absent]) * (1.0 - before(absent))) / 3.0)
        }
        2 if has[0] != has[2] => {
            // Two neighbours: what the line between the two ends leaves is a trapezium.
            let mixed = (0..4).filter(|&k| has[k] != has[(k + 1) % 4]);
            each(0.25 * mixed.map(|k| parts[k]).sum::<f64>())
        }
        // One corner, or two across: a triangle each.
        _ => std::array::from_fn(|k| {
            if has[k] {
                0.5 * parts[k] * before(k)
            } else {
                0.0
            }
        }),
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

    fn grid(samples: [usize; 2]) -> Grid {
        let axis = |from, to, samples| Axis { from, to, samples };
        Grid {
            x_m: axis(-0.061, 0.058, samples[0]),
            y_m: axis(-0.057, 0.063, samples[1]),
        }
    }

    fn both(
        grid: &Grid,
        height_at: impl Fn([f64; 2]) -> Option<f64> + Sync,
    ) -> (Vec<f64>, FineCells) {
        let columns = grid.x_m.samples;
        let heights: Vec<Option<f64>> = (0..grid.len())
            .map(|k| height_at([grid.x_m.node(k % columns), grid.y_m.node(k / columns)]))
            .collect();
        areas_m2(grid, &heights, &height_at, &Silent).unwrap()
    }

    fn areas(grid: &Grid, covered: impl Fn([f64; 2]) -> bool + Sync) -> Vec<f64> {
        both(grid, |p| covered(p).then_some(0.05)).0
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
        let line = self::areas(&self::grid([7, 1]), |_| true);
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

    /// A cap on a plate that ends: samples and smooth cells together have the area of all points, and
    /// what they sum up to is closer to the integral.
    #[test]
    fn broken_cells_are_sampled_with_the_area_that_they_have() {
        let cap = |p: [f64; 2]| {
            let inside = 0.03_f64.powi(2) - p[0] * p[0] - p[1] * p[1];
            (p[0] + 0.3 * p[1] <= 0.041).then(|| 0.04 + inside.max(0.0).sqrt())
        };
        let sums = |n: usize| {
            let (areas, fine) = both(&grid([n, n]), cap);
            assert!(fine.smooth.iter().any(|smooth| !smooth));
            let refined: f64 = fine.area_m2.iter().chain(&fine.point_area_m2).sum();
            assert!((refined / areas.iter().sum::<f64>() - 1.0).abs() < 3e-3);
            let both = [&fine.coarse_area_m2, &fine.area_m2];
            let [coarse, all] = both.map(|areas| areas.iter().sum::<f64>());
            assert!((coarse / all - 1.0).abs() < 1e-12);
            let grid = grid([n, n]);
            let at = |k: usize| cap([grid.x_m.node(k % n), grid.y_m.node(k / n)]).unwrap_or(0.0);
            let of_points = |areas: &[f64]| -> f64 {
                areas.iter().enumerate().map(|(k, area)| area * at(k)).sum()
            };
            let of_samples: f64 = fine
                .area_m2
                .iter()
                .zip(&fine.height_m)
                .map(|(a, h)| a * h)
                .sum();
            [
                of_points(&areas),
                of_points(&fine.point_area_m2) + of_samples,
            ]
        };
        let truth = sums(1281)[1];
        let [mut plain, mut refined] = [0.0_f64; 2];
        for n in [19, 25, 33, 41, 52, 62] {
            let errors = sums(n).map(|sum| (sum / truth - 1.0).abs());
            plain = plain.hypot(errors[0]);
            refined = refined.hypot(errors[1]);
        }
        assert!(refined < 0.5 * plain, "{plain} {refined}");
        let (_, smooth) = both(&grid([20, 20]), |p| Some(0.05 + 0.1 * p[0]));
        assert_eq!(smooth, FineCells::default());
    }
}
