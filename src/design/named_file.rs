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
use std::path::{Path, PathBuf};

/// The role of a file that a design names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The table of the cores' magnetisation.
    Curve,
    /// The mesh of a body of `[[iron]]`, counted from 0.
    Mesh(usize),
}

/// A file that a design names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedFile {
    /// Its role.
    pub role: Role,
    /// Where it is.
    pub path: PathBuf,
}

impl NamedFile {
    /// The key that names it.
    #[must_use]
    pub fn key(&self) -> String {
        match self.role {
            Role::Curve => "core.bh_curve".to_owned(),
            Role::Mesh(number) => format!("iron[{number}].surface"),
        }
    }

    /// Its name in a bundle: of a mesh with the ending, which states its format.
    #[must_use]
    pub fn kept_name(&self) -> String {
        match self.role {
            Role::Curve => "bh_curve.csv".to_owned(),
            Role::Mesh(number) => {
                let ending = self.path.extension().and_then(|ending| ending.to_str());
                let plain = |ending: &&str| ending.chars().all(|c| c.is_ascii_alphanumeric());
                let ending = ending.filter(plain).map(|ending| format!(".{ending}"));
                format!("iron_{number}{}", ending.unwrap_or_default())
            }
        }
    }
}

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
    file.take(stated + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 == stated {
        Ok(bytes)
    } else {
        Err(NamedFileError::OtherLength)
    }
}

/// Bytes that are read between two looks.
const PIECE: u64 = 1 << 20;

/// The same; `watch` sees every piece as it is read, and ends the reading by false: then there is
/// no result.
///
/// # Errors
/// [`NamedFileError`].
pub fn read_watched(
    path: &Path,
    max_bytes: u64,
    watch: &mut dyn FnMut(&[u8]) -> bool,
) -> Result<Option<Vec<u8>>, NamedFileError> {
    let (mut file, stated) = open(path, max_bytes)?;
    let mut bytes = Vec::new();
    loop {
        let from = bytes.len();
        // Memory grows with the bytes read: a claimed size is not trusted.
        if bytes.capacity() == from {
            let room = (stated + 1 - from as u64).min((from as u64).max(PIECE));
            bytes
                .try_reserve_exact(usize::try_from(room).unwrap_or(usize::MAX))
                .map_err(io::Error::from)?;
        }
        let left = stated + 1 - from as u64;
        (&mut file).take(left.min(PIECE)).read_to_end(&mut bytes)?;
        if bytes.len() == from {
            break;
        }
        if !watch(&bytes[from..]) {
            return Ok(None);
        }
        if bytes.len() as u64 > stated {
            break;
        }
    }
    if bytes.len() as u64 == stated {
        Ok(Some(bytes))
    } else {
        Err(NamedFileError::OtherLength)
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
