//! `bench`: error against run time of the user's own scene.

use std::path::PathBuf;

use clap::Args;

use super::page::refined_error;
use super::{BenchRequest, Estimate, MEASURED, run};
use crate::bundle::bench::{BenchFile, Cheapest, ShapeBench};
use crate::cli::args::{SurfaceFlags, Tolerance, Writing};
use crate::cli::budget::{allow, cost_origin, costs};
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::{Sheet, table};
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{count, error, number, number_to, percent, si};
use crate::cli::start::{begin, folder};
use crate::cli::values::{self, FileArgument};
use crate::commands::lambda::command::CriterionFlags;
use crate::design::Need;
use crate::scene::cost::{Components, of_map};
use crate::scene::named_files::NamedContent;
use crate::scene::{Scene, coupled};

/// Error against run time of a design and its objects
///
/// Sweeps what can be set in this scene: the field's tolerance, the grid of points (or, with
/// --max-deviation, points graded to it) and the nodes of the map, in every combination, and holds
/// each against a run that is finer in all of them. Reports the relative error of lambda, the error
/// of the felt force (what the currents give by the interpolated map against what they give in the
/// refined field: the largest all over the surface, its rim too, as estimated) and the processor time;
/// names the cheapest settings within 10, 1 and 0.1 %, to paste. Writes bench.json, bench.csv, two
/// pictures per object and report.html. How long it takes is said once the present settings have run: with --quick
/// within a minute of processor time, else within ten, where settings can be spared for it.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Writing, &[
    ("fluxform bench designs/seed_air.toml shapes/flat.toml --quick",
     "in a few seconds; files go to results/bench-scene/seed_air/"),
    ("fluxform bench designs/seed_air.toml shapes/flat.toml --quick --out f --format json",
     "for a program"),
    ("fluxform bench designs/seed_air.toml shapes/wedge.toml --quick --tolerance 1e-4 --out w",
     "around another tolerance than the default"),
]))]
pub struct Bench {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// Shape files (TOML) or surfaces (STL, OBJ, PLY, 3MF, STEP, ...)
    #[arg(value_name = "SHAPE", required = true)]
    shapes: Vec<FileArgument>,
    /// Shorter ladders, a coarser reference and fewer repeats
    #[arg(long)]
    quick: bool,
    /// Sweep points graded to a deviation, from this one to coarser ones, instead of the grid's
    #[arg(long, value_name = "LENGTH", value_parser = values::length_with_unit)]
    max_deviation: Option<f64>,
    /// Folder of the results [default: results/bench-scene/<design>]
    #[arg(long, value_name = "DIR")]
    out: Option<FileArgument>,
    #[command(flatten)]
    criterion: CriterionFlags,
    #[command(flatten)]
    writing: Writing,
    #[command(flatten)]
    tolerance: Tolerance,
    #[command(flatten)]
    surface: SurfaceFlags,
}

/// Where results go without `--out`, a folder per design.
const OUT: &str = "results/bench-scene";

impl Bench {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let (document, shapes) = documents::design_and_shapes(
            &self.design,
            Need::CALIBRATE,
            &self.shapes,
            &self.surface,
            printer,
        )?;
        let design = &document.design;
        let out = match &self.out {
            Some(out) => folder(out)?,
            None => PathBuf::from(OUT).join(&design.name),
        };
        let tolerance = self.tolerance.tolerance;
        allow(
            costs(design, &shapes, tolerance)
                .into_iter()
                .chain([of_map(design, Components::Gz)]),
            cost_origin(&shapes),
            printer,
        )?;
        let mut inputs = vec![document.input.clone()];
        inputs.extend(Scene::new(design)?.files.iter().map(NamedContent::input));
        let request = BenchRequest {
            design,
            inputs,
            shapes: &shapes,
            lambda: self.criterion.options(None, tolerance),
            max_deviation_m: self.max_deviation,
            quick: self.quick,
            out,
            force: self.writing.force,
        };
        if coupled(design) || design.has_iron() {
            printer.notice(
                "the present settings run first, with the steel solved for them; how long all settings take is \
                 said then",
            );
        }
        let bar = begin(printer);
        let file = run(&request, &|estimate| printer.notice(&said(estimate)), &bar)?;
        drop(bar);
        let to = request.out.display().to_string();
        printer.summary(Stream::Output, &printer.with_warnings(&file), || {
            summary(&file, &to)
        })
    }
}

/// How long it will take.
fn said(estimate: Estimate) -> String {
    let verdict = if estimate.cpu_s > estimate.bound_s {
        "; no setting can be spared to stay within"
    } else {
        ", within"
    };
    format!(
        "{} from {} will take about {} of processor time{verdict} {}; Ctrl-C stops it",
        count(estimate.runs, "run"),
        count(estimate.computations, "computation"),
        si(estimate.cpu_s.ceil(), "s"),
        si(estimate.bound_s, "s"),
    )
}

fn summary(file: &BenchFile, folder: &str) -> String {
    let mut sheet = Sheet::new(&format!(
        "{}: error against processor time (lambda by the criterion {})",
        file.design,
        file.criterion.name()
    ));
    for shape in &file.shapes {
        of_shape(&mut sheet, shape);
        sheet.gap();
    }
    sheet.line("errors", MEASURED);
    for left_out in &file.left_out {
        sheet.line("not swept", &format!("{}: {}", left_out.knob, left_out.why));
    }
    let files = file.files.iter().map(|entry| entry.path.as_str());
    let files: Vec<&str> = files.chain(["bench.json"]).collect();
    sheet.line("written to", &format!("{folder}: {}", files.join(", ")));
    sheet.finish()
}

fn of_shape(sheet: &mut Sheet, shape: &ShapeBench) {
    let reference = &shape.reference;
    sheet.line(
        "object",
        &format!(
            "{}; refined lambda {} N/m{} from {}; felt force at {}",
            shape.shape,
            number(reference.lambda_n_per_m),
            reference
                .lambda_error
                .map_or_else(String::new, |own| format!(" +/- {}", percent(own))),
            count(reference.points as usize, "point"),
            count(reference.places as usize, "place"),
        ),
    );
    sheet.line("refined", &reference.how);
    let mut rows = vec![head(shape)];
    // Knob by knob, each alone; then what is in force now.
    for (at, knob) in shape.knobs.iter().enumerate() {
        rows.extend(shape.along(at).into_iter().map(|run| {
            let setting = &knob.settings[run.settings[at] as usize];
            let mark = if setting.present { "*" } else { "" };
            row(
                &format!(
                    "{} {}{mark}",
                    knob.name.label(),
                    number_to(setting.value, 4)
                ),
                run,
            )
        }));
    }
    rows.extend(shape.present().map(|run| row("present settings", run)));
    let sides = "lrrr";
    sheet.raw(&table(sides, &rows));
    for cheapest in &shape.cheapest {
        let text = named(shape, cheapest);
        sheet.line(&percent(cheapest.target), &text);
    }
}

fn head(shape: &ShapeBench) -> Vec<String> {
    let title = format!("{}, one knob at a time (* present)", shape.shape);
    vec![
        title,
        "lambda".into(),
        "felt force".into(),
        "CPU time".into(),
    ]
}

fn row(name: &str, run: &crate::bundle::bench::Run) -> Vec<String> {
    let error = |value: Option<f64>| value.map_or_else(|| "none".to_owned(), error);
    vec![
        name.to_owned(),
        error(run.lambda_error),
        error(run.felt_error),
        seconds(run.cpu_s),
    ]
}

fn seconds(value: f64) -> String {
    let three = format!("{value:.2e}").parse();
    si(three.unwrap_or(value), "s")
}

/// The cheapest settings for one target.
fn named(shape: &ShapeBench, cheapest: &Cheapest) -> String {
    let run = &shape.runs[cheapest.run as usize];
    let verdict = if cheapest.met {
        String::new()
    } else {
        let (error, own) = (percent(run.error()), refined_error(shape));
        format!("not reached; the closest is off by {error}{own}: ")
    };
    format!(
        "{verdict}{} of processor time\n{}",
        seconds(run.cpu_s),
        cheapest.paste.join("\n")
    )
}
