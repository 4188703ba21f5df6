//! Bodies of steel as faces: cores, a plate that joins them, boxes, cylinders, tubes, meshes.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use super::face::{Curve, Face, Point, Resolution};
use super::mesh_body::MeshBody;
use super::plate::{Cell, beyond, check_holes, is_apart};
pub use super::plate::{Fault, Outline, Plate, Site};
use crate::steel::CoreShape;
use crate::winding::Winding;
use fluxform_numerics::vec3::{dot, minus};

pub(super) use super::plate::SAME_M;

const UP: Point = [0.0, 0.0, 1.0];
const DOWN: Point = [0.0, 0.0, -1.0];

/// A body's shape about its middle.
#[derive(Debug, Clone, PartialEq)]
pub enum Solid {
    /// Sides along x, y and z, m.
    Box(Point),
    /// About z: inner and outer radius and length, m; a full cylinder where the first is 0.
    Tube([f64; 3]),
    /// Radius, m.
    Ball(f64),
    /// Flat facets.
    Mesh(Arc<MeshBody>),
}

/// A body somewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Its shape.
    pub solid: Solid,
    /// Its middle, m.
    pub centre_m: Point,
    /// The matrix that turns it.
    pub turn: [Point; 3],
}

/// No rotation.
pub const UPRIGHT: [Point; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Body {
    /// Distance of a place from its surface, m; below nothing inside.
    #[must_use]
    pub fn distance_m(&self, place_m: Point) -> f64 {
        let d = minus(place_m, self.centre_m);
        let [x, y, z]: Point =
            std::array::from_fn(|i| (0..3).map(|row| self.turn[row][i] * d[row]).sum());
        let outside = |parts: &[f64]| {
            let beyond = parts.iter().map(|p| p.max(0.0).powi(2)).sum::<f64>().sqrt();
            let within = parts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if within > 0.0 { beyond } else { within }
        };
        match &self.solid {
            Solid::Mesh(mesh) => mesh.distance_m([x, y, z]),
            Solid::Box([a, b, c]) => {
                outside(&[x.abs() - 0.5 * a, y.abs() - 0.5 * b, z.abs() - 0.5 * c])
            }
            Solid::Tube([inner, outer, length]) => {
                let r = x.hypot(y);
                let bore = if *inner > 0.0 {
                    inner - r
                } else {
                    f64::NEG_INFINITY
                };
                outside(&[bore.max(r - outer), z.abs() - 0.5 * length])
            }
            Solid::Ball(radius) => dot(d, d).sqrt() - radius,
        }
    }

    /// Its surface.
    #[must_use]
    pub fn faces(&self) -> Vec<Face> {
        let faces = match &self.solid {
            Solid::Box(sides) => cuboid(*sides),
            Solid::Tube([inner, outer, length]) => tube(*inner, *outer, *length),
            Solid::Ball(radius) => Face::ball([0.0; 3], [*radius; 3]),
            Solid::Mesh(mesh) => mesh.faces(),
        };
        let turn = |p: Point| self.turn.map(|row| dot(row, p));
        let moved = |face: Face| face.moved(turn, self.centre_m);
        faces.into_iter().map(moved).collect()
    }

    /// The least that any two of its opposite sides are apart, m.
    #[must_use]
    pub fn thickness_m(&self) -> f64 {
        match &self.solid {
            Solid::Box(sides) => sides.iter().copied().fold(f64::INFINITY, f64::min),
            Solid::Tube([inner, outer, length]) => length.min(outer - inner),
            Solid::Ball(radius) => 2.0 * radius,
            Solid::Mesh(mesh) => mesh.thickness_m(),
        }
    }

    /// Places on its surface, m, and the polygons between them, for drawings: of a mesh its facets.
    #[must_use]
    pub fn drawn(&self) -> (Vec<Point>, Vec<Vec<usize>>) {
        if let Solid::Mesh(mesh) = &self.solid {
            let facets = mesh.facets().iter();
            let facets = facets.map(|facet| facet.iter().map(|k| *k as usize).collect());
            return (mesh.vertices_m().to_vec(), facets.collect());
        }
        let (places, side) = (self.places_m().collect::<Vec<_>>(), Self::STEPS + 1);
        let mut cells = Vec::new();
        for face in (0..places.len()).step_by(side * side) {
            for k in 0..Self::STEPS * Self::STEPS {
                let at = face + k / Self::STEPS * side + k % Self::STEPS;
                cells.push(vec![at, at + 1, at + side + 1, at + side]);
            }
        }
        (places, cells)
    }

    /// Steps along either side of a face in [`Body::places_m`].
    const STEPS: usize = 16;

    /// Places spread over its surface, m: of every face a grid, row by row.
    fn places_m(&self) -> impl Iterator<Item = Point> + use<> {
        const STEPS: usize = Body::STEPS;
        self.faces().into_iter().flat_map(|face| {
            (0..=STEPS * (STEPS + 2)).map(move |k| {
                let (u, v) = (k / (STEPS + 1), k % (STEPS + 1));
                face.point(u as f64 / STEPS as f64, v as f64 / STEPS as f64)
                    .0
            })
        })
    }
}

impl Plate {
    /// Distance of a place from its surface, m, no more than it is; below nothing inside.
    #[must_use]
    pub fn distance_m(&self, place_m: Point) -> f64 {
        let in_holes = self.holes.iter().map(|hole| {
            let [x, y] = [0, 1].map(|axis| place_m[axis] - hole.at_m[axis]);
            hole.radius_m - x.hypot(y)
        });
        in_holes.fold(self.body().distance_m(place_m), f64::max)
    }

    /// The plate as a body, its holes filled.
    #[must_use]
    pub fn body(&self) -> Body {
        let [x, y] = self.centre_m;
        Body {
            solid: match self.outline {
                Outline::Rectangle([a, b]) => Solid::Box([a, b, self.thickness_m]),
                Outline::Round(diameter) => Solid::Tube([0.0, 0.5 * diameter, self.thickness_m]),
            },
            centre_m: [x, y, self.top_m - 0.5 * self.thickness_m],
            turn: UPRIGHT,
        }
    }
}

/// Equal windings, and what is in their bores.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coils<'a> {
    /// Each, its axis at the origin.
    pub winding: Winding,
    /// Axes, m.
    pub positions_m: &'a [[f64; 2]],
    /// Their cores, their axes at the origin, with relative permeability less one.
    pub core: Option<(CoreShape, f64)>,
}

impl Coils<'_> {
    /// Radius about every axis that is cut out of what is near it, m.
    fn radius_m(&self) -> f64 {
        self.core
            .map_or(self.winding.outer_radius_m, |(shape, _)| shape.radius_m)
    }
}

/// Bodies, and what is known of their symmetry.
#[derive(Debug, Clone, PartialEq)]
pub struct Iron {
    faces: Vec<Face>,
    /// The middle of every connected body in plan, m.
    centres_m: Vec<[f64; 2]>,
    /// Planes x = and y = of mirrors, m.
    pub planes_m: [f64; 2],
    mirrors: [bool; 2],
    largest_m: f64,
    top_m: f64,
}

impl Iron {
    /// The coils' cores, a plate below them or both.
    ///
    /// # Errors
    /// [`Fault`].
    pub fn new(coils: Coils<'_>, plate: Option<&Plate>) -> Result<Self, Fault> {
        let about = plate.map_or_else(|| middle(coils.positions_m), |plate| plate.centre_m);
        let mut iron = Self {
            planes_m: about,
            mirrors: [0, 1].map(|axis| {
                let mirrored = |mut place: [f64; 2]| {
                    place[axis] = -place[axis];
                    place
                };
                is_mirrored(coils.positions_m, axis, about[axis])
                    && plate.is_none_or(|plate| plate.keeps_holes(mirrored))
            }),
            ..Self::none()
        };
        let touching = match (coils.core, plate) {
            (Some((shape, _)), Some(plate)) => (shape.bottom_m - plate.top_m).abs() < SAME_M,
            _ => false,
        };
        if let Some(plate) = plate {
            iron.add_plate(plate, coils, touching)?;
        }
        if let Some((shape, chi)) = coils.core {
            let foot = plate.filter(|_| touching).map(|plate| plate.chi);
            iron.add_cores(coils, shape, chi, foot);
        }
        Ok(iron)
    }

    /// No steel yet, and no coils.
    #[must_use]
    pub fn none() -> Self {
        Self {
            faces: Vec::new(),
            centres_m: Vec::new(),
            planes_m: [0.0; 2],
            mirrors: [false; 2],
            largest_m: 0.0,
            top_m: f64::NEG_INFINITY,
        }
    }

    /// Adds a body of its own.
    #[must_use]
    pub fn with(self, body: Vec<Face>, chi: f64) -> Self {
        let body = body.into_iter().map(|face| face.of_steel(chi));
        self.with_joined(body.collect(), [false; 2])
    }

    /// Adds a body of several steels that hang together, whose faces have them; `mirrors`: the planes x = and y = that
    /// none of its faces crosses, and whose mirror leaves all bodies that are added as they are.
    #[must_use]
    pub fn with_joined(mut self, body: Vec<Face>, mirrors: [bool; 2]) -> Self {
        let number = self.centres_m.len();
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for face in &body {
            for (u, v) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (0.5, 0.5)] {
                let at = face.point(u, v).0;
                for i in 0..3 {
                    low[i] = low[i].min(at[i]);
                    high[i] = high[i].max(at[i]);
                }
            }
        }
        for i in 0..3 {
            self.largest_m = self.largest_m.max(high[i] - low[i]);
        }
        self.top_m = self.top_m.max(high[2]);
        self.centres_m
            .push([0, 1].map(|i| 0.5 * (low[i] + high[i])));
        for (own, kept) in self.mirrors.iter_mut().zip(mirrors) {
            *own &= kept;
        }
        self.faces.extend(body.into_iter().map(|mut face| {
            face.body = number;
            face
        }));
        self
    }

    fn add_plate(&mut self, plate: &Plate, coils: Coils<'_>, touching: bool) -> Result<(), Fault> {
        let body = self.centres_m.len();
        self.centres_m.push(plate.centre_m);
        let bottom_m = plate.top_m - plate.thickness_m;
        let extent = match plate.outline {
            Outline::Rectangle([a, b]) => a.max(b),
            Outline::Round(diameter) => diameter,
        };
        self.largest_m = self.largest_m.max(extent);
        self.top_m = self.top_m.max(plate.top_m);
        let radius_m = coils.radius_m();
        let mut faces = plate_sides(plate);
        let mut sites = Vec::new();
        for (number, at_m) in coils.positions_m.iter().enumerate() {
            if !plate.contains(*at_m, radius_m + SAME_M) {
                return Err(Fault::BesidePlate(number));
            }
            sites.push(Site {
                at_m: *at_m,
                radius_m,
            });
        }
        check_holes(plate, touching.then_some(&sites))?;
        // Where no core stands, a disc only serves to cut the plate.
        let clear = |site: &Site| plate.holes.iter().all(|hole| is_apart(hole, site));
        sites.retain(|site| touching || clear(site));
        let discs = sites.len();
        sites.extend(&plate.holes);
        for (number, site) in sites.iter().enumerate() {
            let cell = Cell::new(plate, &sites, number);
            let is_hole = number >= discs;
            faces.extend(cell.ring(site, plate.top_m, UP, touching || is_hole));
            faces.extend(cell.ring(site, bottom_m, DOWN, is_hole));
            if is_hole {
                let wall = cylinder_side(site.at_m, site.radius_m, [bottom_m, plate.top_m]);
                faces.extend(wall.into_iter().map(Face::turned));
                continue;
            }
            faces.extend(disc(site.at_m, site.radius_m, bottom_m, DOWN, false));
            if !touching {
                faces.extend(disc(site.at_m, site.radius_m, plate.top_m, UP, false));
            }
        }
        self.faces.extend(faces.into_iter().map(|mut face| {
            face.chi = [plate.chi, 0.0];
            face.body = body;
            face
        }));
        Ok(())
    }

    /// `foot`: of what they stand on, if they do.
    fn add_cores(&mut self, coils: Coils<'_>, shape: CoreShape, chi: f64, foot: Option<f64>) {
        self.largest_m = self
            .largest_m
            .max(shape.length_m())
            .max(2.0 * shape.radius_m);
        self.top_m = self.top_m.max(shape.top_m);
        for (number, site) in coils.positions_m.iter().enumerate() {
            let body = match foot {
                Some(_) => 0,
                None => {
                    self.centres_m.push(*site);
                    self.centres_m.len() - 1
                }
            };
            let mut add = |faces: Vec<Face>, below: f64| {
                self.faces.extend(faces.into_iter().map(|mut face| {
                    face.chi = [chi, below];
                    face.body = body;
                    face.bore = Some(number);
                    face
                }));
            };
            let mut side = cylinder_side(*site, shape.radius_m, [shape.bottom_m, shape.top_m]);
            for height_m in [-coils.winding.length_m, 0.0] {
                let v = (height_m - shape.bottom_m) / shape.length_m();
                side = side.into_iter().map(|face| face.cut(v)).collect();
            }
            add(side, 0.0);
            add(disc(*site, shape.radius_m, shape.top_m, UP, true), 0.0);
            // Steel of one kind is joined without a surface.
            if foot != Some(chi) {
                let end = disc(*site, shape.radius_m, shape.bottom_m, DOWN, true);
                add(end, foot.unwrap_or(0.0));
            }
        }
    }

    /// The faces on one side of the mirrors.
    pub(super) fn part(&self) -> Vec<Face> {
        let kept = |face: &&Face| {
            let at = face.point(0.5, 0.5).0;
            (0..2).all(|axis| !self.mirrors[axis] || at[axis] > self.planes_m[axis])
        };
        self.faces.iter().filter(kept).cloned().collect()
    }

    /// Signs of x and y of the copies that the mirrors make; the mirror of bit k applied to one copy gives another.
    pub(super) fn images(&self) -> Vec<[f64; 2]> {
        let mut out = vec![[1.0, 1.0]];
        for axis in 0..2 {
            if self.mirrors[axis] {
                let copies: Vec<[f64; 2]> = out.clone();
                out.extend(copies.into_iter().map(|mut signs| {
                    signs[axis] = -1.0;
                    signs
                }));
            }
        }
        out
    }

    /// Whether an image leaves a body where it is.
    pub(super) fn keeps(&self, body: usize, signs: [f64; 2]) -> bool {
        (0..2).all(|axis| {
            signs[axis] > 0.0 || (self.centres_m[body][axis] - self.planes_m[axis]).abs() < SAME_M
        })
    }

    /// The largest relative permeability less one of every body.
    pub(super) fn scales(&self) -> Vec<f64> {
        let mut out = vec![0.0_f64; self.centres_m.len()];
        for face in &self.faces {
            out[face.body] = out[face.body].max(face.chi[0]).max(face.chi[1]);
        }
        out
    }

    /// Height of the highest steel, m.
    #[must_use]
    pub fn top_m(&self) -> f64 {
        self.top_m
    }

    pub(super) fn resolution(
        &self,
        (order, per_turn, levels, along): (usize, usize, i32, f64),
    ) -> Resolution {
        Resolution {
            order,
            per_turn,
            levels,
            panel_m: self.largest_m / along,
        }
    }
}

fn middle(positions_m: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|axis| {
        let of = positions_m.iter().map(|p| p[axis]);
        let (low, high) = of.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
            (a.min(x), b.max(x))
        });
        if low <= high { 0.5 * (low + high) } else { 0.0 }
    })
}

fn is_mirrored(positions_m: &[[f64; 2]], axis: usize, plane_m: f64) -> bool {
    positions_m.iter().all(|place| {
        let mut image = *place;
        image[axis] = 2.0 * plane_m - image[axis];
        positions_m
            .iter()
            .any(|other| (other[0] - image[0]).hypot(other[1] - image[1]) < SAME_M)
    })
}

fn quarters() -> [[f64; 2]; 4] {
    [0.0, 1.0, 2.0, 3.0].map(|k| [k * FRAC_PI_2, (k + 1.0) * FRAC_PI_2])
}

/// A level disc in four parts.
fn disc([x, y]: [f64; 2], radius_m: f64, z_m: f64, normal: Point, sharp: bool) -> Vec<Face> {
    let centre = [x, y, z_m];
    let part = |[from, to]: [f64; 2]| {
        Face::ruled(
            Curve::segment(centre, centre),
            Curve::arc(centre, radius_m, from, to),
            [false, false, false, sharp],
            beyond(centre, normal),
        )
    };
    quarters().map(part).to_vec()
}

/// The side of an upright cylinder in four parts.
fn cylinder_side([x, y]: [f64; 2], radius_m: f64, [low, high]: [f64; 2]) -> Vec<Face> {
    let part = |[from, to]: [f64; 2]| {
        let (s, c) = (0.5 * (from + to)).sin_cos();
        Face::ruled(
            Curve::arc([x, y, low], radius_m, from, to),
            Curve::arc([x, y, high], radius_m, from, to),
            [false, false, true, true],
            beyond([x, y, 0.5 * (low + high)], [c, s, 0.0]),
        )
    };
    quarters().map(part).to_vec()
}

fn plate_sides(plate: &Plate) -> Vec<Face> {
    let heights = [plate.top_m - plate.thickness_m, plate.top_m];
    let [cx, cy] = plate.centre_m;
    match plate.outline {
        Outline::Round(diameter) => cylinder_side(plate.centre_m, 0.5 * diameter, heights),
        Outline::Rectangle([a, b]) => {
            let (a, b) = (0.5 * a, 0.5 * b);
            let rim = [
                ([a, 0.0], [a, b]),
                ([a, b], [0.0, b]),
                ([0.0, b], [-a, b]),
                ([-a, b], [-a, 0.0]),
                ([-a, 0.0], [-a, -b]),
                ([-a, -b], [0.0, -b]),
                ([0.0, -b], [a, -b]),
                ([a, -b], [a, 0.0]),
            ];
            rim.map(|(from, to)| {
                let at = |[x, y]: [f64; 2], z: f64| [cx + x, cy + y, z];
                let corner = |[x, y]: [f64; 2]| x != 0.0 && y != 0.0;
                let middle = [0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])];
                Face::ruled(
                    Curve::segment(at(from, heights[0]), at(to, heights[0])),
                    Curve::segment(at(from, heights[1]), at(to, heights[1])),
                    [corner(from), corner(to), true, true],
                    beyond([cx, cy, heights[0]], [middle[0], middle[1], 0.0]),
                )
            })
            .to_vec()
        }
    }
}

/// A box about the origin, sides along the axes, m.
#[must_use]
pub fn cuboid(sides_m: Point) -> Vec<Face> {
    let mut faces = Vec::new();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let at = |u: f64, v: f64| {
                let mut point = [0.0; 3];
                point[axis] = 0.5 * sign * sides_m[axis];
                point[(axis + 1) % 3] = 0.5 * u * sides_m[(axis + 1) % 3];
                point[(axis + 2) % 3] = 0.5 * v * sides_m[(axis + 2) % 3];
                point
            };
            faces.push(Face::ruled(
                Curve::segment(at(-1.0, -1.0), at(1.0, -1.0)),
                Curve::segment(at(-1.0, 1.0), at(1.0, 1.0)),
                [true; 4],
                at(0.0, 0.0).map(|x| 3.0 * x),
            ));
        }
    }
    faces
}

/// A cylinder about the origin along z, or a tube where `inner_m` is above nothing; radii and length, m.
#[must_use]
pub fn tube(inner_m: f64, outer_m: f64, length_m: f64) -> Vec<Face> {
    let (low, high) = (-0.5 * length_m, 0.5 * length_m);
    let mut faces = cylinder_side([0.0; 2], outer_m, [low, high]);
    if inner_m > 0.0 {
        let inside = cylinder_side([0.0; 2], inner_m, [low, high]);
        faces.extend(inside.into_iter().map(Face::turned));
    }
    for (z, normal) in [(low, DOWN), (high, UP)] {
        if inner_m > 0.0 {
            let centre = [0.0, 0.0, z];
            faces.extend(quarters().map(|[from, to]| {
                Face::ruled(
                    Curve::arc(centre, inner_m, from, to),
                    Curve::arc(centre, outer_m, from, to),
                    [false, false, true, true],
                    beyond(centre, normal),
                )
            }));
        } else {
            faces.extend(disc([0.0; 2], outer_m, z, normal, true));
        }
    }
    faces
}
