//! The order in which a search gives its outputs: files, each whole and to its end, then what a reader takes.

use super::failure::Failure;
use super::printer::Stream;
use super::values::FileArgument;
use crate::bundle::atomic::is_stream;
use crate::progress::{for_a_reader, to_its_end};

/// Where an output goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outlet {
    /// To a file on a disk.
    File,
    /// To a pipe or a device, which a reader may leave full.
    Reader,
}

impl Outlet {
    /// Whether `file` is one of these.
    #[must_use]
    pub fn takes(self, file: Option<&FileArgument>) -> bool {
        let reader = |file: &FileArgument| match file {
            FileArgument::Standard => true,
            FileArgument::Path(path) => is_stream(path),
        };
        file.is_some_and(|file| reader(file) == (self == Self::Reader))
    }
}

/// Gives what was computed, although a stop is requested, which would lose it: `write` the outputs of each kind,
/// then `print` the summary where they left place for it. A file that is refused costs neither what a reader takes
/// nor the summary. A stop ends the wait for a reader, when every file is whole.
///
/// # Errors
/// Those of `write` and `print`; the first, where there are several.
pub fn give<T>(
    mut write: impl FnMut(Outlet) -> Result<Stream, Failure>,
    print: impl FnOnce(Stream) -> Result<T, Failure>,
) -> Result<T, Failure> {
    to_its_end(|| {
        let files = write(Outlet::File);
        let printed = for_a_reader(|| print(write(Outlet::Reader)?));
        files.and(printed)
    })
}
