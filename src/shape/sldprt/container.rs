//! The container of SOLIDWORKS files since 2015: named blocks of raw DEFLATE data.
//!
//! A block: the marker, five little-endian u32 (type, CRC-32 and lengths of the data, length of
//! the name), the name with its nibbles swapped, the data. Near the end of the file a directory
//! repeats the headers; it is not used.

use std::io::Read;

use flate2::read::DeflateDecoder;

use super::ADVICE;
use crate::read_error::{Place, ReadError};

const SIGN: [u8; 4] = [0, 0, 0, 4];
const MARKER: [u8; 6] = [0x14, 0, 0x06, 0, 0x08, 0];
const HEADER: usize = MARKER.len() + 20;
const LONGEST_NAME: usize = 1024;
/// So many bytes may be unpacked from any block,
const LEAST_BUDGET: u64 = 4 << 20;
/// or so many times its length: coordinates hardly shrink to a tenth.
const MOST_RATIO: u64 = 200;
/// So many times its length is reserved on the word of its header.
const RESERVED_RATIO: u64 = 8;
/// Larger display data belong to no part.
const MOST_BYTES: u64 = 2 << 30;

/// A block's header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) name: String,
    /// Offset of the header.
    at: usize,
    /// Offset of the data.
    start: usize,
    crc: u32,
    packed: usize,
    unpacked: u32,
}

/// The blocks of a file, in file order.
pub(super) fn blocks(bytes: &[u8]) -> Result<Vec<Block>, ReadError> {
    if bytes.get(4..8) != Some(&SIGN) {
        return Err(ReadError::new(
            Place::Byte(4),
            format!("this is no SOLIDWORKS part of 2015 or later (its sign is missing): {ADVICE}"),
        ));
    }
    let mut found = Vec::new();
    let mut at = 8;
    while let Some(step) = position(&bytes[at..]) {
        at += step;
        match block(bytes, at) {
            Some(block) => {
                at = block.start + block.packed;
                found.push(block);
            }
            None => at += 1,
        }
    }
    if found.is_empty() {
        let what = format!("the SOLIDWORKS file holds no block of data: {ADVICE}");
        return Err(ReadError::file(what));
    }
    Ok(found)
}

fn position(bytes: &[u8]) -> Option<usize> {
    let mut from = 0;
    loop {
        from += bytes[from..].iter().position(|b| *b == MARKER[0])?;
        if bytes[from..].starts_with(&MARKER) {
            return Some(from);
        }
        from += 1;
    }
}

/// The block whose marker stands at `at`; `None` where chance put the marker there.
fn block(bytes: &[u8], at: usize) -> Option<Block> {
    let word = |k: usize| {
        let from = at + MARKER.len() + 4 * k;
        Some(u32::from_le_bytes(*bytes.get(from..)?.first_chunk()?))
    };
    let (crc, packed, unpacked, length) = (word(1)?, word(2)?, word(3)?, word(4)? as usize);
    if length == 0 || length > LONGEST_NAME {
        return None;
    }
    let name = bytes.get(at + HEADER..)?.get(..length)?;
    let name: Vec<u8> = name.iter().map(|b| b.rotate_left(4)).collect();
    let name = String::from_utf8(name).ok()?;
    let start = at + HEADER + length;
    let packed = packed as usize;
    let whole = bytes.len() - start >= packed;
    (whole && !name.chars().any(char::is_control)).then_some(Block {
        name,
        at,
        start,
        crc,
        packed,
        unpacked,
    })
}

impl Block {
    /// The block's data, their length and checksum verified.
    pub(super) fn unpack(&self, bytes: &[u8]) -> Result<Vec<u8>, ReadError> {
        let fault = |what: &str| {
            let what = format!(
                "the block `{}` {what}: the file is damaged; copy it again, or {ADVICE}",
                self.name
            );
            Err(ReadError::new(Place::Byte(self.at), what))
        };
        let claimed = u64::from(self.unpacked);
        let length = self.packed as u64;
        if claimed > MOST_BYTES.min(LEAST_BUDGET.max(MOST_RATIO * length)) {
            return fault("claims to unpack to more than its data can hold");
        }
        let packed = &bytes[self.start..self.start + self.packed];
        let reserved = claimed.min(RESERVED_RATIO * length);
        let mut data = Vec::with_capacity(usize::try_from(reserved).unwrap_or(0));
        let decoder = DeflateDecoder::new(packed);
        if decoder.take(claimed + 1).read_to_end(&mut data).is_err() {
            return fault("cannot be unpacked");
        }
        if data.len() as u64 != claimed {
            return fault("does not have the length that it claims");
        }
        if crc32fast::hash(&data) != self.crc {
            return fault("does not have the checksum that it claims");
        }
        Ok(data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_marker_is_found_behind_what_begins_like_one() {
        let mut bytes = vec![MARKER[0]; 3];
        bytes.push(!MARKER[0]);
        let at = bytes.len();
        bytes.extend(MARKER);
        assert_eq!(position(&bytes), Some(at));
        assert_eq!(position(&bytes[..at]), None);
    }
}
