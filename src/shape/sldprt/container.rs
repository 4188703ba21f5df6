//! The container of SOLIDWORKS files since 2015: named blocks of raw DEFLATE data.
//!
//! A block: the marker, five little-endian u32 (type, CRC-32 and lengths of the data, length of
//! the name), the name with its nibbles swapped, the data. One name may head several blocks, of
//! which exactly one verifies by its length and checksum; the others may claim to reach over it.
//! So headers are looked for everywhere, also inside what a block claims, and a stream is the
//! first block of its name that verifies. Near the end of the file a directory repeats the
//! headers; it is not used.

use std::io::Read;

use flate2::read::DeflateDecoder;

use super::ADVICE;
use crate::read_error::ReadError;

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
/// So many times the file's length, and so many bytes, are unpacked in search of a block that
/// verifies.
const MOST_TRIED: [u64; 2] = [20, 16 << 20];

/// The file's blocks, headers alone.
pub(super) struct Blocks<'a> {
    bytes: &'a [u8],
    blocks: Vec<Block>,
}

/// A block's header.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Block {
    name: String,
    /// Offset of the data.
    start: usize,
    crc: u32,
    packed: usize,
    unpacked: u32,
}

impl<'a> Blocks<'a> {
    /// True for bytes that begin as such files do.
    pub(super) fn is(bytes: &[u8]) -> bool {
        bytes.get(4..8) == Some(&SIGN)
    }

    /// The headers of a file, in file order.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, ReadError> {
        let mut blocks = Vec::new();
        let mut at = 8;
        while let Some(step) = position(&bytes[at..]) {
            fluxform_base::progress::poll();
            at += step;
            blocks.extend(block(bytes, at));
            at += 1;
        }
        if blocks.is_empty() {
            let what = format!("the SOLIDWORKS file holds no block of data: {ADVICE}");
            return Err(ReadError::file(what));
        }
        Ok(Self { bytes, blocks })
    }

    /// The data of the first block of this name that verifies; `None` without a block of it.
    pub(super) fn stream(&self, name: &str) -> Result<Option<Vec<u8>>, ReadError> {
        let mut tried = 0;
        let [ratio, least] = MOST_TRIED;
        let mut left = least.max(ratio * self.bytes.len() as u64);
        for block in self.blocks.iter().filter(|block| block.name == name) {
            fluxform_base::progress::poll();
            tried += 1;
            if let Some(data) = block.unpack(self.bytes, &mut left) {
                return Ok(Some(data));
            }
        }
        if tried == 0 {
            return Ok(None);
        }
        Err(ReadError::file(format!(
            "none of the {tried} blocks `{name}` of the file has the length and the checksum that \
             it claims: the part was saved without its display, or the file is damaged: copy it \
             again, or {ADVICE}"
        )))
    }
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

/// The block whose marker is at `at`; `None` where chance put the marker there.
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
    (!name.chars().any(char::is_control)).then_some(Block {
        name,
        start,
        crc,
        packed: packed as usize,
        unpacked,
    })
}

impl Block {
    /// The block's data where their length and checksum verify; `left` is what may yet be
    /// unpacked.
    fn unpack(&self, bytes: &[u8], left: &mut u64) -> Option<Vec<u8>> {
        let packed = bytes[self.start..].get(..self.packed)?;
        let claimed = u64::from(self.unpacked);
        let length = self.packed as u64;
        if claimed
            > (*left)
                .min(MOST_BYTES)
                .min(LEAST_BUDGET.max(MOST_RATIO * length))
        {
            return None;
        }
        let reserved = claimed.min(RESERVED_RATIO * length);
        let mut data = Vec::with_capacity(usize::try_from(reserved).unwrap_or(0));
        let read = DeflateDecoder::new(packed)
            .take(claimed + 1)
            .read_to_end(&mut data);
        *left = left.saturating_sub(1 + data.len() as u64);
        let verifies = data.len() as u64 == claimed && crc32fast::hash(&data) == self.crc;
        (read.is_ok() && verifies).then_some(data)
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
