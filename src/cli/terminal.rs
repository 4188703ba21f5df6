//! How wide the terminal is, and text that is wrapped to fit it.

use terminal_size::{Width, terminal_size};

/// Columns that a screen has at least, and at most for lines that a person reads.
const COLUMNS: std::ops::RangeInclusive<usize> = 40..=160;

/// Columns of the terminal; those of the variable `COLUMNS` where it is set. `None` where no stream is
/// a terminal: what goes into a file is not wrapped.
#[must_use]
pub fn columns() -> Option<usize> {
    let variable = std::env::var("COLUMNS").ok().and_then(|c| c.parse().ok());
    let columns = variable.or_else(|| terminal_size().map(|(Width(columns), _)| columns.into()));
    columns.map(|columns: usize| columns.clamp(*COLUMNS.start(), *COLUMNS.end()))
}

/// `text` in lines of at most `columns` characters, broken at blanks; a word that is longer has a
/// line of its own.
#[must_use]
pub fn wrapped(text: &str, columns: usize) -> Vec<String> {
    let mut lines = Vec::new();
    for paragraph in text.lines() {
        let mut rest = paragraph;
        while rest.chars().count() > columns {
            let fits = rest
                .char_indices()
                .nth(columns)
                .map_or(rest.len(), |(at, _)| at);
            // A blank right behind the last column ends the line too.
            let next = rest[fits..].chars().next().map_or(0, char::len_utf8);
            let inside = rest[..fits + next]
                .rfind(' ')
                .filter(|at| !rest[..*at].trim().is_empty());
            let Some(at) = inside.or_else(|| rest[fits..].find(' ').map(|at| fits + at)) else {
                break;
            };
            lines.push(rest[..at].trim_end().to_owned());
            rest = rest[at..].trim_start();
        }
        lines.push(rest.to_owned());
    }
    if lines.is_empty() {
        lines.push(String::new());
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::wrapped;

    #[test]
    fn lines_break_between_words() {
        assert_eq!(wrapped("a bore of 13 mm", 9), ["a bore of", "13 mm"]);
        assert_eq!(wrapped("unbreakable 7", 5), ["unbreakable", "7"]);
        assert_eq!(wrapped("short\n  one", 9), ["short", "  one"]);
        assert_eq!(wrapped("", 9), [""]);
        assert_eq!(
            wrapped("\u{e9}\u{e9} \u{e9}\u{e9}", 3),
            ["\u{e9}\u{e9}", "\u{e9}\u{e9}"]
        );
    }
}
