//! Single files: written beside the target, then renamed.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use tempfile::NamedTempFile;

use super::busy::{Writing, lock};
use super::leftovers::{clean_leftovers, temporary_file};
use super::made::{MadeFolders, made_in};
use super::{Overwrite, WriteError, Written};

/// Writes of at least this size pass through unbuffered.
const BUFFER_BYTES: usize = 1 << 20;

/// Writes one file whole or not at all and returns its size and digest. Missing folders are made.
/// `content` writes the bytes; an error of its own of kind `InvalidData` is reported as such.
///
/// A target that is a device or a pipe is written to directly.
///
/// # Errors
/// [`WriteError`]; the target is then as it was.
pub fn write(
    path: &Path,
    overwrite: &Overwrite,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<Written, WriteError> {
    if let Ok(metadata) = path.metadata()
        && !metadata.is_file()
        && !metadata.is_dir()
    {
        return File::options()
            .write(true)
            .open(path)
            .and_then(|mut device| fill(&mut device, content))
            .map_err(|error| WriteError::from_io("write", path, error));
    }
    let name = path.file_name().ok_or_else(|| WriteError::IsFolder {
        path: path.to_path_buf(),
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut set = FileSet::begin(folder, overwrite.clone())?;
    let written = set.write_path(folder.join(name), content)?;
    set.commit()?;
    Ok(written)
}

/// Files that belong together, such as an array file and its sidecar.
///
/// All are written first, then renamed in reverse order: the sidecar, staged last because it lists
/// the digests of the others, is in place first. After a kill between two renames the sidecar
/// therefore tells that what lies there is ours, and the same command replaces it. Renames are made
/// under a lock on the folder, so that the files of two runs do not mix.
#[derive(Debug)]
pub struct FileSet {
    folder: PathBuf,
    overwrite: Overwrite,
    staged: Vec<(NamedTempFile, PathBuf)>,
    /// What an earlier set had and this one has not.
    outdated: Vec<PathBuf>,
    /// Dropped last: what is still empty then goes again.
    made: Vec<MadeFolders>,
    _writing: Writing,
}

impl FileSet {
    /// Makes the folder where needed and removes the leftovers of killed runs in it.
    ///
    /// # Errors
    /// [`WriteError`] when the folder cannot be made.
    pub fn begin(folder: &Path, overwrite: Overwrite) -> Result<Self, WriteError> {
        let folder = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        let made = made_in(folder, |_| Ok(()))
            .map_err(|error| error.of("make the folder", folder))?
            .1;
        clean_leftovers(folder);
        Ok(Self {
            folder: folder.to_path_buf(),
            overwrite,
            staged: Vec::new(),
            outdated: Vec::new(),
            made: vec![made],
            _writing: Writing::begin(),
        })
    }

    /// Stages a file of the given plain name.
    ///
    /// # Errors
    /// [`WriteError`]; nothing is left of it.
    pub fn write(
        &mut self,
        name: &str,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<Written, WriteError> {
        super::folder::check_name(name)?;
        self.write_path(self.folder.join(name), content)
    }

    /// Stages a file of any path; its folder is made where needed.
    ///
    /// # Errors
    /// [`WriteError`]; nothing is left of it.
    pub fn write_at(
        &mut self,
        target: &Path,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<Written, WriteError> {
        // A bare name stands in the working directory, not in the set's folder.
        let parent = target.parent().filter(|p| !p.as_os_str().is_empty());
        let parent = parent.unwrap_or(Path::new("."));
        let name = target.file_name().ok_or_else(|| WriteError::IsFolder {
            path: target.to_path_buf(),
        })?;
        let made = made_in(parent, |_| Ok(()))
            .map_err(|error| error.of("make the folder", parent))?
            .1;
        self.made.push(made);
        clean_leftovers(parent);
        self.write_path(parent.join(name), content)
    }

    /// Removes the file of the given plain name, if there is one, when the others are put in place: an
    /// earlier set had it, this one has not.
    ///
    /// # Errors
    /// A name that is none.
    pub fn outdate(&mut self, name: &str) -> Result<(), WriteError> {
        super::folder::check_name(name)?;
        self.outdated.push(self.folder.join(name));
        Ok(())
    }

    fn write_path(
        &mut self,
        target: PathBuf,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<Written, WriteError> {
        if target.is_dir() {
            return Err(WriteError::IsFolder { path: target });
        }
        self.overwrite.check(&target)?;
        // A link is followed: the file it leads to is replaced, not the link.
        let target = target.canonicalize().unwrap_or(target);
        let place = place(&target);
        if self
            .staged
            .iter()
            .any(|(_, other)| self::place(other) == place)
        {
            return Err(WriteError::Content {
                path: target,
                message: "another file of this command has that name; choose another".to_owned(),
            });
        }
        let beside = beside(&target, &self.folder);
        let fail = |error| WriteError::from_io("write", &target, error);
        let (mut file, made) =
            made_in(beside, temporary_file).map_err(|error| error.of("write", &target))?;
        self.made.push(made);
        let written = fill(file.as_file_mut(), content)
            .and_then(|written| file.as_file().sync_all().map(|()| written))
            .map_err(fail)?;
        self.staged.push((file, target));
        Ok(written)
    }

    /// Puts all staged files in place.
    ///
    /// # Errors
    /// [`WriteError`]; files not yet in place are removed.
    pub fn commit(self) -> Result<(), WriteError> {
        let _lock = lock_folder(&self.folder);
        // Another run may have been faster.
        for (_, target) in &self.staged {
            self.overwrite.check(target)?;
        }
        for path in &self.outdated {
            match std::fs::remove_file(path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(WriteError::from_io("remove", path, error));
                }
                _ => {}
            }
        }
        let mut folders = Vec::new();
        for (file, target) in self.staged.into_iter().rev() {
            file.persist(&target)
                .map_err(|error| WriteError::from_io("write", &target, error.error))?;
            let folder = beside(&target, &self.folder).to_path_buf();
            if !folders.contains(&folder) {
                folders.push(folder);
            }
        }
        for folder in folders {
            sync_folder(&folder).map_err(|error| WriteError::from_io("write", &folder, error))?;
        }
        Ok(())
    }
}

/// Where `target` is, however it is spelt.
fn place(target: &Path) -> PathBuf {
    let folder = beside(target, Path::new(".")).canonicalize();
    match (folder, target.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => target.to_path_buf(),
    }
}

/// The folder of `target`; `folder` for a bare name, which has none of its own.
fn beside<'a>(target: &'a Path, folder: &'a Path) -> &'a Path {
    match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => folder,
    }
}

/// Runs `content` into `file` through a buffer, hashing on the way.
pub(super) fn fill(
    file: &mut File,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<Written> {
    let mut buffered = BufWriter::with_capacity(
        BUFFER_BYTES,
        Hashing {
            file,
            sha256: Sha256::new(),
            bytes: 0,
        },
    );
    let outcome = content(&mut buffered);
    // On failure the buffer's rest is dropped unwritten.
    let hashing = match outcome {
        Ok(()) => buffered
            .into_inner()
            .map_err(io::IntoInnerError::into_error)?,
        Err(error) => {
            let _ = buffered.into_parts();
            return Err(error);
        }
    };
    Ok(Written {
        bytes: hashing.bytes,
        sha256: hex(&hashing.sha256.finalize()),
    })
}

/// Lower-case hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 16] = b"0123456789abcdef";
    bytes
        .iter()
        .flat_map(|b| [b >> 4, b & 15])
        .map(|nibble| char::from(DIGITS[usize::from(nibble)]))
        .collect()
}

struct Hashing<'a> {
    file: &'a mut File,
    sha256: Sha256,
    bytes: u64,
}

impl Write for Hashing<'_> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        let count = self.file.write(buffer)?;
        self.sha256.update(&buffer[..count]);
        self.bytes += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Serialises the renames of runs that write into the same folder. Where folders cannot be locked
/// the renames go ahead without.
pub(super) fn lock_folder(folder: &Path) -> Option<File> {
    let handle = File::open(folder).ok()?;
    lock(&handle, folder).then_some(handle)
}

/// Makes renames in `folder` durable, where the system knows how.
pub(super) fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(unix) {
        match File::open(folder)?.sync_all() {
            Err(error) if error.kind() == io::ErrorKind::InvalidInput => {} // some network disks
            outcome => return outcome,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bundle::artefact::Input;

    #[test]
    fn a_faster_run_of_other_inputs_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let input = |text: &str| Input::of_bytes(format!("{text}.toml"), text.as_bytes());
        let begun = |text: &str| {
            let overwrite = Overwrite::new(false, folder.path().join("map.json"), &[input(text)]);
            let mut set = FileSet::begin(folder.path(), overwrite).unwrap();
            let told = serde_json::json!({ "inputs": [input(text)] }).to_string();
            set.write("map.npz", |out| out.write_all(text.as_bytes()))
                .unwrap();
            set.write("map.json", |out| out.write_all(told.as_bytes()))
                .unwrap();
            set
        };
        let (slow, fast) = (begun("slow"), begun("fast"));
        fast.commit().unwrap();
        let refused = slow.commit().unwrap_err();
        assert!(matches!(refused, WriteError::OutputExists { .. }));
        assert_eq!(
            std::fs::read(folder.path().join("map.npz")).unwrap(),
            b"fast"
        );
        assert_eq!(folder.path().read_dir().unwrap().count(), 2);
        begun("fast").commit().unwrap();
    }

    #[test]
    fn a_file_that_came_first_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let begun = |text: &str| {
            let mut set = FileSet::begin(folder.path(), Overwrite::Never).unwrap();
            set.write("plan.json", |out| out.write_all(text.as_bytes()))
                .unwrap();
            set
        };
        let (slow, fast) = (begun("slow"), begun("fast"));
        fast.commit().unwrap();
        let refused = slow.commit().unwrap_err();
        assert!(refused.to_string().contains("exists already"), "{refused}");
        let kept = std::fs::read(folder.path().join("plan.json")).unwrap();
        assert_eq!(kept, b"fast");
    }

    #[test]
    fn folders_made_for_nothing_go_again() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("new/newer");
        drop(FileSet::begin(&deep, Overwrite::Force).unwrap());
        assert!(!folder.path().join("new").exists());
        let mut set = FileSet::begin(&deep, Overwrite::Force).unwrap();
        // Another run takes the empty folder away.
        std::fs::remove_dir_all(folder.path().join("new")).unwrap();
        set.write("a", |out| out.write_all(b"a")).unwrap();
        set.commit().unwrap();
        assert_eq!(std::fs::read(deep.join("a")).unwrap(), b"a");
    }

    #[test]
    fn one_file_spelt_in_two_ways_is_not_written_twice() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("inner");
        let overwrite = Overwrite::new(false, folder.path().join("map.json"), &[]);
        let mut set = FileSet::begin(&inner, overwrite).unwrap();
        set.write_at(&inner.join("a.yaml"), |out| out.write_all(b"nodes"))
            .unwrap();
        let again = folder.path().join("inner/../inner/a.yaml");
        let refused = set.write_at(&again, |out| out.write_all(b"sources"));
        let told = refused.unwrap_err().to_string();
        assert!(told.contains("another file of this command"), "{told}");
        set.write_at(&folder.path().join("a.yaml"), |out| {
            out.write_all(b"sources")
        })
        .unwrap();
        set.commit().unwrap();
        assert_eq!(std::fs::read(inner.join("a.yaml")).unwrap(), b"nodes");
        assert_eq!(
            std::fs::read(folder.path().join("a.yaml")).unwrap(),
            b"sources"
        );
    }
}
