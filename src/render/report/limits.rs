//! Limits of a result: coils, points, the design's own limits.

use std::collections::BTreeMap;

use fluxform_coil::limits::{LimitCheck, by_key};

use super::data::{CalibratedObject, DrivenCoil};
use super::error_budget::worst;
use super::frame::Section;
use super::html::{Cell, Html, Table};
use super::number::{count, figures, force, mm, percent, si};

/// Deciding points that are listed, at most.
const LISTED: usize = 5;

pub(super) fn section(object: &CalibratedObject) -> Section {
    let mut body = Html::default();
    body.raw("<ul class=\"said\">");
    body.element("li", &coils(object));
    if let Some(text) = worst(object) {
        body.element("li", &text);
    }
    if let Some(text) = deciding(object) {
        body.element("li", &text);
    }
    if let Some(text) = unmet(&object.limits) {
        body.element("li", &text);
    }
    for warning in object.warnings {
        body.raw("<li><strong>Note:</strong> ")
            .text(warning)
            .raw("</li>");
    }
    body.raw("</ul>");
    if object.lambda.lambda_n_per_m.is_some() {
        body.table(&currents(&object.coils()));
    }
    if !object.limits.is_empty() {
        body.table(&table(&object.limits));
        let mut note =
            "One coil at its rated current, its inductance among its neighbours.".to_owned();
        if !object.unchecked.is_empty() {
            note += &format!(" Not looked at here: {}.", object.unchecked.join(", "));
        }
        body.element("p class=\"note\"", &note);
    }
    Section {
        id: "limits",
        title: "Limits",
        body,
    }
}

/// Which coils carry all they may.
fn coils(object: &CalibratedObject) -> String {
    if object.lambda.lambda_n_per_m.is_none() {
        return "No lambda is chosen, so no coil carries a current.".to_owned();
    }
    let coils = object.coils();
    let bound: Vec<String> = (0..coils.len())
        .filter(|coil| coils[*coil].at_limit)
        .map(|coil| coil.to_string())
        .collect();
    let of = count(coils.len(), "coil");
    let mut text = if bound.is_empty() {
        format!("None of {of} is at its limit.")
    } else {
        format!(
            "{} of {of} at the limit: {}.",
            bound.len(),
            bound.join(", ")
        )
    };
    let sum: f64 = coils.iter().map(|coil| coil.current_a).sum();
    if let Some(most) = object.manifest.limits.total_current_max_a {
        text += &format!(
            " Their sum is {} A of {} A.",
            figures(sum, 4),
            figures(most, 4)
        );
    }
    text
}

fn deciding(object: &CalibratedObject) -> Option<String> {
    let mut points = object.lambda.worst_point.as_ref()?.active.clone()?;
    points.sort_by(|a, b| b.multiplier.abs().total_cmp(&a.multiplier.abs()));
    let listed: Vec<String> = points
        .iter()
        .take(LISTED)
        .map(|point| {
            let [x, y, z] = object.position_m(point.point).map(mm);
            let way = if point.multiplier > 0.0 {
                "weak"
            } else {
                "strong"
            };
            format!(
                "({x}, {y}, {z}) mm too {way} {}",
                percent(point.multiplier.abs())
            )
        })
        .collect();
    let more = match points.len().saturating_sub(LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    (!listed.is_empty()).then(|| {
        format!(
            "If the largest error is to be least instead, these points decide, by their share: \
             {}{more}.",
            listed.join("; ")
        )
    })
}

/// The limits of a coil by their keys.
type Checks = BTreeMap<&'static str, LimitCheck>;

fn unmet(limits: &Checks) -> Option<String> {
    let missed: Vec<String> = limits
        .iter()
        .filter(|(_, limit)| !limit.met)
        .map(|(key, _)| label(key))
        .collect();
    if limits.is_empty() {
        None
    } else if missed.is_empty() {
        Some(format!(
            "The coil meets all {} limits that are looked at.",
            limits.len()
        ))
    } else {
        Some(format!(
            "The coil misses its limit of {}.",
            missed.join(", ")
        ))
    }
}

/// The name on screen and page of the limit, or of the number, that artefacts call `key`.
#[must_use]
pub fn label(key: &str) -> String {
    by_key(key).map_or_else(|| words(key).0, |limit| limit.label.to_owned())
}

/// The name in words of what artefacts call `name`, and its unit.
#[must_use]
pub fn words(name: &str) -> (String, &'static str) {
    let units = [
        ("_ohm", "\u{3a9}"),
        ("_kg", "kg"),
        ("_s", "s"),
        ("_m", "m"),
        ("_w", "W"),
        ("_t", "T"),
        ("_a", "A"),
        ("_v", "V"),
        ("_n", "N"),
        ("_h", "H"),
    ];
    // A key of a document is printed as a user writes it.
    if name.contains('.') {
        return (name.to_owned(), "");
    }
    let found = units
        .into_iter()
        .find_map(|(end, unit)| name.strip_suffix(end).map(|stem| (stem, unit)));
    let (stem, unit) = found.unwrap_or((name, ""));
    (stem.replace('_', " "), unit)
}

/// A value in its unit.
#[must_use]
pub fn in_unit(value: f64, unit: &str) -> String {
    match unit {
        "" => figures(value, 6),
        "N" => force(value),
        // Coils are drawn in millimetres, wire is bought by the metre.
        "m" if value.abs() < 1.0 => format!("{} mm", mm(value)),
        _ => si(value, unit),
    }
}

fn table(limits: &Checks) -> Table {
    let row = |(key, limit): (&&'static str, &LimitCheck)| -> Vec<Cell> {
        let (_, unit) = words(key);
        let verdict = if limit.met {
            "<span class=\"met\">met</span>"
        } else {
            "<span class=\"unmet\">not met</span>"
        };
        vec![
            label(key).into(),
            in_unit(limit.value, unit).into(),
            in_unit(limit.limit, unit).into(),
            Cell::Markup(verdict.to_owned()),
        ]
    };
    Table {
        caption: "The design's limits".to_owned(),
        head: vec![
            ("limit", false),
            ("value", true),
            ("limit", true),
            ("verdict", false),
        ],
        rows: limits.iter().map(row).collect(),
        prose: false,
    }
}

/// The currents as bars against their limits.
fn currents(coils: &[DrivenCoil]) -> Table {
    let low = coils.iter().map(|coil| coil.min_a).fold(0.0, f64::min);
    let high = coils.iter().map(|coil| coil.max_a).fold(0.0, f64::max);
    let span = if high > low { high - low } else { 1.0 };
    let place = |current: f64| ((current - low) / span * 100.0).clamp(0.0, 100.0);
    let row = |(number, coil): (usize, &DrivenCoil)| -> Vec<Cell> {
        let (from, to) = (
            place(coil.current_a.min(0.0)),
            place(coil.current_a.max(0.0)),
        );
        let class = if coil.at_limit { "full" } else { "some" };
        let bar = format!(
            "<svg class=\"bar\" aria-hidden=\"true\"><rect class=\"range\" x=\"{:.2}%\" \
             width=\"{:.2}%\" y=\"15%\" height=\"70%\"/><rect class=\"{class}\" x=\"{from:.2}%\" \
             width=\"{:.2}%\" y=\"15%\" height=\"70%\"/></svg>",
            place(coil.min_a),
            place(coil.max_a) - place(coil.min_a),
            to - from
        );
        vec![
            number.to_string().into(),
            format!("{}, {}", mm(coil.axis_m[0]), mm(coil.axis_m[1])).into(),
            Cell::Markup(bar),
            format!(
                "{}{}",
                if coil.at_limit { "\u{25b2} " } else { "" },
                figures(coil.current_a, 4)
            )
            .into(),
            format!("{} to {}", figures(coil.min_a, 4), figures(coil.max_a, 4)).into(),
        ]
    };
    Table {
        caption:
            "Static currents at the chosen lambda against their limits (\u{25b2} at its limit)"
                .to_owned(),
        head: vec![
            ("coil", false),
            ("x, y / mm", true),
            ("within its range", false),
            ("I / A", true),
            ("range / A", true),
        ],
        rows: coils.iter().enumerate().map(row).collect(),
        prose: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The page called heat power, which the screen calls heat.
    #[test]
    fn regression_a_limit_has_one_name_on_page_and_screen() {
        let missed = LimitCheck {
            value: 31.0,
            limit: 17.0,
            met: false,
        };
        let limits = BTreeMap::from([("power_w", missed)]);
        let text = unmet(&limits);
        assert_eq!(text.as_deref(), Some("The coil misses its limit of heat."));
        assert!(matches!(&table(&limits).rows[0][0], Cell::Text(name) if name == "heat"));
    }
}
