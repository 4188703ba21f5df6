//! `compare`: how differently several objects feel.

use clap::Args;

use super::{CompareFile, CompareOptions, ComparedShape, Place, run};
use crate::cli::args::{SurfaceFlags, Tolerance, Writing};
use crate::cli::budget::{allow, cost_origin, costs};
use crate::cli::describe;
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::{Sheet, Side, table};
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{count, force, number_to, percent};
use crate::cli::start::accuracy_check;
use crate::cli::start::begin;
use crate::cli::values::{self, FileArgument};
use crate::commands::lambda::command::no_constant;
use crate::design::Need;

/// How differently several objects feel, in just-noticeable differences of force
///
/// Renders every object at its own force constant (lambda_jnd, as `lambda` tells it) and compares
/// every two of them wherever a finger would touch either: at the points of both surfaces. With
/// static currents each object's currents give a force at any place. With position feedback the
/// force is lambda h(x, y), by currents of least power, the nearest force where the limits bind and
/// none beside the object. A difference of two forces is told in units of what a finger just
/// notices: a part (--jnd) of the larger force, but at least 0.8 mN; where one object gives no force
/// and the other a strong one it is 1/jnd, the most there is. A lambda that is null ends with exit
/// code 4.
#[derive(Debug, Args)]
#[command(after_help = page(Codes::Writing, &[
    ("fluxform compare designs/seed_air.toml shapes/flat.toml shapes/wedge.toml",
     "two of the seed's objects on its array without cores"),
    ("fluxform compare designs/seed_air.toml shapes/*.toml --plot apart.svg",
     "all of them, with a picture"),
    ("fluxform compare designs/seed_air.toml shapes/flat.toml shapes/wedge.toml --lambda 0.5",
     "both with the same force constant"),
]))]
pub struct Compare {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// Two or more shape files (TOML, `-` for standard input) or surfaces (STL)
    #[arg(value_name = "SHAPE", required = true, num_args = 2..)]
    shapes: Vec<FileArgument>,
    /// Render every object at this force constant, N/m, instead of its own
    #[arg(long, value_name = "LAMBDA", value_parser = values::force_constant,
          allow_hyphen_values = true)]
    lambda: Option<f64>,
    /// Just-noticeable difference: the part of a force by which another must differ to be told
    /// apart; also what each object's own lambda is chosen by
    #[arg(long, value_name = "PART", default_value_t = crate::units::FORCE_JND,
          value_parser = values::jnd, allow_hyphen_values = true)]
    jnd: f64,
    /// Draw the differences as matrices to this SVG file, `-` for standard output
    #[arg(long, value_name = "FILE")]
    plot: Option<FileArgument>,
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
        };
        let force = self.writing.force;
        let plot = (self.plot.as_ref()).map(|file| Picture::new(file, force, document.also_read()));
        if let Some(plot) = &plot {
            plot.check(std::slice::from_ref(&document.input))?;
        }
        allow(
            costs(&document.design, &shapes, self.tolerance.tolerance),
            cost_origin(&shapes),
            printer,
        )?;
        let bar = begin(printer);
        let report = run(&document.design, &shapes, &document.input, &options, &bar)?;
        drop(bar);
        for warning in &report.warnings {
            printer.warning(warning);
        }
        let file = &report.file;
        let mut place = Stream::Output;
        if let Some(plot) = &plot {
            place = plot.write(&file.inputs, &file.picture().svg(), printer)?;
        }
        printer.summary(place, &printer.with_warnings(file), || summary(file))?;
        accuracy_check(&report.accuracy_missed)?;
        match file.without_constant() {
            none if none.is_empty() => Ok(()),
            none => Err(no_constant(&none)),
        }
    }
}

fn summary(file: &CompareFile) -> String {
    let mut sheet = Sheet::new(&format!(
        "{} on {}: differences of force in just-noticeable ones ({}, at least {})",
        count(file.shapes.len(), "object"),
        file.design,
        percent(file.jnd),
        force(file.threshold_n)
    ));
    for (k, shape) in file.shapes.iter().enumerate() {
        let label = if k == 0 { "objects" } else { "" };
        sheet.line(label, &object(shape));
    }
    let stages = file.accuracy.iter();
    let stages = stages.map(|(name, stage)| (*name, stage));
    sheet.line("accuracy", &describe::accuracy(stages));
    sheet.gap();
    sheet.raw(&table_of(file));
    sheet.finish()
}

fn object(shape: &ComparedShape) -> String {
    let saturated = shape.saturated_share.map_or_else(String::new, |share| {
        format!(
            "; with feedback the limits bind at {} of its points",
            percent(share)
        )
    });
    format!(
        "{}: lambda {}, {}{saturated}",
        shape.shape,
        describe::force_constant(shape.lambda_n_per_m),
        count(shape.points, "point")
    )
}

/// One line a pair.
fn table_of(file: &CompareFile) -> String {
    let head = [
        "", "", "static", "rms", "felt", "at mm", "feedback", "rms", "felt", "at mm",
    ];
    let none = || "none".to_owned();
    let told = |value: Option<f64>| value.map_or_else(none, |v| number_to(v, 4));
    let part = |share: Option<f64>| share.map_or_else(none, percent);
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(file.pairs.iter().map(|pair| {
        vec![
            pair.a.clone(),
            pair.b.clone(),
            told(pair.static_jnd),
            told(pair.static_rms_jnd),
            part(pair.static_felt_share),
            at(pair.static_at.as_ref()),
            told(pair.feedback_jnd),
            told(pair.feedback_rms_jnd),
            part(pair.feedback_felt_share),
            at(pair.feedback_at.as_ref()),
        ]
    }));
    let mut sides = [Side::Right; 10];
    sides[..2].fill(Side::Left);
    table(&sides, &rows)
}

fn at(place: Option<&Place>) -> String {
    place.map_or_else(String::new, |place| {
        let at = [place.x_m, place.y_m, place.z_m].map(|c| number_to(c * 1e3, 4));
        format!("({})", at.join(", "))
    })
}
