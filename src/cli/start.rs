//! How every command begins and ends: the stop signal, the bar, the folder it writes to, the accuracy reached.

use std::io::{self, Write};
use std::path::PathBuf;

use super::bar::Bar;
use super::failure::{Failure, Wish};
use super::interrupt;
use super::printer::{Printer, Stream};
use super::values::{FileArgument, TOLERANCE};
use crate::RunError;
use crate::bundle::atomic::{self, Overwrite, write};
use crate::design::message_text::shown_path;

/// A job begins: Ctrl-C asks it to stop, a bar shows how far it is.
pub fn begin(printer: &Printer) -> Bar {
    interrupt::working();
    let bar = Bar::new(printer.draws());
    printer.begins(&bar);
    bar
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

/// Writes what `content` writes where that was requested, as `overwrite` allows; returns where the summary goes.
///
/// # Errors
/// A file that is not ours; a stream that takes no more.
pub fn write_to(
    file: Option<&FileArgument>,
    overwrite: &Overwrite,
    printer: &Printer,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<Stream, Failure> {
    match file {
        None => Ok(Stream::Output),
        Some(FileArgument::Standard) => {
            printer.data(content)?;
            Ok(Stream::Error)
        }
        Some(FileArgument::Path(path)) => {
            write(path, overwrite, content).map_err(RunError::from)?;
            Ok(Stream::Output)
        }
    }
}

/// Says that a file is in place; of a stream that was said as it was written to.
pub fn is_written(file: Option<&FileArgument>, printer: &Printer) {
    if let Some(FileArgument::Path(path)) = file
        && !atomic::is_stream(path)
    {
        printer.notice(&format!("written: {}", shown_path(path)));
    }
}

/// The result is there, but `missed` names the stages whose accuracy misses the tolerance.
pub fn accuracy_check(missed: &[String]) -> Result<(), Failure> {
    if missed.is_empty() {
        return Ok(());
    }
    Err(Failure::Unmet(
        Wish::Accuracy,
        format!(
            "the tolerance (--tolerance, or the default) was not reached by {}; the result itself is given, a larger --tolerance, {} at most, accepts it",
            missed.join("; "),
            TOLERANCE.end()
        ),
    ))
}
