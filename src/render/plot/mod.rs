//! Drawings, from plain numbers to SVG text: the only room that knows the plotting crate.
//!
//! The same numbers give the same bytes.

pub mod curves;
pub mod lambda;
pub mod matrix;
pub mod pareto;
pub mod plane;
pub mod replay;

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

/// The drawing with its clip paths counted from 0: the crate counts on through a process.
fn renumbered(svg: &str) -> String {
    const NAME: &str = "kuva-clip-";
    let mut parts = svg.split(NAME);
    let mut text = parts.next().unwrap_or("").to_owned();
    let mut seen: Vec<&str> = Vec::new();
    for part in parts {
        let digits = part.bytes().take_while(u8::is_ascii_digit).count();
        let (number, rest) = part.split_at(digits);
        let at = seen.iter().position(|one| *one == number);
        let at = at.unwrap_or_else(|| {
            seen.push(number);
            seen.len() - 1
        });
        text.push_str(&format!("{NAME}{at}{rest}"));
    }
    text
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
