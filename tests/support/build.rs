//! Builds nothing: `syn` is here for its features (`Cargo.toml`).

use syn as _;

fn main() {}
