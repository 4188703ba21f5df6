//! Aligned text for summaries.

use std::fmt::Write;

/// Width of the labels of a summary.
const LABEL: usize = 12;

/// A summary under construction: a title, labelled lines, tables.
#[derive(Debug, Default)]
pub struct Sheet {
    text: String,
}

/// Which side the cells of a column keep to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Words.
    Left,
    /// Numbers.
    Right,
}

impl Sheet {
    /// A summary with this title.
    #[must_use]
    pub fn new(title: &str) -> Self {
        Self {
            text: format!("{title}\n"),
        }
    }

    /// Adds `label   text`; further lines of `text` are indented below.
    pub fn line(&mut self, label: &str, text: &str) {
        for (i, part) in text.lines().enumerate() {
            let label = if i == 0 { label } else { "" };
            // Writing to a string does not fail.
            let _ = writeln!(self.text, "  {label:LABEL$}{part}");
        }
    }

    /// Adds an empty line.
    pub fn gap(&mut self) {
        self.text.push('\n');
    }

    /// Adds text unchanged.
    pub fn raw(&mut self, text: &str) {
        self.text.push_str(text);
    }

    /// The summary's text.
    #[must_use]
    pub fn finish(self) -> String {
        self.text
    }
}

/// Rows with aligned columns, two blanks between them, indented by two; one line a row.
#[must_use]
pub fn table(sides: &[Side], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..sides.len()).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for ((cell, side), width) in row.iter().zip(sides).zip(&widths) {
            let width = *width;
            let _ = match side {
                Side::Left => write!(line, "  {cell:width$}"),
                Side::Right => write!(line, "  {cell:>width$}"),
            };
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

/// Rows of named cells under their names; the first column keeps to the left, the others to the
/// right. Every row names the same columns.
#[must_use]
pub fn headed_table<'a>(rows: impl IntoIterator<Item = Vec<(&'a str, String)>>) -> String {
    let mut lines: Vec<Vec<String>> = Vec::new();
    for row in rows {
        if lines.is_empty() {
            lines.push(row.iter().map(|(name, _)| (*name).to_owned()).collect());
        }
        lines.push(row.into_iter().map(|(_, cell)| cell).collect());
    }
    let mut sides = vec![Side::Right; lines.first().map_or(0, Vec::len)];
    sides.iter_mut().take(1).for_each(|side| *side = Side::Left);
    table(&sides, &lines)
}

/// `values` as a grid of `columns`, numbers right-aligned, without indentation.
#[must_use]
pub fn grid(values: &[String], columns: usize) -> String {
    let width = values.iter().map(|v| v.chars().count()).max().unwrap_or(0);
    let mut text = String::new();
    for row in values.chunks(columns.max(1)) {
        let cells: Vec<String> = row.iter().map(|cell| format!("{cell:>width$}")).collect();
        text.push_str(&cells.join("  "));
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned_and_lines_end_without_blanks() {
        let rows = vec![
            vec!["name".to_owned(), "value".to_owned(), String::new()],
            vec!["length".to_owned(), "13 mm".to_owned(), "met".to_owned()],
        ];
        let text = table(&[Side::Left, Side::Right, Side::Left], &rows);
        assert_eq!(text, "  name    value\n  length  13 mm  met\n");
    }

    #[test]
    fn further_lines_stand_below_the_first() {
        let mut sheet = Sheet::new("title");
        sheet.line(
            "currents",
            &grid(&["0.7".into(), "13".into(), "2".into()], 2),
        );
        assert_eq!(
            sheet.finish(),
            "title\n  currents    0.7   13\n                2\n"
        );
    }
}
