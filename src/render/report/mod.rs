//! Pages that people look at: plain data in, one self-contained HTML text out.
//!
//! A page loads nothing and sends nothing: style, script and numbers are in it, and its content
//! security policy names both by their digests. Every text that comes from an input is escaped
//! ([`html`]). The same data give the same bytes.

pub mod array;
pub mod bundle;
pub mod bundle_files;
pub mod data;
mod directions;
mod error_budget;
mod field;
pub mod frame;
pub mod html;
pub mod inputs;
pub mod limits;
pub mod measured;
pub mod number;
pub mod pack;
mod path;
mod surface;
pub mod sweep;
mod uncertainty;
