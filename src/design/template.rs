//! A design's text with some of its keys set to other values.

use std::path::Path;

use toml::{Table, Value};

use super::diagnostics::{Fault, InvalidDocument};

/// Parts of a dotted key.
const PARTS_MAX: usize = 8;

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
    /// # Errors
    /// A key that leads through something that is no section; the message names it.
    pub fn with<'a>(
        &self,
        settings: impl IntoIterator<Item = (&'a str, Value)>,
    ) -> Result<String, String> {
        let mut table = self.table.clone();
        for (key, value) in settings {
            // No key of a design has so many; a table as deep as a key is long would not be written.
            if key.split('.').nth(PARTS_MAX).is_some() {
                let shown: String = key.chars().take(40).collect();
                return Err(format!(
                    "{shown}...: the key has more than {PARTS_MAX} parts; name a section and a key \
                     in it, as in wire.diameter_mm"
                ));
            }
            let mut here = &mut table;
            let mut path = key;
            while let Some((section, rest)) = path.split_once('.') {
                here = here
                    .entry(section)
                    .or_insert_with(|| Value::Table(Table::new()))
                    .as_table_mut()
                    .ok_or_else(|| format!("{key}: {section} is not a section of the design"))?;
                path = rest;
            }
            here.insert(path.to_owned(), value);
        }
        Ok(table.to_string())
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
