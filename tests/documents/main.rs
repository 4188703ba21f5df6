//! The documents: what they show is what the program prints, and their links lead somewhere.
#![allow(clippy::disallowed_methods)]

mod links;
mod pages;
mod shown;
mod tutorial;

use std::process::ExitCode;

fn main() -> ExitCode {
    let all = [links::trials(), shown::trials(), tutorial::trials()];
    fluxform_testing::needs::run(all.into_iter().flatten())
}
