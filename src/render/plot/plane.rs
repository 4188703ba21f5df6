//! Values over a region of the plan as coloured cells, and marked points over them.

use std::sync::Arc;

use kuva::plot::{ColorMap, Heatmap, LegendEntry, LegendShape, QuiverPlot, ScatterPlot};
use kuva::render::figure::Figure;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;

use super::drawing::Drawing;
use super::thinned;

/// A panel's size, px.
const PANEL_PX: [f64; 2] = [460.0, 400.0];
/// Height of a panel's title, px.
const TITLE_PX: u32 = 14;
/// Cells along either side, at most: more are drawn together.
const MOST_CELLS: usize = 100;
/// Where there is no value.
const NOTHING: &str = "#ffffff";
/// Colours that stay apart for the colour-blind and in print, for marks in their order.
const MARKS: [&str; 6] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#000000",
];

/// The same for arrows, on viridis: dark under light.
const ARROWS: [&str; 2] = ["#000000", "#ff5fa2"];

/// How several cells become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Together {
    /// The first stands for all.
    First,
    /// The one largest in size.
    Largest,
}

/// Values in cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    /// Cells along x.
    pub columns: usize,
    /// One value a cell, x fastest; `None` where there is none.
    pub values: Vec<Option<f64>>,
    /// Treatment of more cells than can be drawn.
    pub together: Together,
}

/// Points of one kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// The kind's name.
    pub name: &'static str,
    /// x and y of each.
    pub points: Vec<(f64, f64)>,
}

/// Arrows of one kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrows {
    /// The kind's name.
    pub name: &'static str,
    /// Tail and length along x and y of each, in the unit of the plan.
    pub arrows: Vec<([f64; 2], [f64; 2])>,
}

/// One picture of the region.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// The quantity shown, with its unit.
    pub title: String,
    /// The values; `None` for an empty plan.
    pub cells: Option<Cells>,
    /// Marks over them.
    pub marks: Vec<Mark>,
    /// Arrows over both.
    pub arrows: Vec<Arrows>,
}

/// Pictures of one region beside each other.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanePlot {
    /// Above all panels.
    pub title: String,
    /// Unit of x and y.
    pub unit: String,
    /// Range of x.
    pub x: [f64; 2],
    /// Range of y.
    pub y: [f64; 2],
    /// From left to right.
    pub panels: Vec<Panel>,
}

impl PlanePlot {
    /// The drawing.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        let (plots, layouts) = self.panels.iter().map(|panel| self.panel(panel)).unzip();
        let figure = Figure::new(1, self.panels.len().max(1))
            .with_title(self.title.clone())
            .with_cell_size(PANEL_PX[0], PANEL_PX[1])
            .with_plots(plots)
            .with_layouts(layouts);
        let legend = self.legend();
        let figure = if legend.is_empty() {
            figure
        } else {
            figure
                .with_shared_legend_bottom()
                .with_shared_legend_entries(legend)
        };
        Drawing::new(figure.render())
    }

    fn panel(&self, panel: &Panel) -> (Vec<Plot>, Layout) {
        let (x, y) = (wide(self.x), wide(self.y));
        let mut plots = Vec::new();
        if let Some(cells) = &panel.cells {
            plots.push(Plot::Heatmap(
                Heatmap::new()
                    .with_data(rows(cells))
                    .with_color_map(colours())
                    .with_x_range(x.0, x.1)
                    .with_y_range(y.0, y.1)
                    .with_cell_size(1.0),
            ));
        }
        for (mark, colour) in panel.marks.iter().zip(MARKS) {
            plots.push(Plot::Scatter(
                ScatterPlot::new()
                    .with_data(thinned(&mark.points, x, y))
                    .with_color(colour)
                    .with_size(1.5),
            ));
        }
        for (kind, colour) in panel.arrows.iter().zip(ARROWS) {
            let drawn = kind.arrows.iter().filter(|(_, [u, v])| u.hypot(*v) > 0.0);
            let drawn = drawn.map(|([x, y], [u, v])| (*x, *y, *u, *v));
            let arrows = QuiverPlot::new().with_arrows(drawn.collect::<Vec<_>>());
            plots.push(Plot::Quiver(arrows.with_color(colour)));
        }
        // A colour bar of one value has no ticks.
        let single = panel.cells.as_ref().and_then(single);
        let title = match single {
            Some(value) => format!("{} (all {})", panel.title, TickFormat::Auto.format(value)),
            None => panel.title.clone(),
        };
        let mut layout = Layout::new(x, y)
            .with_title(title)
            .with_title_size(TITLE_PX)
            .with_x_label(format!("x / {}", self.unit))
            .with_y_label(format!("y / {}", self.unit))
            .with_ticks(5)
            .with_equal_aspect();
        layout.show_colorbar = panel.cells.is_some() && single.is_none();
        (plots, layout)
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let mut entries: Vec<LegendEntry> = Vec::new();
        for panel in &self.panels {
            for (mark, colour) in panel.marks.iter().zip(MARKS) {
                if !mark.points.is_empty() {
                    entries.push(LegendEntry {
                        label: format!("{} ({})", mark.name, mark.points.len()),
                        color: colour.to_owned(),
                        shape: LegendShape::Circle,
                        dasharray: None,
                    });
                }
            }
        }
        let mut kinds: Vec<&str> = Vec::new();
        for panel in &self.panels {
            for (kind, colour) in panel.arrows.iter().zip(ARROWS) {
                if !kind.arrows.is_empty() && !kinds.contains(&kind.name) {
                    kinds.push(kind.name);
                    entries.push(LegendEntry {
                        label: kind.name.to_owned(),
                        color: colour.to_owned(),
                        shape: LegendShape::Line,
                        dasharray: None,
                    });
                }
            }
        }
        entries
    }
}

/// A range with some width.
pub(super) fn wide([low, high]: [f64; 2]) -> (f64, f64) {
    if high > low {
        (low, high)
    } else {
        let half = 0.5 * low.abs().max(1.0);
        (low - half, low + half)
    }
}

/// The value of all cells, where it is the same.
fn single(cells: &Cells) -> Option<f64> {
    let mut values = cells.values.iter().flatten().copied();
    let first = values.next()?;
    values.all(|value| value == first).then_some(first)
}

/// At most [`MOST_CELLS`] a side.
pub(super) fn rows(cells: &Cells) -> Vec<Vec<f64>> {
    let columns = cells.columns.max(1);
    let rows = cells.values.len() / columns;
    let step = [columns, rows].map(|count| count.div_ceil(MOST_CELLS).max(1));
    let block = |row: usize, column: usize| {
        let within = (row..(row + step[1]).min(rows)).flat_map(|row| {
            let ends = [column, (column + step[0]).min(columns)];
            cells.values[row * columns..][ends[0]..ends[1]].iter()
        });
        let mut values = within.flatten().copied();
        match cells.together {
            Together::First => values.next(),
            Together::Largest => values.reduce(|a, b| if b.abs() > a.abs() { b } else { a }),
        }
        .unwrap_or(f64::NAN)
    };
    let row = |row: usize| -> Vec<f64> {
        let columns = (0..columns).step_by(step[0]);
        columns.map(|column| block(row, column)).collect()
    };
    (0..rows).step_by(step[1]).map(row).collect()
}

/// Viridis, and white where there is nothing.
pub(super) fn colours() -> ColorMap {
    ColorMap::Custom(Arc::new(|value: f64| {
        if value.is_nan() {
            NOTHING.to_owned()
        } else {
            ColorMap::Viridis.map(value)
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawing(columns: usize, rows: usize) -> PlanePlot {
        let value = |k: usize| (!k.is_multiple_of(7)).then(|| 1.3 + (0.7 * k as f64).sin());
        PlanePlot {
            title: "a".to_owned(),
            unit: "mm".to_owned(),
            x: [-50.0, 50.0],
            y: [-30.0, 70.0],
            panels: vec![
                Panel {
                    title: "heights / mm".to_owned(),
                    cells: Some(Cells {
                        columns,
                        values: (0..columns * rows).map(value).collect(),
                        together: Together::First,
                    }),
                    marks: Vec::new(),
                    arrows: vec![Arrows {
                        name: "push",
                        arrows: vec![([0.7, 1.3], [9.0, -7.0])],
                    }],
                },
                Panel {
                    title: "marks".to_owned(),
                    cells: None,
                    marks: vec![Mark {
                        name: "rim",
                        points: vec![(0.7, 1.3)],
                    }],
                    arrows: Vec::new(),
                },
            ],
        }
    }

    #[test]
    fn a_drawing_says_what_it_shows_and_is_the_same_twice() {
        let svg = drawing(9, 7).drawing().svg();
        for text in ["heights / mm", "x / mm", "rim (1)", "push"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("NaN"));
        assert!(svg == drawing(9, 7).drawing().svg());
    }

    /// A colour bar without ticks stood beside cells of one value.
    #[test]
    fn the_value_that_all_cells_have_is_printed_in_place_of_a_colour_bar() {
        let titled = |value: Option<f64>| {
            let mut plot = drawing(9, 7);
            let cells = plot.panels[0].cells.as_mut().unwrap();
            for cell in cells.values.iter_mut().flatten() {
                *cell = value.unwrap_or(*cell);
            }
            plot.drawing().svg()
        };
        let bar = titled(None).matches("<rect").count();
        for (value, title) in [
            (0.0, "heights / mm (all 0)<"),
            (1.3, "heights / mm (all 1.3)<"),
        ] {
            let svg = titled(Some(value));
            assert!(svg.contains(title), "{value}");
            assert!(svg.matches("<rect").count() < bar, "{value}");
        }
        assert!(titled(None).contains("heights / mm<"));
    }

    #[test]
    fn more_cells_than_can_be_seen_are_drawn_together() {
        let mut cells = drawing(1001, 3).panels.remove(0).cells.unwrap();
        cells.values[1001 + 500] = Some(-77.0);
        cells.together = Together::Largest;
        let rows = rows(&cells);
        assert_eq!((rows.len(), rows[0].len()), (3, 91));
        assert!(rows.iter().flatten().any(|value| *value == -77.0));
        assert!(drawing(0, 0).drawing().svg().ends_with("</svg>"));
    }
}
