//! `map`: gradient maps over the workspace.

use std::path::{Path, PathBuf};

use clap::Args;

use super::mag_manip::MagManipRequest;
use super::text::summary;
use super::vector_field::FEWEST_NODES;
use super::{MapRequest, run};
use crate::bundle::write::{MAP_FILES, MapFormats};
use crate::cli::args::{ErrorFlags, Tolerance, Writing};
use crate::cli::budget::{CostOrigin, allow};
use crate::cli::documents;
use crate::cli::failure::{Failure, Wish};
use crate::cli::help::{Codes, page};
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream};
use crate::cli::start::accuracy_check;
use crate::cli::start::begin;
use crate::cli::start::folder;
use crate::cli::values::{self, FileArgument};
use crate::design::{Design, Need, Steel};
use crate::map::Components;
use crate::scene::cost;

/// Tabulate the gradient maps of every coil over the workspace
///
/// Tabulates the gradient of every coil's field per ampere over the workspace grid of the design
/// and writes map.npz (NumPy, little-endian doubles with axes and units) and map.json beside it;
/// on request also map.csv and map.vti, which ParaView opens. The error at the nodes and the error
/// of interpolating between them are stated; of arrays with coupled steel cores also the compact form
/// that stood for the steel, and its largest error at samples. With --error the nodes are as few as
/// keep both errors together within it, relative to the largest |dBz/dz| at the height; where the
/// design includes the pull of unpowered steel, those of its map too.
///
/// --vfield and --mpem write calibration files of mag_manip, ETH Zurich's runtime for magnetic
/// manipulation: the field on nodes that span the workspace, and one step more where no coil is in the way,
/// whose error between the nodes is stated, and sources on the coils' axes, whose error at places that the fit did not
/// see is stated; the latter ends with code 4 where it exceeds --mpem-tolerance.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Writing, &[
    ("fluxform map designs/seed.toml --out maps", "dBz/dz of all coils"),
    ("fluxform map designs/seed_air.toml --out maps_vtk --vtk --tolerance 1e-6",
     "for ParaView, less accurate"),
    ("fluxform map designs/seed_air.toml --out drawn --components force --plot drawn/force.svg",
     "drawn: slices of the force, and the force over height"),
    ("fluxform map designs/seed_air.toml --out manip --vfield manip/nodes.yaml --mpem manip/mpem.yaml",
     "for mag_manip"),
    ("fluxform tabulate designs/seed.toml --out maps --format json --force",
     "replace what is there, with a summary for programs"),
]))]
pub struct Map {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// Contents
    #[arg(long, default_value = Components::default().name(), value_parser = values::named::<Components>())]
    components: Components,
    /// Currents at which cores with a B-H curve are mapped together too, A: one for all coils, or
    /// one per coil [default: the rated currents]
    #[arg(
        long,
        hide_short_help = true,
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
    /// Draw the force: slices, and over height (.svg, .png or .pdf)
    ///
    /// With every coil at its rated current across at the target's height and upright through the middle
    /// coil, zero white; and that of one ampere above each coil that has no equal. `-` is standard output.
    #[arg(long, value_name = "FILE", value_parser = values::picture)]
    plot: Option<FileArgument>,
    /// Write the field per ampere on nodes for mag_manip's ForwardModelLinearVField too
    #[arg(long, hide_short_help = true, value_name = "FILE.yaml")]
    vfield: Option<FileArgument>,
    /// Nodes of --vfield along each axis, 6 or more; mag_manip needs as many along all three
    /// [default: the most that the workspace has along one, but no more than 31]
    #[arg(long, hide_short_help = true, value_name = "N", requires = "vfield", value_parser = vfield_nodes)]
    vfield_nodes: Option<usize>,
    /// Write multipole sources fitted to the field for mag_manip's ForwardModelMPEM too
    #[arg(long, hide_short_help = true, value_name = "FILE.yaml")]
    mpem: Option<FileArgument>,
    /// Allowed error of --mpem, of field and gradient relative to the largest at each height,
    /// 1e-15 to 1e-1: fewer sources do for a larger one [default: 1e-3]
    #[arg(long, hide_short_help = true, value_name = "T", requires = "mpem", value_parser = values::tolerance)]
    mpem_tolerance: Option<f64>,
    #[command(flatten)]
    writing: Writing,
    #[command(flatten)]
    error: ErrorFlags,
    #[command(flatten)]
    tolerance: Tolerance,
}

/// Nodes along each axis.
fn vfield_nodes(text: &str) -> Result<usize, String> {
    let nodes = text.parse().ok().filter(|n| *n >= FEWEST_NODES);
    nodes.ok_or_else(|| format!("expected a whole number, {FEWEST_NODES} or more"))
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
            return fault(format!("invalid current {wrong}"));
        }
        match self.currents.as_slice() {
            [all] => Ok(Some(vec![*all; coils])),
            each if each.len() == coils => Ok(Some(each.to_vec())),
            each => fault(format!(
                "{} values for {coils} coils; give one for all, or one per coil",
                each.len()
            )),
        }
    }

    /// The options of mag_manip's files, which are kept apart from the map's own in `out`.
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
        if self.plot.is_some()
            && self.components == Components::Gz
            && design.magnet.tilt_deg != [0.0; 2]
        {
            let message = "--plot: the force on a tilted magnet takes more than dB_z/dz; add --components force";
            return Err(Failure::Usage(message.to_owned()));
        }
        let out = out.unwrap_or_else(|| Path::new("results").join(&design.name));
        let request = MapRequest {
            mag_manip: self.mag_manip(&out)?,
            components: self.components,
            tolerance: self.tolerance.tolerance,
            error: self.error.target(),
            currents_a: self.currents_a(design)?,
            out,
            formats: MapFormats {
                csv: self.csv,
                vtk: self.vtk,
            },
            force: self.writing.force,
            picture: self.plot.is_some(),
        };
        let plot = self.plot.as_ref().map(|file| {
            let written = MAP_FILES.map(|name| request.out.join(name));
            let mag_manip = &request.mag_manip;
            let beside = [&mag_manip.vector_field, &mag_manip.multipoles];
            let beside = beside.into_iter().flatten().cloned();
            let read = document.also_read();
            Picture::new(file, request.force, beside.chain(read).chain(written))
        });
        if let Some(plot) = &plot {
            plot.check(std::slice::from_ref(&document.input))?;
        }
        let nodes = request.mag_manip.nodes.filter(|_| self.vfield.is_some());
        let vector_field = nodes.map(|nodes| cost::of_vector_field(design, nodes));
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
        let json = printer.with_warnings(&report);
        let mut place = Stream::Output;
        if let (Some(plot), Some(picture)) = (&plot, &report.picture) {
            place = plot.draw(&report.sidecar.inputs, &picture.drawing(), printer)?;
        }
        printer.summary(place, &json, || summary(design, &report))?;
        accuracy_check(&report.accuracy_missed)?;
        if report
            .multipoles
            .as_ref()
            .is_some_and(|made| !made.tolerance_met)
        {
            return Err(Failure::Unmet(
                Wish::Accuracy,
                "the accuracy requested with --mpem-tolerance was not reached: see the accuracy of \
                 mpem and mpem_gradient; the files are written. A workspace that begins higher \
                 above the coils, or a larger tolerance, helps"
                    .to_owned(),
            ));
        }
        Ok(())
    }
}
