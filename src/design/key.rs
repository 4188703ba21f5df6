//! A key of a document: what it may hold, what holds without it, what it means.

use std::cell::RefCell;

/// A key of a document.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Its section; empty at the top level.
    pub section: String,
    /// Its name, the unit of a number last.
    pub name: &'static str,
    /// The values that may be written.
    pub accepts: Accepts,
    /// Default.
    pub default: Without,
    /// Meaning.
    pub meaning: &'static str,
}

/// The values that a key may hold.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Accepts {
    /// Their kind in words.
    pub kind: String,
    /// The unit of numbers; empty where they have none.
    pub unit: &'static str,
    /// Whether a wire gauge is accepted for a number.
    pub gauges: bool,
    /// The range of numbers in words; empty where any is accepted.
    pub range: String,
}

impl Accepts {
    /// Values of this kind, of any range and without a unit.
    pub(super) fn any(kind: impl Into<String>) -> Self {
        Self {
            kind: kind.into(),
            ..Self::default()
        }
    }

    /// Kind and unit in words: `number, mm`.
    #[must_use]
    pub fn words(&self) -> String {
        let unit = match self.unit {
            "" => String::new(),
            unit => format!(", {unit}"),
        };
        let gauge = if self.gauges { ", or a gauge" } else { "" };
        format!("{}{unit}{gauge}", self.kind)
    }
}

/// Value of a key that is not given.
#[derive(Debug, Clone, PartialEq)]
pub enum Without {
    /// The document is refused.
    Refused,
    /// This value, as TOML.
    Value(String),
    /// Described in the meaning, or none.
    Nothing,
}

/// A key that decides a number, was not written, and so has its default.
#[derive(Debug, Clone, PartialEq)]
pub struct Assumed {
    /// Its dotted path; a section alone where that as a whole is not given.
    pub key: String,
    /// The value, as TOML.
    pub value: String,
}

impl Assumed {
    /// The value by its type.
    #[must_use]
    pub fn typed(&self) -> Option<toml::Value> {
        typed(&self.value)
    }
}

impl Without {
    /// The default by its type; `None` where there is none.
    #[must_use]
    pub fn typed(&self) -> Option<toml::Value> {
        match self {
            Self::Value(text) => typed(text),
            Self::Refused | Self::Nothing => None,
        }
    }
}

fn typed(text: &str) -> Option<toml::Value> {
    let mut table: toml::Table = format!("value = {text}").parse().ok()?;
    table.remove("value")
}

impl Key {
    /// The dotted path: section and name.
    #[must_use]
    pub fn path(&self) -> String {
        if self.section.is_empty() {
            self.name.to_owned()
        } else {
            format!("{}.{}", self.section, self.name)
        }
    }

    /// Accepted values, range and meaning on one line without marks.
    #[must_use]
    pub fn remark(&self) -> String {
        let range = match self.accepts.range.as_str() {
            "" => String::new(),
            range => format!(" {range}"),
        };
        let text = format!("{}{range}: {}", self.accepts.words(), self.meaning);
        text.replace('`', "")
    }
}

/// Keys in the order in which a reader asks for them, each once.
#[derive(Debug, Default)]
pub(super) struct Keys(RefCell<Vec<Key>>);

impl Keys {
    /// Adds a key, or completes the one of the same path: of several requests for one the first
    /// knows most, as it is the one of the outer reader.
    pub(super) fn add(&self, key: Key) {
        let mut keys = self.0.borrow_mut();
        if !keys.iter().any(|known| known.path() == key.path()) {
            keys.push(key);
        }
    }

    pub(super) fn into_inner(self) -> Vec<Key> {
        self.0.into_inner()
    }
}

/// Gives every key its meaning.
///
/// # Panics
/// If a key has none, or a meaning no key: then the table must be mended.
#[must_use]
pub fn with_meanings(mut keys: Vec<Key>, meanings: &[(&str, &'static str)]) -> Vec<Key> {
    for key in &mut keys {
        let path = key.path();
        let known = meanings.iter().find(|(name, _)| *name == path);
        key.meaning = known.unwrap_or_else(|| panic!("{path} has no meaning")).1;
    }
    for (name, _) in meanings {
        let read = keys.iter().any(|key| key.path() == *name);
        assert!(read, "{name} has a meaning, but no reader asks for it");
    }
    keys
}
