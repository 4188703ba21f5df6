//! Surfaces: readers, exact heights, primitives, constraint points.
#![allow(missing_docs)]

mod closed_body;
mod deviation;
mod formats;
mod fuzz;
mod heights;
mod hostile;
mod inspect;
mod marks;
mod more_formats;
mod points;
mod solidworks;
mod stl;
mod thin_parts;
