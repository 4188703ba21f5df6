//! Exact heights of a mesh over a grid: the highest intersection of each vertical line.
//!
//! Borders are inclusive. What lies within the coordinates' own rounding counts as well: a circle's
//! rim is met at its nodes although the file rounds them, whatever lies below it. The result does not
//! depend on the order or the orientation of the triangles, nor on the number of threads: every choice
//! is a maximum.

use std::cmp::Ordering;

use rayon::prelude::*;

use crate::file_mesh::Triangle;
use crate::mesh::Mesh;
use crate::vertical_hit::{Contact, Seen, WALL_NORMAL_Z, upward_normal};
use fluxform_base::progress::{Interrupted, Progress};
use fluxform_numerics::axis::Axis;

/// How many coordinate roundings a point may lie off an edge: x and y of its ends are rounded
/// (1.4), by some programs twice (metres to millimetres, say).
const REACH_ROUNDINGS: f64 = 3.0;
/// Doubles are rounded on the way too: unit, rotation, translation, grid nodes.
const REACH_EPSILONS: f64 = 8.0;
/// Triangles between two looks at the progress.
const STRIDE: usize = 1 << 15;
/// Below this a second thread costs more than it saves.
const TRIANGLES_A_THREAD: usize = 1 << 12;
/// Every worker holds a grid of its own: this bounds the memory.
const MOST_WORKERS: usize = 8;
/// Triangles wider than this many columns are clipped row by row.
const UNCLIPPED_COLUMNS: usize = 4;

/// An axis-aligned grid in plan, m; both axes ascend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Columns.
    pub x_m: Axis,
    /// Rows.
    pub y_m: Axis,
}

impl Grid {
    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.x_m.samples * self.y_m.samples
    }

    /// True without points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Samples along x and y.
    #[must_use]
    pub fn samples(&self) -> [usize; 2] {
        [self.x_m.samples, self.y_m.samples]
    }

    /// Range of x and of y.
    #[must_use]
    pub fn plan(&self) -> [[f64; 2]; 2] {
        [self.x_m, self.y_m].map(|axis| [axis.from, axis.to])
    }
}

/// The surface at one grid point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Height above z = 0, m.
    pub height_m: f64,
    /// Unit normal, n_z >= 0.
    pub normal: [f64; 3],
}

/// How far from an edge a point of the grid still touches it, m.
#[must_use]
pub fn reach_m(mesh: &Mesh, grid: &Grid) -> f64 {
    let facts = mesh.facts();
    if facts.plan_rounding_m == 0.0 {
        return 0.0;
    }
    let plan = [facts.bounds.plan(), grid.plan()];
    let largest = plan
        .as_flattened()
        .as_flattened()
        .iter()
        .fold(0.0, |m: f64, c| m.max(c.abs()));
    REACH_ROUNDINGS * facts.plan_rounding_m + REACH_EPSILONS * f64::EPSILON * largest
}

/// The surface over every point of the grid, x fastest; `None` where there is none.
///
/// # Errors
/// [`Interrupted`] when the user asked to stop.
pub fn heights(
    mesh: &Mesh,
    grid: &Grid,
    progress: &dyn Progress,
) -> Result<Vec<Option<Sample>>, Interrupted> {
    let triangles = mesh.triangles();
    let nodes = Nodes {
        x: Line::new(&grid.x_m),
        y: Line::new(&grid.y_m),
    };
    let reach = reach_m(mesh, grid);
    let workers = rayon::current_num_threads()
        .min(MOST_WORKERS)
        .min(triangles.len() / TRIANGLES_A_THREAD + 1);
    let share = triangles.len().div_ceil(workers).max(1);
    progress.begin("heights", triangles.len() as u64);
    let layers: Result<Vec<Layer>, Interrupted> = (0..workers)
        .into_par_iter()
        .map(|worker| {
            let mut layer = Layer::new(triangles, grid.len());
            let end = ((worker + 1) * share).min(triangles.len());
            let mut from = (worker * share).min(end);
            while from < end {
                progress.check()?;
                let to = (from + STRIDE).min(end);
                for index in from..to {
                    // One triangle may lie over thousands of points.
                    fluxform_base::progress::poll();
                    layer.add(index as u32, &nodes, reach);
                }
                progress.advance((to - from) as u64);
                from = to;
            }
            Ok(layer)
        })
        .collect();
    let layer = layers?.into_iter().reduce(Layer::merge);
    progress.end();
    Ok(layer.map_or_else(Vec::new, Layer::samples))
}

/// One axis' nodes and how to find a coordinate among them.
struct Line {
    nodes: Vec<f64>,
    from: f64,
    per_step: f64,
}

impl Line {
    fn new(axis: &Axis) -> Self {
        let step = axis.step();
        let per_step = if step > 0.0 { 1.0 / step } else { 0.0 };
        Self {
            nodes: axis.nodes(),
            from: axis.from,
            per_step,
        }
    }

    /// Index of the first node that is not below `value`.
    fn first_from(&self, value: f64) -> usize {
        // The cast saturates and cuts off; the guess is off by one or two at most.
        let guess = ((value - self.from) * self.per_step) as usize;
        let mut index = guess.min(self.nodes.len());
        while index > 0 && self.nodes[index - 1] >= value {
            index -= 1;
        }
        while index < self.nodes.len() && self.nodes[index] < value {
            index += 1;
        }
        index
    }

    /// Indices of the nodes from `low` to `high`, both included.
    fn between(&self, low: f64, high: f64) -> std::ops::Range<usize> {
        self.first_from(low)..self.first_from(high.next_up())
    }
}

struct Nodes {
    x: Line,
    y: Line,
}

/// A height and the triangle that gives it.
#[derive(Clone, Copy)]
struct Hit {
    height: f64,
    triangle: u32,
}

const NOTHING: Hit = Hit {
    height: f64::NEG_INFINITY,
    triangle: u32::MAX,
};

impl Hit {
    fn sample(self, triangles: &[Triangle]) -> Option<Sample> {
        (self.triangle != u32::MAX).then(|| Sample {
            height_m: self.height,
            normal: upward_normal(&triangles[self.triangle as usize]),
        })
    }
}

/// The best hits of some of the triangles.
struct Layer<'a> {
    triangles: &'a [Triangle],
    hits: Vec<Hit>,
}

impl<'a> Layer<'a> {
    fn new(triangles: &'a [Triangle], points: usize) -> Self {
        Self {
            triangles,
            hits: vec![NOTHING; points],
        }
    }

    fn add(&mut self, triangle: u32, nodes: &Nodes, reach: f64) {
        let vertices = &self.triangles[triangle as usize];
        let [a, b, c] = vertices;
        let low = [0, 1].map(|k| a[k].min(b[k]).min(c[k]) - reach);
        let high = [0, 1].map(|k| a[k].max(b[k]).max(c[k]) + reach);
        let rows = nodes.y.between(low[1], high[1]);
        if rows.is_empty() {
            return;
        }
        let all_columns = nodes.x.between(low[0], high[0]);
        if all_columns.is_empty() {
            return;
        }
        let seen = Seen::new(vertices, reach);
        for row in rows {
            let y = nodes.y.nodes[row];
            let columns = if all_columns.len() > UNCLIPPED_COLUMNS {
                let [from, to] = seen.columns(y);
                nodes.x.between(from, to)
            } else {
                all_columns.clone()
            };
            for column in columns {
                let point = row * nodes.x.nodes.len() + column;
                let best = self.hits[point];
                if seen.is_hidden_below(best.height) {
                    continue;
                }
                if let Some(height) = seen.contact([nodes.x.nodes[column], y]).height() {
                    self.hits[point] = higher(self.triangles, best, Hit { height, triangle });
                }
            }
        }
    }

    fn merge(mut self, other: Self) -> Self {
        let triangles = self.triangles;
        self.hits
            .par_iter_mut()
            .zip(&other.hits)
            .with_min_len(fluxform_base::progress::items_a_task(other.hits.len()))
            .for_each(|(mine, theirs)| {
                fluxform_base::progress::poll();
                *mine = higher(triangles, *mine, *theirs);
            });
        self
    }

    /// Decides every point.
    fn samples(self) -> Vec<Option<Sample>> {
        self.hits
            .par_iter()
            .with_min_len(fluxform_base::progress::items_a_task(self.hits.len()))
            .map(|hit| {
                fluxform_base::progress::poll();
                hit.sample(self.triangles)
            })
            .collect()
    }
}

/// The surface over one point, from how the triangles touch its vertical line.
pub(super) fn sample_of(triangles: &[Triangle], contacts: &[(u32, Contact)]) -> Option<Sample> {
    let hits = contacts.iter().filter_map(|&(triangle, contact)| {
        let height = contact.height()?;
        Some(Hit { height, triangle })
    });
    hits.fold(NOTHING, |a, b| higher(triangles, a, b))
        .sample(triangles)
}

/// The higher hit. At equal heights the face seen from above is requested: any face before a wall,
/// one that rises from there before one that does not (a dome before its base), of two that rise
/// the steeper, of two that do not the flatter; then the larger normal. Equal keys give the same
/// sample either way, so the order of the triangles does not matter.
fn higher(triangles: &[Triangle], a: Hit, b: Hit) -> Hit {
    if a.height != b.height || a.triangle == u32::MAX || b.triangle == u32::MAX {
        return if b.height > a.height { b } else { a };
    }
    let key = |hit: Hit| {
        let triangle = &triangles[hit.triangle as usize];
        let [x, y, z] = upward_normal(triangle);
        let rises = triangle.iter().any(|vertex| vertex[2] > hit.height);
        (z > WALL_NORMAL_Z, rises, [if rises { -z } else { z }, x, y])
    };
    match key(a).partial_cmp(&key(b)) {
        Some(Ordering::Less) => b,
        _ => a,
    }
}
