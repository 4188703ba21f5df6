//! Bytes that are hashed while they are written: no second pass.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use sha2::{Digest, Sha256};

/// Writes of at least this size pass through unbuffered.
const BUFFER_BYTES: usize = 1 << 20;
/// Largest part of a file that is forced to the disk at once: one call that waits for gigabytes
/// hears no request to stop, and what is given up with them in memory takes as long to remove.
const UNFORCED_BYTES: u64 = 8 << 20;

/// Size and digest of the bytes written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Number of bytes.
    pub bytes: u64,
    /// SHA-256 of the bytes, 64 lower-case hexadecimal digits.
    pub sha256: String,
}

/// What writes a file's bytes. Boxed, so that what makes a file is compiled once and not for every content.
pub type Content<'a> = Box<dyn FnOnce(&mut dyn Write) -> io::Result<()> + 'a>;

/// Whether what is written must be on the disk before it counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Durability {
    /// As the system likes: devices, and what can be computed again.
    Cached,
    /// Forced to the disk piece by piece; the caller forces the rest, once the file has its mode.
    Forced,
}

/// Runs `content` into `file` through a buffer, hashing on the way.
pub(super) fn fill(
    file: &mut File,
    durability: Durability,
    content: Content,
) -> io::Result<Written> {
    let (bytes, sha256) = pour(file, durability, Some(Sha256::new()), content)?;
    Ok(Written {
        bytes,
        sha256: sha256.map_or_else(String::new, |sha256| hex(&sha256.finalize())),
    })
}

/// As [`fill`], for what carries a digest of its own.
pub(super) fn fill_unhashed(file: &mut File, content: Content) -> io::Result<()> {
    pour(file, Durability::Cached, None, content).map(|_| ())
}

fn pour(
    file: &mut File,
    durability: Durability,
    sha256: Option<Sha256>,
    content: Content,
) -> io::Result<(u64, Option<Sha256>)> {
    let mut buffered = BufWriter::with_capacity(
        BUFFER_BYTES,
        Hashing {
            file,
            durability,
            sha256,
            bytes: 0,
            unforced: 0,
        },
    );
    let outcome = content(&mut buffered);
    // On failure the buffer's rest is dropped unwritten.
    let hashing = match outcome {
        Ok(()) => buffered
            .into_inner()
            .map_err(io::IntoInnerError::into_error)?,
        Err(error) => {
            let _ = buffered.into_parts();
            return Err(error);
        }
    };
    Ok((hashing.bytes, hashing.sha256))
}

/// Lower-case hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 16] = b"0123456789abcdef";
    bytes
        .iter()
        .flat_map(|b| [b >> 4, b & 15])
        .map(|nibble| char::from(DIGITS[usize::from(nibble)]))
        .collect()
}

struct Hashing<'a> {
    file: &'a mut File,
    durability: Durability,
    sha256: Option<Sha256>,
    bytes: u64,
    /// Bytes since the last that were forced to the disk.
    unforced: u64,
}

impl Write for Hashing<'_> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        // An incomplete file is temporary, and is removed as it is dropped.
        fluxform_base::progress::poll();
        let count = self.file.write(&buffer[..buffer.len().min(BUFFER_BYTES)])?;
        if let Some(sha256) = &mut self.sha256 {
            sha256.update(&buffer[..count]);
        }
        self.bytes += count as u64;
        self.unforced += count as u64;
        if self.durability == Durability::Forced && self.unforced >= UNFORCED_BYTES {
            self.file.sync_data()?;
            self.unforced = 0;
        }
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
