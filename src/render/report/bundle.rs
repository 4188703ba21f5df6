//! The page of a calibrated object.

use fluxform_base::digits::duration;
use fluxform_bundle::artefact::Input;
use fluxform_bundle::lambda_file::LambdaFile;
use fluxform_bundle::manifest::LeftOut;
use serde_json::{Map, Value, json};

use super::array::views;
use super::data::{CalibratedObject, DrivenCoil};
use super::frame::{Page, Section, foot};
use super::html::{Cell, Html, Table};
use super::number::{count, figures, force, percent};
use super::{directions, error_budget, field, limits, path, surface, uncertainty};
use crate::plot::array::ArrayPlot;

/// The page.
#[must_use]
pub fn page(object: &CalibratedObject, files: &[&str]) -> String {
    let file = object.lambda;
    let mut data = Map::new();
    data.insert("coils".to_owned(), coils(object));
    let sections = [
        Some(answer(object)),
        Some(surface::section(object, &mut data)),
        directions::section(object),
        uncertainty::section(object),
        Some(error_budget::section(object)),
        Some(limits::section(object)),
        Some(path::section(object, &mut data)),
        object.array.as_ref().map(array),
        Some(field::section(object, &mut data)),
        object
            .error_time
            .as_ref()
            .map(|recorded| error_budget::recorded_section(recorded, &mut data)),
        Some(sources(object, files)),
    ];
    let sections = sections.into_iter().flatten().collect();
    Page {
        kind: "Calibration",
        title: format!("{} on {}", file.shape, file.design),
        lead: lead(object),
        sections,
        data: Value::Object(data),
        foot: foot(
            &file.fluxform_version,
            "; all its numbers come from the files \
             of this bundle",
        ),
    }
    .html()
}

fn coils(object: &CalibratedObject) -> Value {
    let one = |coil: &DrivenCoil| {
        json!({
            "x": coil.axis_m[0] * 1e3,
            "y": coil.axis_m[1] * 1e3,
            "radius": object.section.outer_radius_m * 1e3,
            "bore": object.section.inner_radius_m * 1e3,
            "core": object.section.core_radius_m.map(|radius_m| radius_m * 1e3),
            "current": coil.current_a,
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
                "A finger at height h above the coils is to feel {}. With one set of static currents for the \
                 whole object \u{3bb} is {}, and the upward force is off from \u{3bb}h by {}.",
                requested(object),
                stated_lambda(file, lambda),
                rms_error(rms_n, file.relative_rms_error)
            ),
        ),
        (None, _) | (_, None) => html.element(
            "p class=\"lead\"",
            "There is no force constant for this object: nothing can be rendered as requested.",
        ),
    };
    html
}

/// The force that is requested at height h.
fn requested(object: &CalibratedObject) -> String {
    let force = object.manifest.force.as_ref();
    match force.and_then(|force| force.normal_force) {
        None => "the force \u{3bb}h".to_owned(),
        Some(size) => format!(
            "a force along the surface\u{2019}s normal: {}",
            size.meaning().to_lowercase()
        ),
    }
}

/// lambda in the digits that its error leaves; five in bundles of programs that did not state it.
fn stated_lambda(file: &LambdaFile, lambda_n_per_m: f64) -> String {
    let headline = file.headline.as_ref().map(|of| of.lambda.clone());
    headline.unwrap_or_else(|| format!("{} N/m", figures(lambda_n_per_m, 5)))
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
    let lambda = match file.lambda_n_per_m {
        None => "none".to_owned(),
        Some(lambda) => stated_lambda(file, lambda),
    };
    tile(&mut body, "force constant \u{3bb}", &lambda, &by);
    if let (Some(rms_n), Some(worst_n)) = (file.rms_error_n, file.worst_error_n) {
        let relative = file.relative_rms_error.map_or_else(String::new, |part| {
            format!("{} of the rms force", percent(part))
        });
        tile(&mut body, "rms error", &force(rms_n), &relative);
        let at = object.worst_place().map_or_else(String::new, |at| {
            format!("where \u{3bb}h is {}", force(at.wanted_n))
        });
        tile(&mut body, "worst error", &force(worst_n), &at);
        given(&mut body, object);
    }
    body.raw("</dl>");
    Section {
        id: "answer",
        title: "Result",
        body,
    }
}

/// The array from above and in section, where scripts are off too.
fn array(plot: &ArrayPlot) -> Section {
    let mut body = Html::default();
    views(
        &mut body,
        plot,
        [
            "The array from above; numbers are the coils'.",
            "Cut along the row next to the middle, the magnet at the target height.",
        ],
    );
    Section {
        id: "array",
        title: "Array",
        body,
    }
}

/// The force that the static currents give: its share of the requested one, and its direction.
fn given(body: &mut Html, object: &CalibratedObject) {
    let file = object.lambda;
    if let Some(given) = &file.given_force {
        let limits = format!(
            "{} to {} over the points{}",
            percent(given.least),
            percent(given.most),
            if given.above_saturation {
                "; lambda is above saturation"
            } else {
                ""
            }
        );
        tile(body, "given force", &percent(given.mean), &limits);
    }
    if let Some(sideways) = &file.sideways {
        let degrees = figures(sideways.static_median_deg, 2);
        let mut more = format!("of the push, {degrees} degrees off");
        // Feedback of a vector gives the sideways force that is requested.
        if object.manifest.force.is_none() {
            more += &format!("; with feedback {}", percent(sideways.feedback_share));
        }
        let share = percent(sideways.static_share);
        tile(body, "sideways force", &share, &more);
    }
    if let Some(heat) = &file.hottest_coil {
        let celsius = |c: f64| format!("{} C", figures(c, 3));
        let steady = heat.steady_c.map_or_else(|| "no end".to_owned(), celsius);
        let limit = heat.winding_max_s.map_or_else(String::new, |time_s| {
            format!(
                "; {} after {}",
                celsius(heat.winding_max_c),
                duration(time_s)
            )
        });
        let note = format!(
            "in the long run, {} W in still air of {}{limit}",
            figures(heat.power_w, 3),
            celsius(heat.ambient_c)
        );
        tile(body, "hottest coil", &steady, &note);
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
            let cost = match left.error_cost {
                Some(0.0) => "none".to_owned(),
                Some(cost) => percent(cost),
                None => "not known".to_owned(),
            };
            vec![
                left.what.as_str().into(),
                cost.into(),
                left.why.as_str().into(),
            ]
        };
        body.table(&Table {
            caption: "Left out because the object does not need it".to_owned(),
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
        title: "Inputs",
        body,
    }
}

#[cfg(test)]
mod tests;
