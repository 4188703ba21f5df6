//! PLY, ASCII or binary: the elements `vertex` (x, y, z) and `face` (a list of indices).
//!
//! The `ply-rs-bw` crate parses headers and binary bodies; here the header's counts are held against
//! the file's length before anything is read, and only positions and indices are kept. The file
//! carries no unit.

mod ascii;

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

use crate::file_mesh::FileMesh;
use crate::memory;
use crate::number::{F32_ROUNDING, shown};
use crate::polygon::{Faces, MOST_CORNERS};
use crate::read_error::ReadError;
use crate::text::{narrow, starts};

/// Elements that the parser makes at once: it allocates for each.
const AT_ONCE: usize = 1 << 12;

/// A header of more bytes is none that a program wrote.
const LONGEST_HEADER: usize = 1 << 20;

/// Reads a PLY file's bytes.
///
/// # Errors
/// [`ReadError`]: a header that is none or claims more than the file can hold, coordinates that
/// are not finite, an index without a vertex, points without a face.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    let bytes = narrow(bytes);
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let bytes = bytes.trim_ascii_start();
    if !bytes.starts_with(b"ply") {
        let what = format!(
            "this is not a PLY file: it begins with `{}` instead of `ply`",
            shown(&bytes[..bytes.len().min(16)])
        );
        return Err(ReadError::file(what));
    }
    let Split {
        header,
        lines,
        body,
    } = split(bytes)?;
    let header = Parser::<Skipped>::new()
        .read_header(&mut Reader::new(&mut &header[..]))
        .map_err(fault)?;
    check(&header, body.len())?;
    let faces = header.elements.get("face").map_or(0, |face| face.count);
    memory::check(faces as u64).map_err(ReadError::file)?;
    if header.encoding == Encoding::Ascii {
        let body = ascii::read(&header, body, lines)?;
        return mesh(body);
    }
    let mut rest = body;
    let mut reader = Reader::new(&mut rest);
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    let mut faces = Read::default();
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                // The count was held against the file's length.
                vertices.reserve_exact(element.count);
                each(&mut reader, element, &header, |Vertex(vertex)| {
                    vertices.push(vertex);
                    Ok(())
                })?;
            }
            "face" => each(&mut reader, element, &header, |face: Face| {
                faces.face(&face.0)
            })?,
            "tristrips" => each(&mut reader, element, &header, |strips: Face| {
                faces.strips(&strips.0);
                Ok(())
            })?,
            _ => each(&mut reader, element, &header, |_: Skipped| Ok(()))?,
        }
    }
    let largest = vertices.as_flattened().iter();
    let largest = largest.fold(0.0, |m: f64, c| m.max(c.abs()));
    let epsilon = if has_doubles(&header) {
        f64::EPSILON
    } else {
        F32_ROUNDING
    };
    mesh(Body {
        vertices,
        faces,
        coordinate_rounding: largest * epsilon,
        goes_on: !rest.trim_ascii().is_empty(),
    })
}

/// What a file holds after its header.
struct Body {
    vertices: Vec<[f64; 3]>,
    faces: Read,
    coordinate_rounding: f64,
    /// Whether there is more than the header states.
    goes_on: bool,
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
    fn face(&mut self, face: &[i64]) -> Result<(), ReadError> {
        if face.len() > MOST_CORNERS {
            return Err(ReadError::file(format!(
                "face {} (from 0) has more than {MOST_CORNERS} corners",
                self.number
            )));
        }
        self.add(face.iter().copied());
        Ok(())
    }

    /// A strip of triangles, or several with -1 between them.
    fn strips(&mut self, strips: &[i64]) {
        for strip in strips.split(|index| *index == -1) {
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
    starts(&narrow(&bytes[..bytes.len().min(64) & !1]), b"ply")
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

/// A file's header and what follows it.
struct Split<'a> {
    /// As the parser takes it.
    header: Vec<u8>,
    /// Its lines.
    lines: usize,
    body: &'a [u8],
}

/// Parts header and body. Lines end as the first one does, by LF, CRLF or CR alone; comments may be in any
/// encoding, and some programs wrote them without the word `comment`.
///
/// # Errors
/// [`ReadError`]: no end of the header.
fn split(bytes: &[u8]) -> Result<Split<'_>, ReadError> {
    let first = bytes.iter().position(|b| matches!(b, b'\n' | b'\r'));
    let end = match first {
        Some(at) if bytes[at] == b'\r' && bytes.get(at + 1) != Some(&b'\n') => b'\r',
        _ => b'\n',
    };
    let (mut header, mut lines, mut from) = (Vec::new(), 0, 0);
    for line in bytes.split_inclusive(|b| *b == end) {
        fluxform_base::progress::poll();
        lines += 1;
        from += line.len();
        let words = line.trim_ascii();
        let word = words.split(|b| *b <= b' ').next().unwrap_or_default();
        if !word.is_empty() && !HEADER.contains(&word) {
            header.extend_from_slice(b"comment ");
        }
        header.extend(words.iter().map(|b| if b.is_ascii() { *b } else { b'?' }));
        header.push(b'\n');
        if word == b"end_header" {
            let body = &bytes[from..];
            return Ok(Split {
                header,
                lines,
                body,
            });
        }
        if from > LONGEST_HEADER {
            break;
        }
    }
    Err(ReadError::file(
        "the PLY file is damaged: its header has no end (`end_header`); export or copy it again",
    ))
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

fn mesh(body: Body) -> Result<FileMesh, ReadError> {
    let Body {
        vertices,
        faces: read,
        coordinate_rounding,
        goes_on,
    } = body;
    if read.faces.is_empty() {
        return Err(ReadError::file(format!(
            "the PLY file holds {} points and no face: there is no surface; make a mesh of them \
             first",
            vertices.len()
        )));
    }
    for (number, vertex) in vertices.iter().enumerate() {
        if let Some(bad) = vertex.iter().find(|c| !c.is_finite()) {
            return Err(ReadError::file(format!(
                "vertex {number} (from 0) has a coordinate that is {bad}, not a finite number; \
                 repair the mesh and export it again"
            )));
        }
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
    let cut = read.faces.cut(&vertices);
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
    if goes_on {
        warnings.push(
            "the PLY file goes on after the elements that its header states, and that is left out: the \
             header is wrong or something was appended; export it again"
                .into(),
        );
    }
    Ok(FileMesh {
        triangles,
        coordinate_rounding,
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
