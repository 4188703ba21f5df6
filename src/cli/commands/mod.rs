//! One file a command: its arguments, and its summary for people.

pub mod bench;
pub mod calibrate;
pub mod compare;
pub mod completions;
pub mod discretize;
pub mod evaluate;
pub mod lambda;
pub mod man;
pub mod map;
pub mod optimize;
pub mod probe;
pub mod replay;
pub mod sweep;
pub mod verify;

mod describe;

use std::path::PathBuf;

use super::bar::Bar;
use super::failure::{Failure, Wish};
use super::interrupt;
use super::printer::Printer;
use super::values::FileArgument;

/// A job begins: Ctrl-C asks it to stop, a bar shows how far it is.
pub fn begin(printer: &Printer) -> Bar {
    interrupt::working();
    Bar::new(printer.draws())
}

/// The folder that `file` names.
///
/// # Errors
/// Wrong usage: a folder cannot be a standard stream.
pub fn folder(file: &FileArgument) -> Result<PathBuf, Failure> {
    match file {
        FileArgument::Path(path) => Ok(path.clone()),
        FileArgument::Standard => Err(Failure::Usage(
            "--out names a folder here, which standard output (-) is not; name a folder".to_owned(),
        )),
    }
}

/// The result is there, but `missed` names the stages whose accuracy misses the tolerance.
fn accuracy_check(missed: &[String]) -> Result<(), Failure> {
    if missed.is_empty() {
        return Ok(());
    }
    Err(Failure::Unmet(
        Wish::Accuracy,
        format!(
            "the accuracy asked for with --tolerance was not reached by {}; the result itself is given",
            missed.join("; ")
        ),
    ))
}
