//! What stands over a rectangle: the surface that covers it, and what of that rises above a patch.

use super::piece::{Patch, Point, Polygon, Rect};
use super::union::area_m2;
use super::{Faces, Lattice};

/// Faces below a patch that are looked at, at most.
const FLOORS: usize = 4;
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

    /// The faces that surpass a patch by more than `by_m`; `None` without any.
    pub(crate) fn risen(&self, patch: &Patch, among: &[u32], by_m: f64) -> Option<Standing> {
        let pieces: Vec<Polygon> = (self.rising(patch, among, by_m))
            .map(|(piece, _)| piece)
            .collect();
        Standing::of(&pieces, area_m2(&pieces))
    }

    /// By how much the surface lies below a patch, if by more than `by_m`, as far as looks at some places tell, m: the
    /// middles of the highest faces that do so, since a floor below the surface lies lower, and some of the whole, since
    /// faces may be larger. 0 where there is no such face, or none is seen. `height_m` is that of the surface.
    pub(crate) fn fall_m(
        &self,
        (patch, among): (&Patch, &[u32]),
        by_m: f64,
        mut height_m: impl FnMut(Point) -> Option<f64>,
    ) -> f64 {
        let faces = among.iter().map(|face| &self.list[*face as usize]);
        let middles = faces.filter_map(|face| {
            let [_, most_m] = face.most_off_m(&patch.rect, patch, self.hair);
            let piece = (most_m > by_m).then(|| face.within(&patch.rect))?;
            let middle = piece.middle();
            (piece.width() > self.hair.plan_m).then(|| (middle, face.height(middle)))
        });
        let mut middles: Vec<(Point, f64)> = middles.collect();
        if middles.is_empty() {
            return 0.0;
        }
        middles.sort_by(|a, b| b.1.total_cmp(&a.1));
        let middles = middles.iter().take(FLOORS).map(|(at, _)| *at);
        let of_whole = PLACES.map(|part| patch.rect.at(part));
        let falls = (middles.chain(of_whole))
            .filter_map(|at| Some(patch.height_m(at) - height_m(at)?))
            .find(|fall_m| *fall_m > by_m);
        falls.unwrap_or(0.0)
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

    /// [`Faces::fall_m`] over a cell of four points; 0 over others.
    pub(crate) fn fall_m(
        &self,
        cell: usize,
        by_m: f64,
        height_m: impl FnMut(Point) -> Option<f64>,
    ) -> f64 {
        let fall_m = |patch: Patch| {
            let among = self.members(cell);
            self.faces.fall_m((&patch, &among), by_m, height_m)
        };
        self.patch(cell).map_or(0.0, fall_m)
    }
}
