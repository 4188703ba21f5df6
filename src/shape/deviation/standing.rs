//! What stands over a rectangle: the surface that covers it, and what of that rises above a patch.

use super::piece::{Patch, Point, Polygon, Rect};
use super::union::area_m2;
use super::{Faces, Lattice};

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
        let corners = pieces.iter().max_by(larger)?.corners();
        let sum = |k: usize| corners.iter().map(|corner| corner[k]).sum::<f64>();
        (area_m2 > 0.0).then(|| Self {
            at_m: [0, 1].map(|k| sum(k) / corners.len() as f64),
            area_m2,
        })
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
}
