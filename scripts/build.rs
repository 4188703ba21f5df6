//! Digest of the sources that a build is made of: what an earlier build kept is not this one's.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};

fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let path = entry.path();
        if path.is_dir() {
            files_below(&path, found);
        } else {
            found.push(path);
        }
    }
}

fn main() {
    println!("cargo::rerun-if-changed=src");
    println!("cargo::rerun-if-changed=Cargo.lock");
    let mut files = vec![PathBuf::from("Cargo.lock")];
    files_below(Path::new("src"), &mut files);
    files.sort();
    let mut digest = DefaultHasher::new();
    for file in files {
        let Ok(bytes) = std::fs::read(&file) else {
            continue;
        };
        file.hash(&mut digest);
        bytes.hash(&mut digest);
    }
    for variable in ["PROFILE", "TARGET", "OPT_LEVEL"] {
        std::env::var(variable)
            .unwrap_or_default()
            .hash(&mut digest);
    }
    println!("cargo::rustc-env=FLUXFORM_BUILD={:016x}", digest.finish());
}
