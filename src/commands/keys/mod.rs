//! `keys`: every key of designs and shapes, as their readers know them.

pub(crate) mod command;

use serde::Serialize;
use strum::{EnumMessage, IntoStaticStr, VariantArray};

use crate::design::keys::{Key, Without, of_designs};
use crate::shape::document;

/// A document that has keys.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, IntoStaticStr, VariantArray, Serialize,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Document {
    /// A design file.
    Design,
    /// A shape file.
    Shape,
}

crate::choices!(Document);

impl Document {
    /// Its keys, in the order in which its reader asks for them.
    #[must_use]
    pub fn keys(self) -> Vec<Key> {
        match self {
            Self::Design => of_designs(),
            Self::Shape => document::keys(),
        }
    }
}

/// The result of `keys`.
#[derive(Debug, Clone, Serialize)]
pub struct KeyList {
    /// The keys, design first.
    pub keys: Vec<KeyEntry>,
}

/// A key of a document.
#[derive(Debug, Clone, Serialize)]
pub struct KeyEntry {
    /// The document that it is in.
    pub document: Document,
    /// Its section; empty at the top level.
    pub section: String,
    /// Its name.
    pub key: &'static str,
    /// Accepted values, in words.
    pub value: String,
    /// Unit of its numbers; `None` where they have none.
    pub unit: Option<&'static str>,
    /// Range of its numbers; `None` where any is accepted.
    pub range: Option<String>,
    /// Whether a document without it is refused.
    pub required: bool,
    /// Its value where it is not given; `None` where there is none.
    pub default: Option<toml::Value>,
    /// Its meaning.
    pub meaning: &'static str,
    /// Value, range and meaning on one line.
    #[serde(skip)]
    pub remark: String,
}

impl KeyEntry {
    fn new(document: Document, key: Key) -> Self {
        Self {
            document,
            remark: key.remark(),
            section: key.section,
            key: key.name,
            value: key.accepts.words().replace('`', ""),
            unit: Some(key.accepts.unit).filter(|unit| !unit.is_empty()),
            range: Some(key.accepts.range).filter(|range| !range.is_empty()),
            required: key.default == Without::Refused,
            default: key.default.typed(),
            meaning: key.meaning,
        }
    }

    /// The dotted path: section and name.
    #[must_use]
    pub fn path(&self) -> String {
        match self.section.as_str() {
            "" => self.key.to_owned(),
            section => format!("{section}.{}", self.key),
        }
    }
}

/// The keys of every document, or of those that `section` selects: a document, a section, or part of
/// a key's name.
///
/// # Errors
/// Nothing has that name: the names that there are.
pub fn keys(section: Option<&str>) -> Result<KeyList, String> {
    let all: Vec<KeyEntry> = Document::ALL
        .iter()
        .flat_map(|&document| {
            document
                .keys()
                .into_iter()
                .map(move |key| KeyEntry::new(document, key))
        })
        .collect();
    let Some(requested) = section else {
        return Ok(KeyList { keys: all });
    };
    let requested = requested.trim_matches(['[', ']']);
    let by_document = |entry: &KeyEntry| entry.document.name() == requested;
    let by_section = |entry: &KeyEntry| entry.section == requested;
    let by_name = |entry: &KeyEntry| entry.path().contains(requested);
    for chosen in [
        &by_document as &dyn Fn(&KeyEntry) -> bool,
        &by_section,
        &by_name,
    ] {
        let keys: Vec<KeyEntry> = all.iter().filter(|entry| chosen(entry)).cloned().collect();
        if !keys.is_empty() && !requested.is_empty() {
            return Ok(KeyList { keys });
        }
    }
    let mut names: Vec<String> = Document::ALL
        .iter()
        .map(|one| one.name().to_owned())
        .collect();
    for entry in all {
        if !entry.section.is_empty() && !names.contains(&entry.section) {
            names.push(entry.section);
        }
    }
    Err(format!(
        "no section and no key is called {requested:?}: expected part of a key's name, or one of {}",
        names.join(", ")
    ))
}
