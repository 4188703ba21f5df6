//! A measured scan beside what was computed: values against values, and what is left row by row.

use kuva::plot::annotations::ShadedRegion;
use kuva::plot::{LegendEntry, LegendShape, LinePlot, ScatterPlot};
use kuva::render::figure::Figure;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

use super::drawing::Drawing;
use super::pareto::readable;
use super::replay::COILS;
use super::{entry, thinned};

/// A panel's size, px.
const PANEL_PX: [f64; 2] = [460.0, 380.0];
/// Height of a panel's title, px.
const TITLE_PX: u32 = 14;
/// Size of a point, px.
const DOT_PX: f64 = 2.2;
/// Colours of the design as it is, of the line of equal values and of the bands.
const DESIGNED: &str = "#b5b5b5";
const EQUAL: &str = "#7f7f7f";
const BAND: &str = "#0072b2";

/// One measured column.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanColumn {
    /// Its name in the scan.
    pub name: String,
    /// Measured, of the design as it is, and fitted; SI, one per row.
    pub values: [Vec<f64>; 3],
}

/// Columns of one unit.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanKind {
    /// The quantity and its SI unit.
    pub quantity: [&'static str; 2],
    /// The columns.
    pub columns: Vec<ScanColumn>,
    /// Standard deviation that residuals are held against, in that unit, and how it is known.
    pub sigma: (f64, &'static str),
}

/// Data of the drawing.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanFitPlot {
    /// Above all panels.
    pub title: String,
    /// One row of panels each.
    pub kinds: Vec<ScanKind>,
}

impl ScanFitPlot {
    /// The drawing.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        let panels = self
            .kinds
            .iter()
            .flat_map(|kind| [kind.values(), kind.left_as_designed(), kind.left_fitted()]);
        let (plots, layouts): (Vec<_>, Vec<_>) = panels.unzip();
        let figure = Figure::new(self.kinds.len().max(1), 3)
            .with_title(self.title.clone())
            .with_cell_size(PANEL_PX[0], PANEL_PX[1])
            .with_plots(plots)
            .with_layouts(layouts)
            .with_shared_legend_bottom()
            .with_shared_legend_entries(self.legend());
        Drawing::new(figure.render())
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let columns = self
            .kinds
            .iter()
            .flat_map(|kind| kind.columns.iter().zip(COILS));
        let mut entries: Vec<LegendEntry> = columns
            .map(|(column, colour)| {
                entry(
                    &format!("{}, fitted", column.name),
                    colour,
                    LegendShape::Circle,
                )
            })
            .collect();
        entries.push(entry("design as it is", DESIGNED, LegendShape::Circle));
        let bands = self.kinds.first().map(|kind| {
            entry(
                &format!("bands: 1 and 2 times {}", kind.sigma.1),
                BAND,
                LegendShape::Rect,
            )
        });
        entries.extend(bands);
        entries
    }
}

impl ScanKind {
    /// A factor and a unit for values of this size.
    fn unit(&self, values: &[f64]) -> (f64, String) {
        readable(values, self.quantity[1])
    }

    /// Measured over computed.
    fn values(&self) -> (Vec<Plot>, Layout) {
        let all = self
            .columns
            .iter()
            .flat_map(|column| column.values.iter().flatten());
        let all: Vec<f64> = all.copied().collect();
        let (scale, unit) = self.unit(&all);
        let range = ends(all.iter().map(|value| scale * value));
        let equal = LinePlot::new().with_data(vec![(range.0, range.0), (range.1, range.1)]);
        let mut plots = vec![Plot::Line(equal.with_color(EQUAL).with_stroke_width(1.0))];
        let dots = |[measured, computed]: [&[f64]; 2], colour: &str| {
            let pairs = computed.iter().zip(measured);
            let points: Vec<_> = pairs.map(|(x, y)| (scale * x, scale * y)).collect();
            dots(&points, range, range, colour)
        };
        for column in &self.columns {
            let [measured, designed, _] = &column.values;
            plots.push(dots([measured, designed], DESIGNED));
        }
        for (column, colour) in self.columns.iter().zip(COILS) {
            let [measured, _, fitted] = &column.values;
            plots.push(dots([measured, fitted], colour));
        }
        let layout = Layout::new(range, range)
            .with_title(format!("{}: measured over computed", self.quantity[0]))
            .with_title_size(TITLE_PX)
            .with_x_label(format!("computed / {unit}"))
            .with_y_label(format!("measured / {unit}"))
            .with_ticks(5)
            .with_equal_aspect();
        (plots, layout)
    }

    /// Measured minus computed from the design as it is, row by row.
    fn left_as_designed(&self) -> (Vec<Plot>, Layout) {
        let left = self.left(1);
        let all: Vec<f64> = left.iter().flatten().copied().collect();
        let (scale, _) = self.unit(&all);
        let axes = self.rows_and(&all, "minus design as it is");
        let plots = left.iter().map(|left| rowed(left, scale, &axes, DESIGNED));
        (plots.collect(), axes)
    }

    /// Measured minus fitted, row by row, over bands of one and two standard deviations.
    fn left_fitted(&self) -> (Vec<Plot>, Layout) {
        let left = self.left(2);
        let sigma = self.sigma.0;
        let mut all: Vec<f64> = left.iter().flatten().copied().collect();
        all.extend([2.2 * sigma, -2.2 * sigma]);
        let (scale, _) = self.unit(&all);
        let axes = self.rows_and(&all, "minus fitted");
        let left = left.iter().zip(COILS);
        let plots = left
            .map(|(left, colour)| rowed(left, scale, &axes, colour))
            .collect();
        let band = |count: f64| {
            let half = count * scale * sigma;
            ShadedRegion::horizontal(-half, half)
                .with_color(BAND)
                .with_opacity(0.12)
        };
        (
            plots,
            axes.with_shaded_region(band(2.0))
                .with_shaded_region(band(1.0)),
        )
    }

    /// Measured minus computed, column by column.
    fn left(&self, computed: usize) -> Vec<Vec<f64>> {
        let left = |column: &ScanColumn| {
            let pairs = column.values[0].iter().zip(&column.values[computed]);
            pairs
                .map(|(measured, computed)| measured - computed)
                .collect()
        };
        self.columns.iter().map(left).collect()
    }

    /// Axes for residuals over the scan's rows.
    fn rows_and(&self, residuals: &[f64], what: &str) -> Layout {
        let (scale, unit) = self.unit(residuals);
        let rows = self
            .columns
            .iter()
            .map(|column| column.values[0].len())
            .max();
        let x = (0.0, rows.unwrap_or(0) as f64 + 1.0);
        Layout::new(x, ends(residuals.iter().map(|value| scale * value)))
            .with_title(format!("{}: measured {what}", self.quantity[0]))
            .with_title_size(TITLE_PX)
            .with_x_label("row of the scan")
            .with_y_label(format!("residual / {unit}"))
            .with_ticks(5)
    }
}

/// Residuals over their rows.
fn rowed(residuals: &[f64], scale: f64, axes: &Layout, colour: &str) -> Plot {
    let points = residuals.iter().enumerate();
    let points: Vec<_> = points
        .map(|(row, v)| (row as f64 + 1.0, scale * v))
        .collect();
    dots(&points, axes.x_range, axes.y_range, colour)
}

fn dots(points: &[(f64, f64)], x: (f64, f64), y: (f64, f64), colour: &str) -> Plot {
    let points = ScatterPlot::new().with_data(thinned(points, x, y));
    Plot::Scatter(points.with_color(colour).with_size(DOT_PX))
}

/// The range of values, with room at both ends.
fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((0.0_f64, 0.0_f64), |(low, high), v| {
        (low.min(v), high.max(v))
    });
    let room = (0.05 * (high - low)).max(1e-12);
    (low - room, high + room)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(rows: usize) -> ScanFitPlot {
        let wave = |shift: f64| {
            (0..rows)
                .map(|k| 2e-3 * (0.7 * k as f64).sin() + shift)
                .collect()
        };
        let kind = |quantity, names: &[&str]| ScanKind {
            quantity,
            columns: names
                .iter()
                .map(|name| ScanColumn {
                    name: (*name).to_owned(),
                    values: [wave(1.3e-6), wave(3e-5), wave(0.0)],
                })
                .collect(),
            sigma: (2e-6, "the stated noise"),
        };
        ScanFitPlot {
            title: "scan.csv against seed".to_owned(),
            kinds: vec![
                kind(["field", "T"], &["bx_t", "bz_t"]),
                kind(["gradient", "T/m"], &["dbz_dz_t_per_m"]),
            ],
        }
    }

    #[test]
    fn panels_carry_their_units_and_bytes_are_the_same_twice() {
        let svg = plot(30).drawing().svg();
        for text in [
            "computed / mT",
            "measured / mT",
            "residual / uT",
            "residual / uT/m",
            "bz_t, fitted",
            "design as it is",
            "1 and 2 times the stated noise",
            "field: measured minus fitted",
            "field: measured minus design as it is",
            "row of the scan",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("NaN") && svg == plot(30).drawing().svg());
        assert!(plot(0).drawing().svg().ends_with("</svg>"));
    }
}
