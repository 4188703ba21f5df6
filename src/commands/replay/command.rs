//! `replay`: what a runtime does along a trajectory.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::output::{ReplayFiles, write_trajectory};
use super::summary::{ErrorFacts, ReplaySummary, Told};
use super::synthesize;
use super::synthesize::{Kind, Synthesis};
use super::{Opened, ReplayReport, run};
use crate::RunError;
use crate::bundle::atomic::{Overwrite, check_distinct};
use crate::cli::args::Writing;
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::Sheet;
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{count, error, force, number, percent, si};
use crate::cli::start::begin;
use crate::cli::values::{self, FileArgument};

/// Forces below this are rounding, N.
const NOTHING_N: f64 = 1e-12;
/// More positions than this are refused.
const MOST_POSITIONS: f64 = 1e8;

/// Follow a finger: the currents that a runtime commands along a trajectory
///
/// Does what a runtime does with a bundle, and needs nothing but the bundle: at every measured
/// position it commands the currents of least power whose force on the magnet is lambda h(x, y),
/// or the nearest force that the limits allow (equation 8). h is interpolated bilinearly between
/// the bundle's points and is zero where there is no surface; outside the map nothing is commanded.
/// The table tells the wanted force, the force given and their difference, every coil's current,
/// what the bundle's fixed currents would give instead, and whether a position was met (ok),
/// beyond the limits (saturated) or outside the map. A position is held until the next one; with
/// --dynamics what is told is the end of that time.
#[derive(Debug, Args)]
#[command(after_help = page(Codes::Writing, &[
    ("fluxform calibrate designs/seed_air.toml shapes/flat.toml", "make a bundle"),
    ("fluxform replay results/seed_air/flat --synthesize explore --trajectory-out finger.csv",
     "an exploring finger made up"),
    ("fluxform replay results/seed_air/flat finger.csv --out felt.csv --plot felt.svg",
     "replay a recorded trajectory, with a picture"),
    ("fluxform replay results/seed_air/flat finger.csv --dynamics --out - -q",
     "let the currents lag as the coils' circuit does; the table to standard output"),
]))]
pub struct Replay {
    /// Folder of a bundle, with its manifest.json
    #[arg(value_name = "BUNDLE")]
    bundle: PathBuf,
    /// CSV table with the columns t_s, x_m, y_m, z_m of the magnet's centre, in seconds and metres;
    /// `-` for standard input
    #[arg(
        value_name = "TRAJECTORY",
        required_unless_present = "synthesize",
        conflicts_with = "synthesize"
    )]
    trajectory: Option<FileArgument>,
    /// Make a trajectory up instead
    #[arg(long, value_enum, value_name = "KIND")]
    synthesize: Option<KindFlag>,
    /// Which random movements are made up
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1,
        conflicts_with = "trajectory"
    )]
    seed: u64,
    /// How long the trajectory made up lasts, seconds
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = positive, conflicts_with = "trajectory", allow_hyphen_values = true)]
    duration: f64,
    /// Positions a second of the trajectory made up
    #[arg(long, value_name = "HZ", default_value_t = 50.0, value_parser = positive, conflicts_with = "trajectory", allow_hyphen_values = true)]
    rate: f64,
    /// Write the trajectory made up to this file too
    #[arg(long, value_name = "FILE", conflicts_with = "trajectory")]
    trajectory_out: Option<PathBuf>,
    /// Let every current follow its command through the coils' resistances and inductances, under
    /// the supply's voltage
    #[arg(long)]
    dynamics: bool,
    /// Draw finger, forces and currents over time to this SVG file
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Where the table goes, with its facts and seconds beside it (replay.json,
    /// timing_replay.json); `-` is standard output, and then there is nothing beside it
    #[arg(long, value_name = "FILE", default_value = "replay.csv")]
    out: FileArgument,
    #[command(flatten)]
    writing: Writing,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum KindFlag {
    /// Lines to and fro on the surface
    Scan,
    /// A circle on the surface
    Circle,
    /// Up to 14 mm off the surface, once outside the workspace
    Explore,
}

/// A number above 0.
fn positive(text: &str) -> Result<f64, String> {
    match values::force_constant(text) {
        Ok(value) if value > 0.0 => Ok(value),
        _ => Err(format!("{text:?}: expected a number above 0, like 50")),
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
            FileArgument::Path(path) => Some(ReplayFiles::new(path)?),
        };
        let opened = Opened::new(&self.bundle)?;
        let (trajectory, told) = match (&self.trajectory, self.synthesis()) {
            (Some(file), _) => {
                let (trajectory, input) = documents::trajectory(file)?;
                let source = input.path.clone();
                let input = Some(input);
                let synthesis = None;
                (
                    trajectory,
                    Told {
                        source,
                        input,
                        synthesis,
                    },
                )
            }
            (None, Some((synthesis, source))) => {
                let trajectory = opened.synthesize(&synthesis);
                (
                    trajectory,
                    Told {
                        source,
                        input: None,
                        synthesis: Some(synthesis),
                    },
                )
            }
            (None, None) => {
                let message = "name a trajectory, or ask for one with --synthesize";
                return Err(Failure::Usage(message.to_owned()));
            }
        };
        let inputs: Vec<_> = std::iter::once(opened.input.clone())
            .chain(told.input.clone())
            .collect();
        let outputs = self.outputs(files.as_ref());
        check_distinct(&outputs).map_err(RunError::from)?;
        let force = self.writing.force;
        let reads = opened.files();
        let of_table = |files: &ReplayFiles| {
            Overwrite::new(force, files.record(), &inputs)
                .made_with(&synthesize::made_with(
                    told.synthesis.as_ref(),
                    self.dynamics,
                ))
                .protecting(reads.iter())
        };
        let of_table = files.as_ref().map(of_table);
        if let (Some(files), Some(overwrite)) = (&files, &of_table) {
            for path in files.paths() {
                overwrite.check(&path).map_err(RunError::from)?;
            }
        }
        let table = files.iter().flat_map(ReplayFiles::paths);
        let protected: Vec<PathBuf> = reads.iter().cloned().chain(table).collect();
        if let Some(path) = &self.trajectory_out {
            let overwrite = Overwrite::same_bytes(force, &inputs).protecting(protected.iter());
            write_trajectory(&trajectory, path, &overwrite)?;
        }
        let plot = self.plot.clone().map(FileArgument::Path);
        let plot = plot.as_ref().map(|file| {
            let written = self.trajectory_out.clone();
            Picture::new(file, force, protected.into_iter().chain(written))
        });
        if let Some(plot) = &plot {
            plot.check(&inputs)?;
        }
        let bar = begin(printer);
        let mut report = run(&opened, &trajectory, told, self.dynamics, &bar)?;
        drop(bar);
        for warning in &report.summary.warnings {
            printer.warning(warning);
        }
        if let Some(plot) = &plot {
            plot.write(&inputs, &report.svg(), printer)?;
        }
        let place = match (&files, &of_table) {
            (Some(files), Some(overwrite)) => {
                report.write(files, overwrite)?;
                Stream::Output
            }
            _ => {
                printer.data(|out| report.rows.write(out))?;
                Stream::Error
            }
        };
        report.summary.warnings = printer.warnings();
        printer.summary(place, &report.summary, || {
            self.told(&report, files.as_ref())
        })
    }

    /// Every file that is to be written.
    fn outputs(&self, files: Option<&ReplayFiles>) -> Vec<PathBuf> {
        let table = files.into_iter().flat_map(ReplayFiles::paths);
        let beside = [&self.plot, &self.trajectory_out].into_iter().flatten();
        table.chain(beside.cloned()).collect()
    }

    /// What is to be made up, and its name for people.
    fn synthesis(&self) -> Option<(Synthesis, String)> {
        let (kind, name) = match self.synthesize? {
            KindFlag::Scan => (Kind::Scan, "scan lines".to_owned()),
            KindFlag::Circle => (Kind::Circle, "a circle".to_owned()),
            KindFlag::Explore => (
                Kind::Explore,
                format!("an exploring finger, seed {}", self.seed),
            ),
        };
        let synthesis = Synthesis {
            kind,
            seed: self.seed,
            duration_s: self.duration,
            rate_hz: self.rate,
        };
        Some((synthesis, name))
    }

    fn told(&self, report: &ReplayReport, files: Option<&ReplayFiles>) -> String {
        let summary = &report.summary;
        let trajectory = &summary.trajectory;
        let mut sheet = Sheet::new(&format!(
            "{} on {}: {} in {} s ({})",
            summary.shape,
            summary.design,
            count(trajectory.positions, "position"),
            number(trajectory.duration_s),
            trajectory.source
        ));
        sheet.line(
            "wanted",
            &format!(
                "{} N/m times the height, at most {}",
                number(summary.lambda_n_per_m),
                force(summary.force.wanted_max_n)
            ),
        );
        sheet.line("feedback", &errors(&summary.force.feedback));
        sheet.line(
            "fixed",
            &format!(
                "{} (the bundle's static currents)",
                errors(&summary.force.fixed)
            ),
        );
        sheet.line("currents", &currents(summary));
        let power = &summary.power;
        sheet.line(
            "heat",
            &format!(
                "{} on the average, at most {}; fixed currents {}",
                si(power.mean_w, "W"),
                si(power.max_w, "W"),
                si(power.static_w, "W")
            ),
        );
        sheet.line(
            "limits",
            &format!(
                "bind {} of the time; outside the map {}",
                percent(summary.saturated_time_fraction),
                percent(summary.outside_time_fraction)
            ),
        );
        if let Some(dynamics) = &summary.dynamics {
            let voltage = dynamics
                .voltage_v
                .map_or_else(String::new, |v| format!(", voltages up to {} V", number(v)));
            sheet.line(
                "lag",
                &format!(
                    "time constants from {} to {}{voltage}",
                    si(dynamics.time_constant_min_s, "s"),
                    si(dynamics.time_constant_max_s, "s")
                ),
            );
        }
        if let Some(stage) = summary.accuracy.get("force").filter(|s| s.estimate > 0.0) {
            sheet.line(
                "accuracy",
                &format!(
                    "forces to {} N by the map's stated errors; optimality of the currents {}",
                    error(stage.estimate),
                    summary
                        .accuracy
                        .get("allocation")
                        .map_or_else(String::new, |stage| error(stage.estimate))
                ),
            );
        }
        if let Some(files) = files {
            let mut names: Vec<String> = files.names().map(str::to_owned).to_vec();
            let beside = [&self.trajectory_out, &self.plot].into_iter().flatten();
            names.extend(beside.map(|path| path.display().to_string()));
            let folder = files.folder().display();
            sheet.line("written to", &format!("{folder}: {}", names.join(", ")));
        }
        if let Some(step_s) = report.step_s {
            sheet.line("step", &format!("{} each on this machine", si(step_s, "s")));
        }
        sheet.finish()
    }
}

fn newton(force_n: f64) -> String {
    if force_n < NOTHING_N {
        "none".to_owned()
    } else {
        force(force_n)
    }
}

fn errors(facts: &ErrorFacts) -> String {
    if facts.worst_error_n < NOTHING_N {
        return "no error".to_owned();
    }
    let relative = facts
        .relative_rms_error
        .map_or_else(String::new, |part| format!(" ({})", percent(part)));
    let place = facts.worst_at.map_or_else(String::new, |place| {
        let at = [place.x_m, place.y_m, place.z_m].map(|c| number(c * 1e3));
        format!(" at {} s, ({}) mm", number(place.t_s), at.join(", "))
    });
    format!(
        "error rms {}{relative}, worst {}{place}",
        newton(facts.rms_error_n),
        newton(facts.worst_error_n)
    )
}

fn currents(summary: &ReplaySummary) -> String {
    let facts = &summary.currents;
    let most = facts.max_a.iter().copied().fold(0.0, f64::max);
    let rms = facts.rms_a.iter().copied().fold(0.0, f64::max);
    format!(
        "at most {} a coil and {} in all; rms at most {} a coil",
        si(most, "A"),
        si(facts.max_sum_a, "A"),
        si(rms, "A")
    )
}
