//! When the files of a run change.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::{Duration, Instant};

/// Names, sizes and numbers of all that lies below: differs when anything changed.
fn glimpse(folder: &Path) -> Vec<(PathBuf, u64)> {
    let mut entries_below = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let length = entry.metadata().map_or(0, |metadata| metadata.len());
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                folders.push(entry.path());
            }
            entries_below.push((entry.path(), length));
        }
    }
    entries_below
}

/// How often the folder changes before the child ends, as far as looking all the time shows.
pub fn changes(folder: &Path, child: &mut Child) -> usize {
    after_changes(folder, child, usize::MAX)
}

/// Returns at the `most`-th change in the folder, or when the child has ended: how many there were.
pub fn after_changes(folder: &Path, child: &mut Child, most: usize) -> usize {
    let mut last = glimpse(folder);
    let mut count = 0;
    let began = Instant::now();
    while count < most && child.try_wait().unwrap().is_none() {
        let now = glimpse(folder);
        if now != last {
            count += 1;
            last = now;
        }
        assert!(began.elapsed() < Duration::from_secs(300), "hangs");
    }
    count
}
