//! Why a surface file's content is no mesh, and where.

use std::fmt;

/// Characters of either end of a message that are kept.
const LONGEST_HALF: usize = 400;

/// Where in a file a fault lies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line, from 1.
    Line(usize),
    /// An offset, from 0.
    Byte(usize),
    /// A part of an archive, and a line of it, from 1; 0 for all of it.
    Part(String, usize),
}

/// A fault in a surface file's content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadError {
    /// Where it lies.
    pub place: Place,
    /// Expectation, result and advice.
    pub what: String,
}

impl ReadError {
    /// A fault at `place`.
    pub(super) fn new(place: Place, what: impl Into<String>) -> Self {
        let place = match place {
            Place::Part(name, line) => Place::Part(shortened(name), line),
            other => other,
        };
        Self {
            place,
            what: shortened(what.into()),
        }
    }

    /// A fault of the whole file.
    pub(super) fn file(what: impl Into<String>) -> Self {
        Self::new(Place::File, what)
    }
}

/// A message may quote names of any length from the file: the middle of a long one is left out,
/// the advice at its end is kept.
fn shortened(text: String) -> String {
    let chars = text.chars().count();
    if chars <= 2 * LONGEST_HALF {
        return text;
    }
    let start: String = text.chars().take(LONGEST_HALF).collect();
    let end: String = text.chars().skip(chars - LONGEST_HALF).collect();
    format!("{start} ... {end}")
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Place::File => {}
            Place::Line(line) => write!(f, "line {line}: ")?,
            Place::Byte(byte) => write!(f, "byte {byte}: ")?,
            Place::Part(part, 0) => write!(f, "part `{part}`: ")?,
            Place::Part(part, line) => write!(f, "part `{part}`, line {line}: ")?,
        }
        f.write_str(&self.what)
    }
}

impl std::error::Error for ReadError {}
