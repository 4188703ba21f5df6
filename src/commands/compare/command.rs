//! `compare`: how differently several objects feel.

use clap::Args;

use super::text::summary;
use super::{CompareOptions, cost, run};
use crate::cli::args::{SurfaceFlags, Tolerance, Writing};
use crate::cli::budget::{allow, cost_origin, costs};
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::pictures;
use crate::cli::printer::{Printer, Stream};
use crate::cli::start::accuracy_check;
use crate::cli::start::begin;
use crate::cli::values::{self, FileArgument};
use crate::commands::lambda::command::no_constant;
use crate::design::Need;

/// How differently several objects feel, in just-noticeable differences of force
///
/// Renders every object at its own force constant (lambda_jnd, as `lambda` reports it) and compares
/// every two of them wherever a finger would touch either: at the points of both surfaces. With
/// static currents each object's currents give a force at any place. With position feedback the
/// force is the requested one, by currents of least power, the nearest force where the limits bind and
/// none beside the object. A difference of two forces is stated in units of what a finger just
/// notices: a part (--jnd) of the larger force, but at least 0.8 mN; where one object gives no force
/// and the other a strong one it is 1/jnd, where both push against each other up to twice that. Means
/// and shares count either surface half, and all points of a surface alike. A lambda that is null ends
/// with exit code 4.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Writing, &[
    ("fluxform compare designs/seed_air.toml shapes/flat.toml shapes/wedge.toml",
     "two of the seed's objects on its array without cores"),
    ("fluxform compare designs/seed_air.toml shapes/*.toml --plot apart.svg --plot-where where.svg",
     "all of them, with pictures of how much and where"),
    ("fluxform compare designs/seed_air.toml shapes/flat.toml shapes/wedge.toml --lambda 0.5",
     "both with the same force constant"),
]))]
pub struct Compare {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// Two or more shape files (TOML, `-` for standard input) or surfaces (STL, ...)
    #[arg(value_name = "SHAPE", required = true, num_args = 2..)]
    shapes: Vec<FileArgument>,
    /// Render every object at this force constant, N/m, instead of its own
    #[arg(long, value_name = "LAMBDA", value_parser = values::force_constant,
          allow_hyphen_values = true)]
    lambda: Option<f64>,
    /// Just-noticeable difference: the part of a force by which another must differ to be
    /// distinguished; also what each object's own lambda is chosen by
    #[arg(long, value_name = "PART", default_value_t = crate::units::FORCE_JND,
          value_parser = values::jnd, allow_hyphen_values = true)]
    jnd: f64,
    /// Draw the differences as matrices to this file (.svg, .png or .pdf), `-` for standard output
    #[arg(long, value_name = "FILE", value_parser = values::picture)]
    plot: Option<FileArgument>,
    /// Draw where they differ
    ///
    /// For every two objects, on the plan of either, static currents beside position feedback: how much
    /// stronger the first pushes up than the second, in just-noticeable differences of the upward force,
    /// red where it is stronger and blue where it is weaker.
    #[arg(long, value_name = "FILE", value_parser = values::picture)]
    plot_where: Option<FileArgument>,
    #[command(flatten)]
    tolerance: Tolerance,
    #[command(flatten)]
    writing: Writing,
    #[command(flatten)]
    surface: SurfaceFlags,
}

impl Compare {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let (document, shapes) = documents::design_and_shapes(
            &self.design,
            Need::LAMBDA,
            &self.shapes,
            &self.surface,
            printer,
        )?;
        let options = CompareOptions {
            lambda_n_per_m: self.lambda,
            jnd: self.jnd,
            tolerance: self.tolerance.tolerance,
            maps: self.plot_where.is_some(),
        };
        let files = [&self.plot, &self.plot_where].map(Option::as_ref);
        let [plot, plot_where] = pictures::checked(files, self.writing.force, &document)?;
        let mut costs = costs(&document.design, &shapes, self.tolerance.tolerance);
        costs.push(cost(&document.design, &shapes));
        allow(costs, cost_origin(&shapes), printer)?;
        let bar = begin(printer);
        let report = run(&document.design, &shapes, &document.input, &options, &bar)?;
        drop(bar);
        for warning in &report.warnings {
            printer.warning(warning);
        }
        let mut place = Stream::Output;
        if let Some(plot) = &plot {
            place = plot.draw(&report.inputs, &report.picture().drawing(), printer)?;
        }
        if let Some(plot) = &plot_where {
            place = place.or(plot.draw(&report.inputs, &report.map().drawing(), printer)?);
        }
        printer.summary(place, &printer.with_warnings(&report), || summary(&report))?;
        accuracy_check(&report.accuracy_missed)?;
        match report.without_constant() {
            none if none.is_empty() => Ok(()),
            none => Err(no_constant(&none)),
        }
    }
}
