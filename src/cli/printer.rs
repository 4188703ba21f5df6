//! The one place that talks: results to standard output, messages to standard error.
//!
//! With `--quiet` only errors and the data that was asked for (JSON, CSV, `--out -`) are left. With
//! `--format json` warnings go into the JSON object, so that every stream holds one object at most.

use std::borrow::Cow;
use std::cell::RefCell;
use std::io::{self, BufWriter, IsTerminal, Write};

use serde::Serialize;

use super::args::{Colour, Common, Format};
use super::failure::{Failure, FaultEntry};
use crate::bundle::json::to_json;
use crate::design::Faults;

/// Bytes gathered before standard output is written to.
const BUFFER_BYTES: usize = 1 << 16;

/// Decides what is said, where and how.
#[derive(Debug)]
pub struct Printer {
    format: Format,
    quiet: bool,
    colour: bool,
    warnings: RefCell<Vec<String>>,
}

/// Where a summary goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Standard output.
    Output,
    /// Standard error, because standard output holds the data itself.
    Error,
}

/// A result and the warnings about it, as one JSON object.
#[derive(Debug, Serialize)]
pub struct WithWarnings<'a, T> {
    #[serde(flatten)]
    result: &'a T,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct ErrorObject {
    error: ErrorFacts,
}

#[derive(Serialize)]
struct ErrorFacts {
    code: u8,
    message: String,
    faults: Vec<FaultEntry>,
    warnings: Vec<String>,
}

impl Printer {
    /// A printer that does as the arguments say.
    #[must_use]
    pub fn new(common: &Common) -> Self {
        let colour = match common.color {
            Colour::Always => true,
            Colour::Never => false,
            Colour::Auto => {
                let no_colour = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
                !no_colour && io::stderr().is_terminal()
            }
        };
        Self {
            format: common.format,
            quiet: common.quiet,
            colour,
            warnings: RefCell::default(),
        }
    }

    /// Whether results are told as JSON.
    #[must_use]
    pub fn json(&self) -> bool {
        self.format == Format::Json
    }

    /// Whether only errors and data are told.
    #[must_use]
    pub fn quiet(&self) -> bool {
        self.quiet
    }

    /// Whether a progress bar may be drawn.
    #[must_use]
    pub fn draws(&self) -> bool {
        !self.quiet && io::stderr().is_terminal()
    }

    /// Tells a warning.
    pub fn warning(&self, message: &str) {
        if self.json() {
            self.warnings.borrow_mut().push(message.to_owned());
        } else if !self.quiet {
            let head = self.head("warning", "33");
            say(&format!("{head} {}\n", visible(message)));
        }
    }

    /// Tells the warnings about a document that was read.
    pub fn document_warnings(&self, faults: &Faults) {
        if faults.is_empty() {
        } else if self.json() {
            let lines = faults.plain();
            let lines = lines.lines().map(str::to_owned);
            self.warnings.borrow_mut().extend(lines);
        } else if !self.quiet {
            say(&faults.render(self.colour, width()));
        }
    }

    /// The warnings that go into the JSON object.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        self.warnings.borrow().clone()
    }

    /// `result` with the warnings so far, for [`Printer::summary`].
    #[must_use]
    pub fn with_warnings<'a, T>(&self, result: &'a T) -> WithWarnings<'a, T> {
        WithWarnings {
            result,
            warnings: self.warnings.borrow().clone(),
        }
    }

    /// Tells a summary: `human` for people, `json` for programs.
    ///
    /// # Errors
    /// Standard output that takes no more.
    pub fn summary(
        &self,
        place: Place,
        json: &impl Serialize,
        human: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        let text = match self.format {
            Format::Json => to_json(json)?,
            Format::Human if self.quiet => return Ok(()),
            Format::Human => visible(&human()).into_owned().into_bytes(),
        };
        match place {
            Place::Output => self.data(|out| out.write_all(&text)),
            Place::Error => {
                say(&String::from_utf8_lossy(&text));
                Ok(())
            }
        }
    }

    /// Writes data that was asked for to standard output.
    ///
    /// # Errors
    /// Standard output that takes no more.
    pub fn data(
        &self,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), Failure> {
        let mut out = BufWriter::with_capacity(BUFFER_BYTES, io::stdout().lock());
        write(&mut out)?;
        out.flush()?;
        Ok(())
    }

    /// Tells why the command did not end well.
    pub fn failure(&self, failure: &Failure) {
        if matches!(failure, Failure::PipeClosed) {
            return;
        }
        if self.json() {
            let object = ErrorObject {
                error: ErrorFacts {
                    code: failure.exit().code(),
                    message: failure.message(),
                    faults: failure.faults(),
                    warnings: self.warnings.take(),
                },
            };
            if let Ok(text) = to_json(&object) {
                say(&String::from_utf8_lossy(&text));
            }
        } else if let Failure::Documents(documents) = failure {
            for document in documents {
                say(&document.faults.render(self.colour, width()));
            }
        } else {
            let head = self.head("error", "31");
            say(&format!("{head} {}\n", visible(&failure.message())));
        }
    }

    fn head(&self, word: &str, colour: &str) -> String {
        if self.colour {
            format!("\u{1b}[1;{colour}m{word}:\u{1b}[0m")
        } else {
            format!("{word}:")
        }
    }
}

/// Writes to standard error. Where that is closed there is nobody to tell.
pub fn say(text: &str) {
    let mut text = text.to_owned();
    if !text.ends_with('\n') {
        text.push('\n');
    }
    let _ = io::stderr().lock().write_all(text.as_bytes());
}

/// The text with control characters escaped, line ends and tabs aside: what a file says must not
/// command the terminal.
fn visible(text: &str) -> Cow<'_, str> {
    let commands = |c: char| c.is_control() && c != '\n' && c != '\t';
    if !text.contains(commands) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if commands(c) {
            shown.extend(c.escape_unicode());
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

/// Columns at which messages are wrapped.
fn width() -> usize {
    let told = std::env::var("COLUMNS").ok().and_then(|c| c.parse().ok());
    told.unwrap_or(100).clamp(40, 160)
}

#[cfg(test)]
mod tests {
    use super::visible;

    #[test]
    fn what_a_file_says_does_not_command_the_terminal() {
        assert_eq!(
            visible("a\u{1b}[31mb\r\n\tc\u{7}"),
            "a\\u{1b}[31mb\\u{d}\n\tc\\u{7}"
        );
        assert_eq!(visible("ohm \u{3a9}"), "ohm \u{3a9}");
    }
}
