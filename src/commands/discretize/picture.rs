//! A picture of a surface seen from above: heights, marks, deviation.

use crate::design::Design;
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
    /// The array that the surface lies over.
    pub(super) over: Option<Outline>,
}

/// An array from above, m.
pub(super) struct Outline {
    /// Middles of the coils.
    coils: Vec<[f64; 2]>,
    /// Ends of the workspace along x and y.
    workspace: [[f64; 2]; 2],
}

/// Dots along a side of the workspace.
const DOTS: usize = 60;

impl Outline {
    pub(super) fn of(design: &Design) -> Self {
        let workspace = &design.workspace;
        Self {
            coils: design
                .array
                .positions_m
                .iter()
                .map(|p| [p[0], p[1]])
                .collect(),
            workspace: [workspace.x_m, workspace.y_m].map(|axis| [axis.from, axis.to]),
        }
    }

    /// Its two kinds of points.
    fn marks(&self, factor: f64) -> [Mark; 2] {
        let [x, y] = self.workspace;
        let along = |k: usize, [from, to]: [f64; 2]| from + (to - from) * k as f64 / DOTS as f64;
        let sides = (0..=DOTS).flat_map(|k| {
            [
                [along(k, x), y[0]],
                [along(k, x), y[1]],
                [x[0], along(k, y)],
                [x[1], along(k, y)],
            ]
        });
        let scaled = |p: [f64; 2]| (p[0] * factor, p[1] * factor);
        [
            Mark {
                name: "workspace",
                points: sides.map(scaled).collect(),
            },
            Mark {
                name: "coil",
                points: self.coils.iter().copied().map(scaled).collect(),
            },
        ]
    }

    /// The range that holds it and `ends`, along an axis.
    fn widened(&self, axis: usize, ends: [f64; 2]) -> [f64; 2] {
        let coils = self.coils.iter().map(|coil| coil[axis]);
        let all = coils.chain(self.workspace[axis]);
        all.fold(ends, |[low, high], c| [low.min(c), high.max(c)])
    }
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
            arrows: Vec::new(),
        },
        Panel {
            title: "what each point is".to_owned(),
            cells: None,
            marks: marks(seen),
            arrows: Vec::new(),
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
            arrows: Vec::new(),
        });
    }
    let [mut x, mut y] = seen.grid.plan();
    if let Some(over) = &seen.over {
        // Cells would be drawn over the whole range: a panel of its own, of points alone.
        let (columns, rows) = (seen.grid.x_m.nodes(), seen.grid.y_m.nodes());
        let part = seen
            .heights
            .iter()
            .enumerate()
            .filter(|(_, height)| height.is_some());
        let at = |k: usize| {
            (
                columns[k % columns.len()] * factor,
                rows[k / columns.len()] * factor,
            )
        };
        let mut marks = vec![Mark {
            name: "part",
            points: part.map(|(k, _)| at(k)).collect(),
        }];
        marks.extend(over.marks(factor));
        panels = vec![Panel {
            title: format!("the part over the array and its workspace / {unit}"),
            cells: None,
            marks,
            arrows: Vec::new(),
        }];
        (x, y) = (over.widened(0, x), over.widened(1, y));
    }
    let [x, y] = [x, y].map(|ends| ends.map(|end| end * factor));
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
