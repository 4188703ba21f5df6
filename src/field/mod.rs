//! Sources to field and gradient: the loop, the winding, the dipole magnet.

pub mod batch;
pub mod dipole;
pub mod frame;
pub mod ring;
pub mod steel;
pub mod winding;
