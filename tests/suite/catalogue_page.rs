//! The page of the stability catalogue: how many cases came out as expected, and every case.

use fluxform::bundle::artefact::FLUXFORM_VERSION;
use fluxform::report::frame::{Page, Section, foot};
use fluxform::report::html::{Cell, Html, Table};
use fluxform::report::number::{count, figures, si};
use serde_json::{Map, Value};

use crate::catalogue::CaseRow;

/// The page.
#[must_use]
pub fn html(cases: &[CaseRow]) -> String {
    let passed = cases.iter().filter(|case| case.pass).count();
    let failed = cases.len() - passed;
    let seconds: f64 = cases.iter().map(|case| case.seconds).sum();
    let mut lead = Html::default();
    lead.element(
        "p class=\"lead\"",
        &format!(
            "{passed} of {} at the limits of what may be asked came out as expected{}; all took {}.",
            count(cases.len(), "case"),
            if failed > 0 {
                format!(", {failed} did not")
            } else {
                String::new()
            },
            si(seconds, "s")
        ),
    );
    let mut body = Html::default();
    let wrong: Vec<&CaseRow> = cases.iter().filter(|case| !case.pass).collect();
    if !wrong.is_empty() {
        body.table(&table("Cases that failed", &wrong));
    }
    body.table(&table("Every case", &cases.iter().collect::<Vec<_>>()));
    body.element(
        "p class=\"note\"",
        "The bound comes from the expectation: a closed form, a limit, a symmetry, another route or \
         a committed reference. Where the right answer is a refusal, the message is what is expected.",
    );
    Page {
        kind: "Measurement",
        title: "The stability catalogue".to_owned(),
        lead,
        sections: vec![Section {
            id: "answer",
            title: "Result",
            body,
        }],
        data: Value::Object(Map::new()),
        foot: foot(FLUXFORM_VERSION, ""),
    }
    .html()
}

fn table(caption: &str, cases: &[&CaseRow]) -> Table {
    let row = |case: &&CaseRow| -> Vec<Cell> {
        let verdict = if case.pass {
            "<span class=\"met\">as expected</span>"
        } else {
            "<span class=\"unmet\">failed</span>"
        };
        vec![
            case.name.as_str().into(),
            Cell::Markup(verdict.to_owned()),
            figures(case.error, 2).into(),
            figures(case.bound, 2).into(),
            si(case.seconds, "s").into(),
            format!("Expected: {}. Got: {}.", case.expected, case.got).into(),
        ]
    };
    Table {
        caption: caption.to_owned(),
        head: vec![
            ("case", false),
            ("verdict", false),
            ("error", true),
            ("bound", true),
            ("time", true),
            ("what must come out, what did", false),
        ],
        rows: cases.iter().map(row).collect(),
        prose: true,
    }
}
