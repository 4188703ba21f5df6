//! Blue noise: points in no order, none nearer to another than a spacing, none missing.
//!
//! Darts are thrown into the cells of a grid so fine that each holds one point at most, over and
//! over in a shuffled order; the stream of numbers depends on the seed alone. A point's weight is
//! the area nearer to it than to any other: that over the cells of a finer grid, in parts of them, a cell that
//! the surface leaves whole for one of its places; such a place that is a spacing or more from all points becomes one.

use super::{Probe, Scattered};
use crate::deviation::{Rect, Standing};
use crate::error::ShapeError;
use crate::height::{Grid, Sample};
use crate::point_areas::LEAST;
use crate::point_flags::Marks;
use fluxform_base::progress::{Interrupted, Progress};
use fluxform_numerics::axis::Axis;
use fluxform_numerics::random::Random;

/// Darts into every free cell.
const ROUNDS: u64 = 40;
/// Cells a spacing over which areas are counted.
const COUNTED: f64 = 4.0;
/// Parts a side of such a cell, each for the point nearest to it: a whole one left areas 5 % off (rms), 16 % at most.
const PARTS: usize = 4;
/// Cells a side of a block that shares a list of the faces over it.
const BLOCK: usize = 8;

/// Points at random with a least spacing.
#[derive(Debug, Clone, PartialEq)]
pub struct Poisson {
    /// The points, weighted by the area nearest to each.
    pub points: Scattered,
    /// No place of the surface lies farther from a point in plan, m: a bound.
    pub cover_m: f64,
}

struct Cells {
    low_m: [f64; 2],
    cell_m: f64,
    count: [usize; 2],
    darts: Vec<Option<([f64; 2], Sample, Marks)>>,
}

/// Points over the probe's region, at least `spacing_m` apart in plan.
///
/// # Errors
/// [`ShapeError::Document`] for a spacing that is not positive or asks for too many points;
/// [`ShapeError::Interrupted`].
pub fn poisson(
    probe: &Probe<'_>,
    spacing_m: f64,
    seed: u64,
    progress: &dyn Progress,
) -> Result<Poisson, ShapeError> {
    if !(spacing_m > 0.0 && spacing_m.is_finite()) {
        return Err(ShapeError::Document(format!(
            "the spacing is {} mm; it must be positive",
            spacing_m * 1000.0
        )));
    }
    // A cell's diagonal is a spacing.
    let cell_m = spacing_m / std::f64::consts::SQRT_2;
    let sides = probe.plan_m.sides();
    let count = sides.map(|side| (side / cell_m).ceil().max(1.0) as usize);
    // About every second one holds a point.
    probe.check_count(
        count[0].saturating_mul(count[1]) / 2,
        "take a larger spacing",
    )?;
    let mut cells = Cells {
        low_m: probe.plan_m.low_m,
        cell_m,
        count,
        darts: vec![None; count[0] * count[1]],
    };
    cells.throw(probe, spacing_m, seed, progress)?;
    let mut counted = count_areas(probe, &cells, spacing_m, progress)?;
    if !counted.missed.is_empty() {
        for p in std::mem::take(&mut counted.missed) {
            let free = |(_, square)| square >= spacing_m * spacing_m;
            let cell = cells.of(p);
            if cells.darts[cell].is_none() && cells.nearest(p, 2).is_none_or(free) {
                cells.darts[cell] = probe.at(p).map(|(sample, marks)| (p, sample, marks));
            }
        }
        counted = count_areas(probe, &cells, spacing_m, progress)?;
    }
    let mut found: Vec<_> = cells
        .darts
        .iter()
        .zip(counted.areas_m2)
        .filter_map(|(d, a)| Some(((*d)?, a)))
        .collect();
    found.sort_by(|((p, ..), _), ((q, ..), _)| p[1].total_cmp(&q[1]).then(p[0].total_cmp(&q[0])));
    let mut points = Scattered::default();
    for ((p, sample, marks), area_m2) in found {
        points.push(p, (sample, marks), area_m2);
    }
    Ok(Poisson {
        points,
        cover_m: counted.cover_m,
    })
}

/// Statistics of the surface over the counted cells.
struct Counted {
    /// The area nearest to each dart, by its cell.
    areas_m2: Vec<f64>,
    /// No place of these lies farther from its dart, m.
    cover_m: f64,
    /// Places at least a spacing from every dart: narrow parts that none has hit.
    missed: Vec<[f64; 2]>,
}

fn count_areas(
    probe: &Probe<'_>,
    cells: &Cells,
    spacing_m: f64,
    progress: &dyn Progress,
) -> Result<Counted, ShapeError> {
    let mut counted = Counted {
        areas_m2: vec![0.0; cells.darts.len()],
        cover_m: 0.0,
        missed: Vec::new(),
    };
    let step_m = spacing_m / COUNTED;
    let sides = probe.plan_m.sides();
    let blocks = sides.map(|side| ((side / step_m) as usize).div_ceil(BLOCK).max(1));
    let axis = |k: usize, samples: usize| Axis {
        from: probe.plan_m.low_m[k],
        to: probe.plan_m.high_m[k],
        samples,
    };
    let of_blocks = Grid {
        x_m: axis(0, blocks[0] + 1),
        y_m: axis(1, blocks[1] + 1),
    };
    let lattice = probe.lattice(&of_blocks, &[]);
    let nodes = [0, 1].map(|k| axis(k, blocks[k] * BLOCK + 1).nodes());
    let cell_m2 = sides[0] * sides[1] / ((nodes[0].len() - 1) * (nodes[1].len() - 1)) as f64;
    let covers = |row: usize| -> Vec<bool> {
        let places = nodes[0].iter().map(|x| [*x, nodes[1][row]]);
        places.map(|p| probe.covers(p)).collect()
    };
    let mut above = covers(0);
    for row in 0..nodes[1].len() - 1 {
        progress.check()?;
        let below = std::mem::replace(&mut above, covers(row + 1));
        for column in 0..nodes[0].len() - 1 {
            let rect = Rect {
                low_m: [nodes[0][column], nodes[1][row]],
                high_m: [nodes[0][column + 1], nodes[1][row + 1]],
            };
            let has = [&below, &above].map(|has| has[column] && has[column + 1]);
            if has == [true; 2] && probe.covers(rect.centre()) {
                for part in parts(&rect) {
                    let all = Standing {
                        at_m: part.centre(),
                        area_m2: cell_m2 / (PARTS * PARTS) as f64,
                    };
                    counted.add(cells, &part, all, spacing_m);
                }
                continue;
            }
            let block = row / BLOCK * blocks[0] + column / BLOCK;
            let around = (lattice.as_ref()).map(|lattice| lattice.members(block));
            let among = around.map(|around| probe.faces_over(&rect, &around));
            if let Some(found) = probe.standing(&rect, &among.unwrap_or_default()) {
                counted.add(cells, &rect, found, spacing_m);
            }
        }
    }
    // A point counts, however little.
    for (area, dart) in counted.areas_m2.iter_mut().zip(&cells.darts) {
        if dart.is_some() {
            *area = area.max(LEAST * cell_m2);
        }
    }
    Ok(counted)
}

/// A rectangle in [`PARTS`] equal parts a side.
fn parts(rect: &Rect) -> impl Iterator<Item = Rect> {
    let (low_m, sides) = (rect.low_m, rect.sides());
    (0..PARTS * PARTS).map(move |k| {
        let end = |steps: [usize; 2]| {
            [0, 1].map(|axis| low_m[axis] + sides[axis] * steps[axis] as f64 / PARTS as f64)
        };
        let [column, row] = [k % PARTS, k / PARTS];
        Rect {
            low_m: end([column, row]),
            high_m: end([column + 1, row + 1]),
        }
    })
}

impl Counted {
    /// Counts the surface over a cell for the dart nearest to its place.
    fn add(&mut self, cells: &Cells, rect: &Rect, found: Standing, spacing_m: f64) {
        let nearest = cells.nearest(found.at_m, 2);
        if let Some((cell, _)) = nearest {
            self.areas_m2[cell] += found.area_m2;
            // The farthest place of a rectangle is a corner.
            let dart = cells.darts[cell].map_or(found.at_m, |(dart, ..)| dart);
            let corners = rect.corners().into_iter();
            let distances = corners.map(|p| (p[0] - dart[0]).hypot(p[1] - dart[1]));
            self.cover_m = distances.fold(self.cover_m, f64::max);
        }
        if nearest.is_none_or(|(_, square)| square >= spacing_m * spacing_m) {
            self.missed.push(found.at_m);
        }
    }
}

impl Cells {
    /// Throws darts into the cells until hardly any more fits, none nearer to another than `spacing_m`.
    ///
    /// # Errors
    /// Interruption.
    fn throw(
        &mut self,
        probe: &Probe<'_>,
        spacing_m: f64,
        seed: u64,
        progress: &dyn Progress,
    ) -> Result<(), Interrupted> {
        let mut random = Random::new(seed);
        let mut order: Vec<usize> = (0..self.darts.len()).collect();
        for k in (1..order.len()).rev() {
            order.swap(k, (random.unit() * (k + 1) as f64) as usize);
        }
        progress.begin("points", ROUNDS);
        for _ in 0..ROUNDS {
            progress.check()?;
            for &cell in &order {
                if self.darts[cell].is_some() {
                    continue;
                }
                let place = [cell % self.count[0], cell / self.count[0]];
                let p = [0, 1].map(|k| {
                    let p = probe.plan_m.low_m[k] + (place[k] as f64 + random.unit()) * self.cell_m;
                    p.min(probe.plan_m.high_m[k])
                });
                if self
                    .nearest(p, 2)
                    .is_some_and(|(_, square)| square < spacing_m * spacing_m)
                {
                    continue;
                }
                if let Some((sample, marks)) = probe.at(p) {
                    self.darts[cell] = Some((p, sample, marks));
                }
            }
            progress.advance(1);
        }
        progress.end();
        Ok(())
    }

    fn place(&self, p: [f64; 2]) -> [usize; 2] {
        [0, 1].map(|k| (((p[k] - self.low_m[k]) / self.cell_m) as usize).min(self.count[k] - 1))
    }

    /// The cell of a place.
    fn of(&self, p: [f64; 2]) -> usize {
        let [column, row] = self.place(p);
        row * self.count[0] + column
    }

    /// The nearest dart among the cells up to `around` away, and its distance squared.
    fn nearest(&self, p: [f64; 2], around: usize) -> Option<(usize, f64)> {
        let place = self.place(p);
        let [columns, rows] = [0, 1]
            .map(|k| place[k].saturating_sub(around)..=(place[k] + around).min(self.count[k] - 1));
        let mut best: Option<(usize, f64)> = None;
        for row in rows {
            for column in columns.clone() {
                let cell = row * self.count[0] + column;
                if let Some((q, ..)) = self.darts[cell] {
                    let [u, v] = [p[0] - q[0], p[1] - q[1]];
                    let square = u * u + v * v;
                    if best.is_none_or(|(_, least)| square < least) {
                        best = Some((cell, square));
                    }
                }
            }
        }
        best
    }
}
