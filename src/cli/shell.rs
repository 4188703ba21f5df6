//! Command-line parts that programs of this workspace share: common options, messages, exit
//! codes, the progress bar, interruption.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::error::ErrorKind;
use clap::{ArgMatches, ColorChoice, CommandFactory, FromArgMatches};

pub use super::args::{Colour, Common, Format, Writing};
pub use super::bar::{Bar, Watch};
pub use super::exit::Exit;
pub use super::failure::Failure;
pub use super::help::{Codes, page};
pub use super::layout::{Sheet, table};
pub use super::printer::{Captured, Printer, Stream};
pub use super::quantity::{bytes, count, error, number_to, si};
pub use super::start::{begin, folder};
pub use super::values::FileArgument;
use super::{budget, documents, interrupt};
use crate::RunError;
use crate::progress::interruptible;
use crate::shape::step::{self, Kernel, STEP_SECONDS};

/// Arguments that were understood, and what is done with them.
pub trait Program: CommandFactory + FromArgMatches {
    /// From what clap read.
    ///
    /// # Errors
    /// Arguments that do not go together.
    fn parse(matches: &ArgMatches) -> Result<Self, clap::Error> {
        Self::from_arg_matches(matches)
    }

    /// The options of every command.
    fn common(&self) -> &Common;

    /// Runs it.
    ///
    /// # Errors
    /// See [`Failure`].
    fn run(&self, printer: &Printer) -> Result<(), Failure>;
}

/// Runs a program and returns how the process ends.
pub fn main<P: Program>(args: impl Iterator<Item = OsString>) -> Exit {
    let args = help_as_option(args.collect());
    let early = common_before_parsing(&args);
    std::panic::set_hook(Box::new(move |panic| {
        Printer::new(&early).mistake(&panic_message(panic));
    }));
    let parsed = numbers_below_zero(P::command())
        .color(colour_of(&args))
        .try_get_matches_from(&args)
        .and_then(|matches| P::parse(&matches));
    let program = match parsed {
        Ok(program) => program,
        Err(error) => return not_parsed(&error, &args),
    };
    let printer = Printer::new(program.common());
    interrupt::listen(program.common());
    let ran = interruptible(|| prepare(program.common()).and_then(|()| program.run(&printer)))
        .unwrap_or_else(|stop| Err(RunError::from(stop).into()));
    interrupt::end();
    match ran {
        Ok(()) => {
            printer.finish();
            Exit::Done
        }
        Err(failure) => {
            printer.failure(&failure);
            failure.exit()
        }
    }
}

/// A command whose options take a number below zero as their value, which says what is wrong with it; else it is an unknown
/// flag.
fn numbers_below_zero(command: clap::Command) -> clap::Command {
    let option = |arg: clap::Arg| match arg.is_positional() || !arg.get_action().takes_values() {
        true => arg,
        false => arg.allow_negative_numbers(true),
    };
    command.mut_args(option).mut_subcommands(numbers_below_zero)
}

/// Runs a program inside another one, which has the signals, the screen and the threads: nothing is
/// printed. `given` are documents that are in memory, read in place of the files of their names.
pub fn captured<P: Program + Send>(
    args: &[OsString],
    given: Vec<(PathBuf, String)>,
    watch: Watch,
) -> (Captured, Result<(), Failure>) {
    let parsed = numbers_below_zero(P::command())
        .try_get_matches_from(args)
        .and_then(|matches| P::parse(&matches));
    let program = match parsed {
        Ok(program) => program,
        Err(error) if error.use_stderr() => {
            let message = error.render().to_string();
            let message = message.trim().trim_start_matches("error: ").to_owned();
            return (Captured::default(), Err(Failure::Usage(message)));
        }
        Err(help) => {
            let captured = Captured {
                text: help.render().to_string(),
                ..Captured::default()
            };
            return (captured, Ok(()));
        }
    };
    let common = program.common().clone();
    configure(&common);
    let threads = common.threads.map(pool).transpose();
    let run = move || {
        documents::give(given);
        let printer = Printer::capturing(&common, watch);
        let ran = interruptible(|| program.run(&printer))
            .unwrap_or_else(|stop| Err(RunError::from(stop).into()));
        documents::give(Vec::new());
        (printer.captured(), ran)
    };
    match threads {
        Ok(None) => run(),
        Ok(Some(pool)) => pool.install(run),
        Err(failure) => (Captured::default(), Err(failure)),
    }
}

/// As many threads as requested.
fn pool(threads: usize) -> Result<rayon::ThreadPool, Failure> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| Failure::Usage(format!("--threads {threads}: {error}")))
}

/// `help COMMAND` as `COMMAND --help`.
fn help_as_option(mut args: Vec<OsString>) -> Vec<OsString> {
    if args.get(1).is_some_and(|first| first == "help") {
        args.remove(1);
        args.push("--help".into());
    }
    args
}

/// Threads and memory, as requested.
fn prepare(common: &Common) -> Result<(), Failure> {
    if let Some(threads) = common.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()
            .map_err(|error| Failure::Usage(format!("--threads {threads}: {error}")))?;
    }
    configure(common);
    Ok(())
}

/// Memory and the process that reads STEP.
fn configure(common: &Common) {
    budget::grant(common.memory);
    step::configure(Kernel {
        python: common.python.clone(),
        cpu_seconds: common.step_seconds,
        ..Kernel::default()
    });
}

/// Common options, as far as they are known before the arguments are parsed.
fn common_before_parsing(args: &[OsString]) -> Common {
    Common {
        format: match value_of(args, "--format") {
            Some("json") => Format::Json,
            _ => Format::Human,
        },
        strict_inputs: false,
        quiet: false,
        threads: None,
        memory: None,
        python: None,
        step_seconds: STEP_SECONDS,
        color: match value_of(args, "--color") {
            Some("always") => Colour::Always,
            Some("never") => Colour::Never,
            _ => Colour::Auto,
        },
    }
}

/// Clap's own output: help, the version, or wrong usage.
fn not_parsed(error: &clap::Error, args: &[OsString]) -> Exit {
    // Help is requested, or shown where nothing was.
    let help = matches!(
        error.kind(),
        ErrorKind::DisplayHelp
            | ErrorKind::DisplayVersion
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
    );
    let printer = Printer::new(&common_before_parsing(args));
    if !help || (error.use_stderr() && printer.json()) {
        printer.usage(error);
    } else {
        let failure = error.print().err().map(Failure::from);
        // A closed pipe: nobody is left to read the help.
        if let Some(failure) = failure.filter(|failure| failure.code().is_some()) {
            printer.failure(&failure);
            return failure.exit();
        }
    }
    if error.use_stderr() {
        Exit::Usage
    } else {
        Exit::Done
    }
}

/// The colours of help and usage errors, which are printed before the arguments are known.
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
        "fluxform {} stopped on an internal error{place}: {what}\n\
         Please report this line with the command and its input files.",
        env!("CARGO_PKG_VERSION")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

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
