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
mod pictures;
mod printer;
mod quantity;
mod values;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{ColorChoice, CommandFactory, FromArgMatches};

use args::{Arguments, Colour, Command, Common, Format};
use exit::Exit;
use failure::Failure;
use printer::Printer;

use crate::job::JobError;
use crate::progress::interruptible;

/// Runs the command line and returns the process's exit code.
pub fn main(args: impl Iterator<Item = OsString>) -> ExitCode {
    let args: Vec<OsString> = args.collect();
    let early = told_early(&args);
    std::panic::set_hook(Box::new(move |panic| {
        if !caught() {
            Printer::new(&early).mistake(&panic_message(panic));
        }
    }));
    let parsed = Arguments::command()
        .color(colour_of(&args))
        .try_get_matches_from(&args)
        .and_then(|matches| Arguments::from_arg_matches(&matches));
    let arguments = match parsed {
        Ok(arguments) => arguments,
        Err(error) => return not_parsed(&error, &args).into(),
    };
    let printer = Printer::new(&arguments.common);
    let ran = match (&arguments.explain, &arguments.command) {
        (Some(asked), _) => explain::run(asked, &printer),
        (None, Some(command)) => {
            interrupt::listen(&arguments.common);
            interruptible(|| run(command, &arguments.common, &printer))
                .unwrap_or_else(|stop| Err(JobError::from(stop).into()))
        }
        (None, None) => return not_parsed(&without_command(), &args).into(),
    };
    interrupt::end();
    match ran {
        Ok(()) => {
            printer.finish();
            Exit::Done.into()
        }
        Err(failure) => {
            printer.failure(&failure);
            failure.exit().into()
        }
    }
}

/// The command line as clap knows it.
#[must_use]
pub fn command() -> clap::Command {
    Arguments::command()
}

/// What can be known of the common options before the arguments are parsed.
fn told_early(args: &[OsString]) -> Common {
    Common {
        format: match value_of(args, "--format") {
            Some("json") => Format::Json,
            _ => Format::Human,
        },
        quiet: false,
        threads: None,
        memory: None,
        color: match value_of(args, "--color") {
            Some("always") => Colour::Always,
            Some("never") => Colour::Never,
            _ => Colour::Auto,
        },
    }
}

/// Options alone do nothing.
fn without_command() -> clap::Error {
    let message = "'fluxform' requires a subcommand but one was not provided";
    command().error(ErrorKind::MissingSubcommand, message)
}

/// Whether a panic is caught where it happens and told as what it means.
fn caught() -> bool {
    #[cfg(feature = "step")]
    return crate::shape::step::guards_panics();
    #[cfg(not(feature = "step"))]
    false
}

fn run(command: &Command, common: &Common, printer: &Printer) -> Result<(), Failure> {
    if let Some(threads) = common.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()
            .map_err(|error| Failure::Usage(format!("--threads {threads}: {error}")))?;
    }
    budget::grant(common.memory);
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

/// What clap has to say: help, the version, or wrong usage.
fn not_parsed(error: &clap::Error, args: &[OsString]) -> Exit {
    // Help is asked for, or shown where nothing was.
    let help = matches!(
        error.kind(),
        ErrorKind::DisplayHelp
            | ErrorKind::DisplayVersion
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
    );
    let printer = Printer::new(&told_early(args));
    if !help || (error.use_stderr() && printer.json()) {
        printer.usage(error);
    } else {
        // A closed pipe: nobody is left to read the help.
        let _ = error.print();
    }
    if error.use_stderr() {
        Exit::Usage
    } else {
        Exit::Done
    }
}

/// The colours of help and usage errors, which are told before the arguments are known.
fn colour_of(args: &[OsString]) -> ColorChoice {
    match value_of(args, "--color") {
        Some("always") => ColorChoice::Always,
        Some("never") => ColorChoice::Never,
        _ => ColorChoice::Auto,
    }
}

/// The last value of a long option among raw arguments.
fn value_of<'a>(args: &'a [OsString], option: &str) -> Option<&'a str> {
    let mut value = None;
    for (i, arg) in args.iter().enumerate() {
        let Some(arg) = arg.to_str() else { continue };
        if arg == option {
            value = args.get(i + 1).and_then(|next| next.to_str());
        } else if let Some(rest) = arg.strip_prefix(option)
            && let Some(rest) = rest.strip_prefix('=')
        {
            value = Some(rest);
        }
    }
    value
}

fn panic_message(panic: &std::panic::PanicHookInfo) -> String {
    let what = panic.payload_as_str().unwrap_or("no message");
    let place = panic
        .location()
        .map_or_else(String::new, |place| format!(" at {place}"));
    format!(
        "fluxform {} stopped on a mistake of its own{place}: {what}\n\
         Please report this line with the command and its input files.",
        env!("CARGO_PKG_VERSION")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn an_option_is_found_in_either_spelling() {
        let args: Vec<OsString> = ["fluxform", "--format=human", "--format", "json"]
            .map(OsString::from)
            .to_vec();
        assert_eq!(value_of(&args, "--format"), Some("json"));
        assert_eq!(value_of(&args[..2], "--format"), Some("human"));
        assert_eq!(value_of(&args, "--color"), None);
    }
}
