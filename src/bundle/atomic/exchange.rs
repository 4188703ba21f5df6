//! Two folders that change places at once, so that a name stands for one or the other at every moment.

use std::io;
use std::path::Path;

/// Lets two names of one file system change places. `false` where the kernel or the file system knows
/// no exchange; everything is then as it was.
///
/// # Errors
/// What the system says otherwise; everything is then as it was.
#[cfg(target_os = "linux")]
pub(super) fn exchange(one: &Path, other: &Path) -> io::Result<bool> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    use rustix::io::Errno;
    match renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE) {
        Ok(()) => Ok(true),
        // Old kernels; network disks; layered file systems, for folders of a lower layer.
        Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP | Errno::XDEV) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

/// As above; only Linux is asked.
#[cfg(not(target_os = "linux"))]
pub(super) fn exchange(_one: &Path, _other: &Path) -> io::Result<bool> {
    Ok(false)
}

#[cfg(target_os = "linux")]
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::print_stderr)] // a skipped test says so
    fn two_folders_change_places_and_a_missing_one_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
        for path in [&one, &other] {
            std::fs::create_dir(path).unwrap();
        }
        std::fs::write(one.join("a"), "a").unwrap();
        if !exchange(&one, &other).unwrap() {
            eprintln!("skipped: this file system knows no exchange");
            return;
        }
        assert!(other.join("a").is_file() && !one.join("a").exists());
        let missing = exchange(&one, &folder.path().join("none")).unwrap_err();
        assert_eq!(missing.kind(), io::ErrorKind::NotFound);
    }
}
