//! Wavefront OBJ: vertices (`v`) and faces (`f`); everything else is passed over.
//!
//! Indices count from 1, negative ones back from the last vertex so far. Colours after a vertex,
//! texture and normal indices are not used. The file carries no unit.

use crate::shape::fault::{Place, ReadError};
use crate::shape::mesh::FileMesh;
use crate::shape::number::{Numbers, shown};
use crate::shape::polygon::Cutter;
use crate::shape::words::Lines;

/// Reads an OBJ file's bytes; names may be in any encoding.
///
/// # Errors
/// [`ReadError`] with the line: a number that is none, an index without a vertex, no face.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    let mut reader = Reader::default();
    let mut lines = Lines::new(bytes);
    while let Some(line) = lines.next_line() {
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

/// A face: its line, and where its indices end.
struct Face {
    line: usize,
    end: usize,
}

#[derive(Default)]
struct Reader {
    numbers: Numbers,
    vertices: Vec<[f64; 3]>,
    /// Indices of all faces, from 0.
    indices: Vec<usize>,
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
            let first = word.split(|b| *b == b'/').next().unwrap_or_default();
            let index = std::str::from_utf8(first)
                .ok()
                .and_then(|w| w.parse::<i64>().ok());
            let so_far = self.vertices.len();
            self.indices.push(match index {
                None => return Err(format!("expected an index, found `{}`", shown(word))),
                Some(0) => return Err("a face has the index 0; indices count from 1".into()),
                Some(index @ 1..) => usize::try_from(index - 1).unwrap_or(usize::MAX),
                Some(back) => {
                    let back = usize::try_from(back.unsigned_abs()).unwrap_or(usize::MAX);
                    so_far.checked_sub(back).ok_or(format!(
                        "a face has the index -{back}, but only {so_far} vertices come before it"
                    ))?
                }
            });
        }
        let end = self.indices.len();
        if end - start < 3 {
            return Err(format!(
                "a face has at least three corners; here are {}",
                end - start
            ));
        }
        self.faces.push(Face { line, end });
        Ok(())
    }

    fn mesh(self) -> Result<FileMesh, ReadError> {
        if self.faces.is_empty() {
            return Err(ReadError::file(nothing(
                self.free_form,
                self.vertices.len(),
            )));
        }
        let mut triangles = Vec::new();
        let mut cutter = Cutter::new();
        let mut corners = Vec::new();
        let mut start = 0;
        for Face { line, end } in self.faces {
            corners.clear();
            for index in &self.indices[start..end] {
                let vertex = self.vertices.get(*index).ok_or_else(|| {
                    let what = format!(
                        "a face has the index {}, but the file has {} vertices",
                        index.saturating_add(1),
                        self.vertices.len()
                    );
                    ReadError::new(Place::Line(line), what)
                })?;
                corners.push(*vertex);
            }
            cutter.cut(&corners, &mut triangles);
            start = end;
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
