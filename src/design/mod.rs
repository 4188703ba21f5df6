//! The input documents: types, validation, messages. Lengths are metres inside.

pub mod array;
pub mod bh_table;
mod checks;
pub mod diagnostics;
pub mod gauge;
pub mod model;
pub mod parse;
pub mod reader;
pub mod rule;
pub(crate) mod sections;
pub mod source;
pub mod template;
pub mod values;
pub mod words;

pub use diagnostics::{Fault, Faults, InvalidDocument, Severity};
pub use model::*;
pub use parse::Need;
