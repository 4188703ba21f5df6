//! The page of `optimize --for`: the gain, both arrays, what holds it back, what it costs.

use serde_json::{Map, Value};

use super::text::{ended, one_more};
use super::{ArrayOptimization, ShapeGain, tables};
use crate::coil::array_search::search::SearchedChoice;
use crate::coil::array_search::study::{Neighbour, Study, VariableStudy};
use crate::coil::array_search::worth::LimitWorth;
use crate::coil::limits::LimitCheck;
use crate::report::array::views;
use crate::report::frame::{Page, Section, foot};
use crate::report::html::{Cell, Html, Table};
use crate::report::inputs::sources;
use crate::report::limits::{in_unit, words};
use crate::report::number::{figures, percent};

/// The result as one HTML page, whose drawings need no scripts.
#[must_use]
pub fn html(result: &ArrayOptimization) -> String {
    let mut lead = Html::default();
    let of = match result.shapes.as_slice() {
        [shape] => shape.shape.clone(),
        shapes => format!("the {} over {} shapes", result.objective, shapes.len()),
    };
    let missed = match (
        result.limits_met,
        result.limits.values().all(|check| check.met),
    ) {
        (true, true) => "every limit met",
        (true, false) => "every limit met that the search can change",
        (false, _) => "not every limit met",
    };
    let text = format!(
        "Felt {} times as strongly as the given array ({of}), {missed}.",
        figures(result.gain, 4)
    );
    lead.element("p class=\"lead\"", &text);
    let sections = [
        Some(answer(result)),
        arrays(result),
        trade_offs(result),
        result.study.as_ref().map(|study| variables(result, study)),
        limits(result),
        Some(sure(result)),
        Some(sources(&result.inputs)),
    ];
    Page {
        kind: "Optimisation",
        title: format!(
            "The array of {} that renders the shapes best",
            result.design
        ),
        lead,
        sections: sections.into_iter().flatten().collect(),
        data: Value::Object(Map::new()),
        foot: foot(result.fluxform_version, ""),
    }
    .html()
}

fn answer(result: &ArrayOptimization) -> Section {
    let mut body = Html::default();
    let row = |shape: &ShapeGain| -> Vec<Cell> {
        let [before, now] = shape.written(|lambda| figures(lambda, 4), percent);
        let gain = figures(shape.gain, 4);
        vec![
            shape.shape.as_str().into(),
            before.into(),
            now.into(),
            gain.into(),
        ]
    };
    body.table(&Table {
        caption: match result.at_n_per_m {
            Some(lambda) => format!("Errors at {} N/m", figures(lambda, 4)),
            None => "Force constants".to_owned(),
        },
        head: vec![
            ("shape", false),
            ("given array", true),
            ("best array", true),
            ("gain", true),
        ],
        rows: result.shapes.iter().map(row).collect(),
        prose: false,
    });
    let near = result.study.as_ref().map_or(&[][..], |s| &s.neighbours);
    let row = |near: &Neighbour| -> Vec<Cell> {
        let lost = (1.0 - near.objective / result.gain).max(0.0);
        vec![
            near.what.as_str().into(),
            percent(lost).into(),
            named(near.values.iter()).into(),
        ]
    };
    if !near.is_empty() {
        body.table(&Table {
            caption: "Arrays beside it that are easier to make".to_owned(),
            head: vec![("what", false), ("loses", true), ("values", false)],
            rows: near.iter().map(row).collect(),
            prose: true,
        });
    }
    Section {
        id: "answer",
        title: "Result",
        body,
    }
}

fn named<'a>(values: impl Iterator<Item = (&'a String, &'a f64)>) -> String {
    let values: Vec<String> = values
        .map(|(key, value)| format!("{key} = {}", figures(*value, 5)))
        .collect();
    values.join(", ")
}

fn arrays(result: &ArrayOptimization) -> Option<Section> {
    let mut body = Html::default();
    for (title, plot) in ["As given", "Best"].into_iter().zip(&result.drawn) {
        let plot = plot.as_ref()?;
        body.element("h3", title);
        let captions = ["From above.", "Cut along the row next to the middle."];
        views(&mut body, plot, captions);
    }
    Some(Section {
        id: "array",
        title: "Arrays",
        body,
    })
}

fn trade_offs(result: &ArrayOptimization) -> Option<Section> {
    let plot = tables::pareto(result, &[])?;
    let mut body = Html::default();
    body.raw("<div class=\"pair\">");
    for panel in plot.drawn() {
        let caption = format!(
            "Gain against {}. Joined: arrays that no computed one beats, this limit left out; pale: \
             arrays that break a limit.",
            panel.names[0]
        );
        body.raw("<figure>")
            .raw(&panel.markup())
            .element("figcaption", &caption)
            .raw("</figure>");
    }
    body.raw("</div>");
    let row = |searched: &SearchedChoice| -> Vec<Cell> {
        let choice = &searched.choice;
        let lies = match (choice.rows_columns, choice.layout) {
            (Some([rows, columns]), Some(layout)) => format!("{rows} x {columns}, {layout}"),
            (None, _) | (_, None) => "as given".to_owned(),
        };
        let magnet = choice.magnet_m.map(|m| figures(m * 1e3, 4)).join(" x ");
        let gain = searched
            .objective
            .map_or_else(|| "limits not met".to_owned(), |g| figures(g, 4));
        vec![
            searched.coils.to_string().into(),
            lies.into(),
            format!("{magnet} mm").into(),
            if choice.core { "yes" } else { "no" }.into(),
            if choice.plate { "yes" } else { "no" }.into(),
            gain.into(),
        ]
    };
    if result.choices.len() > 1 {
        body.table(&Table {
            caption: "Choices that were searched, at the accuracy of the search".to_owned(),
            head: vec![
                ("coils", true),
                ("layout", false),
                ("magnet", false),
                ("core", false),
                ("plate", false),
                ("gain", true),
            ],
            rows: result.choices.iter().map(row).collect(),
            prose: false,
        });
    }
    Some(Section {
        id: "front",
        title: "Trade-offs",
        body,
    })
}

fn variables(result: &ArrayOptimization, study: &Study) -> Section {
    let mut body = Html::default();
    let bought = |one: &VariableStudy| {
        let without = one.objective_without?;
        Some((result.gain / without - 1.0).max(0.0))
    };
    let most = study
        .variables
        .iter()
        .filter_map(bought)
        .fold(0.0, f64::max);
    let row = |one: &VariableStudy| -> Vec<Cell> {
        let gained = bought(one);
        let [low, high] = one.range.map(|end| figures(end, 4));
        vec![
            one.key.as_str().into(),
            figures(one.given, 5).into(),
            figures(one.value, 5).into(),
            format!("{low} to {high}").into(),
            bar(gained.unwrap_or(most), most),
            gained.map_or_else(|| "needed".to_owned(), percent).into(),
        ]
    };
    body.table(&Table {
        caption: "Each variable, and what it bought".to_owned(),
        head: vec![
            ("variable", false),
            ("given", true),
            ("best", true),
            ("within 1 %", true),
            ("bought", false),
            ("", true),
        ],
        rows: study.variables.iter().map(row).collect(),
        prose: false,
    });
    body.element(
        "p class=\"note\"",
        "Bought: what is lost where this variable goes back to its given value and the others are \
         searched again; needed: none with the given value that meets the limits was found. Within 1 %: how \
         far it may move for a loss of one per cent, the others following.",
    );
    Section {
        id: "variables",
        title: "What each variable bought",
        body,
    }
}

fn bar(value: f64, most: f64) -> Cell {
    let width = if most > 0.0 {
        value / most * 100.0
    } else {
        0.0
    };
    Cell::Markup(format!(
        "<svg class=\"bar\" aria-hidden=\"true\"><rect class=\"some\" y=\"25%\" height=\"50%\" \
         width=\"{width:.2}%\"/></svg>"
    ))
}

fn limits(result: &ArrayOptimization) -> Option<Section> {
    let mut body = Html::default();
    body.raw("<ul class=\"said\">");
    let study = result.study.as_ref();
    let worths = study.map_or(&[][..], |study| &study.limits);
    let active: Vec<&LimitWorth> = worths.iter().filter(|limit| limit.active).collect();
    if active.is_empty() {
        body.element("li", "No limit is known to hold it back.");
    }
    for limit in active {
        body.element("li", &format!("{}.", one_more(limit)));
    }
    for warning in &result.warnings {
        body.raw("<li><strong>Note:</strong> ")
            .text(warning)
            .raw("</li>");
    }
    body.raw("</ul>");
    let row = |(key, check): (&&'static str, &LimitCheck)| -> Vec<Cell> {
        let (name, unit) = words(key);
        let given = result.limits_given.get(key);
        let given = given.map_or_else(String::new, |given| in_unit(given.value, unit));
        let verdict = if check.met {
            "<span class=\"met\">met</span>"
        } else {
            "<span class=\"unmet\">not met</span>"
        };
        vec![
            name.into(),
            given.into(),
            in_unit(check.value, unit).into(),
            in_unit(check.limit, unit).into(),
            Cell::Markup(verdict.to_owned()),
        ]
    };
    body.table(&Table {
        caption: "The design's limits".to_owned(),
        head: vec![
            ("limit", false),
            ("given array", true),
            ("best array", true),
            ("limit", true),
            ("best array", false),
        ],
        rows: result.limits.iter().map(row).collect(),
        prose: false,
    });
    (!result.limits.is_empty()).then_some(Section {
        id: "limits",
        title: "What holds it back",
        body,
    })
}

fn sure(result: &ArrayOptimization) -> Section {
    let mut body = Html::default();
    body.raw("<ul class=\"said\">")
        .element("li", &format!("Certificate: {}.", ended(result)));
    for level in &result.levels {
        let text = format!(
            "Accuracy {}: forces to {}, {} points; force constants off by {} from full accuracy at most, \
             their ratios by {}.",
            level.level,
            percent(level.tolerance),
            level.points,
            percent(level.lambda_error),
            percent(level.gain_error)
        );
        body.element("li", &text);
    }
    body.raw("</ul>");
    Section {
        id: "good",
        title: "How sure it is",
        body,
    }
}
