//! The house: which room may import which, which file may write, print or be unsafe, and
//! whether the pages that describe the house still fit it.

#[path = "architecture/source.rs"]
mod source;

#[path = "architecture/dependencies.rs"]
mod dependencies;
#[path = "architecture/imports.rs"]
mod imports;
#[path = "architecture/outside.rs"]
mod outside;
#[path = "architecture/pages.rs"]
mod pages;
#[path = "architecture/powers.rs"]
mod powers;
