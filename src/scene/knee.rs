//! Warnings about steel that is taken as linear and reaches its knee, as far as the stated errors tell.

/// The advice on the cores of coils.
pub(crate) const FOR_CORES: &str = "give core.bh_curve, or lower the current";

/// Largest error of a peak, relative to it, with which it is known: beyond, panels resolve neither.
const KNOWN: f64 = 0.5;
/// What to do about a peak that is not known.
const FINER: &str = "lower --tolerance";

/// A sentence where the steel of `whose` is above its knee, or where the errors leave that open; `peaks_t` are its
/// largest |B| and their stated errors, T.
///
/// Of several the one that is surest above the knee is named, else the one that may reach farthest.
pub(crate) fn above_knee(
    peaks_t: impl IntoIterator<Item = (f64, f64)>,
    knee_t: f64,
    whose: &str,
    advice: &str,
) -> Option<String> {
    above_knee_or(peaks_t, knee_t, whose, advice, FINER)
}

/// The same, and `finer` says how to know more of a peak.
pub(super) fn above_knee_or(
    peaks_t: impl IntoIterator<Item = (f64, f64)>,
    knee_t: f64,
    whose: &str,
    advice: &str,
    finer: &str,
) -> Option<String> {
    let (mut surest, mut farthest) = ((0.0, 0.0), (0.0, 0.0));
    for (peak_t, error_t) in peaks_t {
        if error_t <= KNOWN * peak_t && peak_t - error_t > surest.0 - surest.1 {
            surest = (peak_t, error_t);
        }
        if peak_t + error_t > farthest.0 + farthest.1 {
            farthest = (peak_t, error_t);
        }
    }
    let stated = |(peak_t, error_t): (f64, f64)| format!("{peak_t:.2} T, +/- {error_t:.2} T");
    if surest.0 - surest.1 > knee_t {
        Some(format!(
            "{whose} reaches {}, above the steel's knee at {knee_t} T, but is taken as linear: the force will be \
             smaller than stated; {advice}",
            stated(surest)
        ))
    } else if farthest.0 + farthest.1 > knee_t {
        Some(format!(
            "it is not known at this tolerance whether {whose} is above the steel's knee at {knee_t} T, where the \
             force is smaller than stated: it is computed to reach {}; {finer}",
            stated(farthest)
        ))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A peak of 64 T with an error of 64 T was called above a knee of 1.5 T, and the force smaller than stated.
    #[test]
    fn regression_a_peak_less_sure_than_its_knee_was_above_it() {
        let said = |peaks: &[(f64, f64)]| {
            let said = above_knee(peaks.iter().copied(), 1.5, "a plate", "make it thicker");
            said.unwrap_or_default()
        };
        assert_eq!(said(&[(1.37, 0.1)]), "");
        for unsure in [(1.37, 0.17), (1.63, 0.17), (64.38, 64.24)] {
            let said = said(&[unsure]);
            assert!(said.contains("not known at this tolerance"), "{said}");
            assert!(said.ends_with("lower --tolerance"), "{said}");
        }
        // What is sure is said whatever else is not.
        let said = said(&[(64.38, 64.24), (1.73, 0.17)]);
        assert!(said.contains("1.73 T, +/- 0.17 T, above"), "{said}");
        assert!(said.ends_with("make it thicker"), "{said}");
    }

    /// 360.8 T, +/- 307.8 T, of a wall that carries 0.88 T, was called above a knee of 1.5 T.
    #[test]
    fn regression_a_peak_that_no_panels_resolve_was_above_the_knee() {
        let finer = "make the steel thicker";
        let said = above_knee_or([(360.8, 307.8)], 1.5, "a wall", "lower the current", finer);
        let said = said.unwrap_or_default();
        assert!(said.contains("not known at this tolerance"), "{said}");
        assert!(said.ends_with(finer), "{said}");
    }
}
