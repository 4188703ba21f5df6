//! When an existing output may be replaced.

use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::WriteError;
use crate::bundle::artefact::Input;
use crate::bundle::plain::read_plain;

/// Records larger than this are not read: ours are a few kilobytes to a few megabytes.
pub(super) const RECORD_MAX_BYTES: u64 = 64 << 20;

/// The policy for outputs that exist already.
#[derive(Debug, Clone)]
pub enum Overwrite {
    /// Replace whatever file is there.
    Force,
    /// Replace what comes from the same inputs, refuse the rest.
    SameInputs(Record),
    /// Replace nothing.
    Never,
}

/// What an existing output is compared with: the inputs of this run, and the JSON file that
/// tells those of the existing output (a sidecar, a manifest, or the output itself).
#[derive(Debug, Clone)]
pub struct Record {
    /// A JSON artefact with a top-level `inputs[]`.
    pub path: PathBuf,
    /// This run's inputs.
    pub inputs: Vec<Input>,
}

impl Overwrite {
    /// `Force`, or compare with the record at `path`.
    #[must_use]
    pub fn new(force: bool, path: impl Into<PathBuf>, inputs: &[Input]) -> Self {
        if force {
            return Self::Force;
        }
        Self::SameInputs(Record {
            path: path.into(),
            inputs: inputs.to_vec(),
        })
    }

    /// Refuses when `target`, which exists, must not be replaced. Call it before a long
    /// computation too; writing checks again.
    ///
    /// # Errors
    /// [`WriteError::OutputExists`].
    pub fn check(&self, target: &Path) -> Result<(), WriteError> {
        if matches!(self, Self::Force) {
            return Ok(());
        }
        match target.symlink_metadata() {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(WriteError::from_io("look at", target, error)),
            Ok(_) => {}
        }
        let confirmed = match self {
            Self::Force => Ok(()),
            Self::SameInputs(record) => record.confirm(),
            Self::Never => Err("already".to_owned()),
        };
        confirmed.map_err(|reason| WriteError::OutputExists {
            path: target.to_path_buf(),
            reason,
        })
    }
}

impl Record {
    /// `Ok` when the record's inputs have this run's digests, in order; else the reason.
    fn confirm(&self) -> Result<(), String> {
        let name = self.path.display();
        let text = read_plain(&self.path, RECORD_MAX_BYTES)
            .map_err(|_| format!("and no {name} tells what it was made from"))?;
        let value: Value = serde_json::from_slice(&text)
            .map_err(|_| format!("and {name} does not tell what it was made from"))?;
        let found: Option<Vec<&str>> =
            value.get("inputs").and_then(Value::as_array).map(|inputs| {
                inputs
                    .iter()
                    .map(|input| input.get("sha256").and_then(Value::as_str).unwrap_or(""))
                    .collect()
            });
        let wanted: Vec<&str> = self.inputs.iter().map(|i| i.sha256.as_str()).collect();
        match found {
            None => Err(format!("and {name} does not tell what it was made from")),
            Some(found) if found == wanted => Ok(()),
            Some(_) => Err(format!("and was made from other inputs (says {name})")),
        }
    }
}
