//! Surfaces: mesh readers, primitives, the height map and the constraint points.
//!
//! A surface file passes `format` (which reader) and that reader (file units), becomes a placed
//! [`mesh::Mesh`] in metres, and `height` looks at it from above. `points` is the entry.
//!
//! ```
//! use std::path::Path;
//!
//! use fluxform_base::progress::Silent;
//! use fluxform_shape::{discretize, document::ShapeDocument};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = "
//!     name = 'dome'
//!     primitive = 'half-sphere'
//!     radius_mm = 20.0
//!     base_mm = 15.0
//!     points = { x_mm = [-20.0, 20.0, 17], y_mm = [-20.0, 20.0, 17] }
//! ";
//! let (document, _warnings) = ShapeDocument::from_toml(text, Path::new("dome.toml"))?;
//! let points = discretize(&document, &Silent)?.points;
//! for j in 0..points.len() {
//!     let r_m = points.x_m[j].hypot(points.y_m[j]);
//!     let height = 0.015 + (0.02_f64.powi(2) - r_m * r_m).max(0.0).sqrt();
//!     assert!((points.height_m[j] - height).abs() < 1e-9);
//! }
//! // The corners of the grid lie beside the dome and give no points.
//! assert_eq!(points.len() + points.outside, 17 * 17);
//! assert!(points.outside > 50);
//! # Ok(())
//! # }
//! ```

pub mod amf;
pub mod bodies;
pub mod certificate;
pub mod closed_body;
pub mod deviation;
pub mod document;
pub mod error;
pub mod file_mesh;
pub mod format;
pub mod glb;
pub mod height;
pub mod height_image;
pub mod hidden;
pub mod holes;
pub mod inspect;
pub mod memory;
pub mod mesh;
pub mod obj;
pub mod off;
pub mod placement;
pub mod ply;
pub mod point_areas;
pub mod point_flags;
pub mod points;
pub mod primitive;
pub mod read_error;
pub mod scattered;
pub mod sldprt;
pub mod step;
pub mod stl;
pub mod surface;
pub mod tessellation;
pub mod three_dxml;
pub mod three_mf;

mod archive;
mod assembly;
mod crossings;
mod edges;
mod index;
mod number;
mod polygon;
mod readers;
mod sides;
mod text;
mod tokens;
mod vertical_hit;
mod xml;
mod zeros;

pub use error::ShapeError;
pub use inspect::MeshReport;
pub use points::{
    ConstraintPoints, Discretized, Settings, discretize, discretize_surface, discretize_with,
};
pub use surface::Surface;
