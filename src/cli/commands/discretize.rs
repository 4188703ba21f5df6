//! `discretize`: a surface to its constraint points.

use clap::Args;

use super::{begin, describe};
use crate::bundle::atomic::{self, Overwrite};
use crate::cli::args::{SurfaceFlags, Writing};
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::Sheet;
use crate::cli::printer::{Place, Printer};
use crate::cli::quantity::{count, length_error, mm, number};
use crate::cli::values::FileArgument;
use crate::job::JobError;
use crate::job::discretize::{PointsReport, PointsSummary, run};

/// Turn a surface into constraint points with heights and normals
///
/// Samples a surface on a grid: the height of every point is the highest place where the vertical
/// line through it meets the surface. The points go to a CSV table (x_m, y_m, height_m and the
/// normal, x fastest, then y), their summary to a JSON file beside it. Grid points without surface
/// are left out and counted. The surface is described by a shape file (TOML) or given directly with
/// its unit and place.
#[derive(Debug, Args)]
#[command(after_help = page(Codes::Writing, &[
    ("fluxform discretize shapes/half_sphere.toml --out points.csv", "a shape file"),
    ("fluxform discretize shapes/wedge.stl --unit mm --translate 0,0,30 --grid 31x31 --out -",
     "a surface given directly; the table goes to standard output"),
    ("fluxform discretize shapes/flat.stl --unit mm --translate 0,0,50 --x -20,20 --out flat.csv",
     "a part of it"),
]))]
pub struct Discretize {
    /// Shape file (TOML, `-` for standard input) or the surface itself (STL)
    #[arg(value_name = "SHAPE")]
    shape: FileArgument,
    /// Where the points go; `-` is standard output, and then there is no JSON file
    #[arg(long, value_name = "FILE", default_value = "points.csv")]
    out: FileArgument,
    #[command(flatten)]
    writing: Writing,
    #[command(flatten)]
    surface: SurfaceFlags,
}

impl Discretize {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let shapes = documents::shapes(std::slice::from_ref(&self.shape), &self.surface, printer)?;
        let bar = begin(printer);
        for shape in shapes {
            let inputs = shape.input.into_iter().collect();
            let mut report = run(&shape.document, inputs, &bar)?;
            for warning in &report.summary.warnings {
                printer.warning(warning);
            }
            let place = self.write(&report, printer)?;
            report.summary.warnings = printer.warnings();
            printer.summary(place, &report.summary, || self.told(&report.summary))?;
        }
        Ok(())
    }

    fn write(&self, report: &PointsReport, printer: &Printer) -> Result<Place, Failure> {
        match &self.out {
            FileArgument::Standard => {
                printer.data(|out| report.write_csv(out))?;
                Ok(Place::Error)
            }
            // A device or a pipe has nothing beside it.
            FileArgument::Path(path)
                if path.metadata().is_ok_and(|m| !m.is_file() && !m.is_dir()) =>
            {
                atomic::write(path, &Overwrite::Force, |out| report.write_csv(out))
                    .map_err(JobError::from)?;
                Ok(Place::Output)
            }
            FileArgument::Path(path) => {
                report.write(path, self.writing.force)?;
                Ok(Place::Output)
            }
        }
    }

    fn told(&self, summary: &PointsSummary) -> String {
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
        let corner = |c: &[f64; 3]| c.map(|v| number(v * 1000.0)).join(", ");
        sheet.line(
            "surface",
            &format!(
                "from ({}) to ({}) mm{}",
                corner(&summary.bounds_min_m),
                corner(&summary.bounds_max_m),
                match (summary.triangles, summary.degenerate_triangles) {
                    (Some(all), Some(0)) => format!(", {}", count(all, "triangle")),
                    (Some(all), Some(flat)) =>
                        format!(", {} ({flat} without area)", count(all, "triangle")),
                    _ => ", a formula".to_owned(),
                }
            ),
        );
        if let Some(stage) = summary.accuracy.get("points") {
            sheet.line(
                "accuracy",
                &format!("heights to {}", length_error(stage.estimate)),
            );
        }
        if let FileArgument::Path(path) = &self.out {
            sheet.line("written to", &path.display().to_string());
        }
        sheet.finish()
    }
}
