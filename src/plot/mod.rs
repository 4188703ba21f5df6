//! Drawings, from plain numbers to SVG text: the only room that knows the plotting crate.
//!
//! The same numbers give the same bytes.

pub mod pareto;
pub mod replay;
