//! Common parts of tests and benches of several targets. Nothing of it is published.
// A test's own files, folders and messages.
#![allow(missing_docs, clippy::disallowed_methods, clippy::print_stderr)]

pub mod boxes;
#[cfg(feature = "bundle")]
pub mod bundle;
#[cfg(feature = "lambda")]
pub mod force_problems;
pub mod inputs;
#[cfg(feature = "lambda")]
pub mod least_error;
pub mod loaders;
pub mod needs;
pub mod place;
pub mod run;
#[cfg(feature = "shape")]
pub mod surface_files;
#[cfg(feature = "shape")]
pub mod surfaces;
pub mod tree;

// For their features alone (`Cargo.toml`).
use {matrixmultiply as _, once_cell as _};

pub use fluxform_numerics::random::Random;

use std::path::{Path, PathBuf};

/// The repository.
#[must_use]
pub fn root() -> PathBuf {
    let member = Path::new(env!("CARGO_MANIFEST_DIR"));
    member.ancestors().nth(2).expect("tests/support").to_owned()
}

/// The text of a file of the repository.
#[must_use]
pub fn committed(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The random numbers of a full study: `FLUXFORM_SEED` draws other cases than the committed seed.
#[must_use]
pub fn random_of_study(committed: u64) -> Random {
    let seed = std::env::var("FLUXFORM_SEED");
    Random::new(seed.map_or(committed, |seed| seed.parse().expect("a seed")))
}
