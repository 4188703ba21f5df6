//! The coils of an array among their neighbours: inductances, and the steel at the rated currents.

use crate::field::steel::clearance::Clearance;
use std::collections::BTreeMap;

use serde::Serialize;

pub use super::array_fields::LargestCoreField;
use super::array_fields::{ArrayFields, most_flux};
use super::iron::middle;
use super::rated::Rated;
use super::steel::{LINEAR_CORES, Solved};
use super::working_point::{WorkingPoint, relative_difference};
use super::{Scene, passive, steel};
use crate::RunError;
use crate::accuracy::{StageAccuracy, missed};
use crate::coil::circuit::Circuit;
use crate::coil::mutual::{self, slowest_inductance_h};
use crate::field::components::Components;
use crate::field::iron::peaks::IronPeaks;

/// The array's inductances.
#[derive(Debug, Clone, Serialize)]
pub struct ArraySummary {
    /// One entry per coil.
    pub coils: Vec<ArrayCoil>,
    /// Inductance matrix, H: `[i][j]` is the flux through coil i for one ampere in coil j. With
    /// a B-H curve that of the linear array whose permeability is `relative_permeability`.
    pub mutual_inductance_h: Vec<Vec<f64>>,
    /// The inductance of the slowest pattern of currents, H: the largest eigenvalue of the matrix.
    pub slowest_inductance_h: f64,
    /// Five time constants of that pattern, s.
    pub settling_s: f64,
    /// With a B-H curve: permeability of the array's linear solution, with which one coil alone has the
    /// curve's gradient at the target; of cores that are not coupled the curve's at their mean |B|.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_permeability: Option<f64>,
    /// With a B-H curve: all coils at their rated currents.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub working_point: Option<WorkingPointSummary>,
    /// With a plate or other bodies of steel: what they carry.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iron: Option<IronSummary>,
    /// The core that can carry the most; absent where neighbours' fluxes are left out, and without cores.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest_core_field: Option<LargestCoreField>,
    /// The stages that miss the tolerance.
    #[serde(skip)]
    pub(crate) accuracy_missed: Vec<String>,
}

/// A plate and other bodies of steel, with all coils at their rated currents.
#[derive(Debug, Clone, Serialize)]
pub struct IronSummary {
    /// Largest |B| in them, well inside the surface, T; null where their permeability is that of air.
    pub peak_field_t: Option<f64>,
    /// Where, m.
    pub peak_at_m: Option<[f64; 3]>,
    /// Flux density above which their steel is no longer linear, T.
    pub knee_t: f64,
    /// [`ArraySummary::settling_s`].
    pub settling_s: f64,
    /// Upward force of all unpowered steel on the magnet at the target's height over the coil nearest to the
    /// array's middle, N; absent unless the design counts it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passive_force_n: Option<f64>,
}

fn iron_summary(
    scene: &Scene,
    settling_s: f64,
    peaks: &IronPeaks,
    (accuracy, warnings): (&mut BTreeMap<&'static str, StageAccuracy>, &mut Vec<String>),
) -> Result<Option<IronSummary>, RunError> {
    let Some(iron) = &scene.iron else {
        return Ok(None);
    };
    let alone = "coil, target and core describe one coil alone, without neighbours, [plate] and [[iron]]; array \
                 has the coils among all steel";
    warnings.push(alone.to_owned());
    let passive_force_n = iron_pull(scene)?.map(|(force_n, stage)| {
        warnings.extend(passive::warning(
            &stage,
            passive::iron_tolerance(scene, passive::PASSIVE_TOLERANCE),
            force_n,
        ));
        accuracy.insert("iron_passive_force", stage);
        force_n
    });
    Ok(Some(IronSummary {
        peak_field_t: peaks.elsewhere.map(|peak| peak.field_t),
        peak_at_m: peaks.elsewhere.map(|peak| peak.place_m),
        knee_t: iron.knee_t,
        settling_s,
        passive_force_n,
    }))
}

/// The pull of all unpowered steel over the coil nearest to the array's middle at the target's height, N, and how
/// sure it is; `None` unless the design counts it.
fn iron_pull(scene: &Scene) -> Result<Option<(f64, StageAccuracy)>, RunError> {
    if !scene.design.magnet.passive_force {
        return Ok(None);
    }
    let axes = &scene.design.array.positions_m;
    let [x, y] = middle(axes);
    let away = |axis: &[f64; 2]| (axis[0] - x).hypot(axis[1] - y);
    let nearest = axes.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
    let [x, y] = nearest.copied().unwrap_or_default();
    let place = [x, y, scene.design.target_height_m];
    let pull = passive::pull(scene, &[place], false)?;
    Ok(pull.map(|pull| (pull.force_n(place)[2], passive::accuracy(&pull))))
}

/// All coils at their rated currents, along the B-H curve.
#[derive(Debug, Clone, Serialize)]
pub struct WorkingPointSummary {
    /// A, one per coil.
    pub currents_a: Vec<f64>,
    /// Flux linkage of every coil, Wb.
    pub flux_linkage_wb: Vec<f64>,
    /// Largest difference of dB_z/dz from the sum of the coils' linear ones, over the coils' axes
    /// at the target's height and the middles between them, relative to the largest.
    pub deviation_from_linear: f64,
}

/// One coil among its neighbours.
#[derive(Debug, Clone, Serialize)]
pub struct ArrayCoil {
    /// Index.
    pub coil: usize,
    /// Axis, m.
    pub x_m: f64,
    /// Axis, m.
    pub y_m: f64,
    /// Self inductance among its neighbours, H; without steel the same as alone.
    pub inductance_h: f64,
    /// Largest |B| in its core with all coils at their rated currents, T; absent for air coils.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_field_t: Option<f64>,
    /// Mean |B| there, T.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_field_t: Option<f64>,
    /// Upper current limit, A.
    pub current_max_a: f64,
}

/// The array of `rated`, whose limits are checked with its inductances; `None` for a single coil without other
/// steel.
///
/// # Errors
/// Steel that cannot be solved.
pub(crate) fn of_rated(scene: &Scene, rated: &mut Rated) -> Result<Option<ArraySummary>, RunError> {
    let array = array(scene, &mut rated.accuracy, &mut rated.warnings)?;
    if let Some(array) = &array {
        rated.check_limits(scene, Some(&array.mutual_inductance_h));
        let missed = array.accuracy_missed.iter().cloned();
        rated.accuracy_missed.extend(missed);
    }
    Ok(array)
}

/// The array among its neighbours and other steel; `None` for a single coil without either.
fn array(
    scene: &Scene,
    accuracy: &mut BTreeMap<&'static str, StageAccuracy>,
    warnings: &mut Vec<String>,
) -> Result<Option<ArraySummary>, RunError> {
    if scene.coils.len() < 2 && scene.iron.is_none() {
        return Ok(None);
    }
    let lowest_m = scene.design.target_height_m;
    let solved = steel::solve(scene, scene.tolerances.field, lowest_m)?;
    let tolerance = scene.tolerances.inductances;
    let in_air = in_air(scene, tolerance);
    let air = in_air.0.clone();
    let (matrix, stage) = inductances(&solved, in_air);
    let accuracy_missed = missed([(&"mutual_inductance", &stage)], tolerance);
    let slowest = Circuit {
        inductance_h: slowest_inductance_h(&matrix),
        ..scene.circuit
    };
    accuracy.insert("mutual_inductance", stage);
    accuracy.extend(solved.linear_flux().map(|stage| (LINEAR_CORES, stage)));
    let (rated, largest_core_field) = core_fields(scene, &solved, &matrix, (accuracy, warnings))?;
    let working_point = rated.working_point.as_ref();
    let working_point = working_point
        .map(|point| working_point_summary(scene, &solved, point, &air))
        .transpose()?;
    let iron = match &rated.iron {
        Some(peaks) => iron_summary(scene, slowest.settling_s(), peaks, (accuracy, warnings))?,
        None => None,
    };
    Ok(Some(ArraySummary {
        coils: coils(scene, &matrix, [&rated.peak_t, &rated.mean_t]),
        mutual_inductance_h: matrix,
        slowest_inductance_h: slowest.inductance_h,
        settling_s: slowest.settling_s(),
        relative_permeability: working_point
            .is_some()
            .then_some(solved.relative_permeability),
        working_point,
        iron,
        largest_core_field,
        accuracy_missed,
    }))
}

/// |B| in the steel at the rated currents, and the core that can carry the most.
fn core_fields(
    scene: &Scene,
    solved: &Solved,
    matrix_h: &[Vec<f64>],
    (accuracy, warnings): (&mut BTreeMap<&'static str, StageAccuracy>, &mut Vec<String>),
) -> Result<(ArrayFields, Option<LargestCoreField>), RunError> {
    let rated_a = scene.rated_currents_a();
    let search = solved.iron_search(scene);
    let at = |currents_a: &[f64]| ArrayFields::new(scene, solved, search.as_ref(), currents_a);
    let rated = at(&rated_a)?;
    accuracy.extend(rated.stages());
    let put_right = scene.iron.iter().flat_map(|iron| &iron.put_right);
    warnings.extend(put_right.cloned());
    let mut above = rated.warnings(scene, "all coils at their rated currents");
    let currents_a = most_flux(scene, matrix_h);
    if !solved.steel().couples() || currents_a == rated_a {
        warnings.extend(above.into_iter().flatten());
        let largest = solved.steel().couples().then(|| rated.largest(&rated_a));
        return Ok((rated, largest.flatten()));
    }
    let most = at(&currents_a)?;
    for (name, stage) in most.stages() {
        let known = accuracy.entry(name).or_insert_with(|| stage.clone());
        known.estimate = known.estimate.max(stage.estimate);
    }
    // Of each kind one: that of the currents that take cores farthest.
    let farthest = most.warnings(scene, "currents within their limits whose fluxes add up");
    for (of_rated, of_most) in above.iter_mut().zip(farthest) {
        *of_rated = of_most.or(of_rated.take());
    }
    warnings.extend(above.into_iter().flatten());
    // The rated currents need not keep the limit of their sum.
    let total_a = scene.design.supply.total_current_max_a;
    let within = total_a.is_none_or(|total_a| rated_a.iter().sum::<f64>() <= total_a);
    let of_rated = within.then(|| rated.largest(&rated_a)).flatten();
    let largest = [of_rated, most.largest(&currents_a)];
    let by_peak =
        |a: &LargestCoreField, b: &LargestCoreField| a.peak_field_t.total_cmp(&b.peak_field_t);
    let largest = largest.into_iter().flatten().max_by(by_peak);
    Ok((rated, largest))
}

/// Every coil with its inductance among the others; peak and mean of |B| in the cores, where they are known.
fn coils(scene: &Scene, matrix_h: &[Vec<f64>], fields_t: [&[f64]; 2]) -> Vec<ArrayCoil> {
    let axes = scene.design.array.positions_m.iter().enumerate();
    axes.map(|(coil, [x_m, y_m])| {
        let [peak_field_t, mean_field_t] = fields_t.map(|field| field.get(coil).copied());
        ArrayCoil {
            coil,
            x_m: *x_m,
            y_m: *y_m,
            inductance_h: matrix_h[coil][coil],
            peak_field_t,
            mean_field_t,
            current_max_a: scene.upper_a[coil],
        }
    })
    .collect()
}

/// The windings' inductance matrix without steel, H, and the relative error of its entries, to
/// `tolerance` if that can be had.
pub(crate) fn in_air(scene: &Scene, tolerance: f64) -> (Vec<Vec<f64>>, f64) {
    let axes = &scene.design.array.positions_m;
    mutual::estimated_matrix_h(&scene.winding, scene.circuit.inductance_h, axes, tolerance)
}

/// The array's inductance matrix, H, from that of its windings `in_air` and its steel's solution.
pub(crate) fn inductances(
    solved: &Solved,
    (in_air, error): (Vec<Vec<f64>>, f64),
) -> (Vec<Vec<f64>>, StageAccuracy) {
    let mut matrix = in_air;
    let mut estimate = error;
    let mut method = "two quadratures of the windings' mutual inductance";
    let mut relative_to = "each mutual inductance";
    for (i, row) in matrix.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            *value += solved.steel().added_inductance_h(i, j);
        }
    }
    if let (true, Some(known)) = (solved.steel().couples(), solved.steel_method()) {
        estimate += solved.steel_error;
        relative_to = "the largest self inductance";
        method = known;
    } else if solved.has_steel() {
        method = "neighbours' cores left out (coupling = \"none\"): mutual inductances are \
                  those of the windings in air";
    }
    let stage = StageAccuracy {
        estimate,
        relative_to: relative_to.to_owned(),
        method: method.to_owned(),
    };
    (matrix, stage)
}

/// The cores at a working point, beside the linear solution.
fn working_point_summary(
    scene: &Scene,
    solved: &Solved,
    point: &WorkingPoint,
    air_inductance_h: &[Vec<f64>],
) -> Result<WorkingPointSummary, RunError> {
    let places = around(scene);
    let sources = solved.sources(scene, &places, 0.0, 1.0)?;
    let steel = sources.map_or_else(Vec::new, |sources| {
        scene.steel_fields(&sources, &places, Components::Gz)
    });
    let (mut air, mut linear) = (vec![0.0; places.len()], vec![0.0; places.len()]);
    let z_m: Vec<f64> = places.iter().map(|p| p[2]).collect();
    for ((coil, current), steel) in scene
        .coils
        .iter()
        .zip(&point.currents_a)
        .zip(steel.chunks_exact(places.len()))
    {
        let [x, y] = coil.axis_m;
        let r_m: Vec<f64> = places.iter().map(|p| (p[0] - x).hypot(p[1] - y)).collect();
        let own = scene
            .winding
            .gradients(&r_m, &z_m, solved.tolerance, Components::Gz)?;
        for (row, (air, linear)) in air.iter_mut().zip(&mut linear).enumerate() {
            *air += current * coil.gain * own.dbz_dz[row];
            *linear += current * coil.gain * steel[row];
        }
    }
    let lowest_m = scene.design.target_height_m;
    let top_m = scene.core.as_ref().map_or(0.0, |core| core.shape.top_m);
    let total = point
        .field(scene, Clearance::above(lowest_m, lowest_m - top_m))
        .at(&places, Components::Gz);
    let sum = |steel: &[f64]| -> Vec<f64> { air.iter().zip(steel).map(|(a, s)| a + s).collect() };
    let flux_linkage_wb = air_inductance_h
        .iter()
        .zip(&point.steel_flux_linkage_wb)
        .map(|(row, steel)| {
            let air: f64 = row.iter().zip(&point.currents_a).map(|(l, i)| l * i).sum();
            air + steel
        })
        .collect();
    Ok(WorkingPointSummary {
        currents_a: point.currents_a.clone(),
        flux_linkage_wb,
        deviation_from_linear: relative_difference(&sum(&total), &sum(&linear)),
    })
}

/// The coils' axes at the target's height, and the middles between every two.
fn around(scene: &Scene) -> Vec<[f64; 3]> {
    let axes: Vec<[f64; 2]> = scene.coils.iter().map(|coil| coil.axis_m).collect();
    let height_m = scene.design.target_height_m;
    let mut places = Vec::new();
    for (i, [x, y]) in axes.iter().enumerate() {
        places.push([*x, *y, height_m]);
        places.extend(
            axes[..i]
                .iter()
                .map(|[a, b]| [0.5 * (a + x), 0.5 * (b + y), height_m]),
        );
    }
    places
}
