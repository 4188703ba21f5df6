//! Files that carry in their first line what they were made of: pictures, pages and designs.

use std::path::Path;

use super::documents::begins_with;
use super::failure::Failure;
use super::printer::{Place, Printer};
use super::values::FileArgument;
use crate::bundle::artefact::Input;
use crate::bundle::atomic::{Overwrite, WriteError, write};
use crate::job::JobError;

/// Writes a drawing, whole or not at all. What is there is replaced with `force`, or when it was
/// drawn of the same inputs. Tells where a summary may go besides.
///
/// # Errors
/// See [`Failure`].
pub fn write_svg(
    file: &FileArgument,
    inputs: &[Input],
    svg: &str,
    force: bool,
    printer: &Printer,
) -> Result<Place, Failure> {
    write_marked(file, inputs, svg, force, printer)
}

/// Writes a page, as [`write_svg`] writes a drawing.
///
/// # Errors
/// See [`Failure`].
pub fn write_page(
    file: &FileArgument,
    inputs: &[Input],
    html: &str,
    force: bool,
    printer: &Printer,
) -> Result<Place, Failure> {
    write_marked(file, inputs, html, force, printer)
}

fn write_marked(
    file: &FileArgument,
    inputs: &[Input],
    text: &str,
    force: bool,
    printer: &Printer,
) -> Result<Place, Failure> {
    let digests: Vec<&str> = inputs.iter().map(|input| input.sha256.as_str()).collect();
    let mark = format!("<!-- fluxform, drawn of {} -->\n", digests.join(" "));
    let path = match file {
        FileArgument::Standard => {
            printer.data(|out| out.write_all(text.as_bytes()))?;
            return Ok(Place::Error);
        }
        FileArgument::Path(path) => path,
    };
    check_target(path, &mark, force, "and was not drawn of these inputs")?;
    write(path, &Overwrite::Force, |out| {
        out.write_all(mark.as_bytes())?;
        out.write_all(text.as_bytes())
    })
    .map_err(JobError::from)?;
    Ok(Place::Output)
}

/// An existing file is replaced with `force`, or when it begins with `mark`.
///
/// # Errors
/// [`WriteError::OutputExists`] with the reason.
pub fn check_target(path: &Path, mark: &str, force: bool, reason: &str) -> Result<(), Failure> {
    if force || !path.is_file() || begins_with(path, mark) {
        return Ok(());
    }
    Err(JobError::from(WriteError::OutputExists {
        path: path.to_owned(),
        reason: reason.to_owned(),
    })
    .into())
}
