//! The only writer and reader of artefacts. It takes plain data and knows nothing of how the
//! numbers were made.
//!
//! [`load::Bundle`] is how a Rust program reads a bundle that `calibrate` wrote;
//! `src/python/fluxform/load_bundle.py`, `scripts/load_bundle.m` and `scripts/fluxform_bundle.h` are its
//! sisters for Python, Octave or MATLAB, and C. The crate's first page has an example. A bundle
//! is not trusted: a folder that is none, another schema or a changed byte is an error.
//!
//! ```
//! use std::path::Path;
//!
//! use fluxform_bundle::load::{Bundle, BundleError};
//!
//! let refused = Bundle::open(Path::new("no/such/folder")).unwrap_err();
//! assert!(matches!(refused, BundleError::NoBundle { .. }));
//! assert!(refused.to_string().contains("it has no manifest.json"));
//! ```

mod array_check;
pub mod artefact;
#[allow(clippy::disallowed_methods)] // the one place that writes files
pub mod atomic;
pub mod bench;
pub mod cache;
mod cross_check;
pub mod force_map;
pub mod headline;
pub mod json;
pub mod lambda_file;
pub mod load;
pub mod mag_manip;
pub mod manifest;
pub mod map_table;
mod npy;
pub mod npz;
pub mod number;
pub mod read_bounded;
pub mod read_table;
pub mod rendering;
pub mod replay;
pub mod scan;
pub mod schema;
pub mod seal;
mod stored;
pub mod sweep;
pub mod table;
pub mod timing;
pub mod trajectory;
pub mod vtk;
pub mod write;
