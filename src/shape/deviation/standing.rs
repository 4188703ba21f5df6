//! What stands over a rectangle: the surface that covers it, and what of that rises above a patch.

use super::piece::{Face, Patch, Point, Polygon, Rect};
use super::union::area_m2;
use super::{Faces, Lattice};

/// Faces below a patch that are looked at, at most.
const FLOORS: usize = 4;
/// Faces whose area is united, at most.
const MOST_PIECES: usize = 32;
/// A smaller share of a rectangle is no area: faces that meet leave rounding open.
const NO_AREA: f64 = 1e-4;
/// Places of a rectangle, as parts of its sides, that leave no quarter of either side out beside its middle.
const PLACES: [Point; 4] = [[0.27, 0.83], [0.71, 0.36], [0.13, 0.19], [0.89, 0.61]];

/// A part of the surface over a rectangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Standing {
    /// A place that it covers, m.
    pub(crate) at_m: Point,
    /// Its plan area, m^2, > 0.
    pub(crate) area_m2: f64,
}

impl Standing {
    /// Of the largest of `pieces`; `None` without area.
    fn of(pieces: &[Polygon], area_m2: f64) -> Option<Self> {
        let larger = |p: &&Polygon, q: &&Polygon| p.area().total_cmp(&q.area());
        let at_m = pieces.iter().max_by(larger)?.middle();
        (area_m2 > 0.0).then_some(Self { at_m, area_m2 })
    }
}

impl Faces {
    /// The surface over a rectangle; `None` where there is none but for rounding.
    pub(crate) fn standing(&self, rect: &Rect, among: &[u32]) -> Option<Standing> {
        let faces = among.iter().map(|face| &self.list[*face as usize]);
        let pieces: Vec<Polygon> = (faces.map(|face| face.within(rect)))
            .filter(|piece| piece.width() > self.hair.plan_m)
            .collect();
        if pieces.is_empty() {
            return None;
        }
        Standing::of(&pieces, self.covered_m2(rect, among))
    }

    /// By how much a patch is surpassed at most, 0 where nowhere, m. A face that is hidden lies lower than the
    /// one that hides it: which are visible need not be known.
    pub(crate) fn rise_m(&self, patch: &Patch, among: &[u32]) -> f64 {
        let above = (self.rising(patch, among, 0.0)).map(|(_, by_m)| by_m);
        above.fold(0.0, f64::max)
    }

    /// The highest place of the surface over a rectangle, m; `None` without any.
    pub(crate) fn highest_m(&self, rect: &Rect, among: &[u32]) -> Option<f64> {
        let heights = self.pieces(rect, among, f64::NEG_INFINITY);
        let corners = heights.flat_map(|(face, piece)| {
            let corners = piece.corners().iter().map(|p| face.height(*p));
            corners.fold(None, |most: Option<f64>, z| {
                Some(most.map_or(z, |m| m.max(z)))
            })
        });
        corners.reduce(f64::max)
    }

    /// What of the surface over a rectangle lies above a level; `None` where nothing does, or too many faces do.
    pub(crate) fn above(&self, rect: &Rect, among: &[u32], level_m: f64) -> Option<Standing> {
        let pieces = self.pieces(rect, among, level_m).take(MOST_PIECES + 1);
        let pieces: Vec<Polygon> = pieces
            .map(|(_, piece)| piece)
            .filter(|piece| piece.width() > self.hair.plan_m)
            .collect();
        if pieces.is_empty() || pieces.len() > MOST_PIECES {
            return None;
        }
        Standing::of(&pieces, area_m2(&pieces))
    }

    /// No less than the area of what lies above a level: faces over each other count each, m^2.
    pub(crate) fn above_m2(&self, rect: &Rect, among: &[u32], level_m: f64) -> f64 {
        let pieces = self.pieces(rect, among, level_m);
        pieces.map(|(_, piece)| piece.area()).sum()
    }

    /// The faces that reach above a level, with the pieces of them over a rectangle that do.
    fn pieces<'a>(
        &'a self,
        rect: &'a Rect,
        among: &'a [u32],
        level_m: f64,
    ) -> impl Iterator<Item = (&'a Face, Polygon)> + 'a {
        let faces = among.iter().map(|face| &self.list[*face as usize]);
        let reaching = faces.filter(move |face| face.heights[1] > level_m);
        reaching.map(move |face| {
            let piece = face.within(rect);
            match face.heights[0] >= level_m {
                true => (face, piece),
                false => (face, piece.cut(|p| face.height(p) - level_m)),
            }
        })
    }

    /// Whether a patch is surpassed by more than `by_m`.
    pub(crate) fn rises(&self, patch: &Patch, among: &[u32], by_m: f64) -> bool {
        self.rising(patch, among, by_m).next().is_some()
    }

    /// The area over which the surface lies below a patch by more than `by_m`, or has gaps, m^2: what no face covers that
    /// lies higher somewhere.
    pub(crate) fn fallen_m2(&self, patch: &Patch, among: &[u32], by_m: f64) -> f64 {
        let pieces = among.iter().filter_map(|face| {
            let face = &self.list[*face as usize];
            let [above_m, below_m] = face.most_off_m(&patch.rect, patch, self.hair);
            let piece = (above_m > -by_m).then(|| face.within(&patch.rect))?;
            let reaches = || {
                piece
                    .supremum(|p| face.height(p) - patch.height_m(p))
                    .value_m
                    > -by_m
            };
            (below_m <= by_m || reaches()).then_some(piece)
        });
        let pieces: Vec<Polygon> = pieces.collect();
        let [width, depth] = patch.rect.sides();
        let sum_m2: f64 = pieces.iter().map(Polygon::area).sum();
        // No more than all: nothing is covered twice.
        let covered_m2 = match sum_m2 <= width * depth * (1.0 + NO_AREA) {
            true => sum_m2,
            false => area_m2(&pieces),
        };
        let open_m2 = width * depth - covered_m2;
        if open_m2 > NO_AREA * width * depth {
            open_m2
        } else {
            0.0
        }
    }

    /// The lowest place under a patch, below it by more than `by_m`, among some that are looked at, with its height, m: the
    /// middles of the highest faces that lie so, since a floor below the surface lies lower, and some of the whole, since
    /// faces may be larger. `height_m` is that of the surface.
    pub(crate) fn fallen_to(
        &self,
        (patch, among): (&Patch, &[u32]),
        by_m: f64,
        mut height_m: impl FnMut(Point) -> Option<f64>,
    ) -> Option<(Point, f64)> {
        let faces = among.iter().map(|face| &self.list[*face as usize]);
        let middles = faces.filter_map(|face| {
            let [_, most_m] = face.most_off_m(&patch.rect, patch, self.hair);
            let piece = (most_m > by_m).then(|| face.within(&patch.rect))?;
            let middle = piece.middle();
            (piece.width() > self.hair.plan_m).then(|| (middle, face.height(middle)))
        });
        let mut middles: Vec<(Point, f64)> = middles.collect();
        middles.sort_by(|a, b| b.1.total_cmp(&a.1));
        let middles = middles.iter().take(FLOORS).map(|(at, _)| *at);
        let of_whole = PLACES.map(|part| patch.rect.at(part));
        let seen = (middles.chain(of_whole)).filter_map(|at| Some((at, height_m(at)?)));
        seen.filter(|(at, height_m)| patch.height_m(*at) - height_m > by_m)
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The pieces of faces over a patch that surpass it by more than `by_m`, and by how much.
    fn rising<'a>(
        &'a self,
        patch: &'a Patch,
        among: &'a [u32],
        by_m: f64,
    ) -> impl Iterator<Item = (Polygon, f64)> + 'a {
        let faces = among.iter().map(|face| &self.list[*face as usize]);
        faces.filter_map(move |face| {
            let [most_m, _] = face.most_off_m(&patch.rect, patch, self.hair);
            if most_m <= by_m {
                return None;
            }
            let piece = face.within(&patch.rect);
            let above = piece.supremum(|p| face.height(p) - patch.height_m(p));
            (piece.width() > self.hair.plan_m && above.value_m > by_m)
                .then_some((piece, above.value_m))
        })
    }
}

impl Lattice<'_> {
    /// Its faces.
    pub(crate) fn faces(&self) -> &Faces {
        self.faces
    }

    /// [`Faces::standing`] over a cell.
    pub(crate) fn standing(&self, cell: usize) -> Option<Standing> {
        self.faces.standing(&self.rect(cell), &self.members(cell))
    }

    /// [`Faces::rise_m`] over a cell of four points; 0 over others.
    pub(crate) fn rise_m(&self, cell: usize) -> f64 {
        let rise_m = |patch: Patch| self.faces.rise_m(&patch, &self.members(cell));
        self.patch(cell).map_or(0.0, rise_m)
    }

    /// [`Faces::fallen_m2`] over a cell of four points; 0 over others.
    pub(crate) fn fallen_m2(&self, cell: usize, by_m: f64) -> f64 {
        let fallen = |patch: Patch| self.faces.fallen_m2(&patch, &self.members(cell), by_m);
        self.patch(cell).map_or(0.0, fallen)
    }
}
