//! Quadrature, ordered sums, small dense algebra, interpolation: no physics.

pub mod axis;
pub mod lagrange;
