//! Bodies of steel as faces: cores, a plate that joins them, boxes, cylinders, tubes, meshes.

use std::sync::Arc;

use super::arrangement;
use super::face::{Face, Point, Resolution, SAME_M};
use super::mesh_body::MeshBody;
use super::near_sources::{LongestSide, MagnetRoom, Windings};
pub use super::plate::{Fault, Outline, Plate};
pub use super::prisms::Contact;
use super::prisms::{self, Prism, connected, is_mirrored};
pub use super::round_faces::Site;
use super::surface::Surface;
use crate::steel::CoreShape;
use crate::winding::Winding;
use fluxform_numerics::vec3::{dot, minus};

/// Resolutions from coarse to fine: order, steps to an edge, and panels along the largest body away from windings. The
/// order grows from each to the next, so that no panel is as in the one before, by which the error is estimated.
pub const RESOLUTIONS: [(usize, i32, f64); 6] = [
    (2, 1, 5.0),
    (3, 2, 6.0),
    (4, 2, 7.0),
    (5, 3, 8.0),
    (6, 4, 9.0),
    (7, 6, 12.0),
];
/// Panels about a whole turn.
const PER_TURN: usize = 4;

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
        let turn = |p: Point| self.turn.map(|row| dot(row, p));
        let moved = |face: Face| face.moved(turn, self.centre_m);
        let faces = match &self.solid {
            Solid::Box(_) | Solid::Tube(_) => {
                let whole = Body {
                    centre_m: [0.0; 3],
                    turn: UPRIGHT,
                    ..self.clone()
                };
                let prism = Piece::new(whole, 1.0).prism(&UPRIGHT);
                let prism = prism.expect("boxes and tubes are prisms of their own frame");
                let faces = arrangement::faces(&[prism], [None; 2], [0.0; 2]);
                let faces = faces.expect("one body crosses no other");
                faces.into_iter().map(|(face, _)| face).collect()
            }
            Solid::Ball(radius) => Face::ball([0.0; 3], [*radius; 3]),
            Solid::Mesh(mesh) => mesh.faces(),
        };
        faces.into_iter().map(moved).collect()
    }

    /// A core on an axis.
    #[must_use]
    pub fn of_core(shape: CoreShape, [x, y]: [f64; 2]) -> Self {
        Self {
            solid: Solid::Tube([0.0, shape.radius_m, shape.length_m()]),
            centre_m: [x, y, 0.5 * (shape.bottom_m + shape.top_m)],
            turn: UPRIGHT,
        }
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

/// A body of one steel.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Its shape and place.
    pub body: Body,
    /// Relative permeability less one.
    pub chi: f64,
    /// Holes through it along z, if it is upright.
    pub holes: Vec<Site>,
    /// Discs about which its ends are cut more finely, if it is upright.
    pub marks: Vec<Site>,
    /// The coil whose core it is.
    pub core: Option<usize>,
}

impl Piece {
    /// A body without holes.
    #[must_use]
    pub fn new(body: Body, chi: f64) -> Self {
        Self {
            body,
            chi,
            holes: Vec::new(),
            marks: Vec::new(),
            core: None,
        }
    }

    /// A plate below `coils`, its ends cut below their axes.
    ///
    /// # Errors
    /// [`Fault`]: its holes.
    pub fn plate(plate: &Plate, coils: Coils<'_>) -> Result<Self, Fault> {
        let radius_m = coils.radius_m();
        let below = |at: &[f64; 2]| Site {
            at_m: *at,
            radius_m,
        };
        let marks: Vec<Site> = coils.positions_m.iter().map(below).collect();
        let stand = |(shape, _): &(CoreShape, f64)| (shape.bottom_m - plate.top_m).abs() < SAME_M;
        let feet = if coils.core.as_ref().is_some_and(stand) {
            &marks[..]
        } else {
            &[]
        };
        plate.check_holes(feet)?;
        Ok(Self {
            holes: plate.holes.clone(),
            marks,
            ..Self::new(plate.body(), plate.chi)
        })
    }

    /// The cores of `coils`.
    pub fn cores(coils: Coils<'_>) -> impl Iterator<Item = Self> {
        let of = move |(shape, chi): (CoreShape, f64)| {
            let core = move |(number, [x, y]): (usize, &[f64; 2])| Self {
                core: Some(number),
                ..Self::new(Body::of_core(shape, [*x, *y]), chi)
            };
            coils.positions_m.iter().enumerate().map(core)
        };
        coils.core.into_iter().flat_map(of)
    }

    /// Whether a circle in plan is its own.
    #[must_use]
    pub fn is_about(&self, site: &Site) -> bool {
        let disc = self.prism(&UPRIGHT).and_then(|prism| prism.disc());
        disc.is_some_and(|disc| disc.is(site)) || self.holes.iter().any(|hole| hole.is(site))
    }

    /// It as a prism along the z of a frame.
    fn prism(&self, frame: &[Point; 3]) -> Option<Prism> {
        let column = |of: &[Point; 3], k: usize| -> Point { [of[0][k], of[1][k], of[2][k]] };
        let share =
            |k: usize, own: usize| dot(column(frame, k), column(&self.body.turn, own)).abs();
        let [x, y, z] = [0, 1, 2].map(|k| dot(column(frame, k), self.body.centre_m));
        let (outline, hole, height) = match self.body.solid {
            Solid::Box(sides) => {
                let mut along = [0.0; 3];
                for (k, along) in along.iter_mut().enumerate() {
                    for (own, side) in sides.iter().enumerate() {
                        let share = share(k, own);
                        if share > SAME_TURN && share < 1.0 - SAME_TURN {
                            return None;
                        }
                        *along += side * share.round();
                    }
                }
                (Outline::Rectangle([along[0], along[1]]), None, along[2])
            }
            Solid::Tube([inner, outer, length]) if share(2, 2) > 1.0 - SAME_TURN => {
                (Outline::Round(2.0 * outer), Some(inner), length)
            }
            Solid::Tube(_) | Solid::Ball(_) | Solid::Mesh(_) => return None,
        };
        let in_frame = |site: &Site| {
            let [x, y] = site.at_m;
            Site {
                at_m: [0, 1].map(|k| dot(column(frame, k), [x, y, 0.0])),
                ..*site
            }
        };
        let bore = hole.filter(|radius| *radius > 0.0).map(|radius_m| Site {
            at_m: [x, y],
            radius_m,
        });
        Some(Prism {
            outline,
            centre_m: [x, y],
            heights_m: [z - 0.5 * height, z + 0.5 * height],
            holes: self.holes.iter().map(in_frame).chain(bore).collect(),
            marks: self.marks.iter().map(in_frame).collect(),
            chi: self.chi,
            core: self.core,
        })
    }
}

/// Rotations that differ by less are one.
const SAME_TURN: f64 = 1e-9;

/// Both as prisms of one frame, if they are.
fn prisms_of(a: &Piece, b: &Piece) -> Option<(Prism, Prism)> {
    let frames = [&UPRIGHT, &a.body.turn, &b.body.turn];
    let of = |frame| Some((a.prism(frame)?, b.prism(frame)?));
    frames.into_iter().find_map(of)
}

/// How two bodies touch, if both have upright sides in one frame.
#[must_use]
pub fn contact(a: &Piece, b: &Piece) -> Contact {
    prisms_of(a, b).map_or(Contact::None, |(a, b)| prisms::contact(&a, &b))
}

/// Bodies that hang together.
enum Part {
    /// With upright sides in the frame of a rotation.
    Prisms([Point; 3], Vec<Prism>),
    /// One of any shape.
    Alone(Vec<Face>),
}

impl Part {
    fn new(pieces: &[&Piece]) -> Result<Self, Fault> {
        let turns = pieces.iter().map(|piece| &piece.body.turn);
        let prisms = |frame: &[Point; 3]| {
            let prisms: Option<Vec<Prism>> = pieces.iter().map(|p| p.prism(frame)).collect();
            Some(Self::Prisms(*frame, prisms?))
        };
        let known = std::iter::once(&UPRIGHT).chain(turns).find_map(prisms);
        match (known, pieces) {
            (Some(part), _) => Ok(part),
            (None, [piece]) => {
                let faces = piece.body.faces().into_iter();
                Ok(Self::Alone(
                    faces.map(|face| face.of_steel(piece.chi)).collect(),
                ))
            }
            (None, _) => Err(Fault::Askew),
        }
    }

    fn upright(&self) -> Option<&[Prism]> {
        match self {
            Self::Prisms(frame, prisms) if *frame == UPRIGHT => Some(prisms),
            Self::Prisms(..) | Self::Alone(_) => None,
        }
    }

    /// Its faces; upright ones do not cross the planes x = and y = `cuts_m`.
    fn faces(&self, coils: Coils<'_>, cuts_m: [Option<f64>; 2]) -> Result<Vec<Face>, Fault> {
        let (frame, prisms) = match self {
            Self::Prisms(frame, prisms) => (frame, prisms),
            Self::Alone(faces) => return Ok(faces.clone()),
        };
        let cuts_m = cuts_m.map(|cut| cut.filter(|_| *frame == UPRIGHT));
        // Frames of cores are upright or upside down.
        let ends_m = [-coils.winding.length_m, 0.0].map(|z| frame[2][2] * z);
        let above = prisms::above_cores(prisms, 0.5 * (ends_m[0] + ends_m[1]), frame[2][2])?;
        let turn = |p: Point| frame.map(|row| dot(row, p));
        let bounds = arrangement::faces(prisms, cuts_m, ends_m)?.into_iter();
        let placed = |(mut face, number): (Face, usize)| {
            face.bore = prisms[number].core;
            face.above.clone_from(&above[number]);
            face.moved(turn, [0.0; 3])
        };
        Ok(bounds.map(placed).collect())
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
    /// The windings near which panels are cut more finely.
    windings: Option<Windings>,
}

impl Iron {
    /// The coils' cores, a plate below them or both.
    ///
    /// # Errors
    /// [`Fault`].
    pub fn new(coils: Coils<'_>, plate: Option<&Plate>) -> Result<Self, Fault> {
        let plate = plate.map(|plate| Piece::plate(plate, coils)).transpose()?;
        let pieces: Vec<Piece> = plate.into_iter().chain(Piece::cores(coils)).collect();
        Self::of(coils, &pieces)
    }

    /// `pieces` about the windings of `coils`: those that touch or overlap are joined.
    ///
    /// # Errors
    /// [`Fault`].
    pub fn of(coils: Coils<'_>, pieces: &[Piece]) -> Result<Self, Fault> {
        let touch = |a: usize, b: usize| contact(&pieces[a], &pieces[b]) >= Contact::Face;
        let groups = connected(pieces.len(), touch);
        let mut parts: Vec<Part> = Vec::new();
        for group in &groups {
            let own: Vec<&Piece> = group.iter().map(|k| &pieces[*k]).collect();
            parts.push(Part::new(&own)?);
        }
        let mut iron = Self::none();
        iron.windings = Some(Windings::new(coils.winding, coils.positions_m));
        iron.planes_m = middle(coils.positions_m);
        let upright: Option<Vec<&[Prism]>> = parts.iter().map(Part::upright).collect();
        iron.mirrors = [0, 1].map(|axis| {
            let at = iron.planes_m[axis];
            let kept = |groups: &Vec<&[Prism]>| is_mirrored(groups, axis, at);
            is_mirrored_array(coils.positions_m, axis, at) && upright.as_ref().is_some_and(kept)
        });
        let cuts_m = [0, 1].map(|k| iron.mirrors[k].then_some(iron.planes_m[k]));
        for part in &parts {
            let faces = part.faces(coils, cuts_m)?;
            for axis in 0..2 {
                iron.mirrors[axis] &= !faces
                    .iter()
                    .any(|face| face.straddles(axis, iron.planes_m[axis]));
            }
            iron = iron.with_faces(faces);
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
            windings: None,
        }
    }

    /// Adds a body of its own.
    #[must_use]
    pub fn with(mut self, body: Vec<Face>, chi: f64) -> Self {
        self.mirrors = [false; 2];
        self.with_faces(body.into_iter().map(|face| face.of_steel(chi)).collect())
    }

    /// The same, solved as a whole.
    #[must_use]
    pub fn without_mirrors(mut self) -> Self {
        self.mirrors = [false; 2];
        self
    }

    /// Adds the faces of what hangs together, which have their steels.
    fn with_faces(mut self, body: Vec<Face>) -> Self {
        let number = self.centres_m.len();
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for face in &body {
            for at in face.corners_m() {
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
        self.faces.extend(body.into_iter().map(|mut face| {
            face.body = number;
            face
        }));
        self
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

    /// Its mirrored part at one of the [`RESOLUTIONS`].
    pub(super) fn surface(&self, tier: usize) -> Surface {
        self.cut(tier, &|panel, face| match &self.windings {
            // Cores are as small as their windings by themselves.
            Some(windings) if face.bore.is_none() => windings.longest_m(panel),
            _ => f64::INFINITY,
        })
    }

    /// The same for magnets, cut more finely near `room` where that is named.
    pub(super) fn surface_for_magnets(&self, tier: usize, room: Option<&MagnetRoom>) -> Surface {
        self.cut(tier, &|panel, _| {
            room.map_or(f64::INFINITY, |room| room.longest_m(panel))
        })
    }

    fn cut(&self, tier: usize, longest_m: &LongestSide<'_>) -> Surface {
        let (order, levels, along) = RESOLUTIONS[tier];
        let resolution = Resolution {
            order,
            per_turn: PER_TURN,
            levels,
            panel_m: self.largest_m / along,
        };
        Surface::new(self.part(), &resolution, longest_m)
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

fn is_mirrored_array(positions_m: &[[f64; 2]], axis: usize, plane_m: f64) -> bool {
    positions_m.iter().all(|place| {
        let mut image = *place;
        image[axis] = 2.0 * plane_m - image[axis];
        positions_m
            .iter()
            .any(|other| (other[0] - image[0]).hypot(other[1] - image[1]) < SAME_M)
    })
}

/// The faces of one body about the origin, of no steel yet.
fn faces_of(solid: Solid) -> Vec<Face> {
    let body = Body {
        solid,
        centre_m: [0.0; 3],
        turn: UPRIGHT,
    };
    body.faces()
}

/// A box about the origin, sides along the axes, m.
#[must_use]
pub fn cuboid(sides_m: Point) -> Vec<Face> {
    faces_of(Solid::Box(sides_m))
}

/// A cylinder about the origin along z, or a tube where `inner_m` is above nothing; radii and length, m.
#[must_use]
pub fn tube(inner_m: f64, outer_m: f64, length_m: f64) -> Vec<Face> {
    faces_of(Solid::Tube([inner_m, outer_m, length_m]))
}
