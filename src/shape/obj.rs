//! Wavefront OBJ: vertices (`v`) and faces (`f`); everything else is passed over.
//!
//! Indices count from 1, negative ones back from the last vertex so far. Colours after a vertex,
//! texture and normal indices are not used. The file carries no unit.

use crate::mesh::FileMesh;
use crate::number::{Numbers, shown};
use crate::polygon::{Cutter, MOST_CORNERS};
use crate::read_error::{Place, ReadError};
use crate::tokens::Lines;

/// Reads an OBJ file's bytes; names may be in any encoding.
///
/// # Errors
/// [`ReadError`] with the line: a number that is none, an index without a vertex, no face.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    let mut reader = Reader::default();
    let mut lines = Lines::new(bytes);
    while let Some(line) = lines.next_line() {
        fluxform_base::progress::poll();
        let mut words = line.words();
        let told = |what| ReadError::new(Place::Line(line.number), what);
        match words.next() {
            Some(b"v") => reader.vertex(words).map_err(told)?,
            Some(b"f" | b"fo") => reader.face(words, line.number).map_err(told)?,
            Some(b"curv" | b"curv2" | b"surf") => reader.free_form += 1,
            _ => {}
        }
    }
    reader.mesh()
}

/// A face: its line, and how many corners it has.
struct Face {
    line: u32,
    corners: u32,
}

#[derive(Default)]
struct Reader {
    numbers: Numbers,
    vertices: Vec<[f64; 3]>,
    /// Indices of all faces, from 0.
    indices: Vec<u32>,
    faces: Vec<Face>,
    free_form: usize,
}

impl Reader {
    fn vertex<'a>(&mut self, mut words: impl Iterator<Item = &'a [u8]>) -> Result<(), String> {
        let mut vertex = [0.0; 3];
        for coordinate in &mut vertex {
            let word = words.next();
            let word = word.ok_or("a vertex has three coordinates; here are fewer")?;
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
        let start = self.indices.len();
        for word in words {
            if self.indices.len() - start == MOST_CORNERS {
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
            self.indices.push(index);
        }
        let corners = self.indices.len() - start;
        if corners < 3 {
            return Err(format!(
                "a face has at least three corners; here are {corners}"
            ));
        }
        self.faces.push(Face {
            line: u32::try_from(line).unwrap_or(u32::MAX),
            corners: corners as u32,
        });
        Ok(())
    }

    fn mesh(self) -> Result<FileMesh, ReadError> {
        if self.faces.is_empty() {
            return Err(ReadError::file(nothing(
                self.free_form,
                self.vertices.len(),
            )));
        }
        let mut triangles = Vec::with_capacity(self.indices.len() - 2 * self.faces.len());
        let mut cutter = Cutter::new();
        let mut corners = Vec::new();
        let mut rest = self.indices.as_slice();
        for face in self.faces {
            let (indices, after) = rest.split_at(face.corners as usize);
            rest = after;
            corners.clear();
            for index in indices {
                let vertex = self.vertices.get(*index as usize).ok_or_else(|| {
                    let what = format!(
                        "a face has the index {}, but the file has {} vertices",
                        u64::from(*index) + 1,
                        self.vertices.len()
                    );
                    ReadError::new(Place::Line(face.line as usize), what)
                })?;
                corners.push(*vertex);
            }
            cutter.cut(&corners, &mut triangles);
        }
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
