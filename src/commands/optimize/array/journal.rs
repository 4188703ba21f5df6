//! The journal of `optimize --for`: the arrays that runs have computed, in a file that holds the design's mark and
//! a sealed record. Runs of one design may share it, one after another or side by side.

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::physics::Journal;
use crate::bundle::atomic::{Overwrite, WriteError, is_stream, write};
use crate::bundle::json::JsonError;
use crate::bundle::read_bounded::read_plain;
use crate::bundle::read_table::TABLE_MAX_BYTES;
use crate::bundle::seal::{is_sealed, to_record};

/// The record, over whose text the seal is.
#[derive(Serialize, Deserialize)]
struct Arrays<J> {
    arrays: J,
}

/// What a journal's file holds, with its bytes; nothing where there is no file.
#[derive(Default)]
pub(super) struct Kept {
    bytes: Vec<u8>,
    pub(super) arrays: Journal,
}

/// The journal at `path`, or why it is none as a run wrote it.
pub(super) fn read(path: &Path) -> Result<Kept, String> {
    if is_stream(path) {
        return Ok(Kept::default());
    }
    let bytes = match read_plain(path, TABLE_MAX_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Kept::default()),
        read => read.map_err(|error| format!("cannot read the journal: {error}"))?,
    };
    let record = bytes.splitn(2, |byte| *byte == b'\n').nth(1);
    let sealed = record.filter(|record| is_sealed(record));
    match sealed.map(serde_json::from_slice::<Arrays<Journal>>) {
        Some(Ok(Arrays { arrays })) => Ok(Kept { bytes, arrays }),
        _ => Err(
            "not a journal as `optimize --for` wrote it, but damaged, changed by hand or of another version: its \
             numbers are not used; choose another --journal, or move it away"
                .to_owned(),
        ),
    }
}

/// The text of a journal whose first line is `mark`.
///
/// # Errors
/// A number that is not finite.
pub(super) fn text(mark: &str, arrays: &Journal) -> Result<Vec<u8>, JsonError> {
    let record = to_record(&Arrays { arrays })?;
    Ok([mark.as_bytes(), b"\n", &record].concat())
}

/// Adds `arrays` to those that are in the file at `path` now: another run may have put its own there since this one
/// read it.
///
/// # Errors
/// A file that cannot be written, or is not this design's journal any more.
pub(super) fn add(
    path: &Path,
    mark: &str,
    overwrite: &Overwrite,
    arrays: &Journal,
) -> Result<(), WriteError> {
    let refused = |message| WriteError::Content {
        path: path.to_path_buf(),
        message,
    };
    loop {
        let earlier = read(path).map_err(refused)?;
        let mut all = earlier.arrays;
        all.extend(arrays.clone());
        let text = text(mark, &all).map_err(|error| refused(error.to_string()))?;
        let overwrite = overwrite.clone().taking_up(&earlier.bytes);
        let written = write(path, &overwrite, |out| out.write_all(&text));
        // Another run was faster. It wrote its journal, so that this comes to an end.
        if written.is_err() && read(path).map_err(refused)?.bytes != earlier.bytes {
            continue;
        }
        return match written {
            Err(WriteError::OutputExists { reason, .. }) => Err(refused(format!(
                "it exists {reason}; choose another --journal"
            ))),
            written => written.map(drop),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A journal of more than 4 MiB, ten thousand arrays, was refused by the run that was to go on from it.
    #[test]
    fn regression_a_long_journal_was_not_read_again() {
        let arrays: Journal = (0..60_000).map(|k| (format!("{k:064}"), None)).collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept.json");
        add(&path, "# Made of a.toml.", &Overwrite::force(), &arrays).unwrap();
        assert!(path.metadata().unwrap().len() > 4 << 20);
        assert_eq!(read(&path).unwrap().arrays, arrays);
    }
}
