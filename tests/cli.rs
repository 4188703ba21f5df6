//! The binary as its users meet it: exit codes, streams, files, messages.
#![cfg(unix)] // signals, /dev/full, links

#[path = "cli/budget.rs"]
mod budget;
#[path = "cli/codes.rs"]
mod codes;
#[path = "cli/files.rs"]
mod files;
#[path = "cli/help.rs"]
mod help;
#[path = "cli/interrupt.rs"]
mod interrupt;
#[path = "cli/kept.rs"]
mod kept;
#[path = "cli/lambda.rs"]
mod lambda;
#[path = "cli/messages.rs"]
mod messages;
#[path = "cli/optimize.rs"]
mod optimize;
#[path = "cli/scan.rs"]
mod scan;
#[path = "cli/steel.rs"]
mod steel;
#[path = "cli/streams.rs"]
mod streams;
#[path = "cli/support.rs"]
mod support;
#[path = "cli/surfaces.rs"]
mod surfaces;
#[path = "cli/sweep.rs"]
mod sweep;
#[path = "cli/verify.rs"]
mod verify;
