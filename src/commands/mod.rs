//! One folder per command: what it computes, its arguments and its text.

pub mod bench;
pub mod calibrate;
pub mod compare;
mod completions;
pub mod discretize;
pub mod evaluate;
pub mod init;
pub mod keys;
pub mod lambda;
pub mod made_with;
mod man;
pub mod map;
pub mod optimize;
pub mod probe;
pub mod replay;
pub mod sweep;
pub mod verify;

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::LazyLock;

use clap::error::ErrorKind;
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::bundle::artefact::SCHEMA_VERSION;
use crate::cli::args::Common;
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::cli::printer::Printer;
use crate::cli::shell::{self, Captured, Program, Watch};
use crate::cli::{explain, help};

/// The crate's version, and the revision of a release build.
const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), env!("FLUXFORM_REVISION"));

/// The version with that of what is written.
static LONG_VERSION: LazyLock<String> =
    LazyLock::new(|| format!("{VERSION}\nwrites artefacts of schema {SCHEMA_VERSION}"));

/// Design the coils of a magnetic haptic display, map their field gradients and solve the force
/// constant of an object.
///
/// A design file describes coils, magnet and drivers; a shape file or a surface describes the
/// object to be felt. `calibrate` joins them into a bundle that a runtime loads: gradient maps, the
/// object's points, the largest force constant lambda that the currents can render, and the
/// currents. Results go to standard output or to files, messages to standard error.
#[derive(Debug, Parser)]
#[command(
    name = "fluxform",
    version = VERSION,
    long_version = LONG_VERSION.as_str(),
    max_term_width = 100,
    override_usage = "fluxform [OPTIONS] <COMMAND>\n       fluxform --explain <CODE>",
    arg_required_else_help = true,
    disable_help_subcommand = true,
    after_long_help = help::main()
)]
struct Arguments {
    /// Options of every command.
    #[command(flatten)]
    common: Common,
    /// Explain an error code, like E301, or the exit code of a failure; `list` names all of them
    #[arg(long, value_name = "CODE", value_parser = explain::target)]
    explain: Option<explain::ExplainTarget>,
    /// The command.
    #[command(subcommand)]
    command: Option<Command>,
}

/// The commands and the way to each.
macro_rules! commands {
    ($($(#[$of:meta])* $name:ident($arguments:ty),)+) => {
        /// The commands; each is described in its own file.
        #[derive(Debug, Subcommand)]
        enum Command {
            $($(#[$of])* $name($arguments),)+
        }

        fn run(command: &Command, printer: &Printer) -> Result<(), Failure> {
            match command {
                $(Command::$name(command) => command.run(printer),)+
            }
        }
    };
}

commands! {
    Init(init::command::Init),
    Keys(keys::command::Keys),
    Evaluate(evaluate::command::Evaluate),
    Probe(probe::command::Probe),
    #[command(visible_alias = "tabulate")]
    Map(map::command::Map),
    Discretize(discretize::command::Discretize),
    Lambda(lambda::command::Lambda),
    Calibrate(calibrate::command::Calibrate),
    Compare(compare::command::Compare),
    Verify(verify::command::Verify),
    Optimize(optimize::command::Optimize),
    Sweep(sweep::command::Sweep),
    Replay(replay::command::Replay),
    Bench(bench::command::Bench),
    Completions(completions::Completions),
    Man(man::Man),
}

/// Runs the command line and returns how the process ends.
pub fn main(args: impl Iterator<Item = OsString>) -> Exit {
    shell::main::<Arguments>(args)
}

/// Runs the command line inside another program: nothing is printed, the result is returned. `given` are
/// documents in memory, read in place of the files of their names; `watch` shows how far the job is.
pub fn captured(
    args: &[OsString],
    given: Vec<(PathBuf, String)>,
    watch: Watch,
) -> (Captured, Result<(), Failure>) {
    shell::captured::<Arguments>(args, given, watch)
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
            (Some(target), _) => explain::run(target, printer),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Arguments::command().debug_assert();
    }
}
