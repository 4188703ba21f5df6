//! The only writer and reader of artefacts. It takes plain data and knows nothing of how the
//! numbers were made.

pub mod artefact;
#[allow(clippy::disallowed_methods)] // the one place that writes files
pub mod atomic;
pub mod json;
pub mod number;
