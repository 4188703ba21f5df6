//! The error estimate that every stage reports beside its numbers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The stages of a result that its tolerance governs; what others state is of another kind (a
/// length, a model's own error).
const GOVERNED: [&str; 5] = ["field", "inductance", "mutual_inductance", "forces", "map"];

/// The stages that a tolerance governs and that miss it, by name. There is one meaning of
/// *reached*: every such stage's stated error is at most the tolerance.
pub fn missed<'a, S: AsRef<str> + 'a>(
    stages: impl IntoIterator<Item = (&'a S, &'a StageAccuracy)>,
    tolerance: f64,
) -> Vec<String> {
    stages
        .into_iter()
        .filter(|(name, stage)| GOVERNED.contains(&name.as_ref()) && !stage.meets(tolerance))
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
        format!("{name}: {estimate:.1e} of {relative_to}, above {tolerance:.1e}")
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
        assert_eq!(of(1e-6).len(), 2);
        assert_eq!(of(f64::NAN).len(), 2);
    }
}
