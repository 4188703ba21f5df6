//! A quantity over two variables as coloured cells, or over one as a curve: what limits allow, and the best.

use std::sync::Arc;

use kuva::plot::scatter::MarkerShape;
use kuva::plot::{Heatmap, LegendShape, LinePlot, ScatterPlot};
use kuva::render::figure::Figure;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;

use super::drawing::Drawing;
use super::pareto::{extent, readable};
use super::plane::colours;
use super::replay::COILS;

/// A panel's size, px.
const PANEL_PX: [f64; 2] = [560.0, 460.0];
/// Labels along an axis, about.
const TICKS: usize = 8;
/// Width of a hatch's line and of a limit's, px.
const HATCH_PX: f64 = 1.2;
const LIMIT_PX: f64 = 2.2;
/// Size of points and of the best one's mark, px.
const DOT_PX: f64 = 4.0;
const BEST_PX: f64 = 9.0;
/// Colours of what breaks a limit, of what meets them, and of the best.
const BROKEN: &str = "#9a9a9a";
const MET: &str = "#0072b2";
const BEST: &str = "#d55e00";

/// A variable, at given values in order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Variable {
    /// Its name, with its unit.
    pub name: String,
    /// Its values.
    pub labels: Vec<String>,
}

/// A limit where it is reached.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitLine {
    /// Its name.
    pub name: String,
    /// The part of the limit that a cell takes, as the cells are; not finite where there is no coil.
    pub used: Vec<f64>,
}

/// A quantity over one or two variables.
#[derive(Debug, Clone, PartialEq)]
pub struct Landscape {
    /// Above the panel.
    pub title: String,
    /// Name of the quantity and its SI unit.
    pub quantity: [&'static str; 2],
    /// The variable along x.
    pub across: Variable,
    /// The one along y; `None` for a curve.
    pub up: Option<Variable>,
    /// SI, the variable along x fastest; `None` where nothing was computed.
    pub values: Vec<Option<f64>>,
    /// Whether all limits are met, as the values are.
    pub met: Vec<bool>,
    /// Limits to draw; of two variables.
    pub limits: Vec<LimitLine>,
    /// Place of the best, counted in values along the variables, and its name.
    pub best: Option<([f64; 2], String)>,
    /// Drawn to scale beside it.
    pub section: Option<Section>,
}

/// Closed outlines of a section.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Above them.
    pub title: String,
    /// Colour and corners of each, x and z, m.
    pub outlines: Vec<(&'static str, Vec<[f64; 2]>)>,
}

impl Landscape {
    /// The drawing.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        let (plots, layout) = match &self.up {
            Some(up) => self.map(up),
            None => self.curve(),
        };
        let entries = self.legend();
        let section = self.section.as_ref().map(Section::panel);
        let panels = std::iter::once((plots, layout)).chain(section);
        let (plots, layouts): (Vec<_>, Vec<_>) = panels.unzip();
        let figure = Figure::new(1, plots.len())
            .with_title(self.title.clone())
            .with_cell_size(PANEL_PX[0], PANEL_PX[1])
            .with_plots(plots)
            .with_layouts(layouts)
            .with_shared_legend_bottom()
            .with_shared_legend_entries(entries);
        Drawing::new(figure.render())
    }

    fn legend(&self) -> Vec<kuva::plot::LegendEntry> {
        let mut entries = Vec::new();
        if self.up.is_none() {
            entries.push(super::entry("meets its limits", MET, LegendShape::Circle));
        }
        if self
            .met
            .iter()
            .zip(&self.values)
            .any(|(met, value)| !met && value.is_some())
        {
            let (name, shape) = match self.up {
                Some(_) => ("hatched: breaks a limit", LegendShape::Line),
                None => ("breaks a limit", LegendShape::Circle),
            };
            entries.push(super::entry(name, BROKEN, shape));
        }
        let limits = self
            .limits
            .iter()
            .zip(COILS)
            .filter(|(limit, _)| !self.reached(limit).is_empty());
        entries.extend(
            limits.map(|(limit, colour)| super::entry(&limit.name, colour, LegendShape::Line)),
        );
        if let Some((_, name)) = &self.best {
            entries.push(super::entry(name, BEST, LegendShape::Circle));
        }
        entries
    }

    fn scaled(&self) -> (Vec<f64>, String) {
        let known: Vec<f64> = self.values.iter().flatten().copied().collect();
        let (scale, unit) = readable(&known, self.quantity[1]);
        let scaled = self
            .values
            .iter()
            .map(|value| value.map_or(f64::NAN, |v| scale * v));
        (scaled.collect(), format!("{} / {unit}", self.quantity[0]))
    }

    fn map(&self, up: &Variable) -> (Vec<Plot>, Layout) {
        let (values, label) = self.scaled();
        let columns = self.across.labels.len().max(1);
        let [x, y] = [&self.across, up].map(Variable::range);
        let heatmap = Heatmap::new()
            .with_data(
                values
                    .chunks(columns)
                    .map(<[f64]>::to_vec)
                    .collect::<Vec<_>>(),
            )
            .with_color_map(colours())
            .with_x_range(x.0, x.1)
            .with_y_range(y.0, y.1)
            .with_cell_size(1.0);
        let mut plots = vec![Plot::Heatmap(heatmap)];
        let line = |points: Vec<(f64, f64)>, colour: &str, width: f64| {
            let line = LinePlot::new().with_data(points);
            Plot::Line(line.with_color(colour).with_stroke_width(width))
        };
        plots.extend(
            self.hatches(columns)
                .into_iter()
                .map(|hatch| line(hatch, BROKEN, HATCH_PX)),
        );
        for (limit, colour) in self.limits.iter().zip(COILS) {
            let pieces = self.reached(limit).into_iter();
            plots.extend(pieces.map(|piece| line(piece.to_vec(), colour, LIMIT_PX)));
        }
        plots.extend(self.best.iter().flat_map(|([x, y], _)| best((*x, *y))));
        let mut layout = Layout::new(x, y)
            .with_title(label)
            .with_x_label(self.across.name.clone())
            .with_y_label(up.name.clone())
            .with_x_tick_step(self.across.step())
            .with_y_tick_step(up.step())
            .with_x_tick_format(self.across.format())
            .with_y_tick_format(up.format())
            .with_clamp_axis()
            .with_clamp_y_axis();
        layout.show_colorbar = true;
        (plots, layout)
    }

    /// A zigzag over every run of cells along x that break a limit.
    fn hatches(&self, columns: usize) -> Vec<Vec<(f64, f64)>> {
        let mut hatches: Vec<Vec<(f64, f64)>> = Vec::new();
        let mut joined = false;
        for (cell, (value, met)) in self.values.iter().zip(&self.met).enumerate() {
            let (column, row) = (cell % columns, (cell / columns) as f64);
            let broken = value.is_some() && !met;
            if broken {
                let rises = column % 2 == 0;
                let [from, to] = if rises { [-0.5, 0.5] } else { [0.5, -0.5] };
                if !joined || column == 0 {
                    hatches.push(vec![(column as f64 - 0.5, row + from)]);
                }
                if let Some(hatch) = hatches.last_mut() {
                    hatch.push((column as f64 + 0.5, row + to));
                }
            }
            joined = broken;
        }
        hatches
    }

    /// Where a limit is just reached: straight pieces between the middles of cells.
    fn reached(&self, limit: &LimitLine) -> Vec<[(f64, f64); 2]> {
        let columns = self.across.labels.len();
        let rows = self.up.as_ref().map_or(0, |up| up.labels.len());
        let mut pieces = Vec::new();
        for row in 1..rows {
            for column in 1..columns {
                let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| {
                    let (i, j) = (column - 1 + i, row - 1 + j);
                    ((i as f64, j as f64), limit.used[j * columns + i] - 1.0)
                });
                if corners.iter().any(|(_, used)| !used.is_finite()) {
                    continue;
                }
                let crossing = |k: usize| {
                    let ((a, u), (b, v)) = (corners[k], corners[(k + 1) % 4]);
                    let share = u / (u - v);
                    ((u < 0.0) != (v < 0.0))
                        .then_some((a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1)))
                };
                let ends: Vec<(f64, f64)> = (0..4).filter_map(crossing).collect();
                pieces.extend(ends.chunks_exact(2).map(|ends| [ends[0], ends[1]]));
            }
        }
        pieces
    }

    fn curve(&self) -> (Vec<Plot>, Layout) {
        let (values, label) = self.scaled();
        let points = |keep: &dyn Fn(usize) -> bool| -> Vec<(f64, f64)> {
            let known = values
                .iter()
                .enumerate()
                .filter(|(_, value)| value.is_finite());
            known
                .filter(|(k, _)| keep(*k))
                .map(|(k, value)| (k as f64, *value))
                .collect()
        };
        let line = LinePlot::new()
            .with_data(points(&|_| true))
            .with_color(BROKEN);
        let mut plots = vec![Plot::Line(line)];
        for (met, colour) in [(false, BROKEN), (true, MET)] {
            let dots = ScatterPlot::new().with_data(points(&|k| self.met[k] == met));
            plots.push(Plot::Scatter(dots.with_color(colour).with_size(DOT_PX)));
        }
        let known: Vec<f64> = values
            .iter()
            .copied()
            .filter(|value| value.is_finite())
            .collect();
        let layout = Layout::new(self.across.range(), extent(&known))
            .with_x_label(self.across.name.clone())
            .with_y_label(label)
            .with_x_tick_step(self.across.step())
            .with_x_tick_format(self.across.format());
        (plots, layout)
    }
}

impl Section {
    fn panel(&self) -> (Vec<Plot>, Layout) {
        let corners = || self.outlines.iter().flat_map(|(_, outline)| outline);
        let ends = |axis: usize| {
            let values: Vec<f64> = corners().map(|corner| 1e3 * corner[axis]).collect();
            extent(&values)
        };
        let line = |(colour, outline): &(&'static str, Vec<[f64; 2]>)| {
            let points = outline.iter().map(|[x, z]| (1e3 * x, 1e3 * z));
            let line = LinePlot::new().with_data(points.collect::<Vec<_>>());
            Plot::Line(line.with_color(*colour).with_stroke_width(LIMIT_PX))
        };
        let layout = Layout::new(ends(0), ends(1))
            .with_title(self.title.clone())
            .with_x_label("x / mm")
            .with_y_label("z / mm")
            .with_equal_aspect();
        (self.outlines.iter().map(line).collect(), layout)
    }
}

/// The best one's mark: a star that is seen on any colour.
fn best(place: (f64, f64)) -> [Plot; 2] {
    [("#ffffff", BEST_PX + 1.5), (BEST, BEST_PX)].map(|(colour, size)| {
        let mark = ScatterPlot::new()
            .with_data(vec![place])
            .with_marker(MarkerShape::Star);
        Plot::Scatter(mark.with_color(colour).with_size(size))
    })
}

impl Variable {
    /// From half a value before the first to half a value after the last.
    fn range(&self) -> (f64, f64) {
        (-0.5, self.labels.len().max(1) as f64 - 0.5)
    }

    fn step(&self) -> f64 {
        self.labels.len().div_ceil(TICKS).max(1) as f64
    }

    /// A value's own label.
    fn format(&self) -> TickFormat {
        let labels = self.labels.clone();
        TickFormat::Custom(Arc::new(move |at: f64| {
            let whole = at.round();
            let label =
                (whole >= 0.0 && (at - whole).abs() < 1e-6).then(|| labels.get(whole as usize));
            label.flatten().cloned().unwrap_or_default()
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn variable(name: &str, count: usize) -> Variable {
        Variable {
            name: name.to_owned(),
            labels: (0..count).map(|k| format!("{}", 7 + 3 * k)).collect(),
        }
    }

    fn landscape(columns: usize, rows: Option<usize>) -> Landscape {
        let count = columns * rows.unwrap_or(1);
        Landscape {
            title: "seed: designs".to_owned(),
            quantity: ["force", "N"],
            across: variable("wire / mm", columns),
            up: rows.map(|rows| variable("length / mm", rows)),
            values: (0..count)
                .map(|k| (k != 1).then_some(0.01 * (k as f64 + 0.7)))
                .collect(),
            met: (0..count).map(|k| k % 3 > 0).collect(),
            limits: vec![LimitLine {
                name: "resistance".to_owned(),
                used: (0..count)
                    .map(|k| 0.3 + 0.31 * (k % columns) as f64)
                    .collect(),
            }],
            best: Some(([2.0, 1.0], "best within its limits".to_owned())),
            section: rows.map(|_| Section {
                title: "best coil".to_owned(),
                outlines: vec![("#8a4b08", vec![[0.01, 0.0], [0.02, 0.0], [0.02, -0.1]])],
            }),
        }
    }

    #[test]
    fn two_variables_make_a_map_and_one_a_curve() {
        for (rows, texts) in [
            (
                Some(4),
                vec![
                    "hatched: breaks a limit",
                    "length / mm",
                    "resistance",
                    "z / mm",
                    "best coil",
                ],
            ),
            (None, vec!["meets its limits", "breaks a limit"]),
        ] {
            let drawn = landscape(5, rows).drawing().svg();
            let all = [
                "wire / mm",
                "force / mN",
                "19",
                "best within its limits",
                "seed: designs",
            ];
            for text in texts.into_iter().chain(all) {
                assert!(drawn.contains(text), "{text}");
            }
            assert!(!drawn.contains("NaN") && drawn == landscape(5, rows).drawing().svg());
        }
        assert!(landscape(1, Some(1)).drawing().svg().ends_with("</svg>"));
        assert!(landscape(1, None).drawing().svg().ends_with("</svg>"));
    }

    #[test]
    fn hatches_cover_what_breaks_a_limit_and_nothing_else() {
        let map = landscape(5, Some(4));
        let cells: usize = map.hatches(5).iter().map(|hatch| hatch.len() - 1).sum();
        let broken = map
            .met
            .iter()
            .zip(&map.values)
            .filter(|(met, value)| !*met && value.is_some());
        assert_eq!(cells, broken.count());
    }

    #[test]
    fn a_limit_runs_where_it_is_just_reached() {
        let map = landscape(5, Some(4));
        let pieces = map.reached(&map.limits[0]);
        // 0.3 + 0.31 x = 1, between three pairs of rows.
        assert_eq!(pieces.len(), 3);
        for [a, b] in pieces {
            assert!(
                (a.0 - 0.7 / 0.31).abs() < 1e-12 && (b.0 - a.0).abs() < 1e-12,
                "{a:?} {b:?}"
            );
        }
    }
}
