//! A coil's geometry, circuit and limits; the best coil (eq. 11) and the best array.

pub mod array_heat;
pub mod array_search;
pub mod circuit;
pub mod drive;
pub mod heat;
pub mod inductance;
pub mod limits;
pub mod mutual;
pub mod optimum;
pub mod section_integrals;
pub mod transient;
