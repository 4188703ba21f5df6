//! Surfaces: readers, exact heights, primitives, constraint points.
#![allow(missing_docs)]

mod corpus;
mod deviation;
mod formats;
mod fuzz;
mod heights;
mod marks;
mod points;
mod samples;
#[cfg(feature = "step")]
mod step;
mod stl;
mod support;
