//! `optimize --for`: arguments, files and the summary.

use std::collections::BTreeMap;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use clap::Args;

use super::physics::{Aim, ArrayPhysics, Constant, Journal, OtherAim};
use super::{
    ArrayEnding, ArrayOptimization, ArrayRequest, journal, optimize_array, page, settling_in_array,
    tables, text,
};
use crate::RunError;
use crate::bundle::artefact::{Input, sha256_hex};
use crate::bundle::atomic::{Overwrite, check_distinct};
use crate::cli::args::SurfaceFlags;
use crate::cli::documents;
use crate::cli::failure::{Failure, Wish};
use crate::cli::help::EVALUATIONS;
use crate::cli::outlet::{Outlet, give};
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream};
use crate::cli::start::{begin, is_written, write_to};
use crate::cli::values::{self, FileArgument};
use crate::coil::array_search::choice::choices;
use crate::coil::array_search::problem::Level;
use crate::coil::array_search::search::compared;
use crate::coil::array_search::space::Space;
use crate::coil::array_search::study::Effort;
use crate::commands::optimize::Document;
use crate::commands::sweep::axis;
use crate::design::message_text::shown_path;
use crate::design::template::Template;
use crate::design::{Design, Need};
use crate::lambda::Criterion;
use crate::numerics::mixed_search::Settings;
use crate::progress::{Interrupted, Progress};
use crate::scene::cost;

/// An array for shapes instead of a coil.
#[derive(Debug, Args)]
#[command(next_help_heading = "The whole array, for shapes")]
pub struct ArrayFlags {
    /// Shapes that the array is to render best: coil, core, wire and positions together, as
    /// far as [search] or --vary says
    #[arg(long = "for", value_name = "SHAPE", num_args = 1..)]
    pub shapes: Vec<FileArgument>,
    /// Vary a key in addition to those of [search]: KEY=FROM:TO or KEY=A,B,C, like array.pitch_mm=40:60
    #[arg(long, value_name = "KEY=VALUES", requires = "shapes")]
    pub vary: Vec<String>,
    /// The force constant that is made large
    #[arg(long, hide_short_help = true, value_name = "NAME", requires = "shapes", default_value = "jnd",
          value_parser = values::either::<Criterion, OtherAim, Constant>())]
    pub constant: Constant,
    /// The force constant at which `--constant error` makes the error small, N/m
    #[arg(long = "lambda", hide_short_help = true, value_name = "N/M", requires = "shapes",
          value_parser = values::force_constant)]
    pub at_n_per_m: Option<f64>,
    /// Weights of the shapes in the geometric mean of their force constants, in order [default:
    /// equal]
    #[arg(long, hide_short_help = true, value_name = "W,...", requires = "shapes", value_delimiter = ',',
          num_args = 1.., conflicts_with = "smallest")]
    pub shares: Vec<f64>,
    /// Make the smallest of the shapes' gains large, not their mean
    #[arg(long, hide_short_help = true, requires = "shapes")]
    pub smallest: bool,
    /// Most arrays of the search.
    #[arg(long, help = EVALUATIONS, hide_short_help = true, value_name = "N", requires = "shapes", default_value_t = Settings::default().evaluations)]
    pub evaluations: usize,
    /// Write the trade-offs against mass, heat, settling and number of coils here (CSV); every number of coils is
    /// then searched to its end, and for each of these costs
    #[arg(long, hide_short_help = true, value_name = "FILE", requires = "shapes")]
    pub front: Option<FileArgument>,
    /// Draw them here, with what limits are worth (SVG, PNG or PDF); of one coil the force around it
    ///
    /// Without --for: the force over outer diameter and length at the best coil's bore, hatched where a
    /// limit is broken, each limit where it is reached, and the section of the array of best coils.
    #[arg(long, hide_short_help = true, value_name = "FILE", value_parser = values::picture)]
    pub plot: Option<FileArgument>,
    /// Keep every array that is computed in this file, and take from it those of an earlier run
    ///
    /// Runs of one design may share it, side by side too. A file that is damaged or was changed by hand is refused.
    #[arg(long, hide_short_help = true, value_name = "FILE", requires = "shapes")]
    pub journal: Option<FileArgument>,
    #[command(flatten)]
    pub surface: SurfaceFlags,
}

/// Arguments that the two kinds of `optimize` share.
pub struct Shared<'a> {
    /// Design file.
    pub design: &'a FileArgument,
    /// Local searches.
    pub starts: Option<usize>,
    /// Where the sequence begins.
    pub seed: u64,
    /// Where the best design goes.
    pub out: Option<&'a FileArgument>,
    /// Where the page goes.
    pub report: Option<&'a FileArgument>,
    /// Whether existing files are replaced.
    pub force: bool,
    /// Allowed error.
    pub tolerance: Option<f64>,
}

/// Pauses between what is written of the journal during a search: each is twice the one before.
const SOONEST_KEPT: Duration = Duration::from_secs(1);
const LATEST_KEPT: Duration = Duration::from_secs(20);

/// The files of a search.
struct Outputs<'a> {
    /// The first line of what is made of the design.
    mark: String,
    /// What design and journal may replace.
    marked: Overwrite,
    /// What the table may replace.
    of_table: Overwrite,
    plot: Option<Picture<'a>>,
    report: Option<Picture<'a>>,
}

impl ArrayFlags {
    /// Runs the search.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, shared: &Shared<'_>, printer: &Printer) -> Result<(), Failure> {
        let (document, shapes) = documents::design_and_shapes(
            shared.design,
            Need::CALIBRATE,
            &self.shapes,
            &self.surface,
            printer,
        )?;
        let path = shared.design.as_given();
        let text = self.varied(&document.text, path)?;
        let read = Design::from_toml(&text, path, Need::CALIBRATE);
        let (design, _) = read.map_err(|fault| Failure::Documents(vec![fault]))?;
        let (design, text) = settling_in_array(design, text, path, shared.tolerance)?;
        let mut inputs = vec![document.input.clone()];
        inputs.extend(shapes.iter().filter_map(|shape| shape.input.clone()));
        let outputs = self.outputs(shared, &document, &inputs)?;
        let files = [shared.out, self.front.as_ref()].into_iter().flatten();
        let there = files
            .map(FileArgument::as_given)
            .filter(|path| path.is_file());
        for path in there.filter(|_| !shared.force) {
            printer.notice(&format!(
                "{} exists: without --force it is kept, unless the same comes out again",
                shown_path(path)
            ));
        }
        let bar = begin(printer);
        let physics = ArrayPhysics::new(&shapes, self.aim()?, shared.tolerance, &bar)?;
        physics.remember(self.earlier()?);
        let request = self.request(shared, shapes.len())?;
        // Of a plate and other bodies no law is known: the given design is measured.
        let is_measured = design.has_iron();
        let said = |measured_s| printer.notice(&estimate(&design, &physics, &request, measured_s));
        if is_measured {
            printer.notice(
                "the given design is computed first, with its plate and other bodies; how long the search takes is \
                 said then",
            );
        } else {
            said(0.0);
        }
        let announce = |measured_s| {
            if is_measured {
                said(measured_s);
            }
        };
        let source = Document {
            design: &design,
            text: &text,
            path,
        };
        let ended = self.keeping(&outputs, &physics, || {
            optimize_array(
                &source, &shapes, inputs, &request, &physics, &announce, &bar,
            )
        });
        let arrays = physics.journal();
        let seconds = bar.take_seconds();
        drop(physics);
        drop(bar);
        let (status, missed) = self.give(shared, &outputs, ended, &arrays, &seconds, printer)?;
        match status {
            ArrayEnding::Done => Ok(()),
            ArrayEnding::Interrupted => Err(RunError::Interrupted(Interrupted).into()),
            ArrayEnding::Infeasible => Err(Failure::Unmet(
                Wish::Coil,
                format!(
                    "no array that was computed meets every limit; the result, which breaks them least, misses: {}",
                    missed.join(", ")
                ),
            )),
        }
    }

    /// The arrays of earlier runs.
    fn earlier(&self) -> Result<Journal, Failure> {
        let Some(FileArgument::Path(path)) = &self.journal else {
            return Ok(Journal::new());
        };
        let kept = journal::read(path);
        let kept =
            kept.map_err(|wrong| Failure::Input(format!("{}: {wrong}", shown_path(path))))?;
        Ok(kept.arrays)
    }

    /// What `search` gives, while the journal is written now and then, so that a run that is killed loses little.
    fn keeping<T>(
        &self,
        outputs: &Outputs<'_>,
        physics: &ArrayPhysics<'_>,
        search: impl FnOnce() -> T,
    ) -> T {
        let Some(FileArgument::Path(path)) = &self.journal else {
            return search();
        };
        thread::scope(|scope| {
            let (ended, until) = mpsc::channel::<()>();
            scope.spawn(move || {
                let mut pause = SOONEST_KEPT;
                while until.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
                    pause = LATEST_KEPT.min(2 * pause);
                    // What cannot be written is reported in the end.
                    let _ = journal::add(path, &outputs.mark, &outputs.marked, &physics.journal());
                }
            });
            let found = search();
            drop(ended);
            found
        })
    }

    /// Writes the journal; returns where the summary goes.
    fn keep(
        &self,
        outputs: &Outputs<'_>,
        arrays: &Journal,
        printer: &Printer,
    ) -> Result<Stream, Failure> {
        match &self.journal {
            Some(FileArgument::Path(path)) => {
                journal::add(path, &outputs.mark, &outputs.marked, arrays)
                    .map_err(RunError::from)?;
                Ok(Stream::Output)
            }
            file => {
                let text = journal::text(&outputs.mark, arrays)?;
                write_to(file.as_ref(), &outputs.marked, printer, |out| {
                    out.write_all(&text)
                })
            }
        }
    }

    /// Gives the result, and the journal also where there is none. A journal that cannot be written costs no
    /// result: it is reported in the end. Returns how the search ended, and the limits that are missed.
    fn give(
        &self,
        shared: &Shared<'_>,
        outputs: &Outputs<'_>,
        ended: Result<ArrayOptimization, RunError>,
        arrays: &Journal,
        seconds: &[(String, f64)],
        printer: &Printer,
    ) -> Result<(ArrayEnding, Vec<String>), Failure> {
        for warning in ended.iter().flat_map(|result| &result.warnings) {
            printer.warning(warning);
        }
        let mut kept = Ok(Stream::Output);
        let given = give(
            |outlet| {
                if outlet.takes(self.journal.as_ref()) {
                    kept = self.keep(outputs, arrays, printer);
                }
                let place = *kept.as_ref().unwrap_or(&Stream::Output);
                match &ended {
                    Ok(result) => {
                        let written = self.write(outlet, shared, outputs, result, printer)?;
                        Ok(place.or(written))
                    }
                    Err(_) => Ok(place),
                }
            },
            |place| match &ended {
                Ok(result) => {
                    let json = printer.with_warnings(result);
                    printer.summary(place, &json, || text::summary(result, seconds))
                }
                Err(_) => Ok(()),
            },
        );
        if let (Err(failure), true) = (&kept, given.is_err() || ended.is_err()) {
            printer.warning(&failure.message());
        }
        given?;
        let result = ended?;
        if let (Some(FileArgument::Path(path)), ArrayEnding::Interrupted, false) =
            (shared.out, &result.status, shared.force)
        {
            printer.notice(&format!(
                "{} holds the best array so far; the same command with --force replaces it",
                shown_path(path)
            ));
        }
        kept.map(|_| (result.status, result.missed()))
    }

    /// Every file that will be written, checked before the search.
    fn outputs<'a>(
        &'a self,
        shared: &Shared<'a>,
        document: &documents::DesignDocument,
        inputs: &[Input],
    ) -> Result<Outputs<'a>, Failure> {
        let mark = mark(shared.design, &document.text);
        let beginning = |head: &str| {
            Overwrite::beginning(shared.force, head, &inputs[..1]).protecting(document.also_read())
        };
        let check = |overwrite: &Overwrite, file: Option<&FileArgument>| match file {
            Some(FileArgument::Path(path)) => overwrite.check(path).map_err(RunError::from),
            Some(FileArgument::Standard) | None => Ok(()),
        };
        let marked = beginning(&mark);
        check(&marked, shared.out)?;
        check(&marked, self.journal.as_ref())?;
        let files = [
            shared.out,
            self.front.as_ref(),
            self.plot.as_ref(),
            self.journal.as_ref(),
            shared.report,
        ];
        let streams = files.iter().flatten().filter(|file| file.is_standard());
        if streams.count() > 1 {
            let wrong = "only one of --out, --front, --plot, --journal and --report can go to standard output (-)";
            return Err(Failure::Usage(wrong.to_owned()));
        }
        let paths = files.into_iter().flatten().filter_map(|file| match file {
            FileArgument::Path(path) => Some(path),
            FileArgument::Standard => None,
        });
        check_distinct(paths.collect::<Vec<_>>()).map_err(RunError::from)?;
        let picture = |file| Picture::new(file, shared.force, document.also_read());
        let plot = self.plot.as_ref().map(picture);
        let report = shared.report.map(picture);
        for picture in [&plot, &report].into_iter().flatten() {
            picture.check(inputs)?;
        }
        // The head of the table is its mark.
        let of_table = beginning(tables::HEAD);
        check(&of_table, self.front.as_ref())?;
        Ok(Outputs {
            mark,
            marked,
            of_table,
            plot,
            report,
        })
    }

    /// Writes the outputs of the result that go to `outlet`; returns where the summary goes.
    fn write(
        &self,
        outlet: Outlet,
        shared: &Shared<'_>,
        outputs: &Outputs<'_>,
        result: &ArrayOptimization,
        printer: &Printer,
    ) -> Result<Stream, Failure> {
        let mut place = Stream::Output;
        if outlet.takes(shared.out) {
            let design = format!("{}\n{}", outputs.mark, result.design_text);
            place = write_to(shared.out, &outputs.marked, printer, |out| {
                out.write_all(design.as_bytes())
            })?;
            is_written(shared.out, printer);
        }
        if outlet.takes(self.front.as_ref()) {
            let table = tables::csv(result);
            let file = self.front.as_ref();
            place = place.or(write_to(file, &outputs.of_table, printer, |out| {
                out.write_all(table.as_bytes())
            })?);
        }
        let worths = result.study.as_ref().map_or_else(Vec::new, text::worths);
        if outlet.takes(self.plot.as_ref())
            && let (Some(plot), Some(pareto)) = (&outputs.plot, tables::pareto(result, &worths))
        {
            place = place.or(plot.draw(&result.inputs, &pareto.drawing(), printer)?);
        }
        if outlet.takes(shared.report)
            && let Some(report) = &outputs.report
        {
            place = place.or(report.write(&result.inputs, &page::html(result), printer)?);
        }
        Ok(place)
    }

    /// The design's text with what the flags vary.
    fn varied(&self, text: &str, path: &std::path::Path) -> Result<String, Failure> {
        if self.vary.is_empty() {
            return Ok(text.to_owned());
        }
        let template =
            Template::new(text, path).map_err(|fault| Failure::Documents(vec![fault]))?;
        let mut settings = Vec::new();
        for given in &self.vary {
            let (key, values) =
                vary(given).map_err(|wrong| Failure::Usage(format!("--vary {given}: {wrong}")))?;
            let key = format!("search.{key}");
            if settings.iter().any(|(known, _)| *known == key) {
                return Err(Failure::Usage(format!(
                    "--vary {given}: the key is given twice; give all its values in one --vary"
                )));
            }
            settings.push((key, values));
        }
        let settings = settings
            .iter()
            .map(|(key, value)| (key.as_str(), value.clone()));
        template.with(settings).map_err(Failure::Usage)
    }

    fn aim(&self) -> Result<Aim, Failure> {
        if (self.constant == Constant::ERROR) != self.at_n_per_m.is_some() {
            return Err(Failure::Usage(
                "--constant error and --lambda go together: the error depends on the force constant, \
                 the other constants on none"
                    .to_owned(),
            ));
        }
        Ok(Aim {
            constant: self.constant,
            at_n_per_m: self.at_n_per_m,
            ..Aim::default()
        })
    }

    fn request(&self, shared: &Shared<'_>, shapes: usize) -> Result<ArrayRequest, Failure> {
        let sound = |share: &f64| *share > 0.0 && share.is_finite();
        if !self.shares.is_empty()
            && (self.shares.len() != shapes || !self.shares.iter().all(sound))
        {
            return Err(Failure::Usage(format!(
                "--shares gives {} weights for {shapes} shapes: expected one above 0 for each",
                self.shares.len()
            )));
        }
        let equal = || vec![1.0; shapes];
        let default = Settings::default();
        Ok(ArrayRequest {
            shares: (!self.smallest).then(|| {
                if self.shares.is_empty() {
                    equal()
                } else {
                    self.shares.clone()
                }
            }),
            settings: Settings {
                seed: shared.seed,
                starts: shared.starts.unwrap_or(default.starts),
                evaluations: self.evaluations.max(1),
                ..default
            },
            tolerance: shared.tolerance,
            every_count: self.front.is_some(),
        })
    }
}

/// `KEY=FROM:TO` or `KEY=A,B,C` as a key of `[search]` and its value.
fn vary(text: &str) -> Result<(String, toml::Value), String> {
    let number = |text: &str| {
        text.trim()
            .parse::<f64>()
            .map_err(|_| format!("expected a number, found {text:?}"))
    };
    if let Some((key, range)) = text.split_once('=')
        && let Some((from, to)) = range.split_once(':')
    {
        let ends = [number(from)?, number(to)?].map(toml::Value::Float);
        return Ok((key.trim().to_owned(), toml::Value::Array(ends.to_vec())));
    }
    let axis = axis::parse(text)?;
    let values = axis
        .values
        .iter()
        .map(crate::commands::sweep::toml_value)
        .collect();
    Ok((axis.key, toml::Value::Array(values)))
}

/// Processor time of a descent on a surrogate for each of its variables, about (`time fluxform optimize --front`).
const CLIMB_S: f64 = 3e-3;

/// The computation that follows, stated first: every number of coils where each is searched to its end, else the
/// costliest of them. The given design took `measured_s`, as far as that is known, and no array is taken for cheaper.
fn estimate(
    design: &Design,
    physics: &ArrayPhysics,
    request: &ArrayRequest,
    measured_s: f64,
) -> String {
    let choices = choices(design, &design.search);
    let spaces = choices
        .iter()
        .filter_map(|choice| Space::new(design, &design.search, choice).ok());
    let cpu_s = |space: Space| {
        let array = space.design(&space.given(design));
        let steel = cost::of_steel(&array, physics.tolerance(Level::Search, &array));
        let forces = physics.count(Level::Search) * space.coils();
        let steel_s: f64 = steel.iter().map(|cost| cost.cpu_seconds).sum();
        steel_s + forces as f64 * cost::STEEL_POINT_COIL_S
    };
    let mut each_cpu_s = BTreeMap::new();
    let mut variables = 0;
    for space in spaces {
        let known: &mut f64 = each_cpu_s.entry(space.coils()).or_default();
        variables = variables.max(space.variables().len());
        *known = known.max(cpu_s(space)).max(measured_s);
    }
    let costliest = each_cpu_s.values().copied().fold(0.0, f64::max);
    let (ends, ends_cpu_s) = match request.every_count {
        true => (each_cpu_s.len(), each_cpu_s.values().sum()),
        false => (1, costliest),
    };
    let compared = compared(choices.len(), request.settings);
    let effort = Effort::of(request.every_count);
    let (searched, around) = (request.settings.evaluations, effort.evaluations);
    let climbs_s = CLIMB_S * (ends * effort.climbs() * variables) as f64;
    let arrays_s = compared as f64 * costliest + (searched + around) as f64 * ends_cpu_s;
    format!(
        "computes up to {} arrays and about {} around the best, about {:.0} CPU s; Ctrl-C gives the best so far",
        compared + ends * searched,
        ends * around,
        (arrays_s + climbs_s).ceil()
    )
}

/// The line by which a design that was made of this one is known from any other file.
pub(in crate::commands::optimize) fn mark(design: &FileArgument, text: &str) -> String {
    format!(
        "# Made of {} (sha256 {}) by `fluxform optimize`.",
        design.as_given().display(),
        sha256_hex(text.as_bytes())
    )
}
