//! Typed reading of a TOML document that collects every fault instead of stopping at the first.
//!
//! A section knows the keys it was queried for; [`Section::finish`] refuses all others. So a key
//! is declared where it is read, on one line, and nowhere else.
//!
//! A number at fault is reported once and then reads as NaN, which satisfies no comparison: the
//! checks that follow stay silent about it. Such a number never leaves the room, because a
//! document with an error yields no value.

use std::cell::{LazyCell, RefCell};
use std::ops::Range;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::diagnostics::{Fault, Faults, InvalidDocument, SHOWN_MAX, Severity};
use super::key::{Accepts, Assumed, Key, Keys, Without};
use super::message_text::{QUOTED_MAX, escaped, nearest, quoted};

/// A value and its bytes in the text (those of its section where it is a default).
#[derive(Debug, Clone, PartialEq)]
pub struct Located<T> {
    /// The value.
    pub value: T,
    /// Bytes of the source text.
    pub span: Range<usize>,
}

/// The faults so far, and the keys where they are listed.
#[derive(Debug, Default)]
pub struct Sink {
    faults: RefCell<Vec<Fault>>,
    assumed: RefCell<Vec<Assumed>>,
    keys: Option<Keys>,
    /// Every key of such documents, for advice.
    all_keys: Option<LazyCell<Vec<Key>>>,
}

impl Sink {
    /// Adds a fault.
    pub fn add(&self, fault: Fault) {
        self.faults.borrow_mut().push(fault);
    }

    /// The keys that have defaults because they were not written, in the order in which they were read.
    #[must_use]
    pub fn assumed(&self) -> Vec<Assumed> {
        self.assumed.borrow().clone()
    }

    /// True when one of the faults is an error.
    #[must_use]
    pub fn has_errors(&self) -> bool {
        self.faults
            .borrow()
            .iter()
            .any(|f| f.severity == Severity::Error)
    }
}

/// Of larger texts only the first syntax error is reported.
const EVERY_ERROR_BYTES: usize = 64 << 10;

/// Reads the document `text`, one of those with `all_keys`, with `read`, which takes the root section and the sink.
///
/// Returns the value and the warnings.
///
/// # Errors
/// Every fault of the document when one of them is an error; the syntax errors alone where the
/// text is not TOML, because what can be read of such a text misleads.
pub fn read_document<T>(
    text: &str,
    path: &Path,
    all_keys: fn() -> Vec<Key>,
    read: impl FnOnce(&mut Section<'_>, &Sink) -> Option<T>,
) -> Result<(T, Faults), InvalidDocument> {
    // A byte order mark would count as a column.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let (table, errors) = parsed(text);
    let sink = Sink {
        all_keys: Some(LazyCell::new(all_keys)),
        ..Sink::default()
    };
    match other_notation(text) {
        Some(fault) => sink.add(fault),
        None => errors
            .iter()
            .for_each(|error| sink.add(syntax_fault(error, text))),
    }
    let mut value = None;
    if !sink.has_errors() {
        let mut root = Section::root(table.get_ref(), &sink);
        value = read(&mut root, &sink);
        root.finish();
    }
    let refused = sink.has_errors();
    let faults = Faults::new(path, text, sink.faults.into_inner());
    match value {
        Some(value) if !refused => Ok((value, faults)),
        _ => Err(InvalidDocument { faults }),
    }
}

/// How a section is named to the user.
fn section_name(path: &str) -> String {
    match path {
        "" => "the top level".to_owned(),
        path => format!("[{path}]"),
    }
}

/// The keys that `read` asks for when it reads `text`, in their order and without meanings.
pub fn list_keys(text: &str, read: impl FnOnce(&mut Section<'_>)) -> Vec<Key> {
    let (table, _) = parsed(text);
    let sink = Sink {
        keys: Some(Keys::default()),
        ..Sink::default()
    };
    read(&mut Section::root(table.get_ref(), &sink));
    sink.keys.map_or_else(Vec::new, Keys::into_inner)
}

/// The document's table and its errors: every one of a text of usual size, the first of a large one,
/// which may have one for every byte.
fn parsed(text: &str) -> (Spanned<DeTable<'_>>, Vec<toml::de::Error>) {
    if text.len() > EVERY_ERROR_BYTES {
        return match DeTable::parse(text) {
            Ok(table) => (table, Vec::new()),
            Err(error) => (Spanned::new(0..0, DeTable::new()), vec![error]),
        };
    }
    DeTable::parse_recoverable(text)
}

/// The fault of a text of another kind, whose every line would be one.
fn other_notation(text: &str) -> Option<Fault> {
    let written = text.trim_start();
    let first = written.chars().next()?;
    let kind = match first {
        '{' => "this is JSON",
        '<' => "this is XML",
        _ => {
            let like_toml = |line: &str| line.contains('=') || line.starts_with(['[', '#']);
            if text.lines().map(str::trim).any(like_toml) {
                return None;
            }
            "no line of it gives a key a value"
        }
    };
    let start = text.len() - written.len();
    let fault =
        Fault::error("", format!("not a TOML file: {kind}")).at(&(start..start + first.len_utf8()));
    Some(fault.help("sections and keys look like [coil] and length_mm = 40.0"))
}

fn syntax_fault(error: &toml::de::Error, text: &str) -> Fault {
    let message = format!("not valid TOML: {}", escaped(error.message().trim(), 200));
    let span = error.span().unwrap_or(0..0);
    let fault = Fault::error("", message).at(&span);
    match slip_in_line(text, span.start) {
        Some(help) => fault.help(help),
        None => fault,
    }
}

/// Advice for a line of another notation: `length_mm = 40,5` or `length_mm = 40.5;`.
fn slip_in_line(text: &str, at: usize) -> Option<String> {
    let at = (0..=at.min(text.len()))
        .rev()
        .find(|at| text.is_char_boundary(*at))?;
    let start = text[..at].rfind('\n').map_or(0, |end| end + 1);
    let line = text[start..].lines().next()?;
    let (key, value) = line.split_once('=')?;
    let (key, value) = (key.trim(), value.split('#').next()?.trim());
    let plain = value.trim_end_matches([';', ',']).trim_end();
    if plain.parse::<f64>().is_ok() && plain != value {
        return Some(format!(
            "write {key} = {plain}, with nothing behind the number"
        ));
    }
    let point = plain.replacen(',', ".", 1);
    let decimal = point != plain && point.parse::<f64>().is_ok();
    if decimal {
        return Some(format!("write a decimal point: {key} = {point}"));
    }
    // A number and its unit.
    let number = plain.split(char::is_whitespace).next()?;
    let unit = plain.strip_prefix(number)?.trim();
    (number.parse::<f64>().is_ok() && unit.chars().all(char::is_alphabetic) && !unit.is_empty())
        .then(|| format!("write {key} = {number}: the unit is in the key's name"))
}

/// One table of the document.
#[derive(Debug)]
pub struct Section<'a> {
    pub(super) sink: &'a Sink,
    pub(super) path: String,
    span: Range<usize>,
    table: Option<&'a DeTable<'a>>,
    known: Vec<&'static str>,
}

/// A value of the document and its place.
pub(super) type ValueRef<'a> = &'a Spanned<DeValue<'a>>;

impl<'a> Section<'a> {
    fn root(table: &'a DeTable<'a>, sink: &'a Sink) -> Self {
        Self {
            sink,
            path: String::new(),
            span: 0..0,
            table: Some(table),
            known: Vec::new(),
        }
    }

    /// The table `name` of this one; absent tables read as empty ones.
    pub fn section(&mut self, name: &'static str) -> Section<'a> {
        let found = self.found(name);
        let table = found.and_then(|value| match value.get_ref() {
            DeValue::Table(table) => Some(table),
            _ => {
                self.add_wrong_type(&self.path_of(name), value, &format!("a section [{name}]"));
                None
            }
        });
        Section {
            sink: self.sink,
            path: self.path_of(name),
            span: found.map_or(self.span.clone(), Spanned::span),
            table,
            known: Vec::new(),
        }
    }

    /// The tables `[[name]]` of this one; a single `[name]` is one of them.
    pub fn sections(&mut self, name: &'static str) -> Vec<Section<'a>> {
        let Some(found) = self.found(name) else {
            return Vec::new();
        };
        if matches!(found.get_ref(), DeValue::Table(_)) {
            return vec![self.section(name)];
        }
        let DeValue::Array(tables) = found.get_ref() else {
            self.add_wrong_type(&self.path_of(name), found, &format!("sections [[{name}]]"));
            return Vec::new();
        };
        let section = |(number, table): (usize, ValueRef<'a>)| {
            let path = match &self.sink.keys {
                Some(_) => self.path_of(name),
                None => format!("{}[{number}]", self.path_of(name)),
            };
            let DeValue::Table(of) = table.get_ref() else {
                self.add_wrong_type(&path, table, &format!("a section [[{name}]]"));
                return None;
            };
            Some(Section {
                sink: self.sink,
                path,
                span: table.span(),
                table: Some(of),
                known: Vec::new(),
            })
        };
        tables.iter().enumerate().filter_map(section).collect()
    }

    /// True when the document has this table.
    #[must_use]
    pub fn is_present(&self) -> bool {
        self.table.is_some()
    }

    /// True when the document has `key` here, whatever its value.
    #[must_use]
    pub fn has(&self, key: &str) -> bool {
        self.table.is_some_and(|table| table.contains_key(key))
    }

    /// Where this table begins.
    #[must_use]
    pub fn span(&self) -> Range<usize> {
        self.span.clone()
    }

    /// The dotted path of `key`.
    #[must_use]
    pub(crate) fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    /// The bytes of `key`'s value, or of the section where it is absent.
    #[must_use]
    pub(crate) fn span_of(&self, key: &str) -> Range<usize> {
        let found = self.table.and_then(|table| table.get(key));
        found.map_or(self.span.clone(), Spanned::span)
    }

    /// Adds a fault at `key`.
    pub fn fault(&self, key: &str, message: impl Into<String>, help: &str) {
        self.sink.add(
            Fault::error(self.path_of(key), message)
                .at(&self.span_of(key))
                .help(help),
        );
    }

    /// Reports that the required `key` is absent.
    pub fn missing(&self, key: &str, help: &str) {
        let fault = Fault::error(self.path_of(key), "this key is required and missing");
        self.sink.add(fault.at(&self.span).help(help));
    }

    /// Lists a key, where keys are listed: what may be written, and what holds without it.
    pub(super) fn list(
        &self,
        name: &'static str,
        accepts: impl FnOnce() -> Accepts,
        default: impl FnOnce() -> Without,
    ) {
        if let Some(keys) = &self.sink.keys {
            keys.add(Key {
                section: self.path.clone(),
                name,
                accepts: accepts(),
                default: default(),
                meaning: "",
            });
        }
    }

    /// Records that `key` is not written and has `value`, as TOML, by default.
    pub(super) fn assume(&self, key: &str, value: impl Into<String>) {
        self.sink.assumed.borrow_mut().push(Assumed {
            key: self.path_of(key),
            value: value.into(),
        });
    }

    /// Records that this whole section is not written.
    pub(super) fn assume_whole(&self, value: impl Into<String>) {
        self.sink.assumed.borrow_mut().push(Assumed {
            key: self.path.clone(),
            value: value.into(),
        });
    }

    /// Accepts `keys` without reading them.
    pub fn ignore(&mut self, keys: &[&'static str]) {
        self.known.extend(keys);
    }

    /// Refuses the keys that were never queried.
    pub fn finish(self) {
        let Some(table) = self.table else { return };
        let keys = table.keys();
        let mut unknown: Vec<_> = keys
            .filter(|key| !self.known.contains(&&**key.get_ref()))
            .collect();
        unknown.sort_by_key(|key| key.span().start);
        for (number, key) in unknown.into_iter().enumerate() {
            let mut fault = self.unknown(key.get_ref()).at(&key.span());
            // Faults are shown in this order; advice takes far longer than the rest.
            if number < SHOWN_MAX {
                fault = fault.help(self.advice(key.get_ref()));
            }
            self.sink.add(fault);
        }
    }

    fn unknown(&self, name: &str) -> Fault {
        let place = section_name(&self.path);
        Fault::error(
            self.path_of(&escaped(name, QUOTED_MAX)),
            format!("unknown key {} in {place}", quoted(name)),
        )
    }

    /// What an unknown key may have been meant to be.
    fn advice(&self, name: &str) -> String {
        if let Some(near) = nearest(name, &self.known) {
            return format!("did you mean {near}?");
        }
        let homes = self.sections_with(name);
        let known = format!("known here: {}", self.known.join(", "));
        if homes.is_empty() {
            known
        } else if homes.contains(&section_name(&self.path)) {
            format!("it does not go with the other keys here; {known}")
        } else {
            format!("it is a key of {}; {known}", homes.join(", "))
        }
    }

    /// The sections that have a key of this `name`.
    fn sections_with(&self, name: &str) -> Vec<String> {
        let all = self.sink.all_keys.as_deref().into_iter().flatten();
        let homes = all.filter(|key| key.name == name);
        homes.map(|key| section_name(&key.section)).collect()
    }

    pub(super) fn found(&mut self, key: &'static str) -> Option<ValueRef<'a>> {
        if !self.known.contains(&key) {
            self.known.push(key);
        }
        self.table?.get(key)
    }
}
