//! Error against seconds: curves in a doubly logarithmic plane, some points marked.

use std::sync::Arc;

use kuva::plot::{LegendEntry, LegendShape, LinePlot, ScatterPlot};
use kuva::render::figure::Figure;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;

use super::drawing::Drawing;
use super::replay::COILS as COLOURS;

/// The plane's size, px.
const PANEL_PX: [f64; 2] = [640.0, 440.0];
/// Errors below this are drawn here: doubles know nothing finer.
const FLOOR: f64 = 1e-17;
/// Marks, px.
const DOT_PX: f64 = 3.5;
const MARK_PX: f64 = 8.0;
/// Most ticks of an axis.
const MOST_TICKS: f64 = 9.0;
const MARK: &str = "#000000";

/// One curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Its name.
    pub name: String,
    /// Seconds and errors, in order.
    pub points: Vec<(f64, f64)>,
    /// Which of them have a ring.
    pub marked: Vec<usize>,
}

/// Data of the drawing.
#[derive(Debug, Clone, PartialEq)]
pub struct CurvesPlot {
    /// Above the plane.
    pub title: String,
    /// Name and unit of what is along x.
    pub across: String,
    /// Name and unit of what is along y.
    pub up: String,
    /// The meaning of a ring.
    pub mark: &'static str,
    /// The curves; the first nine differ in colour.
    pub lines: Vec<Line>,
}

impl CurvesPlot {
    /// The drawing.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        let shown: Vec<Line> = self.lines.iter().map(Line::drawable).collect();
        let all = || shown.iter().flat_map(|line| line.points.iter());
        let x = decades(all().map(|p| p.0));
        let y = decades(all().map(|p| p.1));
        let mut plots = Vec::new();
        for (k, line) in shown.iter().enumerate() {
            let colour = COLOURS[k % COLOURS.len()];
            let marked = line.marked.iter().map(|at| line.points[*at]);
            let ring = ScatterPlot::new()
                .with_data(marked.collect::<Vec<_>>())
                .with_color(MARK)
                .with_size(MARK_PX);
            plots.push(Plot::Scatter(ring));
            let joined = LinePlot::new().with_data(line.points.clone());
            plots.push(Plot::Line(joined.with_color(colour)));
            let dots = ScatterPlot::new()
                .with_data(line.points.clone())
                .with_color(colour)
                .with_size(DOT_PX);
            plots.push(Plot::Scatter(dots));
        }
        // The crate's own logarithmic axes have no ticks below 1e-10.
        let mut layout = Layout::new(x, y)
            .with_x_label(self.across.clone())
            .with_y_label(self.up.clone());
        layout.x_tick_step = Some(step(x));
        layout.y_tick_step = Some(step(y));
        layout.x_tick_format = TickFormat::Custom(Arc::new(power));
        layout.y_tick_format = TickFormat::Custom(Arc::new(power));
        let figure = Figure::new(1, 1)
            .with_title(self.title.clone())
            .with_cell_size(PANEL_PX[0], PANEL_PX[1])
            .with_plots(vec![plots])
            .with_layouts(vec![layout])
            .with_shared_legend_bottom()
            .with_shared_legend_entries(self.legend());
        Drawing::new(figure.render())
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let entry = |label: &str, colour: &str| super::entry(label, colour, LegendShape::Circle);
        let mut entries: Vec<LegendEntry> = (self.lines.iter().enumerate())
            .map(|(k, line)| entry(&line.name, COLOURS[k % COLOURS.len()]))
            .collect();
        if self.lines.iter().any(|line| !line.marked.is_empty()) {
            entries.push(entry(self.mark, MARK));
        }
        entries
    }
}

impl Line {
    /// Decimal logarithms of the points that have any; errors too small are drawn at the floor.
    fn drawable(&self) -> Self {
        let (mut points, mut marked) = (Vec::new(), Vec::new());
        for (at, (x, y)) in self.points.iter().enumerate() {
            if *x > 0.0 && x.is_finite() && *y >= 0.0 && y.is_finite() {
                if self.marked.contains(&at) {
                    marked.push(points.len());
                }
                points.push((x.log10(), y.max(FLOOR).log10()));
            }
        }
        Self {
            name: self.name.clone(),
            points,
            marked,
        }
    }
}

/// Whole decades around logarithms.
fn decades(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let ends = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    if ends.0 > ends.1 {
        return (-1.0, 0.0);
    }
    let (low, high) = (ends.0.floor(), ends.1.ceil());
    (low, if high > low { high } else { low + 1.0 })
}

/// Decades between two ticks.
fn step((low, high): (f64, f64)) -> f64 {
    ((high - low) / MOST_TICKS).ceil().max(1.0)
}

/// A tick's label.
fn power(exponent: f64) -> String {
    let whole = exponent.round();
    if (exponent - whole).abs() < 1e-6 {
        format!("1e{whole}")
    } else {
        String::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawing(points: &[(f64, f64)]) -> CurvesPlot {
        CurvesPlot {
            title: "cored-coil".to_owned(),
            across: "processor time / s".to_owned(),
            up: "error, relative to |grad B|".to_owned(),
            mark: "default",
            lines: vec![Line {
                name: "fluxform: tolerance".to_owned(),
                points: points.to_vec(),
                marked: (0..points.len().min(1)).collect(),
            }],
        }
    }

    #[test]
    fn labels_are_there_and_bytes_are_the_same_twice() {
        let plot = drawing(&[(1e-3, 1e-2), (2e-3, 1e-4), (7e-3, 1e-9)]);
        let svg = plot.drawing().svg();
        for label in [
            "processor time / s",
            "relative to |grad B|",
            "default",
            "cored-coil",
        ] {
            assert!(svg.contains(label), "{label}");
        }
        assert!(svg == plot.drawing().svg());
    }

    #[test]
    fn what_no_logarithm_has_is_left_out_or_drawn_at_the_floor() {
        for points in [
            &[][..],
            &[(0.7, 0.0)],
            &[(f64::NAN, 1.0), (1.0, f64::INFINITY), (-1.0, 1.0)],
            &[(1.0, 1.0)],
        ] {
            let svg = drawing(points).drawing().svg();
            assert!(
                svg.ends_with("</svg>") && !svg.contains("NaN"),
                "{points:?}"
            );
        }
        assert_eq!(decades([-4.6, -0.2].into_iter()), (-5.0, 0.0));
        assert_eq!(decades([2.0].into_iter()), (2.0, 3.0));
        assert_eq!((step((-17.0, 0.0)), step((-5.0, 0.0))), (2.0, 1.0));
        assert_eq!(power(-7.0), "1e-7");
    }
}
