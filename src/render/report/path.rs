//! Error and currents over lambda.

use fluxform_base::force_constant::NamedConstant;
use fluxform_bundle::lambda_file::PathStep;
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
    let worst = facts.lambda.worst_point.as_ref();
    let worst = worst.map_or(&[][..], |worst| &worst.path);
    // One beyond the end, so that the line reaches it.
    let on_plot = worst
        .iter()
        .filter(|turn| turn.lambda_n_per_m <= plot.end_n_per_m)
        .count();
    let worst = &worst[..worst.len().min(on_plot + 1)];
    json!({
        "end": plot.end_n_per_m,
        "chosen": facts.lambda.lambda_n_per_m,
        "lambda": f32s(plot.lambda_n_per_m.iter().copied()),
        "rms": f32s(plot.rms_error_n.iter().map(|e| e * 1e3)),
        "relative": f32s(plot.relative_error.iter().map(|p| p.map_or(f64::NAN, |p| p * 100.0))),
        "worst": {
            "lambda": f32s(worst.iter().map(|turn| turn.lambda_n_per_m)),
            "error": f32s(worst.iter().map(|turn| turn.worst_error_n * 1e3)),
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
    let file = facts.lambda;
    let worst = file.worst_point.as_ref();
    let more = [
        NamedConstant {
            name: "tolerance",
            meaning: "The largest whose errors are not felt at any point",
            lambda_n_per_m: file.tolerance.as_ref().and_then(|t| t.lambda_n_per_m),
        },
        NamedConstant {
            name: "linear, worst point",
            meaning: "Where the first limit binds if the largest error is to be least",
            lambda_n_per_m: worst.and_then(|worst| worst.lambda_linear_n_per_m),
        },
        NamedConstant {
            name: "jnd, worst point",
            meaning: "The same as jnd if the largest error is to be least",
            lambda_n_per_m: worst.and_then(|worst| worst.lambda_jnd_n_per_m),
        },
    ];
    Table {
        caption: "The named force constants".to_owned(),
        head: vec![("name", false), ("lambda", true), ("what it is", false)],
        rows: file
            .constants
            .named()
            .iter()
            .chain(&more)
            .map(row)
            .collect(),
        prose: true,
    }
}

fn breakpoints(facts: &BundleFacts) -> Table {
    let all = facts.lambda.path.len();
    let row = |one: &PathStep| -> Vec<Cell> {
        vec![
            figures(one.lambda_n_per_m, 6).into(),
            one.event.clone().into(),
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
        rows: facts.lambda.path.iter().take(LISTED).map(row).collect(),
        prose: true,
    }
}
