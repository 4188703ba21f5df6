//! Files that carry in their first line what they were made of: pictures, pages and designs.
//!
//! Nothing lists such a file with its digest. One that is there is replaced with `--force`; a run that
//! makes the same bytes again leaves it.

use std::io::{self, Write};
use std::path::PathBuf;

use super::documents::DesignDocument;
use super::failure::Failure;
use super::printer::{Printer, Stream};
use super::start::is_written;
use super::values::FileArgument;
use crate::RunError;
use crate::bundle::artefact::Input;
use crate::bundle::atomic::{self, FileSet, Overwrite, check_distinct, write};
use crate::design::message_text::shown_path;
use crate::plot::drawing::{Drawing, DrawingFormat};

/// How the first line of a drawing or a page begins.
const MARK: &str = "<!-- fluxform, drawn of ";

/// Standard output takes the table or the drawing.
///
/// # Errors
/// Wrong usage: both.
pub fn table_or_drawing(out: &FileArgument, plot: Option<&FileArgument>) -> Result<(), Failure> {
    if out.is_standard() && plot.is_some_and(FileArgument::is_standard) {
        return Err(Failure::Usage(
            "--out and --plot both go to standard output (-); name a file for one of them"
                .to_owned(),
        ));
    }
    Ok(())
}

/// The drawings of a command that makes several, each checked before the run.
///
/// # Errors
/// Two that go to one place; see [`Picture::check`].
pub fn checked<'a, const COUNT: usize>(
    files: [Option<&'a FileArgument>; COUNT],
    force: bool,
    document: &DesignDocument,
) -> Result<[Option<Picture<'a>>; COUNT], Failure> {
    let given = files.iter().flatten();
    if given
        .filter(|file| matches!(file, FileArgument::Standard))
        .count()
        > 1
    {
        let wrong = "only one drawing can go to standard output (-)";
        return Err(Failure::Usage(wrong.to_owned()));
    }
    check_distinct(files.iter().flatten().map(|file| file.as_given())).map_err(RunError::from)?;
    let pictures =
        files.map(|file| file.map(|file| Picture::new(file, force, document.also_read())));
    for picture in pictures.iter().flatten() {
        picture.check(std::slice::from_ref(&document.input))?;
    }
    Ok(pictures)
}

/// What a file holds: the line that states what it was made of, where it is a text, and the rest.
struct Content {
    mark: String,
    bytes: Vec<u8>,
}

impl Content {
    fn of_text(inputs: &[Input], text: &str) -> Self {
        let digests: Vec<&str> = inputs.iter().map(|input| input.sha256.as_str()).collect();
        Self {
            mark: format!("{MARK}{} -->\n", digests.join(" ")),
            bytes: text.into(),
        }
    }

    fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(self.mark.as_bytes())?;
        out.write_all(&self.bytes)
    }
}

/// A drawing or a page that a run is to make, and what of its files it must not replace.
#[derive(Debug)]
pub struct Picture<'a> {
    file: &'a FileArgument,
    force: bool,
    protected: Vec<PathBuf>,
}

impl<'a> Picture<'a> {
    /// The one that goes to `file`. `protected` are files that the run also reads or writes, and that
    /// are not among its inputs.
    pub fn new<P: Into<PathBuf>>(
        file: &'a FileArgument,
        force: bool,
        protected: impl IntoIterator<Item = P>,
    ) -> Self {
        Self {
            file,
            force,
            protected: protected.into_iter().map(Into::into).collect(),
        }
    }

    /// Refuses before a long run what will not be replaced, as far as its inputs are known.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn check(&self, inputs: &[Input]) -> Result<(), Failure> {
        match self.file {
            FileArgument::Standard => Ok(()),
            FileArgument::Path(path) if atomic::is_stream(path) => Ok(()),
            FileArgument::Path(path) => {
                // Text alone states what it was drawn of.
                let mark = match self.format() {
                    DrawingFormat::Svg => MARK,
                    DrawingFormat::Png | DrawingFormat::Pdf => "",
                };
                let overwrite = self.overwrite(mark, inputs);
                Ok(overwrite.check(path).map_err(RunError::from)?)
            }
        }
    }

    /// Draws it in the format that its ending names. Returns where a summary may still go.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn draw(
        &self,
        inputs: &[Input],
        drawing: &Drawing,
        printer: &Printer,
    ) -> Result<Stream, Failure> {
        let content = self.drawn(inputs, drawing)?;
        self.put(inputs, &content, printer)
    }

    /// As [`Self::draw`], the file one of `set`, which puts it in place.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn draw_into(
        &self,
        set: &mut FileSet,
        inputs: &[Input],
        drawing: &Drawing,
        printer: &Printer,
    ) -> Result<Stream, Failure> {
        let content = self.drawn(inputs, drawing)?;
        self.put_into(set, inputs, &content, printer)
    }

    /// Writes a text, whole or not at all. Returns where a summary may still go.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn write(
        &self,
        inputs: &[Input],
        text: &str,
        printer: &Printer,
    ) -> Result<Stream, Failure> {
        self.put(inputs, &Content::of_text(inputs, text), printer)
    }

    /// As [`Self::write`], the file one of `set`, which puts it in place.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn write_into(
        &self,
        set: &mut FileSet,
        inputs: &[Input],
        text: &str,
        printer: &Printer,
    ) -> Result<Stream, Failure> {
        self.put_into(set, inputs, &Content::of_text(inputs, text), printer)
    }

    fn drawn(&self, inputs: &[Input], drawing: &Drawing) -> Result<Content, Failure> {
        Ok(match self.format() {
            DrawingFormat::Svg => Content::of_text(inputs, &drawing.svg()),
            format => Content {
                mark: String::new(),
                bytes: drawing.bytes(format).map_err(Failure::Input)?,
            },
        })
    }

    fn put(
        &self,
        inputs: &[Input],
        content: &Content,
        printer: &Printer,
    ) -> Result<Stream, Failure> {
        let path = match self.file {
            FileArgument::Standard => {
                printer.data(|out| out.write_all(&content.bytes))?;
                return Ok(Stream::Error);
            }
            FileArgument::Path(path) => path,
        };
        write(path, &self.overwrite(&content.mark, inputs), |out| {
            content.write(out)
        })
        .map_err(RunError::from)?;
        printer.notice(&format!("written: {}", shown_path(path)));
        Ok(Stream::Output)
    }

    fn put_into(
        &self,
        set: &mut FileSet,
        inputs: &[Input],
        content: &Content,
        printer: &Printer,
    ) -> Result<Stream, Failure> {
        match self.file {
            FileArgument::Path(path) if !atomic::is_stream(path) => {
                let overwrite = self.overwrite(&content.mark, inputs);
                set.write_under(path, overwrite, Box::new(|out| content.write(out)))
                    .map_err(RunError::from)?;
                Ok(Stream::Output)
            }
            FileArgument::Standard | FileArgument::Path(_) => self.put(inputs, content, printer),
        }
    }

    /// Says that its file is in place; of a stream that was said as it was written to.
    pub fn is_written(&self, printer: &Printer) {
        is_written(Some(self.file), printer);
    }

    /// By the file's ending; pages, which have their own, are texts as SVG is.
    fn format(&self) -> DrawingFormat {
        let ending = self.file.as_given().extension();
        let named = ending.and_then(|ending| DrawingFormat::of(ending.to_str()?));
        named.unwrap_or(DrawingFormat::Svg)
    }

    fn overwrite(&self, mark: &str, inputs: &[Input]) -> Overwrite {
        Overwrite::beginning(self.force, mark, inputs).protecting(self.protected.iter())
    }
}
