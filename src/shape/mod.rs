//! Surfaces: mesh readers, primitives, the height map and the constraint points.
//!
//! A surface file passes `format` (which reader) and `stl` (file units), becomes a placed
//! [`mesh::Mesh`] in metres, and `height` looks at it from above. `points` is the entry.

pub mod certificate;
pub mod deviation;
pub mod document;
pub mod error;
pub mod format;
pub mod height;
pub mod holes;
pub mod marks;
pub mod mesh;
pub mod placement;
pub mod points;
pub mod primitive;
pub mod scattered;
pub mod stl;
pub mod surface;
pub mod tessellation;

mod index;
mod seen;

pub use error::ShapeError;
pub use points::{ConstraintPoints, Discretized, Settings, discretize, discretize_with};
pub use surface::Surface;
