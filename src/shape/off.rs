//! Geomview's OFF, ASCII: vertices, then faces by their corners' indices. Colours, normals and
//! texture coordinates are passed over. The file carries no unit.

use crate::file_mesh::FileMesh;
use crate::memory;
use crate::number::{Numbers, shown};
use crate::polygon::{Faces, MOST_CORNERS};
use crate::read_error::{Place, ReadError};
use crate::text::{narrow, starts};
use crate::tokens::Lines;

/// Heads of files whose vertices begin with x, y and z.
const HEADS: [&[u8]; 8] = [
    b"OFF", b"COFF", b"NOFF", b"STOFF", b"CNOFF", b"STCOFF", b"STNOFF", b"STCNOFF",
];

/// True for bytes that begin as OFF files do.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    let bytes = narrow(&bytes[..bytes.len().min(4096) & !1]);
    let mut rest = Rest(Lines::new(&bytes));
    rest.next().is_ok_and(|(_, words)| is_head(words[0]))
}

fn is_head(word: &[u8]) -> bool {
    HEADS.contains(&word)
}

/// A line's number and words.
type Line<'a> = (usize, Vec<&'a [u8]>);

/// The lines of a file without comments and blank ones.
struct Rest<'a>(Lines<'a>);

impl<'a> Rest<'a> {
    /// The next line.
    ///
    /// # Errors
    /// [`ReadError`] at the end.
    fn next(&mut self) -> Result<Line<'a>, ReadError> {
        loop {
            fluxform_base::progress::poll();
            let Some(line) = self.0.next_line() else {
                let what = "the OFF file ends before its last face: it was cut short";
                return Err(ReadError::file(what));
            };
            let words: Vec<&[u8]> = line.words().collect();
            if !words.is_empty() {
                return Ok((line.number, words));
            }
        }
    }
}

/// Reads an OFF file's bytes.
///
/// # Errors
/// [`ReadError`] with the line: counts that the file does not hold, a number or an index that is
/// none, no face.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    let bytes = narrow(bytes);
    let mut rest = Rest(Lines::new(&bytes));
    let [vertices, faces] = counts(&bytes, &mut rest)?;
    memory::check(faces as u64).map_err(ReadError::file)?;
    let mut numbers = Numbers::default();
    let mut points = Vec::with_capacity(vertices);
    for _ in 0..vertices {
        let (number, words) = rest.next()?;
        let as_fault = |what: String| ReadError::new(Place::Line(number), what);
        let [x, y, z, ..] = words[..] else {
            return Err(as_fault("a vertex has fewer than three coordinates".into()));
        };
        let mut point = [0.0; 3];
        for (slot, word) in point.iter_mut().zip([x, y, z]) {
            *slot = numbers.read(word).map_err(as_fault)?;
        }
        points.push(point);
    }
    let mut all = Faces::default();
    for _ in 0..faces {
        add_face(&mut all, vertices, &mut rest)?;
    }
    let place =
        |(line, _)| ReadError::new(Place::Line(line), "a face has an index without a vertex");
    let (triangles, _) = all.cut(&points).map_err(place)?;
    if triangles.is_empty() {
        let what = format!(
            "the OFF file holds {vertices} vertices and no face: there is no surface, only points"
        );
        return Err(ReadError::file(what));
    }
    let mut warnings = Vec::new();
    if rest.next().is_ok() {
        warnings.push(format!(
            "the OFF file goes on after the {faces} faces that it claims, and that is left out: the count is \
             wrong or something was appended; export it again"
        ));
    }
    Ok(FileMesh {
        triangles,
        coordinate_rounding: numbers.rounding(),
        warnings,
        ..FileMesh::default()
    })
}

/// The numbers of vertices and faces, after the head or on the line below it.
fn counts(bytes: &[u8], rest: &mut Rest<'_>) -> Result<[usize; 2], ReadError> {
    let (number, mut words) = rest.next()?;
    if words.get(1).is_some_and(|word| starts(word, b"BINARY")) {
        let what =
            "this OFF file is binary, which is not read: save it in ASCII, or as binary PLY or STL";
        return Err(ReadError::file(what));
    }
    if !is_head(words[0]) {
        let what = format!(
            "expected an OFF file in ASCII, which begins with `OFF`, found `{}`",
            shown(words[0])
        );
        return Err(ReadError::new(Place::Line(number), what));
    }
    words.remove(0);
    let (number, words) = match words.is_empty() {
        true => rest.next()?,
        false => (number, words),
    };
    let counts: Vec<usize> = words.iter().map_while(|word| whole(word)).collect();
    let [vertices, faces, ..] = counts[..] else {
        let what = "expected the numbers of vertices, faces and edges";
        return Err(ReadError::new(Place::Line(number), what));
    };
    // A vertex takes six bytes at least, a face eight.
    let least = vertices
        .saturating_mul(6)
        .saturating_add(faces.saturating_mul(8));
    if least > bytes.len() + 8 {
        let what = format!(
            "the file claims {vertices} vertices and {faces} faces, more than its {} bytes hold: \
             it was cut short",
            bytes.len()
        );
        return Err(ReadError::new(Place::Line(number), what));
    }
    Ok([vertices, faces])
}

/// Adds the next face, of corners among `vertices`.
fn add_face(all: &mut Faces, vertices: usize, rest: &mut Rest<'_>) -> Result<(), ReadError> {
    let (number, mut words) = rest.next()?;
    let as_fault = |what: String| ReadError::new(Place::Line(number), what);
    let corners = whole(words[0]).filter(|corners| *corners <= MOST_CORNERS);
    // Some programs break a face over lines.
    while corners.is_some_and(|corners| words.len() <= corners) {
        words.extend(rest.next()?.1);
    }
    let indices = corners.and_then(|corners| words.get(1..=corners));
    let indices = indices.ok_or_else(|| {
        as_fault(format!(
            "expected a face's number of corners, at most {MOST_CORNERS}, and as many indices"
        ))
    })?;
    for word in indices {
        let index = whole(word).filter(|index| *index < vertices);
        let index = index.ok_or_else(|| {
            as_fault(format!(
                "a face has the index `{}`, but the file has {vertices} vertices (indices \
                 count from 0)",
                shown(word)
            ))
        })?;
        all.push_index(index as u32);
    }
    all.end_face(number);
    Ok(())
}

fn whole(word: &[u8]) -> Option<usize> {
    std::str::from_utf8(word).ok()?.parse().ok()
}
