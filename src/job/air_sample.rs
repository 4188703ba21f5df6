//! How exact the quadratures in air turned out to be, by values of the elliptic integrals.
//!
//! The rules' a-priori bounds hold everywhere and are careful: what they are at a few places is
//! some hundred times better. Both are told, the sampled one as the estimate.

use crate::accuracy::StageAccuracy;
use crate::field::winding::Winding;

/// The estimate is this multiple of the largest difference that was found.
const SAFETY: f64 = 30.0;
/// Least estimate: what rounding may do, sampled or not.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Places at which values are compared.
pub(super) const PLACES: usize = 48;

/// A value of dB_z/dz per ampere to be compared.
pub(super) struct Sample {
    /// Distance from the coil's axis, m.
    pub(super) r_m: f64,
    /// Height above the coil's top face, m.
    pub(super) z_m: f64,
    /// As computed, T/m/A.
    pub(super) gz: f64,
}

/// `proven`, a bound a priori, with what samples say in its place; itself where they cannot be
/// compared (on the edge of a winding).
pub(super) fn sharper(
    winding: &Winding,
    samples: impl IntoIterator<Item = Sample>,
    proven: StageAccuracy,
) -> StageAccuracy {
    let (mut count, mut largest) = (0, 0.0_f64);
    for Sample { r_m, z_m, gz } in samples {
        // The largest |grad B| at a height is no less than that on the axis.
        let (Ok(here), Ok(on_axis)) = (winding.field(r_m, z_m), winding.field(0.0, z_m)) else {
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
    StageAccuracy {
        estimate,
        method: format!(
            "{SAFETY} times the largest difference from elliptic integrals at {count} places; \
             proven below {:e}: {}",
            proven.estimate, proven.method
        ),
        ..proven
    }
}

/// Indices spread evenly and irregularly over 0..count: multiples of the golden ratio.
pub(super) fn spread(count: usize, samples: usize) -> Vec<usize> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    (0..samples.min(count))
        .map(|i| (((i as f64 * GOLDEN).fract() * count as f64) as usize).min(count - 1))
        .collect()
}
