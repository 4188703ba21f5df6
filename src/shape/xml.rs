//! XML of untrusted origin, one element after the other, with the line for messages.

use std::borrow::Cow;

use quick_xml::XmlVersion;
use quick_xml::escape::resolve_predefined_entity;
use quick_xml::events::{BytesRef, BytesStart, Event};
use quick_xml::name::{NamespaceError, ResolveResult};

use crate::read_error::{Place, ReadError};

/// Elements nested deeper than this belong to no surface.
const DEEPEST: usize = 256;

/// The next event in a document.
pub(super) enum Step<'a> {
    /// An element begins; an empty one ends with the next step.
    Start(Element<'a>),
    /// The innermost element ends, with all its own text.
    End {
        /// Its local name.
        name: String,
        /// Its own text, trimmed.
        text: String,
        /// As [`Element::is_foreign`].
        foreign: bool,
    },
    /// The document ends.
    Done,
}

/// An element's start.
pub(super) struct Element<'a> {
    start: BytesStart<'a>,
    foreign: bool,
}

impl<'a> Element<'a> {
    /// Its name without a prefix.
    pub(super) fn name(&self) -> &str {
        local(self.start.name().into_inner())
    }

    /// Whether it, or an element around it, is of another namespace than the document's first element.
    pub(super) fn is_foreign(&self) -> bool {
        self.foreign
    }

    /// The value of the attribute with this local name.
    pub(super) fn get(&self, requested: &str) -> Option<Cow<'_, str>> {
        self.find(|key| local(key) == requested)
    }

    /// The value of the attribute with this full name.
    pub(super) fn get_exact(&self, requested: &str) -> Option<Cow<'_, str>> {
        self.find(|key| key == requested)
    }

    fn find(&self, is: impl Fn(&str) -> bool) -> Option<Cow<'_, str>> {
        let mut attributes = self.start.attributes();
        let attributes = attributes.with_checks(false);
        let found = attributes
            .flatten()
            .find(|attribute| is(attribute.key.into_inner()))?;
        // With an entity that is not replaced it is shown as it is.
        let value = found.normalized_value(XmlVersion::Implicit1_0);
        Some(value.unwrap_or_else(|_| found.value.clone()))
    }
}

fn local(name: &str) -> &str {
    name.rsplit_once(':').map_or(name, |(_, local)| local)
}

/// An element that has not ended.
struct Open {
    name: String,
    text: String,
    foreign: bool,
}

/// A document, read once from beginning to end.
pub(super) struct Document<'a> {
    part: &'a str,
    text: &'a str,
    reader: quick_xml::NsReader<&'a [u8]>,
    /// The first element's namespace.
    namespace: Option<String>,
    open: Vec<Open>,
    /// The empty element that ends with the next step.
    ends: bool,
}

impl<'a> Document<'a> {
    /// A document's text; `part` names it in messages, empty for the file itself.
    pub(super) fn new(part: &'a str, text: &'a str) -> Self {
        Self {
            part,
            text,
            reader: quick_xml::NsReader::from_str(text),
            namespace: None,
            open: Vec::new(),
            ends: false,
        }
    }

    /// The next event.
    pub(super) fn step(&mut self) -> Result<Step<'a>, ReadError> {
        if std::mem::take(&mut self.ends) {
            return self.end();
        }
        loop {
            match self.reader.read_event() {
                Ok(Event::Start(start)) => {
                    let foreign = self.begin(&start)?;
                    return Ok(Step::Start(Element { start, foreign }));
                }
                Ok(Event::Empty(start)) => {
                    let foreign = self.begin(&start)?;
                    self.ends = true;
                    return Ok(Step::Start(Element { start, foreign }));
                }
                Ok(Event::End(_)) => return self.end(),
                Ok(Event::Text(text)) => self.add(&text),
                Ok(Event::CData(text)) => self.add(&text),
                Ok(Event::GeneralRef(name)) => self.add_reference(&name),
                Ok(Event::Eof) if self.open.is_empty() => return Ok(Step::Done),
                Ok(Event::Eof) => return Err(self.fault("the XML ends here: it was cut short")),
                Ok(_) => {}
                Err(quick_xml::Error::Namespace(NamespaceError::TooManyBindings(most))) => {
                    let what = format!(
                        "the XML names more than {most} namespaces; export it as a plain mesh"
                    );
                    return Err(self.fault(what));
                }
                Err(error) => return Err(self.fault(format!("the XML is damaged: {error}"))),
            }
        }
    }

    /// Notes an element that begins, and whether it is foreign.
    fn begin(&mut self, start: &BytesStart<'_>) -> Result<bool, ReadError> {
        if self.open.len() >= DEEPEST {
            return Err(self.fault(format!("elements are nested more than {DEEPEST} deep")));
        }
        // Passed over, a damaged one would be taken for one that is not there.
        if let Some(error) = start.attributes().with_checks(false).find_map(Result::err) {
            return Err(self.fault(format!("the XML is damaged: {error}")));
        }
        let namespace = match self.reader.resolver().resolve_element(start.name()).0 {
            ResolveResult::Bound(namespace) => Some(namespace.into_inner().to_owned()),
            ResolveResult::Unbound => None,
            ResolveResult::Unknown(prefix) => Some(prefix),
        };
        let foreign = match self.open.last() {
            Some(around) => around.foreign || namespace != self.namespace,
            None => {
                self.namespace = namespace;
                false
            }
        };
        self.open.push(Open {
            name: local(start.name().into_inner()).to_owned(),
            text: String::new(),
            foreign,
        });
        Ok(foreign)
    }

    /// A character by its number or by one of XML's five names. Others are not replaced, but what
    /// stands around them must not become a number without them.
    fn add_reference(&mut self, name: &BytesRef<'_>) {
        match (name.resolve_char_ref(), resolve_predefined_entity(name)) {
            (Ok(Some(letter)), _) => self.add(letter.encode_utf8(&mut [0; 4])),
            (_, Some(text)) => self.add(text),
            _ => self.add("\u{fffd}"),
        }
    }

    fn add(&mut self, text: &str) {
        if let Some(Open { text: own, .. }) = self.open.last_mut()
            && !(own.is_empty() && text.trim().is_empty())
        {
            own.push_str(text);
        }
    }

    fn end(&mut self) -> Result<Step<'a>, ReadError> {
        let Some(mut ended) = self.open.pop() else {
            return Err(self.fault("an element ends that did not begin"));
        };
        ended.text.truncate(ended.text.trim_end().len());
        Ok(Step::End {
            name: ended.name,
            text: ended.text,
            foreign: ended.foreign,
        })
    }

    /// A fault at the place that was read last.
    pub(super) fn fault(&self, what: impl Into<String>) -> ReadError {
        let at = usize::try_from(self.reader.buffer_position()).unwrap_or(usize::MAX);
        let before = &self.text.as_bytes()[..at.min(self.text.len())];
        let line = before.iter().filter(|b| **b == b'\n').count() + 1;
        ReadError::new(
            if self.part.is_empty() {
                Place::Line(line)
            } else {
                Place::Part(self.part.to_owned(), line)
            },
            what,
        )
    }
}
