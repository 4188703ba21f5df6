//! `map`: gradient maps over the workspace.

use std::path::Path;

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::{accuracy_check, begin, describe, folder};
use crate::bundle::manifest::MapSidecar;
use crate::bundle::write::MapFormats;
use crate::cli::args::{Tolerance, Writing};
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::Sheet;
use crate::cli::printer::{Place, Printer};
use crate::cli::quantity::{bytes, count, error, mm, percent};
use crate::cli::values::FileArgument;
use crate::design::{Design, Need, Steel};
use crate::job::map::{MapReport, MapRequest, run};
use crate::map::Components;
use crate::map::sampled::TableReport;

/// Tabulate the gradient maps of every coil over the workspace
///
/// Tabulates the gradient of every coil's field per ampere over the workspace grid of the design
/// and writes map.npz (NumPy, little-endian doubles with axes and units) and map.json beside it;
/// on request also map.csv and map.vti, which ParaView opens. The error at the nodes and the error
/// of interpolating between them are told; of arrays with coupled steel cores also the compact form
/// that stood for the steel, and how far it was seen to be off.
#[derive(Debug, Args)]
#[command(after_help = page(Codes::Writing, &[
    ("fluxform map designs/seed.toml --out maps", "dBz/dz of all coils"),
    ("fluxform map designs/seed_air.toml --out maps_vtk --vtk --tolerance 1e-6",
     "for ParaView, less accurate"),
    ("fluxform tabulate designs/seed.toml --out maps --format json --force",
     "replace what is there, and tell a program"),
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

    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let out = self.out.as_ref().map(folder).transpose()?;
        let document = documents::design(&self.design, Need::MAP, printer)?;
        let design = &document.design;
        let request = MapRequest {
            components: match self.components {
                Wanted::Gz => Components::Gz,
                Wanted::Gradient => Components::Gradient,
                Wanted::All => Components::All,
            },
            tolerance: self.tolerance.tolerance,
            currents_a: self.currents_a(design)?,
            out: out.unwrap_or_else(|| Path::new("results").join(&design.name)),
            formats: MapFormats {
                csv: self.csv,
                vtk: self.vtk,
            },
            force: self.writing.force,
        };
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
        };
        let json = printer.with_warnings(&json);
        printer.summary(Place::Output, &json, || summary(design, &report))?;
        accuracy_check(report.accuracy_reached)
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
