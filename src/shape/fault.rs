//! Why a surface file's content is no mesh, and where.

use std::fmt;

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
    /// What was expected, what was found and what to do.
    pub what: String,
}

impl ReadError {
    /// A fault at `place`.
    pub(super) fn new(place: Place, what: impl Into<String>) -> Self {
        Self {
            place,
            what: what.into(),
        }
    }

    /// A fault of the whole file.
    pub(super) fn file(what: impl Into<String>) -> Self {
        Self::new(Place::File, what)
    }
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
