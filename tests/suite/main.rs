//! The measuring suite: calls its command line, returns its exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    fluxform::cli::shell::main::<fluxform_bench::arguments::Arguments>(std::env::args_os()).into()
}
