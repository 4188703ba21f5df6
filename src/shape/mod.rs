//! Surfaces: mesh readers, primitives, the height map and the constraint points.

pub mod document;
