//! Digest of the sources that a build is made of: what an earlier build kept is not this one's.
//! And the revision that `--version` prints for a release build; others would be compiled again with
//! every commit.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;

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

/// What git answers, without the line's end.
fn git(arguments: &[&str]) -> Option<String> {
    let answer = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(answer.stdout).ok()?;
    answer.status.success().then(|| text.trim_end().to_owned())
}

/// The checkout's revision, or the one that a packaged crate was made from.
fn revision() -> Option<String> {
    if !Path::new(".git").exists() {
        let packaged = std::fs::read_to_string(".cargo_vcs_info.json").ok()?;
        let (_, sha1) = packaged.split_once("\"sha1\": \"")?;
        return sha1.get(..12).map(str::to_owned);
    }
    let log = git(&["rev-parse", "--git-path", "logs/HEAD"])?;
    println!("cargo::rerun-if-changed={log}");
    let changed = !git(&["status", "--porcelain", "--untracked-files=no"])?.is_empty();
    let sha1 = git(&["rev-parse", "--short=12", "HEAD"])?;
    Some(if changed {
        format!("{sha1}, changed")
    } else {
        sha1
    })
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
    let release = std::env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let reported = release.then(revision).flatten();
    let reported = reported.map_or_else(String::new, |revision| format!(" ({revision})"));
    println!("cargo::rustc-env=FLUXFORM_REVISION={reported}");
}
