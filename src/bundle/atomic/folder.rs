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
use std::path::{Component, Path, PathBuf};

use super::absorb::{Owned, absorb, give_modes};
use super::dir::{Dir, Kind, short_identity};
use super::file::fill;
use super::made::{MadeFolders, made_in};
use super::overwrite::real;
use super::record::Record;
use super::temporary::{TemporaryFolder, clean_leftovers, is_temporary};
use super::{OLD, Overwrite, WriteError, parent_of};
use crate::artefact::FileEntry;

/// The file whose presence makes a folder a bundle.
pub(super) const MANIFEST: &str = "manifest.json";

/// Characters of the target's name that stand in the name of the folder that is put aside.
const NAME_MAX: usize = 100;

/// A folder in the making; dropped without [`FolderDraft::commit`] it leaves nothing.
#[derive(Debug)]
pub struct FolderDraft {
    place: Place,
    overwrite: Overwrite,
    draft: TemporaryFolder,
    /// What was written so far.
    written: Vec<FileEntry>,
    /// Dropped after the draft: what is still empty then goes again.
    _made: MadeFolders,
}

/// Where the folder is to be.
#[derive(Debug)]
struct Place {
    target: PathBuf,
    parent: Dir,
    name: OsString,
}

impl FolderDraft {
    /// Refuses when the folder at `target` must not be replaced by one with files of these names, as
    /// far as they are known. Nothing on the disk is changed.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn check(target: &Path, overwrite: &Overwrite, names: &[&str]) -> Result<(), WriteError> {
        let target = resolved(target)?;
        let entries: Vec<FileEntry> = names.iter().map(|name| unknown(name)).collect();
        let fail = |error| WriteError::from_io("write", &target, error);
        match Dir::open(parent_of(&target)) {
            Ok(parent) => {
                parent.writable().map_err(fail)?;
                Place::of(&target, parent)?.check(overwrite, &entries)
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
        let place = Place::of(&target, parent)?;
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
            let written = fill(&mut file, content)?;
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

impl Place {
    fn of(target: &Path, parent: Dir) -> Result<Self, WriteError> {
        let name = target.file_name().ok_or_else(|| WriteError::BadName {
            name: target.display().to_string(),
        })?;
        Ok(Self {
            target: target.to_path_buf(),
            parent,
            name: name.to_owned(),
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

    /// Refuses a folder that files of these names must not go to.
    fn check(&self, overwrite: &Overwrite, written: &[FileEntry]) -> Result<(), WriteError> {
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
    /// rest. May be cut short anywhere and begun again: the old manifest, which tells what is ours,
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

/// A name inside a bundle: relative, `/`-separated plain names, none of them `.` or `..`.
pub(crate) fn check_name(name: &str) -> Result<(), WriteError> {
    let plain = Path::new(name)
        .components()
        .all(|part| matches!(part, Component::Normal(_)));
    let odd = |c: char| c == '\\' || c == ':' || c.is_control();
    // `components` folds "a//b", "a/./b" and "a/": their number tells.
    let parts = Path::new(name).components().count();
    if name.is_empty() || !plain || name.contains(odd) || parts != name.split('/').count() {
        return Err(WriteError::BadName {
            name: name.to_owned(),
        });
    }
    Ok(())
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
    let listed = Record::read(path).map(Record::listed).unwrap_or_default();
    listed.into_keys().collect()
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
mod tests {
    use std::collections::{BTreeMap, BTreeSet};
    use std::fs;

    use super::*;
    use crate::artefact::Input;

    #[test]
    fn a_bundle_named_like_a_temporary_folder_is_refused_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        for name in [
            ".fluxform-7.tmp",
            ".bump.fluxform-old",
            ".fluxform-7.tmp/bump",
        ] {
            let target = folder.path().join(name);
            let refused = FolderDraft::begin(&target, Overwrite::force()).unwrap_err();
            assert!(refused.to_string().contains("temporary"), "{refused}");
            assert_eq!(folder.path().read_dir().unwrap().count(), 0);
        }
    }

    /// A manifest of ours that lists these files, made from `a.toml`.
    fn manifest(files: &[FileEntry]) -> String {
        let inputs = [Input::of_bytes("a.toml", b"a")];
        serde_json::json!({ "schema_version": "1.2.0", "fluxform_version": "0.1.0",
            "inputs": inputs, "files": files })
        .to_string()
    }

    fn ours(target: &Path) -> Overwrite {
        let inputs = [Input::of_bytes("a.toml", b"a")];
        Overwrite::new(false, target.join(MANIFEST), &inputs)
    }

    /// A folder of one file and its manifest.
    fn put(target: &Path, text: &str) -> Result<(), WriteError> {
        put_files(target, ours(target), &[("a.txt", text)])
    }

    fn put_files(
        target: &Path,
        overwrite: Overwrite,
        files: &[(&str, &str)],
    ) -> Result<(), WriteError> {
        let mut draft = FolderDraft::begin(target, overwrite)?;
        let entries: Vec<FileEntry> = files
            .iter()
            .map(|(name, text)| draft.write(name, |out| out.write_all(text.as_bytes())))
            .collect::<Result<_, _>>()?;
        draft.write(MANIFEST, |out| out.write_all(manifest(&entries).as_bytes()))?;
        draft.commit()
    }

    /// Every file below with its bytes, links by where they lead.
    fn tree(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut found = BTreeMap::new();
        for entry in folder.read_dir().unwrap() {
            let path = entry.unwrap().path();
            let kind = path.symlink_metadata().unwrap();
            if kind.is_dir() {
                found.insert(path.clone(), Vec::new());
                found.extend(tree(&path));
            } else if kind.is_symlink() {
                let to = fs::read_link(&path).unwrap();
                found.insert(path, to.to_string_lossy().into_owned().into_bytes());
            } else {
                found.insert(path.clone(), fs::read(&path).unwrap());
            }
        }
        found
    }

    fn names(folder: &Path) -> BTreeSet<String> {
        let entries = folder.read_dir().unwrap();
        entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    #[cfg(target_os = "linux")]
    #[test]
    #[allow(clippy::print_stderr)] // a skipped test says so
    fn a_folder_is_there_at_every_moment_while_it_is_replaced() {
        use std::sync::atomic::{AtomicBool, Ordering};
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bump");
        put(&target, "0").unwrap();
        fs::write(target.join("mine.txt"), "mine").unwrap();
        fs::create_dir(folder.path().join("probe")).unwrap();
        let dir = Dir::open(folder.path()).unwrap();
        if !dir.exchange("bump", "probe").unwrap() {
            eprintln!("skipped: this file system knows no exchange");
            return;
        }
        dir.exchange("bump", "probe").unwrap();
        let (done, begun) = (AtomicBool::new(false), AtomicBool::new(false));
        // Who had found the older folder may find it cleared: then the newer one is there.
        let read = |name: &str| (0..9).find_map(|_| fs::read(target.join(name)).ok());
        std::thread::scope(|scope| {
            let reader = scope.spawn(|| {
                let (mut looks, mut absent) = (0, 0);
                while !done.load(Ordering::Relaxed) {
                    let whole = |name| read(name).is_some_and(|bytes| !bytes.is_empty());
                    let there = target.is_dir() && whole("a.txt") && whole(MANIFEST);
                    absent += usize::from(!there);
                    looks += 1;
                    begun.store(true, Ordering::Relaxed);
                }
                (looks, absent)
            });
            while !begun.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
            let put = (0..200).try_for_each(|round| put(&target, &round.to_string()));
            done.store(true, Ordering::Relaxed);
            let (looks, absent) = reader.join().unwrap();
            put.unwrap();
            assert!(looks > 200, "only {looks} looks");
            assert_eq!(absent, 0, "of {looks} looks");
        });
        assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"199");
        assert_eq!(fs::read(target.join("mine.txt")).unwrap(), b"mine");
        assert_eq!(names(folder.path()).len(), 2);
    }

    /// A run that was killed right after it renamed its draft, or right after the exchange.
    fn killed(target: &Path, text: &str, exchanged: bool) {
        let place = Place::of(target, Dir::open(parent_of(target)).unwrap()).unwrap();
        let mut draft = FolderDraft::begin(target, ours(target)).unwrap();
        let entry = draft.write("a.txt", |out| out.write_all(text.as_bytes()));
        let manifest = manifest(&[entry.unwrap()]);
        draft
            .write(MANIFEST, |out| out.write_all(manifest.as_bytes()))
            .unwrap();
        let old = place.folder().unwrap().unwrap();
        let aside = place.aside(&old, &draft.draft.dir);
        let temporary = draft.draft.name().to_owned();
        place
            .parent
            .rename(&temporary, &place.parent, &aside)
            .unwrap();
        draft.draft.keep();
        if exchanged {
            assert!(place.parent.exchange(&aside, &place.name).unwrap());
        }
    }

    #[test]
    fn a_new_folder_that_never_came_into_place_goes_again() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bump");
        put(&target, "old").unwrap();
        fs::write(target.join("mine.txt"), "mine").unwrap();
        killed(&target, "new", false);
        assert_eq!(names(folder.path()).len(), 2);
        drop(FolderDraft::begin(&target, ours(&target)).unwrap());
        assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"old");
        assert_eq!(fs::read(target.join("mine.txt")).unwrap(), b"mine");
        assert_eq!(names(folder.path()), ["bump".to_owned()].into());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_swap_that_was_cut_short_is_finished() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bump");
        put(&target, "old").unwrap();
        fs::write(target.join("mine.txt"), "mine").unwrap();
        killed(&target, "new", true);
        assert!(!target.join("mine.txt").exists());
        drop(FolderDraft::begin(&target, ours(&target)).unwrap());
        assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"new");
        assert_eq!(fs::read(target.join("mine.txt")).unwrap(), b"mine");
        assert_eq!(names(folder.path()), ["bump".to_owned()].into());
    }

    #[test]
    fn without_an_exchange_two_renames_do_and_a_kill_between_them_is_undone() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bump");
        put(&target, "old").unwrap();
        put(&folder.path().join("draft"), "new").unwrap();
        let place = Place::of(&target, Dir::open(folder.path()).unwrap()).unwrap();
        let new = place.parent.child("draft").unwrap();
        let aside = place.aside(&place.folder().unwrap().unwrap(), &new);
        // The second rename fails: there is nothing to rename.
        place
            .replace_by_renames(OsStr::new("none"), &aside)
            .unwrap_err();
        assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"old");
        // Killed between the two.
        place.parent.rename("bump", &place.parent, &aside).unwrap();
        FolderDraft::check(&target, &ours(&target), &["a.txt"]).unwrap();
        drop(FolderDraft::begin(&target, ours(&target)).unwrap());
        assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"old");
        place
            .replace_by_renames(OsStr::new("draft"), &aside)
            .unwrap();
        assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"new");
        assert_eq!(
            fs::read(folder.path().join(&aside).join("a.txt")).unwrap(),
            b"old"
        );
    }

    /// Links and folders of every name under which a run puts a folder aside.
    #[test]
    fn a_link_or_a_folder_that_is_named_like_one_put_aside_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let [target, victim] = ["bump", "victim"].map(|name| folder.path().join(name));
        put(&target, "old").unwrap();
        put(&victim, "theirs").unwrap();
        fs::write(victim.join("thesis.tex"), "years").unwrap();
        let place = Place::of(&target, Dir::open(folder.path()).unwrap()).unwrap();
        let own = place.folder().unwrap().unwrap();
        let identities = place.aside(&own, &own).into_string().unwrap();
        let plain = ".bump.fluxform-old".to_owned();
        for aside in [plain, identities, ".bump.0-0.fluxform-old".to_owned()] {
            let aside = folder.path().join(aside);
            std::os::unix::fs::symlink(&victim, &aside).unwrap();
            let before = tree(&victim);
            let other = Overwrite::new(false, target.join(MANIFEST), &[]);
            let whole = tree(folder.path());
            FolderDraft::begin(&target, other).unwrap_err();
            assert_eq!(tree(folder.path()), whole, "refused");
            put(&target, "new").unwrap();
            assert!(tree(&victim) == before && aside.is_symlink());
            fs::remove_file(&aside).unwrap();
            // A copy of a bundle: not the folder that was there.
            fs::create_dir(&aside).unwrap();
            fs::write(aside.join("thesis.tex"), "years").unwrap();
            fs::copy(target.join(MANIFEST), aside.join(MANIFEST)).unwrap();
            let before = tree(&aside);
            put(&target, "newer").unwrap();
            put_files(&target, Overwrite::force(), &[("a.txt", "newest")]).unwrap();
            assert_eq!(tree(&aside), before);
            fs::remove_dir_all(&aside).unwrap();
        }
    }

    #[test]
    fn what_the_user_lays_into_a_bundle_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bump");
        let first = [("a.txt", "a"), ("plots/ours.svg", "ours"), ("b.txt", "b")];
        put_files(&target, ours(&target), &first).unwrap();
        let mine = [
            "timing.json",
            "timing_of_mine.csv",
            "report.html",
            "plots/mine.svg",
            "notes/deep/a",
        ];
        fs::create_dir_all(target.join("notes/deep")).unwrap();
        for name in mine {
            fs::write(target.join(name), "mine").unwrap();
        }
        fs::write(target.join("b.txt"), "edited").unwrap();
        std::os::unix::fs::symlink("/nowhere", target.join("link")).unwrap();
        put_files(&target, ours(&target), &[("a.txt", "a2")]).unwrap();
        for name in mine {
            assert_eq!(fs::read(target.join(name)).unwrap(), b"mine", "{name}");
        }
        assert_eq!(fs::read(target.join("b.txt")).unwrap(), b"edited");
        assert!(target.join("link").is_symlink() && !target.join("plots/ours.svg").exists());
        // Of the names of the new bundle.
        for (name, text) in [
            ("report.html", "page"),
            ("b.txt", "b3"),
            ("notes", "a file"),
        ] {
            let before = tree(folder.path());
            let files = [("a.txt", "a3"), (name, text)];
            let refused = put_files(&target, ours(&target), &files).unwrap_err();
            assert!(
                matches!(refused, WriteError::OutputExists { .. }),
                "{refused}"
            );
            assert!(refused.to_string().contains(name), "{refused}");
            assert_eq!(tree(folder.path()), before);
        }
        let forced = [
            ("report.html", "page"),
            ("b.txt", "b4"),
            ("notes", "a file"),
        ];
        put_files(&target, Overwrite::force(), &forced).unwrap();
        let read = |name: &str| fs::read(target.join(name)).unwrap();
        assert_eq!(
            (read("report.html"), read("b.txt")),
            (b"page".to_vec(), b"b4".to_vec())
        );
        assert_eq!(read("report.html.kept-1"), b"mine");
        assert_eq!(read("b.txt.kept-1"), b"edited");
        assert_eq!(read("notes.kept-1/deep/a"), b"mine");
        assert!(!target.join("a.txt").exists(), "listed and unchanged");
    }

    #[test]
    fn what_a_foreign_manifest_lists_is_not_ours() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bump");
        fs::create_dir(&target).unwrap();
        fs::write(target.join("thesis.tex"), "years").unwrap();
        let entry = serde_json::json!({ "path": "thesis.tex", "bytes": 5,
            "sha256": crate::artefact::sha256_hex(b"years") });
        let theirs = serde_json::json!({ "name": "theirs", "files": [entry] }).to_string();
        fs::write(target.join(MANIFEST), &theirs).unwrap();
        put_files(&target, ours(&target), &[("a.txt", "a")]).unwrap_err();
        put_files(&target, Overwrite::force(), &[("a.txt", "a")]).unwrap();
        assert_eq!(fs::read(target.join("thesis.tex")).unwrap(), b"years");
        let kept = fs::read(target.join("manifest.json.kept-1")).unwrap();
        assert_eq!(kept, theirs.as_bytes());
    }

    #[test]
    fn modes_survive_a_rewrite() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bump");
        let files = |text| [("a.txt", text), ("plots/ours.svg", text)];
        put_files(&target, ours(&target), &files("old")).unwrap();
        let modes = [
            ("", 0o700),
            ("plots", 0o710),
            ("a.txt", 0o600),
            (MANIFEST, 0o640),
        ];
        for (name, mode) in modes {
            let permissions = fs::Permissions::from_mode(mode);
            fs::set_permissions(target.join(name), permissions).unwrap();
        }
        put_files(&target, ours(&target), &files("new")).unwrap();
        assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"new");
        for (name, mode) in modes {
            let found = target.join(name).metadata().unwrap().permissions().mode();
            assert_eq!(found & 0o7777, mode, "{name}");
        }
    }

    /// An older bundle whose manifest is a pipe, never ends, or is larger than any.
    #[cfg(target_os = "linux")]
    #[test]
    fn the_manifest_of_a_replaced_folder_is_no_pipe_nor_endless() {
        use rustix::fs::{CWD, FileType, Mode, mknodat};
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bump");
        let manifest = target.join(MANIFEST);
        let mode = Mode::RUSR | Mode::WUSR;
        let lay: [&dyn Fn(); 3] = [
            &|| mknodat(CWD, &manifest, FileType::Fifo, mode, 0).unwrap(),
            &|| std::os::unix::fs::symlink("/dev/zero", &manifest).unwrap(),
            &|| {
                let file = fs::File::create(&manifest).unwrap();
                file.set_len(1 << 40).unwrap();
            },
        ];
        for lay in lay {
            fs::create_dir(&target).unwrap();
            lay();
            FolderDraft::begin(&target, ours(&target)).unwrap_err();
            put_files(&target, Overwrite::force(), &[("a.txt", "a")]).unwrap();
            assert!(target.join("a.txt").is_file() && manifest.is_file());
            assert!(
                target
                    .join("manifest.json.kept-1")
                    .symlink_metadata()
                    .is_ok()
            );
            assert_eq!(folder.path().read_dir().unwrap().count(), 1);
            fs::remove_dir_all(&target).unwrap();
        }
    }

    #[test]
    fn folders_made_for_nothing_go_again() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("design/bump");
        drop(FolderDraft::begin(&target, Overwrite::force()).unwrap());
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
        FolderDraft::begin(&target, Overwrite::force())
            .and_then(|mut draft| {
                draft.write("a", |out| out.write_all(b"a"))?;
                draft.commit()
            })
            .unwrap();
        assert!(target.join("a").is_file());
    }
}
