//! How good a result is: the error budget from file to finger, and every stage's estimate.

use super::data::{CalibratedObject, ErrorTime};
use super::frame::{Section, figure};
use super::html::{Cell, Html, Table};
use super::measured::MeasuredRow;
use super::number::{figures, force, percent, si};
use fluxform_base::accuracy::StageAccuracy;
use serde_json::{Map, Value, json};

/// A part of the error that a force gathers.
struct BudgetPart {
    /// The step that adds it.
    name: &'static str,
    /// Relative to the force, as `basis` states.
    part: f64,
    /// How it follows from the stages' estimates.
    basis: &'static str,
}

/// The axis of the budget: from ten to this power up to the whole force.
const LEAST: f64 = -16.0;

pub(super) fn section(object: &CalibratedObject, data: &mut Map<String, Value>) -> Section {
    let mut body = Html::default();
    let parts = budget(object);
    summary(&mut body, object, &parts);
    body.table(&budget_table(object, &parts));
    body.raw(
        "<p class=\"key\"><span class=\"swatch numeric\"></span>numerical error \
              <span class=\"swatch physical\"></span>what static currents cannot give \
              <span class=\"swatch jnd\"></span>just noticeable; the bars' scale is logarithmic, \
              1e-16 at the left, the whole force at the right</p>",
    );
    body.folded_table(&stages(object));
    if let Some(curve) = &object.error_time {
        error_time(&mut body, curve, data);
    }
    Section {
        id: "good",
        title: "How good it is",
        body,
    }
}

/// The errors that a force gathers from the file to the finger, relative to it.
fn budget(object: &CalibratedObject) -> Vec<BudgetPart> {
    let (manifest, file) = (object.manifest, object.lambda);
    let estimate = |stage: &str| manifest.accuracy.get(stage).map_or(0.0, |s| s.estimate);
    let heights = ["points_tessellation", "points"].map(estimate);
    let all: f64 = heights.iter().sum();
    let lowest_m = object.lowest_m();
    let over_lowest = if lowest_m > 0.0 { 1.0 / lowest_m } else { 0.0 };
    let (per_m, basis) = match manifest.accuracy.get("lambda_of_heights") {
        Some(moved) if all > 0.0 => (
            moved.estimate / all,
            "height error, times what heights change in lambda",
        ),
        Some(_) | None => (over_lowest, "height error over the lowest height"),
    };
    let part = |name, part: f64, basis| BudgetPart { name, part, basis };
    let mut parts = vec![
        part("tessellation", heights[0] * per_m, basis),
        part("rounding in the file", heights[1] * per_m, basis),
        part(
            "number of points",
            estimate("lambda_of_points"),
            "of lambda, against the limit of ever more points",
        ),
        part(
            "between points",
            estimate("points_grid") * over_lowest,
            "how far a runtime's heights lie off the surface, over the lowest height",
        ),
        part(
            "field",
            estimate("forces"),
            "of the largest gradient at the point's height",
        ),
        part(
            "map nodes",
            estimate("map"),
            "of the largest gradient at the node's height",
        ),
        part(
            "map interpolation",
            manifest.map.interpolation.largest_error,
            "largest between nodes, of the largest gradient at the height",
        ),
    ];
    if let (Some(rms_n), Some(relative), Some(gap_n2)) = (
        file.rms_error_n,
        file.relative_rms_error,
        file.duality_gap_n2,
    ) && relative > 0.0
    {
        // sqrt(e^2 + gap) - e, at most either of these.
        let more_n = (gap_n2 / (2.0 * rms_n)).min(gap_n2.sqrt());
        parts.push(part(
            "lambda's optimality",
            more_n * relative / rms_n,
            "what the duality gap leaves open of the rms error, over the rms force",
        ));
    }
    parts
}

fn summary(body: &mut Html, object: &CalibratedObject, parts: &[BudgetPart]) {
    let file = object.lambda;
    let mut parts = parts.iter();
    let largest = parts
        .next()
        .map(|first| parts.fold(first, |a, b| if b.part > a.part { b } else { a }));
    body.raw("<ul class=\"said\">");
    if let Some(largest) = largest {
        let text = format!(
            "The largest numerical error on the way from file to finger is that of {}: {} of the \
             force. A finger notices {}.",
            largest.name,
            percent(largest.part),
            percent(file.jnd)
        );
        body.element("li", &text);
    }
    if let (Some(gap_n2), Some(rms_n)) = (file.duality_gap_n2, file.rms_error_n) {
        let text = format!(
            "No currents within the limits give a smaller mean square error at this lambda: the \
             duality gap is {} N\u{b2}, the mean square error {} N\u{b2}.",
            figures(gap_n2, 2),
            figures(rms_n * rms_n, 3)
        );
        body.element("li", &text);
    }
    let text = format!(
        "The forces of {} coils at {} points have rank {}.",
        object.manifest.array.positions_m.len(),
        file.points,
        file.rank
    );
    body.element("li", &text).raw("</ul>");
}

/// One row a part, from file to finger.
fn budget_table(object: &CalibratedObject, parts: &[BudgetPart]) -> Table {
    let file = object.lambda;
    let row = |part: &BudgetPart, class: &str| -> Vec<Cell> {
        vec![
            part.name.into(),
            Cell::Markup(bar(part.part, file.jnd, class)),
            if part.part > 0.0 {
                percent(part.part)
            } else {
                "none".to_owned()
            }
            .into(),
            part.basis.into(),
        ]
    };
    let mut rows: Vec<Vec<Cell>> = parts.iter().map(|p| row(p, "numeric")).collect();
    if file.lambda_n_per_m.is_some() {
        let finger = BudgetPart {
            name: "static currents",
            part: file.relative_rms_error.unwrap_or(0.0),
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

fn stages(object: &CalibratedObject) -> Table {
    let row = |(name, stage): (&String, &StageAccuracy)| -> Vec<Cell> {
        vec![
            name.replace('_', " ").into(),
            figures(stage.estimate, 3).into(),
            stage.relative_to.clone().into(),
            stage.method.clone().into(),
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
        rows: object.manifest.accuracy.iter().map(row).collect(),
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
pub(super) fn worst(object: &CalibratedObject) -> Option<String> {
    let at = object.worst_place()?;
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
