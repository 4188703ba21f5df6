//! Why a command did not end well: its exit code, its message, and every fault found.

use std::io;

use serde::Serialize;

use super::code::Code;
use super::exit::Exit;
use crate::RunError;
use crate::bundle::atomic::WriteError;
use crate::bundle::json::JsonError;
use crate::bundle::load::{BundleError, bundles_below};
use crate::bundle::read_table::TableError;
use crate::design::message_text::shown_path;
use crate::design::{Faults, InvalidDocument};

/// Why a command did not end well.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Arguments that do not go together.
    #[error("{0}")]
    Usage(String),
    /// A raw surface without its unit.
    #[error("{0}")]
    SurfaceUnit(String),
    /// Documents that were refused; at least one.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Documents(Vec<InvalidDocument>),
    /// A table that cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Any other input that cannot be read.
    #[error("{0}")]
    Input(String),
    /// The job gave no result.
    #[error(transparent)]
    Job(#[from] RunError),
    /// The result is there, but does not meet the request: why, and what is reported.
    #[error("{1}")]
    Unmet(Wish, String),
    /// A verification failed.
    #[error("{0}")]
    Verification(String),
    /// Standard output does not take more.
    #[error("cannot write to standard output: {0}")]
    Output(io::Error),
    /// The reader of standard output went away: not worth a word.
    #[error("the pipe was closed")]
    PipeClosed,
}

/// A request that a result does not meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// Within the limits.
    Limits,
    /// One with a force constant.
    ForceConstant,
    /// An object where the array can render it.
    Placement,
    /// The requested accuracy.
    Accuracy,
    /// A coil.
    Coil,
    /// A row for every point of a sweep.
    Sweep,
    /// One that JSON can hold.
    Json,
}

impl Failure {
    /// The kind of failure; `None` where there is nothing to report.
    #[must_use]
    pub fn code(&self) -> Option<Code> {
        Some(match self {
            Self::PipeClosed => return None,
            Self::Usage(_) => Code::Arguments,
            Self::SurfaceUnit(_) => Code::SurfaceUnit,
            Self::Documents(_) => Code::Document,
            Self::Table(_) => Code::Table,
            Self::Input(_) => Code::Unreadable,
            Self::Unmet(wish, _) => match wish {
                Wish::Limits => Code::Limits,
                Wish::ForceConstant => Code::NoForceConstant,
                Wish::Placement => Code::Placement,
                Wish::Accuracy => Code::Accuracy,
                Wish::Coil => Code::NoCoil,
                Wish::Sweep => Code::Sweep,
                Wish::Json => Code::Output,
            },
            Self::Verification(_) => Code::Check,
            Self::Output(_) => Code::Output,
            Self::Job(error) => code_of(error),
        })
    }

    /// The exit code's meaning.
    #[must_use]
    pub fn exit(&self) -> Exit {
        let exit = self.code().map(Code::exit);
        exit.map_or(Exit::Done, |exit| exit.unwrap_or(Exit::Unmet))
    }

    /// The message, one line a fault.
    #[must_use]
    pub fn message(&self) -> String {
        match self {
            Self::Job(RunError::Interrupted(_)) => {
                "interrupted; what was finished is kept, nothing is half written".to_owned()
            }
            Self::Job(RunError::Bundle(BundleError::NoBundle { path })) => {
                let below = bundles_below(path);
                let named: Vec<String> = below
                    .iter()
                    .take(BUNDLES_NAMED)
                    .map(|p| shown_path(p))
                    .collect();
                match named.as_slice() {
                    [] if !path.exists() => format!("{}: no such folder", shown_path(path)),
                    [] => self.to_string(),
                    _ => format!("{self}; the bundles below it: {}", named.join(", ")),
                }
            }
            _ => self.to_string(),
        }
    }

    /// Every fault, for programs; empty where it is not one of an input.
    #[must_use]
    pub fn faults(&self) -> Vec<FaultEntry> {
        match self {
            Self::Documents(documents) => documents
                .iter()
                .flat_map(|document| FaultEntry::of(&document.faults))
                .collect(),
            Self::Table(table) => table.faults.iter().map(|f| FaultEntry::line(f)).collect(),
            _ if self.exit() == Exit::Input => vec![FaultEntry::line(&self.message())],
            _ => Vec::new(),
        }
    }
}

/// A failure as `--format json` states it.
#[derive(Debug, Serialize)]
pub struct ErrorObject {
    error: ErrorFacts,
}

#[derive(Debug, Serialize)]
struct ErrorFacts {
    /// Stable name of the kind of failure.
    code: &'static str,
    /// The process's exit code.
    exit_code: u8,
    /// The code's meaning.
    meaning: &'static str,
    /// The message, one line per fault.
    message: String,
    faults: Vec<FaultEntry>,
    warnings: Vec<String>,
    /// The summary that would have gone to standard error.
    #[serde(skip_serializing_if = "Option::is_none")]
    summary: Option<serde_json::Value>,
}

impl ErrorObject {
    fn new(code: Code, message: String) -> Self {
        let error = ErrorFacts {
            code: code.name(),
            exit_code: code.exit_code(),
            meaning: code.meaning(),
            message,
            faults: Vec::new(),
            warnings: Vec::new(),
            summary: None,
        };
        Self { error }
    }

    /// A failure of the kind `code`, the warnings before it, and the JSON of a summary that is due.
    #[must_use]
    pub fn of(
        failure: &Failure,
        code: Code,
        warnings: Vec<String>,
        summary: Option<Vec<u8>>,
    ) -> Self {
        let mut object = Self::new(code, failure.message());
        object.error.faults = failure.faults();
        object.error.warnings = warnings;
        object.error.summary = summary.and_then(|text| serde_json::from_slice(&text).ok());
        object
    }

    /// An internal error.
    #[must_use]
    pub fn internal(message: &str) -> Self {
        Self::new(Code::Internal, message.to_owned())
    }

    /// The object, on one line.
    #[must_use]
    pub fn line(&self) -> String {
        // Plain texts and whole numbers can always be written.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// Bundles that are named where a folder above them was given.
const BUNDLES_NAMED: usize = 8;

fn code_of(error: &RunError) -> Code {
    match error {
        RunError::NotModelled(_)
        | RunError::Input(_)
        | RunError::OnEdge(_)
        | RunError::Problem(_) => Code::Contradiction,
        RunError::Scan(_) => Code::Scan,
        RunError::Shape { .. } => Code::Surface,
        RunError::Write(WriteError::OutputExists { .. }) => Code::OutputExists,
        RunError::Write(_) => Code::Output,
        RunError::Sweep(_) => Code::Sweep,
        RunError::Bundle(BundleError::NoBundle { .. } | BundleError::Schema { .. }) => {
            Code::NotABundle
        }
        RunError::Bundle(_) => Code::Damaged,
        RunError::NoForceConstant(_) => Code::NoForceConstant,
        RunError::Misplaced(_) => Code::Placement,
        RunError::Unmet(_) => Code::Measurement,
        RunError::Interrupted(_) => Code::Interrupted,
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::BrokenPipe {
            Self::PipeClosed
        } else {
            Self::Output(error)
        }
    }
}

impl From<JsonError> for Failure {
    fn from(error: JsonError) -> Self {
        Self::Unmet(
            Wish::Json,
            format!("the result cannot be written as JSON: {error}"),
        )
    }
}

/// One fault as `--format json` states it; what is not known is absent.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct FaultEntry {
    /// `error` or `warning`.
    severity: String,
    /// The file as given.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    /// Line, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    line: Option<usize>,
    /// Place in the line in characters, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    column: Option<usize>,
    /// Dotted key of a document, or name of a table's column.
    #[serde(skip_serializing_if = "Option::is_none")]
    key: Option<String>,
    /// The expected value, where the message states it.
    #[serde(skip_serializing_if = "Option::is_none")]
    expected: Option<String>,
    /// The message: expected and actual value.
    message: String,
    /// Advice.
    #[serde(skip_serializing_if = "Option::is_none")]
    advice: Option<String>,
}

impl FaultEntry {
    /// Parts of a line `file:line: column name: message` or `file: message`. A message that names
    /// no file is taken whole.
    fn line(text: &str) -> Self {
        let mut entry = Self {
            severity: "error".to_owned(),
            ..Self::default()
        };
        let mut rest = text;
        if let Some((head, tail)) = rest.split_once(": ") {
            let numbered = head.rsplit_once(':').and_then(|(file, line)| {
                let line = line.parse().ok()?;
                Some((file, line))
            });
            if let Some((file, line)) = numbered {
                (entry.file, entry.line) = (Some(file.to_owned()), Some(line));
                rest = tail;
            } else if head.contains(['.', '/']) && !head.contains(' ') {
                entry.file = Some(head.to_owned());
                rest = tail;
            }
        }
        if let Some(after) = rest.strip_prefix("column ")
            && let Some(end) = after.find([':', ' '])
        {
            entry.key = Some(after[..end].to_owned());
        }
        if let Some((_, advice)) = rest.split_once("; ") {
            entry.advice = Some(advice.to_owned());
        }
        entry.expected = expected(rest);
        entry.message = rest.to_owned();
        entry
    }

    fn of(faults: &Faults) -> Vec<Self> {
        let file = faults.path().display().to_string();
        let entry = |fault: &crate::design::Fault| {
            let place = faults.place(fault);
            Self {
                severity: fault.severity.to_string(),
                file: Some(file.clone()),
                line: place.map(|place| place.line),
                column: place.map(|place| place.column),
                key: (!fault.key.is_empty()).then(|| fault.key.clone()),
                expected: expected(&fault.message),
                message: fault.message.clone(),
                advice: fault.help.clone(),
            }
        };
        faults.list().iter().map(entry).collect()
    }
}

/// The expected value that a message states.
fn expected(message: &str) -> Option<String> {
    let (_, after) = message.split_once("expected ")?;
    let end = after.find([';', '\n']).unwrap_or(after.len());
    let end = after.find(", found").map_or(end, |found| found.min(end));
    Some(after[..end].to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Interrupted;

    #[test]
    fn a_line_is_taken_apart() {
        let entry = FaultEntry::line(
            "a b.csv:3: column z_m: expected a finite number, found \"far\"; write 0.7",
        );
        assert_eq!(entry.file.as_deref(), Some("a b.csv"));
        assert_eq!((entry.line, entry.key.as_deref()), (Some(3), Some("z_m")));
        assert_eq!(entry.expected.as_deref(), Some("a finite number"));
        assert_eq!(entry.advice.as_deref(), Some("write 0.7"));
        let entry = FaultEntry::line("designs: expected a surface, found a directory");
        assert_eq!(entry.file, None);
        assert_eq!(entry.expected.as_deref(), Some("a surface"));
        let entry = FaultEntry::line("none.csv: cannot be read: No such file");
        assert_eq!(entry.file.as_deref(), Some("none.csv"));
        assert_eq!(entry.message, "cannot be read: No such file");
    }

    #[test]
    fn a_job_ends_with_the_exit_code_that_its_error_names() {
        for error in [
            RunError::Input(String::new()),
            RunError::Scan(String::new()),
            RunError::Sweep(String::new()),
            RunError::Unmet(String::new()),
            RunError::NoForceConstant(String::new()),
            RunError::Interrupted(Interrupted),
        ] {
            let code = error.exit_code();
            assert_eq!(Failure::Job(error).exit().code(), code);
        }
        let measured = Failure::Job(RunError::Unmet(String::new()));
        assert_eq!(measured.code(), Some(Code::Measurement));
    }
}
