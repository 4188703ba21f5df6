//! Arguments, commands, the printer, the progress bar and the exit codes.

pub mod args;
pub mod bar;
pub mod budget;
pub mod code;
pub mod describe;
pub mod documents;
pub mod exit;
pub mod explain;
pub mod failure;
pub mod help;
pub mod interrupt;
pub mod layout;
pub mod limits;
pub mod outlet;
pub mod pictures;
pub mod printer;
pub mod quantity;
#[doc(hidden)]
pub mod shell;
pub mod start;
pub mod terminal;
pub mod values;
