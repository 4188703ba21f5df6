//! Files for people beside a bundle's numbers: its page, its plots and the tables of the plots.

use std::io;

use fluxform_bundle::table::{Column, write_columns};

use super::bundle::page;
use super::data::CalibratedObject;
use super::directions;
use super::field::{Plan, some, together};
use super::uncertainty;
use crate::plot::lambda::LambdaPlot;
use crate::plot::plane::{Cells, Panel, PlanePlot, Together};

/// The page's name in a bundle.
pub const PAGE_FILE: &str = "report.html";

/// Heights and nodes along a side of the plotted maps.
const PLOTTED: usize = 3;
const PLOTTED_SIDE: usize = 41;

/// Names and contents of the page and the plots, in the order of the manifest; `others` are files
/// that the bundle holds as they are.
///
/// # Errors
/// Numbers that are not finite.
pub fn files(
    object: &CalibratedObject,
    others: &[&str],
) -> io::Result<Vec<(&'static str, Vec<u8>)>> {
    let mut files = vec![
        (
            "plots/lambda.svg",
            object.curves.drawing().svg().into_bytes(),
        ),
        ("plots/lambda.csv", lambda_table(object.curves)?),
    ];
    if let Some(table) = errors_table(object)? {
        files.push(("plots/errors.csv", table));
    }
    let (svg, table) = field_plot(object)?;
    files.push(("plots/field.svg", svg.into_bytes()));
    files.push(("plots/field.csv", table));
    if let Some(field) = &object.directions {
        let drawing = directions::plot(object, field).drawing().svg();
        files.push(("plots/direction.svg", drawing.into_bytes()));
        files.push(("plots/direction.csv", directions::table(field)?));
    }
    if let Some(study) = &object.lambda.uncertainty {
        let drawing = uncertainty::plot(object, study).drawing().svg();
        files.push(("plots/uncertainty.svg", drawing.into_bytes()));
        files.push(("plots/uncertainty.csv", uncertainty::table(study)?));
    }
    let names = ["map.npz", "points.csv", "currents.csv", "lambda.json"];
    let names = names.iter().chain(others).copied();
    let names: Vec<&str> = names.chain(files.iter().map(|(name, _)| *name)).collect();
    files.insert(0, (PAGE_FILE, page(object, &names).into_bytes()));
    Ok(files)
}

/// Error and currents over lambda as a table.
fn lambda_table(picture: &LambdaPlot) -> io::Result<Vec<u8>> {
    let coils = picture.currents_a.first().map_or(0, Vec::len);
    let names: Vec<String> = (0..coils).map(|coil| format!("current_{coil}_a")).collect();
    let currents: Vec<Vec<f64>> = (0..coils)
        .map(|coil| picture.currents_a.iter().map(|all| all[coil]).collect())
        .collect();
    let turns: Vec<i64> = picture.breakpoint.iter().map(|b| i64::from(*b)).collect();
    let mut columns = vec![
        ("lambda_n_per_m", Column::Number(&picture.lambda_n_per_m)),
        ("rms_error_n", Column::Number(&picture.rms_error_n)),
        ("breakpoint", Column::Index(&turns)),
    ];
    let values = currents.iter().map(|values| Column::Number(values));
    columns.extend(names.iter().map(String::as_str).zip(values));
    let mut out = Vec::new();
    write_columns(&mut out, &columns)?;
    Ok(out)
}

/// Forces at the points as a table; `None` without a force constant.
fn errors_table(object: &CalibratedObject) -> io::Result<Option<Vec<u8>>> {
    let Some(forces) = &object.curves.chosen else {
        return Ok(None);
    };
    let x_m: Vec<f64> = object.points.iter().map(|row| row.x_m).collect();
    let y_m: Vec<f64> = object.points.iter().map(|row| row.y_m).collect();
    let mut out = Vec::new();
    write_columns(
        &mut out,
        &[
            ("x_m", Column::Number(&x_m)),
            ("y_m", Column::Number(&y_m)),
            ("wanted_n", Column::Number(&forces.requested_n)),
            ("given_n", Column::Number(&forces.static_n)),
        ],
    )?;
    Ok(Some(out))
}

/// dB_z/dz at three heights as a drawing and as a table of the same numbers.
fn field_plot(object: &CalibratedObject) -> io::Result<(String, Vec<u8>)> {
    let map = object.map;
    let (planes, plan) = (some(map.z_m.len(), PLOTTED), Plan::new(map, PLOTTED_SIDE));
    let values = together(object, &planes, &plan);
    let ends = |nodes: &[f64]| [nodes[0] * 1e3, nodes[nodes.len() - 1] * 1e3];
    let panel = |(plane, values): (&usize, &[f64])| Panel {
        title: format!("dBz/dz / T/m at {:.4} mm", map.z_m[*plane] * 1e3),
        cells: Some(Cells {
            columns: plan.x.len(),
            values: values.iter().copied().map(Some).collect(),
            together: Together::First,
        }),
        marks: Vec::new(),
        arrows: Vec::new(),
    };
    let panels = planes.iter().zip(values.chunks_exact(plan.len()));
    let plot = PlanePlot {
        title: format!(
            "{} on {}: all coils at their currents",
            object.lambda.shape, object.lambda.design
        ),
        unit: "mm".to_owned(),
        x: ends(&map.x_m),
        y: ends(&map.y_m),
        panels: panels.map(panel).collect(),
    };
    let nodes = || {
        let plan = &plan;
        planes.iter().flat_map(move |z| {
            let rows = plan.y.iter();
            rows.flat_map(move |y| plan.x.iter().map(move |x| (*x, *y, *z)))
        })
    };
    let x: Vec<f64> = nodes().map(|node| map.x_m[node.0]).collect();
    let y: Vec<f64> = nodes().map(|node| map.y_m[node.1]).collect();
    let z: Vec<f64> = nodes().map(|node| map.z_m[node.2]).collect();
    let mut out = Vec::new();
    write_columns(
        &mut out,
        &[
            ("x_m", Column::Number(&x)),
            ("y_m", Column::Number(&y)),
            ("z_m", Column::Number(&z)),
            ("dbz_dz_t_per_m", Column::Number(&values)),
        ],
    )?;
    Ok((plot.drawing().svg(), out))
}
