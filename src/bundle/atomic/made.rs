//! Folders that are made for an output, and go again when nothing came into them.

use std::io;
use std::path::{Path, PathBuf};

use super::WriteError;

/// How often another run may take a folder away between making it and the first file in it.
const ATTEMPTS: usize = 100;

/// Folders that a run made, the outermost first. Those that are empty when this is dropped go again:
/// a run that was stopped leaves none behind.
#[derive(Debug)]
pub(super) struct MadeFolders(Vec<PathBuf>);

impl Drop for MadeFolders {
    fn drop(&mut self) {
        for folder in self.0.iter().rev() {
            // Fails, as it should, where something is in it.
            if std::fs::remove_dir(folder).is_err() {
                break;
            }
        }
    }
}

/// Folders that several threads fill. Were each to clear what it made, a folder would stay where the one
/// that made it stops before another that has a temporary file in it.
#[derive(Debug, Default)]
#[must_use = "empty folders go when this does"]
pub struct SharedFolders(Vec<MadeFolders>);

impl SharedFolders {
    /// Makes `folder` and its parents where needed.
    ///
    /// # Errors
    /// [`WriteError`] where it cannot be made.
    pub fn make(&mut self, folder: &Path) -> Result<(), WriteError> {
        let made = make_folder(folder).map_err(|error| error.of("write", folder))?;
        self.0.push(made);
        Ok(())
    }
}

impl Drop for SharedFolders {
    fn drop(&mut self) {
        // The last first: an earlier one may have made a later one's parent.
        while self.0.pop().is_some() {}
    }
}

/// Why nothing could be made.
#[derive(Debug)]
pub(super) enum MadeError {
    /// A file stands where a folder is wanted.
    NotFolder(PathBuf),
    /// The folder cannot be made.
    Folder(PathBuf, io::Error),
    /// What was to be made in it cannot be.
    Inside(io::Error),
}

impl MadeError {
    /// As told to the user, who was about to do `action` with `path`.
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

/// Makes a folder and its parents; the error names the path that stands in the way.
fn make_folder(folder: &Path) -> Result<MadeFolders, MadeError> {
    let mut made = MadeFolders(Vec::new());
    if folder.is_dir() {
        return Ok(made);
    }
    let missing = folder
        .ancestors()
        .filter(|part| !part.as_os_str().is_empty())
        .take_while(|part| !part.is_dir());
    for part in missing {
        if part.is_file() {
            return Err(MadeError::NotFolder(part.to_path_buf()));
        }
        made.0.insert(0, part.to_path_buf());
    }
    std::fs::create_dir_all(folder)
        .map_err(|error| MadeError::Folder(folder.to_path_buf(), error))?;
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
        for folder in ["out/points/000", "out/points/001", "own", "own/points/000"] {
            folders.make(&place.path().join(folder)).unwrap();
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
}
