//! Surfaces: STL readers, exact heights, primitives, constraint points.
#![allow(missing_docs)]

mod deviation;
mod fuzz;
mod heights;
mod marks;
mod points;
mod stl;
mod support;
