//! The measurements themselves: rows fall along their knobs, tables and JSON are as promised, the catalogue
//! of extreme cases passes, and what stages claim of their errors holds on scenes that nobody chose.

// Figures are printed, and a script is put where the command looks for one.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

mod command;
mod coverage;
mod extreme;
mod page;
mod rows;
