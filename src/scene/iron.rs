//! The plate and other bodies of a design's steel.

use std::sync::Arc;

use super::Scene;
use super::core_material::{Material, SceneCore};
use super::knee::above_knee_or;
use super::named_files::{self, NamedContent};
use super::passive_table::Turn;
use crate::RunError;
use crate::design::iron::{Hole, Iron as Described, IronShape, LinearSteel, PlateOutline};
use crate::design::named_file::Role;
use crate::design::{Coupling, Design};
use crate::field::iron::array::{IronArray, MOST_FACETS, Unsolved};
use crate::field::iron::bodies::{
    Body, Coils, Contact, Fault, Iron, Outline, Piece, Plate, Site, Solid, UPRIGHT, contact,
};
use crate::field::iron::clearance::meeting_m;
use crate::field::iron::face::Point;
use crate::field::iron::mesh_body::MeshBody;
use crate::field::iron::peaks::{Depths, IronPeaks, Peak};
use crate::field::iron::prisms::connected;
use crate::field::steel::core_flux_density::peak_depth_m;
use crate::field::winding::Winding;
use crate::shape::closed_body::{BodyRequest, ClosedBodies};

/// Bodies closer than this part of the smaller core radius or plate are neither apart nor joined.
const LEAST_GAP: f64 = 0.01;
/// Depth below the surface at which the largest |B| is looked for, and its largest part of a thickness, m.
const DEPTH_M: f64 = 1e-3;
const DEPTH_PART: f64 = 0.1;
/// Advice on steel above its knee.
const THICKER: &str = "make the steel thicker, or lower the current";

/// The steel of a design beyond its cores.
#[derive(Debug, Clone)]
pub struct SceneIron {
    plate: Option<Plate>,
    bodies: Vec<IronBody>,
    /// Height of the highest of it, m.
    pub(super) top_m: f64,
    /// Flux density above which a warning is due: the least of all bodies, T.
    pub knee_t: f64,
    /// Repairs of meshes, as warnings.
    pub put_right: Vec<String>,
}

/// A body of `[[iron]]`.
#[derive(Debug, Clone)]
struct IronBody {
    name: String,
    body: Body,
    chi: f64,
}

impl SceneIron {
    /// Of `design`, whose meshes are among `files`; `None` where it has cores alone.
    ///
    /// # Errors
    /// Steel along a curve, meshes that are no bodies, bodies that meet each other, a winding or a bore.
    pub(super) fn new(
        design: &Design,
        winding: &Winding,
        core: Option<&SceneCore>,
        files: &[NamedContent],
    ) -> Result<Option<Self>, RunError> {
        if !design.has_iron() {
            return Ok(None);
        }
        let refuse = |message: &str| Err(RunError::Input(message.to_owned()));
        if core.is_some_and(|core| matches!(core.material, Material::Curve(_))) {
            return refuse(
                "[core] bh_curve: with [plate] or [[iron]] steel is solved as linear; give relative_permeability and \
                 knee_t: `evaluate` states the largest flux density of every core and of the plate beside its knee, \
                 with its error (accuracy.iron_field); above the knee the answer is worth nothing",
            );
        }
        if core.is_some() && design.array.coupling == Coupling::None {
            return refuse(
                "[array] coupling = \"none\": steel beyond the cores joins them; take it out",
            );
        }
        let axes = &design.array.positions_m;
        let plate = design.plate.as_ref().map(|plate| Plate {
            outline: match plate.outline {
                PlateOutline::Rectangle(sides) => Outline::Rectangle(sides),
                PlateOutline::Round(diameter) => Outline::Round(diameter),
            },
            centre_m: middle(axes),
            top_m: core.map_or(-winding.length_m, |core| core.shape.bottom_m) - plate.gap_m,
            thickness_m: plate.thickness_m,
            chi: chi(plate.steel),
            holes: plate.holes.iter().map(site).collect(),
        });
        let (mut bodies, mut put_right) = (Vec::new(), Vec::new());
        for (number, iron) in design.iron.iter().enumerate() {
            let made = bodies_of(number, iron, files, &mut put_right)?;
            bodies.extend(made.into_iter().map(|body| IronBody {
                name: format!("[[iron]] {number}"),
                body,
                chi: chi(iron.steel),
            }));
        }
        let heights = bodies.iter().flat_map(|iron| iron.body.drawn().0);
        let heights = heights.map(|place| place[2]);
        let made = Self {
            top_m: (heights.chain(plate.as_ref().map(|plate| plate.top_m)))
                .fold(f64::NEG_INFINITY, f64::max),
            plate,
            bodies,
            knee_t: (design.iron.iter().map(|iron| iron.steel))
                .chain(design.plate.as_ref().map(|plate| plate.steel))
                .fold(f64::INFINITY, |knee, steel| knee.min(steel.knee_t)),
            put_right,
        };
        made.check(coils(design, winding, core))?;
        Ok(Some(made))
    }

    /// Everything with a name: the plate, the bodies and the cores.
    fn named(&self, coils: Coils<'_>) -> Result<Vec<(String, Piece)>, RunError> {
        let mut named = Vec::new();
        if let Some(plate) = &self.plate {
            let piece = Piece::plate(plate, coils).map_err(|fault| refused(fault, &[]))?;
            named.push(("[plate]".to_owned(), piece));
        }
        let body = |iron: &IronBody| (iron.name.clone(), Piece::new(iron.body.clone(), iron.chi));
        named.extend(self.bodies.iter().map(body));
        let core = |(coil, piece)| (format!("the core of coil {coil}"), piece);
        named.extend(Piece::cores(coils).enumerate().map(core));
        Ok(named)
    }

    fn check(&self, coils: Coils<'_>) -> Result<(), RunError> {
        let named = self.named(coils)?;
        let joins = |a: usize, b: usize| contact(&named[a].1, &named[b].1) >= Contact::Face;
        let groups = connected(named.len(), joins);
        for (number, (name, piece)) in named.iter().enumerate() {
            if piece.core.is_some() {
                break;
            }
            for (coil, [x, y]) in coils.positions_m.iter().enumerate() {
                let length_m = coils.winding.length_m;
                let room = Body {
                    solid: Solid::Tube([0.0, coils.winding.outer_radius_m, length_m]),
                    centre_m: [*x, *y, -0.5 * length_m],
                    turn: UPRIGHT,
                };
                if let Some(at) = meeting_m(&piece.body, &room, 0.0) {
                    return Err(RunError::Input(format!(
                        "{name} cuts the winding of coil {coil} or its bore, which [core] alone may fill, at {}; move it \
                         or make it smaller",
                        place_mm(at)
                    )));
                }
            }
            for (other, (second_name, second)) in named.iter().enumerate().skip(number + 1) {
                let touch = contact(piece, second);
                if touch == Contact::Volume && piece.chi != second.chi {
                    return Err(RunError::Input(format!(
                        "{name} and {second_name} overlap and are of different steels: let them touch, or give both one \
                         relative_permeability"
                    )));
                }
                // What touches along a line may be filled by a third.
                let one = |group: &Vec<usize>| group.contains(&number) && group.contains(&other);
                if touch != Contact::None && groups.iter().any(one) {
                    continue;
                }
                let least = LEAST_GAP * piece.body.thickness_m().min(second.body.thickness_m());
                if let Some(at) = meeting_m(&piece.body, &second.body, least) {
                    return Err(RunError::Input(format!(
                        "{name} and {second_name} are less than {:.3} mm apart or overlap, at {}: closer steel is not \
                         resolved. Joined are boxes, cylinders, tubes, [plate] and cores that are upright about one \
                         direction; export other bodies that touch as one united mesh (shape = \"mesh\")",
                        least * 1e3,
                        place_mm(at)
                    )));
                }
            }
        }
        solid(coils, &named).map(drop)
    }

    /// The windings, and it with the cores of `scene`.
    ///
    /// # Errors
    /// Steel that touches in a way that is not solved.
    pub(super) fn bodies<'a>(&self, scene: &Scene<'a>) -> Result<(Coils<'a>, Iron), RunError> {
        let coils = coils(scene.design, &scene.winding, scene.core.as_ref());
        let iron = solid(coils, &self.named(coils)?)?;
        Ok((coils, iron))
    }

    /// Solves it with the cores of `scene`, to `tolerance`, for heights from `lowest_m` to the workspace's highest.
    ///
    /// # Errors
    /// Steel that touches in a way that is not solved; a node on a winding's edge; more steel than memory allows.
    pub(super) fn solve(
        &self,
        scene: &Scene,
        tolerance: f64,
        lowest_m: f64,
    ) -> Result<IronArray, RunError> {
        let (coils, iron) = self.bodies(scene)?;
        let heights_m = [lowest_m, scene.design.workspace.z_m.to.max(lowest_m)];
        IronArray::new(coils, &iron, tolerance, heights_m).map_err(|fault| match fault {
            Unsolved::OnEdge(on_edge) => on_edge.into(),
            Unsolved::TooLarge { .. } => RunError::Input(format!(
                "the cores with [plate] and [[iron]]: {fault}; take fewer coils, place them alike about two planes, \
                 export meshes coarser, or leave steel out"
            )),
        })
    }

    /// Whether a map of the array to itself keeps it too.
    pub(super) fn is_kept_by(&self, turn: Turn) -> bool {
        let square = |plate: &Plate| match plate.outline {
            Outline::Rectangle([a, b]) => a == b,
            Outline::Round(_) => true,
        };
        // Whether other bodies are their own images is not looked at.
        let alone = self.bodies.is_empty();
        let kept = |plate: &Plate| {
            (!turn.swap || square(plate))
                && plate.keeps_holes(|from_middle| turn.of(from_middle, |_, v| -v))
        };
        alone && self.plate.as_ref().is_none_or(kept)
    }

    /// Refuses steel where the magnet is at the target of any coil.
    ///
    /// # Errors
    /// Its place.
    pub fn check_target(&self, design: &Design) -> Result<(), RunError> {
        let (magnet, height_m) = (&design.magnet, design.target_height_m);
        let reach_m = 0.5 * magnet.diameter_m.min(magnet.length_m);
        for (coil, [x, y]) in design.array.positions_m.iter().enumerate() {
            let distance_m = self.distance_m([*x, *y, height_m]);
            if distance_m < reach_m {
                let side = if distance_m < 0.0 {
                    "inside it"
                } else {
                    "off its surface"
                };
                return Err(RunError::Input(format!(
                    "the magnet at the target, {} mm above coil {coil}, cuts [plate] or [[iron]]: its centre is {:.3} mm \
                     {side}; raise target.height_mm, or move the steel",
                    height_m * 1e3,
                    distance_m.abs() * 1e3
                )));
            }
        }
        Ok(())
    }

    /// Distance of a place from the nearest of it, m; below nothing inside.
    pub(super) fn distance_m(&self, place_m: Point) -> f64 {
        let plate = self.plate.iter().map(|plate| plate.distance_m(place_m));
        let all = plate.chain(self.irons().map(|body| body.distance_m(place_m)));
        all.fold(f64::INFINITY, f64::min)
    }

    /// The bodies, the plate among them.
    #[must_use]
    pub fn solids(&self) -> Vec<Body> {
        let plate = self.plate.as_ref().map(Plate::body);
        self.irons().cloned().chain(plate).collect()
    }

    /// The bodies of `[[iron]]`.
    pub(super) fn irons(&self) -> impl Iterator<Item = &Body> {
        self.bodies.iter().map(|iron| &iron.body)
    }

    /// Sentences where a core, and where the plate or another body is above its knee, where linear steel ends, with
    /// `currents`, as they are called.
    #[must_use]
    pub fn above_knee(
        &self,
        scene: &Scene,
        peaks: &IronPeaks,
        currents: &str,
    ) -> [Option<String>; 2] {
        let of_core = scene
            .core
            .as_ref()
            .map_or(f64::INFINITY, |core| core.knee_t);
        let known = |peak: &Peak| (peak.field_t, peak.error_t.unwrap_or(0.0));
        // A tolerance that the same panels meet gives the same number again.
        let finer = peaks.finer_below.map_or_else(
            || "panels are as fine as they can be here: make the steel thicker".to_owned(),
            |below| format!("lower --tolerance to {:.0e}", 0.5 * below),
        );
        let core = above_knee_or(
            peaks.cores.iter().map(known),
            of_core,
            &format!("a core of the array with {currents}"),
            THICKER,
            &finer,
        );
        let plate = above_knee_or(
            peaks.elsewhere.iter().map(known),
            self.knee_t,
            &format!("the plate or [[iron]] with {currents}"),
            THICKER,
            &finer,
        );
        [core, plate]
    }

    /// How far inside its surface the largest |B| is looked for, m.
    pub(super) fn depths(&self, core: Option<&SceneCore>) -> Depths {
        let of_solid = |body: Body| DEPTH_PART * body.thickness_m();
        let solids = self.solids().into_iter().map(of_solid);
        Depths {
            cores_m: core.map_or(DEPTH_M, |core| peak_depth_m(core.shape)),
            elsewhere_m: solids.fold(DEPTH_M, f64::min),
        }
    }
}

/// The windings of a design and their cores.
fn coils<'a>(design: &'a Design, winding: &Winding, core: Option<&SceneCore>) -> Coils<'a> {
    Coils {
        winding: *winding,
        positions_m: &design.array.positions_m,
        core: core.map(|core| (core.shape, core.relative_permeability() - 1.0)),
    }
}

/// The steel of `named` about the windings of `coils`, joined.
fn solid(coils: Coils<'_>, named: &[(String, Piece)]) -> Result<Iron, RunError> {
    let pieces = named.iter().map(|(_, piece)| piece);
    // Steel with the permeability of air is left out.
    let pieces: Vec<Piece> = pieces.filter(|piece| piece.chi > 0.0).cloned().collect();
    Iron::of(coils, &pieces).map_err(|fault| refused(fault, named))
}

/// Why `named` steel is not solved, and what to do.
fn refused(fault: Fault, named: &[(String, Piece)]) -> RunError {
    let (whose, advice) = match fault {
        Fault::Crosses(site) => (
            named
                .iter()
                .find(|(_, piece)| piece.is_about(&site))
                .map(|(name, _)| name.as_str()),
            "make what it touches larger or smaller, or move it",
        ),
        Fault::Loop(_) => (None, "leave a gap, of air or of relative_permeability = 1"),
        Fault::Askew => (None, "export them as one united mesh (shape = \"mesh\")"),
        Fault::HoleAtEdge { .. } | Fault::HoleAtFoot { .. } | Fault::HolesMeet { .. } => (
            Some("[plate]"),
            "move the hole or make it smaller: what is left between is not resolved",
        ),
    };
    let whose = whose.unwrap_or("[plate] or [[iron]]");
    RunError::Input(format!("{whose}: {fault}; {advice}"))
}

fn site(hole: &Hole) -> Site {
    Site {
        at_m: hole.at_m,
        radius_m: 0.5 * hole.diameter_m,
    }
}

fn chi(steel: LinearSteel) -> f64 {
    steel.relative_permeability - 1.0
}

pub(super) fn middle(axes: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|axis| {
        let ends = axes
            .iter()
            .map(|p| p[axis])
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
                (a.min(x), b.max(x))
            });
        0.5 * (ends.0 + ends.1)
    })
}

/// The bodies that an entry of `[[iron]]` describes: of a mesh one of every part.
fn bodies_of(
    number: usize,
    iron: &Described,
    files: &[NamedContent],
    put_right: &mut Vec<String>,
) -> Result<Vec<Body>, RunError> {
    let [a, b, c] = iron.rotate_deg.map(|angle| angle.to_radians().sin_cos());
    let ((sa, ca), (sb, cb), (sc, cc)) = (a, b, c);
    let solid = match &iron.shape {
        IronShape::Box(sides) => Solid::Box(*sides),
        IronShape::Tube([inner, outer, length]) => Solid::Tube([0.5 * inner, 0.5 * outer, *length]),
        IronShape::Ball(diameter) => Solid::Ball(0.5 * diameter),
        IronShape::Mesh { surface, unit_m } => {
            let request = BodyRequest {
                path: surface,
                unit_m: *unit_m,
                rotate_deg: iron.rotate_deg,
                translate_m: iron.centre_m,
                most_facets: MOST_FACETS,
            };
            let bytes = &named_files::of(files, Role::Mesh(number))?.bytes;
            let read = ClosedBodies::read(bytes, &request);
            let read =
                read.map_err(|fault| RunError::Input(format!("[[iron]] {number}: {fault}")))?;
            let found = read.warnings.iter();
            put_right.extend(found.map(|what| format!("[[iron]] {number}: {what}")));
            let body = |facets| Body {
                solid: Solid::Mesh(Arc::new(MeshBody::new(&read.vertices_m, facets))),
                centre_m: [0.0; 3],
                turn: UPRIGHT,
            };
            return Ok(read.bodies.into_iter().map(body).collect());
        }
    };
    Ok(vec![Body {
        solid,
        centre_m: iron.centre_m,
        // About x, then y, then z.
        turn: [
            [cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
            [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
            [-sb, cb * sa, cb * ca],
        ],
    }])
}

/// `(1.0, 2.5, -3.0) mm`.
fn place_mm(place_m: Point) -> String {
    let [x, y, z] = place_m.map(|c| 1e3 * c + 0.0);
    format!("({x:.3}, {y:.3}, {z:.3}) mm")
}
