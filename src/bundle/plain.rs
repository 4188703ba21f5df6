//! Reading files that nobody vouches for: plain ones, of bounded size.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// The bytes of the plain file at `path`, links followed, no more than `max_bytes`.
///
/// # Errors
/// What the system says; [`io::ErrorKind::InvalidData`] for what is no plain file (a pipe would
/// keep its reader waiting, a device may never end) or is larger.
pub fn read_plain(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    // Asked before opening: opening a pipe would wait for its other end.
    let metadata = path.metadata()?;
    if !metadata.is_file() || metadata.len() > max_bytes {
        let message = format!("expected a plain file of at most {max_bytes} bytes");
        return Err(io::Error::new(io::ErrorKind::InvalidData, message));
    }
    let mut content = Vec::new();
    content.try_reserve_exact(metadata.len() as usize)?;
    File::open(path)?
        .take(max_bytes)
        .read_to_end(&mut content)?;
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::read_plain;

    #[test]
    fn folders_devices_and_large_files_are_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        crate::bundle::atomic::write(&path, &crate::bundle::atomic::Overwrite::force(), |out| {
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
