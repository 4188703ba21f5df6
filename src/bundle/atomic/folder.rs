//! Whole folders: a bundle is whole or absent.
//!
//! 1. All files are written and fsynced in a temporary folder beside the target.
//! 2. Under a lock on the parent folder: where nothing is at the target, the temporary folder is
//!    renamed to it; else it is renamed to `.<name>.fluxform-old` and changes places with the target.
//!    The parent is fsynced.
//! 3. What the user had added to the old folder (files its manifest does not list) is moved into
//!    the new one; the rest of the old folder is removed.
//!
//! So the target's name holds a whole folder at every moment. A run killed in steps 2 or 3 leaves a
//! folder under the other name: the old one, or a new one that never came into place. Either way the
//! next [`FolderDraft::begin`] does step 3 with it; of a new one nothing is the user's.
//!
//! Where the system knows no exchange (`exchange.rs`), the target is renamed to the other name and the
//! temporary folder to the target. Between the two the name is absent for some microseconds: a run
//! killed there leaves the whole old folder under its other name, and the next one puts it back.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Component, Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use super::busy::Writing;
use super::exchange::exchange;
use super::file::{fill, lock_folder, sync_folder};
use super::leftovers::{clean_leftovers, is_temporary, temporary_folder};
use super::made::{MadeFolders, made_in};
use super::overwrite::RECORD_MAX_BYTES;
use super::{Overwrite, WriteError};
use crate::bundle::artefact::FileEntry;
use crate::bundle::plain::read_plain;

/// The file whose presence makes a folder a bundle.
const MANIFEST: &str = "manifest.json";

/// What the name of a folder that is put aside ends with.
const OLD: &str = ".fluxform-old";

/// A folder in the making; dropped without [`FolderDraft::commit`] it leaves nothing.
#[derive(Debug)]
pub struct FolderDraft {
    target: PathBuf,
    overwrite: Overwrite,
    draft: TempDir,
    lock: Option<File>,
    /// Dropped after the draft: what is still empty then goes again.
    _made: MadeFolders,
    _writing: Writing,
}

impl FolderDraft {
    /// Begins a folder that will stand at `target`. Finishes what a killed run left half done.
    ///
    /// # Errors
    /// [`WriteError`] when the target is not ours to replace or the place cannot be written to.
    pub fn begin(target: &Path, overwrite: Overwrite) -> Result<Self, WriteError> {
        // A link is followed: the folder it leads to is replaced, not the link.
        let target = if target.is_symlink() {
            target.canonicalize().unwrap_or(target.to_path_buf())
        } else {
            target.to_path_buf()
        };
        let parent = parent_of(&target);
        check_not_our_own(&target)?;
        let ((draft, lock), made) =
            made_in(parent, temporary_folder).map_err(|error| error.of("write", &target))?;
        // Dropped in the reverse order: the draft goes before the folder that was made for it.
        let (made, lock, draft) = (made, lock, draft);
        clean_leftovers(parent);
        {
            let _lock = lock_folder(parent);
            recover(&target).map_err(|error| WriteError::from_io("recover", &target, error))?;
        }
        check_target(&target, &overwrite)?;
        Ok(Self {
            target,
            overwrite,
            draft,
            lock,
            _made: made,
            _writing: Writing::begin(),
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
        let path = self.draft.path().join(name);
        let shown = self.target.join(name);
        let write = || -> io::Result<_> {
            fs::create_dir_all(parent_of(&path))?;
            let mut file = File::create_new(&path)?;
            let written = fill(&mut file, content)?;
            file.sync_all()?;
            Ok(written)
        };
        let written = write().map_err(|error| WriteError::from_io("write", &shown, error))?;
        Ok(FileEntry {
            path: name.to_owned(),
            bytes: written.bytes,
            sha256: written.sha256,
        })
    }

    /// Puts the folder in place.
    ///
    /// # Errors
    /// [`WriteError`]; the target is then as it was.
    pub fn commit(self) -> Result<(), WriteError> {
        let target = &self.target;
        let parent = parent_of(target);
        let fail = |error| WriteError::from_io("write", target, error);
        sync_tree(self.draft.path()).map_err(fail)?;
        let _lock = lock_folder(parent);
        recover(target).map_err(fail)?;
        // Another run may have been faster.
        check_target(target, &self.overwrite)?;
        let old = old_name(target);
        let replaced = target.exists();
        // From here on the temporary name is no more; dropping the guard must not remove anything.
        let draft = self.draft.keep();
        let placed = if replaced {
            replace(&draft, target, &old)
        } else {
            fs::rename(&draft, target)
        };
        if let Err(error) = placed {
            let _ = fs::remove_dir_all(&draft);
            return Err(fail(error));
        }
        drop(self.lock);
        if let Err(error) = sync_folder(parent) {
            // Which of the two a lost system would find there is unknown: back to the one that was.
            if replaced && matches!(exchange(&old, target), Ok(true)) {
                let _ = fs::remove_dir_all(&old);
            }
            return Err(fail(error));
        }
        if replaced {
            absorb(&old, target).map_err(fail)?;
        }
        Ok(())
    }
}

/// Puts the folder `draft` at `target`, and what is there at `old`. On an error the target is as it
/// was, if the system allows that, and nothing but `draft` is left.
fn replace(draft: &Path, target: &Path, old: &Path) -> io::Result<()> {
    // Not from its temporary name: after the exchange the user's own files stand under it, and what
    // is temporary is cleared.
    fs::rename(draft, old)?;
    match exchange(old, target) {
        Ok(true) => Ok(()),
        Ok(false) => {
            fs::rename(old, draft)?;
            replace_by_renames(draft, target, old)
        }
        Err(error) => {
            let _ = fs::remove_dir_all(old);
            Err(error)
        }
    }
}

/// As [`replace`], on systems without an exchange: between the two renames nothing is at `target`.
fn replace_by_renames(draft: &Path, target: &Path, old: &Path) -> io::Result<()> {
    fs::rename(target, old)?;
    fs::rename(draft, target).inspect_err(|_| {
        let _ = fs::rename(old, target);
    })
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

fn parent_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn old_name(target: &Path) -> PathBuf {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    target.with_file_name(format!(".{name}{OLD}"))
}

/// A folder named like our temporary ones would be taken for a killed run's and removed.
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

fn check_target(target: &Path, overwrite: &Overwrite) -> Result<(), WriteError> {
    let Some(_) = target.file_name() else {
        return Err(WriteError::BadName {
            name: target.display().to_string(),
        });
    };
    match fs::read_dir(target) {
        Ok(mut entries) => match entries.next() {
            None => Ok(()),
            Some(_) => overwrite.check(target),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(WriteError::from_io("write", target, error)),
    }
}

/// Finishes or undoes a swap that was cut short.
fn recover(target: &Path) -> io::Result<()> {
    let old = old_name(target);
    if !old.is_dir() {
        return Ok(());
    }
    if target.exists() {
        absorb(&old, target)
    } else {
        fs::rename(&old, target)
    }
}

/// Moves what is not ours from the old folder into the new one and removes the rest. May be cut
/// short anywhere and begun again: the old manifest, which tells what is ours, goes last.
fn absorb(old: &Path, new: &Path) -> io::Result<()> {
    let listed = listed_files(&old.join(MANIFEST));
    absorb_folder(old, old, new, &listed)?;
    match fs::remove_file(old.join(MANIFEST)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => fs::remove_dir(old),
    }
}

fn absorb_folder(
    root: &Path,
    folder: &Path,
    new: &Path,
    listed: &BTreeSet<PathBuf>,
) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let relative = path.strip_prefix(root).unwrap_or(&path);
        if relative == Path::new(MANIFEST) {
            continue;
        }
        let destination = new.join(relative);
        let link_or_file = !path.symlink_metadata()?.is_dir();
        if link_or_file {
            let timing = relative
                .to_str()
                .is_some_and(|name| name.starts_with("timing"));
            if timing || listed.contains(relative) || destination.exists() {
                fs::remove_file(&path)?;
            } else {
                fs::rename(&path, &destination)?;
            }
        } else if destination.is_dir() || listed.iter().any(|file| file.starts_with(relative)) {
            fs::create_dir_all(&destination)?;
            absorb_folder(root, &path, new, listed)?;
            fs::remove_dir(&path)?;
            let _ = fs::remove_dir(&destination); // goes only when nothing was kept in it
        } else if destination.exists() {
            fs::remove_dir_all(&path)?; // a folder where the new bundle has a file
        } else {
            fs::rename(&path, &destination)?;
        }
    }
    Ok(())
}

/// The files that a manifest or sidecar lists; none where it is not there, no plain file, too large
/// for one, or tells of none.
pub(crate) fn listed_files(manifest: &Path) -> BTreeSet<PathBuf> {
    let value: Value = read_plain(manifest, RECORD_MAX_BYTES)
        .ok()
        .and_then(|text| serde_json::from_slice(&text).ok())
        .unwrap_or_default();
    let files = value.get("files").and_then(Value::as_array);
    files
        .into_iter()
        .flatten()
        .filter_map(|file| file.get("path")?.as_str())
        .map(PathBuf::from)
        .collect()
}

/// Makes the names in a folder and its subfolders durable (their files are already).
fn sync_tree(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            sync_tree(&entry.path())?;
        }
    }
    sync_folder(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bundle_named_like_a_temporary_folder_is_refused_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        for name in [
            ".fluxform-7.tmp",
            ".bump.fluxform-old",
            ".fluxform-7.tmp/bump",
        ] {
            let target = folder.path().join(name);
            let refused = FolderDraft::begin(&target, Overwrite::Force).unwrap_err();
            assert!(refused.to_string().contains("temporary"), "{refused}");
            assert_eq!(folder.path().read_dir().unwrap().count(), 0);
        }
    }

    /// A folder of one file and its manifest.
    fn put(target: &Path, text: &str) -> Result<(), WriteError> {
        let mut draft = FolderDraft::begin(target, Overwrite::Force)?;
        let file = draft.write("a.txt", |out| out.write_all(text.as_bytes()))?;
        let manifest = serde_json::json!({ "files": [{ "path": file.path }] }).to_string();
        draft.write(MANIFEST, |out| out.write_all(manifest.as_bytes()))?;
        draft.commit()
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
        if !exchange(&target, &folder.path().join("probe")).unwrap() {
            eprintln!("skipped: this file system knows no exchange");
            return;
        }
        exchange(&target, &folder.path().join("probe")).unwrap();
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

    #[test]
    fn a_new_folder_that_never_came_into_place_goes_again() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bump");
        put(&target, "old").unwrap();
        fs::write(target.join("mine.txt"), "mine").unwrap();
        // Killed right before the exchange.
        put(&folder.path().join("new"), "new").unwrap();
        fs::rename(folder.path().join("new"), old_name(&target)).unwrap();
        drop(FolderDraft::begin(&target, Overwrite::Force).unwrap());
        assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"old");
        assert_eq!(fs::read(target.join("mine.txt")).unwrap(), b"mine");
        assert_eq!(names(folder.path()), ["bump".to_owned()].into());
    }

    #[test]
    fn without_an_exchange_two_renames_do_and_a_failed_one_is_undone() {
        let folder = tempfile::tempdir().unwrap();
        let [draft, target] = ["draft", "bump"].map(|name| folder.path().join(name));
        let old = old_name(&target);
        put(&target, "old").unwrap();
        // The second rename fails: there is nothing to rename.
        replace_by_renames(&draft, &target, &old).unwrap_err();
        assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"old");
        put(&draft, "new").unwrap();
        replace_by_renames(&draft, &target, &old).unwrap();
        assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"new");
        assert_eq!(fs::read(old.join("a.txt")).unwrap(), b"old");
    }

    #[test]
    fn folders_made_for_nothing_go_again() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("design/bump");
        drop(FolderDraft::begin(&target, Overwrite::Force).unwrap());
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
        FolderDraft::begin(&target, Overwrite::Force)
            .and_then(|mut draft| {
                draft.write("a", |out| out.write_all(b"a"))?;
                draft.commit()
            })
            .unwrap();
        assert!(target.join("a").is_file());
    }
}
