//! Where the force points: a drawing of the angles and of the sideways parts, and its table.

use std::io;

use fluxform_bundle::replay::angle_deg;
use fluxform_bundle::table::{Column, write_columns};
use fluxform_numerics::quantile::quantile;

use super::data::{CalibratedObject, DirectionCell, DirectionField};
use super::frame::Section;
use super::html::Html;
use super::number::figures;
use crate::plot::plane::{Arrows, Cells, Panel, PlanePlot, Together};

/// Arrows along either side, at most.
const MOST_ARROWS: usize = 16;
/// The longest arrow over the spacing of the arrows.
const LONGEST: f64 = 1.6;

/// Smaller angles are rounding, degrees.
const NOTHING_DEG: f64 = 1e-6;

/// Smaller sideways forces are rounding, of the largest.
const NOTHING: f64 = 1e-9;

/// One kind of given force.
type Given = fn(&DirectionCell) -> [f64; 3];

const GIVEN: [(&str, Given); 2] = [
    ("static currents", |cell| cell.static_n),
    ("feedback", |cell| cell.feedback_n),
];

/// The drawing.
pub(super) fn plot(object: &CalibratedObject, field: &DirectionField) -> PlanePlot {
    let panel = |(name, given): (&str, Given)| {
        let angle = |cell: &Option<DirectionCell>| Some(error_deg(cell.as_ref()?, given));
        Panel {
            title: format!("{name}: error of the direction / degrees"),
            cells: Some(Cells {
                columns: field.columns,
                values: field.cells.iter().map(angle).collect(),
                together: Together::Largest,
            }),
            marks: Vec::new(),
            arrows: vec![
                arrows(field, "requested sideways force", |cell| cell.requested_n),
                arrows(field, "given sideways force", given),
            ],
        }
    };
    PlanePlot {
        title: format!(
            "{} on {}: where the force points",
            object.lambda.shape, object.lambda.design
        ),
        unit: "mm".to_owned(),
        x: field.x_m.map(|x| x * 1e3),
        y: field.y_m.map(|y| y * 1e3),
        panels: GIVEN.into_iter().map(panel).collect(),
    }
}

/// The angle between the requested force and the one given, degrees; rounding, which would get a scale of its
/// own, is none.
fn error_deg(cell: &DirectionCell, given: Given) -> f64 {
    let angle = angle_deg(cell.requested_n, given(cell));
    if angle > NOTHING_DEG { angle } else { 0.0 }
}

/// The sideways parts as arrows, all panels' to one scale.
fn arrows(field: &DirectionField, name: &'static str, of: Given) -> Arrows {
    let rows = field.cells.len() / field.columns.max(1);
    let every = field.columns.max(rows).div_ceil(MOST_ARROWS).max(1);
    let sideways = |force: [f64; 3]| force[0].hypot(force[1]);
    let all = field.cells.iter().flatten();
    let longest_n = all
        .flat_map(|cell| [cell.requested_n, cell.static_n, cell.feedback_n])
        .map(sideways)
        .fold(0.0, f64::max);
    let wide_m = (field.x_m[1] - field.x_m[0]).max(field.y_m[1] - field.y_m[0]);
    let spacing_mm = 1e3 * wide_m * every as f64 / (field.columns.max(rows).max(2) - 1) as f64;
    let mm_per_n = if longest_n > 0.0 {
        LONGEST * spacing_mm / longest_n
    } else {
        0.0
    };
    let drawn = field.cells.iter().enumerate().filter(|(at, _)| {
        (at % field.columns.max(1)).is_multiple_of(every)
            && (at / field.columns.max(1)).is_multiple_of(every)
    });
    let one = |cell: &DirectionCell| {
        let [x, y, _] = cell.position_m;
        let force = of(cell);
        let drawn_mm_per_n = match sideways(force) > NOTHING * longest_n {
            true => mm_per_n,
            // An arrow's head is seen however short it is.
            false => 0.0,
        };
        (
            [1e3 * x, 1e3 * y],
            [drawn_mm_per_n * force[0], drawn_mm_per_n * force[1]],
        )
    };
    Arrows {
        name,
        arrows: drawn
            .filter_map(|(_, cell)| cell.as_ref().map(one))
            .collect(),
    }
}

/// The same numbers as a table.
///
/// # Errors
/// Numbers that are not finite.
pub(super) fn table(field: &DirectionField) -> io::Result<Vec<u8>> {
    const NAMES: [&str; 14] = [
        "x_m",
        "y_m",
        "height_m",
        "requested_x_n",
        "requested_y_n",
        "requested_z_n",
        "static_x_n",
        "static_y_n",
        "static_z_n",
        "feedback_x_n",
        "feedback_y_n",
        "feedback_z_n",
        "static_direction_error_deg",
        "direction_error_deg",
    ];
    let row = |cell: &DirectionCell| -> Vec<f64> {
        let vectors = [
            cell.position_m,
            cell.requested_n,
            cell.static_n,
            cell.feedback_n,
        ];
        let angles = GIVEN.map(|(_, given)| angle_deg(cell.requested_n, given(cell)));
        vectors.into_iter().flatten().chain(angles).collect()
    };
    let rows: Vec<Vec<f64>> = field.cells.iter().flatten().map(row).collect();
    let columns: Vec<Vec<f64>> = (0..NAMES.len())
        .map(|column| rows.iter().map(|row| row[column]).collect())
        .collect();
    let named: Vec<(&str, Column)> = NAMES
        .into_iter()
        .zip(columns.iter().map(|values| Column::Number(values)))
        .collect();
    let mut out = Vec::new();
    write_columns(&mut out, &named)?;
    Ok(out)
}

/// The page's section; `None` where the upward force alone is requested.
pub(super) fn section(object: &CalibratedObject) -> Option<Section> {
    let field = object.directions.as_ref()?;
    let force = object.manifest.force.as_ref()?;
    let mut body = Html::default();
    let median = |given: Given| {
        let cells = field.cells.iter().flatten();
        let angles = cells.map(|cell| error_deg(cell, given));
        let mut angles: Vec<f64> = angles.collect();
        angles.sort_by(f64::total_cmp);
        match &angles[..] {
            [] => 0.0,
            angles => quantile(angles, 0.5),
        }
    };
    let [fixed, following] = GIVEN.map(|(_, given)| median(given));
    body.element(
        "p",
        &format!(
            "The requested force is {}. Half of the points are felt within {} degrees of it with the \
             static currents, which are chosen for the upward force alone, and within {} degrees with \
             feedback. Colours are the angle between the requested force and the one given, arrows their \
             sideways parts seen from above.",
            force.direction.meaning().to_lowercase(),
            figures(fixed, 3),
            figures(following, 3)
        ),
    );
    body.raw("<figure><div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"Drawing\">")
        .raw(&plot(object, field).drawing().markup())
        .raw("</div></figure>");
    Some(Section {
        id: "directions",
        title: "Where the force points",
        body,
    })
}
