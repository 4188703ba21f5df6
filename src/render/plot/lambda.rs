//! The force constant of one object: its error and currents over lambda, and what is felt where.

use kuva::plot::annotations::ReferenceLine;
use kuva::plot::{Heatmap, LegendEntry, LegendShape, LinePlot, ScatterPlot};
use kuva::render::figure::Figure;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

use super::drawing::Drawing;
use super::pareto::extent;
use super::plane::{Cells, colours, rows, wide};
use super::replay::COILS;
use super::{entry, thinned};

/// A panel's size, px.
const PANEL_PX: [f64; 2] = [600.0, 400.0];
/// Most coils named in the legend.
const NAMED: usize = 12;
/// Most coils with a line each; of more the lines are the least current, the quartiles and the largest.
const DRAWN: usize = 36;
const QUARTILES: usize = 4;
/// Colours that stay apart for the colour-blind and in print.
const RMS: &str = "#0072b2";
const RELATIVE: &str = "#d55e00";
const BREAKPOINT: &str = "#000000";
const FIXED: &str = "#d55e00";
const FOLLOWING: &str = "#0072b2";
const DIAGONAL: &str = "#7f7f7f";
/// For the constants, in their order; the chosen one is a whole line behind them.
const CONSTANTS: [&str; 5] = ["#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c510a"];
const CHOSEN: &str = "#9a9a9a";
const CHOSEN_PX: f64 = 2.0;
const DASHES: &str = "6 4";

/// A force constant with a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constant {
    /// Such as `jnd`.
    pub name: &'static str,
    /// N/m.
    pub lambda_n_per_m: f64,
}

/// Errors of the forces over the surface, one kind of points.
#[derive(Debug, Clone, PartialEq)]
pub enum ErrorMap {
    /// Points of a grid.
    Grid {
        /// The grid's ends along x, mm.
        x_mm: [f64; 2],
        /// The grid's ends along y, mm.
        y_mm: [f64; 2],
        /// Errors, mN.
        cells: Cells,
    },
    /// Points on no grid: x and y, mm, and errors, mN.
    Scattered {
        /// Places.
        points_mm: Vec<(f64, f64)>,
        /// Given minus lambda h.
        errors_mn: Vec<f64>,
    },
}

/// Forces at the chosen force constant, one entry a point.
#[derive(Debug, Clone, PartialEq)]
pub struct ChosenForces {
    /// N/m.
    pub lambda_n_per_m: f64,
    /// lambda h, N.
    pub requested_n: Vec<f64>,
    /// Upward with static currents, N.
    pub static_n: Vec<f64>,
    /// With position feedback, N; empty where it was not requested.
    pub feedback_n: Vec<f64>,
    /// Given by static currents minus lambda h.
    pub map: ErrorMap,
}

/// Data of the drawing.
#[derive(Debug, Clone, PartialEq)]
pub struct LambdaPlot {
    /// Above all panels.
    pub title: String,
    /// Where the axis of lambda ends, N/m.
    pub end_n_per_m: f64,
    /// lambda, N/m, ascending; breakpoints are among them.
    pub lambda_n_per_m: Vec<f64>,
    /// Root mean square error there, N.
    pub rms_error_n: Vec<f64>,
    /// The same over that of the requested force; `None` where none is requested.
    pub relative_error: Vec<Option<f64>>,
    /// Static currents there, A.
    pub currents_a: Vec<Vec<f64>>,
    /// Whether a coil leaves or meets a limit there.
    pub breakpoint: Vec<bool>,
    /// The named ones.
    pub constants: Vec<Constant>,
    /// At the chosen one, if there is one.
    pub chosen: Option<ChosenForces>,
}

impl LambdaPlot {
    /// The drawing.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        let (errors, relative, over_lambda) = self.errors();
        let panels = [self.currents(), self.map(), self.forces()];
        let (others, layouts): (Vec<_>, Vec<_>) = panels.into_iter().unzip();
        let cells: Vec<_> = std::iter::once(Vec::new()).chain(others).collect();
        let layouts: Vec<_> = std::iter::once(over_lambda).chain(layouts).collect();
        let figure = Figure::new(2, 2)
            .with_title(self.title.clone())
            .with_cell_size(PANEL_PX[0], PANEL_PX[1])
            .with_plots(cells)
            .with_twin_y_plots(0, errors, relative)
            .with_layouts(layouts)
            .with_shared_legend()
            .with_shared_legend_entries(self.legend());
        Drawing::new(figure.render())
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let mut entries = vec![
            entry("rms error", RMS, LegendShape::Line),
            entry("relative error", RELATIVE, LegendShape::Line),
            entry("breakpoint", BREAKPOINT, LegendShape::Circle),
        ];
        entries.extend(self.chosen.iter().map(|chosen| {
            let text = format!("chosen {:.4} N/m", chosen.lambda_n_per_m);
            entry(&text, CHOSEN, LegendShape::Line)
        }));
        entries.extend(self.constants.iter().zip(CONSTANTS).map(|(one, colour)| {
            let beyond = if one.lambda_n_per_m > self.end_n_per_m {
                " (not shown)"
            } else {
                ""
            };
            let text = format!("{} {:.4} N/m{beyond}", one.name, one.lambda_n_per_m);
            LegendEntry {
                dasharray: Some(DASHES.to_owned()),
                ..entry(&text, colour, LegendShape::Line)
            }
        }));
        let coils = self.coils();
        if coils <= NAMED {
            entries.extend((0..coils).map(|coil| {
                let colour = COILS[coil % COILS.len()];
                entry(&format!("coil {coil}"), colour, LegendShape::Line)
            }));
        }
        if let Some(chosen) = &self.chosen {
            entries.push(entry("static currents", FIXED, LegendShape::Circle));
            if !chosen.feedback_n.is_empty() {
                entries.push(entry("with feedback", FOLLOWING, LegendShape::Circle));
            }
        }
        entries
    }

    /// Both errors over lambda, and their axes.
    fn errors(&self) -> (Vec<Plot>, Vec<Plot>, Layout) {
        let rms_mn: Vec<f64> = self.rms_error_n.iter().map(|e| e * 1e3).collect();
        let curve: Vec<(f64, f64)> = self.over(rms_mn.iter().copied()).collect();
        let turns = curve.iter().zip(&self.breakpoint);
        let turns: Vec<(f64, f64)> = turns.filter(|(_, turn)| **turn).map(|(p, _)| *p).collect();
        let part = self.lambda_n_per_m.iter().zip(&self.relative_error);
        let part: Vec<(f64, f64)> = part
            .filter_map(|(lambda, part)| part.map(|part| (*lambda, part * 100.0)))
            .collect();
        let most = |values: &[(f64, f64)]| values.iter().map(|p| p.1).fold(0.0, f64::max);
        let above = |most: f64| if most > 0.0 { 1.05 * most } else { 1.0 };
        let layout = self
            .over_lambda((0.0, above(most(&curve))))
            .with_title("least rms error of static currents")
            .with_y_label("rms error / mN")
            .with_y2_range(0.0, above(most(&part)))
            .with_y2_label("relative to the rms force / %");
        let line = |data: Vec<(f64, f64)>, colour: &str| {
            Plot::Line(LinePlot::new().with_data(data).with_color(colour))
        };
        let dots = ScatterPlot::new().with_color(BREAKPOINT).with_size(2.5);
        let first = vec![line(curve, RMS), Plot::Scatter(dots.with_data(turns))];
        (first, vec![line(part, RELATIVE)], layout)
    }

    fn currents(&self) -> (Vec<Plot>, Layout) {
        let ranked = (self.coils() > DRAWN).then(|| self.quartiles_a());
        let (currents_a, title) = match &ranked {
            None => (&self.currents_a, "static currents"),
            Some(ranked) => (ranked, "static currents: least, quartiles, largest"),
        };
        let lines = currents_a.first().map_or(0, Vec::len);
        let line = |index: usize| {
            let values = currents_a.iter().map(|currents| currents[index]);
            let line = LinePlot::new().with_data(self.over(values).collect::<Vec<_>>());
            // Coils that carry the same lie on each other: the later ones are thinner.
            let width = 1.2 + 2.4 * (1.0 - index as f64 / lines as f64);
            let colour = COILS[index % COILS.len()];
            Plot::Line(line.with_color(colour).with_stroke_width(width))
        };
        let values: Vec<f64> = currents_a.iter().flatten().copied().collect();
        let layout = self
            .over_lambda(extent(&values))
            .with_title(title)
            .with_y_label("I / A");
        ((0..lines).map(line).collect(), layout)
    }

    /// Of the currents at each lambda those that a quarter, a half, three quarters of the coils stay below, and the
    /// ends.
    fn quartiles_a(&self) -> Vec<Vec<f64>> {
        let of = |currents_a: &Vec<f64>| {
            let mut sorted = currents_a.clone();
            sorted.sort_by(f64::total_cmp);
            (0..=QUARTILES)
                .map(|k| sorted[k * (sorted.len() - 1) / QUARTILES])
                .collect()
        };
        self.currents_a.iter().map(of).collect()
    }

    fn map(&self) -> (Vec<Plot>, Layout) {
        let Some(chosen) = &self.chosen else {
            return empty("no lambda is chosen: no errors");
        };
        let title = |range: &str| format!("static: given - lambda h{range} / mN");
        let (plot, x, y, title, bar) = match &chosen.map {
            ErrorMap::Grid { x_mm, y_mm, cells } => {
                let (x, y) = (wide(*x_mm), wide(*y_mm));
                let map = Heatmap::new()
                    .with_data(rows(cells))
                    .with_color_map(colours())
                    .with_x_range(x.0, x.1)
                    .with_y_range(y.0, y.1)
                    .with_cell_size(1.0);
                (Plot::Heatmap(map), x, y, title(""), true)
            }
            ErrorMap::Scattered {
                points_mm,
                errors_mn,
            } => {
                let of = |k: usize| -> Vec<f64> {
                    points_mm
                        .iter()
                        .map(|p| if k == 0 { p.0 } else { p.1 })
                        .collect()
                };
                let low = errors_mn.iter().copied().fold(f64::INFINITY, f64::min);
                let high = errors_mn.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let (map, span) = (colours(), (high - low).max(f64::MIN_POSITIVE));
                let colour = |error: &f64| map.map((error - low) / span);
                let dots = ScatterPlot::new()
                    .with_data(points_mm.clone())
                    .with_colors(errors_mn.iter().map(colour))
                    .with_size(2.0);
                let range = if errors_mn.is_empty() {
                    String::new()
                } else {
                    format!(", {low:.3} (dark) to {high:.3} (bright)")
                };
                let (x, y) = (extent_any(&of(0)), extent_any(&of(1)));
                (Plot::Scatter(dots), x, y, title(&range), false)
            }
        };
        let mut layout = Layout::new(x, y)
            .with_title(title)
            .with_x_label("x / mm")
            .with_y_label("y / mm")
            .with_ticks(5)
            .with_equal_aspect();
        layout.show_colorbar = bar;
        (vec![plot], layout)
    }

    fn forces(&self) -> (Vec<Plot>, Layout) {
        let Some(chosen) = &self.chosen else {
            return empty("no lambda is chosen: no forces");
        };
        let mn = |values: &[f64]| -> Vec<f64> { values.iter().map(|f| f * 1e3).collect() };
        let requested = mn(&chosen.requested_n);
        let (fixed, following) = (mn(&chosen.static_n), mn(&chosen.feedback_n));
        let (x, y) = (
            extent(&requested),
            extent(&[requested.as_slice(), &fixed, &following].concat()),
        );
        let dots = |given: &[f64], colour: &str, size: f64| {
            let points: Vec<(f64, f64)> = requested
                .iter()
                .copied()
                .zip(given.iter().copied())
                .collect();
            let dots = ScatterPlot::new().with_data(thinned(&points, x, y));
            Plot::Scatter(dots.with_color(colour).with_size(size))
        };
        let (low, high) = (x.0.max(y.0), x.1.min(y.1));
        let diagonal = LinePlot::new().with_data(vec![(low, low), (high, high)]);
        let plots = vec![
            Plot::Line(diagonal.with_color(DIAGONAL)),
            dots(&fixed, FIXED, 1.8),
            dots(&following, FOLLOWING, 1.8),
        ];
        let layout = Layout::new(x, y)
            .with_title(format!("forces at {:.4} N/m", chosen.lambda_n_per_m))
            .with_x_label("lambda h / mN")
            .with_y_label("given upward / mN");
        (plots, layout)
    }

    fn coils(&self) -> usize {
        self.currents_a.first().map_or(0, Vec::len)
    }

    fn over<'a>(
        &'a self,
        values: impl Iterator<Item = f64> + 'a,
    ) -> impl Iterator<Item = (f64, f64)> + 'a {
        self.lambda_n_per_m.iter().copied().zip(values)
    }

    /// Axes over lambda, with the constants marked.
    fn over_lambda(&self, values: (f64, f64)) -> Layout {
        let mut layout = Layout::new((0.0, self.end_n_per_m), values).with_x_label("lambda / N/m");
        if let Some(chosen) = &self.chosen {
            let line = ReferenceLine::vertical(chosen.lambda_n_per_m).with_color(CHOSEN);
            let line = line.with_stroke_width(CHOSEN_PX).with_dasharray("none");
            layout = layout.with_reference_line(line);
        }
        for (one, colour) in self.constants.iter().zip(CONSTANTS) {
            if one.lambda_n_per_m <= self.end_n_per_m {
                let line = ReferenceLine::vertical(one.lambda_n_per_m).with_color(colour);
                layout = layout.with_reference_line(line.with_dasharray(DASHES));
            }
        }
        layout
    }
}

/// A panel that says why it is empty.
fn empty(why: &str) -> (Vec<Plot>, Layout) {
    let nothing = ScatterPlot::new().with_data(Vec::<(f64, f64)>::new());
    let layout = Layout::new((0.0, 1.0), (0.0, 1.0)).with_title(why);
    (vec![Plot::Scatter(nothing)], layout)
}

/// The range of an axis of places.
fn extent_any(values: &[f64]) -> (f64, f64) {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    wide([low.min(high), high.max(low)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::plane::Together;

    fn drawing(points: usize) -> LambdaPlot {
        let lambda: Vec<f64> = (0..40).map(|k| 0.1 * f64::from(k)).collect();
        let errors: Vec<f64> = (0..points).map(|k| (0.7 * k as f64).sin()).collect();
        LambdaPlot {
            title: "a on b".to_owned(),
            end_n_per_m: 3.9,
            rms_error_n: lambda.iter().map(|l| 1.3e-3 * l * l).collect(),
            relative_error: lambda
                .iter()
                .map(|l| (*l > 0.0).then_some(0.07 * l))
                .collect(),
            currents_a: lambda.iter().map(|l| vec![0.7 * l, 1.3]).collect(),
            breakpoint: (0..40).map(|k| k % 13 == 7).collect(),
            lambda_n_per_m: lambda,
            constants: vec![
                Constant {
                    name: "linear",
                    lambda_n_per_m: 1.3,
                },
                Constant {
                    name: "saturation",
                    lambda_n_per_m: 7.7,
                },
            ],
            chosen: Some(ChosenForces {
                lambda_n_per_m: 1.9,
                requested_n: (0..points).map(|k| 0.1 + 1e-4 * k as f64).collect(),
                static_n: errors.iter().map(|e| 0.1 + 0.01 * e).collect(),
                feedback_n: Vec::new(),
                map: ErrorMap::Grid {
                    x_mm: [-50.0, 50.0],
                    y_mm: [-30.0, 70.0],
                    cells: Cells {
                        columns: 7,
                        values: errors.into_iter().map(Some).collect(),
                        together: Together::Largest,
                    },
                },
            }),
        }
    }

    #[test]
    fn panels_say_what_they_show_and_are_the_same_twice() {
        let svg = drawing(49).drawing().svg();
        for words in [
            "chosen 1.9000 N/m",
            "linear 1.3000 N/m",
            "saturation 7.7000 N/m (not shown)",
            "relative to the rms force / %",
            "given - lambda h / mN",
            "coil 1",
        ] {
            assert!(svg.contains(words), "{words}");
        }
        assert!(!svg.contains("with feedback") && !svg.contains("NaN"));
        assert!(
            svg == drawing(49).drawing().svg(),
            "not the same bytes twice"
        );
    }

    #[test]
    fn of_many_coils_the_quartiles_are_drawn() {
        let mut many = drawing(49);
        let coils = 4 * DRAWN + 1;
        let falling = |lambda: f64| (0..coils).rev().map(move |k| lambda * k as f64);
        many.currents_a = (0..40).map(|k| falling(f64::from(k)).collect()).collect();
        let ends = many.quartiles_a()[1].clone();
        assert_eq!(ends, [0.0, 36.0, 72.0, 108.0, 144.0]);
        assert!(many.drawing().svg().contains("least, quartiles, largest"));
    }

    #[test]
    fn one_point_and_none_are_drawn() {
        for points in [0, 1] {
            let mut drawn = drawing(points);
            assert!(
                drawn.drawing().svg().ends_with("</svg>") && !drawn.drawing().svg().contains("NaN")
            );
            if let Some(chosen) = &mut drawn.chosen {
                chosen.map = ErrorMap::Scattered {
                    points_mm: vec![(0.7, 1.3); points],
                    errors_mn: vec![-0.3; points],
                };
            }
            assert!(
                !drawn.drawing().svg().contains("NaN") && !drawn.drawing().svg().contains("inf")
            );
            drawn.chosen = None;
            assert!(drawn.drawing().svg().contains("no lambda is chosen"));
        }
    }
}
