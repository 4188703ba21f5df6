//! Arguments and summary of `verify`.

use clap::Args;

use super::{Check, Verifier, VerifyOptions, VerifyReport};
use crate::cli::budget::announce;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::{Sheet, table};
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{count, error};
use crate::cli::start::begin;
use crate::scene::cost::Cost;

/// Check a bundle: checksums, layout, and its numbers recomputed
///
/// Everything in a bundle follows from its inputs, so nothing in it is believed. Checksums and
/// layout are checked first; then the inputs that the manifest names are looked up (relative to
/// the working directory) and the whole bundle is computed from them in memory and compared byte
/// for byte; last its numbers are compared with those of an independent route: map nodes and
/// forces by integrals over the windings' section and the steel solved again to a finer tolerance,
/// the force constants solved for again, the currents' optimality by a bound that does not trust
/// the solver.
/// Where the shape's files are not here, or the bundle was made by another version or on another
/// platform, the report states what could not be checked.
/// Any check that fails or is not possible ends with exit code 5.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Verifying, &[
    ("fluxform calibrate designs/seed.toml shapes/flat.toml", "make a bundle"),
    ("fluxform verify results/seed/flat", "verify it"),
    ("fluxform verify results/seed/flat --format json", "for a program"),
]))]
pub struct Verify {
    /// Folder of a bundle, with its manifest.json
    #[arg(value_name = "BUNDLE")]
    bundle: std::path::PathBuf,
    /// Exit 0 although something could not be checked, when all checks that are possible pass
    #[arg(long)]
    accept_unchecked: bool,
}

impl Verify {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let bar = begin(printer);
        let options = VerifyOptions {
            accept_unchecked: self.accept_unchecked,
        };
        let limit = |costs: &[Cost]| announce(costs, printer);
        let report = Verifier::limited(&limit).verify(&self.bundle, options, &bar)?;
        drop(bar);
        for note in &report.notes {
            printer.warning(note);
        }
        for part in &report.unchecked {
            printer.warning(&format!("not checked: {part}"));
        }
        let json = printer.with_warnings(&report);
        printer.summary(Stream::Output, &json, || self.summary(&report))?;
        let failed = report.checks.iter().filter(|check| !check.passed);
        let failed: Vec<String> = failed
            .map(|check| format!("{} ({})", check.name, check.how))
            .collect();
        if report.passed {
            return Ok(());
        }
        if failed.is_empty() {
            let parts = report.unchecked.len();
            return Err(Failure::Verification(format!(
                "{}: {} passed, {} not checked ({}{}); accept that with --accept-unchecked",
                self.bundle.display(),
                count(report.checks.len(), "check"),
                count(parts, "part"),
                report.unchecked.first().map_or("", String::as_str),
                if parts > 1 { "; ..." } else { "" },
            )));
        }
        Err(Failure::Verification(format!(
            "{}: {} of {} failed: {}",
            self.bundle.display(),
            failed.len(),
            count(report.checks.len(), "check"),
            failed.join(", ")
        )))
    }

    fn summary(&self, report: &VerifyReport) -> String {
        let failed = report.checks.iter().filter(|check| !check.passed).count();
        let all = count(report.checks.len(), "check");
        let verdict = match (failed, report.unchecked.is_empty()) {
            (0, true) => format!("{all} passed"),
            (0, false) => format!("{all} passed, parts NOT CHECKED"),
            (failed, _) => format!("{failed} of {all} FAILED"),
        };
        let mut sheet = Sheet::new(&format!(
            "{}: {} on {}, {verdict}",
            self.bundle.display(),
            report.shape,
            report.design,
        ));
        sheet.gap();
        sheet.raw(&checks_table(&report.checks));
        sheet.finish()
    }
}

fn checks_table(checks: &[Check]) -> String {
    let head = ["check", "measured", "allowed", "", "how"].map(str::to_owned);
    let shown = |value: f64| {
        if value == 0.0 {
            "0".to_owned()
        } else {
            error(value)
        }
    };
    let row = |check: &Check| {
        vec![
            check.name.to_owned(),
            shown(check.measured),
            shown(check.allowed),
            if check.passed { "ok" } else { "FAILED" }.to_owned(),
            check.how.clone(),
        ]
    };
    let rows: Vec<Vec<String>> = std::iter::once(head.to_vec())
        .chain(checks.iter().map(row))
        .collect();
    let sides = "lrrll";
    table(sides, &rows)
}
