//! A picture of a surface seen from above: heights, marks, deviation.

use crate::plot::plane::{Cells, Mark, Panel, PlanePlot, Together};
use crate::shape::height::Grid;
use crate::shape::point_flags::Marks;

/// A unit for people.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    /// Its name.
    pub(super) unit: &'static str,
    /// How many of it make what the numbers count in.
    pub(super) factor: f64,
}

impl Scale {
    /// For numbers in metres.
    pub(super) const MILLIMETRES: Self = Self {
        unit: "mm",
        factor: 1000.0,
    };
    /// For the numbers of a file of which no unit is known.
    pub(super) const FILE: Self = Self {
        unit: "file units",
        factor: 1.0,
    };
}

/// The data of the picture.
pub(super) struct PictureData<'a> {
    pub(super) title: String,
    pub(super) scale: Scale,
    pub(super) grid: &'a Grid,
    /// One value a grid point, x fastest.
    pub(super) heights: &'a [Option<f64>],
    /// The same.
    pub(super) marks: &'a [Option<Marks>],
    /// A bound of the vertical difference, one value a cell; empty where there is none.
    pub(super) cells: &'a [Option<f64>],
}

pub(super) fn picture(seen: &PictureData<'_>) -> PlanePlot {
    let Scale { unit, factor } = seen.scale;
    let scaled = |values: &[Option<f64>]| -> Vec<Option<f64>> {
        values.iter().map(|v| v.map(|v| v * factor)).collect()
    };
    let columns = seen.grid.x_m.samples;
    let mut panels = vec![
        Panel {
            title: format!("height / {unit}"),
            cells: Some(Cells {
                columns,
                values: scaled(seen.heights),
                together: Together::First,
            }),
            marks: Vec::new(),
        },
        Panel {
            title: "what each point is".to_owned(),
            cells: None,
            marks: marks(seen),
        },
    ];
    if seen.cells.iter().any(Option::is_some) {
        // Deviations are smaller than heights: micrometres, where there are metres.
        let (unit, by) = match unit {
            "mm" => ("um", 1000.0),
            unit => (unit, 1.0),
        };
        let values = seen.cells.iter().map(|v| v.map(|v| v * factor * by));
        panels.push(Panel {
            title: format!("surface against interpolation / {unit}"),
            cells: Some(Cells {
                columns: columns.saturating_sub(1),
                values: values.collect(),
                together: Together::Largest,
            }),
            marks: Vec::new(),
        });
    }
    let [x, y] = seen.grid.plan().map(|ends| ends.map(|end| end * factor));
    PlanePlot {
        title: seen.title.clone(),
        unit: unit.to_owned(),
        x,
        y,
        panels,
    }
}

fn marks(seen: &PictureData<'_>) -> Vec<Mark> {
    let (x, y) = (seen.grid.x_m.nodes(), seen.grid.y_m.nodes());
    let factor = seen.scale.factor;
    let of = |name: &'static str, kind: &dyn Fn(usize, &Option<Marks>) -> bool| Mark {
        name,
        points: seen
            .marks
            .iter()
            .enumerate()
            .filter(|(index, marks)| kind(*index, marks))
            .map(|(index, _)| (x[index % x.len()] * factor, y[index / x.len()] * factor))
            .collect(),
    };
    let is = |kind: fn(&Marks) -> bool| {
        move |_: usize, marks: &Option<Marks>| marks.as_ref().is_some_and(kind)
    };
    vec![
        of("rim", &is(|m| m.rim)),
        of("wall", &is(|m| m.wall)),
        of("crease", &is(|m| m.crease.is_some())),
        of("overhang", &is(|m| m.overhang)),
        of("filled hole", &is(|m| m.filled)),
        of("no surface", &|index, _| seen.heights[index].is_none()),
    ]
}
