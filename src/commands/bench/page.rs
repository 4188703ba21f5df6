//! The page and the pictures of a run: both errors over processor time, and the cheapest settings.

use serde_json::{Map, Value, json};

use crate::bundle::bench::{BenchFile, Cheapest, Run, ShapeBench};
use crate::plot::curves::{CurvesPlot, Line};
use crate::report::frame::{Page, Section, figure, foot};
use crate::report::html::{Cell, Html, Table};
use crate::report::inputs::sources;
use crate::report::measured::{MeasuredCurve, MeasuredRow};
use crate::report::number::{count, figures, percent, si};

/// Name of the page.
pub const PAGE: &str = "report.html";

/// Which of the two errors.
struct Shown {
    /// In names of files.
    name: &'static str,
    /// For people.
    label: &'static str,
    of: fn(&Run) -> Option<f64>,
}

const SHOWN: [Shown; 2] = [
    Shown {
        name: "lambda",
        label: "relative error of lambda",
        of: |run| run.lambda_error,
    },
    Shown {
        name: "felt",
        label: "relative error of the felt force",
        of: |run| run.felt_error,
    },
];

/// The pictures: name of the file and SVG.
#[must_use]
pub fn pictures(file: &BenchFile) -> Vec<(String, String)> {
    let of_shape = |shape: &ShapeBench| {
        let drawn = SHOWN.map(|shown| picture(shape, &shown).drawing().svg());
        picture_names(&shape.shape).into_iter().zip(drawn)
    };
    file.shapes.iter().flat_map(of_shape).collect()
}

/// The names of the pictures of a shape.
pub fn picture_names(shape: &str) -> [String; SHOWN.len()] {
    SHOWN.map(|shown| format!("{shape}_{}.svg", shown.name))
}

fn picture(shape: &ShapeBench, shown: &Shown) -> CurvesPlot {
    let curves = shape.curves(shown.of).into_iter();
    let mut lines: Vec<Line> = curves
        .map(|curve| Line {
            name: curve.name,
            points: (curve.runs.iter())
                .filter_map(|(_, run)| Some((run.cpu_s, (shown.of)(run)?)))
                .collect(),
            marked: Vec::new(),
        })
        .collect();
    let present = shape.present();
    lines.extend(present.and_then(|run| {
        Some(Line {
            name: "present settings".to_owned(),
            points: vec![(run.cpu_s, (shown.of)(run)?)],
            marked: vec![0],
        })
    }));
    CurvesPlot {
        mark: "default",
        title: format!("{}: error against processor time", shape.shape),
        across: "processor time / s".to_owned(),
        up: shown.label.to_owned(),
        lines,
    }
}

/// The page.
#[must_use]
pub fn html(file: &BenchFile) -> String {
    let mut data = Map::new();
    let drawn = file.shapes.iter().flat_map(|shape| {
        let curves = move |shown| drawn(shape, shown);
        SHOWN.iter().map(curves)
    });
    data.insert("stages".to_owned(), drawn.collect());
    let mut lead = Html::default();
    for shape in &file.shapes {
        lead.element("p class=\"lead\"", &sentence(shape));
    }
    Page {
        kind: "Measurement",
        title: format!("{}: error against processor time", file.design),
        lead,
        sections: vec![
            answer(file),
            curves(file),
            method(file),
            sources(&file.inputs),
        ],
        data: Value::Object(data),
        foot: foot(
            &file.fluxform_version,
            "; its numbers are those of bench.csv and \
             bench.json beside it. Seconds differ from run to run, errors do not",
        ),
    }
    .html()
}

/// Result at the present settings.
fn sentence(shape: &ShapeBench) -> String {
    let error = |error: Option<f64>| error.map_or_else(|| "no number".to_owned(), percent);
    match shape.present() {
        Some(run) => format!(
            "{}: at the present settings lambda is off by {}, the felt force by at most {} of what is \
             to be felt, in {} of processor time.",
            shape.shape,
            error(run.lambda_error),
            error(run.felt_error),
            si(run.cpu_s, "s")
        ),
        None => format!("{}: the present settings were not measured.", shape.shape),
    }
}

fn cell(error: Option<f64>) -> Cell {
    error
        .map_or_else(|| "\u{2013}".to_owned(), |error| figures(error, 2))
        .into()
}

/// What the refined run's own error adds to those held against it, in words; nothing for a run without one.
pub(super) fn refined_error(shape: &ShapeBench) -> String {
    let own = shape.reference.lambda_error.filter(|own| *own > 0.0);
    own.map_or_else(String::new, |own| {
        format!(" (the refined run is off by up to {})", percent(own))
    })
}

fn cheapest_row(shape: &ShapeBench, cheapest: &Cheapest) -> Vec<Cell> {
    let run = &shape.runs[cheapest.run as usize];
    let verdict = if cheapest.met {
        percent(cheapest.target)
    } else {
        let target = percent(cheapest.target);
        format!(
            "\u{25b2} {target} is not reached{}; closest",
            refined_error(shape)
        )
    };
    vec![
        format!("{}: {verdict}", shape.shape).into(),
        si(run.cpu_s, "s").into(),
        cell(run.lambda_error),
        cell(run.felt_error),
        cheapest.paste.join("   ").into(),
    ]
}

fn answer(file: &BenchFile) -> Section {
    let mut body = Html::default();
    let rows = file.shapes.iter().flat_map(|shape| {
        let row = move |cheapest| cheapest_row(shape, cheapest);
        shape.cheapest.iter().map(row)
    });
    body.table(&Table {
        caption: "The cheapest settings within an error".to_owned(),
        head: vec![
            ("both errors within", false),
            ("CPU time", true),
            ("lambda", true),
            ("felt force", true),
            ("flags and keys", false),
        ],
        rows: rows.collect(),
        prose: true,
    });
    let constants = file.shapes.iter().flat_map(|shape| {
        shape.constants.iter().map(move |constant| {
            let lambda = |value: Option<f64>| -> Cell {
                value
                    .map_or_else(|| "none".to_owned(), |v| figures(v, 6))
                    .into()
            };
            vec![
                format!("{}: {}", shape.shape, constant.criterion.name()).into(),
                lambda(constant.lambda_n_per_m),
                lambda(constant.reference_n_per_m),
                cell(constant.error),
            ]
        })
    });
    body.folded_table(&Table {
        caption: "Every force constant at the present settings".to_owned(),
        head: vec![
            ("constant", false),
            ("N/m", true),
            ("refined, N/m", true),
            ("error", true),
        ],
        rows: constants.collect(),
        prose: false,
    });
    Section {
        id: "answer",
        title: "Result",
        body,
    }
}

fn curves(file: &BenchFile) -> Section {
    let mut body = Html::default();
    body.element(
        "p class=\"note\"",
        "A knob's curve has the others at their finest, so that its own error shows; ringed are the \
         present settings. Both axes are logarithmic.",
    );
    body.raw("<div class=\"pair\">");
    let drawings = file
        .shapes
        .iter()
        .flat_map(|s| SHOWN.iter().map(move |e| (s, e)));
    for (number, (shape, shown)) in drawings.enumerate() {
        body.raw("<div>")
            .element("h3", &format!("{}: {}", shape.shape, shown.name));
        figure(
            &mut body,
            &format!("stage-{number}"),
            &format!("{} of {} against processor time", shown.label, shape.shape),
            shown.label,
        );
        body.raw("</div>");
    }
    body.raw("</div>");
    for shape in &file.shapes {
        body.folded_table(&numbers(shape));
    }
    Section {
        id: "curves",
        title: "Error against time",
        body,
    }
}

/// Every run in a row.
fn numbers(shape: &ShapeBench) -> Table {
    let row = |run: &Run| -> Vec<Cell> {
        let chosen = shape.knobs.iter().zip(&run.settings);
        let values = chosen.map(|(knob, at)| figures(knob.settings[*at as usize].value, 6));
        let mark = if shape.is_present(run) {
            " (present)"
        } else {
            ""
        };
        vec![
            format!("{}{mark}", values.collect::<Vec<_>>().join(", ")).into(),
            si(run.cpu_s, "s").into(),
            si(run.map_s, "s").into(),
            si(run.lambda_s, "s").into(),
            cell(run.lambda_error),
            cell(run.felt_error),
        ]
    };
    Table {
        caption: format!(
            "{}: all {}; {}",
            shape.shape,
            count(shape.runs.len(), "run"),
            shape
                .knobs
                .iter()
                .map(|k| k.name.label())
                .collect::<Vec<_>>()
                .join(", ")
        ),
        head: vec![
            ("settings", false),
            ("CPU time", true),
            ("of the map", true),
            ("of lambda", true),
            ("lambda", true),
            ("felt force", true),
        ],
        rows: shape.runs.iter().map(row).collect(),
        prose: false,
    }
}

fn method(file: &BenchFile) -> Section {
    let mut body = Html::default();
    body.element("p", &format!("Errors: {}.", file.error_of))
        .element("p", &format!("Times: {}.", file.timed))
        .raw("<ul class=\"said\">");
    for shape in &file.shapes {
        let reference = &shape.reference;
        body.element(
            "li",
            &format!(
                "{}, held against: {}; lambda itself good to {}; {}, {}, {} of processor time",
                shape.shape,
                reference.how,
                reference
                    .lambda_error
                    .map_or_else(|| "an unknown part".to_owned(), percent),
                count(reference.points as usize, "point"),
                count(reference.places as usize, "place"),
                si(reference.cpu_s, "s")
            ),
        );
    }
    for left_out in &file.left_out {
        body.element(
            "li",
            &format!("Not swept, {}: {}", left_out.knob, left_out.why),
        );
    }
    body.raw("</ul>");
    Section {
        id: "method",
        title: "How it was measured",
        body,
    }
}

fn drawn(shape: &ShapeBench, shown: &Shown) -> Value {
    let curves = shape.curves(shown.of);
    let all = curves.iter().map(|curve| {
        let rows = curve.runs.iter().filter_map(|(knob, run)| {
            Some(MeasuredRow {
                knob: *knob,
                marked: shape.is_present(run),
                error: (shown.of)(run)?,
                stated: None,
                seconds: run.cpu_s,
                quartiles_s: [run.cpu_s; 2],
            })
        });
        MeasuredCurve {
            name: curve.name.clone(),
            knob: curve.knob.map_or("rank", |knob| knob.label()),
            peer: curve.knob.is_none(),
            rows: rows.collect(),
        }
        .json("", "present settings")
    });
    let mut all: Vec<Value> = all.collect();
    let present = shape.present().and_then(|run| {
        let row = MeasuredRow {
            knob: 0.0,
            marked: true,
            error: (shown.of)(run)?,
            stated: None,
            seconds: run.cpu_s,
            quartiles_s: [run.cpu_s; 2],
        };
        let curve = MeasuredCurve {
            name: "present settings".to_owned(),
            knob: "as they are",
            peer: false,
            rows: vec![row],
        };
        Some(curve.json("", "present settings"))
    });
    all.extend(present);
    json!({ "label": shown.label, "curves": all })
}
