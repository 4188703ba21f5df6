//! `lambda`: the force constant of one object.

use std::slice::from_ref;

use clap::Args;

use super::LambdaReport;
use super::feedback::FeedbackOptions;
use super::text::summary;
use super::{LambdaOptions, run};
use crate::cli::args::{
    ErrorFlags, ForceFlags, SamplingFlags, SurfaceFlags, Tolerance, UncertaintyFlags, WeightsFlag,
    Writing,
};
use crate::cli::budget::{allow, cost_origin, costs};
use crate::cli::documents;
use crate::cli::failure::{Failure, Wish};
use crate::cli::help::{Codes, page};
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream};
use crate::cli::start::accuracy_check;
use crate::cli::start::begin;
use crate::cli::values::{self, FileArgument};
use crate::coil::limits::unchecked;
use crate::design::{Design, Need};
use crate::lambda::{Criterion, Jnd, Settings, Wiring};
use crate::scene::cost::{Cost, of_uncertainties, of_variants};
use crate::scene::sources::ShapeSource;
use crate::scene::tolerances::ErrorTarget;
use crate::units::FORCE_JND;

/// The largest force constant of one object, and its currents
///
/// Finds the force constant lambda of an object: the magnet on a finger at height h is to feel the
/// force lambda h. One set of static currents serves the whole object; the least mean square error
/// over the object's points is followed exactly from lambda = 0 to where no coil moves any more,
/// and the constants are read off that path. Forces are computed at the points directly, not
/// through a map. A lambda that is null ends with exit code 4.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Reading, &[
    ("fluxform lambda designs/seed.toml shapes/half_sphere.toml", "the seed's half-sphere"),
    ("fluxform lambda designs/seed.toml shapes/wedge.toml --criterion linear --at 2.0",
     "the constant at which the first limit binds, and what 2 N/m would give"),
    ("fluxform lambda designs/seed.toml shapes/half_sphere.toml --max-deviation 0.5mm",
     "points where the surface bends, weighted by area, and what they change"),
    ("fluxform lambda designs/seed.toml shapes/wedge.toml --variants",
     "what a broken coil, pairs in series and currents of both signs would change"),
    ("fluxform lambda designs/seed.toml shapes/flat.toml --feedback --shell 14mm",
     "with the finger's position known: currents of their own at every point, and 14 mm off"),
    ("fluxform lambda designs/seed.toml shapes/wedge.toml --plot wedge.svg",
     "error and currents over lambda, and where on the surface forces are wrong"),
    ("fluxform lambda designs/seed.toml shapes/flat.stl --unit mm --translate 0,0,50",
     "a surface given directly"),
]))]
pub struct Lambda {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// Shape file (TOML, `-` for standard input) or the surface itself (STL, OBJ, PLY, 3MF, STEP, ...)
    #[arg(value_name = "SHAPE")]
    shape: FileArgument,
    #[command(flatten)]
    criterion: CriterionFlags,
    #[command(flatten)]
    at: AtFlag,
    #[command(flatten)]
    wiring: WiringFlags,
    #[command(flatten)]
    feedback: FeedbackFlags,
    #[command(flatten)]
    requested: ForceFlags,
    #[command(flatten)]
    uncertain: UncertaintyFlags,
    /// Draw error and currents over lambda, the errors over the surface and force against requested
    /// force (.svg, .png or .pdf); `-` for standard output
    #[arg(long, value_name = "FILE", value_parser = values::picture)]
    plot: Option<FileArgument>,
    #[command(flatten)]
    writing: Writing,
    #[command(flatten)]
    tolerance: Tolerance,
    #[command(flatten)]
    error: ErrorFlags,
    #[command(flatten)]
    weights: WeightsFlag,
    #[command(flatten)]
    sampling: SamplingFlags,
    #[command(flatten)]
    surface: SurfaceFlags,
}

/// Coils that are broken or wired together.
#[derive(Debug, Clone, Args)]
struct WiringFlags {
    /// Coils that carry no current, like 3,5
    ///
    /// For a bundle of such an array, list each coil's current in the design: current_max_a = [2, 2, 2, 0, 2, 0].
    #[arg(
        long,
        hide_short_help = true,
        value_name = "COILS",
        value_delimiter = ','
    )]
    broken: Vec<usize>,
    /// Pairs of coils that carry one current, like 0+8,2+6
    ///
    /// A pair is one circuit: the supply's voltage drives it through both resistances.
    #[arg(long, hide_short_help = true, value_name = "PAIRS", value_delimiter = ',', value_parser = values::pair)]
    series: Vec<[usize; 2]>,
    /// Also solve with one change at a time
    ///
    /// Passive force, push and pull, pairs in series (those opposite each other), broken coils.
    #[arg(long)]
    variants: bool,
}

/// Currents that follow the magnet.
#[derive(Debug, Clone, Copy, Args)]
struct FeedbackFlags {
    /// Also render with position feedback
    ///
    /// At every point the currents of least power that give its force, the largest lambda that all
    /// points can be given, and what static currents lose.
    #[arg(long)]
    feedback: bool,
    /// With --feedback: meet the same upward demand as far above and below the surface, like 14mm
    #[arg(long, hide_short_help = true, value_name = "LENGTH", requires = "feedback",
          value_parser = values::length_with_unit, allow_hyphen_values = true)]
    shell: Option<f64>,
    /// With --feedback: pairs of points under two fingers so far apart, like 50mm,80mm: where both get their
    /// force
    #[arg(long, hide_short_help = true, value_name = "FROM,TO", requires = "feedback",
          value_parser = values::distances, allow_hyphen_values = true)]
    two_fingers: Option<values::Ends>,
    /// With --feedback: angle between forces that a finger just notices, like 25deg: how static currents for a
    /// force vector weigh sideways errors [default: the shape file's `direction_jnd_deg`, or 25]
    #[arg(long, hide_short_help = true, value_name = "ANGLE", requires = "feedback",
          value_parser = values::direction_jnd, allow_hyphen_values = true)]
    direction_jnd: Option<f64>,
}

/// How the force constant is chosen.
#[derive(Debug, Clone, Copy, Args)]
pub struct CriterionFlags {
    /// Which force constant is chosen
    #[arg(long, value_name = "NAME", default_value = Criterion::default().name(),
          value_parser = values::named::<Criterion>())]
    criterion: Criterion,
    /// Just-noticeable difference: the error that saturation may add, relative to the rms force, like 7%;
    /// by-force: 7% as measured at 2.5 to 10 N, or 15% for less than 0.5 N, where 15 to 27% were measured
    #[arg(long, hide_short_help = true, value_name = "PART", default_value_t = Jnd::default(),
          value_parser = values::jnd_or_by_force, allow_hyphen_values = true)]
    jnd: Jnd,
}

/// A force constant beside the chosen one.
#[derive(Debug, Clone, Copy, Args)]
pub struct AtFlag {
    /// Report currents and errors at this force constant too, N/m
    #[arg(long, hide_short_help = true, value_name = "LAMBDA", value_parser = values::force_constant,
          allow_hyphen_values = true)]
    pub at: Option<f64>,
}

impl CriterionFlags {
    /// The settings that the flags request.
    #[must_use]
    pub fn options(self, at_n_per_m: Option<f64>, tolerance: Option<f64>) -> LambdaOptions {
        LambdaOptions {
            settings: Settings {
                criterion: self.criterion,
                jnd_weight: match self.jnd {
                    Jnd::Part(part) => part,
                    Jnd::ByForce => FORCE_JND,
                },
                at_n_per_m,
            },
            jnd_by_force: self.jnd == Jnd::ByForce,
            tolerance,
            ..LambdaOptions::default()
        }
    }
}

impl Lambda {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let options = LambdaOptions {
            weights: self.weights.weights,
            error: self.error.target(),
            default_error: Some(ErrorTarget::DEFAULT),
            sampling: self.sampling.sampling(),
            wiring: Wiring {
                broken: self.wiring.broken.clone(),
                series: self.wiring.series.clone(),
            },
            variants: self.wiring.variants,
            feedback: self.feedback.feedback.then_some(FeedbackOptions {
                shell_m: self.feedback.shell,
                two_fingers_m: self.feedback.two_fingers.map(|ends| ends.0),
            }),
            picture: self.plot.is_some(),
            force: self.requested.into(),
            uncertainty: self.uncertain.into(),
            direction_jnd_deg: self.feedback.direction_jnd,
            ..self.criterion.options(self.at.at, self.tolerance.tolerance)
        };
        let (document, shapes) = documents::design_and_shapes(
            &self.design,
            Need::LAMBDA,
            from_ref(&self.shape),
            &self.surface,
            printer,
        )?;
        options.check_force(shapes.iter().map(|shape| &shape.document))?;
        let design = &document.design;
        let force = self.writing.force;
        let plot = (self.plot.as_ref()).map(|file| Picture::new(file, force, document.also_read()));
        if let Some(plot) = &plot {
            plot.check(from_ref(&document.input))?;
        }
        allow(
            costs_of(design, &shapes, &options),
            cost_origin(&shapes),
            printer,
        )?;
        for warning in unchecked(&design.limits) {
            printer.warning(&warning);
        }
        let bar = begin(printer);
        for shape in shapes {
            let inputs = std::iter::once(document.input.clone())
                .chain(shape.input)
                .collect();
            let (points, report) = run(design, &shape.document, inputs, &options, &bar)?;
            for warning in &report.warnings {
                printer.warning(warning);
            }
            let place = match (&plot, &report.picture) {
                (Some(plot), Some(picture)) => {
                    plot.draw(&report.file.inputs, &picture.drawing(), printer)?
                }
                _ => Stream::Output,
            };
            let json = printer.with_warnings(&report);
            printer.summary(place, &json, || summary(design, &points, &report))?;
            accuracy_check(&report.accuracy_missed)?;
            let file = &report.file;
            well_placed(&report)?;
            rendered(&[(file.shape.as_str(), file.lambda_n_per_m)])?;
        }
        Ok(())
    }
}

/// The costs of a run with these options.
#[must_use]
pub fn costs_of(design: &Design, shapes: &[ShapeSource], options: &LambdaOptions) -> Vec<Cost> {
    let uncertain = options.uncertainty.over(design.uncertainty);
    let requested = shapes.iter().flat_map(|shape| {
        let variants = of_variants(design, &shape.document, options.variants);
        let uncertainties = of_uncertainties(design, &shape.document, &uncertain);
        variants.into_iter().chain(uncertainties)
    });
    costs(design, shapes, options.tolerance)
        .into_iter()
        .chain(requested)
        .collect()
}

/// Fails where the array cannot render the object where it is.
///
/// # Errors
/// Why, and what would bring it there.
pub fn well_placed(report: &LambdaReport) -> Result<(), Failure> {
    match &report.misplaced {
        Some(message) => {
            let message = format!("{}: {message}", report.file.shape);
            Err(Failure::Unmet(Wish::Placement, message))
        }
        None => Ok(()),
    }
}

/// Fails where a shape's force constant is null or zero: the result is there, but no force.
///
/// # Errors
/// The shapes that no force can be rendered for.
pub fn rendered(shapes: &[(&str, Option<f64>)]) -> Result<(), Failure> {
    let named = |with: fn(Option<f64>) -> bool| -> Vec<&str> {
        let those = shapes.iter().filter(|(_, lambda)| with(*lambda));
        those.map(|(shape, _)| *shape).collect()
    };
    let null = named(|lambda| lambda.is_none());
    if !null.is_empty() {
        return Err(no_constant(&null));
    }
    let zero = named(|lambda| lambda == Some(0.0));
    if zero.is_empty() {
        return Ok(());
    }
    let message = format!(
        "the chosen lambda is 0 for {}: see the warnings",
        zero.join(", ")
    );
    Err(Failure::Unmet(Wish::ForceConstant, message))
}

/// The failure of a result without force constant.
pub fn no_constant(shapes: &[&str]) -> Failure {
    let message = format!(
        "the chosen lambda is null for {}: see the warnings",
        shapes.join(", ")
    );
    Failure::Unmet(Wish::ForceConstant, message)
}
