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
    /// Verifies.
    Verifying,
    /// Writes files that need no input.
    Pages,
    /// Measures, writes files, reads nothing.
    Measuring,
}

impl Codes {
    fn lines(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Reading => {
                "\n  3    a bad input file: every fault is reported with its place\n  \
                 4    a result that does not meet the request (see above); or an output that cannot be written\n  \
                 130  interrupted"
            }
            Self::Writing => {
                "\n  3    a bad input file: every fault is reported with its place\n  \
                 4    a result that does not meet the request; or an output that exists or cannot be written\n  \
                 130  interrupted; what was finished is kept"
            }
            Self::Verifying => "\n  3    not a bundle\n  5    a check failed\n  130  interrupted",
            Self::Pages => "\n  4    an output exists or cannot be written",
            Self::Measuring => {
                "\n  4    an output exists or cannot be written; or a measurement failed\n  \
                 5    a case of the catalogue failed\n  \
                 130  interrupted"
            }
        }
    }
}

/// Exit codes and examples: what is typed, and what for.
#[must_use]
pub fn page(codes: Codes, examples: &[(&str, &str)]) -> String {
    let mut text = format!(
        "Exit codes:\n  0    done\n  2    wrong usage{}\n\nExamples:",
        codes.lines()
    );
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
  3    a bad input file: every fault is reported with its place
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
