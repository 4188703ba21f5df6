//! The files that a design names, read once: what was parsed is what is recorded and kept.

use std::sync::Arc;

use crate::RunError;
use crate::bundle::artefact::Input;
use crate::design::named_file::{NamedFile, Role};
use crate::design::{Design, source};
use crate::shape::surface::read_file;

/// The largest mesh of a body of steel, bytes: several times what as many facets as are solved take in any format.
const MESH_MAX_BYTES: u64 = 64 << 20;

/// A file that a design names, and its bytes.
#[derive(Debug, Clone)]
pub struct NamedContent {
    /// Its role and path.
    pub file: NamedFile,
    /// Its name in a bundle.
    pub kept_name: String,
    /// As they were read.
    pub bytes: Arc<[u8]>,
}

impl NamedContent {
    /// Reads `file`.
    ///
    /// # Errors
    /// A file that cannot be read, or is not of its kind.
    pub fn read(file: NamedFile) -> Result<Self, RunError> {
        let input =
            |fault: &dyn std::error::Error| RunError::Input(format!("{}: {fault}", file.key()));
        let bytes = match file.role {
            Role::Curve => source::table_text_of(&file.path)
                .map_err(|fault| RunError::Input(fault.to_string()))?
                .into_bytes(),
            Role::Mesh(_) => {
                read_file(&file.path, MESH_MAX_BYTES).map_err(|fault| input(&fault))?
            }
        };
        Ok(Self {
            kept_name: file.kept_name(),
            file,
            bytes: bytes.into(),
        })
    }

    /// Its entry among the inputs.
    #[must_use]
    pub fn input(&self) -> Input {
        Input::of_bytes(self.file.path.display().to_string(), &self.bytes)
    }

    /// The text of a table.
    pub(super) fn text(&self) -> Result<&str, RunError> {
        std::str::from_utf8(&self.bytes)
            .map_err(|fault| RunError::Input(format!("{}: {fault}", self.file.path.display())))
    }
}

/// All that `design` names.
///
/// # Errors
/// As [`NamedContent::read`].
pub(super) fn read(design: &Design) -> Result<Vec<NamedContent>, RunError> {
    let files = design.named_files().into_iter();
    files.map(NamedContent::read).collect()
}

/// The one of this role.
pub(super) fn of(files: &[NamedContent], role: Role) -> Result<&NamedContent, RunError> {
    let found = files.iter().find(|content| content.file.role == role);
    found.ok_or_else(|| RunError::Input(format!("{role:?}: the file was not read")))
}
