//! Folders that are made for an output, and go again when nothing came into them.

use std::ffi::{OsStr, OsString};
use std::io;
use std::path::{Path, PathBuf};

use super::WriteError;
use super::dir::Dir;

/// How often another run may take a folder away between making it and the first file in it.
const ATTEMPTS: usize = 100;

/// Folders that a run made, the outermost first. Those that are empty when this is dropped go again:
/// a run that was stopped leaves none behind.
#[derive(Debug, Default)]
pub(super) struct MadeFolders(Vec<(Dir, OsString)>);

impl Drop for MadeFolders {
    fn drop(&mut self) {
        for (parent, name) in self.0.iter().rev() {
            // Fails, as it should, where something is in it.
            if parent.remove_empty(name).is_err() {
                break;
            }
        }
    }
}

impl MadeFolders {
    /// Makes the folder `name` in `parent` where nothing is and opens it. A link is refused.
    ///
    /// # Errors
    /// The system's error.
    fn child(&mut self, parent: &Dir, name: impl AsRef<OsStr>) -> io::Result<Dir> {
        let name = name.as_ref();
        match parent.make(name, 0o777) {
            Ok(child) => {
                self.0.push((parent.clone(), name.to_owned()));
                Ok(child)
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => parent.child(name),
            Err(error) => Err(error),
        }
    }
}

/// Folders that several threads fill. Were each to clear what it made, a folder would stay where the one
/// that made it stops before another that has a temporary file in it.
#[derive(Debug, Default)]
#[must_use = "empty folders go when this does"]
pub struct SharedFolders(Vec<MadeFolders>);

impl SharedFolders {
    /// Makes `folder` and its parents where needed, then the folders `below` in one another; those are
    /// never links.
    ///
    /// # Errors
    /// [`WriteError`] where they cannot be made.
    pub fn make(&mut self, folder: &Path, below: &[&str]) -> Result<(), WriteError> {
        let path = below
            .iter()
            .fold(folder.to_owned(), |path, name| path.join(name));
        let ((dir, below), made) =
            made_below(folder, below).map_err(|error| error.of("make the folder", &path))?;
        super::temporary::clean_leftovers(&dir);
        self.0.extend([made, below]);
        Ok(())
    }
}

impl Drop for SharedFolders {
    fn drop(&mut self) {
        // The last first: an earlier one may have made a later one's parent.
        while self.0.pop().is_some() {}
    }
}

/// The folder `name` in `parent`, both made where needed; `name` is never a link. What of it stays empty
/// goes when the second value does.
pub(crate) fn open_made(parent: &Path, name: &OsStr) -> io::Result<(Dir, impl Drop + use<>)> {
    let fail = |error| match error {
        MadeError::NotFolder(_) => io::ErrorKind::NotADirectory.into(),
        MadeError::Folder(_, error) | MadeError::Inside(error) => error,
    };
    let ((dir, below), made) = made_below(parent, &[name]).map_err(fail)?;
    let mut folders = SharedFolders::default();
    folders.0.extend([made, below]);
    Ok((dir, folders))
}

/// Why nothing could be made.
#[derive(Debug)]
pub(super) enum MadeError {
    /// There is a file where a folder is needed.
    NotFolder(PathBuf),
    /// The folder cannot be made.
    Folder(PathBuf, io::Error),
    /// Nothing can be created in it.
    Inside(io::Error),
}

impl MadeError {
    /// The error for a user who was about to do `action` with `path`.
    pub fn of(self, action: &'static str, path: &Path) -> WriteError {
        match self {
            Self::NotFolder(path) => WriteError::NotFolder { path },
            Self::Folder(folder, error) => WriteError::from_io("make the folder", &folder, error),
            Self::Inside(error) => WriteError::from_io(action, path, error),
        }
    }
}

/// Makes `folder` and its parents where needed, and in it what `make` makes. Another run that made
/// the folder for nothing may take it away in between: then both are made again.
pub(super) fn made_in<T>(
    folder: &Path,
    make: impl Fn(&Path) -> io::Result<T>,
) -> Result<(T, MadeFolders), MadeError> {
    let mut attempt = 0;
    loop {
        attempt += 1;
        let gone =
            |error: &io::Error| error.kind() == io::ErrorKind::NotFound && attempt < ATTEMPTS;
        let made = match make_folder(folder) {
            Ok(made) => made,
            Err(MadeError::Folder(_, error)) if gone(&error) => continue,
            Err(error) => return Err(error),
        };
        match make(folder) {
            Ok(value) => return Ok((value, made)),
            Err(error) if gone(&error) => {}
            Err(error) => return Err(MadeError::Inside(error)),
        }
    }
}

/// Makes `folder` and its parents where needed, then the folders `below` in one another, which are never
/// links, and opens the last: all of it again where another run takes one of them away meanwhile.
fn made_below(
    folder: &Path,
    below: &[impl AsRef<OsStr>],
) -> Result<((Dir, MadeFolders), MadeFolders), MadeError> {
    made_in(folder, |folder| {
        let mut made = MadeFolders::default();
        let mut dir = Dir::open(folder)?;
        for name in below {
            dir = made.child(&dir, name)?;
        }
        Ok((dir, made))
    })
}

/// Makes a folder and its parents; the error names the path in the way.
fn make_folder(folder: &Path) -> Result<MadeFolders, MadeError> {
    let mut made = MadeFolders::default();
    let mut missing: Vec<&Path> = folder
        .ancestors()
        .filter(|part| !part.as_os_str().is_empty())
        .take_while(|part| !part.is_dir())
        .collect();
    while let Some(part) = missing.pop() {
        let fail = |error| MadeError::Folder(part.to_path_buf(), error);
        // `a/..` is there as soon as `a` is.
        if part.is_dir() {
            continue;
        }
        if part.is_file() {
            return Err(MadeError::NotFolder(part.to_path_buf()));
        }
        let (parent, name) = Dir::of(part).map_err(fail)?;
        match parent.make(&name, 0o777) {
            Ok(_) => made.0.push((parent, name)),
            // Another run was faster.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists && part.is_dir() => {}
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                return Err(MadeError::NotFolder(part.to_path_buf()));
            }
            Err(error) => return Err(fail(error)),
        }
    }
    Ok(made)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_folders_without_files_go_with_their_parents() {
        let place = tempfile::tempdir().unwrap();
        let [out, own] = ["out", "own"].map(|name| place.path().join(name));
        std::fs::create_dir(&own).unwrap();
        let mut folders = SharedFolders::default();
        for (folder, below) in [
            ("out", &["points", "000"][..]),
            ("out", &["points", "001"]),
            ("own", &[]),
            ("own", &["points", "000"]),
        ] {
            folders.make(&place.path().join(folder), below).unwrap();
        }
        // Another thread's file is cleared after the one that made the folder stopped.
        let file = out.join("points/000/a");
        std::fs::write(&file, "a").unwrap();
        std::fs::write(own.join("points/000/b"), "b").unwrap();
        std::fs::remove_file(&file).unwrap();
        drop(folders);
        assert!(!out.exists());
        assert!(own.join("points/000/b").is_file());
    }

    /// A sweep once failed because another, which had nothing to write, took the folder away between
    /// its making and the next one's in it.
    #[test]
    fn a_folder_that_another_run_takes_away_meanwhile_is_made_again() {
        let place = tempfile::tempdir().unwrap();
        let out = place.path().join("out");
        let round = |_| {
            let mut folders = SharedFolders::default();
            folders.make(&out, &["points", "000"])?;
            drop(folders);
            open_made(&out, OsStr::new("kept"))
                .map(drop)
                .map_err(|error| WriteError::from_io("make the folder", &out, error))
        };
        std::thread::scope(|scope| {
            let run = || (0..2000).try_for_each(round);
            let runs: Vec<_> = (0..4).map(|_| scope.spawn(run)).collect();
            for run in runs {
                run.join().unwrap().unwrap();
            }
        });
    }

    #[test]
    fn a_link_in_place_of_a_folder_below_is_refused() {
        let place = tempfile::tempdir().unwrap();
        let victim = place.path().join("victim");
        std::fs::create_dir(&victim).unwrap();
        std::os::unix::fs::symlink(&victim, place.path().join("points")).unwrap();
        let mut folders = SharedFolders::default();
        let refused = folders.make(place.path(), &["points", "000"]).unwrap_err();
        assert!(refused.to_string().contains("not a folder"), "{refused}");
        drop(folders);
        assert_eq!(victim.read_dir().unwrap().count(), 0);
    }
}
