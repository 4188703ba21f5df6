//! Results of earlier runs, kept so that what has not changed is not computed again.
//!
//! An entry is one file: the digest of all that its value was computed from and of the folder it was
//! kept in, the CRC-32 of the value, and the value. An entry of other origin, of another build of this program,
//! made with other vector instructions (on another machine that shares the folder), or damaged is not
//! used, and is overwritten. So is one that was made in another folder: whoever passes results on may
//! have written anything into their store and the right check beside it. A store that cannot be read
//! or written is none: results are the same without it.

use std::ffi::OsStr;
use std::io::Read;
use std::path::PathBuf;

use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use super::atomic::{self, Dir, Kind};
use fluxform_numerics::dispatch;

/// First bytes of every entry.
const MAGIC: &[u8; 8] = b"fluxkept";
const DIGEST: usize = 32;
/// Bytes of the value's CRC-32: against damage alone, since whoever may write into the folder may write anything.
const CHECK: usize = 4;
/// Larger entries are not read.
const ENTRY_MAX_BYTES: u64 = 16 << 30;

/// Digest of the inputs of a value.
#[derive(Debug, Clone, Default)]
pub struct Origin(Sha256);

impl Origin {
    /// The origin of what the build of this name computes with the present vector instructions.
    #[must_use]
    pub fn of_build(build: &str) -> Self {
        Self::default()
            .and(build.as_bytes())
            .and(dispatch::instructions().as_bytes())
    }

    /// With `part` added; the order counts.
    #[must_use]
    pub fn and(mut self, part: &[u8]) -> Self {
        self.0.update((part.len() as u64).to_le_bytes());
        self.0.update(part);
        self
    }

    /// With numbers added.
    #[must_use]
    pub fn and_numbers(mut self, numbers: impl IntoIterator<Item = f64>) -> Self {
        let mut count = 0_u64;
        for number in numbers {
            self.0.update(number.to_bits().to_le_bytes());
            count += 1;
        }
        self.0.update(count.to_le_bytes());
        self
    }

    /// The digest of all that was added.
    #[must_use]
    pub fn sum(&self) -> [u8; DIGEST] {
        self.0.clone().finalize().into()
    }

    /// The digest of entry `name` of this origin in `folder`.
    fn digest(&self, folder: &Dir, name: &str) -> [u8; DIGEST] {
        let entry = self.clone().and(&folder.identity()).and(name.as_bytes());
        entry.0.finalize().into()
    }
}

/// Entries in one folder, or none. The folder is never reached through a link of its name, nor is an
/// entry.
#[derive(Debug, Clone, Default)]
pub struct Store {
    /// The folder that it is in, and its name there.
    place: Option<(PathBuf, &'static str)>,
}

impl Store {
    /// A store that keeps nothing.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// The store in the folder `name` of `parent`, which is made when something is kept.
    #[must_use]
    pub fn in_folder(parent: PathBuf, name: &'static str) -> Self {
        Self {
            place: Some((parent, name)),
        }
    }

    fn folder(&self) -> Option<Dir> {
        let (parent, name) = self.place.as_ref()?;
        Dir::open(parent).and_then(|dir| dir.child(name)).ok()
    }

    /// The value of entry `name` if it is of this `origin`, or what `compute` gives, which is kept.
    ///
    /// # Errors
    /// Those of `compute`.
    pub fn remember<T: Serialize + DeserializeOwned, E>(
        &self,
        name: &str,
        origin: &Origin,
        compute: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        if let Some(value) = self.recall(name, origin) {
            return Ok(value);
        }
        let value = compute()?;
        self.keep(name, origin, &value);
        Ok(value)
    }

    /// The value of entry `name` if it is of this `origin`.
    #[must_use]
    pub fn recall<T: DeserializeOwned>(&self, name: &str, origin: &Origin) -> Option<T> {
        postcard::from_bytes(&payload(&self.folder()?, name, origin)?).ok()
    }

    /// Keeps `value` as entry `name`. What cannot be kept is computed again next time.
    pub fn keep<T: Serialize>(&self, name: &str, origin: &Origin, value: &T) {
        if let (Some(place), Ok(bytes)) = (&self.place, postcard::to_stdvec(value)) {
            Self::put(place, name, origin, &bytes);
        }
    }

    /// Writes an entry that is in bytes; compiled once for all kinds of values.
    fn put((parent, folder): &(PathBuf, &str), name: &str, origin: &Origin, bytes: &[u8]) {
        let Ok((dir, _made)) = atomic::open_made(parent, OsStr::new(folder)) else {
            return;
        };
        atomic::clean_leftovers(&dir);
        // A file that is no entry is left alone.
        if matches!(dir.status(name), Ok(Some(_))) && !is_entry(&dir, OsStr::new(name)) {
            return;
        }
        // Not forced to the disk: an entry that a power cut tears is noticed and computed again.
        let _ = atomic::put(&dir, name, false, |out| {
            out.write_all(MAGIC)?;
            out.write_all(&origin.digest(&dir, name))?;
            out.write_all(&check(bytes))?;
            out.write_all(bytes)
        });
    }

    /// Removes entry `name`; whether there was one.
    pub fn forget(&self, name: &str) -> bool {
        self.folder().is_some_and(|dir| {
            is_entry(&dir, OsStr::new(name)) && dir.remove_file(OsStr::new(name)).is_ok()
        })
    }

    /// Removes all entries, what killed runs left there, and the folder if nothing else is in it.
    pub fn clear(&self) {
        let (Some((parent, folder)), Some(dir)) = (&self.place, self.folder()) else {
            return;
        };
        atomic::clean_leftovers(&dir);
        for name in dir.names().unwrap_or_default() {
            if is_entry(&dir, &name) {
                let _ = dir.remove_file(&name);
            }
        }
        let _ = Dir::open(parent).and_then(|parent| parent.remove_empty(folder));
    }

    /// Whether entry `name` of this `origin` can be read.
    #[must_use]
    pub fn holds(&self, name: &str, origin: &Origin) -> bool {
        self.folder()
            .is_some_and(|folder| payload(&folder, name, origin).is_some())
    }
}

fn payload(folder: &Dir, name: &str, origin: &Origin) -> Option<Vec<u8>> {
    let status = folder.status(name).ok()??;
    if status.kind != Kind::File || status.bytes > ENTRY_MAX_BYTES {
        return None;
    }
    let mut file = folder.file(name).ok()?;
    // A large file that is none of ours is not read to its end.
    let mut head = [0; MAGIC.len() + DIGEST + CHECK];
    file.read_exact(&mut head).ok()?;
    let (magic, rest) = head.split_at(MAGIC.len());
    let (of_origin, of_value) = rest.split_at(DIGEST);
    if magic != MAGIC || of_origin != origin.digest(folder, name) {
        return None;
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(status.bytes as usize).ok()?;
    file.take(ENTRY_MAX_BYTES).read_to_end(&mut bytes).ok()?;
    (of_value == check(&bytes)).then_some(bytes)
}

fn check(value: &[u8]) -> [u8; CHECK] {
    crc32fast::hash(value).to_le_bytes()
}

/// Whether the file `name` begins as every entry does, or ends before it could differ: a power cut leaves that.
fn is_entry(folder: &Dir, name: &OsStr) -> bool {
    let mut start = Vec::new();
    let read = folder
        .file(name)
        .and_then(|file| file.take(MAGIC.len() as u64).read_to_end(&mut start));
    read.is_ok() && MAGIC.starts_with(&start)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A store in a folder of its own with one entry, and that entry's file.
    fn kept(origin: &Origin) -> (tempfile::TempDir, Store, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::in_folder(folder.path().to_path_buf(), "kept");
        store.keep("steel", origin, &vec![0.7, 1.3]);
        let file = folder.path().join("kept/steel");
        (folder, store, file)
    }

    fn lay(folder: &std::path::Path, name: &str, bytes: &[u8]) {
        let (dir, _made) = atomic::open_made(folder, OsStr::new("kept")).unwrap();
        atomic::put(&dir, name, false, |out| out.write_all(bytes)).unwrap();
    }

    #[test]
    fn any_changed_or_missing_byte_is_noticed_and_mended() {
        let origin = Origin::of_build("a").and_numbers([0.7]);
        let (folder, store, file) = kept(&origin);
        let damage = |bytes: &[u8]| {
            lay(folder.path(), "steel", bytes);
        };
        let recall = || store.recall::<Vec<f64>>("steel", &origin);
        let whole = std::fs::read(&file).unwrap();
        assert_eq!(recall(), Some(vec![0.7, 1.3]));
        for at in 0..whole.len() {
            for bit in 0..8 {
                let mut bytes = whole.clone();
                bytes[at] ^= 1 << bit;
                damage(&bytes);
                assert!(recall().is_none() && !store.holds("steel", &origin));
            }
            damage(&whole[..at]);
            assert!(recall().is_none(), "cut at {at}");
            store.keep("steel", &origin, &vec![0.7, 1.3]);
            assert!(recall().is_some(), "cut at {at}");
        }
        damage(&[&whole[..], b"x"].concat());
        assert!(recall().is_none());
        let computed = store.remember::<_, ()>("steel", &origin, || Ok(vec![1.7]));
        assert_eq!(computed, Ok(vec![1.7]));
        assert_eq!(recall(), Some(vec![1.7]), "overwritten");
    }

    #[test]
    fn another_origin_or_build_is_not_used() {
        let origin = Origin::of_build("a").and_numbers([0.7]);
        let (_folder, store, _file) = kept(&origin);
        for other in [
            Origin::of_build("a"),
            Origin::of_build("a").and_numbers([0.7, 0.7]),
            Origin::of_build("a").and_numbers([0.70001]),
            Origin(Sha256::new())
                .and(b"another build")
                .and_numbers([0.7]),
            Origin(Sha256::new())
                .and(b"a")
                .and(b"other instructions")
                .and_numbers([0.7]),
        ] {
            assert!(store.recall::<Vec<f64>>("steel", &other).is_none());
        }
    }

    #[test]
    #[allow(clippy::disallowed_methods)] // a test's own files
    fn an_entry_under_the_name_of_another_is_not_used() {
        let origin = Origin::of_build("a");
        let (folder, store, file) = kept(&origin);
        lay(folder.path(), "wedge.pull", &std::fs::read(&file).unwrap());
        assert!(!store.holds("wedge.pull", &origin) && store.holds("steel", &origin));
    }

    /// A value with its right check, in a folder that came from elsewhere.
    #[cfg(target_os = "linux")]
    #[test]
    #[allow(clippy::disallowed_methods)] // a test's own files
    fn an_entry_that_was_made_in_another_folder_is_not_used() {
        let origin = Origin::of_build("a").and_numbers([0.7]);
        let (folder, store, file) = kept(&origin);
        let mut forged = std::fs::read(&file).unwrap();
        let value = MAGIC.len() + DIGEST + CHECK;
        let last = forged.len() - 1;
        forged[last] ^= 0x40;
        let right = check(&forged[value..]);
        forged[value - CHECK..value].copy_from_slice(&right);
        let sent = folder.path().join("sent");
        lay(&sent, "steel", &forged);
        let received = Store::in_folder(sent, "kept");
        assert!(!received.holds("steel", &origin));
        let computed = received.remember::<_, ()>("steel", &origin, || Ok(vec![0.7, 1.3]));
        assert_eq!(computed, Ok(vec![0.7, 1.3]));
        assert!(received.holds("steel", &origin), "written again");
        // A folder that is renamed stays the one it was.
        let (from, to) = (folder.path().join("sent"), folder.path().join("renamed"));
        std::fs::rename(from, &to).unwrap();
        let renamed = Store::in_folder(to, "kept");
        assert!(renamed.holds("steel", &origin) && store.holds("steel", &origin));
    }

    #[cfg(target_os = "linux")]
    #[test]
    #[allow(clippy::disallowed_methods)] // a test's own files
    fn an_entry_that_never_ends_or_is_none_of_ours_is_not_read() {
        let origin = Origin::of_build("a");
        let (_folder, store, file) = kept(&origin);
        let made = std::fs::File::create(&file).unwrap();
        made.set_len(ENTRY_MAX_BYTES).unwrap();
        assert!(!store.holds("steel", &origin));
        std::fs::remove_file(&file).unwrap();
        std::os::unix::fs::symlink("/dev/zero", &file).unwrap();
        assert!(!store.holds("steel", &origin));
    }

    #[test]
    fn what_killed_runs_left_is_cleared_with_the_entries() {
        let (folder, store, _file) = kept(&Origin::of_build("a"));
        // Killed before the first byte was written: nothing but its name shows whose it was.
        lay(folder.path(), ".fluxform-7Xq.tmp", b"");
        store.clear();
        assert!(!folder.path().join("kept").exists());
    }

    #[test]
    #[allow(clippy::disallowed_methods)] // a test's own files
    fn a_linked_store_is_neither_cleared_nor_written_to_nor_read() {
        use std::os::unix::fs::symlink;
        let origin = Origin::of_build("a");
        let (victim, theirs, entry) = kept(&origin);
        let place = tempfile::tempdir().unwrap();
        symlink(victim.path().join("kept"), place.path().join("kept")).unwrap();
        let store = Store::in_folder(place.path().to_path_buf(), "kept");
        store.clear();
        store.keep("other", &origin, &7);
        assert!(!store.holds("steel", &origin));
        assert!(entry.is_file() && theirs.holds("steel", &origin));
        assert_eq!(victim.path().join("kept").read_dir().unwrap().count(), 1);
        // Nor is an entry that is a link.
        let own = tempfile::tempdir().unwrap();
        let store = Store::in_folder(own.path().to_path_buf(), "kept");
        std::fs::create_dir(own.path().join("kept")).unwrap();
        symlink(&entry, own.path().join("kept/steel")).unwrap();
        store.keep("steel", &origin, &7);
        store.clear();
        assert!(entry.is_file() && own.path().join("kept/steel").is_symlink());
    }
}
