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
        let heading = |head: &str| match name {
            "" => String::new(),
            _ => format!("\n{head}\n"),
        };
        let (head, tables) = tables(values, name);
        if tables.is_empty() {
            text += &heading(&format!("# [{name}]"));
            text += &entries(section, None);
        }
        for table in tables {
            text += &heading(&head);
            text += &entries(section, Some(table));
        }
    }
    text
}

/// The tables of the section `name`, several where it is an array of them, and the line above each.
fn tables<'a>(values: &'a Table, name: &str) -> (String, Vec<&'a Table>) {
    let mut here = values;
    let mut path = name;
    while let Some((outer, rest)) = path.split_once('.') {
        match here.get(outer).and_then(Value::as_table) {
            Some(inner) => (here, path) = (inner, rest),
            None => return (String::new(), Vec::new()),
        }
    }
    let head = format!("[{name}]");
    match here.get(path) {
        _ if name.is_empty() => (head, vec![values]),
        Some(Value::Array(several)) => {
            let several = several.iter().filter_map(Value::as_table);
            (format!("[{head}]"), several.collect())
        }
        one => (head, one.and_then(Value::as_table).into_iter().collect()),
    }
}

/// A line for each of `keys`, with its value in `table` where that sets it.
fn entries(keys: &[Key], table: Option<&Table>) -> String {
    let mut text = String::new();
    for key in keys {
        let line = entry(key, table.and_then(|table| table.get(key.name)));
        // Writing to a string does not fail.
        let _ = writeln!(text, "{line:COMMENT$}# {}", key.remark());
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

    /// Of several `[[iron]]` and of a section in a section nothing was written.
    #[test]
    fn regression_a_table_of_several_and_one_in_another_were_left_out() {
        let values: Table = "name = 'a'\n[[iron]]\nshape = 'ball'\ndiameter_mm = 1.3\n[[iron]]\n\
                             shape = 'box'\nsize_mm = [0.7, 1.3, 1.9]\n[search.coil]\n\
                             length_mm = [7.0, 13.0]\n[search.array]\nrows = [2, 3]\n"
            .parse()
            .unwrap();
        let text = commented("A design.", &of_designs(), &values);
        let read: Table = text
            .parse()
            .unwrap_or_else(|fault| panic!("{fault}: {text}"));
        assert_eq!(read, values, "{text}");
    }

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
