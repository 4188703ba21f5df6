//! Single files: written beside the target, then renamed.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::created_dirs::{MadeFolders, made_in};
use super::digest::{Content, Durability, Written, fill, fill_unhashed};
use super::dir::{Dir, EntryStatus, Kind};
use super::names::{check_name, parent_of};
use super::overwrite::{Permit, real};
use super::record::{ReplacedNote, present};
use super::temporary::{TemporaryFile, clean_leftovers};
use super::{Overwrite, WriteError};

/// Writes one file whole or not at all and returns its size and digest. Missing folders are made.
/// `content` writes the bytes; an error of its own of kind `InvalidData` is reported as such.
///
/// A target that is a character device or a pipe is written to directly.
///
/// # Errors
/// [`WriteError`]; the target is then as it was.
pub fn write(
    path: &Path,
    overwrite: &Overwrite,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<Written, WriteError> {
    if is_stream(path) {
        return File::options()
            .write(true)
            .open(path)
            .and_then(|mut device| fill(&mut device, Durability::Cached, Box::new(content)))
            .map_err(|error| WriteError::from_io("write", path, error));
    }
    let mut set = FileSet::begin(parent_of(path), overwrite.clone());
    let written = set.write_at(path, content)?;
    set.commit()?;
    Ok(written)
}

/// Whether `path` is a character device or a pipe, which take bytes and keep none.
#[must_use]
pub fn is_stream(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    path.metadata().is_ok_and(|found| {
        let kind = found.file_type();
        kind.is_char_device() || kind.is_fifo()
    })
}

/// Puts one small file in the open folder `dir`, whole or not at all, replacing a regular file of that
/// name; the caller has looked whose that is. Unless `forced`, nothing is forced to the disk: a lost
/// system may leave it empty or cut short, which its reader must recognise, by a checksum.
///
/// # Errors
/// The system's error; the target is then as it was.
pub(crate) fn put(
    dir: &Dir,
    name: &str,
    forced: bool,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let earlier = dir.status(name)?;
    if earlier.is_some_and(|there| there.kind != Kind::File) {
        return Err(io::Error::other("what is there is not a regular file"));
    }
    let mut made = new_temporary(dir, earlier)?;
    // Small: one call at the end forces it.
    fill_unhashed(&mut made.file, Box::new(content))?;
    finish(&made, earlier)?;
    if forced {
        made.file.sync_all()?;
    }
    made.persist(OsStr::new(name))?;
    if forced { dir.sync() } else { Ok(()) }
}

/// A temporary file that is to replace `earlier`: nobody else reads it before it has its mode.
fn new_temporary(dir: &Dir, earlier: Option<EntryStatus>) -> io::Result<TemporaryFile> {
    TemporaryFile::new(dir, if earlier.is_some() { 0o600 } else { 0o666 })
}

/// Gives it the owner and mode of the file that it replaces.
fn finish(made: &TemporaryFile, earlier: Option<EntryStatus>) -> io::Result<()> {
    earlier.map_or(Ok(()), |earlier| earlier.give(&made.file))
}

/// Files that belong together, such as an array file and its sidecar.
///
/// All are written first, then renamed in reverse order: the sidecar, staged last because it lists
/// the digests of the others, is in place first. Files that are replaced are noted beside it until the
/// last rename: after a kill between two renames sidecar and note together show that what is there is
/// ours, and the same command replaces it. Renames are made under a lock on the folder, so that the
/// files of two runs do not mix. Nothing is made or removed before every target may be replaced.
#[derive(Debug)]
pub struct FileSet {
    folder: PathBuf,
    overwrite: Overwrite,
    staged: Vec<Staged>,
    /// Names that an earlier set had and this one has not.
    outdated: Vec<PathBuf>,
    /// Dropped last: what is still empty then goes again.
    made: Vec<MadeFolders>,
}

/// A file that waits for its name.
#[derive(Debug)]
struct Staged {
    temporary: TemporaryFile,
    /// As given.
    shown: PathBuf,
    /// Where it belongs; no link.
    target: PathBuf,
    dir: Dir,
    name: OsString,
    written: Written,
    permit: Permit,
    overwrite: Overwrite,
}

impl FileSet {
    /// A set whose files of plain names go to `folder`, which is made when the first is written.
    #[must_use]
    pub fn begin(folder: &Path, overwrite: Overwrite) -> Self {
        Self {
            folder: parent_of(&folder.join("-")).to_path_buf(),
            overwrite,
            staged: Vec::new(),
            outdated: Vec::new(),
            made: Vec::new(),
        }
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
        check_name(name)?;
        self.write_at(&self.folder.join(name), content)
    }

    /// Stages a file of any path; its folder is made where needed.
    ///
    /// # Errors
    /// [`WriteError`]; nothing is left of it.
    pub(crate) fn write_at(
        &mut self,
        target: &Path,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<Written, WriteError> {
        self.write_under(target, self.overwrite.clone(), Box::new(content))
    }

    /// Stages a file of any path, its folder made where needed, replaced under a policy of its own.
    ///
    /// # Errors
    /// [`WriteError`]; nothing is left of it.
    pub fn write_under(
        &mut self,
        target: &Path,
        overwrite: Overwrite,
        content: Content,
    ) -> Result<Written, WriteError> {
        if target.file_name().is_none() {
            return Err(WriteError::IsFolder {
                path: target.to_path_buf(),
            });
        }
        overwrite.check(target)?;
        let fail = |error| WriteError::from_io("write", target, error);
        // A link is followed: the file it leads to is replaced, not the link.
        let shown = target.to_path_buf();
        let target = real(target).map_err(fail)?;
        let ((dir, name), made) = made_in(parent_of(&target), |_| Dir::of(&target))
            .map_err(|error| error.of("open the folder", parent_of(&target)))?;
        self.made.push(made);
        let own = dir.own_status().map_err(fail)?;
        for other in &self.staged {
            if other.name == name && other.dir.own_status().map_err(fail)?.is(&own) {
                return Err(WriteError::same_name(&target));
            }
        }
        let earlier = dir.status(&name).map_err(fail)?;
        // Another run that made the folder for nothing may have taken it away.
        let ((dir, mut temporary), made) = made_in(parent_of(&target), |folder| {
            let dir = Dir::open(folder)?;
            let temporary = new_temporary(&dir, earlier)?;
            Ok((dir, temporary))
        })
        .map_err(|error| error.of("write", &target))?;
        self.made.push(made);
        let written = fill(&mut temporary.file, Durability::Forced, content).map_err(fail)?;
        finish(&temporary, earlier)
            .and_then(|()| temporary.file.sync_all())
            .map_err(fail)?;
        self.staged.push(Staged {
            temporary,
            shown,
            target,
            dir,
            name,
            written: written.clone(),
            permit: Permit::New,
            overwrite,
        });
        Ok(written)
    }

    /// Removes the file of the given plain name when the others are put in place, if it is listed as
    /// ours and unchanged: an earlier set had it, this one has not.
    ///
    /// # Errors
    /// A name that is none.
    pub(crate) fn outdate(&mut self, name: &str) -> Result<(), WriteError> {
        check_name(name)?;
        self.outdated.push(self.folder.join(name));
        Ok(())
    }

    /// Puts all staged files in place.
    ///
    /// # Errors
    /// [`WriteError`]; files not yet in place are removed.
    pub fn commit(mut self) -> Result<(), WriteError> {
        let of_set = Dir::open(&self.folder).ok();
        let _lock = of_set.as_ref().and_then(|dir| dir.lock(&self.folder));
        // Another run may have been faster.
        for file in &mut self.staged {
            file.permit = file.overwrite.permit(&file.shown, Some(&file.written))?;
        }
        let note = self.note();
        if let Some((dir, name)) = &note {
            self.note_replaced(dir, name)?;
        }
        for path in &self.outdated {
            if let Ok((dir, name)) = Dir::of(path)
                && self.overwrite.owns(path)
            {
                dir.remove_file(&name)
                    .map_err(|error| WriteError::from_io("remove", path, error))?;
            }
        }
        let mut dirs: Vec<Dir> = Vec::new();
        for file in self.staged.into_iter().rev() {
            let placed = match file.permit {
                // Its folder counts all the same: a killed run's leftovers may be there.
                Permit::Same => Ok(()),
                Permit::New => file.temporary.persist_new(&file.name),
                Permit::Replace => file.temporary.persist(&file.name),
            };
            placed.map_err(|error| WriteError::from_io("write", &file.target, error))?;
            if !dirs.iter().any(|dir| dir.path() == file.dir.path()) {
                dirs.push(file.dir);
            }
        }
        // Also that of a run which was killed after its last rename.
        if let Some((dir, name)) = note
            && ReplacedNote::read_in(&dir, &name).is_some()
        {
            let _ = dir.remove_file(&name);
        }
        for dir in dirs {
            dir.sync()
                .map_err(|error| WriteError::from_io("write", dir.path(), error))?;
            clean_leftovers(&dir);
        }
        Ok(())
    }

    /// Where the note beside the record is, or would be.
    fn note(&self) -> Option<(Dir, OsString)> {
        Dir::of(&ReplacedNote::path(self.overwrite.record_path()?)).ok()
    }

    /// Notes beside the record which files are about to be replaced, as they are now.
    fn note_replaced(&self, dir: &Dir, name: &OsStr) -> Result<(), WriteError> {
        let record = self.overwrite.record_path();
        let replaced = |file: &&Staged| {
            file.permit == Permit::Replace && record.is_none_or(|record| file.target != record)
        };
        let mut files = Vec::new();
        for file in self.staged.iter().filter(replaced) {
            let entry = present(&file.dir, &file.name)
                .map_err(|error| WriteError::from_io("read", &file.target, error))?;
            files.extend(entry);
        }
        let fail = |error| WriteError::from_io("write", &dir.path().join(name), error);
        // Somebody else's file of that name stays; then a kill at the wrong moment costs a --force.
        let foreign =
            dir.status(name).map_err(fail)?.is_some() && ReplacedNote::read_in(dir, name).is_none();
        if files.is_empty() || foreign {
            return Ok(());
        }
        let bytes = ReplacedNote::new(files).bytes().map_err(fail)?;
        put(dir, &name.to_string_lossy(), true, |out| {
            out.write_all(&bytes)
        })
        .map_err(fail)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::artefact::{FileEntry, Input};

    fn record(inputs: &[Input], files: &[FileEntry]) -> String {
        let value = serde_json::json!({ "schema_version": "1.4.0", "fluxform_version": "0.1.0",
            "inputs": inputs, "files": files });
        String::from_utf8(crate::seal::to_record(&value).unwrap()).unwrap()
    }

    fn inputs() -> Vec<Input> {
        vec![Input::of_bytes("a.toml", b"a")]
    }

    /// A table and its sidecar.
    fn put_both(folder: &Path, table: &str, text: &str, force: bool) -> Result<(), WriteError> {
        let sidecar = Path::new(table).with_extension("json");
        let sidecar = sidecar.to_str().unwrap();
        let overwrite = Overwrite::new(force, folder.join(sidecar), &inputs());
        let mut set = FileSet::begin(folder, overwrite);
        let written = set.write(table, |out| out.write_all(text.as_bytes()))?;
        let record_text = record(&inputs(), &[FileEntry::new(table, written)]);
        set.write(sidecar, |out| out.write_all(record_text.as_bytes()))?;
        set.commit()
    }

    #[test]
    fn a_sidecar_is_a_permission_only_for_what_it_lists_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        put_both(folder.path(), "plate.csv", "1", false).unwrap();
        std::fs::write(path("plate.txt"), "mine").unwrap();
        let refused = put_both(folder.path(), "plate.txt", "2", false).unwrap_err();
        assert!(
            refused.to_string().contains("does not list it"),
            "{refused}"
        );
        assert_eq!(std::fs::read(path("plate.txt")).unwrap(), b"mine");
        put_both(folder.path(), "plate.csv", "2", false).unwrap();
        std::fs::write(path("plate.csv"), "edited").unwrap();
        let refused = put_both(folder.path(), "plate.csv", "3", false).unwrap_err();
        assert!(
            refused.to_string().contains("was changed since"),
            "{refused}"
        );
        assert_eq!(std::fs::read(path("plate.csv")).unwrap(), b"edited");
        put_both(folder.path(), "plate.csv", "3", true).unwrap();
        assert_eq!(folder.path().read_dir().unwrap().count(), 3);
    }

    #[test]
    fn a_sidecar_that_somebody_edited_is_no_permission() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        put_both(folder.path(), "plate.csv", "1", false).unwrap();
        std::fs::write(path("plate.txt"), "mine").unwrap();
        let mine = FileEntry {
            path: "plate.txt".to_owned(),
            bytes: 4,
            sha256: crate::artefact::sha256_hex(b"mine"),
        };
        let mine = serde_json::to_string(&mine).unwrap();
        let text = std::fs::read_to_string(path("plate.json")).unwrap();
        let edited = text.replacen("\"files\": [", &format!("\"files\": [{mine},"), 1);
        std::fs::write(path("plate.json"), edited).unwrap();
        for table in ["plate.txt", "plate.csv"] {
            let refused = put_both(folder.path(), table, "2", false).unwrap_err();
            let refused = refused.to_string();
            assert!(
                refused.contains("plate.json, which states"),
                "{table}: {refused}"
            );
        }
        assert_eq!(std::fs::read(path("plate.txt")).unwrap(), b"mine");
        assert_eq!(std::fs::read(path("plate.csv")).unwrap(), b"1");
    }

    /// A table and its record, made with one option.
    fn put_with(folder: &Path, jnd: f64, extra: bool, force: bool) -> Result<(), WriteError> {
        let options = crate::artefact::Options::of(&serde_json::json!({ "jnd": jnd }));
        let overwrite = Overwrite::new(force, folder.join("a.json"), &inputs()).made_with(&options);
        let mut set = FileSet::begin(folder, overwrite);
        let mut files = Vec::new();
        for name in ["a.csv", "a.vti"] {
            if name == "a.csv" || extra {
                let text = format!("{name} {jnd}");
                let written = set.write(name, |out| out.write_all(text.as_bytes()))?;
                files.push(FileEntry::new(name, written));
            } else {
                set.outdate(name)?;
            }
        }
        let record_text = serde_json::json!({ "schema_version": "1.4.0", "fluxform_version": "0.1.0",
            "inputs": inputs(), "made_with": options, "files": files });
        let record_text = crate::seal::to_record(&record_text).unwrap();
        set.write("a.json", |out| out.write_all(&record_text))?;
        set.commit()
    }

    #[test]
    fn output_of_other_options_is_replaced_with_force_alone_and_then_whole() {
        let folder = tempfile::tempdir().unwrap();
        let table = || std::fs::read_to_string(folder.path().join("a.csv")).unwrap();
        put_with(folder.path(), 0.07, true, false).unwrap();
        put_with(folder.path(), 0.07, true, false).unwrap();
        let refused = put_with(folder.path(), 7.0, true, false).unwrap_err();
        let refused = refused.to_string();
        assert!(
            refused.contains("other options: jnd 0.07, now 7.0"),
            "{refused}"
        );
        assert_eq!(table(), "a.csv 0.07");
        put_with(folder.path(), 7.0, false, true).unwrap();
        assert_eq!(table(), "a.csv 7");
        // Of the earlier options nothing stays beside it.
        assert_eq!(folder.path().read_dir().unwrap().count(), 2);
    }

    #[test]
    fn a_record_of_an_older_schema_has_no_seal_and_makes_way_with_force() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        put_both(folder.path(), "plate.csv", "1", false).unwrap();
        let text = std::fs::read_to_string(path("plate.json")).unwrap();
        let refused = |text: String| {
            std::fs::write(path("plate.json"), text).unwrap();
            let refused = put_both(folder.path(), "plate.csv", "2", false);
            refused.unwrap_err().to_string()
        };
        let edited = refused(text.replace("1.4.0", "1.3.0"));
        assert!(edited.contains("was changed since"), "{edited}");
        let (bare, _) = text.rsplit_once(',').unwrap();
        let older = refused(format!("{bare}\n}}\n").replace("1.4.0", "1.3.0"));
        assert!(older.contains("older version"), "{older}");
        put_both(folder.path(), "plate.csv", "2", true).unwrap();
        put_both(folder.path(), "plate.csv", "3", false).unwrap();
    }

    #[test]
    fn a_run_killed_between_two_renames_is_not_refused_by_its_own_files() {
        let folder = tempfile::tempdir().unwrap();
        put_both(folder.path(), "plate.csv", "1", false).unwrap();
        let old = std::fs::read(folder.path().join("plate.csv")).unwrap();
        // The sidecar of the second run, and the note of what it replaces, are in place.
        let sidecar = folder.path().join("plate.json");
        let note = ReplacedNote::new(vec![FileEntry {
            path: "plate.csv".to_owned(),
            bytes: 1,
            sha256: crate::artefact::sha256_hex(&old),
        }]);
        let new = FileEntry {
            path: "plate.csv".to_owned(),
            bytes: 2,
            sha256: crate::artefact::sha256_hex(b"22"),
        };
        std::fs::write(&sidecar, record(&inputs(), &[new])).unwrap();
        put_both(folder.path(), "plate.csv", "22", false).unwrap_err();
        std::fs::write(ReplacedNote::path(&sidecar), note.bytes().unwrap()).unwrap();
        put_both(folder.path(), "plate.csv", "22", false).unwrap();
        assert_eq!(folder.path().read_dir().unwrap().count(), 2);
    }

    /// They stayed for good where the next run changed nothing.
    #[test]
    fn what_a_killed_run_left_goes_also_where_nothing_changes() {
        let folder = tempfile::tempdir().unwrap();
        put_both(folder.path(), "plate.csv", "1", false).unwrap();
        std::fs::write(folder.path().join(".fluxform-0.tmp"), "").unwrap();
        put_both(folder.path(), "plate.csv", "1", false).unwrap();
        assert_eq!(folder.path().read_dir().unwrap().count(), 2);
    }

    #[test]
    fn the_note_of_a_run_killed_after_its_last_rename_goes_and_a_users_file_of_its_name_stays() {
        let folder = tempfile::tempdir().unwrap();
        put_both(folder.path(), "plate.csv", "22", false).unwrap();
        let note = ReplacedNote::path(&folder.path().join("plate.json"));
        let ours = ReplacedNote::new(vec![FileEntry {
            path: "plate.csv".to_owned(),
            bytes: 1,
            sha256: crate::artefact::sha256_hex(b"1"),
        }]);
        let ours = ours.bytes().unwrap();
        // Nothing is replaced, and then something.
        for text in ["22", "333"] {
            std::fs::write(&note, &ours).unwrap();
            put_both(folder.path(), "plate.csv", text, false).unwrap();
            assert!(!note.exists(), "left over");
        }
        let edited = [&ours[..], b"\n"].concat();
        let record = record(&inputs(), &[]).into_bytes();
        for theirs in [&b"mine"[..], &edited, &record] {
            std::fs::write(&note, theirs).unwrap();
            for text in ["333", "4444", "333"] {
                put_both(folder.path(), "plate.csv", text, false).unwrap();
                assert_eq!(std::fs::read(&note).unwrap(), theirs);
            }
        }
        std::fs::rename(&note, folder.path().join("elsewhere")).unwrap();
        std::fs::write(folder.path().join("elsewhere"), &ours).unwrap();
        std::os::unix::fs::symlink("elsewhere", &note).unwrap();
        put_both(folder.path(), "plate.csv", "4444", false).unwrap();
        assert!(note.is_symlink() && folder.path().join("elsewhere").is_file());
    }

    #[test]
    fn what_a_run_reads_is_never_replaced() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("a.toml"), "a").unwrap();
        std::fs::hard_link(path("a.toml"), path("hard.csv")).unwrap();
        symlink(path("a.toml"), path("soft.csv")).unwrap();
        std::fs::create_dir(path("read")).unwrap();
        std::fs::write(path("read/b"), "b").unwrap();
        let read = [Input::of_bytes(path("a.toml").display().to_string(), b"a")];
        for force in [false, true] {
            let overwrite = Overwrite::same_bytes(force, &read).protecting([path("read")]);
            for name in ["a.toml", "hard.csv", "soft.csv", "read/b", "read/new"] {
                let refused = write(&path(name), &overwrite, |out| out.write_all(b"x"));
                let refused = refused.unwrap_err();
                assert!(
                    matches!(refused, WriteError::Protected { .. }),
                    "{name}: {refused}"
                );
            }
        }
        assert_eq!(std::fs::read(path("a.toml")).unwrap(), b"a");
        assert_eq!(path("read").read_dir().unwrap().count(), 1);
    }

    #[test]
    fn force_replaces_no_folder_no_link_and_no_pipe() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("thesis.tex"), "years").unwrap();
        std::fs::create_dir(path("folder")).unwrap();
        symlink(path("thesis.tex"), path("link")).unwrap();
        symlink(path("none"), path("dangling")).unwrap();
        for name in ["folder", "link", "dangling"] {
            write(&path(name), &Overwrite::force(), |out| out.write_all(b"x")).unwrap_err();
        }
        assert_eq!(std::fs::read(path("thesis.tex")).unwrap(), b"years");
        assert!(path("dangling").is_symlink() && !path("none").exists());
        // A link to what is ours is followed.
        put_both(folder.path(), "plate.csv", "1", false).unwrap();
        std::fs::rename(path("plate.csv"), path("folder/real.csv")).unwrap();
        symlink(path("folder/real.csv"), path("plate.csv")).unwrap();
        put_both(folder.path(), "plate.csv", "2", false).unwrap();
        assert!(path("plate.csv").is_symlink());
        assert_eq!(std::fs::read(path("folder/real.csv")).unwrap(), b"2");
    }

    #[test]
    fn force_reaches_no_users_file_through_a_linked_folder() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("theirs")).unwrap();
        symlink(path("theirs"), path("out")).unwrap();
        for name in ["plan.json", "plate.csv", "a.svg"] {
            std::fs::write(path("theirs").join(name), "years").unwrap();
        }
        let put = |name: &str, overwrite: Overwrite| {
            write(&path("out").join(name), &overwrite, |out| {
                out.write_all(b"<!-- fluxform, drawn of b -->")
            })
        };
        let drawn = |mark: &str| Overwrite::beginning(true, mark, &[]);
        put("plan.json", Overwrite::force()).unwrap_err();
        put("a.svg", drawn("<!-- fluxform, drawn of b")).unwrap_err();
        put_both(&path("out"), "plate.csv", "2", true).unwrap_err();
        for name in ["plan.json", "plate.csv", "a.svg"] {
            assert_eq!(std::fs::read(path("theirs").join(name)).unwrap(), b"years");
        }
        // A new name, or one of ours, is written there.
        put_both(&path("out"), "new.csv", "1", false).unwrap();
        put_both(&path("out"), "new.csv", "2", true).unwrap();
        let ours = path("theirs").join("b.svg");
        std::fs::write(&ours, "<!-- fluxform, drawn of a -->").unwrap();
        put("b.svg", drawn("<!-- fluxform, drawn of b")).unwrap();
        assert!(std::fs::read(ours).unwrap().ends_with(b"b -->"));
    }

    #[test]
    fn the_mode_of_a_file_survives_a_rewrite() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plate.csv");
        put_both(folder.path(), "plate.csv", "1", false).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        put_both(folder.path(), "plate.csv", "2", false).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"2");
        assert_eq!(
            path.metadata().unwrap().permissions().mode() & 0o7777,
            0o600
        );
    }

    #[test]
    fn the_same_bytes_again_change_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.svg");
        let put = |text: &'static str| {
            let overwrite = Overwrite::same_bytes(false, &[]);
            write(&path, &overwrite, |out| out.write_all(text.as_bytes()))
        };
        put("a").unwrap();
        let before = path.metadata().unwrap().modified().unwrap();
        put("a").unwrap();
        assert_eq!(path.metadata().unwrap().modified().unwrap(), before);
        assert!(matches!(put("b"), Err(WriteError::OutputExists { .. })));
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    }

    #[test]
    fn a_faster_run_of_other_inputs_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let input = |text: &str| Input::of_bytes(format!("{text}.toml"), text.as_bytes());
        let begun = |text: &str| {
            let overwrite = Overwrite::new(false, folder.path().join("map.json"), &[input(text)]);
            let mut set = FileSet::begin(folder.path(), overwrite);
            let map = set.write("map.npz", |out| out.write_all(text.as_bytes()));
            let record_text = record(&[input(text)], &[FileEntry::new("map.npz", map.unwrap())]);
            set.write("map.json", |out| out.write_all(record_text.as_bytes()))
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
            let mut set = FileSet::begin(folder.path(), Overwrite::same_bytes(false, &[]));
            set.write("plan.json", |out| out.write_all(text.as_bytes()))
                .unwrap();
            set
        };
        let (slow, fast) = (begun("slow"), begun("fast"));
        fast.commit().unwrap();
        let refused = slow.commit().unwrap_err();
        assert!(
            refused.to_string().contains("plan.json exists"),
            "{refused}"
        );
        let kept = std::fs::read(folder.path().join("plan.json")).unwrap();
        assert_eq!(kept, b"fast");
    }

    #[test]
    fn folders_made_for_nothing_go_again() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("new/newer");
        let mut set = FileSet::begin(&deep, Overwrite::force());
        set.write("a", |_| Err(io::ErrorKind::Other.into()))
            .unwrap_err();
        drop(set);
        assert!(!folder.path().join("new").exists());
        let mut set = FileSet::begin(&deep, Overwrite::force());
        assert!(!folder.path().join("new").exists());
        set.write("a", |out| out.write_all(b"a")).unwrap();
        set.commit().unwrap();
        assert_eq!(std::fs::read(deep.join("a")).unwrap(), b"a");
    }

    #[test]
    fn one_file_spelt_in_two_ways_is_not_written_twice() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("inner");
        let overwrite = Overwrite::new(false, folder.path().join("map.json"), &[]);
        let mut set = FileSet::begin(&inner, overwrite);
        set.write_at(&inner.join("a.yaml"), |out| out.write_all(b"nodes"))
            .unwrap();
        let again = folder.path().join("inner/../inner/a.yaml");
        let refused = set.write_at(&again, |out| out.write_all(b"sources"));
        let record_text = refused.unwrap_err().to_string();
        assert!(
            record_text.contains("another file of this command"),
            "{record_text}"
        );
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
