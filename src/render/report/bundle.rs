//! The page of a calibrated object.

use fluxform_bundle::artefact::Input;
use fluxform_bundle::lambda_file::LambdaFile;
use fluxform_bundle::manifest::LeftOut;
use serde_json::{Map, Value, json};

use super::data::BundleFacts;
use super::frame::{Page, Section};
use super::html::{Cell, Html, Table};
use super::number::{count, figures, force, percent};
use super::{field, good, limits, path, surface};

/// The page.
#[must_use]
pub fn page(facts: &BundleFacts) -> String {
    let mut data = Map::new();
    data.insert("coils".to_owned(), coils(facts));
    let sections = vec![
        answer(facts),
        good::section(facts, &mut data),
        limits::section(facts),
        path::section(facts, &mut data),
        surface::section(facts, &mut data),
        field::section(facts, &mut data),
        sources(facts),
    ];
    Page {
        kind: "Calibration",
        title: format!("{} on {}", facts.lambda.shape, facts.lambda.design),
        lead: lead(facts),
        sections,
        data: Value::Object(data),
        foot: format!(
            "fluxform {}. This page needs nothing but itself; all its numbers come from the files \
             of this bundle.",
            facts.lambda.fluxform_version
        ),
    }
    .html()
}

fn coils(facts: &BundleFacts) -> Value {
    let one = |coil: &super::data::CoilFacts| {
        json!({
            "x": coil.axis_m[0] * 1e3,
            "y": coil.axis_m[1] * 1e3,
            "radius": coil.radius_m * 1e3,
            "current": coil.current_a,
            "min": coil.min_a,
            "max": coil.max_a,
        })
    };
    Value::Array(facts.coils.iter().map(one).collect())
}

fn lead(facts: &BundleFacts) -> Html {
    let mut html = Html::default();
    match facts.lambda.lambda_n_per_m {
        Some(lambda) => html.element(
            "p class=\"lead\"",
            &format!(
                "A finger at height h above the coils is to feel the force \u{3bb}h. With one set \
                 of static currents for the whole object \u{3bb} is {} N/m, and the force is off by \
                 {} rms{}.",
                figures(lambda, 5),
                force(facts.lambda.rms_error_n.unwrap_or(0.0)),
                relative(facts.lambda, ", ")
            ),
        ),
        None => html.element(
            "p class=\"lead\"",
            "There is no force constant for this object: nothing can be rendered as asked.",
        ),
    };
    html
}

/// The relative error in words, after `before`; nothing where no force is wanted.
fn relative(file: &LambdaFile, before: &str) -> String {
    file.relative_rms_error.map_or_else(String::new, |part| {
        format!("{before}{} of the rms force", percent(part))
    })
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

fn answer(facts: &BundleFacts) -> Section {
    let mut body = Html::default();
    body.raw("<dl class=\"tiles\">");
    let file = facts.lambda;
    let by = file.criterion.described(&percent(file.jnd));
    let by = format!("chosen by {by}");
    match file.lambda_n_per_m {
        None => tile(&mut body, "force constant \u{3bb}", "none", &by),
        Some(lambda) => {
            let lambda = format!("{} N/m", figures(lambda, 5));
            tile(&mut body, "force constant \u{3bb}", &lambda, &by);
            let error = |n: Option<f64>| force(n.unwrap_or(0.0));
            let rms = error(file.rms_error_n);
            tile(&mut body, "rms error", &rms, &relative(file, ""));
            let at = facts.worst_at.map_or_else(String::new, |at| {
                format!("of {} wanted there", force(at.wanted_n))
            });
            let worst = error(file.worst_error_n);
            tile(&mut body, "worst error", &worst, &at);
            let bound = facts.coils.iter().filter(|coil| coil.at_limit()).count();
            let sum: f64 = facts.coils.iter().map(|coil| coil.current_a).sum();
            tile(
                &mut body,
                "coils at limit",
                &format!("{bound} of {}", facts.coils.len()),
                &format!("{} A in all", figures(sum, 4)),
            );
        }
    }
    body.raw("</dl>");
    if file.lambda_n_per_m.is_some() {
        body.table(&limits::currents(&facts.coils));
    }
    Section {
        id: "answer",
        title: "The answer",
        body,
    }
}

fn sources(facts: &BundleFacts) -> Section {
    let mut body = Html::default();
    let input = |input: &Input| -> Vec<Cell> {
        vec![input.path.clone().into(), input.sha256.clone().into()]
    };
    body.table(&Table {
        caption: "Files and their digests".to_owned(),
        head: vec![("file", false), ("sha256", false)],
        rows: facts.lambda.inputs.iter().map(input).collect(),
        prose: true,
    });
    let left_out = &facts.manifest.left_out;
    if !left_out.is_empty() {
        let row = |left: &LeftOut| -> Vec<Cell> {
            let cost = if left.error_cost > 0.0 {
                percent(left.error_cost)
            } else {
                "none".to_owned()
            };
            vec![
                left.what.clone().into(),
                cost.into(),
                left.why.clone().into(),
            ]
        };
        body.table(&Table {
            caption: "What was left out because the object does not need it".to_owned(),
            head: vec![("what", false), ("error it costs", true), ("why", false)],
            rows: left_out.iter().map(row).collect(),
            prose: true,
        });
    }
    body.element("h3", "Files of this bundle")
        .raw("<ul class=\"files\">");
    for file in &facts.files {
        body.raw("<li><code>").text(file).raw("</code></li>");
    }
    body.raw("</ul>");
    body.element(
        "p class=\"note\"",
        &format!(
            "{} of this bundle are listed with their digests in manifest.json; `fluxform verify` \
             checks them and computes the numbers again by another route.",
            count(facts.files.len(), "file")
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
