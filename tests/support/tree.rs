//! Folders as values: their files with their bytes.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Every file below a folder with its bytes; a folder with nothing in it ends with `/`.
pub type Tree = BTreeMap<String, Vec<u8>>;

/// The files below `folder`; one that goes during the walk is not there.
#[must_use]
pub fn tree(folder: &Path) -> Tree {
    let mut files = Tree::new();
    walk(folder, folder, &mut files);
    files
}

fn walk(root: &Path, folder: &Path, files: &mut Tree) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    let mut any = false;
    for entry in entries.flatten() {
        any = true;
        let path = entry.path();
        let name = path.strip_prefix(root).unwrap().to_string_lossy();
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            walk(root, &path, files);
        } else if let Ok(bytes) = fs::read(&path) {
            files.insert(name.into_owned(), bytes);
        }
    }
    if !any && folder != root {
        let name = folder.strip_prefix(root).unwrap().to_string_lossy();
        files.insert(format!("{name}/"), Vec::new());
    }
}

/// Copies a folder of files and folders with their modes; links are followed.
pub fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
    fs::set_permissions(to, fs::metadata(from).unwrap().permissions()).unwrap();
}

/// No file of a write that did not end is left in `folder`.
pub fn assert_no_leftovers(folder: &Path) {
    for entry in fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(!name.contains("fluxform"), "{name} is left");
    }
}

/// A file is the same in two places; what is cached for the next run names its folder in its head.
#[must_use]
pub fn agree(name: &str, one: &[u8], other: &[u8]) -> bool {
    const OWN: std::ops::Range<usize> = 8..40;
    if !name.contains(".fluxform-cache/") || one.len().min(other.len()) < OWN.end {
        return one == other;
    }
    one[..OWN.start] == other[..OWN.start] && one[OWN.end..] == other[OWN.end..]
}

/// Two trees are the same but for the seconds; else which file differs.
pub fn same(now: &Tree, expected: &Tree) -> Result<(), String> {
    let names: BTreeSet<&String> = now.keys().chain(expected.keys()).collect();
    for name in names {
        match (now.get(name), expected.get(name)) {
            (Some(_), None) => return Err(format!("{name} is left over")),
            (None, _) => return Err(format!("{name} is missing")),
            (Some(a), Some(b)) if !agree(name, a, b) && !file_name(name).starts_with("timing") => {
                return Err(format!("{name} differs"));
            }
            _ => {}
        }
    }
    Ok(())
}

#[must_use]
pub fn file_name(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}
