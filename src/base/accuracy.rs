//! The error estimate that every stage reports beside its numbers, and how sure an optimum is.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

/// The stages of a result that its tolerance governs; what others state is of another kind (a
/// length, a model's own error).
const GOVERNED: [&str; 5] = ["field", "inductance", "mutual_inductance", "forces", "map"];

/// Those of the flux density inside a core, which has a coarser default.
const GOVERNED_IN_CORE: [&str; 2] = ["core_field", "core_field_mean"];

/// That of the force of one coil or at a place, whose default allows for the magnet's dipoles.
const GOVERNED_OF_FORCE: [&str; 1] = ["force"];

/// The stages that a tolerance governs and that miss it, by name. There is one meaning of
/// *reached*: every such stage's stated error is at most the tolerance.
pub fn missed<'a, S: AsRef<str> + 'a>(
    stages: impl IntoIterator<Item = (&'a S, &'a StageAccuracy)>,
    tolerance: f64,
) -> Vec<String> {
    missed_among(&GOVERNED, stages, tolerance)
}

/// As [`missed`], of the flux density inside a core.
pub fn missed_in_core<'a, S: AsRef<str> + 'a>(
    stages: impl IntoIterator<Item = (&'a S, &'a StageAccuracy)>,
    tolerance: f64,
) -> Vec<String> {
    missed_among(&GOVERNED_IN_CORE, stages, tolerance)
}

/// As [`missed`], of a force on the magnet.
pub fn missed_of_force<'a, S: AsRef<str> + 'a>(
    stages: impl IntoIterator<Item = (&'a S, &'a StageAccuracy)>,
    tolerance: f64,
) -> Vec<String> {
    missed_among(&GOVERNED_OF_FORCE, stages, tolerance)
}

fn missed_among<'a, S: AsRef<str> + 'a>(
    governed: &[&str],
    stages: impl IntoIterator<Item = (&'a S, &'a StageAccuracy)>,
    tolerance: f64,
) -> Vec<String> {
    stages
        .into_iter()
        .filter(|(name, stage)| governed.contains(&name.as_ref()) && !stage.meets(tolerance))
        .map(|(name, stage)| stage.against(name.as_ref(), tolerance))
        .collect()
}

/// One stage's estimated error and how it was estimated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageAccuracy {
    /// Estimated error, relative to what `relative_to` names.
    pub estimate: f64,
    /// The quantity the estimate is relative to.
    pub relative_to: String,
    /// How the estimate was made: an a-priori bound, two resolutions, samples.
    pub method: String,
}

impl StageAccuracy {
    /// Whether the stated error is at most `tolerance`.
    #[must_use]
    pub fn meets(&self, tolerance: f64) -> bool {
        self.estimate <= tolerance
    }

    fn against(&self, name: &str, tolerance: f64) -> String {
        let Self {
            estimate,
            relative_to,
            ..
        } = self;
        // As many digits as show that one is above the other.
        let differs =
            |digits: &usize| format!("{estimate:.digits$e}") != format!("{tolerance:.digits$e}");
        let digits = (1..17).find(differs).unwrap_or(1);
        format!("{name}: {estimate:.digits$e} of {relative_to}, above {tolerance:.digits$e}")
    }
}

/// How sure it is that no coil is better.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    EnumMessage,
    EnumString,
    IntoStaticStr,
    VariantArray,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum CertificateKind {
    /// The best near one starting point.
    Local,
    /// The best of several.
    Multistart,
    /// The best of every number of layers and turns, each with the best bore found.
    Exhaustive,
    /// Proven.
    Global,
}

crate::choices!(CertificateKind);

impl CertificateKind {
    /// Of local searches alone, by their number.
    #[must_use]
    pub fn of_searches(starts: usize) -> Self {
        if starts == 1 {
            Self::Local
        } else {
            Self::Multistart
        }
    }

    /// The set in which the result is the best.
    #[must_use]
    pub fn scope(self) -> &'static str {
        match self {
            Self::Local => "the best near one starting point",
            Self::Multistart => "the best of many starting points",
            Self::Exhaustive => {
                "exhaustive: the best of every number of layers and turns per layer, each with \
                 the best bore found"
            }
            Self::Global => "proven best",
        }
    }

    /// Open question where no bound on the force is stated.
    #[must_use]
    pub fn open_question(self) -> &'static str {
        match self {
            Self::Local | Self::Multistart => "nothing is proven",
            Self::Exhaustive => "bores between those tried are not bounded",
            Self::Global => "no bound is stated",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reached_means_that_every_governed_stage_is_within_the_tolerance() {
        let stage = |estimate| StageAccuracy {
            estimate,
            relative_to: "the field".to_owned(),
            method: String::new(),
        };
        let stages = [
            ("field", stage(1.3e-6)),
            ("inductance", stage(2.0e-6)),
            ("transient", stage(0.05)),
        ];
        let of = |tolerance| missed(stages.iter().map(|(name, stage)| (name, stage)), tolerance);
        assert!(of(2.0e-6).is_empty());
        assert_eq!(
            of(1.9e-6),
            ["inductance: 2.0e-6 of the field, above 1.9e-6"]
        );
        assert_eq!(
            of(1.996e-6),
            ["inductance: 2.000e-6 of the field, above 1.996e-6"]
        );
        assert_eq!(of(1e-6).len(), 2);
        assert_eq!(of(f64::NAN).len(), 2);
    }
}
