//! The binary: calls the command line, returns its exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    fluxform::commands::main(std::env::args_os()).into()
}
