//! The stable codes of everything that can go wrong, one row each.
//!
//! The first digit is that of the exit code (E130 is exit code 130). Codes are never given another
//! meaning; a new kind of failure gets a new one. What `--explain` prints about each stands in
//! `explanations.txt`.

use super::exit::Exit;

/// A kind of failure. Scripts may rely on [`Code::name`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code {
    /// An internal error.
    Internal,
    /// Arguments that are not understood or do not go together.
    Arguments,
    /// A raw surface without its unit.
    SurfaceUnit,
    /// A design or shape document with faults.
    Document,
    /// A table with faults.
    Table,
    /// An input that cannot be read, or is not what was expected.
    Unreadable,
    /// Inputs that contradict each other or ask for what cannot be computed.
    Contradiction,
    /// A surface that gives no points.
    Surface,
    /// Not a bundle, or one of another layout.
    NotABundle,
    /// A scan that does not determine what is to be fitted, or is in other units.
    Scan,
    /// Limits that are not met: `evaluate --strict`, `optimize`.
    Limits,
    /// The chosen lambda is null.
    NoForceConstant,
    /// A requested accuracy that was not reached.
    Accuracy,
    /// No coil meets the limits.
    NoCoil,
    /// An output exists that is not ours.
    OutputExists,
    /// An output that cannot be written.
    Output,
    /// Points of a sweep that failed, are missing or belong to another one.
    Sweep,
    /// A measurement that could not be made.
    Measurement,
    /// An object that the array cannot render where it is.
    Placement,
    /// A check of `verify` or a case of `fluxform-bench --extreme` failed.
    Check,
    /// A bundle that was changed or damaged.
    Damaged,
    /// The user stopped it.
    Interrupted,
}

impl Code {
    /// Every code, in the order of their names.
    pub const ALL: [Self; 22] = [
        Self::Internal,
        Self::Arguments,
        Self::SurfaceUnit,
        Self::Document,
        Self::Table,
        Self::Unreadable,
        Self::Contradiction,
        Self::Surface,
        Self::NotABundle,
        Self::Scan,
        Self::Limits,
        Self::NoForceConstant,
        Self::Accuracy,
        Self::NoCoil,
        Self::OutputExists,
        Self::Output,
        Self::Sweep,
        Self::Measurement,
        Self::Placement,
        Self::Check,
        Self::Damaged,
        Self::Interrupted,
    ];

    /// Name, exit code (`None`: the panic's 101) and meaning in a line.
    const fn row(self) -> (&'static str, Option<Exit>, &'static str) {
        use Exit::{Input, Interrupted, Unmet, Usage, Verification};
        match self {
            Self::Internal => ("E101", None, "an internal error"),
            Self::Arguments => (
                "E201",
                Some(Usage),
                "arguments that are not understood or do not go together",
            ),
            Self::SurfaceUnit => ("E202", Some(Usage), "a raw surface without --unit"),
            Self::Document => ("E301", Some(Input), "faults in a design or shape file"),
            Self::Table => ("E302", Some(Input), "faults in a CSV table"),
            Self::Unreadable => (
                "E303",
                Some(Input),
                "an input that cannot be read or is not what was expected",
            ),
            Self::Contradiction => (
                "E304",
                Some(Input),
                "inputs that contradict each other or ask for what cannot be computed",
            ),
            Self::Surface => ("E305", Some(Input), "a surface that gives no points"),
            Self::NotABundle => (
                "E306",
                Some(Input),
                "not a bundle, or one that this program does not read",
            ),
            Self::Scan => (
                "E307",
                Some(Input),
                "a scan that does not determine the fit, or is in other units",
            ),
            Self::Limits => ("E401", Some(Unmet), "limits that are not met"),
            Self::NoForceConstant => ("E402", Some(Unmet), "the chosen lambda is null"),
            Self::Accuracy => (
                "E403",
                Some(Unmet),
                "a requested accuracy that was not reached",
            ),
            Self::NoCoil => ("E404", Some(Unmet), "no coil meets the limits"),
            Self::OutputExists => ("E405", Some(Unmet), "an output exists that is not ours"),
            Self::Output => ("E406", Some(Unmet), "an output that cannot be written"),
            Self::Sweep => (
                "E407",
                Some(Unmet),
                "points of a sweep that failed, are missing or belong to another one",
            ),
            Self::Measurement => ("E408", Some(Unmet), "a measurement that could not be made"),
            Self::Placement => (
                "E409",
                Some(Unmet),
                "an object that the array cannot render where it is",
            ),
            Self::Check => ("E501", Some(Verification), "a check failed"),
            Self::Damaged => (
                "E502",
                Some(Verification),
                "a bundle that was changed or damaged",
            ),
            Self::Interrupted => ("E130", Some(Interrupted), "interrupted"),
        }
    }

    /// The stable name, like `E301`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.row().0
    }

    /// How the program ends; `None` for an internal error, which ends as panics do.
    #[must_use]
    pub const fn exit(self) -> Option<Exit> {
        self.row().1
    }

    /// The process's exit code.
    #[must_use]
    pub fn exit_code(self) -> u8 {
        self.exit().map_or(101, Exit::code)
    }

    /// Its meaning, in a line.
    #[must_use]
    pub const fn meaning(self) -> &'static str {
        self.row().2
    }

    /// The text of `--explain`.
    #[must_use]
    pub fn explanation(self) -> &'static str {
        let all = include_str!("explanations.txt");
        let head = format!("## {}\n", self.name());
        let body = all
            .split_once(&head)
            .map_or("", |(_, after)| after.split("\n## ").next().unwrap_or(""));
        body.trim()
    }
}

#[cfg(test)]
mod tests {
    use super::Code;

    #[test]
    fn names_are_unique_and_determine_the_exit_code() {
        for (i, code) in Code::ALL.into_iter().enumerate() {
            assert!(Code::ALL[..i].iter().all(|c| c.name() != code.name()));
            let digits = &code.name()[1..];
            let exit = code.exit_code().to_string();
            let width = if exit.len() == 3 { 3 } else { 1 };
            assert_eq!(digits[..width], exit, "{}", code.name());
        }
    }

    #[test]
    fn every_code_is_explained_and_nothing_else() {
        for code in Code::ALL {
            let text = code.explanation();
            for part in ["Causes:", "What to do:", "Example:"] {
                assert!(text.contains(part), "{}: {part}\n{text}", code.name());
            }
        }
        let heads = include_str!("explanations.txt").matches("## E").count();
        assert_eq!(heads, Code::ALL.len());
    }
}
