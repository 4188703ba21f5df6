//! `sweep plan`: which designs a sweep computes.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::axis;
use super::plan::{PlanRequest, plan};
use crate::RunError;
use crate::bundle::atomic::Overwrite;
use crate::bundle::json::to_json;
use crate::bundle::sweep::{ArrayTask, Axis, Mode, PlanFile};
use crate::bundle::write::write_json;
use crate::cli::args::{Tolerance, Writing};
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, EVALUATIONS, page};
use crate::cli::layout::Sheet;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::count;
use crate::cli::values::FileArgument;
use crate::design::Need;
use crate::numerics::mixed_search::Settings;

/// Write down which designs a sweep computes
///
/// Every --set names a key of the design and its values, as FROM:TO:STEP or as a list; the sweep
/// holds every combination, the last --set varying fastest. TO belongs to a range when it lies
/// within 1e-9 STEP of a step; values are rounded to 12 digits. Texts and flags are listed like
/// numbers, lists as [0,0],[5,0]. Of several [[iron]] a key names one by its index from 0, as in
/// iron.0.size_mm=[10,40,40],[12,40,40]. The plan carries the design's text and a digest of itself, so
/// that nothing else is needed to run it but the B-H tables that the design names.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Writing, &[
    ("fluxform sweep plan designs/seed_air.toml --set wire.diameter_mm=0.5:1.0:0.05 --out wires.json",
     "eleven wires"),
    ("fluxform sweep plan designs/seed_air.toml --set coil.length_mm=50:100:25 \\\n    \
      --set limits.resistance_max_ohm=4,6,8 --out - > limits.json",
     "three lengths, each under three limits"),
    ("fluxform sweep plan designs/seed_air.toml --optimize \\\n    --set limits.resistance_max_ohm=3:9:0.5 --out best.json",
     "the best coil of each resistance"),
    ("fluxform sweep plan designs/seed_search.toml --for shapes/flat.toml shapes/wedge.toml \\\n    \
      --set array.rows=2,3,4 --set limits.settling_max_ms=60:120:20 --out arrays.json",
     "the best array of every number of rows and settling time"),
]))]
pub struct Plan {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// A key and its values, KEY=FROM:TO:STEP (TO included) or KEY=A,B,C; may be given several times
    #[arg(long = "set", value_name = "KEY=VALUES", required = true, value_parser = axis::parse)]
    axes: Vec<Axis>,
    /// Where the plan goes; `-` is standard output
    #[arg(long, value_name = "FILE", default_value = "plan.json")]
    out: FileArgument,
    /// Find the best coil within each design's limits, as `optimize` does, instead of evaluating
    /// the coil as given
    #[arg(long)]
    optimize: bool,
    /// With --optimize: whole layers and whole turns per layer
    #[arg(long, requires = "optimize")]
    wound: bool,
    /// Search the array that renders these shapes best, as `optimize --for` does
    #[arg(long = "for", value_name = "SHAPE", num_args = 1..)]
    shapes: Vec<PathBuf>,
    #[arg(long, help = EVALUATIONS, hide_short_help = true, value_name = "N", requires = "shapes", default_value_t = Settings::default().evaluations as u32,
          value_parser = clap::value_parser!(u32).range(1..))]
    evaluations: u32,
    /// Where random numbers begin, together with a point's index; evaluating draws none
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    writing: Writing,
    #[command(flatten)]
    tolerance: Tolerance,
}

#[derive(Serialize)]
struct PlanSummary<'a> {
    design: &'a str,
    mode: Mode,
    seed: u64,
    points: u64,
    axes: Vec<AxisSummary<'a>>,
    plan: String,
    plan_sha256: &'a str,
}

#[derive(Serialize)]
struct AxisSummary<'a> {
    key: &'a str,
    values: usize,
}

impl Plan {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        // As a rule of clap it would drop what --wound and --evaluations require.
        if self.optimize && !self.shapes.is_empty() {
            let both =
                "--optimize cannot be used with --for: one finds a coil, the other a whole array";
            return Err(Failure::Usage(both.to_owned()));
        }
        let array = (!self.shapes.is_empty()).then(|| ArrayTask {
            shapes: self
                .shapes
                .iter()
                .map(|path| path.display().to_string())
                .collect(),
            evaluations: self.evaluations as usize,
        });
        let request = PlanRequest {
            axes: self.axes.clone(),
            mode: match (self.optimize, self.wound) {
                _ if array.is_some() => Mode::OptimizeFor,
                (false, _) => Mode::Evaluate,
                (true, false) => Mode::Optimize,
                (true, true) => Mode::OptimizeWound,
            },
            array,
            seed: self.seed,
            tolerance: self.tolerance.tolerance,
        };
        request
            .check()
            .map_err(|message| Failure::Usage(format!("--set: {message}")))?;
        let document = documents::design(&self.design, Need::SWEEP, printer)?;
        let plan = plan(&document.design, document.text, document.input, &request)?;
        let place = match &self.out {
            FileArgument::Standard => {
                let text = to_json(&plan)?;
                printer.data(|out| out.write_all(&text))?;
                Stream::Error
            }
            FileArgument::Path(path) => {
                let overwrite = Overwrite::same_bytes(self.writing.force, &plan.inputs);
                write_json(path, &overwrite, &plan).map_err(RunError::from)?;
                Stream::Output
            }
        };
        let json = PlanSummary {
            design: &plan.design,
            mode: plan.mode,
            seed: plan.seed,
            points: plan.points,
            axes: plan
                .axes
                .iter()
                .map(|axis| AxisSummary {
                    key: &axis.key,
                    values: axis.values.len(),
                })
                .collect(),
            plan: self.out.as_given().display().to_string(),
            plan_sha256: &plan.plan_sha256,
        };
        let json = printer.with_warnings(&json);
        printer.summary(place, &json, || self.text(&plan))
    }

    fn text(&self, plan: &PlanFile) -> String {
        let designs = count(plan.points as usize, "design");
        let mut sheet = Sheet::new(&format!("{}: a sweep of {designs}", plan.design));
        let axes: Vec<String> = plan
            .axes
            .iter()
            .map(|axis| format!("{}: {}", axis.key, count(axis.values.len(), "value")))
            .collect();
        sheet.line("varies", &axes.join("\n"));
        if let FileArgument::Path(path) = &self.out {
            sheet.line("written to", &path.display().to_string());
        }
        sheet.finish()
    }
}
