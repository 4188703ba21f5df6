//! The interface between a map and a source without symmetry: an array of coupled cores.

use fluxform_field::steel::equivalent_dipoles::ArraySources;

use super::tabulate::{Components, MapError};

/// An array of coils, each of which can be driven with 1 A. Above [`Sampler::top_m`] every
/// Cartesian component of the field is harmonic, and so are its derivatives.
pub trait Sampler: Sync {
    /// Number of coils that can be driven; coil numbers of a design are below it.
    fn drives(&self) -> usize;

    /// Height of the highest singularity, m: the field is analytic above it.
    fn top_m(&self) -> f64;

    /// Values per ampere of every drive at `points_m`, into `out`, [drive, component, point],
    /// with [`Components::count`] components per drive: dB_z/dz for [`Components::Gz`]; dB_x/dz, dB_y/dz, dB_z/dz for [`Components::Force`]; dB_x/dx, dB_x/dy,
    /// dB_x/dz, dB_y/dz, dB_z/dz for [`Components::Gradient`] (the tensor has no trace and is
    /// symmetric outside the sources), T/m/A; then B_x, B_y, B_z for [`Components::All`], T/A.
    ///
    /// A batch is given as a whole, so that a sampler may use its symmetries; how to share it
    /// among threads is the sampler's own matter. The result must not depend on that.
    ///
    /// # Errors
    /// A point where the gradient is unbounded; interruption.
    fn sample(
        &self,
        points_m: &[[f64; 3]],
        components: Components,
        out: &mut [f64],
    ) -> Result<(), MapError>;
}

/// Independent components of the gradient.
pub const GRADIENT: usize = 5;

/// Place of dB_z/dz among the components.
pub(super) fn gz(components: Components) -> usize {
    match components {
        Components::Gz => 0,
        Components::Force => 2,
        Components::Gradient | Components::All => GRADIENT - 1,
    }
}

/// The gradient's five components at a node from those sampled; those that are not are zero.
pub(super) fn five(components: Components, sampled: impl Fn(usize) -> f64) -> [f64; GRADIENT] {
    match components {
        Components::Gz => [0.0, 0.0, 0.0, 0.0, sampled(0)],
        Components::Force => [0.0, 0.0, sampled(0), sampled(1), sampled(2)],
        Components::Gradient | Components::All => std::array::from_fn(sampled),
    }
}

/// The nine components of the gradient from its five.
pub(super) fn tensor([xx, xy, xz, yz, zz]: [f64; GRADIENT]) -> [f64; 9] {
    [xx, xy, xz, xy, -xx - zz, yz, xz, yz, zz]
}

impl Sampler for ArraySources {
    fn drives(&self) -> usize {
        Self::drives(self)
    }

    fn top_m(&self) -> f64 {
        Self::top_m(self)
    }

    fn sample(
        &self,
        points_m: &[[f64; 3]],
        components: Components,
        out: &mut [f64],
    ) -> Result<(), MapError> {
        Self::sample(self, points_m, components, out);
        Ok(())
    }
}
