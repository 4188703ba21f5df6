//! The one place that talks: results to standard output, messages to standard error.
//!
//! With `--quiet` only errors and the data that was requested (JSON, CSV, `--out -`) are left. With
//! `--format json` warnings go into the JSON object, and a summary that belongs to standard error
//! waits for the end of the command and goes into the error's object if there is an error, so that
//! every stream holds one object at most.

use std::borrow::Cow;
use std::cell::RefCell;
use std::io::{self, BufWriter, IsTerminal, Write};

use serde::Serialize;

use super::args::{Colour, Common, Format};
use super::bar::{Bar, Watch};
use super::code::Code;
use super::failure::{ErrorObject, Failure};
use super::terminal;
use crate::bundle::json::to_json;
use crate::design::Faults;
use crate::design::keys::Assumed;
use crate::design::message_text::{shown_path, visible};

/// Bytes gathered before standard output is written to.
const BUFFER_BYTES: usize = 1 << 16;

/// Decides what is said, where and how.
#[derive(Debug)]
pub struct Printer {
    format: Format,
    quiet: bool,
    colour: bool,
    colour_of_output: bool,
    strict_inputs: bool,
    warnings: RefCell<Vec<String>>,
    /// The defaults of the design that was read; `None` where none was.
    assumed: RefCell<Option<Vec<AssumedEntry>>>,
    /// A summary as JSON that is due on standard error.
    pending: RefCell<Option<Vec<u8>>>,
    /// Inside another program: results in place of output, and who watches the job.
    captured: Option<(RefCell<Captured>, Watch)>,
}

/// The output of a command that runs inside another program.
#[derive(Debug, Default)]
pub struct Captured {
    /// The result as JSON.
    pub json: Vec<u8>,
    /// The summary for people.
    pub text: String,
    /// Data for standard output: a table, help.
    pub data: Vec<u8>,
}

/// Where a summary goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stream {
    /// Standard output.
    Output,
    /// Standard error, because standard output holds the data itself.
    Error,
}

impl Stream {
    /// The one that is left where two outputs may have gone to standard output.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        match self {
            Self::Output => other,
            Self::Error => Self::Error,
        }
    }
}

/// A result and the warnings about it, as one JSON object.
#[derive(Debug, Serialize)]
pub struct WithWarnings<'a, T> {
    #[serde(flatten)]
    result: &'a T,
    /// Keys of the design that decide numbers, were not written, and have these values.
    #[serde(skip_serializing_if = "Option::is_none")]
    assumed: Option<Vec<AssumedEntry>>,
    warnings: Vec<String>,
}

/// A key that has its default, for programs.
#[derive(Debug, Clone, Serialize)]
struct AssumedEntry {
    key: String,
    value: Option<toml::Value>,
}

impl Printer {
    /// A printer that does as the arguments say.
    #[must_use]
    pub fn new(common: &Common) -> Self {
        let colour_on = |terminal: bool| match common.color {
            Colour::Always => true,
            Colour::Never => false,
            Colour::Auto => {
                let no_colour = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
                !no_colour && terminal
            }
        };
        Self {
            format: common.format,
            quiet: common.quiet,
            colour: colour_on(io::stderr().is_terminal()),
            colour_of_output: colour_on(io::stdout().is_terminal()),
            strict_inputs: common.strict_inputs,
            warnings: RefCell::default(),
            assumed: RefCell::default(),
            pending: RefCell::default(),
            captured: None,
        }
    }

    /// A printer that prints nothing: results are returned, as JSON and as text, and `watch` sees how far
    /// the job is.
    #[must_use]
    pub fn capturing(common: &Common, watch: Watch) -> Self {
        let common = Common {
            format: Format::Json,
            quiet: true,
            color: Colour::Never,
            ..common.clone()
        };
        Self {
            captured: Some((RefCell::default(), watch)),
            ..Self::new(&common)
        }
    }

    /// The printed text, where it is captured.
    #[must_use]
    pub fn captured(self) -> Captured {
        self.captured
            .map(|(captured, _)| captured.into_inner())
            .unwrap_or_default()
    }

    /// Shows the job that begins to whoever watches.
    pub fn begins(&self, bar: &Bar) {
        if let Some((_, watch)) = &self.captured {
            watch.follow(bar);
        }
    }

    /// Whether results are printed as JSON.
    #[must_use]
    pub fn json(&self) -> bool {
        self.format == Format::Json
    }

    /// Whether only errors and data are printed.
    #[must_use]
    pub fn quiet(&self) -> bool {
        self.quiet
    }

    /// Whether a progress bar may be drawn.
    #[must_use]
    pub fn draws(&self) -> bool {
        !self.quiet && io::stderr().is_terminal()
    }

    /// Erases the line that a progress bar was drawn on, where nothing else will.
    pub fn erase_line(&self) {
        if self.draws() {
            let _ = io::stderr().lock().write_all(b"\r\x1b[2K");
        }
    }

    /// Prints a warning.
    pub fn warning(&self, message: &str) {
        if self.json() {
            self.warnings.borrow_mut().push(message.to_owned());
        } else if !self.quiet {
            let head = self.head("warning", "33");
            say(&format!("{head} {}\n", visible(message)));
        }
    }

    /// Reports what the program is doing, to people alone.
    pub fn notice(&self, message: &str) {
        if !self.json() && !self.quiet {
            say(&format!("{}\n", visible(message)));
        }
    }

    /// Prints the warnings about a document that was read.
    pub fn document_warnings(&self, faults: &Faults) {
        if faults.is_empty() {
        } else if self.json() {
            let lines = faults.plain();
            let lines = lines.lines().map(str::to_owned);
            self.warnings.borrow_mut().extend(lines);
        } else if !self.quiet {
            say(&faults.render(self.colour, width()));
        }
    }

    /// Whether defaults that decide numbers are refused.
    #[must_use]
    pub fn strict_inputs(&self) -> bool {
        self.strict_inputs
    }

    /// Reports the defaults that a design leaves to the program: on one line, and in the JSON object.
    pub fn assumed(&self, assumed: &[Assumed]) {
        let named: Vec<String> = assumed
            .iter()
            .map(|one| format!("{} = {}", one.key, one.value))
            .collect();
        if !named.is_empty() {
            self.notice(&format!("assumed: {}", named.join(", ")));
        }
        let entry = |one: &Assumed| AssumedEntry {
            key: one.key.clone(),
            value: one.typed(),
        };
        self.assumed
            .replace(Some(assumed.iter().map(entry).collect()));
    }

    /// The warnings that go into the JSON object.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        self.warnings.borrow().clone()
    }

    /// `result` with the warnings so far, for [`Printer::summary`].
    #[must_use]
    pub fn with_warnings<'a, T>(&self, result: &'a T) -> WithWarnings<'a, T> {
        WithWarnings {
            result,
            assumed: self.assumed.borrow().clone(),
            warnings: self.warnings.borrow().clone(),
        }
    }

    /// Prints a summary: `human` for people, `json` for programs.
    ///
    /// # Errors
    /// Standard output that takes no more.
    pub fn summary(
        &self,
        place: Stream,
        json: &impl Serialize,
        human: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        if let Some((captured, _)) = &self.captured {
            let mut captured = captured.borrow_mut();
            captured.json = to_json(json)?;
            captured.text = visible(&human()).into_owned();
            return Ok(());
        }
        let text = match self.format {
            Format::Json => to_json(json)?,
            Format::Human if self.quiet => return Ok(()),
            Format::Human => {
                let text = visible(&human()).into_owned();
                match place {
                    Stream::Output => emphasised(text, self.colour_of_output),
                    Stream::Error => emphasised(text, self.colour),
                }
                .into_bytes()
            }
        };
        match place {
            Stream::Output => self.data(|out| out.write_all(&text)),
            Stream::Error if self.json() => {
                self.pending.replace(Some(text));
                Ok(())
            }
            Stream::Error => {
                say(&String::from_utf8_lossy(&text));
                Ok(())
            }
        }
    }

    /// Prints what waited for the end of the command.
    pub fn finish(&self) {
        if let Some(text) = self.pending.take() {
            say(&String::from_utf8_lossy(&text));
        }
    }

    /// Writes requested data to standard output.
    ///
    /// # Errors
    /// Standard output that takes no more.
    pub fn data(
        &self,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), Failure> {
        if let Some((captured, _)) = &self.captured {
            write(&mut captured.borrow_mut().data)?;
            return Ok(());
        }
        let mut out = BufWriter::with_capacity(BUFFER_BYTES, io::stdout().lock());
        write(&mut out)?;
        out.flush()?;
        Ok(())
    }

    /// Reports why the command did not end well.
    pub fn failure(&self, failure: &Failure) {
        let Some(code) = failure.code() else {
            return;
        };
        if self.json() {
            let summary = self.pending.take();
            say(&ErrorObject::of(failure, code, self.warnings.take(), summary).line());
        } else if let Failure::Documents(documents) = failure {
            for document in documents {
                say(&document.faults.render(self.colour, width()));
            }
            let names: Vec<String> = documents
                .iter()
                .map(|document| shown_path(document.faults.path()))
                .collect();
            self.report(code, &format!("refused: {}", names.join(", ")));
        } else {
            self.report(code, &failure.message());
        }
    }

    /// Reports an internal error.
    pub fn mistake(&self, message: &str) {
        if self.json() {
            say(&ErrorObject::internal(message).line());
        } else {
            self.report(Code::Internal, message);
        }
    }

    /// Reports wrong usage as `error` words it, and its code.
    pub fn usage(&self, error: &clap::Error) {
        if self.json() {
            let usage = error.render().to_string();
            let message = usage.trim().trim_start_matches("error: ").to_owned();
            self.failure(&Failure::Usage(message));
            return;
        }
        let plain = error.render().to_string();
        let shown = match visible(&plain) {
            Cow::Borrowed(_) if self.colour => error.render().ansi().to_string(),
            tame => tame.into_owned(),
        };
        let marked = format!("error[{}]:", Code::Arguments.name());
        say(&shown.replacen("error:", &marked, 1));
    }

    fn report(&self, code: Code, message: &str) {
        let head = self.head(&format!("error[{}]", code.name()), "31");
        say(&format!("{head} {}\n", visible(message)));
    }

    fn head(&self, word: &str, colour: &str) -> String {
        if self.colour {
            format!("\u{1b}[1;{colour}m{word}:\u{1b}[0m")
        } else {
            format!("{word}:")
        }
    }
}

/// Words of summaries that a person must not miss.
const URGENT: [&str; 2] = ["NOT met", "FAILED"];

/// `text` with its urgent words in bold red, where colours are shown.
fn emphasised(text: String, colour: bool) -> String {
    if !colour {
        return text;
    }
    URGENT.iter().fold(text, |text, word| {
        text.replace(word, &format!("\u{1b}[1;31m{word}\u{1b}[0m"))
    })
}

/// Writes to standard error. Where that is closed nobody reads it.
pub fn say(text: &str) {
    let mut text = text.to_owned();
    if !text.ends_with('\n') {
        text.push('\n');
    }
    let _ = io::stderr().lock().write_all(text.as_bytes());
}

/// Whether a person can be asked.
pub fn can_ask() -> bool {
    io::stdin().is_terminal() && io::stderr().is_terminal()
}

/// Whether standard output is a terminal.
pub fn shows_output() -> bool {
    io::stdout().is_terminal()
}

/// Asks at the terminal; an empty answer, or none, is `default`.
///
/// # Errors
/// Standard input that cannot be read.
pub fn ask(question: &str, default: &str) -> Result<String, Failure> {
    let mut stderr = io::stderr().lock();
    let _ = write!(stderr, "{question}[{default}] ").and_then(|()| stderr.flush());
    drop(stderr);
    let mut answer = String::new();
    io::stdin()
        .read_line(&mut answer)
        .map_err(|error| Failure::Input(format!("standard input cannot be read: {error}")))?;
    match answer.trim() {
        "" => Ok(default.to_owned()),
        answer => Ok(answer.to_owned()),
    }
}

/// Columns at which messages are wrapped.
fn width() -> usize {
    terminal::columns().unwrap_or(100)
}
