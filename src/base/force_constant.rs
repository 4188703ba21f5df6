//! The force constants of one object (eq. 10) and which of them is chosen: the one table of their
//! names and meanings.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use crate::units::{FAINT_FORCE_JND, FORCE_JND};

/// The relative change of the force that a finger just notices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Jnd {
    /// A part of the force.
    Part(f64),
    /// [`FORCE_JND`], or [`Jnd::FAINT`] where the requested force is below [`crate::units::FAINT_FORCE_N`].
    ByForce,
}

impl Jnd {
    /// Its name on the command line.
    pub const BY_FORCE: &str = "by-force";
    /// The least that is found for small forces.
    pub const FAINT: f64 = FAINT_FORCE_JND[0];
}

impl Default for Jnd {
    fn default() -> Self {
        Self::Part(FORCE_JND)
    }
}

impl fmt::Display for Jnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Part(part) => part.fmt(f),
            Self::ByForce => f.write_str(Self::BY_FORCE),
        }
    }
}

/// Which force constant is chosen. Its name in artefacts and on the command line is the variant's
/// in lower case, its meaning the first line of the variant's comment.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Default,
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
pub enum Criterion {
    /// Where the first limit binds
    Linear,
    /// The largest at which limits add less than a just-noticeable difference
    #[default]
    Jnd,
    /// Beyond it no current changes
    Saturation,
    /// The largest with no point too weak; its currents may push too much elsewhere
    Maxmin,
}

crate::choices!(Criterion);

impl Criterion {
    /// Its name, with the just-noticeable difference where that decides.
    #[must_use]
    pub fn described(self, jnd: &str) -> String {
        match self {
            Self::Jnd => format!("{} at {jnd}", self.name()),
            Self::Linear | Self::Saturation | Self::Maxmin => self.name().to_owned(),
        }
    }

    /// Whether its currents are those of the least mean square error; otherwise they leave no point
    /// too weak.
    #[must_use]
    pub fn is_least_mean_square(self) -> bool {
        match self {
            Self::Linear | Self::Jnd | Self::Saturation => true,
            Self::Maxmin => false,
        }
    }
}

/// The force constants of one object, N/m. `null` where a limit never binds or nothing can be
/// rendered.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct ForceConstants {
    /// Where the first limit binds, N/m.
    pub lambda_linear_n_per_m: Option<f64>,
    /// The largest lambda at which limits add less than a just-noticeable difference, N/m:
    /// `e* - e_0 <= w^2 lambda^2 mean(h^2)`.
    pub lambda_jnd_n_per_m: Option<f64>,
    /// The smallest, N/m, beyond which the currents no longer change: the last breakpoint. A change
    /// that is worth less than 1e-15 of `lambda^2 mean(h^2)` at every lambda is none: where the sum
    /// binds, rounding of the forces alone decides among coils that tie.
    pub lambda_saturation_n_per_m: Option<f64>,
    /// The largest at which no point is too weak, N/m.
    #[serde(default)]
    pub lambda_maxmin_n_per_m: Option<f64>,
    /// Below it the weakest point is not felt, N/m; null for a surface that touches z = 0.
    pub lambda_floor_n_per_m: Option<f64>,
}

/// One force constant with its name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NamedConstant {
    /// As in the key `lambda_<name>_n_per_m`.
    pub name: &'static str,
    /// In a few words.
    pub meaning: &'static str,
    /// N/m.
    pub lambda_n_per_m: Option<f64>,
}

impl ForceConstants {
    /// The one that `criterion` chooses, N/m.
    #[must_use]
    pub fn of(&self, criterion: Criterion) -> Option<f64> {
        match criterion {
            Criterion::Linear => self.lambda_linear_n_per_m,
            Criterion::Jnd => self.lambda_jnd_n_per_m,
            Criterion::Saturation => self.lambda_saturation_n_per_m,
            Criterion::Maxmin => self.lambda_maxmin_n_per_m,
        }
    }

    /// All of them by name: one for each criterion, then the floor.
    #[must_use]
    pub fn named(&self) -> Vec<NamedConstant> {
        let chosen = Criterion::ALL.iter().map(|&criterion| NamedConstant {
            name: criterion.name(),
            meaning: criterion.meaning(),
            lambda_n_per_m: self.of(criterion),
        });
        let floor = NamedConstant {
            name: "floor",
            meaning: "Below it the weakest point is not felt",
            lambda_n_per_m: self.lambda_floor_n_per_m,
        };
        chosen.chain([floor]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_criterion_has_a_name_a_meaning_and_a_constant() {
        let constants = ForceConstants {
            lambda_linear_n_per_m: Some(1.0),
            lambda_jnd_n_per_m: Some(2.0),
            lambda_saturation_n_per_m: Some(3.0),
            lambda_maxmin_n_per_m: Some(4.0),
            lambda_floor_n_per_m: Some(5.0),
        };
        let names = constants.named();
        assert_eq!(
            names.iter().map(|one| one.name).collect::<Vec<_>>(),
            ["linear", "jnd", "saturation", "maxmin", "floor"]
        );
        for (one, value) in names.iter().zip([1.0, 2.0, 3.0, 4.0, 5.0]) {
            assert!(one.meaning.len() > 10, "{one:?}");
            assert_eq!(one.lambda_n_per_m, Some(value));
        }
        for criterion in Criterion::ALL {
            assert_eq!(criterion.name().parse(), Ok(*criterion));
        }
    }
}
