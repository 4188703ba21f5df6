//! `sweep run`: computes a plan's points, or a part of them.

use std::ops::Range;

use clap::Args;
use serde::Serialize;

use super::run::{RunReport, cost, run};
use crate::cli::budget::{CostOrigin, allow};
use crate::cli::documents;
use crate::cli::failure::{Failure, Wish};
use crate::cli::help::{Codes, page};
use crate::cli::layout::Sheet;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::count;
use crate::cli::start::{begin, folder};
use crate::cli::values::FileArgument;
use crate::scene::shard::Shard;

/// Compute the points of a plan, or a part of them
///
/// Computes what `evaluate` reports of the coil alone for every design of the plan, each into a
/// small file points/000/000123.json of the folder. Points that are there are kept, so a run that
/// was killed or interrupted goes on where it stopped; several runs may share a folder, on one
/// machine or many. A design that cannot be computed becomes a row that says why; the exit code is
/// then 4 when all points are done, unless --allow-failed is given. A file of another plan is never
/// touched without --force.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Writing, &[
    ("fluxform sweep run wires.json --out wires", "all points, on all cores"),
    ("fluxform sweep run wires.json --out wires --shard 1/3 --threads 1",
     "the first of three parts"),
    ("fluxform sweep run wires.json --out more --index 7", "one point, into a folder of its own"),
]))]
pub struct Run {
    /// Plan (JSON), `-` for standard input
    #[arg(value_name = "PLAN")]
    plan: FileArgument,
    /// Folder of the points
    #[arg(long, value_name = "DIR")]
    out: FileArgument,
    /// Only part I of N, counted from 1
    #[arg(long, value_name = "I/N", value_parser = Shard::parse)]
    shard: Option<Shard>,
    /// Only the point with this index, counted from 0
    #[arg(long, value_name = "K", conflicts_with = "shard")]
    index: Option<u64>,
    /// End with 0 even if designs cannot be computed or miss the accuracy: their rows say so
    #[arg(long)]
    allow_failed: bool,
    /// Compute points that are there again, and replace files of another plan
    #[arg(long)]
    force: bool,
}

/// The point `index` of `points`, from 0.
///
/// # Errors
/// An index beyond the last point.
fn one_point(index: u64, points: u64) -> Result<Range<u64>, String> {
    if index < points {
        return Ok(index..index + 1);
    }
    Err(format!(
        "--index {index} is beyond the plan's last point, {}: they are counted from 0",
        points - 1
    ))
}

#[derive(Serialize)]
struct RunSummary<'a> {
    design: &'a str,
    plan_sha256: &'a str,
    folder: String,
    first_index: u64,
    points: u64,
    computed: u64,
    kept: u64,
    failed: u64,
    accuracy_not_reached: u64,
}

impl Run {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let out = folder(&self.out)?;
        let (plan, _) = documents::plan(&self.plan)?;
        let indices = match (self.shard, self.index) {
            (Some(shard), _) => shard.of(plan.points),
            (None, Some(index)) => one_point(index, plan.points).map_err(Failure::Usage)?,
            (None, None) => 0..plan.points,
        };
        allow(cost(&plan, &indices)?, CostOrigin::Document, printer)?;
        let bar = begin(printer);
        let report = run(&plan, &out, indices.clone(), self.force, &bar)?;
        drop(bar);
        let json = RunSummary {
            design: &plan.design,
            plan_sha256: &plan.plan_sha256,
            folder: out.display().to_string(),
            first_index: indices.start,
            points: report.points,
            computed: report.points - report.kept,
            kept: report.kept,
            failed: report.failed,
            accuracy_not_reached: report.inaccurate,
        };
        let json = printer.with_warnings(&json);
        printer.summary(Stream::Output, &json, || self.text(&plan.design, &report))?;
        if self.allow_failed {
            return Ok(());
        }
        unmet(&report)
    }

    fn text(&self, design: &str, report: &RunReport) -> String {
        let points = count(report.points as usize, "point");
        let mut sheet = Sheet::new(&format!("{design}: {points} of a sweep"));
        let computed = report.points - report.kept;
        let mut line = format!("{computed} now, {} before", report.kept);
        if report.failed > 0 {
            line += &format!("; {} cannot be computed", report.failed);
        }
        sheet.line("computed", &line);
        sheet.line("written to", &self.out.as_given().display().to_string());
        sheet.finish()
    }
}

/// The points are there, but not all meet the request.
fn unmet(report: &RunReport) -> Result<(), Failure> {
    let mut parts = Vec::new();
    if let Some((index, message)) = &report.first_failure {
        parts.push(format!(
            "{} of {} cannot be computed, and their rows say why; the first is point {index}: \
             {message}",
            report.failed,
            count(report.points as usize, "design")
        ));
    }
    if report.inaccurate > 0 {
        parts.push(format!(
            "{} of {} miss the requested accuracy",
            report.inaccurate,
            count(report.points as usize, "design")
        ));
    }
    if parts.is_empty() {
        Ok(())
    } else {
        let wish = if report.failed > 0 {
            Wish::Sweep
        } else {
            Wish::Accuracy
        };
        Err(Failure::Unmet(wish, parts.join("; ")))
    }
}

#[cfg(test)]
mod tests {
    use super::one_point;

    #[test]
    fn one_point_of_a_plan_is_counted_from_zero() {
        assert_eq!(one_point(6, 7), Ok(6..7));
        assert!(one_point(7, 7).unwrap_err().contains("last point, 6"));
    }
}
