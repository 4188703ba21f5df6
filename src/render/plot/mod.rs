//! Drawings from plain numbers, as SVG, PNG or PDF: the only room that knows the plotting crate.
//!
//! The same numbers give the same bytes.

pub mod array;
pub mod curves;
pub mod drawing;
pub mod lambda;
pub mod landscape;
pub mod matrix;
pub mod pareto;
pub mod plane;
pub mod replay;
pub mod scan_fit;
pub mod slices;

use std::collections::HashSet;

use kuva::plot::{LegendEntry, LegendShape};

/// Cells of a panel along x and y: of the points of one kind that fall into a cell only the first
/// is drawn, so that ten million points are no larger a picture than ten thousand.
const CELLS: [f64; 2] = [240.0, 180.0];

/// A line of a legend.
fn entry(label: &str, colour: &str, shape: LegendShape) -> LegendEntry {
    LegendEntry {
        label: label.to_owned(),
        color: colour.to_owned(),
        shape,
        dasharray: None,
    }
}

/// The first point in each cell.
fn thinned(points: &[(f64, f64)], x: (f64, f64), y: (f64, f64)) -> Vec<(f64, f64)> {
    let cell = |value: f64, (low, high): (f64, f64), cells: f64| {
        ((value - low) / (high - low) * cells).floor() as i64
    };
    let mut taken = HashSet::new();
    let first = |point: &&(f64, f64)| {
        taken.insert((cell(point.0, x, CELLS[0]), cell(point.1, y, CELLS[1])))
    };
    points.iter().filter(first).copied().collect()
}
