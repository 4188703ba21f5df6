//! Folders by descriptor. What is done with a name is done in the folder that was opened, wherever
//! its path leads by then, and a link is never followed: it is removed or renamed itself, or left.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{
    Access, AtFlags, CWD, FileType, Gid, Mode, OFlags, Uid, accessat, fchmod, fchown, fstat,
    mkdirat, openat, renameat, statat, unlinkat,
};
use rustix::io::Errno;
use sha2::{Digest, Sha256};

use super::busy;
use super::digest::hex;
use super::names::parent_of;

/// Folders nested deeper than this are not entered.
const DEPTH_MAX: usize = 64;

/// The kind of thing that a name refers to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A regular file.
    File,
    /// A folder.
    Folder,
    /// A link, whatever it leads to.
    Link,
    /// A pipe, a device or a socket.
    Special,
}

impl From<FileType> for Kind {
    fn from(kind: FileType) -> Self {
        if kind.is_file() {
            Self::File
        } else if kind.is_dir() {
            Self::Folder
        } else if kind.is_symlink() {
            Self::Link
        } else {
            Self::Special
        }
    }
}

/// A file or folder as the system describes it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EntryStatus {
    pub kind: Kind,
    pub bytes: u64,
    device: u64,
    inode: u64,
    mode: u32,
    owner: u32,
    group: u32,
    /// When its content or what the system says of it changed last, ns.
    changed_ns: i128,
}

/// What the system says of a file's content: another one after every change of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct FileVersion {
    device: u64,
    inode: u64,
    bytes: u64,
    changed_ns: i128,
}

impl FileVersion {
    /// When it came to be by the file system's clock, ns since 1970.
    pub fn changed_ns(self) -> i128 {
        self.changed_ns
    }
}

impl From<rustix::fs::Stat> for EntryStatus {
    #[allow(clippy::unnecessary_cast)] // the fields' types depend on the system
    fn from(stat: rustix::fs::Stat) -> Self {
        Self {
            kind: FileType::from_raw_mode(stat.st_mode).into(),
            bytes: stat.st_size as u64,
            device: stat.st_dev as u64,
            inode: stat.st_ino as u64,
            mode: stat.st_mode & 0o7777,
            owner: stat.st_uid,
            group: stat.st_gid,
            changed_ns: i128::from(stat.st_ctime) * 1_000_000_000 + i128::from(stat.st_ctime_nsec),
        }
    }
}

impl EntryStatus {
    /// That of an open file.
    ///
    /// # Errors
    /// The system's error.
    pub fn of(file: &File) -> io::Result<Self> {
        Ok(fstat(file)?.into())
    }

    /// Which content the file has.
    pub fn version(&self) -> FileVersion {
        FileVersion {
            device: self.device,
            inode: self.inode,
            bytes: self.bytes,
            changed_ns: self.changed_ns,
        }
    }

    /// Whether both are the same file or folder.
    pub fn is(&self, other: &Self) -> bool {
        (self.device, self.inode) == (other.device, other.inode)
    }

    /// Gives `file` this owner, group and mode. The owner as far as the system allows it.
    ///
    /// # Errors
    /// A mode that cannot be set.
    pub fn give(&self, file: impl AsFd) -> io::Result<()> {
        let now = Self::from(fstat(&file)?);
        if (now.owner, now.group) != (self.owner, self.group) {
            let (owner, group) = (Uid::from_raw(self.owner), Gid::from_raw(self.group));
            if fchown(&file, Some(owner), Some(group)).is_err() {
                let _ = fchown(&file, None, Some(group));
            }
        }
        // Last: a change of owner clears some of its bits.
        Ok(fchmod(&file, Mode::from_raw_mode(self.mode as _))?)
    }
}

/// Kind of file at `path`, links followed; `None` where nothing is.
///
/// # Errors
/// The system's error otherwise.
pub(super) fn followed(path: &Path) -> io::Result<Option<EntryStatus>> {
    found(statat(CWD, path, AtFlags::empty()))
}

fn found(stat: rustix::io::Result<rustix::fs::Stat>) -> io::Result<Option<EntryStatus>> {
    match stat {
        Ok(stat) => Ok(Some(stat.into())),
        Err(Errno::NOENT) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// An open folder. Clones share the descriptor.
#[derive(Debug, Clone)]
pub(crate) struct Dir {
    fd: Arc<OwnedFd>,
    /// For messages.
    path: PathBuf,
}

impl Dir {
    /// The folder at `path`, links followed: the user named it.
    ///
    /// # Errors
    /// The system's error.
    pub fn open(path: &Path) -> io::Result<Self> {
        let path = if path.as_os_str().is_empty() {
            Path::new(".")
        } else {
            path
        };
        let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
        let fd = openat(CWD, path, flags, Mode::empty())?;
        Ok(Self {
            fd: Arc::new(fd),
            path: path.to_path_buf(),
        })
    }

    /// The folder of the file or folder at `path`, and its name there.
    ///
    /// # Errors
    /// The system's error; a path without a name.
    pub fn of(path: &Path) -> io::Result<(Self, OsString)> {
        let name = path.file_name().ok_or(io::ErrorKind::InvalidInput)?;
        Ok((Self::open(parent_of(path))?, name.to_owned()))
    }

    /// Its path when it was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The folder `name` in it; a link is an error.
    ///
    /// # Errors
    /// The system's error: [`io::ErrorKind::NotADirectory`] for anything but a folder.
    pub fn child(&self, name: impl AsRef<OsStr>) -> io::Result<Self> {
        let name = name.as_ref();
        let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        let fd = openat(&self.fd, name, flags, Mode::empty()).map_err(|error| match error {
            Errno::LOOP | Errno::MLINK => io::Error::from(io::ErrorKind::NotADirectory),
            error => error.into(),
        })?;
        Ok(Self {
            fd: Arc::new(fd),
            path: self.path.join(name),
        })
    }

    /// The folder `name` in it, made where nothing is.
    ///
    /// # Errors
    /// As [`Dir::child`].
    pub(crate) fn child_or_new(&self, name: impl AsRef<OsStr>) -> io::Result<Self> {
        match mkdirat(&self.fd, name.as_ref(), Mode::from_raw_mode(0o777)) {
            Ok(()) | Err(Errno::EXIST) => self.child(name),
            Err(error) => Err(error.into()),
        }
    }

    /// Makes the folder `name`, whose mode the umask may narrow.
    ///
    /// # Errors
    /// The system's error, also where something of that name is.
    pub fn make(&self, name: impl AsRef<OsStr>, mode: u32) -> io::Result<Self> {
        mkdirat(&self.fd, name.as_ref(), Mode::from_raw_mode(mode as _))?;
        self.child(name)
    }

    /// The names in it, in order.
    ///
    /// # Errors
    /// The system's error.
    pub fn names(&self) -> io::Result<Vec<OsString>> {
        let mut names = Vec::new();
        for entry in rustix::fs::Dir::read_from(&self.fd)? {
            let entry = entry?;
            let name = entry.file_name().to_bytes();
            if name != b"." && name != b".." {
                names.push(OsStr::from_bytes(name).to_owned());
            }
        }
        names.sort();
        Ok(names)
    }

    /// The kind of thing that `name` refers to; `None` where nothing is. A link is a link.
    ///
    /// # Errors
    /// The system's error otherwise.
    pub fn status(&self, name: impl AsRef<OsStr>) -> io::Result<Option<EntryStatus>> {
        found(statat(&self.fd, name.as_ref(), AtFlags::SYMLINK_NOFOLLOW))
    }

    /// Itself.
    ///
    /// # Errors
    /// The system's error.
    pub(crate) fn own_status(&self) -> io::Result<EntryStatus> {
        Ok(fstat(&self.fd)?.into())
    }

    /// Refuses a folder in which this user may not make and remove names.
    ///
    /// # Errors
    /// [`io::ErrorKind::PermissionDenied`] or [`io::ErrorKind::ReadOnlyFilesystem`].
    pub fn writable(&self) -> io::Result<()> {
        let requested = Access::WRITE_OK | Access::EXEC_OK;
        Ok(accessat(&self.fd, ".", requested, AtFlags::EACCESS)?)
    }

    /// The regular file `name`, for reading; anything else, a link included, is an error.
    ///
    /// # Errors
    /// The system's error; [`io::ErrorKind::InvalidInput`] for anything but a regular file.
    pub fn file(&self, name: impl AsRef<OsStr>) -> io::Result<File> {
        // Without waiting for the other end of a pipe.
        let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let file = File::from(openat(&self.fd, name.as_ref(), flags, Mode::empty())?);
        if EntryStatus::of(&file)?.kind != Kind::File {
            return Err(io::ErrorKind::InvalidInput.into());
        }
        Ok(file)
    }

    /// A new file, for writing; the umask may narrow its mode.
    ///
    /// # Errors
    /// The system's error, also where something of that name is.
    pub(crate) fn new_file(&self, name: impl AsRef<OsStr>, mode: u32) -> io::Result<File> {
        let flags = OFlags::RDWR | OFlags::CREATE | OFlags::EXCL | OFlags::CLOEXEC;
        let mode = Mode::from_raw_mode(mode as _);
        Ok(openat(&self.fd, name.as_ref(), flags, mode)?.into())
    }

    /// Removes a name that refers to anything but a folder.
    ///
    /// # Errors
    /// The system's error.
    pub fn remove_file(&self, name: impl AsRef<OsStr>) -> io::Result<()> {
        Ok(unlinkat(&self.fd, name.as_ref(), AtFlags::empty())?)
    }

    /// Removes a folder with nothing in it.
    ///
    /// # Errors
    /// The system's error.
    pub(crate) fn remove_empty(&self, name: impl AsRef<OsStr>) -> io::Result<()> {
        Ok(unlinkat(&self.fd, name.as_ref(), AtFlags::REMOVEDIR)?)
    }

    /// Removes all that is in it; links are removed themselves.
    ///
    /// # Errors
    /// The system's error; folders nested without end.
    pub(crate) fn remove_content(&self) -> io::Result<()> {
        self.remove_content_below(DEPTH_MAX)
    }

    fn remove_content_below(&self, depth: usize) -> io::Result<()> {
        let depth = depth
            .checked_sub(1)
            .ok_or_else(|| io::Error::other("folders are nested too deep"))?;
        for name in self.names()? {
            match self.status(&name)?.map(|status| status.kind) {
                None => {}
                Some(Kind::Folder) => {
                    self.child(&name)?.remove_content_below(depth)?;
                    self.remove_empty(&name)?;
                }
                Some(Kind::File | Kind::Link | Kind::Special) => self.remove_file(&name)?,
            }
        }
        Ok(())
    }

    /// Renames, replacing a file of the new name.
    ///
    /// # Errors
    /// The system's error.
    pub fn rename(
        &self,
        from: impl AsRef<OsStr>,
        folder: &Self,
        to: impl AsRef<OsStr>,
    ) -> io::Result<()> {
        Ok(renameat(&self.fd, from.as_ref(), &folder.fd, to.as_ref())?)
    }

    /// Renames to a name that nothing has.
    ///
    /// # Errors
    /// [`io::ErrorKind::AlreadyExists`]; what the system reports otherwise.
    pub(crate) fn rename_new(
        &self,
        from: impl AsRef<OsStr>,
        folder: &Self,
        to: impl AsRef<OsStr>,
    ) -> io::Result<()> {
        #[cfg(target_os = "linux")]
        {
            use rustix::fs::{RenameFlags, renameat_with};
            let flags = RenameFlags::NOREPLACE;
            match renameat_with(&self.fd, from.as_ref(), &folder.fd, to.as_ref(), flags) {
                Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => {}
                outcome => return Ok(outcome?),
            }
        }
        if folder.status(&to)?.is_some() {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        self.rename(from, folder, to)
    }

    /// Lets two names change places, so that each refers to one or the other at every moment.
    /// `false` where the kernel or the file system knows no exchange; all is then as it was.
    ///
    /// # Errors
    /// The system's error otherwise; all is then as it was.
    #[cfg(target_os = "linux")]
    pub fn exchange(&self, one: impl AsRef<OsStr>, other: impl AsRef<OsStr>) -> io::Result<bool> {
        use rustix::fs::{RenameFlags, renameat_with};
        let flags = RenameFlags::EXCHANGE;
        match renameat_with(&self.fd, one.as_ref(), &self.fd, other.as_ref(), flags) {
            Ok(()) => Ok(true),
            // Old kernels; network disks; layered file systems, for folders of a lower layer.
            Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP | Errno::XDEV) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// As above; on Linux alone.
    #[cfg(not(target_os = "linux"))]
    pub fn exchange(&self, _one: impl AsRef<OsStr>, _other: impl AsRef<OsStr>) -> io::Result<bool> {
        Ok(false)
    }

    /// Makes its names durable, where the system knows how.
    ///
    /// # Errors
    /// The system's error.
    pub fn sync(&self) -> io::Result<()> {
        match rustix::fs::fsync(&self.fd) {
            Err(Errno::INVAL) => Ok(()), // some network disks
            outcome => Ok(outcome?),
        }
    }

    /// A handle that can be locked.
    ///
    /// # Errors
    /// The system's error.
    pub(crate) fn handle(&self) -> io::Result<File> {
        Ok(self.fd.try_clone()?.into())
    }

    /// Serialises the renames of runs that write into it: held until the handle is dropped. `None`
    /// where folders cannot be locked.
    pub fn lock(&self, shown: &Path) -> Option<File> {
        // Of its own: a lock belongs to a description, which clones share.
        let handle = File::from(
            openat(
                &self.fd,
                ".",
                OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC,
                Mode::empty(),
            )
            .ok()?,
        );
        busy::lock(&handle, shown).then_some(handle)
    }

    /// See [`identity`].
    pub fn identity(&self) -> Vec<u8> {
        identity(&self.fd)
    }
}

/// The identity of a file or folder, different from any other's, a copy of it included: its number on its disk and
/// when it was made, as bytes. Nobody can choose them for one that is yet to be unpacked or copied
/// elsewhere. A rename changes neither.
#[cfg(target_os = "linux")]
pub(super) fn identity(file: impl AsFd) -> Vec<u8> {
    use rustix::fs::{StatxFlags, statx};
    let requested = StatxFlags::INO | StatxFlags::BTIME;
    let Ok(found) = statx(file, "", AtFlags::EMPTY_PATH, requested) else {
        return Vec::new();
    };
    // Where a disk does not keep the time it is zero.
    let mut bytes = found.stx_ino.to_le_bytes().to_vec();
    bytes.extend(found.stx_btime.tv_sec.to_le_bytes());
    bytes.extend(found.stx_btime.tv_nsec.to_le_bytes());
    bytes
}

/// As above, without the time.
#[cfg(not(target_os = "linux"))]
pub(super) fn identity(file: impl AsFd) -> Vec<u8> {
    let Ok(found) = fstat(file) else {
        return Vec::new();
    };
    let found = EntryStatus::from(found);
    [found.device.to_le_bytes(), found.inode.to_le_bytes()].concat()
}

/// The identity in 16 characters, for names.
pub(super) fn short_identity(file: impl AsFd) -> String {
    hex(&Sha256::digest(identity(file))[..8])
}

impl AsFd for Dir {
    fn as_fd(&self) -> std::os::fd::BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn a_link_is_not_entered_and_is_removed_itself() {
        let place = tempfile::tempdir().unwrap();
        let [victim, own] = ["victim", "own"].map(|name| place.path().join(name));
        std::fs::create_dir_all(&victim).unwrap();
        std::fs::create_dir_all(own.join("deep/deeper")).unwrap();
        std::fs::write(victim.join("thesis.tex"), "years").unwrap();
        symlink(&victim, own.join("deep/deeper/link")).unwrap();
        symlink(victim.join("thesis.tex"), own.join("file")).unwrap();
        let dir = Dir::open(&own).unwrap();
        assert!(dir.file("file").is_err());
        let deeper = dir.child("deep").unwrap().child("deeper").unwrap();
        let refused = deeper.child("link").unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::NotADirectory);
        dir.remove_content().unwrap();
        assert!(dir.names().unwrap().is_empty());
        assert_eq!(std::fs::read(victim.join("thesis.tex")).unwrap(), b"years");
    }

    #[test]
    fn a_folder_that_is_swapped_for_a_link_is_still_the_one_that_was_opened() {
        let place = tempfile::tempdir().unwrap();
        let [victim, own, moved] = ["victim", "own", "moved"].map(|name| place.path().join(name));
        for folder in [&victim, &own] {
            std::fs::create_dir(folder).unwrap();
            std::fs::write(folder.join("a"), "a").unwrap();
        }
        let dir = Dir::open(place.path()).unwrap().child("own").unwrap();
        std::fs::rename(&own, &moved).unwrap();
        symlink(&victim, &own).unwrap();
        dir.remove_content().unwrap();
        assert!(victim.join("a").is_file() && !moved.join("a").exists());
    }

    #[test]
    #[cfg(target_os = "linux")]
    #[allow(clippy::print_stderr)] // a skipped test says so
    fn two_folders_change_places_and_a_missing_one_is_reported() {
        let place = tempfile::tempdir().unwrap();
        let dir = Dir::open(place.path()).unwrap();
        std::fs::create_dir_all(place.path().join("one/a")).unwrap();
        std::fs::create_dir(place.path().join("other")).unwrap();
        if !dir.exchange("one", "other").unwrap() {
            eprintln!("skipped: this file system knows no exchange");
            return;
        }
        assert!(place.path().join("other/a").is_dir() && !place.path().join("one/a").exists());
        let missing = dir.exchange("one", "none").unwrap_err();
        assert_eq!(missing.kind(), io::ErrorKind::NotFound);
        assert!(dir.rename_new("one", &dir, "other").is_err());
        dir.rename_new("one", &dir, "none").unwrap();
    }

    #[test]
    fn a_folder_stays_itself_when_it_is_renamed_and_no_other_is_it() {
        let place = tempfile::tempdir().unwrap();
        let dir = Dir::open(place.path()).unwrap();
        let [one, other] = ["one", "other"].map(|name| dir.make(name, 0o777).unwrap());
        let found = one.identity();
        assert!(found != other.identity() && found.len() >= 16);
        dir.rename("one", &dir, "renamed").unwrap();
        assert_eq!(found, dir.child("renamed").unwrap().identity());
    }
}
