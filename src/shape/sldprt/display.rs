//! The display lists of a part: tables of triangle strips, one per face, in metres.
//!
//! A table: u32 4, 8, 2, S and the lengths of S strips; u32 12, kind, 2, n and n points of three
//! f32. The lengths add up to n, which no table of another kind does by chance.

use super::ADVICE;
use crate::file_mesh::Triangle;
use crate::read_error::{Place, ReadError};

const LENGTHS: [u32; 3] = [4, 8, 2];
const POINT_BYTES: u32 = 12;
const PAIRS: u32 = 2;
/// A strip has at least one triangle.
const SHORTEST: u32 = 3;

/// All tables of the stream, in file order: one for each face of a body.
pub(super) fn tables(stream: &[u8]) -> Vec<Table> {
    let mut found = Vec::new();
    let mut at = 0;
    while at + 16 <= stream.len() {
        match table(stream, at) {
            Some(table) => {
                fluxform_base::progress::poll();
                at = table.end;
                found.push(table);
            }
            None => at += 1,
        }
    }
    found
}

/// A table of strips.
pub(super) struct Table {
    /// Offset of the first strip's length.
    lengths: usize,
    strips: usize,
    points: usize,
    end: usize,
}

/// The table that is at `at`.
fn table(stream: &[u8], at: usize) -> Option<Table> {
    if [0, 1, 2].map(|k| word(stream, at + 4 * k)) != LENGTHS.map(Some) {
        return None;
    }
    let strips = word(stream, at + 12)? as usize;
    let lengths = at + 16;
    // The lengths must be there before anything is added up.
    let points = lengths.checked_add(strips.checked_mul(4)?)?;
    if strips == 0 || points + 16 > stream.len() {
        return None;
    }
    let mut sum = 0u64;
    for k in 0..strips {
        let length = word(stream, lengths + 4 * k)?;
        if length < SHORTEST {
            return None;
        }
        sum += u64::from(length);
    }
    let head = [0, 2, 3].map(|k| word(stream, points + 4 * k));
    let count = u32::try_from(sum).ok()?;
    if head != [Some(POINT_BYTES), Some(PAIRS), Some(count)] {
        return None;
    }
    let end = (points + 16).checked_add((count as usize).checked_mul(12)?)?;
    (end <= stream.len()).then_some(Table {
        lengths,
        strips,
        points: points + 16,
        end,
    })
}

fn word(stream: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*stream.get(at..)?.first_chunk()?))
}

fn vertex(point: &[u8; 12]) -> [f64; 3] {
    let (words, _) = point.as_chunks::<4>();
    [0, 1, 2].map(|k| f64::from(f32::from_le_bytes(words[k])))
}

impl Table {
    /// Offset of the table.
    pub(super) fn start(&self) -> usize {
        self.lengths
    }

    /// Adds the table's triangles.
    pub(super) fn read(
        &self,
        stream: &[u8],
        triangles: &mut Vec<Triangle>,
    ) -> Result<(), ReadError> {
        let (points, _) = stream[self.points..self.end].as_chunks::<12>();
        let finite = |point: &[u8; 12]| vertex(point).iter().all(|c| c.is_finite());
        if !points.iter().all(finite) {
            let what =
                format!("a point of the display data is not finite; repair the body, or {ADVICE}");
            return Err(ReadError::new(Place::Byte(self.points), what));
        }
        triangles.reserve(points.len().saturating_sub(2 * self.strips));
        let mut rest = points;
        for k in 0..self.strips {
            let length = word(stream, self.lengths + 4 * k).unwrap_or_default() as usize;
            let (strip, after) = rest.split_at(length.min(rest.len()));
            rest = after;
            for (k, w) in strip.windows(3).enumerate() {
                // Every other triangle of a strip runs the other way.
                triangles.push([&w[k % 2], &w[1 - k % 2], &w[2]].map(vertex));
            }
        }
        Ok(())
    }
}
