//! `discretize`: a surface to its constraint points.

use std::path::PathBuf;

use clap::Args;

use super::scattered::{self, ScatteredSummary};
use super::{DeviationSummary, PointsOptions, PointsSummary, TableFiles, run_with};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::Input;
use crate::bundle::atomic::{self, Overwrite, check_distinct};
use crate::cli::args::{ErrorFlags, SamplingFlags, SurfaceFlags, WeightsFlag, Writing};
use crate::cli::budget::{allow, cost_origin};
use crate::cli::describe;
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::Sheet;
use crate::cli::pictures::{Picture, table_or_drawing};
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{count, extents, length_error, mm, number, percent};
use crate::cli::start::{begin, write_to};
use crate::cli::values::{self, FileArgument};
use crate::scene::cost::of_points;
use crate::shape::certificate::Certify;
use crate::shape::deviation::CERTIFY_SECONDS;
use crate::shape::holes::Holes;

/// Flags of points on no grid.
const ON_NO_GRID: [&str; 4] = ["max_deviation", "max_width", "poisson", "seed"];
/// Flags of a grid's points, which `--inspect` does not make.
const OF_A_GRID: [&str; 7] = [
    "holes",
    "certify",
    "certify_seconds",
    "weights",
    "out",
    "error",
    "refine",
];

/// Turn a surface into constraint points with heights and normals
///
/// Samples a surface on a grid: the height of every point is the highest place where the vertical
/// line through it meets the surface. The points go to a CSV table (x_m, y_m, height_m and the
/// normal, x fastest, then y), their summary to a JSON file beside it. Grid points without surface
/// are left out and counted. The surface is described by a shape file (TOML) or given directly with
/// its unit and place.
///
/// How far the surface departs from bilinear interpolation between the points is certified. After
/// the normal the table marks walls, rims, creases (with the other face's normal) and overhangs.
/// Instead of the grid's own samples, --error chooses about as few as keep heights between them within it;
/// instead of the grid's points, --max-deviation chooses as few as a deviation needs, --poisson
/// points without a pattern; both give each point the area it stands for (weight_m2).
///
/// With --inspect no points are made: the content of the surface's file is reported, in its own unit, with
/// a guess at that unit, which is never used.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Writing, &[
    ("fluxform discretize shapes/half_sphere.toml --out points.csv", "a shape file"),
    ("fluxform discretize shapes/wedge.stl --unit mm --translate 0,0,30 --grid 31x31 --out -",
     "a surface given directly; the table goes to standard output"),
    ("fluxform discretize shapes/flat.stl --unit mm --translate 0,0,50 --x -20,20 --out flat.csv",
     "a part of it"),
    ("fluxform discretize shapes/half_sphere.toml --max-deviation 0.5mm --out graded.csv",
     "as many points as the surface needs, and where it needs them"),
    ("fluxform discretize shapes/half_cylinder.stl --inspect --plot from_above.svg",
     "what a file holds: unit, size, holes, faults; and a picture from above"),
]))]
pub struct Discretize {
    /// Shape file (TOML, `-` for standard input) or the surface itself: STL, OBJ, PLY, OFF, GLB, PNG,
    /// 3MF, AMF, 3DXML, STEP, SLDPRT, SLDASM
    #[arg(value_name = "SHAPE")]
    pub(super) shape: FileArgument,
    /// Where the points go; `-` is standard output, and then there is no JSON file
    #[arg(long, value_name = "FILE", default_value = "points.csv")]
    pub(super) out: FileArgument,
    /// Grid points without surface inside the silhouette: leave them out, fill them from around,
    /// or refuse the surface
    #[arg(long, hide_short_help = true, default_value = Holes::default().name(), value_parser = values::named::<Holes>(),
          conflicts_with_all = ON_NO_GRID)]
    holes: Holes,
    /// Compare the points with the surface: vertically, by the Hausdorff distance too (of files alone),
    /// or not
    #[arg(long, hide_short_help = true, default_value = Certify::Vertical.name(), value_parser = values::named::<Certify>(),
          conflicts_with_all = ON_NO_GRID)]
    certify: Certify,
    /// Seconds of one core, about, that --certify may take; then the points come without a certificate,
    /// with a warning
    #[arg(long, value_name = "N", default_value_t = CERTIFY_SECONDS,
          value_parser = clap::value_parser!(u64).range(1..=1_000_000), conflicts_with_all = ON_NO_GRID)]
    certify_seconds: u64,
    #[command(flatten)]
    error: ErrorFlags,
    #[command(flatten)]
    weights: WeightsFlag,
    #[command(flatten)]
    pub(super) sampling: SamplingFlags,
    /// Report what the surface's file holds and make no points
    #[arg(
        long,
        conflicts_with_all = OF_A_GRID,
        conflicts_with_all = ON_NO_GRID
    )]
    pub(super) inspect: bool,
    /// With --inspect: report and draw where the part lies over this design's array and workspace
    #[arg(
        long,
        hide_short_help = true,
        value_name = "DESIGN",
        requires = "inspect",
        conflicts_with_all = OF_A_GRID,
        conflicts_with_all = ON_NO_GRID
    )]
    pub(super) over: Option<FileArgument>,
    /// Draw heights, what each point of a grid is, and the deviation between them (.svg, .png
    /// or .pdf)
    #[arg(long, value_name = "FILE", value_parser = values::picture, conflicts_with_all = ON_NO_GRID)]
    pub(super) plot: Option<FileArgument>,
    #[command(flatten)]
    pub(super) writing: Writing,
    #[command(flatten)]
    pub(super) surface: SurfaceFlags,
}

impl Discretize {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        table_or_drawing(&self.out, self.plot.as_ref())?;
        if self.inspect {
            return self.inspected(printer);
        }
        let shapes = documents::shapes(std::slice::from_ref(&self.shape), &self.surface, printer)?;
        allow(
            shapes.iter().map(|shape| of_points(&shape.document, 0)),
            cost_origin(&shapes),
            printer,
        )?;
        let bar = begin(printer);
        for shape in shapes {
            let inputs: Vec<Input> = shape.input.into_iter().collect();
            let plot = self.check_outputs(&inputs)?;
            if let Some(sampling) = self.sampling.sampling() {
                let mut report = scattered::run(&shape.document, inputs, sampling, &bar)?;
                self.warn(&report.summary.warnings, printer);
                let place = match self
                    .table(printer, &report.summary.inputs, |out| report.write_csv(out))?
                {
                    Some(place) => place,
                    None => {
                        report.write(self.out.as_given(), self.writing.force)?;
                        Stream::Output
                    }
                };
                report.summary.warnings = printer.warnings();
                printer.summary(place, &report.summary, || {
                    self.text_scattered(&report.summary)
                })?;
                continue;
            }
            let mut report = run_with(&shape.document, inputs, &self.options(), &bar)?;
            self.warn(&report.summary.warnings, printer);
            let place =
                match self.table(printer, &report.summary.inputs, |out| report.write_csv(out))? {
                    Some(place) => place,
                    None => {
                        report.write(self.out.as_given(), self.writing.force)?;
                        Stream::Output
                    }
                };
            let place = match &plot {
                None => place,
                Some(plot) => {
                    let (inputs, drawn) = (&report.summary.inputs, report.picture().drawing());
                    let after = plot.draw(inputs, &drawn, printer)?;
                    if after == Stream::Error { after } else { place }
                }
            };
            report.summary.warnings = printer.warnings();
            printer.summary(place, &report.summary, || self.text(&report.summary))?;
        }
        Ok(())
    }

    fn options(&self) -> PointsOptions {
        PointsOptions {
            marks: true,
            holes: self.holes,
            certify: self.certify,
            certify_seconds: self.certify_seconds,
            picture: self.plot.is_some(),
            weights: self.weights.weights,
            error: self.error.target(),
        }
    }

    fn warn(&self, warnings: &[String], printer: &Printer) {
        for warning in warnings {
            printer.warning(warning);
        }
    }

    /// Refuses before anything is computed outputs that must not be replaced, as far as the inputs are
    /// known, or that have the same name. The picture, where one is drawn.
    fn check_outputs(&self, inputs: &[Input]) -> Result<Option<Picture<'_>>, Failure> {
        let mut outputs: Vec<PathBuf> = Vec::new();
        if let FileArgument::Path(path) = &self.out
            && !atomic::is_stream(path)
        {
            let files = TableFiles::new(path, self.writing.force, inputs);
            let files = files.map_err(|wrong| Failure::Usage(wrong.to_string()))?;
            outputs.extend(files.paths());
        }
        let plot = self.plot.as_ref().map(|file| {
            let written = outputs.clone();
            Picture::new(file, self.writing.force, written)
        });
        if let Some(FileArgument::Path(path)) = &self.plot {
            outputs.push(path.clone());
        }
        check_distinct(&outputs).map_err(RunError::from)?;
        if let Some(plot) = &plot {
            plot.check(inputs)?;
        }
        Ok(plot)
    }

    /// Writes the table where it has nothing beside it: to standard output, a device or a pipe.
    fn table(
        &self,
        printer: &Printer,
        inputs: &[Input],
        csv: impl Fn(&mut dyn std::io::Write) -> std::io::Result<()>,
    ) -> Result<Option<Stream>, Failure> {
        match &self.out {
            FileArgument::Path(path) if !atomic::is_stream(path) => Ok(None),
            out => {
                let overwrite = Overwrite::same_bytes(self.writing.force, inputs);
                write_to(Some(out), &overwrite, printer, csv).map(Some)
            }
        }
    }

    /// Names the table and its summary; a device or a pipe has no summary beside it.
    fn written_to(&self, sheet: &mut Sheet) {
        if let FileArgument::Path(path) = &self.out {
            let mut written = path.display().to_string();
            if !atomic::is_stream(path) {
                written += &format!(", {}", path.with_extension("json").display());
            }
            sheet.line("written to", &written);
        }
    }

    fn text_scattered(&self, summary: &ScatteredSummary) -> String {
        let mut sheet = Sheet::new(&format!(
            "{}: {}, {}",
            summary.shape,
            count(summary.points, "constraint point"),
            summary.sampling
        ));
        sheet.line(
            "heights",
            &describe::heights(summary.min_height_m, summary.max_height_m),
        );
        sheet.line(
            "area",
            &format!("{} mm^2 in plan", number(summary.area_m2 * 1e6)),
        );
        if let Some(stage) = summary.accuracy.get("patches") {
            let borders = summary.border_patches.zip(summary.border_width_m);
            let borders = borders.filter(|(patches, _)| *patches > 0);
            let borders = borders.map_or_else(String::new, |(patches, width_m)| {
                let widest = mm(width_m);
                format!(", but for patches at rims and jumps: {patches}, no wider than {widest}")
            });
            sheet.line(
                "deviation",
                &format!("at most {} vertically{borders}", mm(stage.estimate)),
            );
        }
        if let Some(cover_m) = summary.cover_m {
            sheet.line(
                "cover",
                &format!("no place farther than {} from a point", mm(cover_m)),
            );
        }
        self.written_to(&mut sheet);
        sheet.finish()
    }

    fn text(&self, summary: &PointsSummary) -> String {
        let mut sheet = Sheet::new(&format!(
            "{}: {}",
            summary.shape,
            count(summary.points, "constraint point")
        ));
        sheet.line(
            "heights",
            &format!(
                "{}, rms {}",
                describe::heights(summary.min_height_m, summary.max_height_m),
                mm(summary.rms_height_m)
            ),
        );
        let axes = [
            describe::axis("x", &summary.grid_x_m),
            describe::axis("y", &summary.grid_y_m),
        ];
        sheet.line("grid", &axes.join(", "));
        if summary.outside > 0 {
            let outside = count(summary.outside, "grid point");
            sheet.line("left out", &format!("{outside} without surface"));
        }
        sheet.line(
            "surface",
            &format!(
                "{} mm{}",
                extents(
                    summary.bounds_min_m.map(|c| c * 1000.0),
                    summary.bounds_max_m.map(|c| c * 1000.0)
                ),
                match (summary.triangles, summary.degenerate_triangles) {
                    (Some(all), Some(0)) => format!(", {}", count(all, "triangle")),
                    (Some(all), Some(flat)) =>
                        format!(", {} ({flat} without area)", count(all, "triangle")),
                    _ => ", a formula".to_owned(),
                }
            ),
        );
        if let Some(deviation) = &summary.deviation {
            sheet.line("deviation", &between(deviation));
        }
        if let Some(requested) = &summary.requested {
            let jumps = requested.jumps.map_or_else(String::new, |share| {
                let share = percent(share);
                format!("\nleft out: {share} of the points, where the surface jumps")
            });
            sheet.line(
                "error",
                &format!(
                    "{} of the height between the points {} the requested {}{jumps}",
                    percent(requested.between_points),
                    if requested.met { "holds" } else { "exceeds" },
                    percent(requested.error)
                ),
            );
        }
        if let Some(stage) = summary.accuracy.get("points") {
            let facets = summary.accuracy.get("tessellation");
            sheet.line("accuracy", &heights_to(stage, facets));
        }
        self.written_to(&mut sheet);
        if let Some(FileArgument::Path(path)) = &self.plot {
            sheet.line("drawn in", &path.display().to_string());
        }
        sheet.finish()
    }
}

/// The error of the heights against the facets, and how far these lie from the surface they stand for.
fn heights_to(points: &StageAccuracy, facets: Option<&StageAccuracy>) -> String {
    let heights = format!("heights to {}", length_error(points.estimate));
    let Some(facets) = facets.filter(|facets| facets.estimate > 0.0) else {
        return heights;
    };
    let how = facets.method.split(':').next().unwrap_or_default();
    format!(
        "{heights} of the facets, which lie within {} of the surface that they stand for ({how})",
        length_error(facets.estimate)
    )
}

/// How far bilinear interpolation departs from the surface.
fn between(deviation: &DeviationSummary) -> String {
    let (most_m, at_m) = if deviation.below_m > deviation.above_m {
        (deviation.below_m, deviation.below_at_m)
    } else {
        (deviation.above_m, deviation.above_at_m)
    };
    let [x, y] = at_m.map(|c| number(c * 1000.0));
    let mut text = format!("within {} vertically, worst at ({x}, {y}) mm", mm(most_m));
    if let (Some(lower_m), Some(upper_m)) =
        (deviation.hausdorff_lower_m, deviation.hausdorff_upper_m)
    {
        text += &format!("; {} to {} in distance", mm(lower_m), mm(upper_m));
    }
    text
}
