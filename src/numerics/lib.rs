//! Quadrature, dense algebra, interpolation, vector dispatch, grid axes: no physics.

pub mod anderson;
pub mod axis;
pub mod bessel;
pub mod chebyshev;
pub mod dispatch;
pub mod double_double;
pub mod dual;
pub mod gauss;
pub mod gmres;
pub mod interval;
pub mod lagrange;
pub mod lagrange_basis;
pub mod laplace;
pub mod least_squares;
pub mod log_rule;
pub mod matrix;
pub mod mixed_search;
pub mod qr;
pub mod quadratic_program;
pub mod random;
pub mod real;
pub mod refinement;
pub mod ring_functions;
pub mod small_quadratic;
pub mod spectral;
pub mod vec3;
