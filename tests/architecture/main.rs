//! The house: which room may import which, which file may write, print or be unsafe, and
//! whether the pages that describe the house still fit it.

mod source;

mod dependencies;
mod functions;
mod harness;
mod imports;
mod outside;
mod pages;
mod powers;
