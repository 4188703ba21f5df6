//! The C loader of bundles as a program, and its C++ wrapper.

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

/// Builds `scripts/fluxform_replay.cpp` in `folder`.
///
/// # Panics
/// If a compiler refuses it.
#[must_use]
pub fn cpp_loader(folder: &Path) -> PathBuf {
    let source = |name: &str| root().join("scripts").join(name);
    let compiled = Command::new("cc")
        .args(["-std=c99", "-O2", "-c"])
        .args(["fluxform_bundle.c", "fluxform_currents.c"].map(source))
        .current_dir(folder)
        .status();
    assert!(compiled.unwrap().success(), "the C loader does not compile");
    let program = folder.join("replay_cpp");
    let built = Command::new("c++")
        .args("-std=c++11 -Wall -Wextra -Wpedantic -Werror -O2".split(' '))
        .arg(source("fluxform_replay.cpp"))
        .args(["fluxform_bundle.o", "fluxform_currents.o"].map(|name| folder.join(name)))
        .arg("-o")
        .arg(&program)
        .arg("-lm")
        .status();
    assert!(built.unwrap().success(), "the C++ wrapper does not compile");
    program
}
