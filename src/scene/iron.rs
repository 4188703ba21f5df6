//! The plate and other bodies of a design's steel.

use std::sync::Arc;

use super::Scene;
use super::core_material::{Material, SceneCore};
use super::named_files::{self, NamedContent};
use super::passive_table::Turn;
use crate::RunError;
use crate::design::iron::{Hole, Iron as Described, IronShape, LinearSteel, PlateOutline};
use crate::design::named_file::Role;
use crate::design::{Coupling, Design};
use crate::field::iron::array::{IronArray, IronPeaks, MOST_FACETS, Peak, Unsolved};
use crate::field::iron::bodies::{Body, Coils, Fault, Iron, Outline, Plate, Site, Solid, UPRIGHT};
use crate::field::iron::box_union::{self, Contact, contact, is_mirrored};
use crate::field::iron::clearance::meeting_m;
use crate::field::iron::face::Point;
use crate::field::iron::mesh_body::MeshBody;
use crate::field::steel::CoreShape;
use crate::field::winding::Winding;
use crate::shape::closed_body::{BodyRequest, ClosedBodies};

/// Bodies closer than this part of the smaller core radius or plate are neither apart nor joined.
const LEAST_GAP: f64 = 0.01;
/// Depth below the surface at which the largest |B| is looked for, and its largest part of a thickness, m.
const DEPTH_M: f64 = 1e-3;
const DEPTH_PART: f64 = 0.1;

/// The steel of a design beyond its cores.
#[derive(Debug, Clone)]
pub struct SceneIron {
    plate: Option<Plate>,
    bodies: Vec<IronBody>,
    /// Bodies by their numbers: those of one entry hang together.
    joined: Vec<Vec<usize>>,
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
            joined: joined(&bodies)?,
            bodies,
            knee_t: (design.iron.iter().map(|iron| iron.steel))
                .chain(design.plate.as_ref().map(|plate| plate.steel))
                .fold(f64::INFINITY, |knee, steel| knee.min(steel.knee_t)),
            put_right,
        };
        made.check(axes, winding, core.map(|core| core.shape))?;
        Ok(Some(made))
    }

    fn check(
        &self,
        axes: &[[f64; 2]],
        winding: &Winding,
        core: Option<CoreShape>,
    ) -> Result<(), RunError> {
        let outer = winding.outer_radius_m;
        let full = |[x, y]: [f64; 2], radius: f64, low: f64, high: f64| Body {
            solid: Solid::Tube([0.0, radius, high - low]),
            centre_m: [x, y, 0.5 * (low + high)],
            turn: UPRIGHT,
        };
        let plate = self.plate.as_ref().map(|plate| ("[plate]", plate.body()));
        let bodies = self.bodies.iter();
        let bodies = bodies.map(|iron| (iron.name.as_str(), iron.body.clone()));
        let all: Vec<(&str, Body)> = plate.into_iter().chain(bodies).collect();
        let before = usize::from(self.plate.is_some());
        for (number, (name, body)) in all.iter().enumerate() {
            for (coil, axis) in axes.iter().enumerate() {
                let room = full(*axis, outer, -winding.length_m, 0.0);
                if let Some(at) = meeting_m(body, &room, 0.0) {
                    return Err(RunError::Input(format!(
                        "{name} cuts the winding of coil {coil} or its bore, whose steel is [core], at {}; move it or \
                         make it smaller",
                        place_mm(at)
                    )));
                }
                let Some(shape) = core else { continue };
                let own = full(*axis, shape.radius_m, shape.bottom_m, shape.top_m);
                let least = LEAST_GAP * shape.radius_m;
                let joined = *name == "[plate]"
                    && self
                        .plate
                        .as_ref()
                        .is_some_and(|plate| plate.top_m == shape.bottom_m);
                if joined {
                    continue;
                }
                if let Some(at) = meeting_m(body, &own, least) {
                    return Err(RunError::Input(format!(
                        "{name} is less than {:.3} mm from the core of coil {coil}, or in it, at {}: closer steel is \
                         not resolved, and only [plate] with gap_mm = 0 joins the cores",
                        least * 1e3,
                        place_mm(at)
                    )));
                }
            }
            for (other, (second_name, second)) in all[..number].iter().enumerate() {
                let own =
                    |group: &Vec<usize>, k: usize| k >= before && group.contains(&(k - before));
                let one = |group: &Vec<usize>| own(group, number) && own(group, other);
                if self.joined.iter().any(one) && contact(body, second) != Contact::None {
                    continue;
                }
                let least = LEAST_GAP * body.thickness_m().min(second.thickness_m());
                if let Some(at) = meeting_m(body, second, least) {
                    return Err(RunError::Input(format!(
                        "{name} and {second_name} are less than {:.3} mm apart or overlap, at {}: closer steel is not \
                         resolved. Joined are cores with [plate], and boxes of [[iron]] with parallel sides that touch; \
                         export other bodies that touch as one united mesh (shape = \"mesh\")",
                        least * 1e3,
                        place_mm(at)
                    )));
                }
            }
        }
        Ok(())
    }

    /// The windings, and it with the cores of `scene`.
    ///
    /// # Errors
    /// A core beside the plate.
    pub(super) fn bodies<'a>(&self, scene: &Scene<'a>) -> Result<(Coils<'a>, Iron), RunError> {
        let coils = Coils {
            winding: scene.winding,
            positions_m: &scene.design.array.positions_m,
            core: (scene.core.as_ref())
                .map(|core| (core.shape, core.relative_permeability() - 1.0)),
        };
        let iron = Iron::new(coils, self.plate.as_ref());
        let mut iron =
            iron.map_err(|fault| RunError::Input(format!("[plate]: {fault}; {}", advice(&fault))))?;
        // A body with the permeability of air is left out.
        let own = |k: &usize| (self.bodies[*k].body.clone(), self.bodies[*k].chi);
        let of_steel = |group: &Vec<usize>| {
            let bodies = group.iter().map(own).filter(|(_, chi)| *chi > 0.0);
            bodies.collect::<Vec<(Body, f64)>>()
        };
        let groups: Vec<_> = self.joined.iter().map(of_steel).collect();
        let groups: Vec<_> = groups.into_iter().filter(|own| !own.is_empty()).collect();
        let planes_m = iron.planes_m;
        let mirrors = [0, 1].map(|axis| is_mirrored(&groups, axis, planes_m[axis]));
        let cuts_m = [0, 1].map(|axis| mirrors[axis].then_some(planes_m[axis]));
        for group in &groups {
            let faces = match &group[0] {
                (body, _) if matches!(body.solid, Solid::Box(_)) => {
                    box_union::joined(group, cuts_m)
                }
                (body, chi) => {
                    let faces = body.faces().into_iter();
                    faces.map(|face| face.of_steel(*chi)).collect()
                }
            };
            iron = iron.with_joined(faces, mirrors);
        }
        Ok((coils, iron))
    }

    /// Solves it with the cores of `scene`, to `tolerance`, for heights from `lowest_m` up.
    ///
    /// # Errors
    /// A core beside the plate; a node on a winding's edge; more steel than memory allows.
    pub(super) fn solve(
        &self,
        scene: &Scene,
        tolerance: f64,
        lowest_m: f64,
    ) -> Result<IronArray, RunError> {
        let (coils, iron) = self.bodies(scene)?;
        IronArray::new(coils, &iron, tolerance, lowest_m).map_err(|fault| match fault {
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
                return Err(RunError::Input(format!(
                    "the magnet at the target, {} mm above coil {coil}, cuts [plate] or [[iron]], whose surface is \
                     {:.3} mm from its centre (below nothing: inside); raise target.height_mm, or move the steel",
                    height_m * 1e3,
                    distance_m * 1e3
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

    /// Warnings about meshes that were put right, and about steel above its knee, where linear steel ends.
    #[must_use]
    pub fn warnings(&self, scene: &Scene, peaks: &IronPeaks, at: &str) -> Vec<String> {
        let of_core = scene
            .core
            .as_ref()
            .map_or(f64::INFINITY, |core| core.knee_t);
        let largest = |a: Peak, b: &Peak| if b.field_t > a.field_t { *b } else { a };
        let core = peaks.cores.iter().fold(Peak::default(), largest);
        let core = above_knee(core, of_core, &format!("a core of the array at {at}"));
        let plate = above_knee(
            peaks.elsewhere,
            self.knee_t,
            &format!("the plate or [[iron]] at {at}"),
        );
        let put_right = self.put_right.iter().cloned();
        put_right.chain(core).chain(plate).collect()
    }

    /// How far inside its surface the largest |B| is looked for, m.
    pub(super) fn depth_m(&self) -> f64 {
        let solids = self.solids().into_iter();
        solids.fold(DEPTH_M, |depth, body| {
            depth.min(DEPTH_PART * body.thickness_m())
        })
    }
}

fn advice(fault: &Fault) -> &'static str {
    match fault {
        Fault::BesidePlate(_) => "make it larger",
        Fault::HoleAtEdge { .. } | Fault::HoleAtFoot { .. } | Fault::HolesMeet { .. } => {
            "move the hole or make it smaller: what is left between is not resolved"
        }
    }
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

/// A sentence where the peak, or what its error allows, lies above the knee.
fn above_knee(peak: Peak, knee_t: f64, whose: &str) -> Option<String> {
    let (peak_t, error_t) = (peak.field_t, peak.error_t.unwrap_or(0.0));
    let reaches = format!("{whose} reaches {peak_t:.2} T, +/- {error_t:.2} T,");
    let advice = "make the steel thicker, or lower the current";
    if peak_t > knee_t {
        Some(format!(
            "{reaches} above the steel's knee at {knee_t} T, but is taken as linear: the force will be smaller \
             than stated; {advice}"
        ))
    } else if peak_t + error_t > knee_t {
        Some(format!(
            "{reaches} which may be above the steel's knee at {knee_t} T, but is taken as linear: a smaller \
             --tolerance says more; {advice}"
        ))
    } else {
        None
    }
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

/// Bodies by their numbers, those that hang together in one entry.
///
/// # Errors
/// Boxes that touch along a line alone, or overlap and are of different steels.
fn joined(bodies: &[IronBody]) -> Result<Vec<Vec<usize>>, RunError> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (number, own) in bodies.iter().enumerate() {
        let mut group = vec![number];
        for (other, second) in bodies[..number].iter().enumerate() {
            let (a, b) = (&own.name, &second.name);
            match contact(&own.body, &second.body) {
                Contact::None => continue,
                Contact::Volume if own.chi != second.chi => {
                    return Err(RunError::Input(format!(
                        "{a} and {b} overlap and are of different steels: let them touch, or give both one \
                         relative_permeability"
                    )));
                }
                Contact::Face | Contact::Volume => {
                    let at = groups.iter().position(|group| group.contains(&other));
                    group.extend(at.map(|at| groups.swap_remove(at)).into_iter().flatten());
                }
                // Their corners may be filled by a third.
                Contact::Line => {}
            }
        }
        group.sort_unstable();
        groups.push(group);
    }
    for group in &mut groups {
        group.sort_unstable();
    }
    groups.sort_unstable();
    Ok(groups)
}

/// `(1.0, 2.5, -3.0) mm`.
fn place_mm(place_m: Point) -> String {
    let [x, y, z] = place_m.map(|c| 1e3 * c + 0.0);
    format!("({x:.3}, {y:.3}, {z:.3}) mm")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_warns_as_far_as_its_error_reaches() {
        let said = |field_t, error_t| {
            let peak = Peak {
                field_t,
                place_m: [0.0; 3],
                error_t,
            };
            above_knee(peak, 1.5, "a plate")
        };
        assert_eq!(said(1.37, Some(0.1)), None);
        assert!(said(1.37, Some(0.17)).unwrap().contains("may be above"));
        let above = said(1.63, Some(0.17)).unwrap();
        assert!(above.contains("1.63 T, +/- 0.17 T, above"), "{above}");
    }
}
