//! `lambda`: the force constant of one object.

use std::slice::from_ref;

use clap::Args;

use super::feedback::FeedbackOptions;
use super::{LambdaOptions, LambdaReport, run};
use crate::bundle::lambda_file::{
    FeedbackFile, FeedbackPlace, FeedbackRendering, FeedbackShell, LambdaVariant, TolerancePoint,
    WiringFile, WorkingPointForces, WorstPointFile,
};
use crate::cli::args::{SamplingFlags, SurfaceFlags, Tolerance, Writing};
use crate::cli::budget::{allow, asked, costs};
use crate::cli::describe;
use crate::cli::documents;
use crate::cli::failure::{Failure, Wish};
use crate::cli::help::{Codes, page};
use crate::cli::layout::{Sheet, headed_table};
use crate::cli::pictures::Picture;
use crate::cli::printer::{Place, Printer};
use crate::cli::quantity::{count, force, mm, number, number_to, percent};
use crate::cli::start::accuracy_check;
use crate::cli::start::begin;
use crate::cli::values::{self, FileArgument};
use crate::design::{Design, Need};
use crate::lambda::{Criterion, Precision, Settings, Wiring};

/// The largest force constant of one object, and its currents
///
/// Finds the force constant lambda of an object: the magnet on a finger at height h is to feel the
/// force lambda h. One set of static currents serves the whole object; the least mean square error
/// over the object's points is followed exactly from lambda = 0 to where no coil moves any more,
/// and the constants are read off that path. Forces are computed at the points directly, not
/// through a map. A lambda that is null ends with exit code 4.
#[derive(Debug, Args)]
#[command(after_help = page(Codes::Reading, &[
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
    /// Shape file (TOML, `-` for standard input) or the surface itself (STL)
    #[arg(value_name = "SHAPE")]
    shape: FileArgument,
    #[command(flatten)]
    criterion: CriterionFlags,
    #[command(flatten)]
    wiring: WiringFlags,
    #[command(flatten)]
    feedback: FeedbackFlags,
    /// Draw error and currents over lambda, the errors over the surface and force against wanted
    /// force (SVG); `-` for standard output
    #[arg(long, value_name = "FILE")]
    plot: Option<FileArgument>,
    #[command(flatten)]
    writing: Writing,
    #[command(flatten)]
    tolerance: Tolerance,
    #[command(flatten)]
    sampling: SamplingFlags,
    #[command(flatten)]
    surface: SurfaceFlags,
}

/// Coils that are broken or wired together.
#[derive(Debug, Clone, Args)]
struct WiringFlags {
    /// Coils that carry no current, like 3,5
    #[arg(long, value_name = "COILS", value_delimiter = ',')]
    broken: Vec<usize>,
    /// Pairs of coils that carry one current, like 0+8,2+6
    #[arg(long, value_name = "PAIRS", value_delimiter = ',', value_parser = values::pair)]
    series: Vec<[usize; 2]>,
    /// Also solve with one change at a time: passive force, push and pull, pairs in series (those
    /// opposite each other), broken coils
    #[arg(long)]
    variants: bool,
}

/// Currents that follow the magnet.
#[derive(Debug, Clone, Copy, Args)]
struct FeedbackFlags {
    /// Also render with position feedback: at every point the currents of least power that give
    /// its force, the largest lambda that all points can be given, and what static currents lose
    #[arg(long)]
    feedback: bool,
    /// With --feedback: meet the same demand as far above and below the surface, like 14mm
    #[arg(long, value_name = "LENGTH", requires = "feedback",
          value_parser = values::length_with_unit, allow_hyphen_values = true)]
    shell: Option<f64>,
}

/// How the force constant is chosen.
#[derive(Debug, Clone, Copy, Args)]
pub struct CriterionFlags {
    /// Which force constant is chosen
    #[arg(long, value_name = "NAME", default_value = Criterion::default().name(),
          value_parser = values::criterion())]
    criterion: Criterion,
    /// Just-noticeable difference: the error that saturation may add, relative to the rms force
    #[arg(long, value_name = "PART", default_value_t = crate::units::FORCE_JND,
          value_parser = values::jnd, allow_hyphen_values = true)]
    jnd: f64,
    /// Report currents and errors at this force constant too, N/m
    #[arg(long, value_name = "LAMBDA", value_parser = values::force_constant,
          allow_hyphen_values = true)]
    at: Option<f64>,
}

impl CriterionFlags {
    /// The settings that the flags ask for.
    #[must_use]
    pub fn options(self, tolerance: Option<f64>) -> LambdaOptions {
        LambdaOptions {
            settings: Settings {
                criterion: self.criterion,
                jnd_weight: self.jnd,
                at_n_per_m: self.at,
            },
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
            sampling: self.sampling.sampling(),
            wiring: Wiring {
                broken: self.wiring.broken.clone(),
                series: self.wiring.series.clone(),
            },
            variants: self.wiring.variants,
            feedback: self.feedback.feedback.then_some(FeedbackOptions {
                shell_m: self.feedback.shell,
            }),
            picture: self.plot.is_some(),
            ..self.criterion.options(self.tolerance.tolerance)
        };
        let (document, shapes) = documents::design_and_shapes(
            &self.design,
            Need::LAMBDA,
            from_ref(&self.shape),
            &self.surface,
            printer,
        )?;
        let design = &document.design;
        let force = self.writing.force;
        let plot = (self.plot.as_ref()).map(|file| Picture::new(file, force, document.also_read()));
        if let Some(plot) = &plot {
            plot.check(from_ref(&document.input))?;
        }
        allow(
            costs(design, &shapes, self.tolerance.tolerance),
            asked(&shapes),
            printer,
        )?;
        let bar = begin(printer);
        for shape in shapes {
            let inputs = std::iter::once(document.input.clone())
                .chain(shape.input)
                .collect();
            let report = run(design, &shape.document, inputs, &options, &bar)?;
            for warning in &report.warnings {
                printer.warning(warning);
            }
            let place = match (&plot, &report.picture) {
                (Some(plot), Some(picture)) => {
                    plot.write(&report.file.inputs, &picture.svg(), printer)?
                }
                _ => Place::Output,
            };
            let json = printer.with_warnings(&report.file);
            printer.summary(place, &json, || summary(design, &report))?;
            accuracy_check(&report.accuracy_missed)?;
            let file = &report.file;
            rendered(&[(file.shape.as_str(), file.lambda_n_per_m)])?;
        }
        Ok(())
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

/// The result is there, but there is no force constant.
pub fn no_constant(shapes: &[&str]) -> Failure {
    let message = format!(
        "the chosen lambda is null for {}: see the warnings",
        shapes.join(", ")
    );
    Failure::Unmet(Wish::ForceConstant, message)
}

fn summary(design: &Design, report: &LambdaReport) -> String {
    let file = &report.file;
    let mut sheet = Sheet::new(&format!(
        "{} on {}: lambda {}",
        file.shape,
        file.design,
        describe::force_constant(file.lambda_n_per_m)
    ));
    let constants = file.constants.named().into_iter().map(|one| {
        let lambda = one.lambda_n_per_m.map_or_else(|| "none".to_owned(), number);
        format!("{} {lambda}", one.name)
    });
    let constants: Vec<String> = constants.collect();
    sheet.line("lambda", &format!("{} N/m", constants.join(", ")));
    sheet.line("chosen by", &file.criterion.described(&percent(file.jnd)));
    operating_point(&mut sheet, report);
    if let Some(worst) = &file.worst_point {
        sheet.line("worst point", &worst_point(worst));
    }
    if let Some(wiring) = &file.wiring {
        sheet.line("wiring", &wired(wiring));
    }
    if let Some(told) = &file.tolerance {
        sheet.line("not felt", &not_felt(told));
    }
    if let Some(point) = &file.working_point {
        sheet.line("steel", &along_the_curve(point));
    }
    if let Some(of) = &file.sideways {
        sheet.line("sideways", &describe::sideways(of));
    }
    if let Some(told) = &file.feedback {
        sheet.line("feedback", &feedback(told));
        if let Some(found) = told.at_chosen.as_ref().or(told.at_largest.as_ref()) {
            let shares: Vec<f64> = found.active_share.iter().map(|s| s * 100.0).collect();
            let unit = format!("% of the points, at {} N/m", number(found.lambda_n_per_m));
            sheet.line("active", &describe::per_coil(design, &unit, &shares, 1));
        }
        if let Some(shell) = &told.shell {
            sheet.line("shell", &shell_of(shell));
        }
    }
    if let Some(currents) = &file.currents_a {
        sheet.line("currents", &describe::currents(design, currents));
    }
    if let Some(at) = &file.at {
        sheet.line(
            "at",
            &format!(
                "{} N/m: error rms {}, worst {}{}",
                number(at.lambda_n_per_m),
                force(at.rms_error_n),
                force(at.worst_error_n),
                at.worst_point
                    .as_ref()
                    .map_or_else(String::new, |worst| format!(
                        ", at least {}",
                        force(worst.worst_error_n)
                    ))
            ),
        );
        sheet.line("", &describe::currents(design, &at.currents_a));
    }
    sheet.line(
        "path",
        &format!(
            "{}; rank {} of {}{}",
            count(file.path.len(), "breakpoint"),
            file.rank,
            count(design.array.positions_m.len(), "coil"),
            match report.precision {
                Precision::Double => "",
                Precision::DoubleDouble => "; in 31 digits, for nearly dependent coils",
            }
        ),
    );
    sheet.line("points", &points(report));
    let stages = file.accuracy.iter();
    let stages = stages.map(|(name, stage)| (name.as_str(), stage));
    sheet.line("accuracy", &describe::accuracy(stages));
    if let Some(variants) = &file.variants {
        sheet.gap();
        sheet.raw(&table_of(variants));
    }
    sheet.finish()
}

/// What currents of their own at every point give, and static ones do not.
fn feedback(told: &FeedbackFile) -> String {
    let constant = largest(told.lambda_n_per_m, told.reason.as_deref(), told.decided_at);
    let mut lines = vec![format!("lambda {constant}")];
    lines.extend(told.at_chosen.iter().map(rendering));
    lines.extend(told.without.iter().map(|fixed| {
        format!(
            "without, at {} N/m: error rms {}, worst {}\n  currents up to {} A; {} W",
            number(fixed.lambda_n_per_m),
            force(fixed.rms_error_n),
            force(fixed.worst_error_n),
            number_to(fixed.largest_current_a, 4),
            number_to(fixed.power_w, 4)
        )
    }));
    lines.extend(told.at_largest.iter().map(rendering));
    lines.join("\n")
}

fn largest(lambda: Option<f64>, reason: Option<&str>, place: Option<FeedbackPlace>) -> String {
    match (lambda, place) {
        (Some(lambda), Some(place)) => {
            let [x, y, z] = place.position_m.map(|v| number(v * 1e3));
            format!(
                "up to {} N/m at every place; point {} decides, at x {x}, y {y}, z {z} mm",
                number(lambda),
                place.point
            )
        }
        _ => format!("none: {}", reason.unwrap_or("no force is wanted")),
    }
}

fn rendering(found: &FeedbackRendering) -> String {
    let unreached = match found.points_unreached {
        0 => String::new(),
        some => format!(" ({} out of reach)", count(some, "point")),
    };
    format!(
        "at {} N/m: error rms {}, worst {}{unreached}\n  currents up to {} A; {} W on average, \
         up to {} W; {} coils active on average, {} to {}",
        number(found.lambda_n_per_m),
        force(found.rms_error_n),
        force(found.worst_error_n),
        number_to(found.largest_current_a, 4),
        number_to(found.mean_power_w, 4),
        number_to(found.max_power_w, 4),
        number_to(found.active_mean, 3),
        found.active_min,
        found.active_max
    )
}

/// The demand above and below the surface.
fn shell_of(shell: &FeedbackShell) -> String {
    let clipped = match shell.clipped {
        0 => String::new(),
        some => format!(
            "; {} of {} places below {} looked at there",
            some,
            shell.places,
            mm(shell.floor_m)
        ),
    };
    format!(
        "within {} of the surface, {}: lambda {}{clipped}",
        mm(shell.reach_m),
        count(shell.layers, "layer"),
        largest(
            shell.lambda_n_per_m,
            shell.reason.as_deref(),
            shell.decided_at
        )
    )
}

fn wired(wiring: &WiringFile) -> String {
    let broken = wiring.broken.iter().map(|coil| format!("{coil} broken"));
    let series = wiring.series.iter();
    let series = series.map(|[a, b]| format!("{a}+{b} in series"));
    broken.chain(series).collect::<Vec<_>>().join(", ")
}

/// Up to where errors stay below what is felt.
fn not_felt(told: &TolerancePoint) -> String {
    let limit = format!(
        "the larger of {} of its force and {}",
        percent(told.share),
        force(told.threshold_n)
    );
    match (told.lambda_n_per_m, told.point) {
        (Some(lambda), Some(point)) => format!(
            "up to {} N/m currents keep every error within {limit}; point {point} decides",
            number(lambda)
        ),
        _ => format!("no largest lambda keeps every error within {limit}"),
    }
}

/// One row per variant.
fn table_of(variants: &[LambdaVariant]) -> String {
    let or_none =
        |value: Option<f64>, show: fn(f64) -> String| value.map_or_else(|| "none".to_owned(), show);
    let lambda = |value| or_none(value, |v| number_to(v, 4));
    let row = |v: &LambdaVariant| {
        let constants = Criterion::ALL
            .iter()
            .map(|&criterion| (criterion.name(), lambda(v.constants.of(criterion))));
        let mut row = vec![
            ("N/m, W", v.name.clone()),
            ("lambda", lambda(v.lambda_n_per_m)),
            ("change", or_none(v.relative_change, percent)),
        ];
        row.extend(constants);
        row.extend([
            ("worst-point jnd", lambda(v.worst_point_lambda_jnd_n_per_m)),
            ("rms error", or_none(v.relative_rms_error, percent)),
            ("worst error", or_none(v.worst_error_n, force)),
            ("power", lambda(v.power_w)),
        ]);
        row
    };
    headed_table(variants.iter().map(row))
}

/// What currents for the worst point would do instead.
fn worst_point(worst: &WorstPointFile) -> String {
    let constant = |lambda: Option<f64>| lambda.map_or_else(|| "none".to_owned(), number);
    let least = worst.worst_error_n.map_or_else(String::new, |least| {
        let relative = worst.relative_worst_error.map_or_else(String::new, |part| {
            format!(" ({} of the largest force)", percent(part))
        });
        format!("error at least {}{relative}; ", force(least))
    });
    format!(
        "{least}lambda by the worst point: linear {}, jnd {} N/m",
        constant(worst.lambda_linear_n_per_m),
        constant(worst.lambda_jnd_n_per_m)
    )
}

/// What the steel does at the chosen currents, where it follows a curve.
fn along_the_curve(point: &WorkingPointForces) -> String {
    let peak_t = point.peak_field_t.iter().copied().fold(0.0, f64::max);
    format!(
        "along its B-H curve forces {} off those added up: error rms {}, worst {}; \
         |B| up to {} T",
        percent(point.deviation_from_linear),
        force(point.rms_error_n),
        force(point.worst_error_n),
        number_to(peak_t, 4)
    )
}

fn operating_point(sheet: &mut Sheet, report: &LambdaReport) {
    let file = &report.file;
    let heights = &report.points.discretized.points.height_m;
    let mean_m = heights.iter().sum::<f64>() / heights.len() as f64;
    if let Some(lambda) = file.lambda_n_per_m {
        sheet.line(
            "force",
            &format!(
                "{} wanted at the mean height, {}",
                force(lambda * mean_m),
                mm(mean_m)
            ),
        );
    }
    if let (Some(rms), Some(worst)) = (file.rms_error_n, file.worst_error_n) {
        let relative = file.relative_rms_error.map_or_else(String::new, |part| {
            format!(" ({} of the rms force)", percent(part))
        });
        sheet.line(
            "error",
            &format!("rms {}{relative}, worst {}", force(rms), force(worst)),
        );
    }
}

/// How many points there are, how high, and what was left out.
fn points(report: &LambdaReport) -> String {
    let points = &report.points.summary;
    if let Some(sampled) = &report.file.sampling {
        let change = sampled.relative_change.map_or_else(String::new, |change| {
            let sign = if change < 0.0 { "-" } else { "+" };
            format!("; lambda {sign}{} against those", percent(change.abs()))
        });
        return format!(
            "{} {}, weighted by area, instead of the grid's {}{change}",
            report.file.points, sampled.sampling, sampled.grid_points
        );
    }
    let outside = if points.outside > 0 {
        let outside = count(points.outside, "grid point");
        format!("; {outside} without surface left out")
    } else {
        String::new()
    };
    format!(
        "{}, {} high{outside}",
        points.points,
        describe::heights(points.min_height_m, points.max_height_m)
    )
}
