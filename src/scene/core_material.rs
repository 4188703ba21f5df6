//! The steel of a design's cores: where it is and how it magnetises.

use super::named_files::{self, NamedContent};
use crate::RunError;
use crate::design::bh_table::BhTable;
use crate::design::named_file::Role;
use crate::design::{Core, Steel as Described};
use crate::field::steel::CoreShape;
use crate::field::steel::bh_curve::BhCurve;
use crate::field::winding::Winding;
use crate::units::STEEL_DENSITY_KG_PER_M3;

/// More permeable steel changes no field by more than its inverse.
pub(crate) const MOST_PERMEABLE: f64 = 1e9;

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
    conductivity_s_per_m: f64,
    /// Thickness of its sheets, m.
    lamination_m: Option<f64>,
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
    /// Mass, kg.
    #[must_use]
    pub fn mass_kg(&self) -> f64 {
        self.shape.volume_m3() * STEEL_DENSITY_KG_PER_M3
    }

    /// Conductivity of a solid core whose slowest eddy currents die out as fast, S/m: those of a
    /// sheet of thickness d in mu sigma (d / pi)^2, those of a cylinder of radius a in mu sigma (a / x)^2,
    /// x the first zero of J_0.
    #[must_use]
    pub fn conductivity_s_per_m(&self) -> f64 {
        const FIRST_ZERO: f64 = 2.404_825_557_695_773;
        let Some(sheet_m) = self.lamination_m else {
            return self.conductivity_s_per_m;
        };
        let share = FIRST_ZERO * sheet_m / (std::f64::consts::PI * self.shape.radius_m);
        self.conductivity_s_per_m * (share * share).min(1.0)
    }

    /// The core that `core` describes in the bore of `winding`; its B-H table is among `files`.
    ///
    /// # Errors
    /// A B-H table that cannot be a steel's.
    pub fn new(core: &Core, winding: &Winding, files: &[NamedContent]) -> Result<Self, RunError> {
        let shape = CoreShape {
            radius_m: winding.inner_radius_m - core.clearance_m,
            bottom_m: -(winding.length_m + core.below_m),
            top_m: core.above_m,
        };
        let mut warnings = Vec::new();
        let (material, knee_t) = match &core.steel {
            Described::Linear(mu_r) => (Material::Linear(*mu_r), core.knee_t),
            Described::Curve(path) => {
                let text = named_files::of(files, Role::Curve)?.text()?;
                let table = BhTable::from_csv(text, path)
                    .map_err(|fault| RunError::Input(fault.to_string()))?;
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
            lamination_m: core.lamination_m,
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
