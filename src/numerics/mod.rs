//! Quadrature, ordered sums, small dense algebra, interpolation: no physics.

pub mod axis;
pub mod double_double;
pub mod qr;
pub mod real;
