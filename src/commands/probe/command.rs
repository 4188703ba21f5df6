//! `probe`: field and gradient at given points.

use super::scan;
use super::scan::units;
use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::{ProbeRequest, ProbeTable, probe, quantities};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::bundle::atomic::{self, Overwrite};
use crate::bundle::table::SAMPLE_COLUMNS;
use crate::cli::args::{Tolerance, Writing};
use crate::cli::budget::{CostOrigin, allow};
use crate::cli::describe;
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::Sheet;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::count;
use crate::cli::start::{accuracy_check, begin, write_to};
use crate::cli::values::FileArgument;
use crate::design::Need;
use crate::field::components::Components;
use crate::scene::cost::{of_probe, of_steel};

/// How every table of points begins.
const HEADER: &str = "x_m,y_m,z_m,coil,";

/// Field and gradient per ampere of every coil at given points, or against a measured scan
///
/// Computes the field and its gradient per ampere of every coil at the points of a CSV table with
/// the columns x_m, y_m and z_m, directly and not through a map. The result is a CSV table with one
/// row a point and coil, in the points' order and coil by coil within a point. With --magnet-force the
/// force and torque on the design's magnet follow, its centre at the points; the pull of unpowered
/// steel is not part of them. With --format json the same columns come as arrays of one JSON
/// object.
///
/// With --compare a gaussmeter's scan takes the points' place: a CSV table with x_m, y_m, z_m, any of
/// bx_t, by_t, bz_t, dbx_dx_t_per_m to dbz_dz_t_per_m, and the currents that flowed, either as coil
/// and current_a or as current_0_a, current_1_a and so on. Reported are the residuals, the scale of each
/// coil with the line for `[array] gain`, a constant background, the pose of the sensor's frame, and
/// which parameter of the design would explain the residuals; --out takes the residuals as a table.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Reading, &[
    ("printf 'x_m,y_m,z_m\\n0.007,0.013,0.03\\n' | fluxform probe designs/seed.toml -",
     "one point from standard input"),
    ("printf 'x_m,y_m,z_m\\n0,0,0.03\\n' | fluxform probe designs/seed.toml - --components gz -q",
     "only dBz/dz, and no summary"),
    ("printf 'x_m,y_m,z_m\\n0,0.01,0.03\\n' | fluxform probe designs/seed.toml - --magnet-force",
     "the force on the magnet there too"),
    ("fluxform probe designs/seed_air.toml --compare designs/scan_example.csv --noise-t 2e-6",
     "a gaussmeter's scan against the design"),
]))]
pub struct Probe {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    pub(super) design: FileArgument,
    /// CSV table with the columns x_m, y_m, z_m; `-` for standard input
    #[arg(value_name = "POINTS", required_unless_present = "compare")]
    pub(super) points: Option<FileArgument>,
    /// Quantities reported at each point
    #[arg(long, value_enum, default_value_t = ComponentsArgument::All, conflicts_with = "compare")]
    components: ComponentsArgument,
    /// Report force and torque on the magnet too
    ///
    /// Six columns more, per ampere.
    #[arg(long, hide_short_help = true, conflicts_with = "compare")]
    pub(super) magnet_force: bool,
    /// Where the table goes; `-` is standard output [default: -, with --compare nowhere]
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<FileArgument>,
    #[command(flatten)]
    pub(super) scan: scan::command::ScanFlags,
    #[command(flatten)]
    pub(super) writing: Writing,
    #[command(flatten)]
    pub(super) tolerance: Tolerance,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ComponentsArgument {
    /// Field and gradient: twelve columns
    All,
    /// Gradient: nine columns
    Gradient,
    /// dBz/dz alone
    Gz,
}

/// Report on the table; with its columns where standard output holds nothing else.
#[derive(Serialize)]
struct ProbeSummary {
    schema_version: &'static str,
    fluxform_version: &'static str,
    design: String,
    inputs: Vec<Input>,
    points: usize,
    rows: usize,
    accuracy: BTreeMap<&'static str, StageAccuracy>,
    #[serde(skip_serializing_if = "Option::is_none")]
    columns: Option<BTreeMap<&'static str, Vec<f64>>>,
}

impl Probe {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        if let Some(scan) = &self.scan.compare {
            return self.compare(scan, printer);
        }
        let standard = FileArgument::Standard;
        let points = self.points.as_ref().unwrap_or(&standard);
        documents::one_standard_input([&self.design, points])?;
        let document = documents::design(&self.design, Need::PROBE, printer)?;
        let (points_m, points_input) = documents::points(points)?;
        if let Some(hint) = units::coordinates(&document.design, &points_m) {
            printer.warning(&hint);
        }
        let points = points_m.len();
        let components = match self.components {
            ComponentsArgument::All => Components::All,
            ComponentsArgument::Gradient => Components::Gradient,
            ComponentsArgument::Gz => Components::Gz,
        };
        let protected: Vec<PathBuf> = document.also_read().collect();
        let inputs = vec![document.input, points_input];
        let out = self.out.as_ref().unwrap_or(&standard);
        let overwrite =
            Overwrite::beginning(self.writing.force, HEADER, &inputs).protecting(protected);
        if let FileArgument::Path(path) = out
            && !atomic::is_stream(path)
        {
            overwrite.check(path).map_err(RunError::from)?;
        }
        let design = &document.design;
        let as_json = matches!(out, FileArgument::Standard) && printer.json();
        let quantities = || quantities(components, self.magnet_force).len();
        let columns = as_json.then(|| SAMPLE_COLUMNS.len() + quantities());
        allow(
            std::iter::once(of_probe(design, points, columns))
                .chain(of_steel(design, self.tolerance.tolerance)),
            CostOrigin::Document,
            printer,
        )?;
        let bar = begin(printer);
        let request = ProbeRequest {
            components,
            force: self.magnet_force,
            tolerance: self.tolerance.tolerance,
        };
        let table = probe(design, points_m, request, &bar)?;
        drop(bar);
        for warning in &table.warnings {
            printer.warning(warning);
        }
        let mut summary = ProbeSummary {
            schema_version: SCHEMA_VERSION,
            fluxform_version: FLUXFORM_VERSION,
            design: design.name.clone(),
            inputs,
            points,
            rows: table.rows(),
            accuracy: accuracy(&table),
            columns: None,
        };
        let place = match out {
            FileArgument::Standard if as_json => {
                summary.columns = Some(table.columns());
                Stream::Output
            }
            out => write_to(Some(out), &overwrite, printer, |out| table.write(out))?,
        };
        let json = printer.with_warnings(&summary);
        printer.summary(place, &json, || self.text(&summary))?;
        accuracy_check(&table.accuracy_missed)
    }

    fn text(&self, summary: &ProbeSummary) -> String {
        let mut sheet = Sheet::new(&format!(
            "{}: {} at {}",
            summary.design,
            count(summary.rows, "row"),
            count(summary.points, "point")
        ));
        let stages = summary.accuracy.iter().map(|(name, stage)| (*name, stage));
        sheet.line("accuracy", &describe::accuracy(stages));
        if let Some(FileArgument::Path(path)) = &self.out {
            sheet.line("written to", &path.display().to_string());
        }
        sheet.finish()
    }
}

fn accuracy(table: &ProbeTable) -> BTreeMap<&'static str, StageAccuracy> {
    let stage = |estimate, relative_to: &str, method: &str| StageAccuracy {
        estimate,
        relative_to: relative_to.to_owned(),
        method: method.to_owned(),
    };
    let relative_to = if table.relative_to_height {
        "the largest |grad B| at the point's height"
    } else {
        "|grad B| at the point"
    };
    let field = stage(table.relative_error, relative_to, &table.method);
    let force = table.force.clone().map(|stage| ("force", stage));
    let iron = table.iron_error.map(|estimate| {
        let to = "|B| of the nearest coil at the point";
        let how = "difference from the next coarser panels at up to 24 of the points, also beside and below the array, and what \
                   the solver and the evaluation leave";
        ("iron_at_points", stage(estimate, to, how))
    });
    let all = [Some(("field", field)), iron, force];
    let of_curve = table.of_curve.iter().cloned();
    all.into_iter().flatten().chain(of_curve).collect()
}
