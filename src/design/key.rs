//! A key of a document: what it may hold, what holds without it, what it means.

use std::cell::RefCell;

/// A key of a document.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Its section; empty at the top level.
    pub section: String,
    /// Its name, the unit of a number last.
    pub name: &'static str,
    /// Accepted values, in words.
    pub value: String,
    /// The range of its numbers in words; empty where any will do.
    pub range: String,
    /// Default.
    pub default: Without,
    /// Meaning.
    pub meaning: &'static str,
}

/// Value of a key that is not given.
#[derive(Debug, Clone, PartialEq)]
pub enum Without {
    /// The document is refused.
    Refused,
    /// This value.
    Value(String),
    /// Described in the meaning, or none.
    Nothing,
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
