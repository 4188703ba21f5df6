//! The binary as its users meet it: exit codes, streams, files, messages.
#![cfg(unix)] // signals, /dev/full, links

mod assumed;
mod budget;
mod cache;
mod codes;
mod core_field;
mod error_target;
mod files;
mod first_contact;
mod heat;
mod help;
mod interrupt;
mod iron;
mod journal;
mod lambda;
mod messages;
mod mistakes;
mod optimize;
mod optimize_array;
mod optimize_choices;
mod optimize_limits;
mod optimize_page;
mod placement;
mod scan;
mod scan_fit;
mod scan_input;
mod screen;
mod shards;
mod steel;
mod streams;
mod surfaces;
mod sweep;
mod uncertainty;
mod vector;
mod verify;
mod weights;

/// The array of the reference design without steel.
const SEED: &str = "designs/seed_air.toml";
