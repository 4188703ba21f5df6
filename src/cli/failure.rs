//! Why a command did not end well: its exit code, its message, and every fault found.

use std::io;

use serde::Serialize;

use super::exit::Exit;
use crate::bundle::json::JsonError;
use crate::bundle::read_table::TableError;
use crate::design::{Faults, InvalidDocument};
use crate::job::JobError;
use crate::shape::ShapeError;

/// Why a command did not end well.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Arguments that do not go together.
    #[error("{0}")]
    Usage(String),
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
    Job(#[from] JobError),
    /// The result is there, but not as wished.
    #[error("{0}")]
    Unmet(String),
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

impl Failure {
    /// The exit code's meaning.
    #[must_use]
    pub fn exit(&self) -> Exit {
        match self {
            Self::PipeClosed => Exit::Done,
            Self::Usage(_) => Exit::Usage,
            Self::Documents(_) | Self::Table(_) | Self::Input(_) => Exit::Input,
            Self::Unmet(_) | Self::Output(_) => Exit::Unmet,
            Self::Verification(_) => Exit::Verification,
            Self::Job(error) => match error.exit_code() {
                130 => Exit::Interrupted,
                5 => Exit::Verification,
                4 => Exit::Unmet,
                _ => Exit::Input,
            },
        }
    }

    /// The message, one line a fault.
    #[must_use]
    pub fn message(&self) -> String {
        match self {
            Self::Job(JobError::Interrupted(_) | JobError::Shape(ShapeError::Interrupted(_))) => {
                "interrupted; what was finished is kept, nothing is half written".to_owned()
            }
            _ => self.to_string(),
        }
    }

    /// Every fault, for programs; empty where the message says it all.
    #[must_use]
    pub fn faults(&self) -> Vec<FaultEntry> {
        match self {
            Self::Documents(documents) => documents
                .iter()
                .flat_map(|document| FaultEntry::of(&document.faults))
                .collect(),
            Self::Table(table) => table
                .faults
                .iter()
                .map(|fault| FaultEntry::message(fault))
                .collect(),
            _ => Vec::new(),
        }
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
        Self::Unmet(format!("the result cannot be told as JSON: {error}"))
    }
}

/// One fault as `--format json` tells it.
#[derive(Debug, Clone, Serialize)]
pub struct FaultEntry {
    /// `error` or `warning`.
    severity: String,
    /// The file as given.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    /// Line, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    line: Option<usize>,
    /// Column in characters, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    column: Option<usize>,
    /// Dotted key.
    #[serde(skip_serializing_if = "Option::is_none")]
    key: Option<String>,
    /// What was expected and found.
    message: String,
    /// What to do.
    #[serde(skip_serializing_if = "Option::is_none")]
    help: Option<String>,
}

impl FaultEntry {
    fn message(message: &str) -> Self {
        Self {
            severity: "error".to_owned(),
            file: None,
            line: None,
            column: None,
            key: None,
            message: message.to_owned(),
            help: None,
        }
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
                message: fault.message.clone(),
                help: fault.help.clone(),
            }
        };
        faults.list().iter().map(entry).collect()
    }
}
