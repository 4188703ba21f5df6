//! A document's text with every key that its reader knows: those that are set, and the others as
//! comments with what holds without them.

use std::fmt::Write as _;

use toml::{Table, Value};

use super::key::{Key, Without};

/// Column at which comments begin.
const COMMENT: usize = 44;

/// The text of a document that holds `values`, whose keys are of `keys`; `head` is its first comment.
///
/// Every other key follows in its section behind a `#`, with its default, so that it can be found
/// without a manual. The comments are the keys' meanings.
#[must_use]
pub fn commented(head: &str, keys: &[Key], values: &Table) -> String {
    let mut text: String = head.lines().map(|line| format!("# {line}\n")).collect();
    for section in keys.chunk_by(|a, b| a.section == b.section) {
        let name = section[0].section.as_str();
        let table = match name {
            "" => Some(values),
            name => values.get(name).and_then(Value::as_table),
        };
        if !name.is_empty() {
            let off = if table.is_none() { "# " } else { "" };
            // Writing to a string does not fail.
            let _ = write!(text, "\n{off}[{name}]\n");
        }
        for key in section {
            let line = entry(key, table.and_then(|table| table.get(key.name)));
            let _ = writeln!(text, "{line:COMMENT$}# {}", key.remark());
        }
    }
    text
}

fn entry(key: &Key, value: Option<&Value>) -> String {
    match (value, &key.default) {
        (Some(value), _) => format!("{} = {value}", key.name),
        (None, Without::Value(default)) => format!("# {} = {default}", key.name),
        (None, Without::Refused | Without::Nothing) => format!("# {} =", key.name),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keys::of_designs;

    #[test]
    fn it_holds_the_values_and_every_other_key_as_a_comment() {
        let values: Table = "name = 'a'\n[core]\nabove_mm = 1.3\n[array]\n"
            .parse()
            .unwrap();
        let text = commented("A design.", &of_designs(), &values);
        assert!(text.starts_with("# A design.\nname = \"a\" "), "{text}");
        let read: Table = text.parse().unwrap();
        assert_eq!(read, values);
        // With the marks taken off, defaults are values.
        let whole: String = text
            .lines()
            .map(|line| line.strip_prefix("# ").unwrap_or(line))
            .filter(|line| line.starts_with('[') || line.split(" #").next().unwrap().contains("= "))
            .filter(|line| !line.split(" #").next().unwrap().trim_end().ends_with('='))
            .map(|line| format!("{line}\n"))
            .collect();
        let read: Table = whole
            .parse()
            .unwrap_or_else(|fault| panic!("{fault}: {whole}"));
        assert_eq!(read["magnet"]["polarity"].as_str(), Some("repel"));
        for key in of_designs() {
            assert!(text.contains(&format!("{} =", key.name)), "{}", key.path());
        }
    }
}
