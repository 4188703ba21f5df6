//! The cost of uncertainties in felt force: error against power, its table, and the page's section.

use std::io;

use fluxform_bundle::lambda_file::{CurrentsError, RobustSetting, Study, TradeOff};
use fluxform_bundle::table::{Column, write_columns};

use super::data::CalibratedObject;
use super::frame::Section;
use super::html::{Cell, Html, Table};
use super::number::{figures, percent};
use crate::plot::curves::{CurvesPlot, Line};

/// Currents of one kind chosen for the uncertainties.
fn settings(study: &Study) -> [(&'static str, &RobustSetting); 2] {
    [
        ("feedback, chosen for the uncertainties", &study.robust),
        ("static, chosen for the uncertainties", &study.robust_static),
    ]
}

/// All kinds of currents.
fn all(study: &Study) -> [(&'static str, &CurrentsError); 4] {
    let [feedback, fixed] = settings(study).map(|(name, setting)| (name, &setting.error));
    [
        ("static currents", &study.fixed),
        fixed,
        ("feedback, least power", &study.feedback),
        feedback,
    ]
}

/// Error against power: of the force that is requested, by which currents are chosen.
pub(super) fn plot(object: &CalibratedObject, study: &Study) -> CurvesPlot {
    let vector = object.manifest.force.is_some();
    let of_requested = |whole: f64, upward: f64| if vector { whole } else { upward };
    let place = |error: &CurrentsError| {
        let error = &error.promised;
        let of = of_requested(error.expected, error.vertical);
        (error.mean_power_w, of)
    };
    let curve = |(name, setting): (&str, &RobustSetting)| {
        let point = |of: &TradeOff| (of.mean_power_w, of_requested(of.expected, of.vertical));
        let promised = place(&setting.error);
        let mut points: Vec<_> = setting.trade_off.iter().map(point).collect();
        let chosen = points.partition_point(|(power, _)| *power < promised.0);
        points.insert(chosen, promised);
        Line {
            name: name.to_owned(),
            points,
            marked: vec![chosen],
        }
    };
    let alone = |name: &str, error: &CurrentsError| Line {
        name: name.to_owned(),
        points: vec![place(error)],
        marked: Vec::new(),
    };
    let mut lines = settings(study).map(curve).to_vec();
    lines.push(alone("feedback, least power", &study.feedback));
    lines.push(alone("static currents", &study.fixed));
    CurvesPlot {
        title: format!(
            "{} on {}: felt error against power",
            object.lambda.shape, object.lambda.design
        ),
        across: "mean power / W".to_owned(),
        up: if vector {
            "expected error, relative to the requested force".to_owned()
        } else {
            "expected upward error, relative to the requested force".to_owned()
        },
        mark: "chosen",
        lines,
    }
}

/// The same curves as a table.
///
/// # Errors
/// Numbers that are not finite.
pub(super) fn table(study: &Study) -> io::Result<Vec<u8>> {
    let rows: Vec<(i64, &TradeOff)> = [&study.robust_static, &study.robust]
        .into_iter()
        .zip([0, 1])
        .flat_map(|(setting, feedback)| setting.trade_off.iter().map(move |of| (feedback, of)))
        .collect();
    let feedback: Vec<i64> = rows.iter().map(|row| row.0).collect();
    let column =
        |get: fn(&TradeOff) -> f64| -> Vec<f64> { rows.iter().map(|row| get(row.1)).collect() };
    let columns = [
        ("price_n2_per_w", column(|of| of.price_n2_per_w)),
        ("mean_power_w", column(|of| of.mean_power_w)),
        ("expected_error", column(|of| of.expected)),
        ("vertical_error", column(|of| of.vertical)),
        ("sideways_error", column(|of| of.sideways)),
    ];
    let mut named = vec![("feedback", Column::Index(&feedback))];
    named.extend(
        columns
            .iter()
            .map(|(name, values)| (*name, Column::Number(values))),
    );
    let mut out = Vec::new();
    write_columns(&mut out, &named)?;
    Ok(out)
}

/// What is uncertain, and what the errors are.
fn explained(object: &CalibratedObject, study: &Study) -> String {
    let given = &study.given;
    format!(
        "The magnet may be {} mm off along each axis, tilted by {} degrees, {} C warmer, its drivers {} off, each \
         evenly within its bound. Errors are of the force vector, root mean squares over points and uncertainties, \
         relative to the requested force; the worst is relative to the largest requested force. Promised by a \
         quadratic form, realised by {} random displays. {}",
        figures(1e3 * given.sensor_m, 3),
        figures(given.tilt_deg, 3),
        figures(given.heat_c, 3),
        percent(given.driver),
        study.draws,
        if object.manifest.force.is_some() {
            "Currents are chosen for the least error of the vector."
        } else {
            "Currents are chosen for the least error of the upward force, which alone is requested; the plot shows it."
        }
    )
}

/// The page's section; `None` where nothing is uncertain.
pub(super) fn section(object: &CalibratedObject) -> Option<Section> {
    let study = object.lambda.uncertainty.as_ref()?;
    let mut body = Html::default();
    body.element("p", &explained(object, study));
    body.raw("<figure>")
        .raw(&plot(object, study).drawing().markup())
        .raw("</figure>");
    let row = |(name, error): &(&str, &CurrentsError)| -> Vec<Cell> {
        let (promised, realised) = (&error.promised, &error.realised);
        let cells = [
            percent(promised.expected),
            percent(realised.expected),
            percent(promised.vertical),
            percent(promised.sideways),
            percent(promised.worst),
            figures(promised.mean_power_w, 3),
        ];
        let name = Cell::from((*name).to_owned());
        std::iter::once(name).chain(cells.map(Cell::from)).collect()
    };
    body.table(&Table {
        caption: "Felt error with each kind of currents".to_owned(),
        head: vec![
            ("currents", false),
            ("error promised", true),
            ("realised", true),
            ("upward", true),
            ("sideways", true),
            ("worst", true),
            ("W", true),
        ],
        rows: all(study).iter().map(row).collect(),
        prose: false,
    });
    let causes = study.causes.iter().map(|of| -> Vec<Cell> {
        let shares = [
            of.alone.fixed,
            of.alone.feedback,
            of.alone.robust,
            of.halving_gains.feedback,
            of.halving_gains.robust,
        ];
        let name = Cell::from(of.cause.words().to_owned());
        std::iter::once(name)
            .chain(shares.map(|of| Cell::from(percent(of))))
            .collect()
    });
    body.table(&Table {
        caption: "What each uncertainty adds alone, and what half of it would take away".to_owned(),
        head: vec![
            ("uncertain", false),
            ("static", true),
            ("feedback", true),
            ("chosen for it", true),
            ("half: feedback", true),
            ("half: chosen for it", true),
        ],
        rows: causes.collect(),
        prose: false,
    });
    Some(Section {
        id: "uncertainty",
        title: "Uncertainty",
        body,
    })
}
