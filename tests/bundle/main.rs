//! Bundles on disk: three loaders give the same forces, a bundle is whole or absent, and damaged
//! or hostile bundles are refused with words that help.
#![allow(clippy::disallowed_methods, clippy::print_stderr)]

mod archives;
mod forgeries;
mod hostile;
mod loaders;
mod sample;
mod whole;
mod written;
