//! STL files: binary or ASCII is decided by the length, never by the word `solid` alone.
//!
//! Binary: 80 bytes of header, a little-endian u32 count n, n records of 50 bytes (normal and
//! three vertices as f32, two attribute bytes). Normals and attributes are not used.

mod ascii;
mod binary;

use std::io::{self, Read};

use crate::file_mesh::FileMesh;
use crate::read_error::ReadError;
use crate::text::{narrow, starts};

/// Why bytes are no STL mesh, and where: the message of a [`ReadError`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(super) enum StlError {
    /// No byte at all.
    #[error("the file is empty (0 bytes): the export or the download failed")]
    Empty,
    /// Well formed, but without a triangle.
    #[error("the STL file holds no triangle: export a body or a surface")]
    NoTriangle,
    /// Zeros where triangles belong.
    #[error("{what}")]
    Hole {
        /// Where, and what to do.
        what: String,
    },
    /// More triangles than this run may hold.
    #[error("{what}")]
    Memory {
        /// How many, and what to do.
        what: String,
    },
    /// Blanks alone.
    #[error("this is not an STL file but blank; the export failed")]
    Blank,
    /// Too short for a header and a count.
    #[error(
        "binary STL cut short: {length} bytes, where header and triangle count alone take 84; \
         export or copy it again"
    )]
    NoHeader {
        /// Bytes in the file.
        length: usize,
    },
    /// The file ends before its last triangle.
    #[error(
        "binary STL whose header claims {claimed} triangles ({requested} bytes), but the file has \
         {length} bytes: {whole} whole triangles{}; it was cut short or the count \
         (bytes 80 to 83) is wrong; export or copy it again",
        if *rest == 0 { String::new() } else { format!(" and {rest} bytes of another") }
    )]
    CutShort {
        /// The header's count.
        claimed: u32,
        /// Bytes that such a file has.
        requested: u64,
        /// Bytes in the file.
        length: usize,
        /// Whole triangles that are there.
        whole: usize,
        /// Bytes after the last whole one.
        rest: usize,
    },
    /// The file goes on after its last triangle.
    #[error(
        "binary STL whose header claims {claimed} triangles, which end at byte {end}, but \
         {extra} bytes follow{}; the count (bytes 80 to 83) is wrong or something was appended; \
         export it again",
        if extra % 50 == 0 { format!(" (room for {} more triangles)", extra / 50) } else { String::new() }
    )]
    Trailing {
        /// The header's count.
        claimed: u32,
        /// Offset of the first byte after the triangles.
        end: usize,
        /// Bytes from there on.
        extra: usize,
    },
    /// The count fits the length only when read the other way round.
    #[error(
        "binary STL in big-endian byte order ({count} triangles by its length); STL is \
         little-endian; export it again on another program"
    )]
    BigEndian {
        /// The count, read as big-endian.
        count: u32,
    },
    /// A vertex of a binary file is NaN or infinite.
    #[error(
        "vertex {vertex} of triangle {triangle} (byte {byte}) has a coordinate that is {found}, \
         not a finite number; repair the body in the CAD program and export it again"
    )]
    NotFinite {
        /// Number of the triangle, from 1.
        triangle: usize,
        /// Number of the vertex in it, 1 to 3.
        vertex: usize,
        /// Offset of the coordinate.
        byte: usize,
        /// NaN, inf or -inf.
        found: String,
    },
    /// A fault in an ASCII file.
    #[error("line {line}{}: {what}", if *triangle == 0 { String::new() } else { format!(", triangle {triangle}") })]
    Text {
        /// Line, from 1.
        line: usize,
        /// Number of the triangle, from 1; 0 outside one.
        triangle: usize,
        /// Expectation and result.
        what: String,
    },
}

/// Reads an STL file's bytes. Nothing is allocated on the header's word.
///
/// `84 + 50 n` bytes are binary before anything else. Otherwise a text that begins with `solid`
/// is ASCII: several solids are one surface; CR, LF, CRLF, a byte-order mark, capitals and any
/// bytes in names are accepted, and a missing `endsolid` after a whole facet is a warning.
///
/// # Errors
/// [`ReadError`] with the byte or the line.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    parse(bytes).map_err(ReadError::from)
}

/// True for bytes that begin as STL files do: a count that fits the length, or `solid` and a text.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    binary::length_fits(bytes) || (starts(bytes, b"solid") && ascii::looks_like(bytes))
}

fn parse(bytes: &[u8]) -> Result<FileMesh, StlError> {
    if bytes.is_empty() {
        return Err(StlError::Empty);
    }
    if binary::length_fits(bytes) {
        return binary::read(bytes).and_then(not_empty);
    }
    let text = narrow(bytes);
    let mesh = if ascii::after_mark(&text).trim_ascii_start().is_empty() {
        return Err(StlError::Blank);
    } else if ascii::looks_like(&text) {
        ascii::read(&text)?
    } else {
        return Err(binary::fault(bytes));
    };
    not_empty(mesh)
}

/// Reads the `length` bytes of a binary STL file without holding them: the mesh or the fault is
/// that of [`read`]. `None` where the length is not that of the header's count; then `read` is to
/// see the file from its beginning.
///
/// # Errors
/// The source's own.
pub fn stream(source: impl Read, length: u64) -> io::Result<Option<Result<FileMesh, ReadError>>> {
    let result = binary::read_from(source, length)?;
    Ok(result.map(|mesh| mesh.and_then(not_empty).map_err(ReadError::from)))
}

impl From<StlError> for ReadError {
    fn from(error: StlError) -> Self {
        Self::file(error.to_string())
    }
}

fn not_empty(mesh: FileMesh) -> Result<FileMesh, StlError> {
    if mesh.triangles.is_empty() {
        Err(StlError::NoTriangle)
    } else {
        Ok(mesh)
    }
}
