//! Wavefront OBJ: vertices (`v`) and faces (`f`); everything else is passed over.
//!
//! Indices count from 1, negative ones back from the last vertex so far. Colours after a vertex,
//! texture and normal indices are not used. The file carries no unit.

use crate::file_mesh::FileMesh;
use crate::number::{Numbers, shown};
use crate::polygon::{Faces, MOST_CORNERS};
use crate::read_error::{Place, ReadError};
use crate::text::narrow;
use crate::tokens::Lines;

/// First words of lines that OBJ files begin with.
const FIRST: [&[u8]; 7] = [b"v", b"vn", b"vt", b"o", b"g", b"mtllib", b"usemtl"];

/// True for a text whose first line that is no comment is one of an OBJ file.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    let bytes = narrow(&bytes[..bytes.len().min(4096) & !1]);
    let mut lines = Lines::new(&bytes);
    let mut first = None;
    while let (None, Some(line)) = (first, lines.next_line()) {
        first = line.words().next();
    }
    first.is_some_and(|first| FIRST.contains(&first))
}

/// Reads an OBJ file's bytes; names may be in any encoding.
///
/// # Errors
/// [`ReadError`] with the line: a number that is none, an index without a vertex, no face.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    let mut reader = Reader::default();
    let bytes = narrow(bytes);
    let mut lines = Lines::new(&bytes);
    while let Some(line) = lines.next_line() {
        fluxform_base::progress::poll();
        let mut words = line.words();
        let as_fault = |what| ReadError::new(Place::Line(line.number), what);
        match words.next() {
            Some(b"v") => reader.vertex(words).map_err(as_fault)?,
            Some(b"f" | b"fo") => reader.face(words, line.number).map_err(as_fault)?,
            Some(b"curv" | b"curv2" | b"surf") => reader.free_form += 1,
            _ => {}
        }
    }
    reader.mesh()
}

#[derive(Default)]
struct Reader {
    numbers: Numbers,
    vertices: Vec<[f64; 3]>,
    faces: Faces,
    free_form: usize,
}

impl Reader {
    fn vertex<'a>(&mut self, mut words: impl Iterator<Item = &'a [u8]>) -> Result<(), String> {
        let mut vertex = [0.0; 3];
        for coordinate in &mut vertex {
            let word = words.next();
            let word = word.ok_or("a vertex has fewer than three coordinates")?;
            *coordinate = self.numbers.read(word)?;
        }
        self.vertices.push(vertex);
        Ok(())
    }

    fn face<'a>(
        &mut self,
        words: impl Iterator<Item = &'a [u8]>,
        line: usize,
    ) -> Result<(), String> {
        for word in words {
            if self.faces.corners() == MOST_CORNERS {
                return Err(format!("a face has more than {MOST_CORNERS} corners"));
            }
            let first = word.split(|b| *b == b'/').next().unwrap_or_default();
            let index = std::str::from_utf8(first)
                .ok()
                .and_then(|w| w.parse::<i64>().ok());
            let so_far = self.vertices.len();
            let index = match index {
                None => return Err(format!("expected an index, found `{}`", shown(word))),
                Some(0) => return Err("a face has the index 0; indices count from 1".into()),
                Some(index @ 1..) => u32::try_from(index - 1).map_err(|_| {
                    format!("a face has the index {index}: no file has so many vertices")
                })?,
                Some(back) => {
                    let back = usize::try_from(back.unsigned_abs()).unwrap_or(usize::MAX);
                    let index = so_far.checked_sub(back).ok_or_else(|| {
                        format!(
                            "a face has the index -{back}, but only {so_far} vertices come \
                             before it"
                        )
                    })?;
                    u32::try_from(index).map_err(|_| "the file has too many vertices")?
                }
            };
            self.faces.push_index(index);
        }
        let corners = self.faces.corners();
        if corners < 3 {
            return Err(format!(
                "a face of {corners} corners, expected three or more"
            ));
        }
        self.faces.end_face(line);
        Ok(())
    }

    fn mesh(self) -> Result<FileMesh, ReadError> {
        if self.faces.is_empty() {
            return Err(ReadError::file(nothing(
                self.free_form,
                self.vertices.len(),
            )));
        }
        let (triangles, _) = self.faces.cut(&self.vertices).map_err(|(line, index)| {
            let what = format!(
                "a face has the index {}, but the file has {} vertices",
                u64::from(index) + 1,
                self.vertices.len()
            );
            ReadError::new(Place::Line(line), what)
        })?;
        let mut warnings = Vec::new();
        if self.free_form > 0 {
            warnings.push(format!(
                "{} free-form curves and surfaces are left out: only faces (`f`) are read",
                self.free_form
            ));
        }
        Ok(FileMesh {
            triangles,
            coordinate_rounding: self.numbers.rounding(),
            warnings,
            ..FileMesh::default()
        })
    }
}

fn nothing(free_form: usize, vertices: usize) -> String {
    if free_form > 0 {
        "the OBJ file holds free-form surfaces and no face (`f`): export it as triangles".into()
    } else if vertices > 0 {
        format!(
            "the OBJ file holds {vertices} vertices and no face (`f`): there is no surface, \
             only points; export it with its faces"
        )
    } else {
        "this is not an OBJ file with a surface: it has neither vertices (`v`) nor faces (`f`)"
            .into()
    }
}
