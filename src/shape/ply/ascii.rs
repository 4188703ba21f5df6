//! The body of an ASCII PLY file: an element a line, its numbers counted by their digits as in every text.

use ply_rs_bw::ply::{ElementDef, Header, PropertyType, ScalarType};

use super::{Body, INDICES, Read};
use crate::number::{Numbers, shown};
use crate::read_error::{Place, ReadError};
use crate::tokens::Lines;

/// Reads the elements that `header`, of so many lines, states.
///
/// # Errors
/// [`ReadError`] with the line: too few lines or numbers, a number that is none.
pub(super) fn read(header: &Header, bytes: &[u8], header_lines: usize) -> Result<Body, ReadError> {
    let mut lines = Lines::new(bytes);
    let mut numbers = Numbers::default();
    let mut body = Body {
        vertices: Vec::new(),
        faces: Read::default(),
        coordinate_rounding: 0.0,
        goes_on: false,
    };
    for (name, element) in &header.elements {
        if name == "vertex" {
            // The count was held against the file's length.
            body.vertices.reserve_exact(element.count);
        }
        for _ in 0..element.count {
            let (number, words) = next_line(&mut lines).ok_or_else(|| {
                ReadError::file(format!(
                    "the PLY file ends before its last element `{name}`: it was cut short; export or \
                     copy it again"
                ))
            })?;
            let as_fault = |what| ReadError::new(Place::Line(header_lines + number), what);
            match name.as_str() {
                "vertex" => {
                    let vertex = vertex(element, &words, &mut numbers).map_err(as_fault)?;
                    body.vertices.push(vertex);
                }
                "face" => body
                    .faces
                    .face(&indices(element, &words).map_err(as_fault)?)?,
                "tristrips" => body
                    .faces
                    .strips(&indices(element, &words).map_err(as_fault)?),
                _ => {}
            }
        }
    }
    body.goes_on = next_line(&mut lines).is_some();
    body.coordinate_rounding = numbers.rounding();
    Ok(body)
}

/// The next line that is not blank: its number, from 1, and its words.
fn next_line<'a>(lines: &mut Lines<'a>) -> Option<(usize, Vec<&'a [u8]>)> {
    loop {
        fluxform_base::progress::poll();
        let line = lines.next_line()?;
        let words: Vec<&[u8]> = line.words().collect();
        if !words.is_empty() {
            return Some((line.number, words));
        }
    }
}

/// The words of each property of an element: of a list those after their count. More words are passed over.
fn parts<'a, 'w>(
    element: &'a ElementDef,
    words: &'a [&'w [u8]],
) -> impl Iterator<Item = Result<(&'a str, &'a PropertyType, &'a [&'w [u8]]), String>> {
    let mut rest = words;
    element.properties.iter().map(move |(name, property)| {
        let few = || format!("an element `{}` has too few numbers", element.name);
        let (first, after) = rest.split_first().ok_or_else(few)?;
        let count = match &property.data_type {
            PropertyType::Scalar(_) => {
                rest = after;
                return Ok((
                    name.as_str(),
                    &property.data_type,
                    std::slice::from_ref(first),
                ));
            }
            PropertyType::List(..) => usize::try_from(whole(first)?)
                .map_err(|_| format!("a list has {} entries", shown(first)))?,
        };
        let (list, after) = after.split_at_checked(count).ok_or_else(few)?;
        rest = after;
        Ok((name.as_str(), &property.data_type, list))
    })
}

fn vertex(
    element: &ElementDef,
    words: &[&[u8]],
    numbers: &mut Numbers,
) -> Result<[f64; 3], String> {
    let mut vertex = [0.0; 3];
    for part in parts(element, words) {
        let (name, kind, words) = part?;
        let Some(k) = ["x", "y", "z"].iter().position(|axis| *axis == name) else {
            continue;
        };
        let [word] = words else {
            return Err(format!("the coordinate `{name}` is a list"));
        };
        let value = numbers.read(word)?;
        vertex[k] = match kind {
            // The nearest float is what the file's program reads.
            PropertyType::Scalar(ScalarType::Float) => f64::from(value as f32),
            _ => value,
        };
    }
    Ok(vertex)
}

/// The indices of a face's or a strip's corners.
fn indices(element: &ElementDef, words: &[&[u8]]) -> Result<Vec<i64>, String> {
    let mut found = Vec::new();
    for part in parts(element, words) {
        let (name, _, words) = part?;
        if INDICES.contains(&name) {
            found = words
                .iter()
                .map(|word| whole(word))
                .collect::<Result<_, _>>()?;
        }
    }
    Ok(found)
}

fn whole(word: &[u8]) -> Result<i64, String> {
    let value = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
    value.ok_or_else(|| format!("expected a whole number, found `{}`", shown(word)))
}
