//! Reading files that nobody vouches for: plain ones, of bounded size.

use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;

use super::artefact::sha256_of;

/// The largest file of a bundle, 4 GiB: the archive's own limit without extensions.
pub(crate) const FILE_MAX_BYTES: u64 = 1 << 32;

/// Files of up to this size may have holes.
#[cfg(target_os = "linux")]
const HOLES_FROM_BYTES: u64 = 16 << 20;
/// Of a larger file at least one byte in so many lies on the disk. A file system that compresses
/// makes numbers and text smaller by less than that.
#[cfg(target_os = "linux")]
const HOLES_SHARE: u64 = 64;

/// The size of a plain file that may be read: at most `max_bytes`.
///
/// # Errors
/// [`io::ErrorKind::InvalidData`] for anything else: a pipe would keep its reader waiting, a device
/// may never end.
pub(crate) fn check_plain(metadata: &Metadata, max_bytes: u64) -> io::Result<u64> {
    let bytes = metadata.len();
    if metadata.is_file() && bytes <= max_bytes {
        return Ok(bytes);
    }
    let message = format!("expected a plain file of at most {max_bytes} bytes");
    Err(io::Error::new(io::ErrorKind::InvalidData, message))
}

/// Refuses a file of holes: it takes far more memory than it took to make.
#[cfg(target_os = "linux")]
fn check_holes(file: &File, metadata: &Metadata) -> io::Result<()> {
    use std::os::unix::fs::MetadataExt;

    use rustix::fs::{SeekFrom, seek};

    let (bytes, on_disk) = (metadata.len(), metadata.blocks().saturating_mul(512));
    if bytes <= HOLES_FROM_BYTES || bytes / HOLES_SHARE <= on_disk {
        return Ok(());
    }
    // Some file systems count blocks late; they know of no hole then.
    let hole = seek(file, SeekFrom::Hole(0))?;
    seek(file, SeekFrom::Start(0))?;
    if hole >= bytes {
        return Ok(());
    }
    let message = format!("claims {bytes} bytes, but is almost all holes");
    Err(io::Error::new(io::ErrorKind::InvalidData, message))
}

/// Holes cannot be detected here.
#[cfg(not(target_os = "linux"))]
fn check_holes(_: &File, _: &Metadata) -> io::Result<()> {
    Ok(())
}

/// Opens the file at `path`, links followed, after `check_plain`; its size.
fn open_plain(path: &Path, max_bytes: u64) -> io::Result<(File, u64)> {
    // Asked before opening: opening a pipe would wait for its other end.
    check_plain(&path.metadata()?, max_bytes)?;
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    let bytes = check_plain(&metadata, max_bytes)?;
    check_holes(&file, &metadata)?;
    Ok((file, bytes))
}

/// The bytes of the plain file at `path`, links followed, no more than `max_bytes`.
///
/// # Errors
/// The system's error; those of a file that is not plain; a file of holes.
pub fn read_plain(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    let (file, bytes) = open_plain(path, max_bytes)?;
    let mut content = Vec::new();
    content.try_reserve_exact(bytes as usize)?;
    file.take(bytes).read_to_end(&mut content)?;
    Ok(content)
}

/// Size and SHA-256 of the plain file at `path`, links followed, read block by block.
///
/// # Errors
/// As `read_plain`.
pub fn digest_plain(path: &Path, max_bytes: u64) -> io::Result<(u64, String)> {
    let (file, bytes) = open_plain(path, max_bytes)?;
    sha256_of(file.take(bytes))
}

#[cfg(test)]
mod tests {
    use super::{FILE_MAX_BYTES, digest_plain, read_plain};
    use crate::artefact::sha256_hex;

    #[test]
    #[cfg(target_os = "linux")]
    #[allow(clippy::disallowed_methods)]
    fn files_of_holes_are_refused_unread() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("holes");
        let file = std::fs::File::create(&path).unwrap();
        for bytes in [20_000_000_000, 4_000_000_000, 17 << 20] {
            file.set_len(bytes).unwrap();
            assert!(read_plain(&path, FILE_MAX_BYTES).is_err(), "{bytes}");
            assert!(digest_plain(&path, FILE_MAX_BYTES).is_err(), "{bytes}");
        }
        file.set_len(70_000).unwrap();
        let (bytes, digest) = digest_plain(&path, FILE_MAX_BYTES).unwrap();
        assert_eq!((bytes, digest), (70_000, sha256_hex(&[0; 70_000])));
    }

    #[test]
    fn folders_devices_and_large_files_are_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        crate::atomic::write(&path, &crate::atomic::Overwrite::force(), |out| {
            std::io::Write::write_all(out, b"0123456")
        })
        .unwrap();
        assert_eq!(read_plain(&path, 7).unwrap(), b"0123456");
        assert!(read_plain(&path, 6).is_err());
        assert!(read_plain(folder.path(), 100).is_err());
        #[cfg(target_os = "linux")]
        assert!(read_plain(std::path::Path::new("/dev/zero"), 100).is_err());
    }
}
