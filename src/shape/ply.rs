//! PLY, ASCII or binary: the elements `vertex` (x, y, z) and `face` (a list of indices).
//!
//! The `ply-rs-bw` crate parses; here the header's counts are held against the file's length
//! before anything is read, and only positions and indices are kept. The file carries no unit.

use std::borrow::Cow;
use std::io::BufRead;

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

use crate::file_mesh::FileMesh;
use crate::number::{F32_ROUNDING, shown};
use crate::polygon::{Faces, MOST_CORNERS};
use crate::read_error::ReadError;

/// Elements that the parser makes at once: it allocates for each.
const AT_ONCE: usize = 1 << 12;

/// Reads a PLY file's bytes.
///
/// # Errors
/// [`ReadError`]: a header that is none or claims more than the file can hold, coordinates that
/// are not finite, an index without a vertex, points without a face.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    let first = bytes.trim_ascii_start();
    if !begins(bytes) {
        let what = format!(
            "this is not a PLY file: it begins with `{}` instead of `ply`",
            shown(&first[..first.len().min(16)])
        );
        return Err(ReadError::file(what));
    }
    let bytes = plain_header(bytes);
    let mut rest: &[u8] = &bytes;
    let mut reader = Reader::new(&mut rest);
    let header = Parser::<Skipped>::new()
        .read_header(&mut reader)
        .map_err(fault)?;
    let length = reader.get_mut().fill_buf().map_or(0, <[u8]>::len);
    check(&header, length)?;
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut faces = Read::default();
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                // The count was held against the file's length.
                vertices.reserve_exact(element.count);
                each(&mut reader, element, &header, |vertex| {
                    vertices.push(vertex);
                    Ok(())
                })?;
            }
            "face" => each(&mut reader, element, &header, |face: Face| {
                faces.face(&face)
            })?,
            "tristrips" => each(&mut reader, element, &header, |strips: Face| {
                faces.strips(&strips);
                Ok(())
            })?,
            _ => each(&mut reader, element, &header, |_: Skipped| Ok(()))?,
        }
    }
    mesh(&header, &vertices, &faces)
}

/// Reads an element's entries, some at a time.
fn each<E: PropertyAccess>(
    reader: &mut Reader<&mut &[u8]>,
    element: &ElementDef,
    header: &Header,
    mut take: impl FnMut(E) -> Result<(), ReadError>,
) -> Result<(), ReadError> {
    let mut some = element.clone();
    let mut left = element.count;
    while left > 0 {
        fluxform_base::progress::poll();
        some.count = left.min(AT_ONCE);
        left -= some.count;
        let read = Parser::new().read_payload_for_element(reader, &some, header);
        for entry in read.map_err(fault)? {
            take(entry)?;
        }
    }
    Ok(())
}

/// Faces and strips as read.
#[derive(Default)]
struct Read {
    faces: Faces,
    /// How many there are.
    number: usize,
    /// The first face with an index that no vertex can have, and that.
    astray: Option<(usize, i64)>,
}

impl Read {
    fn face(&mut self, face: &Face) -> Result<(), ReadError> {
        if face.0.len() > MOST_CORNERS {
            return Err(ReadError::file(format!(
                "face {} (from 0) has more than {MOST_CORNERS} corners",
                self.number
            )));
        }
        self.add(face.0.iter().copied());
        Ok(())
    }

    /// A strip of triangles, or several with -1 between them.
    fn strips(&mut self, strips: &Face) {
        for strip in strips.0.split(|index| *index == -1) {
            for (k, w) in strip.windows(3).enumerate() {
                // Every other triangle of a strip runs the other way.
                let corners = [w[k % 2], w[1 - k % 2], w[2]];
                // Strips are joined by triangles without area.
                if corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0]
                {
                    self.add(corners.into_iter());
                }
            }
        }
    }

    fn add(&mut self, corners: impl Iterator<Item = i64>) {
        for index in corners {
            let known = u32::try_from(index);
            if known.is_err() {
                self.astray.get_or_insert((self.number, index));
            }
            self.faces.push_index(known.unwrap_or(u32::MAX));
        }
        self.faces.end_face(self.number);
        self.number += 1;
    }
}

/// True for bytes that begin as PLY files do.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    bytes.trim_ascii_start().starts_with(b"ply")
}

/// First words of a header's lines.
const HEADER: [&[u8]; 7] = [
    b"ply",
    b"format",
    b"comment",
    b"obj_info",
    b"element",
    b"property",
    b"end_header",
];

/// The file with a header that the parser takes: comments may be in any encoding, and some
/// programs wrote them without the word `comment`.
fn plain_header(bytes: &[u8]) -> Cow<'_, [u8]> {
    let mark = b"end_header";
    let end = bytes.windows(mark.len()).position(|w| w == mark);
    let header = &bytes[..end.unwrap_or(bytes.len())];
    let first = |line: &[u8]| {
        let word = line.trim_ascii_start().split(|b| *b <= b' ').next();
        word.unwrap_or_default().to_vec()
    };
    let known = |line: &[u8]| {
        let word = first(line);
        word.is_empty() || HEADER.contains(&word.as_slice())
    };
    let lines = || header.split_inclusive(|b| matches!(b, b'\n' | b'\r'));
    if end.is_none() || (header.is_ascii() && lines().all(known)) {
        return Cow::Borrowed(bytes);
    }
    let mut copy = Vec::with_capacity(bytes.len() + 64);
    for line in lines() {
        if !known(line) {
            copy.extend_from_slice(b"comment ");
        }
        let plain = |b: &u8| if b.is_ascii() { *b } else { b'?' };
        copy.extend(line.iter().map(plain));
    }
    copy.extend_from_slice(&bytes[header.len()..]);
    Cow::Owned(copy)
}

fn fault(error: ParseError) -> ReadError {
    // The parser quotes the whole line and shows its inner errors as Rust does: only its first
    // sentences are for the user.
    let text = error.to_string();
    let text: Vec<&str> = text.split_whitespace().collect();
    let mut what = text.join(" ");
    what.truncate(what.find(" Error: ").unwrap_or(what.len()));
    if let Some((at, _)) = what.char_indices().nth(200) {
        what.truncate(at);
        what.push_str("...");
    }
    ReadError::file(format!("the PLY file is damaged: {what}"))
}

/// Holds the header's claims against the bytes that follow it.
fn check(header: &Header, length: usize) -> Result<(), ReadError> {
    let mut least = 0u128;
    for (name, element) in &header.elements {
        if element.properties.is_empty() && element.count > 0 {
            let what = format!("the header's element `{name}` has no property");
            return Err(ReadError::file(what));
        }
        let one: u128 = element
            .properties
            .iter()
            .map(
                |(_, property)| match (&header.encoding, &property.data_type) {
                    // A digit and what separates it from the next.
                    (Encoding::Ascii, _) => 2,
                    (_, PropertyType::Scalar(kind) | PropertyType::List(kind, _)) => size(kind),
                },
            )
            .sum();
        least += element.count as u128 * one;
        // The last digit of a text need not be followed by anything.
        if least > length as u128 + 1 {
            return Err(ReadError::file(format!(
                "the PLY header claims {} elements `{name}`; up to them that takes at least \
                 {least} bytes, but {length} follow the header: the file was cut short or its \
                 header is wrong",
                element.count
            )));
        }
    }
    let property = |element: &str, names: &[&str]| {
        let found = header.elements.iter().find(|(name, _)| *name == element);
        found.is_some_and(|(_, element): (_, &ElementDef)| {
            let known =
                |requested: &&str| element.properties.iter().any(|(name, _)| name == requested);
            names.iter().any(known)
        })
    };
    if !["x", "y", "z"].iter().all(|k| property("vertex", &[k])) {
        let what = "the PLY file has no element `vertex` with the properties x, y and z";
        return Err(ReadError::file(what));
    }
    if !property("face", &INDICES) && !property("tristrips", &INDICES) {
        let what = "the PLY file has no element `face` with a list `vertex_indices`: there is no \
                    surface, only points; make a mesh of them first";
        return Err(ReadError::file(what));
    }
    Ok(())
}

const INDICES: [&str; 2] = ["vertex_indices", "vertex_index"];

fn size(kind: &ScalarType) -> u128 {
    match kind {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

fn mesh(header: &Header, vertices: &[Vertex], read: &Read) -> Result<FileMesh, ReadError> {
    if read.faces.is_empty() {
        return Err(ReadError::file(format!(
            "the PLY file holds {} points and no face: there is no surface; make a mesh of them \
             first",
            vertices.len()
        )));
    }
    let mut largest = 0.0f64;
    for (number, Vertex(vertex)) in vertices.iter().enumerate() {
        if let Some(bad) = vertex.iter().find(|c| !c.is_finite()) {
            return Err(ReadError::file(format!(
                "vertex {number} (from 0) has a coordinate that is {bad}, not a finite number; \
                 repair the mesh and export it again"
            )));
        }
        largest = vertex.iter().fold(largest, |m, c| m.max(c.abs()));
    }
    let without_vertex = |number: usize, index: i64| {
        ReadError::file(format!(
            "face {number} (from 0) has the index {index}, but the file has {} vertices (indices \
             count from 0)",
            vertices.len()
        ))
    };
    if let Some((number, index)) = read.astray {
        return Err(without_vertex(number, index));
    }
    let points: Vec<[f64; 3]> = vertices.iter().map(|vertex| vertex.0).collect();
    let cut = read.faces.cut(&points);
    let (triangles, short) =
        cut.map_err(|(number, index)| without_vertex(number, i64::from(index)))?;
    if triangles.is_empty() {
        let what = "no face of the PLY file has three corners: there is no surface";
        return Err(ReadError::file(what));
    }
    let mut warnings = Vec::new();
    if short > 0 {
        warnings.push(format!(
            "{short} faces with fewer than three corners are left out"
        ));
    }
    // How many digits a text has is not known here; as a rule they were floats.
    let double = header.encoding != Encoding::Ascii && has_doubles(header);
    let epsilon = if double { f64::EPSILON } else { F32_ROUNDING };
    Ok(FileMesh {
        triangles,
        coordinate_rounding: largest * epsilon,
        warnings,
        ..FileMesh::default()
    })
}

fn has_doubles(header: &Header) -> bool {
    let double = PropertyType::Scalar(ScalarType::Double);
    header
        .elements
        .iter()
        .filter(|(name, _)| *name == "vertex")
        .any(|(_, element)| {
            let mut properties = element.properties.iter();
            properties.any(|(name, p)| name == "x" && p.data_type == double)
        })
}

/// x, y, z.
struct Vertex([f64; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([0.0; 3])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let k = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
        };
        self.0[k] = match property {
            Property::Char(v) => v.into(),
            Property::UChar(v) => v.into(),
            Property::Short(v) => v.into(),
            Property::UShort(v) => v.into(),
            Property::Int(v) => v.into(),
            Property::UInt(v) => v.into(),
            Property::Float(v) => v.into(),
            Property::Double(v) => v,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// Indices of a face's corners, as they are in the file.
struct Face(Vec<i64>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        fn all<T: Copy + Into<i64>>(list: &[T]) -> Vec<i64> {
            list.iter().map(|v| (*v).into()).collect()
        }
        if !INDICES.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match &property {
            Property::ListChar(v) => all(v),
            Property::ListUChar(v) => all(v),
            Property::ListShort(v) => all(v),
            Property::ListUShort(v) => all(v),
            Property::ListInt(v) => all(v),
            Property::ListUInt(v) => all(v),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// An element of which nothing is kept.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}
