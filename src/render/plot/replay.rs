//! A replay over time: where the finger is, the forces with and without feedback, the currents.

use std::ops::Range;

use kuva::plot::annotations::ShadedRegion;
use kuva::plot::{LegendEntry, LegendShape, LinePlot, ScatterPlot};
use kuva::render::figure::Figure;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

use super::drawing::Drawing;
use super::entry;

/// A panel's size, px.
const PANEL_PX: [f64; 2] = [620.0, 330.0];
/// Of more than twice as many positions only the extremes of so many equal parts of the time are drawn.
const PARTS: usize = 800;
/// Most coils named in the legend.
const NAMED: usize = 12;
/// Line widths, px.
const THIN: f64 = 1.2;
const THICK: f64 = 2.4;
/// Colours that stay apart for the colour-blind and in print.
const FINGERS: [&str; 2] = ["#0072b2", "#009e73"];
const SURFACE: &str = "#7f7f7f";
const REQUESTED: &str = "#b5b5b5";
const FIXED: &str = "#d55e00";
pub(super) const COILS: [&str; 9] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c510a",
    "#762a83",
];

/// Data of the drawing; one entry per position.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplayPlot<'a> {
    /// Above all panels.
    pub title: String,
    /// s.
    pub t_s: &'a [f64],
    /// One or two, each with its own colour.
    pub fingers: Vec<FingerCurves<'a>>,
    /// Number of coils.
    pub coils: usize,
    /// Coil by coil within a position, A.
    pub current_a: &'a [f64],
}

/// Force and error at one finger; one entry per position.
#[derive(Debug, Clone, PartialEq)]
pub struct FingerCurves<'a> {
    /// m.
    pub position_m: &'a [[f64; 3]],
    /// Height of the surface there, m; 0 where there is none.
    pub surface_m: &'a [f64],
    /// Whether the position lies inside the map.
    pub inside: Vec<bool>,
    /// N.
    pub requested_n: &'a [f64],
    /// With feedback, N.
    pub given_n: &'a [f64],
    /// With fixed currents, N.
    pub static_n: &'a [f64],
}

impl ReplayPlot<'_> {
    /// The drawing.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        let panels = [self.plan(), self.heights(), self.forces(), self.currents()];
        let (cells, layouts): (Vec<_>, Vec<_>) = panels.into_iter().unzip();
        let figure = Figure::new(2, 2)
            .with_title(self.title.clone())
            .with_cell_size(PANEL_PX[0], PANEL_PX[1])
            .with_plots(cells)
            .with_layouts(layouts)
            .with_shared_legend()
            .with_shared_legend_entries(self.legend());
        Drawing::new(figure.render())
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let mut entries = vec![
            entry(
                "finger, force with feedback",
                FINGERS[0],
                LegendShape::Circle,
            ),
            entry("outside the map", FIXED, LegendShape::Circle),
            entry("surface below it", SURFACE, LegendShape::Line),
            entry("force requested", REQUESTED, LegendShape::Line),
            entry("force with fixed currents", FIXED, LegendShape::Line),
        ];
        if self.fingers.len() > 1 {
            let second = entry("second finger", FINGERS[1], LegendShape::Circle);
            entries.insert(1, second);
        }
        if self.coils <= NAMED {
            entries.extend((0..self.coils).map(|coil| {
                let colour = COILS[coil % COILS.len()];
                entry(&format!("coil {coil}"), colour, LegendShape::Line)
            }));
        }
        entries
    }

    /// The fingers with their colours.
    fn coloured(&self) -> impl Iterator<Item = (&FingerCurves<'_>, &'static str)> {
        self.fingers.iter().zip(FINGERS)
    }

    /// The fingers seen from above.
    fn plan(&self) -> (Vec<Plot>, Layout) {
        let mut plots = Vec::new();
        for (finger, colour) in self.coloured() {
            let every = finger.position_m.len().div_ceil(2 * PARTS).max(1);
            for (inside, colour) in [(true, colour), (false, FIXED)] {
                let rows = finger.position_m.iter().zip(&finger.inside);
                let points = rows.filter(|(_, is)| **is == inside).step_by(every);
                let points: Vec<_> = points.map(|([x, y, _], _)| (x * 1e3, y * 1e3)).collect();
                let dots = ScatterPlot::new().with_color(colour).with_size(1.6);
                plots.push(Plot::Scatter(dots.with_data(points)));
            }
        }
        let mm = |axis: usize| {
            let positions = self.fingers.iter().flat_map(|finger| finger.position_m);
            extent(positions.map(move |position| position[axis] * 1e3))
        };
        let layout = Layout::new(mm(0), mm(1))
            .with_title("seen from above")
            .with_x_label("x / mm")
            .with_y_label("y / mm")
            .with_equal_aspect();
        (plots, layout)
    }

    fn heights(&self) -> (Vec<Plot>, Layout) {
        let (mut plots, mut values) = (Vec::new(), Vec::new());
        for (finger, colour) in self.coloured() {
            let height: Vec<f64> = finger.position_m.iter().map(|p| p[2] * 1e3).collect();
            let surface: Vec<f64> = finger.surface_m.iter().map(|h| h * 1e3).collect();
            let felt: Vec<bool> = finger.surface_m.iter().map(|h| *h != 0.0).collect();
            plots.extend(self.lines(&surface, &felt, SURFACE, THICK));
            plots.extend(self.lines(&height, &self.all(), colour, THIN));
            let shown = surface.iter().zip(&felt).filter(|(_, felt)| **felt);
            values.extend(height.iter().copied().chain(shown.map(|(h, _)| *h)));
        }
        let layout = self.over_time(extent(values.into_iter()), "height", "z / mm");
        (plots, layout)
    }

    fn forces(&self) -> (Vec<Plot>, Layout) {
        let mn = |values: &[f64]| -> Vec<f64> { values.iter().map(|f| f * 1e3).collect() };
        let all = self.all();
        let (mut plots, mut values) = (Vec::new(), Vec::new());
        for (finger, colour) in self.coloured() {
            let curves = [finger.requested_n, finger.static_n, finger.given_n].map(mn);
            let [requested, fixed, given] = &curves;
            plots.extend(self.lines(requested, &all, REQUESTED, 2.0 * THICK));
            plots.extend(self.lines(fixed, &finger.inside, FIXED, THIN));
            plots.extend(self.lines(given, &all, colour, THIN));
            values.extend(curves.into_iter().flatten());
        }
        (
            plots,
            self.over_time(extent(values.into_iter()), "upward force", "F / mN"),
        )
    }

    fn currents(&self) -> (Vec<Plot>, Layout) {
        let mut plots = Vec::new();
        for coil in 0..self.coils {
            let current: Vec<f64> = self
                .current_a
                .iter()
                .skip(coil)
                .step_by(self.coils)
                .copied()
                .collect();
            let colour = COILS[coil % COILS.len()];
            plots.extend(self.lines(&current, &self.all(), colour, THIN));
        }
        let layout = self.over_time(extent(self.current_a.iter().copied()), "currents", "I / A");
        (plots, layout)
    }

    fn all(&self) -> Vec<bool> {
        vec![true; self.t_s.len()]
    }

    /// A curve over time, broken where nothing is shown.
    fn lines(&self, values: &[f64], shown: &[bool], colour: &str, width: f64) -> Vec<Plot> {
        let line = |piece: Vec<usize>| {
            let points = piece.into_iter().map(|row| (self.t_s[row], values[row]));
            let line = LinePlot::new().with_data(points.collect::<Vec<_>>());
            Plot::Line(line.with_color(colour).with_stroke_width(width))
        };
        pieces(values, shown).into_iter().map(line).collect()
    }

    /// Whether every finger is inside the map.
    fn inside(&self, row: usize) -> bool {
        self.fingers.iter().all(|finger| finger.inside[row])
    }

    /// Axes over time, with the times at which a finger is outside the map shaded.
    fn over_time(&self, values: (f64, f64), title: &str, label: &str) -> Layout {
        let from = self.t_s.first().copied().unwrap_or(0.0);
        let to = self.t_s.last().copied().unwrap_or(1.0).max(from + 1e-9);
        let mut layout = Layout::new((from, to), values)
            .with_title(title)
            .with_x_label("t / s")
            .with_y_label(label);
        let parts: Vec<_> = parts(self.t_s.len()).collect();
        let outside = |part: &Range<usize>| part.clone().any(|row| !self.inside(row));
        for alike in parts.chunk_by(|a, b| outside(a) == outside(b)) {
            let rows = alike[0].start..alike[alike.len() - 1].end;
            if outside(&alike[0]) {
                let until = self.t_s.get(rows.end).copied().unwrap_or(to);
                let shade = ShadedRegion::vertical(self.t_s[rows.start], until);
                layout = layout.with_shaded_region(shade.with_color(SURFACE));
            }
        }
        layout
    }
}

/// The range of an axis, with room at both ends; 0 is always room enough below nothing.
fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let ends = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    if ends.0 > ends.1 {
        return (0.0, 1.0);
    }
    let room = (0.05 * (ends.1 - ends.0)).max(1e-3 * ends.0.abs().max(ends.1.abs()).max(1e-9));
    (ends.0 - room, ends.1 + room)
}

/// The rows that are drawn together: each alone, or of many rows those of one part of the time.
fn parts(rows: usize) -> impl Iterator<Item = Range<usize>> {
    let size = if rows <= 2 * PARTS {
        1
    } else {
        rows.div_ceil(PARTS)
    };
    (0..rows)
        .step_by(size)
        .map(move |row| row..rows.min(row + size))
}

/// The rows of a curve's pieces, in order: of every part the lowest and the highest that are shown; a part with
/// none ends a piece.
fn pieces(values: &[f64], shown: &[bool]) -> Vec<Vec<usize>> {
    let mut pieces = vec![Vec::new()];
    for part in parts(values.len()) {
        let rows = || part.clone().filter(|row| shown[*row]);
        let order = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
        match (
            rows().min_by(order),
            rows().max_by(order),
            pieces.last_mut(),
        ) {
            (Some(low), Some(high), Some(piece)) => {
                piece.push(low.min(high));
                if low != high {
                    piece.push(low.max(high));
                }
            }
            _ => pieces.push(Vec::new()),
        }
    }
    pieces.retain(|piece| !piece.is_empty());
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(count: usize, fingers: usize) -> String {
        let t_s: Vec<f64> = (0..count).map(|k| 0.02 * k as f64).collect();
        let wave = |hz: f64| -> Vec<f64> { t_s.iter().map(|t| 0.3 * (hz * t).sin()).collect() };
        let (requested, given, fixed) = (wave(0.7), wave(1.3), wave(2.1));
        let position_m: Vec<[f64; 3]> = t_s.iter().map(|t| [0.01 * t, 0.0, 0.05]).collect();
        let finger = FingerCurves {
            position_m: &position_m,
            surface_m: &vec![0.05; count],
            inside: (0..count).map(|k| k % 50 < 40).collect(),
            requested_n: &requested,
            given_n: &given,
            static_n: &fixed,
        };
        let plot = ReplayPlot {
            title: "flat on a".to_owned(),
            t_s: &t_s,
            fingers: vec![finger; fingers],
            coils: 2,
            current_a: &vec![0.7; 2 * count],
        };
        plot.drawing().svg()
    }

    #[test]
    fn few_positions_and_many_are_drawn() {
        for count in [0, 1, 2, 300] {
            let svg = drawn(count, 1);
            assert!(
                svg.ends_with("</svg>") && !svg.contains("NaN"),
                "{count}: {svg}"
            );
        }
        let svg = drawn(300, 1);
        for label in [
            "t / s",
            "F / mN",
            "I / A",
            "coil 1",
            "with feedback",
            "outside the map",
        ] {
            assert!(svg.contains(label), "{label}");
        }
        assert!(svg == drawn(300, 1), "not the same bytes twice");
        assert!(!svg.contains("second finger"));
        assert!(drawn(300, 2).contains("second finger"));
        // Every 50th position is outside the map: pieces without end, if each were drawn.
        let many = drawn(100_000, 1).len();
        assert!(many < 400_000, "{many} bytes");
    }

    #[test]
    fn thinning_keeps_extremes_order_and_gaps() {
        let mut values = vec![0.0; 10_000];
        (values[4_321], values[4_322], values[7_000]) = (-7.0, 13.0, 99.0);
        let mut shown = vec![true; values.len()];
        shown[6_990..7_020].fill(false);
        let kept = pieces(&values, &shown);
        let all = kept.concat();
        assert!(kept.len() == 2 && all.len() <= 2 * PARTS && all.is_sorted_by(|a, b| a < b));
        assert!(all.contains(&4_321) && all.contains(&4_322) && !all.contains(&7_000));
    }
}
