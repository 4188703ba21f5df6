//! How good a result is: the error budget from file to finger, and every stage's estimate.

use super::data::{BudgetPart, BundleFacts, ErrorTime};
use super::frame::{Section, figure};
use super::html::{Cell, Html, Table};
use super::measured::MeasuredRow;
use super::number::{figures, force, percent, si};
use serde_json::{Map, Value, json};

/// The axis of the budget: from ten to this power up to the whole force.
const LEAST: f64 = -16.0;

pub(super) fn section(facts: &BundleFacts, data: &mut Map<String, Value>) -> Section {
    let mut body = Html::default();
    told(&mut body, facts);
    body.table(&budget(facts));
    body.raw(
        "<p class=\"key\"><span class=\"swatch numeric\"></span>numerical error \
              <span class=\"swatch physical\"></span>what static currents cannot give \
              <span class=\"swatch jnd\"></span>just noticeable; the bars' scale is logarithmic, \
              1e-16 at the left, the whole force at the right</p>",
    );
    body.folded_table(&stages(facts));
    if let Some(curve) = &facts.error_time {
        error_time(&mut body, curve, data);
    }
    Section {
        id: "good",
        title: "How good it is",
        body,
    }
}

fn told(body: &mut Html, facts: &BundleFacts) {
    let largest = facts
        .budget
        .iter()
        .reduce(|a, b| if b.part > a.part { b } else { a });
    body.raw("<ul class=\"said\">");
    if let Some(largest) = largest {
        let text = format!(
            "The largest numerical error on the way from file to finger is that of {}: {} of the \
             force. A finger notices {}.",
            largest.name,
            percent(largest.part),
            percent(facts.jnd)
        );
        body.element("li", &text);
    }
    if let Some(chosen) = &facts.chosen {
        let text = format!(
            "No currents within the limits give a smaller mean square error at this lambda: the \
             duality gap is {} N\u{b2}, the mean square error {} N\u{b2}.",
            figures(chosen.duality_gap_n2, 2),
            figures(chosen.rms_error_n * chosen.rms_error_n, 3)
        );
        body.element("li", &text);
    }
    let text = format!(
        "The forces of {} coils at {} points have rank {}.",
        facts.coils.len(),
        facts.points,
        facts.rank
    );
    body.element("li", &text).raw("</ul>");
}

/// One row a part, from file to finger.
fn budget(facts: &BundleFacts) -> Table {
    let row = |part: &BudgetPart, class: &str| -> Vec<Cell> {
        vec![
            part.name.into(),
            Cell::Markup(bar(part.part, facts.jnd, class)),
            if part.part > 0.0 {
                percent(part.part)
            } else {
                "none".to_owned()
            }
            .into(),
            part.basis.into(),
        ]
    };
    let mut rows: Vec<Vec<Cell>> = facts.budget.iter().map(|p| row(p, "numeric")).collect();
    if let Some(chosen) = &facts.chosen {
        let finger = BudgetPart {
            name: "static currents",
            part: chosen.relative_rms_error.unwrap_or(0.0),
            basis: "rms force error over the rms force: the coils, not the computation",
        };
        rows.push(row(&finger, "physical"));
    }
    Table {
        caption: "Error budget from file to finger, relative to the force".to_owned(),
        head: vec![
            ("what adds it", false),
            ("1e-16 to 1", false),
            ("part", true),
            ("what it is", false),
        ],
        rows,
        prose: true,
    }
}

/// A logarithmic bar, with the just-noticeable difference as a line.
fn bar(part: f64, jnd: f64, class: &str) -> String {
    let place = |part: f64| {
        if part > 0.0 {
            ((part.log10() - LEAST) / -LEAST * 100.0).clamp(0.0, 100.0)
        } else {
            0.0
        }
    };
    let mut svg = String::from("<svg class=\"bar\" aria-hidden=\"true\">");
    for tick in [-12.0, -8.0, -4.0] {
        let at = (tick - LEAST) / -LEAST * 100.0;
        svg += &format!("<line class=\"tick\" x1=\"{at}%\" x2=\"{at}%\" y1=\"0\" y2=\"100%\"/>");
    }
    svg += &format!(
        "<rect class=\"{class}\" y=\"25%\" height=\"50%\" width=\"{:.2}%\"/>",
        place(part)
    );
    let at = place(jnd);
    svg + &format!(
        "<line class=\"jnd\" x1=\"{at:.2}%\" x2=\"{at:.2}%\" y1=\"0\" y2=\"100%\"/></svg>"
    )
}

fn stages(facts: &BundleFacts) -> Table {
    let row = |stage: &super::data::StageFacts| -> Vec<Cell> {
        vec![
            stage.name.replace('_', " ").into(),
            figures(stage.estimate, 3).into(),
            stage.relative_to.to_owned().into(),
            stage.method.to_owned().into(),
        ]
    };
    Table {
        caption: "Every stage's estimated error and how it was found".to_owned(),
        head: vec![
            ("stage", false),
            ("error", true),
            ("relative to", false),
            ("how it was found", false),
        ],
        rows: facts.accuracy.iter().map(row).collect(),
        prose: true,
    }
}

fn error_time(body: &mut Html, shipped: &ErrorTime, data: &mut Map<String, Value>) {
    let curve = &shipped.curve;
    body.element("h3", "What accuracy costs");
    figure(
        body,
        "cost",
        "Error against processor time, both axes logarithmic",
        &format!(
            "Not measured in this run: error against CPU time of {} ({}), as recorded for fluxform \
             {} on {}. The dashed line is this run's tolerance, {}; the ring is the curve's point \
             at that tolerance, where there is one.",
            shipped.timed,
            curve.name,
            shipped.version,
            shipped.machine,
            figures(shipped.tolerance, 3)
        ),
    );
    let row = |row: &MeasuredRow| -> Vec<Cell> {
        vec![
            figures(row.knob, 4).into(),
            figures(row.error, 3).into(),
            si(row.seconds, "s").into(),
        ]
    };
    body.folded_table(&Table {
        caption: format!(
            "Error against CPU time, as recorded; errors relative to the {}",
            shipped.error_of
        ),
        head: vec![("tolerance", true), ("error", true), ("CPU time", true)],
        rows: curve.rows.iter().map(row).collect(),
        prose: false,
    });
    data.insert(
        "cost".to_owned(),
        json!({
            "tolerance": shipped.tolerance,
            "curve": curve.json(
                &format!("relative to the {}", shipped.error_of),
                "this run's tolerance",
            ),
        }),
    );
}

/// The worst point in words.
pub(super) fn worst(facts: &BundleFacts) -> Option<String> {
    let chosen = facts.chosen?;
    let at = chosen.worst_at?;
    let [x, y, z] = at.position_m.map(super::number::mm);
    let way = if at.given_n < at.wanted_n {
        "too weak"
    } else {
        "too strong"
    };
    Some(format!(
        "The force is most wrong at ({x}, {y}) mm, {z} mm high: {} instead of {}, {} {way}.",
        force(at.given_n),
        force(at.wanted_n),
        force((at.given_n - at.wanted_n).abs())
    ))
}
