//! The stability catalogue: named cases at the limits of what may be asked, each with what must
//! come out.
//!
//! Expectations come from a closed form, a limit that physics knows, a symmetry, another
//! route or a committed oracle; the bound comes from that expectation (its own error, the stated
//! accuracy of the stage, rounding) and is written down before the result is known. Where the
//! right answer is a refusal, the message is what is expected.

mod arrays;
mod check;
mod edges;
mod geometry;
mod lambda;
mod limits;
mod materials;
mod meshes;
mod penalties;
mod positions;
mod shapes;
mod stiffness;
mod units;
mod wires;

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::catalogue::CaseRow;
use fluxform::commands::bench::clock::Watch;
use fluxform::progress::{Progress, pass_interruption};

/// Seconds a case may take unless it says otherwise; unoptimised builds on busy machines included.
const SECONDS: f64 = 60.0;

/// Measurement of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct Got {
    /// The result in words, with units.
    pub value: String,
    /// Its distance from what is expected, in the measure that the case's bound is stated in;
    /// infinite for a wrong kind of answer.
    pub error: f64,
}

/// One case of the catalogue.
#[derive(Debug, Clone)]
pub struct Case {
    /// Family and case, unique.
    pub name: &'static str,
    /// Expected result, in words.
    pub expected: String,
    /// The largest error that the expectation allows.
    pub bound: f64,
    /// The longest it may take, s.
    pub seconds: f64,
    /// Whether it belongs to the subset that runs with every change.
    pub in_ci: bool,
    /// Computes the result.
    ///
    /// # Errors
    /// Why there is none, which fails the case.
    pub run: fn() -> Result<Got, String>,
}

impl Case {
    fn not_in_ci(self) -> Self {
        Self {
            in_ci: false,
            ..self
        }
    }

    fn within(self, seconds: f64) -> Self {
        Self { seconds, ..self }
    }
}

/// A case of the fast subset.
fn case(
    name: &'static str,
    expected: impl Into<String>,
    bound: f64,
    run: fn() -> Result<Got, String>,
) -> Case {
    Case {
        name,
        expected: expected.into(),
        bound,
        seconds: SECONDS,
        in_ci: true,
        run,
    }
}

/// Every case, family by family.
#[must_use]
pub fn cases() -> Vec<Case> {
    [
        geometry::cases(),
        edges::cases(),
        materials::cases(),
        arrays::cases(),
        wires::cases(),
        limits::cases(),
        stiffness::cases(),
        penalties::cases(),
        shapes::cases(),
        meshes::cases(),
        lambda::cases(),
        positions::cases(),
        units::cases(),
    ]
    .concat()
}

/// Runs `cases` one after the other; a panic fails its case alone. Stops early, with the rows
/// there are, when the user asks to.
#[must_use]
pub fn run(cases: &[Case], progress: &dyn Progress) -> Vec<CaseRow> {
    progress.begin("extreme cases", cases.len() as u64);
    let mut rows = Vec::with_capacity(cases.len());
    for case in cases {
        if progress.interrupted() {
            break;
        }
        rows.push(row(case));
        progress.advance(1);
    }
    progress.end();
    rows
}

fn row(case: &Case) -> CaseRow {
    let watch = Watch::start();
    let outcome = catch_unwind(AssertUnwindSafe(case.run));
    let seconds = watch.elapsed_s();
    let got = match outcome {
        Ok(Ok(got)) => got,
        Ok(Err(message)) => Got {
            value: message,
            error: f64::INFINITY,
        },
        Err(panic) => {
            pass_interruption(&*panic);
            Got {
                value: format!("panic: {}", words(&*panic)),
                error: f64::INFINITY,
            }
        }
    };
    CaseRow {
        name: case.name.to_owned(),
        expected: case.expected.clone(),
        // False for a not-a-number.
        pass: got.error <= case.bound && seconds <= case.seconds,
        // One line a row: some messages have several.
        got: got.value.replace('\n', "; "),
        error: got.error,
        bound: case.bound,
        seconds,
    }
}

fn words(panic: &(dyn std::any::Any + Send)) -> &str {
    panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("without words")
}
