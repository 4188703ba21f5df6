//! The exit codes, each with its meaning.

use std::process::ExitCode;

/// How the program ends. Scripts rely on the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Done.
    Done,
    /// Wrong usage, such as a raw surface without `--unit`.
    Usage,
    /// A bad input file.
    Input,
    /// A result that does not meet the request, or an output that is not ours or cannot be written.
    Unmet,
    /// A verification failed.
    Verification,
    /// The user stopped it; what was finished is kept.
    Interrupted,
}

impl Exit {
    /// The process's exit code.
    #[must_use]
    pub fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Usage => 2,
            Self::Input => 3,
            Self::Unmet => 4,
            Self::Verification => 5,
            Self::Interrupted => 130,
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.code())
    }
}
