//! Finds the files of a folder that are ours, and moves the rest from an old folder into a new one.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::io;
use std::path::Path;

use super::dir::{Dir, EntryStatus, Kind, followed};
use super::names::MANIFEST;
use super::record::{Record, digest, has, is_timing};
use super::{Overwrite, WriteError};
use crate::artefact::FileEntry;

/// The seconds of the run that wrote the folder.
const TIMING: &str = "timing.json";

/// How many names are tried for what is put aside.
const NAMES_MAX: u32 = 10_000;

/// The files of a folder that are known to be ours.
pub(super) struct Owned {
    /// Those of the manifest, where it is one of ours.
    listed: Option<BTreeMap<String, FileEntry>>,
    /// Inputs of this run.
    inputs: Vec<EntryStatus>,
}

impl Owned {
    /// As the manifest in `folder` lists them, but for what this run reads.
    pub fn new(folder: &Dir, overwrite: &Overwrite) -> Self {
        let inputs = overwrite.inputs().iter();
        Self {
            listed: Record::read_in(folder, MANIFEST).map(Record::listed),
            inputs: inputs
                .filter_map(|input| followed(Path::new(&input.path)).ok()?)
                .collect(),
        }
    }

    /// Whether the folder's manifest is one of ours.
    pub(crate) fn has_manifest(&self) -> bool {
        self.listed.is_some()
    }

    /// Whether the file at `path` in the folder, `name` in `dir`, is as we wrote it.
    fn owns(&self, path: &str, dir: &Dir, name: &OsStr) -> io::Result<bool> {
        let Some(listed) = &self.listed else {
            return Ok(false);
        };
        let status = dir.status(name)?;
        if self.reads(status) {
            return Ok(false);
        }
        match listed.get(path) {
            _ if path == MANIFEST => Ok(status.is_some_and(|it| it.kind == Kind::File)),
            Some(entry) => has(dir, name, entry.bytes, &entry.sha256),
            None => Ok(path == TIMING && is_timing(dir, name)),
        }
    }

    fn reads(&self, status: Option<EntryStatus>) -> bool {
        status.is_some_and(|status| self.inputs.iter().any(|input| input.is(&status)))
    }

    /// Whether any file below the folder `path` is listed.
    fn lists_below(&self, path: &str) -> bool {
        let below = format!("{path}/");
        let mut listed = self.listed.iter().flat_map(BTreeMap::keys);
        listed.any(|listed| listed.starts_with(&below))
    }

    /// Refuses to write files where `folder`, shown as `target`, has something else of their names:
    /// unless that is ours or has the same bytes. With force a regular file makes way that this run does
    /// not read.
    ///
    /// # Errors
    /// [`WriteError::OutputExists`], [`WriteError::Protected`].
    pub fn check(
        &self,
        folder: &Dir,
        target: &Path,
        written: &[FileEntry],
        overwrite: &Overwrite,
    ) -> Result<(), WriteError> {
        for entry in written {
            let path = target.join(&entry.path);
            let state = self
                .state(folder, entry, overwrite.forced())
                .map_err(|error| WriteError::from_io("look at", &path, error))?;
            match state {
                State::Free => {}
                State::Input if entry.sha256.is_empty() => {}
                State::Input => {
                    return Err(WriteError::Protected {
                        path,
                        reason: "is read by this very run".to_owned(),
                    });
                }
                State::Foreign(Kind::File) if overwrite.forced() => {}
                State::Foreign(Kind::Folder | Kind::Link | Kind::Special) if overwrite.forced() => {
                    return Err(WriteError::Protected {
                        path,
                        reason: "is not a regular file".to_owned(),
                    });
                }
                State::Foreign(_) => {
                    return Err(WriteError::OutputExists {
                        path,
                        reason: "and is not as this program wrote it".to_owned(),
                    });
                }
            }
        }
        Ok(())
    }

    /// With `force` it is not looked whether a regular file is ours: it makes way either way.
    fn state(&self, folder: &Dir, entry: &FileEntry, forced: bool) -> io::Result<State> {
        let mut dir = folder.clone();
        let mut parts = entry.path.split('/');
        let name = OsStr::new(parts.next_back().unwrap_or_default());
        for part in parts {
            dir = match dir.status(part)?.map(|status| status.kind) {
                None => return Ok(State::Free),
                Some(Kind::Folder) => dir.child(part)?,
                Some(kind @ (Kind::File | Kind::Link | Kind::Special)) => {
                    return Ok(State::Foreign(kind));
                }
            };
        }
        let Some(status) = dir.status(name)? else {
            return Ok(State::Free);
        };
        if forced && status.kind == Kind::File && !self.reads(Some(status)) {
            return Ok(State::Free);
        }
        let same = has(&dir, name, entry.bytes, &entry.sha256)?;
        Ok(if same || self.owns(&entry.path, &dir, name)? {
            State::Free
        } else if self.reads(Some(status)) {
            State::Input
        } else {
            State::Foreign(status.kind)
        })
    }
}

/// State of the name at which a new file of a folder is written.
enum State {
    /// Nothing, or what may go.
    Free,
    /// Inputs of this run.
    Input,
    /// Files not known to be ours.
    Foreign(Kind),
}

/// Gives the folder `new`, and what it has in common with `old`, the owners and modes there.
pub(super) fn give_modes(old: &Dir, new: &Dir) -> io::Result<()> {
    for name in new.names()? {
        let (Some(was), Some(is)) = (old.status(&name)?, new.status(&name)?) else {
            continue;
        };
        match (was.kind, is.kind) {
            (Kind::File, Kind::File) => was.give(&new.file(&name)?)?,
            (Kind::Folder, Kind::Folder) => give_modes(&old.child(&name)?, &new.child(&name)?)?,
            _ => {}
        }
    }
    old.own_status()?.give(new)
}

/// Removes from `old` what is ours, but for its manifest, and moves the rest into `new`. Where `new`
/// has that name too, it comes beside it as `<name>.kept-1`.
pub(super) fn absorb(old: &Dir, new: &Dir, owned: &Owned) -> io::Result<()> {
    absorb_below(old, new, owned, "")
}

fn absorb_below(old: &Dir, new: &Dir, owned: &Owned, below: &str) -> io::Result<()> {
    for name in old.names()? {
        // Ours have plain names.
        let path = format!("{below}{}", name.to_string_lossy());
        let Some(status) = old.status(&name)? else {
            continue;
        };
        if status.kind == Kind::File && owned.owns(&path, old, &name)? {
            if path != MANIFEST {
                old.remove_file(&name)?;
            }
            continue;
        }
        let there = new.status(&name)?;
        if status.kind == Kind::File && same_bytes(old, new, &name, there)? {
            old.remove_file(&name)?;
            continue;
        }
        let both = there.is_some_and(|there| there.kind == Kind::Folder);
        let merges = both || (there.is_none() && owned.lists_below(&path));
        if status.kind == Kind::Folder && merges {
            let from = old.child(&name)?;
            let to = new.child_or_new(&name)?;
            if !both {
                status.give(&to)?;
            }
            absorb_below(&from, &to, owned, &format!("{path}/"))?;
            old.remove_empty(&name)?;
            if !both {
                // Goes only when nothing was kept in it.
                let _ = new.remove_empty(&name);
            }
            continue;
        }
        move_beside(old, new, &name)?;
    }
    Ok(())
}

/// Whether the file `name` is the same in both.
fn same_bytes(old: &Dir, new: &Dir, name: &OsStr, there: Option<EntryStatus>) -> io::Result<bool> {
    let (Some(there), Some(here)) = (there, old.status(name)?) else {
        return Ok(false);
    };
    Ok(there.kind == Kind::File
        && there.bytes == here.bytes
        && digest(new, name)? == digest(old, name)?)
}

/// Moves `name`, or to the first name like it that nothing has.
fn move_beside(old: &Dir, new: &Dir, name: &OsStr) -> io::Result<()> {
    for number in 0..NAMES_MAX {
        let mut to = OsString::from(name);
        if number > 0 {
            to.push(format!(".kept-{number}"));
        }
        match old.rename_new(name, new, &to) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            outcome => return outcome,
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}
