//! When an existing output may be replaced: the one policy for files and folders alike.

use std::ffi::OsStr;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::WriteError;
use super::digest::Written;
use super::dir::{Dir, EntryStatus, Kind, followed};
use super::names::parent_of;
use super::record::{Record, ReplacedNote, State, has, is_timing};
use crate::artefact::{Input, Options, sha256_hex};

/// So many bytes at the beginning of a mark give the kind of file, whatever it was made from.
const KIND_BYTES: usize = 16;

/// The policy for outputs that exist already.
///
/// An input of a run is never replaced. A regular file is replaced when it is known to be this
/// program's own and unchanged, or with `force`; anything else never.
#[derive(Debug, Clone)]
pub struct Overwrite {
    force: bool,
    evidence: Evidence,
    /// This run's inputs.
    inputs: Vec<Input>,
    /// Other paths that must not be replaced: files, and folders with all that is in them.
    protected: Vec<PathBuf>,
    /// What the run read from the file that it replaces.
    taken_up: Option<Written>,
}

/// Evidence that an existing file is this program's own.
#[derive(Debug, Clone)]
enum Evidence {
    /// A sealed JSON artefact of the same inputs and options, or a file that it lists, unchanged since.
    Record { path: PathBuf, options: Options },
    /// The same bytes; what begins otherwise than this is refused before they are known.
    SameBytes(Vec<u8>),
}

/// How a file takes its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Permit {
    /// Nothing is there.
    New,
    /// The file that is there has these very bytes.
    Same,
    /// Something is there that may go.
    Replace,
}

impl Overwrite {
    fn with(force: bool, evidence: Evidence, inputs: &[Input]) -> Self {
        Self {
            force,
            evidence,
            inputs: inputs.to_vec(),
            protected: Vec::new(),
            taken_up: None,
        }
    }

    /// `force`, or what the record at `path` lists: a JSON artefact that is as this program sealed it,
    /// with top-level `inputs[]`, which must be this run's, and `files[]`, which must be on the disk as
    /// listed.
    #[must_use]
    pub fn new(force: bool, path: impl Into<PathBuf>, inputs: &[Input]) -> Self {
        let (path, options) = (path.into(), Options::default());
        Self::with(force, Evidence::Record { path, options }, inputs)
    }

    /// The options of this run, which must be those in the record's `made_with`; without them that must
    /// be empty or absent.
    #[must_use]
    pub fn made_with(mut self, asked: &Options) -> Self {
        if let Evidence::Record { options, .. } = &mut self.evidence {
            options.clone_from(asked);
        }
        self
    }

    /// `force`, or a file that has the very bytes which are to be written.
    #[must_use]
    pub fn same_bytes(force: bool, inputs: &[Input]) -> Self {
        Self::beginning(force, "", inputs)
    }

    /// As [`Self::same_bytes`]; both begin with `mark`, so that a file of other inputs is refused
    /// before anything is computed.
    #[must_use]
    pub fn beginning(force: bool, mark: &str, inputs: &[Input]) -> Self {
        Self::with(force, Evidence::SameBytes(mark.into()), inputs)
    }

    /// The same, but that it must have the very bytes which are to be written, as
    /// [`Self::beginning`].
    #[must_use]
    pub(crate) fn now_beginning(mut self, mark: &str) -> Self {
        self.evidence = Evidence::SameBytes(mark.into());
        self
    }

    /// Nor need it have the bytes which are to be written where it still has these, which the run read from it and
    /// went on from.
    #[must_use]
    pub fn taking_up(mut self, bytes: &[u8]) -> Self {
        self.taken_up = Some(Written {
            bytes: bytes.len() as u64,
            sha256: sha256_hex(bytes),
        });
        self
    }

    /// Any regular file may be replaced.
    #[must_use]
    pub fn force() -> Self {
        Self::same_bytes(true, &[])
    }

    /// Nor may these be replaced: files, or folders with all that is in them.
    #[must_use]
    pub fn protecting<P: Into<PathBuf>>(mut self, paths: impl IntoIterator<Item = P>) -> Self {
        self.protected.extend(paths.into_iter().map(Into::into));
        self
    }

    /// Whether the regular file at `path` is known to be ours and is not read by this run. With force
    /// it may be of other inputs and options.
    pub(super) fn owns(&self, path: &Path) -> bool {
        let owned = || -> io::Result<bool> {
            let (dir, name) = Dir::of(path)?;
            let Some(status) = dir.status(&name)?.filter(|it| it.kind == Kind::File) else {
                return Ok(false);
            };
            Ok(!self.reads(path)? && self.own(&dir, path, &status, false).is_ok())
        };
        owned().unwrap_or(false)
    }

    /// The same without force.
    pub(super) fn unforced(&self) -> Self {
        Self {
            force: false,
            ..self.clone()
        }
    }

    /// The record that lists what is ours.
    pub(super) fn record_path(&self) -> Option<&Path> {
        match &self.evidence {
            Evidence::Record { path, .. } => Some(path),
            Evidence::SameBytes(_) => None,
        }
    }

    /// Whether whatever regular file is there may be replaced.
    pub(super) fn forced(&self) -> bool {
        self.force
    }

    /// This run's inputs.
    pub(super) fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    /// Refuses when `target`, which exists, must not be replaced, or its folder, or the one that it is made in, not be
    /// written to. Call it before a long computation too; writing checks again.
    ///
    /// # Errors
    /// [`WriteError::OutputExists`], [`WriteError::Protected`], [`WriteError::IsFolder`]; the system's.
    pub fn check(&self, target: &Path) -> Result<(), WriteError> {
        self.permit(target, None)?;
        let fail = |error| WriteError::from_io("write", target, error);
        let real = real(target).map_err(fail)?;
        // Folders that are not there are made in the nearest one that is.
        for folder in real.ancestors().skip(1) {
            match Dir::open(parent_of(&folder.join("-"))) {
                Ok(folder) => return folder.writable().map_err(fail),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(fail(error)),
            }
        }
        Ok(())
    }

    /// How a file of these bytes takes its place at `target`; without bytes, as far as can be known.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub(super) fn permit(
        &self,
        target: &Path,
        written: Option<&Written>,
    ) -> Result<Permit, WriteError> {
        let fail = |error| WriteError::from_io("look at", target, error);
        if self.reads(target).map_err(fail)? {
            return Err(WriteError::Protected {
                path: target.to_path_buf(),
                reason: "is read by this very run".to_owned(),
            });
        }
        let linked = target.is_symlink();
        let status = match followed(target).map_err(fail)? {
            None if linked => return protected(target, "is a link that leads nowhere"),
            None => return Ok(Permit::New),
            Some(status) => status,
        };
        match status.kind {
            Kind::File => {}
            Kind::Folder => {
                return Err(WriteError::IsFolder {
                    path: target.to_path_buf(),
                });
            }
            Kind::Link | Kind::Special => return protected(target, "is not a regular file"),
        }
        let shown = target;
        let real = real(target).map_err(fail)?;
        let (dir, name) = Dir::of(&real).map_err(fail)?;
        if let Some(written) = written
            && has(&dir, &name, written.bytes, &written.sha256).map_err(fail)?
        {
            return Ok(Permit::Same);
        }
        // Force does not reach through a link at the file's name or in place of its folder.
        let behind_link = linked || parent_of(shown).is_symlink();
        if self.force && !behind_link {
            return Ok(Permit::Replace);
        }
        let last = written.is_some();
        let forced = || Self {
            force: true,
            ..self.clone()
        };
        match self.own(&dir, &real, &status, last) {
            Ok(()) => Ok(Permit::Replace),
            Err(_) if behind_link && forced().own(&dir, &real, &status, last).is_err() => {
                protected(shown, "is behind a link and not known to be ours")
            }
            Err(reason) => Err(WriteError::OutputExists {
                path: shown.to_path_buf(),
                reason,
            }),
        }
    }

    /// `Ok` when the file at `target` in `dir` is known to be ours, else the reason why it is not.
    fn own(
        &self,
        dir: &Dir,
        target: &Path,
        status: &EntryStatus,
        last: bool,
    ) -> Result<(), String> {
        let name = target.file_name().unwrap_or_default();
        let record = match &self.evidence {
            Evidence::SameBytes(mark) if self.force => {
                let kind = &mark[..mark.len().min(KIND_BYTES)];
                return match begins_with(dir, name, kind) {
                    true if !kind.is_empty() => Ok(()),
                    _ => Err("and is of another kind".to_owned()),
                };
            }
            Evidence::SameBytes(mark) if !last => {
                return match begins_with(dir, name, mark) {
                    true => Ok(()),
                    false => Err("and was not made from these inputs".to_owned()),
                };
            }
            Evidence::SameBytes(_) => {
                let still = |it: &Written| has(dir, name, it.bytes, &it.sha256).unwrap_or(false);
                return match self.taken_up.as_ref().is_some_and(still) {
                    true => Ok(()),
                    false => Err("and differs".to_owned()),
                };
            }
            Evidence::Record { path, .. } => path,
        };
        let shown = record.display();
        let found = self.record(record)?;
        let is = |path: &Path| followed(path).is_ok_and(|it| it.is_some_and(|it| it.is(status)));
        if is(record) || is_timing(dir, name) {
            return Ok(());
        }
        let note = Dir::of(&ReplacedNote::path(record))
            .ok()
            .and_then(|(dir, name)| ReplacedNote::read_in(&dir, &name));
        let replaced = note.map(ReplacedNote::replaced).unwrap_or_default();
        let mut lists = false;
        for entry in found.files().into_iter().chain(replaced) {
            if is(&parent_of(record).join(&entry.path)) {
                lists = true;
                if has(dir, name, entry.bytes, &entry.sha256).unwrap_or(false) {
                    return Ok(());
                }
            }
        }
        Err(if lists {
            format!("and was changed since (says {shown})")
        } else {
            format!("and {shown} does not list it")
        })
    }

    /// The record at `path` if it is ours, and of this run's inputs and options or need not be; else the
    /// reason why it is not.
    pub(super) fn record(&self, path: &Path) -> Result<Record, String> {
        let name = path.display();
        if followed(path).map_or(true, |there| there.is_none()) {
            return Err(format!("and no {name} states what it was made from"));
        }
        let Some(record) = Record::read(path) else {
            return Err(format!("and {name} does not state what it was made from"));
        };
        let state = record.state();
        if state == State::Changed {
            return Err(format!(
                "and {name}, which states what it was made from, was changed since"
            ));
        }
        if self.force {
            return Ok(record);
        }
        if !record.is_of(&self.inputs) {
            return Err(format!("and was made from other inputs (says {name})"));
        }
        if state == State::Older {
            let why = "is of an older version, which states no options";
            return Err(format!("and {name} {why}"));
        }
        let differences = match &self.evidence {
            Evidence::Record { options, .. } => record.differs_in(options),
            Evidence::SameBytes(_) => None,
        };
        match differences {
            None => Ok(record),
            Some(differences) => Err(format!(
                "and was made with other options: {differences} (says {name})"
            )),
        }
    }

    /// Whether this run reads `target`.
    pub(super) fn reads(&self, target: &Path) -> io::Result<bool> {
        let there = followed(target)?;
        for input in &self.inputs {
            if input.path == "-" {
                let stream = EntryStatus::from(rustix::fs::fstat(io::stdin())?);
                let is_it = there.is_some_and(|it| it.kind == Kind::File && it.is(&stream));
                if is_it {
                    return Ok(true);
                }
            } else if same_place(Path::new(&input.path), target, there)? {
                return Ok(true);
            }
        }
        for path in &self.protected {
            if same_place(path, target, there)? || (path.is_dir() && lies_in(target, path)) {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Refuses outputs of one command that would have the same name.
///
/// # Errors
/// [`WriteError::Content`].
pub fn check_distinct<P: AsRef<Path>>(
    outputs: impl IntoIterator<Item = P>,
) -> Result<(), WriteError> {
    let outputs: Vec<P> = outputs.into_iter().collect();
    for (number, output) in outputs.iter().enumerate() {
        let output = output.as_ref();
        let look = |error| WriteError::from_io("look at", output, error);
        let there = followed(output).map_err(look)?;
        let special = there.is_some_and(|there| there.kind == Kind::Special);
        for earlier in &outputs[..number] {
            if !special && same_place(earlier.as_ref(), output, there).map_err(look)? {
                return Err(WriteError::same_name(output));
            }
        }
    }
    Ok(())
}

/// Whether `path` is the file `there` at `target`, by what the system says where both exist, else by
/// their names.
fn same_place(path: &Path, target: &Path, there: Option<EntryStatus>) -> io::Result<bool> {
    let (one, other) = match (followed(path), there) {
        (Ok(Some(one)), Some(other)) => return Ok(one.is(&other)),
        (Ok(None), None) => (path, target),
        _ => return Ok(false),
    };
    Ok(one.file_name() == other.file_name() && {
        let folders = [one, other].map(|it| followed(parent_of(it)));
        match folders {
            [Ok(Some(one)), Ok(Some(other))] => one.is(&other),
            _ => parent_of(one) == parent_of(other),
        }
    })
}

/// Whether `target` is in `folder` or below it.
fn lies_in(target: &Path, folder: &Path) -> bool {
    match (
        real(target).and_then(|it| parent_of(&it).canonicalize()),
        folder.canonicalize(),
    ) {
        (Ok(parent), Ok(folder)) => parent.starts_with(folder),
        _ => false,
    }
}

/// Whether the regular file `name` in `dir` begins with `mark`.
fn begins_with(dir: &Dir, name: &OsStr, mark: &[u8]) -> bool {
    let mut head = vec![0; mark.len()];
    let read = dir
        .file(name)
        .and_then(|mut file| file.read_exact(&mut head));
    read.is_ok() && head == mark
}

/// Where the file at `target` is: a link leads elsewhere.
pub(super) fn real(target: &Path) -> io::Result<PathBuf> {
    if target.is_symlink() {
        target.canonicalize()
    } else {
        Ok(target.to_path_buf())
    }
}

fn protected<T>(target: &Path, reason: &str) -> Result<T, WriteError> {
    Err(WriteError::Protected {
        path: target.to_path_buf(),
        reason: reason.to_owned(),
    })
}
