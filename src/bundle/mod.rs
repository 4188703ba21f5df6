//! The only writer and reader of artefacts. It takes plain data and knows nothing of how the
//! numbers were made.

pub mod artefact;
#[allow(clippy::disallowed_methods)] // the one place that writes files
pub mod atomic;
pub mod bench;
mod consistent;
pub mod force_map;
pub mod json;
pub mod lambda_file;
pub mod load;
pub mod mag_manip;
pub mod manifest;
mod npy;
pub mod npz;
pub mod number;
pub mod read_table;
pub mod rendering;
pub mod replay;
pub mod scan;
pub mod schema;
pub mod store;
pub mod sweep;
pub mod table;
pub mod trajectory;
pub mod vtk;
pub mod write;
