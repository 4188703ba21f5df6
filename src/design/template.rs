//! A design's text with some of its keys set to other values.

use std::path::Path;

use toml::{Table, Value};

use super::diagnostics::{Fault, InvalidDocument};

/// Parts of a dotted key.
const PARTS_MAX: usize = 8;
/// Sections that a design may have several of.
const SEVERAL: [&str; 1] = ["iron"];

/// A design document whose keys can be set again, one variant after the other.
#[derive(Debug, Clone)]
pub struct Template {
    table: Table,
}

impl Template {
    /// The template that `text` is; `path` names it in messages.
    ///
    /// # Errors
    /// A text that is not TOML.
    pub fn new(text: &str, path: &Path) -> Result<Self, InvalidDocument> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let table = text.parse().map_err(|error: toml::de::Error| {
            let message = format!("not valid TOML: {}", error.message().trim());
            InvalidDocument::unreadable(path, Fault::error("", message))
        })?;
        Ok(Self { table })
    }

    /// The document as a table.
    #[must_use]
    pub fn into_table(self) -> Table {
        self.table
    }

    /// The value of a dotted key.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&Value> {
        let mut parts = key.split('.');
        let first = self.table.get(parts.next()?)?;
        parts.try_fold(first, |value, part| value.get(part))
    }

    /// Takes a dotted key out, where it is there.
    pub fn remove(&mut self, key: &str) {
        let mut here = &mut self.table;
        let mut path = key;
        while let Some((section, rest)) = path.split_once('.') {
            let Some(Value::Table(inner)) = here.get_mut(section) else {
                return;
            };
            here = inner;
            path = rest;
        }
        here.remove(path);
    }

    /// The document's text with `settings`: dotted keys and their values. Sections that a key
    /// names and the document lacks are added. Comments and order are not kept.
    ///
    /// Of a table that may be there several times, as `[[iron]]`, the key names one by its index from 0,
    /// `iron.0.size_mm`; where there is one alone it needs no index.
    ///
    /// # Errors
    /// A key that leads through something that is no section, or to a table that is not there or not
    /// determined; a key that is set twice, or with a part of it; the message names it.
    pub fn with<'a>(
        &self,
        settings: impl IntoIterator<Item = (&'a str, Value)>,
    ) -> Result<String, String> {
        let mut changed = self.clone();
        let mut places: Vec<(&str, String)> = Vec::new();
        for (key, value) in settings {
            let place = changed.place(key)?;
            let other = places
                .iter()
                .find(|(_, other)| is_within(&place, other) || is_within(other, &place));
            if let Some((other, _)) = other {
                return Err(set_twice(other, key));
            }
            set(&mut changed.table, key, value)?;
            places.push((key, place));
        }
        Ok(changed.table.to_string())
    }

    /// The one spelling of a key of this document: with the index of a table that is one of several,
    /// without it where the document holds no array of tables there.
    ///
    /// # Errors
    /// As [`Template::with`].
    pub fn place(&self, key: &str) -> Result<String, String> {
        check_parts(key)?;
        let mut here = Some(&self.table);
        let mut path = key;
        let mut place = String::new();
        while let Some((section, rest)) = path.split_once('.') {
            place = place + section + ".";
            let value = here.and_then(|table| table.get(section));
            let (index, rest) = step(key, section, value, rest)?;
            here = match (value, index) {
                (Some(Value::Array(tables)), Some(index)) => {
                    place = format!("{place}{index}.");
                    tables[index].as_table()
                }
                (value, _) => value.and_then(Value::as_table),
            };
            path = rest;
        }
        Ok(place + path)
    }
}

/// Whether `key` is `other` or a part of it.
#[must_use]
pub fn is_within(key: &str, other: &str) -> bool {
    let rest = key.strip_prefix(other);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

fn set_twice(first: &str, second: &str) -> String {
    if first == second {
        format!("{first} is set twice: give it one value")
    } else {
        format!("{first} and {second} set the same key: give all of it in one of them")
    }
}

/// No key of a design has so many parts; a table as deep as a key is long would not be written.
fn check_parts(key: &str) -> Result<(), String> {
    if key.split('.').nth(PARTS_MAX).is_none() {
        return Ok(());
    }
    let shown: String = key.chars().take(40).collect();
    Err(format!(
        "{shown}...: the key has more than {PARTS_MAX} parts; name a section and a key in it, as in \
         wire.diameter_mm"
    ))
}

fn set(table: &mut Table, key: &str, value: Value) -> Result<(), String> {
    check_parts(key)?;
    let mut here = table;
    let mut path = key;
    while let Some((section, rest)) = path.split_once('.') {
        let (index, rest) = step(key, section, here.get(section), rest)?;
        let inner = here
            .entry(section)
            .or_insert_with(|| Value::Table(Table::new()));
        let inner = match (inner, index) {
            (Value::Array(tables), Some(index)) => &mut tables[index],
            (inner, _) => inner,
        };
        here = inner
            .as_table_mut()
            .ok_or_else(|| not_a_section(key, section))?;
        path = rest;
    }
    here.insert(path.to_owned(), value);
    Ok(())
}

fn not_a_section(key: &str, section: &str) -> String {
    format!("{key}: {section} is not a section of the design")
}

/// Of `section`, which is there as `value`, the index of the table that `key` leads to, where it is one of
/// several, and what is left of the key.
fn step<'k>(
    key: &str,
    section: &str,
    value: Option<&Value>,
    rest: &'k str,
) -> Result<(Option<usize>, &'k str), String> {
    let count = match value {
        Some(Value::Array(tables)) if tables.iter().all(Value::is_table) => tables.len(),
        None | Some(Value::Table(_)) if SEVERAL.contains(&section) => 1,
        None | Some(Value::Table(_)) => return Ok((None, rest)),
        Some(_) => return Err(not_a_section(key, section)),
    };
    let (first, after) = rest.split_once('.').unwrap_or((rest, ""));
    let digits = !first.is_empty() && first.bytes().all(|byte| byte.is_ascii_digit());
    match (digits, first.parse()) {
        (true, Ok(index)) if index < count && !after.is_empty() => Ok((Some(index), after)),
        (true, Ok(index)) if index < count => Err(format!(
            "{key} is a whole [[{section}]]: name a key in it, as in {key}.size_mm"
        )),
        (true, _) => Err(format!(
            "{key}: the design has no [[{section}]] {first}, which is counted from 0"
        )),
        (false, _) if count == 1 => Ok((Some(0), rest)),
        (false, _) if count == 0 => Err(format!("{key}: the design has no [[{section}]]")),
        (false, _) => Err(format!(
            "{key}: the design has {count} [[{section}]]: name one by its index, as in {section}.0.{rest} \
             for the first"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn template() -> Template {
        let text = "name = \"a\" # a comment\n[wire]\ndiameter_mm = 0.7\n";
        Template::new(text, Path::new("a.toml")).unwrap()
    }

    #[test]
    fn keys_are_replaced_and_added() {
        let text = template()
            .with([
                ("wire.diameter_mm", Value::Float(0.55)),
                ("array.coupling", Value::String("none".to_owned())),
                ("array.rows", Value::Integer(3)),
            ])
            .unwrap();
        let read: Table = text.parse().unwrap();
        assert_eq!(read["wire"]["diameter_mm"].as_float(), Some(0.55));
        assert_eq!(read["array"]["coupling"].as_str(), Some("none"));
        assert_eq!(read["array"]["rows"].as_integer(), Some(3));
        assert_eq!(read["name"].as_str(), Some("a"));
    }

    #[test]
    fn keys_are_taken_out() {
        let mut template = template();
        template.remove("wire.diameter_mm");
        template.remove("wire.none");
        template.remove("core.none");
        let read: Table = template.with([]).unwrap().parse().unwrap();
        assert!(read["wire"].as_table().unwrap().is_empty());
        assert_eq!(read["name"].as_str(), Some("a"));
    }

    /// No key of `[[iron]]` could be set: "iron is not a section of the design".
    #[test]
    fn regression_a_table_of_several_was_no_section() {
        let body = |size: &str| format!("[[iron]]\nshape = \"box\"\nsize_mm = {size}\n");
        let of = |text: &str| Template::new(text, Path::new("a.toml")).unwrap();
        let sizes = |template: &Template, key: &str| -> Vec<f64> {
            let text = template.with([(key, Value::Float(1.3))]).unwrap();
            let read: Table = text.parse().unwrap();
            let tables = match &read["iron"] {
                Value::Array(tables) => tables.clone(),
                one => vec![one.clone()],
            };
            tables
                .iter()
                .map(|it| it["size_mm"].as_float().unwrap())
                .collect()
        };
        let one = of(&body("0.7"));
        assert_eq!(sizes(&one, "iron.0.size_mm"), [1.3]);
        assert_eq!(sizes(&one, "iron.size_mm"), [1.3]);
        let two = of(&(body("0.7") + &body("1.9")));
        assert_eq!(sizes(&two, "iron.0.size_mm"), [1.3, 1.9]);
        assert_eq!(sizes(&two, "iron.1.size_mm"), [0.7, 1.3]);
        // One that is written as a section, and none.
        for text in [body("0.7").replace("[[iron]]", "[iron]"), String::new()] {
            for key in ["iron.0.size_mm", "iron.size_mm"] {
                assert_eq!(sizes(&of(&text), key), [1.3], "{text}{key}");
                assert_eq!(of(&text).place(key).unwrap(), "iron.size_mm");
            }
        }
        for key in ["iron.0.size_mm", "iron.00.size_mm", "iron.size_mm"] {
            assert_eq!(one.place(key).unwrap(), "iron.0.size_mm");
        }
        assert_eq!(one.place("wire.diameter_mm").unwrap(), "wire.diameter_mm");
        for (key, said) in [
            (
                "iron.size_mm",
                "the design has 2 [[iron]]: name one by its index, as in iron.0.size_mm",
            ),
            (
                "iron.2.size_mm",
                "the design has no [[iron]] 2, which is counted from 0",
            ),
            ("iron.1", "iron.1 is a whole [[iron]]: name a key in it"),
        ] {
            let refused = two.with([(key, Value::Float(1.3))]).unwrap_err();
            assert!(refused.contains(said), "{refused}");
            assert_eq!(two.place(key).unwrap_err(), refused);
        }
    }

    /// The first of two values of a key was lost.
    #[test]
    fn regression_a_key_was_set_twice() {
        let several = || Value::Array(vec![Value::Table(Table::new())]);
        let number = || Value::Float(1.3);
        for (settings, said) in [
            (
                [
                    ("wire.diameter_mm", number()),
                    ("wire.diameter_mm", number()),
                ],
                "wire.diameter_mm is set twice",
            ),
            (
                [
                    ("array.rows", number()),
                    ("array", Value::Table(Table::new())),
                ],
                "array.rows and array set the same key",
            ),
            (
                [("iron", several()), ("iron.size_mm", number())],
                "iron and iron.size_mm set the same key",
            ),
            (
                [("iron.size_mm", number()), ("iron.0.size_mm", number())],
                "iron.size_mm and iron.0.size_mm set the same key",
            ),
        ] {
            let refused = template().with(settings).unwrap_err();
            assert!(refused.contains(said), "{refused}");
        }
        let apart = [("wire.choices_mm", number()), ("wire.choices", number())];
        template().with(apart).unwrap();
    }

    #[test]
    fn a_key_through_a_value_is_refused() {
        let refused = template().with([("wire.diameter_mm.x", Value::Float(1.3))]);
        assert!(
            refused
                .unwrap_err()
                .contains("diameter_mm is not a section")
        );
        let deep = ["a"; 100_000].join(".");
        let refused = template().with([(deep.as_str(), Value::Float(1.3))]);
        assert!(refused.unwrap_err().contains("more than 8 parts"));
        assert!(Template::new("a = ", Path::new("a.toml")).is_err());
    }
}
