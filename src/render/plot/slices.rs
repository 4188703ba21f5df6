//! Slices of a quantity with a sign, zero in the middle of their colours, and curves over height.

use std::sync::Arc;

use kuva::plot::{ColorMap, Heatmap, LegendShape, LinePlot};
use kuva::render::figure::Figure;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;

use super::drawing::Drawing;
use super::pareto::{extent, readable};
use super::plane::{Cells, Together, colours, rows, wide};
use super::replay::COILS;

/// A panel's size, px.
const PANEL_PX: [f64; 2] = [460.0, 400.0];
/// Height of a panel's title, px.
const TITLE_PX: u32 = 14;
/// Width of a line over the colours, px.
const LINE_PX: f64 = 1.0;
/// Where there is no value: in steel or hardly off it, beside a surface.
const NO_VALUE: &str = "#c3c9cf";
/// Colours of the largest negative value and of the largest positive one, which stay apart for the
/// colour-blind; between them white, which is zero.
const ENDS: [[f64; 3]; 2] = [[5.0, 48.0, 97.0], [178.0, 24.0, 43.0]];

/// How values are coloured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shades {
    /// Zero in the middle.
    Signed,
    /// By the logarithm of sizes, down to a thousandth of the largest.
    Decades,
}

/// A line over the colours.
#[derive(Debug, Clone, PartialEq)]
pub struct SliceLine {
    /// Places along both axes, m.
    pub points_m: Vec<[f64; 2]>,
    /// Its colour.
    pub stroke: &'static str,
}

impl SliceLine {
    /// The colour of a field line.
    pub const FIELD: &str = "#ffffff";
}

/// Values on the nodes of a plane through the workspace.
#[derive(Debug, Clone, PartialEq)]
pub struct Slice {
    /// The quantity, without its unit, and the place of the plane.
    pub title: [String; 2],
    /// The SI unit, or [`Slice::JND`].
    pub unit: &'static str,
    /// Names of the axes, without their unit.
    pub axes: [&'static str; 2],
    /// Ends along the axes, m.
    pub ends_m: [[f64; 2]; 2],
    /// Nodes along the first axis, which is fastest.
    pub columns: usize,
    /// In that unit; `None` where there is none.
    pub values: Vec<Option<f64>>,
    /// Their colours.
    pub shades: Shades,
    /// Lines over them.
    pub lines: Vec<SliceLine>,
}

/// Values over height.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightCurve {
    /// Its name.
    pub name: String,
    /// Heights, m, and forces per ampere, N/A.
    pub points: Vec<(f64, f64)>,
}

impl Slice {
    /// The unit of just-noticeable differences, which no prefix goes with.
    pub const JND: &str = "JND";
}

/// Data of the drawing.
#[derive(Debug, Clone, PartialEq)]
pub struct SlicesPlot {
    /// Above all panels.
    pub title: String,
    /// Panels, from left to right, then downwards.
    pub slices: Vec<Slice>,
    /// Panels beside each other, at most.
    pub columns: usize,
    /// The quantity of the curves, without its unit.
    pub curves_title: String,
    /// In the last panel, if there are any.
    pub curves: Vec<HeightCurve>,
}

impl SlicesPlot {
    /// The drawing.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        let curves = (!self.curves.is_empty()).then(|| self.curves());
        let panels = self.slices.iter().map(slice).chain(curves);
        let (plots, layouts): (Vec<_>, Vec<_>) = panels.unzip();
        let columns = plots.len().min(self.columns).max(1);
        let mut figure = Figure::new(plots.len().div_ceil(columns).max(1), columns)
            .with_title(self.title.clone())
            .with_cell_size(PANEL_PX[0], PANEL_PX[1])
            .with_plots(plots)
            .with_layouts(layouts);
        if !self.curves.is_empty() {
            let legend = self.curves.iter().enumerate().map(|(k, curve)| {
                super::entry(&curve.name, COILS[k % COILS.len()], LegendShape::Line)
            });
            figure = figure
                .with_shared_legend_bottom()
                .with_shared_legend_entries(legend.collect());
        }
        Drawing::new(figure.render())
    }

    fn curves(&self) -> (Vec<Plot>, Layout) {
        let all = || self.curves.iter().flat_map(|curve| &curve.points);
        let forces: Vec<f64> = all().map(|point| point.1).collect();
        let heights_mm: Vec<f64> = all().map(|point| 1e3 * point.0).collect();
        let (scale, unit) = readable(&forces, "N/A");
        let plots = self.curves.iter().enumerate().map(|(k, curve)| {
            let points = curve.points.iter().map(|(z, f)| (1e3 * z, scale * f));
            let line = LinePlot::new().with_data(points.collect::<Vec<_>>());
            Plot::Line(line.with_color(COILS[k % COILS.len()]))
        });
        let scaled: Vec<f64> = forces.iter().map(|force| scale * force).collect();
        let layout = Layout::new(extent(&heights_mm), extent(&scaled))
            .with_title(self.curves_title.clone())
            .with_title_size(TITLE_PX)
            .with_x_label("z / mm")
            .with_y_label(format!("force / {unit}"))
            .with_ticks(5);
        (plots.collect(), layout)
    }
}

fn slice(slice: &Slice) -> (Vec<Plot>, Layout) {
    let values: Vec<f64> = slice.values.iter().flatten().copied().collect();
    let (scale, unit) = match slice.unit {
        Slice::JND => (1.0, slice.unit.to_owned()),
        unit => readable(&values, unit),
    };
    let largest = values
        .iter()
        .fold(0.0_f64, |most, v| most.max(scale * v.abs()));
    let shown = |value: f64| match slice.shades {
        Shades::Signed => scale * value,
        Shades::Decades => (scale * value.abs()).max(1e-3 * largest).log10(),
    };
    let cells = rows(&Cells {
        columns: slice.columns,
        values: slice.values.iter().map(|v| v.map(shown)).collect(),
        together: Together::Largest,
    });
    let [x, y] = slice.ends_m.map(|ends| wide(ends.map(|m| 1e3 * m)));
    let colours = match slice.shades {
        Shades::Signed => diverging(cells.iter().flatten().copied()),
        Shades::Decades => with_gaps(colours()),
    };
    let heatmap = Heatmap::new()
        .with_data(cells)
        .with_color_map(colours)
        .with_x_range(x.0, x.1)
        .with_y_range(y.0, y.1)
        .with_cell_size(1.0);
    let [quantity, place] = &slice.title;
    let [across, up] = slice.axes;
    let mut layout = Layout::new(x, y)
        .with_title(format!("{quantity} / {unit} {place}"))
        .with_title_size(TITLE_PX)
        .with_x_label(format!("{across} / mm"))
        .with_y_label(format!("{up} / mm"))
        .with_ticks(5)
        .with_equal_aspect();
    layout.show_colorbar = true;
    if slice.shades == Shades::Decades {
        layout = layout.with_colorbar_tick_format(TickFormat::Custom(Arc::new(power)));
    }
    let line = |line: &SliceLine| {
        let points = line.points_m.iter().map(|[x, y]| (1e3 * x, 1e3 * y));
        let drawn = LinePlot::new().with_data(points.collect::<Vec<_>>());
        Plot::Line(drawn.with_color(line.stroke).with_stroke_width(LINE_PX))
    };
    let plots = std::iter::once(Plot::Heatmap(heatmap)).chain(slice.lines.iter().map(line));
    (plots.collect(), layout)
}

/// `map`, and [`NO_VALUE`] where there is none.
fn with_gaps(map: ColorMap) -> ColorMap {
    ColorMap::Custom(Arc::new(move |share: f64| match share.is_nan() {
        true => NO_VALUE.to_owned(),
        false => map.map(share),
    }))
}

/// Ten to this power, to two digits.
fn power(decades: f64) -> String {
    let decimals = (1.0 - decades.floor()).max(0.0) as usize;
    format!("{:.decimals$}", 10_f64.powf(decades))
}

/// Colours for values of both signs: white is zero, and equal sizes are equally strong. The crate hands
/// the map shares of the range between the least and the largest value.
fn diverging(values: impl Iterator<Item = f64>) -> ColorMap {
    let ends = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    let most = ends.0.abs().max(ends.1.abs());
    ColorMap::Custom(Arc::new(move |share: f64| {
        colour(ends.0 + share * (ends.1 - ends.0), most)
    }))
}

fn colour(value: f64, most: f64) -> String {
    if value.is_nan() {
        return NO_VALUE.to_owned();
    }
    let strength = if most > 0.0 {
        (value / most).clamp(-1.0, 1.0)
    } else {
        0.0
    };
    let end = ENDS[usize::from(strength > 0.0)];
    let [r, g, b] = end.map(|end| (255.0 + strength.abs() * (end - 255.0)).round() as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> SlicesPlot {
        SlicesPlot {
            title: "seed".to_owned(),
            slices: vec![Slice {
                title: ["F_z".to_owned(), "at 30 mm".to_owned()],
                axes: ["x", "y"],
                ends_m: [[-0.05, 0.05], [-0.03, 0.07]],
                columns: 7,
                unit: "N",
                values: (0..35)
                    .map(|k| (k != 7).then_some(0.01 * (f64::from(k) - 11.3)))
                    .collect(),
                shades: Shades::Signed,
                lines: vec![SliceLine {
                    points_m: vec![[-0.03, 0.01], [0.02, 0.03]],
                    stroke: SliceLine::FIELD,
                }],
            }],
            columns: 3,
            curves_title: "above the axis".to_owned(),
            curves: vec![HeightCurve {
                name: "coils 0, 2".to_owned(),
                points: vec![(0.01, 0.7), (0.02, 0.3), (0.05, -0.1)],
            }],
        }
    }

    #[test]
    fn zero_is_white_and_equal_sizes_are_equally_strong() {
        assert_eq!(colour(0.0, 1.3), "#ffffff");
        assert_eq!(
            [colour(1.3, 1.3), colour(-1.3, 1.3)],
            ["#b2182b", "#053061"]
        );
        assert_eq!(colour(0.0, 0.0), "#ffffff");
        assert_eq!(colour(f64::NAN, 1.3), NO_VALUE, "nothing is not zero");
        // A range that is not symmetric keeps its zero.
        let ColorMap::Custom(map) = diverging([-0.3, 0.9].into_iter()) else {
            panic!("a map of our own");
        };
        assert_eq!(map(0.25), "#ffffff");
        assert_eq!(map(1.0), "#b2182b");
        assert_ne!(map(0.0), "#053061");
    }

    #[test]
    fn axes_carry_their_units_and_bytes_are_the_same_twice() {
        let svg = plot().drawing().svg();
        for text in [
            "F_z / mN at 30 mm",
            "x / mm",
            "z / mm",
            "force / mN/A",
            "coils 0, 2",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("NaN"));
        assert!(svg == plot().drawing().svg());
    }
}
