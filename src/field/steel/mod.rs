//! The steel core of one coil.

pub mod condensation;
pub mod interior;
pub mod lobatto;
pub mod permeability;
pub mod saturated;

pub mod trace;
