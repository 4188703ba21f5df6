//! The container of SOLIDWORKS files up to 2014: an OLE compound file. The streams whose name
//! ends in `__ZLB` are packed: a signature, then chunks of two little-endian u32 (lengths of the
//! data, unpacked and packed) and the zlib data, up to a chunk without length.

use std::io::{Cursor, Read};

use cfb::CompoundFile;
use flate2::read::ZlibDecoder;

use super::ADVICE;
use crate::read_error::ReadError;

const SIGN: [u8; 4] = [0xd0, 0xcf, 0x11, 0xe0];
const PACKED: &str = "__ZLB";
/// Bytes before the first chunk of a packed stream.
const SIGNATURE: usize = 16;
/// So many bytes may be unpacked from any stream, or so many times its length.
const LEAST_BUDGET: u64 = 4 << 20;
const MOST_RATIO: u64 = 200;

/// An opened compound file.
pub(super) struct Compound<'a> {
    file: CompoundFile<Cursor<&'a [u8]>>,
    length: u64,
}

impl<'a> Compound<'a> {
    /// True for bytes that begin as such files do.
    pub(super) fn is(bytes: &[u8]) -> bool {
        bytes.starts_with(&SIGN)
    }

    /// Opens a file's bytes.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, ReadError> {
        let file = CompoundFile::open(Cursor::new(bytes)).map_err(|error| {
            let what = format!("the OLE document is damaged ({error}): copy it again, or {ADVICE}");
            ReadError::file(what)
        })?;
        Ok(Self {
            file,
            length: bytes.len() as u64,
        })
    }

    /// The content of a stream, packed or not; `None` where there is none of this name.
    pub(super) fn stream(&mut self, name: &str) -> Result<Option<Vec<u8>>, ReadError> {
        let packed = format!("/{name}{PACKED}");
        let fault = |what: String| {
            let what = format!("the stream `{name}` {what}: copy the file again, or {ADVICE}");
            ReadError::file(what)
        };
        for (path, is_packed) in [(packed.as_str(), true), (&format!("/{name}"), false)] {
            if !self.file.is_stream(path) {
                continue;
            }
            let mut bytes = Vec::new();
            let stream = self.file.open_stream(path);
            // No stream is longer than its file, whatever it claims.
            stream
                .and_then(|stream| stream.take(self.length).read_to_end(&mut bytes))
                .map_err(|error| fault(format!("cannot be read ({error})")))?;
            return match is_packed {
                true => unpack(&bytes).map(Some).map_err(fault),
                false => Ok(Some(bytes)),
            };
        }
        Ok(None)
    }
}

/// The chunks' data, one after the other.
fn unpack(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut rest = bytes.get(SIGNATURE..).ok_or("is cut short")?;
    let budget = LEAST_BUDGET.max(MOST_RATIO * bytes.len() as u64);
    let mut data = Vec::new();
    while let Some((head, after)) = rest.split_first_chunk::<8>() {
        fluxform_base::progress::poll();
        let (words, _) = head.as_chunks::<4>();
        let [unpacked, packed] = [0, 1].map(|k| u32::from_le_bytes(words[k]));
        if packed == 0 {
            break;
        }
        let chunk = after.get(..packed as usize).ok_or("is cut short")?;
        if data.len() as u64 + u64::from(unpacked) > budget {
            return Err("claims to unpack to more than its data can hold".into());
        }
        let before = data.len();
        // zlib holds the data's checksum itself.
        ZlibDecoder::new(chunk)
            .take(u64::from(unpacked) + 1)
            .read_to_end(&mut data)
            .map_err(|_| "cannot be unpacked")?;
        if data.len() - before != unpacked as usize {
            return Err("does not have the length that it claims".into());
        }
        rest = &after[packed as usize..];
    }
    Ok(data)
}
