//! Which components of a field are computed.

/// The components of a field per ampere, the same for sources, maps and tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Components {
    /// dB_z/dz.
    Gz,
    /// The whole gradient tensor.
    Gradient,
    /// The gradient tensor and the field.
    All,
}

impl Components {
    /// Number of independent components outside the sources, where the tensor is symmetric and has
    /// no trace: dB_z/dz; dB_x/dx, dB_x/dy, dB_x/dz, dB_y/dz, dB_z/dz; then B_x, B_y, B_z.
    #[must_use]
    pub fn count(self) -> usize {
        match self {
            Self::Gz => 1,
            Self::Gradient => 5,
            Self::All => 8,
        }
    }
}
