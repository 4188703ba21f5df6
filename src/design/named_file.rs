//! Files that a document names: what they must be before a byte of them is read.
//!
//! Whoever sends a design chooses these names, not the person who runs the program. Such a file may
//! lie anywhere that a path leads to, links followed, but must be a regular file that states its
//! length and holds exactly that: not a folder, a device, a pipe or a socket, and not a file that
//! the system makes up while it is read (`/proc/self/environ` states 0 bytes, files of `/sys` state
//! a page). What a file contains that does not fit is quoted by
//! [`message_text::token`](super::message_text::token) alone.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Why a file that a document names is not read.
#[derive(Debug, thiserror::Error)]
pub enum NamedFileError {
    /// It cannot be opened or read.
    #[error("cannot read the file: {0}")]
    Unreadable(#[from] io::Error),
    /// A folder.
    #[error("found a directory")]
    Folder,
    /// A device, a pipe or a socket.
    #[error("found a device or a pipe")]
    NotRegular,
    /// States no bytes.
    #[error("found an empty file, or one that the system makes up (as in /proc)")]
    NoLength,
    /// States more bytes than are read of such a file.
    #[error("the file is larger than {0} bytes")]
    TooLarge(u64),
    /// Holds very many zero bytes in a row.
    #[error(
        "the file holds more than {} MiB of zero bytes in a row: it was not written to its end, or \
         its length is a lie; export or download it again",
        MOST_ZEROS >> 20
    )]
    Zeros,
    /// Holds fewer or more bytes than it states.
    #[error("found a file that changes, or one that the system makes up (as in /sys)")]
    OtherLength,
}

/// The opened file at `path` and the bytes that it states, more than 0 and at most `max_bytes`.
///
/// # Errors
/// All but [`NamedFileError::OtherLength`].
pub fn open(path: &Path, max_bytes: u64) -> Result<(File, u64), NamedFileError> {
    // Before it is opened: opening a pipe would wait for its other end.
    regular(&fs::metadata(path)?)?;
    let file = File::open(path)?;
    let found = file.metadata()?;
    regular(&found)?;
    match found.len() {
        0 => Err(NamedFileError::NoLength),
        bytes if bytes > max_bytes => Err(NamedFileError::TooLarge(max_bytes)),
        bytes => Ok((file, bytes)),
    }
}

/// The bytes of the file at `path`, at most `max_bytes`.
///
/// # Errors
/// [`NamedFileError`].
pub fn read(path: &Path, max_bytes: u64) -> Result<Vec<u8>, NamedFileError> {
    let (file, stated) = open(path, max_bytes)?;
    let mut bytes = Vec::new();
    bytes
        .try_reserve_exact(usize::try_from(stated).unwrap_or(usize::MAX))
        .map_err(io::Error::from)?;
    let mut guarded = ZeroGuard::new(file).take(stated + 1);
    if let Err(error) = guarded.read_to_end(&mut bytes) {
        return Err(match guarded.get_ref().too_many() {
            true => NamedFileError::Zeros,
            false => error.into(),
        });
    }
    if bytes.len() as u64 == stated {
        Ok(bytes)
    } else {
        Err(NamedFileError::OtherLength)
    }
}

/// Ends a reading once [`MOST_ZEROS`] bytes in a row are 0: no format holds so many, but files do
/// that were never written to their end, or whose length is a lie (sparse files).
#[derive(Debug)]
pub struct ZeroGuard<R> {
    source: R,
    zeros: usize,
}

/// Most bytes in a row that may be 0.
const MOST_ZEROS: usize = 16 << 20;

impl<R> ZeroGuard<R> {
    /// Around a source.
    pub fn new(source: R) -> Self {
        Self { source, zeros: 0 }
    }

    fn too_many(&self) -> bool {
        self.zeros > MOST_ZEROS
    }
}

impl<R: Read> Read for ZeroGuard<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        // Short enough that a part without zeros ends a run.
        let most = buffer.len().min(1 << 20);
        let count = self.source.read(&mut buffer[..most])?;
        let zeros = buffer[..count].iter().rev().take_while(|byte| **byte == 0);
        let zeros = zeros.count();
        self.zeros = if zeros == count {
            self.zeros + zeros
        } else {
            zeros
        };
        if self.too_many() {
            return Err(io::Error::other(NamedFileError::Zeros));
        }
        Ok(count)
    }
}

fn regular(found: &fs::Metadata) -> Result<(), NamedFileError> {
    if found.is_dir() {
        Err(NamedFileError::Folder)
    } else if found.is_file() {
        Ok(())
    } else {
        Err(NamedFileError::NotRegular)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_of_a_known_length_are_read() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let said = |path: &Path, max: u64| read(path, max).unwrap_err().to_string();
        let manifest = root.join("Cargo.toml");
        let bytes = fs::metadata(&manifest).unwrap().len();
        assert_eq!(read(&manifest, bytes).unwrap().len() as u64, bytes);
        assert_eq!(
            said(&manifest, bytes - 1),
            format!("the file is larger than {} bytes", bytes - 1)
        );
        assert_eq!(said(root, 9), "found a directory");
        assert!(said(&root.join("none"), 9).starts_with("cannot read the file: "));
    }

    /// Two gigabytes of nothing were read whole before they were refused.
    #[test]
    fn a_file_that_claims_gigabytes_of_nothing_is_left_after_a_few_megabytes() {
        struct Endless(usize);
        impl Read for Endless {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                buffer.fill(0);
                if self.0 == 0 {
                    buffer[0] = b's';
                }
                self.0 += buffer.len();
                Ok(buffer.len())
            }
        }
        let mut guard = ZeroGuard::new(Endless(0));
        let mut bytes = Vec::new();
        let error = (&mut guard)
            .take(2 << 30)
            .read_to_end(&mut bytes)
            .unwrap_err();
        assert!(
            error.to_string().contains("16 MiB of zero bytes"),
            "{error}"
        );
        assert!(guard.source.0 < 2 * MOST_ZEROS);
        let mut few = vec![0; MOST_ZEROS];
        few.extend(b"end");
        bytes.clear();
        ZeroGuard::new(&few[..]).read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes.len(), few.len());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn files_that_the_system_makes_up_are_not_read() {
        for name in ["/proc/self/environ", "/proc/version", "/dev/zero"] {
            let error = read(Path::new(name), 1 << 20).unwrap_err();
            let made_up = matches!(error, NamedFileError::NoLength | NamedFileError::NotRegular);
            assert!(made_up, "{name}: {error}");
        }
    }
}
