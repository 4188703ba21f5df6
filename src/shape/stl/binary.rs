//! Binary STL.

use std::io::{self, Read};

use crate::file_mesh::{FileMesh, Triangle};
use crate::memory;
use crate::number::F32_ROUNDING;
use crate::stl::StlError;
use crate::zeros::Zeros;

const HEADER: usize = 84;
const RECORD: usize = 50;
/// The normal comes first and is not trusted.
const NORMAL: usize = 12;
/// Records read at once from a file.
const PIECE: usize = 1 << 13;
/// Triangles that are reserved at once.
const RESERVED: usize = 1 << 22;
const SIGN: u32 = 1 << 31;

/// True when the length is what the header's count asks for.
pub(super) fn length_fits(bytes: &[u8]) -> bool {
    count(bytes).is_some_and(|n| requested(n) == bytes.len() as u64)
}

fn count(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(80..)?.first_chunk()?))
}

fn requested(count: u32) -> u64 {
    HEADER as u64 + RECORD as u64 * u64::from(count)
}

/// Reads bytes whose length fits.
pub(super) fn read(bytes: &[u8]) -> Result<FileMesh, StlError> {
    let records = &bytes[HEADER..];
    check_memory(records.len() / RECORD)?;
    let mut found = Records::with_capacity(records.len() / RECORD);
    found.add(records);
    found.mesh()
}

/// Reads a file of `length` bytes piece by piece; `None` where the length does not fit.
pub(super) fn read_from(
    mut source: impl Read,
    length: u64,
) -> io::Result<Option<Result<FileMesh, StlError>>> {
    let mut header = [0; HEADER];
    if length < HEADER as u64 {
        return Ok(None);
    }
    source.read_exact(&mut header)?;
    let Some(claimed) = count(&header).filter(|n| requested(*n) == length) else {
        return Ok(None);
    };
    let mut left = claimed as usize;
    if let Err(error) = check_memory(left) {
        return Ok(Some(Err(error)));
    }
    let mut zeros = Zeros::default();
    // The count fits the length, but a file may be longer than what was written to it.
    let mut found = Records::with_capacity(left.min(RESERVED));
    let mut piece = vec![0; RECORD * left.min(PIECE)];
    while left > 0 {
        fluxform_base::progress::poll();
        let records = left.min(PIECE);
        let piece = &mut piece[..RECORD * records];
        source.read_exact(piece)?;
        if !zeros.see(piece) {
            return Ok(Some(Err(StlError::Hole { what: zeros.what() })));
        }
        found.add(piece);
        left -= records;
    }
    Ok(Some(found.mesh()))
}

fn check_memory(triangles: usize) -> Result<(), StlError> {
    memory::check(triangles as u64).map_err(|what| StlError::Memory { what })
}

/// Triangles read so far.
struct Records {
    triangles: Vec<Triangle>,
    /// The bits of the largest magnitude: they are ordered as the numbers are, infinity and what
    /// is not a number above all.
    largest: i32,
}

impl Records {
    fn with_capacity(triangles: usize) -> Self {
        Self {
            triangles: Vec::with_capacity(triangles),
            largest: 0,
        }
    }

    /// Adds whole records.
    fn add(&mut self, records: &[u8]) {
        let (records, _) = records.as_chunks::<RECORD>();
        let mut largest = self.largest;
        self.triangles.extend(records.iter().map(|record| {
            let (words, _) = record[NORMAL..].as_chunks::<4>();
            let mut triangle = [[0.0; 3]; 3];
            for (slot, word) in triangle.as_flattened_mut().iter_mut().zip(words) {
                let value = f32::from_le_bytes(*word);
                largest = largest.max((value.to_bits() & !SIGN) as i32);
                *slot = f64::from(value);
            }
            triangle
        }));
        self.largest = largest;
    }

    fn mesh(self) -> Result<FileMesh, StlError> {
        let largest = f32::from_bits(self.largest as u32);
        if !largest.is_finite() {
            return Err(not_finite(&self.triangles));
        }
        Ok(FileMesh {
            triangles: self.triangles,
            coordinate_rounding: f64::from(largest) * F32_ROUNDING,
            ..FileMesh::default()
        })
    }
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
    if requested(swapped) == length as u64 {
        return StlError::BigEndian { count: swapped };
    }
    let there = length - HEADER;
    if requested(claimed) > length as u64 {
        return StlError::CutShort {
            claimed,
            requested: requested(claimed),
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
