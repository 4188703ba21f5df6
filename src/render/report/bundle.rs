//! The page of a calibrated object.

use fluxform_bundle::artefact::Input;
use fluxform_bundle::manifest::LeftOut;
use serde_json::{Map, Value, json};

use super::data::{CalibratedObject, DrivenCoil};
use super::frame::{Page, Section};
use super::html::{Cell, Html, Table};
use super::number::{count, figures, force, percent};
use super::{directions, error_budget, field, limits, path, surface};

/// The page.
#[must_use]
pub fn page(object: &CalibratedObject, files: &[&str]) -> String {
    let file = object.lambda;
    let mut data = Map::new();
    data.insert("coils".to_owned(), coils(object));
    let mut sections = vec![
        answer(object),
        error_budget::section(object, &mut data),
        limits::section(object),
        path::section(object, &mut data),
        surface::section(object, &mut data),
    ];
    sections.extend(directions::section(object));
    sections.extend([field::section(object, &mut data), sources(object, files)]);
    Page {
        kind: "Calibration",
        title: format!("{} on {}", file.shape, file.design),
        lead: lead(object),
        sections,
        data: Value::Object(data),
        foot: format!(
            "fluxform {}. This page needs nothing but itself; all its numbers come from the files \
             of this bundle.",
            file.fluxform_version
        ),
    }
    .html()
}

fn coils(object: &CalibratedObject) -> Value {
    let one = |coil: &DrivenCoil| {
        json!({
            "x": coil.axis_m[0] * 1e3,
            "y": coil.axis_m[1] * 1e3,
            "radius": object.coil_radius_m * 1e3,
            "current": coil.current_a,
            "min": coil.min_a,
            "max": coil.max_a,
        })
    };
    Value::Array(object.coils().iter().map(one).collect())
}

fn lead(object: &CalibratedObject) -> Html {
    let mut html = Html::default();
    let file = object.lambda;
    match (file.lambda_n_per_m, file.rms_error_n) {
        (Some(lambda), Some(rms_n)) => html.element(
            "p class=\"lead\"",
            &format!(
                "A finger at height h above the coils is to feel the force \u{3bb}h. With one set \
                 of static currents for the whole object \u{3bb} is {} N/m, and the force is off by \
                 {}.",
                figures(lambda, 5),
                rms_error(rms_n, file.relative_rms_error)
            ),
        ),
        (None, _) | (_, None) => html.element(
            "p class=\"lead\"",
            "There is no force constant for this object: nothing can be rendered as asked.",
        ),
    };
    html
}

fn rms_error(rms_n: f64, relative: Option<f64>) -> String {
    let error = force(rms_n);
    match relative {
        Some(part) => format!("{error} rms, {} of the rms force", percent(part)),
        None => format!("{error} rms"),
    }
}

fn tile(html: &mut Html, name: &str, value: &str, more: &str) {
    html.raw("<div><dt>")
        .text(name)
        .raw("</dt><dd><b>")
        .text(value)
        .raw("</b><span>")
        .text(more)
        .raw("</span></dd></div>");
}

fn answer(object: &CalibratedObject) -> Section {
    let mut body = Html::default();
    body.raw("<dl class=\"tiles\">");
    let file = object.lambda;
    let by = file.criterion.described(&percent(file.jnd));
    let by = format!("chosen by {by}");
    let coils = object.coils();
    let lambda = match file.lambda_n_per_m {
        None => "none".to_owned(),
        Some(lambda) => format!("{} N/m", figures(lambda, 5)),
    };
    tile(&mut body, "force constant \u{3bb}", &lambda, &by);
    if let (Some(rms_n), Some(worst_n)) = (file.rms_error_n, file.worst_error_n) {
        let relative = file.relative_rms_error.map_or_else(String::new, |part| {
            format!("{} of the rms force", percent(part))
        });
        tile(&mut body, "rms error", &force(rms_n), &relative);
        let at = object.worst_place().map_or_else(String::new, |at| {
            format!("of {} wanted there", force(at.wanted_n))
        });
        tile(&mut body, "worst error", &force(worst_n), &at);
        let bound = coils.iter().filter(|coil| coil.at_limit()).count();
        let sum: f64 = coils.iter().map(|coil| coil.current_a).sum();
        tile(
            &mut body,
            "coils at limit",
            &format!("{bound} of {}", coils.len()),
            &format!("{} A in all", figures(sum, 4)),
        );
    }
    body.raw("</dl>");
    if file.lambda_n_per_m.is_some() {
        body.table(&limits::currents(&coils));
    }
    Section {
        id: "answer",
        title: "The answer",
        body,
    }
}

fn sources(object: &CalibratedObject, files: &[&str]) -> Section {
    let mut body = Html::default();
    let input = |input: &Input| -> Vec<Cell> {
        vec![input.path.as_str().into(), input.sha256.as_str().into()]
    };
    body.table(&Table {
        caption: "Files and their digests".to_owned(),
        head: vec![("file", false), ("sha256", false)],
        rows: object.lambda.inputs.iter().map(input).collect(),
        prose: true,
    });
    if !object.manifest.left_out.is_empty() {
        let row = |left: &LeftOut| -> Vec<Cell> {
            let cost = if left.error_cost > 0.0 {
                percent(left.error_cost)
            } else {
                "none".to_owned()
            };
            vec![
                left.what.as_str().into(),
                cost.into(),
                left.why.as_str().into(),
            ]
        };
        body.table(&Table {
            caption: "What was left out because the object does not need it".to_owned(),
            head: vec![("what", false), ("error it costs", true), ("why", false)],
            rows: object.manifest.left_out.iter().map(row).collect(),
            prose: true,
        });
    }
    body.element("h3", "Files of this bundle")
        .raw("<ul class=\"files\">");
    for file in files {
        body.raw("<li><code>").text(file).raw("</code></li>");
    }
    body.raw("</ul>");
    body.element(
        "p class=\"note\"",
        &format!(
            "{} of this bundle are listed with their digests in manifest.json; `fluxform verify` \
             checks them and computes the numbers again by another route.",
            count(files.len(), "file")
        ),
    );
    Section {
        id: "sources",
        title: "What went in",
        body,
    }
}

#[cfg(test)]
mod tests;
