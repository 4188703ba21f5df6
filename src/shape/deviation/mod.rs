//! How far the interpolated points lie from the surface they were taken from.
//!
//! Between four points of a cell a runtime interpolates bilinearly. The surface is piecewise
//! plane, so the vertical difference is a saddle on every piece, and its supremum over the cell is
//! found in closed form (`piece`), once the pieces seen from above are known (`visible`).
//! Cells of which a corner has no surface are counted apart: there a runtime's force ends.

mod hausdorff;
pub(super) mod piece;
mod primitive;
mod sheets;
mod standing;
mod union;
mod visible;

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::height::{Grid, heights, reach_m};
use crate::index::Buckets;
use crate::mesh::Mesh;
use crate::vertical_hit::is_wall;
use fluxform_base::least_request::lowest_requested_m;
use fluxform_base::progress::{self, Interrupted, Progress};
use fluxform_numerics::axis::Axis;

use self::piece::Hair;
use self::union::area_m2;
use self::visible::{HIGHEST, Look, supremum_over_visible};

pub use self::hausdorff::{Interval, hausdorff};
pub use self::piece::{Extreme, Patch, Rect};
pub use self::primitive::{primitive, primitive_by_cell};
pub(crate) use self::standing::Standing;

/// Triangles in a rectangle that are compared with each other at once.
const TOGETHER: usize = 10;
/// Cells between two looks at the progress.
const CELLS_BETWEEN_LOOKS: usize = 1024;
/// A rectangle is halved so often at most: a fan's apex never comes apart.
const DEEPEST: u32 = 9;
/// Quarters over which all faces lie count as so many halvings: sheets over each other, or the same
/// one many times, would else be looked at in every smallest part.
const NO_NEARER: u32 = 5;
/// Places nearer than this times the largest coordinate are not distinguished.
const HAIR: f64 = 1e-12;
/// So many faces of cells, on average over the faces, are held at most: where faces lie over many cells
/// each, blocks of cells share a list,
const MOST_EACH: usize = 64;
/// unless there are so few altogether.
const FEW: usize = 1 << 22;
/// Height hairs by which a difference may be off.
const ROUNDINGS: f64 = 16.0;

/// The vertical difference between the surface and the points, cells of four points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Vertical {
    /// The most by which the surface lies above the interpolated points, m.
    pub above: Extreme,
    /// The most by which it lies below them, m.
    pub below: Extreme,
    /// Largest part of rounding in either, m.
    pub rounding_m: f64,
    /// Largest distance of a bound of limited effort to the supremum, m; 0 where that is exact.
    pub slack_m: f64,
    /// A bound of the largest difference relative to the lowest height of its cell at which a force is requested;
    /// `None` without a cell of four points or a request.
    pub relative: Option<f64>,
    /// Kind of the cells.
    pub cells: Cells,
}

impl Vertical {
    /// The larger of the two, with its place.
    #[must_use]
    pub fn worst(&self) -> Extreme {
        self.above.or(self.below)
    }

    /// A bound of the vertical difference, rounding included, m.
    #[must_use]
    pub fn bound_m(&self) -> f64 {
        self.worst().value_m.max(0.0) + self.rounding_m + self.slack_m
    }
}

/// Cells of the grid by what their corners have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Cells {
    /// Four points: interpolated.
    pub inner: usize,
    /// One to three points: the silhouette passes through.
    pub silhouette: usize,
    /// No point, and yet surface: a part that the grid misses.
    pub missed: usize,
}

/// The faces of a mesh prepared for comparison.
pub struct Faces {
    list: Vec<piece::Face>,
    hair: Hair,
    /// Width in plan up to which a wall is left out, m.
    wall_m: f64,
    effort: Arc<Looks>,
}

/// A part of a cell, and the faces of which something may be seen there.
struct Leaf<'a> {
    rect: &'a Rect,
    faces: &'a [u32],
    /// Whether they cover it and none lies over another: all are seen whole.
    plain: bool,
}

/// How much more is compared: a count of looks at faces, hence the same on every machine and with
/// any number of threads.
#[derive(Debug)]
pub struct Looks {
    left: AtomicI64,
}

/// Seconds of one core that a certificate may take unasked, about.
pub const CERTIFY_SECONDS: u64 = 10;
/// Looks of one such second.
const LOOKS_A_SECOND: u64 = (1 << 30) / 10;
/// Looks that cutting a face to a part of a cell and sorting it among others takes.
const LOOKS_A_LEAF: usize = 16;

impl Looks {
    /// So many looks, and no more.
    #[must_use]
    pub fn new(looks: i64) -> Arc<Self> {
        Arc::new(Self {
            left: AtomicI64::new(looks),
        })
    }

    /// The effort of one core in so many seconds, about: the same count on every machine.
    #[must_use]
    pub fn of_seconds(seconds: u64) -> Arc<Self> {
        Self::new(i64::try_from(seconds.saturating_mul(LOOKS_A_SECOND)).unwrap_or(i64::MAX))
    }

    /// As much as it takes.
    #[must_use]
    pub fn endless() -> Arc<Self> {
        Self::new(i64::MAX)
    }

    /// Takes so many looks; true where they are spent. What is spent altogether does not depend on
    /// who spends it first, and once nothing is left all results are void.
    fn spend(&self, looks: usize) -> bool {
        let looks = i64::try_from(looks).unwrap_or(i64::MAX / 2);
        self.left.fetch_sub(looks, Ordering::Relaxed) < looks
    }

    /// Whether nothing is left: then no comparison that drew on it states anything.
    #[must_use]
    pub fn is_spent(&self) -> bool {
        self.left.load(Ordering::Relaxed) < 0
    }
}

/// What differences over a cell are relative to: its lowest point, or the lowest that counts where that is higher.
#[derive(Debug, Clone, Copy)]
struct Requested {
    lowest_m: f64,
}

impl Requested {
    fn of(heights: &[Option<f64>]) -> Option<Self> {
        let lowest_m = lowest_requested_m(heights.iter().flatten().copied())?;
        Some(Self { lowest_m })
    }

    fn height_m(&self, patch: &Patch) -> f64 {
        patch
            .corners_m
            .into_iter()
            .fold(f64::INFINITY, f64::min)
            .max(self.lowest_m)
    }
}

/// The largest differences over a rectangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Worst {
    pub(super) above: Extreme,
    pub(super) below: Extreme,
}

impl Worst {
    pub(super) const NONE: Self = Self {
        above: Extreme::NONE,
        below: Extreme::NONE,
    };

    fn or(self, other: Self) -> Self {
        Self {
            above: self.above.or(other.above),
            below: self.below.or(other.below),
        }
    }

    pub(super) fn value_m(&self) -> f64 {
        self.above.value_m.max(self.below.value_m)
    }
}

impl Faces {
    /// The mesh's triangles but for vertical walls, which have no height of their own.
    #[must_use]
    pub fn new(mesh: &Mesh, grid: &Grid, effort: Arc<Looks>) -> Self {
        let reach = reach_m(mesh, grid);
        let bounds = mesh.facts().bounds;
        let largest = |corners: [&[f64]; 2]| {
            corners
                .concat()
                .iter()
                .fold(0.0, |m: f64, c| m.max(c.abs()))
        };
        let plan_m = largest([&bounds.min_m[..2], &bounds.max_m[..2]]);
        let height_m = largest([&bounds.min_m[2..], &bounds.max_m[2..]]);
        let faces = mesh.triangles().par_iter();
        Self {
            list: faces
                .filter(|triangle| !is_wall(triangle, reach))
                .filter_map(piece::Face::new)
                .collect(),
            hair: Hair {
                plan_m: HAIR * plan_m,
                height_m: HAIR * height_m,
            },
            wall_m: reach,
            effort,
        }
    }

    /// Walls are no faces, so what they leave open is not seen through.
    fn look(&self) -> Look<'_> {
        Look {
            hair: Hair {
                plan_m: self.hair.plan_m.max(self.wall_m),
                ..self.hair
            },
            effort: &self.effort,
        }
    }

    /// Indices of all faces.
    pub(super) fn all(&self) -> Vec<u32> {
        (0..self.list.len() as u32).collect()
    }

    /// Of `among`, the faces that have plan area in common with the rectangle.
    pub(super) fn over(&self, rect: &Rect, among: &[u32]) -> Vec<u32> {
        let overlaps = |face: &&u32| self.list[**face as usize].overlaps(rect);
        among.iter().filter(overlaps).copied().collect()
    }

    /// The largest differences from `patch` over `rect`, which lies within it; differences no
    /// larger than those of `known` are not looked for.
    pub(super) fn worst(&self, rect: &Rect, among: &[u32], patch: &Patch, known: Worst) -> Worst {
        let mut worst = known;
        self.leaves(*rect, among, DEEPEST, &mut |leaf| {
            self.compare(leaf, patch, &mut worst);
        });
        worst
    }

    /// A bound of the vertical difference over a patch, m.
    pub(super) fn deviation_m(&self, patch: &Patch, among: &[u32]) -> f64 {
        let worst = self.worst(&patch.rect, among, patch, Worst::NONE).value_m();
        worst.max(0.0) + ROUNDINGS * self.hair.height_m
    }

    /// Quarters the rectangle until few faces are left in each part, or none of them lies over
    /// another; what others hide there is left out as far as that is soon known.
    fn leaves(&self, rect: Rect, among: &[u32], deep: u32, visit: &mut dyn FnMut(&Leaf<'_>)) {
        progress::poll();
        if self.effort.spend(LOOKS_A_LEAF * among.len()) {
            return;
        }
        let mut give = |faces: &[u32], plain: bool| {
            visit(&Leaf {
                rect: &rect,
                faces,
                plain,
            });
        };
        if among.len() <= TOGETHER {
            give(among, false);
            return;
        }
        let sheets = self.sheets(&rect, among);
        if sheets.plain {
            give(&sheets.faces, true);
            return;
        }
        let kept = self.not_hidden(&rect, &sheets.faces);
        let [width, depth] = rect.sides();
        let smallest = width.min(depth) < 256.0 * self.hair.plan_m;
        if kept.len() <= TOGETHER || deep == 0 || smallest {
            give(&kept, false);
            return;
        }
        let quarters = rect.quarters();
        let quarters = quarters.map(|quarter| (quarter, self.over(&quarter, &kept)));
        let apart = quarters.iter().any(|(_, faces)| faces.len() < kept.len());
        let deep = deep.saturating_sub(if apart { 1 } else { NO_NEARER });
        for (quarter, faces) in &quarters {
            self.leaves(*quarter, faces, deep, visit);
        }
    }

    /// Of `among`, the faces of which the part in the rectangle is not hidden by a single one of the
    /// highest; the highest first.
    fn not_hidden(&self, rect: &Rect, among: &[u32]) -> Vec<u32> {
        let face = |index: &u32| &self.list[*index as usize];
        let mut order = among.to_vec();
        order.sort_by(|a, b| face(b).heights[1].total_cmp(&face(a).heights[1]));
        let mut kept: Vec<u32> = Vec::with_capacity(order.len());
        for index in order {
            let part = face(&index).within(rect);
            // A difference of planes is least at a corner.
            let over = |other: &piece::Face, p: &piece::Point| {
                other.holds(*p, self.hair.plan_m / 4.0)
                    && other.at_most(*p) - face(&index).at_least(*p) > self.hair.height_m
            };
            let hides = |other: &u32| part.corners().iter().all(|p| over(face(other), p));
            if !kept.iter().take(HIGHEST).any(hides) {
                kept.push(index);
            }
        }
        kept
    }

    /// Whether the faces leave no part of the rectangle open that is wider than `slack_m`.
    pub(super) fn covered(&self, rect: &Rect, among: &[u32], slack_m: f64) -> bool {
        let heights = among.iter().map(|face| self.list[*face as usize].heights);
        let lowest = heights.fold(f64::INFINITY, |m, [low, _]| m.min(low));
        if among.is_empty() {
            return false;
        }
        // A floor under everything is hidden wherever there is surface.
        let floor_m = lowest - lowest.abs() - 1.0;
        let mut look = self.look();
        look.hair.plan_m = look.hair.plan_m.max(slack_m);
        let mut open = false;
        self.leaves(*rect, among, DEEPEST, &mut |leaf| {
            if open || leaf.plain {
                return;
            }
            let faces = leaf.faces.iter();
            let others: Vec<_> = faces.map(|face| self.list[*face as usize]).collect();
            open = piece::Face::floor(leaf.rect, floor_m).is_none_or(|floor| {
                let whole = floor.within(leaf.rect);
                supremum_over_visible(&floor, (leaf.rect, &whole), &others, look, &|_| 0.0)
                    .is_some()
            });
        });
        !open && !self.effort.is_spent()
    }

    /// The area of the rectangle that the faces cover, once where they lie over each other, m^2.
    pub(super) fn covered_m2(&self, rect: &Rect, among: &[u32]) -> f64 {
        let mut sum_m2 = 0.0;
        self.leaves(*rect, among, DEEPEST, &mut |leaf| {
            sum_m2 += if leaf.plain {
                let [width, depth] = leaf.rect.sides();
                width * depth
            } else {
                let faces = leaf.faces.iter();
                let parts = faces.map(|face| self.list[*face as usize].within(leaf.rect));
                area_m2(&parts.collect::<Vec<_>>())
            };
        });
        sum_m2
    }

    fn compare(&self, leaf: &Leaf<'_>, patch: &Patch, worst: &mut Worst) {
        let mut pieces = Vec::with_capacity(leaf.faces.len());
        for &index in leaf.faces {
            let face = self.list[index as usize];
            let [above_m, below_m] = face.most_off_m(leaf.rect, patch, self.hair);
            if above_m <= worst.above.value_m && below_m <= worst.below.value_m {
                continue;
            }
            let part = face.within(leaf.rect);
            if part.width() <= self.hair.plan_m / 4.0 {
                continue;
            }
            // A face that is hidden is lower than the one that hides it: no visibility needed.
            let above = part.supremum(|p| face.height(p) - patch.height_m(p));
            worst.above = worst.above.or(above);
            let below = part.supremum(|p| patch.height_m(p) - face.height(p));
            if leaf.plain {
                worst.below = worst.below.or(below);
            } else if below.value_m > worst.below.value_m {
                pieces.push((face, part, below.value_m));
            }
        }
        if pieces.is_empty() {
            return;
        }
        let others: Vec<piece::Face> = leaf.faces.iter().map(|k| self.list[*k as usize]).collect();
        pieces.sort_by(|p, q| q.2.total_cmp(&p.2));
        for (face, part, bound) in &pieces {
            if *bound <= worst.below.value_m || self.effort.is_spent() {
                break;
            }
            let value = |p: piece::Point| patch.height_m(p) - face.height(p);
            let piece = (leaf.rect, part);
            if let Some(below) = supremum_over_visible(face, piece, &others, self.look(), &value) {
                worst.below = worst.below.or(below);
            }
        }
    }
}

/// The patches of a grid's cells, and the faces over each.
pub struct Lattice<'a> {
    pub(super) faces: &'a Faces,
    x: Vec<f64>,
    y: Vec<f64>,
    heights: &'a [Option<f64>],
    requested: Option<Requested>,
    /// Cells a side of a block.
    block: usize,
    /// The faces over each block.
    buckets: Buckets,
}

impl<'a> Lattice<'a> {
    /// Sorts the faces into the cells. `heights` holds the points' heights, m, x fastest. Memory is
    /// bounded by the number of faces: where they lie over many cells each, only blocks of cells have
    /// a list, out of which a cell's is taken when it is looked at.
    #[must_use]
    pub fn new(faces: &'a Faces, grid: &Grid, heights: &'a [Option<f64>]) -> Self {
        Self::within(FEW.max(MOST_EACH * faces.list.len()), faces, grid, heights)
    }

    /// As [`Self::new`], with `most` entries in the lists.
    fn within(most: usize, faces: &'a Faces, grid: &Grid, heights: &'a [Option<f64>]) -> Self {
        let (x, y) = (grid.x_m.nodes(), grid.y_m.nodes());
        let mut blocks = Blocks::new(1, &x, &y);
        while blocks.count() > 1 && blocks.entries(&faces.list) > most {
            blocks = Blocks::new(2 * blocks.side, &x, &y);
        }
        let pairs: Vec<(u32, u32)> = (0..faces.list.len())
            .into_par_iter()
            .with_min_len(progress::items_a_task(faces.list.len()))
            .flat_map_iter(|index| blocks.under(&faces.list[index], index))
            .collect();
        Self {
            faces,
            heights,
            requested: Requested::of(heights),
            block: blocks.side,
            buckets: Buckets::new(blocks.count(), &pairs),
            x,
            y,
        }
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.x.len().saturating_sub(1) * self.y.len().saturating_sub(1)
    }

    /// The faces over a cell, ascending.
    pub(super) fn members(&self, cell: usize) -> Cow<'_, [u32]> {
        let all = self.around(cell);
        if self.block == 1 {
            return Cow::Borrowed(all);
        }
        Cow::Owned(self.faces.over(&self.rect(cell), all))
    }

    /// Whether no face is over a cell.
    fn is_bare(&self, cell: usize) -> bool {
        let rect = self.rect(cell);
        let over = |face: &u32| self.faces.list[*face as usize].overlaps(&rect);
        !self.around(cell).iter().any(over)
    }

    /// The faces over a cell's block.
    fn around(&self, cell: usize) -> &[u32] {
        let columns = self.x.len() - 1;
        let (column, row) = (cell % columns / self.block, cell / columns / self.block);
        let bucket = row * columns.div_ceil(self.block) + column;
        self.buckets.of(bucket)
    }

    pub(super) fn rect(&self, cell: usize) -> Rect {
        rect(&self.x, &self.y, cell)
    }

    /// Heights at the cell's corners, x fastest.
    fn corners(&self, cell: usize) -> [Option<f64>; 4] {
        let columns = self.x.len() - 1;
        let (column, row) = (cell % columns, cell / columns);
        let node = row * self.x.len() + column;
        [0, 1, self.x.len(), self.x.len() + 1].map(|k| self.heights[node + k])
    }

    pub(super) fn patch(&self, cell: usize) -> Option<Patch> {
        let [a, b, c, d] = self.corners(cell);
        Some(Patch {
            rect: self.rect(cell),
            corners_m: [a?, b?, c?, d?],
        })
    }

    fn cells(&self) -> Cells {
        let mut cells = Cells::default();
        for cell in 0..self.len() {
            match self.corners(cell).iter().flatten().count() {
                4 => cells.inner += 1,
                0 if self.is_bare(cell) => {}
                0 => cells.missed += 1,
                _ => cells.silhouette += 1,
            }
        }
        cells
    }
}

/// A cell between the nodes.
fn rect(x: &[f64], y: &[f64], cell: usize) -> Rect {
    let columns = x.len() - 1;
    let (column, row) = (cell % columns, cell / columns);
    Rect {
        low_m: [x[column], y[row]],
        high_m: [x[column + 1], y[row + 1]],
    }
}

/// Blocks of so many cells a side, from every so many-th node to the next; the last ones may be smaller.
struct Blocks {
    side: usize,
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Blocks {
    fn new(side: usize, x: &[f64], y: &[f64]) -> Self {
        let borders = |nodes: &[f64]| {
            let last = nodes.len().saturating_sub(1);
            let inner = (0..last).step_by(side);
            inner
                .chain([last])
                .filter_map(|node| nodes.get(node).copied())
                .collect()
        };
        Self {
            side,
            x: borders(x),
            y: borders(y),
        }
    }

    fn count(&self) -> usize {
        self.x.len().saturating_sub(1) * self.y.len().saturating_sub(1)
    }

    /// The columns and rows of blocks that a face's bounds touch.
    fn bounds(&self, face: &piece::Face) -> [Range<usize>; 2] {
        let between = |nodes: &[f64], (low, high): (f64, f64)| {
            let from = nodes.partition_point(|node| *node <= low).saturating_sub(1);
            from..nodes
                .partition_point(|node| *node < high)
                .min(nodes.len().saturating_sub(1))
        };
        [
            between(&self.x, face.range(0)),
            between(&self.y, face.range(1)),
        ]
    }

    /// No fewer than how often a face lies over a block.
    fn entries(&self, faces: &[piece::Face]) -> usize {
        let touched = |face| {
            let [columns, rows] = self.bounds(face);
            columns.len() * rows.len()
        };
        (faces.par_iter())
            .with_min_len(progress::items_a_task(faces.len()))
            .map(touched)
            .sum()
    }

    /// The blocks over which a face lies, each with the face's index.
    fn under(&self, face: &piece::Face, index: usize) -> Vec<(u32, u32)> {
        let [columns, rows] = self.bounds(face);
        let mut found = Vec::new();
        for row in rows {
            for column in columns.clone() {
                let block = row * (self.x.len() - 1) + column;
                if face.overlaps(&rect(&self.x, &self.y, block)) {
                    found.push((block as u32, index as u32));
                }
            }
        }
        found
    }
}

/// The exact supremum of the vertical difference over all cells of four points.
///
/// Error: what rounding adds, `rounding_m`, about 1e-11 of the size times the steepest slope.
///
/// # Errors
/// [`Interrupted`] when the user asked to stop.
pub fn vertical(
    mesh: &Mesh,
    grid: &Grid,
    lattice: &Lattice<'_>,
    progress: &dyn Progress,
) -> Result<Vertical, Interrupted> {
    let cells = lattice.cells();
    let start = start(mesh, grid, lattice, progress)?;
    let row = grid.x_m.samples.saturating_sub(1).max(1);
    progress.begin("deviation", lattice.len() as u64);
    let rows: Result<Vec<WorstOfCells>, Interrupted> = (0..lattice.len().div_ceil(row))
        .into_par_iter()
        .map(|index| {
            progress.check()?;
            let mut worst = start;
            for cell in index * row..((index + 1) * row).min(lattice.len()) {
                if let Some(patch) = lattice.patch(cell) {
                    worst.compare(lattice, cell, &patch);
                }
            }
            progress.advance(row as u64);
            Ok(worst)
        })
        .collect();
    progress.end();
    let worst = rows?.into_iter().fold(start, WorstOfCells::or);
    let rounding_m = ROUNDINGS * lattice.faces.hair.height_m;
    let WorstOfCells {
        worst: Worst { above, below },
        relative,
    } = worst;
    let requested = lattice.requested.filter(|_| cells.inner > 0);
    Ok(Vertical {
        above,
        below,
        rounding_m,
        slack_m: 0.0,
        relative: requested.map(|requested| relative.max(0.0) + rounding_m / requested.lowest_m),
        cells,
    })
}

/// The bound of each cell of four points, `None` for the others; m.
///
/// # Errors
/// [`Interrupted`] when the user asked to stop.
pub fn vertical_by_cell(
    lattice: &Lattice<'_>,
    progress: &dyn Progress,
) -> Result<Vec<Option<f64>>, Interrupted> {
    progress.begin("deviation of cells", lattice.len() as u64);
    let cells = (0..lattice.len())
        .into_par_iter()
        .with_min_len(progress::items_a_task(lattice.len()))
        .map(|cell| {
            if cell % CELLS_BETWEEN_LOOKS == 0 {
                progress.check()?;
                progress.advance(CELLS_BETWEEN_LOOKS as u64);
            }
            let patch = lattice.patch(cell);
            Ok(patch.map(|patch| lattice.faces.deviation_m(&patch, &lattice.members(cell))))
        })
        .collect();
    progress.end();
    cells
}

/// The largest differences over cells, and the largest relative to what is requested there.
#[derive(Debug, Clone, Copy)]
struct WorstOfCells {
    worst: Worst,
    relative: f64,
}

impl WorstOfCells {
    const NONE: Self = Self {
        worst: Worst::NONE,
        relative: f64::NEG_INFINITY,
    };

    fn or(self, other: Self) -> Self {
        Self {
            worst: self.worst.or(other.worst),
            relative: self.relative.max(other.relative),
        }
    }

    /// Compares a cell with its patch, as far as it may be the worst in either way.
    fn compare(&mut self, lattice: &Lattice<'_>, cell: usize, patch: &Patch) {
        let mut known = self.worst;
        let requested_m = lattice.requested.map(|requested| requested.height_m(patch));
        if let Some(requested_m) = requested_m {
            for extreme in [&mut known.above, &mut known.below] {
                extreme.value_m = extreme.value_m.min(self.relative * requested_m);
            }
        }
        let found = lattice
            .faces
            .worst(&patch.rect, &lattice.members(cell), patch, known);
        self.take(found, requested_m);
    }

    fn take(&mut self, found: Worst, requested_m: Option<f64>) {
        self.worst = self.worst.or(found);
        if let Some(requested_m) = requested_m {
            self.relative = self.relative.max(found.value_m() / requested_m);
        }
    }
}

/// The differences at the cells' centres: with them most pieces need no closer look.
fn start(
    mesh: &Mesh,
    grid: &Grid,
    lattice: &Lattice<'_>,
    progress: &dyn Progress,
) -> Result<WorstOfCells, Interrupted> {
    let mut worst = WorstOfCells::NONE;
    let middle = |axis: &Axis| Axis {
        from: axis.from + 0.5 * axis.step(),
        to: axis.to - 0.5 * axis.step(),
        samples: axis.samples.saturating_sub(1),
    };
    let centres = Grid {
        x_m: middle(&grid.x_m),
        y_m: middle(&grid.y_m),
    };
    if centres.is_empty() {
        return Ok(worst);
    }
    let (x, y) = (centres.x_m.nodes(), centres.y_m.nodes());
    let found = heights(mesh, &centres, progress)?;
    for (cell, sample) in found.iter().enumerate() {
        let (Some(sample), Some(patch)) = (sample, lattice.patch(cell)) else {
            continue;
        };
        let at_m = [x[cell % x.len()], y[cell / x.len()]];
        let value_m = sample.height_m - patch.height_m(at_m);
        let off = |value_m: f64| Extreme { value_m, at_m };
        let found = Worst {
            above: off(value_m),
            below: off(-value_m),
        };
        worst.take(
            found,
            lattice
                .requested
                .map(|requested| requested.height_m(&patch)),
        );
    }
    Ok(worst)
}

#[cfg(test)]
mod tests;
