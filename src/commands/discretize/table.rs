//! The table of constraint points, with what each point is besides a height.

use std::io::{self, Write};

use crate::bundle::table::{Column, POINT_COLUMNS, write_columns};
use crate::shape::ConstraintPoints;
use crate::shape::point_flags::Marks;
use crate::shape::scattered::Scattered;

/// The points of a grid.
pub(super) fn of_grid(out: &mut dyn Write, points: &ConstraintPoints) -> io::Result<()> {
    let positions = [&points.x_m[..], &points.y_m, &points.height_m];
    write(out, positions, &points.normal, &points.marks, None)
}

/// Points on no grid, with the area each stands for.
pub(super) fn of_scattered(out: &mut dyn Write, points: &Scattered) -> io::Result<()> {
    let positions = [&points.x_m[..], &points.y_m, &points.height_m];
    write(
        out,
        positions,
        &points.normal,
        &points.marks,
        Some(&points.weight_m2),
    )
}

/// After the normal: `wall`, `rim`, `crease` (0 or 1), the crease's other normal (the same one
/// where there is no crease), `layers`, `overhang`, `filled`, and `weight_m2` where there is one.
fn write(
    out: &mut dyn Write,
    positions: [&[f64]; 3],
    normals: &[[f64; 3]],
    marks: &[Marks],
    weight_m2: Option<&[f64]>,
) -> io::Result<()> {
    let flag = |kind: fn(&Marks) -> bool| -> Vec<i64> {
        marks.iter().map(|marks| i64::from(kind(marks))).collect()
    };
    let part = |k: usize| -> Vec<f64> { normals.iter().map(|normal| normal[k]).collect() };
    let other = |k: usize| -> Vec<f64> {
        let pairs = marks.iter().zip(normals);
        pairs
            .map(|(marks, normal)| marks.crease.unwrap_or(*normal)[k])
            .collect()
    };
    let (normal, crease) = ([0, 1, 2].map(part), [0, 1, 2].map(other));
    let flags = [
        ("wall", flag(|m| m.wall)),
        ("rim", flag(|m| m.rim)),
        ("crease", flag(|m| m.crease.is_some())),
    ];
    let sheets = [
        (
            "layers",
            marks
                .iter()
                .map(|marks| i64::from(marks.layers))
                .collect::<Vec<i64>>(),
        ),
        ("overhang", flag(|m| m.overhang)),
        ("filled", flag(|m| m.filled)),
    ];
    let numbers = positions
        .into_iter()
        .chain(normal.iter().map(Vec::as_slice));
    let mut columns: Vec<(&str, Column)> = POINT_COLUMNS
        .into_iter()
        .zip(numbers.map(Column::Number))
        .collect();
    columns.extend(
        flags
            .iter()
            .map(|(name, flag)| (*name, Column::Index(flag))),
    );
    let names = ["crease_normal_x", "crease_normal_y", "crease_normal_z"];
    columns.extend(
        names
            .into_iter()
            .zip(crease.iter().map(|part| Column::Number(part))),
    );
    columns.extend(
        sheets
            .iter()
            .map(|(name, flag)| (*name, Column::Index(flag))),
    );
    columns.extend(weight_m2.map(|weights| ("weight_m2", Column::Number(weights))));
    write_columns(out, &columns)
}
