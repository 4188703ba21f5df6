//! To what accuracy each stage of a scene is computed: the user's tolerance, or the default of the
//! scene's physics.

use super::core_material::{Material, SceneCore};
use super::coupled;
use crate::design::{Design, MagnetModel};
use crate::field::winding::KERNEL_ERROR;

/// The finest accuracy of a magnet's dipoles.
pub(crate) const MAGNET_FINEST: f64 = 1e-9;
/// Maps in air, relative to the largest |grad B| at each height: a million times finer than their
/// interpolation.
pub const MAP_TOLERANCE: f64 = 1e-9;
/// One linear core with its winding, and its maps.
pub const CORED_TOLERANCE: f64 = 1e-6;
/// One core along its B-H curve, whose kinks cross the elements, so that digits are dear.
pub const SATURATED_TOLERANCE: f64 = 1e-4;
/// The flux density inside a core: a steel's knee is not known as well. Along a B-H curve, whose kinks
/// cross the elements, it is at no request held to less.
pub const CORE_FIELD_TOLERANCE: f64 = 1e-2;
/// The cores of an array that magnetise each other.
pub const COUPLED_TOLERANCE: f64 = 1e-4;
/// Steel of any shape: a plate under nine cores takes half a minute of one processor.
pub const IRON_TOLERANCE: f64 = 1e-2;
/// The steel at a working point, relative to the largest |grad B| at a height: the modes that are
/// taken as linear leave an error of this order.
pub const WORKING_POINT_TOLERANCE: f64 = 1e-3;

/// The largest error that a computation may add to the force, relative to the requested force where at
/// least a twentieth of the largest is requested, and to lambda.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorTarget {
    /// Relative.
    pub error: f64,
    /// Whether samples that documents or flags give are chosen all the same.
    pub refine: bool,
    /// Whether nobody requested it: tolerances keep their defaults then, and fewer points are tried.
    pub by_default: bool,
}

impl ErrorTarget {
    /// Errors that make sense: below, steel and kinks cost more than anybody waits for.
    pub const RANGE: std::ops::RangeInclusive<f64> = 1e-5..=0.5;
    /// Of shapes that leave their points to the program: a seventh of the 7 % that a finger notices.
    pub const DEFAULT: f64 = 0.01;
    /// The share of the number of points where a runtime takes its own parts, and where none does.
    const OF_POINTS: [f64; 2] = [0.2, 0.7];
    /// The share of heights between the points: they decide how many a rim needs.
    const BETWEEN_POINTS: f64 = 0.35;
    /// The share of the map's interpolation.
    const OF_INTERPOLATION: f64 = 0.1;
    /// The field's tolerance over the error: forces and map nodes count forty times each on the seed's array,
    /// since all coils may be off to the same side, and have a fifth of the budget between them.
    const OF_FIELD: f64 = 0.0025;
    /// No steel needs to be solved more coarsely.
    const COARSEST: f64 = 1e-3;

    /// The sentence of a request that is exceeded, by an error that `of` names, and what to do.
    #[must_use]
    pub(crate) fn exceeded(self, of: &str, found: f64, advice: &str) -> String {
        // Three digits, without an exponent.
        let percent = |part: f64| {
            let rounded = format!("{:.2e}", 100.0 * part);
            rounded
                .parse::<f64>()
                .map_or(rounded, |value| value.to_string())
        };
        let kind = if self.by_default {
            "default"
        } else {
            "requested"
        };
        format!(
            "the {kind} error of {} % is exceeded: {of} {} %{advice}",
            percent(self.error),
            percent(found)
        )
    }

    /// Error that the number of points may add, `for_runtime` or for lambda alone.
    #[must_use]
    pub fn of_points(self, for_runtime: bool) -> f64 {
        let [with, without] = Self::OF_POINTS;
        self.error * if for_runtime { with } else { without }
    }

    /// Error that heights between the points may add.
    #[must_use]
    pub fn between_points(self) -> f64 {
        Self::BETWEEN_POINTS * self.error
    }

    /// Error that interpolation of the map may add.
    #[must_use]
    pub fn of_interpolation(self) -> f64 {
        Self::OF_INTERPOLATION * self.error
    }

    /// The tolerance of steel.
    #[must_use]
    pub fn tolerance(self) -> f64 {
        (Self::OF_FIELD * self.error).min(Self::COARSEST)
    }
}

/// The accuracy of each stage, relative to what the stage's own function names.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Tolerances {
    /// One coil alone, its field at the target.
    pub coil: f64,
    /// Its force on the magnet there.
    pub coil_force: f64,
    /// The flux density in its core: its largest value and its mean.
    pub core_field: f64,
    /// The field at points.
    pub field: f64,
    /// The forces at points.
    pub forces: f64,
    /// Maps.
    pub map: f64,
    /// The inductances of an array.
    pub inductances: f64,
    /// The steel at given currents along its B-H curve.
    pub working_point: f64,
}

impl Tolerances {
    /// Of `design`, whose core is `core` and whose coils may have current or not; all as `requested`
    /// if the user did.
    pub(super) fn new(
        design: &Design,
        core: Option<&SceneCore>,
        has_current: bool,
        requested: Option<f64>,
    ) -> Self {
        let of_core = |in_air: f64| match core.map(|core| &core.material) {
            None => in_air,
            Some(Material::Curve(_)) if has_current => SATURATED_TOLERANCE,
            Some(Material::Curve(_) | Material::Linear(_)) => CORED_TOLERANCE,
        };
        let of_array = |in_air: f64| {
            if design.has_iron() {
                IRON_TOLERANCE
            } else if coupled(design) {
                COUPLED_TOLERANCE
            } else {
                of_core(in_air)
            }
        };
        let forces_in_air = match design.magnet.model {
            MagnetModel::Dipole => KERNEL_ERROR,
            MagnetModel::Cylinder => MAGNET_FINEST,
        };
        let or = |default: f64| requested.unwrap_or(default);
        Self {
            coil: or(of_core(KERNEL_ERROR)),
            coil_force: or(of_core(forces_in_air)),
            core_field: match core.map(|core| &core.material) {
                Some(Material::Curve(_)) => or(CORE_FIELD_TOLERANCE).max(CORE_FIELD_TOLERANCE),
                Some(Material::Linear(_)) | None => or(CORE_FIELD_TOLERANCE),
            },
            field: or(of_array(KERNEL_ERROR)),
            forces: or(of_array(forces_in_air)),
            map: or(of_array(MAP_TOLERANCE)),
            inductances: requested.unwrap_or(if design.has_iron() {
                IRON_TOLERANCE
            } else {
                COUPLED_TOLERANCE
            }),
            working_point: or(WORKING_POINT_TOLERANCE).max(WORKING_POINT_TOLERANCE),
        }
    }

    /// The accuracy of an array's inductances, and of its coupled cores.
    #[must_use]
    pub fn of_inductances(requested: Option<f64>) -> f64 {
        requested.unwrap_or(COUPLED_TOLERANCE)
    }

    /// The accuracy of the magnet's dipoles where the best coil is searched.
    #[must_use]
    pub fn of_optimum(requested: Option<f64>) -> f64 {
        requested.unwrap_or(KERNEL_ERROR).max(MAGNET_FINEST)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::design::Need;
    use crate::scene::Scene;

    /// A design of two coils with `more` at its end.
    fn of(more: &str, requested: Option<f64>) -> Tolerances {
        let text = format!(
            "name = \"two\"\n[coil]\ninner_diameter_mm = 7.0\nouter_diameter_mm = 13.0\n\
             length_mm = 17.0\n[wire]\ndiameter_mm = 0.7\n[array]\npositions_mm = [[0.0, 0.0], \
             [23.0, 0.0]]\n{more}"
        );
        let (design, _) =
            Design::from_toml(&text, Path::new("two.toml"), Need::EVALUATE).expect("a design");
        let scene = Scene::with_tolerance(&design, requested).expect("a scene");
        scene.tolerances
    }

    #[test]
    fn defaults_are_those_of_the_physics() {
        let air = of("", None);
        assert_eq!((air.coil, air.field), (KERNEL_ERROR, KERNEL_ERROR));
        assert_eq!((air.forces, air.map), (KERNEL_ERROR, MAP_TOLERANCE));
        let finite = of("[magnet]\nmodel = \"cylinder\"\n", None);
        assert_eq!((finite.field, finite.forces), (KERNEL_ERROR, MAGNET_FINEST));
        let coupled = of("coupling = \"full\"\n[core]\n", None);
        assert_eq!(
            (coupled.coil, coupled.field),
            (CORED_TOLERANCE, COUPLED_TOLERANCE)
        );
        assert_eq!(
            (coupled.forces, coupled.map),
            (COUPLED_TOLERANCE, COUPLED_TOLERANCE)
        );
        let alone = of("coupling = \"none\"\n[core]\n", None);
        assert_eq!((alone.coil, alone.map), (CORED_TOLERANCE, CORED_TOLERANCE));
        assert_eq!(alone.inductances, COUPLED_TOLERANCE);
    }

    #[test]
    fn a_requested_tolerance_reaches_every_stage() {
        for more in ["", "coupling = \"full\"\n[core]\n"] {
            let all = of(more, Some(7e-3));
            let Tolerances {
                coil,
                coil_force,
                core_field,
                field,
                forces,
                map,
                inductances,
                working_point,
            } = all;
            let stages = [
                coil,
                coil_force,
                core_field,
                field,
                forces,
                map,
                inductances,
                working_point,
            ];
            assert_eq!(stages, [7e-3; 8]);
        }
        // Linearisation at a working point leaves more than a finer one.
        assert_eq!(of("", Some(1.3e-7)).working_point, WORKING_POINT_TOLERANCE);
    }
}
