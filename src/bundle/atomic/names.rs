//! Names: those of the program's own files, and what a name may be.

use std::path::{Component, Path};

use super::WriteError;

/// The file whose presence makes a folder a bundle.
pub(super) const MANIFEST: &str = "manifest.json";

/// Ending of the name of a folder or note that a run puts aside.
pub(super) const OLD: &str = ".fluxform-old";

/// The folder that `path` is in, as it is spelt; `.` for a bare name.
pub(super) fn parent_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// A name inside a bundle: relative, `/`-separated plain names, none of them `.` or `..`.
pub(crate) fn check_name(name: &str) -> Result<(), WriteError> {
    let plain = Path::new(name)
        .components()
        .all(|part| matches!(part, Component::Normal(_)));
    let odd = |c: char| c == '\\' || c == ':' || c.is_control();
    // `components` folds "a//b", "a/./b" and "a/": their number shows.
    let parts = Path::new(name).components().count();
    if name.is_empty() || !plain || name.contains(odd) || parts != name.split('/').count() {
        return Err(WriteError::BadName {
            name: name.to_owned(),
        });
    }
    Ok(())
}
