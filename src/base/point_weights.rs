//! How points count in the mean over an object.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

/// How the points of a grid count in the mean square error. Its name in artefacts, documents and on
/// the command line is the variant's in lower case, its meaning the first line of the variant's
/// comment.
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
pub enum Weights {
    /// All points alike: a grid's border counts twice, its corners four times
    #[default]
    Equal,
    /// By the plan area that each point stands for: lambda of the object, not of its grid
    Area,
}

crate::choices!(Weights);

impl Weights {
    /// Whether points count alike, so that a file need not say it.
    #[must_use]
    pub fn is_equal(&self) -> bool {
        match self {
            Self::Equal => true,
            Self::Area => false,
        }
    }
}
