//! |B| in the steel of an array at given currents, and the currents at which it is about largest.

use serde::Serialize;

use super::Scene;
use super::knee::{FOR_CORES, above_knee};
use super::steel::Solved;
use super::working_point::WorkingPoint;
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::field::iron::peaks::{IronPeaks, Peak, PeakSearch};
use crate::field::steel::core_flux_density::{CoreField, peak_depth_m};

/// |B| in the steel of an array at one set of currents.
#[derive(Debug)]
pub(super) struct ArrayFields {
    /// Largest |B| in every core, T; empty without cores, and for linear ones that are not coupled.
    pub peak_t: Vec<f64>,
    /// Mean |B| there, T; of cores that a plate or other bodies couple, none.
    pub mean_t: Vec<f64>,
    /// The cores along their B-H curve, if they have one.
    pub working_point: Option<WorkingPoint>,
    /// The same of a plate, other bodies and the cores among them.
    pub iron: Option<IronPeaks>,
    /// Errors of the largest peaks, T; none along a B-H curve.
    peak_errors_t: Vec<f64>,
    /// How sure the largest peak and the largest mean are, relative to them; `None` where nothing looked at them.
    errors: Option<[f64; 2]>,
}

/// The core that can carry the largest |B|.
#[derive(Debug, Clone, Serialize)]
pub struct LargestCoreField {
    /// Its coil.
    pub coil: usize,
    /// Largest |B| in it, T.
    pub peak_field_t: f64,
    /// Mean |B| there, T; not known beside a plate and other bodies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_field_t: Option<f64>,
    /// At these currents, A, one per coil: within their limits and such that their fluxes add up in it.
    pub currents_a: Vec<f64>,
}

impl ArrayFields {
    /// At `currents_a`, of what is solved for the target's height, and of a plate and other bodies as `search` looks at
    /// them.
    ///
    /// # Errors
    /// Cores without a state along their curve; a place on a winding's edge.
    pub fn new(
        scene: &Scene,
        solved: &Solved,
        search: Option<&PeakSearch<'_>>,
        currents_a: &[f64],
    ) -> Result<Self, RunError> {
        let mut fields = Self {
            peak_t: Vec::new(),
            mean_t: Vec::new(),
            working_point: None,
            iron: None,
            peak_errors_t: Vec::new(),
            errors: None,
        };
        let lowest_m = scene.design.target_height_m;
        if let Some(point) = WorkingPoint::new(scene, solved, currents_a, lowest_m)? {
            fields.peak_t.clone_from(&point.peak_field_t);
            fields.mean_t.clone_from(&point.mean_field_t);
            fields.errors = Some(point.core_field_errors);
            fields.working_point = Some(point);
        } else if let Some(array) = solved.steel().coupled() {
            let depth_m = peak_depth_m(array.response.outline.shape);
            let inside = array.core_fields(currents_a, depth_m)?;
            let all = |of: fn(&CoreField) -> f64| inside.iter().map(of).collect::<Vec<f64>>();
            let mean_errors_t = all(|field| field.mean_error * field.mean_t);
            fields.peak_t = all(|field| field.peak_t);
            fields.mean_t = all(|field| field.mean_t);
            fields.peak_errors_t = all(|field| field.peak_error * field.peak_t);
            fields.errors = Some([
                share(&fields.peak_errors_t, &fields.peak_t),
                share(&mean_errors_t, &fields.mean_t),
            ]);
        }
        if let Some(search) = search {
            let peaks = search.peaks(currents_a)?;
            fields.peak_t = peaks.cores.iter().map(|peak| peak.field_t).collect();
            fields.iron = Some(peaks);
        }
        Ok(fields)
    }

    /// The core with the largest peak, at `currents_a`, at which these fields are; `None` without cores, or without
    /// current.
    pub fn largest(&self, currents_a: &[f64]) -> Option<LargestCoreField> {
        let peaks = self.peak_t.iter().copied().enumerate();
        let (coil, peak_field_t) = peaks.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        (peak_field_t > 0.0).then(|| LargestCoreField {
            coil,
            peak_field_t,
            mean_field_t: self.mean_t.get(coil).copied(),
            currents_a: currents_a.to_vec(),
        })
    }

    /// How sure they are.
    pub fn stages(&self) -> impl Iterator<Item = (&'static str, StageAccuracy)> {
        let point = self.working_point.as_ref();
        let point = point.map(|point| ("working_point", point.accuracy()));
        let cores = self.errors.into_iter().flat_map(core_stages);
        let iron = self.iron.as_ref().and_then(iron_accuracy);
        let iron = iron.map(|stage| ("iron_field", stage));
        point.into_iter().chain(cores).chain(iron)
    }

    /// Sentences where a core is above its knee, the plate or another body above its own, and a core above the design's
    /// limit, with `currents`, as they are called.
    pub fn warnings(&self, scene: &Scene, currents: &str) -> [Option<String>; 3] {
        let core = format!("a core of the array with {currents}");
        let knee_t = scene.core.as_ref().map(|core| core.knee_t);
        let knee_t = knee_t.unwrap_or(f64::INFINITY);
        let most_t = self.peak_t.iter().copied().fold(0.0, f64::max);
        let along_curve = (self.working_point.is_some() && most_t > knee_t).then(|| {
            format!(
                "{core} reaches {most_t:.2} T, above its steel's knee at {knee_t:.2} T: the force grows less than in \
                 proportion to the currents"
            )
        });
        let errors_t = self.peak_errors_t.iter().copied();
        let linear = self.peak_t.iter().copied().zip(errors_t);
        let linear = above_knee(linear, knee_t, &core, FOR_CORES);
        let [among_steel, elsewhere] = match (&scene.iron, &self.iron) {
            (Some(iron), Some(peaks)) => iron.above_knee(scene, peaks, currents),
            _ => [None, None],
        };
        let limit_t = scene.design.limits.core_field_max_t;
        let limit = limit_t.filter(|limit_t| most_t > *limit_t).map(|limit_t| {
            format!(
                "{core} reaches {most_t:.2} T; limits.core_field_max_t = {limit_t} is of one coil alone"
            )
        });
        [along_curve.or(linear).or(among_steel), elsewhere, limit]
    }
}

/// How sure the flux densities in the array's cores are: the largest ones and the means.
fn core_stages([peak, mean]: [f64; 2]) -> [(&'static str, StageAccuracy); 2] {
    let stage = |estimate, relative_to: &str| StageAccuracy {
        estimate,
        relative_to: relative_to.to_owned(),
        method:
            "of the solution, and along a B-H curve what saturation takes off the modes across \
                 the axis"
                .to_owned(),
    };
    [
        (
            "array_core_field",
            stage(peak, "the largest peak of a core of the array"),
        ),
        (
            "array_core_field_mean",
            stage(mean, "the largest mean of a core of the array"),
        ),
    ]
}

/// How sure the largest flux densities are: the worst of cores, plate and bodies.
fn iron_accuracy(peaks: &IronPeaks) -> Option<StageAccuracy> {
    let parts = [&peaks.cores[..], peaks.elsewhere.as_slice()];
    let of_part = |part: &[Peak]| {
        let errors_t: Vec<f64> = part
            .iter()
            .map(|peak| peak.error_t)
            .collect::<Option<_>>()?;
        let fields_t: Vec<f64> = part.iter().map(|peak| peak.field_t).collect();
        Some(share(&errors_t, &fields_t))
    };
    let known = parts
        .into_iter()
        .filter(|part| !part.is_empty())
        .map(of_part);
    let known: Vec<f64> = known.collect::<Option<_>>()?;
    Some(StageAccuracy {
        estimate: known.into_iter().reduce(f64::max)?,
        relative_to: "the largest flux density of a core, or of the plate and [[iron]]".to_owned(),
        method: "the difference from the next coarser panels, at the same place and of the largest"
            .to_owned(),
    })
}

/// The largest of some errors relative to the largest value; nothing of no value.
fn share(errors: &[f64], values: &[f64]) -> f64 {
    let largest = |all: &[f64]| all.iter().copied().fold(0.0, f64::max);
    let of = largest(values);
    if of > 0.0 { largest(errors) / of } else { 0.0 }
}

/// The currents within all limits that send most flux through one of the coils, A, by the inductance matrix
/// `[i][j]`, H.
///
/// A core's largest |B| follows its flux, of which the sign of the mutual inductance says how a neighbour changes it:
/// those of parallel coils beside each other take from it.
pub(super) fn most_flux(scene: &Scene, inductance_h: &[Vec<f64>]) -> Vec<f64> {
    let mut most = (0.0, vec![0.0; inductance_h.len()]);
    for row_h in inductance_h {
        for sign in [1.0, -1.0] {
            let row_h: Vec<f64> = row_h.iter().map(|value| sign * value).collect();
            let currents_a = largest_sum(&row_h, scene);
            let flux_wb: f64 = row_h.iter().zip(&currents_a).map(|(l, i)| l * i).sum();
            if flux_wb > most.0 {
                most = (flux_wb, currents_a);
            }
        }
    }
    most.1
}

/// The currents within their limits with the largest sum of `weights` times currents.
fn largest_sum(weights: &[f64], scene: &Scene) -> Vec<f64> {
    let [lower_a, upper_a] = [&scene.lower_a, &scene.upper_a];
    let best = |coil: usize| {
        if weights[coil] > 0.0 {
            upper_a[coil]
        } else {
            lower_a[coil]
        }
    };
    let mut currents_a: Vec<f64> = (0..weights.len()).map(best).collect();
    // Beyond the limit of their sum those that give least for an ampere are lowered first.
    let total_a = scene.design.supply.total_current_max_a;
    let mut over_a = currents_a.iter().sum::<f64>() - total_a.unwrap_or(f64::INFINITY);
    let mut order: Vec<usize> = (0..weights.len()).collect();
    order.sort_by(|a, b| weights[*a].total_cmp(&weights[*b]));
    for coil in order {
        let less_a = (currents_a[coil] - lower_a[coil]).min(over_a).max(0.0);
        currents_a[coil] -= less_a;
        over_a -= less_a;
    }
    currents_a
}
