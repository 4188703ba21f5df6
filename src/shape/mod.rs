//! Surfaces: mesh readers, primitives, the height map and the constraint points.
//!
//! A surface file passes `format` (which reader) and that reader (file units), becomes a placed
//! [`mesh::Mesh`] in metres, and `height` looks at it from above. `points` is the entry.

pub mod amf;
pub mod certificate;
pub mod deviation;
pub mod document;
pub mod error;
pub mod fault;
pub mod format;
pub mod height;
pub mod holes;
pub mod inspect;
pub mod marks;
pub mod mesh;
pub mod obj;
pub mod placement;
pub mod ply;
pub mod points;
pub mod primitive;
pub mod scattered;
pub mod sldprt;
#[cfg(feature = "step")]
pub mod step;
pub mod stl;
pub mod surface;
pub mod tessellation;
pub mod three_dxml;
pub mod three_mf;

mod archive;
mod assembly;
mod boxes;
mod crossings;
mod edges;
mod index;
mod number;
mod polygon;
mod seen;
mod words;
mod xml;

pub use error::ShapeError;
pub use inspect::MeshReport;
pub use points::{ConstraintPoints, Discretized, Settings, discretize, discretize_with};
pub use surface::Surface;
