//! Error and currents over lambda.

use fluxform_base::force_constant::NamedConstant;
use fluxform_bundle::lambda_file::{LambdaFile, PathStep, WorstPointStep};
use serde_json::{Map, Value, json};

use super::data::CalibratedObject;
use super::frame::{Section, figure};
use super::html::{Cell, Html, Table};
use super::number::{count, figures, lambda};
use super::pack::f32s;

/// Breakpoints that are listed; more are in `lambda.json`.
const LISTED: usize = 60;

pub(super) fn section(object: &CalibratedObject, data: &mut Map<String, Value>) -> Section {
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
    body.table(&constants(object));
    body.folded_table(&breakpoints(object));
    data.insert("path".to_owned(), curves(object));
    Section {
        id: "path",
        title: "Over lambda",
        body,
    }
}

fn curves(object: &CalibratedObject) -> Value {
    let plot = object.curves;
    let currents: Vec<Value> = (0..object.manifest.array.positions_m.len())
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
    let worst = object.lambda.worst_point.as_ref();
    let worst = worst.map_or(&[][..], |worst| &worst.path);
    let before_end = |turn: &&WorstPointStep| turn.lambda_n_per_m <= plot.end_n_per_m;
    // One beyond the end, so that the line reaches it.
    let shown = worst.iter().filter(before_end).count() + 1;
    let worst = &worst[..shown.min(worst.len())];
    json!({
        "end": plot.end_n_per_m,
        "chosen": object.lambda.lambda_n_per_m,
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

/// Every force constant of a result by name: those of the mean square, then those of the largest
/// error.
fn named_constants(file: &LambdaFile) -> Vec<NamedConstant> {
    let worst = file.worst_point.as_ref();
    let more = [
        (
            "tolerance",
            "The largest whose errors are not felt at any point",
            file.tolerance.as_ref().and_then(|t| t.lambda_n_per_m),
        ),
        (
            "linear, worst point",
            "Where the first limit binds if the largest error is to be least",
            worst.and_then(|worst| worst.lambda_linear_n_per_m),
        ),
        (
            "jnd, worst point",
            "The same as jnd if the largest error is to be least",
            worst.and_then(|worst| worst.lambda_jnd_n_per_m),
        ),
    ];
    let more = more.map(|(name, meaning, lambda_n_per_m)| NamedConstant {
        name,
        meaning,
        lambda_n_per_m,
    });
    file.constants.named().into_iter().chain(more).collect()
}

fn constants(object: &CalibratedObject) -> Table {
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
        rows: named_constants(object.lambda).iter().map(row).collect(),
        prose: true,
    }
}

fn breakpoints(object: &CalibratedObject) -> Table {
    let path = &object.lambda.path;
    let all = path.len();
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
        rows: path.iter().take(LISTED).map(row).collect(),
        prose: true,
    }
}
