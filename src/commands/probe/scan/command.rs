//! `probe --compare`: arguments and summary of a measured scan held against the design.

use clap::{Args, ValueEnum};

use super::{Fitted, ScanRequest, compare};
use crate::RunError;
use crate::bundle::atomic::{self, Overwrite, check_distinct};
use crate::bundle::scan::{Explanation, FitFile, Left, ScanFile, ScanPlace};
use crate::cli::describe;
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::layout::{Sheet, table};
use crate::cli::pictures::{Picture, table_or_drawing};
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{count, number, number_to, percent, si};
use crate::cli::start::accuracy_check;
use crate::cli::start::begin;
use crate::cli::values::{self, FileArgument};
use crate::commands::probe::command::Probe;
use crate::design::Need;

/// How every table of residuals begins.
const HEADER: &str = "x_m,y_m,z_m,";

/// Explanations beyond this many are in the JSON object alone.
const EXPLANATIONS: usize = 8;

/// Arguments of points, which a scan takes the place of.
const OF_POINTS: [&str; 3] = ["points", "components", "magnet_force"];

/// A measured scan in the points' place.
#[derive(Debug, Args)]
#[command(next_help_heading = "A measured scan")]
pub struct ScanFlags {
    /// Hold this gaussmeter's scan against the design (CSV; `-` for standard input)
    #[arg(long, value_name = "SCAN", conflicts_with = "points")]
    pub compare: Option<FileArgument>,
    /// Parameters to fit: any of scale, background, position, rotation
    #[arg(long, hide_short_help = true, value_name = "WHAT", value_enum, value_delimiter = ',', requires = "compare",
          conflicts_with_all = OF_POINTS, default_values = ["scale", "background", "position"])]
    fit: Vec<What>,
    /// The sensor's noise in tesla: field residuals are held against it; estimated from them where not given
    #[arg(long, hide_short_help = true, value_name = "T", value_parser = values::noise, requires = "compare",
          conflicts_with_all = OF_POINTS)]
    noise_t: Option<f64>,
    /// The noise of measured gradients in T/m, likewise
    #[arg(long, hide_short_help = true, value_name = "G", value_parser = values::noise, requires = "compare",
          conflicts_with_all = OF_POINTS)]
    noise_t_per_m: Option<f64>,
    /// Draw measured over computed values, and the residuals beside their noise (.svg, .png or .pdf)
    #[arg(long, hide_short_help = true, value_name = "FILE", value_parser = values::picture, requires = "compare",
          conflicts_with_all = OF_POINTS)]
    plot: Option<FileArgument>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// A scale for each coil
    Scale,
    /// A constant field
    Background,
    /// Pose of the sensor's frame
    Position,
    /// How the sensor's frame is turned
    Rotation,
}

impl ScanFlags {
    fn request(&self, tolerance: Option<f64>) -> ScanRequest {
        let asked = |what| self.fit.contains(&what);
        ScanRequest {
            fitted: Fitted {
                scale: asked(What::Scale),
                background: asked(What::Background),
                position: asked(What::Position),
                rotation: asked(What::Rotation),
            },
            noise_t: self.noise_t,
            noise_t_per_m: self.noise_t_per_m,
            tolerance,
        }
    }
}

impl Probe {
    /// Holds a scan against the design.
    pub(crate) fn compare(&self, scan: &FileArgument, printer: &Printer) -> Result<(), Failure> {
        documents::one_standard_input([&self.design, scan])?;
        let document = documents::design(&self.design, Need::PROBE, printer)?;
        let design = &document.design;
        let name = scan.as_given().display().to_string();
        let (scan, input) = documents::scan(scan, design.array.positions_m.len())?;
        let inputs = vec![document.input.clone(), input];
        let out = self.out.as_ref();
        let overwrite = Overwrite::beginning(self.writing.force, HEADER, &inputs)
            .protecting(document.also_read());
        if let Some(FileArgument::Path(path)) = out
            && !atomic::is_stream(path)
        {
            overwrite.check(path).map_err(RunError::from)?;
        }
        let plot = self.scan.plot.as_ref();
        if let Some(out) = out {
            table_or_drawing(out, plot)?;
            check_distinct(plot.iter().chain([&out]).map(|file| file.as_given()))
                .map_err(RunError::from)?;
        }
        let plot = plot.map(|file| Picture::new(file, self.writing.force, document.also_read()));
        if let Some(plot) = &plot {
            plot.check(&inputs)?;
        }
        let bar = begin(printer);
        let request = self.scan.request(self.tolerance.tolerance);
        let report = compare(design, &scan, &name, inputs, &request, &bar)?;
        drop(bar);
        for warning in &report.warnings {
            printer.warning(warning);
        }
        let mut place = Stream::Output;
        match out {
            None => {}
            Some(FileArgument::Standard) => {
                printer.data(|out| scan.write_residuals(out, &report.predicted, &report.fitted))?;
                place = Stream::Error;
            }
            Some(FileArgument::Path(path)) => {
                atomic::write(path, &overwrite, |out| {
                    scan.write_residuals(out, &report.predicted, &report.fitted)
                })
                .map_err(RunError::from)?;
            }
        }
        if let Some(plot) = &plot {
            let drawing = report.picture(&scan, &name).drawing();
            place = place.or(plot.draw(&report.file.inputs, &drawing, printer)?);
        }
        let json = printer.with_warnings(&report.file);
        printer.summary(place, &json, || text(&report.file, &name, out))?;
        accuracy_check(&report.accuracy_missed)
    }
}

fn text(file: &ScanFile, name: &str, out: Option<&FileArgument>) -> String {
    let mut sheet = Sheet::new(&format!(
        "{name} against {}: {} of {} in {}",
        file.design,
        count(file.values, "value"),
        file.measured.join(", "),
        count(file.rows, "row")
    ));
    sheet.line("as designed", &left(&file.residuals.as_designed));
    sheet.line("fitted", &left(&file.residuals.fitted));
    let fit = &file.fit;
    if let (Some(values), Some(errors)) = (fit.position_m, fit.position_error_m) {
        let text = three(values, errors, 1e3, "mm");
        sheet.line("position", &format!("{text}, to be added to the scan's"));
    }
    if let (Some(values), Some(errors)) = (fit.rotation_deg, fit.rotation_error_deg) {
        sheet.line("rotation", &three(values, errors, 1.0, "deg"));
    }
    if let (Some(values), Some(errors)) = (fit.background_t, fit.background_error_t) {
        sheet.line("background", &three(values, errors, 1e6, "uT"));
    }
    noise_rows(&mut sheet, &file.residuals.fitted);
    for set in &fit.undetermined {
        let text = match &set[..] {
            [one] => format!("{one}: changes nothing at these points, not fitted"),
            _ => format!(
                "{}: only some combinations; scan elsewhere too",
                set.join(", ")
            ),
        };
        sheet.line("not fitted", &text);
    }
    let best = file.best_explanation.as_deref();
    sheet.line(
        "explanation",
        &match best {
            Some(best) => explained(file.explanations.iter().find(|e| e.parameter == best), best),
            None => "no single parameter: what is left looks like noise to all of them".to_owned(),
        },
    );
    let stages = file
        .accuracy
        .iter()
        .map(|(name, stage)| (name.as_str(), stage));
    sheet.line("accuracy", &describe::accuracy(stages));
    if let Some(FileArgument::Path(path)) = out {
        sheet.line("written to", &path.display().to_string());
    }
    if !fit.scales.is_empty() {
        sheet.gap();
        sheet.raw(&scales(fit));
    }
    sheet.gap();
    sheet.raw(&explanations(&file.explanations));
    if let Some(line) = &fit.gain_toml {
        sheet.gap();
        sheet.raw(&format!("For the design's [array]:\n{line}\n"));
    }
    sheet.finish()
}

/// What is left beside each stated noise.
fn noise_rows(sheet: &mut Sheet, fitted: &Left) {
    let field = fitted.field.as_ref().map(|f| f.reduced_chi_square);
    let gradient = fitted.gradient.as_ref().map(|g| g.reduced_chi_square);
    let both = field.is_some() && gradient.is_some();
    for (kind, ratio) in [("field", field.flatten()), ("gradient", gradient.flatten())] {
        let Some(ratio) = ratio else { continue };
        let of = if both {
            format!("{kind}: ")
        } else {
            String::new()
        };
        let verdict = if ratio > 2.0 {
            "more is left than the stated noise"
        } else {
            "the stated noise is what is left"
        };
        let ratio = number_to(ratio, 3);
        sheet.line(
            "noise",
            &format!("{of}{verdict}: chi-square {ratio} a degree of freedom"),
        );
    }
}

fn left(left: &Left) -> String {
    let mut lines = Vec::new();
    let mut line = |rms: String,
                    part: String,
                    largest: String,
                    at: &ScanPlace,
                    [stated, estimated]: [Option<String>; 2],
                    model: String| {
        let stated = stated.map(|noise| format!(", stated noise {noise}"));
        let estimated = estimated.map(|noise| format!(", estimated noise {noise}"));
        let noise = stated.or(estimated).unwrap_or_default();
        lines.push(format!(
            "rms {rms}{part}{noise}; largest {largest}, {} in line {}; computed to {model}",
            at.column, at.line
        ));
    };
    let part = |rms: f64, of: f64| match rms / of {
        part if of > 0.0 => format!(" ({} of the measured)", percent(part)),
        _ => String::new(),
    };
    if let Some(f) = &left.field {
        line(
            si(f.rms_t, "T"),
            part(f.rms_t, f.measured_rms_t),
            si(f.largest_t, "T"),
            &f.at,
            [f.noise_t, f.estimated_noise_t].map(|noise| Some(si(noise?, "T"))),
            si(f.model_error_t, "T"),
        );
    }
    if let Some(g) = &left.gradient {
        line(
            si(g.rms_t_per_m, "T/m"),
            part(g.rms_t_per_m, g.measured_rms_t_per_m),
            si(g.largest_t_per_m, "T/m"),
            &g.at,
            [g.noise_t_per_m, g.estimated_noise_t_per_m].map(|noise| Some(si(noise?, "T/m"))),
            si(g.model_error_t_per_m, "T/m"),
        );
    }
    lines.join("\n")
}

/// Three numbers with their errors, `factor` of the unit each.
fn three(values: [Option<f64>; 3], errors: [Option<f64>; 3], factor: f64, unit: &str) -> String {
    let one = |((axis, value), error): ((&str, Option<f64>), Option<f64>)| match (value, error) {
        (Some(value), Some(error)) => format!(
            "{axis} {} +- {} {unit}",
            number_to(value * factor, 4),
            number_to(error * factor, 2)
        ),
        _ => format!("{axis} not determined"),
    };
    let all = ["x", "y", "z"].into_iter().zip(values).zip(errors).map(one);
    all.collect::<Vec<_>>().join(", ")
}

fn scales(fit: &FitFile) -> String {
    let mut rows = vec![["coil", "scale", "+-", "gain"].map(str::to_owned).to_vec()];
    for scale in &fit.scales {
        let shown =
            |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.6}"));
        rows.push(vec![
            scale.coil.to_string(),
            shown(scale.scale),
            scale
                .standard_error
                .map_or_else(|| "-".to_owned(), |e| number_to(e, 2)),
            shown(scale.gain),
        ]);
    }
    table("rrrr", &rows)
}

fn explained(found: Option<&Explanation>, name: &str) -> String {
    let Some(found) = found else {
        return name.to_owned();
    };
    let alike = if found.alike.is_empty() {
        String::new()
    } else {
        format!(
            "; this scan cannot distinguish it from {}",
            found.alike.join(", ")
        )
    };
    format!(
        "{name}, which takes {} of the residuals' squares away{alike}",
        percent(found.share)
    )
}

fn explanations(list: &[Explanation]) -> String {
    let head = ["explains", "share", "free", "change", "+-"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for found in list.iter().take(EXPLANATIONS) {
        let shown = |value: Option<f64>| value.map_or_else(String::new, number);
        let error = found
            .standard_error
            .map_or_else(String::new, |e| number_to(e, 2));
        let name = if found.parameter == "height" {
            "height, m"
        } else {
            &found.parameter
        };
        rows.push(vec![
            name.to_owned(),
            percent(found.share),
            found.parameters.to_string(),
            shown(found.change),
            error,
        ]);
    }
    table("lrrrr", &rows)
}
