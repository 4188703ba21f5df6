//! `extreme.json` and `extreme.csv`: what became of the cases at the limits.

use std::io::{self, Write};

use schemars::JsonSchema;
use serde::{Serialize, Serializer};

use fluxform::bundle::artefact::{FileEntry, Input, Options};
use fluxform::bundle::number::{push_cell, push_text};

/// `extreme.json`. Seconds in it differ from run to run.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CatalogueFile {
    /// Layout, `major.minor.patch`.
    pub schema_version: String,
    /// Program that was asked.
    pub fluxform_version: String,
    /// None: the cases are part of the program.
    pub inputs: Vec<Input>,
    /// The options of the run.
    #[serde(default, skip_serializing_if = "Options::is_empty")]
    pub made_with: Options,
    /// The sentence on units.
    pub units: String,
    /// One entry a case.
    pub cases: Vec<CaseRow>,
    /// Table and page beside it, as written.
    pub files: Vec<FileEntry>,
}

/// Outcome of a case.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CaseRow {
    /// The case's name.
    pub name: String,
    /// Expected result.
    pub expected: String,
    /// The outcome.
    pub got: String,
    /// How far off it is, in the unit that `expected` names; null where there is not a number.
    #[serde(serialize_with = "finite_or_null")]
    #[schemars(with = "Option<f64>")]
    pub error: f64,
    /// How far off it may be.
    pub bound: f64,
    /// Wall-clock time, s.
    pub seconds: f64,
    /// Whether error and time kept their bounds.
    pub pass: bool,
}

fn finite_or_null<S: Serializer>(error: &f64, to: S) -> Result<S::Ok, S::Error> {
    error.is_finite().then_some(*error).serialize(to)
}

/// Writes `extreme.csv`.
///
/// # Errors
/// Those of `out`.
pub fn write_cases(out: &mut dyn Write, cases: &[CaseRow]) -> io::Result<()> {
    writeln!(out, "case,verdict,error,bound,seconds,expected,got")?;
    for case in cases {
        let mut line = Vec::new();
        push_text(&mut line, &case.name);
        push_text(&mut line, if case.pass { "pass" } else { "fail" });
        for value in [case.error, case.bound, case.seconds] {
            push_cell(&mut line, value);
        }
        push_text(&mut line, &case.expected);
        push_text(&mut line, &case.got);
        // The last cell has no comma behind it.
        line.pop();
        line.push(b'\n');
        out.write_all(&line)?;
    }
    Ok(())
}
