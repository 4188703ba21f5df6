//! A coil's circuit against direct integration and limits, and the heat of a coil and an array.

mod array_heat;
mod transient;
mod warm_coil;
