//! Surfaces: readers, exact heights, primitives, constraint points.
#![allow(missing_docs)]

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
#[cfg(feature = "step")]
mod step;
mod stl;
