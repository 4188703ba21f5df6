//! How exact the quadratures of coils that answer to themselves alone turned out to be, by direct
//! values.
//!
//! The rules' a-priori bounds hold everywhere and are careful: what they are at a few places is
//! some hundred times better. Both are stated, the sampled one as the estimate.

use super::Scene;
use super::steel::Solved;
use super::tolerances::MAGNET_FINEST;
use crate::RunError;
use crate::numerics::spread::spread;
use crate::progress::Silent;

/// The estimate is this multiple of the largest difference that was found.
const SAFETY: f64 = 30.0;
/// Least estimate: what rounding may do, sampled or not.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Places at which values are compared, of all of them.
const PLACES: usize = 48;
/// Places at which values are compared above and beside the winding.
const NEAR_PLACES: usize = 192;
/// Up to this multiple of the winding's outer radius from the axis: the quadratures lose most there.
const NEAR: f64 = 1.5;
/// Values among which those places are looked for.
const LOOKED_AT: usize = 20_000;

/// A value of dB_z/dz per ampere to be compared.
pub(crate) struct Sample {
    /// Distance from the coil's axis, m.
    pub(crate) r_m: f64,
    /// Height above the coil's top face, m.
    pub(crate) z_m: f64,
    /// As computed, T/m/A.
    pub(crate) gz: f64,
}

/// The error of evaluating a solved field, and how it is known.
pub(crate) struct Evaluation {
    /// Relative to the largest |grad B| at the height.
    pub(crate) estimate: f64,
    /// A bound a priori, or samples beside it.
    pub(crate) method: String,
}

/// `proven`, a bound a priori, with what samples say in its place; itself where they cannot be
/// compared: on the edge of a winding, or where cores answer to other windings.
pub(crate) fn sharper(
    scene: &Scene,
    solved: &Solved,
    samples: impl IntoIterator<Item = Sample>,
    proven: Evaluation,
) -> Evaluation {
    let Some((field, direct)) = solved.steel().direct(&scene.winding) else {
        return proven;
    };
    let (mut count, mut largest) = (0, 0.0_f64);
    for Sample { r_m, z_m, gz } in samples {
        // The largest |grad B| at a height is no less than that on the axis.
        let (Ok(here), Ok(on_axis)) = (field(r_m, z_m), field(0.0, z_m)) else {
            return proven;
        };
        count += 1;
        largest = largest.max((gz - here.dbz_dz).abs() / on_axis.gradient_norm());
    }
    let estimate = SAFETY * largest + ROUNDING;
    // Not a number: fields beyond the range of doubles.
    if count == 0 || estimate.is_nan() || estimate >= proven.estimate {
        return proven;
    }
    Evaluation {
        estimate,
        method: format!(
            "{SAFETY} times the largest difference from {direct} at {count} places; proven below \
             {:e}: {}",
            proven.estimate, proven.method
        ),
    }
}

/// Which of `count` values are compared, `r_m` being the distance of each from the axis of its coil: some of all,
/// and some of those near the winding, or the nearest where few are. None where nothing is to compare them with.
pub(crate) fn compared(
    scene: &Scene,
    solved: &Solved,
    count: usize,
    r_m: impl Fn(usize) -> f64,
) -> Vec<usize> {
    if solved.steel().direct(&scene.winding).is_none() {
        return Vec::new();
    }
    let mut looked_at = spread(count, LOOKED_AT);
    let within_m = NEAR * scene.winding.outer_radius_m;
    let is_near = |index: &usize| r_m(*index) <= within_m;
    let mut near: Vec<usize> = looked_at.iter().copied().filter(is_near).collect();
    if near.len() < PLACES {
        looked_at.sort_by(|a, b| r_m(*a).total_cmp(&r_m(*b)));
        looked_at.truncate(PLACES);
        near = looked_at;
    }
    let near = spread(near.len(), NEAR_PLACES).into_iter().map(|k| near[k]);
    spread(count, PLACES).into_iter().chain(near).collect()
}

/// Tolerance of the forces that others are compared with, in that of these.
pub(super) const FINER: f64 = 1e-2;
/// Places at which forces are compared.
const FORCES: usize = 24;

/// `proven` of forces on the magnet, with what those of a finer rule for it and of finer sources say
/// at some of `points_m` in its place: `given` is the last `N` components of the force of every coil
/// there, N/A, [point, coil], errors being relative to the moment times the gradient at the height.
/// Itself where nothing finer is to be had.
///
/// # Errors
/// Interruption.
pub(crate) fn sharper_forces<const N: usize>(
    scene: &Scene,
    solved: &Solved,
    points_m: &[[f64; 3]],
    given: impl Fn(usize, usize) -> [f64; N],
    proven: Evaluation,
) -> Result<Evaluation, RunError> {
    let finer = solved.to_tolerance(FINER * solved.tolerance);
    if finer.tolerance < MAGNET_FINEST {
        return Ok(proven);
    }
    let rows = spread(points_m.len(), FORCES);
    let places_m: Vec<[f64; 3]> = rows.iter().map(|row| points_m[*row]).collect();
    let sure = match scene.forces::<N>(&finer, &places_m, &Silent) {
        Ok(sure) => sure,
        Err(RunError::Interrupted(stop)) => return Err(stop.into()),
        // So close that a finer rule would have too many dipoles.
        Err(_) => return Ok(proven),
    };
    let [x, y, z] = scene.moment_a_m2;
    let moment = x.hypot(y).hypot(z);
    let mut largest = 0.0_f64;
    for ((row, place_m), sure) in rows
        .iter()
        .zip(&places_m)
        .zip(sure.chunks(scene.coils.len()))
    {
        let Ok(above) = scene.winding.field(0.0, place_m[2]) else {
            return Ok(proven);
        };
        let size = moment * above.gradient_norm();
        for (coil, sure) in sure.iter().enumerate() {
            let gain = scene.coils[coil].gain.abs();
            for (a, b) in given(*row, coil).iter().zip(sure) {
                if gain > 0.0 {
                    largest = largest.max((a - b).abs() / (size * gain));
                }
            }
        }
    }
    let estimate = SAFETY * largest + ROUNDING;
    if rows.is_empty() || estimate.is_nan() || estimate >= proven.estimate {
        return Ok(proven);
    }
    Ok(Evaluation {
        estimate,
        method: format!(
            "{SAFETY} times the largest difference from a hundred times finer forces at {} places; \
             proven below {:e}: {}",
            rows.len(),
            proven.estimate,
            proven.method
        ),
    })
}
