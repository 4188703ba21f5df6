//! Aligned text for summaries.

use std::fmt::Write;

use super::terminal::{columns, wrapped};

/// Width of the labels of a summary.
const LABEL: usize = 12;

/// A summary under construction: a title, labelled lines, tables.
#[derive(Debug, Default)]
pub struct Sheet {
    text: String,
    /// Columns of the screen; `None` where lines are as long as they are.
    columns: Option<usize>,
}

/// Which side the cells of a column keep to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
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
            columns: columns(),
        }
    }

    /// Adds `label   text`; further lines of `text` are indented below.
    pub fn line(&mut self, label: &str, text: &str) {
        let lines = match self.columns {
            Some(columns) => wrapped(text, columns - LABEL - 2),
            None => text.lines().map(str::to_owned).collect(),
        };
        for (i, part) in lines.iter().enumerate() {
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

/// The narrowest column in which words are wrapped.
const WRAPPED_MIN: usize = 20;

/// Rows with aligned columns, two blanks between them, indented by two. The decimal points of a column
/// of numbers are in line. What is wider than the terminal is wrapped in its last column where that
/// holds words, and else continued below, with the first column again. `sides` has a letter per column, `l` for
/// text that keeps to the left, `r` for numbers.
#[must_use]
pub fn table(sides: &str, rows: &[Vec<String>]) -> String {
    table_within(&of_letters(sides), rows, columns().unwrap_or(usize::MAX))
}

fn of_letters(sides: &str) -> Vec<Side> {
    let side = |letter| match letter {
        'l' => Side::Left,
        _ => Side::Right,
    };
    sides.chars().map(side).collect()
}

fn table_within(sides: &[Side], rows: &[Vec<String>], columns: usize) -> String {
    let mut rows: Vec<Vec<String>> = rows.to_vec();
    for (column, side) in sides.iter().enumerate() {
        if *side == Side::Right {
            align_points(&mut rows, column);
        }
    }
    let widths: Vec<usize> = (0..sides.len())
        .map(|column| width(&rows, column))
        .collect();
    let of = |shown: &[usize]| {
        shown
            .iter()
            .map(|column| widths[*column] + 2)
            .sum::<usize>()
    };
    let all: Vec<usize> = (0..sides.len()).collect();
    let Some((last, before)) = all.split_last().filter(|_| of(&all) > columns) else {
        return lines(sides, &rows, &widths, &all);
    };
    let left = columns.saturating_sub(of(before) + 2);
    if sides[*last] == Side::Left && left >= WRAPPED_MIN {
        return lines(sides, &wrap_last(&rows, *last, left), &widths, &all);
    }
    let mut text = String::new();
    let mut shown = vec![0];
    for column in 1..sides.len() {
        if shown.len() > 1 && of(&shown) + widths[column] + 2 > columns {
            text.push_str(&lines(sides, &rows, &widths, &shown));
            text.push('\n');
            shown.truncate(1);
        }
        shown.push(column);
    }
    text + &lines(sides, &rows, &widths, &shown)
}

fn width(rows: &[Vec<String>], column: usize) -> usize {
    let cells = rows.iter().filter_map(|row| row.get(column));
    cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
}

/// Blanks behind the numbers of a column, so that their decimal points are in line.
fn align_points(rows: &mut [Vec<String>], column: usize) {
    /// Characters from the decimal point on; `None` of what is not a number.
    fn tail(cell: &str) -> Option<usize> {
        let digits = cell.trim_start_matches(['-', '+']);
        let whole = digits
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(digits.len());
        (whole > 0).then(|| digits[whole..].chars().count())
    }
    let cells = rows.iter().filter_map(|row| row.get(column));
    let longest = cells.filter_map(|cell| tail(cell)).max().unwrap_or(0);
    for cell in rows.iter_mut().filter_map(|row| row.get_mut(column)) {
        if let Some(tail) = tail(cell) {
            cell.push_str(&" ".repeat(longest - tail));
        }
    }
}

/// Rows of which the words in column `last` take at most `left` characters a line.
fn wrap_last(rows: &[Vec<String>], last: usize, left: usize) -> Vec<Vec<String>> {
    let mut all = Vec::new();
    for row in rows {
        for (i, line) in wrapped(row.get(last).map_or("", String::as_str), left)
            .into_iter()
            .enumerate()
        {
            let cell = |cell: &String| if i == 0 { cell.clone() } else { String::new() };
            let mut cells: Vec<String> = row.iter().take(last).map(cell).collect();
            cells.push(line);
            all.push(cells);
        }
    }
    all
}

/// The columns `shown` of `rows`, a line a row.
fn lines(sides: &[Side], rows: &[Vec<String>], widths: &[usize], shown: &[usize]) -> String {
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for &column in shown {
            let Some(cell) = row.get(column) else {
                continue;
            };
            let width = widths[column];
            let _ = match sides[column] {
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
    let numbers = lines.first().map_or(0, Vec::len).saturating_sub(1);
    table(&format!("l{}", "r".repeat(numbers)), &lines)
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
        let text = table("lrl", &rows);
        assert_eq!(text, "  name    value\n  length  13 mm  met\n");
    }

    #[test]
    fn decimal_points_are_in_line() {
        let cells = ["length", "13.25 mm", "2 mm", "-101.5 mm", "none"];
        let rows: Vec<Vec<String>> = cells.map(|cell| vec![cell.to_owned()]).to_vec();
        let expected = "      length\n    13.25 mm\n     2 mm\n  -101.5 mm\n        none\n";
        assert_eq!(table("r", &rows), expected);
    }

    #[test]
    fn a_table_that_is_wider_than_the_terminal_breaks_between_words_and_columns() {
        let row = |cells: [&str; 3]| cells.map(str::to_owned).to_vec();
        let rows = [
            row(["key", "default", "meaning"]),
            row([
                "length_mm",
                "13",
                "the length of the winding along its axis",
            ]),
        ];
        let words = table_within(&of_letters("lrl"), &rows, 46);
        let below = " ".repeat(22);
        let expected = format!(
            "  key        default  meaning\n  length_mm       13  the length of the\n{below}winding along its axis\n"
        );
        assert_eq!(words, expected);
        let numbers = table_within(&of_letters("lrr"), &rows, 40);
        assert!(numbers.lines().all(|line| line.len() <= 56), "{numbers}");
        assert_eq!(numbers.matches("length_mm").count(), 2, "{numbers}");
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
