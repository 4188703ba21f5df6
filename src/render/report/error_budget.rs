//! How good a result is: the error budget from file to finger, and every stage's estimate.

use super::data::{CalibratedObject, ErrorTime};
use super::frame::{Section, figure};
use super::html::{Cell, Html, Table};
use super::measured::MeasuredRow;
use super::number::{figures, force, percent, si};
use fluxform_base::accuracy::StageAccuracy;
use fluxform_bundle::headline::{FeltShares, GivenForce, Headline};
use serde_json::{Map, Value, json};

/// A part of the error that a force gathers.
struct Part<'a> {
    /// The step that adds it.
    name: &'a str,
    /// Relative to the force, as `basis` states.
    part: f64,
    /// How it follows from the stages' estimates.
    basis: &'a str,
}

/// The axis of the budget: from ten to this power up to the whole force.
const LEAST: f64 = -16.0;

pub(super) fn section(object: &CalibratedObject) -> Section {
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
    felt(&mut body, object);
    body.folded_table(&stages(object));
    Section {
        id: "good",
        title: "Accuracy",
        body,
    }
}

/// The errors that a force gathers from the file to the finger, relative to it, the largest first; none
/// in bundles of programs that did not state them.
fn budget<'a>(object: &'a CalibratedObject) -> Vec<Part<'a>> {
    let headline = object.lambda.headline.as_ref();
    let parts = headline.into_iter().flat_map(|headline| &headline.budget);
    parts
        .map(|part| Part {
            name: part.part.words(),
            part: part.error,
            basis: &part.how,
        })
        .collect()
}

/// lambda, the force that is given, and what the computation adds to it.
fn said_first(body: &mut Html, headline: &Headline) {
    let given = |name: &str, given: &GivenForce| {
        let above = if given.above_saturation {
            " (lambda is above saturation: all currents are at their limits)"
        } else {
            ""
        };
        format!(
            "{name} {} of the requested force on average, {} to {} over the points{above}",
            percent(given.mean),
            percent(given.least),
            percent(given.most)
        )
    };
    let fixed = headline.static_currents.as_ref();
    let followed = headline.feedback.as_ref();
    let both = fixed
        .map(|of| given("static currents give", of))
        .into_iter();
    let both: Vec<String> = both
        .chain(followed.map(|of| given("with feedback", of)))
        .collect();
    let text = format!("lambda is {}: {}.", headline.lambda, both.join("; "));
    body.element("li", &text);
    if let Some(to_halve) = &headline.to_halve {
        let text = format!("To halve the largest part of the numerical error: {to_halve}.");
        body.element("li", &text);
    }
    if let Some(jumps) = headline.jumps {
        let text = format!(
            "At {} of the points the surface jumps: there the force goes from one side's to the other's \
             within a cell, whatever the grid, and the budget leaves that out.",
            percent(jumps)
        );
        body.element("li", &text);
    }
}

fn summary(body: &mut Html, object: &CalibratedObject, parts: &[Part<'_>]) {
    let file = object.lambda;
    let mut parts = parts.iter();
    let largest = parts
        .next()
        .map(|first| parts.fold(first, |a, b| if b.part > a.part { b } else { a }));
    body.raw("<ul class=\"said\">");
    if let Some(headline) = &file.headline {
        said_first(body, headline);
    }
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

/// All of it in one number a kind of currents, and by cause.
fn felt(body: &mut Html, object: &CalibratedObject) {
    let felt = object
        .lambda
        .headline
        .as_ref()
        .and_then(|headline| headline.felt.as_ref());
    let Some(felt) = felt else {
        return;
    };
    let robust = |of: FeltShares| of.robust.map_or_else(|| "-".to_owned(), percent);
    let row = |name: &str, of: FeltShares| -> Vec<Cell> {
        vec![
            name.to_owned().into(),
            percent(of.fixed).into(),
            percent(of.feedback).into(),
            robust(of).into(),
        ]
    };
    let mut rows: Vec<Vec<Cell>> = felt
        .parts
        .iter()
        .map(|part| row(part.cause.words(), part.error))
        .collect();
    rows.push(row("together", felt.total));
    rows.extend((felt.sampling).map(|of| row("known to within, from some points", of)));
    body.table(&Table {
        caption:
            "Felt error of the force vector, from file to finger, relative to the requested force"
                .to_owned(),
        head: vec![
            ("cause", false),
            ("static currents", true),
            ("feedback", true),
            ("chosen for uncertainties", true),
        ],
        rows,
        prose: false,
    });
    body.element(
        "p class=\"note\"",
        &format!("Not modelled: {}.", felt.not_modelled.join("; ")),
    );
}

/// One row a part, from file to finger.
fn budget_table(object: &CalibratedObject, parts: &[Part<'_>]) -> Table {
    let file = object.lambda;
    let row = |part: &Part<'_>, class: &str| -> Vec<Cell> {
        vec![
            part.name.to_owned().into(),
            Cell::Markup(bar(part.part, file.jnd, class)),
            if part.part > 0.0 {
                percent(part.part)
            } else {
                "none".to_owned()
            }
            .into(),
            part.basis.to_owned().into(),
        ]
    };
    let mut rows: Vec<Vec<Cell>> = parts.iter().map(|p| row(p, "numeric")).collect();
    if file.lambda_n_per_m.is_some() {
        let finger = Part {
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

/// A curve that was recorded beforehand: it comes after all that this run measured.
pub(super) fn recorded_section(shipped: &ErrorTime, data: &mut Map<String, Value>) -> Section {
    let curve = &shipped.curve;
    let mut body = Html::default();
    figure(
        &mut body,
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
    Section {
        id: "recorded",
        title: "Error against run time",
        body,
    }
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
        "The upward force is most wrong at ({x}, {y}) mm, {z} mm high: {} where \u{3bb}h is {}, {} {way}.",
        force(at.given_n),
        force(at.wanted_n),
        force((at.given_n - at.wanted_n).abs())
    ))
}
