//! The steel of a design: its material, its solution, and the field it adds.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Scene;
use super::at_current::{self, SATURATED_TOLERANCE};
use crate::RunError;
use crate::design::bh_table::BhTable;
use crate::design::source;
use crate::design::{Core, Coupling, Design, Steel as Described};
use crate::field::steel::array::CoupledArray;
use crate::field::steel::axial_table::AxialTable;
use crate::field::steel::bh_curve::BhCurve;
use crate::field::steel::cored_coil::CoredCoil;
use crate::field::steel::equivalent_dipoles::{ArraySources, Parts};
use crate::field::steel::magnetized::MagnetizedCore;
use crate::field::steel::{CLOSEST, CoreShape};
use crate::field::winding::KERNEL_ERROR;
use crate::field::winding::Winding;

/// More permeable steel changes no field by more than its inverse.
const MOST_PERMEABLE: f64 = 1e9;

/// Default tolerance of one cored coil and of its maps.
pub const CORED_TOLERANCE: f64 = 1e-6;
/// Default tolerance of a coupled array.
pub const COUPLED_TOLERANCE: f64 = 1e-4;
/// Share of the tolerance given to evaluating a solution.
pub(crate) const EVALUATION_SHARE: f64 = 0.1;
/// How the error of one core's solution is known.
pub(crate) const TWO_OF_ONE_CORE: &str =
    "twice the difference of two resolutions of the core's surface";
/// The same of cores that magnetise each other.
pub(crate) const TWO_OF_COUPLED_CORES: &str =
    "the difference of two resolutions of the coupled cores";
/// The same of one core along a B-H curve.
pub(crate) const ALONG_CURVE: &str = "the larger difference among three resolutions of the core's surface and inside, times a \
     safety factor";
/// Heights above a core, in radii, from which on places are far from the steel.
const FAR: f64 = 0.5;
/// Share of the tolerance given to what is claimed of the steel's solution.
const STEEL_SHARE: f64 = 0.45;

/// The steel of every core of a design.
#[derive(Debug, Clone)]
pub struct SceneCore {
    /// Each core, its winding's axis at the origin.
    pub shape: CoreShape,
    /// How the steel magnetises.
    pub material: Material,
    /// Flux density above which a warning is due, T.
    pub knee_t: f64,
    /// S/m.
    pub conductivity_s_per_m: f64,
    /// The table of the magnetisation curve as it was parsed.
    pub curve_text: Option<String>,
    /// Warnings about the material.
    pub warnings: Vec<String>,
}

/// How the steel magnetises.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Material {
    /// A constant relative permeability.
    Linear(f64),
    /// A curve.
    Curve(Box<BhCurve>),
}

impl SceneCore {
    /// The core that `core` describes in the bore of `winding`.
    ///
    /// # Errors
    /// A B-H table that cannot be read or cannot be a steel's.
    pub fn new(core: &Core, winding: &Winding) -> Result<Self, RunError> {
        let shape = CoreShape {
            radius_m: winding.inner_radius_m - core.clearance_m,
            bottom_m: -(winding.length_m + core.below_m),
            top_m: core.above_m,
        };
        let mut warnings = Vec::new();
        let mut curve_text = None;
        let (material, knee_t) = match &core.steel {
            Described::Linear(mu_r) => (Material::Linear(*mu_r), core.knee_t),
            Described::Curve(path) => {
                let text = source::table_text_of(path);
                let text = text.map_err(|fault| RunError::Input(fault.to_string()))?;
                let table = BhTable::from_csv(&text, path)
                    .map_err(|fault| RunError::Input(fault.to_string()))?;
                curve_text = Some(text);
                let curve = BhCurve::new(&table.b_t, &table.h_a_per_m).map_err(|fault| {
                    RunError::Input(format!("core.bh_curve {}: {fault}", path.display()))
                })?;
                warnings.extend(curve.warnings().iter().map(ToString::to_string));
                let knee_t = core.knee_t.unwrap_or_else(|| curve.knee_t());
                (Material::Curve(Box::new(curve)), Some(knee_t))
            }
        };
        Ok(Self {
            shape,
            material,
            knee_t: knee_t.unwrap_or(f64::INFINITY),
            conductivity_s_per_m: core.conductivity_s_per_m,
            curve_text,
            warnings,
        })
    }

    /// The permeability that linear solutions use: the constant one, or the curve's at the origin;
    /// of a curve that starts level one at which they have come to their limit.
    #[must_use]
    pub fn relative_permeability(&self) -> f64 {
        match &self.material {
            Material::Linear(mu_r) => *mu_r,
            Material::Curve(curve) => curve.initial_relative_permeability().min(MOST_PERMEABLE),
        }
    }
}

/// The solved steel of a scene.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Steel {
    /// There is none.
    None,
    /// Every core answers to its own winding alone.
    Alone(Box<AloneCore>),
    /// All cores answer to every winding.
    Coupled(Box<CoupledArray>),
}

/// A core that answers to its own winding alone.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct AloneCore {
    /// Its layer per ampere.
    pub layer: MagnetizedCore,
    /// What it adds to the winding's inductance, H.
    pub added_inductance_h: f64,
}

/// The field that steel adds, ready to be evaluated.
#[derive(Debug, Clone)]
pub enum SteelField {
    /// Of one core at the origin that answers to its own winding alone, per ampere.
    Alone(Arc<AxialTable>),
    /// Of all cores, per ampere of every winding.
    Coupled(ArraySources),
}

impl SteelField {
    /// The field at `points_m`, [drive, component, point].
    ///
    /// # Panics
    /// When `out` has another length than drives x components x points.
    pub fn sample(&self, points_m: &[[f64; 3]], parts: Parts, out: &mut [f64]) {
        match self {
            Self::Alone(table) => table
                .sample_parts(points_m, parts, out)
                .expect("a table without a winding has no winding's edge"),
            Self::Coupled(sources) => sources.sample(points_m, parts, out),
        }
    }
}

/// A scene's field sources, ready to be evaluated.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Solved {
    /// The steel.
    pub steel: Steel,
    /// The tolerance asked for, relative to the largest |grad B| at a height.
    pub tolerance: f64,
    /// The error that is claimed of the steel's solution, relative to the same; 0 without steel.
    pub steel_error: f64,
    /// Permeability of the linear solution. With a B-H curve the cores of coils that are not
    /// coupled follow the curve at the rated current; those that are coupled are linear, of the
    /// permeability at the mean |B| of one coil alone at the rated current.
    pub relative_permeability: f64,
    /// Whether the cores follow their B-H curve.
    pub along_curve: bool,
}

impl Solved {
    /// How [`Solved::steel_error`] is known; `None` without steel.
    #[must_use]
    pub fn steel_method(&self) -> Option<&'static str> {
        match self.steel {
            Steel::None => None,
            Steel::Alone(_) if self.along_curve => Some(ALONG_CURVE),
            Steel::Alone(_) => Some(TWO_OF_ONE_CORE),
            Steel::Coupled(_) => Some(TWO_OF_COUPLED_CORES),
        }
    }

    /// How [`Solved::point_error`] is known.
    #[must_use]
    pub fn point_method(&self) -> String {
        match self.steel_method() {
            None => {
                "a-priori quadrature bound; rounding sampled against 40-digit values".to_owned()
            }
            Some(steel) => format!("{steel}; a-priori bound of its evaluation"),
        }
    }

    /// What is claimed of the field at points: the steel's solution and its evaluation; in air the
    /// kernel's error.
    #[must_use]
    pub fn point_error(&self) -> f64 {
        match self.steel {
            Steel::None => KERNEL_ERROR,
            Steel::Alone(_) | Steel::Coupled(_) => {
                self.steel_error + EVALUATION_SHARE * self.tolerance
            }
        }
    }

    /// What is claimed of a magnet's force, relative to its moment and the gradient at its height:
    /// by dipoles of a rule of this `amplification` and `bound`, `growth` being
    /// [`Scene::magnet_growth`].
    #[must_use]
    pub fn force_error(&self, growth: f64, amplification: f64, bound: f64) -> f64 {
        let evaluation = match self.steel {
            Steel::None => 0.0,
            Steel::Alone(_) | Steel::Coupled(_) => EVALUATION_SHARE * self.tolerance,
        };
        self.steel_error * growth + evaluation + KERNEL_ERROR * amplification + bound
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
    ) -> Result<Option<SteelField>, RunError> {
        let Some(core) = &scene.core else {
            return Ok(None);
        };
        let (lowest_m, distance_m) = clearance_m(scene, core, points_m, reach_m)?;
        Ok(self.sources_at(lowest_m, distance_m, amplification))
    }

    /// The steel's field at places no lower than `lowest_m` and no closer to a core than
    /// `distance_m`, whose errors may grow by `amplification`; `None` without steel.
    #[must_use]
    pub fn sources_at(
        &self,
        lowest_m: f64,
        distance_m: f64,
        amplification: f64,
    ) -> Option<SteelField> {
        let tolerance = EVALUATION_SHARE * self.tolerance / amplification;
        match &self.steel {
            Steel::None => None,
            Steel::Alone(coil) => Some(SteelField::Alone(Arc::new(AxialTable::new(
                None,
                coil.layer.clone(),
                tolerance,
            )))),
            Steel::Coupled(array) => {
                let sources = ArraySources::of_array(array, lowest_m, distance_m, tolerance);
                Some(SteelField::Coupled(sources))
            }
        }
    }

    /// The steel's part of the field per ampere of every coil at `points_m`, by what
    /// [`Solved::sources`] gave for them: [coil, component, point], gains not applied.
    #[must_use]
    pub fn steel_fields(
        &self,
        scene: &Scene,
        sources: &SteelField,
        points_m: &[[f64; 3]],
        parts: Parts,
    ) -> Vec<f64> {
        let block = parts.count() * points_m.len();
        let mut out = vec![0.0; scene.coils.len() * block];
        match &self.steel {
            Steel::None => {}
            Steel::Coupled(_) => sources.sample(points_m, parts, &mut out),
            Steel::Alone(_) => {
                for (coil, out) in scene.coils.iter().zip(out.chunks_exact_mut(block.max(1))) {
                    let [x, y] = coil.axis_m;
                    let own: Vec<[f64; 3]> = points_m
                        .iter()
                        .map(|p| [p[0] - x, p[1] - y, p[2]])
                        .collect();
                    sources.sample(&own, parts, out);
                }
            }
        }
        out
    }
}

/// How low places within `reach_m` of `points_m` go, and how close to any core: at most its
/// length, beyond which rings need be no finer; m.
///
/// # Errors
/// A point on the steel's surface or hardly off it.
pub(crate) fn clearance_m(
    scene: &Scene,
    core: &SceneCore,
    points_m: &[[f64; 3]],
    reach_m: f64,
) -> Result<(f64, f64), RunError> {
    let shape = core.shape;
    let (mut lowest_m, mut distance_m) = (f64::INFINITY, f64::INFINITY);
    for (number, [x, y, z]) in points_m.iter().enumerate() {
        lowest_m = lowest_m.min(*z);
        // Seen from farther than its length a core needs no finer rings.
        if *z > shape.top_m + shape.length_m() {
            continue;
        }
        let distance = clearance_of_m(scene, core, number + 1, [*x, *y, *z], reach_m)?;
        distance_m = distance_m.min(distance);
    }
    Ok((
        lowest_m - reach_m,
        distance_m.min(shape.length_m()) - reach_m,
    ))
}

/// Distance of point `number` from the nearest core, at most a core's length, m.
///
/// # Errors
/// A place within `reach_m` of the point on the steel's surface or hardly off it.
pub(crate) fn clearance_of_m(
    scene: &Scene,
    core: &SceneCore,
    number: usize,
    [x, y, z]: [f64; 3],
    reach_m: f64,
) -> Result<f64, RunError> {
    let shape = core.shape;
    let mut distance_m = shape.length_m();
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

/// The tolerance to which [`solve`] solves: `tolerance`, or the default of the scene's physics.
#[must_use]
pub fn tolerance_of(scene: &Scene, tolerance: Option<f64>, air_default: f64) -> f64 {
    let default = match &scene.core {
        None => air_default,
        Some(_) if coupled(scene.design) => COUPLED_TOLERANCE,
        Some(core) => match &core.material {
            Material::Curve(_) if scene.rated_current_a() > 0.0 => SATURATED_TOLERANCE,
            Material::Curve(_) | Material::Linear(_) => CORED_TOLERANCE,
        },
    };
    tolerance.unwrap_or(default)
}

/// Solves the steel of `scene`, to `tolerance` or the default, for heights from `lowest_m` up; cores
/// that are linear and answer to their own winding alone for all places, where `lowest_m` is close.
///
/// # Errors
/// An outline that meets a winding's edge; a B-H curve along which no state is found.
pub fn solve(
    scene: &Scene,
    tolerance: Option<f64>,
    air_default: f64,
    lowest_m: f64,
) -> Result<Solved, RunError> {
    let Some(core) = &scene.core else {
        return Ok(Solved {
            steel: Steel::None,
            tolerance: tolerance.unwrap_or(air_default),
            steel_error: 0.0,
            relative_permeability: 1.0,
            along_curve: false,
        });
    };
    let current_a = scene.rated_current_a();
    let at_current = match &core.material {
        Material::Curve(curve) if current_a > 0.0 => {
            let tolerance = tolerance.unwrap_or(SATURATED_TOLERANCE);
            let aim = STEEL_SHARE * tolerance;
            let state = at_current::solve(scene, core, curve, current_a, aim, lowest_m)?;
            let secant = curve.relative_permeability(state.inside.mean_b_t).max(1.0);
            Some((state, secant, tolerance))
        }
        Material::Curve(_) | Material::Linear(_) => None,
    };
    let relative_permeability = match &at_current {
        Some((_, secant, _)) => *secant,
        None => core.relative_permeability(),
    };
    if coupled(scene.design) {
        let tolerance = tolerance.unwrap_or(COUPLED_TOLERANCE);
        let array = CoupledArray::new(
            &scene.winding,
            core.shape,
            relative_permeability,
            &scene.design.array.positions_m,
            STEEL_SHARE * tolerance,
            lowest_m,
        )?;
        return Ok(Solved {
            tolerance,
            steel_error: array.relative_error,
            steel: Steel::Coupled(Box::new(array)),
            relative_permeability,
            along_curve: false,
        });
    }
    let along_curve = at_current.is_some();
    let (alone, steel_error, tolerance) = match at_current {
        Some((state, _, tolerance)) => (
            AloneCore {
                layer: state.layer,
                added_inductance_h: state.added_inductance_h,
            },
            state.relative_error,
            tolerance,
        ),
        None => {
            let tolerance = tolerance.unwrap_or(CORED_TOLERANCE);
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
                },
                coil.relative_error,
                tolerance,
            )
        }
    };
    Ok(Solved {
        tolerance,
        steel_error,
        steel: Steel::Alone(Box::new(alone)),
        relative_permeability,
        along_curve,
    })
}

/// Whether the design's cores are coupled.
#[must_use]
pub fn coupled(design: &Design) -> bool {
    design.core.is_some()
        && design.array.coupling == Coupling::Full
        && design.array.positions_m.len() > 1
}
