//! The page of a calibrated object.

use serde_json::{Map, Value, json};

use super::data::{BundleFacts, Chosen};
use super::frame::{Page, Section};
use super::html::{Cell, Html, Table};
use super::number::{count, figures, force, percent};
use super::{error_budget, field, limits, path, surface};

/// The page.
#[must_use]
pub fn page(facts: &BundleFacts) -> String {
    let mut data = Map::new();
    data.insert("coils".to_owned(), coils(facts));
    let sections = vec![
        answer(facts),
        error_budget::section(facts, &mut data),
        limits::section(facts),
        path::section(facts, &mut data),
        surface::section(
            &facts.surface,
            facts.points,
            facts.chosen.is_some(),
            &mut data,
        ),
        field::section(&facts.field, &mut data),
        sources(facts),
    ];
    Page {
        kind: "Calibration",
        title: format!("{} on {}", facts.shape, facts.design),
        lead: lead(facts),
        sections,
        data: Value::Object(data),
        foot: format!(
            "fluxform {}. This page needs nothing but itself; all its numbers come from the files \
             of this bundle.",
            facts.version
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
    match &facts.chosen {
        Some(chosen) => html.element(
            "p class=\"lead\"",
            &format!(
                "A finger at height h above the coils is to feel the force \u{3bb}h. With one set \
                 of static currents for the whole object \u{3bb} is {} N/m, and the force is off by \
                 {}.",
                figures(chosen.lambda_n_per_m, 5),
                off(chosen)
            ),
        ),
        None => html.element(
            "p class=\"lead\"",
            "There is no force constant for this object: nothing can be rendered as asked.",
        ),
    };
    html
}

fn off(chosen: &Chosen) -> String {
    let error = force(chosen.rms_error_n);
    match chosen.relative_rms_error {
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

fn answer(facts: &BundleFacts) -> Section {
    let mut body = Html::default();
    body.raw("<dl class=\"tiles\">");
    let by = facts.criterion.described(&percent(facts.jnd));
    let by = format!("chosen by {by}");
    match &facts.chosen {
        None => tile(&mut body, "force constant \u{3bb}", "none", &by),
        Some(chosen) => {
            let lambda = format!("{} N/m", figures(chosen.lambda_n_per_m, 5));
            tile(&mut body, "force constant \u{3bb}", &lambda, &by);
            let relative = chosen.relative_rms_error.map_or_else(String::new, |part| {
                format!("{} of the rms force", percent(part))
            });
            tile(
                &mut body,
                "rms error",
                &force(chosen.rms_error_n),
                &relative,
            );
            let at = chosen.worst_at.map_or_else(String::new, |at| {
                format!("of {} wanted there", force(at.wanted_n))
            });
            tile(&mut body, "worst error", &force(chosen.worst_error_n), &at);
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
    if facts.chosen.is_some() {
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
    let input =
        |(path, sha256): &(&str, &str)| -> Vec<Cell> { vec![(*path).into(), (*sha256).into()] };
    body.table(&Table {
        caption: "Files and their digests".to_owned(),
        head: vec![("file", false), ("sha256", false)],
        rows: facts.inputs.iter().map(input).collect(),
        prose: true,
    });
    if !facts.left_out.is_empty() {
        let row = |(what, why, cost): &(&str, &str, f64)| -> Vec<Cell> {
            let cost = if *cost > 0.0 {
                percent(*cost)
            } else {
                "none".to_owned()
            };
            vec![(*what).into(), cost.into(), (*why).into()]
        };
        body.table(&Table {
            caption: "What was left out because the object does not need it".to_owned(),
            head: vec![("what", false), ("error it costs", true), ("why", false)],
            rows: facts.left_out.iter().map(row).collect(),
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
