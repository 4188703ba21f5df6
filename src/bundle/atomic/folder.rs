//! Whole folders: a bundle is whole or absent.
//!
//! 1. All files are written and fsynced in a temporary folder beside the target.
//! 2. Under a lock on the parent folder: where nothing is at the target, the temporary folder is
//!    renamed to it; else it is renamed to `.<name>.<identities>.fluxform-old` and changes places with
//!    the target. The parent is fsynced.
//! 3. What is not known to be ours in the old folder (all but the files that our manifest there lists
//!    and that are on the disk as listed) is moved into the new one; the rest is removed.
//!
//! So the target's name holds a whole folder at every moment. A run killed in steps 2 or 3 leaves a
//! folder under the other name: the old one, or a new one that never came into place. The name holds
//! the identities of both, so the next [`FolderDraft::begin`] knows which it is, or that it is neither
//! and none of ours. It does step 3 with the old one and removes the new one.
//!
//! Where the system knows no exchange, the target is renamed to the other name and the temporary
//! folder to the target. Between the two the name is absent for some microseconds: a run killed there
//! leaves the whole old folder under its other name, and the next one puts it back.

use std::ffi::{OsStr, OsString};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::absorb::{Owned, absorb, give_modes};
use super::created_dirs::{MadeFolders, made_in};
use super::digest::{Durability, fill};
use super::dir::{Dir, Kind, short_identity};
use super::names::{MANIFEST, OLD, check_name, parent_of};
use super::overwrite::real;
use super::record::{Record, State};
use super::temporary::{TemporaryFolder, clean_leftovers, is_temporary};
use super::{Overwrite, WriteError};
use crate::artefact::FileEntry;

/// Characters of the target's name in the name of the folder that is put aside.
const NAME_MAX: usize = 100;

/// A folder in the making; dropped without [`FolderDraft::commit`] it leaves nothing.
#[derive(Debug)]
pub struct FolderDraft {
    place: TargetPlace,
    overwrite: Overwrite,
    draft: TemporaryFolder,
    /// Files written so far.
    written: Vec<FileEntry>,
    /// Dropped after the draft: what is still empty then goes again.
    _made: MadeFolders,
}

/// Where the folder is to be.
#[derive(Debug)]
struct TargetPlace {
    target: PathBuf,
    parent: Dir,
    name: OsString,
    /// Whether a link was given, which led here.
    linked: bool,
}

impl FolderDraft {
    /// Refuses when the folder at `target` must not be replaced by one with files of these names, as
    /// far as they are known. Nothing on the disk is changed.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn check(target: &Path, overwrite: &Overwrite, names: &[&str]) -> Result<(), WriteError> {
        let linked = target.is_symlink();
        let target = resolved(target)?;
        let entries: Vec<FileEntry> = names.iter().map(|name| unknown(name)).collect();
        let fail = |error| WriteError::from_io("write", &target, error);
        match Dir::open(parent_of(&target)) {
            Ok(parent) => {
                parent.writable().map_err(fail)?;
                TargetPlace::of(&target, parent, linked)?.check(overwrite, &entries)
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            Err(error) => Err(fail(error)),
        }
    }

    /// Begins a folder that will be at `target`. Finishes what a killed run left half done.
    ///
    /// # Errors
    /// [`WriteError`] when the target is not ours to replace or the place cannot be written to.
    pub fn begin(target: &Path, overwrite: Overwrite) -> Result<Self, WriteError> {
        Self::check(target, &overwrite, &[])?;
        let linked = target.is_symlink();
        let target = resolved(target)?;
        let mode = if target.is_dir() { 0o700 } else { 0o777 };
        let ((parent, draft), made) = made_in(parent_of(&target), |folder| {
            let parent = Dir::open(folder)?;
            let draft = TemporaryFolder::new(&parent, mode)?;
            Ok((parent, draft))
        })
        .map_err(|error| error.of("write", &target))?;
        // Dropped in the reverse order: the draft goes before the folder that was made for it.
        let (made, draft) = (made, draft);
        let place = TargetPlace::of(&target, parent, linked)?;
        {
            let _lock = place.parent.lock(parent_of(&place.target));
            place
                .recover()
                .map_err(|error| WriteError::from_io("recover", &target, error))?;
        }
        place.check(&overwrite, &[])?;
        clean_leftovers(&place.parent);
        Ok(Self {
            place,
            overwrite,
            draft,
            written: Vec::new(),
            _made: made,
        })
    }

    /// Writes one file; `name` is relative, with `/` between folders.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(
        &mut self,
        name: &str,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<FileEntry, WriteError> {
        check_name(name)?;
        let write = || -> io::Result<_> {
            let mut dir = self.draft.dir.clone();
            let mut parts = name.split('/');
            let file = parts.next_back().unwrap_or_default();
            for part in parts {
                dir = dir.child_or_new(part)?;
            }
            let mut file = dir.new_file(file, 0o666)?;
            let written = fill(&mut file, Durability::Forced, Box::new(content))?;
            file.sync_all()?;
            Ok(written)
        };
        let shown = self.place.target.join(name);
        let written = write().map_err(|error| WriteError::from_io("write", &shown, error))?;
        let entry = FileEntry {
            path: name.to_owned(),
            bytes: written.bytes,
            sha256: written.sha256,
        };
        self.written.push(entry.clone());
        Ok(entry)
    }

    /// Puts the folder in place.
    ///
    /// # Errors
    /// [`WriteError`]; the target is then as it was.
    pub fn commit(mut self) -> Result<(), WriteError> {
        let place = &self.place;
        let fail = |error| WriteError::from_io("write", &place.target, error);
        let _lock = place.parent.lock(parent_of(&place.target));
        place.recover().map_err(fail)?;
        // Another run may have been faster.
        place.check(&self.overwrite, &self.written)?;
        let Some(old) = place.folder().map_err(fail)? else {
            sync_tree(&self.draft.dir).map_err(fail)?;
            let name = self.draft.name().to_owned();
            place
                .parent
                .rename_new(&name, &place.parent, &place.name)
                .map_err(fail)?;
            self.draft.keep();
            return place.parent.sync().map_err(fail);
        };
        give_modes(&old, &self.draft.dir).map_err(fail)?;
        sync_tree(&self.draft.dir).map_err(fail)?;
        let aside = place.aside(&old, &self.draft.dir);
        let exchanged = place.replace(&mut self.draft, &aside).map_err(fail)?;
        if let Err(error) = place.parent.sync() {
            // Which of the two a lost system would find there is unknown: back to the one that was.
            if exchanged && matches!(place.parent.exchange(&aside, &place.name), Ok(true)) {
                let _ = place.discard(&aside, &self.draft.dir);
            }
            return Err(fail(error));
        }
        place
            .absorb(&aside, &old, &self.draft.dir, &self.overwrite)
            .map_err(fail)
    }
}

impl TargetPlace {
    fn of(target: &Path, parent: Dir, linked: bool) -> Result<Self, WriteError> {
        let name = target.file_name().ok_or_else(|| WriteError::BadName {
            name: target.display().to_string(),
        })?;
        Ok(Self {
            target: target.to_path_buf(),
            parent,
            name: name.to_owned(),
            linked,
        })
    }

    /// The folder that is there.
    fn folder(&self) -> io::Result<Option<Dir>> {
        match self.parent.child(&self.name) {
            Ok(folder) => Ok(Some(folder)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Refuses a folder that files of these names must not go to. Force does not reach through a link:
    /// what it leads to must be ours.
    fn check(&self, overwrite: &Overwrite, written: &[FileEntry]) -> Result<(), WriteError> {
        if !(self.linked && overwrite.forced()) {
            return self.check_here(overwrite, written);
        }
        let unforced = overwrite.unforced();
        self.check_here(&unforced, written)
            .map_err(|error| match error {
                WriteError::OutputExists { .. } => WriteError::Protected {
                    path: self.target.clone(),
                    reason: "is behind a link and not ours".to_owned(),
                },
                error => error,
            })
    }

    fn check_here(&self, overwrite: &Overwrite, written: &[FileEntry]) -> Result<(), WriteError> {
        let fail = |error| WriteError::from_io("write", &self.target, error);
        let folder = match self.folder().map_err(fail)? {
            Some(folder) => Some(folder),
            // A killed run may have put it aside.
            None => self.put_aside().map_err(fail)?.map(|(_, folder)| folder),
        };
        let Some(folder) = folder else { return Ok(()) };
        folder.writable().map_err(fail)?;
        if folder.names().map_err(fail)?.is_empty() {
            return Ok(());
        }
        if !overwrite.forced()
            && let Some(record) = overwrite.record_path()
        {
            // Its name may not lead there yet.
            let record = folder.path().join(record.file_name().unwrap_or_default());
            overwrite.record(&record).map_err(|reason| {
                let path = self.target.clone();
                WriteError::OutputExists { path, reason }
            })?;
        }
        Owned::new(&folder, overwrite).check(&folder, &self.target, written, overwrite)
    }

    /// Under which name a folder is put aside while another takes its place.
    fn aside(&self, old: &Dir, new: &Dir) -> OsString {
        let identities = format!("{}-{}", short_identity(old), short_identity(new));
        format!("{}{identities}{OLD}", self.aside_start()).into()
    }

    fn aside_start(&self) -> String {
        let name = self.name.to_string_lossy();
        let short: String = name.chars().take(NAME_MAX / 4).collect();
        let short = if name.len() <= NAME_MAX {
            &*name
        } else {
            &*short
        };
        format!(".{short}.")
    }

    /// The identities of the old and the new folder in the name of one that was put aside.
    fn identities<'a>(&self, aside: &'a OsStr) -> Option<(&'a str, &'a str)> {
        let rest = aside.to_str()?.strip_prefix(self.aside_start().as_str())?;
        rest.strip_suffix(OLD)?.split_once('-')
    }

    /// A folder that a killed run put aside while nothing is at the target, and its name.
    fn put_aside(&self) -> io::Result<Option<(OsString, Dir)>> {
        for aside in self.parent.names()? {
            if let Some((old, _)) = self.identities(&aside)
                && let Ok(folder) = self.parent.child(&aside)
                && short_identity(&folder) == old
            {
                return Ok(Some((aside, folder)));
            }
        }
        Ok(None)
    }

    /// Puts the draft at the target, and what is there at `aside`; whether in one call. On an error the
    /// target is as it was, if the system allows that, and nothing but the draft is left.
    fn replace(&self, draft: &mut TemporaryFolder, aside: &OsStr) -> io::Result<bool> {
        let temporary = draft.name().to_owned();
        // Not from its temporary name: after the exchange the user's own files are under it, and what
        // is temporary is cleared.
        self.parent.rename_new(&temporary, &self.parent, aside)?;
        let back = || self.parent.rename_new(aside, &self.parent, &temporary);
        match self.parent.exchange(aside, &self.name) {
            Ok(true) => {
                draft.keep();
                Ok(true)
            }
            Ok(false) => {
                back()?;
                self.replace_by_renames(&temporary, aside)?;
                draft.keep();
                Ok(false)
            }
            Err(error) => {
                back()?;
                Err(error)
            }
        }
    }

    /// As [`Self::replace`], on systems without an exchange: between the two renames nothing is at the
    /// target.
    fn replace_by_renames(&self, draft: &OsStr, aside: &OsStr) -> io::Result<()> {
        let parent = &self.parent;
        parent.rename_new(&self.name, parent, aside)?;
        parent
            .rename_new(draft, parent, &self.name)
            .inspect_err(|_| {
                let _ = parent.rename_new(aside, parent, &self.name);
            })
    }

    /// Finishes or undoes a swap that was cut short.
    fn recover(&self) -> io::Result<()> {
        for aside in self.parent.names()? {
            let Some((old, new)) = self.identities(&aside) else {
                continue;
            };
            // A link or a file is none of ours.
            let Ok(folder) = self.parent.child(&aside) else {
                continue;
            };
            let found = short_identity(&folder);
            let target = self.folder()?;
            match &target {
                _ if found == new => self.discard(&aside, &folder)?,
                Some(target) if found == old && short_identity(target) == new => {
                    self.absorb(&aside, &folder, target, &Overwrite::force())?;
                }
                None if found == old => {
                    self.parent.rename_new(&aside, &self.parent, &self.name)?;
                }
                // Nothing that this program put there.
                Some(_) | None => {}
            }
        }
        Ok(())
    }

    /// Removes a draft that never came into place.
    fn discard(&self, aside: &OsStr, draft: &Dir) -> io::Result<()> {
        draft.remove_content()?;
        self.parent.remove_empty(aside)
    }

    /// Moves what is not ours from the old folder, which is put aside, into the new one and removes the
    /// rest. May be cut short anywhere and begun again: the old manifest, which states what is ours,
    /// goes last.
    fn absorb(&self, aside: &OsStr, old: &Dir, new: &Dir, overwrite: &Overwrite) -> io::Result<()> {
        let owned = Owned::new(old, overwrite);
        absorb(old, new, &owned)?;
        if owned.has_manifest() {
            old.remove_file(MANIFEST)?;
        }
        self.parent.remove_empty(aside)
    }
}

/// An entry of which only the name is known.
fn unknown(name: &str) -> FileEntry {
    FileEntry {
        path: name.to_owned(),
        bytes: 0,
        sha256: String::new(),
    }
}

/// Where the folder at `target` is: a link leads elsewhere.
fn resolved(target: &Path) -> Result<PathBuf, WriteError> {
    let found = real(target).map_err(|_| WriteError::Protected {
        path: target.to_path_buf(),
        reason: "is a link that leads nowhere".to_owned(),
    })?;
    check_not_our_own(&found)?;
    Ok(found)
}

/// A folder named like our temporary ones could be taken for a killed run's.
fn check_not_our_own(target: &Path) -> Result<(), WriteError> {
    let own = |name: &str| is_temporary(name) || (name.starts_with('.') && name.ends_with(OLD));
    let named = |path: &Path| {
        path.file_name()
            .is_some_and(|name| own(&name.to_string_lossy()))
    };
    if named(target) || named(parent_of(target)) {
        return Err(WriteError::Content {
            path: target.to_path_buf(),
            message: "folders of that name are temporary ones, which the next run clears; choose \
                      another name"
                .to_owned(),
        });
    }
    Ok(())
}

/// The files that the manifest or sidecar at `path` lists; none where it is none of ours.
pub(crate) fn listed_files(path: &Path) -> Vec<String> {
    let record = Record::read(path).filter(|record| record.state() != State::Changed);
    let files = record.map(Record::files).unwrap_or_default();
    files.into_iter().map(|file| file.path).collect()
}

/// Makes the names in a folder and its subfolders durable (their files are already).
fn sync_tree(folder: &Dir) -> io::Result<()> {
    for name in folder.names()? {
        if folder
            .status(&name)?
            .is_some_and(|it| it.kind == Kind::Folder)
        {
            sync_tree(&folder.child(&name)?)?;
        }
    }
    folder.sync()
}

#[cfg(test)]
mod tests;
