//! The page of an optimisation: the best coil, what holds it back, how sure it is.

use serde_json::{Map, Value};

use super::compared::{ComparedCoil, PROPERTIES, Property, beside_the_force, name};
use super::result::Optimization;
use super::text::{before_whole, better, misses, nearest};
use crate::coil::optimum::LimitUse;
use crate::coil::optimum::outcome::Alternative;
use crate::report::frame::{Page, Section, foot};
use crate::report::html::{Cell, Html, Table};
use crate::report::inputs::sources;
use crate::report::limits::{in_unit, words};
use crate::report::number::{count, figures, force, mm, percent, si};

/// The result of `optimize` as one HTML page.
#[must_use]
pub fn html(result: &Optimization) -> String {
    let mut lead = Html::default();
    let text = match (&result.objective, &result.no_coil) {
        (Some(best), _) => format!(
            "The best coil within the design's limits pushes the magnet with {} at {} A, {} mm \
             above it.",
            force(best.force_n),
            figures(best.current_a, 4),
            mm(best.height_m)
        ),
        (None, Some(none)) => {
            let nearest =
                nearest(result).map_or_else(String::new, |nearest| format!(" Nearest: {nearest}."));
            format!(
                "There is no such coil: {}.{nearest}",
                none.message.trim_end_matches('.')
            )
        }
        (None, None) => "There is no such coil.".to_owned(),
    };
    lead.element("p class=\"lead\"", &text);
    for beside in result.objective.iter().flat_map(beside_the_force) {
        lead.element("p", &sentence(&beside));
    }
    Page {
        kind: "Optimisation",
        title: format!("The best coil of {}", result.design),
        lead,
        sections: [
            Some(answer(result)),
            result.coil.as_ref().map(|_| limits(result)),
            Some(sure(result)),
            Some(sources(&result.inputs)),
        ]
        .into_iter()
        .flatten()
        .collect(),
        data: Value::Object(Map::new()),
        foot: foot(result.fluxform_version, ""),
    }
    .html()
}

/// A part of the screen's summary as a sentence.
fn sentence(part: &str) -> String {
    let mut letters = part.chars();
    let first = letters
        .next()
        .map(|letter| letter.to_uppercase().to_string());
    format!("{}{}.", first.unwrap_or_default(), letters.as_str())
}

fn answer(result: &Optimization) -> Section {
    let mut body = Html::default();
    if let Some((best, given)) = result.compared() {
        let row = |property: Property| -> Vec<Cell> {
            let unit = words(property.0).1;
            let cell = |coil: &ComparedCoil| in_unit(property.1(coil), unit);
            let given = given.as_ref().map_or_else(|| "\u{2013}".to_owned(), cell);
            vec![name(property).into(), cell(&best).into(), given.into()]
        };
        body.table(&Table {
            caption: "The best coil beside the design's own".to_owned(),
            head: vec![("property", false), ("best", true), ("as given", true)],
            rows: PROPERTIES.into_iter().map(row).collect(),
            prose: false,
        });
    }
    if let Some(misses) = result.given.as_ref().and_then(misses) {
        body.element("p class=\"note\"", &sentence(&misses));
    }
    if !result.alternatives.is_empty() {
        let row = |one: &Alternative| -> Vec<Cell> {
            let size = &one.size;
            let sizes = [size.inner_diameter_m, size.outer_diameter_m, size.length_m];
            let [inner, outer, length] = sizes.map(mm);
            vec![
                format!("{inner} to {outer}, {length} long").into(),
                force(one.force_n).into(),
                percent(one.force_lost).into(),
                si(one.mass_kg, "kg").into(),
                si(one.power_w, "W").into(),
                better(one).into(),
            ]
        };
        body.table(&Table {
            caption: "Coils that give a little less".to_owned(),
            head: vec![
                ("diameters, length / mm", false),
                ("force", true),
                ("lost", true),
                ("mass", true),
                ("heat", true),
                ("better in being", false),
            ],
            rows: result.alternatives.iter().map(row).collect(),
            prose: false,
        });
    }
    Section {
        id: "answer",
        title: "Result",
        body,
    }
}

/// What holds the force back, and warnings.
fn said(result: &Optimization, limits: &[&LimitUse], body: &mut Html) {
    let holding: Vec<String> = limits
        .iter()
        .filter(|limit| limit.holds_back())
        .map(|limit| words(limit.name.key()).0)
        .collect();
    body.raw("<ul class=\"said\">");
    let text = if holding.is_empty() {
        "No limit holds the force back.".to_owned()
    } else {
        format!("The force is held back by {}.", holding.join(", "))
    };
    body.element("li", &text);
    if let Some(whose) = before_whole(result).filter(|_| !holding.is_empty()) {
        body.element(
            "li",
            &format!("What more of a limit gives is that {whose}."),
        );
    }
    notes(result, body);
    body.raw("</ul>");
}

fn notes(result: &Optimization, body: &mut Html) {
    for warning in &result.warnings {
        body.raw("<li><strong>Note:</strong> ")
            .text(warning)
            .raw("</li>");
    }
}

fn limits(result: &Optimization) -> Section {
    let mut body = Html::default();
    let limits: Vec<&LimitUse> = result
        .limits
        .values()
        .chain(result.bounds.values())
        .collect();
    said(result, &limits, &mut body);
    // The gain per percent compares limits of different units.
    let gain = |limit: &LimitUse| 0.01 * limit.limit * limit.sensitivity_n_per_unit;
    let limits: Vec<&LimitUse> = limits
        .into_iter()
        .filter(|limit| !limit.name.is_least_size())
        .collect();
    let most = limits.iter().map(|l| gain(l).abs()).fold(0.0, f64::max);
    let row = |limit: &&LimitUse| -> Vec<Cell> {
        let (name, unit) = words(limit.name.key());
        let width = if most > 0.0 {
            gain(limit).abs() / most * 100.0
        } else {
            0.0
        };
        let bar = format!(
            "<svg class=\"bar\" aria-hidden=\"true\"><rect class=\"some\" y=\"25%\" \
             height=\"50%\" width=\"{width:.2}%\"/></svg>"
        );
        vec![
            name.into(),
            in_unit(limit.value, unit).into(),
            in_unit(limit.limit, unit).into(),
            if limit.holds_back() { "yes" } else { "no" }.into(),
            Cell::Markup(bar),
            if limit.holds_back() {
                force(gain(limit))
            } else {
                "none".to_owned()
            }
            .into(),
        ]
    };
    if !limits.is_empty() {
        body.table(&Table {
            caption: "The limits, and the force that one percent more of each would give"
                .to_owned(),
            head: vec![
                ("limit", false),
                ("value", true),
                ("limit", true),
                ("holds it back", false),
                ("for 1 % more", false),
                ("force gained", true),
            ],
            rows: limits.iter().map(row).collect(),
            prose: false,
        });
    }
    Section {
        id: "limits",
        title: "What limits it",
        body,
    }
}

fn sure(result: &Optimization) -> Section {
    let mut body = Html::default();
    let certificate = &result.certificate;
    let kind = certificate.kind;
    let said = match (certificate.upper_bound_n, certificate.gap) {
        (Some(bound_n), Some(gap)) => format!(
            "Certificate: {}. No coil {} gives more than {}, which is {} more \
             than this one.",
            kind.name(),
            result.within(),
            force(bound_n),
            percent(gap)
        ),
        (None, _) | (_, None) => format!(
            "Certificate: {} ({}; {}).",
            kind.name(),
            kind.scope(),
            kind.open_question()
        ),
    };
    body.raw("<ul class=\"said\">");
    match result.coil {
        Some(_) => {
            body.element("li", &said);
        }
        None => notes(result, &mut body),
    }
    let text = format!(
        "{}, {} of a coil, {} of coils bounded.",
        count(result.starts, "local search").replace("searchs", "searches"),
        count(result.evaluations, "evaluation"),
        count(certificate.cells, "box").replace("boxs", "boxes")
    );
    body.element("li", &text).raw("</ul>");
    Section {
        id: "good",
        title: "How sure it is",
        body,
    }
}
