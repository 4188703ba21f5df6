//! A folder for what nobody keeps.

use std::path::Path;

use tempfile::TempDir;

use super::WriteError;

/// A folder of the system's for temporary files, removed with all that is in it when dropped.
#[derive(Debug)]
pub struct Scratch(TempDir);

impl Scratch {
    /// An empty folder.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn new() -> Result<Self, WriteError> {
        let made = tempfile::Builder::new().prefix("fluxform-").tempdir();
        made.map(Self)
            .map_err(|error| WriteError::from_io("make", Path::new("a temporary folder"), error))
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}
