//! The documents: what they show is what the program prints, and their links lead somewhere.
#![allow(clippy::disallowed_methods, clippy::print_stderr)]

mod links;
mod pages;
mod shown;
mod tutorial;
