//! The input documents: types, validation, messages. Lengths are metres inside.

pub mod model;

pub use model::*;
