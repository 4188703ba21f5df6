//! The C loader of bundles as a program.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::root;

/// Builds `scripts/fluxform_replay.c` in `folder` with additional flags.
///
/// # Panics
/// If the compiler refuses it.
#[must_use]
pub fn c_loader(folder: &Path, flags: &[&str]) -> PathBuf {
    let program = folder.join("replay");
    let sources = ["replay", "bundle", "currents"]
        .map(|name| root().join(format!("scripts/fluxform_{name}.c")));
    let built = Command::new("cc")
        .args("-std=c99 -Wall -Wextra -Wpedantic -Werror -O2".split(' '))
        .args(flags)
        .args(sources)
        .arg("-o")
        .arg(&program)
        .arg("-lm")
        .status();
    assert!(built.unwrap().success(), "the C loader does not compile");
    program
}
