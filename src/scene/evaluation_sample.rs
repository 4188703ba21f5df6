//! How exact quadratures turned out to be: those of coils that answer to themselves alone by direct
//! values, those of a magnet's volume by much finer ones.
//!
//! The rules' a-priori bounds hold everywhere and are careful: what they are at a few places is
//! some hundred times better. Both are stated, the sampled one as the estimate.

use super::Scene;
use super::steel::{Solved, Steel};
use crate::field::winding::{AxialField, OnEdge};
use crate::progress::Silent;

/// The estimate is this multiple of the largest difference that was found.
const SAFETY: f64 = 30.0;
/// Least estimate: what rounding may do, sampled or not.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Places at which values are compared.
pub(crate) const PLACES: usize = 48;

/// Points at which forces are compared with finer ones.
const FORCE_PLACES: usize = 12;
/// Their tolerance, relative to that of the forces.
const FINER_FORCES: f64 = 0.01;

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
    let (layer, direct) = match &solved.steel {
        Steel::None => (None, "elliptic integrals"),
        Steel::Alone(core) => (
            Some(&core.layer),
            "elliptic integrals over the core's layer",
        ),
        Steel::Coupled(_) => return proven,
    };
    let field = |r_m: f64, z_m: f64| -> Result<AxialField, OnEdge> {
        let air = scene.winding.field(r_m, z_m)?;
        Ok(layer.map_or(air, |layer| air + layer.field(r_m, z_m)))
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
    sampled(largest, direct, count, proven)
}

/// `proven`, a bound a priori of `forces_n_per_a` at `points_m` ([point, coil]), with what forces to a
/// hundredth of the tolerance say in its place: for a magnet that is no point, whose rules' bounds are
/// the most careful ones.
pub(crate) fn sharper_by_finer(
    scene: &Scene,
    solved: &Solved,
    points_m: &[[f64; 3]],
    forces_n_per_a: &[f64],
    proven: Evaluation,
) -> Evaluation {
    let Some(driven) = scene.coils.iter().position(|coil| coil.gain != 0.0) else {
        return proven;
    };
    let coils = scene.coils.len();
    let heights = points_m.iter().map(|place| place[2]).enumerate();
    // The lowest is where rules err most.
    let lowest = heights.min_by(|a, b| a.1.total_cmp(&b.1));
    let mut rows = spread(points_m.len(), FORCE_PLACES);
    rows.extend(lowest.map(|(row, _)| row));
    let [axis_x, axis_y] = scene.coils[driven].axis_m;
    let places: Vec<[f64; 3]> = rows.iter().map(|row| points_m[*row]).collect();
    let on_axis = places.iter().map(|place| [axis_x, axis_y, place[2]]);
    let places: Vec<[f64; 3]> = places.iter().copied().chain(on_axis).collect();
    let finer = Solved {
        tolerance: FINER_FORCES * solved.tolerance,
        ..solved.clone()
    };
    let Ok(sure) = scene.forces_n_per_a(&finer, &places, &Silent) else {
        return proven;
    };
    let mut largest = 0.0_f64;
    for (k, row) in rows.iter().enumerate() {
        // |F| <= |m| |grad B|: no height's largest gradient is below what the force on an axis needs.
        let size = sure[(rows.len() + k) * coils + driven].abs();
        let (told, sure) = (&forces_n_per_a[row * coils..], &sure[k * coils..]);
        for (told, sure) in told.iter().zip(sure).take(coils) {
            largest = largest.max((told - sure).abs() / size);
        }
    }
    let direct = "forces by rules and fields to a hundredth of the tolerance";
    sampled(largest, direct, rows.len(), proven)
}

/// What the `largest` difference at `count` places says, or what is `proven` where that is less.
fn sampled(largest: f64, direct: &str, count: usize, proven: Evaluation) -> Evaluation {
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

/// Indices spread evenly and irregularly over 0..count: multiples of the golden ratio.
pub(crate) fn spread(count: usize, samples: usize) -> Vec<usize> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    (0..samples.min(count))
        .map(|i| (((i as f64 * GOLDEN).fract() * count as f64) as usize).min(count - 1))
        .collect()
}
