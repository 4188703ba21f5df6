//! The plate and other bodies of a design's steel.

use super::Scene;
use super::core_material::{Material, SceneCore};
use super::passive_table::Turn;
use crate::RunError;
use crate::design::iron::{Hole, Iron as Described, IronShape, LinearSteel, PlateOutline};
use crate::design::{Coupling, Design};
use crate::field::iron::array::{IronArray, IronPeaks, Peak, Unsolved};
use crate::field::iron::bodies::{Body, Coils, Fault, Iron, Outline, Plate, Site, Solid, UPRIGHT};
use crate::field::iron::face::Point;
use crate::field::steel::CoreShape;
use crate::field::winding::Winding;

/// Bodies closer than this part of the smaller core radius or plate are neither apart nor joined.
const LEAST_GAP: f64 = 0.01;
/// Depth below the surface at which the largest |B| is looked for, and its largest part of a thickness, m.
const DEPTH_M: f64 = 1e-3;
const DEPTH_PART: f64 = 0.1;

/// The steel of a design beyond its cores.
#[derive(Debug, Clone)]
pub struct SceneIron {
    plate: Option<Plate>,
    bodies: Vec<(Body, f64)>,
    names: Vec<String>,
    /// Height of the highest of it, m.
    pub(super) top_m: f64,
    /// Flux density above which a warning is due: the least of all bodies, T.
    pub knee_t: f64,
}

impl SceneIron {
    /// Of `design`; `None` where it has cores alone.
    ///
    /// # Errors
    /// Steel along a curve, bodies that meet each other, a winding or a bore.
    pub(super) fn new(
        design: &Design,
        winding: &Winding,
        core: Option<&SceneCore>,
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
        let bodies: Vec<(Body, f64)> = design
            .iron
            .iter()
            .map(|iron| (body(iron), chi(iron.steel)))
            .collect();
        let heights = bodies
            .iter()
            .flat_map(|(body, _)| body.places_m())
            .map(|place| place[2]);
        let made = Self {
            top_m: (heights.chain(plate.as_ref().map(|plate| plate.top_m)))
                .fold(f64::NEG_INFINITY, f64::max),
            plate,
            bodies,
            names: (0..design.iron.len())
                .map(|k| format!("[[iron]] {k}"))
                .collect(),
            knee_t: (design.iron.iter().map(|iron| iron.steel))
                .chain(design.plate.as_ref().map(|plate| plate.steel))
                .fold(f64::INFINITY, |knee, steel| knee.min(steel.knee_t)),
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
        let plate = self.plate.as_ref();
        let plate = plate.map(|plate| ("[plate]".to_owned(), plate.body()));
        let bodies = self
            .names
            .iter()
            .cloned()
            .zip(self.bodies.iter().map(|(body, _)| *body));
        let all: Vec<(String, Body)> = plate.into_iter().chain(bodies).collect();
        for (number, (name, body)) in all.iter().enumerate() {
            for (coil, axis) in axes.iter().enumerate() {
                let room = full(*axis, outer, -winding.length_m, 0.0);
                if meets(body, &room, 0.0) {
                    return Err(RunError::Input(format!(
                        "{name} cuts the winding of coil {coil} or its bore, whose steel is [core]; move it or \
                         make it smaller"
                    )));
                }
                let Some(shape) = core else { continue };
                let own = full(*axis, shape.radius_m, shape.bottom_m, shape.top_m);
                let least = LEAST_GAP * shape.radius_m;
                let joined = name == "[plate]"
                    && self
                        .plate
                        .as_ref()
                        .is_some_and(|plate| plate.top_m == shape.bottom_m);
                if !joined && meets(body, &own, least) {
                    return Err(RunError::Input(format!(
                        "{name} is less than {:.3} mm from the core of coil {coil}: closer steel is not resolved, \
                         and only [plate] with gap_mm = 0 joins the cores",
                        least * 1e3
                    )));
                }
            }
            for (other, second) in &all[..number] {
                let least = LEAST_GAP * size_m(body).min(size_m(second));
                if meets(body, second, least) {
                    return Err(RunError::Input(format!(
                        "{name} and {other} are less than {:.3} mm apart or overlap: closer steel is not \
                         resolved, and only cores and [plate] are joined",
                        least * 1e3
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
        // What has the permeability of air is none.
        for (body, chi) in self.bodies.iter().filter(|(_, chi)| *chi > 0.0) {
            iron = iron.with(body.faces(), *chi);
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
                 or leave steel out"
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

    /// Distance of a place from the nearest of it, m; below nothing inside.
    pub(super) fn distance_m(&self, place_m: Point) -> f64 {
        let plate = self.plate.iter().map(|plate| plate.distance_m(place_m));
        let bodies = self.bodies.iter();
        let all = plate.chain(bodies.map(|(body, _)| body.distance_m(place_m)));
        all.fold(f64::INFINITY, f64::min)
    }

    /// The bodies, the plate among them.
    #[must_use]
    pub fn solids(&self) -> Vec<Body> {
        let plate = self.plate.as_ref().map(Plate::body);
        self.bodies
            .iter()
            .map(|(body, _)| *body)
            .chain(plate)
            .collect()
    }

    /// Warnings about steel above its knee, where linear steel ends.
    #[must_use]
    pub fn above_knee(&self, scene: &Scene, peaks: &IronPeaks, at: &str) -> Vec<String> {
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
        core.into_iter().chain(plate).collect()
    }

    /// How far inside its surface the largest |B| is looked for, m.
    pub(super) fn depth_m(&self) -> f64 {
        let plate = self.plate.as_ref().map(Plate::body);
        let bodies = self.bodies.iter().map(|(body, _)| *body).chain(plate);
        bodies.fold(DEPTH_M, |depth, body| depth.min(DEPTH_PART * size_m(&body)))
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

/// The least thickness of a body, m.
fn size_m(body: &Body) -> f64 {
    match body.solid {
        Solid::Box(sides) => sides.into_iter().fold(f64::INFINITY, f64::min),
        Solid::Tube([inner, outer, length]) => length.min(outer - inner),
        Solid::Ball(radius) => 2.0 * radius,
    }
}

/// Whether two bodies come closer than `least_m`, by places on the surfaces of both.
fn meets(a: &Body, b: &Body, least_m: f64) -> bool {
    let of = |a: &Body, b: &Body| {
        let mut places = a.places_m().chain([a.centre_m]);
        places.any(|place| b.distance_m(place) < least_m - 1e-12)
    };
    of(a, b) || of(b, a)
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

pub(super) fn body(iron: &Described) -> Body {
    let [a, b, c] = iron.rotate_deg.map(|angle| angle.to_radians().sin_cos());
    let ((sa, ca), (sb, cb), (sc, cc)) = (a, b, c);
    Body {
        solid: match iron.shape {
            IronShape::Box(sides) => Solid::Box(sides),
            IronShape::Tube([inner, outer, length]) => {
                Solid::Tube([0.5 * inner, 0.5 * outer, length])
            }
            IronShape::Ball(diameter) => Solid::Ball(0.5 * diameter),
        },
        centre_m: iron.centre_m,
        // About x, then y, then z.
        turn: [
            [cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
            [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
            [-sb, cb * sa, cb * ca],
        ],
    }
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
