//! `calibrate`: the summary on screen, what the finger feels first.

use std::collections::BTreeMap;
use std::path::Path;

use super::{BundleReport, CalibrateReport};
use crate::bundle::headline::Headline;
use crate::bundle::lambda_file::{LambdaFile, WorkingPointForces};
use crate::bundle::manifest::{LeftOut, Manifest};
use crate::cli::describe;
use crate::cli::layout::{Sheet, headed_table};
use crate::cli::quantity::{
    bytes, count, error, length_error, number, number_to, percent, share, share_within,
};
use crate::design::Design;
use crate::digits::with_error;
use crate::lambda::GivenForce;

/// The summary of a run whose bundles are below `folder`.
pub fn summary(design: &Design, report: &CalibrateReport, folder: &Path) -> String {
    let mut sheet = Sheet::new(&format!(
        "{} on {} ({})",
        count(report.bundles.len(), "shape"),
        design.name,
        describe::array(design)
    ));
    let requested = of_shapes(report, |file| {
        describe::requested_error(file.headline.as_ref()?)
    });
    if !requested.is_empty() {
        sheet.line("error", &requested.join("\n"));
    }
    for table in [force_table, shapes_table, constants_table] {
        sheet.gap();
        sheet.raw(&table(report));
    }
    sheet.gap();
    let Some(first) = report.bundles.first() else {
        return sheet.finish();
    };
    let file = &first.lambda.file;
    sheet.line(
        "lambda",
        &format!("chosen by {}", describe::chosen_by(file)),
    );
    force_lines(&mut sheet, report);
    let heat = of_shapes(report, |file| {
        Some(describe::heating(file.hottest_coil.as_ref()?))
    });
    if !heat.is_empty() {
        sheet.line("heat", &heat.join("\n"));
    }
    sheet.line("accuracy", &accuracies(report));
    if let Some(steel) = working_points(report) {
        sheet.line("steel", &steel);
    }
    sheet.line("left out", &left_out(report));
    let total = report.bundles.iter().map(|b| size(&b.manifest)).sum();
    sheet.line(
        "written to",
        &format!(
            "{}: {}, {}",
            folder.display(),
            count(report.bundles.len(), "bundle"),
            bytes(total)
        ),
    );
    sheet.finish()
}

/// The force of every shape against the requested one, with static currents and with feedback.
fn force_table(report: &CalibrateReport) -> String {
    headed_table(report.bundles.iter().flat_map(force_rows))
}

fn force_rows(bundle: &BundleReport) -> Vec<Vec<(&'static str, String)>> {
    let file = &bundle.lambda.file;
    let headline = file.headline.as_ref();
    let felt = headline.and_then(|of| of.felt.as_ref());
    let off = felt.and_then(|of| of.sampling).unwrap_or_default();
    let felt = felt.map(|of| of.total);
    let sideways = file.sideways.as_ref();
    let fixed = ForceRow {
        shape: file.shape.clone(),
        lambda: lambda(file).unwrap_or_else(|| "none".to_owned()),
        off_by: felt.map(|of| (of.fixed, off.fixed)),
        sideways: sideways.map(|of| of.static_share),
        degrees: sideways.map(|of| of.static_median_deg),
        given: headline.and_then(|of| of.static_currents),
    };
    // That of the upward force alone: where a vector is requested, `off by` has all there is.
    let of_upward = sideways.filter(|_| bundle.manifest.force.is_none());
    let feedback = ForceRow {
        shape: "  with feedback".to_owned(),
        off_by: felt.map(|of| (of.feedback, off.feedback)),
        sideways: of_upward.map(|of| of.feedback_share),
        given: headline.and_then(|of| of.feedback),
        ..ForceRow::default()
    };
    let robust = felt.and_then(|of| of.robust).map(|robust| ForceRow {
        shape: "  the same, robust".to_owned(),
        off_by: Some((robust, off.robust.unwrap_or(0.0))),
        ..ForceRow::default()
    });
    let rows = [Some(fixed), Some(feedback), robust];
    rows.into_iter().flatten().map(ForceRow::cells).collect()
}

/// The part of the requested force that one way of driving the coils gives.
#[derive(Default)]
struct ForceRow {
    shape: String,
    lambda: String,
    /// With by how much it may be off.
    off_by: Option<(f64, f64)>,
    sideways: Option<f64>,
    degrees: Option<f64>,
    given: Option<GivenForce>,
}

impl ForceRow {
    fn cells(self) -> Vec<(&'static str, String)> {
        let range =
            |of: GivenForce| format!("{} to {}", number_to(of.least * 100.0, 3), percent(of.most));
        let off_by = self.off_by.map(|(of, off)| share_within(of, off));
        vec![
            ("shape", self.shape),
            ("lambda N/m", self.lambda),
            ("off by", off_by.unwrap_or_default()),
            ("sideways", self.sideways.map(percent).unwrap_or_default()),
            (
                "degrees",
                self.degrees
                    .map(|of| format!("{of:.0}"))
                    .unwrap_or_default(),
            ),
            (
                "upward",
                self.given.map(|of| percent(of.mean)).unwrap_or_default(),
            ),
            ("over the points", self.given.map(range).unwrap_or_default()),
        ]
    }
}

/// Lines below the table of forces: saturation, the error of the computation, uncertainties.
fn force_lines(sheet: &mut Sheet, report: &CalibrateReport) {
    sheet.line(
        "force",
        "off by, sideways: of the vector, relative to the requested force; upward: mean given of it\n\
         rms, relative, worst: upward force against lambda h, one set of currents for all points",
    );
    let above = of_shapes(report, |file| {
        let fixed = file.headline.as_ref()?.static_currents.as_ref()?;
        let text = "lambda is above saturation: all currents are at their limits";
        fixed.above_saturation.then(|| text.to_owned())
    });
    if !above.is_empty() {
        sheet.line("saturated", &above.join("\n"));
    }
    let errors = of_shapes(report, |file| Some(computed(file.headline.as_ref()?)));
    sheet.line("computed", &errors.join("\n"));
    let jumps = report.bundles.iter().filter_map(|bundle| {
        let file = &bundle.lambda.file;
        let jumps = file.headline.as_ref()?.jumps?;
        Some(format!("{} of {}", percent(jumps), file.shape))
    });
    let jumps: Vec<String> = jumps.collect();
    if !jumps.is_empty() {
        sheet.line(
            "",
            &format!(
                "left out of it: {}, points where the surface jumps and the force within a cell with it",
                jumps.join(", ")
            ),
        );
    }
    let uncertain = of_shapes(report, |file| {
        file.uncertainty.as_ref().map(describe::uncertainty)
    });
    if !uncertain.is_empty() {
        sheet.line("uncertain", &uncertain.join("\n"));
    }
}

/// The largest part of what the computation adds to the force, and what would halve it.
fn computed(headline: &Headline) -> String {
    let largest = headline.budget.first().map_or_else(String::new, |part| {
        format!(", {} by the {}", share(part.error), part.part.words())
    });
    let cure = (headline.to_halve.iter()).map(|cure| format!("; to halve that: {cure}"));
    format!(
        "up to {}{largest}{}",
        share(headline.force_error),
        cure.collect::<String>()
    )
}

/// The lines of every shape, each beginning with its name; one line where it is that of all.
fn of_shapes(
    report: &CalibrateReport,
    text: impl Fn(&LambdaFile) -> Option<String>,
) -> Vec<String> {
    let files = report.bundles.iter().map(|bundle| &bundle.lambda.file);
    let texts = files.filter_map(|file| Some((&file.shape, text(file)?)));
    let texts: Vec<(&String, String)> = texts.collect();
    match texts.first() {
        Some((_, first))
            if texts.len() == report.bundles.len()
                && texts.iter().all(|(_, text)| text == first) =>
        {
            vec![first.clone()]
        }
        _ => (texts.into_iter())
            .map(|(shape, text)| format!("{shape}: {}", text.replace('\n', "\n  ")))
            .collect(),
    }
}

/// Parts that the bundles leave out: a line for each, with its reason where that is the same of all
/// shapes that do without it.
fn left_out(report: &CalibrateReport) -> String {
    let mut things: BTreeMap<&str, Vec<(&str, &LeftOut)>> = BTreeMap::new();
    for bundle in &report.bundles {
        for part in &bundle.manifest.left_out {
            let of = things.entry(&part.what).or_default();
            of.push((&bundle.manifest.shape, part));
        }
    }
    let line = |(what, of): (&str, Vec<(&str, &LeftOut)>)| {
        let first = of[0].1;
        if of.iter().all(|(_, part)| *part == first) {
            let text = describe::left_out(std::slice::from_ref(first));
            let of_all = of.len() == report.bundles.len();
            return if of_all {
                text
            } else {
                let shapes: Vec<&str> = of.iter().map(|(shape, _)| *shape).collect();
                format!("{}: {text}", shapes.join(", "))
            };
        }
        let costs: Vec<String> = (of.iter())
            .map(|(shape, part)| {
                let cost = part.error_cost.map(share);
                format!("{shape} {}", cost.unwrap_or_else(|| "not known".to_owned()))
            })
            .collect();
        let why = first.why.split(';').next().unwrap_or_default();
        format!("{what}: {why}; costs {}", costs.join(", "))
    };
    let lines: Vec<String> = things.into_iter().map(line).collect();
    if lines.is_empty() {
        "nothing".to_owned()
    } else {
        lines.join("\n")
    }
}

/// Errors of the upward force with the static currents, one row per shape.
fn shapes_table(report: &CalibrateReport) -> String {
    let or_none = |value: Option<String>| value.unwrap_or_else(|| "none".to_owned());
    let row = |bundle: &BundleReport| {
        let file = &bundle.lambda.file;
        vec![
            ("static force", file.shape.clone()),
            ("points", file.points.to_string()),
            (
                "rms mN",
                or_none(file.rms_error_n.map(|n| number(n * 1000.0))),
            ),
            ("relative", or_none(file.relative_rms_error.map(percent))),
            (
                "worst mN",
                or_none(file.worst_error_n.map(|n| number(n * 1000.0))),
            ),
            ("at limit", or_none(at_limit(bundle))),
        ]
    };
    headed_table(report.bundles.iter().map(row))
}

/// lambda with its error, N/m.
fn lambda(file: &LambdaFile) -> Option<String> {
    let headline = file.headline.as_ref();
    let known = headline.map(|of| with_error(of.lambda_n_per_m, of.lambda_error_n_per_m));
    known.or_else(|| file.lambda_n_per_m.map(number))
}

/// Every force constant, one row per shape.
fn constants_table(report: &CalibrateReport) -> String {
    let row = |bundle: &BundleReport| {
        let file = &bundle.lambda.file;
        let named = file.constants.named().into_iter().map(|one| {
            let lambda = one.lambda_n_per_m.map_or_else(|| "none".to_owned(), number);
            (one.name, lambda)
        });
        [("lambda N/m", file.shape.clone())]
            .into_iter()
            .chain(named)
            .collect()
    };
    headed_table(report.bundles.iter().map(row))
}

/// How many coils carry all they may, and whether their sum does.
fn at_limit(bundle: &BundleReport) -> Option<String> {
    let currents = bundle.lambda.file.currents_a.as_ref()?;
    let limits = &bundle.manifest.limits;
    let coils = currents.iter().enumerate();
    let bound = coils
        .filter(|(coil, current)| limits.is_reached(*coil, **current))
        .count();
    // Rounding may leave the sum a few bits below its limit.
    let sum: f64 = currents.iter().sum();
    let total = limits.total_current_max_a;
    let full = total.is_some_and(|total| sum >= total * (1.0 - 1e-12));
    let coils = count(bound, "coil");
    Some(if full { format!("{coils}, sum") } else { coils })
}

/// How far forces along the B-H curve are off those added up, where the design gives a curve.
fn working_points(report: &CalibrateReport) -> Option<String> {
    let points: Vec<&WorkingPointForces> = report
        .bundles
        .iter()
        .filter_map(|bundle| bundle.lambda.file.working_point.as_ref())
        .collect();
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
    (!points.is_empty()).then(|| {
        format!(
            "along its B-H curve forces {} off those added up at most; |B| up to {} T",
            percent(largest(&mut points.iter().map(|p| p.deviation_from_linear))),
            number_to(
                largest(&mut points.iter().flat_map(|p| p.peak_field_t.iter().copied())),
                4
            )
        )
    })
}

/// The largest error of each stage over all shapes.
fn accuracies(report: &CalibrateReport) -> String {
    let largest = |stage: &str| {
        let stages = report.bundles.iter();
        stages
            .filter_map(|bundle| bundle.manifest.accuracy.get(stage))
            .map(|accuracy| accuracy.estimate)
            .fold(0.0, f64::max)
    };
    let between = report
        .bundles
        .iter()
        .map(|bundle| bundle.manifest.map.interpolation.largest_error)
        .fold(0.0, f64::max);
    let pull = largest("passive_force");
    let pull = if pull > 0.0 {
        format!("; steel's pull {} of itself", error(pull))
    } else {
        String::new()
    };
    format!(
        "heights {}; forces {}, map nodes {}, between nodes {} of the largest gradient at their \
         height{pull}",
        length_error(largest("points")),
        error(largest("forces")),
        error(largest("map")),
        error(between)
    )
}

fn size(manifest: &Manifest) -> u64 {
    manifest.files.iter().map(|file| file.bytes).sum()
}
