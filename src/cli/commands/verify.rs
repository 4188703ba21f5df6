//! `verify`: a bundle's checksums, and its numbers by an independent route.

use clap::Args;

use super::begin;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::{Sheet, Side, table};
use crate::cli::printer::{Place, Printer};
use crate::cli::quantity::{count, error};
use crate::job::verify::{Check, VerifyReport, run};

/// Check a bundle: checksums, layout, and its numbers recomputed
///
/// Checks that a bundle is whole and as it was written, and computes its numbers again by an
/// independent route: map nodes and forces by integrals over the windings' section and the steel
/// solved anew to a finer tolerance, the force constants solved for again, the currents'
/// optimality by a bound that does not trust the solver.
/// Any check that fails ends with exit code 5.
#[derive(Debug, Args)]
#[command(after_help = page(Codes::Verifying, &[
    ("fluxform calibrate designs/seed.toml shapes/flat.toml", "make a bundle"),
    ("fluxform verify results/seed/flat", "verify it"),
    ("fluxform verify results/seed/flat --format json", "for a program"),
]))]
pub struct Verify {
    /// Folder of a bundle, with its manifest.json
    #[arg(value_name = "BUNDLE")]
    bundle: std::path::PathBuf,
}

impl Verify {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let bar = begin(printer);
        let report = run(&self.bundle, &bar)?;
        drop(bar);
        for note in &report.notes {
            printer.warning(note);
        }
        let json = printer.with_warnings(&report);
        printer.summary(Place::Output, &json, || self.summary(&report))?;
        let failed: Vec<&str> = report
            .checks
            .iter()
            .filter(|check| !check.passed)
            .map(|check| check.name)
            .collect();
        if report.passed {
            return Ok(());
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
        let verdict = if report.passed { "passed" } else { "FAILED" };
        let mut sheet = Sheet::new(&format!(
            "{}: {} on {}, {} {verdict}",
            self.bundle.display(),
            report.shape,
            report.design,
            count(report.checks.len(), "check")
        ));
        sheet.gap();
        sheet.raw(&checks_table(&report.checks));
        sheet.finish()
    }
}

fn checks_table(checks: &[Check]) -> String {
    let head = ["check", "measured", "allowed", "", "how"].map(str::to_owned);
    let told = |value: f64| {
        if value == 0.0 {
            "0".to_owned()
        } else {
            error(value)
        }
    };
    let row = |check: &Check| {
        vec![
            check.name.to_owned(),
            told(check.measured),
            told(check.allowed),
            if check.passed { "ok" } else { "FAILED" }.to_owned(),
            check.how.clone(),
        ]
    };
    let rows: Vec<Vec<String>> = std::iter::once(head.to_vec())
        .chain(checks.iter().map(row))
        .collect();
    let sides = [Side::Left, Side::Right, Side::Right, Side::Left, Side::Left];
    table(&sides, &rows)
}
