//! The Hausdorff distance between the surface and the interpolated points, as an interval.
//!
//! A vertical difference on a slope overstates how far two surfaces lie apart. Both directed
//! distances are searched by branch and bound: a piece lies no farther than the farthest of its
//! corners from the triangle that is nearest to its centre, nor than its vertical difference. From
//! the points towards the surface its walls count as well; from the surface only what is seen from
//! above does.

use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::piece::{Face, Patch, Point, Polygon, Rect};
use super::visible::supremum_over_visible;
use super::{DEEPEST, Extreme, Faces, Lattice, Leaf, Vertical, Worst};
use crate::file_mesh::Triangle;
use crate::mesh::Mesh;
use fluxform_base::progress::{Interrupted, Progress};
use fluxform_numerics::nearest_triangle::Tree;

/// Relative width at which a search ends.
const NARROW: f64 = 0.01;
/// Pieces looked at, at most, in each direction.
const MOST: usize = 30_000;
/// Patches are split into so many parts a side, at most, to be compared as triangles.
const FINEST: f64 = 16.0;

/// A value that is known to lie between two others, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// It is at least this, m.
    pub lower_m: f64,
    /// And at most this, m.
    pub upper_m: f64,
    /// Where the lower value was found, m.
    pub at_m: [f64; 3],
}

/// The Hausdorff distance over the cells of four points; `None` where there is no such cell.
///
/// # Errors
/// [`Interrupted`] when the user asked to stop.
pub fn hausdorff(
    mesh: &Mesh,
    lattice: &Lattice<'_>,
    vertical: &Vertical,
    progress: &dyn Progress,
) -> Result<Option<Interval>, Interrupted> {
    let patches: Vec<(usize, Patch)> = (0..lattice.len())
        .filter_map(|cell| Some((cell, lattice.patch(cell)?)))
        .collect();
    if patches.is_empty() || vertical.worst().value_m == f64::NEG_INFINITY {
        return Ok(None);
    }
    let (points, slop_m) = triangulated(&patches, 0.002 * vertical.worst().value_m);
    let mut search = Search {
        faces: lattice.faces,
        surface: Tree::new(mesh.triangles()),
        points: Tree::new(&points),
        slop_m,
        rounding_m: vertical.rounding_m,
        lower_m: 0.0,
        at_m: [0.0; 3],
    };
    progress.begin("distance", 2);
    progress.check()?;
    // The values at the cells' centres and the worst places spare most pieces a closer look.
    for (_, patch) in &patches {
        search.bound_of_rect(&patch.rect, patch);
    }
    for (worst, sign) in [(vertical.above, 1.0), (vertical.below, -1.0)] {
        let over = |(_, patch): &&(usize, Patch)| patch.rect.holds(worst.at_m);
        if let Some((_, patch)) = patches.iter().find(over) {
            let [x, y] = worst.at_m;
            let at_m = [x, y, patch.height_m(worst.at_m) + sign * worst.value_m];
            search.found(search.points.nearest(at_m).0 - search.slop_m, at_m);
        }
    }
    let from_surface = search.surface_to_points(lattice, &patches, progress)?;
    progress.advance(1);
    let from_points = search.points_to_surface(lattice, &patches, progress)?;
    progress.end();
    let upper_m = from_surface.max(from_points);
    Ok(Some(Interval {
        lower_m: search.lower_m,
        upper_m: upper_m.min(vertical_bound(lattice, &patches, vertical, upper_m)),
        at_m: search.at_m,
    }))
}

/// The vertical bound where every cell is covered, else nothing better than `otherwise`.
fn vertical_bound(
    lattice: &Lattice<'_>,
    patches: &[(usize, Patch)],
    vertical: &Vertical,
    otherwise: f64,
) -> f64 {
    if otherwise <= vertical.bound_m() {
        return otherwise;
    }
    let covered = |(cell, patch): &(usize, Patch)| {
        let members = lattice.members(*cell);
        lattice.faces.covered(&patch.rect, &members, 0.0)
    };
    if patches.iter().all(covered) {
        vertical.bound_m()
    } else {
        otherwise
    }
}

/// The patches as triangles, and how far these lie from them at most, m.
fn triangulated(patches: &[(usize, Patch)], wanted_m: f64) -> (Vec<Triangle>, f64) {
    let mut triangles = Vec::with_capacity(2 * patches.len());
    let mut slop_m = 0.0_f64;
    for (_, patch) in patches {
        let twist_m = patch.twist_m().abs() / 4.0;
        let parts = (twist_m / wanted_m.max(f64::MIN_POSITIVE))
            .sqrt()
            .ceil()
            .clamp(1.0, FINEST);
        slop_m = slop_m.max(twist_m / (parts * parts));
        let at = |i: f64, j: f64| {
            let p = [(0, i), (1, j)].map(|(k, n)| {
                let t = n / parts;
                (1.0 - t) * patch.rect.low_m[k] + t * patch.rect.high_m[k]
            });
            [p[0], p[1], patch.height_m(p)]
        };
        let parts = parts as usize;
        for (i, j) in (0..parts * parts).map(|n| ((n % parts) as f64, (n / parts) as f64)) {
            let corners = [
                at(i, j),
                at(i + 1.0, j),
                at(i, j + 1.0),
                at(i + 1.0, j + 1.0),
            ];
            triangles.push([corners[0], corners[1], corners[3]]);
            triangles.push([corners[0], corners[3], corners[2]]);
        }
    }
    (triangles, slop_m)
}

/// Open intervals of a search.
struct Open<T> {
    bound_m: f64,
    /// Of equal bounds the earliest comes first.
    order: usize,
    part: T,
}

impl<T> PartialEq for Open<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl<T> Eq for Open<T> {}
impl<T> PartialOrd for Open<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl<T> Ord for Open<T> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.bound_m
            .total_cmp(&other.bound_m)
            .then(other.order.cmp(&self.order))
    }
}

/// Part of a face, with the faces that may hide it.
struct Part {
    face: Face,
    polygon: Polygon,
    others: std::rc::Rc<[Face]>,
    patch: Patch,
}

struct Search<'a> {
    faces: &'a Faces,
    surface: Tree,
    points: Tree,
    slop_m: f64,
    rounding_m: f64,
    lower_m: f64,
    at_m: [f64; 3],
}

impl Search<'_> {
    fn enough_m(&self) -> f64 {
        self.lower_m * (1.0 + NARROW) + self.rounding_m
    }

    fn found(&mut self, distance_m: f64, at_m: [f64; 3]) {
        if distance_m > self.lower_m {
            (self.lower_m, self.at_m) = (distance_m, at_m);
        }
    }

    /// An upper bound of the distances from the visible surface to the interpolated points.
    fn surface_to_points(
        &mut self,
        lattice: &Lattice<'_>,
        patches: &[(usize, Patch)],
        progress: &dyn Progress,
    ) -> Result<f64, Interrupted> {
        let mut open = BinaryHeap::new();
        for (cell, patch) in patches {
            progress.check()?;
            let faces = self.faces;
            faces.leaves(patch.rect, &lattice.members(*cell), DEEPEST, &mut |leaf| {
                self.begin(leaf, patch, &mut open)
            });
        }
        let mut looked = 0;
        while let Some(Open { bound_m, part, .. }) = open.pop() {
            fluxform_base::progress::poll();
            if bound_m <= self.enough_m() || looked >= MOST {
                return Ok(bound_m.max(self.enough_m()));
            }
            looked += 1;
            let split = {
                let (x, y) = (part.polygon.range(0), part.polygon.range(1));
                let k =
                    usize::from(part.face.length(1, y.1 - y.0) > part.face.length(0, x.1 - x.0));
                let middle = [x, y].map(|(low, high)| 0.5 * (low + high))[k];
                [
                    part.polygon.cut(|p| middle - p[k]),
                    part.polygon.cut(|p| p[k] - middle),
                ]
            };
            for polygon in split {
                let half = Part {
                    polygon,
                    others: part.others.clone(),
                    ..part
                };
                let bound_m = bound_m.min(self.bound(&half));
                if bound_m > self.enough_m() {
                    open.push(Open {
                        bound_m,
                        order: looked,
                        part: half,
                    });
                }
            }
        }
        Ok(self.enough_m())
    }

    /// Opens the visible pieces of a leaf whose vertical difference exceeds what is known.
    fn begin(&mut self, leaf: &Leaf<'_>, patch: &Patch, open: &mut BinaryHeap<Open<Part>>) {
        let look = self.faces.look();
        let list = &self.faces.list;
        let faces = leaf.faces.iter().map(|face| list[*face as usize]);
        // Of plain faces none hides another.
        let others: std::rc::Rc<[Face]> = match leaf.plain {
            true => std::rc::Rc::new([]),
            false => faces.clone().collect(),
        };
        for face in &faces.collect::<Vec<_>>() {
            let polygon = face.within(leaf.rect);
            if polygon.width() <= look.hair.plan_m / 4.0
                || difference(face, &polygon, patch).value_m <= self.enough_m()
            {
                continue;
            }
            let above = |p: Point| face.height(p) - patch.height_m(p);
            let below = |p: Point| -above(p);
            let piece = (leaf.rect, &polygon);
            let Some(above) = supremum_over_visible(face, piece, &others, look, &above) else {
                continue;
            };
            let below = supremum_over_visible(face, piece, &others, look, &below);
            let bound_m = below.map_or(above, |below| above.or(below)).value_m;
            let part = Part {
                face: *face,
                polygon,
                others: others.clone(),
                patch: *patch,
            };
            let bound_m = bound_m.min(self.bound(&part));
            if bound_m > self.enough_m() {
                open.push(Open {
                    bound_m,
                    order: open.len(),
                    part,
                });
            }
        }
    }

    /// A bound over the part; its centre may be the farthest known.
    fn bound(&mut self, part: &Part) -> f64 {
        let corners = part.polygon.corners();
        if corners.is_empty() {
            return 0.0;
        }
        let count = corners.len() as f64;
        let centre = [0, 1].map(|k| corners.iter().map(|p| p[k]).sum::<f64>() / count);
        let lifted = |p: Point| [p[0], p[1], part.face.height(p)];
        let at_m = lifted(centre);
        let (distance_m, nearest) = self.points.nearest(at_m);
        let most_m = self
            .points
            .farthest(nearest, corners.iter().map(|p| lifted(*p)));
        let hidden = part.others.iter().any(|other| {
            !other
                .hides(
                    &part.face,
                    &Polygon::of(&[centre]),
                    self.faces.hair.height_m,
                )
                .corners()
                .is_empty()
        });
        if !hidden {
            self.found(distance_m - self.slop_m, at_m);
        }
        (most_m + self.slop_m).min(difference(&part.face, &part.polygon, &part.patch).value_m)
    }

    /// An upper bound of the distances from the interpolated points to the surface.
    fn points_to_surface(
        &mut self,
        lattice: &Lattice<'_>,
        patches: &[(usize, Patch)],
        progress: &dyn Progress,
    ) -> Result<f64, Interrupted> {
        let mut open = BinaryHeap::new();
        for (order, (cell, patch)) in patches.iter().enumerate() {
            progress.check()?;
            let members = lattice.members(*cell);
            let covered = self.faces.covered(&patch.rect, &members, 0.0);
            let mut bound_m = self.bound_of_rect(&patch.rect, patch);
            if covered && bound_m > self.enough_m() {
                let known = Extreme {
                    value_m: self.enough_m(),
                    at_m: patch.rect.low_m,
                };
                let known = Worst {
                    above: known,
                    below: known,
                };
                let vertical = self.faces.worst(&patch.rect, &members, patch, known);
                bound_m = bound_m.min(vertical.value_m());
            }
            if bound_m > self.enough_m() {
                open.push(Open {
                    bound_m,
                    order,
                    part: (patch.rect, *patch),
                });
            }
        }
        let mut looked = 0;
        while let Some(Open { bound_m, part, .. }) = open.pop() {
            fluxform_base::progress::poll();
            if bound_m <= self.enough_m() || looked >= MOST {
                return Ok(bound_m.max(self.enough_m()));
            }
            looked += 1;
            let (rect, patch) = part;
            for half in rect.halves(patch.longer(&rect)) {
                let bound_m = bound_m.min(self.bound_of_rect(&half, &patch));
                if bound_m > self.enough_m() {
                    open.push(Open {
                        bound_m,
                        order: looked,
                        part: (half, patch),
                    });
                }
            }
        }
        Ok(self.enough_m())
    }

    /// A bound of the distances from part of a patch; its centre may be the farthest known.
    fn bound_of_rect(&mut self, rect: &Rect, patch: &Patch) -> f64 {
        let lifted = |p: Point| [p[0], p[1], patch.height_m(p)];
        let at_m = lifted(rect.centre());
        let (distance_m, nearest) = self.surface.nearest(at_m);
        self.found(distance_m, at_m);
        // A bilinear patch lies in the hull of its corners.
        self.surface
            .farthest(nearest, rect.corners().into_iter().map(lifted))
    }
}

/// The largest vertical difference over a part of a face, hidden or not.
fn difference(face: &Face, polygon: &Polygon, patch: &Patch) -> Extreme {
    let above = polygon.supremum(|p| face.height(p) - patch.height_m(p));
    above.or(polygon.supremum(|p| patch.height_m(p) - face.height(p)))
}
