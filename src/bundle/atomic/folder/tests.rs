//! Whole folders: swaps that are cut short, and what of a folder is kept.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use super::*;
use crate::artefact::Input;

#[test]
fn a_bundle_named_like_a_temporary_folder_is_refused_not_lost() {
    let folder = tempfile::tempdir().unwrap();
    for name in [
        ".fluxform-7.tmp",
        ".bump.fluxform-old",
        ".fluxform-7.tmp/bump",
    ] {
        let target = folder.path().join(name);
        let refused = FolderDraft::begin(&target, Overwrite::force()).unwrap_err();
        assert!(refused.to_string().contains("temporary"), "{refused}");
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    }
}

/// A manifest of ours that lists these files, made from `a.toml`.
fn manifest(files: &[FileEntry]) -> String {
    let inputs = [Input::of_bytes("a.toml", b"a")];
    let value = serde_json::json!({ "schema_version": "1.4.0", "fluxform_version": "0.1.0",
        "inputs": inputs, "files": files });
    String::from_utf8(crate::seal::to_record(&value).unwrap()).unwrap()
}

fn ours(target: &Path) -> Overwrite {
    let inputs = [Input::of_bytes("a.toml", b"a")];
    Overwrite::new(false, target.join(MANIFEST), &inputs)
}

/// A folder of one file and its manifest.
fn put(target: &Path, text: &str) -> Result<(), WriteError> {
    put_files(target, ours(target), &[("a.txt", text)])
}

fn put_files(
    target: &Path,
    overwrite: Overwrite,
    files: &[(&str, &str)],
) -> Result<(), WriteError> {
    let mut draft = FolderDraft::begin(target, overwrite)?;
    let entries: Vec<FileEntry> = files
        .iter()
        .map(|(name, text)| draft.write(name, |out| out.write_all(text.as_bytes())))
        .collect::<Result<_, _>>()?;
    draft.write(MANIFEST, |out| out.write_all(manifest(&entries).as_bytes()))?;
    draft.commit()
}

#[test]
fn a_manifest_into_which_somebody_wrote_a_users_file_is_no_permission() {
    let place = tempfile::tempdir().unwrap();
    let target = place.path().join("bump");
    put(&target, "ours").unwrap();
    fs::write(target.join("thesis.tex"), "years").unwrap();
    let thesis = FileEntry {
        path: "thesis.tex".to_owned(),
        bytes: 5,
        sha256: crate::artefact::sha256_hex(b"years"),
    };
    let text = fs::read_to_string(target.join(MANIFEST)).unwrap();
    let entry = serde_json::to_string(&thesis).unwrap();
    let edited = text.replacen("\"files\": [", &format!("\"files\": [{entry},"), 1);
    fs::write(target.join(MANIFEST), &edited).unwrap();
    let refused = put(&target, "more").unwrap_err().to_string();
    assert!(refused.contains("was changed since"), "{refused}");
    assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"ours");
    // With force all that was there stays beside the new.
    let forced = Overwrite::new(
        true,
        target.join(MANIFEST),
        &[Input::of_bytes("a.toml", b"a")],
    );
    put_files(&target, forced, &[("a.txt", "more")]).unwrap();
    assert_eq!(fs::read(target.join("thesis.tex")).unwrap(), b"years");
    assert_eq!(fs::read(target.join("a.txt.kept-1")).unwrap(), b"ours");
    let kept = fs::read_to_string(target.join("manifest.json.kept-1")).unwrap();
    assert_eq!(kept, edited);
}

/// Every file below with its bytes, links by where they lead.
fn tree(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in folder.read_dir().unwrap() {
        let path = entry.unwrap().path();
        let kind = path.symlink_metadata().unwrap();
        if kind.is_dir() {
            found.insert(path.clone(), Vec::new());
            found.extend(tree(&path));
        } else if kind.is_symlink() {
            let to = fs::read_link(&path).unwrap();
            found.insert(path, to.to_string_lossy().into_owned().into_bytes());
        } else {
            found.insert(path.clone(), fs::read(&path).unwrap());
        }
    }
    found
}

fn names(folder: &Path) -> BTreeSet<String> {
    let entries = folder.read_dir().unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_is_there_at_every_moment_while_it_is_replaced() {
    use std::sync::atomic::{AtomicBool, Ordering};
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bump");
    put(&target, "0").unwrap();
    fs::write(target.join("mine.txt"), "mine").unwrap();
    fs::create_dir(folder.path().join("probe")).unwrap();
    let dir = Dir::open(folder.path()).unwrap();
    // Some file systems know no exchange.
    if !dir.exchange("bump", "probe").unwrap() {
        return;
    }
    dir.exchange("bump", "probe").unwrap();
    let (done, begun) = (AtomicBool::new(false), AtomicBool::new(false));
    // Who had found the older folder may find it cleared: then the newer one is there.
    let read = |name: &str| (0..9).find_map(|_| fs::read(target.join(name)).ok());
    std::thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let (mut looks, mut absent) = (0, 0);
            while !done.load(Ordering::Relaxed) {
                let whole = |name| read(name).is_some_and(|bytes| !bytes.is_empty());
                let there = target.is_dir() && whole("a.txt") && whole(MANIFEST);
                absent += usize::from(!there);
                looks += 1;
                begun.store(true, Ordering::Relaxed);
            }
            (looks, absent)
        });
        while !begun.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
        let put = (0..200).try_for_each(|round| put(&target, &round.to_string()));
        done.store(true, Ordering::Relaxed);
        let (looks, absent) = reader.join().unwrap();
        put.unwrap();
        assert!(looks > 200, "only {looks} looks");
        assert_eq!(absent, 0, "of {looks} looks");
    });
    assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"199");
    assert_eq!(fs::read(target.join("mine.txt")).unwrap(), b"mine");
    assert_eq!(names(folder.path()).len(), 2);
}

/// A run that was killed right after it renamed its draft, or right after the exchange.
fn killed(target: &Path, text: &str, exchanged: bool) {
    let place = TargetPlace::of(target, Dir::open(parent_of(target)).unwrap(), false).unwrap();
    let mut draft = FolderDraft::begin(target, ours(target)).unwrap();
    let entry = draft.write("a.txt", |out| out.write_all(text.as_bytes()));
    let manifest = manifest(&[entry.unwrap()]);
    draft
        .write(MANIFEST, |out| out.write_all(manifest.as_bytes()))
        .unwrap();
    let old = place.folder().unwrap().unwrap();
    let aside = place.aside(&old, &draft.draft.dir);
    let temporary = draft.draft.name().to_owned();
    place
        .parent
        .rename(&temporary, &place.parent, &aside)
        .unwrap();
    draft.draft.keep();
    if exchanged {
        assert!(place.parent.exchange(&aside, &place.name).unwrap());
    }
}

#[test]
fn a_new_folder_that_never_came_into_place_goes_again() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bump");
    put(&target, "old").unwrap();
    fs::write(target.join("mine.txt"), "mine").unwrap();
    killed(&target, "new", false);
    assert_eq!(names(folder.path()).len(), 2);
    drop(FolderDraft::begin(&target, ours(&target)).unwrap());
    assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"old");
    assert_eq!(fs::read(target.join("mine.txt")).unwrap(), b"mine");
    assert_eq!(names(folder.path()), ["bump".to_owned()].into());
}

#[cfg(target_os = "linux")]
#[test]
fn a_swap_that_was_cut_short_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bump");
    put(&target, "old").unwrap();
    fs::write(target.join("mine.txt"), "mine").unwrap();
    killed(&target, "new", true);
    assert!(!target.join("mine.txt").exists());
    drop(FolderDraft::begin(&target, ours(&target)).unwrap());
    assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"new");
    assert_eq!(fs::read(target.join("mine.txt")).unwrap(), b"mine");
    assert_eq!(names(folder.path()), ["bump".to_owned()].into());
}

#[test]
fn without_an_exchange_two_renames_do_and_a_kill_between_them_is_undone() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bump");
    put(&target, "old").unwrap();
    put(&folder.path().join("draft"), "new").unwrap();
    let place = TargetPlace::of(&target, Dir::open(folder.path()).unwrap(), false).unwrap();
    let new = place.parent.child("draft").unwrap();
    let aside = place.aside(&place.folder().unwrap().unwrap(), &new);
    // The second rename fails: there is nothing to rename.
    place
        .replace_by_renames(OsStr::new("none"), &aside)
        .unwrap_err();
    assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"old");
    // Killed between the two.
    place.parent.rename("bump", &place.parent, &aside).unwrap();
    FolderDraft::check(&target, &ours(&target), &["a.txt"]).unwrap();
    drop(FolderDraft::begin(&target, ours(&target)).unwrap());
    assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"old");
    place
        .replace_by_renames(OsStr::new("draft"), &aside)
        .unwrap();
    assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"new");
    assert_eq!(
        fs::read(folder.path().join(&aside).join("a.txt")).unwrap(),
        b"old"
    );
}

/// Links and folders of every name under which a run puts a folder aside.
#[test]
fn a_link_or_a_folder_that_is_named_like_one_put_aside_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let [target, victim] = ["bump", "victim"].map(|name| folder.path().join(name));
    put(&target, "old").unwrap();
    put(&victim, "theirs").unwrap();
    fs::write(victim.join("thesis.tex"), "years").unwrap();
    let place = TargetPlace::of(&target, Dir::open(folder.path()).unwrap(), false).unwrap();
    let own = place.folder().unwrap().unwrap();
    let identities = place.aside(&own, &own).into_string().unwrap();
    let plain = ".bump.fluxform-old".to_owned();
    for aside in [plain, identities, ".bump.0-0.fluxform-old".to_owned()] {
        let aside = folder.path().join(aside);
        std::os::unix::fs::symlink(&victim, &aside).unwrap();
        let before = tree(&victim);
        let other = Overwrite::new(false, target.join(MANIFEST), &[]);
        let whole = tree(folder.path());
        FolderDraft::begin(&target, other).unwrap_err();
        assert_eq!(tree(folder.path()), whole, "refused");
        put(&target, "new").unwrap();
        assert!(tree(&victim) == before && aside.is_symlink());
        fs::remove_file(&aside).unwrap();
        // A copy of a bundle: not the folder that was there.
        fs::create_dir(&aside).unwrap();
        fs::write(aside.join("thesis.tex"), "years").unwrap();
        fs::copy(target.join(MANIFEST), aside.join(MANIFEST)).unwrap();
        let before = tree(&aside);
        put(&target, "newer").unwrap();
        put_files(&target, Overwrite::force(), &[("a.txt", "newest")]).unwrap();
        assert_eq!(tree(&aside), before);
        fs::remove_dir_all(&aside).unwrap();
    }
}

#[test]
fn what_the_user_lays_into_a_bundle_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bump");
    let first = [("a.txt", "a"), ("plots/ours.svg", "ours"), ("b.txt", "b")];
    put_files(&target, ours(&target), &first).unwrap();
    let mine = [
        "timing.json",
        "timing_of_mine.csv",
        "report.html",
        "plots/mine.svg",
        "notes/deep/a",
    ];
    fs::create_dir_all(target.join("notes/deep")).unwrap();
    for name in mine {
        fs::write(target.join(name), "mine").unwrap();
    }
    fs::write(target.join("b.txt"), "edited").unwrap();
    std::os::unix::fs::symlink("/nowhere", target.join("link")).unwrap();
    put_files(&target, ours(&target), &[("a.txt", "a2")]).unwrap();
    for name in mine {
        assert_eq!(fs::read(target.join(name)).unwrap(), b"mine", "{name}");
    }
    assert_eq!(fs::read(target.join("b.txt")).unwrap(), b"edited");
    assert!(target.join("link").is_symlink() && !target.join("plots/ours.svg").exists());
    // Of the names of the new bundle.
    for (name, text) in [
        ("report.html", "page"),
        ("b.txt", "b3"),
        ("notes", "a file"),
    ] {
        let before = tree(folder.path());
        let files = [("a.txt", "a3"), (name, text)];
        let refused = put_files(&target, ours(&target), &files).unwrap_err();
        assert!(
            matches!(refused, WriteError::OutputExists { .. }),
            "{refused}"
        );
        assert!(refused.to_string().contains(name), "{refused}");
        assert_eq!(tree(folder.path()), before);
    }
    // With force a file makes way, a folder does not.
    let before = tree(folder.path());
    let refused = put_files(&target, Overwrite::force(), &[("notes", "a file")]);
    let refused = refused.unwrap_err();
    assert!(matches!(refused, WriteError::Protected { .. }), "{refused}");
    assert_eq!(tree(folder.path()), before);
    let forced = [("report.html", "page"), ("b.txt", "b4")];
    put_files(&target, Overwrite::force(), &forced).unwrap();
    let read = |name: &str| fs::read(target.join(name)).unwrap();
    assert_eq!(
        (read("report.html"), read("b.txt")),
        (b"page".to_vec(), b"b4".to_vec())
    );
    assert_eq!(read("report.html.kept-1"), b"mine");
    assert_eq!(read("b.txt.kept-1"), b"edited");
    assert_eq!(read("notes/deep/a"), b"mine");
    assert!(!target.join("a.txt").exists(), "listed and unchanged");
}

#[test]
fn what_a_foreign_manifest_lists_is_not_ours() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bump");
    fs::create_dir(&target).unwrap();
    fs::write(target.join("thesis.tex"), "years").unwrap();
    let entry = serde_json::json!({ "path": "thesis.tex", "bytes": 5,
        "sha256": crate::artefact::sha256_hex(b"years") });
    let theirs = serde_json::json!({ "name": "theirs", "files": [entry] }).to_string();
    fs::write(target.join(MANIFEST), &theirs).unwrap();
    put_files(&target, ours(&target), &[("a.txt", "a")]).unwrap_err();
    put_files(&target, Overwrite::force(), &[("a.txt", "a")]).unwrap();
    assert_eq!(fs::read(target.join("thesis.tex")).unwrap(), b"years");
    let kept = fs::read(target.join("manifest.json.kept-1")).unwrap();
    assert_eq!(kept, theirs.as_bytes());
}

#[test]
fn modes_survive_a_rewrite() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bump");
    let files = |text| [("a.txt", text), ("plots/ours.svg", text)];
    put_files(&target, ours(&target), &files("old")).unwrap();
    let modes = [
        ("", 0o700),
        ("plots", 0o710),
        ("a.txt", 0o600),
        (MANIFEST, 0o640),
    ];
    for (name, mode) in modes {
        let permissions = fs::Permissions::from_mode(mode);
        fs::set_permissions(target.join(name), permissions).unwrap();
    }
    put_files(&target, ours(&target), &files("new")).unwrap();
    assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"new");
    for (name, mode) in modes {
        let found = target.join(name).metadata().unwrap().permissions().mode();
        assert_eq!(found & 0o7777, mode, "{name}");
    }
}

/// An older bundle whose manifest is a pipe, never ends, or is larger than any.
#[cfg(target_os = "linux")]
#[test]
fn the_manifest_of_a_replaced_folder_is_no_pipe_nor_endless() {
    use rustix::fs::{CWD, FileType, Mode, mknodat};
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bump");
    let manifest = target.join(MANIFEST);
    let mode = Mode::RUSR | Mode::WUSR;
    let lay: [&dyn Fn(); 3] = [
        &|| mknodat(CWD, &manifest, FileType::Fifo, mode, 0).unwrap(),
        &|| std::os::unix::fs::symlink("/dev/zero", &manifest).unwrap(),
        &|| {
            let file = fs::File::create(&manifest).unwrap();
            file.set_len(1 << 40).unwrap();
        },
    ];
    for lay in lay {
        fs::create_dir(&target).unwrap();
        lay();
        let is_file = fs::symlink_metadata(&manifest).unwrap().is_file();
        FolderDraft::begin(&target, ours(&target)).unwrap_err();
        let forced = put_files(&target, Overwrite::force(), &[("a.txt", "a")]);
        assert_eq!(forced.is_ok(), is_file, "only a plain file makes way");
        assert_eq!(target.join("a.txt").is_file(), is_file);
        assert_eq!(target.join("manifest.json.kept-1").exists(), is_file);
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
        fs::remove_dir_all(&target).unwrap();
    }
}

#[test]
fn folders_made_for_nothing_go_again() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("design/bump");
    drop(FolderDraft::begin(&target, Overwrite::force()).unwrap());
    assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    FolderDraft::begin(&target, Overwrite::force())
        .and_then(|mut draft| {
            draft.write("a", |out| out.write_all(b"a"))?;
            draft.commit()
        })
        .unwrap();
    assert!(target.join("a").is_file());
}

#[test]
fn force_does_not_reach_a_foreign_folder_through_a_link() {
    let folder = tempfile::tempdir().unwrap();
    let [target, link, victim] = ["bump", "link", "victim"].map(|name| folder.path().join(name));
    fs::create_dir(&victim).unwrap();
    fs::write(victim.join(MANIFEST), "theirs").unwrap();
    std::os::unix::fs::symlink(&victim, &link).unwrap();
    let before = tree(folder.path());
    let record = link.join(MANIFEST);
    let overwrite = Overwrite::new(true, record, &[Input::of_bytes("a.toml", b"a")]);
    let refused = put_files(&link, overwrite, &[("a.txt", "a")]).unwrap_err();
    assert!(matches!(refused, WriteError::Protected { .. }), "{refused}");
    assert_eq!(tree(folder.path()), before);
    // To what is ours it leads.
    put(&target, "old").unwrap();
    fs::remove_file(&link).unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    put(&link, "new").unwrap();
    assert!(link.is_symlink());
    assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"new");
}

#[test]
fn the_owner_survives_a_rewrite() {
    use std::os::unix::fs::{MetadataExt, chown};
    const OTHER: u32 = 12_345;
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bump");
    put(&target, "old").unwrap();
    let owned = ["", "a.txt", MANIFEST].map(|name| target.join(name));
    // Only the superuser may give a file away.
    if owned
        .iter()
        .any(|path| chown(path, Some(OTHER), Some(OTHER)).is_err())
    {
        return;
    }
    put(&target, "new").unwrap();
    assert_eq!(fs::read(target.join("a.txt")).unwrap(), b"new");
    for path in &owned {
        let found = path.metadata().unwrap();
        assert_eq!((found.uid(), found.gid()), (OTHER, OTHER), "{path:?}");
    }
}
