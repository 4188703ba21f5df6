//! The solved steel of a scene, and the field it adds.

use crate::field::steel::clearance::Clearance;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::core_material::{Material, SceneCore};
use super::iron::SceneIron;
use super::prepared_field::PreparedField;
use super::{AIR_SHARE, Scene, at_current, coupled};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::field::iron::array::IronArray;
use crate::field::iron::peaks::PeakSearch;
use crate::field::steel::CLOSEST;
use crate::field::steel::array::CoupledArray;
use crate::field::steel::array_request::{ArrayRequest, DriveCache, NoCache};
use crate::field::steel::array_steel::{AloneCore, ArraySteel, NoSteel, SteelField};
use crate::field::steel::cored_coil::CoredCoil;
use crate::field::steel::linear_equivalent::{
    AGAINST_THE_CURVE, GradientDifferences, LinearEquivalent,
};
use crate::field::steel::saturated_coil::SaturatedCoil;
use crate::field::winding::KERNEL_ERROR;
use crate::numerics::spread::spread;

/// Most points at which solutions of steel of any shape are compared.
const IRON_SAMPLES: usize = 24;
/// Share of the tolerance given to evaluating a solution.
pub(crate) const EVALUATION_SHARE: f64 = 0.1;
/// Heights above a core, in radii, from which on places are far from the steel.
const FAR: f64 = 0.5;
/// Share of the tolerance given to what is claimed of the steel's solution.
const STEEL_SHARE: f64 = 0.45;

/// The stage that states what linear cores leave of their B-H curve.
pub(crate) const LINEAR_CORES: &str = "linear_cores";
/// The one that states how far forces per ampere along a B-H curve are from those at smaller currents.
pub(crate) const SMALLER_CURRENTS: &str = "smaller_currents";

/// How it is known what smaller currents give.
const AT_SMALLER_CURRENTS: &str = "the largest difference of a core at several smaller currents from itself at the \
                                   largest current of a coil, alone and per ampere, with a margin";

/// How the error of linear cores in the place of those along a curve is known.
const TWO_OF_LINEAR_CORES: &str = "the difference of two resolutions of the coupled cores, which are linear: what that \
                                   leaves of the B-H curve is stated beside it";

/// Length of coupled cores, in radii, beyond which their solution is not attempted: the work grows with
/// the length, the error faster (at 250 radii 13 CPU s for four cores to 1e-4, at 800 it is missed).
const MOST_SLENDER: f64 = 500.0;

/// The solved steel of a scene.
#[derive(Debug, Clone, Serialize, Deserialize)]
enum Steel {
    /// There is none.
    None,
    /// Every core answers to its own winding alone.
    Alone(Box<AloneCore>),
    /// All cores answer to every winding.
    Coupled(Box<CoupledArray>),
    /// Steel of any shape answers to every winding.
    Iron(Box<IronArray>),
}

impl Steel {
    /// The steel as a source: what every other file knows of it.
    fn source(&self) -> &dyn ArraySteel {
        match self {
            Self::None => &NoSteel,
            Self::Alone(core) => &**core,
            Self::Coupled(array) => &**array,
            Self::Iron(array) => &**array,
        }
    }
}

/// A scene's field sources, ready to be evaluated.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Solved {
    steel: Steel,
    /// The tolerance it was solved to, relative to the largest |grad B| at a height.
    pub tolerance: f64,
    /// The error that is claimed of the steel's solution, relative to the same; 0 without steel.
    pub steel_error: f64,
    /// Permeability of the linear solution. With a B-H curve the cores of coils that are not
    /// coupled follow the curve at the rated current, or at the supply's where that is less; those that are coupled are
    /// linear, of the permeability with which one coil alone has the curve's gradient at the target at that current.
    pub relative_permeability: f64,
    /// The linear cores in the place of those along a curve, where they are coupled.
    #[serde(default)]
    linear: Option<LinearEquivalent>,
    /// The height that it was solved from, m.
    lowest_m: f64,
    /// The largest |B| in a core at that current, T, where it is above the steel's knee.
    #[serde(default)]
    above_knee_t: Option<f64>,
    /// How far a core's gradients are from those at smaller currents.
    #[serde(default)]
    smaller_currents: Option<GradientDifferences>,
    /// The field as it was last prepared.
    #[serde(skip)]
    prepared: PreparedField,
}

impl Solved {
    /// Windings in air.
    #[must_use]
    pub fn in_air(tolerance: f64) -> Self {
        Self {
            steel: Steel::None,
            tolerance,
            steel_error: 0.0,
            relative_permeability: 1.0,
            linear: None,
            lowest_m: f64::NEG_INFINITY,
            above_knee_t: None,
            smaller_currents: None,
            prepared: PreparedField::default(),
        }
    }

    /// A sentence on forces per ampere that hold at the currents of saturated cores alone.
    #[must_use]
    pub fn above_knee(&self, scene: &Scene) -> Option<String> {
        let (peak_t, core) = self.above_knee_t.zip(scene.core.as_ref())?;
        let smaller = self.smaller_currents.as_ref()?.largest_from(self.lowest_m);
        let linear = self.linear_cores().map_or_else(String::new, |stage| {
            format!(
                "; coupled cores are taken as linear: one alone is up to {:.2} % off the B-H curve, among neighbours it \
                 may be more",
                100.0 * stage.estimate
            )
        });
        Some(format!(
            "the core at {} A reaches {peak_t:.2} T, above the steel's knee at {:.2} T: forces per ampere are those at \
             that current; those of smaller currents are up to {:.2} % off, and forces of several do not add up: set \
             supply.current_max_a near the currents used{linear}",
            most_current_a(scene),
            core.knee_t,
            100.0 * smaller
        ))
    }

    /// How far the gradients of linear cores are from those of cores along their B-H curve; `None` where none are in
    /// their place.
    fn linear_cores(&self) -> Option<StageAccuracy> {
        Some(self.of_curve(&self.linear.as_ref()?.gradient, AGAINST_THE_CURVE))
    }

    /// What the forces per ampere leave of a B-H curve, by the stages' names: those of linear cores, and those of smaller
    /// currents.
    ///
    /// It is what the model leaves, which no tolerance changes: stages of their own.
    pub fn curve_stages(&self) -> impl Iterator<Item = (&'static str, StageAccuracy)> {
        let linear = self.linear_cores().map(|stage| (LINEAR_CORES, stage));
        let smaller = self.smaller_currents.as_ref();
        let smaller = smaller.map(|differs| self.of_curve(differs, AT_SMALLER_CURRENTS));
        let smaller = smaller.map(|stage| (SMALLER_CURRENTS, stage));
        linear.into_iter().chain(smaller)
    }

    fn of_curve(&self, differences: &GradientDifferences, method: &str) -> StageAccuracy {
        StageAccuracy {
            estimate: differences.largest_from(self.lowest_m),
            relative_to: "the largest |grad B| at a height".to_owned(),
            method: method.to_owned(),
        }
    }

    /// The same of the flux linkage.
    #[must_use]
    pub(super) fn linear_flux(&self) -> Option<StageAccuracy> {
        Some(StageAccuracy {
            estimate: self.linear.as_ref()?.flux_error,
            relative_to: "the self inductance".to_owned(),
            method: AGAINST_THE_CURVE.to_owned(),
        })
    }

    /// The same solution, made for places anywhere, with the error that it has at groups of places with `clearances`.
    ///
    /// # Errors
    /// A place on a winding's edge.
    pub(crate) fn for_groups(
        self,
        scene: &Scene,
        clearances: &[Clearance],
    ) -> Result<Self, RunError> {
        let lowest_m = (clearances.iter()).fold(f64::INFINITY, |z, group| z.min(group.lowest_m));
        let highest_m =
            (clearances.iter()).fold(f64::NEG_INFINITY, |z, group| z.max(group.highest_m));
        let steel_error = match (&self.steel, &scene.core) {
            (Steel::Iron(array), _) => {
                array.error_between([lowest_m, highest_m], STEEL_SHARE * self.tolerance)?
            }
            (Steel::Coupled(array), Some(core)) => {
                let permeability = self.relative_permeability;
                let request =
                    request(scene, core, permeability, self.tolerance, f64::NEG_INFINITY)?;
                request.error_at(array, clearances)?
            }
            _ => self.steel_error,
        };
        Ok(Self {
            lowest_m,
            steel_error,
            ..self
        })
    }

    /// The steel as a source.
    #[must_use]
    pub fn steel(&self) -> &dyn ArraySteel {
        self.steel.source()
    }

    /// Whether there is steel.
    #[must_use]
    pub fn has_steel(&self) -> bool {
        self.steel().is_present()
    }

    /// The sources as forces ask for them, where these are as maps do: of steel one solution serves
    /// both.
    ///
    /// # Errors
    /// As [`solve`].
    pub fn for_forces(&self, scene: &Scene, lowest_m: f64) -> Result<Self, RunError> {
        if self.has_steel() {
            Ok(self.clone())
        } else {
            solve(scene, scene.tolerances.forces, lowest_m)
        }
    }

    /// Where the largest |B| in the plate, other bodies and the cores among them is looked for; `None` where steel is
    /// cores alone.
    #[must_use]
    pub fn iron_search(&self, scene: &Scene) -> Option<PeakSearch<'_>> {
        let (iron, array) = (scene.iron.as_ref()?, self.steel().iron()?);
        Some(PeakSearch::new(array, iron.depths(scene.core.as_ref())))
    }

    /// The error of B at some of `points_m`, relative to |B| there; `None` where steel is cores alone, whose error holds
    /// everywhere.
    ///
    /// # Errors
    /// A place on a winding's edge.
    pub fn iron_error(&self, points_m: &[[f64; 3]]) -> Result<Option<f64>, RunError> {
        let Some(array) = self.steel().iron() else {
            return Ok(None);
        };
        let some = spread(points_m.len(), IRON_SAMPLES).into_iter();
        let some: Vec<_> = some.map(|point| points_m[point]).collect();
        // Two solutions need not show by their difference what the solver and the evaluation leave.
        let solver = array.solver_error(STEEL_SHARE * self.tolerance);
        Ok(array.error_at(&some, solver + EVALUATION_SHARE * self.tolerance)?)
    }

    /// How [`Solved::steel_error`] is known; `None` without steel.
    #[must_use]
    pub fn steel_method(&self) -> Option<&'static str> {
        if self.linear.is_some() {
            return Some(TWO_OF_LINEAR_CORES);
        }
        self.steel().method()
    }

    /// The share of the tolerance given to evaluating the windings' field beside other parts.
    pub(crate) fn evaluation_share(&self) -> f64 {
        if self.has_steel() {
            EVALUATION_SHARE
        } else {
            AIR_SHARE
        }
    }

    /// How [`Solved::point_error`] is known.
    #[must_use]
    pub fn point_method(&self) -> String {
        match self.steel_method() {
            None => {
                "a-priori quadrature bound; rounding sampled against 40-digit values".to_owned()
            }
            Some(steel) => format!(
                "{steel}; error of its evaluation bounded, over coupled cores estimated at close places"
            ),
        }
    }

    /// The claimed error of the field at points: the steel's solution and its evaluation; in air the
    /// kernel's error.
    #[must_use]
    pub fn point_error(&self) -> f64 {
        if self.has_steel() {
            self.steel_error + EVALUATION_SHARE * self.tolerance
        } else {
            KERNEL_ERROR
        }
    }

    /// The proven error of evaluating a magnet's force by dipoles of a rule of this `amplification` and
    /// `bound`, relative to its moment and the gradient at its height; the steel's solution left out.
    #[must_use]
    pub fn force_evaluation(&self, amplification: f64, bound: f64) -> f64 {
        let evaluation = if self.has_steel() {
            EVALUATION_SHARE * self.tolerance
        } else {
            0.0
        };
        evaluation + KERNEL_ERROR * amplification + bound
    }

    /// The same solution, evaluated to another tolerance.
    pub(super) fn to_tolerance(&self, tolerance: f64) -> Self {
        Self {
            tolerance,
            ..self.clone()
        }
    }

    /// Whether the field at points is within the tolerance.
    #[must_use]
    pub fn reached(&self) -> bool {
        self.point_error() <= self.tolerance
    }

    /// The steel's field at places within `reach_m` of `points_m`, whose errors may grow by
    /// `amplification` in what becomes of it; `None` without steel.
    ///
    /// # Errors
    /// A point on the steel's surface or hardly off it.
    pub fn sources(
        &self,
        scene: &Scene,
        points_m: &[[f64; 3]],
        reach_m: f64,
        amplification: f64,
    ) -> Result<Option<Arc<SteelField>>, RunError> {
        if !self.has_steel() {
            return Ok(None);
        }
        let clearance = clearance(scene, points_m, reach_m)?;
        Ok(self.sources_at(scene, clearance, amplification))
    }

    /// The steel's field at places with `clearance`, whose errors may grow by `amplification`; `None` without steel.
    #[must_use]
    pub fn sources_at(
        &self,
        scene: &Scene,
        clearance: Clearance,
        amplification: f64,
    ) -> Option<Arc<SteelField>> {
        let (top_m, _) = scene.steel_extent_m()?;
        let tolerance = EVALUATION_SHARE * self.tolerance / amplification;
        let prepared = &self.prepared;
        prepared.of(self.steel(), top_m, clearance, tolerance)
    }
}

/// How low and high places within `reach_m` of `points_m` go, and how close to any steel: at most a core's
/// length, beyond which rings need be no finer.
///
/// # Errors
/// A point on the steel's surface or hardly off it.
pub(crate) fn clearance(
    scene: &Scene,
    points_m: &[[f64; 3]],
    reach_m: f64,
) -> Result<Clearance, RunError> {
    let (top_m, far_m) = scene.steel_extent_m().unwrap_or_default();
    let mut clearance = Clearance {
        lowest_m: f64::INFINITY,
        highest_m: f64::NEG_INFINITY,
        distance_m: far_m,
    };
    for (number, [x, y, z]) in points_m.iter().enumerate() {
        clearance.lowest_m = clearance.lowest_m.min(*z);
        clearance.highest_m = clearance.highest_m.max(*z);
        // Seen from farther than its length a core needs no finer rings.
        if *z > top_m + far_m {
            continue;
        }
        let distance = clearance_of_m(scene, number + 1, [*x, *y, *z], reach_m)?;
        clearance.distance_m = clearance.distance_m.min(distance);
    }
    Ok(clearance.within(reach_m))
}

/// Distance of point `number` from the nearest steel, at most a core's length, m.
///
/// # Errors
/// A place within `reach_m` of the point on the steel's surface or hardly off it.
pub(crate) fn clearance_of_m(
    scene: &Scene,
    number: usize,
    [x, y, z]: [f64; 3],
    reach_m: f64,
) -> Result<f64, RunError> {
    let (_, mut distance_m) = scene.steel_extent_m().unwrap_or_default();
    if let Some(iron) = &scene.iron {
        let distance = iron.distance_m([x, y, z]);
        let least_m = CLOSEST * scene.winding.inner_radius_m;
        if distance - reach_m < least_m {
            let place = if distance < 0.0 {
                format!("lies {:.3} mm inside", -distance * 1e3)
            } else {
                format!("is {:.3} mm from the surface of", distance * 1e3)
            };
            return Err(RunError::Input(format!(
                "point {number} ({x}, {y}, {z} m) {place} [plate] or [[iron]], where the field is not \
                 resolved; keep {:.3} mm away from the surface",
                (reach_m + least_m) * 1e3
            )));
        }
        distance_m = distance_m.min(distance);
    }
    let Some(SceneCore { shape, .. }) = &scene.core else {
        return Ok(distance_m);
    };
    for coil in &scene.coils {
        let r = (x - coil.axis_m[0]).hypot(y - coil.axis_m[1]);
        let distance = shape.distance_m(r, z);
        if distance - reach_m < CLOSEST * shape.radius_m {
            return Err(RunError::Input(format!(
                "point {number} ({x}, {y}, {z} m) is {:.3} mm from the surface of the core of \
                 coil {}, where the field is not resolved; keep {:.3} mm away from it",
                distance * 1e3,
                coil.number,
                (reach_m + CLOSEST * shape.radius_m) * 1e3
            )));
        }
        distance_m = distance_m.min(distance);
    }
    Ok(distance_m)
}

/// Solves the steel of `scene` to `tolerance`, one of [`Scene::tolerances`], for heights from
/// `lowest_m` up; cores that are linear and answer to their own winding alone for all places, where
/// `lowest_m` is close.
///
/// # Errors
/// An outline that meets a winding's edge; a B-H curve along which no state is found.
pub fn solve(scene: &Scene, tolerance: f64, lowest_m: f64) -> Result<Solved, RunError> {
    solve_with(scene, tolerance, lowest_m, &NoCache)
}

/// As [`solve`]; the drives of many coupled cores that `cache` holds are taken from there.
///
/// # Errors
/// As [`solve`].
pub(super) fn solve_with(
    scene: &Scene,
    tolerance: f64,
    lowest_m: f64,
    cache: &dyn DriveCache,
) -> Result<Solved, RunError> {
    if let Some(iron) = &scene.iron {
        return solve_iron(scene, iron, tolerance, lowest_m);
    }
    let Some(core) = &scene.core else {
        return Ok(Solved::in_air(tolerance));
    };
    let along_curve = along_curve(scene, core, tolerance, lowest_m)?;
    let relative_permeability = permeability(core, along_curve.as_ref());
    let of_curve = along_curve.as_ref();
    let peak_t = of_curve.map(|of| of.state.inside.peak_b_t);
    let above_knee_t = peak_t.filter(|peak_t| *peak_t > core.knee_t);
    let smaller_currents = of_curve.map(|of| of.smaller_currents.clone());
    let linear = of_curve.and_then(|of| of.linear.clone());
    let solved = |steel, steel_error| Solved {
        steel,
        tolerance,
        steel_error,
        relative_permeability,
        linear,
        lowest_m,
        above_knee_t,
        smaller_currents,
        prepared: PreparedField::default(),
    };
    if coupled(scene.design) {
        let array =
            request(scene, core, relative_permeability, tolerance, lowest_m)?.solve(cache)?;
        let steel_error = array.relative_error;
        return Ok(solved(Steel::Coupled(Box::new(array)), steel_error));
    }
    let (alone, steel_error) = match along_curve {
        Some(AlongCurve { state, .. }) => (
            AloneCore {
                layer: state.layer,
                added_inductance_h: state.added_inductance_h,
                along_curve: true,
            },
            state.relative_error,
        ),
        None => {
            let (winding, shape, aim) = (&scene.winding, core.shape, STEEL_SHARE * tolerance);
            // Far from the steel a solution does that is several times cheaper to evaluate.
            let coil = if lowest_m > shape.top_m.max(0.0) + FAR * shape.radius_m {
                CoredCoil::new(winding, shape, relative_permeability, aim, lowest_m)?
            } else {
                CoredCoil::everywhere(winding, shape, relative_permeability, aim)?
            };
            (
                AloneCore {
                    layer: coil.core,
                    added_inductance_h: coil.added_inductance_h,
                    along_curve: false,
                },
                coil.relative_error,
            )
        }
    };
    Ok(solved(Steel::Alone(Box::new(alone)), steel_error))
}

/// The largest current that a coil can have in either direction, A: its own limit, or what the limit of the sum leaves it
/// where the others run as far below zero as they can.
fn most_current_a(scene: &Scene) -> f64 {
    let total_a = scene.design.supply.total_current_max_a;
    let total_a = total_a.unwrap_or(f64::INFINITY);
    let least_a: f64 = scene.lower_a.iter().sum();
    let limits_a = scene.lower_a.iter().zip(&scene.upper_a);
    let most_a = limits_a.map(|(lower_a, upper_a)| {
        let left_a = total_a - (least_a - lower_a);
        upper_a.min(left_a).max(-lower_a)
    });
    most_a.fold(0.0, f64::max)
}

/// One core along its B-H curve, alone at the largest current that a coil can have.
struct AlongCurve {
    state: SaturatedCoil,
    /// What is taken for it where cores are coupled.
    linear: Option<LinearEquivalent>,
    smaller_currents: GradientDifferences,
    relative_permeability: f64,
}

/// The core along its B-H curve; `None` where it has none, or no current.
///
/// # Errors
/// A curve along which no state is found.
fn along_curve(
    scene: &Scene,
    core: &SceneCore,
    tolerance: f64,
    lowest_m: f64,
) -> Result<Option<AlongCurve>, RunError> {
    let current_a = most_current_a(scene);
    let curve = match &core.material {
        Material::Curve(curve) if current_a > 0.0 => curve,
        Material::Curve(_) | Material::Linear(_) => return Ok(None),
    };
    let aim = STEEL_SHARE * tolerance;
    let state = at_current::solve(scene, core, curve, current_a, aim, lowest_m)?;
    let linear = coupled(scene.design)
        .then(|| at_current::linear(scene, core, curve, &state))
        .transpose()?;
    Ok(Some(AlongCurve {
        smaller_currents: at_current::smaller_currents(scene, core, curve, current_a)?,
        relative_permeability: linear.as_ref().map_or_else(
            || at_current::mean_permeability(curve, &state),
            |linear| linear.relative_permeability,
        ),
        state,
        linear,
    }))
}

/// The permeability of the linear solution beside a core along its curve.
fn permeability(core: &SceneCore, along_curve: Option<&AlongCurve>) -> f64 {
    along_curve.map_or_else(
        || core.relative_permeability(),
        |of| of.relative_permeability,
    )
}

/// The coupled cores of `scene` as they are solved.
///
/// # Errors
/// Cores too slender for that.
fn request<'a>(
    scene: &'a Scene,
    core: &SceneCore,
    relative_permeability: f64,
    tolerance: f64,
    lowest_m: f64,
) -> Result<ArrayRequest<'a>, RunError> {
    let radii = core.shape.length_m() / core.shape.radius_m;
    if radii > MOST_SLENDER {
        return Err(RunError::Input(format!(
            "[core] cores {radii:.0} radii long are not solved together with their neighbours: it \
             would take minutes and miss every tolerance beyond {MOST_SLENDER} radii; shorten the \
             core, or give [array] coupling = \"none\""
        )));
    }
    Ok(ArrayRequest {
        winding: &scene.winding,
        shape: core.shape,
        relative_permeability,
        positions_m: &scene.design.array.positions_m,
        tolerance: STEEL_SHARE * tolerance,
        lowest_m,
    })
}

/// The coupled cores of `scene` as [`solve_with`] solves them, in blocks of drives; `None` where it does
/// not solve it in blocks.
///
/// # Errors
/// As [`solve`].
pub(super) fn in_blocks<'a>(
    scene: &'a Scene,
    tolerance: f64,
    lowest_m: f64,
) -> Result<Option<ArrayRequest<'a>>, RunError> {
    let Some(core) = scene.core.as_ref().filter(|_| coupled(scene.design)) else {
        return Ok(None);
    };
    let along_curve = along_curve(scene, core, tolerance, lowest_m)?;
    let relative_permeability = permeability(core, along_curve.as_ref());
    let request = request(scene, core, relative_permeability, tolerance, lowest_m)?;
    Ok(Some(request).filter(|request| request.blocks() > 0))
}

fn solve_iron(
    scene: &Scene,
    iron: &SceneIron,
    tolerance: f64,
    lowest_m: f64,
) -> Result<Solved, RunError> {
    let array = iron.solve(scene, STEEL_SHARE * tolerance, lowest_m)?;
    let core = scene.core.as_ref();
    Ok(Solved {
        tolerance,
        steel_error: array.relative_error,
        steel: Steel::Iron(Box::new(array)),
        relative_permeability: core.map_or(1.0, SceneCore::relative_permeability),
        linear: None,
        lowest_m,
        above_knee_t: None,
        smaller_currents: None,
        prepared: PreparedField::default(),
    })
}
