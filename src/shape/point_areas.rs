//! The plan area that each point of a grid stands for, and the cells in which points are too few.
//!
//! A cell with surface at all four corners gives each of them a quarter: whole cells inside, halves
//! on the grid's border, quarters in its corners, which is the trapezoidal rule. Where the surface
//! ends within a cell, the places on the cell's sides at which it does are found by bisection; what
//! the straight line between them leaves of the cell goes to the corners that have surface. So the
//! area of a smooth silhouette converges with the second power of the spacing, as the rule does.
//!
//! Where the surface ends or breaks within a cell, its corners alone describe it badly, and no choice
//! among the points shows how badly. Such cells are quartered, and their quarters, until the corners do; so are
//! those that have surface at no corner, and those over which a part rises or falls between the corners.

mod quarters;

use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::quarters::{CellSamples, Part, cell_samples};
use crate::deviation::Lattice;
use crate::height::Grid;
use fluxform_base::progress::{Interrupted, Progress};
use fluxform_numerics::axis::Axis;
use fluxform_numerics::random::Random;

/// How often a cell that is not smooth is quartered: at most, and where that gives too many samples at least.
const DEPTHS: std::ops::RangeInclusive<u32> = 2..=4;
/// Samples at most, if more quarters give more.
const MOST_SAMPLES: usize = 65_536;
/// Triangles that the looks at all samples may be compared with, about: some seconds of one core. Where so many
/// lie over each other that even the fewest samples meet more, cells are left to their corners.
const MOST_MET: usize = 1 << 26;
/// Looks that a cell takes at least, about: the corners of its quarters, doubled by every further quartering.
const LEAST_LOOKS: usize = 9;
/// Cells that are sampled, at most.
const MOST_CELLS: usize = 4096;
/// Of cells with surface at all corners, the fewest that stand for more of them: the mean of fewer is less sure
/// than the corners.
const FEWEST_CHOSEN: usize = 1024;
/// A cell of the grid is smooth whose middle departs by less than this share of its height from its corners' mean.
pub const SMOOTH: f64 = 4e-3;
/// Bisections of a side: to 2e-5 of it.
const BISECTIONS: u32 = 16;
/// The least that a point stands for, of a cell: no point counts for nothing.
pub(super) const LEAST: f64 = 1e-6;
/// Sides between two looks at the progress.
const STRIDE: usize = 1024;

/// A side of a cell, from a node to the next along x (`false`) or y (`true`).
type Side = (usize, bool);

/// The surface over a place.
#[derive(Clone, Copy)]
pub struct Over<'a> {
    /// Its height, m.
    pub height_m: &'a (dyn Fn([f64; 2]) -> Option<f64> + Sync),
    /// Whether it has one: that is sooner known.
    pub covers: &'a (dyn Fn([f64; 2]) -> bool + Sync),
    /// How many triangles a look at it compares the place with.
    pub near: &'a (dyn Fn([f64; 2]) -> usize + Sync),
    /// A mesh's faces over each cell; `None`: only the cells' corners and middles are known.
    pub lattice: Option<&'a Lattice<'a>>,
}

impl Over<'_> {
    /// Whether a cell without surface at its corners has some all the same.
    fn misses(&self, cell: usize) -> bool {
        (self.lattice).is_some_and(|lattice| lattice.standing(cell).is_some())
    }

    /// By how much the surface rises above what lies between the corners of a cell, m.
    fn rise_m(&self, cell: usize) -> f64 {
        self.lattice.map_or(0.0, |lattice| lattice.rise_m(cell))
    }

    /// Whether it lies below that by more than `by_m` somewhere, or has gaps.
    fn falls(&self, cell: usize, by_m: f64) -> bool {
        self.lattice
            .is_some_and(|lattice| lattice.fallen_m2(cell, by_m) > 0.0)
    }

    /// All that covers a missed cell as one sample, for want of effort; none of other cells.
    fn missed_whole(&self, cell: usize) -> CellSamples {
        let whole = self.lattice.and_then(|lattice| {
            let standing = lattice.standing(cell)?;
            let height_m = (self.height_m)(standing.at_m)?;
            let part = Part::of(standing, height_m);
            Some((part, [part.area_m2; 2]))
        });
        whole.into_iter().collect()
    }
}

/// Cells of a grid whose corners describe the surface badly, sampled on finer places; columns of equal
/// length.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FineCells {
    /// Whether each cell, x fastest, is left to its corners; empty where all are.
    pub smooth: Vec<bool>,
    /// x of each sample, m.
    pub x_m: Vec<f64>,
    /// y of each sample, m.
    pub y_m: Vec<f64>,
    /// Height of each sample, m.
    pub height_m: Vec<f64>,
    /// Unit normal of each sample, n_z >= 0.
    pub normal: Vec<[f64; 3]>,
    /// Normal of the other face, of each sample on a crease.
    pub crease: Vec<Option<[f64; 3]>>,
    /// Plan area that each sample stands for, m^2.
    pub area_m2: Vec<f64>,
    /// The same with one quartering less; 0 for the samples that this leaves out.
    pub coarse_area_m2: Vec<f64>,
    /// Of each sample the rank of its cell among those chosen to stand for others too, if it is one of them.
    pub stand_in: Vec<Option<u32>>,
    /// Plan area that each point of the grid stands for in smooth cells alone, m^2, >= 0.
    pub point_area_m2: Vec<f64>,
}

/// The area of every grid point, m^2, x fastest; 0 where `heights_m` has none. Along an axis of one
/// sample, its width is taken as 1 m. `surface` is that between the points.
///
/// # Errors
/// [`Interrupted`] when the user asked to stop.
pub fn areas_m2(
    grid: &Grid,
    heights_m: &[Option<f64>],
    surface: Over,
    progress: &dyn Progress,
) -> Result<(Vec<f64>, FineCells), Interrupted> {
    let mut areas = vec![0.0; heights_m.len()];
    let Broken {
        cells,
        left,
        thinned,
    } = broken_cells(grid, heights_m, surface, progress)?;
    let mut fine = FineCells::default();
    if !cells.is_empty() {
        fine.smooth = vec![true; (grid.x_m.samples - 1) * (grid.y_m.samples - 1)];
        fine.point_area_m2 = vec![0.0; heights_m.len()];
        let mut all = sampled(grid, &cells, surface, progress)?;
        // Surface that no point stands for is never left out.
        let left = if all.is_empty() { cells } else { left };
        if !all.is_empty() {
            thinned
                .all
                .iter()
                .for_each(|cell| fine.smooth[*cell] = false);
        }
        let is_missed = |cell: &usize| {
            corners_of(grid, *cell)
                .iter()
                .all(|k| heights_m[*k].is_none())
        };
        let left = left.into_iter().filter(is_missed);
        all.extend(left.map(|cell| (cell, surface.missed_whole(cell))));
        for (cell, samples) in all {
            fine.smooth[cell] = samples.is_empty();
            let stand_in = thinned.rank(cell);
            let scale = stand_in.map_or(1.0, |_| thinned.scale());
            for (part, [area_m2, coarse_area_m2]) in samples {
                fine.x_m.push(part.at_m[0]);
                fine.y_m.push(part.at_m[1]);
                fine.height_m.push(part.height_m);
                fine.area_m2.push(scale * area_m2);
                fine.coarse_area_m2.push(scale * coarse_area_m2);
                fine.stand_in.push(stand_in);
            }
        }
    }
    let shares = Shares::new(grid, heights_m, surface, progress)?;
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

/// The samples of every broken cell, as finely divided as their number allows.
fn sampled(
    grid: &Grid,
    broken: &[usize],
    surface: Over,
    progress: &dyn Progress,
) -> Result<Vec<(usize, CellSamples)>, Interrupted> {
    let middle = |cell: &usize| {
        let across = grid.x_m.samples - 1;
        let between = |axis: Axis, node: usize| 0.5 * (axis.node(node) + axis.node(node + 1));
        [
            between(grid.x_m, cell % across),
            between(grid.y_m, cell / across),
        ]
    };
    let near: usize = broken.iter().map(|cell| (surface.near)(middle(cell))).sum();
    for depth in DEPTHS.rev() {
        // What is sure to be too much is not begun.
        if (near * LEAST_LOOKS) << (depth - 1) > MOST_MET {
            continue;
        }
        let most = if depth > *DEPTHS.start() {
            MOST_SAMPLES
        } else {
            usize::MAX
        };
        let (so_far, met) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let within = || so_far.load(Relaxed) <= most && met.load(Relaxed) <= MOST_MET;
        // `None` where there are too many by then: the cells are divided again.
        let of_cell = |cell: &usize| {
            fluxform_base::progress::poll();
            within().then(|| {
                let (samples, triangles) = cell_samples(grid, *cell, depth, surface);
                so_far.fetch_add(samples.len(), Relaxed);
                met.fetch_add(triangles, Relaxed);
                (*cell, samples)
            })
        };
        let all: Option<Vec<_>> = broken.par_iter().map(of_cell).collect();
        progress.check()?;
        if let Some(all) = all.filter(|_| within()) {
            return Ok(all);
        }
    }
    Ok(Vec::new())
}

fn along(from: [f64; 2], to: [f64; 2], part: f64) -> [f64; 2] {
    [0, 1].map(|axis| from[axis] + part * (to[axis] - from[axis]))
}

/// How far from `from`, which has surface, to `to`, which has none, the surface goes, as a part of that side.
fn covered_part(
    from: [f64; 2],
    to: [f64; 2],
    covered: &dyn Fn([f64; 2]) -> bool,
    bisections: u32,
) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..bisections {
        let middle = 0.5 * (low + high);
        if covered(along(from, to, middle)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    // A surface that ends at the node itself goes nowhere from it.
    if low == 0.0 { 0.0 } else { 0.5 * (low + high) }
}

/// The part of a rectangle that is covered, by its corners one after the other around it, where the
/// surface's border meets each side once at most.
pub(super) fn covered_share(corners: [[f64; 2]; 4], covered: &dyn Fn([f64; 2]) -> bool) -> f64 {
    let has = corners.map(covered);
    let part = |k: usize| {
        let next = (k + 1) % 4;
        let side =
            |from: usize, to: usize| covered_part(corners[from], corners[to], covered, BISECTIONS);
        match [has[k], has[next]] {
            [true, false] => side(k, next),
            [false, true] => side(next, k),
            _ => 1.0,
        }
    };
    cell_shares(has, [0, 1, 2, 3].map(part)).iter().sum()
}

/// The share of each cell of a grid that its corners get.
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
        surface: Over,
        progress: &dyn Progress,
    ) -> Result<Self, Interrupted> {
        let present: Vec<bool> = heights_m.iter().map(Option::is_some).collect();
        let step = |axis: Axis| match axis.samples {
            1 => 1.0,
            more => (axis.to - axis.from) / (more - 1) as f64,
        };
        Ok(Self {
            ends: ends(grid, &present, surface.covers, progress)?,
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

/// The corners of a cell of a grid, x fastest.
fn corners_of(grid: &Grid, cell: usize) -> [usize; 4] {
    let columns = grid.x_m.samples;
    let first = cell / (columns - 1) * columns + cell % (columns - 1);
    [first, first + 1, first + columns, first + columns + 1]
}

/// The cells in which the surface ends or departs from its corners.
struct Broken {
    /// Those that are sampled, ascending.
    cells: Vec<usize>,
    /// Those in which it ends beyond [`MOST_CELLS`].
    left: Vec<usize>,
    /// Of those with surface at all corners, too many to be sampled.
    thinned: Thinned,
}

/// Cells of which some stand for all. How far a cell departs has no part in the choice: the errors of their corners
/// are of either sign, and what is mended of one sign alone is worse than nothing.
#[derive(Default)]
struct Thinned {
    /// Ascending; none where every cell is sampled.
    all: Vec<usize>,
    /// Those that are sampled, ascending.
    chosen: Vec<usize>,
}

impl Thinned {
    /// One at random out of each of `count` runs of the cells, since what breaks them may repeat.
    fn new(all: Vec<usize>, count: usize) -> Self {
        let mut random = Random::new(1);
        let start = |run: usize| run * all.len() / count;
        let chosen = (0..count).map(|run| {
            let (from, to) = (start(run), start(run + 1));
            let place = (random.between(0.0, 1.0) * (to - from) as f64) as usize;
            all[from + place.min(to - from - 1)]
        });
        Self {
            chosen: chosen.collect(),
            all,
        }
    }

    /// The rank of a cell among those that are sampled.
    fn rank(&self, cell: usize) -> Option<u32> {
        let found = self.chosen.binary_search(&cell).ok()?;
        u32::try_from(found).ok()
    }

    /// The cells that a sampled one stands for.
    fn scale(&self) -> f64 {
        self.all.len() as f64 / self.chosen.len() as f64
    }
}

fn broken_cells(
    grid: &Grid,
    heights_m: &[Option<f64>],
    surface: Over,
    progress: &dyn Progress,
) -> Result<Broken, Interrupted> {
    let [columns, rows] = [grid.x_m.samples, grid.y_m.samples];
    let across = columns.saturating_sub(1);
    let departs = |cell: usize| {
        let known = corners_of(grid, cell).map(|corner| heights_m[corner]);
        match known.iter().flatten().count() {
            0 if surface.misses(cell) => f64::INFINITY,
            0 => 0.0,
            4 => {
                let mean = 0.25 * known.iter().flatten().sum::<f64>();
                let middle = [(grid.x_m, cell % across), (grid.y_m, cell / across)]
                    .map(|(axis, node)| 0.5 * (axis.node(node) + axis.node(node + 1)));
                let off = |height: f64| ((height - mean) / mean).abs();
                let between = surface.rise_m(cell) / mean;
                let departs = (surface.height_m)(middle).map_or(0.0, off).max(between);
                if departs <= SMOOTH && surface.falls(cell, SMOOTH * mean) {
                    // By how much is not asked for.
                    return 2.0 * SMOOTH;
                }
                departs
            }
            _ => f64::INFINITY,
        }
    };
    let cells = 0..across * rows.saturating_sub(1);
    let broken: Vec<(usize, f64)> = cells
        .into_par_iter()
        .with_min_len(fluxform_base::progress::items_a_task(across * rows))
        .map(|cell| {
            if cell % STRIDE == 0 {
                progress.check()?;
            }
            fluxform_base::progress::poll();
            Ok((cell, departs(cell)))
        })
        .filter(|found| !found.as_ref().is_ok_and(|(_, by)| *by <= SMOOTH))
        .collect::<Result<_, Interrupted>>()?;
    let (ends, departs): (Vec<_>, Vec<_>) =
        broken.into_iter().partition(|(_, by)| by.is_infinite());
    let [mut cells, departs] = [ends, departs].map(|found| {
        found
            .into_iter()
            .map(|(cell, _)| cell)
            .collect::<Vec<usize>>()
    });
    let left = cells.split_off(cells.len().min(MOST_CELLS));
    let room = MOST_CELLS - cells.len();
    let mut thinned = Thinned::default();
    if departs.len() <= room {
        cells.extend(departs);
    } else if room >= FEWEST_CHOSEN {
        thinned = Thinned::new(departs, room);
        cells.extend(&thinned.chosen);
    }
    cells.sort_unstable();
    Ok(Broken {
        cells,
        left,
        thinned,
    })
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
        .with_min_len(fluxform_base::progress::items_a_task(mixed.len()))
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
            let part = covered_part(from, to, covered, BISECTIONS);
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
        let surface = Over {
            height_m: &height_at,
            covers: &|p| height_at(p).is_some(),
            near: &|_| 1,
            lattice: None,
        };
        areas_m2(grid, &heights, surface, &Silent).unwrap()
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

    /// Of too many cells those were sampled that depart most from the mean of their corners, relative to it: those
    /// whose corners are low.
    #[test]
    fn cells_that_stand_for_others_are_not_chosen_by_their_departure() {
        let ribs = |p: [f64; 2]| {
            let phase = (0.97 * p[0] + 0.24 * p[1]) / 0.0025;
            Some(if phase.rem_euclid(1.0) < 0.5 {
                0.02
            } else {
                0.04
            })
        };
        for n in [193, 301] {
            let grid = grid([n, n]);
            let (areas, fine) = both(&grid, ribs);
            let broken = fine.smooth.iter().filter(|smooth| !**smooth).count();
            assert!(broken > MOST_CELLS, "{broken}");
            let columns = grid.x_m.samples;
            let of_points = |weights: &[f64]| -> f64 {
                let height =
                    |k: usize| ribs([grid.x_m.node(k % columns), grid.y_m.node(k / columns)]);
                weights
                    .iter()
                    .enumerate()
                    .map(|(k, area)| area * height(k).unwrap())
                    .sum()
            };
            let total: f64 = areas.iter().sum();
            let smooth: f64 = fine.point_area_m2.iter().sum();
            for rule in [&fine.area_m2, &fine.coarse_area_m2] {
                let sum: f64 = rule.iter().sum();
                assert!(((smooth + sum) / total - 1.0).abs() < 1e-9);
                let of_samples: f64 = rule.iter().zip(&fine.height_m).map(|(a, h)| a * h).sum();
                let mean = (of_points(&fine.point_area_m2) + of_samples) / total;
                assert!((mean / 0.03 - 1.0).abs() < 8e-3, "{n}: {mean}");
            }
        }
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

    /// Where triangles lie over each other, every look meets all of them: samples took minutes.
    #[test]
    fn many_triangles_over_each_other_get_fewer_samples() {
        let found = |near: usize| {
            let grid = grid([31, 29]);
            let disc = |p: [f64; 2]| (p[0].hypot(p[1]) <= 0.0437).then_some(0.05);
            let heights: Vec<Option<f64>> = (0..grid.len())
                .map(|k| disc([grid.x_m.node(k % 31), grid.y_m.node(k / 31)]))
                .collect();
            let surface = Over {
                height_m: &disc,
                covers: &|p| disc(p).is_some(),
                near: &|_| near,
                lattice: None,
            };
            areas_m2(&grid, &heights, surface, &Silent).unwrap()
        };
        let plain = found(1);
        let samples = |near: usize| found(near).1.x_m.len();
        assert!(plain.1.x_m.len() > samples(3_000) && samples(3_000) > 0);
        for near in [3_000, 20_000, 1_000_000] {
            let crowded = found(near);
            // The points themselves count as before.
            assert_eq!(crowded.0, plain.0);
            assert_eq!(crowded, found(near));
        }
        assert_eq!(samples(1_000_000), 0);
        assert_eq!(found(1_000_000).1.point_area_m2, plain.0);
    }
}
