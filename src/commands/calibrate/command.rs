//! `calibrate`: maps, points, force constant and currents of objects, one bundle each.

use std::collections::BTreeSet;
use std::path::Path;

use clap::Args;

use super::BundleReport;
use super::CalibrateOptions;
use super::CalibrateReport;
use super::DEFAULT_REACH_M;
use super::plan::{Cost, Done, Plan, plan};
use super::run;
use crate::bundle::lambda_file::{LambdaFile, WorkingPointForces};
use crate::bundle::manifest::Manifest;
use crate::cli::args::{
    ErrorFlags, ForceFlags, SurfaceFlags, Tolerance, UncertaintyFlags, WeightsFlag, Writing,
};
use crate::cli::budget::{allow, cost_origin, costs};
use crate::cli::describe;
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::{Sheet, headed_table};
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{
    bytes, count, error, force, length_error, mm, number, number_to, percent,
};
use crate::cli::start::accuracy_check;
use crate::cli::start::begin;
use crate::cli::start::folder;
use crate::cli::values::{self, FileArgument};
use crate::commands::lambda::LambdaOptions;
use crate::commands::lambda::command::{CriterionFlags, rendered, well_placed};
use crate::design::{Design, Need};
use crate::digits::with_error;
use crate::scene::cost::{Components, of_map};
use crate::scene::sources::DesignSource;

/// The main job: maps, points, force constant and currents, one bundle a shape
///
/// For every shape: samples its surface, finds the force constant and the static currents from
/// forces computed at its points, tabulates the part of the maps that the object needs, and writes
/// all of it as one bundle, OUT/<design>/<shape>/, that a runtime loads. A bundle is whole before
/// the next begins. What the object does not need is left out of the map, and what that costs is
/// reported.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Writing, &[
    ("fluxform calibrate designs/seed.toml shapes/flat.toml shapes/half_sphere.toml",
     "two objects; the bundles go to results/seed/"),
    ("fluxform calibrate designs/seed.toml shapes/wedge.stl --unit mm --translate 0,0,30",
     "a surface given directly; its bundle is called wedge"),
    ("fluxform calibrate designs/seed_air.toml shapes/flat.toml --explain",
     "report first what will be computed, what left out, and what that costs"),
    ("fluxform calibrate designs/seed_air.toml shapes/flat.toml --error 1% --refine --out budget",
     "points, nodes and tolerances for an error of the force of 1 %"),
    ("fluxform calibrate designs/seed.toml shapes/flat.toml --criterion linear --out linear",
     "another criterion beside it; --force would replace what is there"),
]))]
pub struct Calibrate {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// Shape files (TOML) or surfaces (STL, OBJ, PLY, 3MF, STEP, ...); no two of the same name
    #[arg(value_name = "SHAPE", required = true)]
    shapes: Vec<FileArgument>,
    /// Folder under which <design>/<shape>/ is written
    #[arg(long, value_name = "DIR", default_value = "results")]
    out: FileArgument,
    /// How far from the object's points the maps reach within the workspace, like 2cm [default:
    /// 20mm]
    #[arg(long, value_name = "LENGTH", value_parser = values::length, allow_hyphen_values = true)]
    reach: Option<f64>,
    /// Compute the field of coils and steel again, and remove what earlier runs kept of it in
    /// OUT/<design>/.fluxform-cache
    #[arg(long, hide_short_help = true)]
    no_cache: bool,
    /// Report the plan and its cost first
    ///
    /// With the reason for every part that is left out, and the error that this costs.
    #[arg(long)]
    explain: bool,
    /// Leave out report.html and the folder plots
    #[arg(long)]
    no_report: bool,
    #[command(flatten)]
    criterion: CriterionFlags,
    #[command(flatten)]
    requested: ForceFlags,
    #[command(flatten)]
    uncertain: UncertaintyFlags,
    #[command(flatten)]
    error: ErrorFlags,
    #[command(flatten)]
    weights: WeightsFlag,
    #[command(flatten)]
    writing: Writing,
    #[command(flatten)]
    tolerance: Tolerance,
    #[command(flatten)]
    surface: SurfaceFlags,
}

impl Calibrate {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let out = folder(&self.out)?;
        let lambda = LambdaOptions {
            force: self.requested.into(),
            uncertainty: self.uncertain.into(),
            weights: self.weights.weights,
            error: self.error.target(),
            ..self.criterion.options(self.tolerance.tolerance)
        };
        let (document, shapes) = documents::design_and_shapes(
            &self.design,
            Need::CALIBRATE,
            &self.shapes,
            &self.surface,
            printer,
        )?;
        let design = &document.design;
        let source = DesignSource {
            design,
            text: &document.text,
            input: &document.input,
        };
        let options = CalibrateOptions {
            out,
            force: self.writing.force,
            lambda,
            keep: !self.no_cache,
            reach_m: self.reach.unwrap_or(DEFAULT_REACH_M),
            page: !self.no_report,
        };
        let bar = begin(printer);
        let plan = self
            .explain
            .then(|| plan(source, &shapes, &options, &bar))
            .transpose()?;
        drop(bar);
        if let Some(plan) = plan.as_ref().filter(|_| !printer.json()) {
            printer.summary(Stream::Output, plan, || explained(plan))?;
        }
        let components = if options.requests_vector(&shapes) {
            Components::Force
        } else {
            Components::Gz
        };
        allow(
            costs(design, &shapes, self.tolerance.tolerance)
                .into_iter()
                .chain([of_map(design, components)]),
            cost_origin(&shapes),
            printer,
        )?;
        let bar = begin(printer);
        let mut report = run(source, &shapes, &options, &bar)?;
        drop(bar);
        warn(&report, printer);
        report.plan = plan;
        let json = printer.with_warnings(&report);
        let folder = options.out.join(&design.name);
        printer.summary(Stream::Output, &json, || summary(design, &report, &folder))?;
        let missed = |b: &BundleReport| b.lambda.accuracy_missed.clone();
        let missed: Vec<String> = report.bundles.iter().flat_map(missed).collect();
        accuracy_check(&missed)?;
        report
            .bundles
            .iter()
            .try_for_each(|bundle| well_placed(&bundle.lambda))?;
        let constants: Vec<(&str, Option<f64>)> = report
            .bundles
            .iter()
            .map(|b| (b.manifest.shape.as_str(), b.lambda.file.lambda_n_per_m))
            .collect();
        rendered(&constants)
    }
}

fn explained(plan: &Plan) -> String {
    let mut sheet = Sheet::new("plan");
    for term in &plan.terms {
        let (does, without) = match term.done {
            Done::Computed => ("computed", "without it up to"),
            Done::Kept => ("kept", ""),
            Done::LeftOut => ("left out", "costs up to"),
        };
        let cost = match term.cost {
            None if term.done == Done::LeftOut => "; what that costs is not known".to_owned(),
            None => String::new(),
            Some(Cost::OfTheForce(0.0)) => "; costs nothing".to_owned(),
            Some(Cost::OfTheForce(part)) => format!(
                "; {without} {} of the largest coil's force, where the tolerance is {}",
                percent(part),
                error(plan.tolerance)
            ),
            Some(Cost::ForceN(n)) => format!("; {without} {}", force(n)),
        };
        sheet.line(does, &format!("{}: {}{cost}", term.what, term.why));
    }
    if plan.cost_coils < plan.coils {
        sheet.line(
            "costs",
            &format!(
                "are those of the {} coils in the middle of the {}",
                plan.cost_coils, plan.coils
            ),
        );
    }
    for shape in &plan.shapes {
        let nodes = |n: [usize; 3]| format!("{} x {} x {}", n[0], n[1], n[2]);
        sheet.line(
            "map",
            &format!(
                "{}: {} of {} nodes, z {} to {}, for {}",
                shape.shape,
                nodes(shape.nodes),
                nodes(shape.workspace_nodes),
                mm(shape.z_m[0]),
                mm(shape.z_m[1]),
                count(shape.points, "point")
            ),
        );
    }
    sheet.gap();
    sheet.finish()
}

fn warn(report: &CalibrateReport, printer: &Printer) {
    for bundle in &report.bundles {
        let shape = &bundle.manifest.shape;
        for warning in &bundle.lambda.warnings {
            printer.warning(&format!("{shape}: {warning}"));
        }
    }
}

fn size(manifest: &Manifest) -> u64 {
    manifest.files.iter().map(|file| file.bytes).sum()
}

fn summary(design: &Design, report: &CalibrateReport, folder: &Path) -> String {
    let mut sheet = Sheet::new(&format!(
        "{} on {} ({})",
        count(report.bundles.len(), "shape"),
        design.name,
        describe::array(design)
    ));
    for bundle in &report.bundles {
        let file = &bundle.lambda.file;
        let requested = file.headline.as_ref().and_then(describe::requested_error);
        if let Some(requested) = requested {
            sheet.line(
                "error",
                &format!("{}: {}", file.shape, requested.replace('\n', "\n  ")),
            );
        }
    }
    sheet.gap();
    sheet.raw(&shapes_table(report));
    sheet.gap();
    sheet.raw(&constants_table(report));
    sheet.gap();
    let Some(first) = report.bundles.first() else {
        return sheet.finish();
    };
    let file = &first.lambda.file;
    sheet.line(
        "lambda",
        &format!(
            "chosen by {}; errors are of the force, relative to the rms force",
            file.criterion.described(&percent(file.jnd))
        ),
    );
    force_lines(&mut sheet, report);
    sheet.line("accuracy", &accuracies(report));
    if let Some(steel) = working_points(report) {
        sheet.line("steel", &steel);
    }
    let left_out: BTreeSet<String> = report
        .bundles
        .iter()
        .flat_map(|bundle| {
            let parts = describe::left_out(&bundle.manifest.left_out);
            let shape = &bundle.manifest.shape;
            parts
                .lines()
                .map(|part| with_shape(shape, part, report))
                .collect::<Vec<_>>()
        })
        .collect();
    let left_out: Vec<String> = left_out.into_iter().collect();
    sheet.line("left out", &left_out.join("\n"));
    let total = report.bundles.iter().map(|b| size(&b.manifest)).sum();
    sheet.line(
        "written to",
        &format!(
            "{}: {}, {}",
            folder.display(),
            count(report.bundles.len(), "bundle"),
            bytes(total)
        ),
    );
    let felt = of_shapes(report, |file| {
        Some(describe::felt(file.headline.as_ref()?.felt.as_ref()?))
    });
    if !felt.is_empty() {
        sheet.line("finger", &felt.join("\n"));
    }
    sheet.finish()
}

/// The force of every shape: how much is given, what the computation adds, where it points, what is uncertain.
fn force_lines(sheet: &mut Sheet, report: &CalibrateReport) {
    let given = of_shapes(report, |file| {
        Some(describe::given_force(file.headline.as_ref()?))
    });
    sheet.line("given", &given.join("\n"));
    let errors = of_shapes(report, |file| {
        Some(describe::force_error(file.headline.as_ref()?))
    });
    sheet.line("computed", &errors.join("\n"));
    sheet.line("sideways", &sideways(report));
    let uncertain = of_shapes(report, |file| {
        file.uncertainty.as_ref().map(describe::uncertainty)
    });
    if !uncertain.is_empty() {
        sheet.line("uncertain", &uncertain.join("\n"));
    }
}

/// The lines of every shape, each beginning with its name.
fn of_shapes(
    report: &CalibrateReport,
    text: impl Fn(&LambdaFile) -> Option<String>,
) -> Vec<String> {
    let files = report.bundles.iter().map(|bundle| &bundle.lambda.file);
    files
        .filter_map(|file| {
            Some(format!(
                "{}: {}",
                file.shape,
                text(file)?.replace('\n', "\n  ")
            ))
        })
        .collect()
}

/// A line about every shape stands for itself; others begin with their shape.
fn with_shape(shape: &str, part: &str, report: &CalibrateReport) -> String {
    let of_all = report.bundles.iter().all(|bundle| {
        describe::left_out(&bundle.manifest.left_out)
            .lines()
            .any(|other| other == part)
    });
    if of_all {
        part.to_owned()
    } else {
        format!("{shape}: {part}")
    }
}

/// The chosen force constants, one row per shape.
fn shapes_table(report: &CalibrateReport) -> String {
    let or_none = |value: Option<String>| value.unwrap_or_else(|| "none".to_owned());
    let row = |bundle: &BundleReport| {
        let file = &bundle.lambda.file;
        vec![
            ("shape", file.shape.clone()),
            ("points", file.points.to_string()),
            ("lambda N/m", or_none(lambda(file))),
            (
                "rms mN",
                or_none(file.rms_error_n.map(|n| number(n * 1000.0))),
            ),
            ("relative", or_none(file.relative_rms_error.map(percent))),
            (
                "worst mN",
                or_none(file.worst_error_n.map(|n| number(n * 1000.0))),
            ),
            ("at limit", or_none(at_limit(bundle))),
        ]
    };
    headed_table(report.bundles.iter().map(row))
}

/// lambda with its error, N/m.
fn lambda(file: &LambdaFile) -> Option<String> {
    let headline = file.headline.as_ref();
    let known = headline.map(|of| with_error(of.lambda_n_per_m, of.lambda_error_n_per_m));
    known.or_else(|| file.lambda_n_per_m.map(number))
}

/// Every force constant, one row per shape.
fn constants_table(report: &CalibrateReport) -> String {
    let row = |bundle: &BundleReport| {
        let file = &bundle.lambda.file;
        let named = file.constants.named().into_iter().map(|one| {
            let lambda = one.lambda_n_per_m.map_or_else(|| "none".to_owned(), number);
            (one.name, lambda)
        });
        [("lambda N/m", file.shape.clone())]
            .into_iter()
            .chain(named)
            .collect()
    };
    headed_table(report.bundles.iter().map(row))
}

/// How many coils carry all they may, and whether their sum does.
fn at_limit(bundle: &BundleReport) -> Option<String> {
    let currents = bundle.lambda.file.currents_a.as_ref()?;
    let limits = &bundle.manifest.limits;
    let bound = currents
        .iter()
        .zip(limits.current_min_a.iter().zip(&limits.current_max_a))
        .filter(|(current, (min, max))| current >= max || (current <= min && **min < 0.0))
        .count();
    // Rounding may leave the sum a few bits below its limit.
    let sum: f64 = currents.iter().sum();
    let total = limits.total_current_max_a;
    let full = total.is_some_and(|total| sum >= total * (1.0 - 1e-12));
    let coils = count(bound, "coil");
    Some(if full { format!("{coils}, sum") } else { coils })
}

/// How far forces along the B-H curve are off those added up, where the design gives a curve.
fn working_points(report: &CalibrateReport) -> Option<String> {
    let points: Vec<&WorkingPointForces> = report
        .bundles
        .iter()
        .filter_map(|bundle| bundle.lambda.file.working_point.as_ref())
        .collect();
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
    (!points.is_empty()).then(|| {
        format!(
            "along its B-H curve forces {} off those added up at most; |B| up to {} T",
            percent(largest(&mut points.iter().map(|p| p.deviation_from_linear))),
            number_to(
                largest(&mut points.iter().flat_map(|p| p.peak_field_t.iter().copied())),
                4
            )
        )
    })
}

/// The sideways force that the static currents of every shape leave, and feedback.
fn sideways(report: &CalibrateReport) -> String {
    let lines = report.bundles.iter().filter_map(|bundle| {
        let (file, of) = (&bundle.lambda.file, bundle.lambda.file.sideways?);
        Some(format!(
            "{}: {} of the push, {:.0} degrees off; with feedback {}",
            file.shape,
            percent(of.static_share),
            of.static_median_deg,
            percent(of.feedback_share)
        ))
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// The largest error of each stage over all shapes.
fn accuracies(report: &CalibrateReport) -> String {
    let largest = |stage: &str| {
        let stages = report.bundles.iter();
        stages
            .filter_map(|bundle| bundle.manifest.accuracy.get(stage))
            .map(|accuracy| accuracy.estimate)
            .fold(0.0, f64::max)
    };
    let between = report
        .bundles
        .iter()
        .map(|bundle| bundle.manifest.map.interpolation.largest_error)
        .fold(0.0, f64::max);
    let pull = largest("passive_force");
    let pull = if pull > 0.0 {
        format!("; steel's pull {} of itself", error(pull))
    } else {
        String::new()
    };
    format!(
        "heights {}; forces {}, map nodes {}, between nodes {} of the largest gradient at their \
         height{pull}",
        length_error(largest("points")),
        error(largest("forces")),
        error(largest("map")),
        error(between)
    )
}
