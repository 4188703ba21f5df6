//! Error against time of every numerical stage, and time and memory against size.
//!
//! The only room beside the command line that reads a clock. Designs and reference values are
//! built into the program, so a measurement needs no file. One thread, unless threads are what is
//! measured.

pub mod clock;
pub mod memory;
pub mod pace;
pub mod stages;

mod built_in;
mod force;
mod reference;
mod wave;
