//! `optimize`: the best coil within a design's limits.

use super::text;
use std::path::PathBuf;

use clap::Args;

use super::array::command::{ArrayFlags, Shared, mark};
use super::{Dimension, Document, Optimization, OptimizeRequest, optimize, page};
use crate::RunError;
use crate::bundle::atomic::{Overwrite, check_distinct};
use crate::cli::args::{Tolerance, Writing};
use crate::cli::documents;
use crate::cli::failure::{Failure, Wish};
use crate::cli::help::{Codes, page};
use crate::cli::outlet::{Outlet, give};
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream};
use crate::cli::start::{accuracy_check, begin, is_written, write_to};
use crate::cli::values::{self, FileArgument};
use crate::design::Need;

/// Find the best coil within a design's limits
///
/// Seeks inner diameter, outer diameter and length of the winding, and the wire among
/// wire.choices_mm, so that the force on the magnet at the target height is largest within the
/// design's [limits], at the rated current: the driver's, or what the supply's voltage lets through
/// if that is less. The winding is full; with --wound it has whole layers and whole turns per layer.
/// The design's [coil], if it has one, is a starting point and is compared with the result.
/// A certificate says how sure it is that no coil within the limits is better. The sensitivity
/// of a limit is the force that one unit more of it would give.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Writing, &[
    ("fluxform optimize designs/seed_air.toml", "the best coil within the seed's limits, without steel"),
    ("fluxform optimize designs/seed_air.toml --wound --out best.toml && fluxform evaluate best.toml",
     "one that can be wound, as a design"),
    ("fluxform optimize designs/seed_air.toml --fix inner_diameter_mm --format json",
     "with the bore as it is, for a program"),
    ("fluxform optimize designs/seed_air.toml --for shapes/flat.toml --vary coil.length_mm=60:90",
     "the array that renders a plane best, of coils 60 to 90 mm long"),
]), mut_arg("unit", |unit| unit.hide_short_help(true)))]
pub struct Optimize {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// Whole layers and whole turns per layer
    #[arg(long)]
    wound: bool,
    /// Among the array's other coils: their unpowered cores count for force and settling of the
    /// coil nearest to the centre, where the design couples them
    #[arg(long, hide_short_help = true)]
    neighbours: bool,
    /// Local searches for every wire, in addition to that from the design's own coil
    /// [default: 24; with --for 3]
    #[arg(long, hide_short_help = true, value_name = "N", value_parser = starts)]
    starts: Option<usize>,
    /// Where the sequence of starting points begins
    #[arg(long, hide_short_help = true, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Keep these dimensions of the design's [coil]
    #[arg(long, hide_short_help = true, value_name = "KEY", value_parser = values::named::<Dimension>(), num_args = 1.., value_delimiter = ',')]
    fix: Vec<Dimension>,
    /// Boxes of coils that proving the best may take; 0 for no proof
    #[arg(
        long,
        hide_short_help = true,
        value_name = "N",
        default_value_t = OptimizeRequest::default().cells
    )]
    certificate_cells: usize,
    /// Write the design with the best coil here (TOML); `-` is standard output
    #[arg(long, value_name = "FILE")]
    out: Option<FileArgument>,
    /// Write a page with the result here (HTML); `-` is standard output
    #[arg(long, value_name = "FILE")]
    report: Option<FileArgument>,
    #[command(flatten)]
    writing: Writing,
    #[command(flatten)]
    tolerance: Tolerance,
    #[command(flatten)]
    array: ArrayFlags,
}

/// The files of a search.
struct Files<'a> {
    /// The first line of what is made of the design.
    mark: &'a str,
    /// What the design may replace.
    overwrite: &'a Overwrite,
    page: Option<Picture<'a>>,
    plot: Option<Picture<'a>>,
}

fn starts(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(starts @ 1..=1_000_000) => Ok(starts),
        _ => Err("expected a number of searches, 1 to 1000000".to_owned()),
    }
}

impl Optimize {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        self.of_one_kind()?;
        if !self.array.shapes.is_empty() {
            let shared = Shared {
                design: &self.design,
                starts: self.starts,
                seed: self.seed,
                out: self.out.as_ref(),
                report: self.report.as_ref(),
                force: self.writing.force,
                tolerance: self.tolerance.tolerance,
            };
            return self.array.run(&shared, printer);
        }
        let document = documents::design(&self.design, Need::OPTIMIZE, printer)?;
        let mark = mark(&self.design, &document.text);
        let protected: Vec<PathBuf> = document.also_read().collect();
        let inputs = vec![document.input.clone()];
        let overwrite =
            Overwrite::beginning(self.writing.force, &mark, &inputs).protecting(protected.iter());
        let mut outputs = Vec::new();
        if let Some(FileArgument::Path(path)) = &self.out {
            outputs.push(path);
            overwrite.check(path).map_err(RunError::from)?;
        }
        let drawn = [self.report.as_ref(), self.array.plot.as_ref()];
        let files = self.out.iter().chain(drawn.into_iter().flatten());
        if files.clone().filter(|file| file.is_standard()).count() > 1 {
            return Err(Failure::Usage(
                "of --out, --report and --plot only one can go to standard output; give the others a file"
                    .to_owned(),
            ));
        }
        check_distinct(files.map(FileArgument::as_given)).map_err(RunError::from)?;
        let [page, plot] = drawn.map(|file| {
            let written = outputs.iter().map(|path| path.to_path_buf());
            let protected = protected.iter().cloned().chain(written);
            file.map(|file| Picture::new(file, self.writing.force, protected))
        });
        for picture in [&page, &plot].into_iter().flatten() {
            picture.check(&inputs)?;
        }
        let bar = begin(printer);
        let source = Document {
            design: &document.design,
            text: &document.text,
            path: self.design.as_given(),
        };
        let result = optimize(&source, inputs, &self.request(), &bar)?;
        drop(bar);
        let files = Files {
            mark: &mark,
            overwrite: &overwrite,
            page,
            plot,
        };
        for warning in &result.warnings {
            printer.warning(warning);
        }
        give(
            |outlet| self.write(outlet, &files, &result, printer),
            |place| {
                let json = printer.with_warnings(&result);
                printer.summary(place, &json, || text::summary(&result))
            },
        )?;
        if let Some(none) = &result.no_coil {
            return Err(Failure::Unmet(Wish::Coil, none.message.clone()));
        }
        let missed = result.missed();
        if !missed.is_empty() {
            let message = format!("the best coil misses {}", missed.join(", "));
            return Err(Failure::Unmet(Wish::Limits, message));
        }
        let missed =
            (!result.accuracy_reached).then(|| "the best coil: see its accuracy".to_owned());
        accuracy_check(missed.as_slice())
    }

    /// Refuses arguments of one coil beside `--for`, and those of shapes without it. No clap rule says that the former
    /// exclude `--for`: clap drops what an argument requires where another excludes that.
    fn of_one_kind(&self) -> Result<(), Failure> {
        let of_shapes = self.array.surface.given();
        if self.array.shapes.is_empty() && !of_shapes.is_empty() {
            return Err(Failure::Usage(format!(
                "{} can only be used with --for: one coil is optimised without shapes",
                of_shapes.join(", ")
            )));
        }
        let of_one_coil = [
            (self.wound, "--wound"),
            (self.neighbours, "--neighbours"),
            (!self.fix.is_empty(), "--fix"),
            (
                self.certificate_cells != OptimizeRequest::default().cells,
                "--certificate-cells",
            ),
        ];
        let given: Vec<&str> = of_one_coil
            .into_iter()
            .filter_map(|(given, name)| given.then_some(name))
            .collect();
        if self.array.shapes.is_empty() || given.is_empty() {
            return Ok(());
        }
        Err(Failure::Usage(format!(
            "{} cannot be used with --for, which searches a whole array and not one coil",
            given.join(", ")
        )))
    }

    /// Writes the outputs of the result that go to `outlet`; returns where the summary goes.
    fn write(
        &self,
        outlet: Outlet,
        files: &Files<'_>,
        result: &Optimization,
        printer: &Printer,
    ) -> Result<Stream, Failure> {
        let mut place = Stream::Output;
        if outlet.takes(self.out.as_ref())
            && let Some(text) = &result.design_text
        {
            place = write_to(self.out.as_ref(), files.overwrite, printer, |out| {
                write!(out, "{}\n{text}", files.mark)
            })?;
            is_written(self.out.as_ref(), printer);
        }
        if outlet.takes(self.report.as_ref())
            && let Some(page) = &files.page
        {
            place = place.or(page.write(&result.inputs, &page::html(result), printer)?);
        }
        if outlet.takes(self.array.plot.as_ref())
            && let (Some(plot), Some(picture)) = (&files.plot, &result.picture)
        {
            place = place.or(plot.draw(&result.inputs, &picture.drawing(), printer)?);
        }
        Ok(place)
    }

    fn request(&self) -> OptimizeRequest {
        OptimizeRequest {
            wound: self.wound,
            neighbours: self.neighbours,
            fixed: self.fix.clone(),
            starts: self.starts.unwrap_or(OptimizeRequest::default().starts),
            seed: self.seed,
            cells: self.certificate_cells,
            around: true,
            landscape: self.array.plot.is_some(),
            tolerance: self.tolerance.tolerance,
        }
    }
}
