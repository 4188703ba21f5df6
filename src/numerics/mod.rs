//! Quadrature, dense algebra, interpolation, vector dispatch, grid axes: no physics.

pub mod axis;
pub mod chebyshev;
pub mod dispatch;
pub mod double_double;
pub mod dual;
pub mod gauss;
pub mod lagrange;
pub mod laplace;
pub mod matrix;
pub mod qr;
pub mod real;
pub mod spectral;
