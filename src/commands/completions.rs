//! `completions`: what a shell needs to complete the arguments.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::Arguments;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::printer::Printer;

/// Print the completions for a shell
///
/// Prints a script that lets a shell complete commands, options and their values. Where it goes
/// depends on the shell; the examples show the usual places.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::None, &[
    ("fluxform completions bash > fluxform.bash  # then: source fluxform.bash", "bash"),
    ("fluxform completions zsh > _fluxform  # in a folder of $fpath", "zsh"),
    ("fluxform completions fish > fluxform.fish  # in ~/.config/fish/completions", "fish"),
]))]
pub struct Completions {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

impl Completions {
    /// Runs the command.
    ///
    /// # Errors
    /// Standard output that takes no more.
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let mut script = Vec::new();
        clap_complete::generate(
            self.shell,
            &mut Arguments::command(),
            "fluxform",
            &mut script,
        );
        printer.data(|out| out.write_all(&script))
    }
}
