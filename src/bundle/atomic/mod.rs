//! The one place that writes files.
//!
//! A file is written beside its target under a temporary name, fsynced, renamed into place, and
//! its folder fsynced: it is whole or absent whenever the program ends. [`FileSet`] does that for
//! a file and its sidecar, [`FolderDraft`] for a whole folder (see there for the scheme).
//! Temporary names are `.fluxform-*.tmp`; they hold the identity of what has them, and their writer
//! holds a lock on it, so that the next run can distinguish a killed run's leftovers from another run's work
//! and from anything else of that name.
//!
//! [`Overwrite`] decides what may be replaced. All that is removed, renamed or recovered is so by
//! `dir::Dir`: in a folder that was opened, following no link.
//!
//! The digest of a file is computed while it is written: no second pass.

mod absorb;
mod busy;
mod created_dirs;
mod digest;
mod dir;
mod file;
mod folder;
mod names;
mod overwrite;
mod record;
mod scratch;
mod temporary;

use std::io;
use std::path::{Path, PathBuf};

pub use busy::{awaited_folder, is_writing};
pub use created_dirs::SharedFolders;
pub(crate) use created_dirs::open_made;
pub(crate) use digest::hex;
pub use digest::{Content, Written};
pub(crate) use dir::{Dir, Kind};
pub(crate) use file::put;
pub use file::{FileSet, is_stream, write};
pub use folder::FolderDraft;
pub(crate) use folder::listed_files;
pub(crate) use names::check_name;
pub use overwrite::{Overwrite, check_distinct};
pub use scratch::Scratch;
pub(crate) use temporary::clean_leftovers;

/// Why an output was not written. Nothing is left half written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The target exists and is not known to come from the same inputs.
    #[error("{path} exists {reason}; use --force to replace it, or choose another output")]
    OutputExists {
        /// The target.
        path: PathBuf,
        /// Why it is not ours to replace.
        reason: String,
    },
    /// The target is none that may be replaced, whatever is requested.
    #[error("{path} {reason}; nothing replaces it, choose another output")]
    Protected {
        /// The target.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file was to be written where a folder is.
    #[error("{path} is a folder, expected a file name")]
    IsFolder {
        /// The target.
        path: PathBuf,
    },
    /// A folder was to be made where (or below where) a file is.
    #[error("{path} is not a folder; choose another output")]
    NotFolder {
        /// The path that is a file.
        path: PathBuf,
    },
    /// The folder may not be written to.
    #[error("cannot write {path}: the folder is read-only or belongs to someone else")]
    ReadOnly {
        /// The target.
        path: PathBuf,
    },
    /// No space left on the device, or the quota is used up.
    #[error("cannot write {path}: the disk is full; free some space or choose another output")]
    DiskFull {
        /// The target.
        path: PathBuf,
    },
    /// A name of more bytes than the file system takes.
    #[error("cannot write {path}: the name is too long; choose a shorter one")]
    LongName {
        /// The target.
        path: PathBuf,
    },
    /// The content itself could not be made.
    #[error("cannot write {path}: {message}")]
    Content {
        /// The target.
        path: PathBuf,
        /// The fault.
        message: String,
    },
    /// A name that is not allowed inside a bundle.
    #[error("{name:?} is not a plain file name inside the output folder")]
    BadName {
        /// The name.
        name: String,
    },
    /// Anything else the operating system said.
    #[error("cannot {action} {path}: {source}")]
    Io {
        /// The operation.
        action: &'static str,
        /// The target.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

impl WriteError {
    /// Two outputs of one command that have the same name.
    fn same_name(path: &Path) -> Self {
        Self::Content {
            path: path.to_path_buf(),
            message: "another file of this command has that name; choose another".to_owned(),
        }
    }

    /// Sorts an I/O error by what the user can do about it.
    pub fn from_io(action: &'static str, path: &Path, source: io::Error) -> Self {
        let path = match source.kind() {
            // A part of the path, as a rule: the first that is something else.
            io::ErrorKind::NotADirectory => path
                .ancestors()
                .filter(|part| part.symlink_metadata().is_ok())
                .find(|part| !part.is_dir())
                .unwrap_or(path),
            _ => path,
        }
        .to_path_buf();
        match source.kind() {
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                Self::ReadOnly { path }
            }
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull { path },
            io::ErrorKind::InvalidFilename => Self::LongName { path },
            io::ErrorKind::NotADirectory => Self::NotFolder { path },
            io::ErrorKind::IsADirectory => Self::IsFolder { path },
            io::ErrorKind::InvalidData => Self::Content {
                path,
                message: source.to_string(),
            },
            _ => Self::Io {
                action,
                path,
                source,
            },
        }
    }
}
