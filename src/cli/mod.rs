//! Arguments, commands, the printer, the progress bar and the exit codes.

mod args;
mod bar;
mod budget;
mod code;
mod commands;
mod documents;
mod exit;
mod explain;
mod failure;
mod help;
mod interrupt;
mod layout;
mod limits;
mod pictures;
mod printer;
mod quantity;
#[doc(hidden)]
pub mod shell;
mod values;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{ArgMatches, CommandFactory, FromArgMatches};

use args::{Arguments, Command, Common};
use failure::Failure;
use printer::Printer;
use shell::Program;

/// Runs the command line and returns the process's exit code.
pub fn main(args: impl Iterator<Item = OsString>) -> ExitCode {
    shell::main::<Arguments>(args)
}

impl Program for Arguments {
    fn parse(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let arguments = Self::from_arg_matches(matches)?;
        if arguments.explain.is_none() && arguments.command.is_none() {
            // Options alone do nothing.
            let message = "'fluxform' requires a subcommand but one was not provided";
            return Err(Self::command().error(ErrorKind::MissingSubcommand, message));
        }
        Ok(arguments)
    }

    fn common(&self) -> &Common {
        &self.common
    }

    fn run(&self, printer: &Printer) -> Result<(), Failure> {
        match (&self.explain, &self.command) {
            (Some(asked), _) => explain::run(asked, printer),
            (None, Some(command)) => run(command, printer),
            (None, None) => Ok(()),
        }
    }
}

/// The command line as clap knows it.
#[must_use]
pub fn command() -> clap::Command {
    Arguments::command()
}

fn run(command: &Command, printer: &Printer) -> Result<(), Failure> {
    match command {
        Command::Evaluate(command) => command.run(printer),
        Command::Probe(command) => command.run(printer),
        Command::Map(command) => command.run(printer),
        Command::Discretize(command) => command.run(printer),
        Command::Lambda(command) => command.run(printer),
        Command::Calibrate(command) => command.run(printer),
        Command::Compare(command) => command.run(printer),
        Command::Verify(command) => command.run(printer),
        Command::Optimize(command) => command.run(printer),
        Command::Sweep(command) => command.run(printer),
        Command::Replay(command) => command.run(printer),
        Command::Bench(command) => command.run(printer),
        Command::Completions(command) => command.run(printer),
        Command::Man(command) => command.run(printer),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Arguments::command().debug_assert();
    }
}
