//! The steel at given currents in all coils, along its B-H curve: what superposition leaves out.

use super::at_current::{self, no_state};
use super::core_material::{Material, SceneCore};
use super::maps::nearest_to_steel;
use super::steel::{EVALUATION_SHARE, Solved, clearance};
use super::{MAGNET_SHARE, Scene, coupled, upward_n};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::field::components::Components;
use crate::field::steel::array_steel::{ALONG_CURVE, SteelField};
use crate::field::steel::bh_curve::BhCurve;
use crate::field::steel::clearance::Clearance;
use crate::field::steel::core_flux_density::{CoreField, peak_depth_m};
use crate::field::steel::equivalent_dipoles::ArraySources;
use crate::field::steel::saturated::Convergence;
use crate::field::steel::saturated_array::SaturatedArray;
use crate::field::steel::saturated_coil::SaturatedCoil;
use crate::map::FieldMap;
use crate::map::coupled_map::SampledField;
use crate::map::map_source::Sampler;
use crate::map::tabulate::{Grid, MapError, PlacedCoil, tabulate};
use crate::progress::Progress;

/// Deviation from superposition above which a warning is due.
pub(crate) const SUPERPOSITION_WARNING: f64 = 0.01;

/// The cores at a working point.
#[derive(Debug, Clone)]
pub struct WorkingPoint {
    /// Current in every coil, A.
    pub currents_a: Vec<f64>,
    /// Largest |B| in every core, T: of the axisymmetric mode along the curve, and what the other
    /// modes add to it in the linear array, less in the proportion in which the curve's is below the linear one's.
    pub peak_field_t: Vec<f64>,
    /// Mean |B| in every core, T, likewise.
    pub mean_field_t: Vec<f64>,
    /// Estimated errors of both, relative to the largest of the cores: that of the state, and what that proportion takes
    /// off.
    pub core_field_errors: [f64; 2],
    /// Flux linkage of every coil, the neighbours' windings left out, Wb.
    pub steel_flux_linkage_wb: Vec<f64>,
    /// Estimated error of the total gradient above, relative to the largest |grad B| at the
    /// height.
    pub relative_error: f64,
    tolerance: f64,
    cores: Cores,
}

#[derive(Debug, Clone)]
enum Cores {
    /// Every core under its own winding: the coils' effective currents, A, and the states, of
    /// which coils of the same current share one; `None` without current.
    Alone(Vec<(f64, Option<SaturatedCoil>)>),
    /// All under all.
    Coupled(Box<SaturatedArray>),
}

impl WorkingPoint {
    /// Solves the cores of `scene`, linear in `solved`, at `currents_a` for heights from `lowest_m` up; `None` where
    /// superposition holds: without a B-H curve.
    ///
    /// A coil whose map has a measured gain counts with that much more current.
    ///
    /// # Errors
    /// A core that cannot be solved.
    pub fn new(
        scene: &Scene,
        solved: &Solved,
        currents_a: &[f64],
        lowest_m: f64,
    ) -> Result<Option<Self>, RunError> {
        let Some((core, curve)) = curved(scene) else {
            return Ok(None);
        };
        let tolerance = scene.tolerances.working_point;
        let effective_a: Vec<f64> = currents_a
            .iter()
            .zip(&scene.coils)
            .map(|(current, coil)| current * coil.gain)
            .collect();
        let mut made = if coupled(scene.design) {
            Self::coupled(scene, core, curve, &effective_a, tolerance, lowest_m)?
        } else {
            Self::alone(scene, core, curve, &effective_a, tolerance, lowest_m)?
        };
        if let Some(array) = solved.steel().coupled() {
            let [all, axial] =
                array.core_fields_and_axial(&effective_a, peak_depth_m(core.shape))?;
            let peak = |field: &CoreField| field.peak_t;
            let mean = |field: &CoreField| field.mean_t;
            let [peak_error, mean_error] = &mut made.core_field_errors;
            *peak_error += add_transverse(&mut made.peak_field_t, [&all, &axial], peak);
            *mean_error += add_transverse(&mut made.mean_field_t, [&all, &axial], mean);
        }
        made.currents_a = currents_a.to_vec();
        Ok(Some(made))
    }

    fn coupled(
        scene: &Scene,
        core: &SceneCore,
        curve: &BhCurve,
        currents_a: &[f64],
        tolerance: f64,
        lowest_m: f64,
    ) -> Result<Self, RunError> {
        let array = SaturatedArray::new(
            &scene.winding,
            core.shape,
            curve,
            &scene.design.array.positions_m,
            currents_a,
            tolerance,
            lowest_m,
        )
        .map_err(|fault| RunError::Input(format!("[core] with a B-H curve: {fault}")))?;
        if array.status == Convergence::Stalled {
            let most_a = currents_a.iter().fold(0.0_f64, |m, i| m.max(i.abs()));
            return Err(no_state(most_a));
        }
        Ok(Self {
            currents_a: Vec::new(),
            peak_field_t: array.fields.iter().map(|f| f.peak_b_t).collect(),
            mean_field_t: array.fields.iter().map(|f| f.mean_b_t).collect(),
            steel_flux_linkage_wb: array.flux_linkage_wb.clone(),
            relative_error: array.relative_error,
            core_field_errors: [array.relative_error; 2],
            tolerance,
            cores: Cores::Coupled(Box::new(array)),
        })
    }

    fn alone(
        scene: &Scene,
        core: &SceneCore,
        curve: &BhCurve,
        currents_a: &[f64],
        tolerance: f64,
        lowest_m: f64,
    ) -> Result<Self, RunError> {
        let mut states: Vec<(f64, Option<SaturatedCoil>)> = Vec::new();
        for current in currents_a {
            let known = states
                .iter()
                .find(|(other, _)| other.abs() == current.abs());
            let state = match known {
                Some((_, state)) => state.clone(),
                None if *current == 0.0 => None,
                None => Some(at_current::solve(
                    scene,
                    core,
                    curve,
                    current.abs(),
                    tolerance,
                    lowest_m,
                )?),
            };
            states.push((*current, state));
        }
        let of = |pick: &dyn Fn(f64, &SaturatedCoil) -> f64| -> Vec<f64> {
            states
                .iter()
                .map(|(current, state)| state.as_ref().map_or(0.0, |state| pick(*current, state)))
                .collect()
        };
        let largest =
            |pick: &dyn Fn(f64, &SaturatedCoil) -> f64| of(pick).into_iter().fold(0.0, f64::max);
        Ok(Self {
            currents_a: Vec::new(),
            peak_field_t: of(&|_, state| state.inside.peak_b_t),
            mean_field_t: of(&|_, state| state.inside.mean_b_t),
            steel_flux_linkage_wb: of(&|current, state| current * state.added_inductance_h),
            relative_error: largest(&|_, state| state.relative_error),
            core_field_errors: [
                largest(&|_, state| state.peak_error),
                largest(&|_, state| state.mean_error),
            ],
            tolerance,
            cores: Cores::Alone(states),
        })
    }

    /// The error of the steel's solution.
    #[must_use]
    pub fn accuracy(&self) -> StageAccuracy {
        StageAccuracy {
            estimate: self.relative_error + EVALUATION_SHARE * self.tolerance,
            relative_to: "the largest |grad B| at a height".to_owned(),
            method: match self.cores {
                Cores::Alone(_) => ALONG_CURVE.to_owned(),
                Cores::Coupled(_) => format!(
                    "{ALONG_CURVE}; the modes across the axis taken as linear and this varied"
                ),
            },
        }
    }

    /// The steel's total field for points with `clearance`.
    #[must_use]
    pub fn field(&self, scene: &Scene, clearance: Clearance) -> TotalField {
        let tolerance = EVALUATION_SHARE * self.tolerance;
        let parts = match &self.cores {
            Cores::Coupled(array) => {
                let sources = ArraySources::of_saturated(array, clearance, tolerance);
                vec![(1.0, [0.0, 0.0], SteelField::Coupled(sources))]
            }
            Cores::Alone(states) => states
                .iter()
                .zip(&scene.coils)
                .filter_map(|((current, state), coil)| {
                    let layer = &state.as_ref()?.layer;
                    let field = SteelField::of_core(layer.clone(), tolerance);
                    Some((*current, coil.axis_m, field))
                })
                .collect(),
        };
        let top_m = scene.core.as_ref().map_or(0.0, |core| core.shape.top_m);
        TotalField { parts, top_m }
    }

    /// dB_z/dz of all coils together at the nodes of `grid`, [z, y, x], T/m.
    ///
    /// # Errors
    /// A node on a winding's edge or on the steel; interruption.
    pub fn gz_t_per_m(
        &self,
        scene: &Scene,
        grid: &Grid,
        progress: &dyn Progress,
    ) -> Result<Vec<f64>, RunError> {
        let pick = |map: FieldMap| map.gz_t_per_m_per_a;
        self.total(scene, grid, Components::Gz, &pick, progress)
    }

    /// B of all coils together at the nodes of `grid`, [z, y, x, 3], T.
    ///
    /// # Errors
    /// As [`WorkingPoint::gz_t_per_m`].
    pub fn field_t(
        &self,
        scene: &Scene,
        grid: &Grid,
        progress: &dyn Progress,
    ) -> Result<Vec<f64>, RunError> {
        let pick = |map: FieldMap| map.field_t_per_a.unwrap_or_default();
        self.total(scene, grid, Components::All, &pick, progress)
    }

    /// The sum of what `pick` takes of the maps of the windings, at their currents, and of the steel.
    fn total(
        &self,
        scene: &Scene,
        grid: &Grid,
        components: Components,
        pick: &dyn Fn(FieldMap) -> Vec<f64>,
        progress: &dyn Progress,
    ) -> Result<Vec<f64>, RunError> {
        let tolerance = EVALUATION_SHARE * self.tolerance;
        let (winding, coils) = (&scene.winding, &scene.coils);
        let windings = tabulate(winding, coils, grid, components, tolerance, progress)?;
        // The maps include the gains.
        let mut whole = sum_of_coils(&pick(windings), &self.currents_a);
        if scene.core.is_some() {
            let clearance = clearance(scene, &nearest_to_steel(scene, grid), 0.0)?;
            let steel = self.field(scene, clearance);
            let sampled = SampledField::new(&steel, grid, components, tolerance, 1, progress)?;
            let all = PlacedCoil {
                number: 0,
                axis_m: [0.0, 0.0],
                gain: 1.0,
            };
            let steel = pick(sampled.map(&[all], grid, progress)?);
            for (whole, value) in whole.iter_mut().zip(&steel) {
                *whole += value;
            }
        }
        Ok(whole)
    }

    /// Upward force on the magnet at every point, N, windings and steel, the pull of the
    /// unpowered steel left out.
    ///
    /// # Errors
    /// A point on the steel; interruption.
    pub fn forces_n(
        &self,
        scene: &Scene,
        points_m: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<f64>, RunError> {
        let air = Solved::in_air(EVALUATION_SHARE * self.tolerance);
        let per_ampere = scene.forces_n_per_a(&air, points_m, progress)?;
        let mut total: Vec<f64> = per_ampere
            .chunks_exact(scene.coils.len())
            .map(|row| row.iter().zip(&self.currents_a).map(|(f, i)| f * i).sum())
            .collect();
        let lowest_m = points_m.iter().fold(f64::INFINITY, |z, p| z.min(p[2]));
        let rule = scene.magnet_rule(lowest_m, MAGNET_SHARE * self.tolerance)?;
        if scene.core.is_none() {
            return Ok(total);
        }
        let field = self.field(scene, clearance(scene, points_m, rule.reach_m())?);
        let parts = if rule.is_upright() {
            Components::Gz
        } else {
            Components::Gradient
        };
        for node in rule.nodes() {
            let places: Vec<[f64; 3]> = points_m
                .iter()
                .map(|p| std::array::from_fn(|i| p[i] + node.offset_m[i]))
                .collect();
            let steel = field.at(&places, parts);
            for (row, force) in total.iter_mut().enumerate() {
                *force += upward_n(node.moment_a_m2, parts, &steel, row);
            }
        }
        Ok(total)
    }
}

/// Adds to fields of the axisymmetric mode along the curve what the other modes add in the linear array, whose fields are
/// `all` with and `axial` without them, and returns the error of that, relative to the largest.
fn add_transverse(
    along_t: &mut [f64],
    [all, axial]: [&[CoreField]; 2],
    of: impl Fn(&CoreField) -> f64,
) -> f64 {
    let (mut largest_t, mut left_out_t) = (0.0_f64, 0.0_f64);
    for (along_t, (all, axial)) in along_t.iter_mut().zip(all.iter().zip(axial)) {
        let (added_t, axial_t) = ((of(all) - of(axial)).max(0.0), of(axial));
        let part = if *along_t < axial_t {
            *along_t / axial_t
        } else {
            1.0
        };
        left_out_t = left_out_t.max((1.0 - part) * added_t);
        *along_t += part * added_t;
        largest_t = largest_t.max(*along_t);
    }
    if left_out_t > 0.0 {
        left_out_t / largest_t
    } else {
        0.0
    }
}

/// The sum of the coils' blocks in `per_ampere` times their currents.
pub(crate) fn sum_of_coils(per_ampere: &[f64], currents_a: &[f64]) -> Vec<f64> {
    let size = per_ampere.len() / currents_a.len().max(1);
    let mut sum = vec![0.0; size];
    for (values, current) in per_ampere.chunks_exact(size.max(1)).zip(currents_a) {
        for (sum, value) in sum.iter_mut().zip(values) {
            *sum += current * value;
        }
    }
    sum
}

/// A sentence on `what`, per ampere, that does not add up to the state at the working point.
pub(crate) fn superposition_ends(
    scene: &Scene,
    deviation_from_linear: f64,
    peak_field_t: &[f64],
    what: &str,
) -> Option<String> {
    (deviation_from_linear > SUPERPOSITION_WARNING).then(|| {
        let peak_t = peak_field_t.iter().copied().fold(0.0, f64::max);
        let knee_t = scene
            .core
            .as_ref()
            .map_or(f64::INFINITY, |core| core.knee_t);
        format!(
            "superposition ends along the B-H curve: at the working point's currents the state \
             differs by up to {:.1} % of the largest from the sum of {what} (the cores reach \
             {peak_t:.2} T, the knee is at {knee_t:.2} T); set supply.current_max_a near the \
             currents used, for which the cores are solved, or stay below the knee",
            100.0 * deviation_from_linear
        )
    })
}

/// The steel's field at a working point: the sum of all cores'.
#[derive(Debug, Clone)]
pub struct TotalField {
    /// Current, axis, and the field per ampere, their core at the origin.
    parts: Vec<(f64, [f64; 2], SteelField)>,
    top_m: f64,
}

impl TotalField {
    /// Of steel that is linear at these currents, gains included, for places with `clearance`; `None`
    /// without steel.
    #[must_use]
    pub fn linear(
        scene: &Scene,
        solved: &Solved,
        currents_a: &[f64],
        clearance: Clearance,
    ) -> Option<Self> {
        let (top_m, _) = scene.steel_extent_m()?;
        let sources = solved.sources_at(scene, clearance, 1.0)?;
        let parts = match sources.coupled() {
            Some(all) => {
                let driven = SteelField::Coupled(all.at_currents(currents_a));
                vec![(1.0, [0.0, 0.0], driven)]
            }
            None => {
                let coils = scene.coils.iter().zip(currents_a);
                coils
                    .map(|(coil, current)| (*current, coil.axis_m, SteelField::clone(&sources)))
                    .collect()
            }
        };
        Some(Self { parts, top_m })
    }

    /// The field at `points_m`, [component, point].
    #[must_use]
    pub fn at(&self, points_m: &[[f64; 3]], parts: Components) -> Vec<f64> {
        let mut total = vec![0.0; parts.count() * points_m.len()];
        let mut one = total.clone();
        for (current, [x, y], sources) in &self.parts {
            let own: Vec<[f64; 3]> = points_m
                .iter()
                .map(|p| [p[0] - x, p[1] - y, p[2]])
                .collect();
            sources.sample(&own, parts, &mut one);
            for (total, one) in total.iter_mut().zip(&one) {
                *total += current * one;
            }
        }
        total
    }
}

impl Sampler for TotalField {
    fn drives(&self) -> usize {
        1
    }

    fn top_m(&self) -> f64 {
        self.top_m
    }

    fn sample(
        &self,
        points_m: &[[f64; 3]],
        components: Components,
        out: &mut [f64],
    ) -> Result<(), MapError> {
        out.copy_from_slice(&self.at(points_m, components));
        Ok(())
    }
}

/// The core and its B-H curve; `None` for a design without one.
fn curved<'a>(scene: &'a Scene) -> Option<(&'a SceneCore, &'a BhCurve)> {
    let core = scene.core.as_ref()?;
    match &core.material {
        Material::Curve(curve) => Some((core, curve)),
        Material::Linear(_) => None,
    }
}

/// Largest difference of two lists, relative to the largest of the first.
#[must_use]
pub fn relative_difference(values: &[f64], others: &[f64]) -> f64 {
    let size = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let worst = values
        .iter()
        .zip(others)
        .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    if worst > 0.0 { worst / size } else { 0.0 }
}
