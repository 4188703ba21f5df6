//! `map`: gradient maps over the workspace.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::mag_manip::{FEWEST_NODES, MagManipRequest, MultipolesMade, VectorFieldMade};
use super::{MapReport, MapRequest, run};
use crate::bundle::manifest::MapSidecar;
use crate::bundle::write::{MAP_FILES, MapFormats};
use crate::cli::args::{Tolerance, Writing};
use crate::cli::budget::{CostOrigin, allow};
use crate::cli::describe;
use crate::cli::documents;
use crate::cli::failure::{Failure, Wish};
use crate::cli::help::{Codes, page};
use crate::cli::layout::Sheet;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{bytes, count, error, mm, percent};
use crate::cli::start::accuracy_check;
use crate::cli::start::begin;
use crate::cli::start::folder;
use crate::cli::values::{self, FileArgument};
use crate::design::{Design, Need, Steel};
use crate::map::Components;
use crate::map::coupled_map::TableReport;
use crate::scene::cost;

/// Tabulate the gradient maps of every coil over the workspace
///
/// Tabulates the gradient of every coil's field per ampere over the workspace grid of the design
/// and writes map.npz (NumPy, little-endian doubles with axes and units) and map.json beside it;
/// on request also map.csv and map.vti, which ParaView opens. The error at the nodes and the error
/// of interpolating between them are told; of arrays with coupled steel cores also the compact form
/// that stood for the steel, and how far it was seen to be off.
///
/// --vfield and --mpem write calibration files of mag_manip, ETH Zurich's runtime for magnetic
/// manipulation: the field on nodes that span the workspace and one step more, whose error between
/// the nodes is told, and sources on the coils' axes, whose error at places that the fit did not
/// see is told; the latter ends with code 4 where it exceeds --mpem-tolerance.
#[derive(Debug, Args)]
#[command(after_help = page(Codes::Writing, &[
    ("fluxform map designs/seed.toml --out maps", "dBz/dz of all coils"),
    ("fluxform map designs/seed_air.toml --out maps_vtk --vtk --tolerance 1e-6",
     "for ParaView, less accurate"),
    ("fluxform map designs/seed.toml --out maps_mm --vfield maps_mm/nodes.yaml --mpem maps_mm/mpem.yaml",
     "for mag_manip"),
    ("fluxform tabulate designs/seed.toml --out maps --format json --force",
     "replace what is there, with a summary for programs"),
]))]
pub struct Map {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// What the map holds
    #[arg(long, value_enum, default_value_t = Wanted::Gz)]
    components: Wanted,
    /// Currents at which cores with a B-H curve are mapped together too, A: one for all coils, or
    /// one a coil [default: the rated currents]
    #[arg(
        long,
        value_name = "A,...",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    currents: Vec<f64>,
    /// Folder of the files [default: results/<design>]
    #[arg(long, value_name = "DIR")]
    out: Option<FileArgument>,
    /// Write map.csv too
    #[arg(long)]
    csv: bool,
    /// Write map.vti too
    #[arg(long)]
    vtk: bool,
    /// Write the field per ampere on nodes for mag_manip's ForwardModelLinearVField too
    #[arg(long, value_name = "FILE.yaml")]
    vfield: Option<FileArgument>,
    /// Nodes of --vfield along each axis, 6 or more; mag_manip needs as many along all three
    /// [default: the most that the workspace has along one, but no more than 31]
    #[arg(long, value_name = "N", requires = "vfield", value_parser = vfield_nodes)]
    vfield_nodes: Option<usize>,
    /// Write multipole sources fitted to the field for mag_manip's ForwardModelMPEM too
    #[arg(long, value_name = "FILE.yaml")]
    mpem: Option<FileArgument>,
    /// Allowed error of --mpem, of field and gradient relative to the largest at each height,
    /// 1e-15 to 1e-1: fewer sources do for a larger one [default: 1e-3]
    #[arg(long, value_name = "T", requires = "mpem", value_parser = values::tolerance)]
    mpem_tolerance: Option<f64>,
    #[command(flatten)]
    writing: Writing,
    #[command(flatten)]
    tolerance: Tolerance,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Wanted {
    /// dBz/dz
    Gz,
    /// dBz/dz and the gradient tensor
    Gradient,
    /// dBz/dz, the gradient tensor and the field
    All,
}

#[derive(Serialize)]
struct MapSummary<'a> {
    #[serde(flatten)]
    sidecar: &'a MapSidecar,
    folder: String,
    point_coils: usize,
    distinct_radii: usize,
    tabulated: bool,
    /// The compact form of a coupled array's steel.
    #[serde(skip_serializing_if = "Option::is_none")]
    table: Option<TableSummary>,
    /// The field on nodes for mag_manip.
    #[serde(skip_serializing_if = "Option::is_none")]
    vfield: Option<VectorFieldSummary>,
    /// The multipole sources for mag_manip.
    #[serde(skip_serializing_if = "Option::is_none")]
    mpem: Option<MultipolesSummary>,
}

/// The field on nodes that mag_manip reads.
#[derive(Serialize)]
struct VectorFieldSummary {
    file: String,
    nodes: usize,
    step_m: [f64; 3],
    checks: usize,
    field_error: f64,
    gradient_error: f64,
}

impl VectorFieldSummary {
    fn of(made: &VectorFieldMade) -> Self {
        Self {
            file: made.path.display().to_string(),
            nodes: made.nodes,
            step_m: made.steps_m,
            checks: made.checks,
            field_error: made.accuracy[0].estimate,
            gradient_error: made.accuracy[1].estimate,
        }
    }

    fn told(&self) -> String {
        let steps: Vec<String> = self.step_m.iter().map(|step| mm(*step)).collect();
        format!(
            "{}: {n} x {n} x {n} nodes {} apart, one step beyond the workspace",
            self.file,
            steps.join(", "),
            n = self.nodes,
        )
    }
}

/// The multipole sources that mag_manip reads.
#[derive(Serialize)]
struct MultipolesSummary {
    file: String,
    /// Of one coil.
    sources: usize,
    /// Of one coil.
    coefficients: usize,
    condition: f64,
    points: usize,
    checks: usize,
    field_error: f64,
    gradient_error: f64,
    tolerance: f64,
    tolerance_met: bool,
}

impl MultipolesSummary {
    fn of(made: &MultipolesMade) -> Self {
        Self {
            file: made.path.display().to_string(),
            sources: made.sources(),
            coefficients: made.coefficients(),
            condition: made.condition(),
            points: made.points,
            checks: made.checks,
            field_error: made.accuracy[0].estimate,
            gradient_error: made.accuracy[1].estimate,
            tolerance: made.tolerance,
            tolerance_met: made.reached(),
        }
    }

    fn told(&self) -> String {
        format!(
            "{}: {} with {} a coil, fitted at {} (condition {:.0e}), {} {}",
            self.file,
            count(self.sources, "source"),
            count(self.coefficients, "coefficient"),
            count(self.points, "point"),
            self.condition,
            if self.tolerance_met {
                "within"
            } else {
                "NOT within"
            },
            error(self.tolerance)
        )
    }
}

/// Nodes along each axis.
fn vfield_nodes(text: &str) -> Result<usize, String> {
    let nodes = text.parse().ok().filter(|n| *n >= FEWEST_NODES);
    nodes.ok_or_else(|| format!("expected a whole number, {FEWEST_NODES} or more"))
}

/// The compact form that stood for the steel of a coupled array.
#[derive(Serialize)]
struct TableSummary {
    /// From this height up; below it, and where it is null, places are sampled one by one.
    from_m: Option<f64>,
    samples: usize,
    nodes: [usize; 3],
    coefficients: usize,
    bytes: u64,
    checks: usize,
    certificate: f64,
}

impl TableSummary {
    fn of(table: &TableReport) -> Self {
        Self {
            from_m: table.from_m,
            samples: table.samples,
            nodes: table.degrees,
            coefficients: table.coefficients,
            bytes: (table.coefficients * size_of::<f64>()) as u64,
            checks: table.checks,
            certificate: table.certificate,
        }
    }

    fn told(&self) -> String {
        let Some(from_m) = self.from_m else {
            return "sampled at every node".to_owned();
        };
        format!(
            "from {} up by a harmonic function, {} from {}\n\
             within {} of the largest gradient at each height, compared at {}",
            mm(from_m),
            bytes(self.bytes),
            count(self.samples, "sample"),
            error(self.certificate),
            count(self.checks, "place")
        )
    }
}

impl Map {
    /// The working point's currents, where any are given.
    fn currents_a(&self, design: &Design) -> Result<Option<Vec<f64>>, Failure> {
        let coils = design.array.positions_m.len();
        let fault = |why: String| Err(Failure::Usage(format!("--currents: {why}")));
        if self.currents.is_empty() {
            return Ok(None);
        }
        let curved = design
            .core
            .as_ref()
            .is_some_and(|core| matches!(core.steel, Steel::Curve(_)));
        if !curved {
            return fault(
                "without core.bh_curve the coils' maps add up at any currents; leave it out"
                    .to_owned(),
            );
        }
        if let Some(wrong) = self.currents.iter().find(|i| !i.is_finite()) {
            return fault(format!("{wrong} is no current"));
        }
        match self.currents.as_slice() {
            [all] => Ok(Some(vec![*all; coils])),
            each if each.len() == coils => Ok(Some(each.to_vec())),
            each => fault(format!(
                "{} values for {coils} coils; give one for all, or one a coil",
                each.len()
            )),
        }
    }

    /// What is asked for mag_manip, its files kept apart from the map's own in `out`.
    fn mag_manip(&self, out: &Path) -> Result<MagManipRequest, Failure> {
        let mut taken: Vec<PathBuf> = MAP_FILES.iter().map(|name| out.join(name)).collect();
        let mut path = |flag: &str, file: &Option<FileArgument>| match file {
            None => Ok(None),
            Some(FileArgument::Standard) => Err(Failure::Usage(format!(
                "{flag} names a file, which standard output (-) is not"
            ))),
            Some(FileArgument::Path(path)) if taken.contains(path) => Err(Failure::Usage(format!(
                "{flag}: another file of this command has the name {}; choose another",
                path.display()
            ))),
            Some(FileArgument::Path(path)) => {
                taken.push(path.clone());
                Ok(Some(path.clone()))
            }
        };
        Ok(MagManipRequest {
            vector_field: path("--vfield", &self.vfield)?,
            nodes: self.vfield_nodes,
            multipoles: path("--mpem", &self.mpem)?,
            tolerance: self.mpem_tolerance,
        })
    }

    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let out = self.out.as_ref().map(folder).transpose()?;
        let document = documents::design(&self.design, Need::MAP, printer)?;
        let design = &document.design;
        let out = out.unwrap_or_else(|| Path::new("results").join(&design.name));
        let request = MapRequest {
            mag_manip: self.mag_manip(&out)?,
            components: match self.components {
                Wanted::Gz => Components::Gz,
                Wanted::Gradient => Components::Gradient,
                Wanted::All => Components::All,
            },
            tolerance: self.tolerance.tolerance,
            currents_a: self.currents_a(design)?,
            out,
            formats: MapFormats {
                csv: self.csv,
                vtk: self.vtk,
            },
            force: self.writing.force,
        };
        let wanted = request.mag_manip.nodes.filter(|_| self.vfield.is_some());
        let vector_field = wanted.map(|nodes| cost::of_vector_field(design, nodes));
        allow(vector_field, CostOrigin::Flag, printer)?;
        allow(
            std::iter::once(cost::of_map(design, request.components))
                .chain(cost::of_steel(design, request.tolerance)),
            CostOrigin::Document,
            printer,
        )?;
        let bar = begin(printer);
        let report = run(design, vec![document.input], &request, &bar)?;
        drop(bar);
        for warning in &report.warnings {
            printer.warning(warning);
        }
        let json = MapSummary {
            sidecar: &report.sidecar,
            folder: report.folder.display().to_string(),
            point_coils: report.point_coils,
            distinct_radii: report.distinct_radii,
            tabulated: report.tabulated,
            table: report.table.as_ref().map(TableSummary::of),
            vfield: report.vector_field.as_ref().map(VectorFieldSummary::of),
            mpem: report.multipoles.as_ref().map(MultipolesSummary::of),
        };
        let json = printer.with_warnings(&json);
        printer.summary(Stream::Output, &json, || summary(design, &report))?;
        accuracy_check(&report.accuracy_missed)?;
        if report
            .multipoles
            .as_ref()
            .is_some_and(|made| !made.reached())
        {
            return Err(Failure::Unmet(
                Wish::Accuracy,
                "the accuracy asked for with --mpem-tolerance was not reached: see the accuracy of \
                 mpem and mpem_gradient; the files are written. A workspace that begins higher \
                 above the coils, or a larger tolerance, helps"
                    .to_owned(),
            ));
        }
        Ok(())
    }
}

fn summary(design: &Design, report: &MapReport) -> String {
    let map = &report.sidecar.map;
    let mut sheet = Sheet::new(&format!(
        "{}: maps of {} over the workspace",
        report.sidecar.design,
        count(map.coil.len(), "coil")
    ));
    let components = match map.components.as_str() {
        "gz" => "dBz/dz",
        "gradient" => "dBz/dz and the gradient tensor",
        _ => "dBz/dz, the gradient tensor and the field",
    };
    sheet.line("components", &format!("{components}, per ampere"));
    let axes = [("x", &map.x_m), ("y", &map.y_m), ("z", &map.z_m)];
    let axes = axes.map(|(name, axis)| describe::axis(name, axis));
    sheet.line("grid", &axes.join(", "));
    sheet.line(
        "work",
        &format!(
            "{} of nodes and coils, {} from the axes{}",
            count(report.point_coils, "pair"),
            count(report.distinct_radii, "distinct distance"),
            if report.tabulated {
                ", through radial tables"
            } else {
                ""
            }
        ),
    );
    if let Some(table) = &report.table {
        sheet.line("steel", &TableSummary::of(table).told());
    }
    if let Some(point) = &map.working_point {
        let peak_t = point.peak_field_t.iter().copied().fold(0.0, f64::max);
        sheet.line(
            "together",
            &format!(
                "up to {} of the largest off the sum of the coils' maps, cores up to {peak_t:.3} T",
                percent(point.deviation_from_linear)
            ),
        );
        sheet.line("at", &describe::currents(design, &point.currents_a));
    }
    if let Some(made) = &report.vector_field {
        sheet.line("vfield", &VectorFieldSummary::of(made).told());
    }
    if let Some(made) = &report.multipoles {
        sheet.line("mpem", &MultipolesSummary::of(made).told());
    }
    let stages = report.sidecar.accuracy.iter();
    let stages = stages.map(|(name, stage)| (name.as_str(), stage));
    sheet.line("accuracy", &describe::accuracy(stages));
    sheet.line(
        "between",
        &format!(
            "nodes {} of the largest |dBz/dz| at that height, with {}",
            error(map.interpolation.largest_error),
            map.interpolation.name
        ),
    );
    let files = report.sidecar.files.iter();
    let files: Vec<String> = files
        .map(|file| format!("{} ({})", file.path, bytes(file.bytes)))
        .chain(std::iter::once("map.json".to_owned()))
        .collect();
    sheet.line(
        "written to",
        &format!("{}: {}", report.folder.display(), files.join(", ")),
    );
    sheet.finish()
}
