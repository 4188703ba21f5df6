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
    let flag = |kind: fn(&Marks) -> bool| move |row: usize| i64::from(kind(&marks[row]));
    let normal = [0, 1, 2].map(|k| move |row: usize| normals[row][k]);
    let crease = [0, 1, 2].map(|k| move |row: usize| marks[row].crease.unwrap_or(normals[row])[k]);
    let (wall, rim) = (flag(|m| m.wall), flag(|m| m.rim));
    let on_crease = flag(|m| m.crease.is_some());
    let (overhang, filled) = (flag(|m| m.overhang), flag(|m| m.filled));
    let layers = |row: usize| i64::from(marks[row].layers);
    let numbers = positions.into_iter().map(Column::Number);
    let numbers = numbers.chain(normal.iter().map(|part| Column::NumberOf(part)));
    let mut columns: Vec<(&str, Column)> = POINT_COLUMNS.into_iter().zip(numbers).collect();
    columns.extend([
        ("wall", Column::IndexOf(&wall)),
        ("rim", Column::IndexOf(&rim)),
        ("crease", Column::IndexOf(&on_crease)),
        ("crease_normal_x", Column::NumberOf(&crease[0])),
        ("crease_normal_y", Column::NumberOf(&crease[1])),
        ("crease_normal_z", Column::NumberOf(&crease[2])),
        ("layers", Column::IndexOf(&layers)),
        ("overhang", Column::IndexOf(&overhang)),
        ("filled", Column::IndexOf(&filled)),
    ]);
    columns.extend(weight_m2.map(|weights| ("weight_m2", Column::Number(weights))));
    write_columns(out, &columns)
}
