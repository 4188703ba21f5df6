//! The faces of bodies with upright sides that hang together: none where their steel is one.
//!
//! Sides of rectangles cut the plane into cells, ends cut height into slabs, and discs lie over the cells. What two
//! discs act on at one height is nested or apart. Faces lie between different steels, or steel and none: rectangles
//! gathered from cells, rings about discs, sides of cylinders.

use super::face::{Curve, Face, Point, SAME_M};
use super::plate::{Fault, is_apart, widened};
use super::prisms::{Prism, from_rectangle_m};
use super::round_faces::{Cell, Rim, Site, cylinder_side, disc};

/// A face, and the number of a body that it bounds.
pub(super) type Bound = (Face, usize);

/// Of cells: the first and one beyond the last along either axis.
type Rectangle = [[usize; 2]; 2];

/// Relative permeabilities less one on the two sides of a face, the lower or inner one first.
type Sides = [f64; 2];

/// The faces of `prisms`; none crosses the planes x = and y = `cuts_m` but such as are cut about discs. Sides of cores
/// are cut at `ends_m`, the windings' ends.
///
/// # Errors
/// [`Fault::Crosses`].
pub(super) fn faces(
    prisms: &[Prism],
    cuts_m: [Option<f64>; 2],
    ends_m: [f64; 2],
) -> Result<Vec<Bound>, Fault> {
    let arrangement = Arrangement::new(prisms, cuts_m);
    let mut out = Vec::new();
    for axis in 0..2 {
        for plane in 0..arrangement.planes[axis].len() {
            arrangement.add_sides(axis, plane, &mut out);
        }
    }
    for disc in 0..arrangement.discs.len() {
        arrangement.add_cylinder(disc, ends_m, &mut out)?;
    }
    for plane in 0..arrangement.planes[2].len() {
        let level = Level::new(&arrangement, plane)?;
        level.add_faces(&mut out)?;
    }
    Ok(out)
}

/// A circle, and the cells that it is over; `None` outside all rectangles.
struct Disc {
    site: Site,
    cells: Vec<Option<[usize; 2]>>,
}

struct Arrangement<'a> {
    prisms: &'a [Prism],
    /// Of every body its own disc, if it has one, and its holes.
    circles: Vec<(Option<usize>, Vec<usize>)>,
    planes: [Vec<f64>; 3],
    /// Numbers of planes x = and y = that faces do not cross.
    cuts: [Option<usize>; 3],
    discs: Vec<Disc>,
}

impl<'a> Arrangement<'a> {
    fn new(prisms: &'a [Prism], [x, y]: [Option<f64>; 2]) -> Self {
        let cuts_m = [x, y, None];
        let planes = [0, 1, 2].map(|axis| {
            let bounds = |prism: &&Prism| axis == 2 || prism.disc().is_none();
            let ends = prisms.iter().filter(bounds).map(Prism::ends_m);
            let mut planes: Vec<f64> = ends
                .flat_map(|[low, high]| [low[axis], high[axis]])
                .collect();
            planes.sort_by(f64::total_cmp);
            if let (Some(cut), Some(low), Some(high)) =
                (cuts_m[axis], planes.first(), planes.last())
                && (*low..*high).contains(&cut)
            {
                planes.push(cut);
                planes.sort_by(f64::total_cmp);
            }
            planes.dedup_by(|a, b| *a - *b < SAME_M);
            planes
        });
        let mut made = Self {
            prisms,
            circles: Vec::new(),
            cuts: [0, 1, 2].map(|axis| {
                let at = |plane: &f64| cuts_m[axis].is_some_and(|cut| (plane - cut).abs() < SAME_M);
                planes[axis].iter().position(at)
            }),
            planes,
            discs: Vec::new(),
        };
        for prism in prisms {
            let own = prism.disc().map(|site| made.disc(site));
            let holes = prism.holes.iter().map(|site| made.disc(*site)).collect();
            made.circles.push((own, holes));
        }
        made
    }

    /// The number of a disc, which is added if it is not there.
    fn disc(&mut self, site: Site) -> usize {
        if let Some(known) = self.discs.iter().position(|disc| disc.site.is(&site)) {
            return known;
        }
        let cells = self.cells(&site);
        self.discs.push(Disc { site, cells });
        self.discs.len() - 1
    }

    fn counts(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.planes[axis].len().saturating_sub(1))
    }

    /// The cells that a disc is over.
    fn cells(&self, site: &Site) -> Vec<Option<[usize; 2]>> {
        let [nx, ny, _] = self.counts();
        let [xs, ys, _] = &self.planes;
        let ends = |[u0, v0]: [usize; 2], [u1, v1]: [usize; 2]| {
            [[xs[u0], ys[v0], 0.0], [xs[u1], ys[v1], 0.0]]
        };
        let all = (0..nx * ny).map(|k| [k / ny, k % ny]);
        let over =
            |[u, v]: &[usize; 2]| from_rectangle_m(site, ends([*u, *v], [u + 1, v + 1])) < -SAME_M;
        let mut cells: Vec<_> = all.filter(over).map(Some).collect();
        if nx * ny == 0 || !is_within(site, ends([0, 0], [nx, ny])) {
            cells.push(None);
        }
        cells
    }

    fn covers_slab(&self, prism: usize, slab: usize) -> bool {
        let [low, high] = self.prisms[prism].heights_m;
        let middle = 0.5 * (self.planes[2][slab] + self.planes[2][slab + 1]);
        low < middle && middle < high
    }

    /// Whether a disc bounds anything in a slab.
    fn acts(&self, disc: usize, slab: usize) -> bool {
        (self.circles.iter().enumerate()).any(|(prism, (own, holes))| {
            (*own == Some(disc) || holes.contains(&disc)) && self.covers_slab(prism, slab)
        })
    }

    /// The body over a cell within the discs `chain` and no others, the core if it is one.
    fn body(&self, cell: Option<[usize; 2]>, chain: &[usize], slab: usize) -> Option<usize> {
        let covers = |prism: &usize| {
            let (own, holes) = &self.circles[*prism];
            let in_plan = match own {
                Some(disc) => chain.contains(disc),
                None => cell.is_some_and(|cell| self.covers_cell(*prism, cell)),
            };
            in_plan
                && !holes.iter().any(|hole| chain.contains(hole))
                && self.covers_slab(*prism, slab)
        };
        let all = || (0..self.prisms.len()).filter(covers);
        let core = all().find(|prism| self.prisms[*prism].core.is_some());
        core.or_else(|| all().next())
    }

    fn covers_cell(&self, prism: usize, cell: [usize; 2]) -> bool {
        let [low, high] = self.prisms[prism].ends_m();
        (0..2).all(|axis| {
            let planes = &self.planes[axis];
            let middle = 0.5 * (planes[cell[axis]] + planes[cell[axis] + 1]);
            low[axis] < middle && middle < high[axis]
        })
    }

    fn chi(&self, body: Option<usize>) -> f64 {
        body.map_or(0.0, |body| self.prisms[body].chi)
    }

    /// What lies within the discs `chain` over the cells of one; `None` where that differs from cell to cell.
    fn within(&self, over: usize, chain: &[usize], slab: usize) -> Option<f64> {
        let cells = self.discs[over].cells.iter();
        let mut all = cells.map(|cell| self.chi(self.body(*cell, chain, slab)));
        let first = all.next()?;
        all.all(|chi| chi == first).then_some(first)
    }

    /// Of every disc of `acting` those that hold it, itself first and the largest last.
    fn chains(&self, acting: &[usize]) -> Result<Vec<Vec<usize>>, Fault> {
        let chain = |own: &usize| {
            let site = self.discs[*own].site;
            let mut chain = vec![*own];
            for other in acting.iter().filter(|other| *other != own) {
                let around = self.discs[*other].site;
                if around.holds(&site) {
                    chain.push(*other);
                } else if !site.holds(&around) && site.apart_m(&around) < -SAME_M {
                    return Err(Fault::Crosses(site));
                }
            }
            chain.sort_by(|a, b| {
                let radius = |disc: &usize| self.discs[*disc].site.radius_m;
                radius(a).total_cmp(&radius(b))
            });
            Ok(chain)
        };
        acting.iter().map(chain).collect()
    }

    /// The bodies before and after a plane, at a place in it.
    fn bodies_at(&self, axis: usize, plane: usize, [u, v]: [usize; 2]) -> [Option<usize>; 2] {
        let counts = self.counts();
        let of = |along: usize| {
            let mut at = [0; 3];
            at[axis] = along;
            at[(axis + 1) % 3] = u;
            at[(axis + 2) % 3] = v;
            let inside = (0..3).all(|k| at[k] < counts[k]);
            inside.then(|| self.body(Some([at[0], at[1]]), &[], at[2]))?
        };
        [plane.checked_sub(1).and_then(of), of(plane)]
    }

    fn sides(&self, axis: usize, plane: usize, at: [usize; 2]) -> Sides {
        self.bodies_at(axis, plane, at).map(|body| self.chi(body))
    }

    /// Whether a plane has a face over a cell.
    fn is_open(&self, axis: usize, plane: usize, at: [usize; 2]) -> bool {
        let [before, after] = self.sides(axis, plane, at);
        before != after
    }

    /// Rectangles of cells of one plane with a face that are alike, first and last along the two axes after `axis`:
    /// `whole` are parts of one each.
    fn rectangles(&self, axis: usize, plane: usize, whole: Vec<Rectangle>) -> Vec<Rectangle> {
        let counts = self.counts();
        let [nu, nv] = [1, 2].map(|k| counts[(axis + k) % 3]);
        let mut open: Vec<bool> = (0..nu * nv)
            .map(|k| self.is_open(axis, plane, [k / nv, k % nv]))
            .collect();
        let close = |open: &mut Vec<bool>, [[u0, u1], [v0, v1]]: Rectangle| {
            for u in u0..u1 {
                open[u * nv + v0..u * nv + v1].fill(false);
            }
        };
        let grow = |open: &[bool], rectangle: Rectangle| {
            let [[mut u0, mut u1], [mut v0, mut v1]] = rectangle;
            let own = self.sides(axis, plane, [u0, v0]);
            let fits =
                |u: usize, v: usize| open[u * nv + v] && self.sides(axis, plane, [u, v]) == own;
            while v1 < nv && (u0..u1).all(|u| fits(u, v1)) {
                v1 += 1;
            }
            while v0 > 0 && (u0..u1).all(|u| fits(u, v0 - 1)) {
                v0 -= 1;
            }
            while u1 < nu && (v0..v1).all(|v| fits(u1, v)) {
                u1 += 1;
            }
            while u0 > 0 && (v0..v1).all(|v| fits(u0 - 1, v)) {
                u0 -= 1;
            }
            [[u0, u1], [v0, v1]]
        };
        whole
            .iter()
            .for_each(|rectangle| close(&mut open, *rectangle));
        let mut out = Vec::new();
        for rectangle in whole {
            let grown = grow(&open, rectangle);
            close(&mut open, grown);
            out.push(grown);
        }
        for first in 0..nu * nv {
            if open[first] {
                let (u, v) = (first / nv, first % nv);
                let grown = grow(&open, [[u, u + 1], [v, v + 1]]);
                close(&mut open, grown);
                out.push(grown);
            }
        }
        out
    }

    /// The rectangle of the cells that a disc is over; `None` where it reaches beyond all rectangles.
    fn around(&self, site: &Site) -> Option<Rectangle> {
        let cells: Option<Vec<[usize; 2]>> = self.cells(site).into_iter().collect();
        let cells = cells?;
        let along = |k: usize| {
            let numbers = cells.iter().map(|cell| cell[k]);
            Some([numbers.clone().min()?, numbers.max()? + 1])
        };
        Some([along(0)?, along(1)?])
    }

    /// Whether the layer changes quickly at the sides of a rectangle of cells: at its first and last along either axis.
    fn sharp(&self, axis: usize, plane: usize, [[u0, u1], [v0, v1]]: Rectangle) -> [bool; 4] {
        let own = self.sides(axis, plane, [u0, v0]);
        // Before the first row and column there is nothing.
        let differs = |u: Option<usize>, v: Option<usize>| match (u, v) {
            (Some(u), Some(v)) => self.sides(axis, plane, [u, v]) != own,
            _ => true,
        };
        [
            (v0..v1).any(|v| differs(u0.checked_sub(1), Some(v))),
            (v0..v1).any(|v| differs(Some(u1), Some(v))),
            (u0..u1).any(|u| differs(Some(u), v0.checked_sub(1))),
            (u0..u1).any(|u| differs(Some(u), Some(v1))),
        ]
    }

    /// A rectangle of cells as faces, parted at the cuts.
    fn add_rectangle(&self, axis: usize, plane: usize, [us, vs]: Rectangle, out: &mut Vec<Bound>) {
        let parts = |[first, last]: [usize; 2], along: usize| match self.cuts[along] {
            Some(cut) if first < cut && cut < last => vec![[first, cut], [cut, last]],
            _ => vec![[first, last]],
        };
        let (across, along) = ((axis + 1) % 3, (axis + 2) % 3);
        for us in parts(us, across) {
            for vs in parts(vs, along) {
                let at = |u: usize, v: usize| {
                    let mut at = [0.0; 3];
                    at[axis] = self.planes[axis][plane];
                    at[across] = self.planes[across][u];
                    at[along] = self.planes[along][v];
                    at
                };
                let [[u0, u1], [v0, v1]] = [us, vs];
                let mut after = at(u0, v0);
                after[axis] += 1.0;
                let face = Face::ruled(
                    Curve::segment(at(u0, v0), at(u1, v0)),
                    Curve::segment(at(u0, v1), at(u1, v1)),
                    self.sharp(axis, plane, [us, vs]),
                    after,
                );
                self.add(face, self.bodies_at(axis, plane, [u0, v0]), out);
            }
        }
    }

    /// Adds a face whose normal goes from the first body to the second.
    fn add(&self, mut face: Face, bodies: [Option<usize>; 2], out: &mut Vec<Bound>) {
        face.chi = bodies.map(|body| self.chi(body));
        // The normal leaves steel.
        if face.chi[0] == 0.0 {
            face.chi.reverse();
            face = face.turned();
        }
        let known = || bodies.iter().flatten();
        let core = known().find(|body| self.prisms[**body].core.is_some());
        if let Some(body) = core.or_else(|| known().next()) {
            out.push((face, *body));
        }
    }

    /// The faces in a plane x = or y =.
    fn add_sides(&self, axis: usize, plane: usize, out: &mut Vec<Bound>) {
        for rectangle in self.rectangles(axis, plane, Vec::new()) {
            self.add_rectangle(axis, plane, rectangle, out);
        }
    }

    /// The sides of a cylinder, from slab to slab as far as they are alike.
    fn add_cylinder(
        &self,
        own: usize,
        ends_m: [f64; 2],
        out: &mut Vec<Bound>,
    ) -> Result<(), Fault> {
        let site = self.discs[own].site;
        let mut from: Option<(usize, [Option<usize>; 2])> = None;
        let heights = &self.planes[2];
        let mut add = |first: usize, last: usize, bodies: [Option<usize>; 2]| {
            let [low, high] = [heights[first], heights[last]];
            let is_core = bodies
                .iter()
                .flatten()
                .any(|body| self.prisms[*body].core.is_some());
            for mut face in cylinder_side(site.at_m, site.radius_m, [low, high]) {
                for end_m in ends_m.into_iter().filter(|_| is_core) {
                    face = face.cut((end_m - low) / (high - low));
                }
                self.add(face, bodies, out);
            }
        };
        for slab in 0..self.counts()[2] {
            let bodies = self.beside(own, slab)?;
            if let Some((first, before)) = from {
                if bodies.is_some_and(|bodies| self.is_alike(before, bodies)) {
                    continue;
                }
                add(first, slab, before);
            }
            from = bodies.map(|bodies| (slab, bodies));
        }
        if let Some((first, bodies)) = from {
            add(first, heights.len() - 1, bodies);
        }
        Ok(())
    }

    /// Whether the steel on both sides, and the core if it is one, are the same.
    fn is_alike(&self, own: [Option<usize>; 2], other: [Option<usize>; 2]) -> bool {
        let of = |body: Option<usize>| (self.chi(body), body.and_then(|k| self.prisms[k].core));
        own.map(of) == other.map(of)
    }

    /// The bodies inside and outside a disc's side in a slab, where there is a face.
    fn beside(&self, own: usize, slab: usize) -> Result<Option<[Option<usize>; 2]>, Fault> {
        if !self.acts(own, slab) {
            return Ok(None);
        }
        let acting: Vec<usize> = (0..self.discs.len())
            .filter(|d| self.acts(*d, slab))
            .collect();
        let chains = self.chains(&acting)?;
        let chain = chains.into_iter().find(|chain| chain[0] == own);
        let chain = chain.expect("a disc that acts has a chain");
        let ways = [&chain[..], &chain[1..]];
        let crosses = Fault::Crosses(self.discs[own].site);
        let chis = ways.map(|chain| self.within(own, chain, slab));
        let [Some(inner), Some(outer)] = chis else {
            return Err(crosses);
        };
        let cell = self.discs[own].cells[0];
        let bodies = ways.map(|chain| self.body(cell, chain, slab));
        Ok((inner != outer).then_some(bodies))
    }
}

fn is_within(site: &Site, [low, high]: [Point; 2]) -> bool {
    (0..2).all(|k| {
        let (at, reach) = (site.at_m[k], site.radius_m - SAME_M);
        low[k] <= at - reach && at + reach <= high[k]
    })
}

fn overlap(a: Rectangle, b: Rectangle) -> bool {
    (0..2).all(|k| a[k][0] < b[k][1] && b[k][0] < a[k][1])
}

/// A disc at one height.
struct Spot {
    site: Site,
    /// Below and above.
    bodies: [Option<usize>; 2],
    /// The spot that holds it.
    parent: Option<usize>,
    /// Whether the layer changes quickly at its rim.
    sharp: bool,
    /// Whether it only serves to cut.
    is_mark: bool,
}

/// The faces at one height.
struct Level<'a> {
    of: &'a Arrangement<'a>,
    plane: usize,
    /// Larger ones first.
    spots: Vec<Spot>,
}

impl<'a> Level<'a> {
    fn new(of: &'a Arrangement<'a>, plane: usize) -> Result<Self, Fault> {
        let slabs = [plane.checked_sub(1), Some(plane)];
        let slabs = slabs.map(|slab| slab.filter(|slab| *slab < of.counts()[2]));
        let acts = |disc: &usize| slabs.iter().flatten().any(|slab| of.acts(*disc, *slab));
        let acting: Vec<usize> = (0..of.discs.len()).filter(acts).collect();
        let mut chains = of.chains(&acting)?;
        chains.sort_by_key(Vec::len);
        let mut spots: Vec<(Spot, usize)> = Vec::new();
        let differ = |over: usize, own: &[usize], other: &[usize]| {
            let cells = of.discs[over].cells.iter();
            let chi = |cell: &Option<[usize; 2]>, chain: &[usize]| {
                slabs.map(|slab| slab.map_or(0.0, |slab| of.chi(of.body(*cell, chain, slab))))
            };
            cells.clone().any(|cell| chi(cell, own) != chi(cell, other))
        };
        for chain in &chains {
            let own = chain[0];
            let around = &chain[1..];
            // One that nothing differs at, nor within.
            let inner = chains.iter().filter(|inner| inner.contains(&own));
            if !inner
                .clone()
                .any(|inner| differ(inner[0], inner, &inner[1..]))
            {
                continue;
            }
            let site = of.discs[own].site;
            let known = |slab: usize| of.within(own, chain, slab);
            if slabs.iter().flatten().any(|slab| known(*slab).is_none()) {
                return Err(Fault::Crosses(site));
            }
            let cell = of.discs[own].cells[0];
            let mut parent =
                (around.iter()).filter_map(|disc| spots.iter().position(|(_, of)| of == disc));
            let spot = Spot {
                site,
                bodies: slabs.map(|slab| slab.and_then(|slab| of.body(cell, chain, slab))),
                parent: parent.next(),
                sharp: differ(own, chain, around),
                is_mark: false,
            };
            spots.push((spot, own));
        }
        let mut level = Self {
            of,
            plane,
            spots: spots.into_iter().map(|(spot, _)| spot).collect(),
        };
        level.add_marks();
        Ok(level)
    }

    /// Adds the marks of the bodies that end here, where they are clear of discs.
    fn add_marks(&mut self) {
        let height_m = self.of.planes[2][self.plane];
        let ends_here =
            |prism: &&Prism| (prism.heights_m.iter()).any(|end| (end - height_m).abs() < SAME_M);
        let prisms = self.of.prisms.iter().filter(ends_here);
        let marks: Vec<&Site> = prisms.flat_map(|prism| &prism.marks).collect();
        for mark in &marks {
            let real = self.spots.iter().filter(|spot| !spot.is_mark);
            // A narrow ring between a rim and a mark would stand for the edge, and the disc within end coarsely.
            let clear = |site: &Site| site.holds(&widened(mark)) || is_apart(site, mark);
            let cut = |other: &&Site| !other.is(mark) && other.apart_m(mark) < SAME_M;
            if !real.map(|spot| &spot.site).all(clear) || marks.iter().copied().any(|m| cut(&m)) {
                continue;
            }
            let parent = self.spots.iter().rposition(|spot| spot.site.holds(mark));
            let bodies = parent.map_or([None; 2], |parent| self.spots[parent].bodies);
            self.spots.push(Spot {
                site: **mark,
                bodies,
                parent,
                sharp: false,
                is_mark: true,
            });
        }
    }

    /// Rectangles of cells that faces about discs need whole.
    ///
    /// # Errors
    /// A disc over cells that are not alike, some with a face.
    fn whole(&self) -> Result<Vec<Rectangle>, Fault> {
        let mut out: Vec<Rectangle> = Vec::new();
        let sides = |u: usize, v: usize| self.of.sides(2, self.plane, [u, v]);
        let is_alike = |[[u0, u1], [v0, v1]]: Rectangle| {
            (u0..u1).all(|u| (v0..v1).all(|v| sides(u, v) == sides(u0, v0)))
        };
        for spot in self.spots.iter().filter(|spot| spot.parent.is_none()) {
            let over =
                |at: &Option<[usize; 2]>| at.is_some_and(|at| self.of.is_open(2, self.plane, at));
            if !self.of.cells(&spot.site).iter().any(over) {
                continue;
            }
            let around = self.of.around(&spot.site);
            let Some(mut around) = around.filter(|around| is_alike(*around)) else {
                if spot.is_mark {
                    continue;
                }
                return Err(Fault::Crosses(spot.site));
            };
            // With others that it overlaps.
            while let Some(at) = out.iter().position(|other| overlap(*other, around)) {
                let other = out.swap_remove(at);
                around = [0, 1].map(|k| {
                    let ([a0, a1], [b0, b1]) = (other[k], around[k]);
                    [a0.min(b0), a1.max(b1)]
                });
            }
            if !is_alike(around) {
                return Err(Fault::Crosses(spot.site));
            }
            out.push(around);
        }
        Ok(out)
    }

    fn add_faces(&self, out: &mut Vec<Bound>) -> Result<(), Fault> {
        let (of, plane) = (self.of, self.plane);
        let height_m = of.planes[2][plane];
        let room = |spot: &Spot| [spot.site, widened(&spot.site)][usize::from(spot.is_mark)];
        for rectangle in of.rectangles(2, plane, self.whole()?) {
            let [[u0, u1], [v0, v1]] = rectangle;
            let [xs, ys, _] = &of.planes;
            let corners = [[xs[u0], ys[v0], height_m], [xs[u1], ys[v1], height_m]];
            let top = self.spots.iter().filter(|spot| spot.parent.is_none());
            let sites: Vec<&Spot> = top.filter(|spot| is_within(&room(spot), corners)).collect();
            if sites.is_empty() {
                of.add_rectangle(2, plane, rectangle, out);
                continue;
            }
            let corners = corners.map(|[x, y, _]| [x, y]);
            let rim = Rim::Rectangle(corners, of.sharp(2, plane, rectangle));
            let bodies = of.bodies_at(2, plane, [u0, v0]);
            self.add_rings(rim, &sites, bodies, out);
            for mark in sites.iter().filter(|spot| spot.is_mark) {
                self.add_disc(mark, bodies, out);
            }
        }
        for (number, spot) in self.spots.iter().enumerate() {
            let inner: Vec<&Spot> = (self.spots.iter())
                .filter(|inner| inner.parent == Some(number))
                .collect();
            let is_part = !spot.is_mark || spot.parent.is_some();
            let [below, above] = spot.bodies.map(|body| of.chi(body));
            if below == above || !is_part {
                continue;
            }
            if inner.is_empty() {
                self.add_disc(spot, spot.bodies, out);
            } else {
                let rim = Rim::Round(spot.site, spot.sharp);
                self.add_rings(rim, &inner, spot.bodies, out);
            }
        }
        Ok(())
    }

    fn add_disc(&self, spot: &Spot, bodies: [Option<usize>; 2], out: &mut Vec<Bound>) {
        let Site { at_m, radius_m } = spot.site;
        for face in disc(at_m, radius_m, self.of.planes[2][self.plane], spot.sharp) {
            self.of.add(face, bodies, out);
        }
    }

    /// What is within `rim` and about all of `spots`.
    fn add_rings(
        &self,
        rim: Rim,
        spots: &[&Spot],
        bodies: [Option<usize>; 2],
        out: &mut Vec<Bound>,
    ) {
        let height_m = self.of.planes[2][self.plane];
        let sites: Vec<Site> = spots.iter().map(|spot| spot.site).collect();
        for (number, spot) in spots.iter().enumerate() {
            let cell = Cell::new(rim, &sites, number);
            for face in cell.ring(&spot.site, height_m, spot.sharp) {
                self.of.add(face, bodies, out);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::face::Resolution;
    use super::super::panel_columns::Targets;
    use super::super::plate::Outline;
    use super::super::surface::Surface;
    use super::*;

    fn prism(outline: Outline, centre_m: [f64; 2], heights_m: [f64; 2], chi: f64) -> Prism {
        Prism {
            outline,
            centre_m,
            heights_m,
            holes: Vec::new(),
            marks: Vec::new(),
            chi,
            core: None,
        }
    }

    fn holed(mut prism: Prism, holes: &[([f64; 2], f64)]) -> Prism {
        let site = |(at_m, radius_m): &([f64; 2], f64)| Site {
            at_m: *at_m,
            radius_m: *radius_m,
        };
        prism.holes = holes.iter().map(site).collect();
        prism
    }

    fn contains(prism: &Prism, [x, y, z]: Point) -> bool {
        let in_site = |site: &Site| site.distance_m([x, y]) < site.radius_m;
        let [low, high] = prism.ends_m();
        let in_plan = match prism.disc() {
            Some(disc) => in_site(&disc),
            None => low[0] < x && x < high[0] && low[1] < y && y < high[1],
        };
        in_plan && low[2] < z && z < high[2] && !prism.holes.iter().any(in_site)
    }

    const TRAY: f64 = 7.0;

    /// A tray with feet, a pierced post through its floor, a tube about another, a step on a wall.
    fn tray() -> Vec<Prism> {
        let (rectangle, round) = (Outline::Rectangle, Outline::Round);
        let mut floor = holed(
            prism(rectangle([2.0, 1.6]), [0.0; 2], [-0.2, 0.0], TRAY),
            &[([-0.75, -0.6], 0.08)],
        );
        floor.marks = vec![Site {
            at_m: [0.75, 0.0],
            radius_m: 0.1,
        }];
        vec![
            floor,
            prism(rectangle([0.1, 1.6]), [-0.95, 0.0], [-0.2, 0.9], TRAY),
            prism(rectangle([2.0, 0.1]), [0.0, 0.75], [-0.1, 0.6], TRAY),
            prism(rectangle([0.1, 0.4]), [-0.95, 0.6], [0.9, 1.1], 3.0),
            prism(round(0.5), [0.3, 0.2], [0.0, 0.8], TRAY),
            prism(round(0.5), [0.3, 0.2], [-0.5, -0.2], TRAY),
            prism(round(0.3), [0.3, -0.5], [-0.1, 0.7], TRAY),
            holed(
                prism(round(0.7), [-0.4, -0.2], [-0.2, 0.5], TRAY),
                &[([-0.4, -0.2], 0.25)],
            ),
            prism(round(0.2), [-0.36, -0.25], [0.0, 0.4], 2.0),
            // Crosses a foot in plan, below it.
            prism(rectangle([0.6, 0.5]), [0.4, -0.4], [-0.4, -0.2], TRAY),
        ]
    }

    /// A layer of the jump in permeability gives every place the permeability there: no face is missing, doubled or
    /// turned, and every one has its steels.
    #[test]
    fn faces_close_about_the_steel_that_they_bound() {
        let round_plate = vec![
            holed(
                prism(Outline::Round(2.0), [0.1, 0.2], [0.0, 0.3], 5.0),
                &[([0.7, 0.3], 0.12)],
            ),
            prism(Outline::Round(0.6), [0.2, -0.1], [0.3, 1.0], 2.0),
            prism(Outline::Round(0.4), [-0.4, 0.5], [0.1, 1.0], 5.0),
        ];
        for (prisms, cuts_m) in [
            (tray(), [None; 2]),
            (tray(), [Some(0.0), Some(0.1)]),
            (round_plate, [None; 2]),
        ] {
            let bounds = faces(&prisms, cuts_m, [0.0; 2]).unwrap();
            let faces: Vec<Face> = bounds.into_iter().map(|(face, _)| face).collect();
            let resolution = Resolution {
                order: 5,
                per_turn: 6,
                levels: 1,
                panel_m: 0.4,
            };
            let surface = Surface::new(faces, &resolution, &|_, _| f64::INFINITY);
            let mut inside = 0;
            for k in 0..1500 {
                let [u, v, w] =
                    [0.754_877, 0.569_840, 0.324_718].map(|step| (f64::from(k) * step).fract());
                let at = [2.4 * u - 1.2, 2.4 * v - 1.2, 1.9 * w - 0.6];
                let chi_at = |at: Point| {
                    let of = prisms.iter().find(|prism| contains(prism, at));
                    of.map_or(0.0, |prism| prism.chi)
                };
                let chi = chi_at(at);
                // Places on a side are neither inside nor out.
                let beside = (0..6).any(|k| {
                    let mut beside = at;
                    beside[k / 2] += if k % 2 == 0 { 1e-6 } else { -1e-6 };
                    chi_at(beside) != chi
                });
                if beside {
                    continue;
                }
                let mut target = Targets::default();
                target.push(at, None);
                let mut row = vec![0.0; surface.size()];
                for panel in 0..surface.panels().len() {
                    surface.panel_columns(panel, &target, &mut row[surface.nodes_of(panel)]);
                }
                let jump = |node: usize| {
                    let [own, other] = surface.face_of(node).chi;
                    own - other
                };
                let sum: f64 = row
                    .iter()
                    .enumerate()
                    .map(|(k, value)| value * jump(k))
                    .sum();
                assert!((sum + chi).abs() < 2e-3 * TRAY, "{at:?}: {sum} {chi}");
                inside += usize::from(chi > 0.0);
            }
            assert!(inside > 80, "{inside}");
        }
    }

    #[test]
    fn circles_across_an_edge_are_refused() {
        let floor = prism(Outline::Rectangle([2.0, 1.0]), [0.0; 2], [-0.2, 0.0], 9.0);
        let post = |x: f64| prism(Outline::Round(0.4), [x, 0.0], [0.0, 0.5], 9.0);
        let of = |prisms: &[Prism]| faces(prisms, [None; 2], [0.0; 2]);
        assert!(of(&[floor.clone(), post(0.7)]).is_ok());
        for x in [0.9, 1.1] {
            let crossed = of(&[floor.clone(), post(x)]).unwrap_err();
            let site = post(x).disc().unwrap();
            assert_eq!(crossed, Fault::Crosses(site));
        }
        let beside = of(&[floor, post(0.5), post(0.75)]);
        assert!(matches!(beside, Err(Fault::Crosses(_))), "two that cross");
    }
}
