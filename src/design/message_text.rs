//! How messages show numbers, the user's own text, names that are near and axes.

use std::borrow::Cow;
use std::path::Path;

use fluxform_numerics::axis::Axis;

/// Least similarity (Damerau-Levenshtein, normalised) at which a name is called near.
const NEAR: f64 = 0.6;

/// Longest piece of the user's text that a message repeats, characters.
pub(crate) const QUOTED_MAX: usize = 60;

/// Longest piece of a file that another document names and that is no table, characters: enough to
/// recognise a misspelt header, too little to publish a file that was named by mistake or malice.
const TOKEN_MAX: usize = 20;

/// `value` rounded to 12 significant digits, to hide the last bits of a product.
#[must_use]
pub fn twelve_digits(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// `value` as a person writes it: an exponent only where plain digits are unreadable.
#[must_use]
pub fn number(value: f64) -> String {
    if value == 0.0 || (1e-4..1e9).contains(&value.abs()) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

/// `value` with its unit.
#[must_use]
pub fn quantity(value: f64, unit: &str) -> String {
    let digits = number(value);
    if unit.is_empty() {
        digits
    } else {
        format!("{digits} {unit}")
    }
}

/// The user's text, escaped, cut and in quotes.
#[must_use]
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", escaped(text, QUOTED_MAX))
}

/// The first word of a text in a file that a document names, escaped, cut and in quotes.
#[must_use]
pub fn token(text: &str) -> String {
    let word = text.split_whitespace().next().unwrap_or("");
    format!("\"{}\"", escaped(word, TOKEN_MAX))
}

/// The user's text on one line without characters that command a screen, cut after `most` characters.
#[must_use]
pub fn escaped(text: &str, most: usize) -> String {
    let mut shown = String::new();
    for (i, c) in text.chars().enumerate() {
        if i == most {
            return shown + "...";
        }
        push_shown(&mut shown, c, commands(c) || matches!(c, '\n' | '\t'));
    }
    shown
}

/// A file's name as a message shows it: on one line, without characters that command a screen.
#[must_use]
pub fn shown_path(path: &Path) -> String {
    escaped(&path.to_string_lossy(), usize::MAX)
}

/// A message of any number of lines in which every character that commands a screen is escaped:
/// what a file contains or is called must not command the terminal.
#[must_use]
pub fn visible(text: &str) -> Cow<'_, str> {
    if !text.contains(commands) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        push_shown(&mut shown, c, commands(c));
    }
    Cow::Owned(shown)
}

/// Whether a screen obeys the character instead of showing it: control characters but line feed and
/// tab, separators of lines and paragraphs, and marks that reorder the text around them.
#[must_use]
pub fn commands(c: char) -> bool {
    const REORDERING: [std::ops::RangeInclusive<char>; 4] = [
        '\u{200e}'..='\u{200f}',
        '\u{2028}'..='\u{202e}',
        '\u{2066}'..='\u{2069}',
        '\u{61c}'..='\u{61c}',
    ];
    (c.is_control() && c != '\n' && c != '\t') || REORDERING.iter().any(|marks| marks.contains(&c))
}

fn push_shown(shown: &mut String, c: char, escape: bool) {
    match (escape, c) {
        (false, _) => shown.push(c),
        (true, '\n' | '\t' | '\r') => shown.extend(c.escape_default()),
        (true, _) => shown.extend(c.escape_unicode()),
    }
}

/// The name among `names` that `text` was probably meant to be.
#[must_use]
pub fn nearest<'n>(text: &str, names: &[&'n str]) -> Option<&'n str> {
    if text.len() > 2 * QUOTED_MAX {
        return None;
    }
    let likeness = |name: &str| strsim::normalized_damerau_levenshtein(&text.to_lowercase(), name);
    let scored = names.iter().map(|name| (likeness(name), *name));
    let best = scored.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 >= NEAR).then_some(best.1)
}

/// The fault of an axis and the advice; `None` where it is sound.
#[must_use]
pub fn axis_fault(axis: &Axis, unit: &str) -> Option<(String, &'static str)> {
    let Axis { from, to, samples } = *axis;
    let ends = format!("from {} to {} {unit}", number(from), number(to));
    match samples {
        0 => Some((
            "expected at least 1 sample, found 0".to_owned(),
            "61 samples is usual",
        )),
        1 if from == to => None,
        1 => Some((
            format!("1 sample cannot include both ends, {ends}"),
            "make both ends equal, or ask for 2 samples or more",
        )),
        _ if from < to => None,
        _ if from == to => Some((
            format!("{samples} samples need two different ends, found {ends}"),
            "ask for 1 sample",
        )),
        _ => Some((
            format!("the axis runs backwards, {ends}"),
            "write the lower end first",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_as_a_person_writes_them() {
        assert_eq!(number(38.0), "38");
        assert_eq!(number(-0.7), "-0.7");
        assert_eq!(number(1.68e-8), "1.68e-8");
        assert_eq!(number(1.1579e6), "1157900");
        assert_eq!(number(twelve_digits(0.07 * 1000.0)), "70");
        assert_eq!(quantity(0.038, "mm"), "0.038 mm");
    }

    #[test]
    fn a_name_is_near_or_it_is_not() {
        let names = [
            "inner_diameter_mm",
            "outer_diameter_mm",
            "length_mm",
            "turns",
        ];
        assert_eq!(
            nearest("outer_diametre_mm", &names),
            Some("outer_diameter_mm")
        );
        assert_eq!(nearest("Turn", &names), Some("turns"));
        assert_eq!(nearest("colour", &names), None);
        assert_eq!(nearest(&"turns".repeat(1000), &names), None);
    }

    #[test]
    fn what_a_file_says_does_not_command_the_terminal() {
        assert_eq!(
            visible("a\u{1b}[31mb\r\n\tc\u{7}\u{9b}1m"),
            "a\\u{1b}[31mb\\r\n\tc\\u{7}\\u{9b}1m"
        );
        assert_eq!(visible("ohm \u{3a9}"), "ohm \u{3a9}");
        // A name that shows its ending reversed.
        assert_eq!(visible("a\u{202e}vsc"), "a\\u{202e}vsc");
        assert_eq!(shown_path(Path::new("a\nb\u{1b}c")), "a\\nb\\u{1b}c");
    }

    #[test]
    fn of_a_file_named_in_a_document_one_short_word_is_shown() {
        assert_eq!(token(" B  H"), "\"B\"");
        assert_eq!(
            token("SECRET=0123456789abcdef"),
            "\"SECRET=0123456789abc...\""
        );
        assert_eq!(token("\u{1b}]0;"), "\"\\u{1b}]0;\"");
    }

    #[test]
    fn quotations_are_short_and_tame() {
        assert_eq!(quoted("a\u{1b}[31m"), "\"a\\u{1b}[31m\"");
        assert_eq!(
            quoted(&"x".repeat(61)),
            format!("\"{}...\"", "x".repeat(60))
        );
    }
}
