//! Sources to field and gradient: the loop, the winding, the magnet.

pub mod batch;
pub mod dipole;
pub mod frame;
pub mod magnet;
pub mod ring;
pub mod source;
pub mod steel;
pub mod winding;
