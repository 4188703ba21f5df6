//! Binary STL.

use crate::shape::mesh::{FileMesh, Triangle};
use crate::shape::number::F32_ROUNDING;
use crate::shape::stl::StlError;

const HEADER: usize = 84;
const RECORD: usize = 50;
/// The normal comes first and is not trusted.
const NORMAL: usize = 12;

/// True when the length is what the header's count asks for.
pub(super) fn length_fits(bytes: &[u8]) -> bool {
    count(bytes).is_some_and(|n| wanted(n) == bytes.len() as u64)
}

fn count(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(80..)?.first_chunk()?))
}

fn wanted(count: u32) -> u64 {
    HEADER as u64 + RECORD as u64 * u64::from(count)
}

/// Reads bytes whose length fits.
pub(super) fn read(bytes: &[u8]) -> Result<FileMesh, StlError> {
    let records = &bytes[HEADER..];
    let mut triangles: Vec<Triangle> = Vec::with_capacity(records.len() / RECORD);
    let mut largest = 0.0f32;
    let mut finite = true;
    for record in records.chunks_exact(RECORD) {
        let mut triangle = [[0.0; 3]; 3];
        let vertices = record[NORMAL..NORMAL + 36].chunks_exact(4);
        for (slot, four) in triangle.as_flattened_mut().iter_mut().zip(vertices) {
            let value = f32::from_le_bytes([four[0], four[1], four[2], four[3]]);
            finite &= value.is_finite();
            largest = largest.max(value.abs());
            *slot = f64::from(value);
        }
        triangles.push(triangle);
    }
    if !finite {
        return Err(not_finite(&triangles));
    }
    Ok(FileMesh {
        triangles,
        coordinate_rounding: f64::from(largest) * F32_ROUNDING,
        ..FileMesh::default()
    })
}

/// Names the first coordinate that is not finite.
fn not_finite(triangles: &[Triangle]) -> StlError {
    let position = triangles
        .as_flattened()
        .as_flattened()
        .iter()
        .position(|c| !c.is_finite());
    let index = position.expect("the caller found one");
    let (triangle, within) = (index / 9, index % 9);
    StlError::NotFinite {
        triangle: triangle + 1,
        vertex: within / 3 + 1,
        byte: HEADER + RECORD * triangle + NORMAL + 4 * within,
        found: triangles[triangle][within / 3][within % 3].to_string(),
    }
}

/// Says why bytes that are no text are no binary STL either.
pub(super) fn fault(bytes: &[u8]) -> StlError {
    let length = bytes.len();
    let Some(claimed) = count(bytes) else {
        return StlError::NoHeader { length };
    };
    let swapped = claimed.swap_bytes();
    if wanted(swapped) == length as u64 {
        return StlError::BigEndian { count: swapped };
    }
    let there = length - HEADER;
    if wanted(claimed) > length as u64 {
        return StlError::CutShort {
            claimed,
            wanted: wanted(claimed),
            length,
            whole: there / RECORD,
            rest: there % RECORD,
        };
    }
    let end = HEADER + RECORD * claimed as usize;
    StlError::Trailing {
        claimed,
        end,
        extra: length - end,
    }
}
