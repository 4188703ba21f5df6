//! The table of constraint points with their flags.

use std::io::{self, Write};

use super::point_row;
use crate::bundle::table::{PointRow, RowColumn, write_joined_rows};
use crate::point_weights::Weights;
use crate::shape::ConstraintPoints;
use crate::shape::point_flags::Marks;
use crate::shape::scattered::Scattered;

/// The part of a row after those of `points.csv`.
struct Flags {
    marks: Marks,
    /// The other normal of a crease; the point's own where there is no crease.
    crease_normal: [f64; 3],
    /// Area that the point stands for, where points are weighted.
    weight_m2: f64,
}

fn flag(is: bool) -> f64 {
    f64::from(u8::from(is))
}

/// The columns of weighted points; of those that count alike all but the last.
const COLUMNS: &[RowColumn<Flags>] = &[
    RowColumn::written("wall", "", |p| flag(p.marks.wall)),
    RowColumn::written("rim", "", |p| flag(p.marks.rim)),
    RowColumn::written("crease", "", |p| flag(p.marks.crease.is_some())),
    RowColumn::written("crease_normal_x", "", |p| p.crease_normal[0]),
    RowColumn::written("crease_normal_y", "", |p| p.crease_normal[1]),
    RowColumn::written("crease_normal_z", "", |p| p.crease_normal[2]),
    RowColumn::written("layers", "", |p| f64::from(p.marks.layers)),
    RowColumn::written("overhang", "", |p| flag(p.marks.overhang)),
    RowColumn::written("filled", "", |p| flag(p.marks.filled)),
    RowColumn::written("weight_m2", "m^2", |p| p.weight_m2),
];

/// The points of a grid, with the area each stands for where they count by it.
pub(super) fn of_grid(
    out: &mut dyn Write,
    points: &ConstraintPoints,
    weights: Weights,
) -> io::Result<()> {
    let rows = (0..points.len())
        .map(|k| with_flags(point_row(points, k), points.marks[k], points.area_m2[k]));
    let columns = match weights {
        Weights::Equal => &COLUMNS[..COLUMNS.len() - 1],
        Weights::Area => COLUMNS,
    };
    write_joined_rows(out, PointRow::COLUMNS, columns, rows)
}

/// Points on no grid, with the area each stands for.
pub(super) fn of_scattered(out: &mut dyn Write, points: &Scattered) -> io::Result<()> {
    let rows = (0..points.len()).map(|k| {
        let point = PointRow {
            x_m: points.x_m[k],
            y_m: points.y_m[k],
            height_m: points.height_m[k],
            normal: points.normal[k],
        };
        with_flags(point, points.marks[k], points.weight_m2[k])
    });
    write_joined_rows(out, PointRow::COLUMNS, COLUMNS, rows)
}

fn with_flags(point: PointRow, marks: Marks, weight_m2: f64) -> (PointRow, Flags) {
    let flags = Flags {
        marks,
        crease_normal: marks.crease.unwrap_or(point.normal),
        weight_m2,
    };
    (point, flags)
}
