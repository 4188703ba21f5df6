//! `calibrate`: maps, points, force constant and currents of objects, one bundle each.

use clap::Args;
use serde::Serialize;

use super::BundleReport;
use super::CalibrateOptions;
use super::CalibrateReport;
use super::DEFAULT_REACH_M;
use super::plan::{Cost, Done, Plan, plan};
use super::text::summary;
use super::{run, run_shard};
use crate::bundle::artefact::is_nameable;
use crate::cli::args::{
    ErrorFlags, ForceFlags, SurfaceFlags, Tolerance, UncertaintyFlags, WeightsFlag, Writing,
};
use crate::cli::budget::{CostOrigin, allow, cost_origin};
use crate::cli::documents::{self, DesignDocument};
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::Sheet;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{count, error, force, mm, percent};
use crate::cli::start::accuracy_check;
use crate::cli::start::begin;
use crate::cli::start::folder;
use crate::cli::values::{self, FileArgument};
use crate::commands::lambda::LambdaOptions;
use crate::commands::lambda::command::{AtFlag, CriterionFlags, costs_of, rendered, well_placed};
use crate::design::message_text::shown_path;
use crate::design::{Design, Need};
use crate::scene::cached_field::SteelPart;
use crate::scene::cost::{self, Components, of_map, of_steel};
use crate::scene::shard::Shard;
use crate::scene::sources::{DesignSource, ShapeSource};
use crate::scene::tolerances::ErrorTarget;
use crate::shape::document::SurfaceSource;

/// The main job: maps, points, force constant and currents, one bundle per shape
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
    /// Reach of the maps beyond the object [default: 20mm]
    ///
    /// How far from the object's points the maps reach within the workspace, like 2cm.
    #[arg(long, value_name = "LENGTH", value_parser = values::length, allow_hyphen_values = true)]
    reach: Option<f64>,
    /// Compute the field of coils and steel again, and remove what earlier runs cached of it in
    /// OUT/<design>/.fluxform-cache
    #[arg(long, hide_short_help = true)]
    no_cache: bool,
    /// Solve only part I of N of the coils' drives, into the cache, counted from 1
    ///
    /// Of more than 16 coupled cored coils: the drives are solved in blocks, which any number of runs on one
    /// machine or many that share OUT may solve before one without --shard. That one then writes the
    /// same bytes as alone; blocks that are missing, damaged or of another build it solves itself. Part
    /// 1 decides how finely all are solved: start it first.
    #[arg(
        long,
        hide_short_help = true,
        value_name = "I/N",
        value_parser = Shard::parse,
        conflicts_with_all = ["no_cache", "explain"]
    )]
    shard: Option<Shard>,
    /// Report the plan and its cost first
    ///
    /// With the reason for every part that is left out, and the error that this costs.
    #[arg(long)]
    explain: bool,
    /// Leave out report.html and the folder plots
    #[arg(long)]
    no_report: bool,
    /// Add the folder vtk, which ParaView opens
    ///
    /// The object with the forces at its points, requested and given; the coils with their currents; and
    /// B at these currents over the workspace.
    #[arg(long)]
    vtk: bool,
    #[command(flatten)]
    criterion: CriterionFlags,
    #[command(flatten)]
    at: AtFlag,
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
            default_error: Some(ErrorTarget::DEFAULT),
            ..self.criterion.options(self.at.at, self.tolerance.tolerance)
        };
        let (document, shapes) = documents::design_and_shapes(
            &self.design,
            Need::CALIBRATE,
            &self.shapes,
            &self.surface,
            printer,
        )?;
        self.nameable(&document, &shapes)?;
        lambda.check_force(shapes.iter().map(|shape| &shape.document))?;
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
            vtk: self.vtk,
        };
        if let Some(shard) = self.shard {
            return solve_shard(source, shard, &options, printer);
        }
        let bar = begin(printer);
        let plan = self
            .explain
            .then(|| plan(source, &shapes, &options, &bar))
            .transpose()?;
        drop(bar);
        if let Some(plan) = plan.as_ref().filter(|_| !printer.json()) {
            printer.summary(Stream::Output, plan, || explained(plan))?;
        }
        allow(
            costs_of(design, &shapes, &options.lambda)
                .into_iter()
                .chain([map_cost(design, &shapes, &options)]),
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
        let bundles = || report.bundles.iter();
        let missed = |b: &BundleReport| b.lambda.accuracy_missed.clone();
        let missed: Vec<String> = bundles().flat_map(missed).collect();
        accuracy_check(&missed)?;
        bundles().try_for_each(|bundle| well_placed(&bundle.lambda))?;
        let constants: Vec<(&str, Option<f64>)> = bundles()
            .map(|b| (b.manifest.shape.as_str(), b.lambda.file.lambda_n_per_m))
            .collect();
        rendered(&constants)
    }
}

impl Calibrate {
    /// Refuses files that a bundle could not name among its inputs, so that `verify` would not find them.
    fn nameable(&self, document: &DesignDocument, shapes: &[ShapeSource]) -> Result<(), Failure> {
        let given = std::iter::once(&self.design).chain(&self.shapes);
        let given = given.map(|file| file.as_given().to_path_buf());
        let surfaces = shapes
            .iter()
            .filter_map(|shape| match &shape.document.source {
                SurfaceSource::File { path, .. } => Some(path.clone()),
                SurfaceSource::Primitive(_) => None,
            });
        let mut all = given.chain(document.also_read()).chain(surfaces);
        match all.find(|path| !is_nameable(path)) {
            None => Ok(()),
            Some(path) => Err(Failure::Input(format!(
                "{}: a bundle names its inputs, which takes a path in UTF-8 of at most 4096 bytes without \
                 line breaks and other control characters; rename the file or its folder",
                shown_path(&path)
            ))),
        }
    }
}

#[derive(Serialize)]
struct ShardSummary<'a> {
    design: &'a str,
    #[serde(flatten)]
    part: SteelPart,
}

/// One part of the drives, and what was done.
fn solve_shard(
    source: DesignSource,
    shard: Shard,
    options: &CalibrateOptions,
    printer: &Printer,
) -> Result<(), Failure> {
    let design = source.design;
    let steel = of_steel(design, options.lambda.tolerance_for(design));
    allow(steel, CostOrigin::Document, printer)?;
    let bar = begin(printer);
    let part = run_shard(source, shard, options, &bar)?;
    drop(bar);
    let summary = ShardSummary {
        design: &design.name,
        part,
    };
    let json = printer.with_warnings(&summary);
    let text = || {
        let blocks = count(part.of, "block");
        let mut sheet = Sheet::new(&format!(
            "{}: {blocks} of {} of drives",
            design.name, part.blocks
        ));
        let before = part.of - part.solved;
        sheet.line("solved", &format!("{} now, {before} before", part.solved));
        sheet.finish()
    };
    printer.summary(Stream::Output, &json, text)
}

fn explained(plan: &Plan) -> String {
    let mut sheet = Sheet::new("plan");
    for term in &plan.terms {
        let (does, without) = match term.done {
            Done::Computed => ("computed", "without it about"),
            Done::Kept => ("kept", ""),
            Done::LeftOut => ("left out", "costs about"),
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
    let points: usize = plan.shapes.iter().map(|shape| shape.points).sum();
    let mut costs = format!(
        "are the largest at {} of {}",
        plan.cost_points,
        count(points, "point")
    );
    if plan.cost_coils < plan.coils {
        costs += &format!(
            ", of the {} coils in the middle of the {}",
            plan.cost_coils, plan.coils
        );
    }
    sheet.line("costs", &costs);
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

/// The map of the whole workspace.
fn map_cost(design: &Design, shapes: &[ShapeSource], options: &CalibrateOptions) -> cost::Cost {
    let components = if options.vtk {
        Components::All
    } else if options.requests_vector(shapes) {
        Components::Force
    } else {
        Components::Gz
    };
    let mut map = of_map(design, components);
    if !options.vtk {
        // An object may need a small part of it, which is checked with its points.
        map.bytes = 0.0;
    }
    map
}
