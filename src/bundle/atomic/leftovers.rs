//! Temporary names, their locks, and what killed runs left behind.

use std::fs::{File, TryLockError};
use std::io::{self, Read};
use std::path::Path;

use tempfile::{Builder, NamedTempFile, TempDir};

const PREFIX: &str = ".fluxform-";
const SUFFIX: &str = ".tmp";

/// Whether a name is one of a temporary file or folder.
pub(super) fn is_temporary(name: &str) -> bool {
    name.starts_with(PREFIX) && name.ends_with(SUFFIX)
}

/// A new locked file under a temporary name; removed when dropped.
pub(super) fn temporary_file(folder: &Path) -> io::Result<NamedTempFile> {
    loop {
        let file = builder(0o666).tempfile_in(folder)?;
        if claim(file.as_file(), file.path()) {
            return Ok(file);
        }
    }
}

/// A new locked folder under a temporary name; removed when dropped. The file is the lock's handle.
pub(super) fn temporary_folder(folder: &Path) -> io::Result<(TempDir, Option<File>)> {
    loop {
        let draft = builder(0o777).tempdir_in(folder)?;
        let handle = match File::open(draft.path()) {
            Ok(handle) => handle,
            // A cleaner came before the lock.
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            // Folders cannot be opened, hence not locked, on every system.
            Err(_) => return Ok((draft, None)),
        };
        if claim(&handle, draft.path()) {
            return Ok((draft, Some(handle)));
        }
    }
}

/// Removes the files in `folder` that begin with `magic`, what killed runs left there, and the folder
/// if nothing else is in it.
pub fn remove_files_beginning_with(folder: &Path, magic: &[u8]) {
    clean_leftovers(folder);
    let Ok(entries) = folder.read_dir() else {
        return;
    };
    for entry in entries.flatten() {
        let mut start = vec![0; magic.len()];
        let ours = entry.file_type().is_ok_and(|kind| kind.is_file())
            && File::open(entry.path()).is_ok_and(|mut file| file.read_exact(&mut start).is_ok())
            && start == magic;
        if ours {
            let _ = std::fs::remove_file(entry.path());
        }
    }
    let _ = std::fs::remove_dir(folder);
}

/// Removes temporary files and folders in `folder` that no living run holds. Best effort: where
/// locks do not work, nothing is removed.
pub fn clean_leftovers(folder: &Path) {
    let Ok(entries) = folder.read_dir() else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        if !is_temporary(name) {
            continue;
        }
        let path = entry.path();
        let Ok(kind) = entry.file_type() else {
            continue;
        };
        // Ours are files and folders; opening a pipe of that name would wait for its other end.
        if !kind.is_file() && !kind.is_dir() {
            continue;
        }
        let Ok(handle) = File::open(&path) else {
            continue;
        };
        if handle.try_lock().is_ok() {
            let _ = if kind.is_dir() {
                std::fs::remove_dir_all(&path)
            } else {
                std::fs::remove_file(&path)
            };
        }
    }
}

/// Locks what was just made. False when a cleaner came between: then it is gone or going.
fn claim(handle: &File, path: &Path) -> bool {
    match handle.try_lock() {
        Ok(()) => path.exists(),
        Err(TryLockError::WouldBlock) => false,
        Err(TryLockError::Error(_)) => true, // no locks here: then nobody cleans either
    }
}

/// Names, and whom the files let in: the umask decides, as for any new file.
fn builder(mode: u32) -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(mode));
    }
    #[cfg(not(unix))]
    let _ = mode;
    builder
}

#[cfg(target_os = "linux")]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::bundle::artefact::Input;
    use crate::bundle::atomic::{FolderDraft, Overwrite, listed_files};

    fn pipe(path: &Path) {
        use rustix::fs::{CWD, FileType, Mode, mknodat};
        mknodat(CWD, path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
    }

    /// What does not end in time waits for a pipe or reads without end.
    fn in_time<T: Send + 'static>(act: impl FnOnce() -> T + Send + 'static) -> T {
        let (done, wait) = std::sync::mpsc::channel();
        std::thread::spawn(move || done.send(act()));
        wait.recv_timeout(std::time::Duration::from_secs(60))
            .expect("it waits")
    }

    #[test]
    fn a_pipe_under_a_temporary_name_is_passed_by() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(".fluxform-7Xq.tmp");
        pipe(&path);
        let place = folder.path().to_path_buf();
        in_time(move || {
            clean_leftovers(&place);
            remove_files_beginning_with(&place, b"fluxkept");
        });
        assert!(path.exists());
    }

    /// An older bundle whose manifest is a pipe, never ends, or is larger than any.
    #[test]
    fn the_manifest_of_a_replaced_folder_is_no_pipe_nor_endless() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bump");
        let manifest = target.join("manifest.json");
        let lay: [&dyn Fn(); 3] = [
            &|| pipe(&manifest),
            &|| std::os::unix::fs::symlink("/dev/zero", &manifest).unwrap(),
            &|| File::create(&manifest).unwrap().set_len(1 << 40).unwrap(),
        ];
        for lay in lay {
            std::fs::create_dir(&target).unwrap();
            lay();
            let (place, record) = (target.clone(), manifest.clone());
            in_time(move || {
                assert!(listed_files(&record).is_empty());
                let ours = Overwrite::new(false, record, &[Input::of_bytes("a.toml", b"a")]);
                FolderDraft::begin(&place, ours).unwrap_err();
                let mut draft = FolderDraft::begin(&place, Overwrite::Force).unwrap();
                draft.write("a", |out| out.write_all(b"a")).unwrap();
                draft.commit().unwrap();
            });
            assert!(target.join("a").is_file() && !manifest.exists());
            assert_eq!(folder.path().read_dir().unwrap().count(), 1);
            std::fs::remove_dir_all(&target).unwrap();
        }
    }
}
