//! The program under test, and how a run of it ended.

use std::path::PathBuf;
use std::process::Output;

use serde_json::Value;

/// The binary that Cargo built for the test which is running.
#[must_use]
pub fn program() -> PathBuf {
    std::env::var_os("CARGO_BIN_EXE_fluxform")
        .expect("a test of the root package, run by cargo")
        .into()
}

/// Another build that `FLUXFORM_OTHER` names, else [`program`].
#[must_use]
pub fn program_or_other() -> PathBuf {
    std::env::var_os("FLUXFORM_OTHER").map_or_else(program, PathBuf::from)
}

/// How a run ended.
#[derive(Debug, Clone)]
pub struct Ran {
    /// `None` where a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl Ran {
    /// # Panics
    /// If standard output is not UTF-8; standard error is cut where a run is killed.
    #[must_use]
    pub fn of(output: Output) -> Self {
        Self {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }

    #[track_caller]
    pub fn ends(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{self:#?}");
        self
    }

    /// One of these codes, or what happened instead.
    pub fn ended_with(&self, codes: &[i32]) -> Result<(), String> {
        if self.code.is_some_and(|code| codes.contains(&code)) {
            return Ok(());
        }
        Err(format!(
            "ended with {:?}, not {codes:?}: {}",
            self.code, self.err
        ))
    }

    /// Standard error contains every one of `words`.
    #[track_caller]
    pub fn says(self, words: &[&str]) -> Self {
        for word in words {
            assert!(self.err.contains(word), "{word:?} is missing: {}", self.err);
        }
        self
    }

    /// Standard output, one JSON object and nothing else.
    #[track_caller]
    pub fn json(&self) -> Value {
        object(&self.out)
    }

    /// Standard error, one JSON object and nothing else.
    #[track_caller]
    pub fn error(&self) -> Value {
        object(&self.err)
    }
}

#[track_caller]
fn object(text: &str) -> Value {
    let value: Value = serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"));
    assert!(value.is_object(), "{text}");
    value
}
