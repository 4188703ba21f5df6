//! The result of `compare` for people.

use super::{CompareReport, ComparedShape, Place};
use crate::cli::describe;
use crate::cli::layout::{Sheet, table};
use crate::cli::quantity::{count, force, number_to, percent};
use crate::digits::with_error;

/// The result for people.
pub(super) fn summary(report: &CompareReport) -> String {
    let mut sheet = Sheet::new(&format!(
        "{} on {}: differences of force in just-noticeable ones ({}, at least {})",
        count(report.shapes.len(), "object"),
        report.design,
        percent(report.jnd),
        force(report.threshold_n)
    ));
    for (k, shape) in report.shapes.iter().enumerate() {
        let label = if k == 0 { "objects" } else { "" };
        sheet.line(label, &object(shape));
    }
    let stages = report.accuracy.iter();
    let stages = stages.map(|(name, stage)| (*name, stage));
    sheet.line("accuracy", &describe::accuracy(stages));
    sheet.gap();
    sheet.raw(&table_of(report));
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
        lambda_with_error(shape),
        count(shape.points, "point")
    )
}

fn lambda_with_error(shape: &ComparedShape) -> String {
    match (shape.lambda_n_per_m, shape.lambda_error) {
        (Some(lambda), Some(relative)) if relative > 0.0 => {
            format!("{} N/m", with_error(lambda, relative * lambda))
        }
        (lambda, _) => describe::force_constant(lambda),
    }
}

/// One line a pair.
fn table_of(report: &CompareReport) -> String {
    let head = [
        "", "", "static", "rms", "felt", "vector", "at mm", "feedback", "rms", "felt", "vector",
        "at mm",
    ];
    let none = || "none".to_owned();
    let number_or_none = |value: Option<f64>| value.map_or_else(none, |v| number_to(v, 4));
    let part = |share: Option<f64>| share.map_or_else(none, percent);
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(report.pairs.iter().map(|pair| {
        vec![
            pair.a.clone(),
            pair.b.clone(),
            number_or_none(pair.static_jnd),
            number_or_none(pair.static_rms_jnd),
            part(pair.static_felt_share),
            number_or_none(pair.static_vector_jnd),
            at(pair.static_at.as_ref()),
            number_or_none(pair.feedback_jnd),
            number_or_none(pair.feedback_rms_jnd),
            part(pair.feedback_felt_share),
            number_or_none(pair.feedback_vector_jnd),
            at(pair.feedback_at.as_ref()),
        ]
    }));
    table("llrrrrrrrrrr", &rows)
}

fn at(place: Option<&Place>) -> String {
    place.map_or_else(String::new, |place| {
        let at = [place.x_m, place.y_m, place.z_m].map(|c| number_to(c * 1e3, 4));
        format!("({})", at.join(", "))
    })
}
