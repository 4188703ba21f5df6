//! Design the coils, map the field gradients and solve the force constant of
//! a magnetic haptic display.
//!
//! The rooms, in the direction of their imports:
//! `numerics` < `design` < `field` < `coil` < `map`; `shape` beside them;
//! `lambda` on numbers alone; `bundle` writes and reads artefacts, `plot` draws; `job` joins
//! them into what a command does; `cli` is the only room that talks.

pub mod accuracy;
pub mod progress;
pub mod units;

pub mod numerics;

pub mod design;

pub mod field;

pub mod coil;
pub mod map;

pub mod shape;

pub mod lambda;

pub mod bundle;
pub mod plot;

pub mod job;

pub mod bench;

pub mod cli;
