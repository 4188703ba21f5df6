//! The page of a run of `bench`: how the defaults stand, then the curves they stand on.

use serde_json::{Map, Value, json};

use super::frame::{Page, Section, figure};
use super::html::{Cell, Html, Table};
use super::measured::{MeasuredCurve, MeasuredRow};
use super::number::{count, figures, percent, si};
use super::optimum::sources;

/// What rounding may add to a stated error, relative to it.
const ROUNDING: f64 = 1e-6;

/// What the page is told, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchFacts<'a> {
    /// Program that was measured.
    pub version: &'a str,
    /// Whether the finest and slowest rows were left out.
    pub quick: bool,
    /// Path and digest of what went in.
    pub inputs: Vec<(&'a str, &'a str)>,
    /// The stages that were measured.
    pub stages: Vec<StageFacts<'a>>,
    /// Time and memory against size, one entry a stage and what grows.
    pub laws: Vec<LawFacts<'a>>,
    /// Why peers have no curve.
    pub missing: &'a [String],
}

/// A stage.
#[derive(Debug, Clone, PartialEq)]
pub struct StageFacts<'a> {
    /// Its name.
    pub name: &'a str,
    /// What is timed.
    pub timed: &'a str,
    /// What the errors are relative to, or their unit.
    pub error_of: &'a str,
    /// The short name of the errors' axis.
    pub label: &'static str,
    /// What the program does by default, and why.
    pub default: &'a str,
    /// The curves and what each is held against, with that reference's own error.
    pub curves: Vec<(MeasuredCurve<'a>, &'a str, f64)>,
    /// Times of other programs against this one's, in words.
    pub ratios: Vec<String>,
}

/// How time and memory grow.
#[derive(Debug, Clone, PartialEq)]
pub struct LawFacts<'a> {
    /// What is computed.
    pub stage: &'a str,
    /// What grows.
    pub axis: &'a str,
    /// Exponent of the time with its standard error.
    pub time: [f64; 2],
    /// Exponent of the memory with its standard error.
    pub memory: [f64; 2],
    /// The seed's size.
    pub seed: f64,
    /// Size, threads, s, bytes.
    pub sizes: Vec<(f64, u64, f64, f64)>,
    /// Times the seed's size, s, bytes, and what gives way.
    pub outlook: Vec<(f64, f64, f64, Option<&'a str>)>,
}

/// A default on a curve.
struct Standing<'a> {
    stage: &'a str,
    curve: &'a MeasuredCurve<'a>,
    row: MeasuredRow,
    reference_error: f64,
}

impl Standing<'_> {
    /// Error over what is stated.
    fn used(&self) -> Option<f64> {
        let stated = self.row.stated.filter(|stated| *stated > 0.0)?;
        Some(self.row.error / stated)
    }

    /// Whether the error is within what is stated; the reference's own error does not count.
    fn kept(&self) -> Option<bool> {
        let stated = self.row.stated?;
        Some(self.row.error <= stated * (1.0 + ROUNDING) + self.reference_error)
    }

    fn name(&self) -> String {
        format!("{}: {}", self.stage, self.curve.name)
    }
}

/// The page.
#[must_use]
pub fn page(facts: &BenchFacts) -> String {
    let standings = standings(facts);
    let mut data = Map::new();
    let stages = facts.stages.iter();
    data.insert("stages".to_owned(), stages.map(drawn).collect());
    let mut sections = vec![answer(facts, &standings), curves(facts)];
    if !facts.laws.is_empty() {
        sections.push(laws(&facts.laws));
    }
    sections.push(sources(&facts.inputs));
    let mut lead = Html::default();
    lead.element("p class=\"lead\"", &told(&standings));
    Page {
        kind: "Measurement",
        title: "Error against processor time".to_owned(),
        lead,
        sections,
        data: Value::Object(data),
        foot: format!(
            "fluxform {}. This page needs nothing but itself; its numbers are those of bench.csv and \
             bench.json beside it. Seconds differ from run to run, errors do not.",
            facts.version
        ),
    }
    .html()
}

fn standings<'a>(facts: &'a BenchFacts) -> Vec<Standing<'a>> {
    let mut all = Vec::new();
    for stage in &facts.stages {
        for (curve, _, reference_error) in stage.curves.iter().filter(|(c, ..)| !c.peer) {
            all.extend(curve.rows.iter().find(|r| r.marked).map(|row| Standing {
                stage: stage.name,
                curve,
                row: *row,
                reference_error: *reference_error,
            }));
        }
    }
    all
}

fn worst<'a, 'b>(all: &'b [Standing<'a>]) -> Option<&'b Standing<'a>> {
    let used = |one: &Standing| one.used().unwrap_or(f64::NEG_INFINITY);
    let stating = all.iter().filter(|one| one.used().is_some());
    stating.max_by(|a, b| used(a).total_cmp(&used(b)))
}

fn told(all: &[Standing]) -> String {
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

fn answer(facts: &BenchFacts, all: &[Standing]) -> Section {
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
    let peers = facts.stages.iter().flat_map(|stage| &stage.curves);
    let peers = peers.filter(|(curve, ..)| curve.peer).count();
    tile(
        &mut body,
        "measured",
        &count(facts.stages.len(), "stage"),
        &format!(
            "{} of other programs{}",
            count(peers, "curve"),
            if facts.quick {
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
    if !facts.missing.is_empty() {
        body.element("h3", "Programs that were not measured")
            .raw("<ul class=\"said\">");
        for missing in facts.missing {
            body.element("li", missing);
        }
        body.raw("</ul>");
    }
    Section {
        id: "answer",
        title: "The answer",
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
    let mut stated = one.row.stated.map_or_else(|| "\u{2013}".to_owned(), short);
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
        one.curve.knob.into(),
    ]
}

fn short(error: f64) -> String {
    figures(error, 2)
}

fn curves(facts: &BenchFacts) -> Section {
    let mut body = Html::default();
    body.element(
        "p class=\"note\"",
        "Processor time on one thread, the median of the repeats; ringed points are the defaults, \
         dashed lines other programs. Errors below 1e-17 are drawn there.",
    );
    body.raw("<div class=\"pair\">");
    for (number, stage) in facts.stages.iter().enumerate() {
        body.raw("<div>").element("h3", stage.name);
        figure(
            &mut body,
            &format!("stage-{number}"),
            &format!(
                "Error against processor time of {}, both axes logarithmic",
                stage.name
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
    for stage in &facts.stages {
        if !stage.ratios.is_empty() {
            body.raw("<details>").element(
                "summary",
                &format!("{}: times of other programs at the same error", stage.name),
            );
            body.raw("<ul class=\"said\">");
            for ratio in &stage.ratios {
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

fn numbers(stage: &StageFacts) -> Table {
    let mut rows = Vec::new();
    for (curve, reference, own) in &stage.curves {
        for (at, row) in curve.rows.iter().enumerate() {
            let [low, high] = row.quartiles_s.map(|s| si(s, "s"));
            rows.push(vec![
                curve.name.clone().into(),
                format!(
                    "{}{}",
                    figures(row.knob, 6),
                    if row.marked { " (default)" } else { "" }
                )
                .into(),
                short(row.error).into(),
                row.stated.map_or_else(String::new, short).into(),
                si(row.seconds, "s").into(),
                format!("{low} to {high}").into(),
                if at == 0 {
                    format!(
                        "swept: {}; against {reference}, itself good to {}",
                        curve.knob,
                        short(*own)
                    )
                } else {
                    String::new()
                }
                .into(),
            ]);
        }
    }
    Table {
        caption: format!("Every row of {}", stage.name),
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

fn drawn(stage: &StageFacts) -> Value {
    let curves = stage.curves.iter();
    let curves: Vec<Value> = curves
        .map(|(curve, ..)| curve.json("", "default"))
        .collect();
    json!({ "label": stage.label, "curves": curves })
}

fn laws(laws: &[LawFacts]) -> Section {
    let mut body = Html::default();
    let slope = |[slope, error]: [f64; 2]| format!("{slope:.2} \u{b1} {error:.2}");
    let bytes = |bytes: f64| si(bytes, "B");
    let row = |law: &LawFacts| -> Vec<Cell> {
        let mut cells: Vec<Cell> = vec![
            format!("{}, {}", law.stage, law.axis).into(),
            slope(law.time).into(),
            slope(law.memory).into(),
            figures(law.seed, 6).into(),
        ];
        cells.extend((0..2).map(|at| {
            law.outlook
                .get(at)
                .map_or_else(String::new, |(_, s, b, breaks)| {
                    let verdict =
                        breaks.map_or_else(|| "holds".to_owned(), |b| format!("\u{25b2} {b}"));
                    format!("{verdict}: {}, {}", si(*s, "s"), bytes(*b))
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
        for (size, threads, seconds, peak) in &law.sizes {
            rows.push(vec![
                format!("{}, {}", law.stage, law.axis).into(),
                figures(*size, 7).into(),
                threads.to_string().into(),
                si(*seconds, "s").into(),
                bytes(*peak).into(),
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
