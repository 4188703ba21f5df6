//! `sweep merge`: a plan's points as one table and one plot.

use std::path::Path;

use clap::Args;
use serde::Serialize;

use super::merge::{
    MergeFiles, MergeReport, MergeRequest, SweepBest, check_drawable, merge, merge_table,
};
use crate::RunError;
use crate::bundle::atomic::check_distinct;
use crate::bundle::sweep::MergeSummary;
use crate::cli::args::Writing;
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::Sheet;
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{bytes, count, force, mass, number, si};
use crate::cli::start::{begin, folder};
use crate::cli::values::{self, FileArgument};

/// Join the points of a plan into one table, and plot the best designs
///
/// Writes one row per point, in the order of the plan, to a CSV table; beside it NAME.svg, force
/// against resistance, mass and settling time with the designs that no other one beats,
/// NAME_pareto.csv with those designs, and NAME_merge.json. The best are chosen among the designs that
/// meet their limits, if any does. Those of a plan with --for are ranked and drawn by the geometric mean of their
/// shapes' force constants (column mean_lambda_n_per_m) instead of the force; the column gain is over each row's
/// own given array, which the set keys may change. Missing points are named and end with exit code 4 and no table,
/// unless --partial asks for what there is: then the exit code is 0 and the missing are reported as a
/// warning; a table with fewer missing is replaced with --force alone. A point that is in several folders is taken
/// from the first of them. Folders and points of another plan are refused.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Writing, &[
    ("fluxform sweep merge wires.json wires --out wires.csv", "all points of one folder"),
    ("fluxform sweep merge wires.json wires more --partial --out - > so_far.csv",
     "what there is so far, from two folders"),
    ("fluxform sweep merge wires.json wires --out wires.csv --plot wires.png", "with a picture of the force over its keys"),
]))]
pub struct Merge {
    /// Plan (JSON), `-` for standard input
    #[arg(value_name = "PLAN")]
    plan: FileArgument,
    /// Folders that `sweep run` wrote to
    #[arg(value_name = "DIR", required = true)]
    folders: Vec<FileArgument>,
    /// Where the table goes; `-` is standard output, and then there is no plot
    #[arg(long, value_name = "FILE", default_value = "sweep.csv")]
    out: FileArgument,
    /// Merge what there is, even if points are missing
    #[arg(long)]
    partial: bool,
    /// Write a page with the result here (HTML)
    #[arg(long, value_name = "FILE")]
    report: Option<FileArgument>,
    /// Draw the force over the plan's one key, or over its two (.svg, .png or .pdf)
    ///
    /// As a curve, or as a map of colours: hatched are designs that break a limit, white those that are
    /// missing or cannot be computed; a star is the strongest within its limits. Of a plan with --for the
    /// mean force constant is drawn instead.
    #[arg(long, value_name = "FILE", value_parser = values::picture)]
    plot: Option<FileArgument>,
    #[command(flatten)]
    writing: Writing,
}

/// The summary as JSON, with where the table went.
#[derive(Serialize)]
struct MergeJson<'a> {
    #[serde(flatten)]
    summary: &'a MergeSummary,
    table: String,
    /// The best design, of those that meet their limits where there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    best: Option<&'a SweepBest>,
}

impl Merge {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let request = MergeRequest {
            folders: self.folders.iter().map(folder).collect::<Result<_, _>>()?,
            partial: self.partial,
            page: self.report.is_some(),
            landscape: self.plot.is_some(),
        };
        self.one_stream()?;
        let (plan, input) = documents::plan(&self.plan)?;
        if self.plot.is_some() {
            check_drawable(&plan)?;
        }
        let points = request.folders.iter();
        let points =
            points.flat_map(|folder| ["points", "plan.json"].map(|name| folder.join(name)));
        let (mut protected, mut outputs) = (points.collect::<Vec<_>>(), Vec::new());
        if let FileArgument::Path(path) = &self.out {
            outputs.extend(self.files(path).paths());
            protected.extend(outputs.iter().cloned());
        }
        let drawn = [&self.report, &self.plot].map(Option::as_ref);
        let files = drawn.iter().flatten().filter(|file| !file.is_standard());
        outputs.extend(files.map(|file| file.as_given().to_path_buf()));
        check_distinct(&outputs).map_err(RunError::from)?;
        let [page, plot] = drawn.map(|file| {
            file.map(|file| Picture::new(file, self.writing.force, protected.iter().cloned()))
        });
        for picture in [&page, &plot].into_iter().flatten() {
            picture.check(std::slice::from_ref(&input))?;
        }
        let (report, mut place) = match &self.out {
            FileArgument::Standard => {
                let bar = begin(printer);
                let (table, report) = merge_table(&plan, input, &request, &bar)?;
                drop(bar);
                printer.data(|out| out.write_all(&table))?;
                (report, Stream::Error)
            }
            FileArgument::Path(path) => {
                let ending = path.extension().unwrap_or_default();
                if ending == "json" || ending == "svg" {
                    return Err(Failure::Usage(format!(
                        "--out {}: expected the name of the table, like sweep.csv; plot and \
                         summary get names of their own beside it",
                        path.display()
                    )));
                }
                let files = self.files(path);
                let bar = begin(printer);
                let report = merge(&plan, input, &request, &files, &bar)?;
                drop(bar);
                (report, Stream::Output)
            }
        };
        if report.summary.missing > 0 {
            printer.warning(&format!(
                "{} of {} points are missing: {}",
                report.summary.missing, report.summary.points, report.missing
            ));
        }
        if let (Some(page), Some(html)) = (&page, &report.page) {
            place = place.or(page.write(&report.summary.inputs, html, printer)?);
        }
        if let (Some(plot), Some(landscape)) = (&plot, &report.landscape) {
            place = place.or(plot.draw(&report.summary.inputs, &landscape.drawing(), printer)?);
        }
        let json = MergeJson {
            summary: &report.summary,
            table: self.out.as_given().display().to_string(),
            best: report.best.as_ref(),
        };
        let json = printer.with_warnings(&json);
        printer.summary(place, &json, || self.text(&report))
    }

    /// Standard output takes one result.
    fn one_stream(&self) -> Result<(), Failure> {
        let streams = [Some(&self.out), self.report.as_ref(), self.plot.as_ref()];
        let streams = streams.into_iter().flatten();
        if streams.filter(|file| file.is_standard()).count() > 1 {
            return Err(Failure::Usage(
                "of --out, --report and --plot only one can go to standard output; give the others a file"
                    .to_owned(),
            ));
        }
        Ok(())
    }

    fn files(&self, table: &Path) -> MergeFiles {
        MergeFiles {
            table: table.to_path_buf(),
            force: self.writing.force,
        }
    }

    fn text(&self, report: &MergeReport) -> String {
        let summary = &report.summary;
        let rows = count(summary.rows as usize, "design");
        let mut sheet = Sheet::new(&format!("{}: a sweep of {rows}", summary.design));
        if let Some(best) = &report.best {
            sheet.line("best", &best_design(best));
        }
        let mut line = format!("{} meet their limits", summary.limits_met);
        if summary.failed > 0 {
            line += &format!(", {} cannot be computed", summary.failed);
        }
        if summary.inaccurate > 0 {
            line += &format!(", {} miss the requested accuracy", summary.inaccurate);
        }
        sheet.line("designs", &line);
        if let Some(largest_n) = summary.largest_force_n {
            let among = if summary.front_meets_limits {
                "those that meet their limits"
            } else {
                "all, because none meets its limits"
            };
            sheet.line(
                "fronts",
                &format!(
                    "{} on the fronts among {among}; largest force {} of all",
                    summary.front,
                    force(largest_n)
                ),
            );
        }
        if let FileArgument::Path(path) = &self.out {
            let files: Vec<String> = summary
                .files
                .iter()
                .map(|file| format!("{} ({})", file.path, bytes(file.bytes)))
                .collect();
            let folder = path
                .parent()
                .filter(|folder| !folder.as_os_str().is_empty());
            let folder = folder.map_or(".".to_owned(), |folder| folder.display().to_string());
            sheet.line("written to", &format!("{folder}: {}", files.join(", ")));
        }
        sheet.finish()
    }
}

/// The best design and what it costs.
fn best_design(best: &SweepBest) -> String {
    let [resistance_ohm, mass_kg, settling_s] = best.costs;
    let values: Vec<String> = best
        .values
        .iter()
        .map(|(key, value)| format!("{key} = {value}"))
        .collect();
    let (achieved, first) = match best.array {
        Some(array) => (
            format!(
                "mean force constant {}, {} times its own given array's",
                si(array.mean_lambda_n_per_m, "N/m"),
                number(array.gain)
            ),
            "the best for the shapes",
        ),
        None => (force(best.force_n), "the strongest"),
    };
    let among = if best.limits_met {
        " within its limits"
    } else {
        "; none meets its limits"
    };
    format!(
        "design {}: {}\n{}, {}, {}, settled after {}: {first}{among}",
        best.index,
        values.join(", "),
        achieved,
        si(resistance_ohm, "ohm"),
        mass(mass_kg),
        si(settling_s, "s")
    )
}
