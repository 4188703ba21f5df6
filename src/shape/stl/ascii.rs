//! ASCII STL: one pass over the words, whatever separates the lines.

use crate::file_mesh::{FileMesh, Triangle};
use crate::number::{Numbers, shown};
use crate::stl::StlError;

/// The bytes after a UTF-8 byte-order mark.
pub(super) fn after_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// True for a text that begins with `solid`. Binary headers often do too: those show control
/// bytes at once, and no `facet` after the first line.
pub(super) fn looks_like(bytes: &[u8]) -> bool {
    let mut words = Words::new(bytes);
    let first = words.next();
    if !is(first, "solid") {
        // Some text editors' leftovers aside, only a text has no control byte.
        return is_text(bytes);
    }
    if is_text(bytes) {
        return true;
    }
    words.skip_line();
    let next = words.next();
    is(next, "facet") || is(next, "endsolid")
}

/// True when the beginning holds no byte that texts never hold.
fn is_text(bytes: &[u8]) -> bool {
    bytes[..bytes.len().min(1024)].iter().all(|b| *b >= 0x09)
}

/// Reads the whole text.
pub(super) fn read(bytes: &[u8]) -> Result<FileMesh, StlError> {
    let mut reader = Reader {
        words: Words::new(bytes),
        triangle: 0,
        numbers: Numbers::default(),
    };
    let mut triangles: Vec<Triangle> = Vec::new();
    let mut warnings = Vec::new();
    let mut solids = 0;
    while let Some(word) = reader.words.next() {
        fluxform_base::progress::poll();
        reader.triangle = 0;
        if !is(Some(word), "solid") {
            return Err(reader.unexpected("`solid`", Some(word)));
        }
        solids += 1;
        reader.words.skip_line();
        loop {
            reader.triangle = 0;
            let word = reader.words.next();
            if is(word, "facet") {
                reader.triangle = triangles.len() + 1;
                triangles.push(reader.facet()?);
            } else if is(word, "endsolid") {
                reader.words.skip_line();
                break;
            } else if word.is_none() && !triangles.is_empty() {
                warnings.push(format!(
                    "the file ends after triangle {} without `endsolid`: it may have been cut short",
                    triangles.len()
                ));
                break;
            } else {
                return Err(reader.unexpected("`facet` or `endsolid`", word));
            }
        }
    }
    if solids > 1 {
        warnings.push(format!(
            "the file holds {solids} solids; they are taken as one surface"
        ));
    }
    Ok(FileMesh {
        triangles,
        coordinate_rounding: reader.numbers.rounding(),
        warnings,
        ..FileMesh::default()
    })
}

struct Reader<'a> {
    words: Words<'a>,
    /// Number of the triangle being read, 0 outside one.
    triangle: usize,
    numbers: Numbers,
}

impl Reader<'_> {
    /// Reads the rest of a `facet` line. The normal is not trusted and not even parsed.
    fn facet(&mut self) -> Result<Triangle, StlError> {
        let mut word = self.words.next();
        if is(word, "normal") {
            for _ in 0..3 {
                word = self.words.next();
                if is(word, "outer") {
                    return Err(self.unexpected("three numbers after `normal`", word));
                }
            }
            word = self.words.next();
        }
        if !is(word, "outer") {
            return Err(self.unexpected("`outer loop`", word));
        }
        self.expect("loop")?;
        let mut triangle = [[0.0; 3]; 3];
        for vertex in &mut triangle {
            self.expect("vertex")?;
            for coordinate in vertex {
                *coordinate = self.number()?;
            }
        }
        let word = self.words.next();
        if is(word, "vertex") {
            return Err(self.fault(
                "a fourth `vertex`: STL holds triangles only; export the surface again as triangles"
                    .into(),
            ));
        }
        if !is(word, "endloop") {
            return Err(self.unexpected("`endloop`", word));
        }
        self.expect("endfacet")?;
        Ok(triangle)
    }

    fn expect(&mut self, requested: &str) -> Result<(), StlError> {
        let word = self.words.next();
        if is(word, requested) {
            Ok(())
        } else {
            Err(self.unexpected(&format!("`{requested}`"), word))
        }
    }

    fn number(&mut self) -> Result<f64, StlError> {
        let Some(word) = self.words.next() else {
            return Err(self.unexpected("a number", None));
        };
        self.numbers.read(word).map_err(|what| self.fault(what))
    }

    fn unexpected(&self, requested: &str, found: Option<&[u8]>) -> StlError {
        self.fault(match found {
            Some(word) => format!("expected {requested}, found `{}`", shown(word)),
            None => format!("expected {requested}, but the file ends here: it was cut short"),
        })
    }

    fn fault(&self, what: String) -> StlError {
        StlError::Text {
            line: self.words.line(),
            triangle: self.triangle,
            what,
        }
    }
}

fn is(word: Option<&[u8]>, requested: &str) -> bool {
    word.is_some_and(|w| w.eq_ignore_ascii_case(requested.as_bytes()))
}

/// Words between white space, and where they are.
struct Words<'a> {
    bytes: &'a [u8],
    /// First byte not yet looked at.
    at: usize,
    /// Where the last word began.
    word_at: usize,
}

impl<'a> Words<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let at = bytes.len() - after_mark(bytes).len();
        Self {
            bytes,
            at,
            word_at: at,
        }
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let blank = rest.iter().position(|b| *b > b' ').unwrap_or(rest.len());
        let word = &rest[blank..];
        let length = word.iter().position(|b| *b <= b' ').unwrap_or(word.len());
        self.word_at = self.at + blank;
        self.at = self.word_at + length;
        (length > 0).then_some(&word[..length])
    }

    /// Skips a name: everything up to the end of the line.
    fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest
            .iter()
            .position(|b| matches!(b, b'\n' | b'\r'))
            .unwrap_or(rest.len());
    }

    /// Line of the last word, from 1; counted only when a message needs it.
    fn line(&self) -> usize {
        let before = &self.bytes[..self.word_at.min(self.bytes.len())];
        let breaks = before.iter().enumerate().filter(|(i, b)| match b {
            b'\n' => true,
            b'\r' => self.bytes.get(i + 1) != Some(&b'\n'),
            _ => false,
        });
        breaks.count() + 1
    }
}
