//! `replay`: what a runtime does along a trajectory.

use std::path::PathBuf;

use clap::Args;

use super::output::{ReplayFiles, write_trajectory};
use super::page;
use super::page::Below;
use super::summary::TrajectorySource;
use super::synthesize;
use super::synthesize::{Kind, Synthesis};
use super::text;
use super::{Opened, ReplayReport, run};
use crate::RunError;
use crate::bundle::artefact::Input;
use crate::bundle::atomic::{FileSet, Overwrite, check_distinct};
use crate::bundle::trajectory::Trajectory;
use crate::cli::args::Writing;
use crate::cli::budget::{CostOrigin, allow};
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{self, Codes};
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream};
use crate::cli::start::begin;
use crate::cli::values::{self, FileArgument};
use crate::scene::cost::{COPIES_REPLAYED, of_bundle, of_replay};

/// More positions than this are refused.
const MOST_POSITIONS: f64 = 1e8;

/// Follow a finger: the currents that a runtime commands along a trajectory
///
/// Does what a runtime does with a bundle, and needs nothing but the bundle: at every measured
/// position it commands the currents of least power whose force on the magnet is lambda h(x, y),
/// or the nearest force that the limits allow (equation 8). h is interpolated bilinearly between
/// the bundle's points and is zero where there is no surface; outside the map nothing is commanded.
/// The table states the requested force, the force given and their difference, every coil's current,
/// what the bundle's fixed currents would give instead, and whether a position was met (ok),
/// beyond the limits (saturated) or outside the map. A position is held until the next one; with
/// --dynamics its row states the end of that time.
#[derive(Debug, Args)]
#[command(after_long_help = help::page(Codes::Replaying, &[
    ("fluxform calibrate designs/seed_air.toml shapes/flat.toml", "make a bundle"),
    ("fluxform replay results/seed_air/flat --synthesize explore --trajectory-out finger.csv",
     "an exploring finger made up"),
    ("fluxform replay results/seed_air/flat finger.csv --out felt.csv --plot felt.svg",
     "replay a recorded trajectory, with a picture"),
    ("fluxform replay results/seed_air/flat finger.csv --report felt.html --force", "a page to watch it"),
    ("fluxform replay results/seed_air/flat finger.csv --dynamics --out - -q",
     "let the currents lag as the coils' circuit does; the table to standard output"),
]))]
pub struct Replay {
    /// Folder of a bundle, with its manifest.json
    #[arg(value_name = "BUNDLE")]
    bundle: PathBuf,
    /// CSV table with the columns t_s, x_m, y_m, z_m of the magnet's centre; `-` for standard input
    ///
    /// In seconds and metres. With x2_m, y2_m, z2_m too a second finger is on the same array: the currents give
    /// both their force, and make up for the push of their magnets on each other.
    #[arg(value_name = "TRAJECTORY", conflicts_with = "synthesize")]
    trajectory: Option<FileArgument>,
    /// Make a trajectory up instead
    #[arg(long, value_name = "KIND", value_parser = values::named::<Kind>())]
    synthesize: Option<Kind>,
    /// Which random movements are made up
    #[arg(
        long,
        hide_short_help = true,
        value_name = "N",
        default_value_t = 1,
        conflicts_with = "trajectory"
    )]
    seed: u64,
    /// How long the trajectory made up lasts, seconds
    #[arg(long, hide_short_help = true, value_name = "S", default_value_t = 10.0, value_parser = positive, conflicts_with = "trajectory", allow_hyphen_values = true)]
    duration: f64,
    /// Positions per second of the made-up trajectory
    #[arg(long, hide_short_help = true, value_name = "HZ", default_value_t = 50.0, value_parser = positive, conflicts_with = "trajectory", allow_hyphen_values = true)]
    rate: f64,
    /// Write the trajectory made up to this file too
    #[arg(long, value_name = "FILE", conflicts_with = "trajectory")]
    trajectory_out: Option<PathBuf>,
    /// Let every current lag behind its command
    ///
    /// As the coils' resistances and inductances and the supply's voltage make it.
    #[arg(long)]
    dynamics: bool,
    /// Command currents chosen for the bundle's uncertainties
    ///
    /// Those of the least expected error under the uncertainties that the bundle was made with, to
    /// which their power adds at the bundle's price; the felt error is stated with and without them.
    /// ok and saturated are those of exact positions.
    #[arg(long)]
    robust: bool,
    /// Draw finger, forces and currents over time to this file (.svg, .png or .pdf)
    #[arg(long, value_name = "FILE", value_parser = values::picture)]
    plot: Option<FileArgument>,
    /// Write a page to watch it here (HTML); `-` is standard output
    ///
    /// A slider or a button moves the finger; forces and currents of that moment are beside it.
    #[arg(long, value_name = "FILE")]
    report: Option<FileArgument>,
    /// Where the table goes; `-` is standard output
    ///
    /// Its facts and seconds go beside it (replay.json, timing_replay.json); with `-` they are not
    /// written.
    #[arg(long, value_name = "FILE", default_value = "replay.csv")]
    out: FileArgument,
    #[command(flatten)]
    writing: Writing,
}

/// A number above 0, as far as positions can be counted.
fn positive(text: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(value) if value > 0.0 && value <= MOST_POSITIONS => Ok(value),
        _ => Err(format!(
            "{text:?}: expected a number above 0, up to {MOST_POSITIONS:e}, like 50"
        )),
    }
}

impl Replay {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        if self.duration * self.rate > MOST_POSITIONS {
            return Err(Failure::Usage(format!(
                "--duration {} at --rate {} makes more than {MOST_POSITIONS:e} positions; ask for \
                 fewer",
                self.duration, self.rate
            )));
        }
        let files = match &self.out {
            FileArgument::Standard => None,
            FileArgument::Path(path) => Some(ReplayFiles::new(path).map_err(Failure::Usage)?),
        };
        let drawn = [self.plot.as_ref(), self.report.as_ref()];
        let streams = drawn.into_iter().flatten().chain([&self.out]);
        if streams.filter(|file| file.is_standard()).count() > 1 {
            let wrong = "only one of --out, --plot and --report can go to standard output (-)";
            return Err(Failure::Usage(wrong.to_owned()));
        }
        let map = of_bundle(&self.bundle, COPIES_REPLAYED);
        allow(map, CostOrigin::Document, printer)?;
        let opened = Opened::new(&self.bundle)?;
        let opened = if self.robust {
            opened.robust()?
        } else {
            opened
        };
        let (trajectory, source) = self.trajectory(&opened)?;
        let coils = opened.bundle.map.runtime.resistance_ohm.len();
        let cost = of_replay(trajectory.len(), coils);
        let origin = match &self.trajectory {
            Some(_) => CostOrigin::Document,
            None => CostOrigin::Flag,
        };
        allow([cost], origin, printer)?;
        let inputs: Vec<_> = std::iter::once(opened.input.clone())
            .chain(source.input.clone())
            .collect();
        let outputs = self.outputs(files.as_ref());
        check_distinct(&outputs).map_err(RunError::from)?;
        let reads = opened.files();
        let overwrite = self.table_overwrite(files.as_ref(), &inputs, &source, &reads)?;
        let table = files.iter().flat_map(ReplayFiles::paths);
        let protected: Vec<PathBuf> = reads.iter().cloned().chain(table).collect();
        let force = self.writing.force;
        if let Some(path) = &self.trajectory_out {
            let overwrite = Overwrite::same_bytes(force, &inputs).protecting(protected.iter());
            write_trajectory(&trajectory, path, &overwrite)?;
        }
        let [plot, page] = drawn.map(|file| {
            let written = self.trajectory_out.iter();
            let protected = protected.iter().chain(written).cloned();
            file.map(|file| Picture::new(file, force, protected))
        });
        for picture in [&plot, &page].into_iter().flatten() {
            picture.check(&inputs)?;
        }
        let bar = begin(printer);
        let mut report = run(&opened, &trajectory, source, self.dynamics, &bar)?;
        drop(bar);
        for warning in &report.summary.warnings {
            printer.warning(warning);
        }
        let place = write(
            &mut report,
            files.as_ref().zip(overwrite),
            [&plot, &page].map(Option::as_ref),
            (&inputs, &opened.below()),
            printer,
        )?;
        report.summary.warnings = printer.warnings();
        let written = files.as_ref().map(|files| written(files, self.beside()));
        printer.summary(place, &report.summary, || {
            text::summary(&report, written.as_deref())
        })
    }

    /// The trajectory of the file or the synthesis, and where it is from.
    fn trajectory(&self, opened: &Opened) -> Result<(Trajectory, TrajectorySource), Failure> {
        if let Some(file) = &self.trajectory {
            let (trajectory, input) = documents::trajectory(file)?;
            let source = TrajectorySource {
                source: input.path.clone(),
                input: Some(input),
                synthesis: None,
            };
            return Ok((trajectory, source));
        }
        let Some((synthesis, source)) = self.synthesis() else {
            let kinds: Vec<&str> = Kind::ALL.iter().map(|kind| kind.name()).collect();
            return Err(Failure::Usage(format!(
                "a trajectory is missing: name a CSV file with the columns t_s,x_m,y_m,z_m, or have one \
                 made up with --synthesize {}",
                kinds.join("|")
            )));
        };
        let trajectory = opened.synthesize(&synthesis);
        let source = TrajectorySource {
            source,
            input: None,
            synthesis: Some(synthesis),
        };
        Ok((trajectory, source))
    }

    /// The permission to replace the table and what is beside it, refused early where there is none.
    fn table_overwrite(
        &self,
        files: Option<&ReplayFiles>,
        inputs: &[Input],
        source: &TrajectorySource,
        reads: &[PathBuf],
    ) -> Result<Option<Overwrite>, Failure> {
        let Some(files) = files else { return Ok(None) };
        let made_with =
            synthesize::made_with(source.synthesis.as_ref(), self.dynamics, self.robust);
        let overwrite = Overwrite::new(self.writing.force, files.record(), inputs)
            .made_with(&made_with)
            .protecting(reads.iter());
        for path in files.paths() {
            overwrite.check(&path).map_err(RunError::from)?;
        }
        Ok(Some(overwrite))
    }

    /// Every file that is to be written.
    fn outputs(&self, files: Option<&ReplayFiles>) -> Vec<PathBuf> {
        let table = files.into_iter().flat_map(ReplayFiles::paths);
        table.chain(self.beside().cloned()).collect()
    }

    /// The files beside the table's own.
    fn beside(&self) -> impl Iterator<Item = &PathBuf> {
        let drawn = [self.plot.as_ref(), self.report.as_ref()];
        let drawn = drawn.into_iter().flatten().filter_map(|file| match file {
            FileArgument::Path(path) => Some(path),
            FileArgument::Standard => None,
        });
        self.trajectory_out.iter().chain(drawn)
    }

    /// The requested synthesis, and its name for people.
    fn synthesis(&self) -> Option<(Synthesis, String)> {
        let kind = self.synthesize?;
        let name = match kind {
            Kind::Scan => "scan lines".to_owned(),
            Kind::Circle => "a circle".to_owned(),
            Kind::Explore => format!("an exploring finger, seed {}", self.seed),
        };
        let synthesis = Synthesis {
            kind,
            seed: self.seed,
            duration_s: self.duration,
            rate_hz: self.rate,
        };
        Some((synthesis, name))
    }
}

/// Writes the table with what is beside it, picture and page, all or none: a full disk leaves no page without
/// its table. Without files the table goes to standard output. Returns where a summary may still go.
fn write(
    report: &mut ReplayReport,
    files: Option<(&ReplayFiles, Overwrite)>,
    [plot, page]: [Option<&Picture>; 2],
    (inputs, below): (&[Input], &Below),
    printer: &Printer,
) -> Result<Stream, Failure> {
    let Some((files, overwrite)) = files else {
        if let Some(plot) = plot {
            plot.draw(inputs, &report.drawing(), printer)?;
        }
        if let Some(page) = page {
            page.write(inputs, &page::html(report, below), printer)?;
        }
        printer.data(|out| report.rows.write(out))?;
        return Ok(Stream::Error);
    };
    let mut set = FileSet::begin(files.folder(), overwrite);
    let mut place = Stream::Output;
    if let Some(plot) = plot {
        place = place.or(plot.draw_into(&mut set, inputs, &report.drawing(), printer)?);
    }
    if let Some(page) = page {
        let html = page::html(report, below);
        place = place.or(page.write_into(&mut set, inputs, &html, printer)?);
    }
    // The facts last: they are in place first and list the table.
    report.stage(files, &mut set)?;
    set.commit().map_err(RunError::from)?;
    for picture in [plot, page].into_iter().flatten() {
        picture.is_written(printer);
    }
    Ok(place)
}

/// Folder and names of what was written, for people.
fn written<'a>(files: &ReplayFiles, beside: impl Iterator<Item = &'a PathBuf>) -> String {
    let mut names: Vec<String> = files.names().map(str::to_owned).to_vec();
    names.extend(beside.map(|path| path.display().to_string()));
    format!("{}: {}", files.folder().display(), names.join(", "))
}
