//! Coils with steel cores: against oracles by other formulations, closed forms and physics.

// Some tests print the tables that the documentation quotes.
#![allow(clippy::print_stdout)]

mod array;
mod convergence;
mod demagnetization;
mod extremes;
mod field;
mod oracle;
mod support;
