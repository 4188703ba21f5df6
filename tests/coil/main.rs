//! A coil's circuit against direct integration and limits, and the heat of an array.

mod array_heat;
mod transient;
