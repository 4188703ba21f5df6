//! Geometry, circuit and limits of a coil.
