//! The input documents: types, validation, messages. Lengths are metres inside.
//!
//! [`Design::from_toml`] gives a validated design, or every fault of the text with its place.
//!
//! ```
//! use std::path::Path;
//!
//! use fluxform_design::{Design, Need};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = "
//!     name = 'one-coil'
//!     coil = { inner_diameter_mm = 12.0, outer_diameter_mm = 30.0, length_mm = 40.0 }
//!     wire = { diameter_mm = 0.7 }
//! ";
//! let (design, _warnings) = Design::from_toml(text, Path::new("one.toml"), Need::PROBE)?;
//! let coil = design.coil.ok_or("no coil")?;
//! assert_eq!(coil.length_m, 0.04);
//! assert_eq!(design.array.positions_m, [[0.0, 0.0]]);
//!
//! // Both mistakes are reported at once, each with the key that is at fault.
//! let wrong = text.replace("12.0", "32.0").replace("length_mm", "lenght_mm");
//! let faults = Design::from_toml(&wrong, Path::new("one.toml"), Need::PROBE).unwrap_err();
//! let report = faults.to_string();
//! assert!(report.contains("lenght_mm") && report.contains("length_mm"), "{report}");
//! # Ok(())
//! # }
//! ```

pub mod array;
pub mod bh_table;
mod checks;
pub mod commented;
pub mod diagnostics;
mod draft;
pub mod gauge;
pub mod iron;
mod key;
pub mod keys;
mod limits;
pub mod message_text;
pub mod model;
pub mod named_file;
pub mod parse;
pub mod reader;
pub mod rule;
pub mod search;
mod sections;
pub mod source;
pub mod template;
pub mod values;

pub use rule::BODY_MM;
pub use sections::{SEED_SIDE_MM, axis_m};

pub use diagnostics::{Fault, Faults, InvalidDocument, Severity};
pub use draft::Need;
pub use limits::{Limits, Prices};
pub use model::*;
