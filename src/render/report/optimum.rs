//! The page of an optimisation: the best coil, what holds it back, how sure it is.

use serde_json::{Map, Value};

use super::frame::{Page, Section};
use super::html::{Cell, Html, Table};
use super::limits::{in_unit, words};
use super::number::{count, figures, force, percent, si};

/// The contents of the page, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimumFacts<'a> {
    /// Name of the design.
    pub design: &'a str,
    /// Program that made it.
    pub version: &'a str,
    /// Path and digest of what went in.
    pub inputs: Vec<(&'a str, &'a str)>,
    /// Why there is no coil.
    pub none: Option<&'a str>,
    /// Force on the magnet, N, the rated current, A, and the target's height, m.
    pub found: Option<(f64, f64, f64)>,
    /// The coil's properties by their names in artefacts, and those of the design's own coil.
    pub coil: Vec<(&'a str, f64, Option<f64>)>,
    /// The limits.
    pub limits: Vec<ActiveLimit<'a>>,
    /// Kind of certificate.
    pub certificate: &'a str,
    /// What the coil is the best of, and what remains open without a bound.
    pub scope: [&'a str; 2],
    /// Upper bound of the force, N, and its gap.
    pub bound: (Option<f64>, Option<f64>),
    /// Local searches, evaluations of a coil, boxes of coils bounded.
    pub searched: [usize; 3],
    /// Other coils worth a look.
    pub alternatives: Vec<Alternative<'a>>,
    /// Warnings for the user.
    pub notes: &'a [String],
}

/// A limit beside the optimum's value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActiveLimit<'a> {
    /// Its name in artefacts, unit last.
    pub name: &'a str,
    /// The coil's value.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// Whether it holds the force back.
    pub active: bool,
    /// Force that one SI unit more would give, N.
    pub sensitivity_n_per_unit: f64,
}

/// Another coil.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative<'a> {
    /// Bore, outer diameter and length, m.
    pub size_m: [f64; 3],
    /// N.
    pub force_n: f64,
    /// Part of the best force that it lacks.
    pub lost: f64,
    /// Mass of the wire, kg.
    pub wire_mass_kg: f64,
    /// W.
    pub power_w: f64,
    /// In what it is better.
    pub better: Vec<&'a str>,
}

/// The page.
#[must_use]
pub fn page(facts: &OptimumFacts) -> String {
    let mut lead = Html::default();
    let text = match (facts.found, facts.none) {
        (Some((force_n, current_a, height_m)), _) => format!(
            "The best coil within the design's limits pushes the magnet with {} at {} A, {} mm \
             above it.",
            force(force_n),
            figures(current_a, 4),
            super::number::mm(height_m)
        ),
        (None, Some(why)) => format!("There is no such coil: {why}"),
        (None, None) => "There is no such coil.".to_owned(),
    };
    lead.element("p class=\"lead\"", &text);
    Page {
        kind: "Optimisation",
        title: format!("The best coil of {}", facts.design),
        lead,
        sections: vec![
            answer(facts),
            limits(facts),
            sure(facts),
            sources(&facts.inputs),
        ],
        data: Value::Object(Map::new()),
        foot: format!(
            "fluxform {}. This page needs nothing but itself.",
            facts.version
        ),
    }
    .html()
}

fn answer(facts: &OptimumFacts) -> Section {
    let mut body = Html::default();
    let row = |(name, best, given): &(&str, f64, Option<f64>)| -> Vec<Cell> {
        let (name, unit) = words(name);
        let given = given.map_or_else(|| "\u{2013}".to_owned(), |v| in_unit(v, unit));
        vec![name.into(), in_unit(*best, unit).into(), given.into()]
    };
    if !facts.coil.is_empty() {
        body.table(&Table {
            caption: "The best coil beside the design's own".to_owned(),
            head: vec![("property", false), ("best", true), ("as given", true)],
            rows: facts.coil.iter().map(row).collect(),
            prose: false,
        });
    }
    if !facts.alternatives.is_empty() {
        let row = |one: &Alternative| -> Vec<Cell> {
            let [inner, outer, length] = one.size_m.map(super::number::mm);
            vec![
                format!("{inner} to {outer}, {length} long").into(),
                force(one.force_n).into(),
                percent(one.lost).into(),
                si(one.wire_mass_kg, "kg").into(),
                si(one.power_w, "W").into(),
                one.better.join(", ").into(),
            ]
        };
        body.table(&Table {
            caption: "Coils that give a little less".to_owned(),
            head: vec![
                ("diameters, length / mm", false),
                ("force", true),
                ("lost", true),
                ("wire", true),
                ("heat", true),
                ("better in being", false),
            ],
            rows: facts.alternatives.iter().map(row).collect(),
            prose: false,
        });
    }
    Section {
        id: "answer",
        title: "The answer",
        body,
    }
}

fn limits(facts: &OptimumFacts) -> Section {
    let mut body = Html::default();
    let active: Vec<String> = facts
        .limits
        .iter()
        .filter(|limit| limit.active)
        .map(|limit| words(limit.name).0)
        .collect();
    body.raw("<ul class=\"said\">");
    let text = if active.is_empty() {
        "No limit holds the force back.".to_owned()
    } else {
        format!("The force is held back by {}.", active.join(", "))
    };
    body.element("li", &text);
    for note in facts.notes {
        body.raw("<li><strong>Note:</strong> ")
            .text(note)
            .raw("</li>");
    }
    body.raw("</ul>");
    // What one percent more of a limit would give compares limits of different units.
    let gain = |limit: &ActiveLimit| 0.01 * limit.limit * limit.sensitivity_n_per_unit;
    let most = facts
        .limits
        .iter()
        .map(|l| gain(l).abs())
        .fold(0.0, f64::max);
    let row = |limit: &ActiveLimit| -> Vec<Cell> {
        let (name, unit) = words(limit.name);
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
            if limit.active { "yes" } else { "no" }.into(),
            Cell::Markup(bar),
            if limit.active {
                force(gain(limit))
            } else {
                "none".to_owned()
            }
            .into(),
        ]
    };
    if !facts.limits.is_empty() {
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
            rows: facts.limits.iter().map(row).collect(),
            prose: false,
        });
    }
    Section {
        id: "limits",
        title: "What limits it",
        body,
    }
}

fn sure(facts: &OptimumFacts) -> Section {
    let mut body = Html::default();
    let (kind, [scope, open]) = (facts.certificate, facts.scope);
    let [starts, evaluations, cells] = facts.searched;
    let said = match facts.bound {
        (Some(bound_n), Some(gap)) => format!(
            "Certificate: {kind}. No coil within the limits gives more than {}, which is {} more \
             than this one.",
            force(bound_n),
            percent(gap)
        ),
        (None, _) | (_, None) => format!("Certificate: {kind} ({scope}; {open})."),
    };
    body.raw("<ul class=\"said\">").element("li", &said);
    let text = format!(
        "{}, {} of a coil, {} of coils bounded.",
        count(starts, "local search").replace("searchs", "searches"),
        count(evaluations, "evaluation"),
        count(cells, "box").replace("boxs", "boxes")
    );
    body.element("li", &text).raw("</ul>");
    Section {
        id: "good",
        title: "How sure it is",
        body,
    }
}

/// Path and digest of every input.
#[must_use]
pub fn sources(inputs: &[(&str, &str)]) -> Section {
    let mut body = Html::default();
    let row =
        |(path, sha256): &(&str, &str)| -> Vec<Cell> { vec![(*path).into(), (*sha256).into()] };
    body.table(&Table {
        caption: "Files and their digests".to_owned(),
        head: vec![("file", false), ("sha256", false)],
        rows: inputs.iter().map(row).collect(),
        prose: true,
    });
    Section {
        id: "sources",
        title: "What went in",
        body,
    }
}
