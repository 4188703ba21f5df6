//! One coil alone with its core, linear or along a B-H curve, at the rated current.

use serde::Serialize;

use std::collections::BTreeMap;

use super::core_material::{Material, SceneCore};
use super::evaluation_sample::FINER;
use super::knee::{FOR_CORES, above_knee};
use super::tolerances::MAGNET_FINEST;
use super::{MAGNET_SHARE, Scene, at_current, cylinder_of, passive};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::coil::inductance;
use crate::design::MagnetModel;
use crate::field::frame::to_cartesian;
use crate::field::magnet::{MagnetRule, Node, Sources};
use crate::field::steel::array_steel::{ALONG_CURVE, TWO_OF_ONE_CORE};
use crate::field::steel::bh_curve::BhCurve;
use crate::field::steel::core_flux_density::peak_depth_m;
use crate::field::steel::cored_coil::CoredCoil;
use crate::field::steel::magnetized::MagnetizedCore;
use crate::field::winding::KERNEL_ERROR;
use crate::field::winding::{AxialField, Winding};
use crate::numerics::vec3::minus;

/// The steel of the coil.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct CoreSummary {
    /// Radius, m.
    pub radius_m: f64,
    /// Length, m.
    pub length_m: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// The permeability of linear steel; with a B-H curve that of its origin.
    pub relative_permeability: f64,
    /// How the steel magnetises.
    pub material: MaterialKind,
    /// Largest |B| at the rated current, well inside the surface, T.
    pub peak_field_t: f64,
    /// Where: radius and height, m.
    pub peak_at_m: [f64; 2],
    /// Mean of |B| over the core, T.
    pub mean_field_t: f64,
    /// Flux density above which the steel is no longer linear, T.
    pub knee_t: f64,
    /// With a B-H curve: force at the rated current over that of the linear solution, less one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation_from_linear: Option<f64>,
}

/// How steel magnetises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum MaterialKind {
    /// By a constant relative permeability.
    Linear,
    /// Along a B-H curve.
    Curve,
}

/// Field and force at the target, SI.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TargetSummary {
    /// Height of the magnet's centre, m.
    pub height_m: f64,
    /// The rated current: the largest of the drivers' limits, or the supply's V/R, A.
    pub current_a: f64,
    /// dB_z/dz on the axis, T/m/A.
    pub gradient_t_per_m_per_a: f64,
    /// B_z on the axis, T/A.
    pub field_t_per_a: f64,
    /// Upward force at the rated current, N; the unpowered steel's pull included where the
    /// design includes it.
    pub force_n: f64,
    /// Force vector at the rated current, N, as `force_n`.
    pub force_vector_n: [f64; 3],
    /// Torque on the magnet about its centre at the rated current, N m, the steel's pull left out.
    pub torque_n_m: [f64; 3],
    /// Upward force of the unpowered steel, N; where the design includes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passive_force_n: Option<f64>,
}

impl TargetSummary {
    /// Upward force of the rated current alone, N.
    #[must_use]
    pub fn current_force_n(&self) -> f64 {
        self.force_n - self.passive_force_n.unwrap_or(0.0)
    }
}

/// One coil alone, per ampere; with a B-H curve at the rated current, divided by it.
pub(crate) struct Single {
    /// Self inductance, H.
    pub inductance_h: f64,
    /// Flux linkage at the rated current, Wb; with a B-H curve.
    pub flux_linkage_wb: Option<f64>,
    /// Field at the target on the axis.
    pub field: AxialField,
    /// The permeability that the transient estimate uses.
    pub relative_permeability: f64,
    /// The steel.
    pub core: Option<CoreSummary>,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    source: Source,
    /// The tolerance it was computed to.
    pub tolerance: f64,
}

/// Where the field comes from.
enum Source {
    Air(Winding),
    Cored(Box<CoredCoil>),
    Saturated(Winding, Box<MagnetizedCore>),
}

fn stage(estimate: f64, relative_to: &str, method: &str) -> StageAccuracy {
    StageAccuracy {
        estimate,
        relative_to: relative_to.to_owned(),
        method: method.to_owned(),
    }
}

/// dB_i/dx_j.
type Gradient = [[f64; 3]; 3];

/// The tolerance of a coil with its core, which leaves the magnet's dipoles their share.
fn solved_to(scene: &Scene) -> f64 {
    match scene.design.magnet.model {
        MagnetModel::Dipole => scene.tolerances.coil,
        MagnetModel::Cylinder => (1.0 - MAGNET_SHARE) * scene.tolerances.coil,
    }
}

impl Single {
    pub(crate) fn new(scene: &Scene) -> Result<Self, RunError> {
        let height_m = scene.design.target_height_m;
        let Some(core) = &scene.core else {
            return Self::in_air(scene);
        };
        let shape = core.shape;
        if height_m <= shape.top_m {
            return Err(RunError::Input(format!(
                "target.height_mm = {}: the core's top is at {} mm; raise the target or lower the \
                 core (core.above_mm)",
                height_m * 1e3,
                shape.top_m * 1e3
            )));
        }
        if let Material::Curve(curve) = &core.material
            && scene.rated_current_a() != 0.0
        {
            return Self::saturated(scene, core, curve);
        }
        Self::linear(scene, core)
    }

    /// Self inductance, H, and where it is limited the core's flux density, T: no more than a search of
    /// designs needs.
    pub(crate) fn essentials(scene: &Scene) -> Result<(f64, Option<f64>), RunError> {
        let air_h = scene.circuit.inductance_h;
        match &scene.core {
            None => Ok((air_h, None)),
            Some(core)
                if scene.design.limits.core_field_max_t.is_none()
                    && matches!(core.material, Material::Linear(_)) =>
            {
                let (mu_r, height_m) = (core.relative_permeability(), scene.design.target_height_m);
                let tolerance = scene.tolerances.coil;
                let coil = CoredCoil::new(&scene.winding, core.shape, mu_r, tolerance, height_m)?;
                Ok((air_h + coil.added_inductance_h, None))
            }
            Some(_) => {
                let single = Self::new(scene)?;
                Ok((
                    single.inductance_h,
                    single.core.map(|core| core.peak_field_t),
                ))
            }
        }
    }

    fn in_air(scene: &Scene) -> Result<Self, RunError> {
        let height_m = scene.design.target_height_m;
        let accuracy = BTreeMap::from([
            (
                "field",
                stage(
                    KERNEL_ERROR,
                    "|grad B| (|B| for the field) at the target",
                    "a-priori quadrature bound 1e-15; rounding sampled against 40-digit values",
                ),
            ),
            (
                "inductance",
                stage(
                    inductance::RELATIVE_ERROR,
                    "the inductance",
                    "a-priori quadrature bound; sampled against 20-digit values",
                ),
            ),
        ]);
        Ok(Self {
            inductance_h: scene.circuit.inductance_h,
            flux_linkage_wb: None,
            field: scene.winding.field(0.0, height_m)?,
            relative_permeability: 1.0,
            core: None,
            accuracy,
            warnings: Vec::new(),
            source: Source::Air(scene.winding),
            tolerance: scene.tolerances.coil,
        })
    }

    /// The coil with linear steel, or along a curve without current.
    fn linear(scene: &Scene, core: &SceneCore) -> Result<Self, RunError> {
        let (shape, tolerance) = (core.shape, solved_to(scene));
        let height_m = scene.design.target_height_m;
        let mu_r = core.relative_permeability();
        let coil = CoredCoil::new(&scene.winding, shape, mu_r, tolerance, height_m)?;
        let current_a = scene.rated_current_a();
        let inside = coil.core_field(current_a, peak_depth_m(shape))?;
        let accuracy = BTreeMap::from([
            (
                "field",
                stage(
                    coil.relative_error,
                    "the largest |grad B| (|B|) at the target's height",
                    TWO_OF_ONE_CORE,
                ),
            ),
            (
                "inductance",
                stage(coil.relative_error, "the inductance", TWO_OF_ONE_CORE),
            ),
            (
                "core_field",
                stage(
                    inside.peak_error,
                    "the peak",
                    "what the highest degrees of the core's surface and of the scan contribute",
                ),
            ),
            (
                "core_field_mean",
                stage(
                    inside.mean_error,
                    "the mean",
                    "two resolutions of the core's surface and of the volume's rule",
                ),
            ),
        ]);
        let facts = CoreSummary {
            radius_m: shape.radius_m,
            length_m: shape.length_m(),
            mass_kg: core.mass_kg(),
            relative_permeability: mu_r,
            material: MaterialKind::Linear,
            peak_field_t: inside.peak_t,
            peak_at_m: [
                inside.peak_at_m[0].hypot(inside.peak_at_m[1]),
                inside.peak_at_m[2],
            ],
            mean_field_t: inside.mean_t,
            knee_t: core.knee_t,
            deviation_from_linear: None,
        };
        let mut warnings = core.warnings.clone();
        if matches!(core.material, Material::Linear(_)) {
            warnings.extend(above_knee(
                [(inside.peak_t, inside.peak_error * inside.peak_t)],
                core.knee_t,
                "the core at the rated current",
                FOR_CORES,
            ));
        }
        Ok(Self {
            inductance_h: scene.circuit.inductance_h + coil.added_inductance_h,
            flux_linkage_wb: None,
            field: coil.field(0.0, height_m)?,
            relative_permeability: mu_r,
            core: Some(facts),
            accuracy,
            warnings,
            source: Source::Cored(Box::new(coil)),
            tolerance: scene.tolerances.coil,
        })
    }

    /// The coil at its rated current along `curve`.
    fn saturated(scene: &Scene, core: &SceneCore, curve: &BhCurve) -> Result<Self, RunError> {
        let tolerance = solved_to(scene);
        let height_m = scene.design.target_height_m;
        let current_a = scene.rated_current_a();
        let state = at_current::solve(scene, core, curve, current_a, tolerance, height_m)?;
        let field = scene.winding.field(0.0, height_m)? + state.layer.field(0.0, height_m);
        let error = state.relative_error;
        let inductance_h = scene.circuit.inductance_h + state.added_inductance_h;
        let shape = core.shape;
        let initial = core.relative_permeability();
        let linear = CoredCoil::new(&scene.winding, shape, initial, tolerance, height_m)?;
        let linear = linear.field(0.0, height_m)?;
        let accuracy = BTreeMap::from([
            (
                "field",
                stage(error, "|grad B| (|B|) at the target", ALONG_CURVE),
            ),
            ("inductance", stage(error, "the flux linkage", ALONG_CURVE)),
            (
                "core_field",
                stage(state.peak_error, "the peak", ALONG_CURVE),
            ),
            (
                "core_field_mean",
                stage(state.mean_error, "the mean", ALONG_CURVE),
            ),
        ]);
        let facts = CoreSummary {
            radius_m: shape.radius_m,
            length_m: shape.length_m(),
            mass_kg: core.mass_kg(),
            relative_permeability: initial,
            material: MaterialKind::Curve,
            peak_field_t: state.inside.peak_b_t,
            peak_at_m: [state.inside.peak_at_m.0, state.inside.peak_at_m.1],
            mean_field_t: state.inside.mean_b_t,
            knee_t: core.knee_t,
            deviation_from_linear: Some(field.dbz_dz / linear.dbz_dz - 1.0),
        };
        let mut warnings = core.warnings.clone();
        if state.inside.peak_b_t > core.knee_t {
            warnings.push(format!(
                "the core at the rated current reaches {:.2} T, above the steel's knee at {:.2} T: \
                 the force is {:.1} % off that of linear steel, and forces of several currents do \
                 not add up",
                state.inside.peak_b_t,
                core.knee_t,
                100.0 * (field.dbz_dz / linear.dbz_dz - 1.0)
            ));
        }
        if curve.largest_b_t() < state.inside.peak_b_t {
            warnings.push(format!(
                "the B-H table ends at {} T, below the core's {:.2} T: beyond its last point the \
                 steel is taken as saturated (slope mu_0)",
                curve.largest_b_t(),
                state.inside.peak_b_t
            ));
        }
        Ok(Self {
            inductance_h,
            flux_linkage_wb: Some(inductance_h * current_a),
            field,
            relative_permeability: at_current::mean_permeability(curve, &state),
            core: Some(facts),
            accuracy,
            warnings,
            source: Source::Saturated(scene.winding, Box::new(state.layer)),
            tolerance: scene.tolerances.coil,
        })
    }

    /// Field and force at the target on the axis at `current_a`.
    ///
    /// # Errors
    /// A place of the magnet on the winding's edge; a magnet that touches what attracts it.
    pub(crate) fn target(
        &mut self,
        scene: &Scene,
        current_a: f64,
    ) -> Result<TargetSummary, RunError> {
        let height_m = scene.design.target_height_m;
        let finest = MAGNET_SHARE * scene.tolerances.coil_force.max(MAGNET_FINEST);
        let rule = scene.magnet_rule(height_m, finest)?;
        let (fields, gradients) = self.over(&rule, height_m, current_a)?;
        let mut force_n = rule.force_n(&gradients);
        if rule.bound() > 0.0 {
            let of_force = self.force_stage(scene, &rule, (force_n, current_a))?;
            self.accuracy.insert("force", of_force);
        }
        // Quantities that a design does not request are not computed.
        let mut passive_force_n = None;
        if scene.design.magnet.passive_force {
            let place = [0.0, 0.0, height_m];
            if let Some(pull) = passive::pull(scene, &[place], true)? {
                let pulled_n = pull.force_n(place);
                for (force, pulled) in force_n.iter_mut().zip(pulled_n) {
                    *force += pulled;
                }
                passive_force_n = Some(pulled_n[2]);
                let stage = passive::accuracy(&pull);
                self.warnings.extend(passive::warning(
                    &stage,
                    passive::PASSIVE_TOLERANCE,
                    pulled_n[2],
                ));
                self.accuracy.insert("passive_force", stage);
            }
        }
        Ok(TargetSummary {
            height_m,
            current_a,
            gradient_t_per_m_per_a: self.field.dbz_dz,
            field_t_per_a: self.field.b_z,
            force_n: force_n[2],
            force_vector_n: force_n,
            torque_n_m: rule.torque_n_m(&fields, &gradients),
            passive_force_n,
        })
    }

    /// Field, T, and gradient, T/m, at `current_a` at every dipole of a magnet whose centre is on the axis at
    /// `height_m`.
    fn over(
        &self,
        rule: &MagnetRule,
        height_m: f64,
        current_a: f64,
    ) -> Result<(Vec<[f64; 3]>, Vec<Gradient>), RunError> {
        let of_node = |node: &Node| {
            let [x, y, z] = node.offset_m;
            let axial = self.at(x.hypot(y), height_m + z)?;
            let of = to_cartesian(&axial, x, y);
            let gradient = of
                .gradient_t_per_m_per_a
                .map(|row| row.map(|g| g * current_a));
            Ok((of.field_t_per_a.map(|b| b * current_a), gradient))
        };
        let pairs = rule.nodes().iter().map(of_node);
        pairs.collect()
    }

    /// The error of a force that `rule` gives: the field's, and what is proven of the dipoles, by themselves or by the
    /// difference from others throughout the magnet.
    fn force_stage(
        &self,
        scene: &Scene,
        rule: &MagnetRule,
        (force_n, current_a): ([f64; 3], f64),
    ) -> Result<StageAccuracy, RunError> {
        let height_m = scene.design.target_height_m;
        let size_n = {
            let [x, y, z] = scene.moment_a_m2;
            x.hypot(y).hypot(z) * (current_a * self.field.gradient_norm()).abs()
        };
        // An error of the steel is smooth over the magnet; rounding is not.
        let proven = |rule: &MagnetRule| KERNEL_ERROR * rule.amplification() + rule.bound();
        let mut of_rule = proven(rule);
        let mut method = "the field's error and the a-priori bound of the magnet's dipoles";
        let sources = Sources::Below {
            height_m: height_m - scene.sources_top_m(),
        };
        let throughout = |tolerance| {
            let size = cylinder_of(scene.design)?;
            MagnetRule::throughout_cylinder(size, scene.moment_a_m2, sources, tolerance).ok()
        };
        if let Some(other) = throughout(FINER * rule.bound()).or_else(|| throughout(rule.bound())) {
            let (_, gradients) = self.over(&other, height_m, current_a)?;
            let [x, y, z] = minus(other.force_n(&gradients), force_n);
            let by_other = x.hypot(y).hypot(z) / size_n + proven(&other);
            if by_other < of_rule {
                of_rule = by_other;
                method = "the field's error, the difference from dipoles throughout the magnet, and their a-priori bound";
            }
        }
        let field = self.accuracy.get("field");
        Ok(stage(
            field.map_or(0.0, |field| field.estimate) + of_rule,
            "the moment times the largest |grad B| over the magnet",
            method,
        ))
    }

    fn at(&self, r_m: f64, z_m: f64) -> Result<AxialField, RunError> {
        Ok(match &self.source {
            Source::Air(winding) => winding.field(r_m, z_m)?,
            Source::Cored(coil) => coil.field(r_m, z_m)?,
            Source::Saturated(winding, core) => winding.field(r_m, z_m)? + core.field(r_m, z_m),
        })
    }
}
