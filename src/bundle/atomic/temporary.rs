//! Temporary files and folders, their locks, and what killed runs left behind.
//!
//! A temporary name holds the identity of what has it, so a leftover is cleared only when it is the
//! very file or folder that a run of this program made under that name and nobody holds its lock.

use std::ffi::{OsStr, OsString};
use std::fs::{File, TryLockError};
use std::hash::{BuildHasher, RandomState};
use std::io;

use super::busy::Writing;
use super::dir::{Dir, Kind, short_identity};

const PREFIX: &str = ".fluxform-";
const SUFFIX: &str = ".tmp";
/// How often a cleaner may take away what was just made.
const ATTEMPTS: usize = 100;

/// Whether a name is one of a temporary file or folder.
pub(super) fn is_temporary(name: &str) -> bool {
    name.starts_with(PREFIX) && name.ends_with(SUFFIX)
}

fn named(middle: &str) -> String {
    format!("{PREFIX}{middle}{SUFFIX}")
}

fn random_name() -> String {
    named(&format!("{:016x}", RandomState::new().hash_one(0)))
}

/// A new locked file under a temporary name; removed when dropped.
#[derive(Debug)]
pub(super) struct TemporaryFile {
    pub file: File,
    dir: Dir,
    /// `None` once it has a name of its own.
    name: Option<OsString>,
    _writing: Writing,
}

impl TemporaryFile {
    /// In `dir`; the umask may narrow the mode.
    ///
    /// # Errors
    /// The system's error.
    pub fn new(dir: &Dir, mode: u32) -> io::Result<Self> {
        loop {
            let name = random_name();
            let file = dir.new_file(&name, mode)?;
            let mut made = Self {
                file,
                dir: dir.clone(),
                name: Some(name.into()),
                _writing: Writing::begin(),
            };
            // On an error it is removed as it is dropped.
            made.name = claim(dir, &made.file, made.name.as_deref())?;
            if made.name.is_some() {
                return Ok(made);
            }
        }
    }

    /// Gives it the name `name` in its folder, replacing a file of that name.
    ///
    /// # Errors
    /// The system's error; the file is then removed.
    pub(crate) fn persist(mut self, name: &OsStr) -> io::Result<()> {
        if let Some(from) = &self.name {
            self.dir.rename(from, &self.dir, name)?;
        }
        self.name = None;
        Ok(())
    }

    /// As [`Self::persist`], where nothing of that name is.
    ///
    /// # Errors
    /// Also [`io::ErrorKind::AlreadyExists`].
    pub(crate) fn persist_new(mut self, name: &OsStr) -> io::Result<()> {
        if let Some(from) = &self.name {
            self.dir.rename_new(from, &self.dir, name)?;
        }
        self.name = None;
        Ok(())
    }
}

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        if let Some(name) = &self.name {
            let _ = self.dir.remove_file(name);
        }
    }
}

/// A new locked folder under a temporary name; removed with all that is in it when dropped.
#[derive(Debug)]
pub(super) struct TemporaryFolder {
    pub dir: Dir,
    parent: Dir,
    /// `None` once it has a name of its own.
    name: Option<OsString>,
    lock: File,
    _writing: Writing,
}

impl TemporaryFolder {
    /// In `parent`; the umask may narrow the mode.
    ///
    /// # Errors
    /// The system's error.
    pub fn new(parent: &Dir, mode: u32) -> io::Result<Self> {
        let mut attempts = 0;
        loop {
            let name = random_name();
            attempts += 1;
            let dir = match parent.make(&name, mode) {
                // A cleaner came before it was opened.
                Err(error) if error.kind() == io::ErrorKind::NotFound && attempts < ATTEMPTS => {
                    continue;
                }
                made => made?,
            };
            let mut made = Self {
                lock: dir.handle()?,
                dir,
                parent: parent.clone(),
                name: Some(name.into()),
                _writing: Writing::begin(),
            };
            // On an error it is removed as it is dropped.
            made.name = claim(parent, &made.lock, made.name.as_deref())?;
            if made.name.is_some() {
                return Ok(made);
            }
        }
    }

    /// Its name; empty once it was given away.
    pub fn name(&self) -> &OsStr {
        self.name.as_deref().unwrap_or_default()
    }

    /// Somebody else takes care of it from here on.
    pub fn keep(&mut self) {
        self.name = None;
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        if let Some(name) = &self.name {
            let _ = self.dir.remove_content();
            let _ = self.parent.remove_empty(name);
        }
    }
}

/// Locks what was just made and gives it the name that holds its identity. `None` when a cleaner
/// came between: then it is gone or going.
fn claim(dir: &Dir, handle: &File, made: Option<&OsStr>) -> io::Result<Option<OsString>> {
    let made = made.unwrap_or_default();
    match handle.try_lock() {
        // Without locks nobody cleans.
        Ok(()) | Err(TryLockError::Error(_)) => {}
        Err(TryLockError::WouldBlock) => return Ok(None),
    }
    let name = OsString::from(named(&short_identity(handle)));
    match dir.rename(made, dir, &name) {
        Ok(()) => Ok(Some(name)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// Removes temporary files and folders in `dir` that this program made and no living run holds. Best
/// effort: where locks do not work, nothing is removed.
pub(crate) fn clean_leftovers(dir: &Dir) {
    for name in dir.names().unwrap_or_default() {
        if name.to_str().is_some_and(is_temporary) {
            // A file that cannot be removed now is left to the next run.
            let _ = clean(dir, &name);
        }
    }
}

fn clean(dir: &Dir, name: &OsStr) -> io::Result<()> {
    let Some(status) = dir.status(name)? else {
        return Ok(());
    };
    let made_here = |handle: &File| name == OsStr::new(&named(&short_identity(handle)));
    match status.kind {
        Kind::File => {
            let file = dir.file(name)?;
            // Killed before it got its name it is empty.
            let ours = made_here(&file) || file.metadata()?.len() == 0;
            if ours && file.try_lock().is_ok() {
                dir.remove_file(name)?;
            }
        }
        Kind::Folder => {
            let folder = dir.child(name)?;
            let handle = folder.handle()?;
            if handle.try_lock().is_ok() {
                if made_here(&handle) {
                    folder.remove_content()?;
                }
                dir.remove_empty(name)?;
            }
        }
        Kind::Link | Kind::Special => {}
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn leftovers_of_killed_runs_go_and_what_only_has_such_a_name_stays() {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        let dir = Dir::open(place.path()).unwrap();
        // Killed: nobody holds the lock, nobody removes them.
        for mode in [0o777, 0o700] {
            let mut folder = TemporaryFolder::new(&dir, mode).unwrap();
            folder.dir.new_file("half", 0o666).unwrap();
            folder.keep();
            let mut file = TemporaryFile::new(&dir, 0o666).unwrap();
            file.file.set_len(7).unwrap();
            file.name = None;
        }
        std::fs::write(path(".fluxform-empty.tmp"), "").unwrap();
        // At work.
        let held = TemporaryFile::new(&dir, 0o666).unwrap();
        let kept = TemporaryFolder::new(&dir, 0o777).unwrap();
        kept.dir.new_file("half", 0o666).unwrap();
        // The user's own.
        std::fs::write(path(".fluxform-mine.tmp"), "mine").unwrap();
        std::fs::create_dir(path(".fluxform-ours.tmp")).unwrap();
        std::fs::write(path(".fluxform-ours.tmp/a"), "a").unwrap();
        std::fs::create_dir(path("victim")).unwrap();
        std::fs::write(path("victim/a"), "a").unwrap();
        symlink(path("victim"), path(".fluxform-link.tmp")).unwrap();
        clean_leftovers(&dir);
        let mut requested = [
            ".fluxform-link.tmp",
            ".fluxform-mine.tmp",
            ".fluxform-ours.tmp",
            "victim",
        ]
        .map(OsString::from)
        .to_vec();
        requested.extend([held.name.clone().unwrap(), kept.name().to_owned()]);
        requested.sort();
        assert_eq!(dir.names().unwrap(), requested);
        assert!(path("victim/a").is_file() && path(".fluxform-ours.tmp/a").is_file());
        drop((held, kept));
        assert_eq!(dir.names().unwrap().len(), 4);
    }
}
