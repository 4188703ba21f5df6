//! The page of a run: how the defaults stand, then the curves they stand on.

use fluxform::report::frame::{Page, Section, figure, foot};
use fluxform::report::html::{Cell, Html, Table};
use fluxform::report::inputs::sources;
use fluxform::report::measured::{MeasuredCurve, MeasuredRow};
use fluxform::report::number::{count, figures, percent, si};
use serde_json::{Map, Value, json};

use crate::file::{BenchFile, Curve, Law, Row, StageCurves};
use crate::picture::unit_of;
use crate::summary::ratios;

/// Name of a page.
pub const PAGE: &str = "report.html";
/// Largest part of rounding in a stated error, relative to it.
const ROUNDING: f64 = 1e-6;

/// A default on a curve.
struct Standing<'a> {
    stage: &'a str,
    curve: &'a Curve,
    row: &'a Row,
}

impl Standing<'_> {
    /// Error over what is stated.
    fn used(&self) -> Option<f64> {
        let stated = self.row.stated_error.filter(|stated| *stated > 0.0)?;
        Some(self.row.error / stated)
    }

    /// Whether the error is within what is stated; the reference's own error does not count.
    fn kept(&self) -> Option<bool> {
        let stated = self.row.stated_error?;
        Some(self.row.error <= stated * (1.0 + ROUNDING) + self.curve.reference_error)
    }

    fn name(&self) -> String {
        format!("{}: {}", self.stage, name(self.curve))
    }
}

/// The page.
#[must_use]
pub fn html(file: &BenchFile) -> String {
    let standings = standings(file);
    let mut data = Map::new();
    let stages = file.stages.iter();
    data.insert("stages".to_owned(), stages.map(drawn).collect());
    let mut sections = vec![answer(file, &standings), curves(file)];
    if !file.scaling.is_empty() {
        sections.push(laws(&file.scaling));
    }
    sections.push(sources(&file.inputs));
    let mut lead = Html::default();
    lead.element("p class=\"lead\"", &reported(&standings));
    Page {
        kind: "Measurement",
        title: "Error against processor time".to_owned(),
        lead,
        sections,
        data: Value::Object(data),
        foot: foot(
            &file.fluxform_version,
            "; its numbers are those of bench.csv and \
             bench.json beside it. Seconds differ from run to run, errors do not",
        ),
    }
    .html()
}

fn standings(file: &BenchFile) -> Vec<Standing<'_>> {
    let mut all = Vec::new();
    for stage in &file.stages {
        for curve in stage.curves.iter().filter(|curve| !curve.is_peer()) {
            all.extend(
                curve
                    .rows
                    .iter()
                    .find(|row| row.default)
                    .map(|row| Standing {
                        stage: &stage.stage,
                        curve,
                        row,
                    }),
            );
        }
    }
    all
}

fn worst<'a, 'b>(all: &'b [Standing<'a>]) -> Option<&'b Standing<'a>> {
    let used = |one: &Standing| one.used().unwrap_or(f64::NEG_INFINITY);
    let stating = all.iter().filter(|one| one.used().is_some());
    stating.max_by(|a, b| used(a).total_cmp(&used(b)))
}

fn reported(all: &[Standing]) -> String {
    let stating = all.iter().filter(|one| one.kept().is_some()).count();
    let kept = all.iter().filter(|one| one.kept() == Some(true)).count();
    let Some(worst) = worst(all) else {
        return "No default that states its error is among what was measured.".to_owned();
    };
    let verdict = if kept == stating {
        "All keep it".to_owned()
    } else {
        format!("{} do not keep it", stating - kept)
    };
    format!(
        "{} of the measured computations state the error of their default. {verdict}; closest to its \
         promise is {}: it uses {} of what it states.",
        stating,
        worst.name(),
        percent(worst.used().unwrap_or(0.0))
    )
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

fn answer(file: &BenchFile, all: &[Standing]) -> Section {
    let mut body = Html::default();
    body.raw("<dl class=\"tiles\">");
    let stating = all.iter().filter(|one| one.kept().is_some()).count();
    let kept = all.iter().filter(|one| one.kept() == Some(true)).count();
    tile(
        &mut body,
        "stated errors that hold",
        &format!("{kept} of {stating}"),
        "at the defaults",
    );
    if let Some(worst) = worst(all) {
        let used = percent(worst.used().unwrap_or(0.0));
        tile(
            &mut body,
            "closest to its promise",
            &used,
            &format!("of the stated error: {}", worst.name()),
        );
    }
    let seconds = |one: &&Standing| one.row.seconds;
    if let Some(slowest) = all.iter().max_by(|a, b| seconds(a).total_cmp(&seconds(b))) {
        tile(
            &mut body,
            "slowest default",
            &si(slowest.row.seconds, "s"),
            &slowest.name(),
        );
    }
    let peers = file.stages.iter().flat_map(|stage| &stage.curves);
    let peers = peers.filter(|curve| curve.is_peer()).count();
    tile(
        &mut body,
        "measured",
        &count(file.stages.len(), "stage"),
        &format!(
            "{} of other programs{}",
            count(peers, "curve"),
            if file.quick {
                "; the finest and slowest rows left out"
            } else {
                ""
            }
        ),
    );
    body.raw("</dl>");
    if !all.is_empty() {
        body.table(&Table {
            caption: "How the defaults stand: error found beside error stated".to_owned(),
            head: vec![
                ("stage", false),
                ("share of what it states, 1e-4 to 1", false),
                ("default", true),
                ("error", true),
                ("stated", true),
                ("CPU time", true),
                ("what is swept", false),
            ],
            rows: all.iter().map(standing).collect(),
            prose: true,
        });
        body.element(
            "p class=\"note\"",
            "A stage that states no error is exact, or has none to state; its error is that of \
             rounding or of the reference. What an error is relative to stands with each stage below.",
        );
    }
    if !file.peers_missing.is_empty() {
        body.element("h3", "Programs that were not measured")
            .raw("<ul class=\"said\">");
        for missing in &file.peers_missing {
            body.element("li", missing);
        }
        body.raw("</ul>");
    }
    Section {
        id: "answer",
        title: "Result",
        body,
    }
}

fn standing(one: &Standing) -> Vec<Cell> {
    let bar = one.used().map_or_else(
        || "<span>states none</span>".to_owned(),
        |used| {
            let width = ((used.max(1e-4).log10() + 4.0) * 25.0).clamp(0.0, 100.0);
            let class = if one.kept() == Some(false) {
                "full"
            } else {
                "some"
            };
            format!(
                "<svg class=\"bar\" aria-hidden=\"true\"><rect class=\"range\" width=\"100%\" y=\"25%\" \
                 height=\"50%\"/><rect class=\"{class}\" width=\"{width:.2}%\" y=\"25%\" height=\"50%\"/></svg>"
            )
        },
    );
    let mut stated = one
        .row
        .stated_error
        .map_or_else(|| "\u{2013}".to_owned(), short);
    if one.kept() == Some(false) {
        stated.insert_str(0, "\u{25b2} not kept: ");
    }
    vec![
        one.name().into(),
        Cell::Markup(bar),
        figures(one.row.knob, 6).into(),
        short(one.row.error).into(),
        stated.into(),
        si(one.row.seconds, "s").into(),
        one.curve.knob.as_str().into(),
    ]
}

fn short(error: f64) -> String {
    figures(error, 2)
}

fn curves(file: &BenchFile) -> Section {
    let mut body = Html::default();
    body.element(
        "p class=\"note\"",
        "Processor time on one thread, the median of the repeats; ringed points are the defaults, \
         dashed lines other programs. Errors below 1e-17 are drawn there.",
    );
    body.raw("<div class=\"pair\">");
    for (number, stage) in file.stages.iter().enumerate() {
        body.raw("<div>").element("h3", &stage.stage);
        figure(
            &mut body,
            &format!("stage-{number}"),
            &format!(
                "Error against processor time of {}, both axes logarithmic",
                stage.stage
            ),
            &format!(
                "Timed: {}. Error of: {}. Default: {}.",
                stage.timed, stage.error_of, stage.default
            ),
        );
        body.raw("</div>");
    }
    body.raw("</div>");
    // Beneath the drawings and as wide as the page: opened side by side they would not fit paper.
    for stage in &file.stages {
        let ratios = ratios(stage);
        if !ratios.is_empty() {
            body.raw("<details>").element(
                "summary",
                &format!("{}: times of other programs at the same error", stage.stage),
            );
            body.raw("<ul class=\"said\">");
            for ratio in &ratios {
                body.element("li", ratio);
            }
            body.raw("</ul></details>");
        }
        body.folded_table(&numbers(stage));
    }
    Section {
        id: "curves",
        title: "Error against time",
        body,
    }
}

fn numbers(stage: &StageCurves) -> Table {
    let mut rows = Vec::new();
    for curve in &stage.curves {
        for (at, row) in curve.rows.iter().enumerate() {
            let [low, high] = [row.seconds_low, row.seconds_high].map(|s| si(s, "s"));
            rows.push(vec![
                name(curve).into(),
                format!(
                    "{}{}",
                    figures(row.knob, 6),
                    if row.default { " (default)" } else { "" }
                )
                .into(),
                short(row.error).into(),
                row.stated_error.map_or_else(String::new, short).into(),
                si(row.seconds, "s").into(),
                format!("{low} to {high}").into(),
                if at == 0 {
                    format!(
                        "swept: {}; against {}, itself good to {}",
                        curve.knob,
                        curve.reference,
                        short(curve.reference_error)
                    )
                } else {
                    String::new()
                }
                .into(),
            ]);
        }
    }
    Table {
        caption: format!("Every row of {}", stage.stage),
        head: vec![
            ("curve", false),
            ("knob", true),
            ("error", true),
            ("stated", true),
            ("CPU time", true),
            ("quartiles", true),
            ("knob and reference", false),
        ],
        rows,
        prose: true,
    }
}

/// The curve's name, with its program where that is another.
fn name(curve: &Curve) -> String {
    if curve.is_peer() {
        format!("{}: {}", curve.program, curve.name)
    } else {
        curve.name.clone()
    }
}

fn drawn(stage: &StageCurves) -> Value {
    // Its reference is printed below the drawing.
    let label = if unit_of(&stage.error_of).starts_with("error / m") {
        "error / m"
    } else {
        "relative error"
    };
    let measured = |curve: &Curve| {
        let rows = curve.rows.iter().map(|row| MeasuredRow {
            knob: row.knob,
            marked: row.default,
            error: row.error,
            stated: row.stated_error,
            seconds: row.seconds,
            quartiles_s: [row.seconds_low, row.seconds_high],
        });
        let curve = MeasuredCurve {
            name: name(curve),
            knob: &curve.knob,
            peer: curve.is_peer(),
            rows: rows.collect(),
        };
        curve.json("", "default")
    };
    let curves: Vec<Value> = stage.curves.iter().map(measured).collect();
    json!({ "label": label, "curves": curves })
}

fn laws(laws: &[Law]) -> Section {
    let mut body = Html::default();
    let slope = |slope: f64, error: f64| format!("{slope:.2} \u{b1} {error:.2}");
    let bytes = |bytes: f64| si(bytes, "B");
    let row = |law: &Law| -> Vec<Cell> {
        let mut cells: Vec<Cell> = vec![
            format!("{}, {}", law.stage, law.axis).into(),
            slope(law.seconds_slope, law.seconds_slope_error).into(),
            slope(law.memory_slope, law.memory_slope_error).into(),
            figures(law.seed_size, 6).into(),
        ];
        cells.extend((0..2).map(|at| {
            law.outlook
                .get(at)
                .map_or_else(String::new, |at| {
                    let breaks = at.breaks.as_ref();
                    let verdict =
                        breaks.map_or_else(|| "holds".to_owned(), |b| format!("\u{25b2} {b}"));
                    format!("{verdict}: {}, {}", si(at.seconds, "s"), bytes(at.bytes))
                })
                .into()
        }));
        cells
    };
    body.table(&Table {
        caption: "Processor time and memory grow as size to the power of a slope".to_owned(),
        head: vec![
            ("stage, what grows", false),
            ("time slope", true),
            ("memory slope", true),
            ("the seed's size", true),
            ("at 100 times that", true),
            ("at 10,000 times", true),
        ],
        rows: laws.iter().map(row).collect(),
        prose: false,
    });
    body.element(
        "p class=\"note\"",
        "Slopes over the larger half of the sizes, with their standard errors; memory is the \
         process's peak beyond an idle one's. Marked is what gives way first: an hour, or 24 GiB.",
    );
    let mut rows = Vec::new();
    for law in laws {
        for row in &law.sizes {
            rows.push(vec![
                format!("{}, {}", law.stage, law.axis).into(),
                figures(row.size, 7).into(),
                row.threads.to_string().into(),
                si(row.seconds, "s").into(),
                bytes(row.peak_bytes as f64).into(),
            ]);
        }
    }
    body.folded_table(&Table {
        caption: "Every size".to_owned(),
        head: vec![
            ("stage, what grows", false),
            ("size", true),
            ("threads", true),
            ("CPU time", true),
            ("peak memory", true),
        ],
        rows,
        prose: false,
    });
    Section {
        id: "scaling",
        title: "Against size",
        body,
    }
}
