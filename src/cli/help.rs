//! The end of every help page, exit codes and examples, and what several pages say.

/// Help of `--evaluations`.
pub const EVALUATIONS: &str = "With --for: most arrays that the search for a design computes; what limits and trade-offs \
                               around the best are worth takes more";

/// The exit codes that a command can end with in addition to 0 and 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Codes {
    /// Prints only.
    None,
    /// Reads documents, prints.
    Reading,
    /// Reads documents, writes files.
    Writing,
    /// Reads a bundle, writes files.
    Replaying,
    /// Verifies.
    Verifying,
    /// Writes files that need no input.
    Pages,
    /// Writes documents with values that are given.
    Documents,
    /// Measures, writes files, reads nothing.
    Measuring,
}

const BAD_INPUT: &str = "3    a bad input file; faults are reported with their places";
const UNMET_OR_UNWRITTEN: &str =
    "4    a result that does not meet the request; or an output that exists or cannot be written";
const UNWRITTEN: &str = "4    an output exists or cannot be written";
const INTERRUPTED: &str = "130  interrupted";
const KEPT: &str = "130  interrupted; what was finished is kept";

impl Codes {
    fn lines(self) -> &'static [&'static str] {
        match self {
            Self::None => &[],
            Self::Reading => &[
                BAD_INPUT,
                "4    a result that does not meet the request (see above); or an output that cannot be written",
                INTERRUPTED,
            ],
            Self::Writing => &[BAD_INPUT, UNMET_OR_UNWRITTEN, KEPT],
            Self::Replaying => &[
                BAD_INPUT,
                UNMET_OR_UNWRITTEN,
                "5    the bundle is damaged or was changed",
                KEPT,
            ],
            Self::Verifying => &["3    not a bundle", "5    a check failed", INTERRUPTED],
            Self::Pages => &[UNWRITTEN],
            Self::Documents => &["3    a value that a design refuses", UNWRITTEN],
            Self::Measuring => &[
                "4    an output exists or cannot be written; or a measurement failed",
                "5    a case of the catalogue failed",
                INTERRUPTED,
            ],
        }
    }
}

/// Exit codes and examples: what is typed, and what for.
#[must_use]
pub fn page(codes: Codes, examples: &[(&str, &str)]) -> String {
    let mut text = "Exit codes:".to_owned();
    for line in ["0    done", "2    wrong usage"]
        .iter()
        .chain(codes.lines())
    {
        text.push_str(&format!("\n  {line}"));
    }
    text.push_str("\n\nExamples:");
    for (command, purpose) in examples {
        text.push_str(&format!("\n  # {purpose}\n  {command}"));
    }
    text
}

/// The end of the main page.
#[must_use]
pub fn main() -> String {
    "Exit codes:
  0    done; also when the reader of a pipe goes away
  2    wrong usage; also a raw surface without --unit
  3    a bad input file; faults are reported with their places
  4    a result that does not meet the request; or an output that exists or cannot be written
  5    a verification failed
  130  interrupted; what was finished is kept

Examples:
  # the main job: maps, points, force constants and currents of two objects
  fluxform calibrate designs/seed.toml shapes/flat.toml shapes/wedge.toml
  # what one coil is worth
  fluxform evaluate designs/seed.toml
  # more about a command
  fluxform lambda --help"
        .to_owned()
}
