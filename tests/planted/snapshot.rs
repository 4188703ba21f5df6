//! Contents of a folder: kind, mode, bytes and link target of every entry.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::path::Path;

/// Object at a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    File(Vec<u8>),
    Folder,
    Link(String),
    Pipe,
    Other,
}

/// An entry without what may change unnoticed: times, and the number of hard links.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    pub mode: u32,
    pub kind: Kind,
}

/// Every entry below a folder by its path; links are not followed.
pub type Snapshot = BTreeMap<String, Entry>;

pub fn snapshot(root: &Path) -> Snapshot {
    let mut found = Snapshot::new();
    walk(root, "", &mut found);
    found
}

fn walk(root: &Path, prefix: &str, found: &mut Snapshot) {
    for entry in fs::read_dir(root.join(prefix))
        .into_iter()
        .flatten()
        .flatten()
    {
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        let path = entry.path();
        let facts = fs::symlink_metadata(&path).unwrap();
        let of = facts.file_type();
        let kind = if of.is_symlink() {
            Kind::Link(fs::read_link(&path).unwrap().to_string_lossy().into_owned())
        } else if of.is_dir() {
            Kind::Folder
        } else if of.is_file() {
            Kind::File(fs::read(&path).unwrap())
        } else if of.is_fifo() {
            Kind::Pipe
        } else {
            Kind::Other
        };
        let mode = facts.permissions().mode();
        found.insert(name.clone(), Entry { mode, kind });
        if of.is_dir() {
            walk(root, &format!("{name}/"), found);
        }
    }
}

/// How `after` fails to hold an entry of `before`.
pub fn change(path: &str, before: &Snapshot, after: &Snapshot) -> Option<String> {
    let was = &before[path];
    let Some(is) = after.get(path) else {
        return Some(format!("{path} is gone"));
    };
    match (&was.kind, &is.kind) {
        (Kind::File(a), Kind::File(b)) if a != b => Some(format!("{path} has other bytes")),
        (a, b) if a == b && was.mode != is.mode => {
            Some(format!("{path} has mode {:o}, had {:o}", is.mode, was.mode))
        }
        (a, b) if a == b => None,
        (a, b) => Some(format!("{path} was {}, is {}", word(a), word(b))),
    }
}

fn word(kind: &Kind) -> &'static str {
    match kind {
        Kind::File(_) => "a file",
        Kind::Folder => "a folder",
        Kind::Link(_) => "a link",
        Kind::Pipe => "a pipe",
        Kind::Other => "something else",
    }
}
