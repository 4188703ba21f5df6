//! Error and currents over lambda.

use fluxform_base::force_constant::NamedConstant;
use serde_json::{Map, Value, json};

use super::data::BundleFacts;
use super::frame::{Section, figure};
use super::html::{Cell, Html, Table};
use super::number::{count, figures, lambda};
use super::pack::f32s;

/// Breakpoints that are listed; more are in `lambda.json`.
const LISTED: usize = 60;

pub(super) fn section(facts: &BundleFacts, data: &mut Map<String, Value>) -> Section {
    let mut body = Html::default();
    body.raw("<div class=\"pair\">");
    figure(
        &mut body,
        "path",
        "Force error over the force constant lambda",
        "Error of the best static currents over lambda: root mean square, at the worst point, \
         and relative to the rms force. Dots are breakpoints, where a coil meets or leaves a limit.",
    );
    figure(
        &mut body,
        "currents",
        "Currents of all coils over the force constant lambda",
        "Static currents of least mean square error over lambda; straight between breakpoints.",
    );
    body.raw("</div>");
    body.table(&constants(facts));
    body.folded_table(&breakpoints(facts));
    data.insert("path".to_owned(), curves(facts));
    Section {
        id: "path",
        title: "Over lambda",
        body,
    }
}

fn curves(facts: &BundleFacts) -> Value {
    let plot = facts.curves;
    let coils = facts.coils.len();
    let currents: Vec<Value> = (0..coils)
        .map(|coil| f32s(plot.currents_a.iter().map(|at| at[coil])))
        .collect();
    let turns: Vec<usize> = (0..plot.breakpoint.len())
        .filter(|at| plot.breakpoint[*at])
        .collect();
    let marks: Vec<Value> = plot
        .constants
        .iter()
        .map(|one| json!({ "name": one.name, "lambda": one.lambda_n_per_m }))
        .collect();
    let turns_on = |(lambda, _): &&(f64, f64)| *lambda <= plot.end_n_per_m;
    // One beyond the end, so that the line reaches it.
    let shown = facts.worst_turns.iter().filter(turns_on).count() + 1;
    let worst: Vec<(f64, f64)> = facts.worst_turns.iter().take(shown).copied().collect();
    json!({
        "end": plot.end_n_per_m,
        "chosen": facts.chosen.map(|chosen| chosen.lambda_n_per_m),
        "lambda": f32s(plot.lambda_n_per_m.iter().copied()),
        "rms": f32s(plot.rms_error_n.iter().map(|e| e * 1e3)),
        "relative": f32s(plot.relative_error.iter().map(|p| p.map_or(f64::NAN, |p| p * 100.0))),
        "worst": {
            "lambda": f32s(worst.iter().map(|turn| turn.0)),
            "error": f32s(worst.iter().map(|turn| turn.1 * 1e3)),
        },
        "currents": currents,
        "turns": turns,
        "marks": marks,
    })
}

fn constants(facts: &BundleFacts) -> Table {
    let row = |one: &NamedConstant| -> Vec<Cell> {
        vec![
            one.name.into(),
            lambda(one.lambda_n_per_m).into(),
            one.meaning.into(),
        ]
    };
    Table {
        caption: "The named force constants".to_owned(),
        head: vec![("name", false), ("lambda", true), ("what it is", false)],
        rows: facts.constants.iter().map(row).collect(),
        prose: true,
    }
}

fn breakpoints(facts: &BundleFacts) -> Table {
    let all = facts.breakpoints.len();
    let row = |one: &super::data::Breakpoint| -> Vec<Cell> {
        vec![
            figures(one.lambda_n_per_m, 6).into(),
            one.event.to_owned().into(),
        ]
    };
    let more = if all > LISTED {
        format!("; the first {LISTED}, all are in lambda.json")
    } else {
        String::new()
    };
    Table {
        caption: format!("{} of the path{more}", count(all, "breakpoint")),
        head: vec![("lambda / N/m", true), ("what happens", false)],
        rows: facts.breakpoints.iter().take(LISTED).map(row).collect(),
        prose: true,
    }
}
