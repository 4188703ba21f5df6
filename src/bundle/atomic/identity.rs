//! What tells a folder from any other one, a copy of it included.

use std::path::Path;

/// The folder's number on its disk and when it was made, as bytes; empty where the system tells
/// neither. Nobody can choose them for a folder that another one is yet to unpack or to copy.
#[cfg(target_os = "linux")]
#[must_use]
pub(crate) fn identity(folder: &Path) -> Vec<u8> {
    use rustix::fs::{AtFlags, CWD, StatxFlags, statx};
    let wanted = StatxFlags::INO | StatxFlags::BTIME;
    let Ok(found) = statx(CWD, folder, AtFlags::empty(), wanted) else {
        return Vec::new();
    };
    // Where a disk does not keep the time it is zero.
    let mut bytes = found.stx_ino.to_le_bytes().to_vec();
    bytes.extend(found.stx_btime.tv_sec.to_le_bytes());
    bytes.extend(found.stx_btime.tv_nsec.to_le_bytes());
    bytes
}

/// As above; only Linux is asked.
#[cfg(not(target_os = "linux"))]
#[must_use]
pub(crate) fn identity(_folder: &Path) -> Vec<u8> {
    Vec::new()
}

#[cfg(target_os = "linux")]
#[cfg(test)]
mod tests {
    use super::identity;

    #[test]
    fn a_folder_stays_itself_when_it_is_renamed_and_no_other_is_it() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other, renamed] = ["one", "other", "renamed"].map(|n| folder.path().join(n));
        std::fs::create_dir(&one).unwrap();
        std::fs::create_dir(&other).unwrap();
        let found = identity(&one);
        assert!(found != identity(&other) && found.len() >= 20);
        std::fs::rename(&one, &renamed).unwrap();
        assert_eq!(found, identity(&renamed));
        assert!(identity(&one).is_empty());
    }
}
