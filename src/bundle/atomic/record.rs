//! How the program's own files are distinguished from the user's: records that list them with their digests.

use std::collections::{BTreeMap, HashMap};
use std::ffi::OsStr;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::digest::hex;
use super::dir::{Dir, EntryStatus, FileVersion, Kind};
use super::names::OLD;
use crate::artefact::{FLUXFORM_VERSION, FileEntry, Input, Options, SCHEMA_VERSION, parse_version};
use crate::read_bounded::read_plain;
use crate::seal;
use crate::timing;

/// Records larger than this are not read: ours are a few kilobytes to a few megabytes.
const RECORD_MAX_BYTES: u64 = 64 << 20;

/// Records of this schema version and later carry a seal.
const SEALED_FROM: [u32; 3] = [1, 4, 0];

/// The statements of a manifest or sidecar that decide which files may be replaced.
#[derive(Debug, Clone, Default, Deserialize)]
pub(super) struct Record {
    schema_version: String,
    #[serde(rename = "fluxform_version")]
    _fluxform_version: String,
    #[serde(default)]
    inputs: Vec<Input>,
    #[serde(default)]
    made_with: Options,
    #[serde(default)]
    files: Vec<FileEntry>,
    #[serde(default)]
    record_sha256: Option<String>,
    #[serde(skip)]
    state: State,
}

/// Whether a record is as this program wrote it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum State {
    /// Its seal holds.
    Sealed,
    /// Of a schema without seals, which states no options.
    Older,
    /// Changed since.
    #[default]
    Changed,
}

impl Record {
    /// The record at `path`; `None` where none is, or one of another program.
    pub fn read(path: &Path) -> Option<Self> {
        let text = read_plain(path, RECORD_MAX_BYTES).ok()?;
        Self::parse(&text)
    }

    fn parse(text: &[u8]) -> Option<Self> {
        let mut record: Self = serde_json::from_slice(text).ok()?;
        let version = parse_version(&record.schema_version)?;
        record.state = if seal::is_sealed(text) {
            State::Sealed
        } else if version < SEALED_FROM && record.record_sha256.is_none() {
            State::Older
        } else {
            State::Changed
        };
        Some(record)
    }

    /// The record `name` in `dir`, unless it was changed; a link is none.
    pub(crate) fn read_in(dir: &Dir, name: &str) -> Option<Self> {
        Self::parse(&bounded(dir, name)?).filter(|record| record.state != State::Changed)
    }

    /// Whether it is as this program wrote it.
    pub fn state(&self) -> State {
        self.state
    }

    /// The options in which `now` differs, in words.
    pub(crate) fn differs_in(&self, now: &Options) -> Option<String> {
        self.made_with.difference(now)
    }

    /// Whether it was made from inputs of these digests, in this order.
    pub(crate) fn is_of(&self, inputs: &[Input]) -> bool {
        let digests = |inputs: &[Input]| -> Vec<String> {
            inputs.iter().map(|input| input.sha256.clone()).collect()
        };
        digests(&self.inputs) == digests(inputs)
    }

    /// Its list.
    pub fn files(self) -> Vec<FileEntry> {
        self.files
    }

    /// Its list, by name.
    pub fn listed(self) -> BTreeMap<String, FileEntry> {
        let entries = self.files.into_iter();
        entries.map(|file| (file.path.clone(), file)).collect()
    }
}

/// Whether `name` in `dir` is a regular file of this size and digest.
pub(super) fn has(dir: &Dir, name: &OsStr, bytes: u64, sha256: &str) -> io::Result<bool> {
    let status = dir.status(name)?;
    Ok(
        status.is_some_and(|it| it.kind == Kind::File && it.bytes == bytes)
            && digest(dir, name)? == sha256,
    )
}

/// Digests of the files that were read in this run: what is replaced is looked at before a computation, before it is
/// replaced and before it is removed.
static DIGESTS: LazyLock<Mutex<HashMap<FileVersion, String>>> = LazyLock::new(Mutex::default);
/// Digests that are held at most.
const MOST_DIGESTS: usize = 10_000;
/// A file that changed later than this before it was read may change again within the same tick of its file system's
/// clock, so that nothing shows it, ns.
const TICK_NS: i128 = 2_000_000_000;

/// The digest of the regular file `name` in `dir`; that of a file that has not changed since is not computed again.
pub(super) fn digest(dir: &Dir, name: &OsStr) -> io::Result<String> {
    let mut file = dir.file(name)?;
    let known = || DIGESTS.lock().unwrap_or_else(PoisonError::into_inner);
    let version = EntryStatus::of(&file)?.version();
    if let Some(digest) = known().get(&version) {
        return Ok(digest.clone());
    }
    let mut sha256 = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer)? {
            0 => break,
            count => sha256.update(&buffer[..count]),
        }
    }
    let digest = hex(&sha256.finalize());
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let settled = now.is_ok_and(|now| version.changed_ns() + TICK_NS < now.as_nanos() as i128);
    if settled && EntryStatus::of(&file)?.version() == version {
        let mut known = known();
        if known.len() >= MOST_DIGESTS {
            known.clear();
        }
        known.insert(version, digest.clone());
    }
    Ok(digest)
}

/// The regular file `name` in `dir` as it is now.
pub(super) fn present(dir: &Dir, name: &OsStr) -> io::Result<Option<FileEntry>> {
    let Some(status) = dir.status(name)?.filter(|there| there.kind == Kind::File) else {
        return Ok(None);
    };
    Ok(Some(FileEntry {
        path: name.to_string_lossy().into_owned(),
        bytes: status.bytes,
        sha256: digest(dir, name)?,
    }))
}

/// Whether the file `name` in `dir` holds the seconds of a run, which no record lists: recognised by its
/// content.
pub(super) fn is_timing(dir: &Dir, name: &OsStr) -> bool {
    let named = name
        .to_str()
        .is_some_and(|name| name.starts_with("timing") && name.ends_with(".json"));
    if !named {
        return false;
    }
    let mut text = Vec::new();
    let read = dir
        .file(name)
        .and_then(|file| file.take(timing::BYTES_MAX + 1).read_to_end(&mut text));
    read.is_ok() && timing::is_ours(&text)
}

/// The note beside a record on files that are about to be replaced: a run that is killed between two
/// renames leaves both states listed. The next finished one removes it.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ReplacedNote {
    schema_version: String,
    fluxform_version: String,
    replaced: Vec<FileEntry>,
    /// Its own digest; see [`seal`].
    #[serde(skip_serializing)]
    #[serde(rename = "record_sha256")]
    _record_sha256: String,
}

impl ReplacedNote {
    /// Of these files as they are now.
    pub fn new(replaced: Vec<FileEntry>) -> Self {
        Self {
            schema_version: SCHEMA_VERSION.to_owned(),
            fluxform_version: FLUXFORM_VERSION.to_owned(),
            replaced,
            _record_sha256: String::new(),
        }
    }

    /// Where the note of the record at `path` is.
    pub fn path(record: &Path) -> PathBuf {
        let name = record.file_name().unwrap_or_default().to_string_lossy();
        record.with_file_name(format!(".{name}{}", OLD))
    }

    /// The note `name` in `dir`; `None` for anything that this program did not write as it is.
    pub(crate) fn read_in(dir: &Dir, name: &OsStr) -> Option<Self> {
        let text = bounded(dir, name)?;
        let note = serde_json::from_slice(&text).ok();
        note.filter(|_| seal::is_sealed(&text))
    }

    /// Its bytes.
    pub fn bytes(&self) -> io::Result<Vec<u8>> {
        seal::to_record(self).map_err(io::Error::other)
    }

    /// The files.
    pub fn replaced(self) -> Vec<FileEntry> {
        self.replaced
    }
}

/// The bytes of the regular file `name` in `dir`, unless they are too many for a record.
fn bounded(dir: &Dir, name: impl AsRef<OsStr>) -> Option<Vec<u8>> {
    let file = dir.file(name).ok()?;
    let mut text = Vec::new();
    let read = file.take(RECORD_MAX_BYTES + 1).read_to_end(&mut text);
    let whole = read.is_ok_and(|bytes| bytes as u64 <= RECORD_MAX_BYTES);
    whole.then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As long as two changes may have the same time the file is read again, and later a change shows.
    #[test]
    fn a_file_that_changes_has_another_digest() {
        let folder = tempfile::tempdir().unwrap();
        let dir = Dir::open(folder.path()).unwrap();
        let digest_of = |text: &str| {
            std::fs::write(folder.path().join("a"), text).unwrap();
            digest(&dir, OsStr::new("a")).unwrap()
        };
        let sha256 = |text: &str| crate::artefact::sha256_hex(text.as_bytes());
        for text in ["one", "two", "one"] {
            assert_eq!(digest_of(text), sha256(text));
        }
        std::thread::sleep(std::time::Duration::from_nanos(
            TICK_NS as u64 + 100_000_000,
        ));
        let version = || {
            let status = dir.status("a").unwrap().unwrap();
            DIGESTS.lock().unwrap().get(&status.version()).cloned()
        };
        assert_eq!(version(), None);
        assert_eq!(digest(&dir, OsStr::new("a")).unwrap(), sha256("one"));
        assert_eq!(version(), Some(sha256("one")), "it is not read again");
        assert_eq!(digest_of("two"), sha256("two"));
    }
}
