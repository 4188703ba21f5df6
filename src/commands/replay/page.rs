//! The page of `replay`: the fingers moved by hand, with the forces and currents of that moment.

use serde_json::{Map, Value, json};

use super::ReplayReport;
use super::summary::ErrorSummary;
use crate::bundle::replay::FingerRows;
use crate::report::frame::{Page, Section, figure, foot};
use crate::report::html::{Cell, Html, Table};
use crate::report::inputs::sources;
use crate::report::number::{figures, percent};
use crate::report::pack::{f32s, u16s};

/// Moments of more positions, at most: every so manyth is shown.
const MOST: usize = 1000;

/// The array below the fingers, m.
#[derive(Debug, Clone, PartialEq)]
pub struct Below<'a> {
    /// The coils' axes.
    pub positions_m: &'a [[f64; 2]],
    /// Of a winding, or half the distance of neighbours where the bundle holds no design.
    pub outer_radius_m: f64,
}

/// The replay as one HTML page: a slider over the time, and the drawing of all of it, which needs no script.
#[must_use]
pub fn html(report: &ReplayReport, below: &Below) -> String {
    let summary = &report.summary;
    let mut lead = Html::default();
    let share = |errors: &ErrorSummary| match errors.relative_rms_error {
        Some(share) => percent(share),
        None => format!("{} mN", figures(errors.rms_error_n * 1e3, 3)),
    };
    for (finger, force) in summary.fingers() {
        let on = finger.map_or_else(String::new, |finger| format!(" on the {finger}"));
        let text = format!(
            "With feedback the force{on} is off by {} (rms), with fixed currents by {}.",
            share(&force.feedback),
            share(&force.fixed)
        );
        lead.element("p class=\"lead\"", &text);
    }
    let text = format!(
        "{} of the time the limits allow only the nearest force, {} of it is outside the map. The forces are known to {} mN.",
        percent(summary.saturated_time_fraction),
        percent(summary.outside_time_fraction),
        figures(summary.force_error_n() * 1e3, 2)
    );
    lead.element("p class=\"lead\"", &text);
    for warning in &summary.warnings {
        lead.element("p class=\"note\"", warning);
    }
    let every = every(report.rows.len());
    let mut data = Map::new();
    data.insert("replay".to_owned(), moments(report, below, every));
    Page {
        kind: "Replay",
        title: format!("{} on {}", summary.shape, summary.design),
        lead,
        sections: vec![moment(every), whole(report), sources(&summary.inputs)],
        data: Value::Object(data),
        foot: foot(summary.fluxform_version, ""),
    }
    .html()
}

/// Every how many positions one is shown.
fn every(positions: usize) -> usize {
    positions.div_ceil(MOST).max(1)
}

/// The values that the script draws; mm, mN, A and s.
fn moments(report: &ReplayReport, below: &Below, every: usize) -> Value {
    let rows = &report.rows;
    let coil = |coil: usize| {
        let own = rows.current_a.iter().skip(coil).step_by(rows.coils);
        u16s(&own.step_by(every).copied().collect::<Vec<f64>>())
    };
    let milli = |values: &[f64]| f32s(values.iter().step_by(every).map(|value| value * 1e3));
    let finger = |rows: &FingerRows| {
        let axis = |axis: usize| {
            let positions = rows.position_m.iter().step_by(every);
            f32s(positions.map(|position| position[axis] * 1e3))
        };
        let mut curves = json!({
            "x": axis(0), "y": axis(1), "z": axis(2),
            "surface": milli(&rows.height_m),
            "requested": milli(&rows.wanted_force_n),
            "given": milli(&rows.force_n),
            "fixed": milli(&rows.static_force_n),
        });
        if !rows.sideways_n.is_empty() {
            let along_x = |values: &[[f64; 2]]| {
                f32s(values.iter().step_by(every).map(|force| force[0] * 1e3))
            };
            curves["requested_x"] = along_x(&rows.wanted_sideways_n);
            curves["given_x"] = along_x(&rows.sideways_n);
        }
        curves
    };
    let axes = below.positions_m.iter();
    json!({
        "t": f32s(rows.t_s.iter().step_by(every).copied()),
        "fingers": rows.fingers().map(finger).collect::<Vec<_>>(),
        "currents": (0..rows.coils).map(coil).collect::<Vec<_>>(),
        "coils": axes.map(|axis| axis.map(|m| m * 1e3)).collect::<Vec<_>>(),
        "radius": below.outer_radius_m * 1e3,
    })
}

fn moment(every: usize) -> Section {
    let mut body = Html::default();
    let thinned = match every {
        1 => String::new(),
        _ => format!(" Of the positions one in {every} is shown."),
    };
    let caption = format!(
        "From above: red coils push, blue ones pull, the darker the stronger. From the side: the force requested \
         (grey, wide), with feedback (the finger's colour) and with fixed currents (orange), and the surface \
         below the finger.{thinned}"
    );
    figure(
        &mut body,
        "replay",
        "Fingers, forces and currents at one moment",
        &caption,
    );
    Section {
        id: "moment",
        title: "One moment",
        body,
    }
}

fn whole(report: &ReplayReport) -> Section {
    let mut body = Html::default();
    body.raw("<figure><div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"Drawing\">")
        .raw(&report.drawing().markup())
        .raw("</div>")
        .element("figcaption", "Shaded: outside the map.")
        .raw("</figure>");
    let summary = &report.summary;
    let row = |(name, errors): (String, &ErrorSummary)| -> Vec<Cell> {
        let at = errors.worst_at.as_ref();
        vec![
            name.into(),
            format!("{} mN", figures(errors.rms_error_n * 1e3, 3)).into(),
            errors
                .relative_rms_error
                .map_or_else(String::new, percent)
                .into(),
            format!("{} mN", figures(errors.worst_error_n * 1e3, 3)).into(),
            at.map_or_else(String::new, |at| format!("{} s", figures(at.t_s, 4)))
                .into(),
        ]
    };
    let fingers = summary.fingers().into_iter();
    let rows = fingers.flat_map(|(finger, force)| {
        let of = finger.map_or_else(String::new, |finger| format!("{finger}, "));
        [
            row((format!("{of}with feedback"), &force.feedback)),
            row((format!("{of}with fixed currents"), &force.fixed)),
        ]
    });
    body.table(&Table {
        caption: "Error of the upward force".to_owned(),
        head: vec![
            ("currents", false),
            ("rms", true),
            ("of the requested", true),
            ("worst", true),
            ("at", true),
        ],
        rows: rows.collect(),
        prose: false,
    });
    Section {
        id: "whole",
        title: "All of it",
        body,
    }
}
