//! A matrix of pairs, as coloured squares with numbers.

use std::sync::Arc;

use kuva::plot::{ColorMap, Heatmap};
use kuva::render::figure::Figure;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use kuva::render::render::Primitive;

use super::drawing::Drawing;

/// A panel's size, px.
const PANEL_PX: [f64; 2] = [460.0, 400.0];
/// Height of a panel's title, px.
const TITLE_PX: u32 = 14;

/// Characters of a name; longer ones take the squares' room.
const NAME_MAX: usize = 20;

/// Where there is no value.
const NOTHING: &str = "#b5b5b5";
/// Red, green and blue of the largest value.
const MOST: [f64; 3] = [230.0, 120.0, 20.0];

/// One matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// The quantity shown.
    pub title: String,
    /// Row by row, as many rows and columns as names; `None` where there is none.
    pub values: Vec<Option<f64>>,
}

/// Matrices of the same things beside and below each other.
#[derive(Debug, Clone, PartialEq)]
pub struct MatrixPlot {
    /// Above all panels.
    pub title: String,
    /// Names of the rows, which are those of the columns.
    pub names: Vec<String>,
    /// Panels beside each other.
    pub columns: usize,
    /// From left to right, then downwards.
    pub panels: Vec<Panel>,
}

impl MatrixPlot {
    /// The drawing.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        let (plots, layouts) = self.panels.iter().map(|panel| self.panel(panel)).unzip();
        let columns = self.columns.max(1);
        let rows = self.panels.len().div_ceil(columns).max(1);
        let figure = Figure::new(rows, columns)
            .with_title(self.title.clone())
            .with_cell_size(PANEL_PX[0], PANEL_PX[1])
            .with_plots(plots)
            .with_layouts(layouts);
        let mut scene = figure.render();
        for element in &mut scene.elements {
            // A square without a value has no number.
            if let Primitive::Text { content, .. } = element
                && content == "NaN"
            {
                "-".clone_into(content);
            }
        }
        Drawing::new(scene)
    }

    fn panel(&self, panel: &Panel) -> (Vec<Plot>, Layout) {
        let count = self.names.len();
        let rows: Vec<Vec<f64>> = panel
            .values
            .chunks(count.max(1))
            .map(|row| row.iter().map(|v| rounded(v.unwrap_or(f64::NAN))).collect())
            .collect();
        let plots = vec![Plot::Heatmap(
            Heatmap::new()
                .with_data(rows)
                .with_color_map(colours())
                .with_values(),
        )];
        let names: Vec<String> = self.names.iter().map(|name| fitting(name)).collect();
        let layout = Layout::auto_from_plots(&plots)
            .with_title(panel.title.clone())
            .with_title_size(TITLE_PX)
            .with_x_categories(names.clone())
            .with_x_tick_rotate(-30.0)
            .with_y_categories(names);
        (plots, layout)
    }
}

/// A name as long as there is room for: its beginning and its end.
fn fitting(name: &str) -> String {
    let characters: Vec<char> = name.chars().collect();
    if characters.len() <= NAME_MAX {
        return name.to_owned();
    }
    let [begin, end] = [NAME_MAX / 2, (NAME_MAX - 1) / 2];
    let parts = [
        &characters[..begin],
        &['\u{2026}'],
        &characters[characters.len() - end..],
    ];
    parts.concat().into_iter().collect()
}

/// From white to orange, on which black numbers are read; grey where there is nothing.
fn colours() -> ColorMap {
    ColorMap::Custom(Arc::new(|value: f64| {
        if value.is_nan() {
            return NOTHING.to_owned();
        }
        let share = value.clamp(0.0, 1.0);
        let mixed = MOST.map(|most| (255.0 + share * (most - 255.0)).round() as u8);
        format!("#{:02x}{:02x}{:02x}", mixed[0], mixed[1], mixed[2])
    }))
}

/// Two decimals: what fits into a square.
fn rounded(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_names_its_rows_and_shows_its_numbers() {
        let drawing = MatrixPlot {
            title: "apart".to_owned(),
            // A name of 83 characters left no room for any square.
            names: vec!["dome".to_owned(), format!("wedge {} steep", "x".repeat(72))],
            columns: 2,
            panels: vec![Panel {
                title: "largest".to_owned(),
                values: vec![Some(0.0), Some(1.732), Some(1.732), None],
            }],
        };
        let svg = drawing.drawing().svg();
        for text in [
            "dome",
            "wedge xxxx\u{2026}xxx steep",
            "1.73",
            "largest",
            "apart",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg == drawing.drawing().svg());
        assert!(!svg.contains("NaN"));
    }
}
