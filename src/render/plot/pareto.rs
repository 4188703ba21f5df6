//! Gain against three costs, one panel each, with the front that no other point beats.

use kuva::plot::{LegendEntry, LegendShape, LinePlot, ScatterPlot};
use kuva::render::figure::Figure;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

use super::array::ticks;
use super::drawing::Drawing;
use super::thinned;

/// A panel's size, px.
const PANEL_PX: [f64; 2] = [400.0, 380.0];
/// The same on a page, with its space left and below, and around.
const MARKUP_PX: [f64; 2] = [400.0, 300.0];
const MARGIN_PX: [f64; 2] = [50.0, 44.0];
const AROUND_PX: f64 = 12.0;
/// Colours that stay apart for the colour-blind and in print.
const MET: &str = "#0072b2";
const UNMET: &str = "#b5b5b5";
const FRONT: &str = "#d55e00";

/// A cost, held against the gain.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Name of the cost.
    pub name: &'static str,
    /// Its SI unit.
    pub unit: &'static str,
    /// One value a point.
    pub values: Vec<f64>,
    /// Positions of the points on the front, ascending in cost.
    pub front: Vec<usize>,
}

/// Points with one gain and three costs.
#[derive(Debug, Clone, PartialEq)]
pub struct ParetoPlot {
    /// Above all panels.
    pub title: String,
    /// Name of the gain.
    pub gain: &'static str,
    /// Its SI unit.
    pub gain_unit: &'static str,
    /// One value a point.
    pub gains: Vec<f64>,
    /// Whether a point meets its limits.
    pub limits_met: Vec<bool>,
    /// Meaning of the front's points.
    pub front: &'static str,
    /// The costs.
    pub panels: [Panel; 3],
}

/// Axes of a panel: cost along x, gain along y.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnPanel {
    /// Of cost and gain.
    pub names: [&'static str; 2],
    /// Of cost and gain.
    pub units: [String; 2],
    /// Ends of the axes.
    pub ranges: [(f64, f64); 2],
    /// Points that do not meet their limits.
    pub unmet: Vec<(f64, f64)>,
    /// Points that do.
    pub met: Vec<(f64, f64)>,
    /// The front, in its panel's order.
    pub front: Vec<(f64, f64)>,
}

impl DrawnPanel {
    /// Of the axes.
    #[must_use]
    pub fn labels(&self) -> [String; 2] {
        std::array::from_fn(|k| match self.units[k].as_str() {
            "" => self.names[k].to_owned(),
            unit => format!("{} / {unit}", self.names[k]),
        })
    }

    /// The panel as markup for a page, whose style has the colours.
    #[must_use]
    pub fn markup(&self) -> String {
        let [x, y] = self.ranges;
        let [width, height] = MARKUP_PX;
        let [left, bottom] = [MARGIN_PX[0], height - MARGIN_PX[1]];
        let place = |(a, b): (f64, f64)| {
            let across = (a - x.0) / (x.1 - x.0) * (width - MARGIN_PX[0] - AROUND_PX);
            let up = (b - y.0) / (y.1 - y.0) * (bottom - 2.0 * AROUND_PX);
            (left + across, bottom - up)
        };
        let [x_label, y_label] = self.labels();
        let mut svg = format!(
            "<svg class=\"array\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{y_label} over {x_label}\">"
        );
        let mut text = |x: f64, y: f64, class: &str, text: &str| {
            svg.push_str(&format!(
                "<text x=\"{x:.1}\" y=\"{y:.1}\" class=\"{class}\">{text}</text>"
            ));
        };
        text(8.0, 14.0, "", &y_label);
        text(0.5 * (left + width), height - 6.0, "middle", &x_label);
        let mut rules = String::new();
        for value in ticks([x.0, x.1]) {
            let (at, _) = place((value, y.0));
            text(at, bottom + 18.0, "middle", &short(value));
            rules += &format!("M{at:.1} {bottom}v5");
        }
        for value in ticks([y.0, y.1]) {
            let (_, at) = place((x.0, value));
            text(left - 8.0, at + 4.0, "end", &short(value));
            rules += &format!("M{left} {at:.1}h-5");
        }
        let right = width - AROUND_PX;
        rules += &format!("M{left} {:.1}V{bottom}H{right}", 2.0 * AROUND_PX);
        svg.push_str(&format!("<path class=\"rule\" d=\"{rules}\"/>"));
        let kinds = [(&self.unmet, "dim", 2.0), (&self.met, "dot", 2.5)];
        let line: Vec<String> = self
            .front
            .iter()
            .map(|point| place(*point))
            .map(|(x, y)| format!("{x:.1} {y:.1}"))
            .collect();
        for (points, class, radius) in kinds.into_iter().chain([(&self.front, "best", 3.5)]) {
            if class == "best" && !line.is_empty() {
                svg.push_str(&format!(
                    "<path class=\"best-line\" d=\"M{}\"/>",
                    line.join("L")
                ));
            }
            for point in points {
                let (x, y) = place(*point);
                svg.push_str(&format!(
                    "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\"><title>{}, {}</title></circle>",
                    short(point.0),
                    short(point.1)
                ));
            }
        }
        svg.push_str("</svg>");
        svg
    }
}

/// A number of four digits at most.
fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    format!("{rounded}")
}

impl ParetoPlot {
    /// The drawing.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        let (cells, layouts): (Vec<_>, Vec<_>) = self.drawn().iter().map(panel).unzip();
        let figure = Figure::new(1, 3)
            .with_title(self.title.clone())
            .with_cell_size(PANEL_PX[0], PANEL_PX[1])
            .with_plots(cells)
            .with_layouts(layouts)
            .with_shared_legend_bottom()
            .with_shared_legend_entries(self.legend());
        Drawing::new(figure.render())
    }

    /// Values of the panels, in units that suit them; of points that would lie on each other
    /// only the first.
    #[must_use]
    pub fn drawn(&self) -> [DrawnPanel; 3] {
        let (gain_factor, gain_unit) = readable(&self.gains, self.gain_unit);
        let gains: Vec<f64> = self.gains.iter().map(|gain| gain * gain_factor).collect();
        self.panels.each_ref().map(|panel| {
            let (factor, unit) = readable(&panel.values, panel.unit);
            let costs: Vec<f64> = panel.values.iter().map(|value| value * factor).collect();
            let (x, y) = (extent(&costs), extent(&gains));
            let cloud = |met: bool| {
                let points = (0..costs.len()).filter(|at| self.limits_met[*at] == met);
                let points: Vec<(f64, f64)> = points.map(|at| (costs[at], gains[at])).collect();
                thinned(&points, x, y)
            };
            DrawnPanel {
                names: [panel.name, self.gain],
                units: [unit, gain_unit.clone()],
                ranges: [x, y],
                unmet: cloud(false),
                met: cloud(true),
                front: panel
                    .front
                    .iter()
                    .map(|&at| (costs[at], gains[at]))
                    .collect(),
            }
        })
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let entry = |label: &str, colour: &str| super::entry(label, colour, LegendShape::Circle);
        vec![
            entry("meets its limits", MET),
            entry("does not", UNMET),
            entry(self.front, FRONT),
        ]
    }
}

fn panel(drawn: &DrawnPanel) -> (Vec<Plot>, Layout) {
    let dots = |points: &[(f64, f64)], colour: &str, size: f64| {
        let points = ScatterPlot::new().with_data(points.to_vec());
        Plot::Scatter(points.with_color(colour).with_size(size))
    };
    let front = LinePlot::new().with_data(drawn.front.clone());
    let plots = vec![
        dots(&drawn.unmet, UNMET, 2.0),
        dots(&drawn.met, MET, 2.0),
        Plot::Line(front.with_color(FRONT)),
        dots(&drawn.front, FRONT, 3.0),
    ];
    let [x, y] = drawn.ranges;
    let [x_label, y_label] = drawn.labels();
    let layout = Layout::new(x, y)
        .with_x_label(x_label)
        .with_y_label(y_label)
        .with_ticks(5);
    (plots, layout)
}

/// The factor and the unit that make the largest value readable.
pub(super) fn readable(values: &[f64], unit: &str) -> (f64, String) {
    let size = |most: f64, value: &f64| most.max(value.abs());
    let largest = values.iter().fold(0.0, size);
    match unit {
        _ if largest >= 1.0 || largest == 0.0 => (1.0, unit.to_owned()),
        "kg" if largest >= 1e-3 => (1e3, "g".to_owned()),
        "kg" => (1e6, "mg".to_owned()),
        _ if largest >= 1e-3 => (1e3, format!("m{unit}")),
        _ => (1e6, format!("u{unit}")),
    }
}

/// The range of an axis, with room at both ends.
pub(super) fn extent(values: &[f64]) -> (f64, f64) {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if low > high {
        return (0.0, 1.0);
    }
    let room = if high > low {
        0.05 * (high - low)
    } else {
        0.1 * high.abs().max(1e-12)
    };
    let below = low - room;
    // Nothing negative is shown where nothing is.
    (if low >= 0.0 { below.max(0.0) } else { below }, high + room)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawing(count: usize) -> ParetoPlot {
        let values = |scale: f64| {
            (0..count)
                .map(|i| scale * (1.3 + (0.7 * i as f64).sin()))
                .collect()
        };
        let panel = |name, unit, scale| Panel {
            name,
            unit,
            values: values(scale),
            front: (0..count.min(3)).collect(),
        };
        ParetoPlot {
            title: "a: designs".to_owned(),
            gain: "force",
            gain_unit: "N",
            gains: values(0.07),
            limits_met: (0..count).map(|i| i % 3 != 0).collect(),
            front: "best",
            panels: [
                panel("resistance", "ohm", 7.0),
                panel("mass", "kg", 0.3),
                panel("settling time", "s", 1e-5),
            ],
        }
    }

    #[test]
    fn axes_carry_units_that_suit_their_values() {
        let svg = drawing(30).drawing().svg();
        for label in [
            "force / mN",
            "resistance / ohm",
            "mass / g",
            "settling time / us",
            "best",
        ] {
            assert!(svg.contains(label), "{label}");
        }
        assert!(
            svg == drawing(30).drawing().svg(),
            "not the same bytes twice"
        );
    }

    #[test]
    fn few_points_and_many_are_drawn() {
        for count in [0, 1, 2] {
            let svg = drawing(count).drawing().svg();
            assert!(
                svg.ends_with("</svg>") && !svg.contains("NaN"),
                "{count}: {svg}"
            );
        }
        let mut same = drawing(7);
        same.gains = vec![0.7; 7];
        assert!(!same.drawing().svg().contains("NaN"));
        let circles = |svg: &str| svg.matches("<circle").count();
        let many = circles(&drawing(200_000).drawing().svg());
        assert!(many < 20_000, "{many}");
    }
}
