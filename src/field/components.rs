//! Which components of a field are computed.

use serde::Serialize;
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

/// The components of a field per ampere, the same for sources, maps and tables. The name in artefacts and on the command line is the variant's in lower
/// case, its meaning the first line of the variant's comment.
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
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Components {
    /// dBz/dz
    #[default]
    Gz,
    /// dBx/dz, dBy/dz and dBz/dz, all of the force; of a tilted magnet the gradient tensor too
    Force,
    /// dBz/dz and the gradient tensor
    Gradient,
    /// dBz/dz, the gradient tensor and the field
    All,
}

fluxform_base::choices!(Components);

impl Components {
    /// Number of independent components outside the sources, where the tensor is symmetric and has
    /// no trace: dB_z/dz; dB_x/dz, dB_y/dz, dB_z/dz; dB_x/dx, dB_x/dy, dB_x/dz, dB_y/dz, dB_z/dz; then B_x, B_y, B_z.
    #[must_use]
    pub fn count(self) -> usize {
        match self {
            Self::Gz => 1,
            Self::Force => 3,
            Self::Gradient => 5,
            Self::All => 8,
        }
    }
}
